// The solver of the page against the same solver natively, and against the program:
//   node web/compare.mjs SOLVER.wasm ANSWERS LEAFDYN [DRAGS]
// where ANSWERS is the example of that name. All scenarios are opened, and numbers of them moved at random.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

const [wasm, answers, program, drags] = process.argv.slice(2);
const scenarios = join(dirname(fileURLToPath(import.meta.url)), "../scenarios");
const files = ["paper", "classic", "measured", "motion", "study"].flatMap((folder) => readdirSync(join(scenarios, folder)).filter((name) => name.endsWith(".toml")).map((name) => join(folder, name)));
const DRAGS = Number(drags ?? 500);
/// What the page solves to.
const TOLERANCE = 1e-4;

const compiled = await WebAssembly.compile(readFileSync(wasm));
const { exports: solver } = await WebAssembly.instantiate(compiled, { host: { seconds: () => performance.now() / 1000 } });
function inPage(question) {
  const bytes = new TextEncoder().encode(JSON.stringify(question));
  const place = solver.place(bytes.length);
  new Uint8Array(solver.memory.buffer, place, bytes.length).set(bytes);
  const length = solver.answer();
  return JSON.parse(new TextDecoder().decode(new Uint8Array(solver.memory.buffer, solver.result(), length)));
}

const other = spawn(answers, { stdio: ["pipe", "pipe", "inherit"] });
const lines = createInterface({ input: other.stdout })[Symbol.asyncIterator]();
async function natively(question) {
  other.stdin.write(`${JSON.stringify(question)}\n`);
  return JSON.parse((await lines.next()).value);
}

const apart = (a, b) => Math.max(...a.flatMap((tip, j) => tip.map((x, k) => Math.abs(x - b[j][k]))));

/// Both give the same answer, within the bars that they state.
async function both(question, what) {
  const [one, two] = [inPage(question), await natively(question)];
  assert.equal(one.answer, two.answer, `${what}: ${one.error} | ${two.error}`);
  if (one.tips) {
    assert.deepEqual([one.stable, one.index, one.view.verdict], [two.stable, two.index, two.view.verdict], what);
    const off = apart(one.tips, two.tips);
    assert(off <= 2 * ((one.error ?? 0) + (two.error ?? 0)) + 1e-9 * one.view.longest, `${what}: tips ${off} apart`);
  }
  return one;
}

/// Numbers between 0 and 1, the same in every run.
let seed = 1;
const random = () => ((seed = (seed * 48271) % 2147483647) / 2147483647);

const opened = new Map();
let compared = 0;
for (const file of files) {
  const text = readFileSync(join(scenarios, file), "utf8");
  const answer = await both({ ask: "open", text, name: file }, file);
  assert.equal(answer.answer, "opened", `${file}: ${answer.error}`);
  opened.set(file, { text, sliders: answer.sliders });
  const known = answer.known;
  if (/^\s*\[wind\]/m.test(text)) continue;
  let summary;
  try {
    summary = JSON.parse(execFileSync(program, ["relax", join(scenarios, file), "--tolerance", String(Math.max(TOLERANCE, known.tolerance)), "--json", "--write", "none"], { stdio: ["ignore", "pipe", "ignore"] }));
  } catch (failed) {
    summary = JSON.parse(failed.stdout);
  }
  const tips = summary.tip ? [summary.tip] : summary.tips;
  const off = apart(known.tips, tips);
  assert(off <= (known.error ?? 0) + (summary.error_estimate ?? 0) + 1e-9 * known.view.longest, `${file}: tip ${off} from the program's`);
  assert.deepEqual([known.stable, known.index], [summary.stable, summary.negative_eigenvalues], file);
  compared += 1;
}
console.log(`${compared} scenarios have the program's tips and verdicts`);

const pages = () => solver.memory.buffer.byteLength;
const chosen = [...opened].filter((_, i) => i % 2 === 0).slice(0, 20);

/// Opens scenarios and moves numbers of them, and calls `ask` with each question.
async function drag(ask) {
  seed = 1;
  for (let k = 0; k < DRAGS; k++) {
    const [file, { text, sliders }] = chosen[k % chosen.length];
    await ask({ ask: "open", text, name: file }, file);
    const movable = sliders.filter(({ whole, value, key }) => !whole && value !== null && !/^(dynamics|wind|solve)\./.test(key));
    const { key, low, high } = movable[Math.floor(random() * movable.length)];
    for (const part of [random(), random()]) {
      const value = low + part * (high - low);
      await ask({ ask: "set", values: [[key, value]], modes: 0 }, `${file} ${key}=${value}`);
    }
  }
}

const counts = {};
await drag(async (question, what) => {
  const { answer } = await both(question, what);
  counts[answer] = (counts[answer] || 0) + 1;
  if (answer !== "left") return;
  // Which of several it then comes to may hang on the last bit.
  const settled = [inPage({ ask: "settle" }), await natively({ ask: "settle" })];
  for (const { answer, stable, view, error } of settled) assert(answer === "found" && (stable !== false || !view.success), `${what}, settled: ${error}`);
});
console.log(`${DRAGS} drags over ${chosen.length} scenarios are the same as natively:`, counts);
other.stdin.end();

// What is dragged once more takes no more memory.
const once = pages();
await drag((question) => inPage(question).answer === "left" && inPage({ ask: "settle" }));
console.log(`memory: ${(once / 1e6).toFixed(0)} MB, and ${(pages() / 1e6).toFixed(0)} MB after the same again`);
assert(pages() <= 1.1 * once);
