// The box around the leaf: axes with ticks, gravity and wind, captions and the colour scale, on the canvas below the leaf.
const AXIS_NAMES = ["x", "y", "z"];
/// On a projector everything is read from far away.
const projected = matchMedia("(min-width: 1600px)");
const enlarged = (px) => (projected.matches ? 1.3 * px : px);
const font = (px) => `${enlarged(px)}px system-ui, "DejaVu Sans", sans-serif`;

/// The box that holds all leaves, the base among them.
function boxOf(leaves) {
  const box = { low: [0, 0, 0], high: [0, 0, 0] };
  for (const { points } of leaves)
    for (let i = 0; i < points.length; i++) {
      const k = i % 3;
      if (points[i] < box.low[k]) box.low[k] = points[i];
      if (points[i] > box.high[k]) box.high[k] = points[i];
    }
  // Room around, and no side without any width.
  const extent = Math.max(...[0, 1, 2].map((k) => box.high[k] - box.low[k]), 1e-9 * view.longest) || 1;
  for (let k = 0; k < 3; k++) {
    const room = Math.max(0.04 * extent, 0.5 * (0.12 * extent - (box.high[k] - box.low[k])));
    box.low[k] -= room;
    box.high[k] += room;
  }
  box.middle = [0, 1, 2].map((k) => 0.5 * (box.low[k] + box.high[k]));
  box.extent = extent;
  return box;
}

const corner = (box, bits) => [0, 1, 2].map((k) => (bits[k] ? box.high[k] : box.low[k]));

/// For each axis the edge of the box that is drawn: x and y low, z left on the page.
function edges(box, place) {
  const centre = place(box.middle);
  return [0, 1, 2].map((axis) => {
    const others = [0, 1, 2].filter((k) => k !== axis);
    let best = null;
    for (const a of [0, 1])
      for (const b of [0, 1]) {
        const bits = [0, 0, 0];
        bits[others[0]] = a;
        bits[others[1]] = b;
        const [from, to] = [corner(box, bits), corner(box, bits.map((bit, k) => (k === axis ? 1 : bit)))];
        const [p, q] = [place(from), place(to)];
        const mid = [(p[0] + q[0]) / 2 - centre[0], (p[1] + q[1]) / 2 - centre[1]];
        // An edge that rises on the page belongs to the left, one that lies below.
        const upright = Math.abs(q[1] - p[1]) > Math.abs(q[0] - p[0]);
        const rank = upright ? -mid[0] + 0.01 * mid[1] : mid[1] - 0.01 * mid[0];
        // Those farther away lose, where several fall together.
        if (!best || rank > best.rank + 0.5) best = { axis, rank, from, to, p, q, mid };
      }
    return best;
  });
}

/// Axes with ticks; in a small panel with names if it is the first: those of the others are the same.
function drawAxes(pen, box, place, small, named) {
  const size = small ? 10 : 12;
  pen.lineWidth = 1;
  floor(pen, box, place);
  // Numbers of two axes that meet in a corner of the box are not written over one another.
  const [taken, names] = [[], []];
  const isFree = (x, y, wide) => {
    const mine = [x - wide / 2 - 2, y - enlarged(size) / 2, x + wide / 2 + 2, y + enlarged(size) / 2];
    const free = taken.every((other) => mine[0] > other[2] || mine[2] < other[0] || mine[1] > other[3] || mine[3] < other[1]);
    if (free) taken.push(mine);
    return free;
  };
  for (const edge of edges(box, place)) {
    const { axis, from, p, q, mid } = edge;
    const way = [q[0] - p[0], q[1] - p[1]];
    const length = Math.hypot(...way);
    if (length < 30) continue;
    pen.strokeStyle = css("--note");
    line(pen, p, q);
    // Ticks point away from the box.
    let out = [-way[1] / length, way[0] / length];
    if (out[0] * mid[0] + out[1] * mid[1] < 0) out = [-out[0], -out[1]];
    const { values, decimals, step } = ticks(box.low[axis], box.high[axis], Math.min(8, Math.max(3, length / (small ? 55 : 70))));
    pen.fillStyle = css("--note");
    pen.font = font(size - 1);
    pen.textBaseline = "middle";
    pen.textAlign = out[0] < -0.5 ? "right" : out[0] > 0.5 ? "left" : "center";
    let widest = 0;
    for (const value of values) {
      const at = place(from.map((x, k) => (k === axis ? value : x)));
      line(pen, at, [at[0] + 5 * out[0], at[1] + 5 * out[1]]);
      const text = tickText(value, decimals, step);
      const breadth = pen.measureText(text).width;
      const [x, y] = [at[0] + 9 * out[0], at[1] + (out[1] > 0.5 ? 13 : out[1] < -0.5 ? -13 : 9 * out[1])];
      const middle = x + ({ left: 0.5, right: -0.5 }[pen.textAlign] || 0) * breadth;
      if (!isFree(middle, y, breadth)) continue;
      widest = Math.max(widest, breadth);
      pen.fillText(text, x, y);
    }
    const away = Math.abs(out[0]) > 0.5 ? 20 + widest : small ? 27 : 32;
    names.push({ name: withUnit(AXIS_NAMES[axis], lengthUnit), align: pen.textAlign, at: [(p[0] + q[0]) / 2 + away * out[0], (p[1] + q[1]) / 2 + away * out[1]], out });
  }
  pen.fillStyle = css("--ink");
  pen.font = font(size + 1);
  for (const { name, align, at, out } of named ? names : []) {
    pen.textAlign = align;
    const breadth = pen.measureText(name).width;
    const middle = ({ left: 0.5, right: -0.5 }[align] || 0) * breadth;
    // Farther out, where numbers stand in its place.
    const [x, y] = [0, 8, 16, 24].map((k) => [at[0] + k * out[0], at[1] + k * out[1]]).find(([x, y]) => isFree(x + middle, y, breadth)) || at;
    pen.fillText(name, x, y);
  }
}

