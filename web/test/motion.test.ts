import assert from "node:assert/strict";
import { test } from "node:test";
import type { Surface } from "../src/data.ts";
import { contactForce, touchAt } from "../src/motion.ts";
import { reportOf, table } from "./reports.ts";

const surface = (depths: number[], force: number[][]): Surface => ({ name: "wall", role: "surface 1", body: null, shift: table([[0, 0, 0], [1, 0, 0]]), force: table(force), depth: table(depths.map((d) => [d])), point: null });

test("a force is held until the next frame, and a surface moves between them", () => {
  const touch = touchAt(surface([1e-3, -1], [[3, 4, 0], [0, 0, 0]]), { row: 0, share: 0.5 });
  assert.deepEqual(touch, { force: [3, 4, 0], pressed: true, shift: [0.5, 0, 0], point: null });
});

test("the hand touches where it is between two frames", () => {
  const wall = { ...surface([1e-3, 1e-3], [[3, 4, 0], [0, 0, 0]]), point: table([[0, 0, 0], [0, 0, 2]]) };
  assert.deepEqual(touchAt(wall, { row: 0, share: 0.25 }).point, [0, 0, 0.5]);
});

test("forces of surfaces add, and where nothing is touched or known there is none", () => {
  const { frames } = reportOf();
  const [one, other, gap] = [surface([1e-3, -1], [[3, 0, 0], [0, 0, 0]]), surface([1e-3, 1e-3], [[0, 4, 0], [0, 0, 2]]), surface([NaN, NaN], [[NaN, 0, 0], [NaN, 0, 0]])];
  assert.equal(contactForce([one, other, gap], frames, 0.5), 5);
  assert.equal(contactForce([one, other, gap], frames, 1), 2);
  assert.equal(contactForce([one, gap], frames, 1), null);
});
