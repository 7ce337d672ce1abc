//! Special points of a boundary: cusps, and crossings with another boundary.
//!
//! A test function vanishes there, the speed of the fold in the parameter plane or another
//! eigenvalue of H; its zero along the boundary is found by a secant method.

use crate::branch::boundary::point_search::{BoundarySearchTolerance, TwoParameterEquations};
use crate::branch::boundary::singular_point::{COINCIDENT_EIGENVALUE_TOLERANCE, SingularPoint};
use crate::branch::critical::{CriticalKind, SecantLimits};
use crate::branch::equations::CorrectorFailure;

/// The search along the boundary: at a cusp the parameters are accurate to the square of the
/// accuracy; at a crossing they are as accurate.
const SECANT: SecantLimits = SecantLimits {
    evaluations: 25,
    accuracy: 1e-11,
    shortest_slope_difference: 1e-7,
};

/// Largest distance of the special point from its initial guess, along the boundary; and that of
/// a point of the boundary from its prediction, across it.
const LARGEST_SEARCH_DISTANCE: f64 = 0.3;

/// The search for points of the boundary at which the test function is evaluated.
const SEARCH_POINT_TOLERANCE: BoundarySearchTolerance = BoundarySearchTolerance {
    accuracy: 1e-13,
    largest_distance: LARGEST_SEARCH_DISTANCE,
};

/// The search for a point of the boundary at a value of one parameter, from its prediction.
const GIVEN_PARAMETER_TOLERANCE: BoundarySearchTolerance = BoundarySearchTolerance {
    accuracy: 1e-12,
    largest_distance: 0.5,
};

/// Distance along the boundary from the special point's approximation to the point with which the
/// first slope is differenced.
const FIRST_SLOPE_DISTANCE: f64 = 1e-2;

/// Why a point of a boundary is special.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodimensionTwoKind {
    /// A curve of folds turns back: two folds meet and vanish.
    Cusp,
    /// Another mode also becomes neutral: two boundaries cross or touch.
    Crossing,
}

impl CodimensionTwoKind {
    /// The function that vanishes there, at a point of the boundary.
    fn test_function(self, point: &SingularPoint) -> f64 {
        match self {
            CodimensionTwoKind::Cusp => point.fold_speed,
            CodimensionTwoKind::Crossing => {
                let others = point.others.iter().copied();
                let nearest = others.min_by(|a, b| a.abs().total_cmp(&b.abs()));
                nearest.unwrap_or(f64::INFINITY)
            }
        }
    }
}

/// A point of a boundary at which a test function along the boundary vanishes.
pub struct CodimensionTwoPoint {
    pub kind: CodimensionTwoKind,
    pub point: SingularPoint,
    /// Derivative of the test function with respect to arclength along the boundary.
    pub slope: f64,
}

/// A point of a boundary found from a prediction along the tangent.
pub struct PredictedBoundaryPoint {
    pub point: SingularPoint,
    /// Distance of the point from the prediction.
    pub prediction_error: f64,
}

/// The point of the boundary in the plane normal to its tangent at a distance `step` along it.
pub fn boundary_point_at_distance(
    manifold: &mut TwoParameterEquations,
    now: &SingularPoint,
    step: f64,
    tolerance: BoundarySearchTolerance,
) -> Result<PredictedBoundaryPoint, CorrectorFailure> {
    let solution = manifold.displace_along_direction(&now.solution, &now.tangent, step)?;
    let search = now.search(manifold, None, solution, tolerance);
    let found = search.secant(manifold)?;
    let prediction_error = found.distance.abs();
    Ok(PredictedBoundaryPoint {
        point: now.with_own_directions(manifold, found)?,
        prediction_error,
    })
}

