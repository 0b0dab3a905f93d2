/** Curves of one diagram on one time axis, as uPlot wants them. */

import uPlot from "uplot";
import type { Curve, Numbers } from "../data.ts";

type Column = (number | null | undefined)[];

/** NaN is a gap, which uPlot calls null. */
export function gapped(values: Numbers): Column {
  return Array.from(values, (value) => (Number.isNaN(value) ? null : value));
}

/** The times of all curves in one rising row, and each curve on it; curves that share their times cost nothing. */
export function joined(curves: Curve[]): uPlot.AlignedData {
  const groups = new Map<Numbers, Curve[]>();
  for (const curve of curves) groups.set(curve.x, [...(groups.get(curve.x) ?? []), curve]);
  const tables = [...groups].map(([x, members]) => [Array.from(x), ...members.map((m) => gapped(m.y))]);
  const table = (tables.length === 1 ? tables[0]! : uPlot.join(tables as uPlot.AlignedData[])) as Column[];
  const order = [...groups.values()].flat();
  return [table[0]!, ...curves.map((curve) => table[1 + order.indexOf(curve)]!)] as uPlot.AlignedData;
}
