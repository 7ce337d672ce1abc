//! Following a branch on one grid.

use super::critical::{Critical, Kind, locate};
use super::equations::{Equations, Stuck, reversed};
use super::field::{add, between, plus};
use super::refine::on_finer;
use super::refined::Doubt;
use super::step::Found;
use super::{Point, Tangent};

/// First step as a part of the longest, and the shortest.
const FIRST: f64 = 0.25;
const SHORTEST: f64 = 1e-5;

/// Growth of the step where Newton's method needs at most so many iterations
/// and the branch turns little.
const GROWTH: f64 = 1.5;
const FEW: usize = 4;
const STRAIGHT: f64 = 0.97;

/// A branch that turns by more than this (cosine) in a step is not trusted to
/// be the same.
const BENT: f64 = 0.85;

/// Newton may move a predicted point by this part of the step.
const DRIFT: f64 = 0.5;

/// A step goes along the mean of the tangents at its ends but for a part of third
/// order. One with more than this part of it across them leads to another branch.
const ACROSS: f64 = 0.1;

/// More eigenvalues than this do not change their sign in one step, if it can
/// be shortened to this part of the longest.
const MOST_CHANGES: usize = 2;
const SHORT_ENOUGH: f64 = 0.02;

/// A change of the index that is not explained is taken as it is where steps
/// are shorter than this part of the longest.
const UNEXPLAINED: f64 = 1e-3;

/// A branch that comes to within this part of a step of its first point is
/// tried for being closed, after so many points: by so many steps into the plane
/// through that point which is normal to the branch. There the two must be the
/// same within `SAME` (radians, lengths, fractions).
const CLOSED: f64 = 1.0;
const CLOSED_AFTER: usize = 8;
const CLOSING: usize = 5;
const SAME: f64 = 1e-7;

/// Grids of a critical point, unless its tips need more.
const CRITICAL_GRIDS: usize = 4;

/// Whether these points are enough.
type Enough<'a> = dyn Fn(&[Point]) -> bool + 'a;

/// How to follow a branch.
#[derive(Clone, Copy)]
pub struct Walk<'a> {
    /// The longest step; the parameter's range is one, and so is a turn of all
    /// nodes by ten radians or a shift by one length.
    pub longest: f64,
    /// Most points.
    pub most: usize,
    /// Grids on which a critical point is found at least.
    pub critical_grids: usize,
    /// Whether enough is known once there are these points.
    pub enough: Option<&'a Enough<'a>>,
}

impl Walk<'_> {
    /// To wherever the branch ends.
    pub fn new(longest: f64, most: usize) -> Self {
        Walk {
            longest,
            most,
            critical_grids: CRITICAL_GRIDS,
            enough: None,
        }
    }
}

/// How a branch ended.
#[derive(Clone, Debug)]
pub enum End {
    /// At the end of the range.
    Reached,
    /// Back at the start of the range.
    Returned,
    /// Where it began.
    Closed,
    /// After as many points as were allowed.
    MostPoints,
    /// Where enough was known.
    Enough,
    /// No step however short could be made.
    Stuck(Stuck),
    /// What comes next is another thing on every grid up to the finest.
    Unverified(Doubt),
}

impl End {
    /// That of a branch that has come to this end of the range.
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
    /// Where its index changes: after which point, and what is there.
    pub critical: Vec<(usize, Critical)>,
    /// Changes of the index that could not be located: after which point.
    pub missed: Vec<usize>,
    /// How it ended, if it has.
    pub end: Option<End>,
    /// The first point on the present grid, if it is known there.
    first: Option<Point>,
    /// Length of the next step, and of those that were made.
    step: f64,
    steps: Vec<f64>,
}

/// Follows a branch on one grid from its first point in the direction of its
/// tangent, as long as the parameter is within its range. `progress` is told of
/// each point: how many there are, and the parameter.
pub fn walk(
    equations: &mut Equations,
    first: Point,
    how: &Walk,
    progress: &mut dyn FnMut(usize, f64),
) -> Branch {
    let mut branch = Branch::new(first, how);
    branch.go_on(equations, how, how.most, progress);
    branch
}

impl Branch {
    /// A branch of which the first point is known.
    pub fn new(first: Point, how: &Walk) -> Self {
        Branch {
            points: vec![first.clone()],
            critical: Vec::new(),
            missed: Vec::new(),
            end: None,
            first: Some(first),
            step: FIRST * how.longest,
            steps: Vec::new(),
        }
    }

