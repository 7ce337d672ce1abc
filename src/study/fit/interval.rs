//! Intervals of the free numbers: from the curvature at the minimum where the sum of
//! squares follows it, and else from its profile.

use nalgebra::DVector;

use super::around::{Around, Least, Slopes};
use super::judge::{Judge, OPEN};
use super::least_squares::{End, Iteration};
use super::model::Point;
use super::result::FitParameter;

/// The sum of squares at the ends of an interval may be off by this part before the
/// interval is taken from the profile of the sum.
const STRAIGHT: f64 = 0.15;

/// Steps to an end of a profile, iterations at each, how exactly the least sum is
/// found there, in variances, and how exactly the end.
const PROFILE_STEPS: usize = 16;
const PROFILE_ITERATIONS: usize = 25;
const LEAST: f64 = 1e-2;
const PROFILE_ACCURACY: f64 = 0.01;

/// Points by which an end is looked for before the whole profile is, what part of the sum
/// a correction may still take off there, and how exactly it is found.
const FEW: usize = 14;
const SETTLED: f64 = 0.1;
const NEAR_ENOUGH: f64 = 0.03;

/// Part of a correction that is taken where the one before went too far.
const SHORTER: f64 = 0.5;

/// How often leaves may be lost on the way to them.
const FEW_LOST: usize = 3;

/// A sum that is off by no more than this part of what may be needs no other look.
const CLEARLY: f64 = 0.5;

/// How often leaves may be lost on the way to an end of a profile.
const MOST_LOST: usize = 6;

/// A sum of squares so far below the minimum, in variances, belongs to a better one.
const BETTER: f64 = 0.1;

/// Where a profile ends.
enum Side {
    /// So far from the minimum.
    At(f64),
    /// Not within a factor of ten, nor before a bound.
    Open,
    /// Leaves cannot be followed there.
    Lost,
}

