/** The window into the scene: renderer, camera and lights. It draws only when something has changed. */

import { AmbientLight, Color, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { el } from "../dom.ts";

/** A word in the scene, at a point [m] of the world. */
export interface Tag {
  element: HTMLElement;
  point: Vector3;
  shown: boolean;
}

/** Between two pictures of a motion [ms]: longer than this is slow, longer than the second is no motion. */
const SLOW = [70, 500] as const;

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(38, 1, 0.005, 200);
  readonly controls: OrbitControls;
  #renderer: WebGLRenderer;
  #place: HTMLElement;
  #tags: Tag[] = [];
  #asked = false;
  #inset = 0;
  #last = 0;
  #slow = 0;
  #ratio = Math.min(devicePixelRatio || 1, 2);
  #before = new Set<() => void>();

  /** Throws where the browser has no WebGL. */
  constructor(place: HTMLElement) {
    this.#place = place;
    const canvas = el("canvas");
    const context = canvas.getContext("webgl2", { antialias: true, stencil: false, powerPreference: "low-power" });
    if (!context) throw new Error("no WebGL");
    this.#renderer = new WebGLRenderer({ canvas, context });
    this.#renderer.setPixelRatio(this.#ratio);
    this.#renderer.domElement.setAttribute("aria-label", "the arm in 3D; drag to orbit, wheel to zoom");
    this.#renderer.domElement.setAttribute("role", "img");
    place.append(this.#renderer.domElement);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.#renderer.domElement);
    this.controls.enableDamping = false;
    this.controls.minDistance = 0.03;
    this.controls.maxDistance = 60;
    this.controls.addEventListener("change", () => this.ask());
    const key = new DirectionalLight(0xffffff, 1.7);
    key.position.set(2, -3, 5);
    const fill = new DirectionalLight(0xffffff, 0.6);
    fill.position.set(-3, 2, 1);
    const sky = new HemisphereLight(0xffffff, 0x8d99a6, 0.9);
    sky.position.set(0, 0, 1);
    this.scene.add(key, fill, sky, new AmbientLight(0xffffff, 0.25));
    new ResizeObserver(() => this.#fit()).observe(place);
    this.#fit();
  }

  /** Width over height of the part of the picture that nothing covers. */
  get aspect(): number {
    const { clientWidth: width, clientHeight: height } = this.#place;
    return Math.max(width - this.#inset, 1) / Math.max(height, 1);
  }

  get canvas(): HTMLCanvasElement {
    return this.#renderer.domElement;
  }

  /** Called before each picture, e.g. to place what depends on the camera. */
  onPicture(listener: () => void): void {
    this.#before.add(listener);
  }

  /** Keep a strip at the left [px] free: the middle of the picture moves to the right. */
  inset(left: number): void {
    if (left === this.#inset) return;
    this.#inset = left;
    this.#fit();
  }

  ground(color: string): void {
    this.scene.background = new Color(color);
    this.ask();
  }

  /** A word that follows a point of the world. */
  tag(className: string): Tag {
    const tag = { element: el("span", { class: `tag ${className}`, "aria-hidden": "true" }), point: new Vector3(), shown: true };
    this.#tags.push(tag);
    this.#place.append(tag.element);
    return tag;
  }

  /** Ask for a new picture; asking often costs one. */
  ask(): void {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame((now) => {
      this.#asked = false;
      this.#pace(now);
      if (this.#place.clientWidth === 0) return;
      this.#before.forEach((listener) => listener());
      this.#renderer.render(this.scene, this.camera);
      this.#tags.forEach((tag) => this.#put(tag));
    });
  }

  /** Full sharpness again, e.g. when the run stands still. */
  sharpen(): void {
    this.#slow = 0;
    this.#sharpness(1);
  }

  /** On a machine that cannot keep up, a coarser picture moves better than a sharp one. */
  #pace(now: number): void {
    const gap = now - this.#last;
    this.#last = now;
    if (gap > SLOW[1]) return;
    this.#slow = gap > SLOW[0] ? this.#slow + 1 : Math.max(this.#slow - 1, 0);
    if (this.#slow < 8) return;
    this.#slow = 0;
    this.#sharpness(0.7);
  }

  #sharpness(share: number): void {
    const ratio = share * this.#ratio;
    if (ratio !== this.#renderer.getPixelRatio()) this.#renderer.setPixelRatio(ratio);
  }

  /** Where a point [m] of the world is seen, in pixels of the page. */
  onScreen(point: Vector3): { x: number; y: number } {
    this.camera.updateMatrixWorld();
    const seen = point.clone().project(this.camera);
    const box = this.canvas.getBoundingClientRect();
    return { x: box.left + ((seen.x + 1) / 2) * box.width, y: box.top + ((1 - seen.y) / 2) * box.height };
  }

  #put(tag: Tag): void {
    const seen = tag.point.clone().project(this.camera);
    const inside = tag.shown && Math.abs(seen.x) < 1.02 && Math.abs(seen.y) < 1.02 && seen.z < 1;
    tag.element.hidden = !inside;
    if (!inside) return;
    const x = ((seen.x + 1) / 2) * this.#place.clientWidth;
    const y = ((1 - seen.y) / 2) * this.#place.clientHeight;
    tag.element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }

  #fit(): void {
    const { clientWidth: width, clientHeight: height } = this.#place;
    if (width === 0 || height === 0) return;
    this.#renderer.setSize(width, height);
    this.camera.aspect = width / height;
    if (this.#inset > 0) this.camera.setViewOffset(width, height, -this.#inset / 2, 0, width, height);
    else this.camera.clearViewOffset();
    this.camera.updateProjectionMatrix();
    this.ask();
  }
}
