//! The fields of a leaf between the nodes of its grids: extrapolated over these grids at common nodes,
//! and by integration of the equilibrium equations between two stations where they are known.

use crate::leaf::{DiscreteLeaf, RodFields, RodIntegrator, StationFields};
use crate::numbers::larger;
use crate::relax::accuracy::richardson::{Richardson, distance};
use crate::relax::accuracy::transfer::{GridLevel, NodalResultants, Stencil, positions};
use crate::rotation::align_quaternion_sign;
use glam::{DQuat, DVec3};

/// A node's values that are extrapolated: position, quaternion, n and m along the directors.
type PackedNode = [f64; 13];

/// The first of these values, of position and rotation.
const POSE_VALUES: usize = 7;

/// Nodes of the interpolation of lower order, whose distance from the usual one is taken for the error
/// of both.
const LOWER_ORDER_NODES: usize = 5;

/// The leaf's fields after `columns` extrapolations at the ends of `parts` equal parts of its
/// grids, rod after rod, dimensionless.
pub fn extrapolated_node_fields(
    levels: &[GridLevel],
    columns: usize,
    parts: usize,
) -> Vec<Vec<RodFields>> {
    let finest = &levels[levels.len() - 1];
    let rods = 0..finest.leaf.rods();
    let used = &levels[levels.len() - 1 - columns..];
    let used: Vec<_> = used.iter().map(NodalResultants::on_level).collect();
    if columns == 0 {
        return rods.map(|j| on_grid(&used[0], finest, j, parts)).collect();
    }
    let rod = |j: usize| unpack_nodes(&extrapolated(&used, &rotations(finest, j), j, parts));
    rods.map(rod).collect()
}

/// The fields of rod `j` on one grid, at the ends of equal parts.
fn on_grid(
    resultants: &NodalResultants,
    level: &GridLevel,
    j: usize,
    parts: usize,
) -> Vec<RodFields> {
    let GridLevel { leaf, state } = level;
    let stride = leaf.segments() / parts;
    let node = |(i, q): (usize, DQuat)| {
        let [n, m] = resultants.at(j, i).map(|vector| q * vector);
        let x = state.x[state.base(j) + i];
        RodFields { x, q, n, m }
    };
    let rotations = rotations(level, j).into_iter().enumerate();
    rotations.step_by(stride).map(node).collect()
}

/// A leaf at all nodes of one of its grids.
pub struct FieldsAtNodes {
    /// The number of the grid, from the coarsest.
    pub grid: usize,
    /// The fields, rod after rod, dimensionless.
    pub rods: Vec<Vec<RodFields>>,
    /// By how much the error of positions exceeds that at the nodes of the coarsest grid.
    pub added_error: f64,
}

/// The leaf's fields at all nodes of one of the first `wanted` grids: of the finest where the error
/// of positions exceeds that at the nodes of the coarsest, `known`, by no more than `allowed`.
///
/// Nodes added by a grid have the extrapolation of the grids from there on, plus the remainder of
/// that of the coarser grids, which is small and smooth, interpolated between their nodes. The
/// error of the interpolation is estimated by the largest difference from one of lower order.
pub fn finer_nodes(
    levels: &[GridLevel],
    columns: usize,
    wanted: usize,
    known: f64,
    allowed: f64,
) -> FieldsAtNodes {
    let used = levels.len() - 1 - columns;
    let finest = &levels[levels.len() - 1];
    let rods = 0..finest.leaf.rods();
    let signs: Vec<_> = rods.clone().map(|j| rotations(finest, j)).collect();
    let resultants: Vec<_> = levels[used..]
        .iter()
        .map(NodalResultants::on_level)
        .collect();
    let on = |k: usize, j: usize| {
        let segments = levels[k].leaf.segments();
        extrapolated(
            &resultants[k.saturating_sub(used)..],
            &signs[j],
            j,
            segments,
        )
    };
    let mut reached: Vec<Vec<PackedNode>> = rods.clone().map(|j| on(0, j)).collect();
    let (mut grid, mut between) = (0, 0.0);
    for k in 1..wanted {
        let mut excess = match k {
            1 => known * (layer_ratio(levels) - 1.0),
            _ => 0.0,
        };
        let mut nodes: Vec<Vec<PackedNode>> = rods.clone().map(|j| on(k, j)).collect();
        excess += add_remainder(&mut nodes, &reached, [&levels[k - 1].leaf, &levels[k].leaf]);
        if !excess.is_finite() || between + excess > allowed {
            break;
        }
        (grid, reached, between) = (k, nodes, between + excess);
    }
    FieldsAtNodes {
        grid,
        rods: reached.iter().map(|rod| unpack_nodes(rod)).collect(),
        added_error: between,
    }
}

