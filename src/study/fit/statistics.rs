//! Statistics of a minimum: deviations, correlations, bands, and which candidate experiment would be most
//! informative.
//!
//! All follow from the singular values of the weighted derivatives: combinations of the free numbers with
//! the smallest ones are those to which the data are insensitive. [`MinimumNeighbourhood`] has the
//! residuals near a minimum, and the least sum of squares for a given displacement of one number.

use crate::relax::{ContinuationFailure, GridPolicy};
use crate::study::fit::columns::{DatumDimension, FitError};
use crate::study::fit::data::{Data, Experiment};
use crate::study::fit::model::{
    EvaluationBudget, FitModel, FitPoint, WeightedDerivatives, Weighting,
};
use crate::study::fit::prediction::{CaseSolution, DatumQuantity, ScalarDatum};
use crate::study::fit::remark::FitCandidateRemark;
use crate::study::fit::result::FitCandidate;
use nalgebra::{DMatrix, DVector};

/// A number with an uncertainty of more than this, in logarithms or units, is not determined: a
/// factor of ten.
pub(super) const UNDETERMINED_UNCERTAINTY: f64 = std::f64::consts::LN_10;

/// Excess below the minimum, in variances, that indicates a better minimum.
pub(super) const BETTER_MINIMUM_EXCESS: f64 = 0.1;

/// A number with a larger component than this in combinations to which the data are insensitive
/// is not determined.
const INSENSITIVE_COMPONENT: f64 = 1e-3;

pub(super) struct FitStatistics<'m, 'a> {
    pub model: &'m FitModel<'a>,
    pub weighting: Weighting,
    /// Whether the standard deviations of the data are known.
    pub has_known_deviations: bool,
    pub point: &'m FitPoint,
    pub residuals: DVector<f64>,
    pub jacobian: DMatrix<f64>,
    /// Singular directions of the coordinates, in ascending order of the sensitivity of the data,
    /// and the singular values.
    pub singular_directions: DMatrix<f64>,
    pub singular_values: Vec<f64>,
    /// Number of directions, the first ones, to which the data are insensitive.
    pub insensitive_count: usize,
    /// Degrees of freedom: data minus determined combinations.
    pub degrees_of_freedom: usize,
    /// Standard deviation of residuals.
    pub residual_deviation: f64,
    /// Half width of a 95 % interval in standard deviations.
    pub coverage_factor: f64,
}

pub(super) struct CoordinateUncertainty {
    pub deviation: f64,
    /// Changes of all coordinates correlated with a change of this one by one.
    pub correlated_changes: DVector<f64>,
}

impl<'m, 'a> FitStatistics<'m, 'a> {
    pub fn new(
        model: &'m FitModel<'a>,
        weighting: Weighting,
        known: bool,
        point: &'m FitPoint,
    ) -> Self {
        let residuals = weighting.residuals(point);
        let WeightedDerivatives { roots, jacobian } =
            weighting.weighted_derivatives(point, &residuals);
        let SingularDirections { values, directions } = singular_value_decomposition(&jacobian);
        let largest = values.last().copied().unwrap_or(0.0);
        let insensitive = values
            .iter()
            .filter(|value| **value <= NULL_SINGULAR_VALUE * largest)
            .count();
        let count = point
            .components()
            .filter(|component| !component.is_uninformative)
            .count();
        let freedom = count.saturating_sub(values.len() - insensitive);
        let weighed = residuals.component_mul(&roots);
        let (spread, quantile) = match known || freedom == 0 {
            true => (1.0, NORMAL_QUANTILE_95),
            false => {
                let mean = weighed.norm_squared() / freedom as f64;
                (mean.sqrt(), student_quantile_95(freedom))
            }
        };
        FitStatistics {
            model,
            weighting,
            has_known_deviations: known,
            point,
            residuals,
            jacobian,
            singular_directions: directions,
            singular_values: values,
            insensitive_count: insensitive,
            degrees_of_freedom: freedom,
            residual_deviation: spread,
            coverage_factor: quantile,
        }
    }

