// Sliders for numbers of the scenario: linear or logarithmic, with a range that can be changed.

/// The place of a value on its way, from 0 to 1, and back.
const partOf = ({ low, high, log }, value) => (log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
const STEPS = 1000;
/// The part of the way that the arrow keys move a number.
const NUDGE = 0.01;

/// No more digits than the steps of a slider tell apart.
const valueOf = ({ low, high, log, whole }, part) => {
  if (part === 0 || part === 1) return part ? high : low;
  const value = log ? low * (high / low) ** part : low + part * (high - low);
  if (whole) return Math.round(value);
  const step = (log ? value * Math.log(high / low) : high - low) / STEPS;
  const unit = Math.floor(Math.log10(step));
  return Number((Math.round(value / 10 ** unit) * 10 ** unit).toPrecision(12));
};
const rounded = (value) => Number(value.toPrecision(6));
/// As a field for numbers shows it: small ones by their power of ten, whose digits fit into it.
const written = (value) => (value !== 0 && Math.abs(value) < 1e-4 ? rounded(value).toExponential() : String(rounded(value)));

/// The slider of all veins that have grown, which is none of a number of the scenario: by how much the margins are longer than the midrib.
const MARGINS = "margins";

/// What else numbers are looked for by.
const MEANT = [
  [/^margins$/, "ripple ripples wave waves edge edges growth grown"],
  [/rest\.stretch/, "ripple wave margin edge growth grown"],
  [/load\.g(ravity)?\b/, "weight heavy light mass gravity"],
  [/bending|young/, "stiff soft floppy modulus"],
  [/torsion|shear_modulus/, "twist stiff soft"],
  [/thickness/, "thick thin"],
  [/wind/, "blow gust storm air"],
];

/// All numbers of the scenario, those that are shown, and the values that were changed.
class Sliders {
  constructor(rows, change) {
    Object.assign(this, { rows, change, all: [], shown: [], values: new Map(), marks: new Map(), growth: null });
  }

  /// Takes the numbers of a scenario, and the growth of its margins; shown are those asked for, or those that move the leaf most.
  open(all, growth, wanted, values) {
    this.growth = growth;
    this.all = growth ? [marginsSlider(this.growthOf(() => NaN)), ...all] : all;
    this.values = new Map(values);
    this.marks.clear();
    const known = new Map(this.all.map((one) => [one.key, one]));
    const asked = (wanted || []).filter(({ key }) => known.has(key)).map((one) => ({ ...known.get(one.key), ...one }));
    const lost = (wanted || []).filter(({ key }) => !known.has(key)).map(({ key }) => key);
    const ends = ({ low, high }) => ({ low: rounded(low), high: rounded(high) });
    this.shown = asked.length ? asked : first(this.all).map((one) => ({ ...one, ...ends(one) }));
    find("added").textContent = lost.length ? `this scenario has no number ${lost.join(", ")}` : "";
    find("keys").replaceChildren(...this.all.map(({ key, words }) => new Option(words, key)));
    this.fill();
  }

  /// By how many per cent the first vein is longer than that in the middle, with the stretches that a function knows, or else those given.
  growthOf(known) {
    const { keys, stretches } = this.growth;
    const [first, middle] = [0, stretches.length >> 1].map((j) => (Number.isFinite(known(keys[j])) ? known(keys[j]) : stretches[j]));
    return 100 * (first / middle - 1);
  }

  /// The values of numbers of the scenario that a value of a slider means.
  meant(key, value) {
    if (key !== MARGINS) return [[key, value]];
    const { keys, stretches } = this.growth;
    const middle = stretches[stretches.length >> 1];
    const part = value / this.given(MARGINS);
    return keys.map((key, j) => [key, Number((middle + part * (stretches[j] - middle)).toPrecision(12))]);
  }

  /// What the scenario has.
  given(key) {
    const given = this.all.find((one) => one.key === key);
    if (given) return given.value;
    const vein = this.growth ? this.growth.keys.indexOf(key) : -1;
    return vein < 0 ? NaN : this.growth.stretches[vein];
  }

  value(key) {
    return this.valueIn(this.values, key);
  }

  /// The value of a slider where these numbers of the scenario have changed.
  valueIn(values, key) {
    if (key === MARGINS && this.growth) return this.growthOf((key) => values.get(key));
    return values.has(key) ? values.get(key) : this.given(key);
  }

  /// Whether any number is another than that of the scenario.
  moved() {
    return [...this.values].some(([key, value]) => value !== this.given(key));
  }

  placeAll() {
    this.shown.forEach(({ key }) => this.place(key));
  }

  set(key, value, done) {
    this.last = key;
    const slider = this.shown.find((one) => one.key === key);
    if (slider) {
      // A value beyond its range widens that.
      if (value > slider.high) slider.high = value;
      if (value < slider.low && !(slider.log && value <= 0)) slider.low = value;
    }
    for (const [number, its] of this.meant(key, value)) this.values.set(number, its);
    this.place(key);
    this.change(done);
  }

  /// Adds the slider of a number by its key or by a part of what it is called; of several that which moves the leaf most.
  add(text) {
    const wanted = text.trim().toLowerCase();
    const called = ({ key, words, description }) => [key, words, description, ...MEANT.filter(([which]) => which.test(key)).map(([, words]) => words)].join(" ").toLowerCase();
    const alike = this.all.filter((one) => wanted && called(one).includes(wanted)).sort((a, b) => (b.effect || 0) - (a.effect || 0));
    const found = this.all.find(({ key }) => key === text.trim()) || alike[0];
    if (!found) return false;
    if (!this.shown.some(({ key }) => key === found.key)) this.shown.unshift({ ...found, low: rounded(found.low), high: rounded(found.high) });
    this.fill();
    this.shown.find(({ key }) => key === found.key).parts.range.focus();
    return true;
  }

  remove(key) {
    const at = this.shown.findIndex((one) => one.key === key);
    this.shown.splice(at, 1);
    this.fill();
    const next = this.shown[Math.min(at, this.shown.length - 1)];
    (next ? next.parts.range : find("add")).focus();
  }

  fill() {
    this.rows.replaceChildren(...this.shown.map((slider) => this.row(slider)));
    this.placeAll();
  }

  row(slider) {
    const { key, description, words, unit } = slider;
    const make = (tag, properties, ...children) => {
      const element = Object.assign(document.createElement(tag), properties);
      element.append(...children);
      return element;
    };
    const id = `slider ${key}`.replaceAll(/\W/g, "-");
    // The Tab key stops once: from there Enter leads to the number, and Escape back.
    const number = make("input", { type: "number", step: "any", tabIndex: -1 });
    number.setAttribute("aria-label", `${key}, as a number`);
    number.addEventListener("change", () => (Number.isFinite(number.valueAsNumber) ? this.set(key, number.valueAsNumber, true) : this.place(key)));
    number.addEventListener("keydown", (event) => {
      if (event.key === "Escape") range.focus();
      const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!way || event.altKey || event.ctrlKey) return;
      event.preventDefault();
      const part = partOf(slider, this.value(key)) + way * NUDGE;
      this.set(key, slider.whole ? this.value(key) + way : valueOf(slider, Math.min(1, Math.max(0, part))), true);
    });
    const range = make("input", { type: "range", min: 0, max: STEPS, step: slider.whole ? "any" : 1, id, title: description });
    range.addEventListener("input", () => this.set(key, valueOf(slider, range.value / STEPS), false));
    range.addEventListener("change", () => this.change(true));
    range.addEventListener("keydown", (event) => {
      if (event.key === "Delete") this.remove(key);
      if (event.key !== "Enter") return;
      event.preventDefault();
      number.select();
    });
    const away = make("button", { type: "button", tabIndex: -1, textContent: "×", title: `takes the slider of ${key} away` });
    away.setAttribute("aria-label", `take the slider of ${key} away`);
    away.addEventListener("click", () => this.remove(key));
    const end = (name) => {
      const input = make("input", { type: "number", step: "any", tabIndex: -1, value: written(slider[name]) });
      input.setAttribute("aria-label", `${name === "low" ? "lowest" : "highest"} ${key}`);
      input.addEventListener("change", () => this.range(slider, name, input));
      return input;
    };
    const log = make("input", { type: "checkbox", tabIndex: -1, checked: slider.log });
    log.setAttribute("aria-label", `logarithmic ${key}`);
    log.addEventListener("change", () => {
      slider.log = log.checked && slider.low > 0;
      log.checked = slider.log;
      this.place(key);
    });
    const marks = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    marks.setAttribute("class", "marks");
    marks.setAttribute("viewBox", "0 0 1000 8");
    marks.setAttribute("preserveAspectRatio", "none");
    marks.setAttribute("role", "img");
    const ends = { low: end("low"), high: end("high") };
    slider.parts = { number, range, marks, away, ends };
    const row = make(
      "div",
      { className: "slider" },
      make("div", { className: "head" }, make("label", { htmlFor: id, title: description }, make("span", { className: "words", textContent: withItsUnit(words, unit) }), make("span", { className: "key", textContent: key })), number, away),
      make("div", { className: "way" }, range, marks),
      make("div", { className: "ends" }, ends.low, make("label", {}, log, " log"), ends.high),
    );
    slider.parts.row = row;
    return row;
  }

  /// Changes an end of a range, if that leaves a range.
  range(slider, name, input) {
    const given = { ...slider, [name]: input.valueAsNumber };
    if (Number.isFinite(input.valueAsNumber) && given.low < given.high && !(given.log && given.low <= 0)) slider[name] = input.valueAsNumber;
    else input.value = slider[name];
    this.place(slider.key);
  }

  /// Brings the parts of a slider to its value.
  place(key) {
    const slider = this.shown.find((one) => one.key === key);
    if (!slider || !slider.parts) return;
    const { number, range, ends } = slider.parts;
    const value = this.value(key);
    for (const [name, input] of Object.entries(ends)) input.value = written(slider[name]);
    number.value = written(value);
    range.value = STEPS * partOf(slider, value);
    range.setAttribute("aria-valuetext", String(rounded(value)));
    this.mark(slider);
  }

  /// What is known of the way: where it is unstable, folds and crossings.
  foresee(key, branch) {
    this.marks.set(key, branch);
    const slider = this.shown.find((one) => one.key === key);
    if (slider && slider.parts) this.mark(slider);
  }

  forget(but) {
    for (const key of [...this.marks.keys()]) if (key !== but) this.foresee(key, null);
  }

  mark(slider) {
    const { marks } = slider.parts;
    const branch = this.marks.get(slider.key);
    marks.replaceChildren();
    marks.setAttribute("aria-hidden", !branch);
    marks.setAttribute("aria-label", "");
    if (!branch) return;
    const add = (tag, attributes) => {
      const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      marks.append(element);
      return element;
    };
    const at = (value) => 1000 * partOf(slider, value);
    const said = [];
    branch.points.forEach((point, i) => {
      const next = branch.points[i + 1];
      const unstable = next && point.index && next.index;
      // Beyond a fold one lies over the other.
      if (next) add("path", { d: `M${at(point.value)} ${unstable ? 6 : 2}H${at(next.value)}`, stroke: unstable ? "var(--bad)" : "var(--good)", "stroke-width": 3 });
      if (!point.kind) return;
      add("path", { d: `M${at(point.value)} 0V8`, stroke: "var(--ink)", "stroke-width": 5 });
      said.push(`${point.kind.replace("-", " ")} at ${Number(point.value.toPrecision(5))}`);
    });
    marks.setAttribute("aria-label", said.join(", ") || "no fold and no crossing ahead");
  }

  /// Sorts by what a change of each by its own size does to the tip, and colours them.
  rank(effects) {
    const largest = Math.max(...effects.values(), 1e-300);
    const effect = ({ key }) => effects.get(key) || 0;
    this.shown.sort((a, b) => effect(b) - effect(a));
    this.fill();
    for (const slider of this.shown) slider.parts.row.style.borderLeftColor = `color-mix(in srgb, var(--accent) ${Math.round((100 * effect(slider)) / largest)}%, transparent)`;
  }
}

