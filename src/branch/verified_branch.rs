//! A branch on grids as fine as it needs: every point of it is verified on finer grids.
//!
//! It begins with the equilibrium that a relaxation found, or beside a branch point of another
//! branch. Points are computed ahead on one grid and verified in parallel; where one is not
//! verified, the branch is continued from the last one that is, with a shorter step or on the grid
//! with all segments halved.

use crate::branch::continuation::{Branch, BranchEnd, ContinuationOptions};
use crate::branch::convergence::{ExtrapolatedPoint, VerificationFailure};
use crate::branch::critical::CriticalPoint;
use crate::branch::equations::{BranchEquations, CorrectorFailure};
use crate::branch::family::{LeafFamily, PARAMETER_ROUNDING};
use crate::branch::points::BranchDirection;
use crate::branch::points::EquilibriumPoint;
use crate::branch::refine::{refine_critical, verify_regular_point};
use crate::leaf::{DiscreteLeaf, Grid, State, System};
use crate::numbers::larger;
use crate::relax::accuracy::transfer::prolong;
use crate::relax::{
    Equilibrium, Options, SolverCounts, converge_saddle, relax, state_from_rod_shapes,
};
use glam::DVec3;
use rayon::prelude::*;

/// How much work a verified branch may take.
struct VerifiedBranchBudget {
    /// Largest number of segments of the grid on which the branch is followed, and of its nodes:
    /// each doubling makes verification, on still finer grids, as much more expensive.
    finest_segments: usize,
    most_nodes: usize,
    /// Least and largest number of points computed before they are verified in parallel: points
    /// after the first that is not verified are lost.
    least_batch: usize,
    largest_batch: usize,
    /// Attempts to pass a point on the finest grid, and the factor by which each shortens the step.
    finest_grid_attempts: usize,
    finest_grid_step_factor: f64,
    /// Largest number of consecutive points dropped next to a critical point: the critical point
    /// lies elsewhere on every grid, so that a point may be before it on one and beyond it on
    /// another.
    consecutive_dropped_points: usize,
}

const BUDGET: VerifiedBranchBudget = VerifiedBranchBudget {
    finest_segments: 512,
    most_nodes: 20_000,
    least_batch: 2,
    largest_batch: 16,
    finest_grid_attempts: 4,
    finest_grid_step_factor: 0.4,
    consecutive_dropped_points: 4,
};

/// From the grid on which they were found to the finest, neighboring points move alike: their
/// displacements differ by at most this part of the distance of the points, plus this part of the
/// larger displacement, plus `NEGLIGIBLE_DISPLACEMENT_DIFFERENCE` (lengths). The part is large,
/// since the points are sought in different planes.
const SIMILAR_DISPLACEMENT_FRACTION: f64 = 0.8;

const NEGLIGIBLE_DISPLACEMENT_DIFFERENCE: f64 = 1e-6;

/// The equations of a family on successively refined grids, each of which halves the
/// segments of the one before.
pub struct NestedBranchEquations<'a> {
    equations: Vec<BranchEquations<'a>>,
}

/// A branch of which every point is verified on finer grids.
pub struct VerifiedBranch {
    /// The branch as found on its grids.
    pub branch: Branch,
    /// Why the branch ends.
    pub end: BranchEnd,
    /// The points of the branch, extrapolated over grids.
    pub points: Vec<ExtrapolatedPoint>,
    /// The critical points of the branch, extrapolated over grids.
    pub critical: Vec<ExtrapolatedPoint>,
    /// What was found of critical points beyond the last point.
    beyond: Vec<Result<ExtrapolatedPoint, VerificationFailure>>,
}

impl<'a> NestedBranchEquations<'a> {
    /// The equations on the first grid alone; finer ones follow where they are needed.
    pub fn new(family: &'a LeafFamily<'a>, grid: Grid) -> Self {
        NestedBranchEquations {
            equations: vec![BranchEquations::new(family, grid)],
        }
    }