    pub fn uncertainty(&self, k: usize) -> CoordinateUncertainty {
        let sensitive = self.insensitive_count..self.singular_values.len();
        let mut along = DVector::zeros(self.singular_values.len());
        for direction in sensitive {
            let v = self.singular_directions.column(direction);
            along +=
                v * (v[k] * (self.residual_deviation / self.singular_values[direction]).powi(2));
        }
        let variance = along[k];
        match variance > 0.0 {
            true => CoordinateUncertainty {
                deviation: variance.sqrt(),
                correlated_changes: along / variance,
            },
            false => CoordinateUncertainty {
                deviation: 0.0,
                correlated_changes: along,
            },
        }
    }

    /// The changes of the others that are correlated with that of a coordinate, if none of them has
    /// a larger uncertainty than [`UNDETERMINED_UNCERTAINTY`]: weakly determined combinations then do not change.
    pub fn conditional_changes(&self, k: usize) -> DVector<f64> {
        let mut along = DVector::zeros(self.singular_values.len());
        for (direction, value) in self.singular_values.iter().enumerate() {
            let v = self.singular_directions.column(direction);
            let sensitive = (value / self.residual_deviation).powi(2);
            along += v
                * (v[k] / (sensitive + (self.coverage_factor / UNDETERMINED_UNCERTAINTY).powi(2)));
        }
        let own = along[k];
        along / own
    }

    /// Whether the sum of squares of the residuals is larger than their standard deviations allow:
    /// at the quantile of five deviations of a normal variable (Wilson and Hilferty 1931).
    pub fn has_excessive_residuals(&self) -> bool {
        let freedom = self.degrees_of_freedom.max(1) as f64;
        let part = 2.0 / (9.0 * freedom);
        let most = freedom * (1.0 - part + 5.0 * part.sqrt()).powi(3);
        let explained = self.residuals.norm_squared() <= most;
        !self.weighting.is_robust && !explained
    }

    /// Whether the data are sensitive to every change of a coordinate.
    pub fn is_sensitive_to(&self, k: usize) -> bool {
        let insensitive = (0..self.insensitive_count)
            .map(|direction| self.singular_directions[(k, direction)].powi(2));
        insensitive.sum::<f64>().sqrt() <= INSENSITIVE_COMPONENT
    }

    /// Whether the data drove a coordinate far from its initial value without determining it, or to
    /// a bound.
    pub fn is_runaway(&self, k: usize) -> bool {
        let (free, theta) = (&self.model.coordinates[k], self.point.theta[k]);
        let far = (theta - free.initial).abs() > UNDETERMINED_UNCERTAINTY;
        free.active_bound(theta).is_some() || far && self.is_weakly_determined(k)
    }

    /// Whether the data determine a coordinate to no better than a factor of ten.
    pub fn is_weakly_determined(&self, k: usize) -> bool {
        self.coverage_factor * self.uncertainty(k).deviation > UNDETERMINED_UNCERTAINTY
    }

    /// The standard deviation of a candidate's datum: that of the fit's data of its kind.
    pub fn typical_deviation(&self, kind: DatumDimension) -> Option<f64> {
        let alike = |component: &&ScalarDatum| component.quantity.dimension() == kind;
        let alike = self.point.components().filter(alike);
        let mut sds: Vec<f64> = alike.map(|c| self.datum_deviation(c)).collect();
        sds.sort_by(f64::total_cmp);
        sds.get(sds.len() / 2).copied()
    }

    /// The standard deviation of a datum: as given, or as estimated from all residuals.
    pub fn datum_deviation(&self, component: &ScalarDatum) -> f64 {
        component
            .sd
            .unwrap_or(self.residual_deviation * self.weighting.assumed_deviation)
    }

    /// Correlations of the coordinates to which the data are sensitive.
    pub fn correlations(&self) -> Vec<Vec<Option<f64>>> {
        let count = self.singular_values.len();
        let uncertainties: Vec<_> = (0..count).map(|k| self.uncertainty(k)).collect();
        let entry = |a: usize, b: usize| {
            let [own, other] = [a, b].map(|k| uncertainties[k].deviation);
            let known =
                self.is_sensitive_to(a) && self.is_sensitive_to(b) && own > 0.0 && other > 0.0;
            // The correlated change is the covariance with `a` over the variance of `a`.
            let change = uncertainties[a].correlated_changes[b];
            known.then(|| (change * own / other).clamp(-1.0, 1.0))
        };
        let row = |a: usize| (0..count).map(|b| entry(a, b)).collect();
        (0..count).map(row).collect()
    }

