/** The foot of the page: play, speed, and the time with the marks of the run on it. */

import { button, el, say } from "./dom.ts";
import { clock, shown } from "./numbers.ts";
import type { Header } from "./report.ts";
import { SPEEDS, type Timeline } from "./timeline.ts";

export function makeTransport(header: Header, timeline: Timeline, contact: ((t: number) => number | null) | null, goWorst: () => void): HTMLElement {
  const play = button("▶", "play (space)", () => timeline.toggle(), "play");
  const speed = el("select", { class: "speed", "aria-label": "speed" });
  for (const value of SPEEDS) speed.append(el("option", { value }, `${value}×`));
  speed.addEventListener("change", () => timeline.setSpeed(Number(speed.value)));
  const time = el("output", { class: "now" });
  const felt = contact && el("output", { class: "felt", title: "force of what the hand touches" });
  const slider = el("input", { type: "range", class: "time", min: timeline.start, max: timeline.end, step: "any", "aria-label": "time of the run [s]" });
  slider.addEventListener("input", () => timeline.seek(Number(slider.value)));
  const span = Math.max(timeline.end - timeline.start, 1e-9);
  const share = (t: number) => `${(100 * Math.min(Math.max((t - timeline.start) / span, 0), 1)).toFixed(3)}%`;
  const track = el("div", { class: "track", "aria-hidden": "true" });
  for (const { start, end, kind, label } of header.spans) {
    const band = el("i", { class: `band ${kind}`, title: label });
    band.style.left = share(start);
    band.style.width = `max(2px, ${((100 * (Math.min(end, timeline.end) - start)) / span).toFixed(3)}%)`;
    track.append(band);
  }
  for (const { time: at, label } of header.marks) {
    const tick = el("i", { class: "tick", title: `${label}, ${clock(at)} s` });
    tick.style.left = share(at);
    track.append(tick);
  }
  const worst = header.verdict?.worst_time ?? null;
  if (worst !== null) {
    const tick = el("i", { class: "tick worst-tick", title: `worst moment, ${clock(worst)} s` }, "▼");
    tick.style.left = share(worst);
    track.append(tick);
  }
  const move = () => {
    const t = timeline.time;
    slider.value = String(t);
    slider.setAttribute("aria-valuetext", `${clock(t)} seconds`);
    say(time, `${clock(t)} s`);
    if (!felt) return;
    const force = contact(t);
    say(felt, force === null ? "no contact" : `contact ${shown(force, 3)} N`);
  };
  const change = () => {
    say(play, timeline.playing ? "❚❚" : "▶");
    play.setAttribute("aria-label", timeline.playing ? "pause (space)" : "play (space)");
    play.title = play.getAttribute("aria-label")!;
    if (!SPEEDS.includes(timeline.speed) && ![...speed.options].some((o) => Number(o.value) === timeline.speed)) {
      speed.append(el("option", { value: timeline.speed }, `${timeline.speed}×`));
    }
    speed.value = String(timeline.speed);
  };
  timeline.onMove(move);
  timeline.onChange(change);
  move();
  change();
  return el(
    "footer",
    { class: "transport" },
    play,
    speed,
    time,
    felt,
    el("div", { class: "rail" }, track, slider),
    el("span", { class: "total" }, `of ${clock(timeline.end)} s`),
    jumps(header, timeline, worst === null ? null : goWorst),
  );
}

/** A list of the events of the run to jump to. */
function jumps(header: Header, timeline: Timeline, goWorst: (() => void) | null): HTMLElement | null {
  const places: [string, () => void][] = header.marks.map((mark) => [`${clock(mark.time)} s: ${mark.label}`, () => timeline.seek(mark.time)]);
  const first = header.verdict?.verdict === "violated" ? header.verdict.time : null;
  if (first !== null) places.unshift([`${clock(first)} s: first overdraft`, () => timeline.seek(first)]);
  if (goWorst) places.unshift(["worst moment", goWorst]);
  if (places.length === 0) return null;
  const list = el("select", { class: "jumps", "aria-label": "jump to an event of the run" }, el("option", { value: "" }, "jump to …"));
  places.forEach(([words], i) => list.append(el("option", { value: i }, words)));
  list.addEventListener("change", () => {
    if (list.value !== "") places[Number(list.value)]![1]();
    list.value = "";
    list.blur();
  });
  return list;
}
