/** The floor: a grid in metres with its scale and the axes of the world. */

import { Color, Group, LineBasicMaterial, LineSegments, BufferGeometry, Float32BufferAttribute } from "three";
import { fixed } from "../numbers.ts";
import type { Theme } from "../theme.ts";
import type { Stage, Tag } from "./stage.ts";

/** Spacing [m] of the lines for a floor of this half width [m]: 1, 2 or 5 times a power of ten. */
export function spacing(half: number): number {
  const raw = half / 5;
  const decade = 10 ** Math.floor(Math.log10(raw));
  return ([1, 2, 5].find((m) => m * decade >= raw * 0.999) ?? 10) * decade;
}

/** Lines between each two of these points [m]. */
export function lines(points: number[], material: LineBasicMaterial): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
  return new LineSegments(geometry, material);
}

export class Floor {
  readonly group = new Group();
  #grid = new LineBasicMaterial({ transparent: true, opacity: 0.6 });
  #axes = ["x", "y", "z"].map(() => new LineBasicMaterial());
  #tags: Tag[] = [];

  /**
   * @param reach how far the arm reaches [m]
   * @param middle of the floor [m]; it is shifted to the next crossing of lines
   */
  constructor(stage: Stage, reach: number, middle: [number, number, number]) {
    const step = spacing(reach);
    const [x0, y0] = [Math.round(middle[0] / step) * step, Math.round(middle[1] / step) * step];
    this.group.position.set(x0, y0, middle[2]);
    const count = Math.ceil(reach / step);
    const half = count * step;
    const points: number[] = [];
    for (let i = -count; i <= count; i++) points.push(i * step, -half, 0, i * step, half, 0, -half, i * step, 0, half, i * step, 0);
    this.group.add(lines(points, this.#grid));
    const length = 0.8 * step;
    const at = [-step, -2 * step];
    const ends = [[length, 0, 0], [0, length, 0], [0, 0, length]];
    ends.forEach((end, i) => {
      const line = lines([at[0]!, at[1]!, 0, at[0]! + end[0]!, at[1]! + end[1]!, end[2]!], this.#axes[i]!);
      this.group.add(line);
      this.#tag(stage, "xyz"[i]!, [at[0]! + 1.15 * end[0]!, at[1]! + 1.15 * end[1]!, 1.15 * end[2]!]);
    });
    const unit = (metres: number) => `${fixed(metres, Math.max(0, -Math.floor(Math.log10(step))))} m`;
    for (const k of [-1, 0, 1]) {
      this.#tag(stage, unit(x0 + k * step), [k * step, -half - 0.25 * step, 0]);
      this.#tag(stage, unit(y0 + k * step), [half + 0.25 * step, k * step, 0]);
    }
  }

  #tag(stage: Stage, text: string, point: number[]): void {
    const tag = stage.tag("scale");
    tag.element.textContent = text;
    tag.point.set(point[0]!, point[1]!, point[2]!).add(this.group.position);
    this.#tags.push(tag);
  }

  show(seen: boolean): void {
    this.group.visible = seen;
    for (const tag of this.#tags) tag.shown = seen;
  }

  paint(theme: Theme): void {
    this.#grid.color = new Color(theme.css("--floor"));
    ["--axis-x", "--axis-y", "--axis-z"].forEach((name, i) => {
      this.#axes[i]!.color = new Color(theme.css(name));
    });
  }
}
