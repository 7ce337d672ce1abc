//! Following a boundary one way, step by step.

use rayon::prelude::*;

use super::grids::on_finer;
use super::halt::Halt;
use super::place::Place;
use super::plane::Plane;
use super::refine::{Accuracy, Step, refine};
use super::search::Lost;
use super::sheet::Sheet;
use super::special::{land, onto, special_between};
use super::table::Verified;
use crate::branch::equations::Stuck;
use crate::branch::refined::Doubt;
use crate::leaf::Grid;

/// First step as a part of the longest, and the shortest.
const FIRST: f64 = 0.25;
const SHORTEST: f64 = 1e-4;

/// Growth of the step where the boundary turns little.
const GROWTH: f64 = 1.5;
const STRAIGHT: f64 = 0.97;

/// A boundary, or the sheet across it, that turns by more than this (cosine) in a step is
/// not trusted to be the same.
const BENT: f64 = 0.85;

/// A point may lie off the prediction by this part of the step.
const DRIFT: f64 = 0.3;

/// Accuracy of points on the way, and of those that are given a number.
const ACCURACY: f64 = 1e-8;
const EXACT: f64 = 1e-12;

/// Points that are made before they are verified, side by side.
const AHEAD: usize = 8;

/// The finest grid to follow a boundary on, in segments.
const FINEST: usize = 256;

/// The start of the boundary again: numbers and shapes are the same within these.
const SAME: [f64; 2] = [1e-6, 1e-4];

/// How to follow a boundary.
#[derive(Clone, Copy, Debug)]
pub struct Stride {
    /// The longest step; each number's range is one, and so is a turn of all nodes by ten
    /// radians or a shift by one length.
    pub longest: f64,
    /// Most points.
    pub most: usize,
    /// Wanted accuracy.
    pub accuracy: Accuracy,
}

/// A boundary followed one way.
pub struct Walk<'a, 'h> {
    plane: Plane<'a>,
    how: &'h Stride,
    /// The second number where it began.
    second: f64,
    first: Place,
    /// Length of the next step.
    step: f64,
    steps: Vec<Step>,
    verified: Vec<Verified>,
    end: Option<Halt>,
    /// Matrices factorised on grids that were left, and to verify points.
    pub factorizations: usize,
}

impl<'a, 'h> Walk<'a, 'h> {
    /// From its first point, at which one of the numbers may be given.
    pub fn new(plane: Plane<'a>, how: &'h Stride, first: Place, given: Option<usize>) -> Self {
        Walk {
            plane,
            how,
            second: first.spot.place[1],
            first: first.clone(),
            step: FIRST * how.longest,
            steps: vec![Step {
                place: first,
                special: None,
                given,
            }],
            verified: Vec::new(),
            end: None,
            factorizations: 0,
        }
    }

    /// Goes on to its end; every point is verified, on finer grids where it must.
    pub fn run(
        &mut self,
        grid: Grid,
        needless: &dyn Fn() -> bool,
        progress: &mut dyn FnMut(usize, [f64; 2]),
    ) -> Halt {
        let mut sheet = match Sheet::new(self.plane, grid) {
            Ok(sheet) => sheet,
            Err(_) => return Halt::OutOfRange,
        };
        let mut counted = 0;
        loop {
            if needless() {
                return Halt::Closed;
            }
            // The next points are made while those before are verified, side by side.
            let (plane, accuracy, grid) = (self.plane, self.how.accuracy, sheet.grid().clone());
            let new = self.steps[self.verified.len()..].to_vec();
            let mut found = Vec::new();
            rayon::in_place_scope(|scope| {
                scope.spawn(|_| {
                    let each = new.par_iter();
                    found = each.map(|it| refine(plane, &grid, it, accuracy)).collect();
                });
                self.go_on(&mut sheet, AHEAD, progress);
            });
            self.factorizations += sheet.equations.factorizations - counted;
            counted = sheet.equations.factorizations;
            let all = new.len() + self.verified.len() == self.steps.len();
            let end = match (self.accept(found), self.end) {
                (None, Some(end)) if all => match end {
                    Halt::Stuck | Halt::Unfolded | Halt::Parted => end,
                    _ => return end,
                },
                (None, _) => continue,
                (Some(doubt), _) => Halt::Unverified(doubt),
            };
            // Perhaps a finer grid knows better.
            if !self.refine(&mut sheet) {
                return end;
            }
            counted = 0;
        }
    }

