/** Everything that is in the scene, moved to a moment of the run. */

import { Vector3 } from "three";
import type { Report } from "../data.ts";
import { forward } from "../kinematics.ts";
import { magnified, touchAt, type Moment } from "../motion.ts";
import { shown } from "../numbers.ts";
import { largestNorm, valuesAt } from "../sampling.ts";
import type { Theme } from "../theme.ts";
import { ArmView } from "./arm.ts";
import { Dials } from "./dials.ts";
import { Floor } from "./floor.ts";
import { layerOf, type Layer } from "./layers.ts";
import { Arrow, Ball, Marker } from "./markers.ts";
import { Path } from "./paths.ts";
import type { Stage, Tag } from "./stage.ts";
import { SurfaceView, type Drawn } from "./surfaces.ts";
import { pathExtent, wholeExtent } from "./views.ts";

/** Sizes on the screen of things that keep theirs while one zooms [px]. */
const PIXELS = { tip: 4.5, marker: 11, ball: 9, arrow: 95 };

type Move = (moment: Moment, factor: number) => void;

export class World {
  readonly layers: Layer[] = [];
  #moves: Move[] = [];
  #paints: (() => void)[] = [];
  #sized: { object: { scale: Vector3; position: Vector3 }; pixels: number }[] = [];
  #report: Report;
  #theme: Theme;
  #stage: Stage;
  #forces: { arrow: Arrow; tag: Tag }[] = [];
  #touchables: SurfaceView[] = [];

