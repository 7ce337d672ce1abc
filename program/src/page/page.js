// The page of a result: what is shown, how it is played and chosen.
const several = view.kind === "equilibria" && view.leaves.length > 1;
const sequence = view.kind === "motion" || view.kind === "trace";

/// Where it is in a sequence, perhaps between two leaves; the phase of a mode; the chosen one of several.
Object.assign(shown, { at: 0, phase: 0, alone: several ? -1 : 0, playing: false });
let diagram = null;

function fillText() {
  const stable = find("verdict");
  stable.textContent = view.verdict;
  // Green is what is known to be stable, and nothing else.
  const bad = !view.success || /unstable|index/.test(view.verdict);
  stable.className = bad ? "bad" : /^stable/.test(view.verdict) ? "good" : "";
  const many = view.rods === 1 ? "1 vein" : `${view.rods} veins${view.joined ? " joined at the tip" : " with free tips"}`;
  const part = view.drawn.length < view.rods ? `, ${view.drawn.length} drawn` : "";
  find("what").textContent = many + part;
  fillSummary();
}

/// The numbers of the result, or of the chosen one of several.
function fillSummary() {
  const own = several && shown.alone >= 0 ? view.leaves[shown.alone] : null;
  const lines = own && own.summary ? own.summary : view.summary;
  find("summary").tBodies[0].replaceChildren(...lines.map(([name, text]) => row(name, text)));
  find("summary").caption.textContent = own ? own.label : "Result";
}

/// All leaves or, of a long sequence, so many, the first and the last among them.
function sampled(most) {
  const last = view.leaves.length - 1;
  const count = Math.min(most, last + 1);
  return Array.from({ length: count }, (_, i) => leafAt(Math.round((i * last) / Math.max(1, count - 1))));
}

/// Those that set the limits of the colours.
function limiting() {
  return shown.mode >= 0 ? [0, 0.5, 1, 1.5].map((part) => inMode(view.modes[shown.mode], part * Math.PI)) : sampled(40);
}

/// The leaves in the panels: several, or one: as given, between two instants, or in a mode.
function currentLeaves() {
  if (several) return shown.alone < 0 ? sampled(Infinity) : [leafAt(shown.alone)];
  if (shown.mode >= 0) return [inMode(view.modes[shown.mode], shown.phase)];
  const index = Math.min(Math.floor(shown.at), view.leaves.length - 1);
  const [a, part] = [leafAt(index), shown.at - index];
  if (view.kind !== "motion" || part < 1e-6 || index + 1 >= view.leaves.length) return [a];
  const b = leafAt(index + 1);
  return [{ ...a, points: a.points.map((x, i) => x + part * (b.points[i] - x)) }];
}

/// Brings everything up to date: `again` after a setting has changed.
function update(again) {
  leaves = currentLeaves();
  if (leaves.length) showDirections(leaves[0]);
  if (space) space.panels = leaves.map((leaf, i) => ({ leaf, mesh: put(i, leaf, again), label: several ? leaf.label : "" }));
  shown.dirty = true;
  if (again) shown.stale = true;
  if (sequence || shown.mode >= 0) tellFrame();
  if (find("probe").open) fillProbe();
}

function tellFrame() {
  const index = Math.round(shown.at);
  if (shown.mode >= 0) {
    find("now").textContent = view.modes[shown.mode].label;
    return;
  }
  const one = view.leaves[index];
  // Texts that nobody can read so fast cost more than the leaf.
  const now = performance.now();
  if (shown.playing && (shown.told === index || now - shown.toldAt < 80)) return;
  [shown.told, shown.toldAt] = [index, now];
  find("now").textContent = `${one.label}   (${index + 1} of ${view.leaves.length})`;
  find("frame").value = index;
  if (diagram) {
    const time = one.time === undefined ? undefined : timeAt(shown.at);
    diagram.show(index, time);
  }
}

function timeAt(at) {
  const index = Math.min(Math.floor(at), view.leaves.length - 1);
  const next = view.leaves[Math.min(index + 1, view.leaves.length - 1)];
  const [a, b] = [view.leaves[index].time, next.time];
  return a + (at - index) * (b - a);
}

/// The place, between two leaves, of a time.
function atTime(time) {
  const next = view.leaves.findIndex((leaf) => leaf.time > time);
  if (next < 0) return view.leaves.length - 1;
  if (next === 0) return 0;
  const [a, b] = [view.leaves[next - 1].time, view.leaves[next].time];
  return next - 1 + (time - a) / (b - a);
}

function play(on) {
  shown.playing = on;
  find("play").textContent = on ? "❚❚" : "▶";
  find("play").setAttribute("aria-label", on ? "pause (space)" : "play (space)");
  if (!on && sequence) tellFrame();
  if (on && sequence && shown.at >= view.leaves.length - 1) shown.at = 0;
}

/// Goes on in a sequence, or in the vibration, by so many seconds.
function advance(seconds) {
  if (shown.mode >= 0) {
    shown.phase += (2 * Math.PI * seconds) / 1.6;
    return update(false);
  }
  const part = seconds / Number(find("speed").value);
  const last = view.leaves.length - 1;
  if (view.kind === "motion") {
    const [from, to] = [view.leaves[0].time, view.leaves[last].time];
    shown.at = atTime(timeAt(shown.at) + part * (to - from));
  } else shown.at = Math.min(last, shown.at + part * last);
  if (shown.at >= last) play(false);
  update(false);
}

