/** The run at one time: joint positions, frames, points and the force on the end effector. */

import type { Frames } from "./data.ts";
import { forward, type Posture } from "./kinematics.ts";
import type { Arm } from "./report.ts";
import { placeOf, valuesAt, type Place } from "./sampling.ts";

export interface Moment {
  place: Place;
  /** Link and motor positions (n) [rad or m]. */
  q: number[];
  theta: number[];
  /** null without a description of the arm, or where a joint position is missing. */
  posture: Posture | null;
  /** End effector [m]: by the joints where the arm is known, else as recorded. */
  tip: number[];
  reference: number[] | null;
  governed: number[] | null;
  /** [N], [N m] */
  force: number[] | null;
  moment: number[] | null;
}

/** The run at time t [s], straight between frames. */
export function momentAt(arm: Arm | null, frames: Frames, t: number): Moment {
  const place = placeOf(frames.time, t);
  const q = valuesAt(frames.q, place);
  const posture = arm && q.every(Number.isFinite) ? forward(arm, q) : null;
  // A push is there or not: no half force lies between two rows.
  const held = { row: place.row, share: 0 };
  return {
    place,
    q,
    theta: valuesAt(frames.theta, place),
    posture,
    tip: posture ? posture.tip.xyz : valuesAt(frames.position, place),
    reference: frames.reference && valuesAt(frames.reference, place),
    governed: frames.governed && valuesAt(frames.governed, place),
    force: frames.force && valuesAt(frames.force, held),
    moment: frames.moment && valuesAt(frames.moment, held),
  };
}

/** What the magnified motor position is in the picture: q + factor (theta - q). */
export function magnified(moment: Moment, factor: number): number[] {
  return moment.q.map((q, i) => q + factor * (moment.theta[i]! - q));
}
