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
