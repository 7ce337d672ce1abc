// The leaf in space as it stands on a page: where it is drawn, from where it is seen, what it is asked. Whoever uses it says
// which leaves there are: `sampled`, so many of them, and `limiting`, those that set the limits of the colours.
const root = document.documentElement;
/// Colours of the theme, which are asked for in every picture.
const themed = new Map();
const css = (name) => {
  if (!themed.has(name)) themed.set(name, getComputedStyle(root).getPropertyValue(name).trim());
  return themed.get(name);
};
const [under, canvas, over] = ["under", "space", "over"].map(find);
// Drawn once in a while, and put under the leaf by the browser in every picture.
under.getContext("2d", { willReadFrequently: true });

/// What is shown: the quantity that colours it, one of the shape alone if it is `plain`, a mode if it is one, and what is
/// to be drawn anew.
const shown = { mode: -1, plain: false, quantity: 0, dirty: true, stale: true };
let space = null;
let leaves = [];

function row(name, ...cells) {
  const tr = document.createElement("tr");
  const th = document.createElement("th");
  th.scope = "row";
  th.textContent = name;
  tr.append(th);
  for (const cell of cells) tr.append(Object.assign(document.createElement("td"), { textContent: cell }));
  return tr;
}

/// Everything that is drawn in space; throws where that cannot be.
function openSpace() {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: !SOFTWARE, alpha: true });
  const scene = new THREE.Scene();
  const sun = new THREE.DirectionalLight(0xffffff, 2.2);
  scene.add(new THREE.AmbientLight(0xffffff, 1.5), sun);
  const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -1e4, 1e4);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.minZoom = 0.2;
  controls.maxZoom = 200;
  controls.addEventListener("change", redraw);
  return { renderer, scene, sun, camera, controls, meshes: [], box: boxOf(sampled(60)), fit: [1, 1], panels: [] };
}

/// A mesh for a leaf in a panel, of which there is one for each number of nodes.
function meshFor(panel, shape) {
  let mesh = space.meshes.find((mesh) => mesh.panel === panel && mesh.nodes === shape.nodes);
  if (!mesh) {
    mesh = new LeafMesh(shape);
    mesh.panel = panel;
    mesh.theme();
    space.scene.add(mesh.group);
    space.meshes.push(mesh);
  }
  return mesh;
}

const activeQuantities = () => (shown.plain ? GEOMETRY : quantities);
const quantity = () => activeQuantities()[shown.quantity] || activeQuantities()[0];

/// Limits of the colours: over all that is shown side by side or one after the other.
const limitsKnown = new Map();

function limitsOf(quantity) {
  const key = `${quantity.name} ${shown.mode}`;
  if (!limitsKnown.has(key)) {
    const leaves = limiting();
    let [low, high] = range(leaves.flatMap((leaf) => [...range(valuesOf(leaf, quantity).filter(Number.isFinite))]));
    // A signed quantity has its zero in the middle; one that does not vary has some width.
    if (quantity.signed) [low, high] = [-Math.max(Math.abs(low), Math.abs(high)), Math.max(Math.abs(low), Math.abs(high))];
    else low = Math.min(0, low);
    // What is rounding beside its like is shown as nothing.
    const like = quantity.group === undefined ? 0 : largestOf(leaves, quantity.group);
    if (high - low < 1e-6 * like) [low, high] = quantity.signed ? [-1e-3 * like, 1e-3 * like] : [0, 1e-3 * like];
    if (!(high - low > 1e-7 * Math.abs(high))) [low, high] = quantity.signed ? [-1, 1] : [low, low + (Math.abs(low) || 1)];
    limitsKnown.set(key, [low, high]);
  }
  return limitsKnown.get(key);
}

/// The largest of three numbers of every node.
function largestOf(leaves, group) {
  let largest = 0;
  for (const { state } of leaves)
    for (let s = group; s < state.length; s += 16) for (let k = 0; k < 3; k++) largest = Math.max(largest, Math.abs(state[s + k]) || 0);
  return Number.isFinite(largest) ? largest : 0;
}

const mapOf = (quantity) => (quantity.signed ? MAPS.signed : MAPS.sequential);

/// Brings the mesh of a panel to a leaf.
function put(panel, shape, again) {
  const mesh = meshFor(panel, shape);
  mesh.surface.visible = find("surface").checked && veins > 1;
  mesh.shape(shape);
  const colors = quantity();
  if (colors.name === "vein") {
    if (again || mesh.painted !== "vein") mesh.paint(null);
  } else mesh.paint(valuesOf(shape, colors), limitsOf(colors), mapOf(colors));
  mesh.painted = colors.name;
  return mesh;
}

