/** What touches the hand: translucent bodies, a mark where the hand touches one, and the force as an arrow. */

import { BoxGeometry, type BufferGeometry, Color, CylinderGeometry, DoubleSide, EdgesGeometry, Group, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, PlaneGeometry, SphereGeometry } from "three";
import type { Surface } from "../data.ts";
import type { Touch } from "../motion.ts";
import { shown } from "../numbers.ts";
import type { Body } from "../report.ts";
import { largestNorm } from "../sampling.ts";
import type { Look } from "../theme.ts";
import { lines } from "./floor.ts";
import { Arrow, Ball } from "./markers.ts";
import { put } from "./shapes.ts";
import type { Tag } from "./stage.ts";

/** Sides of the squares on the part of a plane that is drawn. */
const SQUARES = 8;
/** Half the side of that part, and half the length of a cylinder without ends, as shares of the arm's reach. */
const PATCH = 0.5;
const ENDLESS = 3;

/** What there is of a surface in the scene. */
export interface Drawn {
  name: string;
  /** Where its body stands [m]; null where none is seen. */
  at: number[] | null;
  /** The force whose arrow is seen [N]; null without. */
  force: number[] | null;
}

/** The geometry of a body, in its own axes. */
function geometryOf({ kind, sizes }: Body, reach: number): BufferGeometry {
  const [a, b, c] = sizes as [number, number | null, number];
  if (kind === "plane") return new PlaneGeometry(2 * PATCH * reach, 2 * PATCH * reach);
  if (kind === "sphere") return new SphereGeometry(a, 48, 32);
  if (kind === "box") return new BoxGeometry(a, b!, c);
  return new CylinderGeometry(a, a, b ?? 2 * ENDLESS * reach, 48, 1, b === null).rotateX(Math.PI / 2);
}

/** Lines on a body: squares on a plane, edges elsewhere. */
function linesOf(kind: Body["kind"], geometry: BufferGeometry, reach: number, material: LineBasicMaterial): LineSegments {
  if (kind !== "plane") return new LineSegments(new EdgesGeometry(geometry, 30), material);
  const half = PATCH * reach;
  const points: number[] = [];
  for (let i = 0; i <= SQUARES; i++) {
    const at = half * ((2 * i) / SQUARES - 1);
    points.push(at, -half, 0, at, half, 0, -half, at, 0, half, at, 0);
  }
  return lines(points, material);
}

export class SurfaceView {
  readonly group = new Group();
  readonly arrow = new Arrow();
  readonly mark = new Ball(1);
  readonly tag: Tag;
  readonly label: string;
  #surface: Surface;
  #largest: number;
  #body: Group | null = null;
  #seen = true;
  #touch: Touch | null = null;
  // Both sides are seen, and nothing is hidden behind it: the hand may be within.
  #skin = new MeshLambertMaterial({ transparent: true, opacity: 0.22, side: DoubleSide, depthWrite: false });
  #edges = new LineBasicMaterial({ transparent: true, opacity: 0.55, depthWrite: false });

  /**
   * @param reach of the arm [m]
   * @param largest force of the scene [N], that of the longest arrow
   */
  constructor(surface: Surface, reach: number, largest: number, tag: Tag) {
    [this.#surface, this.#largest, this.tag] = [surface, largest, tag];
    const { body, name } = surface;
    const kind = body && body.kind !== name ? `, ${body.kind}` : "";
    const scale = largestNorm(surface.force) > 0 ? ` (longest arrow ${shown(largest, 3)} N)` : "";
    this.label = `${name}${kind}${scale}`;
    this.group.add(this.arrow.group, this.mark.object);
    if (!body) return;
    const frame = new Group();
    put(frame, { rotation: body.rotation, xyz: body.place });
    const geometry = geometryOf(body, reach);
    frame.add(new Mesh(geometry, this.#skin), linesOf(body.kind, geometry, reach, this.#edges));
    this.#body = new Group();
    this.#body.add(frame);
    this.group.add(this.#body);
  }

  show(seen: boolean): void {
    this.#seen = seen;
    this.group.visible = seen;
  }

  /** @param tip where the hand is [m] */
  move(touch: Touch, tip: number[]): void {
    this.#touch = touch;
    const { force, pressed, shift } = touch;
    if (this.#body) {
      this.#body.visible = shift === null || shift.every(Number.isFinite);
      if (shift && this.#body.visible) this.#body.position.set(shift[0]!, shift[1]!, shift[2]!);
    }
    const size = Math.hypot(...force);
    const at = touch.point ?? tip;
    const felt = this.arrow.move(at, force, pressed && this.#largest > 0 ? size / this.#largest : 0);
    this.mark.object.visible = this.mark.move(at) && pressed;
    this.tag.shown = felt && this.#seen;
    this.tag.element.textContent = `${this.#surface.name} ${shown(size, 3)} N`;
  }

  paint(look: Look): void {
    this.#skin.color = new Color(look.color);
    this.#edges.color = new Color(look.color);
    this.arrow.paint(look);
    this.mark.paint(look);
  }

  get drawn(): Drawn {
    const body = this.#surface.body;
    const at = this.#seen && body && this.#body?.visible ? body.place.map((x, i) => x + (this.#touch?.shift?.[i] ?? 0)) : null;
    return { name: this.#surface.name, at, force: this.tag.shown ? [...this.#touch!.force] : null };
  }
}
