//! Following a boundary through the plane of two parameters, in both directions in parallel.
//!
//! In each direction it is followed on one grid, step by step; points are computed ahead while
//! those before are verified. Where a point is not verified, or no step succeeds, the boundary is
//! continued on a finer grid from the last point that is. It ends at an end of a range, or where
//! it closes.

use crate::branch::boundary::codimension_two::{
    CodimensionTwoPoint, boundary_point_at_distance, boundary_point_at_parameter,
    codimension_two_between,
};
use crate::branch::boundary::point_search::{
    BoundarySearchTolerance, TwoParameterEquations, TwoParameterProblem,
};
use crate::branch::boundary::refine::{
    BoundaryAccuracy, UnverifiedBoundaryPoint, VerifiedBoundaryPoint, verify_boundary_point,
};
use crate::branch::boundary::singular_point::{
    BoundarySeed, FinerBoundaryPoint, SingularPoint, boundary_point_on_finer,
};
use crate::branch::continuation::{BranchEnd, StepControl};
use crate::branch::convergence::VerificationFailure;
use crate::branch::critical::CriticalKind;
use crate::branch::equations::CorrectorFailure;
use crate::branch::family::PARAMETER_ROUNDING;
use crate::leaf::Grid;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Steps along a boundary: the turn is that of the boundary, and for `smallest_cosine` also that
/// of the normal to it.
const STEPS: StepControl = StepControl {
    first: 0.25,
    shortest: 1e-4,
    growth: 1.5,
    growth_cosine: 0.97,
    smallest_cosine: 0.85,
    largest_prediction_error: 0.3,
};

/// Accuracy of points that are not at a given parameter (arclength on the manifold): extrapolation
/// over grids locates them again.
const ACCURACY: f64 = 1e-8;

/// Points computed ahead while earlier ones are verified in parallel.
const POINTS_COMPUTED_AHEAD: usize = 8;

/// The finest grid to follow a boundary on, in segments.
const FINEST_CONTINUATION_GRID: usize = 256;

/// Tolerances (parameter, shape) within which the boundary is closed.
const CLOSURE_TOLERANCES: [f64; 2] = [1e-6, 1e-4];

/// How to follow a boundary: step control and accuracy.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryContinuationOptions {
    /// The longest step; the range of each parameter has length one, and so has a turn of all
    /// nodes by ten radians or a shift by one length.
    pub longest_step: f64,
    pub max_points: usize,
    pub accuracy: BoundaryAccuracy,
}

/// What a step along a boundary has led to.
struct BoundaryStep {
    /// Special points in between, and the point of the step itself.
    points: Vec<UnverifiedBoundaryPoint>,
    end: Option<BranchEnd>,
}

/// A value of one of the parameters at which a step ends.
struct ParameterLimit {
    /// The first parameter, 0, or the second, 1.
    which: usize,
    value: f64,
    /// Arclength of the step to this value.
    distance: f64,
}

/// A boundary that is followed in one direction: all points so far, the first of which are
/// verified.
pub struct BoundaryContinuation<'a, 'h> {
    plane: &'a TwoParameterProblem<'a>,
    options: &'h BoundaryContinuationOptions,
    /// The second parameter at the starting point.
    initial_second_parameter: f64,
    first: SingularPoint,
    /// Arclength of the next step on the manifold.
    step: f64,
    steps: Vec<UnverifiedBoundaryPoint>,
    verified: Vec<VerifiedBoundaryPoint>,
    end: Option<BranchEnd>,
    /// Matrices factorized on earlier grids, and to verify points.
    pub factorizations: usize,
}

impl<'a, 'h> BoundaryContinuation<'a, 'h> {
    /// Begins at the first point of a boundary, at which one of the parameters may be given.
    pub fn new(
        plane: &'a TwoParameterProblem<'a>,
        how: &'h BoundaryContinuationOptions,
        first: SingularPoint,
        given: Option<usize>,
    ) -> Self {
        BoundaryContinuation {
            plane,
            options: how,
            initial_second_parameter: first.solution.params[1],
            first: first.clone(),
            step: STEPS.first * how.longest_step,
            steps: vec![UnverifiedBoundaryPoint {
                point: first,
                special: None,
                fixed_parameter: given,
            }],
            verified: Vec::new(),
            end: None,
            factorizations: 0,
        }
    }

