//! A leaf at rest on one grid, and its transfer to others: prolongation to the grid with all segments
//! halved or to any other, restriction, and prediction on a finer grid from several coarser ones by
//! polynomials through the nearest nodes; strains and stress resultants at the nodes of a state.

use crate::leaf::{
    ContractionResultants, DiscreteLeaf, Grid, Leaf, NodeLoad, RodFields, State, whole_state,
};
use crate::rod::SegmentGradient;
use crate::rotation::{self, interpolated_rotation};
use crate::shape::{NodeState, RodShape};
use glam::{DQuat, DVec3};

/// Segments of a panel between kinks from which on polynomials along it predict better than cubic
/// Hermite interpolants.
const LEAST_PANEL_SEGMENTS: usize = 4;

/// Predicts the state on the finest grid refined: the polynomial in ds^2 through the states on
/// nested `levels`, from coarse to fine. Interpolation along the panels between kinks is
/// polynomial as well; in panels of few segments the finest grid contributes `state`, its
/// prolongation.
pub fn predict_on_finer_grid(levels: &[&GridLevel], state: &mut State) {
    let [coarser @ .., finest] = levels else {
        return;
    };
    let first = &levels[0].leaf;
    let edges = edges(&first.grid, first.leaf.kinks());
    let panel = |ends: &[usize]| Panel {
        first: ends[0],
        last: ends[1],
        coarsest: first.segments(),
        known: usize::from(ends[0] > 0 || !first.leaf.hinged()),
    };
    let panels: Vec<Panel> = edges.windows(2).map(panel).collect();
    for panel in &panels {
        if panel.count(&finest.state) >= LEAST_PANEL_SEGMENTS {
            panel.interpolate(&finest.state, state);
        }
    }
    let segments: Vec<usize> = levels.iter().map(|it| it.leaf.segments()).collect();
    for (level, weight) in coarser
        .iter()
        .zip(weights(&segments, state.segments() as f64))
    {
        for panel in &panels {
            panel.add_change(weight, &level.state, &finest.state, state);
        }
    }
}

/// Weights of values on grids of the given segments in the value on another or, with infinitely
/// many segments, in their limit, by the polynomial in ds^2 through all of them.
pub fn weights(segments: &[usize], target: f64) -> Vec<f64> {
    let target = target.powi(-2);
    let square = |segments: usize| (segments as f64).powi(-2);
    let weight = |own: &usize| {
        let others = segments.iter().filter(|other| *other != own);
        let parts = others.map(|it| (target - square(*it)) / (square(*own) - square(*it)));
        parts.product()
    };
    segments.iter().map(weight).collect()
}

/// Nodes of a grid at its ends and kinks.
fn edges(grid: &Grid, kinks: &[f64]) -> Vec<usize> {
    let node = |kink: &f64| grid.sigma().partition_point(|at| *at < kink - 1e-12);
    let inner = kinks.iter().map(node);
    [0].into_iter()
        .chain(inner)
        .chain([grid.segments()])
        .collect()
}

/// The part of the rods between two kinks: from node `first` to node `last` of the coarsest
/// grid, which has `coarsest` segments.
struct Panel {
    first: usize,
    last: usize,
    coarsest: usize,
    /// Whether its first node is known: a clamped base, or the last of the panel before.
    known: usize,
}

impl Panel {
    /// The number of the panel's first node or segment on the grid of a state.
    fn first(&self, state: &State) -> usize {
        self.first * state.segments() / self.coarsest
    }

    /// The number of the panel's segments on the grid of a state.
    fn count(&self, state: &State) -> usize {
        (self.last - self.first) * state.segments() / self.coarsest
    }

    /// Interpolation from the panel's nodes on one grid to those on another.
    fn nodes(&self, from: &State, to: &State) -> Vec<Stencil> {
        let (have, want) = (self.count(from), self.count(to));
        let place = |k: usize| (k * have) as f64 / want as f64;
        let through = |k: usize| Stencil::new(self.first(from), have + 1, place(k));
        (0..=want).map(through).collect()
    }

    /// Interpolation from the midpoints of the panel's segments on one grid to those on another.
    fn middles(&self, from: &State, to: &State) -> Vec<Stencil> {
        let (have, want) = (self.count(from), self.count(to));
        let place = |i: usize| (i as f64 + 0.5) * have as f64 / want as f64 - 0.5;
        let through = |i: usize| Stencil::new(self.first(from), have, place(i));
        (0..want).map(through).collect()
    }

