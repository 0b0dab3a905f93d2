import assert from "node:assert/strict";
import { test } from "node:test";
import { gzipSync } from "node:zlib";
import { bytesOf, gunzip, opened, readReport, ReportError, unshuffled } from "../src/data.ts";
import type { ArrayRef } from "../src/report.ts";
import { headerOf, shuffled } from "./reports.ts";

test("an array comes back from its shuffled bytes, bit by bit", () => {
  for (const [dtype, values] of [["f32", new Float32Array([1.5, -0, NaN, 3e-39, Infinity])], ["f64", new Float64Array([Math.PI, -1e-300, 2 ** 60])]] as const) {
    const pad = 8;
    const blob = new Uint8Array(pad + values.byteLength);
    blob.set(shuffled(values), pad);
    const ref: ArrayRef = { dtype, offset: pad, shape: [values.length] };
    const back = unshuffled(blob.buffer, ref);
    assert.equal(back.constructor, values.constructor);
    assert.ok(back.every((value, i) => Object.is(value, values[i])));
  }
});

test("the first bytes of all numbers stand first", () => {
  // 1.0f is 00 00 80 3f and 2.0f is 00 00 00 40, little-endian.
  const bytes = new Uint8Array([0, 0, 0, 0, 0x80, 0x00, 0x3f, 0x40]);
  assert.deepEqual([...unshuffled(bytes.buffer, { dtype: "f32", offset: 0, shape: [2] })], [1, 2]);
});

test("an array that reaches beyond the data is said to be cut short", () => {
  assert.throws(() => unshuffled(new ArrayBuffer(15), { dtype: "f64", offset: 8, shape: [1] }), /cut short: an array reaches beyond the data/);
});

test("base64 may have line ends, and gzip is undone", async () => {
  const text = gzipSync(Buffer.from("passiflex")).toString("base64");
  const wrapped = text.replace(/(.{7})/g, "$1\n");
  assert.equal(Buffer.from(await gunzip(bytesOf(wrapped))).toString(), "passiflex");
});

test("another format is refused by name", () => {
  const header = { ...headerOf(), format: "passiflex report 9" };
  assert.throws(() => opened(header, new ArrayBuffer(64)), (error: Error) => error instanceof ReportError && error.message.includes('"passiflex report 9"'));
});

/** A page with these two texts, as far as the reader looks at it. */
function page(head: string | null, data: string | null): Document {
  const texts: Record<string, string | null> = { "passiflex-report": head, "passiflex-data": data };
  return { getElementById: (id: string) => ({ textContent: texts[id] }) } as unknown as Document;
}

test("what is wrong with a page is said in words", async () => {
  await assert.rejects(readReport(page(null, null)), /holds no report data/);
  await assert.rejects(readReport(page("{", "AAAA")), /header of this report cannot be read/);
  await assert.rejects(readReport(page(JSON.stringify(headerOf()), "AAAA")), /cannot be unpacked/);
});