    /// Follows it to its end; every point is verified, on finer grids where necessary.
    pub fn run(
        &mut self,
        grid: Grid,
        cancelled: &dyn Fn() -> bool,
        progress: &mut dyn FnMut(usize, [f64; 2]),
    ) -> BranchEnd {
        let mut manifold = TwoParameterEquations::new(self.plane, grid);
        let mut counted = 0;
        loop {
            if cancelled() {
                return BranchEnd::LoopClosed;
            }
            if self.plane.limit.reached() {
                return BranchEnd::RunLimitReached;
            }
            // The next points are computed while the previous ones are verified, in parallel.
            let (plane, accuracy, grid) =
                (self.plane, self.options.accuracy, manifold.grid().clone());
            let new = self.steps[self.verified.len()..].to_vec();
            let mut found = Vec::new();
            rayon::in_place_scope(|scope| {
                scope.spawn(|_| {
                    let each = new.par_iter();
                    found = each
                        .map(|it| verify_boundary_point(plane, &grid, it, accuracy))
                        .collect();
                });
                self.extend(&mut manifold, POINTS_COMPUTED_AHEAD, progress);
            });
            self.factorizations += manifold.factorizations - counted;
            counted = manifold.factorizations;
            let all = new.len() + self.verified.len() == self.steps.len();
            let end = match (self.accept(found), self.end.clone()) {
                (None, Some(end)) if all => match end {
                    BranchEnd::StepFailed(CorrectorFailure::OutOfRange(_)) => return end,
                    BranchEnd::StepFailed(_) => end,
                    _ => return end,
                },
                (None, _) => continue,
                (Some(doubt), _) => BranchEnd::PointUnverified(doubt),
            };
            // A finer grid may resolve it.
            if !self.refine(&mut manifold) {
                return end;
            }
            counted = 0;
        }
    }

    /// Its verified points, in order. Extrapolation moves points at a fixed value of one parameter
    /// or of the other: where that changes, a point may come to lie before its predecessor, and is
    /// left out, unless it is the last or a special one.
    pub fn ordered_points(self) -> Vec<VerifiedBoundaryPoint> {
        let mut kept: Vec<(UnverifiedBoundaryPoint, VerifiedBoundaryPoint)> = Vec::new();
        let last = self.verified.len().saturating_sub(1);
        for (k, (step, point)) in self.steps.into_iter().zip(self.verified).enumerate() {
            let needed = k == last || step.special.is_some();
            if needed {
                while kept.len() > 1
                    && let Some((before, found)) = kept.last()
                    && before.special.is_none()
                    && order_reversed([before, &step], [found, &point])
                {
                    kept.pop();
                }
            }
            let back = |(before, found): &(UnverifiedBoundaryPoint, VerifiedBoundaryPoint)| {
                order_reversed([before, &step], [found, &point])
            };
            if needed || !kept.last().is_some_and(back) {
                kept.push((step, point));
            }
        }
        kept.into_iter().map(|(_, point)| point).collect()
    }

    /// Computes so many further points, unless the boundary ends.
    fn extend(
        &mut self,
        manifold: &mut TwoParameterEquations,
        points: usize,
        progress: &mut dyn FnMut(usize, [f64; 2]),
    ) {
        let enough = self.steps.len() + points;
        while self.end.is_none() && self.steps.len() < enough {
            if self.steps.len() >= self.options.max_points {
                self.end = Some(BranchEnd::PointLimitReached);
                break;
            }
            self.try_step(manifold);
            let last = &self.steps[self.steps.len() - 1];
            progress(self.steps.len(), last.point.solution.params);
        }
    }

