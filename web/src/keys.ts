/** The keys of the page. */

import type { Timeline } from "./timeline.ts";

/** Keys and what they do, as the page lists them. */
export const KEYS: [string[], string][] = [
  [["space"], "play or pause"],
  [["←", "→"], "one frame back or on"],
  [["shift ←", "shift →"], "one second back or on"],
  [["home", "end"], "start or end of the run"],
  [["w"], "the worst moment; once more: zoom to it"],
  [["+", "−"], "faster or slower"],
  [["1", "2"], "look at the whole arm, or at the end effector from near by"],
  [["f"], "keep looking at the end effector, or stop that"],
  [["i", "o"], "zoom the diagrams in at the play time, or out"],
  [["z"], "show all times in the diagrams"],
  [["?"], "this list"],
];

export interface Actions {
  worst: () => void;
  keys: () => void;
  whole: () => void;
  closeUp: () => void;
  follow: () => void;
  allTimes: () => void;
  /** Zoom by this factor, less than 1 to see a shorter time. */
  zoom: (factor: number) => void;
}

/** Controls that need a key for themselves. */
function takes(target: EventTarget | null, key: string): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.matches("select, textarea, input:not([type=range], [type=checkbox])")) return true;
  if (target.matches("input[type=range]:not(.time)")) return /^(Arrow|Home|End|Page)/.test(key);
  return key === " " && target.matches("button, summary, input[type=checkbox]");
}

export function listenToKeys(timeline: Timeline, actions: Actions): void {
  const acts: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => timeline.toggle(),
    ArrowLeft: (event) => (event.shiftKey ? timeline.seek(timeline.time - 1) : timeline.step(-1)),
    ArrowRight: (event) => (event.shiftKey ? timeline.seek(timeline.time + 1) : timeline.step(1)),
    Home: () => timeline.seek(timeline.start),
    End: () => timeline.seek(timeline.end),
    "+": () => timeline.shiftSpeed(1),
    "=": () => timeline.shiftSpeed(1),
    "-": () => timeline.shiftSpeed(-1),
    w: actions.worst,
    f: actions.follow,
    i: () => actions.zoom(0.5),
    o: () => actions.zoom(2),
    z: actions.allTimes,
    "1": actions.whole,
    "2": actions.closeUp,
    "?": actions.keys,
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const act = Object.hasOwn(acts, event.key) ? acts[event.key] : undefined;
    if (!act || takes(event.target, event.key)) return;
    event.preventDefault();
    act(event);
  });
}
