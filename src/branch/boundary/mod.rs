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
//! Equilibria at points of the parameter plane, each continued from a neighbouring one.
//!
//! Leaves on either side of a stability boundary.
//!
//! Transfer of boundary points to finer and coarser grids.

mod continuation;
mod refine;
mod singular_point;

pub use crate::branch::boundary::continuation::{Boundary, Special, WalkOptions, follow};
pub use crate::branch::boundary::refine::{Accuracy, Verified};
pub(crate) use crate::branch::boundary::singular_point::Direction;
use crate::branch::boundary::singular_point::{Manifold, SingularPoint};
pub use crate::branch::boundary::singular_point::{Plane, Seed, Solution};
use crate::branch::continuation::{End, Walk, walk};
use crate::branch::critical::{Critical, Kind};
use crate::branch::equations::{Equations, Stuck};
use crate::branch::refine::{Doubt, Refined, index_at, on_finer, refine_critical};
use crate::branch::{Point, every_second, prolong_field};
use crate::leaf::{Field, Grid, State};
use crate::relax::accuracy::transfer::{prolong, restrict};
use crate::relax::solve_on_grid::settle_from;
use crate::run::Limit;
use crate::scenario::Scenario;
use glam::DVec3;
use std::ops::RangeInclusive;

/// The longest step, as a part of the path, and the largest number of points on it.
const LONGEST: f64 = 1.0;

const MOST: usize = 100;

/// The finest grid for repeating a path, in segments.
const FINEST: usize = 1024;

/// Segments of the coarsest grid for counting an index again.
const RECOUNTED: usize = 256;

/// Least number of grids for a critical point.
const CRITICAL_GRIDS: usize = 4;

/// An equilibrium at a point of the parameter plane.
#[derive(Clone, Debug)]
pub struct AtRest {
    /// State and parameters on a grid, and that grid.
    pub solution: Solution,
    pub grid: Grid,
    /// Morse index, confirmed on finer grids.
    pub index: usize,
}

/// What was found on the straight path from an equilibrium to another point of the plane.
pub struct Path {
    /// The grid on which it was followed.
    pub grid: Grid,
    /// Tips of all rods along it, in the family's units.
    pub tips: Vec<Vec<DVec3>>,
    /// Its critical points on that grid; the parameter goes from 0 to 1 along the path.
    pub critical: Vec<Critical>,
    /// Whether the branch turns back before the end of the path.
    turned: bool,
    /// The equilibrium at the end; none if the branch turns back before, or is lost.
    pub end: Option<AtRest>,
    pub factorizations: usize,
}

/// The scenarios on the straight path between two points of the plane.
type Between<'p> = dyn Fn([f64; 1]) -> Result<Scenario, String> + Sync + 'p;

fn between<'p>(plane: &'p Plane, [from, to]: [[f64; 2]; 2]) -> Box<Between<'p>> {
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
pub fn follow_path(plane: &Plane, from: &AtRest, to: [f64; 2]) -> Path {
    let make = between(plane, [from.solution.params, to]);
    let family = plane.along_path(&*make);
    let mut path = Path {
        grid: from.grid.clone(),
        tips: Vec::new(),
        critical: Vec::new(),
        turned: false,
        end: None,
        factorizations: 0,
    };
    let Ok(family) = family else { return path };
    let mut equations = Equations::new(&family, from.grid.clone());
    let Ok(mut first) = equations.correct(&from.solution.state, 0.0, None) else {
        return path;
    };
    loop {
        let last = follow_on_grid(&mut equations, &first, &mut path);
        let index = last
            .as_ref()
            .and_then(|it| index_at(&mut equations, it).ok());
        let finer = 2 * first.state.segments() <= FINEST;
        if let (Some(last), Some(index)) = (last, index)
            && (index == last.index || !finer)
        {
            path.end = Some(AtRest {
                solution: Solution {
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
pub fn recount(plane: &Plane, at: &AtRest) -> Option<usize> {
    let make = between(plane, [at.solution.params; 2]);
    let family = plane.along_path(&*make).ok()?;
    let mut equations = Equations::new(&family, at.grid.clone());
    let mut point = equations.correct(&at.solution.state, 0.0, None).ok()?;
    while point.state.segments() < RECOUNTED {
        (equations, point) = on_finer(&mut equations, &point).ok()?;
    }
    index_at(&mut equations, &point).ok()
}

/// The point at the end of the path on this grid, if the branch reaches it.
fn follow_on_grid(equations: &mut Equations, first: &Point, path: &mut Path) -> Option<Point> {
    let mut first = first.clone();
    first.tangent = first.tangent.growing();
    let turned = |points: &[Point]| points[points.len() - 1].tangent.params[0] < 0.0;
    let how = Walk {
        enough: Some(&turned),
        ..Walk::new(LONGEST, MOST)
    };
    let before = equations.factorizations;
    let branch = walk(equations, first, &how, &mut |_, _| {});
    path.factorizations += equations.factorizations - before;
    path.grid.clone_from(equations.grid());
    let tips = |point: &Point| point.state.tips().collect();
    path.tips = branch.points.iter().map(tips).collect();
    path.critical = branch.critical.into_iter().map(|(_, it)| it).collect();
    path.turned = matches!(branch.end, Some(End::Enough | End::Returned));
    match branch.end {
        Some(End::Reached) if branch.missed.is_empty() => branch.points.last().cloned(),
        _ => None,
    }
}

/// A critical point on the path between two points of the plane, extrapolated over grids.
pub fn refine_on_path(
    plane: &Plane,
    ends: [[f64; 2]; 2],
    grid: &Grid,
    critical: &Critical,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    let make = between(plane, ends);
    let family = plane.along_path(&*make)?;
    refine_critical(&family, grid, critical, accuracy, CRITICAL_GRIDS)
}

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
