/** Text to the clipboard, and files to the disk; both work on a page opened from a file too. */

import { el } from "./dom.ts";

/** Copy a text; where the browser refuses, its element is selected so that Ctrl+C does it. Whether it was copied. */
export async function copy(text: string, shownIn: HTMLElement): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    select(shownIn);
    return document.execCommand("copy");
  }
}

/** Select all the text of an element. */
export function select(element: HTMLElement): void {
  const selection = getSelection();
  selection?.removeAllRanges();
  const range = document.createRange();
  range.selectNodeContents(element);
  selection?.addRange(range);
}

/** Offer a text as a file. */
export function download(name: string, text: string, type: string): void {
  // The mark tells spreadsheets that the text is UTF-8.
  const address = URL.createObjectURL(new Blob(["\ufeff", text], { type }));
  const link = el("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
