/** What went wrong, said on the page. */

import { button, el } from "./dom.ts";

let box: HTMLElement | null = null;

/** Show a message at the top of the page; the same one is not shown twice. */
export function complain(message: string): void {
  if (!box) {
    box = el("div", { class: "failure", role: "alert" });
    document.body.prepend(box);
  }
  if ([...box.children].some((line) => line.firstChild?.textContent === message)) return;
  const line: HTMLElement = el("p", {}, el("span", {}, message));
  line.append(button("✕", "dismiss this message", () => line.remove()));
  box.append(line);
}

/** Catch what nobody else has caught. */
export function watchErrors(): void {
  addEventListener("error", (event) => complain(`Something went wrong in the viewer: ${event.message}`));
  addEventListener("unhandledrejection", (event) => {
    const reason: unknown = event.reason;
    complain(`Something went wrong in the viewer: ${reason instanceof Error ? reason.message : String(reason)}`);
  });
}
