//! Special points of a boundary: cusps, and crossings with another boundary.

use super::manifold::Manifold;
use super::singular_point::SingularPoint;
use crate::branch::events::critical::Kind;
use crate::branch::problem::equations::Stuck;

/// Largest number of evaluations in the search along the boundary.
const EVALUATIONS: usize = 25;

/// Accuracy along the boundary: at a cusp the parameters are accurate to its square; at a
/// crossing it is that of the parameters.
const SPECIAL_ACCURACY: f64 = 1e-11;

/// Differences over less than this do not give a reliable slope.
const LOCAL: f64 = 1e-7;

/// Largest distance of the point from its initial guess, along the boundary.
const REACH: f64 = 0.3;

/// Modes of which the eigenvalues are below this, relative to their derivative along the boundary,
/// become neutral at one crossing.
const TOGETHER: f64 = 1e-5;

/// Accuracy of the boundary points during the search.
const SPECIAL_EXACT: f64 = 1e-13;

/// Accuracy of points at a given parameter.
const GIVEN: f64 = 1e-12;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Special {
    /// A curve of folds turns back: two folds meet and vanish.
    Cusp,
    /// Another mode also becomes neutral: two boundaries cross or touch.
    Crossing,
}

impl Special {
    /// The function that vanishes there, at a point of the boundary.
    fn value(self, point: &SingularPoint) -> f64 {
        match self {
            Special::Cusp => point.speed,
            Special::Crossing => {
                let others = point.others.iter().copied();
                let nearest = others.min_by(|a, b| a.abs().total_cmp(&b.abs()));
                nearest.unwrap_or(f64::INFINITY)
            }
        }
    }
}

/// The point of the boundary in the plane normal to its tangent at a distance `step` along it.
pub fn at_distance(
    manifold: &mut Manifold,
    now: &SingularPoint,
    step: f64,
    accuracy: f64,
    furthest: f64,
) -> Result<(SingularPoint, f64), Stuck> {
    let solution = manifold.moved(&now.solution, &now.tangent, step)?;
    let search = now.search(manifold, None, solution, (accuracy, furthest));
    let found = search.secant(manifold)?;
    let off = found.distance.abs();
    Ok((now.completed(manifold, found)?, off))
}

/// The special point near an approximation to it, and the derivative of the vanishing function
/// along the boundary.
pub fn locate_near(
    manifold: &mut Manifold,
    near: &SingularPoint,
    special: Special,
) -> Result<(SingularPoint, f64), Stuck> {
    let first = at_distance(manifold, near, 0.0, SPECIAL_EXACT, REACH)?.0;
    let away = 1e-2;
    let second = at_distance(manifold, &first, away, SPECIAL_EXACT, REACH)?.0;
    let slope = (special.value(&second) - special.value(&first)) / away;
    zero(manifold, &first, special, slope, [-REACH, REACH])
}

/// The zero by a secant method, from a point of the boundary.
fn zero(
    manifold: &mut Manifold,
    now: &SingularPoint,
    special: Special,
    mut slope: f64,
    [least, most]: [f64; 2],
) -> Result<(SingularPoint, f64), Stuck> {
    let mut best = now.clone();
    let (mut at, mut value) = (0.0, special.value(now));
    let mut worse = 0;
    for _ in 0..EVALUATIONS {
        let step = -value / slope;
        if !step.is_finite() || !(least..=most).contains(&(at + step)) {
            return Err(Stuck::NotConverged);
        }
        let (next, _) = at_distance(manifold, now, at + step, SPECIAL_EXACT, REACH)?;
        let after = special.value(&next);
        if step.abs() > LOCAL {
            slope = (after - value) / step;
        }
        (at, value) = (at + step, after);
        match after.abs() < special.value(&best).abs() {
            true => best = next,
            false => worse += 1,
        }
        if step.abs() < SPECIAL_ACCURACY || worse > 1 {
            return Ok((best, slope));
        }
    }
    Err(Stuck::NotConverged)
}

/// The point of the boundary at a value of one of the parameters, predicted `step` along the
/// tangent.
pub fn at_value(
    manifold: &mut Manifold,
    now: &SingularPoint,
    step: f64,
    which: usize,
    value: f64,
) -> Result<SingularPoint, Stuck> {
    let mut solution = manifold.moved(&now.solution, &now.tangent, step)?;
    solution.params[which] = value;
    let search = now.search(manifold, Some(which), solution, (GIVEN, 0.5));
    let found = search.secant(manifold)?;
    let mut point = now.completed(manifold, found)?;
    point.solution.params[which] = value;
    Ok(point)
}

/// Special points between two points of a boundary, the second `step` along the tangent of the
/// first; fails if there is more than one. Several modes may become neutral together, as those of
/// the boundary do.
pub fn special_between(
    manifold: &mut Manifold,
    [now, next]: [&SingularPoint; 2],
    step: f64,
) -> Result<Option<(Special, SingularPoint)>, Stuck> {
    let cusp = now.kind == Kind::Fold && now.speed * next.speed < 0.0;
    let special = match (cusp, now.index.abs_diff(next.index)) {
        (false, 0) => return Ok(None),
        (true, 0) => Special::Cusp,
        (false, _) => Special::Crossing,
        _ => return Err(Stuck::NotConverged),
    };
    let slope = (special.value(next) - special.value(now)) / step;
    let (point, slope) = zero(manifold, now, special, slope, [-0.1 * step, 1.1 * step])?;
    let vanishing = point
        .others
        .iter()
        .filter(|it| it.abs() < TOGETHER * slope.abs());
    match special == Special::Cusp || vanishing.count() == now.index.abs_diff(next.index) {
        true => Ok(Some((special, point))),
        false => Err(Stuck::NotConverged),
    }
}
