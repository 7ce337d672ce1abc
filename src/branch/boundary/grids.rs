//! Transfer of boundary points to finer and coarser grids.

use super::manifold::{Direction, Manifold, Solution};
use super::plane::Plane;
use super::search::NotFound;
use super::singular_point::SingularPoint;
use crate::branch::field::prolong as prolong_field;
use crate::leaf::{Field, Grid, State};
use crate::relax::prolong::prolong;

/// Segments of the coarsest.
const COARSEST: usize = 8;

/// Initial guess for a boundary point on the grid with all segments halved, with its
/// directions.
pub fn on_finer<'a>(
    manifold: &mut Manifold<'a>,
    point: &SingularPoint,
) -> Result<(Manifold<'a>, SingularPoint), NotFound> {
    let state = prolong(manifold.leaf(point.solution.params)?, &point.solution.state);
    let finer = manifold.refined()?;
    let direction = |it: &Direction| {
        finer.normalised(Direction {
            increments: prolong_field(&it.increments),
            params: it.params,
        })
    };
    let point = SingularPoint {
        solution: Solution {
            state,
            ..point.solution
        },
        soft: point.soft.iter().map(prolong_field).collect(),
        tangent: direction(&point.tangent),
        normal: direction(&point.normal),
        ..point.clone()
    };
    Ok((finer, point))
}

/// Initial guess for the point on the grid with every second node.
pub fn on_coarser(
    plane: Plane,
    grid: &Grid,
    point: &SingularPoint,
) -> Option<(Grid, SingularPoint)> {
    let (coarse, state) = state_on_coarser(plane, grid, &point.solution.state)?;
    let direction = |it: &Direction| Direction {
        increments: every_second(&it.increments),
        params: it.params,
    };
    let point = SingularPoint {
        solution: Solution {
            state,
            ..point.solution
        },
        soft: point.soft.iter().map(every_second).collect(),
        tangent: direction(&point.tangent),
        normal: direction(&point.normal),
        ..point.clone()
    };
    Some((coarse, point))
}

/// A state on the grid with every second node; none if that would be too coarse, or if `grid` is
/// not its refinement.
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
