/** The curves of a diagram by name, with the value of each at one time; a click takes a curve away or brings it back. */

import type { Panel } from "../data.ts";
import { el, say } from "../dom.ts";
import { beside, shown, withUnit } from "../numbers.ts";
import { readAt } from "../sampling.ts";
import type { Look } from "../theme.ts";
import { extent } from "./ranges.ts";

/** So many names stand in one column, and so short ones in two [characters]. */
const FEW = 4;
const SHORT = 9;

export class Legend {
  readonly element = el("ul", { class: "legend" });
  #panel: Panel | null = null;
  #values: HTMLElement[] = [];
  /** Whether there are two columns, with less room for digits. */
  #two = false;
  /** Largest magnitude of all curves: what is small beside it is noise. */
  #scale = 0;

  /** @param toggle what to do when curve i is switched, or to be seen alone */
  show(panel: Panel, looks: Look[], hidden: ReadonlySet<string>, toggle: (curve: number, alone: boolean) => void): void {
    this.#panel = panel;
    this.#values = [];
    this.#scale = Math.max(...(extent(panel.curves) ?? [0]).map(Math.abs));
    // Many short names stand in two columns: what is out of sight is not looked for.
    this.#two = this.element.classList.toggle("two", panel.curves.length > FEW && panel.curves.every((curve) => curve.label.length <= SHORT));
    const rows = panel.curves.map((curve, i) => {
      const value = el("span", { class: "value" });
      this.#values.push(value);
      const row = el(
        "button",
        { type: "button", "aria-pressed": String(!hidden.has(curve.label)), title: `${curve.label}: show or hide; with shift: this one alone, or all` },
        swatch(looks[i]!),
        el("span", { class: "name" }, curve.label),
        value,
      );
      row.addEventListener("click", (event) => {
        toggle(i, event.shiftKey);
        rows.forEach((item, k) => item.firstElementChild!.setAttribute("aria-pressed", String(!hidden.has(panel.curves[k]!.label))));
        if (event.detail > 0) row.blur();
      });
      return el("li", {}, row);
    });
    this.element.replaceChildren(...rows);
  }

  /** Write the values at time t [s]. */
  read(t: number): void {
    const panel = this.#panel;
    if (!panel) return;
    panel.curves.forEach((curve, i) => {
      const value = readAt(curve.x, curve.y, t);
      say(this.#values[i]!, value === null ? shown(null) : this.#two ? beside(value, this.#scale) : withUnit(value, panel.unit, 4, this.#scale));
    });
  }
}

const SVG = "http://www.w3.org/2000/svg";

/** A short piece of a line as it is drawn. */
export function swatch(look: Look): SVGSVGElement {
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("viewBox", "0 0 22 8");
  picture.setAttribute("class", "swatch");
  picture.setAttribute("aria-hidden", "true");
  const line = document.createElementNS(SVG, "line");
  const attributes = { x1: 1, x2: 21, y1: 4, y2: 4, stroke: look.color, "stroke-width": Math.max(look.width, 1.5), "stroke-dasharray": look.dash.join(" ") };
  for (const [name, value] of Object.entries(attributes)) line.setAttribute(name, String(value));
  picture.append(line);
  return picture;
}
