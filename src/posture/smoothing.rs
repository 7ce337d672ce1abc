//! A smooth centreline through measured points: a quintic P-spline with a penalty on the third
//! derivative, whose weight is that of restricted maximum likelihood.
//!
//! The points are p_i = r(t_i) + noise, with t the distance along the points as a fraction of the whole, and
//! r(t) = sum of c_j B_j(t) with B-splines of degree 5 on uniform knots. With weights w_i = 1/sd_i^2 the
//! coefficients minimize
//!
//! ```text
//!   sum of w_i |p_i - r(t_i)|^2 + lambda * integral of |r'''|^2 dt
//! ```
//!
//! which is the posterior mean where r''' is white noise of the variance sigma^2/lambda (G. Wahba, Spline models
//! for observational data, 1990; P. H. C. Eilers and B. D. Marx, Stat. Sci. 11 (1996), 89). Parabolas are not
//! penalized. lambda maximizes the restricted likelihood, one for all coordinates. The posterior covariance of
//! every coordinate is sigma^2 (B^T W B + lambda P)^-1.

use crate::numbers::GAUSS_LEGENDRE_RULE;
use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, SymmetricEigen};

/// Degree of the splines.
const DEGREE: usize = 5;

/// Splines that do not vanish in an interval between knots.
const LOCAL: usize = DEGREE + 1;

/// Dimension of the polynomials without penalty: parabolas.
const UNPENALIZED: usize = 3;

/// Most intervals between knots: more do not change the curve, as the penalty decides.
const MOST_INTERVALS: usize = 24;

/// Least number of points.
pub const LEAST_POINTS: usize = 6;

/// Least standard deviation of a coordinate that is believed, as a fraction of the length: the likelihood of points
/// that others have smoothed or resampled has its maximum where the curve follows their interpolation.
const LEAST_DEVIATION: f64 = 1e-4;

/// Residuals with fewer degrees of freedom than this tell too little of the noise across the curve alone.
const LEAST_FREEDOM: f64 = 3.0;

/// Range of the logarithm of lambda beside that at which data and penalty weigh the same on average, and the number
/// of values at which the likelihood is looked at before its maximum is refined.
const LOG_LAMBDA_RANGE: [f64; 2] = [-35.0, 25.0];
const LOG_LAMBDA_SAMPLES: usize = 61;

/// A curve r(t), 0 <= t <= 1, as the sum of B-splines.
#[derive(Clone, Debug)]
pub struct SplineCurve {
    /// Number of intervals between knots.
    intervals: usize,
    /// Coefficients, one per spline.
    coefficients: Vec<DVec3>,
}

/// The splines that do not vanish at a place: the number of the first, and values and derivatives of each.
#[derive(Clone, Copy, Debug)]
pub struct LocalBasis {
    /// Number of the first of these splines.
    pub first: usize,
    /// Value, first, second and third derivative by t.
    pub derivatives: [[f64; LOCAL]; 4],
}

/// Position and derivatives of a curve by its parameter.
#[derive(Clone, Copy, Debug, Default)]
pub struct CurvePoint {
    /// r.
    pub position: DVec3,
    /// dr/dt.
    pub first: DVec3,
    /// d2r/dt2.
    pub second: DVec3,
}

/// Values of the B-splines of one degree at the fraction `u` of an interval between knots.
fn splines_of_degree(degree: usize, u: f64) -> [f64; LOCAL] {
    let mut values = [0.0; LOCAL];
    values[0] = 1.0;
    for p in 1..=degree {
        let mut saved = 0.0;
        for r in 0..p {
            let part = values[r] / p as f64;
            values[r] = saved + ((r + 1) as f64 - u) * part;
            saved = (u + (p - r - 1) as f64) * part;
        }
        values[p] = saved;
    }
    values
}

/// The basis at `t` on uniform knots.
pub fn local_basis(intervals: usize, t: f64) -> LocalBasis {
    let scaled = t.clamp(0.0, 1.0) * intervals as f64;
    let first = (scaled.floor() as usize).min(intervals - 1);
    let u = scaled - first as f64;
    let mut derivatives = [[0.0; LOCAL]; 4];
    for (order, row) in derivatives.iter_mut().enumerate() {
        // The derivative of a B-spline is the difference of two of the degree below.
        let mut values = splines_of_degree(DEGREE - order, u);
        for _ in 0..order {
            for j in (0..LOCAL).rev() {
                let before = if j > 0 { values[j - 1] } else { 0.0 };
                values[j] = before - values[j];
            }
        }
        let unit = (intervals as f64).powi(order as i32);
        *row = values.map(|value| value * unit);
    }
    LocalBasis { first, derivatives }
}