    /// Its points, verified. Grids move them at a given value of one number or of the other:
    /// where that changes a point may come to lie before the one before it, and is left out,
    /// unless it is the last or a special one.
    pub fn in_order(self) -> Vec<Verified> {
        let mut kept: Vec<(Step, Verified)> = Vec::new();
        let last = self.verified.len().saturating_sub(1);
        for (k, (step, point)) in self.steps.into_iter().zip(self.verified).enumerate() {
            let needed = k == last || step.special.is_some();
            if needed {
                while kept.len() > 1
                    && let Some((before, found)) = kept.last()
                    && before.special.is_none()
                    && goes_back([before, &step], [found, &point])
                {
                    kept.pop();
                }
            }
            let back =
                |(before, found): &(Step, Verified)| goes_back([before, &step], [found, &point]);
            if needed || !kept.last().is_some_and(back) {
                kept.push((step, point));
            }
        }
        kept.into_iter().map(|(_, point)| point).collect()
    }

    /// Makes so many further points, unless it comes to an end.
    fn go_on(
        &mut self,
        sheet: &mut Sheet,
        points: usize,
        progress: &mut dyn FnMut(usize, [f64; 2]),
    ) {
        let enough = self.steps.len() + points;
        while self.end.is_none() && self.steps.len() < enough {
            if self.steps.len() >= self.how.most {
                self.end = Some(Halt::MostPoints);
                break;
            }
            self.try_step(sheet);
            let last = &self.steps[self.steps.len() - 1];
            progress(self.steps.len(), last.place.spot.place);
        }
    }

    /// Keeps what was verified; forgets what cannot be, and what was made after that.
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

    /// Takes the last point to the grid with all segments halved; false where that is too
    /// fine, or has no such point.
    fn refine(&mut self, sheet: &mut Sheet<'a>) -> bool {
        if 2 * sheet.grid().segments() > FINEST {
            return false;
        }
        let mut on_finer = |place: &Place, given| {
            let (mut finer, near) = on_finer(sheet, place).ok()?;
            let place = match given {
                Some(which) => land(&mut finer, &near, 0.0, which, near.spot.place[which]),
                None => onto(&mut finer, &near, 0.0, ACCURACY, 1.0).map(|(place, _)| place),
            };
            Some((finer, place.ok()?))
        };
        let Some(last) = self.steps.last_mut() else {
            return false;
        };
        let (Some((_, first)), Some((finer, place))) = (
            on_finer(&self.first, Some(1)),
            on_finer(&last.place, last.given),
        ) else {
            return false;
        };
        (self.first, last.place) = (first, place);
        self.step *= 0.5;
        self.end = None;
        *sheet = finer;
        true
    }

    /// Makes a step from the last point, or shortens the next try; ends where that is too
    /// short.
    fn try_step(&mut self, sheet: &mut Sheet) {
        let now = self.steps[self.steps.len() - 1].place.clone();
        match self.advance(sheet, &now) {
            Ok((next, end)) => {
                self.steps.extend(next);
                self.end = end;
            }
            Err(_) if 0.5 * self.step >= SHORTEST * self.how.longest => self.step *= 0.5,
            Err(lost) => self.end = Some(lost.into()),
        }
    }

