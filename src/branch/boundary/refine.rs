//! Points of a stability boundary on finer and finer grids.
//!
//! A point is sought at the same value of one of the parameters on all grids or, where the
//! boundary goes along neither, in the plane across it; special points where they are on each
//! grid. On a finer grid Newton's method begins at the point extrapolated from the grids before.
//! The matrix of a nearly rigid leaf loses digits on finer grids: its points are found by a secant
//! method, from coarse grids on, and their parameters are extrapolated to no softening.

use crate::branch::boundary::codimension_two::{CodimensionTwoKind, locate_codimension_two};
use crate::branch::boundary::point_search::{
    BoundaryPointSearch, BoundarySearchTolerance, TwoParameterDirection, TwoParameterEquations,
    TwoParameterProblem, TwoParameterState,
};
use crate::branch::boundary::singular_point::{
    SingularPoint, boundary_point_on_coarser, boundary_point_on_finer,
};
use crate::branch::convergence::{
    EXACT_PARAMETER_ERROR, GridLimits, MAX_GRIDS, NestedGridPoint, Relocation, VerificationFailure,
    verify_over_grids,
};
use crate::branch::critical::CriticalKind;
use crate::branch::equations::CorrectorFailure;
use crate::branch::family::stiffest_condensed;
use crate::branch::refine::{
    CUBIC_EXTRAPOLATION_WEIGHTS, FINEST_GRID_RATIO, PARABOLIC_EXTRAPOLATION_WEIGHTS,
    REGULARIZATION_COMPLIANCES, is_nearly_rigid,
};
use crate::leaf::{Grid, State};
use crate::newton::Contraction;
use crate::numbers::larger;
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::{GridLevel, predict_on_finer_grid, weights};
use glam::DVec3;

/// Least number of grids of a point, and largest of a point of a nearly rigid leaf.
const MIN_POINT_GRIDS: usize = 3;

const MAX_RIGID_LEAF_GRIDS: usize = 4;

/// Largest error of the tips (lengths) of a point whose parameters are known.
const LARGEST_NEUTRAL_TIP_ERROR: f64 = 1e-3;

/// Largest iteration error of Newton's method on a grid, as a part of the error allowed.
const ITERATION_ERROR_FRACTION: f64 = 1e-3;

/// First compliance by which matrices of nearly rigid leaves are softened, and the largest ratio
/// of the errors of successive, smaller ones.
const FIRST_REGULARIZATION: f64 = 1e-3;

const REGULARIZATION_ERROR_RATIO: f64 = 0.5;

/// The search for a point from where it is on the previous grid: to rounding, as extrapolation
/// over grids magnifies what remains.
const RELOCATION_TOLERANCE: BoundarySearchTolerance = BoundarySearchTolerance {
    accuracy: 1e-13,
    largest_distance: 0.5,
};

/// Least angle (its sine) between the boundary and the line on which its point is sought, and the
/// least derivative of one parameter along the boundary relative to the other.
const SMALLEST_SEARCH_ANGLE_SINE: f64 = 0.3;

const SMALLEST_PARAMETER_RATE_RATIO: f64 = 0.1;

/// Required accuracy of points: of their tips, and of both parameters as parts of their ranges.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryAccuracy {
    pub tips: f64,
    pub numbers: f64,
    /// Accuracy of the parameters for which further grids are tried.
    pub sought: f64,
}

impl BoundaryAccuracy {
    /// Whether errors of the tips and of the parameters are small enough, on the `last` grid or on
    /// one after which there are others; `exact`: whether the parameters are as sought.
    fn is_reached(&self, tips: f64, numbers: [f64; 2], exact: bool, last: bool) -> bool {
        match last {
            false => tips <= self.tips && exact,
            true => {
                tips <= larger(self.tips, LARGEST_NEUTRAL_TIP_ERROR)
                    && (exact || larger(numbers[0], numbers[1]) <= self.numbers)
            }
        }
    }
}