impl SplineCurve {
    /// Number of splines.
    pub fn count(&self) -> usize {
        self.coefficients.len()
    }

    /// Number of intervals between knots.
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// The curve at a place with this basis.
    pub fn point(&self, basis: &LocalBasis) -> CurvePoint {
        let mut sums = [DVec3::ZERO; 3];
        for k in 0..LOCAL {
            let coefficient = self.coefficients[basis.first + k];
            for (sum, of) in sums.iter_mut().zip(&basis.derivatives) {
                *sum += of[k] * coefficient;
            }
        }
        let [position, first, second] = sums;
        CurvePoint {
            position,
            first,
            second,
        }
    }

    /// Displaces a coefficient.
    pub fn shift(&mut self, j: usize, by: DVec3) {
        self.coefficients[j] += by;
    }

    /// The curve at `t`.
    pub fn at(&self, t: f64) -> CurvePoint {
        self.point(&local_basis(self.intervals, t))
    }
}

/// What the smoothing of points came to.
#[derive(Clone, Debug)]
pub struct SmoothedCurve {
    /// The posterior mean.
    pub curve: SplineCurve,
    /// The parameters of the points.
    pub at: Vec<f64>,
    /// The points.
    pub points: Vec<DVec3>,
    /// Covariance of the coefficients of a coordinate across the curve, for a unit of which all coordinates have the
    /// same.
    pub covariance: DMatrix<f64>,
    /// Standard deviation of a coordinate of a point with the weight 1: an estimate, or as given.
    pub deviation: f64,
    /// Whether the deviation was given.
    pub is_deviation_given: bool,
    /// Effective number of coefficients of each coordinate.
    pub degrees_of_freedom: f64,
    /// Number of independent residuals that tell the deviation; infinite if that is given.
    pub residual_freedom: f64,
    /// Weight of the penalty, in units of the sum of weights and the length.
    pub lambda: f64,
}

impl SmoothedCurve {
    /// The variance of a coordinate of the curve at a place with this basis.
    pub fn variance(&self, basis: &LocalBasis) -> f64 {
        let values = basis.derivatives[0];
        let mut variance = 0.0;
        for i in 0..LOCAL {
            for j in 0..LOCAL {
                variance +=
                    values[i] * values[j] * self.covariance[(basis.first + i, basis.first + j)];
            }
        }
        variance
    }
}

/// Fractions of the length of the polygon through the points.
pub fn chord_fractions(points: &[DVec3]) -> Vec<f64> {
    let mut along = vec![0.0];
    for pair in points.windows(2) {
        along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
    }
    let all = along[along.len() - 1];
    along.iter().map(|one| one / all).collect()
}

/// The integrals of B_i''' B_j'''.
fn penalty(intervals: usize) -> DMatrix<f64> {
    let size = intervals + DEGREE;
    let mut penalty = DMatrix::zeros(size, size);
    for interval in 0..intervals {
        for point in &GAUSS_LEGENDRE_RULE {
            let t = (interval as f64 + point.at) / intervals as f64;
            let third = local_basis(intervals, t).derivatives[3];
            let weight = point.weight / intervals as f64;
            for i in 0..LOCAL {
                for j in 0..LOCAL {
                    penalty[(interval + i, interval + j)] += weight * third[i] * third[j];
                }
            }
        }
    }
    penalty
}

/// The likelihood of one weight of the penalty, in the basis in which data and penalty are both diagonal.
struct RestrictedLikelihood {
    /// Penalty of each direction where its data term is 1; zero for parabolas.
    penalties: Vec<f64>,
    /// Sums over the coordinates of the squares of the data's projections on each direction.
    projections: Vec<f64>,
    /// Sum of squares of the data beside all directions.
    beside: f64,
    /// Number of data less that of parabolas, in all coordinates that have noise.
    freedom: f64,
    /// Number of coordinates that have noise.
    coordinates: f64,
    /// Known variance, or the least that is believed.
    variance: KnownVariance,
}

#[derive(Clone, Copy)]
enum KnownVariance {
    Given(f64),
    AtLeast(f64),
}

