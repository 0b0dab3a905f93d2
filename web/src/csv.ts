/** What the page shows, as comma-separated values. */

import type { Numbers, Report, Table } from "./data.ts";

interface Column {
  name: string;
  at: (row: number) => number | undefined;
}

interface Block {
  time: Numbers;
  name: string;
  columns: Column[];
}

/** One field: quoted where it must be; a text that a spreadsheet would take for a formula gets a leading '. */
export function field(value: string | number | null | undefined): string {
  if (value === null || value === undefined) return "";
  if (typeof value === "number") return Number.isFinite(value) ? String(value) : "";
  const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

/** A comment line: one field, whatever the text holds. */
function remark(text: string): string {
  return field(`# ${text.replace(/[\r\n]+/g, " ")}`);
}

function tableColumns(table: Table | null, names: string[]): Column[] {
  if (!table) return [];
  return names.map((name, i) => ({ name, at: (row) => table.data[row * table.columns + i] }));
}

function motionBlock(report: Report): Block {
  const { frames, header } = report;
  const joints = Array.from({ length: frames.q.columns }, (_, i) => i);
  const unit = (i: number) => (header.arm?.joints[i]?.kind === "prismatic" ? "m" : "rad");
  const axes = (name: string, of: string) => ["x", "y", "z"].map((axis) => `${name} ${axis} [${of}]`);
  return {
    name: "motion",
    time: frames.time,
    columns: [
      ...tableColumns(frames.q, joints.map((i) => `q ${i + 1} [${unit(i)}]`)),
      ...tableColumns(frames.theta, joints.map((i) => `theta ${i + 1} [${unit(i)}]`)),
      ...tableColumns(frames.position, axes("position", "m")),
      ...tableColumns(frames.reference, axes("reference", "m")),
      ...tableColumns(frames.governed, axes("governed reference", "m")),
      ...tableColumns(frames.force, axes("external force", "N")),
      ...tableColumns(frames.moment, axes("external moment", "N m")),
      ...report.ghosts.flatMap((ghost) => tableColumns(ghost.position, axes(`${ghost.label}: position`, "m"))),
    ],
  };
}

function curveBlocks(report: Report): Block[] {
  const blocks = new Map<Numbers, Block>();
  for (const panel of report.panels) {
    for (const curve of panel.curves) {
      let block = blocks.get(curve.x);
      if (!block) blocks.set(curve.x, (block = { name: "curves", time: curve.x, columns: [] }));
      const name = `${panel.kind} / ${panel.choice} / ${curve.label} [${panel.unit}]`;
      block.columns.push({ name, at: (row) => curve.y[row] });
    }
  }
  return [...blocks.values()];
}

/** The whole text. Blocks of columns stand side by side, each behind its own time column. */
export function csvOf(report: Report): string {
  const { header } = report;
  const blocks = [motionBlock(report), ...curveBlocks(report)];
  const lines = [
    remark(`${header.title} (${header.made_by})`),
    remark("What this report shows, not every row and signal of the run file. SI units; an empty field is a gap."),
    remark(`${blocks.length} blocks of columns side by side, each behind its own time column: first the motion, then the curves by their times.`),
    ...(header.thinning ? [remark(`Curves are thinned: ${header.thinning}`)] : []),
    ...header.notices.map((notice) => remark(`Notice: ${notice}`)),
  ];
  lines.push(blocks.flatMap((b, i) => [`time ${i + 1} (${b.name}) [s]`, ...b.columns.map((c) => c.name)]).map(field).join(","));
  const rows = Math.max(0, ...blocks.map((block) => block.time.length));
  for (let row = 0; row < rows; row++) {
    const fields: string[] = [];
    for (const { time, columns } of blocks) {
      const inside = row < time.length;
      fields.push(inside ? field(time[row]) : "");
      for (const column of columns) fields.push(inside ? field(rounded(column.at(row))) : "");
    }
    lines.push(fields.join(","));
  }
  return `${lines.join("\r\n")}\r\n`;
}

/** Single precision carries seven digits; more would be noise. */
function rounded(value: number | undefined): number | undefined {
  return value === undefined ? undefined : Number(value.toPrecision(8));
}