/// The special point near an approximation to it.
pub fn locate_codimension_two(
    manifold: &mut TwoParameterEquations,
    near: &SingularPoint,
    special: CodimensionTwoKind,
) -> Result<CodimensionTwoPoint, CorrectorFailure> {
    let mut at = |from: &SingularPoint, step: f64| {
        boundary_point_at_distance(manifold, from, step, SEARCH_POINT_TOLERANCE)
            .map(|found| found.point)
    };
    let away = FIRST_SLOPE_DISTANCE;
    let first = at(near, 0.0)?;
    let second = at(&first, away)?;
    let slope = (special.test_function(&second) - special.test_function(&first)) / away;
    secant_codimension_two(
        manifold,
        &first,
        special,
        slope,
        [-LARGEST_SEARCH_DISTANCE, LARGEST_SEARCH_DISTANCE],
    )
}

/// The zero by a secant method, from a point of the boundary.
fn secant_codimension_two(
    manifold: &mut TwoParameterEquations,
    now: &SingularPoint,
    special: CodimensionTwoKind,
    mut slope: f64,
    [least, most]: [f64; 2],
) -> Result<CodimensionTwoPoint, CorrectorFailure> {
    let mut best = now.clone();
    let (mut at, mut value) = (0.0, special.test_function(now));
    let mut worse = 0;
    for _ in 0..SECANT.evaluations {
        let step = -value / slope;
        if !step.is_finite() || !(least..=most).contains(&(at + step)) {
            return Err(CorrectorFailure::NotConverged);
        }
        let next = boundary_point_at_distance(manifold, now, at + step, SEARCH_POINT_TOLERANCE)?;
        let next = next.point;
        let after = special.test_function(&next);
        if step.abs() > SECANT.shortest_slope_difference {
            slope = (after - value) / step;
        }
        (at, value) = (at + step, after);
        match after.abs() < special.test_function(&best).abs() {
            true => best = next,
            false => worse += 1,
        }
        if step.abs() < SECANT.accuracy || worse > 1 {
            return Ok(CodimensionTwoPoint {
                kind: special,
                point: best,
                slope,
            });
        }
    }
    Err(CorrectorFailure::NotConverged)
}

/// The point of the boundary at a value of one of the parameters, predicted `step` along the
/// tangent.
pub fn boundary_point_at_parameter(
    manifold: &mut TwoParameterEquations,
    now: &SingularPoint,
    step: f64,
    which: usize,
    value: f64,
) -> Result<SingularPoint, CorrectorFailure> {
    let mut solution = manifold.displace_along_direction(&now.solution, &now.tangent, step)?;
    solution.params[which] = value;
    let search = now.search(manifold, Some(which), solution, GIVEN_PARAMETER_TOLERANCE);
    let found = search.secant(manifold)?;
    let mut point = now.with_own_directions(manifold, found)?;
    point.solution.params[which] = value;
    Ok(point)
}

/// Special points between two points of a boundary, the second `step` along the tangent of the
/// first; fails if there is more than one. Several modes may become neutral together, as those of
/// the boundary do.
pub fn codimension_two_between(
    manifold: &mut TwoParameterEquations,
    [now, next]: [&SingularPoint; 2],
    step: f64,
) -> Result<Option<CodimensionTwoPoint>, CorrectorFailure> {
    let cusp = now.kind == CriticalKind::Fold && now.fold_speed * next.fold_speed < 0.0;
    let special = match (cusp, now.index.abs_diff(next.index)) {
        (false, 0) => return Ok(None),
        (true, 0) => CodimensionTwoKind::Cusp,
        (false, _) => CodimensionTwoKind::Crossing,
        _ => return Err(CorrectorFailure::NotConverged),
    };
    let slope = (special.test_function(next) - special.test_function(now)) / step;
    let found = secant_codimension_two(manifold, now, special, slope, [-0.1 * step, 1.1 * step])?;
    let others = found.point.others.iter();
    let vanishing =
        others.filter(|it| it.abs() < COINCIDENT_EIGENVALUE_TOLERANCE * found.slope.abs());
    match special == CodimensionTwoKind::Cusp || vanishing.count() == now.index.abs_diff(next.index)
    {
        true => Ok(Some(found)),
        false => Err(CorrectorFailure::NotConverged),
    }
}
