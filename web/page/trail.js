// The trail: tip, energy or reaction against the number that was moved last, as it went; and the branch ahead.

const CHOICES = [
  ["tip z", "length", ({ tip }) => tip[2]],
  ["tip y", "length", ({ tip }) => tip[1]],
  ["tip x", "length", ({ tip }) => tip[0]],
  ["energy", "energy", ({ energy }) => energy],
  ["height of waves", "length", ({ waves }) => waves],
  ["reaction x", "force", ({ reaction }) => (reaction ? reaction[0] : null)],
  ["reaction z", "force", ({ reaction }) => (reaction ? reaction[2] : null)],
];
/// Points of a trail, and milliseconds between two drawings of it.
const MOST = 2000;
const PAUSE = 100;

class Trail {
  constructor() {
    this.choice = 0;
    find("choice").addEventListener("change", () => {
      this.choice = Number(find("choice").value);
      this.draw();
    });
    this.begin(null);
  }

  /// Waves are what one looks at where there are any.
  choose(known) {
    this.choice = known.waves > 0 ? CHOICES.findIndex(([name]) => name === "height of waves") : 0;
  }

  /// For another number, or another scenario.
  begin(key, log = false, units = [null, null]) {
    const [length, force] = units;
    const named = { length, force, energy: length && force ? `${force} ${length}` : null };
    Object.assign(this, { key, log, points: [], branch: null, dirty: true });
    const names = CHOICES.map(([name, unit]) => (named[unit] ? `${name} / ${named[unit]}` : name));
    this.names = names;
    find("choice").replaceChildren(...names.map((name, i) => new Option(name, i)));
    find("choice").value = this.choice;
    find("trail").hidden = !key;
  }

  add(value, known) {
    const [tip] = known.tips;
    const { energy, reaction, waves } = known;
    this.points.push({ value, tip, energy, reaction, waves, unstable: known.stable === false });
    if (this.points.length > MOST) this.points.shift();
    this.later();
  }

  /// Where it snapped, the trail is broken.
  gap(value) {
    this.points.push({ value, tip: [null, null, null], energy: null, reaction: null, waves: null, unstable: false });
  }

  foresee(branch) {
    this.branch = branch;
    this.later();
  }

  later() {
    if (this.timer) return;
    this.timer = setTimeout(() => {
      this.timer = null;
      this.draw();
    }, PAUSE);
  }

  draw() {
    if (!this.key || !stage || !this.points.length) return;
    const of = CHOICES[this.choice][2];
    const curves = [];
    const curve = (name, color, points) => ({ choice: 0, name, color, x: points.map(({ value }) => value), y: points.map(of), unstable: points.map(({ index, unstable }) => Boolean(index || unstable)), leaves: [] });
    if (this.branch) {
      const { points } = this.branch;
      const special = points.map(({ kind }, i) => [i, kind]).filter(([, kind]) => kind);
      curves.push({ ...curve("what comes", 7, points), special });
    }
    curves.push(curve("as it went", 0, this.points));
    const { words, unit } = sliders.shown.find(({ key }) => key === this.key) || { words: this.key };
    const chart = { across: withItsUnit(words, unit), log: this.log, choices: [this.names[this.choice]], curves };
    if (this.diagram && this.diagram.stage === stage) {
      this.diagram.chart = chart;
      this.diagram.draw(0);
    } else {
      this.diagram = new stage.Diagram(find("chart"), find("key"), chart, () => {});
      this.diagram.stage = stage;
    }
    const now = this.points.at(-1);
    const y = of(now);
    if (y === null) return;
    const [cx, cy] = this.diagram.place(now.value, y);
    this.diagram.mark.replaceChildren();
    this.diagram.add("circle", { cx, cy, r: 5, fill: "var(--accent)" }, undefined, this.diagram.mark);
  }
}
