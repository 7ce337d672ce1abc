//! Leaves on either side of a boundary.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::grids::{every_second, state_on_coarser};
use super::plane::Plane;
use super::search::Lost;
use super::sheet::{Direction, Sheet, Spot};
use super::table::Verified;
use crate::branch::critical::Kind;
use crate::leaf::{Grid, Leaf, State};
use crate::limit::Limit;
use crate::relax::fall::settle_from;

/// How far from the boundary they are sought, in turn: in lengths on the sheet, or parts of
/// the ranges.
const AWAY: [f64; 5] = [0.1, 0.05, 0.02, 0.01, 0.005];

/// The finest grid that pictures need, in segments.
const FINEST: usize = 64;

/// A leaf beside a boundary.
pub struct Beside {
    pub spot: Spot,
    /// Its Morse index.
    pub index: usize,
    /// Where it began to fall, if it is what the leaf of the other, stable side comes to rest
    /// as: at the equilibrium beyond a branch point, or at the fold.
    pub fallen_from: Option<State>,
}

/// The leaves on both sides of a point of a boundary that goes `along` this way in the plane:
/// equilibria on the sheet, that with the smaller index first. If this is stable the other is
/// what it comes to rest as beyond. None if one of them is not found.
pub fn beside(plane: Plane, point: &Verified, along: [f64; 2]) -> Option<[Beside; 2]> {
    let (grid, point) = &for_pictures(plane, point);
    let [a, b] = point.indices;
    let (fewer, more) = (a.min(b), a.max(b));
    let at = |away: f64, indices: RangeInclusive<usize>| {
        on_sheet(plane, grid, point, along, (away, &indices))
    };
    let low = AWAY.iter().find_map(|away| at(-away, fewer..=fewer))?;
    let high = match (fewer, point.kind) {
        (0, Kind::Branching) => {
            // Another boundary may be close behind this one: across as few as can be.
            let found = AWAY.iter().filter_map(|away| at(*away, more..=usize::MAX));
            at_rest(plane, grid, found.min_by_key(|found| found.index)?.spot)?
        }
        (0, Kind::Fold) => at_rest(plane, grid, beyond(point, &low.spot, along)?)?,
        _ => AWAY.iter().find_map(|away| at(*away, more..=more))?,
    };
    Some([low, high])
}

/// The point on a grid that is as coarse as pictures allow.
fn for_pictures(plane: Plane, point: &Verified) -> (Grid, Verified) {
    let mut grid = Grid::through(&point.stations, plane.family.first().kinks());
    let mut point = point.clone();
    while grid.segments() > FINEST
        && let Some((coarse, state)) = state_on_coarser(plane, &grid, &point.state)
    {
        point.across.increments = every_second(&point.across.increments);
        (grid, point.state) = (coarse, state);
    }
    (grid, point)
}

/// The equilibrium so far from a point across the boundary, if it has one of these indices.
fn on_sheet(
    plane: Plane,
    grid: &Grid,
    point: &Verified,
    along: [f64; 2],
    (away, indices): (f64, &RangeInclusive<usize>),
) -> Option<Beside> {
    let found = || -> Result<Beside, Lost> {
        let mut sheet = Sheet::new(plane, grid.clone())?;
        let along = Direction {
            place: along,
            ..sheet.number(0)
        };
        let start = Spot {
            state: point.state.clone(),
            place: point.place,
        };
        let start = sheet.beside(&start, &point.across, away)?;
        let rates = sheet.rates(&start)?;
        let sample = sheet.settle(&start, [&along, &point.across], &[], &rates)?;
        Ok(Beside {
            spot: sample.spot,
            index: sample.solved.negative,
            fallen_from: None,
        })
    };
    let found = found().ok()?;
    (indices.contains(&found.index) && inside(found.spot.place)).then_some(found)
}

/// A fold's leaf where there is none near: on the other side of the boundary than the stable
/// one.
fn beyond(point: &Verified, stable: &Spot, along: [f64; 2]) -> Option<Spot> {
    let normal = [-along[1], along[0]];
    let off: f64 = (0..2)
        .map(|i| (stable.place[i] - point.place[i]) * normal[i])
        .sum();
    let length = along[0].hypot(along[1]).copysign(-off);
    let mut away = AWAY.iter().map(|away| away / length);
    let place = away.find_map(|away| {
        let place = [0, 1].map(|i| point.place[i] + away * normal[i]);
        inside(place).then_some(place)
    })?;
    Some(Spot {
        state: point.state.clone(),
        place,
    })
}

/// Where a leaf comes to rest.
fn at_rest(plane: Plane, grid: &Grid, from: Spot) -> Option<Beside> {
    let scenario = Arc::new(plane.scenario(from.place).ok()?);
    let leaf = Leaf::in_units(scenario, plane.family.scale());
    let state = settle_from(&leaf, grid, from.state.clone(), &Limit::default())?;
    Some(Beside {
        spot: Spot {
            state,
            place: from.place,
        },
        index: 0,
        fallen_from: Some(from.state),
    })
}

fn inside(place: [f64; 2]) -> bool {
    place.iter().all(|part| (0.0..=1.0).contains(part))
}
