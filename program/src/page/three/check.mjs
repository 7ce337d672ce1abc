// Opens pages of the program in a browser without a network, and validates its tubes:
//   npm ci && node check.mjs ../../../../target/release/leafdyn
// The browser is Chromium, CHROMIUM or /usr/bin/chromium; WebGL is drawn by swiftshader.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import validator from "gltf-validator";

const top = fileURLToPath(new URL("../../../..", import.meta.url));
const program = resolve(process.argv[2] || join(top, "target/release/leafdyn"));
const folder = mkdtempSync(join(tmpdir(), "leafdyn-page-"));
const keep = process.env.KEEP;

function leafdyn(name, ...words) {
  const out = join(folder, name);
  execFileSync(program, [...words, "--out", out], { cwd: top, stdio: ["ignore", "ignore", "inherit"] });
  return out;
}

const SWIFTSHADER = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const launch = (args) => chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args: ["--no-sandbox", ...args] });

/// Opens a page; whatever goes wrong on it ends the test.
async function open(browser, file, options = {}) {
  const context = await browser.newContext({ offline: true, viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  const wrong = [];
  page.on("pageerror", (error) => wrong.push(String(error)));
  page.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
  page.on("request", (request) => request.url().startsWith("file://") || request.url().startsWith("blob:") || wrong.push(request.url()));
  const start = Date.now();
  await page.goto(`file://${file}`);
  await page.waitForFunction(() => window.leafdyn && (window.leafdyn.shown.drawn > 0 || document.body.classList.contains("flat")));
  page.loaded = Date.now() - start;
  page.done = async (name) => {
    if (keep) await page.screenshot({ path: join(keep, `${name}.png`) });
    assert.deepEqual(wrong, [], name);
    await context.close();
  };
  return page;
}

/// Pixels of the leaf itself, and where nodes of the outer veins are said to be.
const outline = () => {
  const { view, place, picture } = window.leafdyn;
  picture();
  const canvas = document.getElementById("space");
  const flat = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const pen = flat.getContext("2d");
  pen.drawImage(canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, flat.width, flat.height);
  const opaque = (x, y) => data[4 * (Math.round(y) * flat.width + Math.round(x)) + 3] > 0;
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  let count = 0;
  for (let y = 0; y < flat.height; y++)
    for (let x = 0; x < flat.width; x++)
      if (opaque(x, y)) {
        count++;
        [box[0], box[1], box[2], box[3]] = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
      }
  const points = window.leafdyn.nodes();
  const placed = points.map((point) => place(point));
  const hits = placed.filter(([x, y]) => opaque(x, y)).length;
  const said = [Math.min(...placed.map((p) => p[0])), Math.min(...placed.map((p) => p[1])), Math.max(...placed.map((p) => p[0])), Math.max(...placed.map((p) => p[1]))];
  return { count, box, said, hits, points, placed, veins: view.rods };
};

async function leafAtRest(browser, out) {
  assert(statSync(join(out, "view.html")).size < 1e6, "view.html is larger than 1 MB");
  const page = await open(browser, join(out, "view.html"));
  const summary = JSON.parse(readFileSync(join(out, "summary.json")));
  const axes = { above: [0, 1], side: [0, 2], front: [1, 2] };
  for (const [name, [across, up]] of Object.entries(axes)) {
    await page.click(`[data-view=${name}]`);
    await page.waitForTimeout(100);
    const seen = await page.evaluate(outline);
    assert(seen.count > 500, `${name}: the canvas is blank`);
    assert(seen.hits > 0.97 * seen.points.length, `${name}: ${seen.hits} of ${seen.points.length} nodes are drawn`);
    // The drawn leaf ends where its outermost nodes are, but for the tubes' width and the clamp.
    seen.box.forEach((edge, k) => assert(Math.abs(edge - seen.said[k]) < 14, `${name}: edge ${k} at ${edge}, not at ${seen.said[k]}`));
    // One scale for both directions, and the tip where the summary says.
    const last = seen.points.length - 1;
    const [a, b] = [seen.placed[0], seen.placed[last]];
    const [p, q] = [seen.points[0], seen.points[last]];
    const scale = Math.hypot(b[0] - a[0], b[1] - a[1]) / Math.hypot(q[across] - p[across], q[up] - p[up]);
    assert(Math.abs(b[0] - a[0] - scale * (q[across] - p[across])) < 0.5, name);
    assert(Math.abs(a[1] - b[1] - scale * (q[up] - p[up])) < 0.5, name);
    summary.tip.forEach((x, k) => assert(Math.abs(x - q[k]) < 1e-6, `tip ${k}`));
  }
  await hover(page);
  await keys(page);
  await colours(page);
  await page.done("leaf");
}

async function hover(page) {
  const at = await page.evaluate(() => window.leafdyn.place(window.leafdyn.nodes()[5]));
  const box = await page.locator("#space").boundingBox();
  await page.mouse.move(box.x + at[0], box.y + at[1]);
  await page.waitForFunction(() => document.getElementById("hint").style.display === "block");
  assert.match(await page.textContent("#hint"), /vein, station: \d+/);
  assert.match(await page.textContent("#hint"), /tension/);
}

async function keys(page) {
  const place = () => page.evaluate(() => window.leafdyn.place(window.leafdyn.nodes().at(-1)));
  await page.focus("#space");
  let before = await place();
  for (const key of ["1", "ArrowLeft", "ArrowUp", "Shift+ArrowLeft", "+", "-", "4", "2"]) {
    await page.keyboard.press(key);
    const after = await place();
    assert.notDeepEqual(after, before, `${key} does nothing`);
    before = after;
  }
}

async function colours(page) {
  const pictures = new Set();
  for (const value of await page.$$eval("#quantity option", (all) => all.map((one) => one.value))) {
    await page.selectOption("#quantity", value);
    pictures.add(await page.evaluate(() => window.leafdyn.picture().toDataURL()));
  }
  assert(pictures.size > 7, "the colours do not differ");
  await page.check("#surface");
  const before = pictures.size;
  pictures.add(await page.evaluate(() => window.leafdyn.picture().toDataURL()));
  assert(pictures.size > before, "there is no surface");
}

async function motion(browser, out) {
  const page = await open(browser, join(out, "motion.html"));
  const first = await page.evaluate(() => window.leafdyn.picture().toDataURL());
  await page.click("#play");
  await page.waitForFunction(() => window.leafdyn.shown.at > 2);
  await page.click("#play");
  const at = await page.evaluate(() => window.leafdyn.shown.at);
  assert.notEqual(await page.evaluate(() => window.leafdyn.picture().toDataURL()), first, "nothing moves");
  await page.waitForTimeout(300);
  assert.equal(await page.evaluate(() => window.leafdyn.shown.at), at, "pause does not stop");
  const chart = await page.locator("#chart").boundingBox();
  await page.mouse.click(chart.x + 0.8 * chart.width, chart.y + 0.4 * chart.height);
  assert((await page.evaluate(() => window.leafdyn.shown.at)) > at, "a click into the diagram does nothing");
  await page.done("motion");
}

async function trace(browser, out) {
  const page = await open(browser, join(out, "trace.html"));
  const chart = await page.locator("#chart").boundingBox();
  await page.mouse.click(chart.x + 0.9 * chart.width, chart.y + 0.5 * chart.height);
  assert((await page.evaluate(() => window.leafdyn.shown.at)) > 0, "a click into the diagram does nothing");
  await page.done("trace");
}

async function equilibria(browser, out) {
  const page = await open(browser, join(out, "equilibria.html"));
  const { equilibria } = JSON.parse(readFileSync(join(out, "equilibria.json")));
  assert.equal(await page.evaluate(() => window.leafdyn.view.leaves.length), equilibria.length);
  assert(equilibria.length > 1);
  await page.done("equilibria");
}

async function modes(browser, out) {
  const page = await open(browser, join(out, "view.html"));
  await page.selectOption("#mode", "1");
  const first = await page.evaluate(() => window.leafdyn.picture().toDataURL());
  await page.waitForTimeout(400);
  assert.notEqual(await page.evaluate(() => window.leafdyn.picture().toDataURL()), first, "it does not vibrate");
  await page.done("modes");
}

/// What is asked of a wide leaf: pictures a second, and milliseconds until it is there.
const ASKED = { rate: 30, open: 2000 };

/// 35 veins of 64 segments and 401 instants: how fast it opens and plays. Other work on the machine slows it down: the best
/// of some tries counts, and what is short is said, not refused.
async function wide(browser, out) {
  const file = join(out, "motion.html");
  const viewport = { width: 1180, height: 649 };
  let [rate, opened, size, instants] = [0, Infinity, [], 0];
  for (let k = 0; k < 3; k++) {
    const page = await open(browser, file, { viewport });
    opened = Math.min(opened, page.loaded);
    size = await page.evaluate(() => [document.getElementById("space").clientWidth, document.getElementById("space").clientHeight]);
    instants = await page.evaluate(() => window.leafdyn.view.leaves.length);
    await page.click("#play");
    await page.waitForTimeout(500);
    const count = () => page.evaluate(() => [window.leafdyn.shown.drawn, performance.now()]);
    const [drawn, start] = await count();
    await page.waitForTimeout(2000);
    const [after, end] = await count();
    rate = Math.max(rate, (1000 * (after - drawn)) / (end - start));
    await page.done("wide");
  }
  assert.deepEqual([size, instants], [[800, 600], 401]);
  const said = (reached) => (reached ? "" : " (short)");
  console.log(`35 veins x 64, ${instants} instants, ${size.join(" x ")}, ${(statSync(file).size / 1e6).toFixed(1)} MB:`);
  console.log(`  open in ${opened} ms, ${ASKED.open} asked${said(opened <= ASKED.open)}`);
  console.log(`  ${rate.toFixed(1)} pictures a second, ${ASKED.rate} asked${said(rate >= ASKED.rate)}`);
  assert(rate > 5 && opened < 20000);
}

async function without(out) {
  const browser = await launch(["--disable-gpu", "--disable-3d-apis"]);
  const page = await open(browser, join(out, "view.html"));
  assert(await page.isVisible("#still svg"), "there is no figure");
  assert.match(await page.textContent("#why"), /figure stands in its place/);
  await browser.close();
}

async function tubes(...files) {
  for (const file of files) {
    const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), { ignoredIssues: [] });
    const { numErrors, numWarnings, messages } = report.issues;
    console.log(`${basename(file)}: gltf-validator finds ${numErrors} errors, ${numWarnings} warnings`);
    assert.equal(numErrors + numWarnings, 0, `${file}: ${JSON.stringify(messages.slice(0, 3))}`);
  }
}

