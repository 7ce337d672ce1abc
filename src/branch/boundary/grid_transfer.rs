//! Points of a boundary carried over to the grid with all segments halved, or with every second
//! node: initial guesses for the point there.

use crate::branch::boundary::point_search::{
    TwoParameterDirection, TwoParameterEquations, TwoParameterProblem, TwoParameterState,
};
use crate::branch::boundary::singular_point::SingularPoint;
use crate::branch::equations::CorrectorFailure;
use crate::branch::points::{prolong_field, restrict_field};
use crate::leaf::{Grid, NodalField, State};
use crate::relax::accuracy::transfer::{prolong, restrict};

/// A point of a boundary and the grid of its state.
pub struct GridBoundaryPoint<P> {
    pub grid: Grid,
    pub point: P,
}

/// Segments of the coarsest grid to which a point of a boundary is transferred.
const COARSEST_BOUNDARY_GRID: usize = 8;

/// A point of a boundary with the equations on its grid.
pub struct FinerBoundaryPoint<'a> {
    pub manifold: TwoParameterEquations<'a>,
    pub point: SingularPoint,
}

/// Initial guess for a boundary point on the grid with all segments halved, with its
/// directions.
pub fn boundary_point_on_finer<'a>(
    manifold: &mut TwoParameterEquations<'a>,
    point: &SingularPoint,
) -> Result<FinerBoundaryPoint<'a>, CorrectorFailure> {
    let state = prolong(
        manifold.leaves.leaf_at(point.solution.params)?,
        &point.solution.state,
    );
    let finer = manifold.refined();
    let point = transferred(point, state, |field| {
        prolong_field(field, manifold.first_node())
    });
    let point = SingularPoint {
        tangent: finer.normalize_direction(point.tangent),
        normal: finer.normalize_direction(point.normal),
        ..point
    };
    Ok(FinerBoundaryPoint {
        manifold: finer,
        point,
    })
}

/// Initial guess for the point on the grid with every second node.
pub fn boundary_point_on_coarser(
    plane: &TwoParameterProblem,
    grid: &Grid,
    point: &SingularPoint,
) -> Option<GridBoundaryPoint<SingularPoint>> {
    let coarse = coarser_grid(plane, grid)?;
    let first = usize::from(!plane.first_leaf().hinged());
    let state = restrict(&point.solution.state);
    let point = transferred(point, state, |field| restrict_field(field, first));
    Some(GridBoundaryPoint {
        grid: coarse,
        point,
    })
}

/// The point on the grid of this state, to which `field` transfers increments.
fn transferred(
    point: &SingularPoint,
    state: State,
    field: impl Fn(&NodalField) -> NodalField,
) -> SingularPoint {
    let direction = |it: &TwoParameterDirection| TwoParameterDirection {
        increments: field(&it.increments),
        params: it.params,
    };
    SingularPoint {
        solution: TwoParameterState {
            state,
            ..point.solution
        },
        border_modes: point.border_modes.iter().map(&field).collect(),
        tangent: direction(&point.tangent),
        normal: direction(&point.normal),
        ..point.clone()
    }
}

/// The grid with every second node; none if that would be too coarse, or if `grid` is not its
/// refinement.
pub fn coarser_grid(plane: &TwoParameterProblem, grid: &Grid) -> Option<Grid> {
    let half = grid.segments() / 2;
    if half < COARSEST_BOUNDARY_GRID || 2 * half != grid.segments() {
        return None;
    }
    let coarse = coarsened(grid, half, plane.first_leaf().kinks());
    (coarse.refined() == *grid).then_some(coarse)
}

/// The grid of so many segments that this one refines.
pub fn coarsened(grid: &Grid, segments: usize, kinks: &[f64]) -> Grid {
    let stations = grid.sigma().iter().copied();
    let stations: Vec<f64> = stations.step_by(grid.segments() / segments).collect();
    Grid::from_stations(&stations, kinks)
}
