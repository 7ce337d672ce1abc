// The leaf in space: veins as tubes, the surface between them, the clamp and the tip.
const SIDES = 8;
/// Pieces of a tube, at least.
const PIECES = 48;

/// Half the width of a vein, so that neighbours stay apart.
const radius = view.longest * (veins <= 3 ? 0.0075 : veins <= 8 ? 0.006 : veins <= 30 ? 0.0034 : veins <= 70 ? 0.0024 : 0.002);

/// A leaf in the scene, whose shape and colours can be set again without new buffers.
class LeafMesh {
  constructor(leaf) {
    this.nodes = leaf.nodes;
    this.sub = leaf.nodes > 1 ? Math.max(1, Math.ceil(PIECES / (leaf.nodes - 1))) : 1;
    this.fine = Math.max(1, (leaf.nodes - 1) * this.sub + 1);
    this.points = new Float32Array(3 * veins * this.fine);
    const vertices = veins * this.fine * SIDES;
    const attribute = (size) => new THREE.BufferAttribute(new Float32Array(vertices * size), size).setUsage(THREE.DynamicDrawUsage);
    const geometry = new THREE.BufferGeometry();
    for (const [name, size] of [["position", 3], ["normal", 3], ["color", 3]]) geometry.setAttribute(name, attribute(size));
    geometry.setIndex(new THREE.BufferAttribute(this.tubeIndices(), 1));
    this.tubes = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
    const membrane = new THREE.BufferGeometry();
    membrane.setAttribute("position", new THREE.BufferAttribute(this.points, 3).setUsage(THREE.DynamicDrawUsage));
    const flat = new THREE.BufferAttribute(new Float32Array(3 * veins * this.fine), 3).setUsage(THREE.DynamicDrawUsage);
    membrane.setAttribute("normal", flat);
    membrane.setIndex(new THREE.BufferAttribute(this.surfaceIndices(), 1));
    const material = new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.55, depthWrite: false });
    this.surface = new THREE.Mesh(membrane, material);
    const ball = new THREE.SphereGeometry(1.9 * radius, 16, 12);
    this.tips = Array.from({ length: view.joined ? 1 : veins }, () => new THREE.Mesh(ball, new THREE.MeshLambertMaterial()));
    const block = new THREE.CylinderGeometry(3 * radius, 3 * radius, 3 * radius, 24);
    block.rotateX(Math.PI / 2);
    this.clamp = new THREE.Mesh(block, new THREE.MeshLambertMaterial());
    this.group = new THREE.Group();
    this.group.add(this.tubes, this.surface, this.clamp, ...this.tips);
    for (const part of [this.tubes, this.surface]) part.frustumCulled = false;
  }

  tubeIndices() {
    const indices = new Uint32Array(veins * Math.max(0, this.fine - 1) * SIDES * 6);
    let at = 0;
    for (let j = 0; j < veins; j++)
      for (let i = 0; i + 1 < this.fine; i++)
        for (let k = 0; k < SIDES; k++) {
          const a = (j * this.fine + i) * SIDES;
          const [p, q] = [a + k, a + ((k + 1) % SIDES)];
          indices.set([p, q, p + SIDES, q, q + SIDES, p + SIDES], at);
          at += 6;
        }
    return indices;
  }

  surfaceIndices() {
    const indices = new Uint32Array(Math.max(0, veins - 1) * Math.max(0, this.fine - 1) * 6);
    let at = 0;
    for (let j = 0; j + 1 < veins; j++)
      for (let i = 0; i + 1 < this.fine; i++) {
        const [p, q] = [j * this.fine + i, (j + 1) * this.fine + i];
        indices.set([p, q, p + 1, q, q + 1, p + 1], at);
        at += 6;
      }
    return indices;
  }

  /// Takes over the shape of a leaf with as many nodes.
  shape(leaf) {
    this.smooth(leaf);
    this.tube();
    const last = (j) => 3 * (j * this.fine + this.fine - 1);
    this.tips.forEach((tip, j) => tip.position.fromArray(this.points, last(j)));
    const membrane = this.surface.geometry;
    membrane.attributes.position.needsUpdate = true;
    if (this.surface.visible) membrane.computeVertexNormals();
  }

  /// Points on the cubic through neighbouring nodes: with the exact slopes R v where they are known.
  smooth(leaf) {
    const { sub, fine, nodes, points } = this;
    const from = leaf.points;
    if (sub === 1) {
      points.set(from.subarray(0, points.length));
      return;
    }
    const slope = leaf.state ? slopeOfState(leaf) : slopeOfPoints(leaf);
    const [a, b] = [[0, 0, 0], [0, 0, 0]];
    for (let j = 0; j < veins; j++)
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

  /// Rings around the points, carried along without twist.
  tube() {
    const { fine, points } = this;
    const { position, normal } = this.tubes.geometry.attributes;
    const [ring, out] = [position.array, normal.array];
    const [cos, sin] = [Math.cos, Math.sin].map((f) => Float32Array.from({ length: SIDES }, (_, k) => f((2 * Math.PI * k) / SIDES)));
    for (let j = 0; j < veins; j++) {
      let [nx, ny, nz] = [0, 0, 1];
      for (let i = 0; i < fine; i++) {
        const at = 3 * (j * fine + i);
        const [before, after] = [i > 0 ? at - 3 : at, i + 1 < fine ? at + 3 : at];
        let [tx, ty, tz] = [points[after] - points[before], points[after + 1] - points[before + 1], points[after + 2] - points[before + 2]];
        const length = Math.sqrt(tx * tx + ty * ty + tz * tz) || 1;
        tx /= length; ty /= length; tz /= length;
        let along = nx * tx + ny * ty + nz * tz;
        if (Math.abs(along) > 0.98) {
          // At a start straight up, or a sharp kink: any direction across will do.
          [nx, ny, nz] = Math.abs(tx) < 0.8 ? [1, 0, 0] : [0, 1, 0];
          along = nx * tx + ny * ty + nz * tz;
        }
        nx -= along * tx; ny -= along * ty; nz -= along * tz;
        const size = Math.sqrt(nx * nx + ny * ny + nz * nz) || 1;
        nx /= size; ny /= size; nz /= size;
        const [bx, by, bz] = [ty * nz - tz * ny, tz * nx - tx * nz, tx * ny - ty * nx];
        let to = at * SIDES;
        for (let k = 0; k < SIDES; k++, to += 3) {
          const [x, y, z] = [cos[k] * nx + sin[k] * bx, cos[k] * ny + sin[k] * by, cos[k] * nz + sin[k] * bz];
          out[to] = x; out[to + 1] = y; out[to + 2] = z;
          ring[to] = points[at] + radius * x; ring[to + 1] = points[at + 1] + radius * y; ring[to + 2] = points[at + 2] + radius * z;
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
      const own = linear(rgb(view.colors[j]));
      for (let i = 0; i < fine; i++) {
        let c = own;
        if (values) {
          const [node, part] = [Math.min(Math.floor(i / sub), nodes - 1), (i % sub) / sub];
          const at = j * nodes + node;
          const value = part > 0 ? values[at] + part * (values[at + 1] - values[at]) : values[at];
          c = linear(colorOf(map, (value - limits[0]) / (limits[1] - limits[0])));
        }
        for (let k = 0; k < SIDES; k++) color.array.set(c, 3 * ((j * fine + i) * SIDES + k));
      }
    }
    color.needsUpdate = true;
  }

  /// The parts that have one colour each.
  theme(css) {
    this.clamp.material.color.set(css("--clamp"));
    this.tips.forEach((tip) => tip.material.color.set(css("--accent")));
    this.surface.material.color.set(css("--membrane"));
  }
}

/// From the colours of screens to those that light is reckoned with.
const linear = (c) => c.map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));

