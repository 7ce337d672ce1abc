// What the page listens to, and how it begins.

function listenToSpace(canvas) {
  const at = (event) => {
    const box = find("stage").getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  let from = null;
  canvas.addEventListener(
    "pointerdown",
    (event) => {
      if (!pressed("pull") || !stage.inSpace()) return;
      const found = stage.nearest(...at(event));
      if (!found) return;
      stage.controls().enabled = false;
      canvas.setPointerCapture(event.pointerId);
      const { nodes, stations } = found.leaf;
      from = { place: at(event), vein: stage.view.drawn[Math.floor(found.node / nodes)], at: stations[Math.max(1, found.node % nodes)] };
    },
    { capture: true },
  );
  canvas.addEventListener("pointermove", (event) => {
    if (!from) return turnGravityLater();
    const [x, y] = at(event);
    now.pull = { vein: from.vein, at: from.at, displacement: stage.across(x - from.place[0], y - from.place[1]) };
    pump();
  });
  const end = () => {
    if (!from) return;
    from = null;
    stage.controls().enabled = true;
    if (!now.pull) return;
    const go = () => (now.busy ? setTimeout(go, 10) : play(false));
    go();
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
}

let turning = null;
function turnGravityLater() {
  if (!find("turned").checked || turning) return;
  turning = requestAnimationFrame(() => {
    turning = null;
    turnGravity();
  });
}

function toggle(id, act) {
  find(id).addEventListener("click", () => {
    press(id, !pressed(id));
    act(pressed(id));
  });
}

const advise = (text) => (find("advice").textContent = text);

function addSlider() {
  const wanted = find("add").value;
  if (!wanted.trim()) return;
  const found = sliders.add(wanted);
  if (found) find("add").value = "";
  find("added").textContent = found ? "" : `no number of this scenario has ${wanted.trim()} in its name`;
}

function tellSlower() {
  const factor = 2 ** Number(find("slower").value);
  find("slower").setAttribute("aria-valuetext", factor === 1 ? "as fast as it is" : `${Number(factor.toPrecision(2))} times slower`);
}

async function readFile(file) {
  if (file) open({ text: await file.text(), name: file.name });
}

function listen() {
  for (const event of ["pointerdown", "input"]) document.addEventListener(event, () => pressed("pull") || advise(""), { once: true });
  find("theme").addEventListener("click", () => {
    stage.setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    stage.again();
    trail.later();
  });
  find("undo").addEventListener("click", undo);
  find("reset").addEventListener("click", reset);
  find("share").addEventListener("click", share);
  find("go").addEventListener("click", () => play(false));
  find("drop").addEventListener("click", () => play(true));
  find("rank").addEventListener("click", rank);
  find("others").addEventListener("click", others);
  find("save").addEventListener("change", () => save(find("save").value));
  find("quantity").addEventListener("change", () => {
    stage.shown.quantity = Number(find("quantity").value);
    stage.again();
  });
  for (const id of ["surface", "axes"]) find(id).addEventListener("change", () => stage.again());
  find("unloaded").addEventListener("change", () => (find("unloaded").checked ? later() : stage.beside("unloaded", null)));
  for (const id of ["vein", "station"]) find(id).addEventListener("input", () => stage.fillProbe());
  find("probe").addEventListener("toggle", () => stage.fillProbe());
  find("turned").addEventListener("change", turnGravity);
  toggle("vibrate", (on) => stage.vibrate(on, swing()));
  toggle("pull", (on) => {
    document.body.classList.toggle("pulling", on);
    advise(on ? "Drag a vein: a spring pulls it after the pointer. Let go, and it swings." : "");
  });
  toggle("foresee", (on) => {
    if (!on) sliders.forget(null);
    trail.foresee(null);
    later();
  });
  toggle("pin", (on) => {
    now.pinned = on ? now.known : null;
    stage.beside("pinned", on ? now.known.view.leaves[0] : null, "--accent");
    tellLeaf(now.known);
  });
  find("sliders").addEventListener("submit", (event) => event.preventDefault());
  find("add").addEventListener("change", addSlider);
  // Chosen from the list, not typed.
  find("add").addEventListener("input", ({ inputType }) => {
    find("added").textContent = "";
    if (!inputType || inputType === "insertReplacementText") addSlider();
  });
  find("slower").addEventListener("input", tellSlower);
  tellSlower();
  document.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => stage.look(button.dataset.view)));
  find("same-mass").addEventListener("change", () => LESSONS.arch.keepMass());
  document.querySelectorAll("[data-question]").forEach((button) => button.addEventListener("click", () => ask(button.dataset.question)));
  find("gallery").addEventListener("change", () => open(gallery[Number(find("gallery").value)]));
  find("read").addEventListener("click", read);
  find("file").addEventListener("change", () => readFile(find("file").files[0]));
  document.addEventListener("keydown", key);
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  document.addEventListener("dragleave", () => document.body.classList.remove("dropping"));
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    readFile(event.dataTransfer.files[0]);
  });
  document.addEventListener("paste", (event) => {
    const text = event.clipboardData.getData("text/plain");
    if (!/INPUT|TEXTAREA/.test(event.target.tagName) && /^\s*\[?\w[\w.]*\]?\s*=?/m.test(text) && text.includes("=")) open({ text, name: "pasted.toml" });
  });
  window.addEventListener("hashchange", async () => {
    const shared = await unpacked(location.hash).catch(() => null);
    if (shared) open(shared);
    else if (questionOf(location.hash)) ask(questionOf(location.hash));
  });
  new ResizeObserver(() => {
    stage.resize();
    trail.later();
  }).observe(find("stage"));
}