    /// The equations on the grid of a state, which must be one of these.
    pub fn on_grid_of(&mut self, state: &State) -> &mut BranchEquations<'a> {
        let level = (state.segments() / self.equations[0].grid().segments()).ilog2();
        &mut self.equations[level as usize]
    }

    /// Creates the next finer grid if needed; false if that is too fine.
    fn refine(&mut self, state: &State) -> bool {
        let finer = 2 * state.segments();
        if finer > BUDGET.finest_segments || finer * state.rods() > BUDGET.most_nodes {
            return false;
        }
        let last = &self.equations[self.equations.len() - 1];
        if last.grid().segments() < finer {
            let refined = last.refined();
            self.equations.push(refined);
        }
        true
    }

    /// Number of matrices factorized so far.
    pub fn factorizations(&self) -> usize {
        self.equations.iter().map(|it| it.factorizations).sum()
    }

    /// Follows a branch from its first point in the direction of its tangent. Where a
    /// point cannot be verified, the branch is continued from the last one that was: with a shorter
    /// step, or on a finer grid. `progress` is called after each point with the number of points
    /// and the parameter.
    pub fn follow(
        &mut self,
        first: EquilibriumPoint,
        how: &ContinuationOptions,
        accuracy: f64,
        progress: &mut dyn FnMut(usize, f64),
    ) -> VerifiedBranch {
        let mut known = VerifiedBranch {
            branch: Branch::new(first, how),
            end: BranchEnd::PointLimitReached,
            points: Vec::new(),
            critical: Vec::new(),
            beyond: Vec::new(),
        };
        let (mut ahead, mut tries) = (BUDGET.largest_batch / 2, 0);
        let mut points_per_verification = how.points_per_verification;
        loop {
            let now = &known.branch.points[known.branch.points.len() - 1];
            let (before, now) = (known.points.len(), now.state.clone());
            let equations = self.on_grid_of(&now);
            (known.branch).extend_to(equations, how, before + ahead, progress);
            known.branch.thin_points(before, points_per_verification);
            let leaves = &equations.leaves;
            let doubt = known.verify(leaves.family, &leaves.grid, accuracy, how.critical_grids);
            if known.points.len() > before {
                tries = 0;
            }
            if leaves.family.limit.reached() && !(doubt.is_none() && known.branch.is_complete()) {
                let last = known.points.len().saturating_sub(1);
                known.branch.truncate_at(last);
                known.end = BranchEnd::RunLimitReached;
                return known;
            }
            match (doubt, &known.branch.end) {
                (None, None) => {
                    ahead = (2 * ahead).min(BUDGET.largest_batch);
                    continue;
                }
                (Some(_), _)
                | (
                    None,
                    Some(BranchEnd::StepFailed(
                        CorrectorFailure::NotConverged | CorrectorFailure::Unresolved,
                    )),
                ) => {}
                (None, Some(end)) => {
                    known.end = end.clone();
                    return known;
                }
            }
            let end = known.branch.end.clone();
            // How far the branch is known shall not depend on which points are left out.
            points_per_verification = 1;
            ahead = BUDGET.least_batch;
            tries += 1;
            let last = known.points.len().saturating_sub(1);
            known.branch.truncate_at(last);
            let here = known.branch.points[last].state.clone();
            let refined = self.refine(&here) && known.branch.refine(self.on_grid_of(&here)).is_ok();
            known.branch.shorten(if refined {
                1.0
            } else {
                BUDGET.finest_grid_step_factor
            });
            if !refined
                && (tries > BUDGET.finest_grid_attempts
                    || known.points.is_empty()
                    || doubt.is_none())
            {
                known.end = match (doubt, end) {
                    (None, Some(end)) => end,
                    (doubt, _) => {
                        BranchEnd::PointUnverified(doubt.unwrap_or(VerificationFailure::Unsolved))
                    }
                };
                return known;
            }
        }
    }
}