    /// Interpolates the state on one grid to another.
    fn interpolate(&self, from: &State, to: &mut State) {
        let (nodes, middles) = (self.nodes(from, to), self.middles(from, to));
        for j in 0..from.rods() {
            let base = from.base(j);
            let first = to.base(j) + self.first(to);
            for (k, node) in nodes.iter().enumerate() {
                to.x[first + k] = node.value(|i| from.x[base + i]);
                to.q[first + k] = node.rotation(|i| from.q[base + i]);
            }
            let base = j * from.segments();
            let first = j * to.segments() + self.first(to);
            for (i, middle) in middles.iter().enumerate() {
                to.n[first + i] = middle.value(|i| from.n[base + i]);
            }
        }
        if !to.tissue.is_empty() {
            for g in 0..from.tissue.len() / (from.segments() + 1) {
                let (base, first) = (from.base(g), to.base(g) + self.first(to));
                for (k, node) in nodes.iter().enumerate() {
                    to.tissue[first + k] = node.value(|i| from.tissue[base + i]);
                }
            }
        }
    }

    /// Adds `weight` times the change from the state on the `fine` grid to that on
    /// the `coarse` one.
    fn add_change(&self, weight: f64, coarse: &State, fine: &State, to: &mut State) {
        let (nodes, middles) = (self.nodes(coarse, to), self.middles(coarse, to));
        let on_coarse = self.middles(fine, coarse);
        let (start, count) = (self.first(coarse), self.count(coarse));
        let stride = fine.segments() / coarse.segments();
        for j in 0..coarse.rods() {
            let change = |i: usize| {
                let (a, b) = (coarse.base(j) + i, fine.base(j) + stride * i);
                let turn = rotation::log(coarse.q[a] * fine.q[b].conjugate());
                (weight * (coarse.x[a] - fine.x[b]), weight * turn)
            };
            let changes: Vec<_> = (start..=start + count).map(change).collect();
            let first = to.base(j) + self.first(to);
            for (k, node) in nodes.iter().enumerate().skip(self.known) {
                let turn = node.value(|i| changes[i - start].1);
                to.x[first + k] += node.value(|i| changes[i - start].0);
                to.q[first + k] = (rotation::exp(turn) * to.q[first + k]).normalize();
            }
            let [base, fine_base] = [coarse, fine].map(|state| j * state.segments());
            let change = |i: usize| {
                let known = on_coarse[i - start].value(|i| fine.n[fine_base + i]);
                weight * (coarse.n[base + i] - known)
            };
            let changes: Vec<_> = (start..start + count).map(change).collect();
            let first = j * to.segments() + self.first(to);
            for (i, middle) in middles.iter().enumerate() {
                to.n[first + i] += middle.value(|i| changes[i - start]);
            }
        }
        if [coarse, fine, to]
            .iter()
            .any(|state| state.tissue.is_empty())
        {
            return;
        }
        for g in 0..coarse.tissue.len() / (coarse.segments() + 1) {
            let change = |i: usize| {
                let (a, b) = (coarse.base(g) + i, fine.base(g) + stride * i);
                weight * (coarse.tissue[a] - fine.tissue[b])
            };
            let changes: Vec<_> = (start..=start + count).map(change).collect();
            let first = to.base(g) + self.first(to);
            let skipped = usize::from(self.first > 0);
            for (k, node) in nodes.iter().enumerate().skip(skipped) {
                to.tissue[first + k] += node.value(|i| changes[i - start]);
            }
        }
    }
}

