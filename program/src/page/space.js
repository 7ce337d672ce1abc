// The leaf in space: veins as tubes, the surface between them, the tip, what is held, and the loads.
/// Of a tube only the half that faces the reader is drawn, in so many strips: fewer where no graphics processor helps, and
/// a flat one of thin veins.
const SOFTWARE = drawnBySoftware();
const STRIPS = !SOFTWARE ? 6 : veins > 12 ? 1 : 2;
const RING = STRIPS + 1;
/// Their corners and what is normal there, as parts of the direction to the reader and of that across it.
const CORNERS = Array.from({ length: RING }, (_, k) => Math.PI * (k / STRIPS - 0.5)).map((angle) => [Math.cos(angle), Math.sin(angle)]);
const NORMALS = STRIPS > 1 ? CORNERS : CORNERS.map(() => [1, 0]);
/// Pieces of a tube, at least.
const PIECES = 48;

/// Half the width of a vein, so that neighbours stay apart.
const radius = view.longest * (veins <= 3 ? 0.0075 : veins <= 8 ? 0.006 : veins <= 30 ? 0.0034 : veins <= 70 ? 0.0024 : 0.002);

/// Whether there is no graphics processor, so that every triangle takes its time.
function drawnBySoftware() {
  const probe = document.createElement("canvas").getContext("webgl2");
  const known = probe && probe.getExtension("WEBGL_debug_renderer_info");
  const software = known ? /swiftshader|llvmpipe|software/i.test(probe.getParameter(known.UNMASKED_RENDERER_WEBGL)) : false;
  const lost = probe && probe.getExtension("WEBGL_lose_context");
  if (lost) lost.loseContext();
  return software;
}

/// Parts of one colour are drawn with the shader of the veins, which is compiled once.
function plain(geometry) {
  const white = new Float32Array(geometry.attributes.position.array.length).fill(1);
  geometry.setAttribute("color", new THREE.BufferAttribute(white, 3));
  return (material = new THREE.MeshLambertMaterial({ vertexColors: true })) => new THREE.Mesh(geometry, material);
}

/// Triangles between points: for each of `count` veins, whose points begin `stride` apart, quadrilaterals along it and
/// across, whose corners are `step` apart along and `side` across.
function quads(count, stride, along, across, step, side) {
  const indices = [];
  for (let j = 0; j < count; j++)
    for (let i = 0; i < along; i++)
      for (let k = 0; k < across; k++) {
        const p = j * stride + i * step + k * side;
        indices.push(p, p + side, p + step, p + side, p + side + step, p + step);
      }
  return new THREE.BufferAttribute(Uint32Array.from(indices), 1);
}

