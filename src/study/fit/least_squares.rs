//! Least squares: the Gauss-Newton method with a trust region and bounds, along equilibria that are
//! followed continuously, without jumps.
//!
//! Convergence is tested with the longest admissible step, not with the one within the present
//! trust region: that may be small because of another direction, and then gains little even if
//! the point is not a minimum in a weakly determined direction.

use crate::relax::{ContinuationFailure, GridPolicy};
use crate::study::fit::free::LONGEST_COORDINATE_STEP;
use crate::study::fit::model::{FitModel, FitPoint, WeightedDerivatives, Weighting};
use crate::study::fit::statistics::{
    NULL_SINGULAR_VALUE, SingularDirections, singular_value_decomposition,
};
use nalgebra::{DMatrix, DVector};

/// Steps of a Gauss-Newton iteration, and where it ends. Lengths of steps are in logarithms or
/// units of the free numbers, gains are reductions of the sum of squares in variances of one datum.
struct GaussNewtonLimits {
    /// Largest number of steps.
    most_steps: usize,
    /// The initial radius of the trust region.
    initial_radius: f64,
    /// A smaller trust region ends the iteration.
    least_radius: f64,
    /// A shorter step ends the iteration.
    shortest_step: f64,
    /// A point ends the iteration from which the longest step is expected to gain no more.
    converged_gain: f64,
    /// Smaller gains may be errors of the equilibria: two in succession end the iteration, and so
    /// does a loss.
    uncertain_gain: f64,
    /// The end is no minimum if the longest step was expected to gain more.
    open_gain: f64,
    /// The part of the way to the sum of another minimum that the longest step must be expected to
    /// lead.
    hopeless_part: f64,
    /// The part of the way back to a known minimum that the longest step may lead.
    returning_part: f64,
    /// Bisections for the damping that shortens a step to the trust region.
    damping_bisections: usize,
    /// Least variance of residuals in units of the assumed one: equilibria are not more accurate.
    least_variance: f64,
}

const GAUSS_NEWTON: GaussNewtonLimits = GaussNewtonLimits {
    most_steps: 100,
    initial_radius: 0.7,
    least_radius: 1e-12,
    shortest_step: 1e-9,
    converged_gain: 1e-7,
    uncertain_gain: 1e-2,
    open_gain: 0.1,
    hopeless_part: 0.5,
    returning_part: 0.5,
    damping_bisections: 40,
    least_variance: 1e-6,
};

/// As [`NULL_SINGULAR_VALUE`], for the less accurate derivatives of the search.
const NULL_SINGULAR_VALUE_SEARCH: f64 = 3e-7;

/// How an iteration ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum GaussNewtonOutcome {
    Converged,
    StepLimit,
    /// The budget of evaluations is used up, or the limit of the run is reached.
    BudgetExhausted,
    /// No further step succeeds; with the reason of the last failure.
    Stuck(Option<ContinuationFailure>),
}

/// A known minimum, besides which another one is searched.
pub(super) struct KnownMinimum<'t> {
    pub theta: &'t [f64],
    /// The largest sum of another minimum that fits as well.
    pub largest_sum: f64,
    /// The distance at which the search begins.
    pub distance: f64,
}

impl KnownMinimum<'_> {
    /// Whether a step hardly leads to such a minimum: the sum that is expected after it is too large
    /// still, or it leads back to the known minimum.
    fn is_step_hopeless(&self, expected: f64, sum: f64, theta: &[f64]) -> bool {
        let returns = coordinate_change(self.theta, theta).norm()
            < GAUSS_NEWTON.returning_part * self.distance;
        returns
            || expected - self.largest_sum
                > (1.0 - GAUSS_NEWTON.hopeless_part) * (sum - self.largest_sum).max(0.0)
    }
}

/// Where an iteration ended.
pub(super) struct GaussNewtonResult {
    pub point: FitPoint,
    pub outcome: GaussNewtonOutcome,
    /// How often the leaves were followed.
    pub evaluations: usize,
}

pub(super) struct GaussNewtonIteration<'m, 'a> {
    pub model: &'m FitModel<'a>,
    pub weighting: Weighting,
    pub held: Vec<bool>,
    pub most_steps: usize,
    /// Gain that the longest step may still promise at the end, as a part of a datum's variance.
    pub gain_tolerance: f64,
    /// Whether the derivatives of the previous point may be used for the last one, if that is a
    /// minimum by them.
    pub reuses_derivatives: bool,
    /// A minimum besides which another one is searched that fits as well.
    pub excluded_minimum: Option<KnownMinimum<'m>>,
    /// The values tried from the last point at which a leaf would have had to jump, the farthest first.
    pub jumps: Vec<Vec<f64>>,
    /// Called with the number of the step and the sum.
    pub progress: &'m mut dyn FnMut(usize, f64),
}

