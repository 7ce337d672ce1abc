//! The leaf at the nodes of its grids, extrapolated over them.

use crate::leaf::RodFields;
use crate::relax::level::Level;
use crate::relax::richardson::Richardson;
use crate::relax::shape;
use crate::relax::stencil::Stencil;
use glam::{DQuat, DVec3};

/// A node's values that are extrapolated: position, quaternion, n and m along the directors.
pub type Node = [f64; 13];

/// Nodes of the interpolation of lower order.
const LOWER: usize = 5;

/// The leaf's fields after `columns` extrapolations at the ends of `parts` equal parts of its
/// grids, rod after rod, dimensionless.
pub fn nodes(levels: &[Level], columns: usize, parts: usize) -> Vec<Vec<RodFields>> {
    let finest = &levels[levels.len() - 1];
    if columns == 0 {
        let rods = 0..finest.leaf.rods();
        return rods.map(|j| on_grid(finest, j, parts)).collect();
    }
    let fields = |node: &Node| {
        let (x, q, resultants) = unpacked(node);
        let [n, m] = resultants.map(|vector| q * vector);
        RodFields { x, q, n, m }
    };
    let rods = values(levels, columns, parts);
    let rods = rods.iter().map(|rod| rod.iter().map(fields).collect());
    rods.collect()
}

/// The same as the values that are extrapolated.
pub fn values(levels: &[Level], columns: usize, parts: usize) -> Vec<Vec<Node>> {
    let finest = &levels[levels.len() - 1];
    let used = &levels[levels.len() - 1 - columns..];
    let rod = |j: usize| extrapolated(used, &rotations(finest, j), j, parts);
    (0..finest.leaf.rods()).map(rod).collect()
}

/// The fields of a rod on one grid.
fn on_grid(level: &Level, j: usize, parts: usize) -> Vec<RodFields> {
    let Level { leaf, state } = level;
    let stride = leaf.segments() / parts;
    let node = |(i, q): (usize, DQuat)| {
        let [n, m] = shape::resultants(leaf, state, j, i).map(|vector| q * vector);
        let x = state.x[state.base(j) + i];
        RodFields { x, q, n, m }
    };
    let rotations = rotations(level, j).into_iter().enumerate();
    rotations.step_by(stride).map(node).collect()
}

/// The same at all nodes of the finest grid. Nodes added by a grid have the extrapolation of the
/// grids from there on, plus the remainder of that of the coarser grids, which is small and
/// smooth, interpolated between their nodes. Also returns an estimate of the error of positions by
/// this interpolation: the largest difference from one of lower order, summed over the grids.
pub fn every_node(levels: &[Level], columns: usize) -> (Vec<Vec<Node>>, f64) {
    let used = levels.len() - 1 - columns;
    let finest = &levels[levels.len() - 1];
    let signs: Vec<_> = (0..finest.leaf.rods())
        .map(|j| rotations(finest, j))
        .collect();
    let on = |first: usize, j: usize, level: &Level| {
        let levels = &levels[first.max(used)..];
        extrapolated(levels, &signs[j], j, level.leaf.segments())
    };
    let rods = 0..signs.len();
    let mut rods: Vec<Vec<Node>> = rods.map(|j| on(0, j, &levels[0])).collect();
    let mut error = 0.0;
    for (k, level) in levels.iter().enumerate().skip(1) {
        let coarser = &levels[k - 1].leaf;
        let stencil = |&at: &f64| {
            let ([stencil, _], [lower, _]) = (
                <Stencil>::at(coarser, at),
                Stencil::<LOWER>::at(coarser, at),
            );
            (stencil, lower)
        };
        let stencils: Vec<_> = level.leaf.grid.sigma().iter().map(stencil).collect();
        let mut largest = 0.0_f64;
        for (j, known) in rods.iter_mut().enumerate() {
            let mut nodes = on(k, j, level);
            let own = nodes
                .iter()
                .step_by(level.leaf.segments() / coarser.segments());
            let change = |(a, b): (&Node, &Node)| -> Node { std::array::from_fn(|k| a[k] - b[k]) };
            let changes: Vec<Node> = known.iter().zip(own).map(change).collect();
            let position = |i: usize| DVec3::from_slice(&changes[i]);
            for (node, (stencil, lower)) in nodes.iter_mut().zip(&stencils) {
                let difference = stencil.value(position) - lower.value(position);
                largest = largest.max(difference.length());
                for (i, weight) in stencil.terms() {
                    (node.iter_mut().zip(&changes[i])).for_each(|(sum, it)| *sum += weight * it);
                }
            }
            *known = nodes;
        }
        error += largest;
    }
    (rods, error)
}

/// The values of a rod extrapolated over `levels` at the ends of so many parts; its quaternions on
/// the finest grid are `signs`.
fn extrapolated(levels: &[Level], signs: &[DQuat], j: usize, parts: usize) -> Vec<Node> {
    let on = |Level { leaf, state }: &Level| {
        let stride = leaf.segments() / parts;
        let node = |i: usize| -> Node {
            let k = state.base(j) + i * stride;
            let [n, m] = shape::resultants(leaf, state, j, i * stride);
            // q and -q are the same rotation: all grids must use the same sign.
            let q = with_sign_of(state.q[k], signs[i * ((signs.len() - 1) / parts)]);
            let x = state.x[k];
            [
                x.x, x.y, x.z, q.x, q.y, q.z, q.w, n.x, n.y, n.z, m.x, m.y, m.z,
            ]
        };
        (leaf.segments(), (0..=parts).flat_map(node).collect())
    };
    let table: Richardson = levels.iter().map(on).collect();
    table.column(levels.len() - 1).as_chunks().0.to_vec()
}

/// The same as position, rotation, and force and moment along the directors.
pub fn unpacked(node: &Node) -> (DVec3, DQuat, [DVec3; 2]) {
    let vector = |k: usize| DVec3::from_slice(&node[k..]);
    let q = DQuat::from_slice(&node[3..]).normalize();
    (vector(0), q, [vector(7), vector(10)])
}

/// Quaternions of rod `j` at all nodes, continuous in sign.
fn rotations(level: &Level, j: usize) -> Vec<DQuat> {
    let base = level.state.base(j);
    continuous(&level.state.q[base..=base + level.leaf.segments()])
}

/// The same rotations by quaternions that are continuous in sign.
pub fn continuous(rotations: &[DQuat]) -> Vec<DQuat> {
    let mut before = rotations[0];
    let same = |q: &DQuat| {
        before = with_sign_of(*q, before);
        before
    };
    rotations.iter().map(same).collect()
}

/// Of q and -q the one nearer to `other`.
pub fn with_sign_of(q: DQuat, other: DQuat) -> DQuat {
    if q.dot(other) < 0.0 { -q } else { q }
}