try {
  const rest = leafdyn("rest", "relax", "scenarios/paper/fig04.toml", "--write", "html,json,glb", "--modes", "3");
  const swing = leafdyn("swing", "simulate", "scenarios/motion/swing.toml", "--write", "html,glb");
  const traced = leafdyn("trace", "trace", "scenarios/paper/fig04.toml", "--set", "leaf.rods=5", "--vary", "load.gravity[2]=-1..-5", "--write", "html");
  const all = leafdyn("all", "relax", "scenarios/paper/fig10.toml", "--set", "leaf.rods=5", "--all", "--write", "html,json");
  const large = leafdyn("large", "simulate", "scenarios/motion/swing.toml", "--set", "leaf.rods=35", "--segments", "64", "--set", "dynamics.duration=2", "--set", "dynamics.output_interval=0.005", "--write", "html");
  const browser = await launch(SWIFTSHADER);
  await leafAtRest(browser, rest);
  await modes(browser, rest);
  await motion(browser, swing);
  await trace(browser, traced);
  await equilibria(browser, all);
  await wide(browser, large);
  await browser.close();
  await without(rest);
  await tubes(join(rest, "leaf.glb"), join(swing, "motion.glb"));
  console.log("pages and tubes are as they should be");
} finally {
  if (!keep) rmSync(folder, { recursive: true, force: true });
  else console.log(folder);
}
