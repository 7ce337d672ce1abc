//! A branch on one grid, point by point, with its critical points.
//!
//! A step is shortened until the corrected point lies near its prediction, the branch turns little,
//! and every change of the index, and every turn in the parameter, is explained by critical points
//! in between. A branch ends at an end of the range, where it closes, or where no step succeeds.

use crate::branch::convergence::VerificationFailure;
use crate::branch::correct::{SteppedPoint, TangentBefore};
use crate::branch::critical::{
    CriticalKind, CriticalPoint, locate_critical_points, locate_pitchfork_vertex,
};
use crate::branch::equations::{BranchEquations, CorrectorFailure};
use crate::branch::points::{
    BranchDirection, EquilibriumPoint, add_scaled, increments_between, scaled_sum,
};
use crate::branch::refine::on_finer;
use crate::numbers::larger;

/// How steps along a branch or a boundary are chosen and judged. Halving the turn or the
/// prediction error that is allowed makes about as many more points, and is safer from other
/// branches nearby.
pub(super) struct StepControl {
    /// The first step and the shortest, as parts of the longest.
    pub first: f64,
    pub shortest: f64,
    /// Growth factor of the step, where the cosine of the turn exceeds `growth_cosine`.
    pub growth: f64,
    pub growth_cosine: f64,
    /// A step in which the cosine of the turn is smaller is rejected.
    pub smallest_cosine: f64,
    /// Largest distance of a point from its prediction, as a part of the step.
    pub largest_prediction_error: f64,
}

const STEPS: StepControl = StepControl {
    first: 0.25,
    shortest: 1e-5,
    growth: 1.5,
    growth_cosine: 0.97,
    smallest_cosine: 0.85,
    largest_prediction_error: 0.5,
};

/// The part of the rate of the parameter by which it may have changed in the last step for the next one to be
/// predicted by both tangents.
const LARGEST_BENT_RATE_CHANGE: f64 = 0.1;

/// A step grows only if Newton's method needs at most so many iterations.
const STEP_GROWTH_ITERATIONS: usize = 4;

/// A chord is parallel to the mean of the tangents at its ends up to third order. If a larger
/// part of it than this is transverse, the step has led to another branch.
const LARGEST_TRANSVERSE_FRACTION: f64 = 0.1;

/// Changes of the index in one step. A longer step may have led to another branch.
struct IndexChangeLimits {
    /// Largest number of sign changes of eigenvalues, unless the step is shorter than
    /// `many_changes_step` times the longest.
    most: usize,
    many_changes_step: f64,
    /// A change that no critical point explains is accepted in a step not longer than this part of
    /// the longest.
    unexplained_change_step: f64,
}

const INDEX_CHANGES: IndexChangeLimits = IndexChangeLimits {
    most: 2,
    many_changes_step: 0.02,
    unexplained_change_step: 1e-3,
};

/// The test whether a branch has come back to its first point.
struct ClosureTest {
    /// Distance from the first point, in steps, within which it is made, after so many points.
    distance: f64,
    points: usize,
    /// Largest number of corrections to the plane through the first point normal to the branch.
    corrections: usize,
    /// How near both must then be (radians, lengths, fractions).
    tolerance: f64,
}

const CLOSURE: ClosureTest = ClosureTest {
    distance: 1.0,
    points: 8,
    corrections: 5,
    tolerance: 1e-7,
};

/// Least number of grids for a critical point.
pub(super) const CRITICAL_GRIDS: usize = 4;

/// Predicate on the points so far: whether to stop.
type StopCriterion<'a> = dyn Fn(&[EquilibriumPoint]) -> bool + 'a;

/// How to follow a branch: step control and stopping.
#[derive(Clone, Copy)]
pub struct ContinuationOptions<'a> {
    /// The longest step; the range of the parameter has length one, and so has a turn of all
    /// nodes by ten radians or a shift by one length.
    pub longest_step: f64,
    /// Largest number of points of the branch, the first included.
    pub max_points: usize,
    /// Least number of grids for a critical point.
    pub critical_grids: usize,
    /// Stops the branch once it returns true.
    pub stop_criterion: Option<&'a StopCriterion<'a>>,
    /// Of so many points in a row between which the index does not change one is verified on finer grids; the
    /// others are left out of the branch.
    pub points_per_verification: usize,
}

impl ContinuationOptions<'_> {
    /// Follows a branch with steps up to `longest` to at most so many points, without a criterion
    /// for stopping.
    pub fn new(longest: f64, most: usize) -> Self {
        ContinuationOptions {
            longest_step: longest,
            max_points: most,
            critical_grids: CRITICAL_GRIDS,
            stop_criterion: None,
            points_per_verification: 1,
        }
    }
}

