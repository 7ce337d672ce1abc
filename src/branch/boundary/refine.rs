//! Points of a boundary on finer and finer grids: extrapolated and thereby verified.
//!
//! A point of a boundary, extrapolated over finer and finer grids.

use crate::branch::boundary::codimension_two::{CodimensionTwoKind, locate_codimension_two};
use crate::branch::boundary::singular_point::{
    BoundaryPointSearch, SingularPoint, TwoParameterDirection, TwoParameterEquations,
    TwoParameterProblem, TwoParameterState,
};
use crate::branch::boundary::{boundary_point_on_coarser, boundary_point_on_finer};
use crate::branch::critical::CriticalKind;
use crate::branch::equations::CorrectorFailure;
use crate::branch::family::stiffest_condensed;
use crate::branch::refine::{
    CUBIC_EXTRAPOLATION_WEIGHTS, FINEST_GRID_RATIO, NEARLY_RIGID, PARABOLIC_EXTRAPOLATION_WEIGHTS,
    REGULARIZATION_COMPLIANCES, VerificationFailure,
};
use crate::leaf::{Grid, State};
use crate::newton::Contraction;
use crate::numbers::larger;
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::{GridLevel, predict_on_finer_grid, weights};
use glam::DVec3;

/// Least and largest number of grids of a point, that of a nearly rigid leaf, and segments of
/// the finest grid.
const MIN_POINT_GRIDS: usize = 3;

const GRIDS: usize = 6;

const MAX_RIGID_LEAF_GRIDS: usize = 4;

const FINEST: usize = 4096;

/// Displacements from grid to grid must decrease, unless below this (lengths).
const NEGLIGIBLE_DISPLACEMENT: f64 = 1e-4;

/// Largest error of the tips (lengths) of a point whose parameters are known.
const LARGEST_NEUTRAL_TIP_ERROR: f64 = 1e-3;

/// Largest iteration error of Newton's method on a grid, as a part of the error allowed.
const ITERATION_ERROR_FRACTION: f64 = 1e-3;

/// Parameters with errors below this part of their ranges are exact.
const EXACT_PARAMETER_ERROR: f64 = 1e-12;

/// First compliance by which matrices of nearly rigid leaves are softened, and the largest ratio
/// of the errors of successive, smaller ones.
const FIRST_REGULARIZATION: f64 = 1e-3;

const REGULARIZATION_ERROR_RATIO: f64 = 0.5;

/// Accuracy of a point on its grid, as a part of the ranges, and the largest distance from the
/// initial guess of the previous grid.
const ACCURACY: f64 = 1e-13;

const LARGEST_GUESS_DISTANCE: f64 = 0.5;

/// Least angle (its sine) between the boundary and the line on which its point is sought, and the
/// least derivative of one parameter along the boundary relative to the other.
const SMALLEST_SEARCH_ANGLE_SINE: f64 = 0.3;

const SMALLEST_PARAMETER_RATE_RATIO: f64 = 0.1;

/// Required accuracy of points: of their tips, and of both parameters as parts of their ranges.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryAccuracy {
    pub tips: f64,
    pub numbers: f64,
    /// That of the parameters for which further grids are tried.
    pub sought: f64,
}

impl BoundaryAccuracy {
    /// Whether errors of the tips and of the parameters are small enough, on the `last` grid or on
    /// one after which there are others; `exact`: whether the parameters are as sought.
    fn is_reached(&self, tips: f64, numbers: [f64; 2], (exact, last): (bool, bool)) -> bool {
        match last {
            false => tips <= self.tips && exact,
            true => {
                tips <= larger(self.tips, LARGEST_NEUTRAL_TIP_ERROR)
                    && (exact || larger(numbers[0], numbers[1]) <= self.numbers)
            }
        }
    }
}

/// A point to be verified.
#[derive(Clone, Debug)]
pub struct UnverifiedBoundaryPoint {
    /// Where it is on a grid.
    pub point: SingularPoint,
    pub special: Option<CodimensionTwoKind>,
    /// The parameter that is fixed: at an end of its range.
    pub fixed_parameter: Option<usize>,
}

