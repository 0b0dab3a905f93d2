/** How much the deflection of the joints is magnified, and what it truly is. */

import { el, say } from "../dom.ts";
import { largestDeflection, magnification } from "../kinematics.ts";
import { fixed, shown } from "../numbers.ts";
import type { Report } from "../data.ts";
import type { Moment } from "../motion.ts";

/** Largest deflection in the picture with the factor of the start [rad, m]. */
const TARGET = { turn: 0.9, shift: 0.1 };

export class Magnifier {
  readonly element: HTMLDetailsElement;
  #factor = 1;
  #slider = el("input", { type: "range", min: 0, max: 3, step: 0.05, "aria-label": "magnification of the joint deflection" });
  #label = el("output", {});
  #summary = el("summary", {});
  #rows: { row: HTMLElement; gap: HTMLElement }[] = [];
  #units: string[];

  constructor(report: Report, changed: () => void) {
    const { arm } = report.header;
    this.#units = Array.from({ length: report.frames.q.columns }, (_, i) => (arm?.joints[i]?.kind === "prismatic" ? "m" : "rad"));
    const largest = largestDeflection(arm, report.frames, false);
    this.#slider.addEventListener("input", () => {
      this.set(10 ** Number(this.#slider.value));
      changed();
    });
    const body = el("tbody");
    this.#units.forEach((_, i) => {
      const gap = el("td");
      const row = el("tr", { title: arm?.joints[i]?.name ?? "" }, el("th", { scope: "row" }, `joint ${i + 1}`), gap);
      this.#rows.push({ row, gap });
      body.append(row);
    });
    const unit = this.#units.includes("m") ? "mrad, mm" : "mrad";
    const head = el("tr", {}, el("th", { scope: "col" }, "true"), el("th", { scope: "col" }, `θ − q [${unit}]`));
    this.element = el(
      "details",
      { class: "pane magnifier" },
      this.#summary,
      el("label", { class: "factor" }, el("span", {}, "θ − q drawn"), this.#label),
      this.#slider,
      el("table", {}, el("thead", {}, head), body),
    );
    const shift = largestDeflection(arm, report.frames, true);
    const factors = [magnification(largest, TARGET.turn), magnification(shift, TARGET.shift)];
    this.set(largest > 0 && shift > 0 ? Math.min(...factors) : Math.max(...factors));
  }

  get factor(): number {
    return this.#factor;
  }

  set(factor: number): void {
    this.#factor = Math.min(Math.max(factor, 1), 1000);
    this.#slider.value = String(Math.log10(this.#factor));
    const text = `${shown(this.#factor, this.#factor < 10 ? 2 : 3)}×`;
    say(this.#label, text);
    say(this.#summary, `joint deflection ${text}`);
  }

  /** Write the deflections of a moment. */
  read(moment: Moment): void {
    this.#rows.forEach(({ gap }, i) => say(gap, fixed(1000 * (moment.theta[i]! - moment.q[i]!), 3)));
  }

  /** Say of one joint that it is meant; null: of none. */
  point(joint: number | null): void {
    this.#rows.forEach(({ row }, i) => row.classList.toggle("meant", i === joint));
  }

  /** A sentence on joint i for a tip beside the pointer. */
  sentence(moment: Moment, i: number): string {
    const unit = this.#units[i]!;
    const gap = moment.theta[i]! - moment.q[i]!;
    return `joint ${i + 1}: q = ${shown(moment.q[i])} ${unit}, θ = ${shown(moment.theta[i])} ${unit}, θ − q = ${shown(gap, 3)} ${unit} (drawn ${shown(this.#factor, 3)}×)`;
  }
}