/// How a branch ended, or a boundary on one of its sides.
#[derive(Clone, Debug, PartialEq)]
pub enum BranchEnd {
    /// At the end of the range; of a boundary, at an end of one of the ranges.
    RangeEndReached,
    /// Back at the start of the range.
    RangeStartReached,
    /// At the point where it began: it is closed.
    LoopClosed,
    /// On a boundary that was followed before.
    KnownBoundaryMet,
    /// After as many points as were allowed.
    PointLimitReached,
    /// Where the stopping criterion was met.
    StopCriterionMet,
    /// Where it loses its stability, as requested.
    StabilityLost,
    /// Where the limit of the run was reached.
    RunLimitReached,
    /// The step could not be made however short.
    StepFailed(CorrectorFailure),
    /// The next point is not verified on any grid up to the finest.
    PointUnverified(VerificationFailure),
}

impl BranchEnd {
    /// How a branch ends at this end of the range, 0 or 1.
    fn at_range_end(edge: f64) -> Self {
        match edge {
            1.0 => BranchEnd::RangeEndReached,
            _ => BranchEnd::RangeStartReached,
        }
    }
}

/// A branch on one grid, or on finer and finer ones.
#[derive(Clone, Debug)]
pub struct Branch {
    /// The points in the order in which the branch was followed.
    pub points: Vec<EquilibriumPoint>,
    /// Critical points, each with the number of the point before it.
    pub critical: Vec<(usize, CriticalPoint)>,
    /// Changes of the index that could not be located, by the number of the point before.
    pub unlocated_index_changes: Vec<usize>,
    /// Vertices of pitchforks at which no branch was found to cross, by the number of the point
    /// before.
    pub unmatched_vertices: Vec<usize>,
    /// Why the branch ends, once it does.
    pub end: Option<BranchEnd>,
    /// The first point on the present grid, if it was found there.
    first: Option<EquilibriumPoint>,
    /// Length of the next step, and of all previous ones.
    step: f64,
    steps: Vec<f64>,
}

/// Follows a branch on one grid from its first point in the direction of its
/// tangent, as long as the parameter is within its range. `progress` is called after
/// each point with the number of points and the parameter.
pub fn follow_branch(
    equations: &mut BranchEquations,
    first: EquilibriumPoint,
    how: &ContinuationOptions,
    progress: &mut dyn FnMut(usize, f64),
) -> Branch {
    let mut branch = Branch::new(first, how);
    branch.extend_to(equations, how, how.max_points, progress);
    branch
}

impl Branch {
    /// A branch with one point, not yet followed.
    pub fn new(first: EquilibriumPoint, how: &ContinuationOptions) -> Self {
        Branch {
            points: vec![first.clone()],
            critical: Vec::new(),
            unlocated_index_changes: Vec::new(),
            unmatched_vertices: Vec::new(),
            end: None,
            first: Some(first),
            step: STEPS.first * how.longest_step,
            steps: Vec::new(),
        }
    }

    /// Continues until there are `until` points, or the branch ends.
    pub fn extend_to(
        &mut self,
        equations: &mut BranchEquations,
        how: &ContinuationOptions,
        until: usize,
        progress: &mut dyn FnMut(usize, f64),
    ) {
        while self.end.is_none() && self.points.len() < until.min(how.max_points) {
            if equations.leaves.family.limit.reached() {
                self.end = Some(BranchEnd::RunLimitReached);
                return;
            }
            if how
                .stop_criterion
                .is_some_and(|enough| enough(&self.points))
            {
                self.end = Some(BranchEnd::StopCriterionMet);
                return;
            }
            if let Err(stuck) = self.try_step(equations, how) {
                self.end = Some(BranchEnd::StepFailed(stuck));
            }
            let now = &self.points[self.points.len() - 1];
            progress(self.points.len(), now.fraction);
        }
        if self.end.is_none() && self.points.len() >= how.max_points {
            self.end = Some(BranchEnd::PointLimitReached);
        }
    }

    /// Discards everything after the given point, and the end; the next step is
    /// as long as the previous one from that point, or to it.
    pub fn truncate_at(&mut self, to: usize) {
        let made = self.steps.get(to).or(self.steps.last());
        self.step = *made.unwrap_or(&self.step);
        self.points.truncate(to + 1);
        self.steps.truncate(to);
        self.critical.retain(|(after, _)| *after < to);
        self.unlocated_index_changes.retain(|after| *after < to);
        self.unmatched_vertices.retain(|after| *after < to);
        self.end = None;
    }

    /// Whether it ended where a branch is known as far as requested.
    pub fn is_complete(&self) -> bool {
        self.end.as_ref().is_some_and(BranchEnd::is_complete)
    }

    pub fn shorten(&mut self, part: f64) {
        self.step *= part;
    }

