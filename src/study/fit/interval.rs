//! Intervals of the free numbers: from the curvature at the minimum if the sum of
//! squares is quadratic, else from its profile.

use nalgebra::DVector;

use super::end::{BETTER, QUADRATIC, Reach, ends};
use super::least_squares::{End, Iteration};
use super::model::Point;
use super::neighbourhood::Neighbourhood;
use super::result::{FitParameter, FitStep};
use super::statistics::{OPEN, Statistics};

/// Steps to an end of a profile, iterations at each, accuracy of the least sum there, in
/// variances, and accuracy of the end.
const PROFILE_STEPS: usize = 16;
const PROFILE_ITERATIONS: usize = 25;
const LEAST: f64 = 1e-2;
const PROFILE_ACCURACY: f64 = 0.01;

/// Largest number of lost leaves in the search for an end of a profile.
const MOST_LOST: usize = 6;

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
            let mut profiling = |step, sum| progress(&FitStep { step, sum, known });
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
        key: free.keys.to_string(),
        value: free.value(stats.point.theta[k]),
        low,
        high,
        determined: false,
        profiled: false,
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
    let half = stats.quantile * stats.deviation(k).0;
    let mut sides = [Some(half), Some(half)];
    let (deviation, along) = shape.deviation(k);
    let first = shape.quantile * deviation;
    let few = match near {
        Some(near) => ends(near, k, first, half),
        None if half > OPEN || !straight(shape, &along, first) => Some([Err(half), Err(half)]),
        None => None,
    };
    if let Some(found) = few {
        parameter.profiled = true;
        let along = shape.conditional(k);
        for ((side, sign), found) in sides.iter_mut().zip([-1.0, 1.0]).zip(found) {
            *side = match found {
                Ok(found) => found,
                Err(guess) => profile(shape, k, (sign * guess, &along), progress)?,
            };
        }
    }
    let end = |side: Reach, sign: f64, bound: f64, given: Option<f64>| {
        let end = side.map(|reach| theta + sign * reach);
        // Outside the possible or permitted range.
        let inside = end.filter(|end| (bound - end) * sign >= 0.0);
        inside.map_or(given, |end| Some(free.value(end)))
    };
    let [down, up] = sides;
    parameter.low = end(down, -1.0, free.bounds[0], low);
    parameter.high = end(up, 1.0, free.bounds[1], high);
    let near = |end: Option<f64>| end.is_some_and(|end| (free.of(end) - theta).abs() <= OPEN);
    parameter.determined = near(parameter.low) && near(parameter.high);
    Ok(parameter)
}

/// Excess of the sum of squares over the minimum, in squared spreads.
fn above(stats: &Statistics, point: &Point) -> f64 {
    let residuals = stats.weighting.residuals(point);
    let bound = stats.weighting.bound(&stats.residuals);
    let sum = |residuals: &DVector<f64>| stats.weighting.sum(residuals, bound);
    (sum(&residuals) - sum(&stats.residuals)) / stats.spread.powi(2)
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

/// The end of an interval: where the excess of the profile (the least sum of squares over all
/// other numbers) is that at the end of a normal one.
///
/// # Errors
/// A point with a lower sum than the minimum.
fn profile(
    stats: &Statistics,
    k: usize,
    (first, along): (f64, &DVector<f64>),
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Reach, Point> {
    let sign = first.signum();
    let [low, high] = stats.model.coordinates[k].bounds;
    let to_bound = match sign < 0.0 {
        true => stats.point.theta[k] - low,
        false => high - stats.point.theta[k],
    };
    let most = (OPEN + 0.1).min(to_bound);
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
        let start = (stats.model).moved(&from.theta, sign * (reach - inside.0), along);
        let start = stats.model.follow(from, &start);
        let least = start.ok().map(|start| {
            let mut iteration = Iteration::new(stats.model, stats.weighting, progress);
            iteration.held[k] = true;
            iteration.most_steps = PROFILE_ITERATIONS;
            iteration.enough = LEAST;
            iteration.run(start)
        });
        let Some((least, End::Converged, _)) = least else {
            lost += 1;
            if lost > MOST_LOST {
                return Ok(None);
            }
            reach = 0.5 * (inside.0 + reach);
            continue;
        };
        let above = above(stats, &least);
        if above < -BETTER {
            return Err(least);
        }
        let root = above.max(0.0).sqrt();
        if (root / stats.quantile - 1.0).abs() < PROFILE_ACCURACY {
            return Ok(Some(reach));
        }
        match root < stats.quantile {
            true => {
                inside = (reach, root);
                nearest = Some(least);
            }
            false => outside = Some((reach, root)),
        }
        reach = match outside {
            None if reach >= most => return Ok(None),
            None => {
                let factor = stats.quantile / root.max(0.3 * stats.quantile);
                (reach * factor * 1.05).min(most)
            }
            // The root of the sum is nearly linear.
            Some(outside) => {
                let part = (stats.quantile - inside.1) / (outside.1 - inside.1);
                inside.0 + part.clamp(0.1, 0.9) * (outside.0 - inside.0)
            }
        };
    }
    Ok(outside.map(|(end, _)| end))
}
