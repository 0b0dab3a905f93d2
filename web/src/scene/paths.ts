/** Lines through points of the world: where something has been and where it will go. */

import { Color, Group } from "three";
import { Line2 } from "three/addons/lines/Line2.js";
import { LineGeometry } from "three/addons/lines/LineGeometry.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import type { Table } from "../data.ts";
import type { Place } from "../sampling.ts";
import type { Look } from "../theme.ts";

/** One line with the points that are numbers; `rows` says which row each of them is. */
function pointsOf(table: Table): { points: number[]; rows: number[] } {
  const points: number[] = [];
  const rows: number[] = [];
  for (let row = 0; row < table.rows; row++) {
    const point = table.data.subarray(3 * row, 3 * row + 3);
    if (!point.every(Number.isFinite)) continue;
    points.push(...point);
    rows.push(row);
  }
  return { points, rows };
}

export class Path {
  readonly group = new Group();
  #past: Line2 | null = null;
  #materials: { past: LineMaterial; whole: LineMaterial };
  #rows: number[];

  /** @param table positions (rows, 3) [m]; where numbers are missing the line goes straight on */
  constructor(table: Table, dashed: boolean, length: number) {
    const { points, rows } = pointsOf(table);
    this.#rows = rows;
    const material = (opacity: number) =>
      new LineMaterial({ transparent: true, opacity, depthTest: false, depthWrite: false, dashed, dashSize: 0.012 * length, gapSize: 0.008 * length });
    this.#materials = { past: material(0.95), whole: material(0.3) };
    if (rows.length < 2) return;
    const line = (kind: "past" | "whole") => {
      const made = new Line2(new LineGeometry(), this.#materials[kind]);
      made.geometry.setPositions(points);
      if (dashed) made.computeLineDistances();
      made.renderOrder = 3;
      made.frustumCulled = false;
      this.group.add(made);
      return made;
    };
    line("whole");
    this.#past = line("past");
  }

  /** Show the line up to a place as past. */
  move(place: Place): void {
    if (!this.#past) return;
    let past = place.row;
    if (this.#rows.length !== this.#rows[this.#rows.length - 1]! + 1) past = this.#rows.filter((row) => row <= place.row).length - 1;
    this.#past.visible = past > 0;
    this.#past.geometry.instanceCount = Math.min(Math.max(past, 0), this.#rows.length - 1);
  }

  paint(look: Look): void {
    for (const material of Object.values(this.#materials)) material.color = new Color(look.color);
    this.#materials.past.linewidth = Math.max(look.width * 1.4, 2.2);
    this.#materials.whole.linewidth = Math.max(look.width * 0.9, 1.4);
  }
}