impl VerifiedBranch {
    /// Verifies the remaining points, all on one grid; stops at the first that
    /// fails, and returns why.
    fn verify(
        &mut self,
        family: &LeafFamily,
        grid: &Grid,
        accuracy: f64,
        grids: usize,
    ) -> Option<VerificationFailure> {
        let mut singular = std::mem::take(&mut self.beyond);
        let critical = &self.branch.critical[self.critical.len() + singular.len()..];
        let points = &self.branch.points[self.points.len()..];
        // Points and critical points in one list, to keep all threads busy.
        let mut found: Vec<Result<ExtrapolatedPoint, VerificationFailure>> = (0..points.len()
            + critical.len())
            .into_par_iter()
            .map(|k| match points.get(k) {
                // What is still to be verified is lost.
                _ if family.limit.reached() => Err(VerificationFailure::Unsolved),
                Some(point) => verify_regular_point(family, grid, point, accuracy),
                None => {
                    let critical = &critical[k - points.len()].1;
                    refine_critical(family, grid, critical, accuracy, grids)
                }
            })
            .collect();
        singular.append(&mut found.split_off(points.len()));
        self.drop_unverified_vertices(&mut singular);
        let mut critical = singular.into_iter();
        let mut dropped = 0;
        for point in found {
            let number = self.points.len();
            let near = number > 0 && self.branch.is_near_critical(number);
            let near = near && matches!(point, Err(VerificationFailure::OtherIndex));
            if near && dropped < BUDGET.consecutive_dropped_points {
                if number + 1 < self.branch.points.len() {
                    self.branch.drop_point(number);
                    dropped += 1;
                    continue;
                } else if self.branch.end.is_none() {
                    // Decided once there is a point after it.
                    self.beyond = critical.collect();
                    return None;
                }
            }
            dropped = 0;
            let known = self.critical.len();
            let count = number
                .checked_sub(1)
                .map_or(0, |before| self.critical_after(before));
            let singular: Result<Vec<ExtrapolatedPoint>, VerificationFailure> =
                critical.by_ref().take(count).collect();
            if let Err(doubt) = self.add(point, singular) {
                self.points.truncate(number);
                self.critical.truncate(known);
                return Some(doubt);
            }
        }
        None
    }

    /// Moves vertices of pitchforks that are not verified from the last critical points, and from
    /// what is `found` of these, to those of which no crossing branch is known.
    fn drop_unverified_vertices(
        &mut self,
        found: &mut Vec<Result<ExtrapolatedPoint, VerificationFailure>>,
    ) {
        let known = self.critical.len();
        for k in (0..found.len()).rev() {
            if found[k].is_err() && self.branch.critical[known + k].1.is_vertex() {
                let (after, _) = self.branch.critical.remove(known + k);
                self.branch.unmatched_vertices.push(after);
                drop(found.remove(k));
            }
        }
    }

    /// Number of critical points between this point and the next.
    fn critical_after(&self, point: usize) -> usize {
        let critical = self.branch.critical.iter();
        critical.filter(|(after, _)| *after == point).count()
    }

    /// Adds a point with the critical points before it.
    fn add(
        &mut self,
        point: Result<ExtrapolatedPoint, VerificationFailure>,
        critical: Result<Vec<ExtrapolatedPoint>, VerificationFailure>,
    ) -> Result<(), VerificationFailure> {
        let number = self.points.len();
        if number > 0 && self.branch.unlocated_index_changes.contains(&(number - 1)) {
            return Err(VerificationFailure::Unexplained);
        }
        let critical = critical?;
        // A point next to the range's end is on the other side of it, in truth.
        if !critical.iter().all(ExtrapolatedPoint::may_be_in_range) {
            return Err(VerificationFailure::OtherIndex);
        }
        self.critical.extend(critical);
        self.points.push(point?);
        match number == 0 || self.has_similar_displacement(number) {
            true => Ok(()),
            false => Err(VerificationFailure::OtherBranch),
        }
    }