/// Verifies a point on as many grids as necessary; they must agree on index and
/// branch. For a nearly rigid leaf, whose matrix loses more digits on finer grids, starting from
/// coarser ones if possible.
pub fn refine(
    plane: &TwoParameterProblem,
    grid: &Grid,
    step: &UnverifiedBoundaryPoint,
    accuracy: BoundaryAccuracy,
) -> Result<VerifiedBoundaryPoint, VerificationFailure> {
    let rigid = TwoParameterEquations::new(plane, grid.clone())
        .leaves
        .leaf_at(step.point.solution.params)?
        .least_compliance();
    if rigid * NEARLY_RIGID < 1.0
        && let Some((grid, point)) = boundary_point_on_coarser(plane, grid, &step.point)
    {
        let step = UnverifiedBoundaryPoint {
            point,
            ..step.clone()
        };
        if let Ok(verified) = refine(plane, &grid, &step, accuracy) {
            return Ok(verified);
        }
    }
    verify_from_grid(plane, grid, step, accuracy)
}

/// The same, starting from this grid.
fn verify_from_grid(
    plane: &TwoParameterProblem,
    grid: &Grid,
    step: &UnverifiedBoundaryPoint,
    accuracy: BoundaryAccuracy,
) -> Result<VerifiedBoundaryPoint, VerificationFailure> {
    let mut manifold = TwoParameterEquations::new(plane, grid.clone());
    let mut near = step.point.clone();
    let given = step
        .fixed_parameter
        .or_else(|| fixable_parameter(&manifold, &near));
    let given = given.filter(|_| step.special.is_none());
    let mut table =
        BoundaryConvergenceTable::new(given.map(|which| (which, near.solution.params[which])));
    let (mut moved, mut factorizations) = (f64::INFINITY, 0);
    let mut contraction = Contraction::default();
    let (mut levels, mut params) = (Vec::<GridLevel>::new(), Vec::new());
    let enough = accuracy.sought.max(EXACT_PARAMETER_ERROR);
    let mut softening = None;
    for level in 0..GRIDS {
        if level > 0 {
            (manifold, near) = boundary_point_on_finer(&mut manifold, &near)?;
        }
        let mut start = near.solution.clone();
        let believed = table.tips.best().map_or(0, |best| best.columns + 1);
        predict_spot(&levels, &params, believed, &mut start);
        let rigid = manifold
            .leaves
            .leaf_at(near.solution.params)?
            .least_compliance()
            * NEARLY_RIGID
            < 1.0;
        let (point, along) = match (step.special, rigid) {
            (None, false) => {
                let left = ITERATION_ERROR_FRACTION * enough;
                let from = (&near, &start);
                let found = newton_or_secant(&mut manifold, from, given, left, &mut contraction)?;
                table.iteration_error = larger(table.iteration_error, found.1);
                (found.0, None)
            }
            _ => relocated(&mut manifold, &near, step.special, given)?,
        };
        factorizations += manifold.factorizations;
        let shift = near
            .solution
            .state
            .largest_displacement_to(&point.solution.state);
        if shift > moved.max(NEGLIGIBLE_DISPLACEMENT) {
            return Err(VerificationFailure::OtherBranch);
        }
        if point.index != step.point.index {
            return Err(VerificationFailure::OtherIndex);
        }
        if level > 0 {
            moved = shift;
        }
        near = point;
        levels.push(GridLevel {
            leaf: manifold.leaves.leaf_at(near.solution.params)?.clone(),
            state: near.solution.state.clone(),
        });
        params.push(near.solution.params);
        let sought = (step.special, given);
        let numbers = match (rigid, softening) {
            (false, _) => BoundaryParameters::without_regularization(near.solution.params),
            (true, Some(known)) => unregularized_parameters(&mut manifold, &near, sought, known)?,
            (true, None) => {
                least_regularized_parameters(&mut manifold, &near, sought, (&table, along))?
            }
        };
        softening = rigid.then_some(numbers.regularization);
        table.push(&mut manifold, (&near, along), &numbers)?;
        if level + 1 < MIN_POINT_GRIDS {
            continue;
        }
        let exact = table.is_exact(enough);
        let last = level + 1 == if rigid { MAX_RIGID_LEAF_GRIDS } else { GRIDS }
            || 2 * manifold.grid().segments() > FINEST;
        let tips = table.tips.best().map_or(f64::INFINITY, |best| best.error);
        if accuracy.is_reached(tips, table.errors(), (exact, last)) {
            return Ok(VerifiedBoundaryPoint {
                factorizations,
                ..table.verified_point(&manifold, &near, step.special)
            });
        }
        if last {
            break;
        }
    }
    Err(VerificationFailure::Inaccurate)
}

