//! Intervals of the free numbers: from the curvature at the minimum where the sum of
//! squares follows it, and else from its profile.

use nalgebra::DVector;

use super::around::Around;
use super::end::{BETTER, Ends, STRAIGHT, Side, ends};
use super::judge::{Judge, OPEN};
use super::least_squares::{End, Iteration};
use super::model::Point;
use super::result::{FitParameter, FitStep};

/// Steps to an end of a profile, iterations at each, how exactly the least sum is
/// found there, in variances, and how exactly the end.
const PROFILE_STEPS: usize = 16;
const PROFILE_ITERATIONS: usize = 25;
const LEAST: f64 = 1e-2;
const PROFILE_ACCURACY: f64 = 0.01;

/// How often leaves may be lost on the way to an end of a profile.
const MOST_LOST: usize = 6;

/// The free numbers with their intervals. The shape of the sum of squares away from
/// the minimum is that of `shape`, which may be a minimum on coarser grids.
///
/// # Errors
/// With a point from which there is a better minimum.
pub(super) fn intervals(
    judge: &Judge,
    shape: &Judge,
    progress: &mut dyn FnMut(&FitStep),
) -> Result<Vec<FitParameter>, Point> {
    let around = Around::new(shape);
    let all = judge.values.len();
    (0..all)
        .map(|k| {
            let known = Some((k, all));
            let mut profiling = |step, sum| progress(&FitStep { step, sum, known });
            parameter(judge, (shape, around.as_ref()), k, &mut profiling)
        })
        .collect()
}

/// The free numbers where there is no minimum, and nothing is known of them but the
/// bounds that were given.
pub(super) fn without_intervals(judge: &Judge) -> Vec<FitParameter> {
    (0..judge.values.len()).map(|k| unknown(judge, k)).collect()
}

fn unknown(judge: &Judge, k: usize) -> FitParameter {
    let free = &judge.model.coordinates[k];
    let given = |bound: f64| free.bounded.then(|| free.value(bound));
    let [low, high] = free.bounds.map(given);
    FitParameter {
        key: free.keys.to_string(),
        value: free.value(judge.point.theta[k]),
        low,
        high,
        determined: false,
        profiled: false,
    }
}

