//! Following a boundary in one direction, step by step.
//!
//! Following a boundary through the plane of two parameters, in both directions.
//!
//! Special points of a boundary: cusps, and crossings with another boundary.

use crate::branch::boundary::manifold_on_finer;
use crate::branch::boundary::refine::{Accuracy, Step, Verified, refine};
use crate::branch::boundary::singular_point::{Manifold, Plane, Seed, SingularPoint};
use crate::branch::continuation::End;
use crate::branch::critical::Kind;
use crate::branch::equations::Stuck;
use crate::branch::refine::Doubt;
use crate::leaf::Grid;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// First step and shortest step, as parts of the longest.
const FIRST: f64 = 0.25;

const SHORTEST: f64 = 1e-4;

/// Growth factor of the step, where the cosine of the boundary's turn exceeds the other.
const GROWTH: f64 = 1.5;

const STRAIGHT: f64 = 0.97;

/// A step in which the boundary, or the normal to it, turns by more than this (cosine) is
/// rejected.
const BENT: f64 = 0.85;

/// Largest distance of a point from its prediction, as a part of the step.
const DRIFT: f64 = 0.3;

/// Accuracy of ordinary points, and of those at a given parameter.
const ACCURACY: f64 = 1e-8;

const EXACT: f64 = 1e-12;

/// Points computed ahead while earlier ones are verified in parallel.
const AHEAD: usize = 8;

/// The finest grid to follow a boundary on, in segments.
const FINEST: usize = 256;

/// Tolerances (parameter, shape) within which the boundary is closed.
const SAME: [f64; 2] = [1e-6, 1e-4];

/// How to follow a boundary: step control and accuracy.
#[derive(Clone, Copy, Debug)]
pub struct WalkOptions {
    /// The longest step; the range of each parameter has length one, and so has a turn of all
    /// nodes by ten radians or a shift by one length.
    pub longest: f64,
    pub most: usize,
    pub accuracy: Accuracy,
}

/// A boundary followed in one direction.
pub struct Walk<'a, 'h> {
    plane: &'a Plane<'a>,
    how: &'h WalkOptions,
    /// The second parameter at the starting point.
    second: f64,
    first: SingularPoint,
    /// Length of the next step.
    step: f64,
    steps: Vec<Step>,
    verified: Vec<Verified>,
    end: Option<End>,
    /// Matrices factorised on earlier grids, and to verify points.
    pub factorizations: usize,
}

