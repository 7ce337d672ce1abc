//! The fields along the veins, extrapolated over the grids.

use crate::leaf::{DiscreteLeaf, RodFields};
use crate::relax::level::Level;
use crate::relax::place::{Measures, Place, Values};
use crate::relax::richardson::Richardson;
use crate::relax::shape;
use crate::shape::{NodeState, RodShape};
use glam::{DQuat, DVec3};

/// Values carried per node through the extrapolation: position, quaternion, n, m.
const FIELDS: usize = 13;

type Node = [f64; FIELDS];

/// In the interval at an end, the error of the polynomial is this part of that at a
/// known node without its own value, if the difference is smooth: the ratio of the
/// products of distances, 14.8 to 120.
const AT_ENDS: f64 = 0.125;

/// Segments of the coarsest grid whose nodes are stations enough.
const STATIONS: usize = 8;

/// A leaf at the stations of one of its grids, in the scenario's units.
pub struct Fields {
    pub stations: Vec<f64>,
    pub rods: Vec<RodShape>,
    /// What positions may be wrong by beside the error at the coarsest grid's
    /// nodes, dimensionless.
    pub between: f64,
}

/// All nodal fields with `columns` extrapolations, at the nodes of the coarsest grid,
/// or if these are few of the next; if every node is asked for of the finest that
/// keeps the tolerance as those of the coarsest do, which have that `error`.
///
/// Nodes of the coarsest grid have the whole extrapolation. Those that a finer
/// grid adds have that of the grids from there on, and the rest of the coarser
/// ones' correction, which is small and smooth, interpolated.
pub fn fields(
    levels: &[&Level],
    columns: usize,
    error: Option<f64>,
    tolerance: f64,
    every_node: bool,
) -> Fields {
    let (first, finest) = (levels[0], levels[levels.len() - 1]);
    let leaf = &first.leaf.leaf;
    let used = &levels[levels.len() - 1 - columns..];
    let rods = 0..first.leaf.rods();
    let mut known_nodes: Vec<_> = (rods.clone())
        .map(|j| RodNodes::new(used, finest, j))
        .collect();
    let mut on = |grid: &Level| -> Vec<Vec<Node>> {
        let rods = known_nodes.iter_mut();
        rods.map(|rod| rod.extrapolated(grid.leaf.segments()))
            .collect()
    };
    let (mut reported, mut nodes, mut between) = (first, on(first), 0.0);
    let known_error = error.unwrap_or(0.0);
    let most = match every_node {
        true => levels.len(),
        false => 1 + usize::from(first.leaf.segments() < STATIONS),
    };
    for &finer in levels.iter().take(most).skip(1) {
        let coarse = reported.leaf.segments();
        if !finer.leaf.segments().is_multiple_of(coarse) {
            continue;
        }
        let stride = finer.leaf.segments() / coarse;
        let known = reported.leaf.grid.sigma();
        let place = |at: f64| Place::new(known, leaf.kinks(), at);
        let weights = |(k, at): (usize, &f64)| match k.is_multiple_of(stride) {
            // That node is known.
            true => Values::new(),
            false => place(*at).lagrange(),
        };
        let weights = finer.leaf.grid.sigma().iter().enumerate().map(weights);
        let weights: Vec<_> = weights.collect();
        let others = known.iter().map(|at| place(*at));
        let others: Vec<_> = others.map(|place| (place.first, place.others())).collect();
        let mut added = on(finer);
        let mut error = 0.0_f64;
        for (added, nodes) in added.iter_mut().zip(&nodes) {
            error = error.max(correct(added, nodes, stride, &weights, &others));
        }
        let error = match reported.leaf.segments() == first.leaf.segments() {
            true => error + known_error * (hidden(levels) - 1.0),
            false => error,
        };
        if known_error <= tolerance && known_error + between + error > tolerance {
            break;
        }
        (reported, nodes, between) = (finer, added, between + error);
    }
    let rods = nodes.iter().enumerate().map(|(j, nodes)| {
        let node = |(i, values)| unpack(&reported.leaf, j, i, values);
        RodShape {
            length: leaf.length(j) * leaf.scale.length,
            nodes: nodes.iter().enumerate().map(node).collect(),
        }
    });
    Fields {
        stations: reported.leaf.grid.sigma().to_vec(),
        rods: rods.collect(),
        between,
    }
}

/// What the leaf is, with `columns` extrapolations, at the nodes of the coarsest grid, rod
/// after rod, dimensionless.
pub fn nodes(levels: &[Level], columns: usize) -> Vec<Vec<RodFields>> {
    let (first, finest) = (&levels[0], &levels[levels.len() - 1]);
    let used: Vec<&Level> = levels[levels.len() - 1 - columns..].iter().collect();
    let node = |values: &Node| {
        let vector = |k: usize| DVec3::from_slice(&values[k..]);
        let q = DQuat::from_slice(&values[3..]).normalize();
        RodFields {
            x: vector(0),
            q,
            n: q * vector(7),
            m: q * vector(10),
        }
    };
    let rod = |j: usize| {
        let nodes = RodNodes::new(&used, finest, j).extrapolated(first.leaf.segments());
        nodes.iter().map(node).collect()
    };
    (0..first.leaf.rods()).map(rod).collect()
}

