//! Residuals near a minimum, and the least sum of squares for a given displacement of one
//! number.

use nalgebra::{DMatrix, DVector};

use super::case::CaseAt;
use super::model::Point;
use super::statistics::{OPEN, Statistics};
use crate::relax::{Grids, Lost};

/// The neighbourhood of a minimum.
pub(super) struct Neighbourhood<'j, 'm, 'a> {
    pub stats: &'j Statistics<'m, 'a>,
    /// Numbers at a bound, which stay fixed.
    fixed: Vec<bool>,
}

/// Derivatives of the residuals, and the Gauss-Newton curvature of the sum of squares, slightly
/// regularised, so that combinations to which the data are insensitive do not change.
pub(super) struct Slopes {
    jacobian: DMatrix<f64>,
    curvature: DMatrix<f64>,
}

/// The least sum of squares with one number fixed away from the minimum.
pub(super) struct Least {
    /// Its excess over the minimum, in squared spreads.
    pub above: f64,
    /// The same if the other numbers do not change.
    pub straight: f64,
    /// The change of the other numbers.
    pub correction: DVector<f64>,
    /// Half of its first derivative, and half of its second derivative.
    slope: f64,
    bend: f64,
}

impl<'j, 'm, 'a> Neighbourhood<'j, 'm, 'a> {
    /// `None` if residuals have different weights, or derivatives are not known.
    pub fn new(stats: &'j Statistics<'m, 'a>) -> Option<Self> {
        let differentiated = |case: &CaseAt| case.responses.is_some();
        if stats.weighting.robust || !stats.point.cases.iter().all(differentiated) {
            return None;
        }
        let coordinates = stats.model.coordinates.iter().zip(&stats.point.theta);
        let fixed = coordinates.map(|(free, theta)| free.at_bound(*theta).is_some());
        Some(Neighbourhood {
            stats,
            fixed: fixed.collect(),
        })
    }

    pub fn slopes(&self) -> Slopes {
        self.slopes_of(self.stats.jacobian.clone())
    }

    /// Derivatives at another point, which stores them.
    pub fn slopes_at(&self, mut there: Point) -> Result<(Point, Slopes), Lost> {
        self.stats.model.differentiate(&mut there)?;
        let slopes = self.slopes_of(self.stats.weighting.jacobian(&there));
        Ok((there, slopes))
    }

    fn slopes_of(&self, mut jacobian: DMatrix<f64>) -> Slopes {
        let stats = self.stats;
        for k in (0..self.fixed.len()).filter(|&k| self.fixed[k]) {
            jacobian.column_mut(k).fill(0.0);
        }
        let count = stats.values.len();
        let least = (stats.quantile / OPEN).powi(2);
        let curvature = jacobian.tr_mul(&jacobian) / stats.spread.powi(2)
            + DMatrix::identity(count, count) * least;
        Slopes {
            jacobian,
            curvature,
        }
    }

    /// The values after a change from the minimum, clamped to the bounds.
    pub fn moved(&self, change: &DVector<f64>) -> Vec<f64> {
        let theta = &self.stats.point.theta;
        let mut moved = self.stats.model.moved(theta, 1.0, change);
        for k in (0..theta.len()).filter(|&k| self.fixed[k]) {
            moved[k] = theta[k];
        }
        moved
    }

    /// The residuals for other values, and their point, followed from a point with
    /// derivatives.
    pub fn residuals(&self, from: &Point, theta: &[f64]) -> Result<(DVector<f64>, Point), Lost> {
        let stats = self.stats;
        let there = stats.model.follow_on(from, theta, Grids::These)?;
        Ok((stats.weighting.residuals(&there), there))
    }

    /// The least sum of squares over all numbers but the `k`th, linearised where the residuals
    /// are these, with a step no longer than `longest`.
    pub fn least(
        &self,
        slopes: &Slopes,
        k: usize,
        residuals: &DVector<f64>,
        longest: f64,
    ) -> Option<Least> {
        let stats = self.stats;
        let mut curvature = slopes.curvature.clone();
        let mut coupled = -curvature.column(k);
        coupled[k] = 1.0;
        curvature.row_mut(k).fill(0.0);
        curvature.column_mut(k).fill(0.0);
        curvature[(k, k)] = 1.0;
        let variance = stats.spread.powi(2);
        let mut slope = slopes.jacobian.tr_mul(residuals) / variance;
        slope[k] = 0.0;
        let inverse = curvature.clone().cholesky()?;
        let along = inverse.solve(&coupled);
        let mut correction = -inverse.solve(&slope);
        let corrected = residuals + &slopes.jacobian * &correction;
        let change = &slopes.jacobian * &along;
        let mut damping = (stats.quantile / OPEN).powi(2);
        while correction.norm() > longest {
            damping *= 2.0;
            let count = curvature.nrows();
            let damped = &curvature + DMatrix::identity(count, count) * damping;
            correction = -damped.cholesky()?.solve(&slope);
        }
        let least = stats.residuals.norm_squared();
        let above = |residuals: &DVector<f64>| (residuals.norm_squared() - least) / variance;
        Some(Least {
            above: above(&corrected),
            straight: above(residuals),
            slope: corrected.dot(&change) / variance,
            bend: change.norm_squared() / variance,
            correction,
        })
    }
}

impl Least {
    /// The change of the number at which the least sum exceeds the minimum by `above`, with
    /// linearised residuals: the farther of two solutions, or the minimum of the excess if there
    /// are none.
    pub fn step(&self, above: f64, sign: f64) -> f64 {
        let root = self.slope.powi(2) - self.bend * (self.above - above);
        (sign * root.max(0.0).sqrt() - self.slope) / self.bend
    }
}
