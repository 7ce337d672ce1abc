//! Intervals of the free numbers: from the curvature at the minimum if the sum of
//! squares is quadratic, else from its profile.
//!
//! Ends of the intervals of numbers for which the sum of squares is not quadratic: from
//! a few points around the minimum, with derivatives at few of them.
//!
//! Ends of intervals by whole fits: the number is held at one distance from the minimum after
//! another, and all others are fitted again.
//!
//! Residuals near a minimum, and the least sum of squares for a given displacement of one
//! number.

use crate::relax::{Grids, Lost};
use crate::study::fit::least_squares::{End, Iteration};
use crate::study::fit::minima::MOST_STEPS;
use crate::study::fit::model::{CaseAt, Point};
use crate::study::fit::statistics::{OPEN, Statistics};
use crate::study::fit::{FitParameter, FitStep};
use nalgebra::{DMatrix, DVector};

/// The free numbers with their intervals. The shape of the sum of squares away from
/// the minimum is taken from `shape`, which may be a minimum on coarser grids.
///
/// # Errors
/// A point from which a better minimum is reached.
pub(super) fn intervals(
    stats: &Statistics,
    shape: &Statistics,
    progress: &mut dyn FnMut(&FitStep),
) -> Result<Vec<FitParameter>, Point> {
    let near = Neighbourhood::new(shape);
    let all = stats.values.len();
    (0..all)
        .map(|k| {
            let known = Some((k, all));
            let mut profiling = |step, sum| {
                progress(&FitStep {
                    step,
                    sum,
                    known,
                    budget: None,
                })
            };
            parameter(stats, (shape, near.as_ref()), k, &mut profiling)
        })
        .collect()
}

/// The free numbers without a minimum: nothing is known of them but the given bounds.
pub(super) fn without_intervals(stats: &Statistics) -> Vec<FitParameter> {
    (0..stats.values.len()).map(|k| unknown(stats, k)).collect()
}

fn unknown(stats: &Statistics, k: usize) -> FitParameter {
    let free = &stats.model.coordinates[k];
    let given = |bound: f64| free.bounded.then(|| free.value(bound));
    let [low, high] = free.bounds.map(given);
    FitParameter {
        key: free.number.to_string(),
        value: free.value(stats.point.theta[k]),
        low,
        high,
        standard_error: None,
        determined: false,
        profiled: false,
        lost: [None; 2],
    }
}