/// How many times more the last grid changed the positions at the nodes of the one
/// before than at those of the first: as much more may be wrong there, as it is where
/// a boundary layer hides between the nodes of the first.
fn hidden(levels: &[&Level]) -> f64 {
    let (first, finest) = (levels[0], levels[levels.len() - 1]);
    let n = finest.leaf.segments();
    let before = levels.iter().rev().skip(1);
    let Some(before) = before
        .into_iter()
        .find(|it| n.is_multiple_of(it.leaf.segments()))
    else {
        return 1.0;
    };
    let count = before.leaf.segments();
    let (stride, coarse) = (n / count, count / first.leaf.segments());
    let mut most = [0.0_f64; 2];
    for j in 0..finest.leaf.rods() {
        for i in 0..=count {
            let x = before.state.x[before.state.base(j) + i];
            let change = (finest.state.x[finest.state.base(j) + i * stride] - x).length();
            let known = i.is_multiple_of(coarse);
            most[usize::from(known)] = most[usize::from(known)].max(change);
        }
    }
    match most {
        [between, known] if known > 0.0 => (between / known).max(1.0),
        _ => 1.0,
    }
}

/// The nodes of a rod on several grids, each computed when it is first asked for: those
/// that grids have in common are asked for again and again.
struct RodNodes<'l> {
    rod: usize,
    /// Rotations on the finest grid, of a continuous sign.
    signs: Vec<DQuat>,
    levels: Vec<(&'l Level, Vec<Option<Node>>)>,
}

impl<'l> RodNodes<'l> {
    fn new(levels: &[&'l Level], finest: &Level, rod: usize) -> Self {
        let none = |level: &&'l Level| (*level, vec![None; level.leaf.segments() + 1]);
        RodNodes {
            rod,
            signs: rotations(finest, rod),
            levels: levels.iter().map(none).collect(),
        }
    }

    /// The fields at the ends of `n` parts, from those grids that have them.
    fn extrapolated(&mut self, n: usize) -> Vec<Node> {
        let (rod, signs) = (self.rod, &self.signs);
        let mut table = Richardson::default();
        let mut count = 0;
        for (level, known) in &mut self.levels {
            let segments = level.leaf.segments();
            if !segments.is_multiple_of(n) {
                continue;
            }
            let stride = segments / n;
            let values = (0..=n).flat_map(|i| {
                *known[i * stride].get_or_insert_with(|| {
                    let node = shape::node(&level.leaf, &level.state, rod, i * stride);
                    pack(&node, signs[i * ((signs.len() - 1) / n)])
                })
            });
            table.push(segments, values.collect());
            count += 1;
        }
        table.column(count - 1).as_chunks().0.to_vec()
    }
}

/// Puts `known` at every `stride`th node of a finer grid, and between these the
/// difference interpolated. Returns how much that may be wrong by in the positions: as
/// much as the difference at a known node is from what its neighbours say, which lie
/// further apart.
fn correct(
    nodes: &mut [Node],
    known: &[Node],
    stride: usize,
    weights: &[Values],
    others: &[(usize, [Values; 2])],
) -> f64 {
    let own = nodes.iter().step_by(stride);
    let corrections: Vec<Node> = known.iter().zip(own).map(|(a, b)| minus(a, b)).collect();
    let position = |node: &Node| DVec3::from_slice(node);
    let term = |&(i, weight): &(usize, f64)| weight * position(&corrections[i]);
    let told = |weights: &Values| -> DVec3 { weights.iter().map(term).sum() };
    let mut errors = Measures::new(known.len());
    for (correction, (first, others)) in corrections.iter().zip(others) {
        let off = |weights: &Values| (told(weights) - position(correction)).length();
        errors.add(*first, others.each_ref().map(off));
    }
    for (k, (node, weights)) in nodes.iter_mut().zip(weights).enumerate() {
        if k.is_multiple_of(stride) {
            *node = known[k / stride];
            continue;
        }
        for &(i, weight) in weights {
            for (value, correction) in node.iter_mut().zip(&corrections[i]) {
                *value += weight * correction;
            }
        }
    }
    errors.error(AT_ENDS)
}

fn minus(a: &Node, b: &Node) -> Node {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Rotations of rod `j` at all nodes, of a continuous sign.
fn rotations(level: &Level, j: usize) -> Vec<DQuat> {
    let base = level.state.base(j);
    let mut rotations: Vec<DQuat> = Vec::new();
    for &q in &level.state.q[base..=base + level.leaf.segments()] {
        rotations.push(alike(q, rotations.last().copied().unwrap_or(q)));
    }
    rotations
}

fn pack(node: &NodeState, reference: DQuat) -> Node {
    // A rotation's two quaternions must not be mixed up between grids.
    let q = alike(node.rotation, reference);
    let (x, n, m) = (node.position, node.n, node.m);
    [
        x.x, x.y, x.z, q.x, q.y, q.z, q.w, n.x, n.y, n.z, m.x, m.y, m.z,
    ]
}

/// That quaternion of a rotation which is nearer to another.
fn alike(q: DQuat, other: DQuat) -> DQuat {
    if q.dot(other) < 0.0 { -q } else { q }
}

fn unpack(leaf: &DiscreteLeaf, j: usize, i: usize, values: &Node) -> NodeState {
    let vector = |k: usize| DVec3::new(values[k], values[k + 1], values[k + 2]);
    let mut node = NodeState {
        position: vector(0),
        rotation: DQuat::from_xyzw(values[3], values[4], values[5], values[6]).normalize(),
        v: DVec3::X,
        u: DVec3::ZERO,
        n: vector(7),
        m: vector(10),
    };
    shape::strains(leaf, j, leaf.grid.sigma()[i], &mut node);
    let scale = leaf.leaf.scale;
    node.position *= scale.length;
    node.u /= scale.length;
    node.n *= scale.force();
    node.m *= scale.moment();
    node
}
