// Bundles the viewer: node build.mjs --out DIR writes viewer.js, viewer.css and THIRD_PARTY.txt there.
// The folder of the call does not matter; the packages of package-lock.json must be installed (npm ci).

import { mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { build } from "esbuild";

const HERE = dirname(fileURLToPath(import.meta.url));
// Every supported browser has DecompressionStream; none of them is older than this.
const TARGET = ["chrome103", "firefox113", "safari16.4"];

const { values } = parseArgs({ options: { out: { type: "string", default: join(HERE, "dist") } } });
const out = resolve(values.out);
const shared = {
  absWorkingDir: HERE,
  bundle: true,
  minify: true,
  charset: "ascii",
  legalComments: "none",
  target: TARGET,
  write: false,
  logLevel: "warning",
};

/** The one file esbuild makes of an entry. */
async function bundled(entry, more) {
  const { outputFiles } = await build({ ...shared, ...more, entryPoints: [join(HERE, entry)] });
  return outputFiles[0].text;
}

/** Name, version and licence text of each run-time dependency. */
async function licences() {
  const own = JSON.parse(await readFile(join(HERE, "package.json"), "utf8"));
  const parts = ["The viewer in a passiflex report contains these libraries:\n"];
  for (const name of Object.keys(own.dependencies).sort()) {
    const home = join(HERE, "node_modules", name);
    const { version, license } = JSON.parse(await readFile(join(home, "package.json"), "utf8"));
    const file = (await readdir(home)).find((entry) => /^licen[cs]e/i.test(entry));
    if (!file) throw new Error(`${name} ${version} carries no licence text`);
    const text = (await readFile(join(home, file), "utf8")).trim();
    parts.push(`${"=".repeat(78)}\n${name} ${version} (${license})\n${"=".repeat(78)}\n\n${text}\n`);
  }
  return parts.join("\n");
}

const banner = "/* passiflex report viewer; contains three and uPlot (MIT), licence texts in THIRD_PARTY.txt of passiflex */\n";
const js = banner + (await bundled("src/main.ts", { format: "iife" }));
const css = await bundled("src/style/viewer.css", {});
// Both stand inline in an HTML page, where these words would end their element.
if (/<\/script|<!--/i.test(js)) throw new Error("viewer.js contains '</script' or '<!--': it cannot stand inline");
if (/<\/style/i.test(css)) throw new Error("viewer.css contains '</style': it cannot stand inline");

await mkdir(out, { recursive: true });
await writeFile(join(out, "viewer.js"), js);
await writeFile(join(out, "viewer.css"), css);
await writeFile(join(out, "THIRD_PARTY.txt"), await licences());
console.log(`${out}: viewer.js ${Math.round(js.length / 1000)} kB, viewer.css ${Math.round(css.length / 1000)} kB`);
