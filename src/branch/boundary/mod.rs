//! The boundary of stability as a curve: a critical point of a branch along one parameter,
//! continued in a second one.
//!
//! Equilibria of leaves that differ in two parameters l = (l1, l2) form a two-dimensional
//! manifold g(z, l) = 0. On it, the matrix K is singular along curves. With K bordered by soft
//! modes, as in [`crate::branch`], an eigenvalue h of H is zero there: the minimally augmented
//! equations of such a curve are
//!
//! ```text
//! g(z, l) = 0,   h(z, l) = 0
//! ```
//!
//! with the state and both parameters as unknowns (Govaerts, Numerical Methods for
//! Bifurcations of Dynamical Equilibria, 2000, chapters 3 to 5). The curve is followed by
//! arclength. The tangent plane of the manifold is spanned by two directions, one along the
//! curve, one across it, in which h changes: a step predicts along the first, and a secant
//! method along the second, with Newton's method back to the manifold, finds the zero of h.
//! Folds of the curve in either parameter are no obstacle.
//!
//! At branch points due to symmetry, K has a null vector that is not a tangent of the manifold
//! followed: that is the one of the symmetric branch. Several modes that become neutral
//! together are followed by the mean of their eigenvalues, as long as these coincide.
//!
//! A curve of folds turns back at a cusp; where a further eigenvalue vanishes, two curves
//! cross. Both are located along the curve, and verified as every point is: on finer and
//! finer grids, at the same value of the second parameter (of the first, where the curve goes
//! along that; in the same plane across the curve, where it goes along neither), and
//! extrapolated.
//!
//! This file has what surrounds a boundary: equilibria at points of the parameter plane, each
//! continued along a straight path from another, and leaves on either side of a boundary, for
//! pictures.

mod codimension_two;
mod continuation;
mod point_search;
mod refine;
mod singular_point;

pub use crate::branch::boundary::codimension_two::CodimensionTwoKind;
pub use crate::branch::boundary::continuation::{
    BoundaryContinuationOptions, ContinuedBoundary, follow_boundary,
};
pub(crate) use crate::branch::boundary::point_search::TwoParameterDirection;
use crate::branch::boundary::point_search::TwoParameterEquations;
pub use crate::branch::boundary::point_search::{TwoParameterProblem, TwoParameterState};
pub use crate::branch::boundary::refine::{BoundaryAccuracy, VerifiedBoundaryPoint};
pub use crate::branch::boundary::singular_point::{BoundarySeed, coarsened};
use crate::branch::boundary::singular_point::{GridBoundaryPoint, coarser_grid};
use crate::branch::continuation::{BranchEnd, CRITICAL_GRIDS, ContinuationOptions, follow_branch};
use crate::branch::convergence::{ExtrapolatedPoint, VerificationFailure};
use crate::branch::critical::{CriticalKind, CriticalPoint};
use crate::branch::equations::BranchEquations;
use crate::branch::points::{EquilibriumPoint, restrict_field};
use crate::branch::refine::{confirmed_index, on_finer, refine_critical};
use crate::leaf::{Grid, State};
use crate::relax::accuracy::transfer::restrict;
use crate::relax::solve_on_grid::relax_from_state;
use crate::run::Limit;
use crate::scenario::Scenario;
use glam::DVec3;
use std::ops::RangeInclusive;

/// The longest step on a path, as a part of it, and the largest number of points.
const LONGEST_PATH_STEP: f64 = 1.0;

const MAX_PATH_POINTS: usize = 100;

/// The finest grid for repeating a path, in segments.
const FINEST_PATH_GRID: usize = 1024;

/// Segments of the coarsest grid for counting an index again.
const COARSEST_INDEX_GRID: usize = 256;