/// The parameter that can be fixed while a point is sought across the boundary, if there is
/// one: the second, unless the boundary goes along the first alone.
fn fixable_parameter(manifold: &TwoParameterEquations, point: &SingularPoint) -> Option<usize> {
    let [first, second] = point.tangent.params.map(f64::abs);
    let sine = |which: usize| {
        let (across, _) = point.crossing_at_fixed_parameter(manifold, which);
        manifold.direction_product(&across, &point.normal).abs()
    };
    let order = if second >= SMALLEST_PARAMETER_RATE_RATIO * first {
        [1, 0]
    } else {
        [0, 1]
    };
    let changes = point
        .tangent
        .params
        .map(|part| part.abs() > SMALLEST_PARAMETER_RATE_RATIO * SMALLEST_SEARCH_ANGLE_SINE);
    order
        .into_iter()
        .find(|&k| changes[k] && sine(k) > SMALLEST_SEARCH_ANGLE_SINE)
}

/// The point on this grid, to rounding; for a crossing also the derivative of the other
/// eigenvalue along the boundary, which alone determines the position of the crossing on it.
/// (At a cusp the parameters are stationary along it.)
fn relocated(
    manifold: &mut TwoParameterEquations,
    near: &SingularPoint,
    special: Option<CodimensionTwoKind>,
    given: Option<usize>,
) -> Result<(SingularPoint, Option<f64>), CorrectorFailure> {
    if let Some(special) = special {
        let (point, slope) = locate_codimension_two(manifold, near, special)?;
        return Ok((
            point,
            (special == CodimensionTwoKind::Crossing).then_some(slope),
        ));
    }
    let found = search_from_previous_grid(manifold, near, given).secant(manifold)?;
    Ok((near.with_search_result(manifold, found), None))
}

/// Predicts the point on the next grid from those on at least two coarser ones: the last ones,
/// as many as are taken to follow one error series.
fn predict_spot(
    levels: &[GridLevel],
    params: &[[f64; 2]],
    believed: usize,
    solution: &mut TwoParameterState,
) {
    if levels.len() < 2 {
        return;
    }
    let skipped = levels.len() - believed.clamp(2, levels.len());
    let (levels, params) = (&levels[skipped..], &params[skipped..]);
    predict_on_finer_grid(&levels.iter().collect::<Vec<_>>(), &mut solution.state);
    let segments: Vec<usize> = levels.iter().map(|it| it.leaf.segments()).collect();
    let weights = weights(&segments, solution.state.segments() as f64);
    solution.params =
        [0, 1].map(|i| (params.iter().zip(&weights).map(|(at, part)| part * at[i])).sum());
}

/// The point on this grid by Newton's method from its prediction, or by the secant method if
/// that fails; and the estimated iteration error.
fn newton_or_secant(
    manifold: &mut TwoParameterEquations,
    (near, start): (&SingularPoint, &TwoParameterState),
    given: Option<usize>,
    accuracy: f64,
    contraction: &mut Contraction,
) -> Result<(SingularPoint, f64), CorrectorFailure> {
    let search = near.search(
        manifold,
        given,
        start.clone(),
        (accuracy, LARGEST_GUESS_DISTANCE),
    );
    let frozen = near.kind == CriticalKind::Branching;
    let found = search.newton(manifold, frozen, contraction);
    let (found, left) = found.or_else(|_| {
        let search = search_from_previous_grid(manifold, near, given);
        search.secant(manifold).map(|found| (found, 0.0))
    })?;
    Ok((near.with_search_result(manifold, found), left))
}

