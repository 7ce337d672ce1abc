//! Points of a boundary that are more than that: cusps, and crossings with another one.

use super::place::Place;
use super::search::{Lost, Search};
use super::sheet::Sheet;
use crate::branch::critical::Kind;
use crate::branch::equations::Stuck;

/// Evaluations in the search along the boundary.
const EVALUATIONS: usize = 25;

/// Accuracy along the boundary: at a cusp the numbers are known to its square; at a
/// crossing it is that of the numbers.
const ACCURACY: f64 = 1e-11;

/// The least change that tells a slope from rounding.
const LOCAL: f64 = 1e-7;

/// How far the point may lie from where it is expected, along the boundary.
const REACH: f64 = 0.3;

/// Accuracy of points on the way to it.
const EXACT: f64 = 1e-13;

/// Accuracy of points that are given a number.
const GIVEN: f64 = 1e-12;

/// What a point of a boundary is besides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Special {
    /// A curve of folds turns back: two folds meet and vanish.
    Cusp,
    /// Another mode becomes neutral, too: two boundaries cross or touch.
    Crossing,
}

impl Special {
    /// What is zero there, at a point of the boundary.
    fn value(self, place: &Place) -> f64 {
        match self {
            Special::Cusp => place.speed,
            Special::Crossing => {
                let others = place.others.iter().copied();
                let nearest = others.min_by(|a, b| a.abs().total_cmp(&b.abs()));
                nearest.unwrap_or(f64::INFINITY)
            }
        }
    }
}

/// The point of the boundary in the plane across its tangent that is so far along it.
pub fn onto(
    sheet: &mut Sheet,
    now: &Place,
    step: f64,
    accuracy: f64,
    furthest: f64,
) -> Result<(Place, f64), Lost> {
    let spot = sheet.moved(&now.spot, &now.tangent, step)?;
    let search = Search {
        spot: &spot,
        across: &now.normal,
        slope: now.slope,
        along: &now.tangent,
        held: &now.held,
        neutral: now.neutral,
        accuracy,
        furthest,
    };
    let found = search.run(sheet)?;
    let off = found.distance.abs();
    Ok((now.at(sheet, found)?, off))
}

/// The special point between two of a boundary, the second so far along the tangent of
/// the first.
fn locate(
    sheet: &mut Sheet,
    [now, next]: [&Place; 2],
    step: f64,
    special: Special,
) -> Result<Place, Lost> {
    let values = [now, next].map(|place| special.value(place));
    let slope = (values[1] - values[0]) / step;
    Ok(zero(sheet, now, special, slope, [-0.1 * step, 1.1 * step])?.0)
}

/// The special point near one that is nearly it, and the change of what is zero there with
/// the way along the boundary.
pub fn locate_near(
    sheet: &mut Sheet,
    near: &Place,
    special: Special,
) -> Result<(Place, f64), Lost> {
    let first = onto(sheet, near, 0.0, EXACT, REACH)?.0;
    let away = 1e-2;
    let second = onto(sheet, &first, away, EXACT, REACH)?.0;
    let slope = (special.value(&second) - special.value(&first)) / away;
    zero(sheet, &first, special, slope, [-REACH, REACH])
}

/// The zero by the secant method, from a point of the boundary.
fn zero(
    sheet: &mut Sheet,
    now: &Place,
    special: Special,
    mut slope: f64,
    [least, most]: [f64; 2],
) -> Result<(Place, f64), Lost> {
    let mut best = now.clone();
    let (mut at, mut value) = (0.0, special.value(now));
    let mut worse = 0;
    for _ in 0..EVALUATIONS {
        let step = -value / slope;
        if !step.is_finite() || !(least..=most).contains(&(at + step)) {
            return Err(Lost::Stuck(Stuck::NotConverged));
        }
        let (next, _) = onto(sheet, now, at + step, EXACT, REACH)?;
        let after = special.value(&next);
        if step.abs() > LOCAL {
            slope = (after - value) / step;
        }
        (at, value) = (at + step, after);
        match after.abs() < special.value(&best).abs() {
            true => best = next,
            false => worse += 1,
        }
        if step.abs() < ACCURACY || worse > 1 {
            return Ok((best, slope));
        }
    }
    Err(Lost::Stuck(Stuck::NotConverged))
}

/// The point of the boundary at a value of one of the numbers, about so far along the
/// tangent.
pub fn land(
    sheet: &mut Sheet,
    now: &Place,
    step: f64,
    which: usize,
    value: f64,
) -> Result<Place, Lost> {
    let mut spot = sheet.moved(&now.spot, &now.tangent, step)?;
    spot.place[which] = value;
    let (across, slope) = now.across_at(sheet, which);
    let along = sheet.number(which);
    let search = Search {
        spot: &spot,
        across: &across,
        slope,
        along: &along,
        held: &now.held,
        neutral: now.neutral,
        accuracy: GIVEN,
        furthest: 0.5,
    };
    let found = search.run(sheet)?;
    let mut place = now.at(sheet, found)?;
    place.spot.place[which] = value;
    Ok(place)
}

/// Special points between two of a boundary, the second so far along the tangent of the
/// first; more than one are not told apart.
pub fn special_between(
    sheet: &mut Sheet,
    [now, next]: [&Place; 2],
    step: f64,
) -> Result<Option<(Special, Place)>, Lost> {
    let cusp = now.kind == Kind::Fold && now.speed * next.speed < 0.0;
    let special = match (cusp, now.index.abs_diff(next.index)) {
        (false, 0) => return Ok(None),
        (true, 0) => Special::Cusp,
        (false, 1) => Special::Crossing,
        _ => return Err(Lost::Stuck(Stuck::NotConverged)),
    };
    let place = locate(sheet, [now, next], step, special)?;
    Ok(Some((special, place)))
}
