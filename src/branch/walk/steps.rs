//! Following a branch on one grid.

use crate::branch::events::critical::{Critical, Kind, locate};
use crate::branch::events::vertex::crossing_at_vertex;
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::field::{add, between, plus};
use crate::branch::problem::step::Found;
use crate::branch::verify::refined::Doubt;
use crate::branch::verify::regular::on_finer;
use crate::branch::{Direction, Point};
use crate::largest::larger;

/// First step and shortest step, as parts of the longest.
const FIRST: f64 = 0.25;
const SHORTEST: f64 = 1e-5;

/// Growth factor of the step, if Newton's method needs at most `FEW` iterations
/// and the cosine of the branch's turn exceeds `STRAIGHT`.
const GROWTH: f64 = 1.5;
const FEW: usize = 4;
const STRAIGHT: f64 = 0.97;

/// A step in which the cosine of the branch's turn is below this is rejected.
const BENT: f64 = 0.85;

/// Largest distance of a point from its prediction, as a part of the step.
const DRIFT: f64 = 0.5;

/// A chord is parallel to the mean of the tangents at its ends up to third order. If a larger
/// part of it than this is transverse, the step has led to another branch.
const ACROSS: f64 = 0.1;

/// A step with more sign changes of eigenvalues than this is rejected, until it
/// is as short as this part of the longest.
const MOST_CHANGES: usize = 2;
const SHORT_ENOUGH: f64 = 0.02;

/// An unexplained change of the index is accepted if steps
/// are shorter than this part of the longest.
const UNEXPLAINED: f64 = 1e-3;

/// A branch that comes to within this part of a step of its first point is
/// tested for closure, after so many points: in at most `CLOSING` corrections to the plane
/// through the first point normal to the branch. The two must then agree
/// within `SAME` (radians, lengths, fractions).
const CLOSED: f64 = 1.0;
const CLOSED_AFTER: usize = 8;
const CLOSING: usize = 5;
const SAME: f64 = 1e-7;

/// Least number of grids for a critical point.
const CRITICAL_GRIDS: usize = 4;

/// Predicate on the points so far: whether to stop.
type Enough<'a> = dyn Fn(&[Point]) -> bool + 'a;

/// How to follow a branch: step control and stopping.
#[derive(Clone, Copy)]
pub struct Walk<'a> {
    /// The longest step; the range of the parameter has length one, and so has a turn of all
    /// nodes by ten radians or a shift by one length.
    pub longest: f64,
    /// Largest number of points.
    pub most: usize,
    /// Least number of grids for a critical point.
    pub critical_grids: usize,
    /// Stops the branch once it returns true.
    pub enough: Option<&'a Enough<'a>>,
}

impl Walk<'_> {
    /// Without a stopping criterion.
    pub fn new(longest: f64, most: usize) -> Self {
        Walk {
            longest,
            most,
            critical_grids: CRITICAL_GRIDS,
            enough: None,
        }
    }
}

/// How a branch ended, or a boundary on one of its sides.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// At the end of the range; of a boundary, at an end of one of the ranges.
    Reached,
    /// Back at the start of the range.
    Returned,
    /// Where it began.
    Closed,
    /// On a boundary that was followed before.
    Met,
    /// After as many points as were allowed.
    MostPoints,
    /// Where the stopping criterion was met.
    Enough,
    /// Where it loses its stability, as requested.
    Unstable,
    /// Where the limit of the run was reached.
    Stopped,
    /// The step could not be made however short.
    Stuck(Stuck),
    /// The next point is not verified on any grid up to the finest.
    Unverified(Doubt),
}

impl End {
    /// That of a branch which has reached this end of the range.
    fn at_edge(edge: f64) -> Self {
        match edge {
            1.0 => End::Reached,
            _ => End::Returned,
        }
    }
}

/// A branch on one grid, or on finer and finer ones.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Its points, in order.
    pub points: Vec<Point>,
    /// Critical points, each with the number of the point before it.
    pub critical: Vec<(usize, Critical)>,
    /// Changes of the index that could not be located, by the number of the point before.
    pub missed: Vec<usize>,
    /// Vertices of pitchforks at which no branch was found to cross, by the number of the point
    /// before.
    pub unmet: Vec<usize>,
    /// How it ended, once it has.
    pub end: Option<End>,
    /// The first point on the present grid, if it was found there.
    first: Option<Point>,
    /// Length of the next step, and of all previous ones.
    step: f64,
    steps: Vec<f64>,
}

