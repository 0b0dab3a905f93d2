import assert from "node:assert/strict";
import { test } from "node:test";
import { csvOf, field } from "../src/csv.ts";
import { reportOf } from "./reports.ts";

test("a field is quoted where it must be, and no text is a formula", () => {
  assert.equal(field("plain"), "plain");
  assert.equal(field('a,"b"'), '"a,""b"""');
  assert.equal(field("two\nlines"), '"two\nlines"');
  assert.equal(field("=HYPERLINK(1)"), "'=HYPERLINK(1)");
  for (const start of ["+", "-", "@", "\t"]) assert.ok(field(`${start}1`).startsWith("'"));
  assert.equal(field(-1.5), "-1.5");
  assert.equal(field(NaN), "");
  assert.equal(field(undefined), "");
});

test("blocks stand side by side behind their own times; a gap is empty", () => {
  const lines = csvOf(reportOf()).trimEnd().split("\r\n");
  assert.deepEqual(lines.filter((line) => !/^"?#/.test(line)), [
    'time 1 (motion) [s],q 1 [rad],theta 1 [rad],position x [m],position y [m],position z [m],time 2 (curves) [s],"energy / energies / =tank, ""T"" [J]"',
    "0,0,0,0,0,0,0,2",
    "1,0.5,0.25,0,0,0,0.5,",
    ",,,,,,1,0.1",
  ]);
  assert.match(lines[2]!, /2 blocks of columns side by side/);
});

test("a title with line ends stays one remark", () => {
  const report = reportOf();
  report.header.title = 'a\n=1,"2"';
  assert.equal(csvOf(report).split("\r\n")[0], '"# a =1,""2"" (passiflex 0.1.0, commit abc1234)"');
});
