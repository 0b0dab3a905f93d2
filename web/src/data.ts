/** From the text of the page to arrays: base64, gzip, byte shuffle. */

import type { ArrayRef, Body, CurveRef, Header, PanelHeader } from "./report.ts";

export type Numbers = Float32Array | Float64Array;

/** Rows of numbers in one flat array (C order). */
export interface Table {
  rows: number;
  columns: number;
  data: Numbers;
}

/** A curve with its numbers: time [s] and values in the unit of its panel, NaN for a gap. */
export interface Curve extends CurveRef {
  x: Numbers;
  y: Numbers;
}

export interface Panel extends Omit<PanelHeader, "curves"> {
  curves: Curve[];
}

export interface Ghost {
  label: string;
  kind: "run" | "ideal";
  role: string;
  q: Table | null;
  position: Table;
}

/** What may touch the hand: shift [m], force on the hand [N] and depth [m] at the frames. */
export interface Surface {
  name: string;
  role: string;
  body: Body | null;
  shift: Table | null;
  force: Table;
  depth: Table;
  /** Where the hand touches it [m]; null where that is not known. */
  point: Table | null;
}

/** The motion on one time grid: angles [rad] (prismatic: m), positions [m], force [N], moment [N m]. */
export interface Frames {
  time: Numbers;
  q: Table;
  theta: Table;
  position: Table;
  reference: Table | null;
  governed: Table | null;
  force: Table | null;
  moment: Table | null;
}

export interface Report {
  header: Header;
  frames: Frames;
  ghosts: Ghost[];
  surfaces: Surface[];
  panels: Panel[];
}

export const FORMAT = "passiflex report 1";

/** Raised where the page carries no report this viewer can read; the message is for the reader. */
export class ReportError extends Error {}

/** Bytes of a base64 text; white space is ignored. */
export function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  const text = atob(base64.replace(/\s+/g, ""));
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** Unpack gzip with the browser's own means. */
export async function gunzip(bytes: Uint8Array<ArrayBuffer>): Promise<ArrayBuffer> {
  if (typeof DecompressionStream === "undefined") {
    throw new ReportError("This browser is too old to unpack the report (no DecompressionStream). Try a browser of 2023 or later.");
  }
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return await new Response(stream).arrayBuffer();
}

/** Undo the byte shuffle of one array: all first bytes stand first, then all second bytes, ... */
export function unshuffled(blob: ArrayBuffer, ref: ArrayRef): Numbers {
  const width = ref.dtype === "f64" ? 8 : 4;
  const count = ref.shape.reduce((product, size) => product * size, 1);
  if (ref.offset + count * width > blob.byteLength) {
    throw new ReportError("The report is cut short: an array reaches beyond the data. Make the report again.");
  }
  const source = new Uint8Array(blob, ref.offset, count * width);
  const target = new Uint8Array(count * width);
  for (let byte = 0; byte < width; byte++) {
    for (let i = 0; i < count; i++) target[i * width + byte] = source[byte * count + i]!;
  }
  const view = new DataView(target.buffer);
  const out = width === 8 ? new Float64Array(count) : new Float32Array(count);
  for (let i = 0; i < count; i++) out[i] = width === 8 ? view.getFloat64(8 * i, true) : view.getFloat32(4 * i, true);
  return out;
}

/** Arrays of the blob put in the places the header names. */
export function opened(header: Header, blob: ArrayBuffer): Report {
  if (header.format !== FORMAT) {
    throw new ReportError(`This viewer reads "${FORMAT}", the file says "${String(header.format)}". Make the report again.`);
  }
  const table = (ref: ArrayRef): Table => ({ rows: ref.shape[0] ?? 0, columns: ref.shape[1] ?? 1, data: unshuffled(blob, ref) });
  const maybe = (ref: ArrayRef | null | undefined): Table | null => (ref ? table(ref) : null);
  const times = header.times.map((ref) => unshuffled(blob, ref));
  const { frames } = header;
  return {
    header,
    frames: {
      time: unshuffled(blob, frames.time),
      q: table(frames.q),
      theta: table(frames.theta),
      position: table(frames.position),
      reference: maybe(frames.reference),
      governed: maybe(frames.governed),
      force: maybe(frames.force),
      moment: maybe(frames.moment),
    },
    ghosts: header.ghosts.map((ghost) => ({ ...ghost, q: maybe(ghost.q), position: table(ghost.position) })),
    surfaces: header.surfaces.map((surface) => ({ ...surface, shift: maybe(surface.shift), force: table(surface.force), depth: table(surface.depth), point: maybe(surface.point) })),
    panels: header.panels.map((panel) => ({
      ...panel,
      curves: panel.curves.map((curve) => ({ ...curve, x: times[curve.time]!, y: unshuffled(blob, curve.values) })),
    })),
  };
}

/** The report that stands in the page's two data scripts. */
export async function readReport(page: Document): Promise<Report> {
  const [head, data] = ["passiflex-report", "passiflex-data"].map((id) => page.getElementById(id)?.textContent);
  if (!head || !data) throw new ReportError("This page holds no report data; the file may be cut short. Make the report again.");
  let header: Header;
  try {
    header = JSON.parse(head) as Header;
  } catch {
    throw new ReportError("The header of this report cannot be read; the file may be cut short. Make the report again.");
  }
  let blob: ArrayBuffer;
  try {
    blob = await gunzip(bytesOf(data));
  } catch (error) {
    if (error instanceof ReportError) throw error;
    throw new ReportError("The data of this report cannot be unpacked; the file may be cut short. Make the report again.");
  }
  return opened(header, blob);
}
