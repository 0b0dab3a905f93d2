/** The head of the page: what was run, what came out, and the buttons. */

import { download } from "../clipboard.ts";
import { csvOf } from "../csv.ts";
import type { Report } from "../data.ts";
import { button, el } from "../dom.ts";
import type { Theme } from "../theme.ts";
import { configurationDialog, factsDialog, keysDialog, metricsDialog } from "./panels.ts";
import { badge, worstButton } from "./verdict.ts";

/** A file name from a title: letters, digits and a few signs. */
export function fileName(title: string): string {
  const plain = title.normalize("NFKD").replace(/[^A-Za-z0-9._-]+/g, "_").replace(/^[_.]+|_+$/g, "");
  return `${plain.slice(0, 80) || "report"}.csv`;
}

export interface Head {
  element: HTMLElement;
  /** Open the list of keys. */
  showKeys: () => void;
}

/** @param goWorst what the button to the worst moment does */
export function makeHead(report: Report, theme: Theme, goWorst: () => void): Head {
  const { header } = report;
  const { verdict, notices } = header;
  const dialogs = { facts: factsDialog(header), metrics: metricsDialog(header), configuration: configurationDialog(header), keys: keysDialog() };
  const opener = (text: string, label: string, box: HTMLDialogElement, className = "") => button(text, label, () => box.showModal(), className);
  const tone = button("◐", "dark or light", () => theme.set(theme.tone === "dark" ? "light" : "dark"), "icon");
  const buttons = el(
    "div",
    { class: "buttons", role: "toolbar", "aria-label": "report" },
    opener(notices.length > 0 ? `facts, ${notices.length} notice${notices.length > 1 ? "s" : ""}` : "facts", "what was run and what came out", dialogs.facts, notices.length > 0 ? "facts-button warned" : "facts-button"),
    opener("metrics", "the table of metrics", dialogs.metrics),
    opener("configuration", "the resolved configuration, to read and to copy", dialogs.configuration, "configuration-button"),
    button("download data", "the curves and the motion of this page as CSV", () => download(fileName(header.title), csvOf(report), "text/csv"), "download-button"),
    tone,
    opener("?", "keys and hands (?)", dialogs.keys, "icon"),
  );
  const said: [string, string][] = header.thinning ? [...header.facts, ["curves", header.thinning]] : header.facts;
  const chips = said.map(([name, value]) => el("div", { class: "chip" }, el("dt", {}, name), el("dd", {}, value)));
  const sentence = verdict && el("p", { class: "sentence", title: verdict.remedy || verdict.sentence }, verdict.sentence, verdict.remedy ? el("span", { class: "remedy" }, ` What helps: ${verdict.remedy}`) : null);
  const element = el(
    "header",
    { class: "head" },
    el("div", { class: "title-row" }, el("h1", { title: header.title }, header.title), verdict ? badge(verdict) : null, worstButton(verdict, goWorst), buttons),
    sentence,
    el("dl", { class: "facts" }, ...chips),
    ...notices.map((notice) => el("p", { class: "notice", role: "note" }, el("span", { "aria-hidden": "true" }, "⚠ "), notice)),
    ...Object.values(dialogs),
  );
  return { element, showKeys: () => dialogs.keys.showModal() };
}
