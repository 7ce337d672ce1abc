//! The leaf at the nodes of its grids, extrapolated over them.

use crate::largest::larger;
use crate::leaf::{DiscreteLeaf, RodFields};
use crate::relax::accuracy::richardson::{Richardson, distance};
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::stencil::Stencil;
use crate::relax::transfer::strains;
use glam::{DQuat, DVec3};

/// A node's values that are extrapolated: position, quaternion, n and m along the directors.
type Node = [f64; 13];

/// Nodes of the interpolation of lower order.
const LOWER: usize = 5;

/// The leaf's fields after `columns` extrapolations at the ends of `parts` equal parts of its
/// grids, rod after rod, dimensionless.
pub fn nodes(levels: &[Level], columns: usize, parts: usize) -> Vec<Vec<RodFields>> {
    let finest = &levels[levels.len() - 1];
    let rods = 0..finest.leaf.rods();
    if columns == 0 {
        return rods.map(|j| on_grid(finest, j, parts)).collect();
    }
    let used = &levels[levels.len() - 1 - columns..];
    let rod = |j: usize| unpacked(&extrapolated(used, &rotations(finest, j), j, parts));
    rods.map(rod).collect()
}

/// The fields of a rod on one grid.
fn on_grid(level: &Level, j: usize, parts: usize) -> Vec<RodFields> {
    let Level { leaf, state } = level;
    let stride = leaf.segments() / parts;
    let node = |(i, q): (usize, DQuat)| {
        let [n, m] = strains::resultants(leaf, state, j, i).map(|vector| q * vector);
        let x = state.x[state.base(j) + i];
        RodFields { x, q, n, m }
    };
    let rotations = rotations(level, j).into_iter().enumerate();
    rotations.step_by(stride).map(node).collect()
}

/// The leaf's fields at all nodes of one of the first `wanted` grids: of the finest where the error
/// of positions exceeds that at the nodes of the coarsest, `known`, by no more than `allowed`. Also
/// returns the number of this grid, and the excess.
///
/// Nodes added by a grid have the extrapolation of the grids from there on, plus the remainder of
/// that of the coarser grids, which is small and smooth, interpolated between their nodes. The
/// error of the interpolation is estimated by the largest difference from one of lower order.
pub fn finer_nodes(
    levels: &[Level],
    columns: usize,
    wanted: usize,
    [known, allowed]: [f64; 2],
) -> (usize, Vec<Vec<RodFields>>, f64) {
    let used = levels.len() - 1 - columns;
    let finest = &levels[levels.len() - 1];
    let rods = 0..finest.leaf.rods();
    let signs: Vec<_> = rods.clone().map(|j| rotations(finest, j)).collect();
    let on = |k: usize, j: usize| {
        let segments = levels[k].leaf.segments();
        extrapolated(&levels[k.max(used)..], &signs[j], j, segments)
    };
    let mut reached: Vec<Vec<Node>> = rods.clone().map(|j| on(0, j)).collect();
    let (mut grid, mut between) = (0, 0.0);
    for k in 1..wanted {
        let mut excess = match k {
            1 => known * (layer_ratio(levels) - 1.0),
            _ => 0.0,
        };
        let mut nodes: Vec<Vec<Node>> = rods.clone().map(|j| on(k, j)).collect();
        excess += add_remainder(&mut nodes, &reached, [&levels[k - 1].leaf, &levels[k].leaf]);
        if !excess.is_finite() || between + excess > allowed {
            break;
        }
        (grid, reached, between) = (k, nodes, between + excess);
    }
    (
        grid,
        reached.iter().map(|rod| unpacked(rod)).collect(),
        between,
    )
}

/// Adds to the `nodes` of a grid what those of the `coarser` one have more, interpolated between
/// them; returns the error of that.
fn add_remainder(
    nodes: &mut [Vec<Node>],
    known: &[Vec<Node>],
    [coarser, finer]: [&DiscreteLeaf; 2],
) -> f64 {
    let stride = finer.segments() / coarser.segments();
    let stencil = |&at: &f64| {
        let [stencil, _] = <Stencil>::at(coarser, at);
        let [lower, _] = Stencil::<LOWER>::at(coarser, at);
        (stencil, lower)
    };
    let stencils: Vec<_> = finer.grid.sigma().iter().map(stencil).collect();
    let mut error = 0.0_f64;
    for (nodes, known) in nodes.iter_mut().zip(known) {
        let own = nodes.iter().step_by(stride);
        let remainder = |(a, b): (&Node, &Node)| -> Node { std::array::from_fn(|k| a[k] - b[k]) };
        let remainders: Vec<Node> = known.iter().zip(own).map(remainder).collect();
        let position = |i: usize| DVec3::from_slice(&remainders[i]);
        for (node, (stencil, lower)) in nodes.iter_mut().zip(&stencils) {
            let difference = stencil.value(position) - lower.value(position);
            error = larger(error, difference.length());
            for (i, weight) in stencil.terms() {
                (node.iter_mut().zip(&remainders[i])).for_each(|(sum, it)| *sum += weight * it);
            }
        }
    }
    error
}

/// Ratio of the largest changes of positions by the last grid at the nodes of the grid before and
/// at those of the first: errors may be larger by it, as with a boundary layer between the nodes
/// of the first grid.
fn layer_ratio(levels: &[Level]) -> f64 {
    let [first, .., before, finest] = levels else {
        return 1.0;
    };
    let change = |stride| distance(&positions(before, stride), &positions(finest, 2 * stride));
    ratio(
        change(1),
        change(before.leaf.segments() / first.leaf.segments()),
    )
}

/// Ratio of a change to another, which is a part of it; one if there is no change.
fn ratio(change: f64, part: f64) -> f64 {
    match change == 0.0 {
        true => 1.0,
        false => change / part,
    }
}

/// The values of a rod extrapolated over `levels` at the ends of so many parts; its quaternions on
/// the finest grid are `signs`.
fn extrapolated(levels: &[Level], signs: &[DQuat], j: usize, parts: usize) -> Vec<Node> {
    let on = |Level { leaf, state }: &Level| {
        let stride = leaf.segments() / parts;
        let node = |i: usize| -> Node {
            let k = state.base(j) + i * stride;
            let [n, m] = strains::resultants(leaf, state, j, i * stride);
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

/// The fields with these values.
fn unpacked(rod: &[Node]) -> Vec<RodFields> {
    let fields = |node: &Node| {
        let vector = |k: usize| DVec3::from_slice(&node[k..]);
        let q = DQuat::from_slice(&node[3..]).normalize();
        RodFields {
            x: vector(0),
            q,
            n: q * vector(7),
            m: q * vector(10),
        }
    };
    rod.iter().map(fields).collect()
}

/// Quaternions of rod `j` at all nodes, continuous in sign.
fn rotations(level: &Level, j: usize) -> Vec<DQuat> {
    let base = level.state.base(j);
    let mut before = level.state.q[base];
    let same = |q: &DQuat| {
        before = with_sign_of(*q, before);
        before
    };
    let rotations = level.state.q[base..=base + level.leaf.segments()].iter();
    rotations.map(same).collect()
}

/// Of q and -q the one nearer to `other`.
pub fn with_sign_of(q: DQuat, other: DQuat) -> DQuat {
    if q.dot(other) < 0.0 { -q } else { q }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_between_nodes_that_do_not_move_is_no_small_one() {
        assert_eq!(ratio(3e-9, 1e-9), 3.0);
        assert_eq!(ratio(3e-9, 0.0), f64::INFINITY);
        assert_eq!(ratio(0.0, 0.0), 1.0);
    }
}