/// Opens what is typed, or shows the line that is refused.
async function read() {
  const text = find("text").value;
  if (await open({ text, name: "scenario.toml" })) return;
  const line = Number(/:(\d+)/.exec(find("message").textContent)?.[1]);
  if (!(line > 0)) return;
  const lines = text.split("\n");
  const start = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
  find("text").focus();
  find("text").setSelectionRange(start, start + (lines[line - 1] || "").length);
}

function key(event) {
  if (event.target.id === "text" && event.ctrlKey && event.key === "Enter") return find("read").click();
  const typing = /INPUT|SELECT|TEXTAREA/.test(event.target.tagName);
  if ((event.ctrlKey || event.metaKey) && event.key === "z" && event.target.id !== "text") undo();
  else if (event.ctrlKey || event.metaKey || event.altKey || typing) return;
  else if (event.key === "p") find("pull").click();
  else if (event.key === " " && event.target.tagName !== "BUTTON" && event.target.tagName !== "SUMMARY") play(false);
  else if (!stage.key(event)) return;
  event.preventDefault();
}

/// The scenarios of the repository in their folders, and one that is none of them.
function fillGallery() {
  const folders = new Map();
  gallery.forEach(({ name }, i) => {
    const [folder, file] = name.replace(/\.toml$/, "").split("/");
    if (!folders.has(folder)) folders.set(folder, Object.assign(document.createElement("optgroup"), { label: folder }));
    folders.get(folder).append(new Option(file, i));
  });
  const own = Object.assign(new Option("your own", ""), { hidden: true, disabled: true });
  find("gallery").replaceChildren(own, ...folders.values());
}

let before = 0;
function tick(time) {
  const seconds = Math.min(0.2, (time - before) / 1000);
  before = time;
  stage.frame(seconds);
  requestAnimationFrame(tick);
}

async function begin() {
  const source = URL.createObjectURL(new Blob([find("worker").textContent], { type: "text/javascript" }));
  gallery = JSON.parse(new TextDecoder().decode(await unpack("gallery-data")));
  fillGallery();
  const compiled = await code();
  [front, back] = [0, 1].map(() => new Solver(source, compiled));
  await front.ready;
  find("version").textContent = `leafdyn ${(await front.ask({ ask: "version" })).version}`;
  const given = JSON.parse(find("given").textContent);
  const shared = await unpacked(location.hash).catch(() => null);
  const opened = (shared && (await open(shared))) || (given && (await open(given)));
  // Whoever comes without a wish is asked a question; `#all` begins with a leaf and all its numbers.
  const question = questionOf(location.hash) || (opened || location.hash ? null : "ripple");
  if (question) await ask(question);
  else if (!opened) await open(gallery.find(({ name }) => name.includes("fig04")) || gallery[0]);
  listen();
  requestAnimationFrame(tick);
  /// For tests, and for whoever builds on the page.
  window.leafdyn = { now, gallery, sliders, trail, open, ask, share, play, stage: () => stage, front, back };
}

begin().catch((reason) => {
  document.body.classList.add("flat");
  find("found").textContent = "nothing can be solved here";
  find("why").textContent = `This browser does not run the solver (${reason.message}).`;
});
