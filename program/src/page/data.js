// The numbers along the veins that follow from the `view` of a page.
const find = (id) => document.getElementById(id);

function bytes(base64) {
  const text = atob(base64);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < out.length; i++) out[i] = text.charCodeAt(i);
  return out.buffer;
}

/// Every leaf as { label, nodes, stations, points, state }; numbers are decoded when they are first asked for.
const veins = view.drawn.length;
const decoded = new Map();

function leafAt(index) {
  if (!decoded.has(index)) decoded.set(index, decode(view.leaves[index]));
  return decoded.get(index);
}

const evenly = (nodes) => Array.from({ length: nodes }, (_, i) => i / Math.max(1, nodes - 1));

function decode(leaf) {
  const stations = leaf.stations || evenly(leaf.nodes);
  let points;
  if (leaf.points.f32 !== undefined) {
    points = new Float32Array(bytes(leaf.points.f32));
  } else {
    const steps = new Uint16Array(bytes(leaf.points.u16));
    const { low, size } = leaf.points;
    points = Float32Array.from(steps, (step, i) => low[i % 3] + (step / 65535) * size);
  }
  const [state, stress] = [leaf.state, leaf.stress].map((numbers) => (numbers ? new Float32Array(bytes(numbers)) : null));
  return { ...leaf, stations, points, state, stress };
}

/// The largest size of many numbers. (A function takes only so many arguments as its stack holds.)
function largestSize(numbers) {
  let largest = 0;
  for (const number of numbers) largest = Math.max(largest, Math.abs(number));
  return largest;
}

const [lengthUnit, forceUnit] = view.units;
const momentUnit = lengthUnit && forceUnit ? `${forceUnit} ${lengthUnit}` : null;
const withUnit = (name, unit) => (unit ? `${name} / ${unit}` : name);

/// Offsets in the state of a node.
const [Q, V, U, N, M] = [0, 4, 7, 10, 13];
const hypot = Math.hypot;

/// What veins can be coloured by. `of` has the state of a node from offset `s` on, and `along` the leaf; the three numbers of its `group`
/// are of one kind, and tell what is no more than rounding.
const QUANTITIES = [
  { name: "vein" },
  { name: "curvature", group: U, unit: lengthUnit && `(1/${lengthUnit})`, of: (x, s) => hypot(x[s + U + 1], x[s + U + 2]) },
  { name: "twist", group: U, unit: lengthUnit && `(1/${lengthUnit})`, of: (x, s) => x[s + U], signed: true },
  { name: "stretch − 1", group: V, of: (x, s) => x[s + V] - 1, signed: true },
  { name: "shear strain", group: V, of: (x, s) => hypot(x[s + V + 1], x[s + V + 2]) },
  { name: "tension", group: N, unit: forceUnit, of: (x, s) => x[s + N], signed: true },
  { name: "shear force", group: N, unit: forceUnit, of: (x, s) => hypot(x[s + N + 1], x[s + N + 2]) },
  { name: "bending moment", group: M, unit: momentUnit, of: (x, s) => hypot(x[s + M + 1], x[s + M + 2]) },
  { name: "twisting moment", group: M, unit: momentUnit, of: (x, s) => x[s + M], signed: true },
  { name: "equivalent stress", unit: momentUnit && `(${forceUnit}/${lengthUnit}²)`, along: (leaf) => leaf.stress },
];
const GEOMETRY = [
  { name: "vein" },
  { name: "curvature", unit: lengthUnit && `(1/${lengthUnit})`, along: curvature },
  { name: "height z", unit: lengthUnit, along: (leaf) => Float32Array.from({ length: leaf.points.length / 3 }, (_, i) => leaf.points[3 * i + 2]), signed: true },
];
const [first] = view.leaves;
const quantities = first && first.state ? QUANTITIES.filter(({ along }) => !along || along(first)) : GEOMETRY;

/// The values of a quantity at all nodes of a leaf.
function valuesOf(leaf, quantity) {
  if (quantity.along) return quantity.along(leaf);
  const count = leaf.points.length / 3;
  return Float32Array.from({ length: count }, (_, i) => quantity.of(leaf.state, 16 * i));
}

/// Of the circle through a node and its neighbours.
function curvature(leaf) {
  const { points, nodes } = leaf;
  const count = points.length / 3;
  const out = new Float32Array(count);
  for (let i = 0; i < count; i++) {
    const k = i % nodes;
    if (nodes < 3) continue;
    const mid = i - k + Math.min(Math.max(k, 1), nodes - 2);
    const [a, b, c] = [mid - 1, mid, mid + 1].map((j) => points.subarray(3 * j, 3 * j + 3));
    const ab = [0, 1, 2].map((j) => b[j] - a[j]);
    const bc = [0, 1, 2].map((j) => c[j] - b[j]);
    const cross = hypot(ab[1] * bc[2] - ab[2] * bc[1], ab[2] * bc[0] - ab[0] * bc[2], ab[0] * bc[1] - ab[1] * bc[0]);
    const product = hypot(...ab) * hypot(...bc) * hypot(...ab.map((x, j) => x + bc[j]));
    out[i] = product > 0 ? (2 * cross) / product : 0;
  }
  return out;
}

/// Colour maps: viridis without its brightest end, and blue over grey to vermilion.
const VIRIDIS = ["#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151", "#bddf26"];
const DIVERGING = ["#0b5fa5", "#4a90c8", "#9dbfd8", "#c9c9cb", "#e0ad8f", "#d8743f", "#b03a12"];
const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
const MAPS = { sequential: VIRIDIS.map(rgb), signed: DIVERGING.map(rgb) };

/// The least light, of 1, that a colour has on a dark page: darker ones are mixed with white until they have it.
const LEAST_LIGHT = 0.34;

/// A colour as the theme shows it: visible on its paper.
function visible(color) {
  if (document.documentElement.dataset.theme !== "dark") return color;
  const light = 0.3 * color[0] + 0.59 * color[1] + 0.11 * color[2];
  const part = Math.max(0, (LEAST_LIGHT - light) / (1 - light));
  return color.map((x) => x + part * (1 - x));
}

const colorOf = (map, t) => visible(between(map, t));

function between(map, t) {
  const place = Math.min(Math.max(t, 0), 1) * (map.length - 1);
  const left = Math.min(Math.floor(place), map.length - 2);
  const part = place - left;
  return [0, 1, 2].map((k) => map[left][k] + part * (map[left + 1][k] - map[left][k]));
}

/// Four digits at most.
function short(x) {
  if (x === null || !Number.isFinite(x)) return "∞";
  const size = Math.abs(x);
  if (size < 1e-300) return "0";
  const text = size >= 1e-3 && size < 1e5 ? String(Number(size.toPrecision(4))) : power(size);
  return (x < 0 ? "−" : "") + text;
}

function power(size) {
  const [digits, exponent] = size.toExponential(2).split("e");
  const raised = [...String(Number(exponent))].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] || "⁻").join("");
  return `${digits}×10${raised}`;
}

/// Round numbers between two others, about so many.
function ticks(low, high, about) {
  const rough = (high - low) / Math.max(1, about);
  if (!(rough > 0)) return { values: [low], decimals: 2 };
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * decade).find((s) => s >= rough * 0.999);
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) values.push(k * step);
  return { values, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), step };
}

function tickText(value, decimals, step) {
  const size = Math.abs(value);
  if (size < 1e-9 * step) return "0";
  if (decimals > 4 || size >= 1e6) return short(value);
  return (value < 0 ? "−" : "") + size.toFixed(decimals);
}
