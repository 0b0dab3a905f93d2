/** The run at one time: joint positions, frames, points and the force on the end effector. */

import type { Frames, Surface } from "./data.ts";
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

/** What a surface does to the hand. */
export interface Touch {
  /** [N], on the hand. */
  force: number[];
  /** Whether the hand is in it. */
  pressed: boolean;
  /** How far it has moved [m]; null for one that stays. */
  shift: number[] | null;
  /** Where the hand touches it [m]; null where that is not known. */
  point: number[] | null;
}

/** A surface at a place of the run. */
export function touchAt(surface: Surface, place: Place): Touch {
  // An impact is there or not, as a push.
  const held = { row: place.row, share: 0 };
  const force = valuesAt(surface.force, held);
  return {
    force,
    pressed: valuesAt(surface.depth, held)[0]! > 0 && force.every(Number.isFinite),
    shift: surface.shift && valuesAt(surface.shift, place),
    point: surface.point && valuesAt(surface.point, place),
  };
}

/** Size of the force of all surfaces together at time t [N]; null where nothing is touched. */
export function contactForce(surfaces: Surface[], frames: Frames, t: number): number | null {
  const place = placeOf(frames.time, t);
  const touches = surfaces.map((surface) => touchAt(surface, place)).filter((touch) => touch.pressed);
  if (touches.length === 0) return null;
  return Math.hypot(...[0, 1, 2].map((i) => touches.reduce((sum, { force }) => sum + force[i]!, 0)));
}

/** What the magnified motor position is in the picture: q + factor (theta - q). */
export function magnified(moment: Moment, factor: number): number[] {
  return moment.q.map((q, i) => q + factor * (moment.theta[i]! - q));
}
