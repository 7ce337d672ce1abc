// Three questions, each a view of its own: a leaf, few sliders, what just happened in words, and what one would measure. The scenario and
// all its numbers are one click away.

/// A strip that is pushed together, and pushed across at its free end.
const SNAP = `name = "snap"

[leaf]
rods = 1
length = 1.0
fan = [0.0]

[stiffness]
torsion = 1.0
bending_2 = 1.0
bending_3 = 10.0
axial = 100.0
shear_2 = 100.0
shear_3 = 100.0

[load]
tip_force = [-2.8, 0.0, 0.05]
`;

/// One blade of grass, nearly upright, in cm, N and s: the unit of mass is 100 kg.
const ARCH = `name = "arch"

[units]
length = "cm"
force = "N"
time = "s"

[leaf]
rods = 1
length = 25.0
fan = [0.0]
elevation = 1.4

[section]
shape = "rectangle"
width = 0.5
thickness = { at = [0.0, 1.0], value = [0.03, 0.03] }
young = 1.2e5
mass_density = 1e-5

[load]
g = [0.0, 0.0, -981.0]
`;

/// Thickness at the base and at the tip of that blade.
const THICKNESSES = ["section.thickness.value[0]", "section.thickness.value[1]"];

/// Its mass in g: the unit of mass is that of N s²/cm, 100 kg.
function bladeMass() {
  const [base, tip, length, width, density] = [...THICKNESSES, "leaf.length", "section.width", "section.mass_density"].map((key) => sliders.value(key));
  return 1e5 * density * length * width * 0.5 * (base + tip);
}

/// Where the flat leaf of study/undulation.toml without weight loses its stability: a2/a3 for each a1 (docs/undulation.md, from its traces).
const WAVES_BEGIN = [
  [0.943, 0.1], [0.879, 0.21], [0.764, 0.42], [0.613, 0.71], [0.474, 0.99], [0.4, 1.15], [0.275, 1.46],
  [0.154, 1.84], [0.087, 2.42], [0.075, 3.37], [0.069, 4.93], [0.065, 7.21], [0.0625, 10],
];

/// The load number of a heavy column that begins to bend over under its own weight: A. G. Greenhill (Proc. Camb. Phil. Soc. 4, 1881, 65).
const GREENHILL = 7.8373;

const words = (x, digits = 2) => String(Number(x.toPrecision(digits)));