/// A leaf in the scene, whose shape and colours can be set again without new buffers.
/// Points on the cubic through neighbouring nodes, so many pieces between two: with the exact slopes R v where they are known.
function smooth(leaf, sub, points) {
  const { nodes, points: from } = leaf;
  if (sub === 1) {
    points.set(from.subarray(0, points.length));
    return;
  }
  const fine = (nodes - 1) * sub + 1;
  const slope = leaf.state ? slopeOfState(leaf) : slopeOfPoints(leaf);
  const [a, b] = [[0, 0, 0], [0, 0, 0]];
  for (let j = 0; j * 3 * nodes < from.length; j++)
    for (let i = 0; i + 1 < nodes; i++) {
      const p = j * nodes + i;
      slope(p, i, 1, a);
      slope(p + 1, i + 1, -1, b);
      const last = i + 2 === nodes ? sub : sub - 1;
      for (let s = 0; s <= last; s++) {
        const t = s / sub;
        const [h0, h1] = [(1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2];
        const [h2, h3] = [t * t * (3 - 2 * t), t * t * (t - 1)];
        const to = 3 * (j * fine + i * sub + s);
        for (let k = 0; k < 3; k++) points[to + k] = h0 * from[3 * p + k] + h1 * a[k] + h2 * from[3 * p + 3 + k] + h3 * b[k];
      }
    }
}

/// Pieces between two nodes, so that a vein has enough to look smooth.
const piecesOf = (nodes) => (nodes > 1 ? Math.max(1, Math.ceil(PIECES / (nodes - 1))) : 1);

class LeafMesh {
  constructor(leaf) {
    this.nodes = leaf.nodes;
    this.sub = piecesOf(leaf.nodes);
    this.fine = Math.max(1, (leaf.nodes - 1) * this.sub + 1);
    this.points = new Float32Array(3 * veins * this.fine);
    const vertices = veins * this.fine * RING;
    const attribute = (size) => new THREE.BufferAttribute(new Float32Array(vertices * size), size).setUsage(THREE.DynamicDrawUsage);
    const geometry = new THREE.BufferGeometry();
    for (const [name, size] of [["position", 3], ["normal", 3], ["color", 3]]) geometry.setAttribute(name, attribute(size));
    geometry.setIndex(quads(veins, this.fine * RING, this.fine - 1, STRIPS, RING, 1));
    this.tubes = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true }));
    this.toward = [0, 0, 0];
    const membrane = new THREE.BufferGeometry();
    membrane.setAttribute("position", new THREE.BufferAttribute(this.points, 3).setUsage(THREE.DynamicDrawUsage));
    const flat = new THREE.BufferAttribute(new Float32Array(3 * veins * this.fine), 3).setUsage(THREE.DynamicDrawUsage);
    membrane.setAttribute("normal", flat);
    membrane.setIndex(quads(veins - 1, this.fine, this.fine - 1, 1, 1, this.fine));
    const material = new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.55, depthWrite: false });
    this.surface = new THREE.Mesh(membrane, material);
    const ball = plain(new THREE.SphereGeometry(1.9 * radius, 16, 12));
    const accent = new THREE.MeshLambertMaterial({ vertexColors: true });
    this.tips = Array.from({ length: view.joined ? 1 : veins }, () => ball(accent));
    this.holds = holdMarks(leaf, this);
    this.bars = clampBars(leaf, this);
    this.loads = [];
    this.group = new THREE.Group();
    this.group.add(this.tubes, this.surface, ...this.tips, ...[...this.holds, ...this.bars].map(({ mark }) => mark));
    for (const part of [this.tubes, this.surface]) part.frustumCulled = false;
  }

  /// The point nearest to a fraction of the length.
  fineAt(stations, sigma) {
    const after = stations.findIndex((at) => at >= sigma);
    if (after < 1) return after === 0 ? 0 : this.fine - 1;
    const part = (sigma - stations[after - 1]) / (stations[after] - stations[after - 1]);
    return Math.round((after - 1 + part) * this.sub);
  }

  /// Brings the arrows of the loads to the shape.
  load(leaf) {
    const loads = leaf.loads || view.loads || [];
    if (loads !== this.known) {
      this.loads.forEach(({ mark }) => this.group.remove(mark));
      this.loads = loads.filter(({ vein }) => view.drawn.includes(vein)).map((load) => ({ ...load, mark: loadMark(load) }));
      this.loads.forEach(({ mark }) => (paintMark(mark), this.group.add(mark)));
      this.known = loads;
    }
    for (const { mark, ...load } of this.loads) mark.position.fromArray(tailOf(load, leaf, this));
  }

  /// Takes over the shape of a leaf with as many nodes.
  shape(leaf) {
    smooth(leaf, this.sub, this.points);
    this.moved = true;
    const last = (j) => 3 * (j * this.fine + this.fine - 1);
    this.tips.forEach((tip, j) => tip.position.fromArray(this.points, last(j)));
    // A tip that is held has the mark of its holder.
    this.tips.forEach((tip, j) => (tip.visible = !view.holds.some((hold) => holdsTip(hold, j))));
    this.holds.forEach(({ mark, place }) => mark.position.fromArray(this.points, place));
    this.bars.forEach(({ mark, places }) => layBetween(mark, places.map((place) => new THREE.Vector3().fromArray(this.points, place))));
    this.load(leaf);
    const membrane = this.surface.geometry;
    membrane.attributes.position.needsUpdate = true;
    if (this.surface.visible) membrane.computeVertexNormals();
  }

  /// Turns the tubes to the reader, who looks from this direction, if that is not done yet.
  face(toward) {
    if (!this.moved && toward.every((x, k) => x === this.toward[k])) return;
    [this.moved, this.toward] = [false, toward];
    const { fine, points } = this;
    const { position, normal } = this.tubes.geometry.attributes;
    const [ring, out] = [position.array, normal.array];
    const [vx, vy, vz] = toward;
    let to = 0;
    for (let j = 0; j < veins; j++) {
      let [sx, sy, sz] = [0, 1, 0];
      for (let i = 0; i < fine; i++) {
        const at = 3 * (j * fine + i);
        const [before, after] = [i > 0 ? at - 3 : at, i + 1 < fine ? at + 3 : at];
        const [tx, ty, tz] = [points[after] - points[before], points[after + 1] - points[before + 1], points[after + 2] - points[before + 2]];
        // Across vein and line of sight; where these are one, as before.
        const [cx, cy, cz] = [ty * vz - tz * vy, tz * vx - tx * vz, tx * vy - ty * vx];
        const size = Math.sqrt(cx * cx + cy * cy + cz * cz);
        if (size > 1e-12 * view.longest) [sx, sy, sz] = [cx / size, cy / size, cz / size];
        const length = Math.sqrt(tx * tx + ty * ty + tz * tz) || 1;
        const [fx, fy, fz] = [(sy * tz - sz * ty) / length, (sz * tx - sx * tz) / length, (sx * ty - sy * tx) / length];
        for (let k = 0; k < RING; k++, to += 3) {
          const [c, s] = [radius * CORNERS[k][0], radius * CORNERS[k][1]];
          const [nc, ns] = NORMALS[k];
          ring[to] = points[at] + c * fx + s * sx; ring[to + 1] = points[at + 1] + c * fy + s * sy; ring[to + 2] = points[at + 2] + c * fz + s * sz;
          out[to] = nc * fx + ns * sx; out[to + 1] = nc * fy + ns * sy; out[to + 2] = nc * fz + ns * sz;
        }
      }
    }
    position.needsUpdate = true;
    normal.needsUpdate = true;
  }

  /// Colours by the vein, or by values at the nodes between two limits.
  paint(values, limits, map) {
    const { fine, sub, nodes } = this;
    const color = this.tubes.geometry.attributes.color;
    for (let j = 0; j < veins; j++) {
      const own = linear(visible(rgb(view.colors[j])));
      for (let i = 0; i < fine; i++) {
        let c = own;
        if (values) {
          const [node, part] = [Math.min(Math.floor(i / sub), nodes - 1), (i % sub) / sub];
          const at = j * nodes + node;
          const value = part > 0 ? values[at] + part * (values[at + 1] - values[at]) : values[at];
          c = linear(colorOf(map, (value - limits[0]) / (limits[1] - limits[0])));
        }
        for (let k = 0; k < RING; k++) color.array.set(c, 3 * ((j * fine + i) * RING + k));
      }
    }
    color.needsUpdate = true;
  }

  /// The parts that have one colour each.
  theme() {
    for (const { mark } of [...this.holds, ...this.bars]) mark.material.color.set(css("--clamp"));
    for (const { mark } of this.loads) paintMark(mark);
    this.tips.forEach((tip) => tip.material.color.set(css("--accent")));
    this.surface.material.color.set(css("--membrane"));
  }
}

