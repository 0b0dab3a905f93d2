/** What a hand does on a diagram: a click seeks, a drag of the mouse zooms, a drag of a finger moves the play time. */

import type uPlot from "uplot";
import type { Timeline } from "../timeline.ts";
import type { Window } from "./window.ts";

/** Way of the pointer [px] up to which it is a click and no drag. */
const STILL = 5;

export function listen(plot: uPlot, timeline: Timeline, window: Window): void {
  const { over } = plot;
  let pressed: number | null = null;
  const timeAt = (event: PointerEvent | MouseEvent) => plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
  over.addEventListener("pointerdown", (event) => {
    pressed = event.clientX;
  });
  over.addEventListener("pointermove", (event) => {
    if (event.pointerType !== "touch") window.point(timeAt(event));
    else if (pressed !== null && Math.abs(event.clientX - pressed) > STILL) {
      timeline.pause();
      timeline.seek(timeAt(event));
    }
  });
  over.addEventListener("pointerleave", () => window.point(null));
  over.addEventListener("pointercancel", () => {
    pressed = null;
  });
  over.addEventListener("click", (event) => {
    if (pressed !== null && Math.abs(event.clientX - pressed) <= STILL && event.detail < 2) timeline.seek(timeAt(event));
    pressed = null;
  });
  over.addEventListener("dblclick", () => window.reset());
}
