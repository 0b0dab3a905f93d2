/** What there is to see in the scene, each with a name, a look and a switch. */

import type { Object3D } from "three";
import { el } from "../dom.ts";
import type { Look } from "../theme.ts";
import { swatch } from "../plots/legend.ts";

export interface Layer {
  label: string;
  look: () => Look;
  /** What the switch does; `seen` says its new state. */
  set: (seen: boolean) => void;
  seen: boolean;
}

/** A layer that is one object of the scene. */
export function layerOf(label: string, object: Object3D, look: () => Look, seen = true): Layer {
  object.visible = seen;
  return { label, look, seen, set: (now) => (object.visible = now) };
}

/** The list of layers with check boxes. */
export function layerList(layers: Layer[], changed: () => void): { element: HTMLElement; paint: () => void } {
  const list = el("ul", { class: "layers" });
  const swatches: HTMLElement[] = [];
  for (const layer of layers) {
    const box = el("input", { type: "checkbox", checked: layer.seen });
    box.addEventListener("change", () => {
      layer.seen = box.checked;
      layer.set(box.checked);
      changed();
      box.blur();
    });
    const sample = el("span", { class: "sample" });
    swatches.push(sample);
    list.append(el("li", {}, el("label", {}, box, sample, el("span", {}, layer.label))));
  }
  return { element: list, paint: () => swatches.forEach((sample, i) => sample.replaceChildren(swatch(layers[i]!.look()))) };
}
