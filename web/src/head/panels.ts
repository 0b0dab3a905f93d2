/** What stands behind the buttons of the head: metrics, configuration, facts and keys. */

import { copy, select } from "../clipboard.ts";
import { button, dialog, el } from "../dom.ts";
import { KEYS } from "../keys.ts";
import { shown } from "../numbers.ts";
import type { Header } from "../report.ts";
import { badge } from "./verdict.ts";

function cell(value: number | string | null): HTMLElement {
  return typeof value === "string" ? el("td", {}, value) : el("td", { class: "number", title: value === null ? "not there" : String(value) }, shown(value));
}

export function metricsDialog({ metrics }: Header): HTMLDialogElement {
  if (metrics.rows.length === 0) return dialog("Metrics", el("p", {}, "This run carries no metrics."));
  const head = ["metric", ...metrics.columns, "unit", "what it says"].map((name) => el("th", { scope: "col" }, name));
  const rows = metrics.rows.map((row) =>
    el("tr", {}, el("th", { scope: "row" }, row.name), ...row.values.map(cell), el("td", {}, row.unit), el("td", { class: "meaning" }, row.meaning)),
  );
  return dialog("Metrics", el("table", { class: "metrics" }, el("thead", {}, el("tr", {}, ...head)), el("tbody", {}, ...rows)));
}

export function configurationDialog({ configuration }: Header): HTMLDialogElement {
  const text = el("pre", { class: "configuration", tabindex: "0" }, configuration);
  const said = el("span", { role: "status" });
  const copying = button("copy", "copy the configuration to the clipboard", () => {
    void copy(configuration, text).then((done) => {
      said.textContent = done ? "copied" : "selected: press Ctrl+C (or ⌘C) to copy";
    });
  });
  const selecting = button("select all", "select the text of the configuration", () => select(text));
  return dialog("Configuration", el("p", { class: "actions" }, copying, selecting, said), text);
}

export function factsDialog({ facts, verdict, notices, thinning, made_by, title }: Header): HTMLDialogElement {
  const list = el("dl", { class: "facts-list" }, ...facts.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
  const parts: (HTMLElement | null)[] = [
    verdict && el("p", {}, badge(verdict), " ", verdict.sentence),
    verdict?.remedy ? el("p", {}, el("b", {}, "What helps: "), verdict.remedy) : null,
    ...notices.map((notice) => el("p", { class: "notice" }, notice)),
    list,
    thinning ? el("p", { class: "fine" }, `Curves: ${thinning}`) : null,
    el("p", { class: "fine" }, `Made by ${made_by}. Viewer built with three.js and uPlot (MIT licence).`),
  ];
  return dialog(title, ...parts);
}

export function keysDialog(): HTMLDialogElement {
  const rows = KEYS.map(([keys, does]) => el("tr", {}, el("th", { scope: "row" }, ...keys.map((key) => el("kbd", {}, key))), el("td", {}, does)));
  const hands = [
    "In a diagram: click to go to that time, drag to zoom all diagrams, double click to show all times; drag a finger to move the play time.",
    "Click a name in a legend to hide its curve, with shift to see it alone. Point at a diagram to read all curves there; else they are read at the play time. The distance from the play time to the pointer stands beside it: from peak to peak it is a period.",
    "In the scene: drag to orbit, wheel or pinch to zoom, right drag or two fingers to shift.",
  ];
  return dialog("Keys and hands", el("table", { class: "keys" }, el("tbody", {}, ...rows)), ...hands.map((text) => el("p", {}, text)));
}
