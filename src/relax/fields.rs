//! The fields along the veins, extrapolated over the grids.

use crate::leaf::{Grid, Leaf, RodFields};
use crate::relax::defect::Estimate;
use crate::relax::level::Level;
use crate::relax::nodes::{Node, RodNodes, components, unpacked, with_sign_of};
use crate::relax::place::{ErrorMeasures, Place, Values};
use crate::relax::shape;
use crate::shape::RodShape;
use glam::DVec3;

/// In an end interval, the error of the polynomial is this part of the leave-one-out error at
/// a known node, if the difference is smooth: the ratio of the products of distances, 14.8 to
/// 120.
const AT_ENDS: f64 = 0.125;

/// Segments of the coarsest grid from which on its nodes are enough stations.
const STATIONS: usize = 8;

/// A leaf at the stations of one of its grids, in the scenario's units.
pub struct Fields {
    pub stations: Vec<f64>,
    pub rods: Vec<RodShape>,
    /// Error of the positions in addition to that at the coarsest grid's nodes, dimensionless.
    pub between: f64,
}

/// All nodal fields after `columns` extrapolations, at the nodes of the coarsest grid or, if
/// these are few and there is a finer one, of the next; if every node is requested, of the
/// finest. If the leaf was `integrated` to the tolerance (with that error) the fields are those
/// of the integration, for a corrected leaf at every node of its grid. Otherwise they are returned only at nodes
/// that satisfy the tolerance as those of the coarsest grid do, which have the given `error`:
/// nodes of the coarsest grid have the whole extrapolation, nodes added by a finer grid have
/// that of the grids from there on, plus the interpolated remainder of the coarser grids'
/// correction, which is small and smooth.
pub fn fields(
    levels: &[&Level],
    columns: usize,
    (error, tolerance): (Option<f64>, f64),
    every_node: bool,
    integrated: Option<(&Estimate, f64)>,
) -> Fields {
    let (first, finest) = (levels[0], levels[levels.len() - 1]);
    let few = first.leaf.segments() < STATIONS;
    let wanted = match every_node {
        true => finest,
        false => levels[usize::from(few && levels.len() > 1)],
    };
    let known_error = error.unwrap_or(0.0);
    let leaf = &first.leaf.leaf;
    if let Some((estimate, error)) = integrated {
        let between = (error - known_error).max(0.0);
        let first = &first.leaf.grid;
        let wanted = match every_node {
            true => estimate.grid.clone(),
            false if few && estimate.grid != *first => first.refined(),
            false => first.clone(),
        };
        return Fields::new(leaf, &wanted, &sampled(estimate, &wanted, finest), between);
    }
    let used = &levels[levels.len() - 1 - columns..];
    let rods = 0..first.leaf.rods();
    let mut known_nodes: Vec<_> = rods.map(|j| RodNodes::new(used, finest, j)).collect();
    let mut on = |grid: &Level| -> Vec<Vec<Node>> {
        let rods = known_nodes.iter_mut();
        rods.map(|rod| rod.extrapolated(grid.leaf.segments()))
            .collect()
    };
    let (mut reported, mut nodes) = (first, on(first));
    let mut between = 0.0;
    for &finer in levels {
        let coarse = reported.leaf.segments();
        let segments = finer.leaf.segments();
        if segments <= coarse || segments > wanted.leaf.segments() {
            continue;
        }
        let stride = segments / coarse;
        let known = reported.leaf.grid.sigma();
        let place = |at: f64| Place::new(known, leaf.kinks(), at);
        let weights = |(k, at): (usize, &f64)| match k.is_multiple_of(stride) {
            // The node belongs to the coarser grid.
            true => Values::new(),
            false => place(*at).lagrange(),
        };
        let weights = finer.leaf.grid.sigma().iter().enumerate().map(weights);
        let weights: Vec<_> = weights.collect();
        let others = known.iter().map(|at| place(*at));
        let others: Vec<_> = others
            .map(|place| (place.first, place.leave_one_out()))
            .collect();
        let mut added = on(finer);
        let mut error = 0.0_f64;
        for (added, nodes) in added.iter_mut().zip(&nodes) {
            error = error.max(correct(added, nodes, stride, &weights, &others));
        }
        let error = match coarse == first.leaf.segments() {
            true => error + known_error * (layer_ratio(levels) - 1.0),
            false => error,
        };
        if known_error <= tolerance && known_error + between + error > tolerance {
            break;
        }
        (reported, nodes, between) = (finer, added, between + error);
    }
    Fields::new(leaf, &reported.leaf.grid, &nodes, between)
}

impl Fields {
    /// Those at the nodes of a grid.
    fn new(leaf: &Leaf, grid: &Grid, nodes: &[Vec<Node>], between: f64) -> Self {
        let rods = nodes.iter().enumerate().map(|(j, nodes)| {
            let stations = nodes.iter().zip(grid.sigma());
            RodShape {
                length: leaf.length(j) * leaf.scale.length,
                nodes: stations
                    .map(|(values, sigma)| {
                        let (x, q, resultants) = unpacked(values);
                        shape::node(leaf, (j, *sigma), (x, q), resultants)
                    })
                    .collect(),
            }
        });
        Fields {
            stations: grid.sigma().to_vec(),
            rods: rods.collect(),
            between,
        }
    }
}

/// The integrated leaf at the requested nodes; quaternions have the signs of the `finest` grid.
fn sampled(estimate: &Estimate, wanted: &Grid, finest: &Level) -> Vec<Vec<Node>> {
    let stride = estimate.grid.segments() / wanted.segments();
    let rod = |(j, rod): (usize, &Vec<RodFields>)| {
        let mut sign = finest.state.q[finest.state.base(j)];
        let node = |node: &RodFields| {
            sign = with_sign_of(node.q, sign);
            let (n, m) = (sign.inverse() * node.n, sign.inverse() * node.m);
            components(node.x, sign, n, m)
        };
        rod.iter().step_by(stride).map(node).collect()
    };
    estimate.rods.iter().enumerate().map(rod).collect()
}

/// Ratio, at least one, of the largest changes of positions by the last grid at the other
/// nodes of the grid before and at the nodes of the first: errors may be larger by it, as with
/// a boundary layer between the nodes of the first grid.
fn layer_ratio(levels: &[&Level]) -> f64 {
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

/// Sets every `stride`th node of a finer grid to `known`, and adds the interpolated difference
/// between these. Returns an error estimate of the positions: the leave-one-out error of the
/// difference at known nodes, whose neighbours are further apart.
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
    let interpolated = |weights: &Values| -> DVec3 { weights.iter().map(term).sum() };
    let mut errors = ErrorMeasures::new(known.len());
    for (correction, (first, others)) in corrections.iter().zip(others) {
        let off = |weights: &Values| (interpolated(weights) - position(correction)).length();
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