/// The state on the refined grid: nodes in common are kept, new ones lie on cubic Hermite
/// interpolants of position and quaternion. Forces are interpolated linearly between the
/// midpoints of the segments.
pub fn prolong(leaf: &DiscreteLeaf, state: &State) -> State {
    let n = leaf.segments();
    let (mut x, mut q, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..leaf.rods() {
        let force = |i: usize| state.n[j * n + i];
        // Spatial curvature and force at a node: from the adjacent segments, or extrapolated
        // from the two nearest to an end.
        let curved = |i: usize| {
            let segment = leaf.segment(state, j, i, force(i));
            segment.frame * segment.u
        };
        let curvatures: Vec<DVec3> = (0..n).map(curved).collect();
        let nodal = |value: &dyn Fn(usize) -> DVec3, i: usize| match i {
            _ if n == 1 => value(0),
            0 => 1.5 * value(0) - 0.5 * value(1),
            _ if i == n => 1.5 * value(n - 1) - 0.5 * value(n - 2),
            _ => 0.5 * (value(i - 1) + value(i)),
        };
        let curvature = |i: usize| nodal(&|i| curvatures[i], i);
        let base = state.base(j);
        for i in 0..n {
            let (section, k) = (leaf.section(j, i), base + i);
            let tangent = |i: usize| {
                let q = state.q[base + i];
                q * (section.rest_strain + section.compliance * (q.conjugate() * nodal(&force, i)))
            };
            let middle = 0.5 * (state.x[k] + state.x[k + 1])
                + section.ds / 8.0 * (tangent(i) - tangent(i + 1));
            let (q0, q1) = (state.q[k], state.q[k + 1]);
            let q1 = if q0.dot(q1) < 0.0 { -q1 } else { q1 };
            // q' = u q / 2 with u spatial.
            let slope = |u: DVec3, q: DQuat| DQuat::from_xyzw(u.x, u.y, u.z, 0.0) * q * 0.5;
            let bend = (slope(curvature(i), q0) - slope(curvature(i + 1), q1)) * (section.ds / 8.0);
            x.extend([state.x[k], middle]);
            q.extend([q0, ((q0 + q1) * 0.5 + bend).normalize()]);
            let before = match i {
                0 => 2.0 * force(0) - force(1.min(n - 1)),
                _ => force(i - 1),
            };
            let after = match i + 1 < n {
                true => force(i + 1),
                false => 2.0 * force(i) - force(i.saturating_sub(1)),
            };
            let eighth = 0.125 * (after - before);
            forces.extend([force(i) - eighth, force(i) + eighth]);
        }
        x.push(state.x[base + n]);
        q.push(state.q[base + n]);
    }
    let mut fine = State::new(2 * n, x, q);
    fine.n = forces;
    fine.tissue = (state.tissue.chunks(n + 1)).flat_map(halved).collect();
    fine
}

/// Values at nodes, and between them: cubic, at the ends quadratic.
fn halved(at: &[DVec3]) -> Vec<DVec3> {
    let n = at.len() - 1;
    let between = |i: usize| match i {
        _ if n < 3 => 0.5 * (at[i] + at[i + 1]),
        0 => 0.375 * at[0] + 0.75 * at[1] - 0.125 * at[2],
        _ if i + 1 == n => 0.375 * at[n] + 0.75 * at[n - 1] - 0.125 * at[n - 2],
        _ => 0.5625 * (at[i] + at[i + 1]) - 0.0625 * (at[i - 1] + at[i + 2]),
    };
    let pairs = (0..n).flat_map(|i| [at[i], between(i)]);
    pairs.chain([at[n]]).collect()
}

/// The state on any other grid, interpolated: positions and quaternions by polynomials through
/// nodes nearby, forces linearly between the midpoints of the segments.
pub fn transfer(leaf: &DiscreteLeaf, state: &State, grid: &Grid) -> State {
    if *grid == leaf.grid {
        return state.clone();
    }
    let n = leaf.segments();
    let stencils: Vec<Stencil> = (grid.sigma().iter())
        .map(|sigma| {
            let [value, _] = Stencil::value_and_derivative_stencils(leaf, *sigma);
            value
        })
        .collect();
    let middle = |i: usize| {
        let i = i.min(n - 1);
        leaf.grid.segment_midpoint(i)
    };
    // The segment whose middle is before a place, and the weight of the next.
    let between = |sigma: f64| {
        let before = (0..n)
            .take_while(|i| middle(*i) <= sigma)
            .count()
            .saturating_sub(1);
        let next = (before + 1).min(n - 1);
        let width = middle(next) - middle(before);
        let weight = if width > 0.0 {
            (sigma - middle(before)) / width
        } else {
            0.0
        };
        (before, next, weight.clamp(0.0, 1.0))
    };
    let places: Vec<_> = (0..grid.segments())
        .map(|i| between(grid.segment_midpoint(i)))
        .collect();
    let (mut x, mut q, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..leaf.rods() {
        let base = state.base(j);
        for stencil in &stencils {
            x.push(stencil.value(|i| state.x[base + i]));
            q.push(stencil.rotation(|i| state.q[base + i]));
        }
        for &(before, next, weight) in &places {
            let [a, b] = [before, next].map(|i| state.n[j * n + i]);
            forces.push(a.lerp(b, weight));
        }
    }
    let mut other = State::new(grid.segments(), x, q);
    other.n = forces;
    let gaps = state.tissue.chunks(n + 1);
    let nodes = gaps.flat_map(|gap| stencils.iter().map(|stencil| stencil.value(|i| gap[i])));
    other.tissue = nodes.collect();
    // The ends of veins are common to all grids.
    for j in 0..leaf.rods() {
        let (from, to) = (state.base(j), other.base(j));
        for (a, b) in [(from, to), (from + n, to + grid.segments())] {
            (other.x[b], other.q[b]) = (state.x[a], state.q[a]);
        }
    }
    other
}

/// The state on the next coarser grid: forces are means over the two halves of a segment.
pub fn restrict(fine: &State) -> State {
    let (mut x, mut q) = (Vec::new(), Vec::new());
    for j in 0..fine.rods() {
        let nodes = (0..=fine.segments()).step_by(2).map(|i| fine.base(j) + i);
        x.extend(nodes.clone().map(|k| fine.x[k]));
        q.extend(nodes.map(|k| fine.q[k]));
    }
    let mut coarse = State::new(fine.segments() / 2, x, q);
    coarse.n = fine.n.chunks(2).map(|n| 0.5 * (n[0] + n[1])).collect();
    let gaps = fine.tissue.chunks(fine.segments() + 1);
    coarse.tissue = gaps
        .flat_map(|gap| gap.iter().step_by(2))
        .copied()
        .collect();
    coarse
}

/// Largest number of nodes of a polynomial along a rod.
const NODES: usize = 7;

/// Adjacent points with their weights in a value that is interpolated between them, or in its
/// derivative.
pub(crate) struct Stencil<const MOST: usize = NODES> {
    pub first: usize,
    count: usize,
    weights: [f64; MOST],
}

impl<const MOST: usize> Stencil<MOST> {
    /// The stencil of the value at `place` among `points` equally spaced points, of which `first` is
    /// the first: through at most `MOST` of the nearest of them.
    pub fn new(first: usize, points: usize, place: f64) -> Self {
        let count = MOST.min(points);
        let centred = (place - 0.5 * (count - 1) as f64).round().max(0.0);
        let skipped = (centred as usize).min(points - count);
        let mut weights = [0.0; MOST];
        for (a, weight) in weights[..count].iter_mut().enumerate() {
            *weight = lagrange(count, a, place - skipped as f64).value;
        }
        Stencil {
            first: first + skipped,
            count,
            weights,
        }
    }

    /// The points of the stencil, with their weights.
    pub fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        (self.first..).zip(self.weights[..self.count].iter().copied())
    }

    /// The interpolated value, or its derivative.
    pub fn value(&self, at: impl Fn(usize) -> DVec3) -> DVec3 {
        self.terms().map(|(i, weight)| weight * at(i)).sum()
    }

    /// The interpolated rotation.
    pub fn rotation(&self, at: impl Fn(usize) -> DQuat) -> DQuat {
        interpolated_rotation(self.terms().map(|(i, weight)| (at(i), weight)))
    }

    /// The stencil of the value at a fraction of the length between two kinks through nodes after the first
    /// kink, at which the value jumps; `None` at a kink, and where no node is between the kinks.
    pub fn beyond_jump(leaf: &DiscreteLeaf, jump: f64, sigma: f64) -> Option<Self> {
        let (nodes, kinks) = (leaf.grid.sigma(), leaf.leaf.kinks());
        let next = kinks.iter().find(|&&kink| kink > jump + 1e-12);
        let next = next.copied().unwrap_or(1.0);
        let [low, high] = [jump, next].map(|at| nodes.partition_point(|&node| node < at - 1e-12));
        if sigma <= jump + 1e-12 || sigma > next + 1e-12 || low + 1 >= high {
            return None;
        }
        let width = nodes[low + 1] - nodes[low];
        let place = (sigma - nodes[low + 1]) / width;
        Some(Stencil::new(low + 1, high - low, place))
    }

    /// The stencils of the value at a fraction of the length, and of its derivative with sigma, of
    /// values at nodes numbered from 0; linear extrapolation beyond the ends of the rod.
    pub fn value_and_derivative_stencils(leaf: &DiscreteLeaf, sigma: f64) -> [Self; 2] {
        let (beyond, sigma) = (sigma - sigma.clamp(0.0, 1.0), sigma.clamp(0.0, 1.0));
        let nodes = leaf.grid.sigma();
        // A polynomial does not reach across a kink.
        let kinks = leaf.leaf.kinks();
        let panel = kinks.partition_point(|&kink| kink < sigma);
        let low = panel.checked_sub(1).map_or(0.0, |k| kinks[k]);
        let high = kinks.get(panel).copied().unwrap_or(1.0);
        // A node at a kink agrees with it up to rounding.
        let [low, high] = [low, high].map(|at| nodes.partition_point(|&node| node < at - 1e-12));
        let count = MOST.min(high - low + 1);
        let right = nodes.partition_point(|&node| node < sigma);
        let first = (right.saturating_sub(count / 2)).clamp(low, high + 1 - count);
        // Nodes of a panel are equally spaced.
        let width = nodes[first + 1] - nodes[first];
        let place = (sigma - nodes[first]) / width;
        let (mut weights, mut slopes) = ([0.0; MOST], [0.0; MOST]);
        for (a, (weight, slope)) in weights.iter_mut().zip(&mut slopes).take(count).enumerate() {
            let basis = lagrange(count, a, place);
            *slope = basis.slope / width;
            *weight = basis.value + beyond * *slope;
        }
        [weights, slopes].map(|weights| Stencil {
            first,
            count,
            weights,
        })
    }
}

/// A Lagrange basis polynomial at one place.
struct LagrangeBasis {
    value: f64,
    /// Derivative with respect to the place, in distances of points.
    slope: f64,
}

/// The Lagrange basis polynomial of point `a` of 0, 1, ..., `count` - 1 at `t`: the weight of the
/// value there in the polynomial through all of these points.
fn lagrange(count: usize, a: usize, t: f64) -> LagrangeBasis {
    let others = (0..count).filter(|&b| b != a);
    let one = LagrangeBasis {
        value: 1.0,
        slope: 0.0,
    };
    others.fold(one, |LagrangeBasis { value, slope }, b| {
        let apart = a as f64 - b as f64;
        let factor = (t - b as f64) / apart;
        LagrangeBasis {
            value: value * factor,
            slope: slope * factor + value / apart,
        }
    })
}

/// A place along a vein.
#[derive(Clone, Copy)]
pub struct VeinStation {
    /// The number of the vein, from 0.
    pub vein: usize,
    /// Fraction of the vein's length.
    pub sigma: f64,
}

/// The state of a vein at a station, from its dimensionless position and rotation and its stress
/// resultants n and m along the directors, in the units of the scenario: strains follow from these
/// by eqs (5) and (6).
pub fn node_state(
    leaf: &Leaf,
    at: VeinStation,
    position: DVec3,
    rotation: DQuat,
    [n, m]: [DVec3; 2],
) -> NodeState {
    let (section, scale) = (leaf.section(at.vein, at.sigma, 1.0), leaf.scale);
    let u = section.rest_curvature + m / section.couple_stiffness;
    NodeState {
        position: position * scale.length,
        rotation,
        v: section.rest_strain + section.compliance * n,
        u: u / scale.length,
        n: n * scale.force(),
        m: m * scale.moment(),
    }
}

/// The state of a vein at a station, in the units of the scenario, from dimensionless fields along
/// the lab axes.
pub fn node_state_from_fields(leaf: &Leaf, at: VeinStation, fields: &RodFields) -> NodeState {
    let &RodFields { x, q, n, m } = fields;
    node_state(leaf, at, x, q, [n, m].map(|vector| q.inverse() * vector))
}

/// The dimensionless fields, along the lab axes, of a state in the units of the scenario.
pub fn fields_from_node_state(leaf: &Leaf, node: &NodeState) -> RodFields {
    let (q, scale) = (node.rotation, leaf.scale);
    RodFields {
        x: node.position / scale.length,
        q,
        n: q * node.n / scale.force(),
        m: q * node.m / scale.moment(),
    }
}

/// Takes back the strains that a vein would have by what the tissue bears of its force and moment
/// (dimensionless).
pub fn subtract_tissue_strain(
    leaf: &Leaf,
    at: VeinStation,
    [force, moment]: [DVec3; 2],
    node: &mut NodeState,
) {
    if force != DVec3::ZERO || moment != DVec3::ZERO {
        let section = leaf.section(at.vein, at.sigma, 1.0);
        node.v -= section.compliance * force;
        node.u -= moment / (section.couple_stiffness * leaf.scale.length);
    }
}

/// All rods of a state in the units of the scenario.
pub fn rod_shapes(leaf: &DiscreteLeaf, state: &State) -> Vec<RodShape> {
    let resultants = NodalResultants::new(leaf, state);
    let rod = |j: usize| {
        let nodes = leaf.grid.sigma().iter().enumerate().map(|(i, &sigma)| {
            let (at, k) = (VeinStation { vein: j, sigma }, state.base(j) + i);
            let mut node = node_state(&leaf.leaf, at, state.x[k], state.q[k], resultants.at(j, i));
            subtract_tissue_strain(&leaf.leaf, at, resultants.of_tissue(j, i), &mut node);
            node
        });
        RodShape {
            length: leaf.leaf.length(j) * leaf.leaf.scale.length,
            nodes: nodes.collect(),
        }
    };
    (0..leaf.rods()).map(rod).collect()
}

/// The stress resultants at the nodes of a leaf in a state, along the directors, dimensionless.
pub struct NodalResultants<'l> {
    pub leaf: &'l DiscreteLeaf,
    pub state: &'l State,
    /// What the tissue bears of those of every segment; empty unless it contracts.
    tissue: Vec<ContractionResultants>,
    /// The loads of the tissue on all nodes, rod after rod; empty without tissue.
    tissue_loads: Vec<NodeLoad>,
}

