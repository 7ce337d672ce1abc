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
/// How far from a traced branch, in lengths, a leaf may be that is on it.
const NEAR = 1e-3;
/// The part of the largest lowest eigenvalue below which a leaf is soft.
const SOFT = 0.02;
/// Milliseconds within which steps of one number are undone together.
const TOGETHER = 1000;
/// What is shown of a leaf, which an address holds too.
const LOOKS = ["surface", "axes", "unloaded"];
/// Milliseconds between numbers that are told.
const TOLD = 120;

function tell(message) {
  find("message").hidden = !message;
  find("message").textContent = message || "";
}

const nextFrame = () => new Promise((next) => requestAnimationFrame(next));

/// Opens a scenario; where it is refused, what was open stays.
async function open({ text, name, values = [], sliders: wanted, last, view, looks = {}, at = null, question = null }) {
  const wish = (now.wish = {});
  now.playing = false;
  while (now.busy) await nextFrame();
  // Of several that were chosen meanwhile the last one is opened.
  if (wish !== now.wish) return false;
  now.busy = true;
  find("found").textContent = "opening";
  const answer = await front.ask({ ask: "open", text, name, values, at });
  now.busy = false;
  if (answer.answer !== "opened") {
    tell(answer.error);
    showGallery();
    if (now.known) tellLeaf(now.known);
    return false;
  }
  tell(null);
  Object.assign(now, { text, name, pull: null, pinned: null });
  // A leaf of one's own is no answer to the question that was open.
  if (lesson && !question) ask("");
  past.length = 0;
  now.modesAt = null;
  now.before = new Map(values);
  find("text").value = text;
  // An address is that of one leaf alone.
  if (view === undefined) forgetAddress();
  showGallery();
  for (const id of LOOKS) if (typeof looks[id] === "boolean") find(id).checked = looks[id];
  restage(answer.known.view);
  stage.colourBy(looks.colour);
  if (view && stage.inSpace()) stage.see(view);
  sliders.open(answer.sliders, answer.growth, wanted, values);
  trail.choose(answer.known);
  trail.begin(null);
  if (last && sliders.shown.some(({ key }) => key === last)) beginTrail(last, answer.known);
  show(answer.known);
  later();
  return true;
}

/// Which of the gallery is open, if it is one of these.
function showGallery() {
  const which = gallery.findIndex((one) => one.text === now.text);
  find("gallery").value = which < 0 ? "" : which;
}

function forgetAddress() {
  if (location.hash) history.replaceState(null, "", location.href.slice(0, location.href.indexOf("#")));
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

/// Shows a leaf at rest, in space and in numbers; one on a coarse grid is told as such.
function show(known, at = sliders.value(trail.key), coarse = false) {
  now.coarse = coarse;
  if (known.view.rods !== stage.view.rods || known.view.joined !== stage.view.joined) restage(known.view);
  now.known = known;
  now.count += 1;
  stage.show(known);
  tellSoon();
  if (trail.key && !now.pull) trail.add(at, known);
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
  find("found").textContent = now.coarse ? `${view.verdict}, on a coarse grid while it is dragged` : view.verdict;
  const soft = known.eigenvalues.length > 0 && known.eigenvalues[0] < SOFT * stiffness(known);
  if (stage.shown.mode >= 0) stage.vibrate(true, swing());
  const state = known.stable === false || !view.success ? "bad" : known.stable ? "good" : "";
  find("lamp").className = state === "good" && soft ? "soft" : state;
  find("verdict").className = state;
  find("summary").classList.remove("past");
  find("what").textContent = view.rods === 1 ? "1 vein" : `${view.rods} veins`;
  const lines = [...view.summary];
  // Where they are not known at once their place is kept: what stands below does not jump.
  const at = lines.findIndex(([name]) => name === "modes");
  if (at >= 0) now.modesAt = at;
  else if (now.modesAt) lines.splice(now.modesAt, 0, ["modes", "…"]);
  const table = lines.map(([name, text]) => stage.row(name, text));
  if (now.pinned) table.unshift(...differences(now.pinned, known));
  find("summary").tBodies[0].replaceChildren(...table);
  tellLesson(known);
  // They keep the focus where there is nothing to undo any more.
  find("undo").setAttribute("aria-disabled", past.length === 0);
  find("reset").setAttribute("aria-disabled", !sliders.moved());
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
    beginTrail(sliders.last, now.known);
    if (now.known) trail.add(sliders.valueIn(now.before, sliders.last), now.known);
  }
  if (lesson && lesson.tie) lesson.tie(sliders.last);
  if (done) remember(sliders.last);
  // Let go, it is solved as accurately as before.
  now.dragged = !done;
  pump();
}

