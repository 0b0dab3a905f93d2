/** Elements of the page. Text goes in as text only: names and labels of a run may hold anything. */

type Attributes = Record<string, string | number | boolean>;
type Child = Node | string | null | undefined;

/** An element with attributes (true: present without value) and children; strings become text nodes. */
export function el<K extends keyof HTMLElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== false) element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children) if (child !== null && child !== undefined) element.append(child);
  return element;
}

/** A button; after a click of a pointer it lets the focus go, so that the keys of the page work on. */
export function button(text: string, label: string, act: () => void, className = ""): HTMLButtonElement {
  const element = el("button", { type: "button", title: label, "aria-label": label, class: className }, text);
  element.addEventListener("click", (event) => {
    act();
    if (event.detail > 0) element.blur();
  });
  return element;
}

/** A dialog with a heading and a close button; Esc closes it too, and so does a click beside it. */
export function dialog(title: string, ...content: Child[]): HTMLDialogElement {
  const close = el("button", { type: "button", class: "close", "aria-label": "close" }, "✕");
  const body = el("div", { class: "dialog-body", tabindex: "0" }, ...content);
  const box = el("dialog", { "aria-label": title }, el("header", {}, el("h2", {}, title), close), body);
  close.addEventListener("click", () => box.close());
  box.addEventListener("click", (event) => {
    if (event.target === box) box.close();
  });
  return box;
}

/** Set the text of an element if it is another one: the page is laid out less often. */
export function say(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}