fn parameter(
    stats: &Statistics,
    (shape, near): (&Statistics, Option<&Neighbourhood>),
    k: usize,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<FitParameter, Point> {
    let free = &stats.model.coordinates[k];
    let theta = stats.point.theta[k];
    let mut parameter = unknown(stats, k);
    if !stats.is_sensitive_to(k) {
        return Ok(parameter);
    }
    let (low, high) = (parameter.low, parameter.high);
    let own = stats.deviation(k).0;
    parameter.standard_error = Some(own * free.slope(theta));
    let half = stats.quantile * own;
    let mut sides = [Reach::End(half); 2];
    let (deviation, along) = shape.deviation(k);
    let first = shape.quantile * deviation;
    let few = match near {
        Some(near) => ends(near, k, first, half),
        None if half > OPEN || !straight(shape, &along, first) => Some([Err(half), Err(half)]),
        None => None,
    };
    let runaways: Vec<usize> = (0..stats.values.len())
        .filter(|&j| j != k && shape.ran_away(j))
        .collect();
    let vague = (0..stats.values.len()).any(|j| j != k && shape.is_vague(j));
    // Derivatives do not lead to values far away at which the sum is lower, and ends are too near.
    let few = match runaways.is_empty() && !vague {
        true => few,
        false => {
            let guess = |side: Result<Reach, f64>| match side {
                Ok(Reach::End(end)) => Err(end),
                other => other,
            };
            Some(few.map_or([Err(first); 2], |sides| sides.map(guess)))
        }
    };
    if let Some(found) = few {
        parameter.profiled = true;
        let profile = Profile {
            stats: shape,
            k,
            along: &shape.conditional(k),
            runaways: &runaways,
        };
        for ((side, sign), found) in sides.iter_mut().zip([-1.0, 1.0]).zip(found) {
            *side = match found {
                Ok(found) => found,
                Err(guess) => profile.end(sign * guess, progress)?,
            };
        }
    }
    let end = |side: Reach, sign: f64, bound: f64, given: Option<f64>| {
        let end = match side {
            Reach::End(reach) => Some(theta + sign * reach),
            Reach::Open | Reach::Lost(_) => None,
        };
        // Outside the possible or permitted range.
        let inside = end.filter(|end| (bound - end) * sign >= 0.0);
        inside.map_or(given, |end| Some(free.value(end)))
    };
    let lost = |side: Reach, sign: f64| match side {
        Reach::Lost(reach) => Some(free.value(theta + sign * reach)),
        Reach::End(_) | Reach::Open => None,
    };
    let [down, up] = sides;
    parameter.lost = [lost(down, -1.0), lost(up, 1.0)];
    parameter.low = end(down, -1.0, free.bounds[0], low);
    parameter.high = end(up, 1.0, free.bounds[1], high);
    let near = |end: Option<f64>| end.is_some_and(|end| (free.of(end) - theta).abs() <= OPEN);
    // A bound at which the number stands is not an end that the data give.
    let at_bound = free.at_bound(theta).is_some();
    parameter.determined = !at_bound && near(parameter.low) && near(parameter.high);
    Ok(parameter)
}

/// Whether the sum of squares at the ends of an interval agrees with the quadratic
/// approximation at the minimum.
fn straight(stats: &Statistics, along: &DVector<f64>, half: f64) -> bool {
    let expected = stats.quantile.powi(2);
    [-half, half].into_iter().all(|step| {
        let theta = stats.model.moved(&stats.point.theta, step, along);
        let there = stats.model.follow(stats.point, &theta);
        let above = there.map(|point| above(stats, &point));
        above.is_ok_and(|above| (above / expected - 1.0).abs() < QUADRATIC)
    })
}

/// Largest relative deviation of the sum of squares from a quadratic at the ends of an interval;
/// beyond it the interval is taken from the profile of the sum.
pub(super) const QUADRATIC: f64 = 0.15;

/// Largest number of points in the search for an end before the full profile is computed, the
/// relative reduction still possible by a correction there, and the accuracy of the end.
const FEW: usize = 14;

const SETTLED: f64 = 0.1;

const NEAR_ENOUGH: f64 = 0.03;

/// A correction that leaves more than this part of the expected reduction has failed, and
/// the part of it that is taken next if it went too far.
const STAGNATION: f64 = 0.5;

const SHORTER: f64 = 0.5;

/// Largest number of lost leaves in the search.
const FEW_LOST: usize = 3;

/// A sum with a smaller relative error than this needs no further evaluation.
const CLEARLY: f64 = 0.3;

/// Excess below the minimum, in variances, that indicates a better minimum.
pub(super) const BETTER: f64 = 0.1;

/// Where a profile ends on one side of the minimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reach {
    /// At this distance.
    End(f64),
    /// Not within a factor of ten, nor before a bound.
    Open,
    /// Beyond this distance, up to which it does not, the other numbers could not be fitted.
    Lost(f64),
}

/// Residuals at a point near a minimum.
type EvaluatedPoint = (DVector<f64>, Point);