/// An equilibrium at a point of the parameter plane.
#[derive(Clone, Debug)]
pub struct ConfirmedEquilibrium {
    /// State and parameters on a grid, and that grid.
    pub solution: TwoParameterState,
    pub grid: Grid,
    /// Morse index, on which three grids in a row agree.
    pub index: usize,
}

/// What was found on the straight path from an equilibrium to another point of the plane.
pub struct ParameterPath {
    /// The grid on which it was followed.
    pub grid: Grid,
    /// Tips of all rods along it, in the family's units.
    pub tips: Vec<Vec<DVec3>>,
    /// Its critical points on that grid; the parameter goes from 0 to 1 along the path.
    pub critical: Vec<CriticalPoint>,
    /// Whether the branch turns back before the end of the path.
    turned: bool,
    /// The equilibrium at the end; none if the branch turns back before, or is lost.
    pub end: Option<ConfirmedEquilibrium>,
    pub factorizations: usize,
}

/// The scenarios on the straight path between two points of the plane.
type PathScenarios<'p> = dyn Fn([f64; 1]) -> Result<Scenario, String> + Sync + 'p;

fn scenarios_on_path<'p>(
    plane: &'p TwoParameterProblem,
    [from, to]: [[f64; 2]; 2],
) -> Box<PathScenarios<'p>> {
    Box::new(move |[part]: [f64; 1]| {
        let at = |i: usize| match part {
            1.0 => to[i],
            _ => from[i] + part * (to[i] - from[i]),
        };
        plane.scenario([at(0), at(1)]).map_err(|out| out.0)
    })
}

/// Follows the branch through an equilibrium along the straight path to another point of the
/// plane, by arclength, unless it turns back. The equilibrium at the end is accepted if three
/// finer grids in a row have it with the same index. If they do not, or this is not the index
/// on the grid of the path, that grid is too coarse, and a finer one is tried.
pub fn follow_path(
    plane: &TwoParameterProblem,
    from: &ConfirmedEquilibrium,
    to: [f64; 2],
) -> ParameterPath {
    let make = scenarios_on_path(plane, [from.solution.params, to]);
    let family = plane.along_path(&*make);
    let mut path = ParameterPath {
        grid: from.grid.clone(),
        tips: Vec::new(),
        critical: Vec::new(),
        turned: false,
        end: None,
        factorizations: 0,
    };
    let Ok(family) = family else { return path };
    let mut equations = BranchEquations::new(&family, from.grid.clone());
    let Ok(mut first) = equations.correct(&from.solution.state, 0.0, None) else {
        return path;
    };
    loop {
        let last = follow_on_grid(&mut equations, &first, &mut path);
        let index = last
            .as_ref()
            .and_then(|it| confirmed_index(&mut equations, it).ok());
        let finer = 2 * first.state.segments() <= FINEST_PATH_GRID;
        if let (Some(last), Some(index)) = (last, index)
            && (index == last.index || !finer)
        {
            path.end = Some(ConfirmedEquilibrium {
                solution: TwoParameterState {
                    state: last.state,
                    params: to,
                },
                grid: equations.grid().clone(),
                index,
            });
            return path;
        }
        match on_finer(&mut equations, &first) {
            Ok(on_finer) if finer && !path.turned => (equations, first) = on_finer,
            _ => return path,
        }
    }
}

/// The index of an equilibrium counted again, on fine grids alone; none if they do not have
/// it, or do not agree.
pub fn recount_index(plane: &TwoParameterProblem, at: &ConfirmedEquilibrium) -> Option<usize> {
    let make = scenarios_on_path(plane, [at.solution.params; 2]);
    let family = plane.along_path(&*make).ok()?;
    let mut equations = BranchEquations::new(&family, at.grid.clone());
    let mut point = equations.correct(&at.solution.state, 0.0, None).ok()?;
    while point.state.segments() < COARSEST_INDEX_GRID {
        (equations, point) = on_finer(&mut equations, &point).ok()?;
    }
    confirmed_index(&mut equations, &point).ok()
}

