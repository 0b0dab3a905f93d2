import assert from "node:assert/strict";
import { test } from "node:test";
import { Timeline } from "../src/timeline.ts";

const FRAMES = Float64Array.of(0, 0.5, 1, 1.5);

/** Pictures by hand: the callbacks a browser would call. */
function pictures(): (now: number) => void {
  let waiting: FrameRequestCallback[] = [];
  globalThis.requestAnimationFrame = (callback) => waiting.push(callback);
  return (now) => {
    const due = waiting;
    waiting = [];
    due.forEach((callback) => callback(now));
  };
}

test("seeking stays inside the run and passes over what is no number", () => {
  const timeline = new Timeline(FRAMES);
  let moves = 0;
  timeline.onMove(() => moves++);
  timeline.seek(9);
  assert.equal(timeline.time, 1.5);
  timeline.seek(-1);
  timeline.seek(NaN);
  timeline.seek(0);
  assert.equal(timeline.time, 0);
  assert.equal(moves, 2);
});

test("a step goes from frame to frame, from between them to the next one on that side", () => {
  const timeline = new Timeline(FRAMES);
  timeline.seek(0.7);
  timeline.step(1);
  assert.equal(timeline.time, 1);
  timeline.seek(0.7);
  timeline.step(-1);
  assert.equal(timeline.time, 0.5);
  timeline.step(-1);
  timeline.step(-1);
  assert.equal(timeline.time, 0);
});

test("playing takes real time times the speed, and pauses at the end", () => {
  const picture = pictures();
  const timeline = new Timeline(FRAMES);
  timeline.setSpeed(2);
  timeline.play();
  const start = performance.now();
  picture(start + 100);
  assert.ok(Math.abs(timeline.time - 0.2) < 0.01, `${timeline.time}`);
  for (let i = 2; i < 12; i++) picture(start + 100 * i);
  assert.equal(timeline.time, 1.5);
  assert.equal(timeline.playing, false);
  timeline.play();
  assert.equal(timeline.time, 0);
});

test("the speed goes through its list and takes any positive number", () => {
  const timeline = new Timeline(FRAMES);
  timeline.shiftSpeed(1);
  timeline.shiftSpeed(1);
  timeline.shiftSpeed(1);
  assert.equal(timeline.speed, 4);
  timeline.setSpeed(0.3);
  timeline.shiftSpeed(-1);
  assert.equal(timeline.speed, 0.25);
  timeline.setSpeed(-1);
  timeline.setSpeed(NaN);
  assert.equal(timeline.speed, 0.25);
});
