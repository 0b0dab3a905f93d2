import assert from "node:assert/strict";
import { test } from "node:test";
import { apart, beside, bracketed, clock, fixed, shown, withUnit } from "../src/numbers.ts";

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

test("the distance of two times is a period", () => {
  assert.equal(apart(0.0087), "Δ 8.7 ms, 115 Hz");
  assert.equal(apart(-2), "Δ 2 s, 0.5 Hz");
  assert.equal(apart(0), "");
  assert.equal(apart(NaN), "");
});

test("numbers that share a scale have the same decimals", () => {
  assert.equal(beside(-0.00512, 1), "−0.01");
  assert.equal(beside(0.00512, 0.3), "0.005");
  assert.equal(beside(-1e-17, 1), "0.00");
  assert.equal(beside(42.123, 176), "42");
  assert.equal(beside(2e7, 2e7), "2e7");
  assert.equal(beside(0, 0), "0");
});