    /// Whether a point and its predecessor are displaced alike on the finest grids.
    fn has_similar_displacement(&self, number: usize) -> bool {
        let [before, now] = [number - 1, number].map(|k| {
            let (coarse, fine) = (&self.branch.points[k].state, &self.points[k].state);
            (coarse, displacements(coarse, fine))
        });
        let largest = |displacements: &[DVec3]| {
            crate::numbers::largest(displacements.iter().map(|d| d.length()))
        };
        let differences = before.1.iter().zip(&now.1).map(|(a, b)| *b - *a);
        let differences: Vec<DVec3> = differences.collect();
        let distance = before.0.largest_displacement_to(now.0);
        largest(&differences)
            <= SIMILAR_DISPLACEMENT_FRACTION * distance
                + SIMILAR_DISPLACEMENT_FRACTION * largest(&before.1).max(largest(&now.1))
                + NEGLIGIBLE_DISPLACEMENT_DIFFERENCE
    }
}

/// Displacements of the nodes of a state to those of one on the same grid or a refinement.
fn displacements(coarse: &State, fine: &State) -> Vec<DVec3> {
    let stride = fine.segments() / coarse.segments();
    let node =
        |j: usize, i: usize| fine.x[fine.base(j) + stride * i] - coarse.x[coarse.base(j) + i];
    let rods = (0..coarse.rods()).flat_map(|j| (0..=coarse.segments()).map(move |i| (j, i)));
    rods.map(|(j, i)| node(j, i)).collect()
}

/// The finest grid on which the first point is sought.
const FINEST_FIRST_POINT: usize = 512;

/// Largest distance between the tips of one grid and the extrapolated ones, relative to
/// the length.
const SAME_TIPS_TOLERANCE: f64 = 0.02;

/// Nodes of a grid from which on a branch does not begin on one that is finer than its relaxation.
const MOST_FIRST_NODES: usize = 300;

/// A relaxation on fewer segments counts as one on this many.
const COARSEST_RELAXATION_GRID: usize = 8;

/// Distances from the branch point at which the other branch is sought, in this order.
const BRANCH_SWITCHING_DISTANCES: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];

/// Where the first of `BRANCH_SWITCHING_DISTANCES` leads out of the range of the parameter, it is
/// shortened by this factor, at most `MAX_SWITCHING_REDUCTIONS` - 1 times.
const SWITCHING_DISTANCE_FACTOR: f64 = 0.3;

const MAX_SWITCHING_REDUCTIONS: i32 = 8;

/// The first point of a branch and its grid: the equilibrium `rest` at this `fraction`, found with
/// these `options`; on a grid of at least `segments` segments, or, if none is given, on
/// the first one on which the index is that of `rest`, at least twice as fine as the stations of the
/// relaxation or, of a large leaf, as fine.
///
/// # Errors
/// The failure on the finest grid, if Newton's method converges on none.
pub fn begin_branch<'a>(
    family: &'a LeafFamily<'a>,
    (rest, fraction): (&Equilibrium, f64),
    options: &Options,
    segments: Option<usize>,
) -> Result<(NestedBranchEquations<'a>, EquilibriumPoint), CorrectorFailure> {
    let coarsest = (rest.shape.stations.len() - 1).max(COARSEST_RELAXATION_GRID);
    let finer = 2 * coarsest;
    let enough = match rest.rod_count * finer > MOST_FIRST_NODES {
        true => coarsest,
        false => finer,
    };
    let least = segments.unwrap_or(enough);
    find_first_point(family, rest, fraction, least, segments.is_some()).or_else(|stuck| {
        // Interpolation between the stations may be too inaccurate: relax once more, on the
        // finest grid alone, and begin there.
        let finest = rest.accuracy.segments.iter().max().copied();
        let options = Options {
            method: options.method.on_grid(finest),
            ..options.clone()
        };
        let alone = relax(&family.scenario([fraction])?, &options, &mut |_| {});
        let Ok(alone) = alone else {
            return Err(stuck);
        };
        let mut tips = rest.tips.iter().zip(&alone.tips);
        let near = SAME_TIPS_TOLERANCE * family.scale().length;
        match tips.all(|(a, b)| a.distance(*b) < near) {
            true => {
                let least = alone.shape.stations.len() - 1;
                find_first_point(family, &alone, fraction, least, true)
            }
            false => Err(stuck),
        }
    })
}