  constructor(report: Report, theme: Theme, stage: Stage) {
    [this.#report, this.#theme, this.#stage] = [report, theme, stage];
    const reach = wholeExtent(report.header.arm, report.frames).radius;
    this.#addArm(reach);
    this.#addPaths();
    this.#addSurfaces(reach);
    this.#addForce();
    this.#addGhosts();
    this.#addFloor(reach);
    stage.onPicture(() => this.#keepSizes());
    this.paint();
  }

  #add(layer: Layer, paint: () => void, move: Move): void {
    this.layers.push(layer);
    this.#paints.push(paint);
    this.#moves.push(move);
    layer.set(layer.seen);
  }

  #addArm(reach: number): void {
    const { arm } = this.#report.header;
    if (!arm) return;
    const theme = this.#theme;
    const ink = (name: string) => () => ({ color: theme.css(name), width: 4, dash: [] });
    const main = new ArmView(arm, 1);
    const motor = new ArmView(arm, 0.38);
    const dials = new Dials(arm, 2 * reach);
    this.#stage.scene.add(main.group, motor.group, dials.group);
    const inner = (group: { visible: boolean }, label: string, name: string, seen: boolean): Layer => ({
      label,
      look: ink(name),
      seen,
      set: (now) => (group.visible = now),
    });
    const armLayer = inner(main.group, "arm", "--arm-link", true);
    this.#add(armLayer, () => main.paint(theme), ({ posture }) => {
      main.group.visible = armLayer.seen && posture !== null;
      if (posture) main.move(posture);
    });
    const dialLayer = inner(dials.group, "dials: link q, motor θ", "--dial-motor", true);
    this.#add(dialLayer, () => dials.paint(theme), (moment, factor) => {
      const angles = magnified(moment, factor);
      const readable = moment.posture !== null && angles.every(Number.isFinite);
      dials.group.visible = dialLayer.seen && readable;
      if (moment.posture && readable) dials.move(moment.posture, moment.q, angles);
    });
    const motorLayer = inner(motor.group, "motor arm, magnified", "--dial-motor", false);
    this.#add(motorLayer, () => motor.tint(theme.css("--dial-motor")), (moment, factor) => {
      const angles = magnified(moment, factor);
      motor.group.visible = motorLayer.seen && angles.every(Number.isFinite);
      if (motor.group.visible) motor.move(forward(arm, angles));
    });
  }

  #addPaths(): void {
    const { frames } = this.#report;
    const theme = this.#theme;
    const length = Math.max(pathExtent(frames).radius, 0.02);
    const path = (label: string, table: typeof frames.position, roles: string[], dashed: boolean, marker: Marker | Ball, pixels: number, at: (m: Moment) => number[] | null) => {
      const line = new Path(table, dashed, length);
      const look = () => theme.look(...roles);
      line.group.add(marker.object);
      this.#sized.push({ object: marker.object, pixels });
      this.#stage.scene.add(line.group);
      const paint = () => {
        line.paint(look());
        marker.paint(look());
      };
      this.#add(layerOf(label, line.group, look), paint, (moment) => {
        line.move(moment.place);
        const point = at(moment);
        marker.object.visible = point !== null && marker.move(point);
      });
    };
    path("end-effector path", frames.position, ["proposed"], false, new Ball(1), PIXELS.tip, (m) => m.tip);
    if (frames.reference) path("reference", frames.reference, ["reference"], true, new Marker("cross", 1), PIXELS.marker, (m) => m.reference);
    if (frames.governed) path("governed reference", frames.governed, ["governed"], true, new Marker("octahedron", 1), PIXELS.marker, (m) => m.governed);
  }

  #addForce(): void {
    const { force, moment: turning } = this.#report.frames;
    const largest = Math.max(largestNorm(force), this.#strongest());
    if (!force || !(largestNorm(force) > 1e-9)) return;
    const turns = largestNorm(turning) > 1e-9;
    const arrow = new Arrow();
    const tag = this.#stage.tag("force");
    this.#stage.scene.add(arrow.group);
    this.#sized.push({ object: arrow.group, pixels: PIXELS.arrow });
    this.#forces.push({ arrow, tag });
    const look = () => ({ ...this.#theme.look("environment"), color: this.#theme.css("--span-force"), width: 3, dash: [] });
    const layer: Layer = { label: this.#report.surfaces.length > 0 ? "external force, other" : "external force", look, seen: true, set: (seen) => (arrow.group.visible = seen) };
    this.#add(layer, () => arrow.paint(look()), (moment) => {
      const f = moment.force!;
      const size = Math.hypot(...f);
      tag.shown = arrow.move(moment.tip, f, size / largest) && layer.seen;
      arrow.group.visible = tag.shown;
      const torque = turns ? `, ${shown(Math.hypot(...moment.moment!), 3)} N m` : "";
      tag.element.textContent = `${shown(size, 3)} N${torque}`;
    });
  }

  /** Bodies, and arrows of their forces; all arrows of the scene share one scale. */
  #addSurfaces(reach: number): void {
    const { surfaces, frames } = this.#report;
    const largest = Math.max(largestNorm(frames.force), this.#strongest());
    for (const surface of surfaces) {
      const view = new SurfaceView(surface, reach, largest, this.#stage.tag("force contact"));
      this.#touchables.push(view);
      this.#forces.push(view);
      this.#stage.scene.add(view.group);
      this.#sized.push({ object: view.arrow.group, pixels: PIXELS.arrow }, { object: view.mark.object, pixels: PIXELS.ball });
      const look = () => ({ ...this.#theme.look(surface.role), width: 4, dash: [] });
      const layer: Layer = { label: view.label, look, seen: true, set: (seen) => view.show(seen) };
      this.#add(layer, () => view.paint(look()), (moment) => view.move(touchAt(surface, moment.place), moment.tip));
    }
  }

  /** Largest force of a surface [N]. */
  #strongest(): number {
    return Math.max(0, ...this.#report.surfaces.map(({ force }) => largestNorm(force)));
  }

  /** The surfaces as they are in the scene. */
  get surfaces(): Drawn[] {
    return this.#touchables.map((view) => view.drawn);
  }

  #addGhosts(): void {
    const { ghosts, header, frames } = this.#report;
    const length = Math.max(pathExtent(frames).radius, 0.02);
    for (const ghost of ghosts) {
      const look = () => this.#theme.look(ghost.role);
      const line = new Path(ghost.position, true, length);
      const ball = new Ball(1);
      const arm = ghost.q && header.arm ? new ArmView(header.arm, 0.3) : null;
      line.group.add(ball.object);
      if (arm) line.group.add(arm.group);
      this.#sized.push({ object: ball.object, pixels: PIXELS.ball });
      this.#stage.scene.add(line.group);
      const paint = () => {
        line.paint(look());
        ball.paint(look());
        arm?.tint(look().color);
      };
      this.#add(layerOf(`ghost: ${ghost.label}`, line.group, look), paint, ({ place }) => {
        line.move(place);
        ball.object.visible = ball.move(valuesAt(ghost.position, place));
        if (!arm || !ghost.q || !header.arm) return;
        const q = valuesAt(ghost.q, place);
        arm.group.visible = q.every(Number.isFinite);
        if (arm.group.visible) arm.move(forward(header.arm, q));
      });
    }
  }

  #addFloor(reach: number): void {
    const floor = new Floor(this.#stage, Math.max(1.1 * reach, 0.02), this.#middle());
    this.#stage.scene.add(floor.group);
    const look = () => ({ color: this.#theme.css("--floor"), width: 2, dash: [] });
    const layer: Layer = { label: "floor and scale", look, seen: true, set: (seen) => floor.show(seen) };
    this.#add(layer, () => floor.paint(this.#theme), () => undefined);
  }

  /** Where the floor lies: under the base, or under the path where no base is known [m]. */
  #middle(): [number, number, number] {
    if (this.#report.header.arm) return [0, 0, 0];
    const { center, radius } = pathExtent(this.#report.frames);
    return [center.x, center.y, center.z - radius];
  }

  /** Move all to a moment, the deflection magnified by a factor. */
  move(moment: Moment, factor: number): void {
    this.#moves.forEach((move) => move(moment, factor));
  }

  /** Take the colours of the present tone. */
  paint(): void {
    this.#paints.forEach((paint) => paint());
    this.#stage.ground(this.#theme.css("--scene"));
  }

  #keepSizes(): void {
    const { camera } = this.#stage;
    const perPixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(this.#stage.canvas.clientHeight, 1);
    for (const { object, pixels } of this.#sized) {
      object.scale.setScalar(Math.max(perPixel * pixels * object.position.distanceTo(camera.position), 1e-6));
    }
    for (const { arrow, tag } of this.#forces) {
      tag.point.copy(arrow.reach).multiplyScalar(arrow.group.scale.x).add(arrow.group.position);
    }
  }
}
