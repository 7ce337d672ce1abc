// The diagram beside a motion or a trace: curves, a mark where the leaf is, and a click that goes there.
const CURVE_COLORS = ["#0072b2", "#009e73", "#d55e00", "#aa5a96", "#e69f00", "#56aae1", "#8a5a33", "#7a7a84"];
const SVG = "http://www.w3.org/2000/svg";

class Diagram {
  constructor(svg, key, chart, go) {
    Object.assign(this, { svg, key, chart, go });
    svg.addEventListener("click", (event) => this.click(event));
    this.draw(0);
  }

  /// Draws one of the choices.
  draw(choice) {
    this.choice = choice;
    const { svg, chart } = this;
    this.curves = chart.curves.filter((curve) => curve.choice === choice);
    const box = svg.getBoundingClientRect();
    const [width, height] = [box.width || 340, box.height || 220];
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("aria-label", `${chart.choices[choice]} against ${chart.across}`);
    svg.replaceChildren();
    const cell = (this.cell = { left: 52, right: width - 24, top: 8, bottom: height - 34 });
    const xs = this.curves.flatMap((curve) => curve.x).map((x) => this.across(x)).filter(Number.isFinite);
    const ys = this.curves.flatMap((curve) => curve.y).filter((y) => y !== null && Math.abs(y) < 1e200);
    this.x = widened(range(xs), chart.log ? 0 : 0.02);
    this.y = widened(range(ys), 0.06);
    this.frame(cell);
    for (const curve of this.curves) this.curve(curve);
    // On a layer of its own: what moves does not draw the curves anew.
    this.mark = find("mark");
    this.mark.setAttribute("viewBox", svg.getAttribute("viewBox"));
    this.drawKey();
  }

  /// Logarithms keep the sign of what varies.
  across(x) {
    return this.chart.log ? Math.log10(Math.abs(x)) : x;
  }

  place(x, y) {
    const { left, right, top, bottom } = this.cell;
    return [left + ((this.across(x) - this.x[0]) / (this.x[1] - this.x[0])) * (right - left), bottom - ((y - this.y[0]) / (this.y[1] - this.y[0])) * (bottom - top)];
  }

  add(tag, attributes, text, to = this.svg) {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    if (text !== undefined) element.textContent = text;
    to.append(element);
    return element;
  }

  frame({ left, right, top, bottom }) {
    const { chart } = this;
    const frame = { fill: "none", stroke: "var(--frame)" };
    const rising = ticks(this.y[0], this.y[1], 5);
    for (const value of rising.values) {
      const y = bottom - ((value - this.y[0]) / (this.y[1] - this.y[0])) * (bottom - top);
      this.add("path", { d: `M${left} ${y}H${right}`, stroke: "var(--grid)" });
      this.add("text", { x: left - 6, y: y + 4, "text-anchor": "end" }, tickText(value, rising.decimals, rising.step));
    }
    const across = chart.log ? logTicks(this.x) : ticks(this.x[0], this.x[1], 5);
    const sign = this.curves.some((curve) => curve.x.some((x) => x < 0)) ? -1 : 1;
    for (const value of across.values) {
      const x = left + ((value - this.x[0]) / (this.x[1] - this.x[0])) * (right - left);
      this.add("path", { d: `M${x} ${top}V${bottom}`, stroke: "var(--grid)" });
      const text = chart.log ? short(sign * 10 ** value) : tickText(value, across.decimals, across.step);
      this.add("text", { x, y: bottom + 14, "text-anchor": "middle" }, text);
    }
    this.add("rect", { x: left, y: top, width: right - left, height: bottom - top, ...frame });
    this.add("text", { x: (left + right) / 2, y: bottom + 30, "text-anchor": "middle" }, chart.across);
  }