/// Adds to the `nodes` of a grid what those of the `coarser` one have more, interpolated between
/// them; returns the error of that.
fn add_remainder(
    nodes: &mut [Vec<PackedNode>],
    known: &[Vec<PackedNode>],
    [coarser, finer]: [&DiscreteLeaf; 2],
) -> f64 {
    let stride = finer.segments() / coarser.segments();
    let stencil = |&at: &f64| {
        let [stencil, _] = <Stencil>::value_and_derivative_stencils(coarser, at);
        let [lower, _] = Stencil::<LOWER_ORDER_NODES>::value_and_derivative_stencils(coarser, at);
        (stencil, lower)
    };
    let stencils: Vec<_> = finer.grid.sigma().iter().map(stencil).collect();
    let mut error = 0.0_f64;
    for (j, (nodes, known)) in nodes.iter_mut().zip(known).enumerate() {
        let beyond = stencils_beyond_grips(j, [coarser, finer]);
        let own = nodes.iter().step_by(stride);
        let remainder = |(a, b): (&PackedNode, &PackedNode)| -> PackedNode {
            std::array::from_fn(|k| a[k] - b[k])
        };
        let remainders: Vec<PackedNode> = known.iter().zip(own).map(remainder).collect();
        let position = |i: usize| DVec3::from_slice(&remainders[i]);
        for (k, (node, (stencil, lower))) in nodes.iter_mut().zip(&stencils).enumerate() {
            let difference = stencil.value(position) - lower.value(position);
            error = larger(error, difference.length());
            let (pose, resultants) = node.split_at_mut(POSE_VALUES);
            for (i, weight) in stencil.terms() {
                (pose.iter_mut().zip(&remainders[i])).for_each(|(sum, it)| *sum += weight * it);
            }
            let beyond = beyond.get(k).and_then(Option::as_ref);
            for (i, weight) in beyond.unwrap_or(stencil).terms() {
                let remainder = &remainders[i][POSE_VALUES..];
                (resultants.iter_mut().zip(remainder)).for_each(|(sum, it)| *sum += weight * it);
            }
        }
    }
    error
}

/// The interpolation of the stress resultants of rod `j` from the nodes of a coarser grid to those of a
/// finer one where it differs from that of positions: beyond grips, at whose last nodes resultants jump and those
/// before the jump are known. Empty for a rod without grips.
fn stencils_beyond_grips(j: usize, [coarser, finer]: [&DiscreteLeaf; 2]) -> Vec<Option<Stencil>> {
    let grips = coarser.leaf.scenario().grips.iter();
    let ends: Vec<f64> = grips
        .filter(|grip| grip.vein == j)
        .map(|grip| grip.at[1])
        .collect();
    if ends.is_empty() {
        return Vec::new();
    }
    let stencil = |&sigma: &f64| {
        let mut beyond = ends
            .iter()
            .map(|end| Stencil::beyond_jump(coarser, *end, sigma));
        beyond.find_map(|stencil| stencil)
    };
    finer.grid.sigma().iter().map(stencil).collect()
}