    /// Drops a point between two others: critical points on both sides are then between these.
    pub fn drop_point(&mut self, number: usize) {
        self.points.remove(number);
        self.steps[number - 1] += self.steps.remove(number);
        let after = self.critical.iter_mut().map(|(after, _)| after);
        for after in after
            .chain(&mut self.unlocated_index_changes)
            .chain(&mut self.unmatched_vertices)
        {
            *after -= usize::from(*after >= number);
        }
    }

    /// Drops points after the first `verified` ones, so that one remains of so many in a row. The last one
    /// remains, as do those beside a change of the index and next to these.
    pub fn thin_points(&mut self, verified: usize, points_per_verification: usize) {
        let mut number = verified.max(1);
        let mut dropped = 0;
        while number + 2 < self.points.len() {
            let index = self.points[number].index;
            let around = &self.points[number - 1..number + 3];
            let is_even = around.iter().all(|point| point.index == index);
            let unlocated = [number - 1, number].iter().any(|it| {
                self.unlocated_index_changes.contains(it) || self.unmatched_vertices.contains(it)
            });
            if dropped + 1 < points_per_verification
                && is_even
                && !unlocated
                && !self.is_near_critical(number)
            {
                self.drop_point(number);
                dropped += 1;
            } else {
                number += 1;
                dropped = 0;
            }
        }
    }

    /// Whether there is a critical point right before or after a point.
    pub fn is_near_critical(&self, number: usize) -> bool {
        let mut critical = self.critical.iter();
        critical.any(|(after, _)| *after == number || after + 1 == number)
    }

    /// Transfers the last point to the grid with all segments halved.
    pub fn refine(&mut self, equations: &mut BranchEquations) -> Result<(), CorrectorFailure> {
        let last = self.points.len() - 1;
        let (_, finer) = on_finer(equations, &self.points[last])?;
        let first = self.first.take();
        self.first = match last {
            0 => Some(finer.clone()),
            _ => first.and_then(|first| Some(on_finer(equations, &first).ok()?.1)),
        };
        self.points[last] = finer;
        Ok(())
    }

    /// Makes a step from the last point, or shortens the next attempt. Fails if that
    /// is too short.
    fn try_step(
        &mut self,
        equations: &mut BranchEquations,
        how: &ContinuationOptions,
    ) -> Result<(), CorrectorFailure> {
        let now = &self.points[self.points.len() - 1];
        let step = self.step;
        let before = self.steps.last().map(|step| TangentBefore {
            tangent: &self.points[self.points.len() - 2].tangent,
            step: *step,
        });
        // Where a branch turns sharply, or is about to turn back, how it did tells nothing of how it will.
        let before = before.filter(|before| {
            let [then, rate] = [before.tangent, &now.tangent].map(|tangent| tangent.params[0]);
            before.is_on_grid_of(now)
                && equations.direction_product(before.tangent, &now.tangent) > STEPS.growth_cosine
                && (rate - then).abs() < LARGEST_BENT_RATE_CHANGE * rate.abs()
        });
        let found =
            SteppedPoint::step_from(equations, now, before, step).and_then(|found| {
                match how.accepts(equations, now, &found, step) {
                    true => Ok(found),
                    false => Err(CorrectorFailure::NotConverged),
                }
            });
        let mut next = match found {
            Ok(found) => found,
            Err(_) if 0.5 * step >= STEPS.shortest * how.longest_step => {
                self.step = 0.5 * step;
                return Ok(());
            }
            Err(stuck) => return Err(stuck),
        };
        let turn = equations.direction_product(&now.tangent, &next.point.tangent);
        let easy = next.point.iterations <= STEP_GROWTH_ITERATIONS && turn > STEPS.growth_cosine;
        let mut end = next
            .stop_at_range_end(equations, now, step)?
            .map(BranchEnd::at_range_end);
        if let Some(first) = &self.first
            && end.is_none()
            && self.points.len() > CLOSURE.points
            && distance(first, &next.point) < CLOSURE.distance * step
            && let Some(point) = close_branch(equations, first, &next.point, step)
        {
            next.point = point;
            end = Some(BranchEnd::LoopClosed);
        }
        let turned = now.tangent.params[0] * next.point.tangent.params[0] < 0.0;
        if next.point.index != now.index || turned {
            let after = self.points.len() - 1;
            let distance = equations.direction_product(
                &direction_between(equations, now, &next.point),
                &now.tangent,
            );
            let found = locate_critical_points(equations, now, &next.point, distance);
            // If the branch turns back and no eigenvalue changes sign, it touches another one
            // where that crosses: the vertex of a pitchfork.
            let is_vertex = turned
                && next.point.index == now.index
                && found.as_ref().is_ok_and(|found| found.is_empty());
            let vertex =
                is_vertex.then(|| locate_pitchfork_vertex(equations, now, &next.point, distance));
            let mut found = found.unwrap_or_default();
            let changes: usize = found.iter().map(|critical| critical.modes.len()).sum();
            let folds = found
                .iter()
                .filter(|critical| critical.kind == CriticalKind::Fold);
            let explained = changes == next.point.index.abs_diff(now.index)
                && (folds.count() % 2 == 1) == turned;
            if let Some(Ok(vertex)) = vertex {
                let known = self.critical.last().map(|(_, last)| last);
                let again = known.is_some_and(|known| known.is_same_point(&vertex));
                found.extend((!again).then_some(vertex));
            } else if !explained {
                // An unexplained change of the index: the step has led to another branch
                // nearby.
                if next.step > INDEX_CHANGES.unexplained_change_step * how.longest_step {
                    self.step = 0.5 * next.step;
                    return Ok(());
                }
                match is_vertex {
                    true => self.unmatched_vertices.push(after),
                    false => self.unlocated_index_changes.push(after),
                }
            }
            let all = found.into_iter();
            self.critical.extend(all.map(|point| (after, point)));
        }
        self.steps.push(next.step);
        self.points.push(next.point);
        self.end = end;
        if easy {
            self.step = (STEPS.growth * step).min(how.longest_step);
        }
        Ok(())
    }
}

