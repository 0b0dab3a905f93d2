/** The one clock of the page: time, playing and speed, with those who want to know. */

import type { Numbers } from "./data.ts";
import { rowAt } from "./sampling.ts";

export const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4];

type Listener = () => void;

export class Timeline {
  readonly start: number;
  readonly end: number;
  /** Times of the frames [s]. */
  readonly frames: Numbers;
  #time: number;
  #speed = 1;
  #playing = false;
  #last = 0;
  #moved = new Set<Listener>();
  #changed = new Set<Listener>();

  /** @param frames times of the frames [s], rising */
  constructor(frames: Numbers) {
    this.frames = frames;
    this.start = frames[0] ?? 0;
    this.end = frames[frames.length - 1] ?? 0;
    this.#time = this.start;
  }

  /** [s] */
  get time(): number {
    return this.#time;
  }

  get playing(): boolean {
    return this.#playing;
  }

  /** Seconds of the run per second of the watch. */
  get speed(): number {
    return this.#speed;
  }

  /** Called after each change of the time. */
  onMove(listener: Listener): void {
    this.#moved.add(listener);
  }

  /** Called after play, pause and a change of speed. */
  onChange(listener: Listener): void {
    this.#changed.add(listener);
  }

  /** Go to time t [s]; kept inside the run, and something that is no number is ignored. */
  seek(t: number): void {
    if (!Number.isFinite(t)) return;
    const time = Math.min(Math.max(t, this.start), this.end);
    if (time === this.#time) return;
    this.#time = time;
    this.#moved.forEach((listener) => listener());
  }

  /** Go by a number of frames, from the frame at or before the present time. */
  step(frames: number): void {
    const row = rowAt(this.frames, this.#time);
    const between = this.frames[row]! < this.#time && frames < 0 ? 1 : 0;
    this.pause();
    this.seek(this.frames[Math.min(Math.max(row + frames + between, 0), this.frames.length - 1)]!);
  }

  /** Play in real time times the speed; from the end it starts again. */
  play(): void {
    if (this.#playing || this.end <= this.start) return;
    if (this.#time >= this.end) this.seek(this.start);
    this.#playing = true;
    this.#last = performance.now();
    this.#changed.forEach((listener) => listener());
    requestAnimationFrame(this.#tick);
  }

  pause(): void {
    if (!this.#playing) return;
    this.#playing = false;
    this.#changed.forEach((listener) => listener());
  }

  toggle(): void {
    if (this.#playing) this.pause();
    else this.play();
  }

  setSpeed(speed: number): void {
    if (!(speed > 0) || !Number.isFinite(speed)) return;
    this.#speed = speed;
    this.#changed.forEach((listener) => listener());
  }

  /** The next speed up (+1) or down (-1) of the list. */
  shiftSpeed(way: 1 | -1): void {
    const next = way > 0 ? SPEEDS.find((s) => s > this.#speed) : SPEEDS.findLast((s) => s < this.#speed);
    if (next !== undefined) this.setSpeed(next);
  }

  #tick = (now: number): void => {
    if (!this.#playing) return;
    // A page that lay in the background comes back with one long step, which nobody has watched.
    const passed = Math.min(Math.max(now - this.#last, 0), 1000) / 1000;
    this.#last = Math.max(now, this.#last);
    this.seek(this.#time + passed * this.#speed);
    if (this.#time >= this.end) this.pause();
    else requestAnimationFrame(this.#tick);
  };
}
