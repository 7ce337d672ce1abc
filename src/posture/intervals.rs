//! What the noise of the points makes of the least modulus.
//!
//! An eigenvalue changes to first order as the Rayleigh quotient of its mode does. The covariance of the smoothed
//! curve's coefficients therefore gives the standard deviation of log E*.

use crate::posture::Posture;
use crate::posture::smoothing::{SmoothedCurve, local_basis};
use glam::DVec3;
use nalgebra::DVector;

/// Quantile of the normal distribution for 95 %.
const NORMAL_QUANTILE: f64 = 1.959_963_985;

/// Factor on the standard deviations of log E*, which are those of first order: with it 95 % intervals hold the E* of
/// 92 to 97 of 100 twins with noise of 0.1 to 1 % of the length (`tests/statics/postures`).
const COVERAGE_FACTOR: f64 = 1.06;

/// Change of a coefficient in a difference quotient, in lengths of the curve.
const DIFFERENCE: f64 = 1e-6;

/// Standard deviation of log E*, to first order in the noise; zero where there is none.
pub fn relative_deviation(posture: &Posture) -> f64 {
    let (Some(smoothed), Some(mode)) = (posture.smoothing(), &posture.mode) else {
        return 0.0;
    };
    let directors = posture.critical_directors();
    let quotient = |first: &[DVec3]| {
        let line = posture.elements.line(first);
        mode.rayleigh_quotient(&posture.elements, &line, directors)
    };
    let variance = variance_of(posture, smoothed, &quotient);
    variance.sqrt() / posture.critical.value
}

/// The variance of a number that follows from the derivatives dr/dt at the Gauss points, to first order.
fn variance_of(
    posture: &Posture,
    smoothed: &SmoothedCurve,
    number: &dyn Fn(&[DVec3]) -> f64,
) -> f64 {
    let intervals = smoothed.curve.intervals();
    let at = posture.elements.at.iter();
    let rows: Vec<_> = at.map(|&t| local_basis(intervals, t)).collect();
    let first: Vec<DVec3> = rows
        .iter()
        .map(|basis| smoothed.curve.point(basis).first)
        .collect();
    let step = DIFFERENCE * posture.line.length;
    let axes = posture.noisy_axes();
    let mut changed = first.clone();
    let mut variance = 0.0;
    for axis in axes {
        let gradient = DVector::from_fn(smoothed.curve.count(), |j, _| {
            let shift = |changed: &mut Vec<DVec3>, by: f64| {
                for (k, basis) in rows.iter().enumerate() {
                    let local = j.wrapping_sub(basis.first);
                    let rate = basis.derivatives[1].get(local).copied().unwrap_or(0.0);
                    changed[k] = first[k] + by * rate * axis;
                }
            };
            shift(&mut changed, step);
            let above = number(&changed);
            shift(&mut changed, -step);
            (above - number(&changed)) / (2.0 * step)
        });
        variance += gradient.dot(&(&smoothed.covariance * &gradient));
    }
    // The parameters follow the points along the curve, so that the ends of the curve are where the first and the last
    // point are: their noise along it is not smoothed.
    for end in [0.0, 1.0] {
        let shift = |changed: &mut Vec<DVec3>, by: f64| {
            for (k, &t) in posture.elements.at.iter().enumerate() {
                let point = smoothed.curve.at(t);
                let speed = point.first.length();
                let tangent = point.first / speed;
                let turn = (point.second - point.second.dot(tangent) * tangent) / speed;
                let (part, slope) = if end == 1.0 {
                    (t, 1.0)
                } else {
                    (1.0 - t, -1.0)
                };
                changed[k] = first[k] + by * (slope * tangent + part * turn);
            }
        };
        shift(&mut changed, step);
        let above = number(&changed);
        shift(&mut changed, -step);
        let rate = (above - number(&changed)) / (2.0 * step);
        let basis = local_basis(smoothed.curve.intervals(), end);
        let missing = smoothed.deviation.powi(2) - smoothed.variance(&basis);
        variance += rate * rate * missing.max(0.0);
    }
    variance
}

/// Half the width of 95 % intervals in standard deviations where these are known from so many independent residuals:
/// the quantile of Student's distribution (Cornish and Fisher's expansion).
pub fn student_quantile(freedom: f64) -> f64 {
    let z = NORMAL_QUANTILE;
    let [z3, z5, z7] = [3, 5, 7].map(|power| z.powi(power));
    z + (z3 + z) / (4.0 * freedom)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * freedom.powi(2))
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * freedom.powi(3))
}

impl Posture {
    /// The directions in which the points have noise.
    pub fn noisy_axes(&self) -> Vec<DVec3> {
        match self.parts.first().map(|part| &part.directors) {
            Some(crate::posture::line::Directors::Planar { normal, .. }) if self.is_planar() => {
                let one = normal.any_orthonormal_vector();
                vec![one, normal.cross(one)]
            }
            _ => vec![DVec3::X, DVec3::Y, DVec3::Z],
        }
    }

    /// Half the width of 95 % intervals, in standard deviations of first order.
    pub fn interval_factor(&self) -> f64 {
        let freedom = self
            .smoothing()
            .map_or(f64::INFINITY, |it| it.residual_freedom);
        COVERAGE_FACTOR * student_quantile(freedom)
    }

    /// The 95 % interval of the least modulus.
    pub fn critical_interval(&self) -> [f64; 2] {
        let factor = (self.interval_factor() * self.critical.relative_deviation).exp();
        [self.critical.value / factor, self.critical.value * factor]
    }
}