/// Asks for a new picture, with all that lies below the leaf.
function redraw() {
  shown.dirty = shown.stale = true;
}

/// Draws the directions anew where those of a leaf are others than those that are drawn.
function showDirections(leaf) {
  const now = JSON.stringify(directionsOf(leaf));
  if (now !== shown.directions) shown.stale = true;
  shown.directions = now;
}

/// Looks from a direction, at all of the box.
function look(name) {
  const from = { free: view.toward, above: [0, -1e-4, 1], side: [0, -1, 0], front: [1, 0, 0] }[name];
  const { camera, controls, box } = space;
  controls.target.fromArray(box.middle);
  const away = new THREE.Vector3(...from).normalize().multiplyScalar(10 * box.extent);
  camera.position.copy(controls.target).add(away);
  camera.near = 0;
  camera.far = 30 * box.extent;
  camera.zoom = 1;
  controls.update();
  camera.updateMatrixWorld();
  fitBox();
  document.querySelectorAll("#views button").forEach((button) => button.setAttribute("aria-pressed", button.dataset.view === name));
  redraw();
}

/// Extents of the box across the line of sight.
function fitBox() {
  const { camera, box } = space;
  const [right, up] = [0, 1].map((k) => new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, k));
  const extent = (way) => [0, 1, 2].reduce((sum, k) => sum + Math.abs(way.getComponent(k)) * (box.high[k] - box.low[k]), 0);
  space.fit = [extent(right), extent(up)];
}

/// What several panels leave free: above them the buttons of the views, below the arrows of directions and the colour scale.
const AROUND = { above: 46, below: 66 };

/// Rectangles of the panels on the stage.
function layout(width, height) {
  const count = space.panels.length;
  const [top, room] = count > 1 ? [AROUND.above, Math.max(120, height - AROUND.above - AROUND.below)] : [0, height];
  let best = { scale: 0 };
  for (let columns = 1; columns <= count; columns++) {
    const rows = Math.ceil(count / columns);
    const [w, h] = [width / columns, room / rows];
    const scale = Math.min(w / space.fit[0], h / space.fit[1]);
    if (scale > best.scale) best = { scale, columns, w, h };
  }
  space.panels.forEach((panel, i) => {
    panel.rect = [(i % best.columns) * best.w, top + Math.floor(i / best.columns) * best.h, best.w, best.h];
  });
}

/// How a point of a panel lies on the stage, in pixels of the page.
function placeIn(panel) {
  const { camera } = space;
  const [left, top, width, height] = panel.rect;
  const point = new THREE.Vector3();
  frustum(width, height);
  const place = (at) => {
    point.set(at[0], at[1], at[2]).project(camera);
    return [left + (0.5 + 0.5 * point.x) * width, top + (0.5 - 0.5 * point.y) * height];
  };
  place.scale = (camera.zoom * width) / (camera.right - camera.left);
  return place;
}

function frustum(width, height) {
  const { camera, fit } = space;
  const small = space.panels.length > 1;
  // A title stands above a small panel, names of axes below the box of a large one.
  const [marginX, above, below] = small ? [34, 42, 36] : height < 420 ? [60, 76, 84] : find("axes").checked ? [90, 66, 110] : [40, 50, 50];
  const scale = Math.min(Math.max(40, width - 2 * marginX) / fit[0], Math.max(40, height - above - below) / fit[1]);
  camera.right = width / 2 / scale;
  camera.left = -camera.right;
  camera.top = (height + above - below) / 2 / scale;
  camera.bottom = camera.top - height / scale;
  camera.updateProjectionMatrix();
}

/// Asked for only when it may have changed: that lays the page out anew.
function stageSize() {
  if (!space.stage) {
    const stage = find("stage").getBoundingClientRect();
    space.stage = [Math.round(stage.width), Math.round(stage.height)];
  }
  return space.stage;
}

function render() {
  if (!space) return;
  const { renderer, scene, sun, camera, controls } = space;
  const [width, height] = stageSize();
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const size = `${width} ${height} ${ratio}`;
  if (size !== space.size) {
    // Only now: a canvas that is given a size is made anew.
    space.size = size;
    shown.stale = true;
    renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
    for (const layer of [under, over]) [layer.width, layer.height] = [Math.floor(width * ratio), Math.floor(height * ratio)];
  }
  layout(width, height);
  if (shown.stale) drawUnder(width, height, ratio);
  shown.stale = false;
  renderer.setScissorTest(true);
  // Light from over the reader's left shoulder.
  sun.position.copy(camera.position).sub(controls.target).applyAxisAngle(camera.up, -0.5).add(new THREE.Vector3(0, 0, 4 * space.box.extent));
  space.meshes.forEach((mesh) => (mesh.group.visible = false));
  const toward = camera.position.clone().sub(controls.target).normalize().toArray();
  space.panels.forEach((panel) => {
    const [left, top, w, h] = panel.rect;
    frustum(w, h);
    const bottom = height - top - h;
    renderer.setViewport(left, bottom, w, h);
    renderer.setScissor(left, bottom, w, h);
    const parts = [panel.mesh.group, ...(panel.beside || [])];
    parts.forEach((part) => (part.visible = true));
    panel.mesh.face(toward);
    renderer.render(scene, camera);
    parts.forEach((part) => (part.visible = false));
  });
}