/// A unit stays in one line with its stroke.
const withItsUnit = (words, unit) => (unit ? `${words} /\u00a0${unit.replaceAll(" ", "\u00a0")}` : words);

/// The slider of the growth of the margins, in per cent.
function marginsSlider(value) {
  return { key: MARGINS, words: "margins longer than the midrib", unit: "%", value, low: 0, high: 2 * value, log: false, whole: false, effect: Infinity, description: "growth of the veins: the outermost by this part, those between as they are in the scenario" };
}

/// Lists have a number for each vein, and a factor of all, which tells more.
const OF_ONE_VEIN = /^(leaf|stiffness|section|blade|rest|coupling|tissue|dynamics|foundation)\..*\[/;
/// Growth of all veins alike is another length.
const OF_LENGTH = /^(scale:)?rest\.stretch$/;
/// What one moves first where effects are not known, as of a leaf that does not rest: the first number of each kind.
const USUAL = [/^load\.g(ravity)?\[/, /^wind\.velocity/, /^load\.tip_force/, /young|bending_2/, /thickness/, /^(leaf|blade)\.length/];
/// Effects that differ by a smaller part are those of one number by two names.
const ONE_EFFECT = 1e-6;

/// Numbers that one wants to move first: those that move the leaf most, each once.
function first(all) {
  const finite = all.filter(({ value }) => Number.isFinite(value));
  const sized = finite.filter(({ key, value, whole }) => value !== 0 && !whole && !OF_ONE_VEIN.test(key) && !OF_LENGTH.test(key));
  const able = sized.filter(({ effect }) => effect > 0);
  // Of two names that without a factor.
  const ranked = able.sort((a, b) => b.effect - a.effect || a.key.startsWith("scale:") - b.key.startsWith("scale:"));
  const once = [];
  for (const one of ranked) if (!once.some(({ effect }) => effect === one.effect || Math.abs(effect - one.effect) < ONE_EFFECT * effect)) once.push(one);
  const usual = USUAL.map((kind) => sized.find(({ key }) => kind.test(key))).filter(Boolean);
  return [once, usual, finite].find((some) => some.length).slice(0, 4);
}
