// Sliders for numbers of the scenario: linear or logarithmic, with a range that can be changed.

/// The place of a value on its way, from 0 to 1, and back.
const partOf = ({ low, high, log }, value) => (log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
const valueOf = ({ low, high, log, whole }, part) => {
  const value = log ? low * (high / low) ** part : low + part * (high - low);
  return whole ? Math.round(value) : Number(value.toPrecision(6));
};

const STEPS = 1000;

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
    this.shown = asked.length ? asked : first(all).map((one) => ({ ...one }));
    find("keys").replaceChildren(...all.map(({ key, description }) => new Option(description, key)));
    this.fill();
  }

  value(key) {
    if (this.values.has(key)) return this.values.get(key);
    const given = this.all.find((one) => one.key === key);
    return given ? given.value : NaN;
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
    if (!this.shown.some(({ key }) => key === found.key)) this.shown.unshift({ ...found });
    this.fill();
    return true;
  }

  remove(key) {
    this.shown = this.shown.filter((one) => one.key !== key);
    this.fill();
  }

  fill() {
    this.rows.replaceChildren(...this.shown.map((slider) => this.row(slider)));
    this.shown.forEach(({ key }) => this.place(key));
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
    number.addEventListener("change", () => Number.isFinite(number.valueAsNumber) && this.set(key, number.valueAsNumber, true));
    const range = make("input", { type: "range", min: 0, max: STEPS, step: slider.whole ? "any" : 1, id, title: description });
    range.addEventListener("input", () => this.set(key, valueOf(slider, range.value / STEPS), false));
    range.addEventListener("change", () => this.change(true));
    const away = make("button", { type: "button", textContent: "×", title: `without ${key}` });
    away.addEventListener("click", () => this.remove(key));
    const end = (name) => {
      const input = make("input", { type: "number", step: "any", value: slider[name] });
      input.setAttribute("aria-label", `${name === "low" ? "lowest" : "highest"} ${key}`);
      input.addEventListener("change", () => this.range(slider, name, input));
      return input;
    };
    const log = make("input", { type: "checkbox", checked: slider.log });
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
    slider.parts = { number, range, marks };
    const row = make(
      "div",
      { className: "slider" },
      make("div", { className: "head" }, make("label", { htmlFor: id, textContent: key, title: description }), number, away),
      make("div", { className: "way" }, range, marks),
      make("div", { className: "ends" }, end("low"), make("label", {}, log, " log"), end("high")),
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
    const { number, range } = slider.parts;
    const value = this.value(key);
    number.value = Number(value.toPrecision(6));
    range.value = STEPS * partOf(slider, value);
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
      if (next) add("path", { d: `M${at(point.value)} 2H${at(next.value)}`, stroke: point.index || next.index ? "var(--bad)" : "var(--good)", "stroke-width": 3 });
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
  const wanted = ["load.g[2]", "load.gravity[2]", "load.tip_force[2]", "load.tip_force[0]", "rest.bend_2", "scale:rest.bend_2", "scale:rest.bend_3", "stiffness.torsion", "scale:stiffness.torsion", "stiffness.bending_2", "section.young", "blade.thickness", "blade.young", "tip.position[0]", "grip[1].move[1]", "coupling.z", "leaf.length", "blade.length"];
  const found = wanted.map((key) => all.find((one) => one.key === key)).filter((one) => one && Number.isFinite(one.value) && one.value !== 0);
  return (found.length ? found : all.filter(({ value }) => Number.isFinite(value))).slice(0, 4);
}