impl<'m, 'a> GaussNewtonIteration<'m, 'a> {
    pub fn new(
        model: &'m FitModel<'a>,
        weighting: Weighting,
        progress: &'m mut dyn FnMut(usize, f64),
    ) -> Self {
        GaussNewtonIteration {
            model,
            weighting,
            held: vec![false; model.coordinates.len()],
            most_steps: GAUSS_NEWTON.most_steps,
            gain_tolerance: GAUSS_NEWTON.converged_gain,
            reuses_derivatives: false,
            excluded_minimum: None,
            jumps: Vec::new(),
            progress,
        }
    }

    /// From a point to a minimum near it, with derivatives.
    pub fn run(&mut self, mut point: FitPoint) -> GaussNewtonResult {
        let mut evaluations = 0;
        let outcome = self.iterate(&mut point, &mut evaluations);
        GaussNewtonResult {
            point,
            outcome,
            evaluations,
        }
    }

    fn iterate(&mut self, point: &mut FitPoint, evaluations: &mut usize) -> GaussNewtonOutcome {
        if let Err(lost) = self.model.differentiate_data(point) {
            return GaussNewtonOutcome::Stuck(Some(lost));
        }
        let mut radius = GAUSS_NEWTON.initial_radius;
        let mut small = 0;
        for step in 0..self.most_steps {
            let residuals = self.weighting.residuals(point);
            let bound = self.weighting.huber_bound(&residuals);
            let sum = self.weighting.huber_sum(&residuals, bound);
            (self.progress)(step, sum);
            let linear = self.linearize_residuals(point, &residuals);
            let variance = linear.datum_variance(point, sum);
            let longest = self.bounded_update(
                &point.theta,
                &linear.trust_region_step(LONGEST_COORDINATE_STEP),
            );
            let open = linear.expected_reduction(&coordinate_change(&point.theta, &longest));
            if open < self.gain_tolerance * variance {
                return GaussNewtonOutcome::Converged;
            }
            let besides = self.excluded_minimum.as_ref();
            if besides.is_some_and(|it| it.is_step_hopeless(sum - open, sum, &longest)) {
                return GaussNewtonOutcome::Stuck(None);
            }
            self.jumps.clear();
            let nearly = open < GAUSS_NEWTON.uncertain_gain * variance;
            let mut lost = None;
            loop {
                let theta = self.bounded_update(&point.theta, &linear.trust_region_step(radius));
                let change = coordinate_change(&point.theta, &theta);
                let (size, predicted) = (change.norm(), linear.expected_reduction(&change));
                let end = |lost: Option<ContinuationFailure>| match open
                    > GAUSS_NEWTON.open_gain * variance
                {
                    true => GaussNewtonOutcome::Stuck(lost),
                    false => GaussNewtonOutcome::Converged,
                };
                let number = size.is_finite() && predicted.is_finite();
                let worth = size >= GAUSS_NEWTON.shortest_step
                    && predicted >= GAUSS_NEWTON.converged_gain * variance
                    && radius >= GAUSS_NEWTON.least_radius;
                if !number || !worth {
                    return end(lost);
                }
                if self.model.must_end() {
                    return GaussNewtonOutcome::BudgetExhausted;
                }
                *evaluations += 1;
                match self.model.continue_leaves(point, &theta) {
                    Ok(mut trial) => {
                        let found = self.weighting.residuals(&trial);
                        let gained = sum - self.weighting.huber_sum(&found, bound);
                        if self.reuses_derivatives
                            && gained > 0.0
                            && self.is_minimum(point, &theta, &found)
                        {
                            trial.take_gradients(point);
                            *point = trial;
                            return GaussNewtonOutcome::Converged;
                        }
                        if gained > 0.0 && self.model.differentiate_data(&mut trial).is_ok() {
                            let ratio = gained / predicted;
                            if ratio < 0.25 {
                                radius = 0.5 * size;
                            } else if ratio > 0.75 {
                                radius = radius.max(2.0 * size).min(LONGEST_COORDINATE_STEP);
                            }
                            *point = trial;
                            small = if nearly { small + 1 } else { 0 };
                            if small == 2 {
                                return GaussNewtonOutcome::Converged;
                            }
                            break;
                        }
                        if nearly {
                            return GaussNewtonOutcome::Converged;
                        }
                        lost = None;
                    }
                    Err(why) => {
                        if why == ContinuationFailure::OtherEquilibrium {
                            self.jumps.push(theta);
                        }
                        lost = Some(why);
                    }
                }
                radius = 0.25 * size;
            }
        }
        GaussNewtonOutcome::StepLimit
    }

