// Makes dist/live.html: the page with the solver, scripts and scenarios inside.
//   node web/page.mjs SOLVER.wasm
// `web/build.sh` compiles the solver and calls this.
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

/// Five letters for four bytes, a sixteenth less than in base64; `<` and `\` are none of them. Of the last
/// group, filled with zeros, there is a letter more than it has bytes.
function letters85(bytes) {
  const text = [];
  for (let group = 0; group < bytes.length; group += 4) {
    let number = 0;
    for (let k = group; k < group + 4; k += 1) number = 256 * number + (k < bytes.length ? bytes[k] : 0);
    const letters = [];
    for (let k = 0; k < 5; k += 1) {
      const letter = 33 + (number % 85);
      letters.unshift(String.fromCharCode(letter < 60 ? letter : letter < 91 ? letter + 1 : letter + 2));
      number = Math.floor(number / 85);
    }
    text.push(letters.slice(0, 1 + Math.min(4, bytes.length - group)).join(""));
  }
  return text.join("");
}

const web = dirname(fileURLToPath(import.meta.url));
const read = (...path) => readFileSync(join(web, ...path), "utf8");
const pages = "../program/src/page";
const folders = ["paper", "classic", "measured", "motion", "study"];
const scenarios = folders.flatMap((folder) =>
  readdirSync(join(web, "../scenarios", folder))
    .filter((name) => name.endsWith(".toml"))
    .sort()
    .map((name) => ({ name: `${folder}/${name}`, text: read("../scenarios", folder, name) })),
);
const stage = ["data.js", "space.js", "axes.js", "chart.js", "stage.js"].map((name) => read(pages, name)).join("\n") + read("page/leaf.js");
const script = ["solver.js", "link.js", "trail.js", "sliders.js", "live.js", "lessons.js", "main.js"].map((name) => read("page", name)).join("\n");
// The stage of a leaf of so many veins lasts until another one is opened.
const scripts = `${read(pages, "three/three.min.js")}\nfunction stageOf(view) {\n"use strict";\n${stage}\n}\n(() => {\n"use strict";\n${script}\n})();`;
const packed = (bytes) => letters85(gzipSync(bytes, { level: 9 }));
const part = {
  STYLE: read(pages, "page.css") + read("page/live.css"),
  SCRIPTS: packed(Buffer.from(scripts)),
  WORKER: read("page/worker.js"),
  GALLERY: packed(Buffer.from(JSON.stringify(scenarios))),
  GIVEN: "null",
  SOLVER: packed(readFileSync(process.argv[2])),
  LICENCES: [read("../LICENSE-MIT"), read(pages, "three/LICENSE-three.txt")].join("\n\n").replaceAll("&", "&amp;").replaceAll("<", "&lt;"),
};
const page = read("page/live.html").replaceAll(/\{\{(\w+)\}\}/g, (_, name) => part[name]);
mkdirSync(join(web, "dist"), { recursive: true });
writeFileSync(join(web, "dist/live.html"), page);
console.log(`web/dist/live.html: ${(page.length / 1e6).toFixed(2)} MB`);