fn parameter(
    judge: &Judge,
    (shape, around): (&Judge, Option<&Around>),
    k: usize,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<FitParameter, Point> {
    let free = &judge.model.coordinates[k];
    let theta = judge.point.theta[k];
    let mut parameter = unknown(judge, k);
    if !judge.feels(k) {
        return Ok(parameter);
    }
    let (low, high) = (parameter.low, parameter.high);
    let half = judge.quantile * judge.deviation(k).0;
    let mut sides = [Side::At(half), Side::At(half)];
    let (deviation, along) = shape.deviation(k);
    let first = shape.quantile * deviation;
    let few = around.and_then(|around| ends(around, k, first, half));
    let few = match few {
        Some(Ends::Straight) => None,
        Some(Ends::Apart(found)) => Some(found),
        None if half > OPEN || around.is_some() || !straight(shape, &along, first) => {
            Some([Err(half), Err(half)])
        }
        None => None,
    };
    if let Some(found) = few {
        parameter.profiled = true;
        let along = shape.conditional(k, OPEN);
        for ((side, sign), found) in sides.iter_mut().zip([-1.0, 1.0]).zip(found) {
            *side = match found {
                Ok(found) => found,
                Err(guess) => profile(shape, k, (sign * guess, &along), progress)?,
            };
        }
    }
    let end = |side: &Side, sign: f64, bound: f64, given: Option<f64>| match side {
        Side::At(reach) => {
            let end = theta + sign * reach;
            match (bound - end) * sign < 0.0 {
                // Beyond where it may be, or was let.
                true => given,
                false => Some(free.value(end)),
            }
        }
        Side::Open | Side::Lost => given,
    };
    let [down, up] = &sides;
    parameter.low = end(down, -1.0, free.bounds[0], low);
    parameter.high = end(up, 1.0, free.bounds[1], high);
    let near = |end: Option<f64>| end.is_some_and(|end| (free.of(end) - theta).abs() <= OPEN);
    parameter.determined = near(parameter.low) && near(parameter.high);
    Ok(parameter)
}

/// How far the sum of squares is above the minimum, in squared spreads.
fn above(judge: &Judge, point: &Point) -> f64 {
    let residuals = judge.weighing.residuals(point);
    let bound = judge.weighing.bound(&judge.residuals);
    let sum = |residuals: &DVector<f64>| judge.weighing.sum(residuals, bound);
    (sum(&residuals) - sum(&judge.residuals)) / judge.spread.powi(2)
}

/// Whether the sum of squares is, at the ends of an interval, what the curvature at
/// the minimum makes of it.
fn straight(judge: &Judge, along: &DVector<f64>, half: f64) -> bool {
    let expected = judge.quantile.powi(2);
    [-half, half].into_iter().all(|step| {
        let theta = moved(judge, judge.point, along, step);
        let there = judge.model.follow(judge.point, &theta);
        let above = there.map(|point| above(judge, &point));
        above.is_ok_and(|above| (above / expected - 1.0).abs() < STRAIGHT)
    })
}

fn moved(judge: &Judge, from: &Point, along: &DVector<f64>, step: f64) -> Vec<f64> {
    let coordinates = judge.model.coordinates.iter().enumerate();
    coordinates
        .map(|(k, free)| {
            let moved = from.theta[k] + step * along[k];
            moved.clamp(free.bounds[0], free.bounds[1])
        })
        .collect()
}

/// The end of an interval: where the least sum of squares over all others is as far
/// above the minimum as at the end of a normal one.
///
/// # Errors
/// With a point of a sum that is lower than that of the minimum.
fn profile(
    judge: &Judge,
    k: usize,
    (first, along): (f64, &DVector<f64>),
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Side, Point> {
    let sign = first.signum();
    let [low, high] = judge.model.coordinates[k].bounds;
    let to_bound = match sign < 0.0 {
        true => judge.point.theta[k] - low,
        false => high - judge.point.theta[k],
    };
    let most = (OPEN + 0.1).min(to_bound);
    let mut reach = first.abs().min(most);
    // Reach and root of the sum, on this side of the end and beyond; and a point from
    // which leaves are followed.
    let mut inside = (0.0, 0.0);
    let mut outside: Option<(f64, f64)> = None;
    let mut nearest: Option<Point> = None;
    let mut lost = 0;
    for _ in 0..PROFILE_STEPS {
        if most <= 0.0 {
            return Ok(Side::Open);
        }
        let from = nearest.as_ref().unwrap_or(judge.point);
        let start = moved(judge, from, along, sign * (reach - inside.0));
        let start = judge.model.follow(from, &start);
        let least = start.ok().map(|start| {
            let mut iteration = Iteration::new(judge.model, judge.weighing, progress);
            iteration.held[k] = true;
            iteration.most_steps = PROFILE_ITERATIONS;
            iteration.enough = LEAST;
            iteration.run(start)
        });
        let Some((least, End::Converged, _)) = least else {
            lost += 1;
            if lost > MOST_LOST {
                return Ok(Side::Lost);
            }
            reach = 0.5 * (inside.0 + reach);
            continue;
        };
        let above = above(judge, &least);
        if above < -BETTER {
            return Err(least);
        }
        let root = above.max(0.0).sqrt();
        if (root / judge.quantile - 1.0).abs() < PROFILE_ACCURACY {
            return Ok(Side::At(reach));
        }
        match root < judge.quantile {
            true => {
                inside = (reach, root);
                nearest = Some(least);
            }
            false => outside = Some((reach, root)),
        }
        reach = match outside {
            None if reach >= most => return Ok(Side::Open),
            None => {
                let factor = judge.quantile / root.max(0.3 * judge.quantile);
                (reach * factor * 1.05).min(most)
            }
            // The root of the sum is nearly linear.
            Some(outside) => {
                let part = (judge.quantile - inside.1) / (outside.1 - inside.1);
                inside.0 + part.clamp(0.1, 0.9) * (outside.0 - inside.0)
            }
        };
    }
    Ok(match outside {
        Some((end, _)) => Side::At(end),
        None => Side::Lost,
    })
}