/// Axes, gravity, wind, captions and the scale of colours.
function drawUnder(width, height, ratio) {
  const pen = under.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = css("--paper");
  pen.fillRect(0, 0, width, height);
  const small = space.panels.length > 1;
  for (const panel of space.panels) {
    const place = placeIn(panel);
    if (find("axes").checked) drawAxes(pen, space.box, place, small, !small || panel === space.panels[0]);
    if (panel === space.panels[0]) drawDirections(pen, space.box, place, [44, height - (small ? 46 : 64)], 76, panel.leaf);
    if (panel.label) drawLabel(pen, panel, small);
  }
  const colors = quantity();
  drawScale(pen, colors, colors.name === "vein" ? null : limitsOf(colors), mapOf(colors), width, height);
}

function drawLabel(pen, panel, small) {
  const [left, top, width] = panel.rect;
  pen.fillStyle = css("--ink");
  pen.font = font(small ? 12 : 14);
  pen.textAlign = "center";
  pen.textBaseline = "top";
  // In two lines where one is too long, and never in the next panel.
  const [first, second] = pen.measureText(panel.label).width > width - 12 ? twoLines(panel.label) : [panel.label, ""];
  const y = top + (small ? 4 : 46);
  pen.fillText(first, left + width / 2, y, width - 12);
  pen.fillText(second, left + width / 2, y + enlarged(15), width - 12);
}

/// A text divided at the comma or the space nearest to its middle.
function twoLines(text) {
  const middle = text.length / 2;
  const breaks = [...text.matchAll(/ /g)].map(({ index }) => [Math.abs(index - middle) - (text[index - 1] === "," ? middle / 2 : 0), index]);
  if (!breaks.length) return [text, ""];
  const [, at] = breaks.reduce((a, b) => (b[0] < a[0] ? b : a));
  return [text.slice(0, at), text.slice(at + 1)];
}

/// The node nearest to a place on the stage.
function nearest(x, y) {
  let best = { far: 14 };
  for (const panel of space ? space.panels : []) {
    const [left, top, width, height] = panel.rect;
    if (x < left || y < top || x > left + width || y > top + height) continue;
    const place = placeIn(panel);
    const { points } = panel.leaf;
    for (let i = 0; 3 * i < points.length; i++) {
      const at = place(points.subarray(3 * i, 3 * i + 3));
      const far = Math.hypot(at[0] - x, at[1] - y);
      if (far < best.far) best = { far, node: i, at, leaf: panel.leaf };
    }
  }
  return best.leaf ? best : null;
}

/// What is known of a node: names and numbers.
function told(leaf, node) {
  const [j, i] = [Math.floor(node / leaf.nodes), node % leaf.nodes];
  const list = (numbers) => [...numbers].map(short).join(", ");
  const lines = [
    ["vein, station", `${view.drawn[j]}, ${short(leaf.stations[i])} of its length`],
    [withUnit("x, y, z", lengthUnit), list(leaf.points.subarray(3 * node, 3 * node + 3))],
  ];
  if (!leaf.state) return lines;
  const part = (at) => leaf.state.subarray(16 * node + at, 16 * node + at + 3);
  return [
    ...lines,
    ["stretch, shear 2, 3", list(part(V))],
    [withUnit("twist, bend 2, 3", lengthUnit && `(1/${lengthUnit})`), list(part(U))],
    [withUnit("tension, shear force 2, 3", forceUnit), list(part(N))],
    [withUnit("moment: twisting, bending 2, 3", momentUnit), list(part(M))],
  ];
}

function hover(event) {
  const stage = find("stage").getBoundingClientRect();
  const [x, y] = [event.clientX - stage.left, event.clientY - stage.top];
  const found = event.buttons ? null : nearest(x, y);
  const hint = find("hint");
  const pen = over.getContext("2d");
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, over.width, over.height);
  hint.style.display = over.style.display = found ? "block" : "none";
  if (!found) return;
  hint.textContent = told(found.leaf, found.node).map(([name, text]) => `${name}: ${text}`).join("\n");
  hint.style.left = `${Math.min(x + 16, stage.width - hint.offsetWidth - 8)}px`;
  hint.style.top = `${Math.min(y + 16, stage.height - hint.offsetHeight - 8)}px`;
  const ratio = over.width / stage.width;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.strokeStyle = css("--accent");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(found.at[0], found.at[1], 7, 0, 7);
  pen.stroke();
}