impl<'l> NodalResultants<'l> {
    /// Those of a leaf in a state.
    pub fn new(leaf: &'l DiscreteLeaf, state: &'l State) -> Self {
        let tissue = leaf.contraction_resultants(state);
        NodalResultants {
            leaf,
            state,
            tissue,
            tissue_loads: leaf.tissue_loads(state),
        }
    }

    /// Those of a leaf at rest on one grid.
    pub fn on_level(level: &'l GridLevel) -> Self {
        NodalResultants::new(&level.leaf, &level.state)
    }

    /// Whether tissue bears a part of them.
    pub fn include_tissue(&self) -> bool {
        !self.tissue.is_empty()
    }

    /// The gradient of segment `i` of rod `j`, and the part of the tissue in it.
    fn segment(&self, j: usize, i: usize) -> [SegmentGradient; 2] {
        let (leaf, k) = (self.leaf, j * self.leaf.segments() + i);
        let carried = self.state.n[k];
        let own = leaf.segment(self.state, j, i, carried);
        let mut whole = own.gradient(leaf.section(j, i));
        whole.x = carried;
        let none = SegmentGradient {
            x: DVec3::ZERO,
            a: DVec3::ZERO,
            b: DVec3::ZERO,
        };
        let tissue = self.tissue.get(k).map_or(none, |it| it.gradient);
        whole.x += tissue.x;
        whole.a += tissue.a;
        whole.b += tissue.b;
        [whole, tissue]
    }

