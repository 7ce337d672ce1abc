// The leaf of the live page, within the scripts of the stage: it is one, and it moves.
let current = null;
/// Leaves beside it, as lines, by name.
const ghosts = new Map();

const sampled = () => [current, ...[...ghosts.values()].map((ghost) => ghost.leaf)].filter(Boolean);
const limiting = () => [current];

/// Centrelines of a leaf with any number of veins.
class Ghost {
  constructor(leaf, color) {
    this.leaf = leaf;
    const sub = piecesOf(leaf.nodes);
    const fine = Math.max(1, (leaf.nodes - 1) * sub + 1);
    const points = new Float32Array((leaf.points.length / leaf.nodes) * fine);
    smooth(leaf, sub, points);
    const pieces = points.length / 3 - points.length / 3 / fine;
    const ends = new Float32Array(6 * pieces);
    let to = 0;
    for (let i = 0; i + 1 < points.length / 3; i++) {
      if ((i + 1) % fine === 0) continue;
      ends.set(points.subarray(3 * i, 3 * i + 6), to);
      to += 6;
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(ends, 3));
    this.color = color;
    this.lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: css(color) }));
    this.lines.visible = false;
    this.lines.frustumCulled = false;
  }

  remove() {
    space.scene.remove(this.lines);
    this.lines.geometry.dispose();
  }
}

/// Puts a leaf beside, or takes it away.
function beside(name, given, color) {
  if (ghosts.has(name)) ghosts.get(name).remove();
  ghosts.delete(name);
  if (given && space) {
    const ghost = new Ghost(decode(given), color);
    space.scene.add(ghost.lines);
    ghosts.set(name, ghost);
    grow();
  }
  if (current) draw(false);
}

/// A leaf may leave the box by this part of it: smaller steps of the view are no help to anyone.
const BEYOND = 2e-3;

/// The box around all that was shown; seen from where it was before, as far aside of its middle.
function grow() {
  const now = boxOf(sampled());
  const { box } = space;
  const out = [0, 1, 2].some((k) => Math.max(box.low[k] - now.low[k], now.high[k] - box.high[k]) > BEYOND * box.extent);
  if (!out) return;
  const before = [...box.middle];
  for (let k = 0; k < 3; k++) {
    box.low[k] = Math.min(box.low[k], now.low[k]);
    box.high[k] = Math.max(box.high[k], now.high[k]);
    box.middle[k] = 0.5 * (box.low[k] + box.high[k]);
  }
  box.extent = Math.max(...[0, 1, 2].map((k) => box.high[k] - box.low[k]));
  const { camera, controls } = space;
  const away = camera.position.clone().sub(controls.target);
  controls.target.add(new THREE.Vector3(...box.middle.map((x, k) => x - before[k])));
  camera.position.copy(controls.target).add(away.setLength(10 * box.extent));
  camera.far = 30 * box.extent;
  controls.update();
  camera.updateMatrixWorld();
  fitBox();
  redraw();
}

/// The limits of the colours hold all that was shown.
function widen() {
  const colors = quantity();
  if (colors.name === "vein") return;
  const key = `${colors.name} ${shown.mode}`;
  const before = limitsKnown.get(key);
  limitsKnown.delete(key);
  const now = limitsOf(colors);
  if (!before) return;
  const both = [Math.min(before[0], now[0]), Math.max(before[1], now[1])];
  limitsKnown.set(key, both);
  if (both.some((limit, k) => limit !== before[k])) shown.stale = true;
}

function draw(again) {
  const leaf = shown.mode >= 0 && view.modes.length ? inMode(view.modes[shown.mode], shown.phase, shown.swing) : current;
  leaves = [leaf];
  if (!space) return;
  if (!shown.plain) widen();
  const mesh = put(0, leaf, again);
  // Asked for before it is drawn, it lies where it lay before.
  const rect = space.panels.length ? space.panels[0].rect : [0, 0, ...stageSize()];
  space.panels = [{ leaf, mesh, rect, label: "", beside: [...ghosts.values()].map((ghost) => ghost.lines) }];
  shown.dirty = true;
  if (again) shown.stale = true;
  if (find("probe").open) fillProbe();
}

/// Colours that a shape without strains has, too, or those of the veins.
function plainly(plain) {
  if (shown.plain === plain) return;
  const { name } = quantity();
  shown.plain = plain;
  if (plain) [shown.chosen, shown.quantity] = [shown.quantity, Math.max(0, GEOMETRY.findIndex((one) => one.name === name))];
  else shown.quantity = shown.chosen;
  shown.stale = true;
}

/// Shows a leaf at rest.
function show(known) {
  const turned = JSON.stringify(view.directions) !== JSON.stringify(known.view.directions);
  Object.assign(view, known.view);
  decoded.clear();
  view.modes.forEach((mode) => (mode.decoded = undefined));
  current = leafAt(0);
  showDirections(current);
  if (shown.mode < 0) plainly(false);
  if (space) grow();
  draw(turned);
}