/// Whether what holds a leaf is at this one of its tips: the joined one, or that of a vein that is drawn.
const holdsTip = ({ part, vein, at }, j) => part === "tip" || (part === "grip" && at[1] === 1 && (view.rods === 1 || (!view.joined && vein === view.drawn[j])));

/// Where a mark at a fraction of a vein lies among the points of a mesh; less than zero: the vein is not drawn.
const placeOf = (vein, at, { stations }, mesh) => 3 * (view.drawn.indexOf(vein) * mesh.fine + mesh.fineAt(stations, at));

/// Marks on what is held, at its ends and at the nodes between: blocks where veins are clamped, and cones that point at them
/// where they are pinned, wheels where they slide, and posts where springs hold them.
function holdMarks(leaf, mesh) {
  const cone = new THREE.CylinderGeometry(1.9 * radius, 0, 3.2 * radius, 12);
  cone.rotateX(Math.PI / 2);
  cone.translate(0, 0, 1.6 * radius);
  const block = (part) => {
    const size = part === "grip" ? [2 * radius, 2 * radius, 2.8 * radius, 4] : [3 * radius, 3 * radius, 3 * radius, 24];
    return new THREE.CylinderGeometry(...size).rotateX(Math.PI / 2);
  };
  // Wheels, across what slides, and posts.
  const wheel = new THREE.CylinderGeometry(1.9 * radius, 1.9 * radius, 1.2 * radius, 24);
  const post = new THREE.CylinderGeometry(1.1 * radius, 1.1 * radius, 3.6 * radius, 6);
  const shapes = { pinned: () => plain(cone), clamped: (part) => plain(block(part)), sliding: () => plain(wheel), elastic: () => plain(post) };
  const drawn = view.holds.filter(({ vein }) => view.drawn.includes(vein));
  return drawn.flatMap(({ part, vein, at, held }) => {
    const inside = leaf.stations.filter((sigma) => sigma > at[0] && sigma < at[1]);
    const places = [...new Set([at[0], ...inside, at[1]].map((sigma) => placeOf(vein, sigma, leaf, mesh)))];
    const shape = shapes[held](part);
    const material = new THREE.MeshLambertMaterial({ vertexColors: true });
    return places.map((place) => ({ place, mark: shape(material) }));
  });
}

