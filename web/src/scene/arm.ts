/** The solids of an arm, moved by joint positions. */

import { Color, Group, MeshLambertMaterial, MeshPhongMaterial, type Material } from "three";
import type { Posture } from "../kinematics.ts";
import type { Arm } from "../report.ts";
import type { Theme } from "../theme.ts";
import { meshOf, put } from "./shapes.ts";

export class ArmView {
  readonly group = new Group();
  #bodies: Group[] = [];
  #materials: Record<"link" | "joint" | "tool", MeshPhongMaterial | MeshLambertMaterial>;

  /** @param opacity 1 for the arm itself, less for a ghost */
  constructor(arm: Arm, opacity: number) {
    // Where a ghost lies in the arm, the arm is what one sees.
    const make = (): MeshPhongMaterial | MeshLambertMaterial =>
      opacity === 1
        ? new MeshPhongMaterial({ shininess: 28, specular: 0x3a4148 })
        : new MeshLambertMaterial({ transparent: true, opacity, depthWrite: false, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 150 });
    this.#materials = { link: make(), joint: make(), tool: make() };
    for (const solids of arm.solids) {
      const body = new Group();
      for (const solid of solids) {
        // A ghost is an outline of the arm: housings within the links would only make it muddy.
        if (opacity < 1 && solid.part === "joint") continue;
        body.add(meshOf(solid, this.#materials[solid.part] as Material));
      }
      this.#bodies.push(body);
      this.group.add(body);
    }
  }

  move(posture: Posture): void {
    this.#bodies.forEach((body, i) => {
      const pose = posture.bodies[i];
      if (pose) put(body, pose);
    });
  }

  /** Colours of the arm itself. */
  paint(theme: Theme): void {
    this.#materials.link.color = new Color(theme.css("--arm-link"));
    this.#materials.joint.color = new Color(theme.css("--arm-joint"));
    this.#materials.tool.color = new Color(theme.css("--arm-tool"));
  }

  /** One colour for all parts of a ghost. */
  tint(color: string): void {
    for (const material of Object.values(this.#materials)) material.color = new Color(color);
  }
}
