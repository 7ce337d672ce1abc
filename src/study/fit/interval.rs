//! Intervals of the free numbers: from the curvature at the minimum if the sum of
//! squares is quadratic, else from its profile.

use nalgebra::DVector;

use super::end::{QUADRATIC, Reach, ends};
use super::model::Point;
use super::neighbourhood::Neighbourhood;
use super::profile::{Profile, above};
use super::result::{FitParameter, FitStep};
use super::statistics::{OPEN, Statistics};

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