/// The same numbers without a mouse.
function fillProbe() {
  const one = leaves[0];
  find("station").max = one.nodes - 1;
  const wanted = Number(find("vein").value);
  const j = view.drawn.reduce((best, number, k) => (Math.abs(number - wanted) < Math.abs(view.drawn[best] - wanted) ? k : best), 0);
  const node = j * one.nodes + Math.min(Number(find("station").value), one.nodes - 1);
  find("numbers").tBodies[0].replaceChildren(...told(one, node).map(([name, text]) => row(name, text)));
}

/// Turns by angles, moves by parts of the panel, zooms by a factor.
function turn(azimuth, polar) {
  const { camera, controls } = space;
  const away = camera.position.clone().sub(controls.target);
  const [flat, distance] = [Math.hypot(away.x, away.y), away.length()];
  const height = Math.min(Math.max(Math.atan2(away.z, flat) + polar, -1.57), 1.57);
  const around = Math.atan2(away.y, away.x) + azimuth;
  away.set(Math.cos(height) * Math.cos(around), Math.cos(height) * Math.sin(around), Math.sin(height)).multiplyScalar(distance);
  camera.position.copy(controls.target).add(away);
  controls.update();
}

function move(right, up) {
  const { camera, controls, box } = space;
  const size = box.extent / camera.zoom;
  const by = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0).multiplyScalar(right * size);
  by.add(new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1).multiplyScalar(up * size));
  camera.position.add(by);
  controls.target.add(by);
  controls.update();
}

function zoom(factor) {
  space.camera.zoom = Math.min(Math.max(space.camera.zoom * factor, 0.2), 200);
  space.camera.updateProjectionMatrix();
  redraw();
}

/// The picture as it stands.
function picture() {
  render();
  const paper = Object.assign(document.createElement("canvas"), { width: under.width, height: under.height });
  const pen = paper.getContext("2d");
  for (const layer of [under, canvas]) pen.drawImage(layer, 0, 0, paper.width, paper.height);
  return paper;
}

function savePicture() {
  picture().toBlob((blob) => {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: `${view.title}.png` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

function fillQuantities() {
  find("quantity").replaceChildren(...activeQuantities().map((one, i) => new Option(withUnit(one.name, one.unit), i)));
  shown.quantity = Math.min(shown.quantity, activeQuantities().length - 1);
  find("quantity").value = shown.quantity;
}

/// The leaf in a mode at a phase, displaced by a visible part of it, or by a part `swing` of that: nodes that move out of
/// phase have one more shape, a quarter of a period later.
function inMode(mode, phase, swing = 1) {
  if (!mode.decoded) {
    mode.decoded = new Float32Array(bytes(mode.rest));
    mode.by = new Float32Array(bytes(mode.displacement));
    mode.after = mode.later && new Float32Array(bytes(mode.later));
    const largest = Math.max(largestSize(mode.by), 1e-30);
    mode.size = Math.min(1, (0.2 * space.box.extent) / largest);
  }
  const size = swing * mode.size;
  const [now, after] = [size * Math.sin(phase), -size * Math.cos(phase)];
  const points = mode.decoded.map((x, i) => x + now * mode.by[i] + (mode.after ? after * mode.after[i] : 0));
  return { label: mode.label, nodes: mode.nodes, stations: evenly(mode.nodes), points, state: null };
}

function setTheme(name) {
  root.dataset.theme = name;
  themed.clear();
  if (space) space.meshes.forEach((mesh) => (mesh.painted = null));
  find("theme").textContent = name === "dark" ? "light" : "dark";
  redraw();
  if (space) space.meshes.forEach((mesh) => mesh.theme());
}

/// Keys that turn, move and zoom, and those of the views; false if it is none of them.
function keyInSpace(event) {
  if (!space) return false;
  const views = { 1: "free", 2: "above", 3: "side", 4: "front" };
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  if (views[event.key]) look(views[event.key]);
  else if (event.target === canvas && arrows[event.key]) {
    const [x, y] = arrows[event.key];
    if (event.shiftKey) move(-0.04 * x, -0.04 * y);
    else turn(0.06 * x, 0.06 * y);
  } else if (event.key === "+" || event.key === "=") zoom(1.15);
  else if (event.key === "-" || event.key === "−") zoom(1 / 1.15);
  else return false;
  return true;
}