/// Ratio of the largest changes of positions by the last grid at the nodes of the grid before and
/// at those of the first: errors may be larger by it, as with a boundary layer between the nodes
/// of the first grid.
fn layer_ratio(levels: &[GridLevel]) -> f64 {
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
fn extrapolated(
    levels: &[NodalResultants],
    signs: &[DQuat],
    j: usize,
    parts: usize,
) -> Vec<PackedNode> {
    let on = |resultants: &NodalResultants| {
        let (leaf, state) = (resultants.leaf, resultants.state);
        let stride = leaf.segments() / parts;
        let node = |i: usize| -> PackedNode {
            let k = state.base(j) + i * stride;
            let [n, m] = resultants.at(j, i * stride);
            // q and -q are the same rotation: all grids must use the same sign.
            let q = align_quaternion_sign(state.q[k], signs[i * ((signs.len() - 1) / parts)]);
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

/// The fields of a rod whose nodes have these values.
fn unpack_nodes(rod: &[PackedNode]) -> Vec<RodFields> {
    let fields = |node: &PackedNode| {
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
fn rotations(level: &GridLevel, j: usize) -> Vec<DQuat> {
    let base = level.state.base(j);
    let mut before = level.state.q[base];
    let same = |q: &DQuat| {
        before = align_quaternion_sign(*q, before);
        before
    };
    let rotations = level.state.q[base..=base + level.leaf.segments()].iter();
    rotations.map(same).collect()
}

/// Longest step of the integration between stations, as a fraction of the length. Half of it doubles
/// the work for stations between those of the solution.
const LONGEST_STEP: f64 = 1.0 / 64.0;

/// Safety factor on the error between stations.
const SAFETY: f64 = 2.0;

/// The fields of all rods at one fraction of their lengths.
pub type LeafSection = Vec<RodFields>;

/// A station at which a leaf is known.
#[derive(Clone, Copy)]
pub struct KnownSection<'s> {
    pub sigma: f64,
    pub section: &'s LeafSection,
}

/// At which of two stations the stress resultants of a vein between them are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownResultants {
    /// At both.
    Both,
    /// At the second: a grip holds the first, where they jump, and those before it are known.
    AtSecond,
    /// At none: a grip holds the vein all along.
    Nowhere,
}

/// A leaf at points between two stations.
pub struct SectionsBetween {
    pub sections: Vec<LeafSection>,
    /// The error of the positions of every vein in addition to those at the stations.
    pub added_errors: Vec<f64>,
}

/// A leaf at rest at `points` between two stations: the mean of what is integrated from
/// either side, with weights that fall linearly to zero at the other. `None` where positions
/// integrated from one station miss the other by more than the distance of the two.
///
/// Let a and b be the vectors by which the two miss. Errors that grow linearly from either
/// station have a + b = 0 if the mean is free of them; otherwise its error is at most |a + b|/4. What is
/// integrated from the second station alone has an error of at most |b|.
pub fn integrate_between_stations(
    flow: &mut RodIntegrator,
    kinks: &[f64],
    ends: [KnownSection; 2],
    points: &[f64],
    known: impl Fn(usize) -> KnownResultants,
) -> Option<SectionsBetween> {
    let [from, to] = ends.map(|end| end.sigma);
    let [begin, end] = ends.map(|end| end.section);
    let forward = points.iter().copied().chain([to]);
    let mut before = integrate_from_section(flow, kinks, ends[0], forward);
    let backward = points.iter().rev().copied().chain([from]);
    let mut behind = integrate_from_section(flow, kinks, ends[1], backward);
    let (there, here) = (before.pop()?, behind.pop()?);
    let mut added_errors = vec![0.0; begin.len()];
    for (j, added) in added_errors.iter_mut().enumerate() {
        let (a, b) = (there[j].x - end[j].x, here[j].x - begin[j].x);
        // Also where the integration yields no numbers.
        let near = |miss: DVec3| miss.is_finite() && miss.length() <= to - from;
        let (known, error) = match known(j) {
            KnownResultants::Both => (near(a) && near(b), 0.25 * (a + b).length()),
            KnownResultants::AtSecond => (near(b), b.length()),
            KnownResultants::Nowhere => (true, 0.0),
        };
        if !known {
            return None;
        }
        *added = SAFETY * error;
    }
    behind.reverse();
    let sections = before.iter().zip(&behind).zip(points);
    let sections = sections.map(|((a, b), at)| {
        let weight = (at - from) / (to - from);
        let weight = |j: usize| match known(j) {
            KnownResultants::AtSecond => 1.0,
            KnownResultants::Both | KnownResultants::Nowhere => weight,
        };
        weighted_mean_section([a, b], weight)
    });
    Some(SectionsBetween {
        sections: sections.collect(),
        added_errors,
    })
}

/// The mean of two sections, the second with this weight in each vein.
fn weighted_mean_section([a, b]: [&LeafSection; 2], weight: impl Fn(usize) -> f64) -> LeafSection {
    let rod = |(j, (a, b)): (usize, (&RodFields, &RodFields))| RodFields {
        x: a.x.lerp(b.x, weight(j)),
        q: a.q.lerp(b.q, weight(j)),
        n: a.n.lerp(b.n, weight(j)),
        m: a.m.lerp(b.m, weight(j)),
    };
    a.iter().zip(b).enumerate().map(rod).collect()
}

/// A kink that is closer to a station than this, as a fraction of the length, is there: nodes of grids are within rounding
/// of kinks. A load on a point jumps there once, and not at the station and at the kink.
const KINK_ROUNDING: f64 = 1e-12;

/// The sections at `points`, one after the other, integrated from one section; no step reaches
/// across a kink.
fn integrate_from_section(
    flow: &mut RodIntegrator,
    kinks: &[f64],
    begin: KnownSection,
    points: impl Iterator<Item = f64>,
) -> Vec<LeafSection> {
    let (mut at, mut section) = (begin.sigma, begin.section.clone());
    let mut integrate_to = |point: f64| {
        let inside = |kink: &&f64| {
            let apart = [at, point].map(|end| **kink - end);
            apart[0] * apart[1] < 0.0 && apart.iter().all(|it| it.abs() > KINK_ROUNDING)
        };
        let mut stops: Vec<f64> = kinks.iter().filter(inside).copied().collect();
        if point < at {
            stops.reverse();
        }
        for stop in stops.into_iter().chain([point]) {
            let steps = ((stop - at).abs() / LONGEST_STEP).ceil().max(1.0);
            let mut after = vec![StationFields::default(); steps as usize];
            flow.integrate(|j| section[j], [at, stop], &mut after);
            if let Some(last) = after.last() {
                section = (0..section.len()).map(|j| last.rod(j)).collect();
            }
            at = stop;
        }
        section.clone()
    };
    points.map(&mut integrate_to).collect()
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