/// d r / d sigma times the spacing of the stations on the side that is asked for.
function slopeOfState(leaf) {
  const { state, stations, nodes, points } = leaf;
  const lengths = Float32Array.from({ length: veins }, (_, j) => restLength(leaf, j));
  return (p, i, side, out) => {
    const s = 16 * p;
    const [w, x, y, z, v1, v2, v3] = state.subarray(s, s + 7);
    const step = Math.abs(stations[i + side] - stations[i]) * lengths[Math.floor(p / nodes)];
    out[0] = step * ((1 - 2 * (y * y + z * z)) * v1 + 2 * (x * y - w * z) * v2 + 2 * (x * z + w * y) * v3);
    out[1] = step * (2 * (x * y + w * z) * v1 + (1 - 2 * (x * x + z * z)) * v2 + 2 * (y * z - w * x) * v3);
    out[2] = step * (2 * (x * z - w * y) * v1 + 2 * (y * z + w * x) * v2 + (1 - 2 * (x * x + y * y)) * v3);
  };
}

const restLength = (_, j) => view.lengths[j];

/// The same from the neighbours.
function slopeOfPoints(leaf) {
  const { points, nodes } = leaf;
  return (p, i, _side, out) => {
    const [left, right] = [i > 0 ? p - 1 : p, i + 1 < nodes ? p + 1 : p];
    for (let k = 0; k < 3; k++) out[k] = (points[3 * right + k] - points[3 * left + k]) / Math.max(1, right - left);
  };
}