    /// Keeps verified points; at the first failure discards that point and all later ones.
    fn accept(
        &mut self,
        found: Vec<Result<VerifiedBoundaryPoint, VerificationFailure>>,
    ) -> Option<VerificationFailure> {
        for point in found {
            match point {
                Ok(point) => {
                    self.factorizations += point.factorizations;
                    self.verified.push(point);
                }
                Err(doubt) => {
                    self.steps.truncate(self.verified.len().max(1));
                    self.end = None;
                    return Some(doubt);
                }
            }
        }
        None
    }

    /// Transfers the last point to the grid with all segments halved; false if that is too
    /// fine, or has no such point.
    fn refine(&mut self, manifold: &mut TwoParameterEquations<'a>) -> bool {
        if 2 * manifold.grid().segments() > FINEST_CONTINUATION_GRID {
            return false;
        }
        let mut on_finer = |point: &SingularPoint, given| {
            let FinerBoundaryPoint {
                manifold: mut finer,
                point: near,
            } = boundary_point_on_finer(manifold, point).ok()?;
            let point = match given {
                Some(which) => boundary_point_at_parameter(
                    &mut finer,
                    &near,
                    0.0,
                    which,
                    near.solution.params[which],
                ),
                None => {
                    let tolerance = BoundarySearchTolerance {
                        accuracy: ACCURACY,
                        largest_distance: 1.0,
                    };
                    boundary_point_at_distance(&mut finer, &near, 0.0, tolerance)
                        .map(|found| found.point)
                }
            };
            Some(FinerBoundaryPoint {
                manifold: finer,
                point: point.ok()?,
            })
        };
        let Some(last) = self.steps.last_mut() else {
            return false;
        };
        let (Some(first), Some(finer)) = (
            on_finer(&self.first, Some(1)),
            on_finer(&last.point, last.fixed_parameter),
        ) else {
            return false;
        };
        (self.first, last.point) = (first.point, finer.point);
        self.step *= 0.5;
        self.end = None;
        *manifold = finer.manifold;
        true
    }

    /// Makes a step from the last point, or shortens the next attempt; ends the boundary if that
    /// is too short.
    fn try_step(&mut self, manifold: &mut TwoParameterEquations) {
        let now = self.steps[self.steps.len() - 1].point.clone();
        match self.advance(manifold, &now) {
            Ok(next) => {
                self.steps.extend(next.points);
                self.end = next.end;
            }
            Err(_) if 0.5 * self.step >= STEPS.shortest * self.options.longest_step => {
                self.step *= 0.5
            }
            Err(stuck) => self.end = Some(end_after_failure(stuck)),
        }
    }

    /// The next points: special ones in between, and that of the step itself.
    fn advance(
        &mut self,
        manifold: &mut TwoParameterEquations,
        now: &SingularPoint,
    ) -> Result<BoundaryStep, CorrectorFailure> {
        if leaves_parameter_range(now) {
            return Ok(BoundaryStep {
                points: Vec::new(),
                end: Some(BranchEnd::RangeEndReached),
            });
        }
        let mut step = self.step;
        let mut given = self.first_passed_mark(now, step, |which| {
            now.solution.params[which] + step * now.tangent.params[which]
        });
        if given.is_none() {
            let tolerance = BoundarySearchTolerance {
                accuracy: ACCURACY,
                largest_distance: STEPS.largest_prediction_error * step,
            };
            let found = boundary_point_at_distance(manifold, now, step, tolerance)?;
            let (next, off) = (found.point, found.prediction_error);
            given = self.first_passed_mark(now, step, |which| next.solution.params[which]);
            if given.is_none() {
                let turn = self.accepts(manifold, [now, &next], off, step)?;
                if turn > STEPS.growth_cosine {
                    self.step = (STEPS.growth * step).min(self.options.longest_step);
                }
                let mut steps = self.codimension_two_points(manifold, [now, &next], step)?;
                steps.push(UnverifiedBoundaryPoint {
                    point: next,
                    special: None,
                    fixed_parameter: None,
                });
                return Ok(BoundaryStep {
                    points: steps,
                    end: None,
                });
            }
        }
        let Some(ParameterLimit {
            which,
            value,
            distance,
        }) = given
        else {
            return Err(CorrectorFailure::NotConverged);
        };
        step = distance;
        let next = boundary_point_at_parameter(manifold, now, step, which, value)?;
        let off = manifold.difference(&now.solution, &next.solution);
        let along = manifold.direction_product(&off, &now.tangent);
        let off = (manifold.direction_product(&off, &off) - along * along)
            .max(0.0)
            .sqrt();
        self.accepts(manifold, [now, &next], off, step)?;
        let edge = value == 0.0 || value == 1.0;
        let mut steps = self.codimension_two_points(manifold, [now, &next], step)?;
        let end = match () {
            () if edge => Some(BranchEnd::RangeEndReached),
            () if self.has_returned_to_start(manifold, &next) => Some(BranchEnd::LoopClosed),
            () => None,
        };
        steps.push(UnverifiedBoundaryPoint {
            point: next,
            special: None,
            fixed_parameter: Some(which),
        });
        Ok(BoundaryStep { points: steps, end })
    }

