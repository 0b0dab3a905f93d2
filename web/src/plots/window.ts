/** The stretch of time all diagrams show, and the time the pointer is at. */

export class Window {
  readonly start: number;
  readonly end: number;
  #range: [number, number];
  #pointer: number | null = null;
  #zoomed = new Set<() => void>();
  #pointed = new Set<() => void>();

  /** @param start,end of the run [s] */
  constructor(start: number, end: number) {
    this.start = start;
    this.end = end > start ? end : start + 1;
    this.#range = [this.start, this.end];
  }

  /** [s] */
  get range(): readonly [number, number] {
    return this.#range;
  }

  get whole(): boolean {
    return this.#range[0] === this.start && this.#range[1] === this.end;
  }

  /** Where the pointer is [s]; null where it is over no diagram. */
  get pointer(): number | null {
    return this.#pointer;
  }

  onZoom(listener: () => void): void {
    this.#zoomed.add(listener);
  }

  onPoint(listener: () => void): void {
    this.#pointed.add(listener);
  }

  /** Show from..to [s], kept inside the run and not shorter than a millisecond. */
  zoom(from: number, to: number): void {
    const low = Math.max(Math.min(from, to), this.start);
    const high = Math.min(Math.max(from, to), this.end);
    if (!(high - low >= 1e-3) || (low === this.#range[0] && high === this.#range[1])) return;
    this.#range = [low, high];
    this.#zoomed.forEach((listener) => listener());
  }

  /** Show a stretch of so many times the present length, with time t [s] in its middle as far as the run allows. */
  scale(t: number, factor: number): void {
    const length = Math.min(factor * (this.#range[1] - this.#range[0]), this.end - this.start);
    const low = Math.min(Math.max(t - length / 2, this.start), this.end - length);
    this.zoom(low, low + length);
  }

  /** Show the whole run again. */
  reset(): void {
    this.zoom(this.start, this.end);
  }

  point(time: number | null): void {
    if (time === this.#pointer) return;
    this.#pointer = time;
    this.#pointed.forEach((listener) => listener());
  }
}
