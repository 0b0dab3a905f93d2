import assert from "node:assert/strict";
import { test } from "node:test";
import { bracketed, clock, fixed, shown, withUnit } from "../src/numbers.ts";

test("numbers have four digits and no noise", () => {
  const cases: [number | null, string][] = [
    [0, "0"], [-0, "0"], [1, "1"], [12.3456, "12.35"], [-0.012345, "−0.01235"], [1234.56, "1235"], [123456, "123456"],
    [99999.9, "100000"], [1.5e7, "1.5e7"], [-2.5e-6, "−2.5e−6"], [null, "–"], [NaN, "–"], [Infinity, "∞"], [-Infinity, "−∞"],
  ];
  for (const [value, text] of cases) assert.equal(shown(value), text);
});

test("what is nothing beside the scale is 0", () => {
  assert.equal(shown(-1.11e-16, 4, 0.1), "0");
  assert.equal(shown(1.11e-16), "1.11e−16");
});

test("a pure number has no unit", () => {
  assert.equal(withUnit(2.5, "N m"), "2.5 N m");
  assert.equal(withUnit(2.5, "1"), "2.5");
  assert.equal(bracketed("1"), "[–]");
  assert.equal(bracketed("J"), "[J]");
});

test("times and fixed numbers never show a sign before zero", () => {
  assert.equal(clock(10.34), "10.340");
  assert.equal(fixed(-0.0004, 3), "0.000");
  assert.equal(fixed(-0.0006, 3), "−0.001");
  assert.equal(fixed(NaN, 3), "–");
});