/// The ends of an interval below and above, from a few points around the minimum; as errors,
/// approximate distances that are not confirmed. `None` if they are those of the quadratic
/// approximation.
pub(super) fn ends(
    near: &Neighbourhood,
    k: usize,
    first: f64,
    half: f64,
) -> Option<[Result<Reach, f64>; 2]> {
    let stats = near.stats;
    let slopes = near.slopes();
    let along = stats.conditional(k);
    let mut known: Option<EvaluatedPoint> = None;
    if half <= OPEN {
        let expected = stats.quantile.powi(2);
        let off = |above: f64| (above / expected - 1.0).abs();
        let change = &along * first;
        let Ok(up) = near.residuals(stats.point, &near.moved(&change)) else {
            return Some([Err(half), Err(half)]);
        };
        // By reflection, to second order.
        let linear = &stats.jacobian * change;
        let down = &up.0 - &linear - &linear;
        let sides =
            [&up.0, &down].map(|residuals| near.least(&slopes, k, residuals, f64::INFINITY));
        let clear = |least: &Option<Least>| {
            (least.as_ref()).is_some_and(|least| off(least.above) < CLEARLY * QUADRATIC)
        };
        if sides.iter().all(clear) {
            return None;
        }
        known = Some(up);
    }
    let [low, high] = stats.model.coordinates[k].bounds;
    let theta = stats.point.theta[k];
    let distance = |sign: f64, room: f64, known: Option<EvaluatedPoint>| {
        let most = (OPEN + 0.1).min(room);
        let search = Search {
            near,
            k,
            at_minimum: &slopes,
            along: &along,
            sign,
            most,
            distance: first.min(most),
            curvature: DVector::zeros(along.len()),
            before: (0.0, 0.0),
            there: None,
            longest: f64::INFINITY,
            last: Correction {
                length: 0.0,
                from: f64::INFINITY,
                gain: f64::INFINITY,
            },
        };
        search.run(known.filter(|_| first <= most))
    };
    let down = distance(-1.0, theta - low, None);
    let up = distance(1.0, high - theta, known);
    let quadratic = half <= OPEN && [down, up] == [Ok(Reach::End(first)); 2];
    (!quadratic).then_some([down, up])
}

/// Search for the end of a profile on one side: along a parabola from the minimum, which
/// is corrected towards the least sum. Derivatives are those of the minimum until an end
/// is near, and then those where they last proved inaccurate.
struct Search<'s, 'j, 'm, 'a> {
    near: &'s Neighbourhood<'j, 'm, 'a>,
    k: usize,
    at_minimum: &'s Slopes,
    along: &'s DVector<f64>,
    sign: f64,
    /// Upper limit of the distance.
    most: f64,
    /// Present estimate of the distance of the end.
    distance: f64,
    curvature: DVector<f64>,
    /// Distance and root of the sum at the previous point.
    before: (f64, f64),
    /// Where derivatives are known, if not only at the minimum.
    there: Option<(Point, Slopes)>,
    longest: f64,
    last: Correction,
}

/// A correction of the other numbers towards the least sum.
struct Correction {
    length: f64,
    /// The sum before it, and its expected reduction.
    from: f64,
    gain: f64,
}

/// The search fails.
struct Failed;

/// The result at a point: the end if this is it, or none, if another point follows.
type Next = Result<Option<Reach>, Failed>;

impl Search<'_, '_, '_, '_> {
    /// Finds the end; `known` is the point at the first guess.
    ///
    /// # Errors
    /// The approximate distance of the end, if the search does not converge.
    fn run(mut self, mut known: Option<EvaluatedPoint>) -> Result<Reach, f64> {
        if self.most <= 0.0 {
            return Ok(Reach::Open);
        }
        let mut lost = 0;
        for step in 0..FEW {
            let Some(found) = known.take().or_else(|| self.point()) else {
                lost += 1;
                if lost > FEW_LOST {
                    break;
                }
                self.distance = 0.5 * (self.before.0 + self.distance);
                continue;
            };
            match self.evaluate(step == 0, found) {
                Ok(None) => {}
                Ok(Some(end)) => return Ok(end),
                Err(Failed) => break,
            }
        }
        Err(self.distance)
    }

    /// The leaves at the present estimate of the end.
    fn point(&self) -> Option<EvaluatedPoint> {
        let change =
            self.along * (self.sign * self.distance) + &self.curvature * self.distance.powi(2);
        let from = match &self.there {
            Some((point, _)) => point,
            None => self.near.stats.point,
        };
        let found = self.near.residuals(from, &self.near.moved(&change));
        found.ok()
    }

    fn least(&self, residuals: &DVector<f64>) -> Result<Least, Failed> {
        let slopes = match &self.there {
            Some((_, slopes)) => slopes,
            None => self.at_minimum,
        };
        let least = self.near.least(slopes, self.k, residuals, self.longest);
        least.ok_or(Failed)
    }

    /// Whether the sum is the least one, and that of an end.
    fn settled(&self, least: &Least) -> bool {
        let corrected = least.straight - least.above < SETTLED * least.above;
        corrected && (self.root(least) - 1.0).abs() < NEAR_ENOUGH
    }