/// The free numbers with their intervals. The shape of the sum of squares away from
/// the minimum is that of `shape`, which may be a minimum on coarser grids.
///
/// # Errors
/// With a point from which there is a better minimum.
pub(super) fn intervals(
    judge: &Judge,
    shape: &Judge,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Vec<FitParameter>, Point> {
    let around = Around::new(shape);
    let numbers = 0..judge.values.len();
    numbers
        .map(|k| parameter(judge, (shape, around.as_ref()), k, progress))
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

/// What a few points around a minimum tell of the ends of an interval.
enum Ends {
    /// They are where the curvature has them,
    Straight,
    /// or elsewhere, below and above; or about so far where the points do not tell.
    Apart([Result<Side, f64>; 2]),
}

/// Residuals at a point near a minimum.
type Known = (DVector<f64>, Point);

/// The ends of an interval by a few points around the minimum; `None` where there are none.
fn ends(around: &Around, k: usize, first: f64, half: f64) -> Option<Ends> {
    let judge = around.judge;
    let slopes = around.slopes();
    let along = judge.conditional(k, OPEN);
    let mut known: Option<Known> = None;
    if half <= OPEN {
        let expected = judge.quantile.powi(2);
        let off = |above: f64| (above / expected - 1.0).abs();
        let change = &along * first;
        let up = around.residuals(judge.point, &around.moved(&change)).ok()?;
        // To second order the other side is its mirror image.
        let linear = &judge.jacobian * change;
        let down = &up.0 - &linear - &linear;
        let sides =
            [&up.0, &down].map(|residuals| around.least(&slopes, k, residuals, f64::INFINITY));
        let clear = |least: &Option<Least>| {
            (least.as_ref()).is_some_and(|least| off(least.above) < CLEARLY * STRAIGHT)
        };
        if sides.iter().all(clear) {
            return Some(Ends::Straight);
        }
        known = Some(up);
    }
    let [low, high] = judge.model.coordinates[k].bounds;
    let theta = judge.point.theta[k];
    let reach = |sign: f64, room: f64, known: Option<Known>| {
        let most = (OPEN + 0.1).min(room);
        let known = known.filter(|_| first <= most);
        let reach = (sign, first.min(most), most);
        self::reach(around, (k, &slopes, &along), reach, known)
    };
    let down = reach(-1.0, theta - low, None);
    let up = reach(1.0, high - theta, known);
    let same = |side: &Result<Side, f64>| matches!(side, Ok(Side::At(reach)) if *reach == first);
    Some(match same(&down) && same(&up) && half <= OPEN {
        true => Ends::Straight,
        false => Ends::Apart([down, up]),
    })
}

/// The end of a profile on one side, from a first guess and not beyond what is most:
/// along a parabola from the minimum, which is bent to where the sum is least.
/// Derivatives are those of the minimum until an end is near, and then those there. `known`
/// is what is found at the guess.
///
/// # Errors
/// With how far the end may be, where that does not settle.
fn reach(
    around: &Around,
    (k, at_minimum, along): (usize, &Slopes, &DVector<f64>),
    (sign, first, most): (f64, f64, f64),
    mut known: Option<Known>,
) -> Result<Side, f64> {
    if most <= 0.0 {
        return Ok(Side::Open);
    }
    let judge = around.judge;
    let wanted = judge.quantile.powi(2);
    let mut reach = first;
    let mut bend = DVector::zeros(along.len());
    // Reach and root of the sum there.
    let mut before = (0.0, 0.0);
    let mut there: Option<(Point, Slopes)> = None;
    // The longest correction, the last one, from what sum, and what it was to gain.
    let (mut longest, mut corrected) = (f64::INFINITY, 0.0);
    let (mut straight, mut to_gain) = (f64::INFINITY, f64::INFINITY);
    let mut lost = 0;
    for step in 0..FEW {
        let theta = around.moved(&(along * (sign * reach) + &bend * reach.powi(2)));
        let (from, mut slopes) = match &there {
            Some((point, slopes)) => (point, slopes),
            None => (judge.point, at_minimum),
        };
        let found = known
            .take()
            .map_or_else(|| around.residuals(from, &theta), Ok);
        let Ok((residuals, point)) = found else {
            lost += 1;
            if lost > FEW_LOST {
                break;
            }
            reach = 0.5 * (before.0 + reach);
            continue;
        };
        let Some(mut least) = around.least(slopes, k, &residuals, longest) else {
            break;
        };
        if least.straight < -BETTER {
            break;
        }
        if reach >= most && least.straight < wanted {
            return Ok(Side::Open);
        }
        if step == 0 && (least.above / wanted - 1.0).abs() < STRAIGHT {
            return Ok(Side::At(reach));
        }
        let settled = |least: &Least| {
            let root = least.above.max(0.0).sqrt() / judge.quantile;
            let corrected = least.straight - least.above < SETTLED * least.above;
            corrected && (root - 1.0).abs() < NEAR_ENOUGH
        };
        let stagnates = there.is_some() && least.straight - least.above > 0.5 * to_gain;
        if settled(&least) || stagnates {
            // By the derivatives there it may be lower still.
            there = around.slopes_at(point).ok();
            slopes = match &there {
                Some((_, slopes)) => slopes,
                None => break,
            };
            match around.least(slopes, k, &residuals, longest) {
                Some(found) => least = found,
                None => break,
            }
            if settled(&least) {
                return Ok(Side::At(reach));
            }
        }
        to_gain = least.straight - least.above;
        if stagnates {
            // The last correction went too far, or not far enough.
            longest = match least.straight > straight {
                true => SHORTER * corrected,
                false => 2.0 * longest,
            };
            match around.least(slopes, k, &residuals, longest) {
                Some(shorter) => least = shorter,
                None => break,
            }
        }
        (corrected, straight) = (least.correction.norm(), least.straight);
        bend += &least.correction / reach.powi(2);
        // The root of the sum is nearly linear.
        let root = least.above.max(0.0).sqrt() / judge.quantile;
        let secant = (root - before.1) / (reach - before.0);
        let next = match &there {
            None if secant > 0.0 => reach + (1.0 - root) / secant,
            _ => reach + sign * least.step(wanted, sign),
        };
        if !next.is_finite() {
            break;
        }
        before = (reach, root);
        reach = next.clamp(0.5 * reach, 2.0 * reach).min(most);
    }
    Err(reach)
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
