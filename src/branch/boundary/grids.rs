//! Transfer of boundary points to finer and coarser grids.

use super::manifold::{Direction, Manifold, Plane, Solution};
use super::singular_point::SingularPoint;
use crate::branch::problem::equations::Stuck;
use crate::branch::problem::field::{every_second, prolong_field};
use crate::leaf::{Field, Grid, State};
use crate::relax::transfer::prolong::{prolong, restrict};

/// Segments of the coarsest.
const COARSEST: usize = 8;

/// Initial guess for a boundary point on the grid with all segments halved, with its
/// directions.
pub fn manifold_on_finer<'a>(
    manifold: &mut Manifold<'a>,
    point: &SingularPoint,
) -> Result<(Manifold<'a>, SingularPoint), Stuck> {
    let state = prolong(
        manifold.leaves.at(point.solution.params)?,
        &point.solution.state,
    );
    let finer = manifold.refined();
    let point = transferred(point, state, |field| {
        prolong_field(field, manifold.first_node())
    });
    let point = SingularPoint {
        tangent: finer.normalised(point.tangent),
        normal: finer.normalised(point.normal),
        ..point
    };
    Ok((finer, point))
}

/// Initial guess for the point on the grid with every second node.
pub fn manifold_on_coarser(
    plane: &Plane,
    grid: &Grid,
    point: &SingularPoint,
) -> Option<(Grid, SingularPoint)> {
    let (coarse, state) = state_on_coarser(plane, grid, &point.solution.state)?;
    let first = usize::from(!plane.first().hinged());
    let point = transferred(point, state, |field| every_second(field, first));
    Some((coarse, point))
}

/// The point on the grid of this state, to which `field` transfers increments.
fn transferred(
    point: &SingularPoint,
    state: State,
    field: impl Fn(&Field) -> Field,
) -> SingularPoint {
    let direction = |it: &Direction| Direction {
        increments: field(&it.increments),
        params: it.params,
    };
    SingularPoint {
        solution: Solution {
            state,
            ..point.solution
        },
        soft: point.soft.iter().map(&field).collect(),
        tangent: direction(&point.tangent),
        normal: direction(&point.normal),
        ..point.clone()
    }
}

/// A state on the grid with every second node; none if that would be too coarse, or if `grid` is
/// not its refinement.
pub fn state_on_coarser(plane: &Plane, grid: &Grid, state: &State) -> Option<(Grid, State)> {
    let half = state.segments() / 2;
    if half < COARSEST || 2 * half != state.segments() {
        return None;
    }
    let coarse = coarsened(grid, half, plane.first().kinks());
    (coarse.refined() == *grid).then(|| (coarse, restrict(state)))
}

/// The grid of so many segments that this one refines.
pub fn coarsened(grid: &Grid, segments: usize, kinks: &[f64]) -> Grid {
    let stations = grid.sigma().iter().copied();
    let stations: Vec<f64> = stations.step_by(grid.segments() / segments).collect();
    Grid::through(&stations, kinks)
}