const LESSONS = {
  ripple: {
    title: "Why do leaf margins ripple?",
    scenario: () => gallery.find(({ name }) => name === "study/undulation.toml"),
    sliders: [
      { key: MARGINS, low: 0, high: 50, log: false },
      { key: "scale:stiffness.bending_2", low: 1, high: 100, log: true, words: "bending stiffness up and down, times that at first" },
      { key: "stiffness.torsion", low: 0.1, high: 10, log: true },
    ],
    lead: "A margin that has grown longer than the midrib does not fit beside it. It can bow outwards in the surface of the leaf, or bend up and down.",
    formula: "A vein under the compression T would have (1/2π) √(|T| L²/A2) waves: the softer it is up and down (small A2), the more. To leave the surface it has to twist as well, which A1 resists.",
    measure: "The lengths of margin and midrib (a thread laid along each), and how far each droops as a strip, held flat and held on edge.",
    chapter: "undulation.md",
    said(known, before) {
      const longer = sliders.value(MARGINS);
      const ratio = 0.01 * sliders.value("scale:stiffness.bending_2");
      const first = longer < 1 ? "The margins are as long as the midrib: nothing is too long." : `The margins are ${words(longer)} % longer than the midrib: too long to lie straight beside it.`;
      const soft = `Up and down they are ${ratio < 1 ? `${words(1 / ratio)} times softer than` : "as stiff as"} sideways`;
      const now = known.waves > 0 ? `${soft}, so it costs less to ripple, ${words(known.waves)} of the length high, than to bow outwards.` : `${soft}, and here it costs less to take up the length by bowing outwards: there are no waves to count.`;
      const change = known.waves - before.waves;
      const then = before.waves > 0 && !known.waves ? "With the last step the waves vanished." : !before.waves && known.waves > 0 ? "With the last step waves appeared." : Math.abs(change) > 1e-3 ? `With the last step the waves became ${change > 0 ? "higher" : "lower"}.` : "";
      return [first, now, then];
    },
    picture: (svg) => drawPlane(svg),
  },
  snap: {
    title: "Why does a bent strip snap?",
    scenario: () => ({ text: SNAP, name: "snap.toml" }),
    sliders: [
      { key: "load.tip_force[2]", low: -0.5, high: 0.5, log: false, words: "push across (positive: upwards)" },
      { key: "load.tip_force[0]", low: -4, high: -2, log: false, words: "push along (negative: together)" },
    ],
    lead: "A strip that is pushed together bends to one side or to the other. Push its tip across, slowly, towards the other side: it leans, and then it jumps.",
    formula: "At rest the energy V(z) = W(z) − F z has no slope; stable is a valley. At the fold valley and hill meet, V″ = 0: beyond it nothing holds the leaf on its side. W(z) is the work against the force that would hold the tip at z: the area under the curve of force and displacement.",
    measure: "The force at which it jumps, once on the way there and once on the way back: the difference is the hysteresis, and the area between is the energy that a snap sets free.",
    chapter: "how-to-read.md",
    said(known, before) {
      const [z, was] = [known.tips[0][2], before.tips[0][2]];
      const force = sliders.value("load.tip_force[2]");
      const first = `The tip is ${z > 0 ? "above" : "below"}, and the push is ${force > 0 ? "upwards" : force < 0 ? "downwards" : "off"}.`;
      const against = z * force < 0;
      const now = Math.abs(sliders.value("load.tip_force[0]")) < 2.467 ? "It is pushed together by less than π²/4 of its stiffness: the straight strip is stable, and nothing can snap." : against ? "It leans against the push: its valley becomes flatter, the nearer it comes to the fold (the mark on the slider)." : "It leans the way that it is pushed: its valley is deep.";
      const then = z * was < 0 ? "It snapped: its valley ended, and it fell into the other. Go back, and it does not return at the same force." : "";
      return [first, now, then];
    },
    picture: (svg, known) => drawLandscape(svg, known),
  },
  arch: {
    title: "Why does a grass leaf arch and not fall?",
    scenario: () => ({ text: ARCH, name: "arch.toml" }),
    sliders: [
      { key: "leaf.length", low: 5, high: 45, log: false },
      { key: THICKNESSES[0], low: 0.01, high: 0.08, log: true, words: "thickness at the base" },
      { key: THICKNESSES[1], low: 0.005, high: 0.08, log: true, words: "thickness at the tip" },
      { key: "section.width", low: 0.1, high: 1, log: true },
    ],
    keepMass() {
      this.mass = bladeMass();
    },
    /// Of a given mass the width follows from the other numbers.
    tie(key) {
      if (!find("same-mass").checked || key === "section.width") return this.keepMass();
      const width = Number((sliders.value("section.width") * (this.mass / bladeMass())).toPrecision(6));
      const slider = sliders.shown.find((one) => one.key === "section.width");
      slider.low = Math.min(slider.low, width);
      slider.high = Math.max(slider.high, width);
      sliders.values.set("section.width", width);
      sliders.place("section.width");
    },
    lead: "Its own weight bends it: twice as long is twice the weight on twice the lever. But the farther it bends over, the nearer its weight comes to its base, and the shorter the lever: there its stiffness holds it. It arches, and does not fall.",
    formula: "Upright a blade of constant section stands up to the length L = (7.84 E I/(ρ g A))^⅓; of a flat section I/A = t²/12, so that L grows with t^⅔, and the width does not count. For the same mass a thicker, narrower blade stands longer, and so does one that tapers: its weight is low, and its stiffness where the moment is.",
    measure: "Its length, thickness and mass, and how often it nods in a second after a touch: the frequency tells E I without cutting it.",
    chapter: "how-to-read.md",
    said(known) {
      const [length, thickness, tip] = ["leaf.length", ...THICKNESSES].map((key) => sliders.value(key));
      const [young, density, g] = [sliders.value("section.young"), sliders.value("section.mass_density"), Math.abs(sliders.value("load.g[2]"))];
      const most = Math.cbrt((GREENHILL * young * thickness ** 2) / (12 * density * g));
      const [x, , z] = known.tips[0];
      const even = Math.abs(tip / thickness - 1) < 0.01;
      const first = even ? `Upright it could stand up to ${words(most)} cm; it is ${words(length)} cm long${length > most ? ": too long" : ""}.` : `As thick all along as at its base it could stand up to ${words(most)} cm; it is ${words(length)} cm long, and ${tip < thickness ? "tapers" : "is thicker at its tip"}.`;
      const now = z > 0.8 * length ? "It stands." : z > 0 ? `It arches: its tip is ${words(z)} cm above its base and ${words(Math.abs(x))} cm aside.` : `It hangs: its tip is ${words(-z)} cm below its base.`;
      const [lowest] = known.eigenvalues;
      const nods = lowest > 0 ? ` and nods ${words(Math.sqrt(lowest) / (2 * Math.PI))} times a second` : "";
      return [first, now, `It weighs ${words(bladeMass())} g${nods}.`];
    },
  },
};

