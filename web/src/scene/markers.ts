/** Marks at points: the reference, the ideal mass, and the force as an arrow. */

import { Color, ConeGeometry, CylinderGeometry, Group, Mesh, MeshBasicMaterial, MeshLambertMaterial, type Object3D, OctahedronGeometry, SphereGeometry, TorusGeometry, Vector3 } from "three";
import type { Look } from "../theme.ts";
import { along } from "./shapes.ts";

/** Length of the head of an arrow, as a share of the longest arrow. */
const HEAD = 0.26;

function flat(opacity = 1): MeshBasicMaterial {
  return new MeshBasicMaterial({ transparent: true, opacity, depthTest: false, depthWrite: false });
}

/** A mark at a point, of one material. */
class PointMark<Shape extends Object3D, Paint extends MeshBasicMaterial | MeshLambertMaterial> {
  readonly object: Shape;
  protected readonly material: Paint;

  constructor(object: Shape, material: Paint) {
    this.object = object;
    this.material = material;
  }

  /** Put it at a point [m]; false where the point is no number. */
  move(point: number[]): boolean {
    const known = point.every(Number.isFinite);
    if (known) this.object.position.set(point[0]!, point[1]!, point[2]!);
    return known;
  }

  paint(look: Look): void {
    this.material.color = new Color(look.color);
  }
}

/** A jack of three bars with a ring, or an octahedron for the governed reference. */
export class Marker extends PointMark<Group, MeshBasicMaterial> {
  constructor(shape: "cross" | "octahedron", size: number) {
    super(new Group(), flat(0.9));
    if (shape === "octahedron") {
      const body = new Mesh(new OctahedronGeometry(0.55 * size), this.material);
      this.material.wireframe = true;
      this.object.add(body);
    } else {
      for (let i = 0; i < 3; i++) {
        const bar = new Mesh(new CylinderGeometry(0.05 * size, 0.05 * size, 2 * size, 8), this.material);
        const end = new Vector3().setComponent(i, size);
        along(bar, end.clone().negate(), end);
        const ring = new Mesh(new TorusGeometry(0.62 * size, 0.035 * size, 6, 40), this.material);
        along(ring, new Vector3(), new Vector3());
        if (i === 0) ring.rotation.y = Math.PI / 2;
        if (i === 1) ring.rotation.x = Math.PI / 2;
        this.object.add(bar, ring);
      }
    }
    this.object.traverse((part) => {
      part.renderOrder = 4;
    });
  }
}

/** A translucent ball. */
export class Ball extends PointMark<Mesh, MeshLambertMaterial> {
  constructor(radius: number) {
    const material = new MeshLambertMaterial({ transparent: true, opacity: 0.55, depthTest: false, depthWrite: false });
    super(new Mesh(new SphereGeometry(radius, 28, 18), material), material);
    this.object.renderOrder = 2;
  }
}

/** An arrow from the end effector in the direction of the force on it; its group may be scaled. */
export class Arrow {
  readonly group = new Group();
  /** Direction and length of the arrow before scaling. */
  readonly reach = new Vector3();
  #material = flat(0.95);
  #shaft = new Mesh(new CylinderGeometry(0.028, 0.028, 1, 12), this.#material);
  #head = new Mesh(new ConeGeometry(0.085, HEAD, 20), this.#material);

  constructor() {
    this.group.add(this.#shaft, this.#head);
    this.group.traverse((part) => {
      part.renderOrder = 6;
    });
  }

  /**
   * @param from where it starts [m]
   * @param force its direction [N]
   * @param share its size as a share of the largest force; nothing is shown below 1e-3
   */
  move(from: number[], force: number[], share: number): boolean {
    this.group.visible = share > 1e-3 && from.every(Number.isFinite);
    if (!this.group.visible) return false;
    const length = Math.max(share, 0.2);
    const head = Math.min(HEAD, 0.6 * length);
    this.group.position.set(from[0]!, from[1]!, from[2]!);
    this.reach.set(force[0]!, force[1]!, force[2]!).setLength(length);
    const neck = this.reach.clone().setLength(length - head);
    along(this.#shaft, new Vector3(), neck);
    this.#shaft.scale.set(1, length - head, 1);
    along(this.#head, neck, this.reach);
    this.#head.scale.setScalar(head / HEAD);
    return true;
  }

  paint(look: Look): void {
    this.#material.color = new Color(look.color);
  }
}
