//! Ends of intervals by whole fits: the number is held at one distance from the minimum after
//! another, and all others are fitted again.

use nalgebra::DVector;

use super::end::{BETTER, Reach};
use super::least_squares::{End, Iteration};
use super::model::Point;
use super::statistics::{OPEN, Statistics};

/// Steps to an end of a profile, iterations at each, accuracy of the least sum there, in
/// variances, and accuracy of the end.
const PROFILE_STEPS: usize = 16;
const PROFILE_ITERATIONS: usize = 25;
const LEAST: f64 = 1e-2;
const PROFILE_ACCURACY: f64 = 0.01;

/// Largest number of lost leaves in the search for an end of a profile.
const MOST_LOST: usize = 6;

/// Where fits begin again for numbers that ran away: so far on the way from their initial values.
const BACK: [f64; 2] = [1.0 / 3.0, 0.0];

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

/// A lower sum may exist where leaves cannot be followed.
struct Unsettled;

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
        let stats = self.stats;
        let sign = first.signum();
        let most = (OPEN + 0.1).min(self.room(sign));
        let mut reach = first.abs().min(most);
        // Distance and root of the sum, inside and outside of the end; and a point from
        // which leaves are followed.
        let mut inside = (0.0, 0.0);
        let mut outside: Option<(f64, f64)> = None;
        let mut nearest: Option<Point> = None;
        let mut lost = 0;
        for _ in 0..PROFILE_STEPS {
            if most <= 0.0 {
                return Ok(None);
            }
            let from = nearest.as_ref().unwrap_or(stats.point);
            let Some(mut least) = self.fitted(from, sign * (reach - inside.0), progress) else {
                lost += 1;
                if lost > MOST_LOST {
                    return Ok(None);
                }
                reach = 0.5 * (inside.0 + reach);
                continue;
            };
            let root = |least: &Point| above(stats, least).max(0.0).sqrt() / stats.quantile;
            if root(&least) > 1.0 - PROFILE_ACCURACY {
                match self.back(&least, progress) {
                    Ok(lower) => least = lower.unwrap_or(least),
                    Err(Unsettled) => return Ok(None),
                }
            }
            if above(stats, &least) < -BETTER {
                return Err(least);
            }
            let root = root(&least);
            if (root - 1.0).abs() < PROFILE_ACCURACY {
                return Ok(Some(reach));
            }
            match root < 1.0 {
                true => {
                    inside = (reach, root);
                    nearest = Some(least);
                }
                false => outside = Some((reach, root)),
            }
            reach = match outside {
                None if reach >= most => return Ok(None),
                None => (reach / root.max(0.3) * 1.05).min(most),
                // The root of the sum is nearly linear.
                Some(outside) => {
                    let part = (1.0 - inside.1) / (outside.1 - inside.1);
                    inside.0 + part.clamp(0.1, 0.9) * (outside.0 - inside.0)
                }
            };
        }
        Ok(outside.map(|(end, _)| end))
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

    /// The minimum over all other numbers so far from a point.
    fn fitted(
        &self,
        from: &Point,
        step: f64,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Option<Point> {
        let model = self.stats.model;
        let start = model.moved(&from.theta, step, self.along);
        let start = model.follow(from, &start).ok()?;
        match self.others(start, progress) {
            (least, End::Converged) => Some(least),
            _ => None,
        }
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
    /// from where the data feel them.
    fn back(
        &self,
        least: &Point,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Result<Option<Point>, Unsettled> {
        if self.runaways.is_empty() {
            return Ok(None);
        }
        let (stats, model) = (self.stats, self.stats.model);
        let lowest = above(stats, least);
        let mut before: Option<Point> = None;
        let mut settled = true;
        for part in BACK {
            let mut theta = least.theta.clone();
            for &j in self.runaways {
                theta[j] = model.coordinates[j].on_the_way(stats.point.theta[j], part);
            }
            let from = before.as_ref().unwrap_or(least);
            let there = model.follow(from, &theta).ok();
            let Some(mut there) = there.or_else(|| model.find(&theta).ok()) else {
                settled = false;
                continue;
            };
            settled &= model.differentiate(&mut there).is_ok();
            let start = model.follow(&there, &theta);
            before = Some(there);
            let Ok(start) = start else {
                settled = false;
                continue;
            };
            let (found, end) = self.others(start, progress);
            if above(stats, &found) < lowest - LEAST {
                return Ok(Some(found));
            }
            settled &= end == End::Converged;
        }
        match settled {
            true => Ok(None),
            false => Err(Unsettled),
        }
    }
}