    /// Half width of the model's 95 % band at each datum.
    pub fn confidence_bands(&self) -> Vec<f64> {
        let roots = self.weighting.weight_roots(&self.residuals);
        let components = self.point.components().enumerate();
        components
            .map(|(i, component)| {
                let row = self.jacobian.row(i);
                let sensitive = self.insensitive_count..self.singular_values.len();
                let variance: f64 = sensitive
                    .map(|direction| {
                        let v = self.singular_directions.column(direction);
                        ((row * v)[(0, 0)] / self.singular_values[direction]).powi(2)
                    })
                    .sum();
                let sd = component.sd.unwrap_or(self.weighting.assumed_deviation);
                self.coverage_factor * self.residual_deviation * variance.sqrt() * sd / roots[i]
            })
            .collect()
    }
}

/// Singular values below this part of the largest belong to combinations to which the data are
/// insensitive; derivatives are more accurate than that.
pub(super) const NULL_SINGULAR_VALUE: f64 = 1e-7;

/// Components of a combination smaller than this part of its largest are set to zero.
const NEGLIGIBLE_COMPONENT: f64 = 1e-3;

/// Half width of a 95 % interval of a normal variable, in standard deviations.
pub(super) const NORMAL_QUANTILE_95: f64 = 1.959_963_984_540_054;

/// Singular values and right singular vectors of derivatives of the data.
pub(super) struct SingularDirections {
    /// Singular values, ascending.
    pub values: Vec<f64>,
    /// Right singular vectors, as columns.
    pub directions: DMatrix<f64>,
}

pub(super) fn singular_value_decomposition(jacobian: &DMatrix<f64>) -> SingularDirections {
    let count = jacobian.ncols();
    if jacobian.nrows() > 2 * count {
        // For many rows: those of the triangular factor, which are the same.
        return singular_value_decomposition(&jacobian.clone().qr().r());
    }
    // Padded with zero rows, there are as many values as columns.
    let rows = jacobian.nrows().max(count);
    let square = jacobian.clone().resize_vertically(rows, 0.0);
    let svd = square.svd(false, true);
    let rows = svd.v_t.unwrap_or_else(|| DMatrix::identity(count, count));
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b]));
    let values = order.iter().map(|&k| svd.singular_values[k]).collect();
    let directions = DMatrix::from_fn(count, count, |r, c| rows[(order[c], r)]);
    SingularDirections { values, directions }
}

/// A basis of a space of directions with as many zero components as possible:
/// its reduced row echelon form.
pub(super) fn sparse_basis(space: &DMatrix<f64>) -> Vec<Vec<(usize, f64)>> {
    let mut rows = space.transpose();
    let (count, width) = rows.shape();
    let mut pivots: Vec<usize> = Vec::new();
    for row in 0..count {
        let free = (0..width).filter(|k| !pivots.contains(k));
        let largest = free
            .flat_map(|k| (row..count).map(move |r| (r, k)))
            .max_by(|a, b| rows[*a].abs().total_cmp(&rows[*b].abs()));
        let Some((from, column)) = largest else { break };
        rows.swap_rows(row, from);
        pivots.push(column);
        let pivot = rows[(row, column)];
        rows.row_mut(row).scale_mut(1.0 / pivot);
        let own = rows.row(row).into_owned();
        for other in (0..count).filter(|other| *other != row) {
            let part = rows[(other, column)];
            let mut target = rows.row_mut(other);
            target -= &own * part;
        }
    }
    let parts = |row: usize| {
        let largest = rows.row(row).amax();
        let all = (0..width).map(|k| (k, rows[(row, k)] / largest));
        all.filter(|(_, part)| part.abs() > NEGLIGIBLE_COMPONENT)
            .collect()
    };
    let mut all: Vec<Vec<(usize, f64)>> = (0..count).map(parts).collect();
    all.sort_by_key(|parts| parts.first().map_or(0, |part| part.0));
    all
}

