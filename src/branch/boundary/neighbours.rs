//! Leaves on either side of a stability boundary.

use std::ops::RangeInclusive;

use super::grids::state_on_coarser;
use super::manifold::{Direction, Manifold, Plane, Solution};
use super::table::Verified;
use crate::branch::events::critical::Kind;
use crate::branch::problem::field::every_second;
use crate::leaf::{Grid, State};
use crate::limit::Limit;
use crate::relax::settle::settle_from::settle_from;

/// Distances from the boundary at which they are sought, in this order: arclengths on the
/// solution manifold, or fractions of the ranges.
const AWAY: [f64; 5] = [0.1, 0.05, 0.02, 0.01, 0.005];

/// The finest grid used for pictures, in segments.
const FINEST_DRAWN: usize = 64;

/// A leaf next to a boundary.
pub struct Neighbour {
    pub solution: Solution,
    pub index: usize,
    /// If it is where the leaf of the other, stable side comes to rest beyond the boundary, the
    /// initial state of that fall: the unstable equilibrium at a branch point, or the fold.
    pub fallen_from: Option<State>,
}

/// The leaves on both sides of a point of a boundary with this tangent `along` it in the
/// parameter plane: equilibria, the one of smaller index first. If that is stable, the other is
/// where it comes to rest beyond the boundary. None if one of them is not found.
pub fn beside(plane: &Plane, point: &Verified, along: [f64; 2]) -> Option<[Neighbour; 2]> {
    let (grid, point) = &for_pictures(plane, point);
    let [a, b] = point.indices;
    let (fewer, more) = (a.min(b), a.max(b));
    let at = |away: f64, indices: RangeInclusive<usize>| {
        on_sheet(plane, grid, point, along, (away, &indices))
    };
    let low = AWAY.iter().find_map(|away| at(-away, fewer..=fewer))?;
    let high = match (fewer, point.kind) {
        (0, Kind::Branching) => {
            // Another boundary may be close: take the equilibrium of least index.
            let found = AWAY.iter().filter_map(|away| at(*away, more..=usize::MAX));
            at_rest(plane, grid, found.min_by_key(|found| found.index)?.solution)?
        }
        (0, Kind::Fold) => at_rest(plane, grid, beyond(point, &low.solution, along)?)?,
        _ => AWAY.iter().find_map(|away| at(*away, more..=more))?,
    };
    Some([low, high])
}

/// The point on the coarsest grid that pictures allow.
fn for_pictures(plane: &Plane, point: &Verified) -> (Grid, Verified) {
    let mut grid = Grid::through(&point.stations, plane.first().kinks());
    let mut point = point.clone();
    while grid.segments() > FINEST_DRAWN
        && let Some((coarse, state)) = state_on_coarser(plane, &grid, &point.state)
    {
        point.across.increments = every_second(
            &point.across.increments,
            usize::from(!plane.first().hinged()),
        );
        (grid, point.state) = (coarse, state);
    }
    (grid, point)
}

/// The equilibrium at a distance across the boundary, if its index is one of these.
fn on_sheet(
    plane: &Plane,
    grid: &Grid,
    point: &Verified,
    along: [f64; 2],
    (away, indices): (f64, &RangeInclusive<usize>),
) -> Option<Neighbour> {
    let mut manifold = Manifold::new(plane, grid.clone());
    let along = Direction {
        params: along,
        ..manifold.unit_parameter(0)
    };
    let start = Solution {
        state: point.state.clone(),
        params: point.params,
    };
    let start = manifold.beside(&start, &point.across, away).ok()?;
    let rates = manifold.rates(&start, false).ok()?;
    let normals = [&along, &point.across];
    let found = manifold.bordered(start, normals, &[], Some(&rates), false);
    let found = found.ok()?;
    let index = found.solved.negative;
    (indices.contains(&index) && inside(found.solution.params)).then_some(Neighbour {
        solution: found.solution,
        index,
        fallen_from: None,
    })
}

/// Initial state beyond a fold, where no equilibrium is near: the leaf at the fold, with
/// parameters on the side of the boundary opposite to the stable one.
fn beyond(point: &Verified, stable: &Solution, along: [f64; 2]) -> Option<Solution> {
    let normal = [-along[1], along[0]];
    let off: f64 = (0..2)
        .map(|i| (stable.params[i] - point.params[i]) * normal[i])
        .sum();
    let length = along[0].hypot(along[1]).copysign(-off);
    let mut away = AWAY.iter().map(|away| away / length);
    let params = away.find_map(|away| {
        let params = [0, 1].map(|i| point.params[i] + away * normal[i]);
        inside(params).then_some(params)
    })?;
    Some(Solution {
        state: point.state.clone(),
        params,
    })
}

/// The equilibrium to which a leaf relaxes.
fn at_rest(plane: &Plane, grid: &Grid, from: Solution) -> Option<Neighbour> {
    let leaf = plane.leaf(from.params).ok()?;
    let state = settle_from(&leaf, grid, from.state.clone(), &Limit::default())?;
    Some(Neighbour {
        solution: Solution {
            state,
            params: from.params,
        },
        index: 0,
        fallen_from: Some(from.state),
    })
}

fn inside(params: [f64; 2]) -> bool {
    params.iter().all(|part| (0.0..=1.0).contains(part))
}
