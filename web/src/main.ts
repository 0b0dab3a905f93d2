/** The viewer of a passiflex report: reads the data of the page and builds what is seen. */

import { makeApi } from "./api.ts";
import { readReport, ReportError } from "./data.ts";
import { el } from "./dom.ts";
import { complain, watchErrors } from "./failure.ts";
import { makeHead } from "./head/head.ts";
import { listenToKeys } from "./keys.ts";
import { tipError } from "./kinematics.ts";
import { contactForce } from "./motion.ts";
import { Plots } from "./plots/group.ts";
import { SceneView } from "./scene/view.ts";
import { Theme } from "./theme.ts";
import { Timeline } from "./timeline.ts";
import { makeTransport } from "./transport.ts";

/** Largest distance [m] between the drawn tip and the recorded one that round-off explains. */
const TIP_TOLERANCE = 1e-5;

/** What is seen to each side of the worst moment when one goes there once more [s]; every row of it is on the page. */
const CLOSE_UP = 0.25;

/** The time [s] a fragment `#t=12.5` names. */
function fragmentTime(): number {
  const text = new URLSearchParams(location.hash.slice(1)).get("t");
  return text === null || text === "" ? NaN : Number(text);
}

/** Paper is white: what is drawn for a dark page could not be read on it. */
function printInLight(theme: Theme): void {
  let before: typeof theme.tone | null = null;
  addEventListener("beforeprint", () => {
    before = theme.tone;
    theme.set("light");
  });
  addEventListener("afterprint", () => {
    if (before) theme.set(before);
  });
}

async function start(): Promise<void> {
  const place = document.getElementById("app") ?? document.body.appendChild(el("div", { id: "app" }));
  place.replaceChildren(el("p", { class: "missing" }, "Unpacking the report …"));
  const report = await readReport(document);
  const { header, frames } = report;
  const theme = new Theme(header.styles);
  const timeline = new Timeline(frames.time);
  const goWorst = () => {
    const worst = header.verdict?.worst_time ?? null;
    if (worst === null) return;
    timeline.pause();
    if (timeline.time === worst) plots.window.zoom(worst - CLOSE_UP, worst + CLOSE_UP);
    timeline.seek(worst);
  };
  if (header.arm) {
    const error = tipError(header.arm, frames);
    if (error > TIP_TOLERANCE) {
      header.notices.push(`The drawn arm misses the recorded end effector by up to ${(1000 * error).toPrecision(3)} mm: trust the curves, not the picture.`);
    }
  }
  const contact = report.surfaces.length > 0 ? (t: number) => contactForce(report.surfaces, frames, t) : null;
  const head = makeHead(report, theme, goWorst);
  const scene = new SceneView(report, theme, timeline);
  const plots = new Plots(report.panels, theme, timeline);
  place.replaceChildren(head.element, el("main", {}, scene.element, plots.element), makeTransport(header, timeline, contact, goWorst));
  scene.start();
  plots.draw();
  listenToKeys(timeline, {
    worst: goWorst,
    keys: head.showKeys,
    whole: () => scene.whole(),
    closeUp: () => scene.closeUp(),
    follow: () => scene.toggleFollow(),
    allTimes: () => plots.window.reset(),
    zoom: (factor) => plots.window.scale(timeline.time, factor),
  });
  printInLight(theme);
  timeline.seek(fragmentTime());
  addEventListener("hashchange", () => timeline.seek(fragmentTime()));
  window.passiflex = makeApi(report, timeline, plots.window, scene);
}

watchErrors();
start().catch((error: unknown) => {
  document.getElementById("app")?.replaceChildren();
  if (error instanceof ReportError) complain(error.message);
  else complain(`The report cannot be shown: ${error instanceof Error ? error.message : String(error)}`);
});