    /// The root of the sum, normalised to one at an end.
    fn root(&self, least: &Least) -> f64 {
        least.above.max(0.0).sqrt() / self.near.stats.quantile
    }

    fn evaluate(&mut self, first: bool, (residuals, point): EvaluatedPoint) -> Next {
        let wanted = self.near.stats.quantile.powi(2);
        let mut least = self.least(&residuals)?;
        if least.straight < -BETTER {
            return Err(Failed);
        }
        if self.distance >= self.most && least.straight < wanted {
            return Ok(Some(Reach::Open));
        }
        if first && (least.above / wanted - 1.0).abs() < QUADRATIC {
            return Ok(Some(Reach::End(self.distance)));
        }
        let gain = least.straight - least.above;
        let stagnates = self.there.is_some() && gain > STAGNATION * self.last.gain;
        if stagnates || self.settled(&least) {
            // With the derivatives there it may be reduced further.
            self.there = Some(self.near.slopes_at(point).map_err(|_| Failed)?);
            least = self.least(&residuals)?;
            if self.settled(&least) {
                return Ok(Some(Reach::End(self.distance)));
            }
        }
        if stagnates {
            // The last correction went too far, or not far enough.
            self.longest = match least.straight > self.last.from {
                true => SHORTER * self.last.length,
                false => 2.0 * self.longest,
            };
            least = self.least(&residuals)?;
        }
        self.advance(&least)
    }

    fn advance(&mut self, least: &Least) -> Next {
        self.last = Correction {
            length: least.correction.norm(),
            from: least.straight,
            gain: least.straight - least.above,
        };
        self.curvature += &least.correction / self.distance.powi(2);
        // The root of the sum is nearly linear.
        let root = self.root(least);
        let secant = (root - self.before.1) / (self.distance - self.before.0);
        let wanted = self.near.stats.quantile.powi(2);
        let next = match &self.there {
            None if secant > 0.0 => self.distance + (1.0 - root) / secant,
            _ => self.distance + self.sign * least.step(wanted, self.sign),
        };
        if !next.is_finite() {
            return Err(Failed);
        }
        self.before = (self.distance, root);
        self.distance = next
            .clamp(0.5 * self.distance, 2.0 * self.distance)
            .min(self.most);
        Ok(None)
    }
}

/// Steps to an end of a profile, iterations at each, accuracy of the least sum there, in
/// variances, and accuracy of the end.
const PROFILE_STEPS: usize = 16;

const PROFILE_ITERATIONS: usize = 25;

const LEAST: f64 = 1e-2;

const PROFILE_ACCURACY: f64 = 0.01;

/// Largest number of distances at which the other numbers cannot be fitted, in the search for an
/// end of a profile, and number of the smaller steps by which leaves are followed there.
const MOST_LOST: usize = 6;

const SMALLER_STEPS: usize = 4;

/// Where fits begin again for numbers that ran away: so far on the way from their initial values.
const BACK: [f64; 3] = [1.0 / 3.0, 0.0, 2.0 / 3.0];

/// The profile of the sum of squares along a number.
pub(super) struct Profile<'s, 'm, 'a> {
    pub stats: &'s Statistics<'m, 'a>,
    pub k: usize,
    /// The changes of all numbers per change of this one.
    pub along: &'s DVector<f64>,
    /// Other numbers that ran away: there the data hardly feel them, and derivatives do not lead
    /// back to values at which the sum would be lower.
    pub runaways: &'s [usize],
}

/// A point of a profile.
struct ProfilePoint {
    distance: f64,
    /// The root of the sum, normalised to one at an end.
    root: f64,
    /// None at the minimum.
    point: Option<Point>,
}

/// Excess of the sum of squares over the minimum, in squared spreads.
pub(super) fn above(stats: &Statistics, point: &Point) -> f64 {
    let residuals = stats.weighting.residuals(point);
    let bound = stats.weighting.bound(&stats.residuals);
    let sum = |residuals: &DVector<f64>| stats.weighting.sum(residuals, bound);
    (sum(&residuals) - sum(&stats.residuals)) / stats.spread.powi(2)
}