/// Shows it at an instant of a motion.
function moving(given) {
  shown.mode = -1;
  plainly(true);
  current = decode(given);
  showDirections(current);
  if (space) grow();
  draw(false);
}

/// Lets it vibrate in its first mode by so much of the usual displacement, or not.
function vibrate(on, swing) {
  shown.swing = swing;
  shown.mode = on && view.modes.length ? 0 : -1;
  plainly(shown.mode >= 0);
  shown.phase = Math.PI / 2;
  draw(false);
}

/// A frame of the screen.
function frame(seconds) {
  if (shown.mode >= 0) {
    shown.phase += (2 * Math.PI * seconds) / 1.6;
    draw(false);
  }
  if (!shown.dirty || !space) return;
  shown.dirty = false;
  render();
  shown.drawn = (shown.drawn || 0) + 1;
}

/// By how much, in space, the pointer was moved in the plane of the screen.
function across(dx, dy) {
  const { scale } = placeIn(space.panels[0]);
  const way = [0, 1].map((k) => new THREE.Vector3().setFromMatrixColumn(space.camera.matrixWorld, k));
  return way[0].multiplyScalar(dx / scale).add(way[1].multiplyScalar(-dy / scale)).toArray();
}

/// The direction in space that points down on the screen.
const downward = () => new THREE.Vector3().setFromMatrixColumn(space.camera.matrixWorld, 1).negate().toArray();

/// Looks as a camera did: from its direction and its zoom and, where these are known, at its target and with its box.
function see([x, y, z, zoom, ...others]) {
  const { camera, controls, box } = space;
  if (others.length === 9) {
    Object.assign(box, { low: others.slice(3, 6), high: others.slice(6) });
    box.middle = box.low.map((low, k) => 0.5 * (low + box.high[k]));
    box.extent = Math.max(...box.low.map((low, k) => box.high[k] - low));
    controls.target.fromArray(others.slice(0, 3));
  }
  camera.position.copy(controls.target).add(new THREE.Vector3(x, y, z).multiplyScalar(10 * box.extent));
  camera.far = 30 * box.extent;
  camera.zoom = zoom;
  controls.update();
  camera.updateMatrixWorld();
  fitBox();
  redraw();
}

/// How far two leaves are apart, at the nodes that both have; infinitely where they have none.
function apart(one, other) {
  const [a, b] = [decode(one), decode(other)].sort((a, b) => a.nodes - b.nodes);
  const stride = (b.nodes - 1) / (a.nodes - 1);
  if (!Number.isInteger(stride) || a.points.length / a.nodes !== b.points.length / b.nodes) return Infinity;
  let far = 0;
  for (let p = 0; 3 * p < a.points.length; p++) {
    const q = Math.floor(p / a.nodes) * b.nodes + stride * (p % a.nodes);
    far = Math.max(far, Math.hypot(...[0, 1, 2].map((k) => a.points[3 * p + k] - b.points[3 * q + k])));
  }
  return far;
}

/// Colours the veins by the quantity of this name, if there is one.
function colourBy(name) {
  const which = quantities.findIndex((one) => one.name === name);
  if (which < 0) return;
  shown.quantity = which;
  fillQuantities();
  draw(true);
}

function leave() {
  if (!space) return;
  space.controls.dispose();
  space.renderer.dispose();
  space.renderer.forceContextLoss();
}

current = leafAt(0);
try {
  space = openSpace();
} catch (reason) {
  find("why").textContent = `Nothing can be drawn in space here (${reason.message}): the figure stands in its place.`;
}
find("vein").max = view.rods;
find("vein").value = Math.min(view.rods, Number(find("vein").value));
fillQuantities();
if (space) {
  look("free");
  canvas.addEventListener("pointermove", hover);
  canvas.addEventListener("pointerleave", hover);
}
draw(true);
return {
  view, shown, show, moving, vibrate, beside, frame, across, downward, leave, look, picture, savePicture, setTheme, redraw, nearest, Diagram, short, fillProbe, row,
  inSpace: () => space !== null,
  controls: () => space && space.controls,
  camera: () => space && [...space.camera.position.clone().sub(space.controls.target).normalize().toArray(), space.camera.zoom, ...space.controls.target.toArray(), ...space.box.low, ...space.box.high],
  see, apart, colourBy,
  colour: () => (shown.plain ? quantities[shown.chosen] : quantity()).name,
  key: keyInSpace,
  resize: () => {
    if (space) space.stage = null;
    redraw();
  },
  again: () => draw(true),
  place: (point) => placeIn(space.panels[0])(point),
  nodes: () => Array.from({ length: current.points.length / 3 }, (_, i) => [...current.points.subarray(3 * i, 3 * i + 3)]),
};
