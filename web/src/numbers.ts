/** Numbers as a reader wants them: few digits, no noise. */

/** Four significant digits; 1e-17 beside a scale of 1 is 0; a gap is a dash. */
export function shown(value: number | null | undefined, digits = 4, scale = 0): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (size === 0 || size < 1e-9 * scale) return "0";
  if (size >= 1e6 || size < 1e-4) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e") as [string, string];
    return minus(`${trimmed(mantissa)}e${Number(exponent)}`);
  }
  return minus(trimmed(value.toPrecision(digits).includes("e") ? value.toFixed(0) : value.toPrecision(digits)));
}

/** A time [s] with milliseconds. */
export function clock(seconds: number): string {
  return minus(seconds.toFixed(3));
}

/** How far one time lies from another [s], and the frequency if that is a period. */
export function apart(seconds: number): string {
  const size = Math.abs(seconds);
  if (!(size >= 1e-6)) return "";
  return `Δ ${size < 1 ? `${shown(1000 * size, 3)} ms` : `${shown(size, 4)} s`}, ${shown(1 / size, 3)} Hz`;
}

/** A value with its unit, e.g. "4.2 N". */
export function withUnit(value: number | null, unit: string, digits = 4, scale = 0): string {
  const text = shown(value, digits, scale);
  return unit && unit !== "1" ? `${text} ${unit}` : text;
}

/** A unit as it stands on an axis; a pure number has a dash. */
export function bracketed(unit: string): string {
  return `[${unit && unit !== "1" ? unit : "–"}]`;
}

/** A number with fixed decimals and no sign before a zero. */
export function fixed(value: number, decimals: number): string {
  return Number.isFinite(value) ? minus((Number(value.toFixed(decimals)) || 0).toFixed(decimals)) : "–";
}

/** A number to a hundredth of a scale that others share: all of them with the same decimals. */
export function beside(value: number, scale: number): string {
  const decimals = scale > 0 ? Math.min(Math.max(2 - Math.floor(Math.log10(scale)), 0), 6) : 2;
  return scale < 1e-3 || scale >= 1e6 ? shown(value, 3, scale) : fixed(value, decimals);
}

function trimmed(text: string): string {
  return text.includes(".") ? text.replace(/0+$/, "").replace(/\.$/, "") : text;
}

function minus(text: string): string {
  return text.replace(/-/g, "−");
}