/// The first point on a grid of at least `least` segments; of any index, or on the first grid
/// with the index of `rest`.
fn find_first_point<'a>(
    family: &'a LeafFamily<'a>,
    rest: &Equilibrium,
    fraction: f64,
    least: usize,
    any_index: bool,
) -> Result<(NestedBranchEquations<'a>, EquilibriumPoint), CorrectorFailure> {
    let leaf = &family.leaf([fraction])?;
    let mut grid = Grid::from_stations(&rest.shape.stations, leaf.kinks());
    let mut discrete = DiscreteLeaf::new(leaf, grid.clone());
    let mut state = state_from_rod_shapes(leaf, &discrete, &rest.shape.rods);
    let mut found = Err(CorrectorFailure::NotConverged);
    loop {
        if grid.segments() >= least {
            let mut grids = NestedBranchEquations::new(family, grid.clone());
            let point = grids
                .on_grid_of(&state)
                .correct(&state, fraction, None)
                .or_else(|_| {
                    let mut system = System::new(&discrete);
                    converge_saddle(
                        &discrete,
                        &mut state,
                        &mut system,
                        &mut SolverCounts::default(),
                    );
                    grids.on_grid_of(&state).correct(&state, fraction, None)
                });
            match point {
                Ok(point) => {
                    let same = Some(point.index) == rest.stability.negative_eigenvalues;
                    found = Ok((grids, point));
                    if same || any_index {
                        return found;
                    }
                }
                Err(stuck) if found.is_err() => found = Err(stuck),
                Err(_) => {}
            }
            if grid.segments() >= FINEST_FIRST_POINT {
                return found.and(Err(CorrectorFailure::BesideBifurcation));
            }
        }
        state = prolong(&discrete, &state);
        grid = grid.refined();
        discrete = DiscreteLeaf::new(leaf, grid.clone());
    }
}

/// The first points of the branches that cross at `critical` in the plane of
/// the first of its neutral modes, one on either side: as near as possible, but so far from the
/// branch point that finer grids have them too, with this accuracy of their tips. A side is
/// missing where its branch leaves the range of the parameter at once.
pub fn switch_branches(
    equations: &mut BranchEquations,
    critical: &CriticalPoint,
    accuracy: f64,
) -> Vec<EquilibriumPoint> {
    let across = critical.branching_direction(equations);
    [across.clone(), across.reversed()]
        .iter()
        .filter_map(|direction| first_point_off_branch(equations, critical, direction, accuracy))
        .collect()
}

/// The first point of the branch that leaves a branch point in this direction, within the range.
fn first_point_off_branch(
    equations: &mut BranchEquations,
    critical: &CriticalPoint,
    direction: &BranchDirection,
    accuracy: f64,
) -> Option<EquilibriumPoint> {
    let (family, grid) = (equations.leaves.family, equations.grid().clone());
    let mut at = |away: f64| {
        let point = critical
            .equilibrium_along_direction(equations, direction, away)
            .ok()?;
        let beyond = larger(-point.fraction, point.fraction - 1.0);
        (beyond <= PARAMETER_ROUNDING).then_some(point)
    };
    let mut nearest = None;
    for (k, away) in BRANCH_SWITCHING_DISTANCES.into_iter().enumerate() {
        let Some(point) = at(away) else {
            if k == 0 {
                // Over a short range the parameter changes by more than all of it there.
                let nearer =
                    (1..MAX_SWITCHING_REDUCTIONS).map(|k| away * SWITCHING_DISTANCE_FACTOR.powi(k));
                let found = nearer.into_iter().find_map(&mut at);
                if found.is_some() {
                    return found;
                }
            }
            continue;
        };
        if verify_regular_point(family, &grid, &point, accuracy).is_ok() {
            return Some(point);
        }
        nearest = nearest.or(Some(point));
    }
    nearest
}