/// The search for the point, starting from that on the previous grid.
fn search_from_previous_grid(
    manifold: &TwoParameterEquations,
    near: &SingularPoint,
    given: Option<usize>,
) -> BoundaryPointSearch {
    near.search(
        manifold,
        given,
        near.solution.clone(),
        (ACCURACY, LARGEST_GUESS_DISTANCE),
    )
}

/// The parameters at a point of a nearly rigid leaf on its first grid: the softening is reduced
/// until rounding errors, here or on the finest grid, exceed those of extrapolation.
fn least_regularized_parameters(
    manifold: &mut TwoParameterEquations,
    near: &SingularPoint,
    sought: (Option<CodimensionTwoKind>, Option<usize>),
    (table, along): (&BoundaryConvergenceTable, Option<f64>),
) -> Result<BoundaryParameters, CorrectorFailure> {
    let largest = |[a, b]: [f64; 2]| larger(a, b);
    let mut numbers = unregularized_parameters(manifold, near, sought, FIRST_REGULARIZATION)?;
    let finest = FINEST_GRID_RATIO * manifold.grid().segments() as f64;
    for softening in REGULARIZATION_COMPLIANCES {
        let rounding =
            table.rounding_errors_of_parameters(manifold, (near, along), softening, finest)?;
        let left = largest(numbers.errors);
        if largest(rounding) > left {
            break;
        }
        match unregularized_parameters(manifold, near, sought, softening) {
            Ok(better) if largest(better.errors) < REGULARIZATION_ERROR_RATIO * left => {
                numbers = better
            }
            _ => break,
        }
    }
    Ok(numbers)
}

/// The parameters at a point of a nearly rigid leaf: from matrices softened by one to four times
/// as much, extrapolated to zero.
fn unregularized_parameters(
    manifold: &mut TwoParameterEquations,
    near: &SingularPoint,
    (special, given): (Option<CodimensionTwoKind>, Option<usize>),
    softening: f64,
) -> Result<BoundaryParameters, CorrectorFailure> {
    let grid = manifold.grid().clone();
    let mut values_by_softening = [[0.0; 2]; 4];
    let mut search = search_from_previous_grid(manifold, near, given);
    for (k, params) in values_by_softening.iter_mut().enumerate().rev() {
        let mut soft = TwoParameterEquations::new(manifold.leaves.family, grid.clone());
        soft.regularize(softening * (k + 1) as f64);
        search.solution = match special {
            Some(special) => {
                let solution = search.solution;
                let near = SingularPoint {
                    solution,
                    ..near.clone()
                };
                locate_codimension_two(&mut soft, &near, special)?
                    .0
                    .solution
            }
            None => search.secant(&mut soft)?.sample.solution,
        };
        *params = search.solution.params;
    }
    let by = |weights: [f64; 4]| {
        let sum = |i: usize| {
            weights
                .iter()
                .zip(&values_by_softening)
                .map(|(w, at)| w * at[i])
                .sum()
        };
        [0, 1].map(sum)
    };
    let (values, parabola): ([f64; 2], [f64; 2]) = (
        by(CUBIC_EXTRAPOLATION_WEIGHTS),
        by(PARABOLIC_EXTRAPOLATION_WEIGHTS),
    );
    Ok(BoundaryParameters {
        values,
        regularization: softening,
        errors: [0, 1].map(|i| (values[i] - parabola[i]).abs()),
    })
}

/// Amplification of rounding errors by extrapolation to zero softening: the root of the sum of
/// the squares of its weights.
const REGULARIZATION_ROUNDING_AMPLIFICATION: f64 = 8.3;

