//! Residuals around a minimum, and the least sum of squares there for a number that is
//! moved.

use nalgebra::{DMatrix, DVector};

use super::case::CaseAt;
use super::judge::{Judge, OPEN};
use super::model::Point;
use crate::relax::{Grids, Lost};

/// The surroundings of a minimum.
pub(super) struct Around<'j, 'm, 'a> {
    pub judge: &'j Judge<'m, 'a>,
    /// Numbers at a bound, which stay there.
    fixed: Vec<bool>,
}

/// Derivatives of the residuals, and the curvature of the sum of squares by them, with a
/// little more, so that combinations that are hardly felt stay where they are.
pub(super) struct Slopes {
    jacobian: DMatrix<f64>,
    curvature: DMatrix<f64>,
}

/// The least sum of squares where a number is held away from the minimum.
pub(super) struct Least {
    /// By how much it is above the minimum, in squared spreads.
    pub above: f64,
    /// What that would be if the others stayed.
    pub straight: f64,
    /// How the others have to move.
    pub correction: DVector<f64>,
    /// Half of the derivative of that sum, and of its second derivative.
    slope: f64,
    bend: f64,
}

impl<'j, 'm, 'a> Around<'j, 'm, 'a> {
    /// `None` where residuals are not weighed alike, or derivatives are not known.
    pub fn new(judge: &'j Judge<'m, 'a>) -> Option<Self> {
        let differentiated = |case: &CaseAt| case.answers.is_some();
        if judge.weighing.robust || !judge.point.cases.iter().all(differentiated) {
            return None;
        }
        let coordinates = judge.model.coordinates.iter().zip(&judge.point.theta);
        let fixed = coordinates.map(|(free, theta)| free.bounds.contains(theta));
        Some(Around {
            judge,
            fixed: fixed.collect(),
        })
    }

    /// Derivatives at the minimum.
    pub fn slopes(&self) -> Slopes {
        self.slopes_of(self.judge.jacobian.clone())
    }

    /// Derivatives at another point, which has them then.
    pub fn slopes_at(&self, mut there: Point) -> Result<(Point, Slopes), Lost> {
        self.judge.model.differentiate(&mut there)?;
        let slopes = self.slopes_of(self.judge.weighing.jacobian(&there));
        Ok((there, slopes))
    }

    fn slopes_of(&self, mut jacobian: DMatrix<f64>) -> Slopes {
        let judge = self.judge;
        for k in (0..self.fixed.len()).filter(|&k| self.fixed[k]) {
            jacobian.column_mut(k).fill(0.0);
        }
        let count = judge.values.len();
        let least = (judge.quantile / OPEN).powi(2);
        let curvature = jacobian.tr_mul(&jacobian) / judge.spread.powi(2)
            + DMatrix::identity(count, count) * least;
        Slopes {
            jacobian,
            curvature,
        }
    }

    /// The values after a change from the minimum, within bounds.
    pub fn moved(&self, change: &DVector<f64>) -> Vec<f64> {
        let judge = self.judge;
        let coordinates = judge.model.coordinates.iter().zip(&judge.point.theta);
        let moved = coordinates.zip(change.iter()).zip(&self.fixed);
        moved
            .map(|(((free, theta), change), fixed)| match fixed {
                true => *theta,
                false => (theta + change).clamp(free.bounds[0], free.bounds[1]),
            })
            .collect()
    }

    /// The residuals for other values, and the point, followed from one that is
    /// differentiated.
    pub fn residuals(&self, from: &Point, theta: &[f64]) -> Result<(DVector<f64>, Point), Lost> {
        let judge = self.judge;
        let there = judge.model.follow_on(from, theta, Grids::These)?;
        Ok((judge.weighing.residuals(&there), there))
    }

    /// The least sum of squares over all numbers but the `k`th, to first order from where
    /// the residuals are these, and no farther from there than `longest`.
    pub fn least(
        &self,
        slopes: &Slopes,
        k: usize,
        residuals: &DVector<f64>,
        longest: f64,
    ) -> Option<Least> {
        let judge = self.judge;
        let mut curvature = slopes.curvature.clone();
        let mut coupled = -curvature.column(k);
        coupled[k] = 1.0;
        curvature.row_mut(k).fill(0.0);
        curvature.column_mut(k).fill(0.0);
        curvature[(k, k)] = 1.0;
        let variance = judge.spread.powi(2);
        let mut slope = slopes.jacobian.tr_mul(residuals) / variance;
        slope[k] = 0.0;
        let inverse = curvature.clone().cholesky()?;
        let along = inverse.solve(&coupled);
        let mut correction = -inverse.solve(&slope);
        let corrected = residuals + &slopes.jacobian * &correction;
        let change = &slopes.jacobian * &along;
        let mut damping = (judge.quantile / OPEN).powi(2);
        while correction.norm() > longest {
            damping *= 2.0;
            let count = curvature.nrows();
            let damped = &curvature + DMatrix::identity(count, count) * damping;
            correction = -damped.cholesky()?.solve(&slope);
        }
        let least = judge.residuals.norm_squared();
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
    /// By how much the number has to move so that the least sum is `above` the minimum, to
    /// first order of the residuals: the farther of two such places, or where it is
    /// least if there are none.
    pub fn step(&self, above: f64, sign: f64) -> f64 {
        let root = self.slope.powi(2) - self.bend * (self.above - above);
        (sign * root.max(0.0).sqrt() - self.slope) / self.bend
    }
}
