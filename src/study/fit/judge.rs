//! What the data determine around a minimum: deviations, correlations, bands.

use nalgebra::{DMatrix, DVector};

use super::case::Component;
use super::directions::{NORMAL, NULL, singular, student};
use super::least_squares::Weighing;
use super::model::{Model, Point};
use super::quantity::Kind;

/// A number that may be this far off, in logarithms or units, is not determined: a
/// factor of ten.
pub(super) const OPEN: f64 = std::f64::consts::LN_10;

/// A number whose component in combinations that no datum feels is larger than this is
/// not determined.
const TAKES_PART: f64 = 1e-3;

/// How often the leaves of all experiments were brought to rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evaluations {
    /// As accurately as a search needs.
    pub rough: usize,
    /// As accurately as is wanted.
    pub accurate: usize,
}

/// The minimum and what surrounds it.
pub(super) struct Judge<'m, 'a> {
    pub model: &'m Model<'a>,
    pub weighing: Weighing,
    /// Whether the standard deviations of the data are known.
    pub known: bool,
    pub point: &'m Point,
    pub evaluations: Evaluations,
    pub residuals: DVector<f64>,
    pub jacobian: DMatrix<f64>,
    /// Directions of the coordinates, ascending in what the data say about them, and
    /// the singular values.
    pub directions: DMatrix<f64>,
    pub values: Vec<f64>,
    /// Directions that are not felt: the first so many.
    pub unfelt: usize,
    /// Data less determined combinations.
    pub freedom: usize,
    /// Standard deviation of residuals.
    pub spread: f64,
    /// Half of a 95 % interval in standard deviations.
    pub quantile: f64,
}

impl<'m, 'a> Judge<'m, 'a> {
    pub fn new(
        model: &'m Model<'a>,
        weighing: Weighing,
        known: bool,
        point: &'m Point,
        evaluations: Evaluations,
    ) -> Self {
        let residuals = weighing.residuals(point);
        let roots = weighing.roots(&residuals);
        let mut jacobian = match point.gradients().next() {
            Some(_) => weighing.jacobian(point),
            None => DMatrix::zeros(residuals.len(), point.theta.len()),
        };
        for (mut row, root) in jacobian.row_iter_mut().zip(roots.iter()) {
            row *= *root;
        }
        let (values, directions) = singular(&jacobian);
        let largest = values.last().copied().unwrap_or(0.0);
        let unfelt = values
            .iter()
            .filter(|value| **value <= NULL * largest)
            .count();
        let count = point
            .components()
            .filter(|component| !component.free)
            .count();
        let freedom = count.saturating_sub(values.len() - unfelt);
        let weighed = residuals.component_mul(&roots);
        let (spread, quantile) = match known || freedom == 0 {
            true => (1.0, NORMAL),
            false => {
                let mean = weighed.norm_squared() / freedom as f64;
                (mean.sqrt(), student(freedom))
            }
        };
        Judge {
            model,
            weighing,
            known,
            point,
            evaluations,
            residuals,
            jacobian,
            directions,
            values,
            unfelt,
            freedom,
            spread,
            quantile,
        }
    }

    /// Standard deviation of a coordinate, and what goes with its change in the others.
    pub fn deviation(&self, k: usize) -> (f64, DVector<f64>) {
        let felt = self.unfelt..self.values.len();
        let mut along = DVector::zeros(self.values.len());
        for direction in felt {
            let v = self.directions.column(direction);
            along += v * (v[k] * (self.spread / self.values[direction]).powi(2));
        }
        let variance = along[k];
        match variance > 0.0 {
            true => (variance.sqrt(), along / variance),
            false => (0.0, along),
        }
    }

    /// What goes with a change of a coordinate in the others, if no more than this is
    /// open of any of them: combinations that are hardly felt then stay where they are.
    pub fn conditional(&self, k: usize, open: f64) -> DVector<f64> {
        let mut along = DVector::zeros(self.values.len());
        for (direction, value) in self.values.iter().enumerate() {
            let v = self.directions.column(direction);
            let felt = (value / self.spread).powi(2);
            along += v * (v[k] / (felt + (self.quantile / open).powi(2)));
        }
        let own = along[k];
        along / own
    }

    /// The component of a coordinate in combinations that are not felt.
    fn takes_part(&self, k: usize) -> f64 {
        let unfelt = (0..self.unfelt).map(|direction| self.directions[(k, direction)].powi(2));
        unfelt.sum::<f64>().sqrt()
    }

    /// Whether the residuals are larger than their standard deviations allow: by five
    /// deviations of their sum of squares.
    pub fn suspicious(&self) -> bool {
        let freedom = self.freedom as f64;
        let expected = freedom + 5.0 * (2.0 * freedom).sqrt();
        self.freedom > 0 && !self.weighing.robust && self.residuals.norm_squared() > expected
    }

    /// Whether the data feel each change of a coordinate.
    pub fn feels(&self, k: usize) -> bool {
        self.takes_part(k) <= TAKES_PART
    }

    /// The standard deviation of a candidate's datum: as those of the fit of its kind.
    pub fn assumed(&self, kind: Kind) -> Option<f64> {
        let alike = |component: &&Component| component.what.kind() == kind;
        let alike = self.point.components().filter(alike);
        let mut sds: Vec<f64> = alike.map(|c| self.sd(c)).collect();
        sds.sort_by(f64::total_cmp);
        sds.get(sds.len() / 2).copied()
    }

    /// The standard deviation of a datum: as given, or as all residuals tell it.
    pub fn sd(&self, component: &Component) -> f64 {
        component.sd.unwrap_or(self.spread * self.weighing.assumed)
    }

    /// Correlations of the coordinates that the data feel.
    pub fn correlations(&self) -> Vec<Vec<Option<f64>>> {
        let count = self.values.len();
        let deviations: Vec<_> = (0..count).map(|k| self.deviation(k)).collect();
        let entry = |a: usize, b: usize| {
            let ((own, along), (other, _)) = (&deviations[a], &deviations[b]);
            let known = self.feels(a) && self.feels(b) && *own > 0.0 && *other > 0.0;
            // along is the covariance with a over its variance.
            known.then(|| (along[b] * own / other).clamp(-1.0, 1.0))
        };
        let row = |a: usize| (0..count).map(|b| entry(a, b)).collect();
        (0..count).map(row).collect()
    }

    /// Half of the model's 95 % band at each datum.
    pub fn bands(&self) -> Vec<f64> {
        let roots = self.weighing.roots(&self.residuals);
        let components = self.point.components().enumerate();
        components
            .map(|(i, component)| {
                let row = self.jacobian.row(i);
                let felt = self.unfelt..self.values.len();
                let variance: f64 = felt
                    .map(|direction| {
                        let v = self.directions.column(direction);
                        ((row * v)[(0, 0)] / self.values[direction]).powi(2)
                    })
                    .sum();
                let sd = component.sd.unwrap_or(self.weighing.assumed);
                self.quantile * self.spread * variance.sqrt() * sd / roots[i]
            })
            .collect()
    }
}