/// Bars between the clamps of neighbouring veins whose bases are apart.
function clampBars(leaf, mesh) {
  const clamps = view.holds.filter(({ part, held, vein }) => part === "base" && held === "clamped" && view.drawn.includes(vein));
  const bar = plain(new THREE.CylinderGeometry(3 * radius, 3 * radius, 1, 16).rotateX(Math.PI / 2));
  const places = clamps.map(({ vein }) => placeOf(vein, 0, leaf, mesh));
  return places.slice(1).map((place, i) => ({ places: [places[i], place], mark: bar(new THREE.MeshLambertMaterial({ vertexColors: true })) }));
}

/// Lays a mark that is one long along z between two points.
function layBetween(mark, [from, to]) {
  const way = to.clone().sub(from);
  mark.visible = way.length() > 1e-9 * view.longest;
  mark.position.copy(from).lerp(to, 0.5);
  if (!mark.visible) return;
  mark.scale.z = way.length();
  mark.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), way.normalize());
}

/// Radius of the curved arrow of a moment, and pieces of it along and around.
const TURN = { radius: 0.06, angle: 1.5 * Math.PI, along: 24, around: 6 };

/// Whether it is a moment, or one per length.
const turns = (action) => action === "moment" || action === "couple";

/// Radius of the ball of a mass that has landed, in radii of veins.
const BALL = 2.5;

/// The arrow of a load: along z from the origin, turned to its direction. That of a moment is curved about it; a mass is a ball.
function loadMark({ action, direction, length }) {
  const mark = new THREE.Group();
  const thick = (action === "distributed" ? 0.35 : 0.6) * radius;
  const head = new THREE.ConeGeometry(3 * thick, 8 * thick, 12).rotateX(Math.PI / 2);
  const material = new THREE.MeshLambertMaterial({ vertexColors: true });
  const [reach, size] = [length * view.longest, 8 * thick];
  if (action === "mass") {
    mark.add(plain(new THREE.SphereGeometry(BALL * radius, 16, 12))(material));
  } else if (turns(action)) {
    const [tube, tip] = [plain(curved(thick))(material), plain(head)(material)];
    const ring = TURN.radius * view.longest;
    tip.position.set(ring * Math.cos(TURN.angle), ring * Math.sin(TURN.angle), 0);
    tip.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(-Math.sin(TURN.angle), Math.cos(TURN.angle), 0));
    mark.add(tube, tip);
  } else {
    const shaft = Math.max(reach - size, 0.1 * reach);
    const rod = new THREE.CylinderGeometry(thick, thick, shaft, 8).rotateX(Math.PI / 2).translate(0, 0, 0.5 * shaft);
    mark.add(plain(rod)(material), plain(head.translate(0, 0, reach - 0.5 * size))(material));
  }
  mark.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...direction));
  return mark;
}

