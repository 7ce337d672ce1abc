//! Least squares: Gauss's and Newton's method within a region of trust and within
//! bounds, along equilibria that are followed and never jumped between.
//!
//! Whether a point is a minimum is asked of the longest step that is ever taken, not of
//! the one within the present region: that may be short for another direction's sake,
//! and then gains little from a point that is none along what the data feel weakly.

use nalgebra::{DMatrix, DVector};

use super::directions::{NULL, singular};
use super::free::LONGEST_STEP;
use super::model::{Model, Point};
use crate::relax::{Grids, Lost};

/// Steps tried before a minimum is given up.
const MOST_STEPS: usize = 100;

/// The longest step at first, in logarithms or units, and the least that is tried.
const FIRST_STEP: f64 = 0.7;
const LEAST_STEP: f64 = 1e-12;

/// A step this small ends the iteration; and a point from which the longest step is
/// expected to gain no more than this part of one datum's variance.
const STEP: f64 = 1e-9;
const GAIN: f64 = 1e-7;

/// Gains below this part of it may be the finite accuracy of the equilibria: two in
/// succession end the iteration, and so does a loss.
const ACCURACY: f64 = 1e-2;

/// A minimum is none where the longest step was expected to gain more than this part.
const WORTHWHILE: f64 = 0.1;

/// Bisections to the damping that shortens a step.
const BISECTIONS: usize = 40;

/// The least variance that is reckoned with, of residuals in units of the assumed
/// deviation: equilibria are not known better.
const LEAST_VARIANCE: f64 = 1e-6;

/// Tukey's constant of Huber's weights: 95 % efficient for normal errors.
const HUBER: f64 = 1.345;

/// The standard deviation that is assumed where none is known, in lengths of the
/// leaf, until the residuals tell it.
pub(super) const ASSUMED: f64 = 1e-3;