    /// Force n and couple m at node `i` of rod `j`: from the balance of the node's half-cell and the end
    /// moments of the adjoining segment, so that they have the clean ds^2 series of the positions. They
    /// include what contracting tissue bears of them.
    pub fn at(&self, j: usize, i: usize) -> [DVec3; 2] {
        let (leaf, state) = (self.leaf, self.state);
        let n = leaf.segments();
        let to_directors = state.q[state.base(j) + i].conjugate();
        let before = i.checked_sub(1).map(|i| self.segment(j, i));
        let after = (i < n).then(|| self.segment(j, i));
        // The load on the node, without what the tissue exerts as a part of the segments.
        let of_tissue = self.tissue_loads.get(state.base(j) + i).copied();
        let load = leaf.load_with_tissue(state, j, i, of_tissue.unwrap_or_default());
        let end = leaf.rigid_end_load(state, j, i);
        let follower = leaf.follower_wrench(state, j, i);
        let [ground_before, ground_after] = leaf.foundation_forces(state, j, i);
        let mut force = load.force + end.force + follower.force;
        let mut moment = load.moment + end.moment + follower.moment;
        if let Some([_, tissue]) = &before {
            (force, moment) = (force + tissue.x, moment + tissue.b);
        }
        if let Some([_, tissue]) = &after {
            (force, moment) = (force - tissue.x, moment + tissue.a);
        }
        let (force, moment) = match (before, after) {
            (None, Some([next, _])) => (next.x + force + ground_after, moment - next.a),
            (Some([before, _]), _) => {
                // The part of the nodal load that belongs to the left half-cell.
                let jump = leaf.own_load_jump_before(j, i);
                let left = leaf.grid.segment_width(i - 1);
                let right = if i < n {
                    leaf.grid.segment_width(i)
                } else {
                    0.0
                };
                force -= match i == n {
                    true => leaf.tip_force(j),
                    false => leaf.point_force_at(j, leaf.grid.sigma()[i]),
                };
                if leaf.has_levers() {
                    let q = state.q[state.base(j) + i];
                    moment -= leaf.lever_moment_at(j, leaf.grid.sigma()[i], q);
                }
                let part = left / (left + right);
                let follower = leaf.follower_jump_before(state, j, i);
                (
                    before.x - part * force - jump - follower.force - ground_before,
                    before.b - part * moment - follower.moment,
                )
            }
            (None, None) => (DVec3::ZERO, DVec3::ZERO),
        };
        [force, moment].map(|vector| to_directors * vector)
    }

