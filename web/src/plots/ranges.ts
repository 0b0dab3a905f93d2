/** How far curves reach, and what a diagram shows of that. */

import type { Curve, Panel } from "../data.ts";

/** Least and largest of the finite values, or null where there is none. */
export function extent(curves: Curve[]): [number, number] | null {
  let low = Infinity;
  let high = -Infinity;
  for (const { y } of curves) {
    for (const value of y) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : null;
}

/** So much of a curve may lie beyond a range without its spikes, at each end. */
const RARE = 0.01;

/** Least and largest of the values without the rarest at each end of each curve; null where there is none. */
export function core(columns: ArrayLike<number | null | undefined>[], from = 0, to = Infinity): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (const column of columns) {
    const values: number[] = [];
    for (let i = from; i <= Math.min(to, column.length - 1); i++) {
      const value = column[i];
      if (value !== null && value !== undefined && !Number.isNaN(value)) values.push(value);
    }
    if (values.length === 0) continue;
    const rising = Float64Array.from(values).sort();
    const rare = Math.floor(RARE * (rising.length - 1));
    low = Math.min(low, rising[rare]!);
    high = Math.max(high, rising[rising.length - 1 - rare]!);
  }
  return low <= high ? [low, high] : null;
}

/** Whether spikes flatten all the rest of some curves: most of the height is needed for few values. */
export function spiky(curves: Curve[]): boolean {
  const [all, most] = [extent(curves), core(curves.map((curve) => curve.y))];
  return all !== null && most !== null && most[1] > most[0] && all[1] - all[0] > 3 * (most[1] - most[0]);
}

/** Which of several diagrams to show first: the one whose reference moves most, else the first. */
export function liveliest(panels: Panel[]): number {
  const ways = panels.map((panel) => {
    const reach = extent(panel.curves.filter((curve) => curve.role === "reference"));
    return reach ? reach[1] - reach[0] : 0;
  });
  return Math.max(0, ways.indexOf(Math.max(...ways)));
}

/** The vertical range with the levels that are near enough: they may stretch the picture up to six times. */
export function rangeWith(low: number, high: number, levels: number[]): [number, number] {
  let [bottom, top] = [low, high];
  const size = Math.max(high - low, 0.1 * Math.max(Math.abs(low), Math.abs(high)), 1e-9);
  for (const level of levels.toSorted((a, b) => distance(a, low, high) - distance(b, low, high))) {
    const reach: [number, number] = [Math.min(bottom, level), Math.max(top, level)];
    if (reach[1] - reach[0] <= 6 * size) [bottom, top] = reach;
  }
  if (top - bottom < 1e-3 * size) [bottom, top] = [bottom - size / 2, top + size / 2];
  const margin = 0.06 * (top - bottom);
  return [bottom - margin, top + margin];
}

function distance(level: number, low: number, high: number): number {
  return Math.max(low - level, level - high, 0);
}