    /// Goes on until there are so many points, or it ends.
    pub fn go_on(
        &mut self,
        equations: &mut Equations,
        how: &Walk,
        until: usize,
        progress: &mut dyn FnMut(usize, f64),
    ) {
        while self.end.is_none() && self.points.len() < until.min(how.most) {
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

    /// Forgets all behind the given point, and the end; the next step from it will be
    /// as long as the last one from it, or to it.
    pub fn go_back(&mut self, to: usize) {
        let made = self.steps.get(to).or(self.steps.last());
        self.step = *made.unwrap_or(&self.step);
        self.points.truncate(to + 1);
        self.steps.truncate(to);
        self.critical.retain(|(after, _)| *after < to);
        self.missed.retain(|after| *after < to);
        self.end = None;
    }

    /// Makes the next step so much shorter.
    pub fn shorten(&mut self, part: f64) {
        self.step *= part;
    }

    /// Leaves out a point between two others.
    pub fn leave_out(&mut self, number: usize) {
        self.points.remove(number);
        self.steps[number - 1] += self.steps.remove(number);
        let after = self.critical.iter_mut().map(|(after, _)| after);
        for after in after.chain(&mut self.missed) {
            *after -= usize::from(*after >= number);
        }
    }

    /// Whether there is a critical point right before or behind a point.
    pub fn is_near_critical(&self, number: usize) -> bool {
        let mut critical = self.critical.iter();
        critical.any(|(after, _)| *after == number || after + 1 == number)
    }

    /// Takes its last point to the grid with all segments halved.
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

    /// Makes a step from the last point, or shortens the next try. Fails where that is
    /// too short.
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
        let turn = equations.along(&now.tangent, &next.point.tangent);
        let mut end = next.arrive_at_edge(equations, now, step)?.map(End::at_edge);
        if let Some(first) = &self.first
            && end.is_none()
            && self.points.len() > CLOSED_AFTER
            && distance(first, &next.point) < CLOSED * step
            && let Some(point) = closing(equations, first, &next.point, step)
        {
            next.point = point;
            end = Some(End::Closed);
        }
        let turned = now.tangent.fraction * next.point.tangent.fraction < 0.0;
        if next.point.index != now.index || turned {
            let after = self.points.len() - 1;
            let way = equations.along(&chord(now, &next.point), &now.tangent);
            let found = locate(equations, now, &next.point, way);
            // A branch that turns round with no eigenvalue changing its sign touches
            // another where that one crosses: the vertex of a pitchfork.
            let vertex = turned
                && next.point.index == now.index
                && found.as_ref().is_ok_and(|found| found.is_empty());
            let found = found.unwrap_or_default();
            let changes: usize = found.iter().map(|critical| critical.modes.len()).sum();
            let folds = found.iter().filter(|critical| critical.kind == Kind::Fold);
            let explained = changes == next.point.index.abs_diff(now.index)
                && (folds.count() % 2 == 1) == turned;
            if !explained {
                // A change that nothing in between explains: this is another
                // branch, passing nearby.
                if next.step > UNEXPLAINED * how.longest {
                    self.step = 0.5 * next.step;
                    return Ok(());
                }
                if !vertex {
                    self.missed.push(after);
                }
            }
            let all = found.into_iter();
            self.critical.extend(all.map(|point| (after, point)));
        }
        self.steps.push(next.step);
        self.points.push(next.point);
        self.end = end;
        if next.iterations <= FEW && turn > STRAIGHT {
            self.step = (GROWTH * step).min(how.longest);
        }
        Ok(())
    }
}

impl Walk<'_> {
    /// Whether a step may be believed to have stayed on the branch.
    fn accepts(&self, equations: &Equations, now: &Point, found: &Found, step: f64) -> bool {
        let changes = found.point.index.abs_diff(now.index);
        equations.along(&now.tangent, &found.point.tangent) > BENT
            && found.drift < DRIFT * step
            && (changes <= MOST_CHANGES || step < SHORT_ENOUGH * self.longest)
            && across(equations, now, &found.point) < ACROSS
    }
}

/// The straight way from a point to another.
fn chord(a: &Point, b: &Point) -> Tangent {
    Tangent {
        increments: between(&a.state, &b.state),
        fraction: b.fraction - a.fraction,
    }
}

/// The part of the way from a point to another that lies across the mean of their
/// tangents.
fn across(equations: &Equations, a: &Point, b: &Point) -> f64 {
    let mean = equations.normalised(Tangent {
        increments: plus(&a.tangent.increments, 1.0, &b.tangent.increments),
        fraction: a.tangent.fraction + b.tangent.fraction,
    });
    let mut way = chord(a, b);
    let length = equations.along(&way, &way).sqrt();
    let along = equations.along(&way, &mean);
    add(&mut way.increments, -along, &mean.increments);
    way.fraction -= along * mean.fraction;
    equations.along(&way, &way).sqrt() / length
}

/// The point of the branch of `near` that is the branch's first again: in value,
/// shape, tangent and index.
fn closing(equations: &mut Equations, first: &Point, near: &Point, step: f64) -> Option<Point> {
    let mut near = near.clone();
    for _ in 0..CLOSING {
        let same = equations.along(&near.tangent, &first.tangent);
        if same < BENT || near.index != first.index {
            return None;
        }
        if distance(&near, first) < SAME {
            return Some(near);
        }
        let way = equations.along(&chord(&near, first), &first.tangent) / same;
        if way.abs() > 2.0 * step {
            return None;
        }
        let increments = &near.tangent.increments;
        let fraction = near.fraction + way * near.tangent.fraction;
        let state = (equations.moved(&near.state, fraction, increments, way)).ok()?;
        (near, _) = (equations.correct(&state, fraction, Some(&first.tangent))).ok()?;
    }
    None
}

/// Distance of two points: of the shapes, or in the parameter.
fn distance(a: &Point, b: &Point) -> f64 {
    (a.state.shift_to(&b.state)).max((a.fraction - b.fraction).abs())
}

impl Tangent {
    /// The direction in which the parameter grows, or shrinks.
    pub fn towards(self, growing: bool) -> Self {
        match (self.fraction >= 0.0) == growing {
            true => self,
            false => reversed(self),
        }
    }
}