/// The question that an address names, `#q=snap`, if there is one.
const questionOf = (hash) => Object.keys(LESSONS).find((name) => hash === `#q=${name}`);

/// The question that is open, and the leaf before its last step.
let lesson = null;
let step = { open: false, known: null };

/// Opens a question, or leaves all of them.
async function ask(name) {
  lesson = name ? LESSONS[name] : null;
  document.body.classList.toggle("lesson", Boolean(lesson));
  document.querySelectorAll("[data-question]").forEach((button) => button.setAttribute("aria-pressed", button.dataset.question === (name || "")));
  find("lesson").hidden = !lesson;
  if (!lesson) return;
  const { title, lead, formula, measure, chapter } = lesson;
  for (const [id, text] of Object.entries({ "lesson-title": title, "lesson-lead": lead, "lesson-formula": formula, "lesson-measure": measure })) find(id).textContent = text;
  // On the site the documents stand beside the page; a file alone only names them.
  find("lesson-chapter").textContent = `docs/${chapter}`;
  if (/^http/.test(location.protocol)) find("lesson-chapter").href = `docs/${chapter.replace(".md", "")}/`;
  find("lesson-picture").replaceChildren();
  find("lesson-picture").style.display = lesson.picture ? "" : "none";
  find("same-mass-row").hidden = !lesson.tie;
  find("same-mass").checked = false;
  step = { open: false, known: null };
  const { text, name: file } = lesson.scenario();
  const asked = lesson;
  await open({ text, name: file, sliders: lesson.sliders, last: lesson.sliders[0].key, question: name });
  history.replaceState(null, "", `#q=${name}`);
  if (lesson !== asked) return;
  step.open = true;
  tellLesson(now.known);
}

/// What just happened, in words and in the picture.
function tellLesson(known) {
  // Until its leaf is open, numbers are those of another one.
  if (!lesson || !known || !step.open) return;
  // A step is a change of a slider, from where it was taken to where it is let go; the same leaf, solved again, is none.
  const values = JSON.stringify([...sliders.values]);
  if (values !== step.values) step = { open: true, before: step.dragged ? step.before : step.known || known, values, dragged: Boolean(now.dragged) };
  else if (!now.dragged) step.dragged = false;
  step.known = known;
  find("said").replaceChildren(...lesson.said(known, step.before || known).filter(Boolean).map((text) => Object.assign(document.createElement("span"), { textContent: `${text} ` })));
  if (lesson.picture) lesson.picture(find("lesson-picture"), known);
}

/// A part of a picture.
function part(svg, tag, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  svg.append(element);
  return element;
}

const PLANE = { left: 46, right: 330, top: 10, bottom: 176, x: [0.0075, 1.3], y: [0.075, 13] };
/// How far the point is dragged: to numbers of the sliders.
const WITHIN = { x: [0.01, 1], y: [0.1, 10] };