/// Follows a branch on one grid from its first point in the direction of its
/// tangent, as long as the parameter is within its range. `progress` is called after
/// each point with the number of points and the parameter.
pub fn walk(
    equations: &mut Equations,
    first: Point,
    how: &Walk,
    progress: &mut dyn FnMut(usize, f64),
) -> Branch {
    let mut branch = Branch::new(first, how);
    branch.extend_to(equations, how, how.most, progress);
    branch
}

impl Branch {
    /// A branch with one point.
    pub fn new(first: Point, how: &Walk) -> Self {
        Branch {
            points: vec![first.clone()],
            critical: Vec::new(),
            missed: Vec::new(),
            unmet: Vec::new(),
            end: None,
            first: Some(first),
            step: FIRST * how.longest,
            steps: Vec::new(),
        }
    }

    /// Continues until there are `until` points, or the branch ends.
    pub fn extend_to(
        &mut self,
        equations: &mut Equations,
        how: &Walk,
        until: usize,
        progress: &mut dyn FnMut(usize, f64),
    ) {
        while self.end.is_none() && self.points.len() < until.min(how.most) {
            if equations.leaves.family.limit.reached() {
                self.end = Some(End::Stopped);
                return;
            }
            if how.enough.is_some_and(|enough| enough(&self.points)) {
                self.end = Some(End::Enough);
                return;
            }
            if let Err(stuck) = self.try_step(equations, how) {
                self.end = Some(End::Stuck(stuck));
            }
            let now = &self.points[self.points.len() - 1];
            progress(self.points.len(), now.fraction);
        }
        if self.end.is_none() && self.points.len() >= how.most {
            self.end = Some(End::MostPoints);
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
        self.missed.retain(|after| *after < to);
        self.unmet.retain(|after| *after < to);
        self.end = None;
    }

    /// Whether it ended where a branch is known as far as requested.
    pub fn is_complete(&self) -> bool {
        self.end.as_ref().is_some_and(End::complete)
    }

    pub fn shorten(&mut self, part: f64) {
        self.step *= part;
    }

    /// Drops a point between two others.
    pub fn drop_point(&mut self, number: usize) {
        self.points.remove(number);
        self.steps[number - 1] += self.steps.remove(number);
        let after = self.critical.iter_mut().map(|(after, _)| after);
        for after in after.chain(&mut self.missed).chain(&mut self.unmet) {
            *after -= usize::from(*after >= number);
        }
    }

    /// Whether there is a critical point right before or after a point.
    pub fn is_near_critical(&self, number: usize) -> bool {
        let mut critical = self.critical.iter();
        critical.any(|(after, _)| *after == number || after + 1 == number)
    }

    /// Transfers the last point to the grid with all segments halved.
    pub fn refine(&mut self, equations: &mut Equations) -> Result<(), Stuck> {
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
    fn try_step(&mut self, equations: &mut Equations, how: &Walk) -> Result<(), Stuck> {
        let now = &self.points[self.points.len() - 1];
        let step = self.step;
        let found = Found::by_step(equations, now, step).and_then(|found| {
            match how.accepts(equations, now, &found, step) {
                true => Ok(found),
                false => Err(Stuck::NotConverged),
            }
        });
        let mut next = match found {
            Ok(found) => found,
            Err(_) if 0.5 * step >= SHORTEST * how.longest => {
                self.step = 0.5 * step;
                return Ok(());
            }
            Err(stuck) => return Err(stuck),
        };
        let turn = equations.inner(&now.tangent, &next.point.tangent);
        let easy = next.point.iterations <= FEW && turn > STRAIGHT;
        let mut end = next.stop_at_edge(equations, now, step)?.map(End::at_edge);
        if let Some(first) = &self.first
            && end.is_none()
            && self.points.len() > CLOSED_AFTER
            && distance(first, &next.point) < CLOSED * step
            && let Some(point) = closed_at(equations, first, &next.point, step)
        {
            next.point = point;
            end = Some(End::Closed);
        }
        let turned = now.tangent.params[0] * next.point.tangent.params[0] < 0.0;
        if next.point.index != now.index || turned {
            let after = self.points.len() - 1;
            let distance = equations.inner(&chord(equations, now, &next.point), &now.tangent);
            let found = locate(equations, now, &next.point, distance);
            // If the branch turns back and no eigenvalue changes sign, it touches another one
            // where that crosses: the vertex of a pitchfork.
            let is_vertex = turned
                && next.point.index == now.index
                && found.as_ref().is_ok_and(|found| found.is_empty());
            let vertex =
                is_vertex.then(|| crossing_at_vertex(equations, now, &next.point, distance));
            let mut found = found.unwrap_or_default();
            let changes: usize = found.iter().map(|critical| critical.modes.len()).sum();
            let folds = found.iter().filter(|critical| critical.kind == Kind::Fold);
            let explained = changes == next.point.index.abs_diff(now.index)
                && (folds.count() % 2 == 1) == turned;
            if let Some(Ok(vertex)) = vertex {
                let known = self.critical.last().map(|(_, last)| last);
                let again = known.is_some_and(|known| known.is_at(&vertex));
                found.extend((!again).then_some(vertex));
            } else if !explained {
                // An unexplained change of the index: the step has led to another branch
                // nearby.
                if next.step > UNEXPLAINED * how.longest {
                    self.step = 0.5 * next.step;
                    return Ok(());
                }
                match is_vertex {
                    true => self.unmet.push(after),
                    false => self.missed.push(after),
                }
            }
            let all = found.into_iter();
            self.critical.extend(all.map(|point| (after, point)));
        }
        self.steps.push(next.step);
        self.points.push(next.point);
        self.end = end;
        if easy {
            self.step = (GROWTH * step).min(how.longest);
        }
        Ok(())
    }
}

impl Walk<'_> {
    /// Whether a step has presumably stayed on the branch.
    fn accepts(&self, equations: &Equations, now: &Point, found: &Found, step: f64) -> bool {
        let changes = found.point.index.abs_diff(now.index);
        equations.inner(&now.tangent, &found.point.tangent) > BENT
            && found.drift < DRIFT * step
            && (changes <= MOST_CHANGES || step < SHORT_ENOUGH * self.longest)
            && transverse_part(equations, now, &found.point) < ACROSS
    }
}

/// The difference of two points.
fn chord(equations: &Equations, a: &Point, b: &Point) -> Direction {
    Direction {
        increments: between(&a.state, &b.state, equations.first_node()),
        params: [b.fraction - a.fraction],
    }
}

/// The part of the chord between two points that is transverse to the mean of their
/// tangents.
fn transverse_part(equations: &Equations, a: &Point, b: &Point) -> f64 {
    let mean = equations.normalised(Direction {
        increments: plus(&a.tangent.increments, 1.0, &b.tangent.increments),
        params: [a.tangent.params[0] + b.tangent.params[0]],
    });
    let mut rest = chord(equations, a, b);
    let length = equations.inner(&rest, &rest).sqrt();
    let along = equations.inner(&rest, &mean);
    add(&mut rest.increments, -along, &mean.increments);
    rest.params[0] -= along * mean.params[0];
    equations.inner(&rest, &rest).sqrt() / length
}

/// Corrects a point near the first one until both agree in parameter, shape, tangent and
/// index; none if they do not.
fn closed_at(equations: &mut Equations, first: &Point, near: &Point, step: f64) -> Option<Point> {
    let mut near = near.clone();
    for _ in 0..CLOSING {
        let same = equations.inner(&near.tangent, &first.tangent);
        if same < BENT || near.index != first.index {
            return None;
        }
        if distance(&near, first) < SAME {
            return Some(near);
        }
        let shift = equations.inner(&chord(equations, &near, first), &first.tangent) / same;
        if shift.abs() > 2.0 * step {
            return None;
        }
        let moved = (equations.moved(&near.solution(), &near.tangent, shift)).ok()?;
        near = (equations.correct(&moved.state, moved.params[0], Some(&first.tangent))).ok()?;
    }
    None
}

/// Distance of two points: the larger of those of shape and parameter.
fn distance(a: &Point, b: &Point) -> f64 {
    larger(a.state.shift_to(&b.state), (a.fraction - b.fraction).abs())
}

impl Direction {
    /// The direction in which the parameter grows.
    pub fn growing(self) -> Self {
        match self.params[0] >= 0.0 {
            true => self,
            false => self.reversed(),
        }
    }
}