    /// Where the step first leaves a range, or passes the initial value of the second parameter.
    fn first_passed_mark(
        &self,
        now: &SingularPoint,
        step: f64,
        next: impl Fn(usize) -> f64,
    ) -> Option<ParameterLimit> {
        let marks = [
            (0, 0.0),
            (0, 1.0),
            (1, 0.0),
            (1, 1.0),
            (1, self.initial_second_parameter),
        ];
        let passed = marks.into_iter().filter_map(|(which, value)| {
            let (before, after) = (now.solution.params[which], next(which));
            let part = (value - before) / (after - before);
            let inside = value == self.initial_second_parameter && which == 1;
            let passed = match inside {
                true => {
                    (before - value).abs() > PARAMETER_ROUNDING
                        && (before < value) != (after < value)
                }
                false => (value == 0.0 && after < value) || (value == 1.0 && after > value),
            };
            passed.then_some(ParameterLimit {
                which,
                value,
                distance: part.clamp(0.0, 1.0) * step,
            })
        });
        passed.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// Checks that a step has stayed on the boundary; returns the cosine of its turn.
    fn accepts(
        &self,
        manifold: &TwoParameterEquations,
        [now, next]: [&SingularPoint; 2],
        off: f64,
        step: f64,
    ) -> Result<f64, CorrectorFailure> {
        let turn = manifold.direction_product(&now.tangent, &next.tangent);
        let tilt = manifold.direction_product(&now.normal, &next.normal);
        match off <= STEPS.largest_prediction_error * step
            && turn > STEPS.smallest_cosine
            && tilt > STEPS.smallest_cosine
        {
            true => Ok(turn),
            false => Err(CorrectorFailure::NotConverged),
        }
    }

    /// Special points between two points of a boundary.
    fn codimension_two_points(
        &self,
        manifold: &mut TwoParameterEquations,
        pair: [&SingularPoint; 2],
        step: f64,
    ) -> Result<Vec<UnverifiedBoundaryPoint>, CorrectorFailure> {
        let special = codimension_two_between(manifold, pair, step)?;
        let step = |found: CodimensionTwoPoint| UnverifiedBoundaryPoint {
            point: found.point,
            special: Some(found.kind),
            fixed_parameter: None,
        };
        Ok(special.into_iter().map(step).collect())
    }

    fn has_returned_to_start(
        &self,
        manifold: &TwoParameterEquations,
        point: &SingularPoint,
    ) -> bool {
        let first = &self.first;
        (first.solution.params[0] - point.solution.params[0]).abs() < CLOSURE_TOLERANCES[0]
            && first
                .solution
                .state
                .largest_displacement_to(&point.solution.state)
                < CLOSURE_TOLERANCES[1]
            && manifold.direction_product(&first.tangent, &point.tangent) > STEPS.smallest_cosine
    }
}

/// The end of a boundary where no point is found. Every grid has been tried: that one is too
/// coarse says no more.
pub fn end_after_failure(stuck: CorrectorFailure) -> BranchEnd {
    BranchEnd::StepFailed(match stuck {
        CorrectorFailure::Unresolved => CorrectorFailure::NotConverged,
        stuck => stuck,
    })
}

/// Whether extrapolation has reversed the order of the points of two steps.
fn order_reversed(
    steps: [&UnverifiedBoundaryPoint; 2],
    found: [&VerifiedBoundaryPoint; 2],
) -> bool {
    let way = |[a, b]: [[f64; 2]; 2]| [0, 1].map(|i| b[i] - a[i]);
    let [a, b] = [
        way(steps.map(|step| step.point.solution.params)),
        way(found.map(|point| point.params)),
    ];
    a[0] * b[0] + a[1] * b[1] < 0.0
}

/// Whether a point is at an end of a range and the boundary leaves it.
fn leaves_parameter_range(now: &SingularPoint) -> bool {
    (0..2).any(|k| {
        let (at, way) = (now.solution.params[k], now.tangent.params[k]);
        at <= PARAMETER_ROUNDING && way < 0.0 || at >= 1.0 - PARAMETER_ROUNDING && way > 0.0
    })
}

/// A boundary, on both sides of its starting point.
#[derive(Clone, Debug)]
pub struct ContinuedBoundary {
    /// The kind of its critical points along the first parameter, and how many modes are neutral.
    pub kind: CriticalKind,
    pub neutral: usize,
    pub points: Vec<VerifiedBoundaryPoint>,
    /// How it ended at its first point and at its last.
    pub ends: [BranchEnd; 2],
    /// Matrices factorized for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Called for each point with the number of points so far and its parameters.
type BoundaryProgress<'p> = dyn FnMut(usize, [f64; 2]) + Send + 'p;

/// Follows the boundary through a critical point of a branch in both directions, in parallel.
pub fn follow_boundary(
    plane: &TwoParameterProblem,
    grid: &Grid,
    seed: &BoundarySeed,
    how: &BoundaryContinuationOptions,
    progress: &mut BoundaryProgress,
) -> ContinuedBoundary {
    let mut boundary = ContinuedBoundary {
        kind: seed.critical.kind,
        neutral: seed.critical.modes.len(),
        points: Vec::new(),
        ends: [BranchEnd::PointLimitReached, BranchEnd::PointLimitReached],
        factorizations: 0,
    };
    let mut manifold = TwoParameterEquations::new(plane, grid.clone());
    let begun = SingularPoint::begin(&mut manifold, seed);
    boundary.factorizations += manifold.factorizations;
    let first = match begun {
        Ok(first) => first,
        Err(stuck) => {
            let end = end_after_failure(stuck);
            boundary.ends = [end.clone(), end];
            return boundary;
        }
    };
    let (closed, reported) = (AtomicBool::new(false), Mutex::new(([0; 2], progress)));
    let follow = |side: usize, first: SingularPoint| {
        let mut side_followed =
            BoundaryContinuation::new(plane, how, first, seed.constant_parameter());
        let mut report = |points: usize, params| {
            let mut reported = reported.lock().unwrap_or_else(PoisonError::into_inner);
            reported.0[side] = points;
            let points = reported.0.iter().sum();
            reported.1(points, params);
        };
        // If one direction leads back to the start, the other is not needed.
        let cancelled = || side == 0 && closed.load(Ordering::Relaxed);
        let end = side_followed.run(grid.clone(), &cancelled, &mut report);
        closed.fetch_or(side == 1 && end == BranchEnd::LoopClosed, Ordering::Relaxed);
        (side_followed, end)
    };
    let ((forward, end), (backward, beginning)) =
        rayon::join(|| follow(1, first.clone()), || follow(0, first.reversed()));
    boundary.factorizations += forward.factorizations;
    let is_closed = end == BranchEnd::LoopClosed;
    boundary.ends = [if is_closed { end.clone() } else { beginning }, end];
    boundary.points = forward.ordered_points();
    if is_closed {
        return boundary;
    }
    boundary.factorizations += backward.factorizations;
    // Both directions begin with the same point.
    let skip = usize::from(!boundary.points.is_empty());
    let before = backward.ordered_points().into_iter().skip(skip).rev();
    boundary.points.splice(..0, before);
    boundary
}