/// Half width of a 95 % interval in standard deviations that are estimated with this number of
/// degrees of freedom (Student's distribution; Abramowitz and Stegun, Handbook of Mathematical
/// Functions, 26.7.5).
pub(super) fn student_quantile_95(freedom: usize) -> f64 {
    const FEW: [f64; 4] = [12.706_2, 4.302_7, 3.182_4, 2.776_4];
    if let Some(quantile) = FEW.get(freedom.wrapping_sub(1)) {
        return *quantile;
    }
    let (z, n) = (NORMAL_QUANTILE_95, freedom as f64);
    let z2 = z * z;
    z + z * (z2 + 1.0) / (4.0 * n)
        + z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * n * n)
        + z * (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / (384.0 * n.powi(3))
        + z * (79.0 * z2.powi(4) + 776.0 * z2.powi(3) + 1482.0 * z2 * z2 - 1920.0 * z2 - 945.0)
            / (92160.0 * n.powi(4))
}

/// Excess of the sum of squares over the minimum, in squared spreads.
pub(super) fn normalized_excess(stats: &FitStatistics, point: &FitPoint) -> f64 {
    let residuals = stats.weighting.residuals(point);
    let bound = stats.weighting.huber_bound(&stats.residuals);
    let sum = |residuals: &DVector<f64>| stats.weighting.huber_sum(residuals, bound);
    (sum(&residuals) - sum(&stats.residuals)) / stats.residual_deviation.powi(2)
}

/// A point near a minimum, with its residuals.
pub(super) struct EvaluatedPoint {
    pub residuals: DVector<f64>,
    pub point: FitPoint,
}

pub(super) struct MinimumNeighbourhood<'j, 'm, 'a> {
    pub stats: &'j FitStatistics<'m, 'a>,
    /// Numbers at a bound, which stay fixed.
    fixed: Vec<bool>,
}

/// Derivatives of the residuals, and the Gauss-Newton curvature of the sum of squares, slightly
/// regularized, so that combinations to which the data are insensitive do not change.
pub(super) struct GaussNewtonModel {
    jacobian: DMatrix<f64>,
    curvature: DMatrix<f64>,
}

/// A point with derivatives.
pub(super) struct DifferentiatedPoint {
    pub point: FitPoint,
    pub model: GaussNewtonModel,
}

/// The least sum of squares with one number fixed away from the minimum.
pub(super) struct ConstrainedMinimum {
    /// Its excess over the minimum, in squared spreads.
    pub excess: f64,
    /// Its excess if the other numbers do not change.
    pub excess_without_correction: f64,
    /// The change of the other numbers.
    pub correction: DVector<f64>,
    /// Half of its first derivative, and half of its second derivative.
    half_slope: f64,
    half_curvature: f64,
}

impl<'j, 'm, 'a> MinimumNeighbourhood<'j, 'm, 'a> {
    /// `None` if residuals have different weights, or derivatives are not known.
    pub fn new(stats: &'j FitStatistics<'m, 'a>) -> Option<Self> {
        let differentiated = |case: &CaseSolution| case.responses.is_some();
        if stats.weighting.is_robust || !stats.point.case_solutions.iter().all(differentiated) {
            return None;
        }
        let coordinates = stats.model.coordinates.iter().zip(&stats.point.theta);
        let fixed = coordinates.map(|(free, theta)| free.active_bound(*theta).is_some());
        Some(MinimumNeighbourhood {
            stats,
            fixed: fixed.collect(),
        })
    }

    pub fn gauss_newton_model(&self) -> GaussNewtonModel {
        self.gauss_newton_from_jacobian(self.stats.jacobian.clone())
    }

    /// Derivatives at another point, which stores them.
    pub fn gauss_newton_model_at(
        &self,
        mut there: FitPoint,
    ) -> Result<DifferentiatedPoint, ContinuationFailure> {
        self.stats.model.differentiate_data(&mut there)?;
        let jacobian = self.stats.weighting.jacobian(&there);
        Ok(DifferentiatedPoint {
            model: self.gauss_newton_from_jacobian(jacobian),
            point: there,
        })
    }

