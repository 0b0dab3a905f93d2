/** Where the bodies of a serial arm are: the same chain of frames as the Python side, in plain numbers. */

import type { Frames } from "./data.ts";
import type { Arm } from "./report.ts";

/** A frame in the world: rotation (9, row-major) and origin [m]. */
export interface Pose {
  rotation: number[];
  xyz: number[];
}

export const WORLD: Pose = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], xyz: [0, 0, 0] };

/** The bodies (n + 1, first the base) and the end-effector frame. */
export interface Posture {
  bodies: Pose[];
  /** Frame of each joint before its own motion, in the world. */
  joints: Pose[];
  tip: Pose;
}

function product(a: number[], b: number[]): number[] {
  const out = new Array<number>(9);
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) out[3 * i + j] = a[3 * i]! * b[j]! + a[3 * i + 1]! * b[3 + j]! + a[3 * i + 2]! * b[6 + j]!;
  }
  return out;
}

/** A point [m] given in a frame, in the world. */
export function placed(pose: Pose, point: number[]): number[] {
  const r = pose.rotation;
  return [0, 1, 2].map((i) => pose.xyz[i]! + r[3 * i]! * point[0]! + r[3 * i + 1]! * point[1]! + r[3 * i + 2]! * point[2]!);
}

/** Frame `child`, given in `parent`, seen from the world. */
export function composed(parent: Pose, child: Pose): Pose {
  return { rotation: product(parent.rotation, child.rotation), xyz: placed(parent, child.xyz) };
}

/** Rotation by an angle [rad] about a unit axis (Rodrigues). */
export function turn(axis: number[], angle: number): number[] {
  const [x, y, z] = axis as [number, number, number];
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  const v = 1 - c;
  return [
    c + x * x * v, x * y * v - z * s, x * z * v + y * s,
    y * x * v + z * s, c + y * y * v, y * z * v - x * s,
    z * x * v - y * s, z * y * v + x * s, c + z * z * v,
  ];
}

/** The motion of one joint: a turn by q [rad] about its axis, or a shift by q [m] along it. */
export function motion(kind: string, axis: number[], q: number): Pose {
  if (kind === "prismatic") return { rotation: WORLD.rotation, xyz: axis.map((a) => a * q) };
  return { rotation: turn(axis, q), xyz: [0, 0, 0] };
}

/** All frames of the arm at joint positions q (n) [rad or m]. */
export function forward(arm: Arm, q: ArrayLike<number>): Posture {
  const bodies = [WORLD];
  const joints: Pose[] = [];
  let body = WORLD;
  arm.joints.forEach((joint, i) => {
    const before = composed(body, joint);
    joints.push(before);
    body = composed(before, motion(joint.kind, joint.axis, q[i]!));
    bodies.push(body);
  });
  return { bodies, joints, tip: composed(body, arm.tip) };
}

/** Largest distance [m] between the tip by joint angles and the recorded position, over some hundred rows. */
export function tipError(arm: Arm, frames: Frames): number {
  const { q, position } = frames;
  const stride = Math.max(1, Math.floor(q.rows / 300));
  let largest = 0;
  for (let row = 0; row < q.rows; row += stride) {
    const { xyz } = forward(arm, q.data.subarray(row * q.columns, (row + 1) * q.columns)).tip;
    const error = Math.hypot(...xyz.map((value, i) => value - position.data[3 * row + i]!));
    if (error > largest) largest = error;
  }
  return largest;
}

/** Deflections theta - q of all joints at one row or between rows [rad or m]. */
export function deflections(q: number[], theta: number[]): number[] {
  return q.map((value, i) => theta[i]! - value);
}

/** Largest |theta - q| of the run among joints of one sort [rad, or m for prismatic ones]. */
export function largestDeflection(arm: Arm | null, frames: Frames, prismatic: boolean): number {
  const { q, theta } = frames;
  let largest = 0;
  for (let i = 0; i < q.data.length; i++) {
    const slides = arm?.joints[i % q.columns]?.kind === "prismatic";
    const size = Math.abs(theta.data[i]! - q.data[i]!);
    if (slides === prismatic && size > largest) largest = size;
  }
  return largest;
}

/** A factor for the picture: a round one with which the largest deflection reaches `target` (same unit). */
export function magnification(largest: number, target: number): number {
  if (!(largest > 0)) return 1;
  const factor = Math.min(Math.max(target / largest, 1), 1000);
  const decade = 10 ** Math.floor(Math.log10(factor));
  return [5, 2, 1].map((m) => m * decade).find((rounded) => rounded <= factor) ?? 1;
}
