import assert from "node:assert/strict";
import { test } from "node:test";
import { forward, largestDeflection, magnification, tipError, turn, WORLD } from "../src/kinematics.ts";
import type { Arm } from "../src/report.ts";
import { reportOf, table } from "./reports.ts";

const PLAIN = WORLD.rotation;

function near(got: number[], wanted: number[], tolerance = 1e-14): void {
  got.forEach((value, i) => assert.ok(Math.abs(value - wanted[i]!) < tolerance, `${got} is not ${wanted}`));
}

function planar(l1: number, l2: number): Arm {
  const joint = (name: string, x: number) => ({ name, kind: "revolute", xyz: [x, 0, 0], rotation: PLAIN, axis: [0, 0, 1] });
  return { joints: [joint("a", 0), joint("b", l1)], tip: { xyz: [l2, 0, 0], rotation: PLAIN }, solids: [[], [], []] };
}

test("the tip of a planar arm of two joints is where the closed form says", () => {
  const [l1, l2] = [0.4, 0.3];
  for (const [a, b] of [[0, 0], [0.3, -1.2], [2.5, 1.7], [-3, 0.01]] as const) {
    const { tip, bodies, joints } = forward(planar(l1, l2), [a, b]);
    near(tip.xyz, [l1 * Math.cos(a) + l2 * Math.cos(a + b), l1 * Math.sin(a) + l2 * Math.sin(a + b), 0]);
    near(tip.rotation, turn([0, 0, 1], a + b));
    assert.equal(bodies.length, 3);
    near(joints[1]!.xyz, [l1 * Math.cos(a), l1 * Math.sin(a), 0]);
    near(joints[1]!.rotation, turn([0, 0, 1], a));
  }
});

test("a prismatic joint shifts along its axis as its frame is turned", () => {
  const quarter = turn([1, 0, 0], Math.PI / 2);
  const arm: Arm = {
    joints: [{ name: "lift", kind: "prismatic", xyz: [0, 0, 0.5], rotation: quarter, axis: [0, 0, 1] }],
    tip: { xyz: [0.1, 0, 0], rotation: PLAIN },
    solids: [[], []],
  };
  // z of the joint lies along -y of the world.
  near(forward(arm, [0.2]).tip.xyz, [0.1, -0.2, 0.5]);
  near(forward(arm, [0.2]).tip.rotation, quarter);
});

test("a turn is a rotation that leaves its axis alone", () => {
  const axis = [2, -1, 2].map((x) => x / 3);
  const r = turn(axis, 0.7);
  near([0, 1, 2].map((i) => r[3 * i]! * axis[0]! + r[3 * i + 1]! * axis[1]! + r[3 * i + 2]! * axis[2]!), axis);
  assert.ok(Math.abs(r[0]! + r[4]! + r[8]! - (1 + 2 * Math.cos(0.7))) < 1e-14);
});

test("a tip that is drawn elsewhere than recorded is measured", () => {
  const { frames } = reportOf();
  const q = table([[0, 0], [0.5, 0.5]]);
  const arm = planar(0.4, 0.3);
  const position = table([[0.7, 0, 0], forward(arm, [0.5, 0.5]).tip.xyz]);
  assert.ok(tipError(arm, { ...frames, q, position }) < 1e-15);
  position.data[5]! += 0.002;
  assert.ok(Math.abs(tipError(arm, { ...frames, q, position }) - 0.002) < 1e-12);
});

test("the magnification is round, between 1 and 1000, and does not overshoot", () => {
  assert.equal(magnification(0.0031, 0.9), 200);
  assert.equal(magnification(0.9, 0.9), 1);
  assert.equal(magnification(3, 0.9), 1);
  assert.equal(magnification(1e-9, 0.9), 1000);
  assert.equal(magnification(0, 0.9), 1);
  assert.equal(magnification(NaN, 0.9), 1);
});

test("the largest deflection passes over gaps", () => {
  const { frames } = reportOf();
  assert.equal(largestDeflection(null, { ...frames, theta: table([[NaN], [0.25]]) }, false), 0.25);
  assert.equal(largestDeflection(null, frames, true), 0);
});
