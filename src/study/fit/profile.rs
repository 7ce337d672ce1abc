//! Ends of intervals by whole fits: the number is held at one distance from the minimum after
//! another, and all others are fitted again.

use nalgebra::DVector;

use super::end::{BETTER, Reach};
use super::least_squares::{End, Iteration};
use super::model::Point;
use super::starts::MOST_STEPS;
use super::statistics::{OPEN, Statistics};

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
