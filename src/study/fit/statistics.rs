//! Statistics of a minimum: deviations, correlations, bands.

use nalgebra::{DMatrix, DVector};

use super::case::Component;
use super::directions::{NORMAL, NULL, singular, student};
use super::least_squares::Weighting;
use super::model::{Model, Point};
use super::quantity::Kind;

/// A number with an uncertainty of more than this, in logarithms or units, is not determined: a
/// factor of ten.
pub(super) const OPEN: f64 = std::f64::consts::LN_10;

/// A number with a larger component than this in combinations to which the data are insensitive
/// is not determined.
const INSENSITIVE: f64 = 1e-3;

/// The minimum and its statistics.
pub(super) struct Statistics<'m, 'a> {
    pub model: &'m Model<'a>,
    pub weighting: Weighting,
    /// Whether the standard deviations of the data are known.
    pub known: bool,
    pub point: &'m Point,
    pub residuals: DVector<f64>,
    pub jacobian: DMatrix<f64>,
    /// Singular directions of the coordinates, in ascending order of the sensitivity of the data,
    /// and the singular values.
    pub directions: DMatrix<f64>,
    pub values: Vec<f64>,
    /// Number of directions, the first ones, to which the data are insensitive.
    pub insensitive: usize,
    /// Degrees of freedom: data minus determined combinations.
    pub freedom: usize,
    /// Standard deviation of residuals.
    pub spread: f64,
    /// Half width of a 95 % interval in standard deviations.
    pub quantile: f64,
}

impl<'m, 'a> Statistics<'m, 'a> {
    pub fn new(model: &'m Model<'a>, weighting: Weighting, known: bool, point: &'m Point) -> Self {
        let residuals = weighting.residuals(point);
        let (roots, jacobian) = weighting.weighted(point, &residuals);
        let (values, directions) = singular(&jacobian);
        let largest = values.last().copied().unwrap_or(0.0);
        let insensitive = values
            .iter()
            .filter(|value| **value <= NULL * largest)
            .count();
        let count = point
            .components()
            .filter(|component| !component.free)
            .count();
        let freedom = count.saturating_sub(values.len() - insensitive);
        let weighed = residuals.component_mul(&roots);
        let (spread, quantile) = match known || freedom == 0 {
            true => (1.0, NORMAL),
            false => {
                let mean = weighed.norm_squared() / freedom as f64;
                (mean.sqrt(), student(freedom))
            }
        };
        Statistics {
            model,
            weighting,
            known,
            point,
            residuals,
            jacobian,
            directions,
            values,
            insensitive,
            freedom,
            spread,
            quantile,
        }
    }

    /// Standard deviation of a coordinate, and the correlated changes of the others.
    pub fn deviation(&self, k: usize) -> (f64, DVector<f64>) {
        let sensitive = self.insensitive..self.values.len();
        let mut along = DVector::zeros(self.values.len());
        for direction in sensitive {
            let v = self.directions.column(direction);
            along += v * (v[k] * (self.spread / self.values[direction]).powi(2));
        }
        let variance = along[k];
        match variance > 0.0 {
            true => (variance.sqrt(), along / variance),
            false => (0.0, along),
        }
    }

    /// The changes of the others that are correlated with that of a coordinate, if none of them has
    /// a larger uncertainty than [`OPEN`]: weakly determined combinations then do not change.
    pub fn conditional(&self, k: usize) -> DVector<f64> {
        let mut along = DVector::zeros(self.values.len());
        for (direction, value) in self.values.iter().enumerate() {
            let v = self.directions.column(direction);
            let sensitive = (value / self.spread).powi(2);
            along += v * (v[k] / (sensitive + (self.quantile / OPEN).powi(2)));
        }
        let own = along[k];
        along / own
    }

    /// Whether the sum of squares of the residuals is larger than their standard deviations allow:
    /// at the quantile of five deviations of a normal variable (Wilson and Hilferty 1931).
    pub fn suspicious(&self) -> bool {
        let freedom = self.freedom.max(1) as f64;
        let part = 2.0 / (9.0 * freedom);
        let most = freedom * (1.0 - part + 5.0 * part.sqrt()).powi(3);
        let explained = self.residuals.norm_squared() <= most;
        !self.weighting.robust && !explained
    }

    /// Whether the data are sensitive to every change of a coordinate.
    pub fn is_sensitive_to(&self, k: usize) -> bool {
        let insensitive =
            (0..self.insensitive).map(|direction| self.directions[(k, direction)].powi(2));
        insensitive.sum::<f64>().sqrt() <= INSENSITIVE
    }

    /// Whether the data drove a coordinate far from its initial value without determining it, or to
    /// a bound.
    pub fn ran_away(&self, k: usize) -> bool {
        let (free, theta) = (&self.model.coordinates[k], self.point.theta[k]);
        let far = (theta - free.start).abs() > OPEN;
        free.at_bound(theta).is_some() || far && self.is_vague(k)
    }

    /// Whether the data determine a coordinate to no better than a factor of ten.
    pub fn is_vague(&self, k: usize) -> bool {
        self.quantile * self.deviation(k).0 > OPEN
    }

    /// The standard deviation of a candidate's datum: that of the fit's data of its kind.
    pub fn assumed(&self, kind: Kind) -> Option<f64> {
        let alike = |component: &&Component| component.what.kind() == kind;
        let alike = self.point.components().filter(alike);
        let mut sds: Vec<f64> = alike.map(|c| self.sd(c)).collect();
        sds.sort_by(f64::total_cmp);
        sds.get(sds.len() / 2).copied()
    }

    /// The standard deviation of a datum: as given, or as estimated from all residuals.
    pub fn sd(&self, component: &Component) -> f64 {
        component.sd.unwrap_or(self.spread * self.weighting.assumed)
    }

    /// Correlations of the coordinates to which the data are sensitive.
    pub fn correlations(&self) -> Vec<Vec<Option<f64>>> {
        let count = self.values.len();
        let deviations: Vec<_> = (0..count).map(|k| self.deviation(k)).collect();
        let entry = |a: usize, b: usize| {
            let ((own, along), (other, _)) = (&deviations[a], &deviations[b]);
            let known =
                self.is_sensitive_to(a) && self.is_sensitive_to(b) && *own > 0.0 && *other > 0.0;
            // along is the covariance with a over its variance.
            known.then(|| (along[b] * own / other).clamp(-1.0, 1.0))
        };
        let row = |a: usize| (0..count).map(|b| entry(a, b)).collect();
        (0..count).map(row).collect()
    }

    /// Half width of the model's 95 % band at each datum.
    pub fn bands(&self) -> Vec<f64> {
        let roots = self.weighting.roots(&self.residuals);
        let components = self.point.components().enumerate();
        components
            .map(|(i, component)| {
                let row = self.jacobian.row(i);
                let sensitive = self.insensitive..self.values.len();
                let variance: f64 = sensitive
                    .map(|direction| {
                        let v = self.directions.column(direction);
                        ((row * v)[(0, 0)] / self.values[direction]).powi(2)
                    })
                    .sum();
                let sd = component.sd.unwrap_or(self.weighting.assumed);
                self.quantile * self.spread * variance.sqrt() * sd / roots[i]
            })
            .collect()
    }
}