/// The trail and what comes are those of one number.
function beginTrail(key, known) {
  const slider = sliders.shown.find((one) => one.key === key) || {};
  trail.begin(key, Boolean(slider.log) && sliders.value(key) > 0, known ? known.view.units : undefined);
  sliders.forget(null);
}

/// What can be undone: steps of one number that follow quickly, as by keys, together.
function remember(key = null) {
  const values = [...sliders.values];
  if (JSON.stringify(values) === JSON.stringify([...now.before])) return;
  const [last, time] = [past.at(-1), performance.now()];
  if (last && key && last.key === key && time - last.time < TOGETHER) last.time = time;
  else past.push({ key, time, before: [...now.before] });
  now.before = new Map(values);
}

/// Brings the leaf to the values that are wanted by now, again until there are no newer ones.
async function pump() {
  now.wanted = true;
  now.playing = false;
  clearTimeout(now.timer);
  // Those of other numbers are none of these.
  if (pressed("others")) others();
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
  const coarse = Boolean(now.dragged) && !modes && !now.pull;
  const answer = await front.ask({ ask: "set", values: [...sliders.values], modes, coarse, pull: now.pull });
  if (answer.answer === "lost") return reopen(answer.error);
  if (answer.answer === "refused") return tell(answer.error);
  tell(null);
  if (answer.answer !== "left") return show(answer, asked, coarse);
  trail.gap(asked);
  tellMotion("its stable equilibria end here: it moves on");
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
  const named = now.known.view.units[2] === "s";
  now.playing = true;
  let last = begun;
  let due = 0;
  while (answer.answer === "moving" && !answer.ended && now.playing && !(damped && now.wanted && performance.now() - begun > 300)) {
    stage.moving(answer.leaf);
    find("now").textContent = damped ? "on its way to the next equilibrium" : instantText(answer.time);
    const time = await nextFrame();
    if (time - (now.toldAt || 0) > TOLD) tellMotion(damped ? "its stable equilibria end here: it moves on" : `in motion, ${instantText(answer.time)}`, answer.tip);
    // Elsewhere a natural period takes about a second.
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

const instantText = (time) => `t = ${stage.short(time)}${now.known.view.units[2] ? ` ${now.known.view.units[2]}` : ""}`;

/// What is known of a leaf in motion: where its tip is. The numbers of the leaf at rest are past, and pale.
function tellMotion(found, tip) {
  now.toldAt = performance.now();
  clearTimeout(now.telling);
  find("found").textContent = found;
  find("verdict").className = find("lamp").className = "";
  const [length] = now.known.view.units;
  const here = tip ? [stage.row("tip now", `(${tip.map(stage.short).join(", ")})${length ? ` ${length}` : ""}`)] : [];
  here.forEach((row) => row.classList.add("now"));
  const rest = now.known.view.summary.map(([name, text]) => stage.row(name, text));
  find("summary").classList.add("past");
  find("summary").tBodies[0].replaceChildren(...here, ...rest);
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
  const { known } = now;
  const blown = known.view.summary.some(([name]) => name === "wind");
  if (!released && !now.pull && known.stable && !blown) {
    find("now").textContent = "it is at rest, and stays: pull at a vein, or drop it";
    return;
  }
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
  const { text, name } = now;
  const values = [...sliders.values];
  const same = () => !now.busy && now.text === text && JSON.stringify(values) === JSON.stringify([...sliders.values]);
  now.busy = true;
  const exact = await front.ask({ ask: "set", values, modes: 3 });
  now.busy = false;
  if (now.wanted) return pump();
  // As no value has changed, this is a leaf beside its end.
  if (exact.answer === "left") return pump();
  if (exact.answer === "followed" || exact.answer === "found") {
    now.known = exact;
    now.coarse = false;
    stage.show(exact);
    tellLeaf(exact);
  }
  const { at } = await front.ask({ ask: "place" });
  if (!same()) return;
  back = back.free();
  const opened = await back.ask({ ask: "open", text, name, values, at });
  if (opened.answer !== "opened" || !same()) return;
  if (find("unloaded").checked) {
    const bare = await back.ask({ ask: "unloaded" });
    if (bare.answer === "unloaded" && same()) stage.beside("unloaded", bare.view.leaves[0], "--frame");
  }
  const slider = sliders.shown.find(({ key }) => key === trail.key);
  if (slider && pressed("foresee") && !slider.whole && slider.key !== MARGINS && same() && !isOn(trail.branch, slider, now.known)) {
    const { key, low, high, log } = slider;
    sliders.foresee(key, null);
    trail.foresee(null);
    const branch = await back.ask({ ask: "trace", key, from: low, to: high, log });
    if (branch.answer === "branch" && now.text === text && trail.key === key) {
      // Other numbers may have changed since, and the leaf may have snapped.
      const others = (all) => JSON.stringify([...all].filter(([one]) => one !== key));
      const asked = others(values);
      if (asked !== others(sliders.values)) return;
      Object.assign(branch, { low, high, log, others: asked });
      sliders.foresee(key, branch);
      trail.foresee(branch);
      tellLesson(now.known);
    }
  }
}

/// Whether a branch that was traced between the ends of a slider is that on which the leaf is.
function isOn(branch, { key, low, high, log }, known) {
  if (!branch || branch.low !== low || branch.high !== high || branch.log !== log) return false;
  if (branch.others !== JSON.stringify([...sliders.values].filter(([one]) => one !== key))) return false;
  const value = sliders.value(key);
  const near = NEAR * known.view.longest;
  // Between two of its points it is as far from both as these are from one another, or less.
  return branch.points.some((a, i) => {
    const b = branch.points[i + 1];
    if (!b || (a.value - value) * (b.value - value) > 0 || a.value === b.value) return false;
    const part = (value - a.value) / (b.value - a.value);
    const bend = Math.hypot(...a.tip.map((x, k) => x - b.tip[k]));
    return Math.hypot(...a.tip.map((x, k) => x + part * (b.tip[k] - x) - known.tips[0][k])) <= near + 0.25 * bend;
  });
}

async function others() {
  const on = !pressed("others");
  press("others", on);
  for (let k = 0; k < 12; k++) stage.beside(`other ${k}`, null);
  if (!on) return;
  find("now").textContent = "looking for other equilibria";
  const { text, name } = now;
  const values = [...sliders.values];
  back = back.free();
  await back.ask({ ask: "open", text, name, values });
  const found = await back.ask({ ask: "equilibria" });
  find("now").textContent = "";
  if (found.answer === "gone" || now.text !== text || !pressed("others")) return press("others", false);
  if (found.answer !== "equilibria") return tell(found.error);
  const apart = ({ tips }) => Math.hypot(...tips[0].map((x, k) => x - now.known.tips[0][k]));
  const rest = found.list.filter((known) => apart(known) > 1e-3 * now.known.view.longest).slice(0, 12);
  rest.forEach((known, k) => stage.beside(`other ${k}`, known.view.leaves[0], known.stable ? "--good" : "--bad"));
  find("now").textContent = rest.length ? `${rest.length} more: green is stable` : "no other was found";
}

async function rank() {
  const keys = sliders.shown.filter(({ key, whole }) => !whole && key !== MARGINS).map(({ key }) => key);
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
  sliders.placeAll();
  pump();
}

function reset() {
  if (!sliders.moved()) return;
  sliders.values = new Map();
  remember();
  sliders.placeAll();
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
  const looks = Object.fromEntries(LOOKS.map((id) => [id, find(id).checked]));
  looks.colour = stage.colour();
  const { text, name } = now;
  const values = [...sliders.values];
  const at = await placeAmongSeveral({ text, name, values });
  const hash = `#s=${await packed({ text, name, values, sliders: shown, last: trail.key, view, looks, at })}`;
  try {
    history.replaceState(null, "", hash);
    await navigator.clipboard.writeText(location.href);
    find("share").textContent = "copied";
  } catch {
    find("share").textContent = "in the address";
  }
  setTimeout(() => (find("share").textContent = "copy link"), 1500);
  return location.href;
}

/// Where the leaf is, if a relaxation leads elsewhere.
async function placeAmongSeveral(opening) {
  if (!sliders.moved()) return undefined;
  const { leaves, longest } = now.known.view;
  const { at } = await front.ask({ ask: "place" });
  back = back.free();
  const { answer, known } = await back.ask({ ask: "open", ...opening });
  return answer === "opened" && stage.apart(known.view.leaves[0], leaves[0]) < NEAR * longest ? undefined : at;
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
