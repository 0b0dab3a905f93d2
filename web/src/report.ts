/** The header of a report file ("passiflex report 1") as the Python side writes it; SI units throughout. */

/** Where an array lies in the blob and how it is shaped (C order). */
export interface ArrayRef {
  dtype: "f32" | "f64";
  /** First byte in the unpacked blob. */
  offset: number;
  shape: number[];
}

/** A stretch of time [s] in which something was in force. */
export interface Span {
  start: number;
  end: number;
  label: string;
  kind: "governor" | "fallback" | "force";
}

/** An instant [s] at which something happened. */
export interface Mark {
  time: number;
  label: string;
}

export interface Level {
  value: number;
  label: string;
}

export interface Verdict {
  verdict: "passive" | "violated" | "inconclusive";
  sentence: string;
  /** When it was decided [s]: of a violated run the first overdraft, otherwise the worst moment. */
  time: number | null;
  /** When the least was left [s]. */
  worst_time: number | null;
  /** What was left then [J]; negative where the bound was broken. */
  margin: number | null;
  term: string;
  remedy: string;
}

export interface MetricRow {
  name: string;
  unit: string;
  meaning: string;
  values: (number | string | null)[];
}

export interface Solid {
  kind: "capsule" | "cylinder" | "sphere";
  /** [m], in the frame of the body. */
  start: number[];
  end: number[];
  radius: number;
  part: "link" | "joint" | "tool";
}

export interface Joint {
  name: string;
  kind: string;
  /** Origin [m] and rotation (9, row-major) in the frame of the body before. */
  xyz: number[];
  rotation: number[];
  axis: number[];
}

export interface Arm {
  joints: Joint[];
  tip: { xyz: number[]; rotation: number[] };
  /** n + 1 bodies: first the base's. */
  solids: Solid[][];
}

/** What a surface looks like, where it is at first. */
export interface Body {
  kind: "plane" | "sphere" | "cylinder" | "box";
  /** [m]: of a plane the point next to where the hand starts. */
  place: number[];
  /** Its axes (9, row-major): z is out of a plane, and along a cylinder. */
  rotation: number[];
  /** [m]: of a plane none; the radius; radius and length, null where it has no end; three edges. */
  sizes: (number | null)[];
}

export interface SurfaceRef {
  name: string;
  role: string;
  /** null where the file does not say it, or it is too large to be drawn. */
  body: Body | null;
  /** How far it has moved; null for one that stays. */
  shift: ArrayRef | null;
  force: ArrayRef;
  depth: ArrayRef;
  /** Where the hand touches it; null or missing where that is not known. */
  point?: ArrayRef | null;
}

export interface CurveRef {
  label: string;
  role: string;
  /** Index into `times`. */
  time: number;
  values: ArrayRef;
}

export interface PanelHeader {
  kind: string;
  choice: string;
  title: string;
  unit: string;
  curves: CurveRef[];
  levels: Level[];
  spans: Span[];
  marks: Mark[];
}

export interface RoleStyle {
  light: string;
  dark: string;
  /** [px] */
  width: number;
  dash: number[];
}

export interface Header {
  format: string;
  title: string;
  made_by: string;
  notices: string[];
  facts: [string, string][];
  verdict: Verdict | null;
  metrics: { columns: string[]; rows: MetricRow[] };
  configuration: string;
  marks: Mark[];
  spans: Span[];
  duration: number;
  arm: Arm | null;
  frames: {
    time: ArrayRef;
    q: ArrayRef;
    theta: ArrayRef;
    position: ArrayRef;
    reference: ArrayRef | null;
    governed: ArrayRef | null;
    force: ArrayRef | null;
    moment: ArrayRef | null;
  };
  ghosts: { label: string; kind: "run" | "ideal"; role: string; q: ArrayRef | null; position: ArrayRef }[];
  surfaces: SurfaceRef[];
  panels: PanelHeader[];
  times: ArrayRef[];
  styles: Record<string, RoleStyle>;
  thinning: string;
}
