//! Following a branch.

use super::critical::{Critical, locate};
use super::equations::{Equations, Stuck, reversed};
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

/// More eigenvalues than this do not change their sign in one step, if it can
/// be shortened to this part of the longest.
const MOST_CHANGES: usize = 2;
const SHORT_ENOUGH: f64 = 0.02;

/// A change of the index that is not explained is taken as it is where steps
/// are shorter than this part of the longest.
const UNEXPLAINED: f64 = 1e-3;

/// A branch that comes back to its first point to within this part of a step is
/// closed; looked for after so many points.
const CLOSED: f64 = 0.75;
const CLOSED_AFTER: usize = 8;

/// How to follow a branch.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    /// The longest step; the parameter's range is one, and so is a turn of all
    /// nodes by ten radians or a shift by one length.
    pub longest: f64,
    /// Most points.
    pub most: usize,
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
    /// No step however short could be made.
    Stuck(Stuck),
}

/// A branch on one grid.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Its points, in order.
    pub points: Vec<Point>,
    /// Where its index changes: after which point, and what is there.
    pub critical: Vec<(usize, Critical)>,
    /// Changes of the index that could not be located: after which point.
    pub missed: Vec<usize>,
    /// How it ended.
    pub end: End,
}

/// Follows a branch from its first point in the direction of its tangent, as
/// long as the parameter is within its range. `progress` is called with each point.
pub fn walk(
    equations: &mut Equations,
    first: Point,
    how: &Walk,
    progress: &mut dyn FnMut(&Point),
) -> Branch {
    let mut branch = Branch {
        points: vec![first.clone()],
        critical: Vec::new(),
        missed: Vec::new(),
        end: End::MostPoints,
    };
    let mut now = first.clone();
    let mut step = FIRST * how.longest;
    progress(&now);
    while branch.points.len() < how.most {
        let found = advance(equations, &now, step).and_then(|found| {
            match how.accepts(equations, &now, &found, step) {
                true => Ok(found),
                false => Err(Stuck::NotConverged),
            }
        });
        let mut next = match found {
            Ok(found) => found,
            Err(reason) => {
                step *= 0.5;
                if step < SHORTEST * how.longest {
                    branch.end = End::Stuck(reason);
                    return branch;
                }
                continue;
            }
        };
        let turned = equations.along(&now.tangent, &next.point.tangent);
        let edge = match arrive_at_edge(equations, &now, &mut next, step) {
            Ok(edge) => edge,
            Err(stuck) => {
                branch.end = End::Stuck(stuck);
                return branch;
            }
        };
        if next.point.index != now.index {
            let after = branch.points.len() - 1;
            let found = locate(equations, &now, &next.point, next.step).unwrap_or_default();
            let changes: usize = found.iter().map(|critical| critical.modes.len()).sum();
            if changes != next.point.index.abs_diff(now.index) {
                // A change that nothing in between explains: this is another
                // branch, passing nearby.
                if next.step > UNEXPLAINED * how.longest {
                    step = 0.5 * next.step;
                    continue;
                }
                branch.missed.push(after);
            }
            let all = found.into_iter();
            branch.critical.extend(all.map(|point| (after, point)));
        }
        let closed = edge.is_none()
            && branch.points.len() > CLOSED_AFTER
            && distance(&first, &next.point) < CLOSED * step;
        now = next.point;
        progress(&now);
        branch.points.push(now.clone());
        if let Some(end) = edge.or(closed.then_some(End::Closed)) {
            branch.end = end;
            return branch;
        }
        if next.iterations <= FEW && turned > STRAIGHT {
            step = (GROWTH * step).min(how.longest);
        }
    }
    branch
}

/// A point found by a step.
struct Found {
    point: Point,
    iterations: usize,
    /// Length of the step, along the tangent it was made from.
    step: f64,
    /// By how much Newton moved the prediction.
    drift: f64,
}

impl Walk {
    /// Whether a step may be believed to have stayed on the branch.
    fn accepts(&self, equations: &Equations, now: &Point, found: &Found, step: f64) -> bool {
        let changes = found.point.index.abs_diff(now.index);
        equations.along(&now.tangent, &found.point.tangent) > BENT
            && found.drift < DRIFT * step
            && (changes <= MOST_CHANGES || step < SHORT_ENOUGH * self.longest)
    }
}

/// One step along the branch.
fn advance(equations: &mut Equations, now: &Point, step: f64) -> Result<Found, Stuck> {
    let tangent = &now.tangent;
    let fraction = now.fraction + step * tangent.fraction;
    let state = equations.moved(&now.state, now.fraction, &tangent.increments, step)?;
    let (point, iterations) = equations.correct(&state, fraction, Some(tangent))?;
    let drift = (state.shift_to(&point.state)).max((point.fraction - fraction).abs());
    Ok(Found {
        point,
        iterations,
        step,
        drift,
    })
}

/// Shortens a step that leaves the range to end where the range does; returns
/// which end that is.
fn arrive_at_edge(
    equations: &mut Equations,
    now: &Point,
    next: &mut Found,
    step: f64,
) -> Result<Option<End>, Stuck> {
    let (edge, end) = match next.point.fraction {
        fraction if fraction > 1.0 => (1.0, End::Reached),
        fraction if fraction < 0.0 => (0.0, End::Returned),
        _ => return Ok(None),
    };
    let part = (edge - now.fraction) / (next.point.fraction - now.fraction);
    next.step = part * step;
    let increments = &now.tangent.increments;
    let state = equations.moved(&now.state, now.fraction, increments, next.step)?;
    (next.point, _) = equations.correct(&state, edge, None)?;
    if equations.along(&next.point.tangent, &now.tangent) < 0.0 {
        next.point.tangent = reversed(next.point.tangent.clone());
    }
    Ok(Some(end))
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