/// The point at the end of the path on this grid, if the branch reaches it.
fn follow_on_grid(
    equations: &mut BranchEquations,
    first: &EquilibriumPoint,
    path: &mut ParameterPath,
) -> Option<EquilibriumPoint> {
    let mut first = first.clone();
    first.tangent = first.tangent.towards_larger_parameter();
    let turned = |points: &[EquilibriumPoint]| points[points.len() - 1].tangent.params[0] < 0.0;
    let how = ContinuationOptions {
        stop_criterion: Some(&turned),
        ..ContinuationOptions::new(LONGEST_PATH_STEP, MAX_PATH_POINTS)
    };
    let before = equations.factorizations;
    let branch = follow_branch(equations, first, &how, &mut |_, _| {});
    path.factorizations += equations.factorizations - before;
    path.grid.clone_from(equations.grid());
    let tips = |point: &EquilibriumPoint| point.state.tips().collect();
    path.tips = branch.points.iter().map(tips).collect();
    path.critical = branch.critical.into_iter().map(|(_, it)| it).collect();
    path.turned = matches!(
        branch.end,
        Some(BranchEnd::StopCriterionMet | BranchEnd::RangeStartReached)
    );
    match branch.end {
        Some(BranchEnd::RangeEndReached) if branch.unlocated_index_changes.is_empty() => {
            branch.points.last().cloned()
        }
        _ => None,
    }
}

/// A critical point on the path between two points of the plane, extrapolated over grids.
pub fn refine_on_path(
    plane: &TwoParameterProblem,
    ends: [[f64; 2]; 2],
    grid: &Grid,
    critical: &CriticalPoint,
    accuracy: f64,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    let make = scenarios_on_path(plane, ends);
    let family = plane.along_path(&*make)?;
    refine_critical(&family, grid, critical, accuracy, CRITICAL_GRIDS)
}

/// Distances from the boundary at which neighboring leaves are sought, in this order: arclengths
/// on the solution manifold, or fractions of the ranges.
const NEIGHBOUR_DISTANCES: [f64; 5] = [0.1, 0.05, 0.02, 0.01, 0.005];

/// The finest grid used for pictures, in segments.
const FINEST_PICTURE_GRID: usize = 64;

/// An equilibrium next to a boundary of stability, for a picture.
pub struct BoundaryNeighbour {
    pub solution: TwoParameterState,
    pub index: usize,
    /// The initial state of the fall, where this is the equilibrium to which the leaf of the other,
    /// stable side falls beyond the boundary: the unstable equilibrium at a branch point, or the
    /// fold.
    pub fallen_from: Option<State>,
}

/// The leaves on both sides of a point of a boundary with this tangent `along` it in the
/// parameter plane: equilibria, the one of smaller index first. If that is stable, the other is
/// where it comes to rest beyond the boundary. None if one of them is not found.
pub fn leaves_beside_boundary(
    plane: &TwoParameterProblem,
    point: &VerifiedBoundaryPoint,
    along: [f64; 2],
) -> Option<[BoundaryNeighbour; 2]> {
    let GridBoundaryPoint { grid, point } = &point_on_picture_grid(plane, point);
    let [a, b] = point.indices;
    let (fewer, more) = (a.min(b), a.max(b));
    let at = |away: f64, indices: RangeInclusive<usize>| {
        equilibrium_across_boundary(plane, grid, point, along, away)
            .filter(|found| indices.contains(&found.index))
    };
    let low = NEIGHBOUR_DISTANCES
        .iter()
        .find_map(|away| at(-away, fewer..=fewer))?;
    let high = match (fewer, point.kind) {
        (0, CriticalKind::Branching) => {
            // Another boundary may be close: take the equilibrium of least index.
            let found = NEIGHBOUR_DISTANCES
                .iter()
                .filter_map(|away| at(*away, more..=usize::MAX));
            relaxed_neighbour(plane, grid, found.min_by_key(|found| found.index)?.solution)?
        }
        (0, CriticalKind::Fold) => relaxed_neighbour(
            plane,
            grid,
            initial_state_beyond_fold(point, &low.solution, along)?,
        )?,
        _ => NEIGHBOUR_DISTANCES
            .iter()
            .find_map(|away| at(*away, more..=more))?,
    };
    Some([low, high])
}

