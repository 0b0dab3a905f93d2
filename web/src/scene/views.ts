/** From where one looks: the whole arm, the end effector from near by, and following it. */

import { Vector3, type PerspectiveCamera } from "three";
import type { Frames, Table } from "../data.ts";
import { forward } from "../kinematics.ts";
import type { Arm } from "../report.ts";
import type { Stage } from "./stage.ts";

/** Ball around what moves [m]. */
export interface Extent {
  center: Vector3;
  radius: number;
}

function ballOf(points: Vector3[]): Extent {
  const low = new Vector3(Infinity, Infinity, Infinity);
  const high = low.clone().negate();
  for (const point of points) {
    low.min(point);
    high.max(point);
  }
  if (points.length === 0) return { center: new Vector3(), radius: 0.5 };
  return { center: low.clone().add(high).multiplyScalar(0.5), radius: Math.max(low.distanceTo(high) / 2, 1e-3) };
}

function rowsOf(table: Table | null, count: number): Vector3[] {
  if (!table) return [];
  const stride = Math.max(1, Math.floor(table.rows / count));
  const points: Vector3[] = [];
  for (let row = 0; row < table.rows; row += stride) {
    const [x, y, z] = table.data.subarray(3 * row, 3 * row + 3);
    if (Number.isFinite(x! + y! + z!)) points.push(new Vector3(x, y, z));
  }
  return points;
}

/** Where the whole arm is during the run, with its base. */
export function wholeExtent(arm: Arm | null, frames: Frames): Extent {
  const points = [...rowsOf(frames.position, 60), ...rowsOf(frames.reference, 60)];
  if (!arm) return ballOf(points);
  points.push(new Vector3());
  const stride = Math.max(1, Math.floor(frames.q.rows / 12));
  for (let row = 0; row < frames.q.rows; row += stride) {
    const q = frames.q.data.subarray(row * frames.q.columns, (row + 1) * frames.q.columns);
    if (!q.every(Number.isFinite)) continue;
    for (const { xyz } of forward(arm, q).bodies) points.push(new Vector3(...xyz));
  }
  const { center, radius } = ballOf(points);
  const length = [...arm.joints, arm.tip].reduce((sum, { xyz }) => sum + Math.hypot(...xyz), 0);
  return { center, radius: Math.max(radius, 0.2 * length) };
}

/** Where the end effector and its reference are during the run. */
export function pathExtent(frames: Frames): Extent {
  return ballOf([...rowsOf(frames.position, 400), ...rowsOf(frames.reference, 400)]);
}

/** Put the camera so that a ball fills the picture; the direction stays unless one is given. */
export function look(stage: Stage, extent: Extent, direction?: Vector3): void {
  const { camera, controls } = stage;
  const way = direction ?? camera.position.clone().sub(controls.target);
  const half = Math.min(angle(camera), 2 * Math.atan(Math.tan(angle(camera) / 2) * stage.aspect)) / 2;
  controls.target.copy(extent.center);
  camera.position.copy(extent.center).addScaledVector(way.normalize(), (1.12 * extent.radius) / Math.sin(half));
  controls.update();
  stage.ask();
}

function angle(camera: PerspectiveCamera): number {
  return (camera.fov * Math.PI) / 180;
}

/** From where the arm is best seen: from the side of the plane it reaches in, a little from above. */
export function sideOf(extent: Extent): Vector3 {
  const azimuth = Math.hypot(extent.center.x, extent.center.y) > 1e-3 ? Math.atan2(extent.center.y, extent.center.x) : 0;
  const seen = azimuth - (52 * Math.PI) / 180;
  return new Vector3(Math.cos(seen), Math.sin(seen), 0.42);
}
