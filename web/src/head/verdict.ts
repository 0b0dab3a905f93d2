/** Whether the run was passive, in one word and one sentence, and the way to its worst moment. */

import { button, el } from "../dom.ts";
import { clock, withUnit } from "../numbers.ts";
import type { Verdict } from "../report.ts";

/** A sign beside the word, so that the colour is not needed. */
const SIGNS: Record<Verdict["verdict"], string> = { passive: "✓", violated: "✗", inconclusive: "?" };

export function badge(verdict: Verdict): HTMLElement {
  const known = Object.hasOwn(SIGNS, verdict.verdict);
  return el("strong", { class: `badge ${known ? verdict.verdict : "inconclusive"}` }, `${known ? SIGNS[verdict.verdict] : "?"} ${verdict.verdict}`);
}

/** The words of the jump to the worst moment, or null where the verdict names none. */
export function worstWords(verdict: Verdict | null): string | null {
  if (!verdict || verdict.worst_time === null) return null;
  const margin = verdict.margin === null ? "" : `, margin ${withUnit(verdict.margin, "J", 3)}`;
  return `go to the worst moment (t = ${clock(verdict.worst_time)} s${margin})`;
}

/** The button that jumps there. */
export function worstButton(verdict: Verdict | null, go: () => void): HTMLElement | null {
  const words = worstWords(verdict);
  if (!words) return null;
  const made = button("", `${words} (w); once more: zoom to it`, go, "worst");
  made.append(el("span", { class: "long" }, words), el("span", { class: "short" }, "worst moment"));
  return made;
}
