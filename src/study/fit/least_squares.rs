//! Least squares: Levenberg's and Marquardt's method, within bounds, along
//! equilibria that are followed and never jumped between.

use nalgebra::{DMatrix, DVector};

use super::free::LONGEST_STEP;
use super::model::{Model, Point};
use crate::relax::Lost;

/// Steps tried before a minimum is given up.
const MOST_STEPS: usize = 100;

/// Damping at first, relative to the largest diagonal entry, and its least.
const DAMPING: f64 = 1e-4;
const LEAST_DAMPING: f64 = 1e-13;
const LARGEST_DAMPING: f64 = 1e12;

/// A step this small, in logarithms or units, ends the iteration; and one that is
/// expected to gain no more than this part of one datum's variance.
const STEP: f64 = 1e-9;
const GAIN: f64 = 1e-7;

/// Gains below this part of it may be the finite accuracy of the equilibria: two in
/// succession end the iteration, and so does a loss.
const ACCURACY: f64 = 1e-3;

/// A minimum is none where a step was expected to gain more than this part of it.
const WORTHWHILE: f64 = 0.1;

/// The least variance that is reckoned with, of residuals in units of the assumed
/// deviation: equilibria are not known better.
const LEAST_VARIANCE: f64 = 1e-6;

/// Tukey's constant of Huber's weights: 95 % efficient for normal errors.
const HUBER: f64 = 1.345;

/// The standard deviation that is assumed where none is known, in lengths of the
/// leaf, until the residuals tell it.
pub(super) const ASSUMED: f64 = 1e-3;

/// How residuals are weighed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weighing {
    /// In place of standard deviations that are not known.
    pub assumed: f64,
    /// Whether large residuals count less.
    pub robust: bool,
}

impl Weighing {
    /// Residuals over their standard deviations.
    pub fn residuals(&self, point: &Point) -> DVector<f64> {
        let components = point.components();
        let residual = components.map(|c| (c.model - c.observed) / c.sd.unwrap_or(self.assumed));
        DVector::from_vec(residual.collect())
    }

    /// Their derivatives.
    pub fn jacobian(&self, point: &Point) -> DMatrix<f64> {
        let sd: Vec<f64> = point
            .components()
            .map(|c| c.sd.unwrap_or(self.assumed))
            .collect();
        let rows: Vec<&Vec<f64>> = point.gradients().collect();
        DMatrix::from_fn(rows.len(), point.theta.len(), |i, k| rows[i][k] / sd[i])
    }

    /// Roots of the weights of residuals: less than one for those beyond Huber's
    /// bound, in units of the spread of all.
    pub fn roots(&self, residuals: &DVector<f64>) -> DVector<f64> {
        if !self.robust {
            return DVector::from_element(residuals.len(), 1.0);
        }
        let bound = HUBER * spread(residuals);
        residuals.map(|r| match r.abs() > bound {
            true => (bound / r.abs()).sqrt(),
            false => 1.0,
        })
    }

    /// Their sum: of squares, beyond Huber's bound linear.
    pub fn sum(&self, residuals: &DVector<f64>, bound: f64) -> f64 {
        let term = |r: &f64| match self.robust && r.abs() > bound {
            true => bound * (2.0 * r.abs() - bound),
            false => r * r,
        };
        residuals.iter().map(term).sum()
    }

    pub fn bound(&self, residuals: &DVector<f64>) -> f64 {
        HUBER * spread(residuals)
    }
}

/// The standard deviation of normal numbers, by the median of their sizes.
fn spread(residuals: &DVector<f64>) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    (1.4826 * median).max(1e-12)
}

/// How an iteration ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum End {
    Converged,
    MostSteps,
    /// No step leads on; why the last did not.
    Stuck(Option<Lost>),
}

/// An iteration to the least sum of squares.
pub(super) struct Iteration<'m, 'a> {
    pub model: &'m Model<'a>,
    pub weighing: Weighing,
    /// Coordinates that are held.
    pub held: Vec<bool>,
    pub most_steps: usize,
    /// Told the number of the step and the sum.
    pub progress: &'m mut dyn FnMut(usize, f64),
}

impl<'m, 'a> Iteration<'m, 'a> {
    pub fn new(
        model: &'m Model<'a>,
        weighing: Weighing,
        progress: &'m mut dyn FnMut(usize, f64),
    ) -> Self {
        Iteration {
            model,
            weighing,
            held: vec![false; model.coordinates.len()],
            most_steps: MOST_STEPS,
            progress,
        }
    }