impl Profile<'_, '_, '_> {
    /// The end of an interval: where the excess of the profile (the least sum of squares over all
    /// other numbers) is that at the end of a normal one. `first` is a guess of its distance, with
    /// its sign.
    ///
    /// # Errors
    /// A point with a lower sum than the minimum.
    pub fn end(&self, first: f64, progress: &mut dyn FnMut(usize, f64)) -> Result<Reach, Point> {
        let sign = first.signum();
        let most = (OPEN + 0.1).min(self.room(sign));
        if most <= 0.0 {
            return Ok(Reach::Open);
        }
        let mut reach = first.abs().min(most);
        let mut inside = ProfilePoint {
            distance: 0.0,
            root: 0.0,
            point: None,
        };
        let mut outside: Option<ProfilePoint> = None;
        // The nearest distance at which all fits failed.
        let mut lost = f64::INFINITY;
        let mut failures = 0;
        for _ in 0..PROFILE_STEPS {
            if self.stats.model.budget.is_used_up() {
                return Ok(Reach::Lost(inside.distance));
            }
            let least = self.least(sign * reach, &inside, outside.as_ref(), progress);
            let Some(mut least) = least else {
                failures += 1;
                if failures > MOST_LOST {
                    break;
                }
                lost = reach;
                reach = 0.5 * (inside.distance + reach);
                continue;
            };
            if self.root(&least) > 1.0 - PROFILE_ACCURACY {
                least = self.back(&least, progress).unwrap_or(least);
            }
            if above(self.stats, &least) < -BETTER {
                return Err(least);
            }
            let root = self.root(&least);
            if (root - 1.0).abs() < PROFILE_ACCURACY {
                return Ok(Reach::End(reach));
            }
            let known = ProfilePoint {
                distance: reach,
                root,
                point: Some(least),
            };
            match root < 1.0 {
                true => inside = known,
                false => outside = Some(known),
            }
            reach = match &outside {
                None if reach >= most => return Ok(Reach::Open),
                None => {
                    let next = (reach / root.max(0.3) * 1.05).min(most);
                    next.min(0.5 * (reach + lost))
                }
                // The root of the sum is nearly linear.
                Some(outside) => {
                    let part = (1.0 - inside.root) / (outside.root - inside.root);
                    let width = outside.distance - inside.distance;
                    inside.distance + part.clamp(0.1, 0.9) * width
                }
            };
        }
        Ok(match outside {
            Some(outside) if failures <= MOST_LOST => Reach::End(outside.distance),
            _ => Reach::Lost(inside.distance),
        })
    }

    /// The root of the sum, normalised to one at an end.
    fn root(&self, least: &Point) -> f64 {
        above(self.stats, least).max(0.0).sqrt() / self.stats.quantile
    }

    /// The distance of the bound on one side.
    fn room(&self, sign: f64) -> f64 {
        let [low, high] = self.stats.model.coordinates[self.k].bounds;
        let theta = self.stats.point.theta[self.k];
        match sign < 0.0 {
            true => theta - low,
            false => high - theta,
        }
    }

    /// The minimum over all other numbers at a distance from the minimum of all, with its sign. If it
    /// is not reached from inside, it is approached in smaller steps, from outside, and with leaves
    /// relaxed from their usual starts. `None` if all that fails.
    fn least(
        &self,
        distance: f64,
        inside: &ProfilePoint,
        outside: Option<&ProfilePoint>,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Option<Point> {
        let from = inside.point.as_ref().unwrap_or(self.stats.point);
        let sign = distance.signum();
        let step = distance - sign * inside.distance;
        let behind = outside.and_then(|known| {
            let step = distance - sign * known.distance;
            Some((known.point.as_ref()?, step))
        });
        let along = |from: &Point, step: f64| self.stats.model.moved(&from.theta, step, self.along);
        let followed =
            |from: &Point, step: f64| self.stats.model.follow(from, &along(from, step)).ok();
        let relaxed = |theta: &[f64]| self.stats.model.find_within(theta, MOST_STEPS).ok();
        let initial = || {
            let mut theta = self.initial();
            theta[self.k] = along(from, step)[self.k];
            theta
        };
        let ways: [&dyn Fn() -> Option<Point>; 5] = [
            &|| followed(from, step),
            &|| self.in_smaller_steps(from, step),
            &|| behind.and_then(|(point, step)| followed(point, step)),
            &|| relaxed(&along(from, step)),
            &|| relaxed(&initial()),
        ];
        ways.into_iter().find_map(|way| {
            let (least, end) = self.others(way()?, progress);
            // Without a minimum there, the least sum is still no larger.
            (end == End::Converged || self.root(&least) < 1.0).then_some(least)
        })
    }

    /// A point followed in smaller steps, at each of which the derivatives are new.
    fn in_smaller_steps(&self, from: &Point, step: f64) -> Option<Point> {
        let model = self.stats.model;
        let mut there: Option<Point> = None;
        for part in 1..=SMALLER_STEPS {
            let part = part as f64 / SMALLER_STEPS as f64;
            let theta = model.moved(&from.theta, part * step, self.along);
            let mut next = model.follow(there.as_ref().unwrap_or(from), &theta).ok()?;
            model.differentiate(&mut next).ok()?;
            there = Some(next);
        }
        there
    }

    /// The initial values.
    fn initial(&self) -> Vec<f64> {
        let coordinates = self.stats.model.coordinates.iter();
        coordinates.map(|free| free.start).collect()
    }

    /// From a point to a minimum over all other numbers.
    fn others(&self, start: Point, progress: &mut dyn FnMut(usize, f64)) -> (Point, End) {
        let mut iteration = Iteration::new(self.stats.model, self.stats.weighting, progress);
        iteration.held[self.k] = true;
        iteration.most_steps = PROFILE_ITERATIONS;
        iteration.enough = LEAST;
        let (least, end, _) = iteration.run(start);
        (least, end)
    }

    /// A lower sum with the same value of the number, if numbers that ran away are fitted again
    /// from where the data feel them. Where there is no leaf, there is no lower sum.
    fn back(&self, least: &Point, progress: &mut dyn FnMut(usize, f64)) -> Option<Point> {
        if self.runaways.is_empty() {
            return None;
        }
        let (stats, model) = (self.stats, self.stats.model);
        let lowest = above(stats, least);
        let mut before: Option<Point> = None;
        for part in BACK {
            let mut theta = least.theta.clone();
            for &j in self.runaways {
                theta[j] = model.coordinates[j].on_the_way(stats.point.theta[j], part);
            }
            let from = before.as_ref().unwrap_or(least);
            let there = model.follow(from, &theta).ok();
            let Some(mut there) = there.or_else(|| model.find_within(&theta, MOST_STEPS).ok())
            else {
                continue;
            };
            if model.differentiate(&mut there).is_err() {
                continue;
            }
            let start = model.follow(&there, &theta);
            before = Some(there);
            let Ok(start) = start else { continue };
            let (found, _) = self.others(start, progress);
            if above(stats, &found) < lowest - LEAST {
                return Some(found);
            }
        }
        None
    }
}