impl ContinuationOptions<'_> {
    /// Whether a step has presumably stayed on the branch.
    fn accepts(
        &self,
        equations: &BranchEquations,
        now: &EquilibriumPoint,
        found: &SteppedPoint,
        step: f64,
    ) -> bool {
        let changes = found.point.index.abs_diff(now.index);
        equations.direction_product(&now.tangent, &found.point.tangent) > STEPS.smallest_cosine
            && found.drift < STEPS.largest_prediction_error * step
            && (changes <= INDEX_CHANGES.most
                || step < INDEX_CHANGES.many_changes_step * self.longest_step)
            && transverse_part(equations, now, &found.point) < LARGEST_TRANSVERSE_FRACTION
    }
}

/// The direction, not normalized, from one point to another.
fn direction_between(
    equations: &BranchEquations,
    a: &EquilibriumPoint,
    b: &EquilibriumPoint,
) -> BranchDirection {
    BranchDirection {
        increments: increments_between(&a.state, &b.state, equations.first_node()),
        params: [b.fraction - a.fraction],
    }
}

/// The part of the chord between two points that is transverse to the mean of their
/// tangents.
fn transverse_part(equations: &BranchEquations, a: &EquilibriumPoint, b: &EquilibriumPoint) -> f64 {
    let mean = equations.normalize_direction(BranchDirection {
        increments: scaled_sum(&a.tangent.increments, 1.0, &b.tangent.increments),
        params: [a.tangent.params[0] + b.tangent.params[0]],
    });
    let mut rest = direction_between(equations, a, b);
    let length = equations.direction_product(&rest, &rest).sqrt();
    let along = equations.direction_product(&rest, &mean);
    add_scaled(&mut rest.increments, -along, &mean.increments);
    rest.params[0] -= along * mean.params[0];
    equations.direction_product(&rest, &rest).sqrt() / length
}

/// Corrects a point near the first one until both agree in parameter, shape, tangent and
/// index; none if they do not.
fn close_branch(
    equations: &mut BranchEquations,
    first: &EquilibriumPoint,
    near: &EquilibriumPoint,
    step: f64,
) -> Option<EquilibriumPoint> {
    let mut near = near.clone();
    for _ in 0..CLOSURE.corrections {
        let same = equations.direction_product(&near.tangent, &first.tangent);
        if same < STEPS.smallest_cosine || near.index != first.index {
            return None;
        }
        if distance(&near, first) < CLOSURE.tolerance {
            return Some(near);
        }
        let shift = equations
            .direction_product(&direction_between(equations, &near, first), &first.tangent)
            / same;
        if shift.abs() > 2.0 * step {
            return None;
        }
        let moved =
            (equations.displace_along_direction(&near.solution(), &near.tangent, shift)).ok()?;
        near = (equations.correct(&moved.state, moved.params[0], Some(&first.tangent))).ok()?;
    }
    None
}

/// Distance of two points: the larger of those of shape and parameter.
fn distance(a: &EquilibriumPoint, b: &EquilibriumPoint) -> f64 {
    larger(
        a.state.largest_displacement_to(&b.state),
        (a.fraction - b.fraction).abs(),
    )
}

impl BranchDirection {
    /// The direction in which the parameter grows.
    pub fn towards_larger_parameter(self) -> Self {
        match self.params[0] >= 0.0 {
            true => self,
            false => self.reversed(),
        }
    }
}