/// A part of a ring about z.
function curved(thick) {
  const [points, count] = [[], TURN.around + 1];
  for (let i = 0; i <= TURN.along; i++)
    for (let k = 0; k < count; k++) {
      const [turn, around] = [(TURN.angle * i) / TURN.along, (2 * Math.PI * k) / TURN.around];
      const out = TURN.radius * view.longest + thick * Math.cos(around);
      points.push(out * Math.cos(turn), out * Math.sin(turn), thick * Math.sin(around));
    }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(points), 3));
  geometry.setIndex(quads(1, 0, TURN.along, TURN.around, count, 1));
  geometry.computeVertexNormals();
  return geometry;
}

/// Where the arrow of a load begins: one along a vein, or that pushes against it, ends at its point.
function tailOf({ action, vein, at, offset, direction, length }, leaf, mesh) {
  const place = placeOf(vein, at, leaf, mesh);
  const arm = offset && leaf.state ? armOf(offset, vein, at, leaf) : [0, 0, 0];
  const point = [...mesh.points.subarray(place, place + 3)].map((x, k) => x + arm[k]);
  if (turns(action) || action === "mass") return point;
  const first = placeOf(vein, 0, leaf, mesh);
  const before = Math.max(first, place - 3);
  const tangent = [0, 1, 2].map((k) => mesh.points[before + 3 + k] - mesh.points[before + k]);
  const along = direction.reduce((sum, x, k) => sum + x * tangent[k], 0);
  const ends = action === "distributed" || along < -0.5 * hypot(...tangent);
  return ends ? point.map((x, k) => x - length * view.longest * direction[k]) : point;
}

/// From the axis to the point of a load off it: y d2 + z d3.
function armOf([y, z], vein, at, { state, stations, nodes }) {
  const after = stations.findIndex((station) => station >= at - 1e-9);
  const node = view.drawn.indexOf(vein) * nodes + (after < 0 ? nodes - 1 : after);
  const [w, a, b, c] = state.subarray(16 * node, 16 * node + 4);
  return [
    2 * (a * b - w * c) * y + 2 * (a * c + w * b) * z,
    (1 - 2 * (a * a + c * c)) * y + 2 * (b * c - w * a) * z,
    2 * (b * c + w * a) * y + (1 - 2 * (a * a + b * b)) * z,
  ];
}

const paintMark = (mark) => mark.children.forEach((part) => part.material.color.set(css("--bad")));

/// From the colours of screens to those that light is reckoned with.
const linear = (c) => c.map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));

/// d r / d sigma times the spacing of the stations on the side that is asked for.
function slopeOfState(leaf) {
  const { state, stations, nodes } = leaf;
  return (p, i, side, out) => {
    const s = 16 * p;
    const [w, x, y, z, v1, v2, v3] = state.subarray(s, s + 7);
    const step = Math.abs(stations[i + side] - stations[i]) * view.lengths[Math.floor(p / nodes)];
    out[0] = step * ((1 - 2 * (y * y + z * z)) * v1 + 2 * (x * y - w * z) * v2 + 2 * (x * z + w * y) * v3);
    out[1] = step * (2 * (x * y + w * z) * v1 + (1 - 2 * (x * x + z * z)) * v2 + 2 * (y * z - w * x) * v3);
    out[2] = step * (2 * (x * z - w * y) * v1 + 2 * (y * z + w * x) * v2 + (1 - 2 * (x * x + y * y)) * v3);
  };
}

/// The same from the neighbours.
function slopeOfPoints(leaf) {
  const { points, nodes } = leaf;
  return (p, i, _side, out) => {
    const [left, right] = [i > 0 ? p - 1 : p, i + 1 < nodes ? p + 1 : p];
    for (let k = 0; k < 3; k++) out[k] = (points[3 * right + k] - points[3 * left + k]) / Math.max(1, right - left);
  };
}