/// The point on the coarsest grid that pictures allow.
fn point_on_picture_grid(
    plane: &TwoParameterProblem,
    point: &VerifiedBoundaryPoint,
) -> GridBoundaryPoint<VerifiedBoundaryPoint> {
    let mut grid = Grid::from_stations(&point.stations, plane.first_leaf().kinks());
    let mut point = point.clone();
    while grid.segments() > FINEST_PICTURE_GRID
        && let Some(coarse) = coarser_grid(plane, &grid)
    {
        point.across.increments = restrict_field(
            &point.across.increments,
            usize::from(!plane.first_leaf().hinged()),
        );
        (grid, point.state) = (coarse, restrict(&point.state));
    }
    GridBoundaryPoint { grid, point }
}

/// The equilibrium at a distance `away` from the boundary, across it, if it is in the ranges.
fn equilibrium_across_boundary(
    plane: &TwoParameterProblem,
    grid: &Grid,
    point: &VerifiedBoundaryPoint,
    along: [f64; 2],
    away: f64,
) -> Option<BoundaryNeighbour> {
    let mut manifold = TwoParameterEquations::new(plane, grid.clone());
    let along = TwoParameterDirection {
        params: along,
        ..manifold.unit_parameter(0)
    };
    let start = TwoParameterState {
        state: point.state.clone(),
        params: point.params,
    };
    let start = manifold
        .displace_equilibrium(&start, &point.across, away)
        .ok()?;
    let rates = manifold.parameter_derivatives(&start, false).ok()?;
    let normals = [&along, &point.across];
    let found = manifold.correct_bordered(start, normals, &[], Some(&rates), false);
    let found = found.ok()?;
    let index = found.solved.negative;
    is_in_parameter_range(found.solution.params).then_some(BoundaryNeighbour {
        solution: found.solution,
        index,
        fallen_from: None,
    })
}

/// Initial state beyond a fold, where no equilibrium is near: the leaf at the fold, with
/// parameters on the side of the boundary opposite to the stable one.
fn initial_state_beyond_fold(
    point: &VerifiedBoundaryPoint,
    stable: &TwoParameterState,
    along: [f64; 2],
) -> Option<TwoParameterState> {
    let normal = [-along[1], along[0]];
    let off: f64 = (0..2)
        .map(|i| (stable.params[i] - point.params[i]) * normal[i])
        .sum();
    let length = along[0].hypot(along[1]).copysign(-off);
    let mut away = NEIGHBOUR_DISTANCES.iter().map(|away| away / length);
    let params = away.find_map(|away| {
        let params = [0, 1].map(|i| point.params[i] + away * normal[i]);
        is_in_parameter_range(params).then_some(params)
    })?;
    Some(TwoParameterState {
        state: point.state.clone(),
        params,
    })
}

/// The equilibrium to which a leaf relaxes.
fn relaxed_neighbour(
    plane: &TwoParameterProblem,
    grid: &Grid,
    from: TwoParameterState,
) -> Option<BoundaryNeighbour> {
    let leaf = plane.leaf(from.params).ok()?;
    let state = relax_from_state(&leaf, grid, from.state.clone(), &Limit::default())?;
    Some(BoundaryNeighbour {
        solution: TwoParameterState {
            state,
            params: from.params,
        },
        index: 0,
        fallen_from: Some(from.state),
    })
}

fn is_in_parameter_range(params: [f64; 2]) -> bool {
    params.iter().all(|part| (0.0..=1.0).contains(part))
}