/// The plane of softness and torsion: on which side of the curve the flat leaf ripples. A point is dragged, and the leaf follows.
function drawPlane(svg) {
  const { left, right, top, bottom, x, y } = PLANE;
  const place = (a, b) => [left + ((right - left) * Math.log(a / x[0])) / Math.log(x[1] / x[0]), bottom - ((bottom - top) * Math.log(b / y[0])) / Math.log(y[1] / y[0])];
  const [ratio, torsion] = [0.01 * sliders.value("scale:stiffness.bending_2"), sliders.value("stiffness.torsion")];
  if (!svg.childNodes.length) {
    svg.setAttribute("viewBox", "0 0 340 216");
    svg.setAttribute("aria-label", "where the flat leaf ripples: softness against stiffness against twisting");
    const curve = WAVES_BEGIN.map(([a, b]) => place(a, b).map((x) => x.toFixed(1)).join(","));
    part(svg, "path", { d: `M${left} ${top}V${bottom}H${place(...WAVES_BEGIN[0])[0]} L${curve.join(" L")}V${top}Z`, fill: "var(--membrane)", opacity: 0.35 });
    part(svg, "path", { d: `M${curve.join(" L")}`, fill: "none", stroke: "var(--ink)", "stroke-width": 1.6 });
    part(svg, "rect", { x: left, y: top, width: right - left, height: bottom - top, fill: "none", stroke: "var(--frame)" });
    for (const value of [0.01, 0.1, 1]) part(svg, "text", { x: place(value, 1)[0], y: bottom + 14, "text-anchor": "middle" }, value);
    for (const value of [0.1, 1, 10]) part(svg, "text", { x: left - 5, y: place(1, value)[1] + 4, "text-anchor": "end" }, value);
    part(svg, "text", { x: (left + right) / 2, y: bottom + 31, "text-anchor": "middle" }, "bending stiffness: up and down ÷ sideways");
    part(svg, "text", { x: 12, y: (top + bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(top + bottom) / 2})` }, "stiffness against twisting");
    part(svg, "text", { x: left + 8, y: bottom - 8 }, "drag the point");
    svg.style.touchAction = "none";
    part(svg, "text", { x: place(0.02, 1)[0], y: place(1, 0.45)[1] }, "ripples");
    part(svg, "text", { x: place(0.6, 1)[0], y: place(1, 4)[1], "text-anchor": "middle" }, "flat");
    svg.mark = part(svg, "circle", { r: 7, fill: "var(--accent)", stroke: "var(--paper)", "stroke-width": 1.5 });
    const go = (event) => {
      if (event.type === "pointermove" && !event.buttons) return;
      const box = svg.getBoundingClientRect();
      const at = [(340 * (event.clientX - box.left)) / box.width, (216 * (event.clientY - box.top)) / box.height];
      const within = ([low, high], value) => Math.min(high, Math.max(low, value));
      const a = within(WITHIN.x, x[0] * (x[1] / x[0]) ** ((at[0] - left) / (right - left)));
      const b = within(WITHIN.y, y[0] * (y[1] / y[0]) ** ((bottom - at[1]) / (bottom - top)));
      sliders.values.set("stiffness.torsion", Number(b.toPrecision(3)));
      sliders.set("scale:stiffness.bending_2", Number((100 * a).toPrecision(3)), event.type === "pointerup");
      sliders.placeAll();
      // The point is under the pointer, also where the leaf takes its time.
      drawPlane(svg);
    };
    svg.onpointerdown = (event) => (svg.setPointerCapture(event.pointerId), go(event));
    svg.onpointermove = svg.onpointerup = go;
  }
  const [cx, cy] = place(Math.min(x[1], Math.max(x[0], ratio)), Math.min(y[1], Math.max(y[0], torsion)));
  svg.mark.setAttribute("cx", cx);
  svg.mark.setAttribute("cy", cy);
}

/// The energy over the height of the tip, V(z) = W(z) − F z, from the forces along the branch that was traced: and where the leaf lies in it.
function drawLandscape(svg, known) {
  const points = trail.key === "load.tip_force[2]" && trail.branch ? trail.branch.points : [];
  svg.replaceChildren();
  svg.style.touchAction = "auto";
  svg.setAttribute("viewBox", "0 0 340 160");
  svg.setAttribute("aria-label", "energy over the height of the tip");
  if (points.length < 3) return void part(svg, "text", { x: 170, y: 80, "text-anchor": "middle" }, "the energy is drawn as soon as the branch is known");
  const force = sliders.value("load.tip_force[2]");
  let work = 0;
  const curve = points.map(({ value, tip }, i) => {
    if (i) work += 0.5 * (value + points[i - 1].value) * (tip[2] - points[i - 1].tip[2]);
    // Its slope is the force that is missing: to hold the tip there it takes that of the branch.
    return [tip[2], work - force * tip[2], value - force];
  });
  const [zs, es] = [0, 1].map((k) => curve.map((one) => one[k]));
  const [low, high] = [Math.min(...zs), Math.max(...zs)];
  const [deep, top] = [Math.min(...es), Math.max(...es)];
  const place = (z, e) => [20 + (300 * (z - low)) / (high - low || 1), 130 - (110 * (e - deep)) / (top - deep || 1)];
  const at = (z, e) => place(z, e).map((x) => x.toFixed(1)).join(",");
  const cubic = ([z, e, slope], i) => {
    if (!i) return `M${at(z, e)}`;
    const [from, height, before] = curve[i - 1];
    const third = (z - from) / 3;
    return `C${at(from + third, height + before * third)} ${at(z - third, e - slope * third)} ${at(z, e)}`;
  };
  part(svg, "path", { d: curve.map(cubic).join(" "), fill: "none", stroke: "var(--ink)", "stroke-width": 1.6 });
  const z = known.tips[0][2];
  const nearest = curve.reduce((best, one) => (Math.abs(one[0] - z) < Math.abs(best[0] - z) ? one : best));
  const [cx, cy] = place(z, nearest[1]);
  part(svg, "circle", { cx, cy: cy - 7, r: 7, fill: "var(--accent)" });
  part(svg, "text", { x: 170, y: 150, "text-anchor": "middle" }, "height of the tip: the strip rests in a valley");
  part(svg, "text", { x: 10, y: 75, "text-anchor": "middle", transform: "rotate(-90 10 75)" }, "energy");
}