/// A point of a boundary found on one grid, to be verified on finer ones.
#[derive(Clone, Debug)]
pub struct UnverifiedBoundaryPoint {
    pub point: SingularPoint,
    pub special: Option<CodimensionTwoKind>,
    /// The parameter that is fixed: at an end of its range.
    pub fixed_parameter: Option<usize>,
}

/// A point of a boundary on a grid.
struct LocatedBoundaryPoint {
    point: SingularPoint,
    /// Derivative of the vanishing function along the boundary, where that alone determines the
    /// position of the point on it: at a crossing. (At a cusp the parameters are stationary along
    /// the boundary.)
    slope_along: Option<f64>,
}

/// What distinguishes a point from others of its boundary.
#[derive(Clone, Copy)]
struct BoundaryPointCondition {
    special: Option<CodimensionTwoKind>,
    fixed_parameter: Option<usize>,
}

/// Verifies a point on as many grids as necessary; they must agree on index and
/// branch. For a nearly rigid leaf, whose matrix loses more digits on finer grids, starting from
/// coarser ones if possible.
pub fn verify_boundary_point(
    plane: &TwoParameterProblem,
    grid: &Grid,
    step: &UnverifiedBoundaryPoint,
    accuracy: BoundaryAccuracy,
) -> Result<VerifiedBoundaryPoint, VerificationFailure> {
    let mut manifold = TwoParameterEquations::new(plane, grid.clone());
    let leaf = manifold.leaves.leaf_at(step.point.solution.params)?;
    if is_nearly_rigid(leaf)
        && let Some(coarser) = boundary_point_on_coarser(plane, grid, &step.point)
    {
        let step = UnverifiedBoundaryPoint {
            point: coarser.point,
            ..step.clone()
        };
        if let Ok(verified) = verify_boundary_point(plane, &coarser.grid, &step, accuracy) {
            return Ok(verified);
        }
    }
    verify_over_grids(NestedBoundaryPoint::new(plane, grid, step, accuracy))
}

/// A point of a boundary that is verified on finer and finer grids.
struct NestedBoundaryPoint<'a> {
    manifold: TwoParameterEquations<'a>,
    /// The point on the present grid.
    located: LocatedBoundaryPoint,
    condition: BoundaryPointCondition,
    /// The index that all grids must have.
    index: usize,
    /// Whether the leaf is nearly rigid, and the compliance by which its matrix is softened.
    rigid: bool,
    regularization: Option<f64>,
    /// The leaf in its state on each grid so far, and the parameters there.
    levels: Vec<GridLevel>,
    params: Vec<[f64; 2]>,
    contraction: Contraction,
    table: BoundaryConvergenceTable,
    accuracy: BoundaryAccuracy,
    factorizations: usize,
}

impl<'a> NestedBoundaryPoint<'a> {
    fn new(
        plane: &'a TwoParameterProblem<'a>,
        grid: &Grid,
        step: &UnverifiedBoundaryPoint,
        accuracy: BoundaryAccuracy,
    ) -> Self {
        let manifold = TwoParameterEquations::new(plane, grid.clone());
        let point = step.point.clone();
        let given = step
            .fixed_parameter
            .or_else(|| fixable_parameter(&manifold, &point));
        let given = given.filter(|_| step.special.is_none());
        let fixed = given.map(|which| FixedParameter {
            which,
            value: point.solution.params[which],
        });
        NestedBoundaryPoint {
            manifold,
            condition: BoundaryPointCondition {
                special: step.special,
                fixed_parameter: given,
            },
            index: point.index,
            located: LocatedBoundaryPoint {
                point,
                slope_along: None,
            },
            rigid: false,
            regularization: None,
            levels: Vec::new(),
            params: Vec::new(),
            contraction: Contraction::default(),
            table: BoundaryConvergenceTable::new(fixed),
            accuracy,
            factorizations: 0,
        }
    }

    /// The error of the parameters below which no finer grid is needed.
    fn sought_error(&self) -> f64 {
        self.accuracy.sought.max(EXACT_PARAMETER_ERROR)
    }