function step(by) {
  if (!sequence) return;
  play(false);
  shown.at = Math.min(Math.max(Math.round(shown.at) + by, 0), view.leaves.length - 1);
  update(false);
}

function key(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|SELECT|TEXTAREA/.test(event.target.tagName)) return;
  if (event.key === " " && event.target.tagName !== "BUTTON" && event.target.tagName !== "SUMMARY" && !find("player").hidden) play(!shown.playing);
  else if (event.key === ",") step(-1);
  else if (event.key === ".") step(1);
  else if (!keyInSpace(event)) return;
  event.preventDefault();
}

function fillModes() {
  if (!view.modes.length) return;
  find("mode-row").hidden = false;
  find("mode").replaceChildren(new Option("at rest", -1), ...view.modes.map((mode, i) => new Option(mode.label, i)));
  find("mode").addEventListener("change", () => {
    shown.mode = Number(find("mode").value);
    shown.plain = shown.mode >= 0;
    [shown.quantity, shown.phase] = [0, Math.PI / 2];
    fillQuantities();
    find("player").hidden = shown.mode < 0;
    play(shown.mode >= 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches);
    update(true);
  });
  for (const id of ["frame", "speed-row", "choice-row", "diagram"]) find(id).style.display = "none";
}

function fillPlayer() {
  if (!sequence || !view.leaves.length) return;
  find("player").hidden = false;
  find("frame").max = view.leaves.length - 1;
  find("frame").addEventListener("input", () => {
    play(false);
    shown.at = Number(find("frame").value);
    update(false);
  });
  if (view.chart) {
    find("choice").replaceChildren(...view.chart.choices.map((name, i) => new Option(name, i)));
    diagram = new Diagram(find("chart"), find("key"), view.chart, ({ leaf, time }) => {
      play(false);
      shown.at = leaf !== undefined ? leaf : atTime(time);
      update(false);
    });
    find("choice").addEventListener("change", () => {
      diagram.draw(Number(find("choice").value));
      tellFrame();
    });
  }
}

/// One of several alone, or all of them again.
function choose(event) {
  if (!several) return;
  const stage = find("stage").getBoundingClientRect();
  const [x, y] = [event.clientX - stage.left, event.clientY - stage.top];
  const index = space.panels.findIndex(({ rect: [left, top, width, height] }) => x >= left && y >= top && x < left + width && y < top + height);
  shown.alone = shown.alone < 0 ? index : -1;
  fillSummary();
  update(true);
}

function listen() {
  find("theme").addEventListener("click", () => {
    setTheme(root.dataset.theme === "dark" ? "light" : "dark");
    if (view.leaves.length) update(true);
  });
  find("quantity").addEventListener("change", () => {
    shown.quantity = Number(find("quantity").value);
    update(true);
  });
  for (const id of ["surface", "axes"]) find(id).addEventListener("change", () => update(true));
  find("png").addEventListener("click", savePicture);
  find("play").addEventListener("click", () => play(!shown.playing));
  for (const id of ["vein", "station"]) find(id).addEventListener("input", fillProbe);
  find("probe").addEventListener("toggle", fillProbe);
  find("settings").addEventListener("submit", (event) => event.preventDefault());
  document.addEventListener("keydown", key);
  new ResizeObserver(() => {
    if (space) space.stage = null;
    redraw();
    if (diagram) {
      diagram.draw(diagram.choice);
      tellFrame();
    }
  }).observe(find("stage"));
  if (!space) return;
  canvas.addEventListener("pointermove", hover);
  canvas.addEventListener("pointerleave", hover);
  canvas.addEventListener("dblclick", choose);
  document.querySelectorAll("#views button").forEach((button) => button.addEventListener("click", () => look(button.dataset.view)));
}

/// A frame of the screen: draws only what has changed.
let before = 0;
function tick(now) {
  const seconds = Math.min(0.2, (now - before) / 1000);
  before = now;
  if (shown.playing) advance(seconds);
  if (shown.dirty) {
    shown.dirty = false;
    render();
    shown.drawn = (shown.drawn || 0) + 1;
  }
  requestAnimationFrame(tick);
}

function open() {
  fillText();
  find("vein").max = view.rods;
  if (!view.leaves.length) throw new Error("there is no leaf to show");
  space = openSpace();
  fillQuantities();
  look("free");
}

try {
  open();
} catch (reason) {
  space = null;
  document.body.classList.add("flat");
  find("why").textContent = `Nothing can be drawn in space here (${reason.message}): the figure stands in its place.`;
  ["quantity", "surface", "axes", "png"].forEach((id) => (find(id).disabled = true));
}
fillPlayer();
if (space) fillModes();
setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
listen();
if (view.leaves.length) update(true);
requestAnimationFrame(tick);
/// For tests, and for whoever builds on the page.
window.leafdyn = {
  view,
  shown,
  picture,
  place: (point, panel = 0) => placeIn(space.panels[panel])(point),
  nodes: (panel = 0) => {
    const { points } = space.panels[panel].leaf;
    return Array.from({ length: points.length / 3 }, (_, i) => [...points.subarray(3 * i, 3 * i + 3)]);
  },
};