    fn gauss_newton_from_jacobian(&self, mut jacobian: DMatrix<f64>) -> GaussNewtonModel {
        let stats = self.stats;
        for k in (0..self.fixed.len()).filter(|&k| self.fixed[k]) {
            jacobian.column_mut(k).fill(0.0);
        }
        let count = stats.singular_values.len();
        let least = (stats.coverage_factor / UNDETERMINED_UNCERTAINTY).powi(2);
        let curvature = jacobian.tr_mul(&jacobian) / stats.residual_deviation.powi(2)
            + DMatrix::identity(count, count) * least;
        GaussNewtonModel {
            jacobian,
            curvature,
        }
    }

    /// The values after a change from the minimum, clamped to the bounds.
    pub fn bounded_update(&self, change: &DVector<f64>) -> Vec<f64> {
        let theta = &self.stats.point.theta;
        let mut moved = self.stats.model.bounded_update(theta, 1.0, change);
        for k in (0..theta.len()).filter(|&k| self.fixed[k]) {
            moved[k] = theta[k];
        }
        moved
    }

    /// The residuals for other values, and their point, followed from a point with
    /// derivatives.
    pub fn residuals(
        &self,
        from: &FitPoint,
        theta: &[f64],
    ) -> Result<EvaluatedPoint, ContinuationFailure> {
        let stats = self.stats;
        let there = stats
            .model
            .continue_leaves_on_grids(from, theta, GridPolicy::These)?;
        Ok(EvaluatedPoint {
            residuals: stats.weighting.residuals(&there),
            point: there,
        })
    }

    /// The least sum of squares over all numbers but the `k`th, linearized where the residuals
    /// are these, with a step no longer than `longest`.
    pub fn constrained_minimum(
        &self,
        slopes: &GaussNewtonModel,
        k: usize,
        residuals: &DVector<f64>,
        longest: f64,
    ) -> Option<ConstrainedMinimum> {
        let stats = self.stats;
        let mut curvature = slopes.curvature.clone();
        let mut coupled = -curvature.column(k);
        coupled[k] = 1.0;
        curvature.row_mut(k).fill(0.0);
        curvature.column_mut(k).fill(0.0);
        curvature[(k, k)] = 1.0;
        let variance = stats.residual_deviation.powi(2);
        let mut slope = slopes.jacobian.tr_mul(residuals) / variance;
        slope[k] = 0.0;
        let inverse = curvature.clone().cholesky()?;
        let along = inverse.solve(&coupled);
        let mut correction = -inverse.solve(&slope);
        let corrected = residuals + &slopes.jacobian * &correction;
        let change = &slopes.jacobian * &along;
        let mut damping = (stats.coverage_factor / UNDETERMINED_UNCERTAINTY).powi(2);
        while correction.norm() > longest {
            damping *= 2.0;
            let count = curvature.nrows();
            let damped = &curvature + DMatrix::identity(count, count) * damping;
            correction = -damped.cholesky()?.solve(&slope);
        }
        let least = stats.residuals.norm_squared();
        let above = |residuals: &DVector<f64>| (residuals.norm_squared() - least) / variance;
        Some(ConstrainedMinimum {
            excess: above(&corrected),
            excess_without_correction: above(residuals),
            half_slope: corrected.dot(&change) / variance,
            half_curvature: change.norm_squared() / variance,
            correction,
        })
    }
}

impl ConstrainedMinimum {
    /// The change of the number at which the least sum exceeds the minimum by `above`, with
    /// linearized residuals: the farther of two solutions, or the minimum of the excess if there
    /// are none.
    pub fn step_to_excess(&self, above: f64, sign: f64) -> f64 {
        let root = self.half_slope.powi(2) - self.half_curvature * (self.excess - above);
        (sign * root.max(0.0).sqrt() - self.half_slope) / self.half_curvature
    }
}

/// Prior of a coordinate: 95 % within a factor of ten up and down.
const PRIOR_DEVIATION: f64 = std::f64::consts::LN_10 / NORMAL_QUANTILE_95;

