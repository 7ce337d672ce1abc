// The live page: a scenario, its sliders, and the leaf that follows them.
const find = (id) => document.getElementById(id);
let gallery = [];
const calm = matchMedia("(prefers-reduced-motion: reduce)");

let stage = null;
let front = null;
let back = null;
const trail = new Trail();
const sliders = new Sliders(find("rows"), changed);
/// What is open, and what is under way.
const now = { text: "", name: "", known: null, pinned: null, busy: false, wanted: false, pull: null, playing: false, count: 0 };
const past = [];

/// Milliseconds without a change after which it is asked what comes.
const IDLE = 250;
/// The part of the largest lowest eigenvalue below which a leaf is soft.
const SOFT = 0.02;
/// Milliseconds between numbers that are told.
const TOLD = 120;

function tell(message) {
  find("message").hidden = !message;
  find("message").textContent = message || "";
}

const nextFrame = () => new Promise((next) => requestAnimationFrame(next));

/// Opens a scenario; where it is refused, what was open stays.
async function open({ text, name, values = [], sliders: wanted, view }) {
  now.playing = false;
  while (now.busy) await nextFrame();
  now.busy = true;
  find("found").textContent = "opening";
  const answer = await front.ask({ ask: "open", text, name, values });
  now.busy = false;
  if (answer.answer !== "opened") {
    tell(answer.error);
    if (now.known) tellLeaf(now.known);
    return false;
  }
  tell(null);
  Object.assign(now, { text, name, pull: null, pinned: null });
  past.length = 0;
  find("text").value = text;
  restage(answer.known.view);
  if (view && stage.inSpace()) stage.see(view);
  sliders.open(answer.sliders, wanted, values);
  trail.begin(null);
  show(answer.known);
  later();
  return true;
}