    /// The next points: special ones between, and that of the step itself.
    fn advance(
        &mut self,
        sheet: &mut Sheet,
        now: &Place,
    ) -> Result<(Vec<Step>, Option<Halt>), Lost> {
        let not_converged = || Lost::Stuck(Stuck::NotConverged);
        if leaves(now) {
            return Ok((Vec::new(), Some(Halt::Reached)));
        }
        let mut step = self.step;
        let mut given = self.edge(now, step, |which| {
            now.spot.place[which] + step * now.tangent.place[which]
        });
        if given.is_none() {
            let (next, off) = onto(sheet, now, step, ACCURACY, DRIFT * step)?;
            given = self.edge(now, step, |which| next.spot.place[which]);
            if given.is_none() {
                let turn = self.accepts(sheet, [now, &next], off, step)?;
                if turn > STRAIGHT {
                    self.step = (GROWTH * step).min(self.how.longest);
                }
                let mut steps = self.between(sheet, [now, &next], step)?;
                steps.push(Step {
                    place: next,
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
        let next = land(sheet, now, step, which, value)?;
        let off = sheet.way(&now.spot, &next.spot);
        let along = sheet.along(&off, &now.tangent);
        let off = (sheet.along(&off, &off) - along * along).max(0.0).sqrt();
        self.accepts(sheet, [now, &next], off, step)?;
        let edge = value == 0.0 || value == 1.0;
        let mut steps = self.between(sheet, [now, &next], step)?;
        let end = match () {
            () if edge => Some(Halt::Reached),
            () if self.is_first(sheet, &next) => Some(Halt::Closed),
            () => None,
        };
        steps.push(Step {
            place: next,
            special: None,
            given: Some(which),
        });
        Ok((steps, end))
    }

    /// The number, its value and the part of the step where this first leaves a range, or
    /// passes the second number's value at the start.
    fn edge(
        &self,
        now: &Place,
        step: f64,
        next: impl Fn(usize) -> f64,
    ) -> Option<(usize, f64, f64)> {
        let marks = [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0), (1, self.second)];
        let passed = marks.into_iter().filter_map(|(which, value)| {
            let (before, after) = (now.spot.place[which], next(which));
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

    /// Whether a step may be believed to have stayed on the boundary; by how much this
    /// turned.
    fn accepts(
        &self,
        sheet: &Sheet,
        [now, next]: [&Place; 2],
        off: f64,
        step: f64,
    ) -> Result<f64, Lost> {
        let turn = sheet.along(&now.tangent, &next.tangent);
        let tilt = sheet.along(&now.normal, &next.normal);
        match off <= DRIFT * step && turn > BENT && tilt > BENT {
            true => Ok(turn),
            false => Err(Lost::Stuck(Stuck::NotConverged)),
        }
    }

    /// Special points between two of a boundary.
    fn between(&self, sheet: &mut Sheet, pair: [&Place; 2], step: f64) -> Result<Vec<Step>, Lost> {
        let special = special_between(sheet, pair, step)?;
        let step = |(special, place)| Step {
            place,
            special: Some(special),
            given: None,
        };
        Ok(special.into_iter().map(step).collect())
    }

    fn is_first(&self, sheet: &Sheet, place: &Place) -> bool {
        let first = &self.first;
        (first.spot.place[0] - place.spot.place[0]).abs() < SAME[0]
            && first.spot.state.shift_to(&place.spot.state) < SAME[1]
            && sheet.along(&first.tangent, &place.tangent) > BENT
    }
}

/// Whether the verified points of two steps follow each other the other way.
fn goes_back(steps: [&Step; 2], found: [&Verified; 2]) -> bool {
    let way = |[a, b]: [[f64; 2]; 2]| [0, 1].map(|i| b[i] - a[i]);
    let [a, b] = [
        way(steps.map(|step| step.place.spot.place)),
        way(found.map(|point| point.place)),
    ];
    a[0] * b[0] + a[1] * b[1] < 0.0
}

/// Whether a point is at an end of a range, and the boundary goes on beyond.
fn leaves(now: &Place) -> bool {
    (0..2).any(|k| {
        let (at, way) = (now.spot.place[k], now.tangent.place[k]);
        at <= EXACT && way < 0.0 || at >= 1.0 - EXACT && way > 0.0
    })
}