impl<'a, 'h> Walk<'a, 'h> {
    /// From its first point, at which one of the parameters may be given.
    pub fn new(
        plane: &'a Plane<'a>,
        how: &'h WalkOptions,
        first: SingularPoint,
        given: Option<usize>,
    ) -> Self {
        Walk {
            plane,
            how,
            second: first.solution.params[1],
            first: first.clone(),
            step: FIRST * how.longest,
            steps: vec![Step {
                point: first,
                special: None,
                given,
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
    ) -> End {
        let mut manifold = Manifold::new(self.plane, grid);
        let mut counted = 0;
        loop {
            if cancelled() {
                return End::Closed;
            }
            if self.plane.limit.reached() {
                return End::Stopped;
            }
            // The next points are computed while the previous ones are verified, in parallel.
            let (plane, accuracy, grid) = (self.plane, self.how.accuracy, manifold.grid().clone());
            let new = self.steps[self.verified.len()..].to_vec();
            let mut found = Vec::new();
            rayon::in_place_scope(|scope| {
                scope.spawn(|_| {
                    let each = new.par_iter();
                    found = each.map(|it| refine(plane, &grid, it, accuracy)).collect();
                });
                self.extend(&mut manifold, AHEAD, progress);
            });
            self.factorizations += manifold.factorizations - counted;
            counted = manifold.factorizations;
            let all = new.len() + self.verified.len() == self.steps.len();
            let end = match (self.accept(found), self.end.clone()) {
                (None, Some(end)) if all => match end {
                    End::Stuck(Stuck::OutOfRange(_)) => return end,
                    End::Stuck(_) => end,
                    _ => return end,
                },
                (None, _) => continue,
                (Some(doubt), _) => End::Unverified(doubt),
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
    pub fn in_order(self) -> Vec<Verified> {
        let mut kept: Vec<(Step, Verified)> = Vec::new();
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
            let back = |(before, found): &(Step, Verified)| {
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
        manifold: &mut Manifold,
        points: usize,
        progress: &mut dyn FnMut(usize, [f64; 2]),
    ) {
        let enough = self.steps.len() + points;
        while self.end.is_none() && self.steps.len() < enough {
            if self.steps.len() >= self.how.most {
                self.end = Some(End::MostPoints);
                break;
            }
            self.try_step(manifold);
            let last = &self.steps[self.steps.len() - 1];
            progress(self.steps.len(), last.point.solution.params);
        }
    }

    /// Keeps verified points; at the first failure discards that point and all later ones.
    fn accept(&mut self, found: Vec<Result<Verified, Doubt>>) -> Option<Doubt> {
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
    fn refine(&mut self, manifold: &mut Manifold<'a>) -> bool {
        if 2 * manifold.grid().segments() > FINEST {
            return false;
        }
        let mut on_finer = |point: &SingularPoint, given| {
            let (mut finer, near) = manifold_on_finer(manifold, point).ok()?;
            let point = match given {
                Some(which) => at_value(&mut finer, &near, 0.0, which, near.solution.params[which]),
                None => at_distance(&mut finer, &near, 0.0, ACCURACY, 1.0).map(|(point, _)| point),
            };
            Some((finer, point.ok()?))
        };
        let Some(last) = self.steps.last_mut() else {
            return false;
        };
        let (Some((_, first)), Some((finer, point))) = (
            on_finer(&self.first, Some(1)),
            on_finer(&last.point, last.given),
        ) else {
            return false;
        };
        (self.first, last.point) = (first, point);
        self.step *= 0.5;
        self.end = None;
        *manifold = finer;
        true
    }

    /// Makes a step from the last point, or shortens the next attempt; ends the boundary if that
    /// is too short.
    fn try_step(&mut self, manifold: &mut Manifold) {
        let now = self.steps[self.steps.len() - 1].point.clone();
        match self.advance(manifold, &now) {
            Ok((next, end)) => {
                self.steps.extend(next);
                self.end = end;
            }
            Err(_) if 0.5 * self.step >= SHORTEST * self.how.longest => self.step *= 0.5,
            Err(stuck) => self.end = Some(lost(stuck)),
        }
    }

    /// The next points: special ones in between, and that of the step itself.
    fn advance(
        &mut self,
        manifold: &mut Manifold,
        now: &SingularPoint,
    ) -> Result<(Vec<Step>, Option<End>), Stuck> {
        let not_converged = || Stuck::NotConverged;
        if leaves_range(now) {
            return Ok((Vec::new(), Some(End::Reached)));
        }
        let mut step = self.step;
        let mut given = self.first_mark(now, step, |which| {
            now.solution.params[which] + step * now.tangent.params[which]
        });
        if given.is_none() {
            let (next, off) = at_distance(manifold, now, step, ACCURACY, DRIFT * step)?;
            given = self.first_mark(now, step, |which| next.solution.params[which]);
            if given.is_none() {
                let turn = self.accepts(manifold, [now, &next], off, step)?;
                if turn > STRAIGHT {
                    self.step = (GROWTH * step).min(self.how.longest);
                }
                let mut steps = self.between(manifold, [now, &next], step)?;
                steps.push(Step {
                    point: next,
                    special: None,
                    given: None,
                });
                return Ok((steps, None));
            }
        }
        let Some((which, value, part)) = given else {
            return Err(not_converged());
        };
        step = part;
        let next = at_value(manifold, now, step, which, value)?;
        let off = manifold.difference(&now.solution, &next.solution);
        let along = manifold.inner(&off, &now.tangent);
        let off = (manifold.inner(&off, &off) - along * along).max(0.0).sqrt();
        self.accepts(manifold, [now, &next], off, step)?;
        let edge = value == 0.0 || value == 1.0;
        let mut steps = self.between(manifold, [now, &next], step)?;
        let end = match () {
            () if edge => Some(End::Reached),
            () if self.is_first(manifold, &next) => Some(End::Closed),
            () => None,
        };
        steps.push(Step {
            point: next,
            special: None,
            given: Some(which),
        });
        Ok((steps, end))
    }

    /// Where the step first leaves a range, or passes the initial value of the second parameter:
    /// which parameter, its value, and the length of the step to it.
    fn first_mark(
        &self,
        now: &SingularPoint,
        step: f64,
        next: impl Fn(usize) -> f64,
    ) -> Option<(usize, f64, f64)> {
        let marks = [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0), (1, self.second)];
        let passed = marks.into_iter().filter_map(|(which, value)| {
            let (before, after) = (now.solution.params[which], next(which));
            let part = (value - before) / (after - before);
            let inside = value == self.second && which == 1;
            let passed = match inside {
                true => (before - value).abs() > EXACT && (before < value) != (after < value),
                false => (value == 0.0 && after < value) || (value == 1.0 && after > value),
            };
            passed.then_some((which, value, part.clamp(0.0, 1.0) * step))
        });
        passed.min_by(|a, b| a.2.total_cmp(&b.2))
    }

    /// Checks that a step has stayed on the boundary; returns the cosine of its turn.
    fn accepts(
        &self,
        manifold: &Manifold,
        [now, next]: [&SingularPoint; 2],
        off: f64,
        step: f64,
    ) -> Result<f64, Stuck> {
        let turn = manifold.inner(&now.tangent, &next.tangent);
        let tilt = manifold.inner(&now.normal, &next.normal);
        match off <= DRIFT * step && turn > BENT && tilt > BENT {
            true => Ok(turn),
            false => Err(Stuck::NotConverged),
        }
    }

    /// Special points between two points of a boundary.
    fn between(
        &self,
        manifold: &mut Manifold,
        pair: [&SingularPoint; 2],
        step: f64,
    ) -> Result<Vec<Step>, Stuck> {
        let special = special_between(manifold, pair, step)?;
        let step = |(special, point)| Step {
            point,
            special: Some(special),
            given: None,
        };
        Ok(special.into_iter().map(step).collect())
    }

    fn is_first(&self, manifold: &Manifold, point: &SingularPoint) -> bool {
        let first = &self.first;
        (first.solution.params[0] - point.solution.params[0]).abs() < SAME[0]
            && first.solution.state.shift_to(&point.solution.state) < SAME[1]
            && manifold.inner(&first.tangent, &point.tangent) > BENT
    }
}

/// The end of a boundary where no point is found. Every grid has been tried: that one is too
/// coarse says no more.
pub fn lost(stuck: Stuck) -> End {
    End::Stuck(match stuck {
        Stuck::Unresolved => Stuck::NotConverged,
        stuck => stuck,
    })
}

/// Whether extrapolation has reversed the order of the points of two steps.
fn order_reversed(steps: [&Step; 2], found: [&Verified; 2]) -> bool {
    let way = |[a, b]: [[f64; 2]; 2]| [0, 1].map(|i| b[i] - a[i]);
    let [a, b] = [
        way(steps.map(|step| step.point.solution.params)),
        way(found.map(|point| point.params)),
    ];
    a[0] * b[0] + a[1] * b[1] < 0.0
}

/// Whether a point is at an end of a range and the boundary leaves it.
fn leaves_range(now: &SingularPoint) -> bool {
    (0..2).any(|k| {
        let (at, way) = (now.solution.params[k], now.tangent.params[k]);
        at <= EXACT && way < 0.0 || at >= 1.0 - EXACT && way > 0.0
    })
}

/// A boundary, on both sides of its starting point.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// The kind of its critical points along the first parameter, and how many modes are neutral.
    pub kind: Kind,
    pub neutral: usize,
    pub points: Vec<Verified>,
    /// How it ended at its first point and at its last.
    pub ends: [End; 2],
    /// Matrices factorised for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Called for each point with the number of points so far and its parameters.
type Progress<'p> = dyn FnMut(usize, [f64; 2]) + Send + 'p;

/// Follows the boundary through a critical point of a branch in both directions, in parallel.
pub fn follow(
    plane: &Plane,
    grid: &Grid,
    seed: &Seed,
    how: &WalkOptions,
    progress: &mut Progress,
) -> Boundary {
    let mut boundary = Boundary {
        kind: seed.critical.kind,
        neutral: seed.critical.modes.len(),
        points: Vec::new(),
        ends: [End::MostPoints, End::MostPoints],
        factorizations: 0,
    };
    let mut manifold = Manifold::new(plane, grid.clone());
    let begun = SingularPoint::begin(&mut manifold, seed);
    boundary.factorizations += manifold.factorizations;
    let first = match begun {
        Ok(first) => first,
        Err(stuck) => {
            let end = lost(stuck);
            boundary.ends = [end.clone(), end];
            return boundary;
        }
    };
    let (closed, reported) = (AtomicBool::new(false), Mutex::new(([0; 2], progress)));
    let walk = |side: usize, first: SingularPoint| {
        let mut walk = Walk::new(plane, how, first, seed.given());
        let mut report = |points: usize, params| {
            let mut reported = reported.lock().unwrap_or_else(PoisonError::into_inner);
            reported.0[side] = points;
            let points = reported.0.iter().sum();
            reported.1(points, params);
        };
        // If one direction leads back to the start, the other is not needed.
        let cancelled = || side == 0 && closed.load(Ordering::Relaxed);
        let end = walk.run(grid.clone(), &cancelled, &mut report);
        closed.fetch_or(side == 1 && end == End::Closed, Ordering::Relaxed);
        (walk, end)
    };
    let ((forward, end), (backward, beginning)) =
        rayon::join(|| walk(1, first.clone()), || walk(0, first.turned()));
    boundary.factorizations += forward.factorizations;
    let is_closed = end == End::Closed;
    boundary.ends = [if is_closed { end.clone() } else { beginning }, end];
    boundary.points = forward.in_order();
    if is_closed {
        return boundary;
    }
    boundary.factorizations += backward.factorizations;
    // Both directions begin with the same point.
    let skip = usize::from(!boundary.points.is_empty());
    let before = backward.in_order().into_iter().skip(skip).rev();
    boundary.points.splice(..0, before);
    boundary
}

/// Largest number of evaluations in the search along the boundary.
const EVALUATIONS: usize = 25;

/// Accuracy along the boundary: at a cusp the parameters are accurate to its square; at a
/// crossing it is that of the parameters.
const SPECIAL_ACCURACY: f64 = 1e-11;

/// Differences over less than this do not give a reliable slope.
const LOCAL: f64 = 1e-7;

/// Largest distance of the point from its initial guess, along the boundary.
const REACH: f64 = 0.3;

/// Modes of which the eigenvalues are below this, relative to their derivative along the boundary,
/// become neutral at one crossing.
const TOGETHER: f64 = 1e-5;

/// Accuracy of the boundary points during the search.
const SPECIAL_EXACT: f64 = 1e-13;

/// Accuracy of points at a given parameter.
const GIVEN: f64 = 1e-12;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Special {
    /// A curve of folds turns back: two folds meet and vanish.
    Cusp,
    /// Another mode also becomes neutral: two boundaries cross or touch.
    Crossing,
}

impl Special {
    /// The function that vanishes there, at a point of the boundary.
    fn value(self, point: &SingularPoint) -> f64 {
        match self {
            Special::Cusp => point.speed,
            Special::Crossing => {
                let others = point.others.iter().copied();
                let nearest = others.min_by(|a, b| a.abs().total_cmp(&b.abs()));
                nearest.unwrap_or(f64::INFINITY)
            }
        }
    }
}

/// The point of the boundary in the plane normal to its tangent at a distance `step` along it.
pub fn at_distance(
    manifold: &mut Manifold,
    now: &SingularPoint,
    step: f64,
    accuracy: f64,
    furthest: f64,
) -> Result<(SingularPoint, f64), Stuck> {
    let solution = manifold.moved(&now.solution, &now.tangent, step)?;
    let search = now.search(manifold, None, solution, (accuracy, furthest));
    let found = search.secant(manifold)?;
    let off = found.distance.abs();
    Ok((now.completed(manifold, found)?, off))
}

/// The special point near an approximation to it, and the derivative of the vanishing function
/// along the boundary.
pub fn locate_near(
    manifold: &mut Manifold,
    near: &SingularPoint,
    special: Special,
) -> Result<(SingularPoint, f64), Stuck> {
    let first = at_distance(manifold, near, 0.0, SPECIAL_EXACT, REACH)?.0;
    let away = 1e-2;
    let second = at_distance(manifold, &first, away, SPECIAL_EXACT, REACH)?.0;
    let slope = (special.value(&second) - special.value(&first)) / away;
    zero(manifold, &first, special, slope, [-REACH, REACH])
}

/// The zero by a secant method, from a point of the boundary.
fn zero(
    manifold: &mut Manifold,
    now: &SingularPoint,
    special: Special,
    mut slope: f64,
    [least, most]: [f64; 2],
) -> Result<(SingularPoint, f64), Stuck> {
    let mut best = now.clone();
    let (mut at, mut value) = (0.0, special.value(now));
    let mut worse = 0;
    for _ in 0..EVALUATIONS {
        let step = -value / slope;
        if !step.is_finite() || !(least..=most).contains(&(at + step)) {
            return Err(Stuck::NotConverged);
        }
        let (next, _) = at_distance(manifold, now, at + step, SPECIAL_EXACT, REACH)?;
        let after = special.value(&next);
        if step.abs() > LOCAL {
            slope = (after - value) / step;
        }
        (at, value) = (at + step, after);
        match after.abs() < special.value(&best).abs() {
            true => best = next,
            false => worse += 1,
        }
        if step.abs() < SPECIAL_ACCURACY || worse > 1 {
            return Ok((best, slope));
        }
    }
    Err(Stuck::NotConverged)
}

/// The point of the boundary at a value of one of the parameters, predicted `step` along the
/// tangent.
pub fn at_value(
    manifold: &mut Manifold,
    now: &SingularPoint,
    step: f64,
    which: usize,
    value: f64,
) -> Result<SingularPoint, Stuck> {
    let mut solution = manifold.moved(&now.solution, &now.tangent, step)?;
    solution.params[which] = value;
    let search = now.search(manifold, Some(which), solution, (GIVEN, 0.5));
    let found = search.secant(manifold)?;
    let mut point = now.completed(manifold, found)?;
    point.solution.params[which] = value;
    Ok(point)
}

/// Special points between two points of a boundary, the second `step` along the tangent of the
/// first; fails if there is more than one. Several modes may become neutral together, as those of
/// the boundary do.
pub fn special_between(
    manifold: &mut Manifold,
    [now, next]: [&SingularPoint; 2],
    step: f64,
) -> Result<Option<(Special, SingularPoint)>, Stuck> {
    let cusp = now.kind == Kind::Fold && now.speed * next.speed < 0.0;
    let special = match (cusp, now.index.abs_diff(next.index)) {
        (false, 0) => return Ok(None),
        (true, 0) => Special::Cusp,
        (false, _) => Special::Crossing,
        _ => return Err(Stuck::NotConverged),
    };
    let slope = (special.value(next) - special.value(now)) / step;
    let (point, slope) = zero(manifold, now, special, slope, [-0.1 * step, 1.1 * step])?;
    let vanishing = point
        .others
        .iter()
        .filter(|it| it.abs() < TOGETHER * slope.abs());
    match special == Special::Cusp || vanishing.count() == now.index.abs_diff(next.index) {
        true => Ok(Some((special, point))),
        false => Err(Stuck::NotConverged),
    }
}
