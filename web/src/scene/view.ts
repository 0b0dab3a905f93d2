/** The left part of the page: the scene with its buttons, its list of what is shown, and the magnifier. */

import { Vector3 } from "three";
import type { Report } from "../data.ts";
import { button, el, say } from "../dom.ts";
import { magnified, momentAt, type Moment } from "../motion.ts";
import type { Theme } from "../theme.ts";
import type { Timeline } from "../timeline.ts";
import { layerList } from "./layers.ts";
import { Magnifier } from "./magnifier.ts";
import { Stage } from "./stage.ts";
import type { Drawn } from "./surfaces.ts";
import { look, pathExtent, sideOf, wholeExtent } from "./views.ts";
import { World } from "./world.ts";

/** Height of the scene [px] from which all its panes are open at once. */
const ROOMY = 460;

/** Distance of the pointer from a joint [px] at which the joint is meant. */
const NEAR = 26;

/** Least time between two writings of the numbers while the run plays [ms]. */
const READING = 100;

export class SceneView {
  readonly element = el("section", { class: "scene", "aria-label": "the arm in 3D" });
  #report: Report;
  #theme: Theme;
  #timeline: Timeline;
  #stage: Stage | null = null;
  #world: World | null = null;
  #magnifier: Magnifier;
  #moment: Moment;
  #follow = false;
  #read = -Infinity;
  #followButton = button("follow", "keep looking at the end effector (f)", () => this.toggleFollow());
  #hint = el("div", { class: "hint", hidden: true });

  constructor(report: Report, theme: Theme, timeline: Timeline) {
    [this.#report, this.#theme, this.#timeline] = [report, theme, timeline];
    this.#moment = momentAt(report.header.arm, report.frames, timeline.time);
    this.#magnifier = new Magnifier(report, () => this.move());
    this.#followButton.setAttribute("aria-pressed", "false");
    timeline.onMove(() => this.move());
    timeline.onChange(() => {
      if (!timeline.playing) this.#stage?.sharpen();
      this.move();
    });
  }

  /** Build the picture; the element must be on the page. Where there is no WebGL, say so instead. */
  start(): void {
    try {
      this.#stage = new Stage(this.element);
    } catch {
      this.#withoutPicture();
      return;
    }
    this.#world = new World(this.#report, this.#theme, this.#stage);
    const { arm } = this.#report.header;
    const roomy = this.element.clientHeight > ROOMY;
    const list = layerList(this.#world.layers, () => this.move());
    list.paint();
    const legend = el("details", { class: "pane shown", open: roomy }, el("summary", {}, "shown"), list.element);
    this.element.append(this.#viewButtons(), legend, this.#hint);
    if (!arm) {
      const note = "This run file carries no description of the arm: only path, reference and ghosts are shown.";
      this.element.append(el("p", { class: "scene-note" }, note));
    } else {
      this.#magnifier.element.open = roomy;
      this.element.append(this.#magnifier.element);
      this.#listen();
    }
    this.#theme.onChange(() => {
      this.#world?.paint();
      list.paint();
      this.move();
    });
    this.#stage.canvas.addEventListener("webglcontextlost", () => {
      say(this.#hint, "The 3D picture was lost by the browser; load the page again to have it back.");
      this.#hint.hidden = false;
    });
    const { element: magnifier } = this.#magnifier;
    // Where there is no room for both, opening one closes the other.
    const alone = (opened: HTMLDetailsElement, other: HTMLDetailsElement) => {
      if (opened.open && this.element.clientHeight <= ROOMY) other.open = false;
    };
    legend.addEventListener("toggle", () => alone(legend, magnifier));
    magnifier.addEventListener("toggle", () => alone(magnifier, legend));
    const inset = () => this.#stage?.inset(legend.open || (arm && magnifier.open) ? 0.8 * legend.offsetWidth : 0);
    legend.addEventListener("toggle", inset);
    magnifier.addEventListener("toggle", inset);
    inset();
    this.whole();
    this.move();
  }

  #withoutPicture(): void {
    const text = "This browser shows no 3D picture: WebGL is missing or switched off. The diagrams work without it.";
    this.element.append(el("p", { class: "missing" }, text));
    if (this.#report.header.arm) {
      this.#magnifier.element.open = true;
      this.element.append(this.#magnifier.element);
    }
    this.move();
  }

  #viewButtons(): HTMLElement {
    return el(
      "div",
      { class: "diagrams" },
      button("whole arm", "look at the whole arm (1)", () => this.whole()),
      button("close-up", "look at the end effector from near by (2)", () => this.closeUp()),
      this.#followButton,
    );
  }