    /// What the tissue bears of the force and the moment at node `i` of rod `j`: interpolated between the middles
    /// of the segments on either side, at the ends from the last two.
    pub fn of_tissue(&self, j: usize, i: usize) -> [DVec3; 2] {
        let (leaf, n) = (self.leaf, self.leaf.segments());
        let part = |i: usize| {
            let of = self.tissue.get(j * n + i);
            of.map_or([DVec3::ZERO; 2], |of| {
                [of.force, of.moment].map(|it| it.extend(0.0))
            })
        };
        if n == 1 {
            return part(0);
        }
        let before = i.saturating_sub(1).min(n - 2);
        let [from, to] = [before, before + 1].map(|i| leaf.grid.segment_midpoint(i));
        let weight = (leaf.grid.sigma()[i] - from) / (to - from);
        let [from, to] = [before, before + 1].map(part);
        [0, 1].map(|k| from[k].lerp(to[k], weight))
    }
}

/// A leaf at rest on one grid.
#[derive(Clone)]
pub struct GridLevel {
    pub leaf: DiscreteLeaf,
    pub state: State,
}

/// A state of a leaf at the nodes of a grid, from which the leaf is brought to rest there.
pub struct StateOnGrid {
    pub grid: Grid,
    pub state: State,
}

/// The level of the whole leaf from that of its half.
pub fn mirror_level(reduced: &Leaf, whole: &Leaf, level: &GridLevel) -> GridLevel {
    GridLevel {
        leaf: DiscreteLeaf::new(whole, level.leaf.grid.clone()),
        state: whole_state(reduced, &level.state),
    }
}

