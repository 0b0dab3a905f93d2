/** One place on the page for the diagrams of one kind: a chooser, the curves and their legend. */

import uPlot from "uplot";
import type { Panel } from "../data.ts";
import { button, el, say } from "../dom.ts";
import { apart, bracketed, clock, shown } from "../numbers.ts";
import type { Theme } from "../theme.ts";
import type { Timeline } from "../timeline.ts";
import { listen } from "./gestures.ts";
import { Legend } from "./legend.ts";
import { drawLevels, drawMarks, drawSpans } from "./overlay.ts";
import { core, liveliest, rangeWith, spiky } from "./ranges.ts";
import { joined } from "./series.ts";
import type { Window } from "./window.ts";

const AXIS_WIDTH = 62;

export class Slot {
  readonly element: HTMLElement;
  readonly kind: string;
  #panels: Panel[];
  #panel: Panel;
  #theme: Theme;
  #timeline: Timeline;
  #window: Window;
  #legend = new Legend();
  #hidden = new Set<string>();
  #place = el("div", { class: "plot" });
  #heading = el("span", { class: "unit" });
  #when = el("span", { class: "when" });
  #playhead = el("div", { class: "playhead" });
  #distance = el("span", { class: "distance" });
  #pointer = el("div", { class: "pointer" }, this.#distance);
  #spikes: HTMLButtonElement;
  #plot: uPlot | null = null;