/// The information each of these experiments would add to the fit, the most informative
/// first. Its data are as accurate as given, or as those of the fit.
pub(super) fn rank_candidate_experiments(
    stats: &FitStatistics,
    wanted: &[Experiment],
) -> Result<Vec<FitCandidate>, FitError> {
    let count = stats.singular_values.len();
    let known = stats.jacobian.transpose() * &stats.jacobian / stats.residual_deviation.powi(2);
    let known = known + DMatrix::identity(count, count) / PRIOR_DEVIATION.powi(2);
    let mut found = Vec::new();
    for experiment in wanted {
        let data = Data {
            experiments: vec![experiment.clone()],
            ..Data::default()
        };
        let of = stats.model;
        // One leaf for each, whatever the search took.
        let budget = EvaluationBudget::new(usize::MAX);
        let model = FitModel::new(of.base, of.coordinates, &of.options, data, budget)?;
        let mut candidate = FitCandidate {
            experiment: experiment.name.clone(),
            bits: 0.0,
            shrinks: 1.0,
            remark: None,
        };
        match information_added(stats, &model) {
            Err(refused) => candidate.remark = Some(refused),
            Ok(added) => {
                let with = &known + &added;
                let size = |matrix: &DMatrix<f64>| {
                    let values = matrix.clone().symmetric_eigen().eigenvalues;
                    let least = values.min();
                    (values.iter().map(|value| value.log2()).sum::<f64>(), least)
                };
                let ((before, least_before), (after, least_after)) = (size(&known), size(&with));
                candidate.bits = 0.5 * (after - before);
                candidate.shrinks = (least_before / least_after).sqrt();
            }
        }
        found.push(candidate);
    }
    found.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    Ok(found)
}

fn information_added(
    stats: &FitStatistics,
    model: &FitModel,
) -> Result<DMatrix<f64>, FitCandidateRemark> {
    let refused = |why: FitError| FitCandidateRemark::Refused(why.to_string());
    let found = model.relax_leaves(&stats.point.theta);
    let mut point = found.map_err(refused)?;
    (model.check_weights(&point)).map_err(refused)?;
    (model.differentiate_data(&mut point)).map_err(|_| FitCandidateRemark::Singular)?;
    let sd = |component: &ScalarDatum| match component.quantity {
        DatumQuantity::Result(quantity) => component
            .sd
            .or(stats.typical_deviation(quantity.dimension())),
        DatumQuantity::Vein { .. } => component.sd,
    };
    let sd: Option<Vec<f64>> = point.components().map(sd).collect();
    let sd = sd.ok_or(FitCandidateRemark::NoDeviation)?;
    let rows: Vec<&Vec<f64>> = point.gradients().collect();
    let jacobian = DMatrix::from_fn(rows.len(), stats.singular_values.len(), |i, k| {
        rows[i][k] / sd[i]
    });
    Ok(jacobian.transpose() * jacobian)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of tables of Student's distribution.
    #[test]
    fn quantiles_of_students_distribution() {
        for (freedom, quantile) in [
            (1, 12.7062),
            (4, 2.7764),
            (5, 2.5706),
            (10, 2.2281),
            (30, 2.0423),
            (1_000_000, 1.9600),
        ] {
            assert!(
                (student_quantile_95(freedom) - quantile).abs() < 5e-4,
                "{freedom}"
            );
        }
    }

    #[test]
    fn a_space_of_directions_has_a_sparse_basis() {
        // Spanned by (1, 1, 0, 0) and (0, 0, 1, -2), mixed.
        let space = DMatrix::from_column_slice(4, 2, &[1.0, 1.0, 1.0, -2.0, 2.0, 2.0, -1.0, 2.0]);
        let basis = sparse_basis(&space);
        assert!(basis[0].iter().map(|part| part.0).eq([0, 1]));
        assert!((basis[0][0].1 - basis[0][1].1).abs() < 1e-12);
        assert!((basis[1][0].1 + 0.5).abs() < 1e-12 && basis[1][1].1 == 1.0);
    }

    #[test]
    fn rows_fewer_than_columns_leave_directions_unfelt() {
        let SingularDirections { values, directions } =
            singular_value_decomposition(&DMatrix::from_row_slice(1, 2, &[3.0, 4.0]));
        assert!(values[0] < 1e-12 && (values[1] - 5.0).abs() < 1e-12);
        let insensitive = directions.column(0);
        assert!((3.0 * insensitive[0] + 4.0 * insensitive[1]).abs() < 1e-12);
    }
}