    /// The point on the present grid by Newton's method from its prediction, or by the secant
    /// method if that fails; the estimated iteration error is recorded in the table.
    fn newton_or_secant(
        &mut self,
        near: &SingularPoint,
        start: TwoParameterState,
    ) -> Result<SingularPoint, CorrectorFailure> {
        let tolerance = BoundarySearchTolerance {
            accuracy: ITERATION_ERROR_FRACTION * self.sought_error(),
            ..RELOCATION_TOLERANCE
        };
        let (manifold, given) = (&mut self.manifold, self.condition.fixed_parameter);
        let search = near.search(manifold, given, start, tolerance);
        let frozen = near.kind == CriticalKind::Branching;
        let found = search.newton(manifold, frozen, &mut self.contraction);
        let found = found.or_else(|_| {
            let search = search_from_previous_grid(manifold, near, given);
            search.secant(manifold)
        })?;
        self.table.iteration_error = larger(self.table.iteration_error, found.iteration_error);
        Ok(near.with_search_result(manifold, found))
    }
}

impl NestedGridPoint for NestedBoundaryPoint<'_> {
    type Verified = VerifiedBoundaryPoint;

    fn locate(&mut self, level: usize) -> Result<Relocation, VerificationFailure> {
        let near = if level > 0 {
            let finer = boundary_point_on_finer(&mut self.manifold, &self.located.point)?;
            self.manifold = finer.manifold;
            finer.point
        } else {
            self.located.point.clone()
        };
        let mut start = near.solution.clone();
        let believed = self.table.tips.best().map_or(0, |best| best.columns + 1);
        predict_on_next_grid(&self.levels, &self.params, believed, &mut start);
        self.rigid = is_nearly_rigid(self.manifold.leaves.leaf_at(near.solution.params)?);
        self.located = match (self.condition.special, self.rigid) {
            (None, false) => LocatedBoundaryPoint {
                point: self.newton_or_secant(&near, start)?,
                slope_along: None,
            },
            _ => locate_by_secant(&mut self.manifold, &near, self.condition)?,
        };
        self.factorizations += self.manifold.factorizations;
        let point = &self.located.point;
        let shift = (near.solution.state).largest_displacement_to(&point.solution.state);
        Ok(Relocation {
            displacement: if level > 0 { shift } else { f64::INFINITY },
            tangent_cosine: 1.0,
            same_index: point.index == self.index,
        })
    }

    fn segments(&self) -> usize {
        self.manifold.grid().segments()
    }

    fn grid_limits(&self) -> GridLimits {
        GridLimits {
            least: MIN_POINT_GRIDS,
            most: match self.rigid {
                true => MAX_RIGID_LEAF_GRIDS,
                false => MAX_GRIDS,
            },
        }
    }

    fn tabulate(&mut self, _: usize) -> Result<(), VerificationFailure> {
        let (manifold, located) = (&mut self.manifold, &self.located);
        let solution = &located.point.solution;
        self.levels.push(GridLevel {
            leaf: manifold.leaves.leaf_at(solution.params)?.clone(),
            state: solution.state.clone(),
        });
        self.params.push(solution.params);
        let condition = self.condition;
        let numbers = match (self.rigid, self.regularization) {
            (false, _) => BoundaryParameters::without_regularization(solution.params),
            (true, Some(known)) => {
                unregularized_parameters(manifold, &located.point, condition, known)?
            }
            (true, None) => {
                least_regularized_parameters(manifold, located, condition, &self.table)?
            }
        };
        self.regularization = self.rigid.then_some(numbers.regularization);
        Ok(self.table.push(manifold, located, &numbers)?)
    }

    fn extrapolated(
        &mut self,
        level: usize,
        last: bool,
    ) -> Result<Option<VerifiedBoundaryPoint>, VerificationFailure> {
        if level + 1 < MIN_POINT_GRIDS {
            return Ok(None);
        }
        let (table, point) = (&self.table, &self.located.point);
        let exact = table.is_exact(self.sought_error());
        let tips = table.tips.best().map_or(f64::INFINITY, |best| best.error);
        let reached = (self.accuracy).is_reached(tips, table.errors(), exact, last);
        Ok(reached.then(|| VerifiedBoundaryPoint {
            factorizations: self.factorizations,
            ..table.verified_point(&self.manifold, point, self.condition.special)
        }))
    }
}

