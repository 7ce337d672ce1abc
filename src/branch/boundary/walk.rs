//! Following a boundary in one direction, step by step.

use rayon::prelude::*;

use super::grids::manifold_on_finer;
use super::manifold::{Manifold, Plane};
use super::refine::{Accuracy, Step, refine};
use super::singular_point::SingularPoint;
use super::special::{at_distance, at_value, special_between};
use super::table::Verified;
use crate::branch::problem::equations::Stuck;
use crate::branch::verify::refined::Doubt;
use crate::branch::walk::steps::End;
use crate::leaf::Grid;

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