impl RestrictedLikelihood {
    /// The sum of squares and of the penalty, divided by the variance that makes it most likely.
    fn quadratic(&self, lambda: f64) -> f64 {
        let each = self.penalties.iter().zip(&self.projections);
        let shrunk = each.map(|(penalty, square)| {
            let weighted = lambda * penalty;
            square * weighted / (1.0 + weighted)
        });
        self.beside + shrunk.sum::<f64>()
    }

    fn variance(&self, lambda: f64) -> f64 {
        match self.variance {
            KnownVariance::Given(variance) => variance,
            KnownVariance::AtLeast(least) => (self.quadratic(lambda) / self.freedom).max(least),
        }
    }

    /// Minus twice the logarithm, but for a constant.
    fn deviance(&self, lambda: f64) -> f64 {
        let variance = self.variance(lambda);
        let penalized = self.penalties.iter().filter(|penalty| **penalty > 0.0);
        let determinant: f64 = penalized
            .map(|penalty| (1.0 + 1.0 / (lambda * penalty)).ln())
            .sum();
        self.freedom * variance.ln()
            + self.quadratic(lambda) / variance
            + self.coordinates * determinant
    }

    fn most_likely(&self) -> f64 {
        let mean = {
            let some = self.penalties.iter().filter(|penalty| **penalty > 0.0);
            let logs: Vec<f64> = some.map(|penalty| penalty.ln()).collect();
            logs.iter().sum::<f64>() / logs.len().max(1) as f64
        };
        let [low, high] = LOG_LAMBDA_RANGE.map(|log| log - mean);
        let step = (high - low) / (LOG_LAMBDA_SAMPLES - 1) as f64;
        let deviance = |log: f64| self.deviance(log.exp());
        let sampled = (0..LOG_LAMBDA_SAMPLES).map(|k| low + k as f64 * step);
        let best = sampled.map(|log| (log, deviance(log)));
        let best = best.fold((low, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a });
        golden_section(&deviance, best.0 - step, best.0 + step).exp()
    }
}

/// The minimum of a function of one minimum, to three digits of the interval.
pub fn golden_section(function: &dyn Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const PART: f64 = 0.381_966_011_250_105;
    let (mut x, mut y) = (low + PART * (high - low), high - PART * (high - low));
    let (mut at_x, mut at_y) = (function(x), function(y));
    for _ in 0..16 {
        if at_x < at_y {
            (high, y, at_y) = (y, x, at_x);
            x = low + PART * (high - low);
            at_x = function(x);
        } else {
            (low, x, at_x) = (x, y, at_y);
            y = high - PART * (high - low);
            at_y = function(y);
        }
    }
    0.5 * (low + high)
}

/// Smooths points, of which there are at least [`LEAST_POINTS`]; `sd` are the standard deviations of their
/// coordinates, if known, and `coordinates` the number of those that were measured, 2 in a plane. `None` if two
/// points in three do not differ.
pub fn smooth(points: &[DVec3], sd: Option<&[f64]>, coordinates: usize) -> Option<SmoothedCurve> {
    let at = chord_fractions(points);
    let length = points
        .windows(2)
        .map(|pair| pair[0].distance(pair[1]))
        .sum();
    smooth_at(points, &at, sd, length, coordinates, true)
}

