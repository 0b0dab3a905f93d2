import assert from "node:assert/strict";
import { test } from "node:test";
import type { Curve, Panel } from "../src/data.ts";
import { core, extent, liveliest, rangeWith, spiky } from "../src/plots/ranges.ts";
import { joined } from "../src/plots/series.ts";
import { Window } from "../src/plots/window.ts";

function curve(role: string, y: number[]): Curve {
  return { label: role, role, time: 0, values: { dtype: "f32", offset: 0, shape: [y.length] }, x: Float64Array.from(y, (_, i) => i), y: Float32Array.from(y) };
}

test("curves of one grid share it, curves of two are put on one, and a gap stays a gap", () => {
  const [a, b] = [curve("a", [1, NaN, 3]), curve("b", [4, 5, 6])];
  b.x = a.x;
  assert.deepEqual(joined([a, b]), [[0, 1, 2], [1, null, 3], [4, 5, 6]]);
  const c = { ...curve("c", [7, NaN]), x: Float64Array.of(0.5, 2) };
  assert.deepEqual(joined([c, a]), [[0, 0.5, 1, 2], [undefined, 7, undefined, null], [1, undefined, null, 3]]);
});

test("the extent passes over gaps", () => {
  assert.deepEqual(extent([curve("a", [NaN, 1, -2]), curve("b", [3, NaN, NaN])]), [-2, 3]);
  assert.equal(extent([curve("a", [NaN])]), null);
});

test("a level near the curves is in the picture, a far one is not", () => {
  const inside = (range: [number, number], value: number) => range[0] < value && value < range[1];
  assert.ok(inside(rangeWith(0.5, 2, [0.01]), 0.01));
  assert.ok(!inside(rangeWith(-5, 5, [320, -320]), 320));
  const still = rangeWith(0, 0, []);
  assert.ok(still[0] < 0 && still[1] > 0);
});

test("the first diagram shown is that whose reference moves most", () => {
  const panel = (y: number[]) => ({ curves: [curve("reference", y), curve("proposed", [0, 99])] }) as unknown as Panel;
  assert.equal(liveliest([panel([0, 0]), panel([0, 0.1]), panel([0, 0.05])]), 1);
  assert.equal(liveliest([{ curves: [curve("tank", [1, 2])] } as unknown as Panel]), 0);
});

test("the window stays inside the run and tells of changes only", () => {
  const window = new Window(0, 30);
  let calls = 0;
  window.onZoom(() => calls++);
  window.zoom(12, -5);
  assert.deepEqual(window.range, [0, 12]);
  window.zoom(0, 12);
  window.zoom(3, 3.0001);
  assert.equal(calls, 1);
  window.reset();
  assert.ok(window.whole);
});

test("the window is scaled about a time, and stays inside the run", () => {
  const window = new Window(0, 30);
  window.scale(10, 0.5);
  assert.deepEqual(window.range, [2.5, 17.5]);
  window.scale(3, 0.5);
  assert.deepEqual(window.range, [0, 7.5]);
  window.scale(29, 2);
  assert.deepEqual(window.range, [15, 30]);
  window.scale(20, 8);
  assert.ok(window.whole);
});

test("spikes are left out of the range that is most of the values", () => {
  const wave = Array.from({ length: 1000 }, (_, i) => Math.sin(i));
  const spiked = wave.map((value, i) => (i === 500 ? 80 : value));
  const [low, high] = core([curve("a", spiked).y])!;
  assert.ok(low > -1.001 && low < -0.9 && high > 0.9 && high < 1.001);
  assert.deepEqual(core([[1, null, undefined, 3, 9]], 0, 3), [1, 3]);
  assert.equal(core([[null, NaN]]), null);
  assert.ok(spiky([curve("a", spiked)]));
  assert.ok(!spiky([curve("a", wave)]));
  assert.ok(!spiky([curve("a", [NaN, NaN])]));
});