/// Largest amplification of iteration errors by extrapolation.
const ITERATION_ERROR_AMPLIFICATION: f64 = 2.0;

/// A point of a boundary extrapolated to zero segment length.
#[derive(Clone, Debug)]
pub struct VerifiedBoundaryPoint {
    /// Both parameters, as fractions of their ranges, and bounds on their errors.
    pub params: [f64; 2],
    pub errors: [f64; 2],
    /// Tips of all rods, in the family's units, and a bound on their error.
    pub tips: Vec<DVec3>,
    pub error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// The direction across the boundary on the manifold, to where more eigenvalues are negative.
    pub across: TwoParameterDirection,
    /// The nodes as fractions of the length.
    pub stations: Vec<f64>,
    pub kind: CriticalKind,
    pub special: Option<CodimensionTwoKind>,
    /// Morse indices where the first parameter is smaller and where it is larger; at a fold,
    /// of the two branches that meet there.
    pub indices: [usize; 2],
    /// Matrices factorised for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Both parameters at a point on a grid.
#[derive(Default)]
pub struct BoundaryParameters {
    pub values: [f64; 2],
    /// Compliance by which the matrix was softened, in units of L^2/A, and the error of the
    /// extrapolation to zero.
    pub regularization: f64,
    pub errors: [f64; 2],
}

impl BoundaryParameters {
    /// Without softening.
    pub fn without_regularization(values: [f64; 2]) -> Self {
        BoundaryParameters {
            values,
            ..BoundaryParameters::default()
        }
    }
}

/// The values to be extrapolated.
#[derive(Default)]
pub struct BoundaryConvergenceTable {
    pub tips: Richardson,
    numbers: [Richardson; 2],
    /// The parameter that is fixed on all grids, if there is one, and its value.
    fixed_parameter: Option<(usize, f64)>,
    /// Errors of the parameters due to rounding of the matrix on a grid, and their amplification
    /// by extrapolation to zero softening.
    rounded: [f64; 2],
    amplified: f64,
    /// Errors of the parameters due to softening.
    regularization_errors: [f64; 2],
    /// Largest iteration error of Newton's method.
    pub iteration_error: f64,
}

impl BoundaryConvergenceTable {
    pub fn new(given: Option<(usize, f64)>) -> Self {
        BoundaryConvergenceTable {
            fixed_parameter: given,
            amplified: 1.0,
            ..BoundaryConvergenceTable::default()
        }
    }

    /// Errors of the parameters due to rounding of a matrix with so much softening, on so many
    /// segments; `along` is the derivative of the vanishing function along the boundary.
    pub fn rounding_errors_of_parameters(
        &self,
        manifold: &mut TwoParameterEquations,
        (point, along): (&SingularPoint, Option<f64>),
        softening: f64,
        segments: f64,
    ) -> Result<[f64; 2], CorrectorFailure> {
        let (across, slope) = match self.fixed_parameter {
            Some((which, _)) => point.crossing_at_fixed_parameter(manifold, which),
            None => (point.normal.clone(), point.slope),
        };
        let leaf = manifold.leaves.leaf_at(point.solution.params)?;
        let stiffest = stiffest_condensed(leaf).min(1.0 / softening);
        let rounding = f64::EPSILON * stiffest * segments * segments;
        Ok([0, 1].map(|i| {
            let own = (rounding / slope * across.params[i]).abs();
            let along = along.map_or(0.0, |slope| rounding / slope * point.tangent.params[i]);
            own + along.abs()
        }))
    }