/// Fine lines on the lower side of the box.
function floor(pen, box, place) {
  pen.strokeStyle = css("--grid");
  for (const axis of [0, 1]) {
    const other = 1 - axis;
    const { values } = ticks(box.low[axis], box.high[axis], 6);
    for (const value of [box.low[axis], ...values, box.high[axis]]) {
      const end = (side) => {
        const at = [0, 0, box.low[2]];
        at[axis] = value;
        at[other] = side[other];
        return place(at);
      };
      line(pen, end(box.low), end(box.high));
    }
  }
}

function line(pen, p, q) {
  pen.beginPath();
  pen.moveTo(p[0], p[1]);
  pen.lineTo(q[0], q[1]);
  pen.stroke();
}

/// What they are for a leaf: of an instant of a motion the wind may be another.
const directionsOf = (leaf) => leaf.directions || view.directions;

/// The directions of gravity and wind as arrows of fixed size beside each other, from a corner of the panel on.
function drawDirections(pen, box, place, [x, y], step, leaf) {
  directionsOf(leaf).forEach((it, k) => drawDirection(pen, box, place, [x + k * step, y], it));
}

function drawDirection(pen, box, place, at, { name, direction }) {
  const [a, b] = [place(box.middle), place(box.middle.map((x, k) => x + 0.25 * box.extent * direction[k]))];
  const way = [b[0] - a[0], b[1] - a[1]];
  // Compared with a direction across the line of sight.
  const whole = place.scale * 0.25 * box.extent;
  const part = Math.min(1, Math.hypot(...way) / whole);
  pen.strokeStyle = pen.fillStyle = css("--bad");
  pen.lineWidth = 2;
  const unit = part > 0.05 ? way.map((x) => x / Math.hypot(...way)) : [0, 0];
  const reach = 38 * part;
  const from = [at[0] - 0.5 * reach * unit[0], at[1] - 0.5 * reach * unit[1]];
  const to = [at[0] + 0.5 * reach * unit[0], at[1] + 0.5 * reach * unit[1]];
  if (part > 0.05) {
    line(pen, from, [to[0] - 6 * unit[0], to[1] - 6 * unit[1]]);
    pen.beginPath();
    pen.moveTo(to[0], to[1]);
    pen.lineTo(to[0] - 9 * unit[0] + 4.5 * unit[1], to[1] - 9 * unit[1] - 4.5 * unit[0]);
    pen.lineTo(to[0] - 9 * unit[0] - 4.5 * unit[1], to[1] - 9 * unit[1] + 4.5 * unit[0]);
    pen.fill();
  } else {
    // Along the line of sight: away from the reader.
    pen.beginPath();
    pen.arc(at[0], at[1], 7, 0, 7);
    pen.stroke();
    line(pen, [at[0] - 5, at[1] - 5], [at[0] + 5, at[1] + 5]);
    line(pen, [at[0] - 5, at[1] + 5], [at[0] + 5, at[1] - 5]);
  }
  pen.font = font(12);
  pen.textAlign = "center";
  pen.textBaseline = "alphabetic";
  pen.fillText(name, at[0], at[1] + 36);
}

/// The colour scale, or which vein has which colour.
function drawScale(pen, quantity, limits, map, width, height) {
  const [wide, high] = [Math.min(260, width - 40), 10];
  const [left, top] = [width - wide - 24, height - 46];
  const byVein = quantity.name === "vein";
  if (byVein && veins < 2) return;
  for (let i = 0; i < wide; i++) {
    const t = i / (wide - 1);
    const color = byVein ? visible(rgb(view.colors[Math.min(veins - 1, Math.floor(t * veins))])) : colorOf(map, t);
    pen.fillStyle = `rgb(${color.map((x) => Math.round(255 * x)).join(",")})`;
    pen.fillRect(left + i, top, 1.5, high);
  }
  pen.fillStyle = css("--ink");
  pen.font = font(12);
  pen.textAlign = "left";
  pen.textBaseline = "alphabetic";
  pen.fillText(byVein ? "vein" : withUnit(quantity.name, quantity.unit), left, top - 6);
  pen.fillStyle = css("--note");
  const [low, high2] = byVein ? [1, view.rods] : limits;
  const { values, decimals, step } = byVein
    ? { values: veinTicks(), decimals: 0, step: 1 }
    : ticks(low, high2, 5);
  pen.textAlign = "center";
  for (const value of values) {
    const t = byVein ? (value - 0.5) / view.rods : (value - low) / (high2 - low);
    pen.fillText(tickText(value, decimals, step), left + t * wide, top + high + 14);
  }
}

function veinTicks() {
  const count = view.rods;
  const step = Math.max(1, ticks(0, count, 6).step);
  const values = new Set([1]);
  for (let k = step; k <= count; k += step) values.add(k);
  return [...values];
}
