/** What tests and the console of the browser may ask the page: `window.passiflex`. */

import type { Report } from "./data.ts";
import type { Window } from "./plots/window.ts";
import type { Header } from "./report.ts";
import { readAt } from "./sampling.ts";
import type { Drawn } from "./scene/surfaces.ts";
import type { SceneView } from "./scene/view.ts";
import type { Timeline } from "./timeline.ts";

export interface Api {
  header: Header;
  /** Play time [s]. */
  time: () => number;
  seek: (t: number) => void;
  play: () => void;
  pause: () => void;
  playing: () => boolean;
  /** Set the speed (1: real time) if one is given; the present one. */
  speed: (x?: number) => number;
  /** The stretch of time that the diagrams show [s]. */
  shownTimes: () => number[];
  /** The value of a curve at the play time, in the unit of its panel: the nearest row; null for a gap. */
  value: (kind: string, choice: string, label: string) => number | null;
  /** End effector by the viewer's own kinematics [m]. */
  tip: () => number[];
  /** Where it is seen, in pixels of the page; null without WebGL. */
  tipOnScreen: () => { x: number; y: number } | null;
  /** Set the magnification of the joint deflection if one is given; the present one. */
  magnify: (factor?: number) => number;
  /** The surfaces in the scene; empty without WebGL. */
  surfaces: () => Drawn[];
  /** Joint positions as drawn [rad or m]: of the links, and of the motors with the magnified deflection. */
  drawn: () => { q: number[]; motor: number[] };
}

declare global {
  interface Window {
    passiflex: Api;
  }
}

export function makeApi(report: Report, timeline: Timeline, shown: Window, scene: SceneView): Api {
  return {
    header: report.header,
    time: () => timeline.time,
    seek: (t) => timeline.seek(t),
    play: () => timeline.play(),
    pause: () => timeline.pause(),
    playing: () => timeline.playing,
    speed: (x) => {
      if (x !== undefined) timeline.setSpeed(x);
      return timeline.speed;
    },
    shownTimes: () => [...shown.range],
    value: (kind, choice, label) => {
      const panel = report.panels.find((p) => p.kind === kind && p.choice === choice);
      const curve = panel?.curves.find((c) => c.label === label);
      if (!curve) throw new RangeError(`no curve ${JSON.stringify([kind, choice, label])} in this report`);
      return readAt(curve.x, curve.y, timeline.time);
    },
    tip: () => scene.tip,
    tipOnScreen: () => scene.tipOnScreen,
    magnify: (factor) => {
      if (factor !== undefined) scene.factor = factor;
      return scene.factor;
    },
    surfaces: () => scene.surfaces,
    drawn: () => scene.drawn,
  };
}
