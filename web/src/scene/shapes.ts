/** Small shapes the scene is made of. */

import { BufferGeometry, CapsuleGeometry, CylinderGeometry, Matrix4, Mesh, Object3D, Quaternion, SphereGeometry, Vector3, type Material } from "three";
import type { Pose } from "../kinematics.ts";
import type { Solid } from "../report.ts";

const Y = new Vector3(0, 1, 0);

/** Matrix of a frame. */
export function matrixOf(pose: Pose, into = new Matrix4()): Matrix4 {
  const [r, p] = [pose.rotation, pose.xyz] as [number[], number[]];
  return into.set(r[0]!, r[1]!, r[2]!, p[0]!, r[3]!, r[4]!, r[5]!, p[1]!, r[6]!, r[7]!, r[8]!, p[2]!, 0, 0, 0, 1);
}

/** Put an object into a frame; it is hidden where a number is missing. */
export function put(object: Object3D, pose: Pose): void {
  object.matrixAutoUpdate = false;
  matrixOf(pose, object.matrix);
  object.matrixWorldNeedsUpdate = true;
}

/** Turn and place an object whose length lies along y so that it lies from start to end [m]. */
export function along(object: Object3D, start: Vector3, end: Vector3): void {
  object.position.copy(start).add(end).multiplyScalar(0.5);
  const way = end.clone().sub(start);
  if (way.lengthSq() > 0) object.quaternion.copy(new Quaternion().setFromUnitVectors(Y, way.normalize()));
}

/** The mesh of one solid in the frame of its body. */
export function meshOf(solid: Solid, material: Material): Mesh {
  const [start, end] = [new Vector3(...solid.start), new Vector3(...solid.end)];
  const length = start.distanceTo(end);
  let geometry: BufferGeometry;
  if (solid.kind === "sphere" || length < 1e-9) geometry = new SphereGeometry(solid.radius, 28, 18);
  else if (solid.kind === "capsule") geometry = new CapsuleGeometry(solid.radius, length, 8, 24);
  else geometry = new CylinderGeometry(solid.radius, solid.radius, length, 32);
  const mesh = new Mesh(geometry, material);
  along(mesh, start, end);
  return mesh;
}

/** A unit vector square to an axis: the zero of a dial. */
export function square(axis: Vector3): Vector3 {
  const [x, y, z] = [Math.abs(axis.x), Math.abs(axis.y), Math.abs(axis.z)];
  const least = x <= y && x <= z ? new Vector3(1, 0, 0) : y <= z ? new Vector3(0, 1, 0) : new Vector3(0, 0, 1);
  return least.addScaledVector(axis, -least.dot(axis)).normalize();
}
