/** Small reports for the tests. */

import type { Report, Table } from "../src/data.ts";
import type { Header } from "../src/report.ts";

/** The bytes of an array, all first bytes first, as the Python side writes them. */
export function shuffled(values: Float32Array | Float64Array): Uint8Array {
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  const width = values.BYTES_PER_ELEMENT;
  return Uint8Array.from({ length: bytes.length }, (_, i) => bytes[(i % values.length) * width + Math.floor(i / values.length)]!);
}

export function headerOf(): Header {
  const none = { dtype: "f64" as const, offset: 0, shape: [0] };
  return {
    format: "passiflex report 1",
    title: "a run",
    made_by: "passiflex 0.1.0, commit abc1234",
    notices: [],
    facts: [],
    verdict: null,
    metrics: { columns: [], rows: [] },
    configuration: "",
    marks: [],
    spans: [],
    duration: 1,
    arm: null,
    frames: { time: none, q: none, theta: none, position: none, reference: null, governed: null, force: null, moment: null },
    ghosts: [],
    surfaces: [],
    panels: [],
    times: [],
    styles: {},
    thinning: "",
  };
}

export function table(rows: number[][]): Table {
  return { rows: rows.length, columns: rows[0]?.length ?? 0, data: Float64Array.from(rows.flat()) };
}

/** Two frames of one joint, and one curve on three other times. */
export function reportOf(): Report {
  const still = table([[0, 0, 0], [0, 0, 0]]);
  return {
    header: headerOf(),
    frames: { time: Float64Array.of(0, 1), q: table([[0], [0.5]]), theta: table([[0], [0.25]]), position: still, reference: null, governed: null, force: null, moment: null },
    ghosts: [],
    surfaces: [],
    panels: [
      {
        kind: "energy",
        choice: "energies",
        title: "energy",
        unit: "J",
        curves: [{ label: '=tank, "T"', role: "tank", time: 0, values: { dtype: "f32", offset: 0, shape: [3] }, x: Float64Array.of(0, 0.5, 1), y: Float32Array.of(2, NaN, 0.1) }],
        levels: [],
        spans: [],
        marks: [],
      },
    ],
  };
}