/// The same for points with given parameters, in units of `length`; with `across` the noise along the curve, which the
/// parameters take up, does not count.
pub fn smooth_at(
    points: &[DVec3],
    at: &[f64],
    sd: Option<&[f64]>,
    length: f64,
    coordinates: usize,
    across: bool,
) -> Option<SmoothedCurve> {
    let count = points.len();
    let intervals = (count - DEGREE).clamp(1, MOST_INTERVALS);
    let size = intervals + DEGREE;
    let bases: Vec<LocalBasis> = at.iter().map(|&t| local_basis(intervals, t)).collect();
    let weights: Vec<f64> = match sd {
        Some(sd) => sd.iter().map(|sd| (length / sd).powi(2)).collect(),
        None => vec![1.0; count],
    };
    let mut normal = DMatrix::<f64>::zeros(size, size);
    let mut right = DMatrix::<f64>::zeros(size, 3);
    let centre = points.iter().sum::<DVec3>() / count as f64;
    let scaled: Vec<DVec3> = points.iter().map(|p| (*p - centre) / length).collect();
    for ((basis, weight), point) in bases.iter().zip(&weights).zip(&scaled) {
        let values = basis.derivatives[0];
        for i in 0..LOCAL {
            for j in 0..LOCAL {
                normal[(basis.first + i, basis.first + j)] += weight * values[i] * values[j];
            }
            for axis in 0..3 {
                right[(basis.first + i, axis)] += weight * values[i] * point[axis];
            }
        }
    }
    let penalty = penalty(intervals);
    // Where points leave gaps, a trace of the penalty keeps the data term definite.
    let trace = normal.trace() / penalty.trace();
    let definite = &normal + &penalty * (1e-9 * trace);
    let factor = Cholesky::new(definite)?;
    let lower = factor.l();
    let inner = lower.solve_lower_triangular(&penalty)?;
    let both = lower.solve_lower_triangular(&inner.transpose())?;
    let eigen = SymmetricEigen::new((&both + both.transpose()) * 0.5);
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let mut penalties = vec![0.0; size];
    for &k in &order[UNPENALIZED..] {
        penalties[k] = eigen.eigenvalues[k].max(f64::MIN_POSITIVE);
    }
    let rotated = eigen.eigenvectors.transpose() * lower.solve_lower_triangular(&right)?;
    let projections: Vec<f64> = (0..size).map(|k| rotated.row(k).norm_squared()).collect();
    let squares: f64 = weights
        .iter()
        .zip(&scaled)
        .map(|(w, p)| w * p.length_squared())
        .sum();
    let noisy = coordinates as f64;
    let freedom = noisy * (count - UNPENALIZED) as f64;
    let likelihood = RestrictedLikelihood {
        beside: (squares - projections.iter().sum::<f64>()).max(0.0),
        penalties,
        projections,
        freedom,
        coordinates: noisy,
        variance: match sd {
            Some(_) => KnownVariance::Given(1.0),
            None => KnownVariance::AtLeast(LEAST_DEVIATION * LEAST_DEVIATION),
        },
    };
    let lambda = likelihood.most_likely();
    let solution = {
        let shrunk = |k: usize| 1.0 / (1.0 + lambda * likelihood.penalties[k]);
        let each = (0..size).map(|k| rotated.row(k) * shrunk(k));
        DMatrix::from_rows(&each.collect::<Vec<_>>())
    };
    let back = lower.transpose();
    let coefficients = back.solve_upper_triangular(&(&eigen.eigenvectors * solution))?;
    let curve = SplineCurve {
        intervals,
        coefficients: (0..size)
            .map(|j| {
                let [x, y, z] = [0, 1, 2].map(|axis| coefficients[(j, axis)]);
                centre + length * DVec3::new(x, y, z)
            })
            .collect(),
    };
    let freedoms = likelihood.penalties.iter();
    let degrees_of_freedom = freedoms
        .map(|penalty| 1.0 / (1.0 + lambda * penalty))
        .sum::<f64>();
    let variance = match sd {
        Some(_) => 1.0,
        None => {
            let left = count as f64 - degrees_of_freedom;
            let estimate = match across && left > LEAST_FREEDOM {
                // The parameters follow the points along the curve: only residuals across it show noise.
                true => {
                    let residuals = bases.iter().zip(points).map(|(basis, point)| {
                        let on = curve.point(basis);
                        let off = (*point - on.position) / length;
                        let tangent = on.first.normalize_or_zero();
                        off.length_squared() - off.dot(tangent).powi(2)
                    });
                    residuals.sum::<f64>() / ((noisy - 1.0) * left)
                }
                false => {
                    let seen = if across { noisy - 1.0 } else { noisy };
                    likelihood.quadratic(lambda) / (freedom * seen / noisy)
                }
            };
            estimate.max(LEAST_DEVIATION * LEAST_DEVIATION)
        }
    };
    let spread = {
        let scaled = (0..size).map(|k| {
            let part = 1.0 / (1.0 + lambda * likelihood.penalties[k]);
            eigen.eigenvectors.column(k) * part.sqrt()
        });
        back.solve_upper_triangular(&DMatrix::from_columns(&scaled.collect::<Vec<_>>()))?
    };
    Some(SmoothedCurve {
        curve,
        at: at.to_vec(),
        points: points.to_vec(),
        covariance: &spread * spread.transpose() * (length * length * variance),
        deviation: length * variance.sqrt(),
        is_deviation_given: sd.is_some(),
        residual_freedom: match sd {
            Some(_) => f64::INFINITY,
            None => ((noisy - 1.0).max(1.0) * (count as f64 - degrees_of_freedom)).max(1.0),
        },
        degrees_of_freedom,
        lambda,
    })
}