  constructor(kind: string, panels: Panel[], theme: Theme, timeline: Timeline, window: Window, enlarge: HTMLElement) {
    this.kind = kind;
    this.#panels = panels;
    this.#panel = panels[liveliest(panels)]!;
    this.#theme = theme;
    this.#timeline = timeline;
    this.#window = window;
    this.#spikes = button("⇕", "leave the rarest values (1 % at each end) out of the height of the diagram", () => this.#leaveOut(), "quiet spikes");
    this.#spikes.setAttribute("aria-pressed", "false");
    const side = el("div", { class: "side" }, el("div", { class: "slot-head" }, this.#chooser(), this.#spikes, enlarge), el("div", { class: "what" }, this.#heading, this.#when), this.#legend.element);
    this.element = el("section", { class: "slot", "aria-label": `${kind} over time` }, this.#place, side);
    this.#place.append(el("span", { class: "time-label", "aria-hidden": "true" }, "time [s]"));
    new ResizeObserver(() => this.#fit()).observe(this.#place);
  }

  #chooser(): HTMLElement {
    if (this.#panels.length === 1) return el("h2", {}, this.kind);
    const chooser = el("select", { "aria-label": `which ${this.kind} diagram` });
    this.#panels.forEach((panel, i) => chooser.append(el("option", { value: i }, `${this.kind}: ${panel.choice}`)));
    chooser.value = String(this.#panels.indexOf(this.#panel));
    chooser.addEventListener("change", () => {
      this.#panel = this.#panels[Number(chooser.value)]!;
      this.draw();
    });
    return chooser;
  }

  /** Build the diagram anew, after another choice or in other colours. */
  draw(): void {
    const panel = this.#panel;
    const looks = panel.curves.map((curve) => this.#theme.look(curve.role));
    this.#plot?.destroy();
    this.#spikes.hidden = !spiky(panel.curves);
    say(this.#heading, `${panel.title} ${bracketed(panel.unit)}`);
    this.#legend.show(panel, looks, this.#hidden, (i, alone) => this.#toggle(i, alone));
    this.#plot = new uPlot(this.#options(panel), joined(panel.curves), this.#place);
    this.#plot.over.append(this.#playhead, this.#pointer);
    listen(this.#plot, this.#timeline, this.#window);
    this.zoomed();
    this.read();
  }

  #toggle(i: number, alone: boolean): void {
    const labels = this.#panel.curves.map((curve) => curve.label);
    const label = labels[i]!;
    if (alone) {
      const others = labels.filter((other) => other !== label);
      const already = !this.#hidden.has(label) && others.every((other) => this.#hidden.has(other));
      labels.forEach((one) => this.#hidden.delete(one));
      if (!already) others.forEach((other) => this.#hidden.add(other));
    } else if (!this.#hidden.delete(label)) this.#hidden.add(label);
    this.#plot?.batch(() => labels.forEach((one, k) => this.#plot!.setSeries(k + 1, { show: !this.#hidden.has(one) })));
  }

  #leaveOut(): void {
    this.#spikes.setAttribute("aria-pressed", String(this.#spikes.getAttribute("aria-pressed") === "false"));
    this.zoomed();
  }

  /** The height of the diagram, for the curves and the times in sight; null where nothing is. */
  #reach(u: uPlot, low: number | null, high: number | null): [number, number] | null {
    if (low === null || high === null) return null;
    if (this.#spikes.hidden || this.#spikes.getAttribute("aria-pressed") === "false") return [low, high];
    const [from, to] = u.series[0]!.idxs ?? [];
    return core(u.data.slice(1).filter((_, k) => u.series[k + 1]!.show), from, to) ?? [low, high];
  }

  #options(panel: Panel): uPlot.Options {
    const theme = this.#theme;
    const axis: uPlot.Axis = {
      stroke: theme.css("--dim"),
      grid: { stroke: theme.css("--grid"), width: 1 },
      ticks: { stroke: theme.css("--grid"), width: 1, size: 4 },
      font: `11px ${theme.css("--font")}`,
      labelFont: `11px ${theme.css("--font")}`,
      gap: 3,
    };
    const levels = panel.levels.map((level) => level.value);
    return {
      width: Math.max(this.#place.clientWidth, 80),
      height: Math.max(this.#place.clientHeight, 60),
      padding: [6, 10, 0, 0],
      legend: { show: false },
      cursor: {
        x: false,
        y: false,
        drag: { x: true, y: false, dist: 5, setScale: false },
        points: { show: false },
        bind: { dblclick: () => null },
      },
      select: { show: true, left: 0, top: 0, width: 0, height: 0 },
      scales: {
        x: { time: false, range: () => [...this.#window.range] as [number, number] },
        y: { range: (u, low, high) => rangeWith(...(this.#reach(u, low, high) ?? ([0, 1] as const)), levels) },
      },
      series: [{}, ...panel.curves.map((curve) => this.#series(curve.label, curve.role))],
      axes: [
        { ...axis, size: 20, values: (_u, ticks) => ticks.map((t) => shown(t, 6)) },
        {
          ...axis,
          size: AXIS_WIDTH - 14,
          label: bracketed(panel.unit),
          labelSize: 14,
          labelGap: 0,
          space: 24,
          values: (_u, ticks) => ticks.map((v) => shown(v, 4, Math.max(...ticks.map(Math.abs)))),
        },
      ],
      hooks: {
        drawClear: [(u) => drawSpans(u, panel, theme)],
        draw: [
          (u) => {
            drawLevels(u, panel.levels, panel.unit, theme);
            drawMarks(u, panel, theme);
          },
        ],
        setSelect: [
          (u) => {
            const { left, width } = u.select;
            if (width > 4) this.#window.zoom(u.posToVal(left, "x"), u.posToVal(left + width, "x"));
            u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          },
        ],
      },
    };
  }

  #series(label: string, role: string): uPlot.Series {
    const { color, width, dash } = this.#theme.look(role);
    return { label, stroke: color, width, dash, points: { show: false }, show: !this.#hidden.has(label), spanGaps: false };
  }

  #fit(): void {
    const [width, height] = [this.#place.clientWidth, this.#place.clientHeight];
    if (!this.#plot || width < 80 || height < 40) return;
    if (width === this.#plot.width && height === this.#plot.height) return;
    this.#plot.setSize({ width, height });
    this.moved();
  }

  /** The stretch of time is another one. */
  zoomed(): void {
    const [min, max] = this.#window.range;
    this.#plot?.setScale("x", { min, max });
    this.moved();
  }

  /** The play time or the pointer is at another place. */
  moved(): void {
    if (!this.#plot) return;
    const { pointer, range } = this.#window;
    const put = (line: HTMLElement, t: number | null) => {
      const seen = t !== null && t >= range[0] && t <= range[1];
      line.style.visibility = seen ? "visible" : "hidden";
      if (seen) line.style.transform = `translateX(${this.#plot!.valToPos(t, "x").toFixed(1)}px)`;
    };
    put(this.#playhead, this.#timeline.time);
    put(this.#pointer, pointer);
    say(this.#distance, pointer === null ? "" : apart(pointer - this.#timeline.time));
    this.#pointer.classList.toggle("left", pointer !== null && pointer > (range[0] + range[1]) / 2);
  }

  /** Write the values at the pointer, or at the play time where there is none. */
  read(): void {
    const { pointer } = this.#window;
    const t = pointer ?? this.#timeline.time;
    say(this.#when, `${pointer === null ? "at" : "pointer at"} ${clock(t)} s`);
    this.#legend.read(t);
  }
}
