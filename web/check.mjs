// Opens the live page in a browser without a network, and uses it as a reader does:
//   (cd program/src/page/three && npm ci) && node web/check.mjs [CLAIM ...]
// The browser is Chromium, CHROMIUM or /usr/bin/chromium, as it is on a machine without a graphics processor: WebGL is drawn by
// swiftshader, and its layers are put together in software, too. (With --use-angle=swiftshader that would be done by swiftshader:
// half as many pictures a second, and a browser that nobody has.)
import assert from "node:assert/strict";
import { readFileSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { deflateRawSync } from "node:zlib";

const web = dirname(fileURLToPath(import.meta.url));
const { chromium } = createRequire(join(web, "../program/src/page/three/package.json"))("playwright-core");
const file = join(web, "dist/live.html");
const keep = process.env.KEEP;
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args: ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"] });

/// Opens the page; whatever goes wrong on it, or is asked of a network, ends the test.
async function open(hash = "#all", options = {}) {
  const context = await browser.newContext({ offline: true, viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  const wrong = [];
  page.on("pageerror", (error) => wrong.push(String(error)));
  page.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
  page.on("request", (request) => /^(file|blob|data):/.test(request.url()) || wrong.push(request.url()));
  const start = Date.now();
  await page.goto(`file://${file}${hash}`);
  await page.waitForFunction(() => window.leafdyn && window.leafdyn.now.count > 0);
  page.opened = Date.now() - start;
  page.tip = () => page.evaluate(() => window.leafdyn.now.known.tips[0]);
  page.choose = (name) => page.evaluate((name) => window.leafdyn.open(window.leafdyn.gallery.find((one) => one.name === name)), name);
  page.rest = () => page.waitForFunction(() => !window.leafdyn.now.busy && !window.leafdyn.now.wanted);
  page.done = async (name) => {
    if (keep) await page.screenshot({ path: join(keep, `live-${name}.png`) });
    assert.deepEqual(wrong, [], name);
    await context.close();
  };
  return page;
}

/// A slider by keyboard and by number; undo, reset; the trail; the same leaf by its address.
async function slides() {
  const page = await open();
  assert.match(await page.textContent("#found"), /^stable/);
  const before = await page.tip();
  await page.fill('[aria-label="load.gravity[2], as a number"]', "-2");
  await page.keyboard.press("Enter");
  await page.waitForFunction((z) => window.leafdyn.now.known.tips[0][2] < z, before[2]);
  await page.rest();
  const heavy = await page.tip();
  await page.focus("#slider-load-gravity-2-");
  for (let k = 0; k < 5; k++) await page.keyboard.press("ArrowRight");
  await page.waitForFunction((z) => window.leafdyn.now.known.tips[0][2] > z, heavy[2]);
  await page.waitForFunction(() => document.querySelectorAll("#chart path").length > 3);
  await page.rest();
  const shown = await page.tip();
  const address = await page.evaluate(() => window.leafdyn.share());
  const again = await open(address.slice(address.indexOf("#")));
  const shared = await again.tip();
  shown.forEach((x, k) => assert(Math.abs(x - shared[k]) < 2e-4, `tip ${k}: ${x}, by its address ${shared[k]}`));
  await again.done("address");
  await page.click("#reset");
  await page.rest();
  const reset = await page.tip();
  before.forEach((x, k) => assert(Math.abs(x - reset[k]) < 2e-4));
  await page.done("slides");
}

/// Pressed and let go where a pointer finds it.
async function press(page, where) {
  await page.locator(where).scrollIntoViewIfNeeded();
  const box = await page.locator(where).boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
}

/// A slider dragged by a pointer to a part of its way.
async function drag(page, key, part) {
  const slider = page.locator(`#slider-${key.replaceAll(/\W/g, "-")}`);
  await slider.scrollIntoViewIfNeeded();
  const box = await slider.boundingBox();
  const x = (part) => box.x + 8 + part * (box.width - 16);
  await page.mouse.move(x(Number(await slider.inputValue()) / 1000), box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(x(part), box.y + box.height / 2, { steps: 20 });
  await page.mouse.up();
}

/// The Tab key, until what is wanted has the focus.
async function tabTo(page, wanted, keys = "Tab") {
  for (let k = 0; k < 80; k++) {
    await page.keyboard.press(keys);
    if (await page.evaluate((wanted) => [document.activeElement.id, document.activeElement.getAttribute("aria-label")].includes(wanted), wanted)) return;
  }
  assert.fail(`no key leads to ${wanted}`);
}

/// How high the waves of a leaf are, as the page says it.
const waves = (page) => page.evaluate(() => Number(/([\d.]+) high/.exec(document.getElementById("summary").textContent)?.[1] ?? 0));

/// As someone who sees the page for the first time: chooses the leaf with waves, makes its veins stiffer, and finds the torsion at which it
/// lies flat; the address leads to the same leaf, seen from the same place. By mouse alone, and by keyboard alone.
async function flattens(byKeys) {
  const name = byKeys ? "flat-by-keys" : "flat-by-mouse";
  const page = await open("#all", { permissions: ["clipboard-read", "clipboard-write"] });
  const [bending, torsion] = ["scale:stiffness.bending_2", "stiffness.torsion"];
  if (byKeys) {
    await tabTo(page, "gallery");
    await page.keyboard.type("undu");
  } else await page.locator("#gallery").selectOption({ label: "undulation" });
  await page.waitForFunction(() => document.getElementById("title").textContent === "undulation" && /0.08\d* high/.test(document.getElementById("summary").textContent));
  await page.rest();
  if (byKeys) {
    // The slider that is added has the focus, and Enter leads to its number.
    for (const key of [torsion, bending]) {
      await tabTo(page, "add");
      await page.keyboard.type(key);
      await page.keyboard.press("Enter");
    }
    assert.equal(await page.evaluate(() => document.activeElement.id), "slider-scale-stiffness-bending_2");
    await page.keyboard.press("Enter");
    await page.keyboard.press("Control+A");
    await page.keyboard.type("10");
    await page.keyboard.press("Enter");
  } else {
    for (const key of [torsion, bending]) {
      await page.fill("#add", key);
      await page.press("#add", "Enter");
    }
    await press(page, `[aria-label="highest ${bending}"]`);
    await page.mouse.click(0, 0);
    await page.fill(`[aria-label="highest ${bending}"]`, "10");
    await page.mouse.click(640, 700);
    await drag(page, bending, 1);
  }
  await page.rest();
  assert.equal(await page.inputValue(`[aria-label="${bending}, as a number"]`), "10");
  assert((await waves(page)) > 0.03);
  if (byKeys) {
    await tabTo(page, "slider-stiffness-torsion");
    for (let k = 0; k < 5; k++) await page.keyboard.press("PageUp");
  } else await drag(page, torsion, 0.97);
  await page.waitForFunction(() => Number(/([\d.]+) high/.exec(document.getElementById("summary").textContent)?.[1] ?? 0) < 0.006, null, { timeout: 60000 });
  await page.rest();
  if (byKeys) await tabTo(page, "space", "Shift+Tab");
  if (byKeys) for (const key of ["ArrowLeft", "ArrowLeft", "+", "Shift+ArrowUp"]) await page.keyboard.press(key);
  else {
    await page.mouse.move(500, 300);
    await page.mouse.down();
    await page.mouse.move(600, 340, { steps: 5 });
    await page.mouse.up();
    await page.mouse.wheel(0, -200);
  }
  if (byKeys) {
    await tabTo(page, "share", "Shift+Tab");
    await page.keyboard.press("Enter");
  } else await press(page, "#share");
  await page.waitForFunction(() => document.getElementById("share").textContent === "copied", null, { timeout: 60000 });
  const address = await page.evaluate(() => navigator.clipboard.readText());
  const shown = (page) => page.evaluate(() => [document.querySelector("#summary").textContent.match(/tip\([^)]*\)/)[0].match(/[-\d.]+/g).map(Number), window.leafdyn.stage().camera()]);
  const again = await open(address.slice(address.indexOf("#")));
  const [[tip, view], [other, seen]] = [await shown(page), await shown(again)];
  assert(Math.max(...tip.map((x, k) => Math.abs(x - other[k]))) < 2e-4, `${tip}, by its address ${other}`);
  assert(Math.max(...view.map((x, k) => Math.abs(x - seen[k]))) < 1e-6, `seen from ${view}, by its address ${seen}`);
  await again.done(`${name}-again`);
  if (byKeys) {
    await page.keyboard.press("Control+z");
    await page.waitForFunction(() => /0.04\d* high/.test(document.getElementById("summary").textContent), null, { timeout: 60000 });
    assert.equal(await page.evaluate(() => document.activeElement.id), "share");
  }
  await page.done(name);
}

/// Beyond its snap another leaf is found afresh: the address leads to the one that is shown.
async function sharesOneOfSeveral() {
  const page = await open();
  await page.evaluate((text) => window.leafdyn.open({ text, name: "column.toml" }), COLUMN);
  for (const value of [0.05, -0.05]) await page.evaluate((value) => window.leafdyn.sliders.set("load.tip_force[2]", value, true), value);
  await page.rest();
  const up = await page.tip();
  assert(up[2] > 0.3);
  const address = await page.evaluate(() => window.leafdyn.share());
  const again = await open(address.slice(address.indexOf("#")));
  assert(Math.abs((await again.tip())[2] - up[2]) < 2e-4);
  await again.done("one-of-several-again");
  await page.done("one-of-several");
}

/// Whatever can be used has a name, and whatever can be touched is large enough for a finger.
async function named() {
  const page = await open("#all", { viewport: { width: 400, height: 800 }, hasTouch: true, isMobile: true });
  const client = await page.context().newCDPSession(page);
  const { nodes } = await client.send("Accessibility.getFullAXTree");
  const used = ["button", "slider", "spinbutton", "checkbox", "combobox", "textbox", "image", "DisclosureTriangle"];
  const nameless = nodes.filter(({ ignored, role, name }) => !ignored && used.includes(role?.value) && !name?.value);
  assert.deepEqual(nameless.map(({ role }) => role.value), []);
  assert(nodes.filter(({ role }) => used.includes(role?.value)).length > 40);
  const low = await page.evaluate(() => [...document.querySelectorAll("button, select, .way input, .head input")].filter((it) => it.offsetParent && it.getBoundingClientRect().height < 32).map((it) => it.id || it.textContent));
  assert.deepEqual(low, []);
  await page.done("named");
}

const COLUMN = `
name = "column"
leaf = { rods = 1, length = 1.0, fan = [0.0] }
stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 10.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
load = { tip_force = [-2.8, 0.0, 0.5] }
`;

/// It follows to its fold, snaps, and comes back late; folds are marked on the slider.
async function snaps() {
  const page = await open();
  await page.click("#source > summary");
  await page.fill("#text", COLUMN);
  await page.click("#read");
  await page.waitForFunction(() => window.leafdyn.now.known.view.title === "column");
  await page.evaluate(() => window.leafdyn.sliders.add("load.tip_force[2]"));
  const set = (value) => page.evaluate((value) => window.leafdyn.sliders.set("load.tip_force[2]", value, true), value);
  const z = async () => (await page.tip())[2];
  assert((await z()) > 0.3);
  await set(-0.1);
  await page.rest();
  assert((await z()) > 0.3);
  await set(-0.3);
  await page.waitForFunction(() => window.leafdyn.now.known.tips[0][2] < -0.3, null, { timeout: 60000 });
  await page.rest();
  await set(0.1);
  await page.rest();
  assert((await z()) < -0.3, "there is no hysteresis");
  await page.waitForFunction(() => /fold at -0.111/.test(document.querySelector(".marks[aria-label*=fold]")?.getAttribute("aria-label")), null, { timeout: 60000 });
  await page.done("snaps");
}

/// Let go it moves, and rests again; pulled by a pointer it follows.
async function moves() {
  const page = await open();
  await page.click("#drop");
  await page.waitForFunction(() => /^t = /.test(document.getElementById("now").textContent));
  await page.waitForTimeout(300);
  await page.click("#go");
  await page.rest();
  const before = await page.tip();
  await page.click("#pull");
  const box = await page.locator("#space").boundingBox();
  const at = await page.evaluate(() => window.leafdyn.stage().place(window.leafdyn.stage().nodes().at(-1)));
  await page.mouse.move(box.x + at[0], box.y + at[1]);
  await page.mouse.down();
  await page.mouse.move(box.x + at[0], box.y + at[1] - 120, { steps: 5 });
  await page.waitForFunction((z) => window.leafdyn.now.known.tips[0][2] > z + 0.02, before[2]);
  await page.mouse.up();
  await page.waitForFunction(() => window.leafdyn.now.playing, null, { timeout: 60000 });
  await page.keyboard.press(" ");
  await page.rest();
  await page.done("moves");
}

/// What is no scenario is refused with the program's words, shown as text, and the leaf stays.
async function hostile() {
  const page = await open();
  const read = (text) => page.evaluate((text) => window.leafdyn.open({ text, name: "hostile.toml" }), text);
  const texts = ["", "<script>alert(1)</script>", "a = ".repeat(1e5), `${"[".repeat(20000)}`, `name = "${"x".repeat(1e6)}"`, COLUMN.replace("rods = 1", "rods = 0"), COLUMN.replace("length = 1.0", "length = 1e300"), COLUMN.replace("1.0, fan", "nan, fan")];
  for (const text of texts) {
    assert.equal(await read(text), false, text.slice(0, 40));
    assert(await page.isVisible("#message"));
    assert((await page.textContent("#message")).length < 2000, text.slice(0, 40));
  }
  assert.match(await page.textContent("#message"), /hostile\.toml:\d+/);
  assert.equal(await page.textContent("#title"), "fig04");
  assert(await read(COLUMN.replace('"column"', '"<img src=x onerror=alert(1)>"')).catch(() => false) !== undefined);
  assert.equal(await page.locator("header img").count(), 0);
  await page.done("hostile");
}

/// What is asked of it: pictures and solutions a second, while a slider is dragged. Other work on the machine slows it down: what is
/// short is said, not refused.
async function fast() {
  const page = await open();
  console.log(`live.html: ${(statSync(file).size / 1e6).toFixed(2)} MB (3 asked), opened in ${page.opened} ms (1500 asked)`);
  await page.click("#foresee");
  const names = await page.evaluate(() => window.leafdyn.gallery.map(({ name }) => name));
  const slow = [];
  for (const name of names) {
    await page.choose(name);
    await page.rest();
    await page.waitForFunction(() => window.leafdyn.back.waiting.size === 0, null, { timeout: 60000 });
    const { key, solved, drawn, took } = await page.evaluate(async () => {
      const { now, front, sliders, stage } = window.leafdyn;
      const { key, high } = sliders.shown.find(({ whole }) => !whole);
      const value = sliders.value(key) || 0.1 * high;
      const [count, pictures, begun] = [now.count, stage().shown.drawn, performance.now()];
      const times = [];
      for (let time = 0; time < 2000; time = performance.now() - begun) {
        sliders.set(key, value * (1 + 0.1 * Math.sin(time / 500)), false);
        await new Promise(requestAnimationFrame);
        times.push(front.took);
      }
      const seconds = (performance.now() - begun) / 1000;
      return { key, solved: (now.count - count) / seconds, drawn: (stage().shown.drawn - pictures) / seconds, took: times.sort((a, b) => a - b)[times.length >> 1] };
    });
    if (drawn < 30) slow.push(name);
    console.log(`  ${name}, ${key}: ${solved.toFixed(0)} equilibria and ${drawn.toFixed(0)} pictures a second, ${took.toFixed(1)} ms in the solver`);
    assert.match(await page.textContent("#found"), /equilibrium|moves on/, name);
  }
  console.log(`  fewer than the 30 pictures a second that are asked of an idle machine: ${slow.join(", ") || "none"}`);
  assert(page.opened < 20000);
  await page.done("fast");
}

/// The picture in the documents: an undulating leaf, whose veins are made stiffer.
async function picture() {
  const page = await open("#all", { viewport: { width: 1280, height: 860 } });
  await page.choose("study/undulation.toml");
  await page.check("#surface");
  const key = "scale:stiffness.bending_2";
  await page.evaluate((key) => window.leafdyn.sliders.add(key), key);
  for (let k = 0; k <= 10; k++) {
    await page.evaluate(([key, value]) => window.leafdyn.sliders.set(key, value, true), [key, 1.1 ** k]);
    await page.rest();
  }
  await page.waitForFunction(() => document.querySelector(".marks[aria-label]:not([aria-label=''])"), null, { timeout: 60000 });
  await page.waitForTimeout(500);
  await page.done("picture");
}

/// The links of the site's gallery, one by one: each opens its leaf with the sliders that are asked for, and each slider moves the leaf.
async function gallery() {
  const entries = JSON.parse(readFileSync(join(web, "../site/gallery.json"), "utf8"));
  for (const { scenario, sliders } of entries) {
    const name = `${scenario.split("/")[1]}.toml`;
    const text = readFileSync(join(web, `../scenarios/${scenario}.toml`), "utf8");
    const held = { text, name, values: [], sliders, view: null };
    const page = await open(`#s=${deflateRawSync(JSON.stringify(held)).toString("base64url")}`);
    const shown = await page.evaluate(() => window.leafdyn.sliders.shown.map(({ key, low, high, log }) => ({ key, low, high, log })));
    assert.deepEqual(shown, sliders, scenario);
    assert.equal(await page.textContent("#added"), "", scenario);
    for (const { key, low, high, log } of sliders) {
      const middle = log ? Math.sqrt(low * high) : 0.5 * (low + high);
      const before = await page.evaluate(() => window.leafdyn.stage().nodes());
      await page.evaluate(([key, value]) => window.leafdyn.sliders.set(key, value, true), [key, 0.4 * low + 0.6 * middle]);
      await page.rest();
      const after = await page.evaluate(() => window.leafdyn.stage().nodes());
      const longest = await page.evaluate(() => window.leafdyn.stage().view.longest);
      const moved = before.length === after.length ? Math.max(...before.map((x, i) => Math.hypot(...x.map((y, k) => y - after[i][k])))) : Infinity;
      assert(moved > 1e-4 * longest, `${scenario}: ${key} moves the leaf by ${moved}`);
    }
    await page.done(`gallery-${scenario.split("/")[1]}`);
  }
}

/// The first sliders do something, are found by what they mean, and have one stop of the Tab key each.
async function firstSliders() {
  const page = await open();
  const keys = () => page.evaluate(() => window.leafdyn.sliders.shown.map(({ key }) => key));
  const first = await keys();
  assert.equal(first.length, 4);
  assert(first.includes("load.gravity[2]") && !first.includes("stiffness.torsion"), `${first}`);
  assert.match(await page.textContent(".slider .words"), /\S/);
  const stops = await page.evaluate(() => document.querySelectorAll(".slider :is(input, button):not([tabindex='-1'])").length);
  assert.equal(stops, 4, "stops of the Tab key");
  const add = async (text) => {
    await page.fill("#add", text);
    await page.press("#add", "Enter");
    return (await keys())[0];
  };
  for (const text of ["weight", "twist", "coupling.y"]) assert.match(await add(text), { weight: /load\.g/, twist: /torsion|twist/, "coupling.y": /^coupling\.y$/ }[text]);
  await page.choose("study/undulation.toml");
  await page.rest();
  assert.equal((await keys())[0], "margins");
  for (const text of ["ripple", "margin"]) assert.equal(await add(text), "margins");
  assert.equal(await page.inputValue('[aria-label="margins, as a number"]'), "30");
  // As many per cent as the outermost vein is longer; the others in proportion.
  await page.evaluate(() => window.leafdyn.sliders.set("margins", 15, true));
  await page.rest();
  const values = await page.evaluate(() => Object.fromEntries(window.leafdyn.sliders.values));
  assert.equal(values["rest.stretch[0]"], 1.15);
  assert.equal(values["rest.stretch[1]"], 1.096);
  assert.equal(values["rest.stretch[5]"], 1);
  assert.equal(await page.inputValue('[aria-label="margins, as a number"]'), "15");
  await page.done("first-sliders");
}

/// A leaf that moves is not told as one at rest: its tip is where it is seen, and the numbers at rest are pale.
async function movesAreTold() {
  const page = await open();
  await page.choose("motion/gust.toml");
  await page.rest();
  const rest = await page.tip();
  page.evaluate(() => void window.leafdyn.play(false));
  await page.waitForFunction(() => /in motion, t = [1-9.]/.test(document.getElementById("found").textContent), null, { timeout: 60000 });
  await page.waitForTimeout(1500);
  const told = await page.evaluate(() => ({
    lamp: document.getElementById("lamp").className,
    verdict: document.getElementById("verdict").className,
    past: document.getElementById("summary").classList.contains("past"),
    row: document.querySelector("#summary tr.now").textContent,
  }));
  assert.deepEqual([told.lamp, told.verdict, told.past], ["", "", true]);
  const tip = told.row.replaceAll("−", "-").match(/-?[\d.]+(?=[,)])/g).map(Number);
  assert(Math.hypot(...tip.map((x, k) => x - rest[k])) > 1e-3, `${tip} in motion, ${rest} at rest`);
  await page.evaluate(() => void window.leafdyn.play(false));
  await page.rest();
  await page.waitForFunction(() => document.getElementById("verdict").className === "good", null, { timeout: 60000 });
  await page.done("moves-are-told");
}

/// Three questions: each opens its leaf with few sliders, says what a step of a slider did, and leads to all numbers of the same leaf.
async function questions() {
  const page = await open();
  const said = () => page.textContent("#said");
  const ask = async (name) => {
    await press(page, `[data-question=${name}]`);
    await page.waitForFunction(() => document.body.classList.contains("lesson") && document.querySelectorAll("#said span").length > 1, null, { timeout: 60000 });
    await page.rest();
    assert(!(await page.isVisible("#summary")) && (await page.isVisible("#lesson-measure")), name);
    assert.equal(await page.evaluate(() => window.leafdyn.sliders.shown.length), { ripple: 3, snap: 2, arch: 4 }[name]);
  };
  await ask("ripple");
  assert.match(await said(), /30 % longer.*ripple, 0\.1\d* of the length high/);
  if (keep) await page.screenshot({ path: join(keep, "live-question-ripple.png") });
  // A point of the plane is pulled to where the leaf is flat, and the leaf follows.
  const box = await page.locator("#lesson-picture").boundingBox();
  const at = (x, y) => [box.x + (box.width * x) / 340, box.y + (box.height * y) / 216];
  await page.mouse.move(...at(60, 90));
  await page.mouse.down();
  await page.mouse.move(...at(320, 20), { steps: 4 });
  await page.mouse.up();
  await page.rest();
  await page.waitForFunction(() => /waves vanished|no waves to count/.test(document.getElementById("said").textContent), null, { timeout: 60000 });
  await ask("snap");
  const set = (key, value) => page.evaluate(([key, value]) => window.leafdyn.sliders.set(key, value, true), [key, value]);
  await page.waitForFunction(() => document.querySelector("#lesson-picture circle"), null, { timeout: 60000 });
  if (keep) await page.screenshot({ path: join(keep, "live-question-snap.png") });
  await set("load.tip_force[2]", -0.3);
  await page.waitForFunction(() => /It snapped/.test(document.getElementById("said").textContent), null, { timeout: 60000 });
  await ask("arch");
  if (keep) await page.screenshot({ path: join(keep, "live-question-arch.png") });
  // Greenhill's length of a heavy column of this section: (7.8373 E t^2/(12 rho g))^(1/3).
  const most = Math.cbrt((7.8373 * 1.2e5 * 0.03 ** 2) / (12 * 1e-5 * 981));
  assert.match(await said(), new RegExp(`stand up to ${Number(most.toPrecision(2))} cm`));
  // Of the same mass, thinner at its tip, it is wider; and the words are about a blade that tapers.
  await page.check("#same-mass");
  const mass = async () => Number(/weighs ([\d.]+) g/.exec(await said())[1]);
  const before = await mass();
  await set("section.thickness.value[1]", 0.015);
  await page.waitForFunction(() => /tapers/.test(document.getElementById("said").textContent), null, { timeout: 60000 });
  const width = await page.evaluate(() => window.leafdyn.sliders.value("section.width"));
  assert(Math.abs(width - 0.5 * (0.03 / 0.0225)) < 1e-5, `${width} cm wide`);
  assert.equal(await mass(), before);
  await page.uncheck("#same-mass");
  await set("section.thickness.value[1]", 0.03);
  await set("section.width", 0.5);
  await set("leaf.length", 8);
  await page.waitForFunction(() => /It stands/.test(document.getElementById("said").textContent), null, { timeout: 60000 });
  const direct = await open("#q=arch");
  await direct.waitForFunction(() => document.getElementById("title").textContent === "arch");
  await direct.done("question-by-address");
  await press(page, "[data-question='']");
  assert(await page.isVisible("#summary"));
  assert.equal(await page.evaluate(() => window.leafdyn.sliders.value("leaf.length")), 8);
  await page.done("questions");
}

/// On a telephone, in the dark.
async function narrow() {
  const page = await open("#all", { viewport: { width: 400, height: 800 }, colorScheme: "dark" });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert(wide <= 400, `${wide} px wide`);
  // The picture stays while the sliders scroll.
  await page.locator("#source").scrollIntoViewIfNeeded();
  const top = await page.evaluate(() => document.getElementById("stage").getBoundingClientRect().top);
  assert(top >= 0 && top < 200, `the picture is at ${top}`);
  await page.done("narrow");
}

const claims = { slides, snaps, moves, hostile, flattensByMouse: () => flattens(false), flattensByKeys: () => flattens(true), sharesOneOfSeveral, gallery, firstSliders, movesAreTold, questions, narrow, named, ...(keep ? { picture } : {}), fast };
const wanted = process.argv.slice(2);

try {
  for (const [name, claim] of Object.entries(claims)) if (!wanted.length || wanted.includes(name)) await claim();
  console.log("the live page is as it should be");
} finally {
  await browser.close();
}