  curve(curve) {
    const color = CURVE_COLORS[curve.color % CURVE_COLORS.length];
    const points = curve.x.map((x, i) => (curve.y[i] === null ? null : this.place(x, curve.y[i])));
    // Stable pieces are full, unstable ones dashed.
    for (const unstable of curve.unstable ? [false, true] : [null]) {
      let path = "";
      for (let i = 0; i + 1 < points.length; i++) {
        if (!points[i] || !points[i + 1]) continue;
        if (unstable !== null && (curve.unstable[i] && curve.unstable[i + 1]) !== unstable) continue;
        const [a, b] = [points[i], points[i + 1]];
        path += `${path.endsWith(` ${a[0].toFixed(1)},${a[1].toFixed(1)}`) ? "" : `M ${a[0].toFixed(1)},${a[1].toFixed(1)}`} L ${b[0].toFixed(1)},${b[1].toFixed(1)}`;
      }
      const dash = unstable ? { "stroke-dasharray": "4 3" } : {};
      this.add("path", { d: path, fill: "none", stroke: color, "stroke-width": 1.6, "stroke-linejoin": "round", ...dash });
    }
    for (const [i, word] of curve.special || []) {
      if (!points[i]) continue;
      const dot = this.add("circle", { cx: points[i][0], cy: points[i][1], r: 3.5, fill: "var(--paper)", stroke: "var(--bad)", "stroke-width": 1.5 });
      this.add("title", {}, word, dot);
    }
  }

  drawKey() {
    const named = this.curves.length > 1 ? this.curves : [];
    const line = (color, name) => {
      const row = document.createElement("span");
      const dash = document.createElement("i");
      dash.style.background = color;
      row.append(dash, name);
      return row;
    };
    const note = (text) => Object.assign(document.createElement("span"), { textContent: text });
    const rows = named.map((curve) => line(CURVE_COLORS[curve.color % CURVE_COLORS.length], curve.name));
    if (this.curves.some((curve) => curve.unstable && curve.unstable.includes(true))) rows.push(note("dashed: unstable"));
    if (this.curves.some((curve) => (curve.special || []).length)) rows.push(note("○ fold or branch point"));
    this.key.replaceChildren(...rows);
  }

  /// Marks where the leaf is: its time, or its point.
  show(index, time) {
    const { top, bottom } = this.cell;
    this.mark.replaceChildren();
    if (time !== undefined) {
      const [x] = this.place(time, 0);
      this.add("path", { d: `M${x} ${top}V${bottom}`, stroke: "var(--accent)", "stroke-width": 1.5 }, undefined, this.mark);
      return;
    }
    for (const curve of this.curves) {
      const at = curve.leaves.indexOf(index);
      if (at < 0 || curve.y[at] === null) continue;
      const [cx, cy] = this.place(curve.x[at], curve.y[at]);
      this.add("circle", { cx, cy, r: 5.5, fill: "var(--accent)", stroke: "var(--paper)", "stroke-width": 1.5 }, undefined, this.mark);
    }
  }

  /// Goes to the nearest point of a curve, or to the time.
  click(event) {
    const box = this.svg.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    let best = { far: Infinity };
    for (const curve of this.curves)
      curve.x.forEach((value, i) => {
        const at = this.place(value, curve.y[i] ?? NaN);
        const far = curve.leaves ? Math.hypot(at[0] - x, at[1] - y) : Math.abs(at[0] - x);
        if (far < best.far) best = { far, leaf: curve.leaves && curve.leaves[i], time: curve.leaves ? undefined : value };
      });
    if (best.far < Infinity) this.go(best);
  }
}

/// Powers of ten between two logarithms or, where these are few, rounder and rounder numbers between them.
function logTicks([low, high]) {
  if (high - low > 2) return ticks(low, high, Math.min(5, high - low));
  const decades = Array.from({ length: Math.floor(high) - Math.floor(low) + 1 }, (_, k) => Math.floor(low) + k);
  const within = (digits) => decades.flatMap((k) => digits.map((digit) => k + Math.log10(digit))).filter((x) => x >= low - 1e-9 && x <= high + 1e-9);
  const values = [[1], [1, 3], [1, 2, 5], [1, 1.5, 2, 3, 4, 5, 7]].map(within).find((some) => some.length > 2);
  return { values: values || ticks(10 ** low, 10 ** high, 4).values.map(Math.log10) };
}

function range(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return low <= high ? [low, high] : [0, 1];
}

function widened([low, high], part) {
  const size = high - low > 1e-12 * Math.max(Math.abs(low), Math.abs(high)) ? high - low : Math.abs(low) || 1;
  return [low - part * size, high + part * size].map((x, k) => (high === low ? low + (k - 0.5) * size : x));
}
