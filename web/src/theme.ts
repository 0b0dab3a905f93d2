/** Dark and light: which of them, and the colours of the roles in it. */

import type { RoleStyle } from "./report.ts";

export type Tone = "light" | "dark";

/** How a role is drawn in the present tone. */
export interface Look {
  color: string;
  /** [px] */
  width: number;
  dash: number[];
}

// Okabe and Ito's colours, for a role that the file does not name.
const SPARE: [string, string][] = [
  ["#0072b2", "#56b4e9"],
  ["#d55e00", "#ff8a4c"],
  ["#009e73", "#3fd0a5"],
  ["#cc79a7", "#e6a3c8"],
  ["#8a6d00", "#f0e442"],
  ["#555555", "#bbbbbb"],
];

// Colours of the style sheet that the file may name: variable and role.
const NAMED = {
  "--span-governor": "governor",
  "--span-fallback": "fallback",
  "--span-force": "force",
  "--level": "level",
  "--good": "passive",
  "--bad": "violated",
  "--open": "inconclusive",
};

export class Theme {
  #styles: Record<string, RoleStyle>;
  #listeners = new Set<() => void>();
  #tone: Tone;

  constructor(styles: Record<string, RoleStyle>) {
    this.#styles = styles;
    const dark = matchMedia("(prefers-color-scheme: dark)");
    this.#tone = dark.matches ? "dark" : "light";
    dark.addEventListener("change", () => this.set(dark.matches ? "dark" : "light"));
    this.#write();
  }

  #write(): void {
    const { dataset, style } = document.documentElement;
    dataset["tone"] = this.#tone;
    for (const [name, role] of Object.entries(NAMED)) {
      const known = Object.hasOwn(this.#styles, role) ? this.#styles[role] : undefined;
      if (known) style.setProperty(name, known[this.#tone]);
    }
  }

  get tone(): Tone {
    return this.#tone;
  }

  /** Called after each change of the tone. */
  onChange(listener: () => void): void {
    this.#listeners.add(listener);
  }

  set(tone: Tone): void {
    if (tone === this.#tone) return;
    this.#tone = tone;
    this.#write();
    this.#listeners.forEach((listener) => listener());
  }

  /** The look of a role; the first known of several names counts. */
  look(...roles: string[]): Look {
    for (const role of roles) {
      const style = Object.hasOwn(this.#styles, role) ? this.#styles[role] : undefined;
      if (style) return { color: style[this.#tone], width: style.width, dash: style.dash };
    }
    const code = [...(roles[0] ?? "")].reduce((sum, letter) => (sum * 31 + letter.charCodeAt(0)) >>> 0, 7);
    return { color: SPARE[code % SPARE.length]![this.#tone === "light" ? 0 : 1], width: 1.5, dash: [] };
  }

  /** A colour of the style sheet, e.g. "--ink". */
  css(name: string): string {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }
}
