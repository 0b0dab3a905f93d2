/** All diagrams of the page on one timeline. */

import type { Panel } from "../data.ts";
import { button, el } from "../dom.ts";
import type { Theme } from "../theme.ts";
import type { Timeline } from "../timeline.ts";
import { Slot } from "./slot.ts";
import { Window } from "./window.ts";

export const KINDS = ["energy", "port", "tracking", "torque", "contact"];

/** Least time between two writings of the values while the run plays [ms]: faster than this nobody reads. */
const READING = 120;

export class Plots {
  readonly element = el("div", { class: "plots" });
  readonly window: Window;
  #slots: Slot[] = [];
  #timeline: Timeline;
  #read = -Infinity;
  #asked = false;

  constructor(panels: Panel[], theme: Theme, timeline: Timeline) {
    this.#timeline = timeline;
    this.window = new Window(timeline.start, timeline.end);
    const others = panels.map((panel) => panel.kind).filter((kind) => !KINDS.includes(kind));
    for (const kind of new Set([...KINDS, ...others])) {
      const own = panels.filter((panel) => panel.kind === kind);
      if (own.length === 0) continue;
      const enlarge: HTMLButtonElement = button("⤢", `enlarge ${kind}`, () => this.#enlarge(kind, enlarge), "quiet");
      enlarge.setAttribute("aria-pressed", "false");
      const slot = new Slot(kind, own, theme, timeline, this.window, enlarge);
      this.#slots.push(slot);
      this.element.append(slot.element);
    }
    if (this.#slots.length === 0) this.element.append(el("p", { class: "missing" }, "This report holds no curves."));
    const whole = button("show all times", "show the whole run in all diagrams (z, or double click)", () => this.window.reset(), "whole");
    whole.hidden = true;
    this.element.append(whole);
    this.window.onZoom(() => {
      whole.hidden = this.window.whole;
      this.#slots.forEach((slot) => slot.zoomed());
    });
    this.window.onPoint(() => this.#refresh(true));
    timeline.onMove(() => this.#refresh(!timeline.playing));
    timeline.onChange(() => this.#refresh(true));
    theme.onChange(() => this.draw());
  }

  /** Draw all diagrams; the element must be on the page. */
  draw(): void {
    this.#slots.forEach((slot) => slot.draw());
    this.#refresh(true);
  }

  #enlarge(kind: string, by: HTMLButtonElement): void {
    const large = by.getAttribute("aria-pressed") === "false";
    by.setAttribute("aria-pressed", String(large));
    this.element.classList.toggle("one", large);
    for (const slot of this.#slots) slot.element.hidden = large && slot.kind !== kind;
  }

  /** Move the lines with the next picture; write the values too, at once or when they are old. */
  #refresh(now: boolean): void {
    if (now) this.#read = -Infinity;
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame((clock) => {
      this.#asked = false;
      const due = clock - this.#read >= READING || !this.#timeline.playing;
      if (due) this.#read = clock;
      for (const slot of this.#slots) {
        if (slot.element.hidden) continue;
        slot.moved();
        if (due) slot.read();
      }
    });
  }
}
