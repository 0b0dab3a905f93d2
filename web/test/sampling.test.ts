import assert from "node:assert/strict";
import { test } from "node:test";
import { momentAt } from "../src/motion.ts";
import { largestNorm, nearestRow, placeOf, readAt, rowAt, valuesAt } from "../src/sampling.ts";
import { reportOf, table } from "./reports.ts";

const TIME = Float64Array.of(0, 1, 1, 2);

test("the row at a time is the last one not after it", () => {
  assert.deepEqual([-1, 0, 0.5, 1, 1.5, 2, 9].map((t) => rowAt(TIME, t)), [0, 0, 0, 2, 2, 3, 3]);
  assert.deepEqual([0.4, 0.6, 1.4, 1.6].map((t) => nearestRow(TIME, t)), [0, 1, 2, 3]);
});

test("between rows the numbers lie on a line, on a row they are the row's", () => {
  const rows = table([[0, 10], [1, 20], [5, 50], [7, 70]]);
  assert.deepEqual(valuesAt(rows, placeOf(TIME, 0.25)), [0.25, 12.5]);
  assert.deepEqual(valuesAt(rows, placeOf(TIME, 1)), [5, 50]);
  assert.deepEqual(valuesAt(rows, placeOf(TIME, 99)), [7, 70]);
  assert.deepEqual(valuesAt(rows, placeOf(TIME, -99)), [0, 10]);
});

test("a reading is a number of the file, or nothing in a gap and far outside", () => {
  const x = Float64Array.of(0, 1, 2);
  const y = Float32Array.of(3, NaN, 5);
  assert.deepEqual([0.4, 1, 1.6, 2.5, 3.5, -2].map((t) => readAt(x, y, t)), [3, null, 5, 5, null, null]);
  assert.equal(readAt(new Float64Array(0), new Float32Array(0), 0), null);
});

test("the largest force is one of the rows, gaps left aside", () => {
  assert.equal(largestNorm(table([[3, 4, 0], [NaN, 9, 9], [1, 0, 0]])), 5);
  assert.equal(largestNorm(null), 0);
});

test("a force is held between rows, joint positions are not", () => {
  const { frames } = reportOf();
  const moment = momentAt(null, { ...frames, force: table([[4, 0, 0], [0, 0, 0]]) }, 0.5);
  assert.deepEqual(moment.q, [0.25]);
  assert.deepEqual(moment.force, [4, 0, 0]);
  assert.deepEqual(moment.tip, [0, 0, 0]);
  assert.equal(moment.posture, null);
});