/// A stage for another leaf: what was drawn before is left.
function restage(view) {
  if (stage) stage.leave();
  const old = find("space");
  old.replaceWith(old.cloneNode());
  listenToSpace(find("space"));
  stage = stageOf(view);
  document.body.classList.toggle("flat", !stage.inSpace());
  stage.setTheme(document.documentElement.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
  press("vibrate", false);
  press("pin", false);
  press("others", false);
}

const press = (id, on) => find(id).setAttribute("aria-pressed", on);
const pressed = (id) => find(id).getAttribute("aria-pressed") === "true";

/// Shows a leaf at rest, in space and in numbers.
function show(known, at = sliders.value(trail.key)) {
  if (known.view.rods !== stage.view.rods || known.view.joined !== stage.view.joined) restage(known.view);
  now.known = known;
  now.count += 1;
  stage.show(known);
  tellSoon();
  if (trail.key) trail.add(at, known);
  if (!stage.inSpace()) still();
  // A notebook around it hears how the scenario stands.
  if (window.parent !== window) window.parent.postMessage({ leafdyn: { text: now.text, values: Object.fromEntries(sliders.values) } }, "*");
}

/// Numbers that change faster than one reads are told now and then.
function tellSoon() {
  const wait = (now.toldAt || 0) + TOLD - performance.now();
  clearTimeout(now.telling);
  if (wait <= 0) tellLeaf(now.known);
  else now.telling = setTimeout(() => tellLeaf(now.known), wait);
}

function tellLeaf(known) {
  now.toldAt = performance.now();
  const { view } = known;
  find("title").textContent = document.title = view.title;
  find("found").textContent = view.verdict;
  const soft = known.eigenvalues.length > 0 && known.eigenvalues[0] < SOFT * stiffness(known);
  if (stage.shown.mode >= 0) stage.vibrate(true, swing());
  find("lamp").className = known.stable === false || !view.success ? "bad" : known.stable ? (soft ? "soft" : "good") : "";
  find("what").textContent = view.rods === 1 ? "1 vein" : `${view.rods} veins`;
  const lines = [...view.summary];
  if (known.eigenvalues.length) lines.push(["frequencies", known.eigenvalues.map((square) => (square < 0 ? `unstable, grows at ${stage.short(Math.sqrt(-square))}` : stage.short(Math.sqrt(square) / (2 * Math.PI)))).join(", ")]);
  const table = lines.map(([name, text]) => stage.row(name, text));
  if (now.pinned) table.unshift(...differences(now.pinned, known));
  find("summary").tBodies[0].replaceChildren(...table);
  find("undo").disabled = past.length === 0;
  find("reset").disabled = sliders.values.size === 0;
}

/// The largest lowest eigenvalue that was seen: what is small beside it is soft.
function stiffness(known) {
  now.stiffest = Math.max(now.stiffest && now.stiffestOf === now.text ? now.stiffest : 0, known.eigenvalues[0]);
  now.stiffestOf = now.text;
  return now.stiffest;
}

/// How far it swings: the more, the softer it is; as far as can be where its lowest eigenvalue is zero.
function swing() {
  const [lowest] = now.known.eigenvalues;
  return lowest > 0 ? Math.min(1, Math.max(0.15, Math.sqrt((SOFT * now.stiffest) / lowest))) : 1;
}

function differences(pinned, known) {
  const list = (numbers) => numbers.map(stage.short).join(", ");
  const rows = [];
  if (pinned.tips.length === known.tips.length) rows.push(stage.row("tip moved", list(known.tips[0].map((x, k) => x - pinned.tips[0][k]))));
  if (pinned.energy !== null && known.energy !== null) rows.push(stage.row("energy changed", stage.short(known.energy - pinned.energy)));
  return rows;
}

/// A slider was moved, or let go.
function changed(done) {
  if (sliders.last !== trail.key) {
    const slider = sliders.shown.find(({ key }) => key === sliders.last) || {};
    trail.begin(sliders.last, Boolean(slider.log) && sliders.value(sliders.last) > 0, now.known ? now.known.view.units : undefined);
    if (now.known && now.before) trail.add(now.before.get(sliders.last) ?? sliders.all.find(({ key }) => key === sliders.last)?.value, now.known);
    sliders.forget(null);
  }
  if (done) remember();
  pump();
}

function remember() {
  const values = [...sliders.values];
  const last = past.at(-1);
  if (!last || JSON.stringify(last.after) !== JSON.stringify(values)) past.push({ before: now.before ? [...now.before] : [], after: values });
  now.before = new Map(values);
}

/// Brings the leaf to the values that are wanted by now, again until there are no newer ones.
async function pump() {
  now.wanted = true;
  now.playing = false;
  clearTimeout(now.timer);
  if (now.busy) return;
  now.busy = true;
  while (now.wanted) {
    now.wanted = false;
    // A mode takes longer than the leaf.
    await follow(pressed("vibrate") ? 1 : 0);
  }
  now.busy = false;
  later();
}

async function follow(modes) {
  const asked = sliders.value(trail.key);
  const answer = await front.ask({ ask: "set", values: [...sliders.values], modes, pull: now.pull });
  if (answer.answer === "lost") return reopen(answer.error);
  if (answer.answer === "refused") return tell(answer.error);
  tell(null);
  if (answer.answer !== "left") return show(answer, asked);
  trail.gap(asked);
  find("found").textContent = "its stable equilibria end here: it moves on";
  find("lamp").className = "bad";
  await travel(true, false);
}

/// After the solver broke off: the scenario again, as it was at last.
async function reopen(error) {
  const values = [...sliders.values];
  const answer = await front.ask({ ask: "open", text: now.text, name: now.name, values });
  if (answer.answer === "opened") show(answer.known);
  tell(error);
}

/// In motion until it rests or is stopped: to its next equilibrium, or let go.
async function travel(damped, released) {
  if (damped && calm.matches) return land({ ask: "settle" });
  let answer = await front.ask({ ask: "go", damped, released });
  if (answer.answer !== "moving") {
    if (!damped) tell(answer.error);
    return land({ ask: "settle" });
  }
  const begun = performance.now();
  const named = now.known.view.units[0] !== null;
  now.playing = true;
  let last = begun;
  let due = 0;
  while (answer.answer === "moving" && !answer.ended && now.playing && !(damped && now.wanted && performance.now() - begun > 300)) {
    stage.moving(answer.leaf);
    find("now").textContent = damped ? "on its way to the next equilibrium" : `t = ${stage.short(answer.time)}`;
    const time = await nextFrame();
    // A named unit of length comes with seconds; without one a natural period takes about as long.
    const speed = (damped ? 2.5 : 1) / 2 ** (damped ? 0 : Number(find("slower").value));
    due += (Math.min(time - last, 100) / 1000) * speed * (named && !damped ? 1 : answer.unit);
    last = time;
    const count = Math.min(Math.floor(due / answer.step), 40);
    if (count < 1) continue;
    due -= count * answer.step;
    answer = await front.ask({ ask: "frame", count });
  }
  now.playing = false;
  find("now").textContent = "";
  if (answer.answer === "lost") return reopen(answer.error);
  if (answer.answer === "refused") tell(answer.error);
  return land({ ask: "land" });
}

async function land(question) {
  const answer = await front.ask(question);
  if (answer.answer === "found") show(answer);
  else if (answer.answer === "lost") await reopen(answer.error);
  else tell(answer.error);
}

/// Lets it go, where nothing else is under way.
async function play(released) {
  if (now.playing) {
    now.playing = false;
    return;
  }
  while (now.busy) await nextFrame();
  now.busy = true;
  now.pull = null;
  find("go").textContent = "stop";
  await travel(false, released);
  find("go").textContent = "let go";
  now.busy = false;
  if (now.wanted) pump();
  else later();
}

/// What is asked when nothing has changed for a while: the modes, what comes, the unloaded leaf.
function later() {
  clearTimeout(now.timer);
  now.timer = setTimeout(wonder, IDLE);
}

async function wonder() {
  if (now.busy || now.pull) return;
  const values = [...sliders.values];
  const same = () => !now.busy && JSON.stringify(values) === JSON.stringify([...sliders.values]);
  now.busy = true;
  const exact = await front.ask({ ask: "set", values, modes: 3 });
  now.busy = false;
  if (now.wanted) return pump();
  if (exact.answer === "followed" || exact.answer === "found") {
    now.known = exact;
    stage.show(exact);
    tellLeaf(exact);
  }
  const { text, name } = now;
  back = back.free();
  const opened = await back.ask({ ask: "open", text, name, values });
  if (opened.answer !== "opened" || !same()) return;
  if (find("unloaded").checked) {
    const bare = await back.ask({ ask: "unloaded" });
    if (bare.answer === "unloaded" && same()) stage.beside("unloaded", bare.view.leaves[0], "--frame");
  }
  const slider = sliders.shown.find(({ key }) => key === trail.key);
  if (slider && pressed("foresee") && !sliders.marks.get(slider.key) && !slider.whole && same()) {
    const { key, low, high, log } = slider;
    const branch = await back.ask({ ask: "trace", key, from: low, to: high, log });
    if (branch.answer === "branch" && now.text === text && trail.key === key) {
      sliders.foresee(key, branch);
      trail.foresee(branch);
    }
  }
}

async function others() {
  const on = !pressed("others");
  press("others", on);
  for (let k = 0; k < 12; k++) stage.beside(`other ${k}`, null);
  if (!on) return;
  find("now").textContent = "looking for other equilibria";
  const values = [...sliders.values];
  back = back.free();
  await back.ask({ ask: "open", text: now.text, name: now.name, values });
  const found = await back.ask({ ask: "equilibria" });
  find("now").textContent = "";
  if (found.answer === "gone") return press("others", false);
  if (found.answer !== "equilibria") return tell(found.error);
  const apart = ({ tips }) => Math.hypot(...tips[0].map((x, k) => x - now.known.tips[0][k]));
  const rest = found.list.filter((known) => apart(known) > 1e-3 * now.known.view.longest).slice(0, 12);
  rest.forEach((known, k) => stage.beside(`other ${k}`, known.view.leaves[0], known.stable ? "--good" : "--bad"));
  find("now").textContent = rest.length ? `${rest.length} more: green is stable` : "no other was found";
}

async function rank() {
  const keys = sliders.shown.filter(({ whole }) => !whole).map(({ key }) => key);
  const found = await front.ask({ ask: "sensitivity", keys });
  if (found.answer !== "sensitivity") return tell(found.error);
  const size = ({ key, tips }) => [key, Math.hypot(...tips[0]) * Math.abs(sliders.value(key) || sliders.shown.find((one) => one.key === key).high)];
  sliders.rank(new Map(found.list.map(size)));
}

function undo() {
  const last = past.pop();
  if (!last) return;
  sliders.values = new Map(last.before);
  now.before = new Map(last.before);
  sliders.fill();
  pump();
}

function reset() {
  remember();
  sliders.values = new Map();
  past.push({ before: now.before ? [...now.before] : [], after: [] });
  now.before = new Map();
  sliders.fill();
  pump();
}

async function save(what) {
  find("save").value = "";
  if (!what) return;
  if (what === "png") return stage.savePicture();
  const found = await front.ask({ ask: "write", file: what });
  if (found.answer !== "file") return tell(found.error);
  const name = what === "scenario.toml" ? `${now.known.view.title}.toml` : `${now.known.view.title}-${what}`;
  download(name, new Blob([bytesOf(found.content)]));
}

async function still() {
  const found = await front.ask({ ask: "write", file: "figure.svg" });
  if (found.answer !== "file") return;
  const image = Object.assign(new Image(), { alt: `${now.known.view.title}: ${now.known.view.verdict}`, src: `data:image/svg+xml;base64,${found.content}` });
  find("drawing").replaceChildren(image);
}

async function share() {
  const shown = sliders.shown.map(({ key, low, high, log }) => ({ key, low, high, log }));
  const view = stage.inSpace() ? stage.camera() : null;
  const hash = `#s=${await packed({ text: now.text, name: now.name, values: [...sliders.values], sliders: shown, view })}`;
  try {
    history.replaceState(null, "", hash);
    await navigator.clipboard.writeText(location.href);
    find("share").textContent = "copied";
  } catch {
    find("share").textContent = "in the address";
  }
  setTimeout(() => (find("share").textContent = "link"), 1500);
  return location.href;
}

/// Weight as the view has it: towards the lower edge of the screen.
function turnGravity() {
  if (!find("turned").checked || !stage.inSpace()) return;
  const table = ["load.g", "load.gravity"].find((table) => [0, 1, 2].some((k) => sliders.value(`${table}[${k}]`)));
  if (!table) return;
  const keys = [0, 1, 2].map((k) => `${table}[${k}]`);
  const size = Math.hypot(...keys.map((key) => sliders.value(key)));
  const down = stage.downward();
  keys.forEach((key, k) => {
    sliders.values.set(key, Number((size * down[k]).toPrecision(6)));
    sliders.place(key);
  });
  pump();
}