    /// From a point to the minimum near it, which is differentiated.
    pub fn run(&mut self, mut point: Point) -> (Point, End, usize) {
        if let Err(lost) = self.model.differentiate(&mut point) {
            return (point, End::Stuck(Some(lost)), 0);
        }
        let mut damping = DAMPING;
        let mut growth = 2.0;
        let mut evaluations = 0;
        let mut small = 0;
        for step in 0..self.most_steps {
            let residuals = self.weighing.residuals(&point);
            let bound = self.weighing.bound(&residuals);
            let sum = self.weighing.sum(&residuals, bound);
            (self.progress)(step, sum);
            let roots = self.weighing.roots(&residuals);
            let mut jacobian = self.weighing.jacobian(&point);
            for (mut row, root) in jacobian.row_iter_mut().zip(roots.iter()) {
                row *= *root;
            }
            let weighed = residuals.component_mul(&roots);
            let gradient = jacobian.transpose() * &weighed;
            let active = self.active(&point, &gradient);
            let normal = jacobian.transpose() * &jacobian;
            let largest = (0..active.len())
                .filter(|&k| active[k])
                .fold(0.0_f64, |m, k| m.max(normal[(k, k)]));
            if largest == 0.0 {
                return (point, End::Converged, evaluations);
            }
            let known = point.components().all(|component| component.sd.is_some());
            let variance = match known {
                true => 1.0,
                false => (sum / residuals.len() as f64).max(LEAST_VARIANCE),
            };
            let mut lost = None;
            let mut expected = None;
            loop {
                let change = damped(&normal, &gradient, &active, damping * largest);
                let theta = self.clamped(&point.theta, &change);
                let change: DVector<f64> =
                    DVector::from_vec(theta.clone()) - DVector::from_vec(point.theta.clone());
                let size = change.amax();
                let predicted =
                    -(2.0 * gradient.dot(&change) + (jacobian.clone() * &change).norm_squared());
                // What was expected of the first of these steps, and did not come.
                let worthwhile = *expected.get_or_insert(predicted) > WORTHWHILE * variance;
                let end = |lost: Option<Lost>| match worthwhile || lost.is_some() {
                    true => End::Stuck(lost),
                    false => End::Converged,
                };
                if size < STEP || predicted < GAIN * variance {
                    return (point, end(lost), evaluations);
                }
                evaluations += 1;
                match self.model.follow(&point, &theta) {
                    Ok(mut trial) => {
                        let found = self.weighing.residuals(&trial);
                        let gained = sum - self.weighing.sum(&found, bound);
                        if gained > 0.0 && self.model.differentiate(&mut trial).is_ok() {
                            let ratio = gained / predicted;
                            damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).max(0.1);
                            damping = damping.max(LEAST_DAMPING);
                            growth = 2.0;
                            point = trial;
                            let little = gained.max(predicted) < ACCURACY * variance;
                            small = if little { small + 1 } else { 0 };
                            if small == 2 {
                                return (point, End::Converged, evaluations);
                            }
                            break;
                        }
                        if gained.abs().max(predicted) < ACCURACY * variance {
                            return (point, end(None), evaluations);
                        }
                        lost = None;
                    }
                    Err(why) => lost = Some(why),
                }
                damping *= growth;
                growth *= 2.0;
                if damping > LARGEST_DAMPING {
                    return (point, End::Stuck(lost), evaluations);
                }
            }
        }
        (point, End::MostSteps, evaluations)
    }

    /// Coordinates that may move: not held, nor at a bound that the gradient drives
    /// them against.
    fn active(&self, point: &Point, gradient: &DVector<f64>) -> Vec<bool> {
        let coordinates = self.model.coordinates.iter().enumerate();
        coordinates
            .map(|(k, free)| {
                let [low, high] = free.bounds;
                let theta = point.theta[k];
                let against =
                    theta <= low && gradient[k] > 0.0 || theta >= high && gradient[k] < 0.0;
                !self.held[k] && !against
            })
            .collect()
    }

    fn clamped(&self, theta: &[f64], change: &DVector<f64>) -> Vec<f64> {
        let shorten = (LONGEST_STEP / change.amax()).min(1.0);
        (self.model.coordinates.iter().zip(theta).zip(change.iter()))
            .map(|((free, theta), change)| {
                (theta + shorten * change).clamp(free.bounds[0], free.bounds[1])
            })
            .collect()
    }
}

/// The step of the damped normal equations in the active coordinates. Damping is
/// the same along all, so that nothing moves along combinations that no datum feels.
fn damped(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    active: &[bool],
    damping: f64,
) -> DVector<f64> {
    let mut matrix = normal.clone();
    let mut right = -gradient;
    for k in 0..active.len() {
        matrix[(k, k)] += damping;
        if !active[k] {
            right[k] = 0.0;
            for other in 0..active.len() {
                matrix[(k, other)] = 0.0;
                matrix[(other, k)] = 0.0;
            }
            matrix[(k, k)] = 1.0;
        }
    }
    match matrix.cholesky() {
        Some(factor) => factor.solve(&right),
        None => DVector::zeros(active.len()),
    }
}
