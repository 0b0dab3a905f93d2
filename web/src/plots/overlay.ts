/** What lies under and over the curves of a diagram: bands, levels and marks, with their words. */

import type uPlot from "uplot";
import type { Panel } from "../data.ts";
import { withUnit } from "../numbers.ts";
import type { Level, Span } from "../report.ts";
import type { Theme } from "../theme.ts";

/** Slope of the hatching, so that a band can be told by more than its colour; 0: outline only. */
const HATCH: Record<Span["kind"], number[]> = { governor: [1], fallback: [1, -1], force: [] };

function pen(u: uPlot): { c: CanvasRenderingContext2D; ratio: number; left: number; top: number; right: number; bottom: number } {
  const { left, top, width, height } = u.bbox;
  return { c: u.ctx, ratio: devicePixelRatio || 1, left, top, right: left + width, bottom: top + height };
}

function hatch(c: CanvasRenderingContext2D, x0: number, x1: number, y0: number, y1: number, slope: number, gap: number): void {
  const height = y1 - y0;
  c.beginPath();
  // Lines keep their places on the canvas when a band grows, so bands side by side look like one.
  for (let x = Math.floor((x0 - height) / gap) * gap; x < x1 + height; x += gap) {
    c.moveTo(x, slope > 0 ? y1 : y0);
    c.lineTo(x + height, slope > 0 ? y0 : y1);
  }
  c.stroke();
}

/** Bands behind the curves. */
export function drawSpans(u: uPlot, panel: Panel, theme: Theme): void {
  const { c, ratio, left, top, right, bottom } = pen(u);
  c.save();
  c.beginPath();
  c.rect(left, top, right - left, bottom - top);
  c.clip();
  for (const span of panel.spans) {
    const x0 = Math.max(u.valToPos(span.start, "x", true), left - 2);
    const x1 = Math.min(Math.max(u.valToPos(span.end, "x", true), x0 + ratio), right + 2);
    if (x1 < left || x0 > right) continue;
    const color = theme.css(`--span-${span.kind}`);
    c.fillStyle = c.strokeStyle = color;
    c.lineWidth = ratio;
    c.globalAlpha = 0.12;
    c.fillRect(x0, top, x1 - x0, bottom - top);
    c.save();
    c.beginPath();
    c.rect(x0, top, x1 - x0, bottom - top);
    c.clip();
    c.globalAlpha = 0.28;
    for (const slope of HATCH[span.kind] ?? []) hatch(c, x0, x1, top, bottom, slope, 9 * ratio);
    c.restore();
    if (span.kind === "force") {
      c.globalAlpha = 0.7;
      c.setLineDash([3 * ratio, 3 * ratio]);
      c.strokeRect(x0, top - 2, x1 - x0, bottom - top + 4);
      c.setLineDash([]);
    }
  }
  c.restore();
}

/** Words at a place with a halo of the ground colour. */
function words(c: CanvasRenderingContext2D, text: string, x: number, y: number, color: string, halo: string, ratio: number): void {
  c.lineWidth = 3 * ratio;
  c.lineJoin = "round";
  c.strokeStyle = halo;
  c.strokeText(text, x, y);
  c.fillStyle = color;
  c.fillText(text, x, y);
}

/** Levels as dashed lines; one that lies outside the picture is named at the edge with an arrow. */
export function drawLevels(u: uPlot, levels: Level[], unit: string, theme: Theme): void {
  const { c, ratio, left, top, right, bottom } = pen(u);
  const [ink, ground] = [theme.css("--level"), theme.css("--ground")];
  c.save();
  c.font = `${11 * ratio}px ${theme.css("--font")}`;
  c.textAlign = "right";
  const sorted = levels.toSorted((a, b) => b.value - a.value);
  let taken = -Infinity;
  for (const [i, { value, label }] of sorted.entries()) {
    const y = u.valToPos(value, "y", true);
    const inside = y >= top - 1 && y <= bottom + 1;
    if (inside) {
      c.strokeStyle = ink;
      c.lineWidth = 1.2 * ratio;
      c.setLineDash([7 * ratio, 4 * ratio]);
      c.beginPath();
      c.moveTo(left, y);
      c.lineTo(right, y);
      c.stroke();
      c.setLineDash([]);
    }
    // The lowest of several is named below its line, where its words keep out of the way of the others.
    const low = sorted.length > 1 && i === sorted.length - 1 && bottom - y > 14 * ratio;
    const above = inside ? y - top > 14 * ratio && !low : y < top;
    const text = inside ? label : `${y < top ? "▲" : "▼"} ${label} (${withUnit(value, unit)})`;
    c.textBaseline = inside ? (above ? "bottom" : "top") : above ? "top" : "bottom";
    const place = inside ? y + (above ? -2 : 2) * ratio : y < top ? top + 2 * ratio : bottom - 2 * ratio;
    if (Math.abs(place - taken) < 12 * ratio) continue;
    taken = place;
    words(c, text, right - 4 * ratio, place, ink, ground, ratio);
  }
  c.restore();
}

/** Marks as ticks from the top; their words, and those of the bands, where there is room in the first line. */
export function drawMarks(u: uPlot, panel: Panel, theme: Theme): void {
  const { c, ratio, left, top, right } = pen(u);
  const [ink, ground] = [theme.css("--dim"), theme.css("--ground")];
  c.save();
  c.font = `${10.5 * ratio}px ${theme.css("--font")}`;
  c.textBaseline = "top";
  c.textAlign = "left";
  const notes: { x: number; text: string; color: string }[] = [];
  for (const mark of panel.marks) {
    const x = u.valToPos(mark.time, "x", true);
    if (x < left || x > right) continue;
    c.fillStyle = ink;
    c.beginPath();
    c.moveTo(x - 4 * ratio, top);
    c.lineTo(x + 4 * ratio, top);
    c.lineTo(x, top + 7 * ratio);
    c.fill();
    notes.push({ x: x + 6 * ratio, text: mark.label, color: ink });
  }
  // Many short bands of one kind are named once, in the first of them in sight; a mark may have named it already.
  const named = new Set(notes.map((note) => note.text));
  for (const span of panel.spans) {
    const x0 = u.valToPos(span.start, "x", true);
    const x1 = u.valToPos(span.end, "x", true);
    if (x1 < left || x0 > right || named.has(span.label)) continue;
    named.add(span.label);
    notes.push({ x: Math.max(x0, left) + 3 * ratio, text: span.label, color: ink });
  }
  const free = [-Infinity, -Infinity];
  for (const { x, text, color } of notes.sort((a, b) => a.x - b.x)) {
    const width = c.measureText(text).width;
    const line = free.findIndex((end) => x > end);
    if (line < 0 || x + width > right) continue;
    free[line] = x + width + 6 * ratio;
    words(c, text, x, top + (2 + 12 * line) * ratio, color, ground, ratio);
  }
  c.restore();
}