/// The neighbourhood of a minimum.
pub(super) struct Neighbourhood<'j, 'm, 'a> {
    pub stats: &'j Statistics<'m, 'a>,
    /// Numbers at a bound, which stay fixed.
    fixed: Vec<bool>,
}

/// Derivatives of the residuals, and the Gauss-Newton curvature of the sum of squares, slightly
/// regularised, so that combinations to which the data are insensitive do not change.
pub(super) struct Slopes {
    jacobian: DMatrix<f64>,
    curvature: DMatrix<f64>,
}

/// The least sum of squares with one number fixed away from the minimum.
pub(super) struct Least {
    /// Its excess over the minimum, in squared spreads.
    pub above: f64,
    /// The same if the other numbers do not change.
    pub straight: f64,
    /// The change of the other numbers.
    pub correction: DVector<f64>,
    /// Half of its first derivative, and half of its second derivative.
    slope: f64,
    bend: f64,
}

impl<'j, 'm, 'a> Neighbourhood<'j, 'm, 'a> {
    /// `None` if residuals have different weights, or derivatives are not known.
    pub fn new(stats: &'j Statistics<'m, 'a>) -> Option<Self> {
        let differentiated = |case: &CaseAt| case.responses.is_some();
        if stats.weighting.robust || !stats.point.cases.iter().all(differentiated) {
            return None;
        }
        let coordinates = stats.model.coordinates.iter().zip(&stats.point.theta);
        let fixed = coordinates.map(|(free, theta)| free.at_bound(*theta).is_some());
        Some(Neighbourhood {
            stats,
            fixed: fixed.collect(),
        })
    }

