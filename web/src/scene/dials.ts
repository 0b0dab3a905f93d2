/** Two dials at each joint: link position q and motor position theta, their difference magnified. */

import { BufferAttribute, BufferGeometry, Color, DoubleSide, Group, Matrix4, Mesh, MeshBasicMaterial, RingGeometry, Vector3 } from "three";
import type { Posture } from "../kinematics.ts";
import type { Arm } from "../report.ts";
import type { Theme } from "../theme.ts";
import { put, square } from "./shapes.ts";

const STEPS = 40;
const Z = new Vector3(0, 0, 1);

interface Inks {
  link: MeshBasicMaterial;
  motor: MeshBasicMaterial;
  gap: MeshBasicMaterial;
  ring: MeshBasicMaterial;
}

function ink(opacity: number): MeshBasicMaterial {
  // Drawn over the arm: a reading must not vanish inside a housing.
  return new MeshBasicMaterial({ side: DoubleSide, transparent: true, opacity, depthTest: false, depthWrite: false });
}

/** A flat bar from radius a to b [m] at angle 0, w [m] wide. */
function bar(a: number, b: number, w: number): BufferGeometry {
  const geometry = new BufferGeometry();
  const h = w / 2;
  geometry.setAttribute("position", new BufferAttribute(new Float32Array([a, -h, 0, b, -h, 0, b, h, 0, a, h, 0]), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  return geometry;
}

/** The dials of one joint, flat in the plane square to its axis; the axis is z of the dial. */
class Dial {
  readonly frame = new Group();
  #turning: boolean;
  #radius: number;
  #link: Group;
  #motor: Group;
  #gap: Mesh;

  constructor(axis: number[], prismatic: boolean, radius: number, inks: Inks) {
    this.#turning = !prismatic;
    this.#radius = radius;
    const z = new Vector3(...axis).normalize();
    const x = square(z);
    const plane = new Group();
    plane.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(x, z.clone().cross(x), z));
    const hand = (inner: number, outer: number, from: number, to: number, material: MeshBasicMaterial) => {
      const group = new Group();
      if (this.#turning) group.add(new Mesh(bar(from * radius, to * radius, 0.1 * radius), material));
      else group.add(new Mesh(new RingGeometry(inner * radius, outer * radius, 48), material));
      plane.add(group);
      return group;
    };
    this.#link = hand(1.25, 1.45, 1.22, 1.62, inks.link);
    this.#motor = hand(0.95, 1.15, 0.72, 1.1, inks.motor);
    if (this.#turning) {
      plane.add(new Mesh(new RingGeometry(1.19 * radius, 1.24 * radius, 64), inks.link));
      plane.add(new Mesh(new RingGeometry(1.05 * radius, 1.1 * radius, 64), inks.motor));
      plane.add(new Mesh(bar(1.24 * radius, 1.36 * radius, 0.05 * radius), inks.ring));
    }
    this.#gap = new Mesh(new BufferGeometry(), inks.gap);
    this.#gap.frustumCulled = false;
    this.#gap.geometry.setAttribute("position", new BufferAttribute(new Float32Array(6 * (STEPS + 1)), 3));
    const faces = Array.from({ length: STEPS }, (_, i) => [2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2]).flat();
    this.#gap.geometry.setIndex(faces);
    plane.add(this.#gap);
    plane.traverse((part) => {
      part.renderOrder = 5;
    });
    this.frame.add(plane);
  }

  /** @param q,seen link position and magnified motor position [rad or m] */
  set(q: number, seen: number): void {
    const corners = this.#gap.geometry.getAttribute("position") as BufferAttribute;
    const r = this.#radius;
    if (this.#turning) {
      this.#link.quaternion.setFromAxisAngle(Z, q);
      this.#motor.quaternion.setFromAxisAngle(Z, seen);
      const way = Math.min(Math.max(seen - q, -2 * Math.PI), 2 * Math.PI);
      for (let i = 0; i <= STEPS; i++) {
        const angle = q + (way * i) / STEPS;
        corners.setXYZ(2 * i, 0.75 * r * Math.cos(angle), 0.75 * r * Math.sin(angle), 0);
        corners.setXYZ(2 * i + 1, 1.62 * r * Math.cos(angle), 1.62 * r * Math.sin(angle), 0);
      }
    } else {
      this.#link.position.z = q;
      this.#motor.position.z = seen;
      for (let i = 0; i <= STEPS; i++) {
        const height = q + ((seen - q) * i) / STEPS;
        corners.setXYZ(2 * i, 1.1 * r, 0, height);
        corners.setXYZ(2 * i + 1, 1.3 * r, 0, height);
      }
    }
    corners.needsUpdate = true;
  }
}

export class Dials {
  readonly group = new Group();
  #dials: Dial[];
  #inks: Inks = { link: ink(0.95), motor: ink(0.95), gap: ink(0.45), ring: ink(0.8) };

  /** @param size length of the arm [m], where no housing says how large a joint is */
  constructor(arm: Arm, size: number) {
    this.#dials = arm.joints.map((joint, i) => {
      const radii = (arm.solids[i + 1] ?? []).concat(arm.solids[i] ?? []).filter((solid) => solid.part === "joint").map((solid) => solid.radius);
      const radius = Math.min(Math.max(1.25 * (radii[0] ?? 0.05 * size), 0.045 * size), 0.12 * size);
      const dial = new Dial(joint.axis, joint.kind === "prismatic", radius, this.#inks);
      this.group.add(dial.frame);
      return dial;
    });
  }

  move(posture: Posture, q: number[], seen: number[]): void {
    this.#dials.forEach((dial, i) => {
      put(dial.frame, posture.joints[i]!);
      dial.set(q[i]!, seen[i]!);
    });
  }

  paint(theme: Theme): void {
    this.#inks.link.color = new Color(theme.css("--dial-link"));
    this.#inks.motor.color = new Color(theme.css("--dial-motor"));
    this.#inks.gap.color = new Color(theme.css("--dial-motor"));
    this.#inks.ring.color = new Color(theme.css("--dim"));
  }
}