/// The parameter that can be fixed while a point is sought across the boundary, if there is
/// one: the second, unless the boundary goes along the first alone.
fn fixable_parameter(manifold: &TwoParameterEquations, point: &SingularPoint) -> Option<usize> {
    let [first, second] = point.tangent.params.map(f64::abs);
    let sine = |which: usize| {
        let crossing = point.crossing(manifold, Some(which));
        manifold
            .direction_product(&crossing.direction, &point.normal)
            .abs()
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

/// The point on this grid, to rounding, by secant methods.
fn locate_by_secant(
    manifold: &mut TwoParameterEquations,
    near: &SingularPoint,
    condition: BoundaryPointCondition,
) -> Result<LocatedBoundaryPoint, CorrectorFailure> {
    if let Some(special) = condition.special {
        let found = locate_codimension_two(manifold, near, special)?;
        return Ok(LocatedBoundaryPoint {
            point: found.point,
            slope_along: (special == CodimensionTwoKind::Crossing).then_some(found.slope),
        });
    }
    let search = search_from_previous_grid(manifold, near, condition.fixed_parameter);
    let found = search.secant(manifold)?;
    Ok(LocatedBoundaryPoint {
        point: near.with_search_result(manifold, found),
        slope_along: None,
    })
}

/// Predicts the point on the next grid from those on at least two coarser ones: the last ones,
/// as many as are taken to follow one error series.
fn predict_on_next_grid(
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

/// The search for the point, starting from that on the previous grid.
fn search_from_previous_grid(
    manifold: &TwoParameterEquations,
    near: &SingularPoint,
    given: Option<usize>,
) -> BoundaryPointSearch {
    near.search(manifold, given, near.solution.clone(), RELOCATION_TOLERANCE)
}

/// The parameters at a point of a nearly rigid leaf on its first grid: the softening is reduced
/// until rounding errors, here or on the finest grid, exceed those of extrapolation.
fn least_regularized_parameters(
    manifold: &mut TwoParameterEquations,
    located: &LocatedBoundaryPoint,
    condition: BoundaryPointCondition,
    table: &BoundaryConvergenceTable,
) -> Result<BoundaryParameters, CorrectorFailure> {
    let largest = |[a, b]: [f64; 2]| larger(a, b);
    let near = &located.point;
    let mut numbers = unregularized_parameters(manifold, near, condition, FIRST_REGULARIZATION)?;
    let finest = FINEST_GRID_RATIO * manifold.grid().segments() as f64;
    for softening in REGULARIZATION_COMPLIANCES {
        let rounding = table.rounding_errors_of_parameters(manifold, located, softening, finest)?;
        let left = largest(numbers.errors);
        if largest(rounding) > left {
            break;
        }
        match unregularized_parameters(manifold, near, condition, softening) {
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
    condition: BoundaryPointCondition,
    softening: f64,
) -> Result<BoundaryParameters, CorrectorFailure> {
    let grid = manifold.grid().clone();
    let mut values_by_softening = [[0.0; 2]; 4];
    let mut search = search_from_previous_grid(manifold, near, condition.fixed_parameter);
    for (k, params) in values_by_softening.iter_mut().enumerate().rev() {
        let mut soft = TwoParameterEquations::new(manifold.leaves.family, grid.clone());
        soft.regularize(softening * (k + 1) as f64);
        search.solution = match condition.special {
            Some(special) => {
                let solution = search.solution;
                let near = SingularPoint {
                    solution,
                    ..near.clone()
                };
                locate_codimension_two(&mut soft, &near, special)?
                    .point
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
    /// Matrices factorized for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Both parameters at a point on a grid; those of a softened matrix are extrapolated to no
/// softening.
#[derive(Default)]
struct BoundaryParameters {
    values: [f64; 2],
    /// Compliance by which the matrix was softened, in units of L^2/A, and the error of the
    /// extrapolation to zero.
    regularization: f64,
    errors: [f64; 2],
}

impl BoundaryParameters {
    /// Parameters of a leaf whose matrix is not softened.
    fn without_regularization(values: [f64; 2]) -> Self {
        BoundaryParameters {
            values,
            ..BoundaryParameters::default()
        }
    }
}

/// A parameter that is the same on all grids.
#[derive(Clone, Copy)]
struct FixedParameter {
    /// The first of both parameters, 0, or the second, 1.
    which: usize,
    value: f64,
}

/// Tips and parameters of a point of a boundary on finer and finer grids, and what their errors
/// consist of besides those of extrapolation.
#[derive(Default)]
struct BoundaryConvergenceTable {
    tips: Richardson,
    numbers: [Richardson; 2],
    /// The parameter that is fixed on all grids, if there is one.
    fixed_parameter: Option<FixedParameter>,
    /// Errors of the parameters due to rounding of the matrix on a grid, and their amplification
    /// by extrapolation to zero softening.
    rounded: [f64; 2],
    amplified: f64,
    /// Errors of the parameters due to softening.
    regularization_errors: [f64; 2],
    /// Largest iteration error of Newton's method on any grid (lengths, fractions of ranges).
    iteration_error: f64,
}

impl BoundaryConvergenceTable {
    fn new(given: Option<FixedParameter>) -> Self {
        BoundaryConvergenceTable {
            fixed_parameter: given,
            amplified: 1.0,
            ..BoundaryConvergenceTable::default()
        }
    }

    /// Errors of the parameters due to rounding of a matrix with so much softening, on so many
    /// segments.
    fn rounding_errors_of_parameters(
        &self,
        manifold: &mut TwoParameterEquations,
        located: &LocatedBoundaryPoint,
        softening: f64,
        segments: f64,
    ) -> Result<[f64; 2], CorrectorFailure> {
        let point = &located.point;
        let fixed = self.fixed_parameter.map(|fixed| fixed.which);
        let crossing = point.crossing(manifold, fixed);
        let slope = crossing.slope;
        let leaf = manifold.leaves.leaf_at(point.solution.params)?;
        let stiffest = stiffest_condensed(leaf).min(1.0 / softening);
        let rounding = f64::EPSILON * stiffest * segments * segments;
        Ok([0, 1].map(|i| {
            let own = (rounding / slope * crossing.direction.params[i]).abs();
            let along = (located.slope_along)
                .map_or(0.0, |slope| rounding / slope * point.tangent.params[i]);
            own + along.abs()
        }))
    }

    fn push(
        &mut self,
        manifold: &mut TwoParameterEquations,
        located: &LocatedBoundaryPoint,
        numbers: &BoundaryParameters,
    ) -> Result<(), CorrectorFailure> {
        let state = &located.point.solution.state;
        let segments = state.segments() as f64;
        let rounding = self.rounding_errors_of_parameters(
            manifold,
            located,
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

    fn errors(&self) -> [f64; 2] {
        [0, 1].map(|i| match self.fixed_value(i) {
            Some(_) => 0.0,
            None => (self.numbers[i].best()).map_or(f64::INFINITY, |best| best.error),
        })
    }

    /// The value of a parameter, if it is fixed.
    fn fixed_value(&self, i: usize) -> Option<f64> {
        let given = self.fixed_parameter.filter(|fixed| fixed.which == i);
        given.map(|fixed| fixed.value)
    }

    /// Whether the error of each parameter is at most `enough`, or at most its rounding error.
    fn is_exact(&self, enough: f64) -> bool {
        let mut errors = self.errors().into_iter().zip(self.rounded);
        errors.all(|(error, rounded)| error <= enough.max(rounded))
    }

    fn verified_point(
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
                let crossing = point.crossing(manifold, Some(1));
                crossing.slope * crossing.direction.params[0] > 0.0
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
            accuracy.is_reached(tips, [0.0, number], number <= accuracy.sought, last)
        };
        assert!(reached(1e-2, 1e-7, false) && reached(1e-2, 1e-5, true));
        assert!(!reached(1e-2, 1e-6, false) && !reached(1e-2, 1e-4, true));
        assert!(!reached(2e-2, 1e-7, false) && !reached(2e-2, 1e-7, true));
    }
}
