/** Rows of a time grid: which one a time belongs to, and what lies between two of them. */

import type { Numbers, Table } from "./data.ts";

/** The last row at or before time t [s]; 0 before the first. Times rise, the same time may stand twice. */
export function rowAt(time: Numbers, t: number): number {
  let low = 0;
  let high = time.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (time[middle]! <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** The row nearest to time t [s]. */
export function nearestRow(time: Numbers, t: number): number {
  const row = rowAt(time, t);
  return row + 1 < time.length && time[row + 1]! - t < t - time[row]! ? row + 1 : row;
}

/** A row and the share of the way to the next one, in [0, 1). */
export interface Place {
  row: number;
  share: number;
}

/** Where time t [s] lies on the grid; times outside are taken to its ends. */
export function placeOf(time: Numbers, t: number): Place {
  const row = rowAt(time, t);
  const step = row + 1 < time.length ? time[row + 1]! - time[row]! : 0;
  const share = step > 0 ? Math.min(Math.max((t - time[row]!) / step, 0), 1) : 0;
  return share === 1 ? { row: row + 1, share: 0 } : { row, share };
}

/** The numbers of a table at a place, straight between rows; a whole row is returned as it is. */
export function valuesAt(table: Table, place: Place): number[] {
  const { columns, data, rows } = table;
  const row = Math.min(place.row, rows - 1);
  const out = Array.from(data.subarray(row * columns, (row + 1) * columns));
  if (place.share === 0 || row + 1 >= rows) return out;
  return out.map((value, i) => value + place.share * (data[(row + 1) * columns + i]! - value));
}

/** The value of a curve in the row nearest to t [s]: what stands in the file, not something between. */
export function readAt(x: Numbers, y: Numbers, t: number): number | null {
  if (x.length === 0) return null;
  const last = x[x.length - 1]!;
  const spacing = x.length > 1 ? (last - x[0]!) / (x.length - 1) : 0;
  if (t > last + spacing || t < x[0]! - spacing) return null;
  const value = y[nearestRow(x, t)]!;
  return Number.isFinite(value) ? value : null;
}

/** Largest magnitude of the finite entries of each row's norm, e.g. of a force [N]; 0 where there is none. */
export function largestNorm(table: Table | null): number {
  if (!table) return 0;
  let largest = 0;
  for (let row = 0; row < table.rows; row++) {
    let sum = 0;
    for (let c = 0; c < table.columns; c++) sum += table.data[row * table.columns + c]! ** 2;
    if (sum > largest) largest = sum;
  }
  return Math.sqrt(largest);
}