    /// The linearized residuals in the coordinates that may move.
    fn linearize_residuals(
        &self,
        point: &FitPoint,
        residuals: &DVector<f64>,
    ) -> LinearizedResiduals {
        let WeightedDerivatives {
            roots,
            mut jacobian,
        } = self.weighting.weighted_derivatives(point, residuals);
        let gradient = jacobian.tr_mul(&residuals.component_mul(&roots));
        let active = self.movable_coordinates(point, &gradient);
        for k in (0..active.len()).filter(|&k| !active[k]) {
            jacobian.column_mut(k).fill(0.0);
        }
        let SingularDirections { values, directions } = singular_value_decomposition(&jacobian);
        let slopes = directions.tr_mul(&gradient);
        let null = match self.model.grids {
            GridPolicy::AsNeeded => NULL_SINGULAR_VALUE,
            GridPolicy::These => NULL_SINGULAR_VALUE_SEARCH,
        };
        let least = null * values.last().copied().unwrap_or(0.0);
        LinearizedResiduals {
            insensitive_count: values.iter().filter(|value| **value <= least).count(),
            slopes,
            singular_values: values,
            singular_directions: directions,
        }
    }

    /// Whether residuals at `theta` are minimal by the derivatives at a point, up to what is
    /// significant.
    fn is_minimum(&self, point: &FitPoint, theta: &[f64], residuals: &DVector<f64>) -> bool {
        let bound = self.weighting.huber_bound(residuals);
        let linear = self.linearize_residuals(point, residuals);
        let variance = linear.datum_variance(point, self.weighting.huber_sum(residuals, bound));
        let longest =
            self.bounded_update(theta, &linear.trust_region_step(LONGEST_COORDINATE_STEP));
        linear.expected_reduction(&coordinate_change(theta, &longest))
            < self.gain_tolerance * variance
    }

    /// Coordinates that may move: neither held, nor pushed against a bound by the gradient.
    fn movable_coordinates(&self, point: &FitPoint, gradient: &DVector<f64>) -> Vec<bool> {
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

    fn bounded_update(&self, theta: &[f64], change: &DVector<f64>) -> Vec<f64> {
        let shorten = (LONGEST_COORDINATE_STEP / change.amax()).min(1.0);
        self.model.bounded_update(theta, shorten, change)
    }
}

fn coordinate_change(from: &[f64], to: &[f64]) -> DVector<f64> {
    DVector::from_iterator(to.len(), to.iter().zip(from).map(|(to, from)| to - from))
}

/// Weighted residuals, linearized, along their singular directions.
struct LinearizedResiduals {
    /// Singular values, ascending, and their directions as columns.
    singular_values: Vec<f64>,
    singular_directions: DMatrix<f64>,
    /// Derivatives of half the sum of squares along these.
    slopes: DVector<f64>,
    /// Number of directions, the first ones, to which the data are insensitive; they stay fixed.
    insensitive_count: usize,
}

impl LinearizedResiduals {
    /// The variance of a datum, in units of its assumed one.
    fn datum_variance(&self, point: &FitPoint, sum: f64) -> f64 {
        let sensitive = self.singular_values.len() - self.insensitive_count;
        let mut count = 0_usize;
        let mut known = true;
        for component in point.components() {
            count += usize::from(!component.is_uninformative);
            known &= component.sd.is_some();
        }
        match known {
            true => 1.0,
            false => (sum / count.saturating_sub(sensitive).max(1) as f64)
                .max(GAUSS_NEWTON.least_variance),
        }
    }

    /// The step within a radius that minimizes the sum of squares.
    fn trust_region_step(&self, radius: f64) -> DVector<f64> {
        let along = |damping: f64| {
            let part = |k: usize, slope: f64| match k < self.insensitive_count {
                true => 0.0,
                false => -slope / (self.singular_values[k].powi(2) + damping),
            };
            let parts = self.slopes.iter().enumerate();
            DVector::from_iterator(self.slopes.len(), parts.map(|(k, slope)| part(k, *slope)))
        };
        let mut parts = along(0.0);
        if parts.norm() > radius {
            // The length decreases with the damping.
            let (mut low, mut high) = (0.0, self.slopes.norm() / radius);
            for _ in 0..GAUSS_NEWTON.damping_bisections {
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
        &self.singular_directions * parts
    }

    /// The expected reduction of the sum of squares by a step.
    fn expected_reduction(&self, step: &DVector<f64>) -> f64 {
        let parts = self.singular_directions.tr_mul(step);
        let terms = parts.iter().enumerate();
        terms
            .map(|(k, part)| {
                -part * (2.0 * self.slopes[k] + self.singular_values[k].powi(2) * part)
            })
            .sum()
    }
}
