//! Points of a boundary taken to finer grids and to coarser ones.

use super::place::Place;
use super::plane::Plane;
use super::search::Lost;
use super::sheet::{Direction, Sheet, Spot};
use crate::branch::field::prolong as prolong_field;
use crate::leaf::{Field, Grid, State};
use crate::relax::prolong::prolong;

/// Segments of the coarsest.
const COARSEST: usize = 8;

/// A point of the same kind on the grid with all segments halved: where it would be, with
/// its directions.
pub fn on_finer<'a>(sheet: &mut Sheet<'a>, place: &Place) -> Result<(Sheet<'a>, Place), Lost> {
    let state = prolong(sheet.leaf(place.spot.place)?, &place.spot.state);
    let finer = sheet.refined()?;
    let direction = |it: &Direction| {
        finer.normalised(Direction {
            increments: prolong_field(&it.increments),
            place: it.place,
        })
    };
    let place = Place {
        spot: Spot {
            state,
            ..place.spot
        },
        held: place.held.iter().map(prolong_field).collect(),
        tangent: direction(&place.tangent),
        normal: direction(&place.normal),
        ..place.clone()
    };
    Ok((finer, place))
}

/// The point on the grid with every second node: where it would be.
pub fn on_coarser(plane: Plane, grid: &Grid, place: &Place) -> Option<(Grid, Place)> {
    let (coarse, state) = state_on_coarser(plane, grid, &place.spot.state)?;
    let direction = |it: &Direction| Direction {
        increments: every_second(&it.increments),
        place: it.place,
    };
    let place = Place {
        spot: Spot {
            state,
            ..place.spot
        },
        held: place.held.iter().map(every_second).collect(),
        tangent: direction(&place.tangent),
        normal: direction(&place.normal),
        ..place.clone()
    };
    Some((coarse, place))
}

/// A state on the grid with every second node; none if this would be too coarse, or not the
/// one of which `grid` is the next finer.
pub fn state_on_coarser(plane: Plane, grid: &Grid, state: &State) -> Option<(Grid, State)> {
    let stations: Vec<f64> = grid.sigma().iter().copied().step_by(2).collect();
    let coarse = Grid::through(&stations, plane.family.first().kinks());
    let (n, rods) = (state.segments(), state.rods());
    if n % 2 != 0 || n / 2 < COARSEST || coarse.refined() != *grid {
        return None;
    }
    let nodes = (0..rods).flat_map(|j| (0..=n).step_by(2).map(move |i| state.base(j) + i));
    let (x, q) = nodes.map(|k| (state.x[k], state.q[k])).unzip();
    let mut fewer = State::new(n / 2, x, q);
    fewer.n = state
        .n
        .chunks(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .collect();
    Some((coarse, fewer))
}

/// A field at every second node.
pub fn every_second(field: &Field) -> Field {
    let rods = field.iter();
    rods.map(|rod| rod.iter().copied().skip(1).step_by(2).collect())
        .collect()
}