/// As [`NULL`] while the search goes on with less accurate derivatives.
const NULL_OF_SEARCH: f64 = 3e-7;

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
    /// What the longest step may be expected to gain at the end, of a datum's variance.
    pub enough: f64,
    /// Whether the derivatives of the last point but one will do for the last, if that is a
    /// minimum by them.
    pub lean: bool,
    /// Where a leaf would have had to jump, as near as that was tried.
    pub jump: Option<Vec<f64>>,
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
            enough: GAIN,
            lean: false,
            jump: None,
            progress,
        }
    }

    /// From a point to the minimum near it, which is differentiated.
    pub fn run(&mut self, mut point: Point) -> (Point, End, usize) {
        if let Err(lost) = self.model.differentiate(&mut point) {
            return (point, End::Stuck(Some(lost)), 0);
        }
        let mut radius = FIRST_STEP;
        let mut evaluations = 0;
        let mut small = 0;
        for step in 0..self.most_steps {
            let residuals = self.weighing.residuals(&point);
            let bound = self.weighing.bound(&residuals);
            let sum = self.weighing.sum(&residuals, bound);
            (self.progress)(step, sum);
            let linear = self.linear(&point, &residuals);
            let variance = linear.variance(&point, sum);
            let longest = self.clamped(&point.theta, &linear.step(LONGEST_STEP));
            let open = linear.gain(&change(&point.theta, &longest));
            if open < self.enough * variance {
                return (point, End::Converged, evaluations);
            }
            let nearly = open < ACCURACY * variance;
            let mut lost = None;
            loop {
                let theta = self.clamped(&point.theta, &linear.step(radius));
                let change = change(&point.theta, &theta);
                let (size, predicted) = (change.norm(), linear.gain(&change));
                let end = |lost: Option<Lost>| match open > WORTHWHILE * variance {
                    true => End::Stuck(lost),
                    false => End::Converged,
                };
                if size < STEP || predicted < GAIN * variance || radius < LEAST_STEP {
                    return (point, end(lost), evaluations);
                }
                evaluations += 1;
                match self.model.follow(&point, &theta) {
                    Ok(mut trial) => {
                        let found = self.weighing.residuals(&trial);
                        let gained = sum - self.weighing.sum(&found, bound);
                        if self.lean && gained > 0.0 && self.rests(&point, &theta, &found) {
                            trial.take_gradients(&mut point);
                            return (trial, End::Converged, evaluations);
                        }
                        if gained > 0.0 && self.model.differentiate(&mut trial).is_ok() {
                            let ratio = gained / predicted;
                            if ratio < 0.25 {
                                radius = 0.5 * size;
                            } else if ratio > 0.75 {
                                radius = radius.max(2.0 * size).min(LONGEST_STEP);
                            }
                            point = trial;
                            small = if nearly { small + 1 } else { 0 };
                            if small == 2 {
                                return (point, End::Converged, evaluations);
                            }
                            break;
                        }
                        if nearly {
                            return (point, End::Converged, evaluations);
                        }
                        lost = None;
                    }
                    Err(why) => {
                        if why == Lost::Elsewhere {
                            self.jump = Some(theta);
                        }
                        lost = Some(why);
                    }
                }
                radius = 0.25 * size;
            }
        }
        (point, End::MostSteps, evaluations)
    }

    /// The residuals as they change with the coordinates that may move.
    fn linear(&self, point: &Point, residuals: &DVector<f64>) -> Linear {
        let roots = self.weighing.roots(residuals);
        let mut jacobian = self.weighing.jacobian(point);
        for (mut row, root) in jacobian.row_iter_mut().zip(roots.iter()) {
            row *= *root;
        }
        let gradient = jacobian.tr_mul(&residuals.component_mul(&roots));
        let active = self.active(point, &gradient);
        for k in (0..active.len()).filter(|&k| !active[k]) {
            jacobian.column_mut(k).fill(0.0);
        }
        let (values, directions) = singular(&jacobian);
        let slopes = directions.tr_mul(&gradient);
        let null = match self.model.grids {
            Grids::AsNeeded => NULL,
            Grids::These => NULL_OF_SEARCH,
        };
        let least = null * values.last().copied().unwrap_or(0.0);
        Linear {
            unfelt: values.iter().filter(|value| **value <= least).count(),
            slopes,
            values,
            directions,
        }
    }

    /// Whether residuals at `theta` are at their least by the derivatives at a point, as
    /// far as these matter.
    fn rests(&self, point: &Point, theta: &[f64], residuals: &DVector<f64>) -> bool {
        let bound = self.weighing.bound(residuals);
        let linear = self.linear(point, residuals);
        let variance = linear.variance(point, self.weighing.sum(residuals, bound));
        let longest = self.clamped(theta, &linear.step(LONGEST_STEP));
        linear.gain(&change(theta, &longest)) < self.enough * variance
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

fn change(from: &[f64], to: &[f64]) -> DVector<f64> {
    DVector::from_iterator(to.len(), to.iter().zip(from).map(|(to, from)| to - from))
}

/// Weighed residuals, linear in the coordinates, along their singular directions.
struct Linear {
    /// Singular values, ascending, and their directions as columns.
    values: Vec<f64>,
    directions: DMatrix<f64>,
    /// Derivatives of half the sum of squares along these.
    slopes: DVector<f64>,
    /// Directions that no datum feels: the first so many. Nothing moves along them.
    unfelt: usize,
}

impl Linear {
    /// The variance of a datum, in units of its assumed one.
    fn variance(&self, point: &Point, sum: f64) -> f64 {
        let felt = self.values.len() - self.unfelt;
        let mut count = 0_usize;
        let mut known = true;
        for component in point.components() {
            count += usize::from(!component.free);
            known &= component.sd.is_some();
        }
        match known {
            true => 1.0,
            false => (sum / count.saturating_sub(felt).max(1) as f64).max(LEAST_VARIANCE),
        }
    }

    /// The step within a radius to where the sum of squares is least.
    fn step(&self, radius: f64) -> DVector<f64> {
        let along = |damping: f64| {
            let part = |k: usize, slope: f64| match k < self.unfelt {
                true => 0.0,
                false => -slope / (self.values[k].powi(2) + damping),
            };
            let parts = self.slopes.iter().enumerate();
            DVector::from_iterator(self.slopes.len(), parts.map(|(k, slope)| part(k, *slope)))
        };
        let mut parts = along(0.0);
        if parts.norm() > radius {
            // The length falls with the damping.
            let (mut low, mut high) = (0.0, self.slopes.norm() / radius);
            for _ in 0..BISECTIONS {
                let middle = match low > 0.0 {
                    true => f64::sqrt(low * high),
                    false => 1e-4 * high,
                };
                match along(middle).norm() > radius {
                    true => low = middle,
                    false => high = middle,
                }
            }
            parts = along(high);
        }
        &self.directions * parts
    }

    /// What a step is expected to take off the sum of squares.
    fn gain(&self, step: &DVector<f64>) -> f64 {
        let parts = self.directions.tr_mul(step);
        let terms = parts.iter().enumerate();
        terms
            .map(|(k, part)| -part * (2.0 * self.slopes[k] + self.values[k].powi(2) * part))
            .sum()
    }
}