    pub fn push(
        &mut self,
        manifold: &mut TwoParameterEquations,
        (point, along): (&SingularPoint, Option<f64>),
        numbers: &BoundaryParameters,
    ) -> Result<(), CorrectorFailure> {
        let state = &point.solution.state;
        let segments = state.segments() as f64;
        let rounding = self.rounding_errors_of_parameters(
            manifold,
            (point, along),
            numbers.regularization,
            segments,
        )?;
        if numbers.regularization > 0.0 {
            self.amplified = REGULARIZATION_ROUNDING_AMPLIFICATION;
        }
        for i in 0..2 {
            self.rounded[i] = larger(self.rounded[i], rounding[i]);
            self.regularization_errors[i] =
                larger(self.regularization_errors[i], numbers.errors[i]);
        }
        let tips = state.tips().flat_map(|tip| tip.to_array());
        self.tips.push(state.segments(), tips.collect());
        for (table, number) in self.numbers.iter_mut().zip(numbers.values) {
            table.push(state.segments(), vec![number]);
        }
        Ok(())
    }

    pub fn errors(&self) -> [f64; 2] {
        [0, 1].map(|i| match self.fixed_value(i) {
            Some(_) => 0.0,
            None => (self.numbers[i].best()).map_or(f64::INFINITY, |best| best.error),
        })
    }

    /// The value of a parameter, if it is fixed.
    fn fixed_value(&self, i: usize) -> Option<f64> {
        let given = self.fixed_parameter.filter(|(which, _)| *which == i);
        given.map(|(_, value)| value)
    }

    /// Whether the errors of both parameters are below this, or below rounding.
    pub fn is_exact(&self, enough: f64) -> bool {
        let mut errors = self.errors().into_iter().zip(self.rounded);
        errors.all(|(error, rounded)| error <= enough.max(rounded))
    }

    pub fn verified_point(
        &self,
        manifold: &TwoParameterEquations,
        point: &SingularPoint,
        special: Option<CodimensionTwoKind>,
    ) -> VerifiedBoundaryPoint {
        let tips = self.tips.extrapolated();
        let errors = self.errors();
        let number =
            |i: usize| (self.fixed_value(i)).unwrap_or_else(|| self.numbers[i].extrapolated()[0]);
        let (beyond, below) = (point.index, point.index.saturating_sub(point.neutral_modes));
        let forward = match point.kind {
            CriticalKind::Branching => {
                let (across, slope) = point.crossing_at_fixed_parameter(manifold, 1);
                slope * across.params[0] > 0.0
            }
            CriticalKind::Fold => true,
        };
        VerifiedBoundaryPoint {
            params: [number(0), number(1)],
            errors: [0, 1].map(|i| match self.fixed_value(i) {
                Some(_) => 0.0,
                None => {
                    let rounded = self.amplified * self.rounded[i];
                    errors[i]
                        + self.regularization_errors[i]
                        + rounded
                        + ITERATION_ERROR_AMPLIFICATION * self.iteration_error
                }
            }),
            tips: tips.chunks(3).map(DVec3::from_slice).collect(),
            // No tip is more accurate than machine precision.
            error: (self.tips.best()).map_or(f64::INFINITY, |best| {
                best.error + ITERATION_ERROR_AMPLIFICATION * self.iteration_error + f64::EPSILON
            }),
            state: point.solution.state.clone(),
            across: point.normal.clone(),
            stations: manifold.grid().sigma().to_vec(),
            kind: point.kind,
            special,
            indices: match forward {
                true => [below, beyond],
                false => [beyond, below],
            },
            factorizations: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where no finer grid is left parameters need not be as exact as sought, but as required; the
    /// bound of the tips is theirs alone, and a last grid is not judged more strictly.
    #[test]
    fn each_error_is_compared_with_its_own_bound() {
        let accuracy = BoundaryAccuracy {
            tips: 1e-2,
            numbers: 1e-5,
            sought: 1e-7,
        };
        let reached = |tips, number, last| {
            accuracy.is_reached(tips, [0.0, number], (number <= accuracy.sought, last))
        };
        assert!(reached(1e-2, 1e-7, false) && reached(1e-2, 1e-5, true));
        assert!(!reached(1e-2, 1e-6, false) && !reached(1e-2, 1e-4, true));
        assert!(!reached(2e-2, 1e-7, false) && !reached(2e-2, 1e-7, true));
    }
}
