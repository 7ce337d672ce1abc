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

/// All numbers of the scenario, those that are shown, and the values that were changed.
class Sliders {
  constructor(rows, change) {
    Object.assign(this, { rows, change, all: [], shown: [], values: new Map(), marks: new Map() });
  }

  /// Takes the numbers of a scenario; shown are those asked for, or some that matter.
  open(all, wanted, values) {
    this.all = all;
    this.values = new Map(values);
    this.marks.clear();
    const known = new Map(all.map((one) => [one.key, one]));
    const asked = (wanted || []).filter(({ key }) => known.has(key)).map((one) => ({ ...known.get(one.key), ...one }));
    const ends = ({ low, high }) => ({ low: rounded(low), high: rounded(high) });
    this.shown = asked.length ? asked : first(all).map((one) => ({ ...one, ...ends(one) }));
    find("keys").replaceChildren(...all.map(({ key, description }) => new Option(description, key)));
    this.fill();
  }

  /// What the scenario has.
  given(key) {
    const given = this.all.find((one) => one.key === key);
    return given ? given.value : NaN;
  }

  value(key) {
    return this.values.has(key) ? this.values.get(key) : this.given(key);
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
    this.values.set(key, value);
    this.place(key);
    this.change(done);
  }

  add(text) {
    const wanted = text.trim().toLowerCase();
    const found = this.all.find(({ key }) => key === text.trim()) || this.all.find(({ key, description }) => wanted && `${key} ${description}`.toLowerCase().includes(wanted));
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
    (next ? next.parts.away : find("add")).focus();
  }

  fill() {
    this.rows.replaceChildren(...this.shown.map((slider) => this.row(slider)));
    this.placeAll();
  }

  row(slider) {
    const { key, description } = slider;
    const make = (tag, properties, ...children) => {
      const element = Object.assign(document.createElement(tag), properties);
      element.append(...children);
      return element;
    };
    const id = `slider ${key}`.replaceAll(/\W/g, "-");
    const number = make("input", { type: "number", step: "any" });
    number.setAttribute("aria-label", `${key}, as a number`);
    number.addEventListener("change", () => (Number.isFinite(number.valueAsNumber) ? this.set(key, number.valueAsNumber, true) : this.place(key)));
    number.addEventListener("keydown", (event) => {
      const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!way || event.altKey || event.ctrlKey) return;
      event.preventDefault();
      const part = partOf(slider, this.value(key)) + way * NUDGE;
      this.set(key, slider.whole ? this.value(key) + way : valueOf(slider, Math.min(1, Math.max(0, part))), true);
    });
    const range = make("input", { type: "range", min: 0, max: STEPS, step: slider.whole ? "any" : 1, id, title: description });
    range.addEventListener("input", () => this.set(key, valueOf(slider, range.value / STEPS), false));
    range.addEventListener("change", () => this.change(true));
    const away = make("button", { type: "button", textContent: "×", title: `takes the slider of ${key} away` });
    away.setAttribute("aria-label", `take the slider of ${key} away`);
    away.addEventListener("click", () => this.remove(key));
    const end = (name) => {
      const input = make("input", { type: "number", step: "any", value: slider[name] });
      input.setAttribute("aria-label", `${name === "low" ? "lowest" : "highest"} ${key}`);
      input.addEventListener("change", () => this.range(slider, name, input));
      return input;
    };
    const log = make("input", { type: "checkbox", checked: slider.log });
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
      make("div", { className: "head" }, make("label", { htmlFor: id, textContent: key, title: description }), number, away),
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
    for (const [name, input] of Object.entries(ends)) input.value = slider[name];
    number.value = rounded(value);
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

/// Numbers that one wants to move first.
function first(all) {
  const wanted = ["load.g[2]", "load.gravity[2]", "load.tip_force[2]", "load.tip_force[0]", "rest.bend_2", "scale:rest.bend_2", "scale:rest.bend_3", "stiffness.torsion", "scale:stiffness.torsion", "stiffness.bending_2", "scale:stiffness.bending_2", "section.young", "blade.thickness", "blade.young", "tip.position[0]", "grip[1].move[1]", "coupling.z", "leaf.length", "blade.length"];
  const found = wanted.map((key) => all.find((one) => one.key === key)).filter((one) => one && Number.isFinite(one.value) && one.value !== 0);
  return (found.length ? found : all.filter(({ value }) => Number.isFinite(value))).slice(0, 4);
}