  /** Keep looking at the end effector, or stop that. */
  toggleFollow(): void {
    this.#follow = !this.#follow;
    this.#followButton.setAttribute("aria-pressed", String(this.#follow));
    if (this.#follow) this.#lookAtTip();
    this.#stage?.ask();
  }

  whole(): void {
    const extent = wholeExtent(this.#report.header.arm, this.#report.frames);
    if (this.#stage) look(this.#stage, { ...extent, radius: 0.95 * extent.radius }, sideOf(extent));
  }

  closeUp(): void {
    const [all, path] = [wholeExtent(this.#report.header.arm, this.#report.frames), pathExtent(this.#report.frames)];
    if (this.#stage) look(this.#stage, { center: path.center, radius: Math.max(1.25 * path.radius, 0.05 * all.radius) });
  }

  /** Where the end effector is [m], by the viewer's own kinematics where the arm is known. */
  get tip(): number[] {
    return [...this.#moment.tip];
  }

  /** Where it is seen [px]; null without a picture. */
  get tipOnScreen(): { x: number; y: number } | null {
    return this.#stage && this.#stage.onScreen(new Vector3(...this.#moment.tip));
  }

  get factor(): number {
    return this.#magnifier.factor;
  }

  set factor(factor: number) {
    this.#magnifier.set(factor);
    this.move();
  }

  /** Joint positions as drawn: links, and motors with their magnified deflection [rad or m]. */
  get drawn(): { q: number[]; motor: number[] } {
    return { q: [...this.#moment.q], motor: magnified(this.#moment, this.factor) };
  }

  /** The surfaces as they are in the scene. */
  get surfaces(): Drawn[] {
    return this.#world?.surfaces ?? [];
  }

  /** Bring the scene to the time of the timeline. */
  move(): void {
    const { header, frames } = this.#report;
    this.#moment = momentAt(header.arm, frames, this.#timeline.time);
    const now = performance.now();
    if (!this.#timeline.playing || now - this.#read > READING) {
      this.#magnifier.read(this.#moment);
      this.#read = now;
    }
    this.#world?.move(this.#moment, this.#magnifier.factor);
    if (this.#follow) this.#lookAtTip();
    this.#stage?.ask();
  }

  #lookAtTip(): void {
    const tip = new Vector3(...this.#moment.tip);
    if (!this.#stage || !Number.isFinite(tip.lengthSq())) return;
    const { camera, controls } = this.#stage;
    camera.position.add(tip.clone().sub(controls.target));
    controls.target.copy(tip);
    controls.update();
  }

  /** The pointer near a joint: say its true deflection. */
  #listen(): void {
    const { canvas } = this.#stage!;
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 0) return;
      const near = this.#jointNear(event);
      this.#magnifier.point(near);
      this.#hint.hidden = near === null;
      if (near !== null) say(this.#hint, this.#magnifier.sentence(this.#moment, near));
    });
    canvas.addEventListener("pointerleave", () => {
      this.#magnifier.point(null);
      this.#hint.hidden = true;
    });
  }

  #jointNear(event: PointerEvent): number | null {
    let [best, least] = [null as number | null, NEAR];
    this.#moment.posture?.joints.forEach((pose, i) => {
      const seen = this.#stage!.onScreen(new Vector3(...pose.xyz));
      const distance = Math.hypot(seen.x - event.clientX, seen.y - event.clientY);
      if (distance < least) [best, least] = [i, distance];
    });
    return best;
  }
}