/// Whether all nodes lie in the plane z = 0.
pub fn is_planar_level(level: &GridLevel) -> bool {
    level.state.x.iter().all(|x| x.z == 0.0)
}

/// Positions of all rods at every `stride`-th node, dimensionless.
pub fn positions(level: &GridLevel, stride: usize) -> Vec<f64> {
    let n = level.leaf.segments();
    let nodes = |j: usize| {
        (0..=n)
            .step_by(stride)
            .map(move |i| level.state.base(j) + i)
    };
    let nodes = (0..level.leaf.rods()).flat_map(nodes);
    nodes.flat_map(|k| level.state.x[k].to_array()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights reproduce value and derivative of polynomials up to their degree.
    #[test]
    fn polynomials_are_met() {
        for count in 2..=NODES {
            let t = 0.37 * count as f64;
            for degree in 0..count as i32 {
                let term = |a: usize| {
                    let basis = lagrange(count, a, t);
                    let value = (a as f64).powi(degree);
                    (basis.value * value, basis.slope * value)
                };
                let (weights, slopes): (Vec<f64>, Vec<f64>) = (0..count).map(term).unzip();
                let slope = match degree {
                    0 => 0.0,
                    _ => f64::from(degree) * t.powi(degree - 1),
                };
                let size = (count as f64).powi(degree);
                assert!((weights.iter().sum::<f64>() - t.powi(degree)).abs() < 1e-13 * size);
                assert!((slopes.iter().sum::<f64>() - slope).abs() < 1e-12 * size);
            }
        }
    }
}