    pub fn slopes(&self) -> Slopes {
        self.slopes_of(self.stats.jacobian.clone())
    }

    /// Derivatives at another point, which stores them.
    pub fn slopes_at(&self, mut there: Point) -> Result<(Point, Slopes), Lost> {
        self.stats.model.differentiate(&mut there)?;
        let slopes = self.slopes_of(self.stats.weighting.jacobian(&there));
        Ok((there, slopes))
    }

    fn slopes_of(&self, mut jacobian: DMatrix<f64>) -> Slopes {
        let stats = self.stats;
        for k in (0..self.fixed.len()).filter(|&k| self.fixed[k]) {
            jacobian.column_mut(k).fill(0.0);
        }
        let count = stats.values.len();
        let least = (stats.quantile / OPEN).powi(2);
        let curvature = jacobian.tr_mul(&jacobian) / stats.spread.powi(2)
            + DMatrix::identity(count, count) * least;
        Slopes {
            jacobian,
            curvature,
        }
    }

    /// The values after a change from the minimum, clamped to the bounds.
    pub fn moved(&self, change: &DVector<f64>) -> Vec<f64> {
        let theta = &self.stats.point.theta;
        let mut moved = self.stats.model.moved(theta, 1.0, change);
        for k in (0..theta.len()).filter(|&k| self.fixed[k]) {
            moved[k] = theta[k];
        }
        moved
    }

    /// The residuals for other values, and their point, followed from a point with
    /// derivatives.
    pub fn residuals(&self, from: &Point, theta: &[f64]) -> Result<(DVector<f64>, Point), Lost> {
        let stats = self.stats;
        let there = stats.model.follow_on(from, theta, Grids::These)?;
        Ok((stats.weighting.residuals(&there), there))
    }

    /// The least sum of squares over all numbers but the `k`th, linearised where the residuals
    /// are these, with a step no longer than `longest`.
    pub fn least(
        &self,
        slopes: &Slopes,
        k: usize,
        residuals: &DVector<f64>,
        longest: f64,
    ) -> Option<Least> {
        let stats = self.stats;
        let mut curvature = slopes.curvature.clone();
        let mut coupled = -curvature.column(k);
        coupled[k] = 1.0;
        curvature.row_mut(k).fill(0.0);
        curvature.column_mut(k).fill(0.0);
        curvature[(k, k)] = 1.0;
        let variance = stats.spread.powi(2);
        let mut slope = slopes.jacobian.tr_mul(residuals) / variance;
        slope[k] = 0.0;
        let inverse = curvature.clone().cholesky()?;
        let along = inverse.solve(&coupled);
        let mut correction = -inverse.solve(&slope);
        let corrected = residuals + &slopes.jacobian * &correction;
        let change = &slopes.jacobian * &along;
        let mut damping = (stats.quantile / OPEN).powi(2);
        while correction.norm() > longest {
            damping *= 2.0;
            let count = curvature.nrows();
            let damped = &curvature + DMatrix::identity(count, count) * damping;
            correction = -damped.cholesky()?.solve(&slope);
        }
        let least = stats.residuals.norm_squared();
        let above = |residuals: &DVector<f64>| (residuals.norm_squared() - least) / variance;
        Some(Least {
            above: above(&corrected),
            straight: above(residuals),
            slope: corrected.dot(&change) / variance,
            bend: change.norm_squared() / variance,
            correction,
        })
    }
}

impl Least {
    /// The change of the number at which the least sum exceeds the minimum by `above`, with
    /// linearised residuals: the farther of two solutions, or the minimum of the excess if there
    /// are none.
    pub fn step(&self, above: f64, sign: f64) -> f64 {
        let root = self.slope.powi(2) - self.bend * (self.above - above);
        (sign * root.max(0.0).sqrt() - self.slope) / self.bend
    }
}
