//! Response of a leaf at rest to changes of the free numbers.
//!
//! The derivatives of the components of a point.
//!
//! A vein as a curve, for the nearest point to a traced one.
//!
//! A model with the accuracy of a search: on the coarsest grids whose error is insignificant
//! relative to the data.

use crate::leaf::{Leaf, LeafParameterDerivative, LinearResponse, ParameterForces};
use crate::relax::{
    ContinuationFailure, GridLevel, GridPolicy, LARGEST_TOLERANCE, Linearized, NestedEquilibrium,
    Options, Parameter, Stencil,
};
use crate::scenario::PhotoParameterDerivative;
use crate::study::ParameterKeys;
use crate::study::fit::FitError;
use crate::study::fit::data::{
    DatumDimension, MeasuredQuantity, ObservationModel, ObservedCoordinates,
};
use crate::study::fit::least_squares::Weighting;
use crate::study::fit::model::{
    CaseSolution, DatumQuantity, FitModel, FitPoint, INSIGNIFICANT_PREDICTION_ERROR, ScalarDatum,
    ScenarioDerivative,
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Relative accuracy of the predicted state from which a leaf is relaxed.
const PREDICTED_STATE_ACCURACY: f64 = 1e-3;

/// The linearised equations of a leaf at rest on every grid, and the force rates of the free
/// numbers.
pub(super) struct ParameterResponses {
    linearized: Mutex<Vec<Linearized>>,
    /// Force rates of each number on every grid.
    force_rates: Vec<Vec<ParameterForces>>,
    /// Response to each number on every grid; empty if the adjoint equations are solved for the
    /// data, since these are fewer.
    pub per_parameter: Vec<Vec<LinearResponse>>,
}

fn singular_matrix_failure() -> ContinuationFailure {
    ContinuationFailure::NotAtRest("the leaf is at a singular point".into())
}

impl ParameterResponses {
    /// The linearised equations at a leaf at rest.
    pub fn new(
        at: &NestedEquilibrium,
        rates: &[LeafParameterDerivative],
        tolerance: f64,
    ) -> ParameterResponses {
        let linear = at.levels.iter();
        let linear: Vec<_> = linear
            .map(|level| Linearized::new(level, tolerance))
            .collect();
        let forces = linear.iter().zip(&at.levels);
        ParameterResponses {
            force_rates: forces
                .map(|(linear, level)| linear.forces(level, rates))
                .collect(),
            linearized: Mutex::new(linear),
            per_parameter: Vec::new(),
        }
    }

    /// Solves them for each number.
    pub fn solve_for_parameters(
        &mut self,
        levels: &[GridLevel],
    ) -> Result<(), ContinuationFailure> {
        let count = self.force_rates.first().map_or(0, Vec::len);
        let mut all = vec![Vec::new(); count];
        let linear = self
            .linearized
            .get_mut()
            .unwrap_or_else(PoisonError::into_inner);
        for ((level, linear), forces) in levels.iter().zip(linear).zip(&self.force_rates) {
            let responses = linear
                .responses(level, forces)
                .ok_or_else(singular_matrix_failure)?;
            for (all, answer) in all.iter_mut().zip(responses) {
                all.push(answer);
            }
        }
        self.per_parameter = all;
        Ok(())
    }

    /// Derivatives of results on one grid with respect to each number, if the results are adjoint
    /// to unit forces on the leaf: by one solution per result.
    pub fn adjoint_derivatives(
        &self,
        (k, level): (usize, &GridLevel),
        units: &[ParameterForces],
    ) -> Result<Vec<Vec<f64>>, ContinuationFailure> {
        let mut all = self
            .linearized
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let linear = &mut all[k];
        let responses = linear
            .responses(level, units)
            .ok_or_else(singular_matrix_failure)?;
        let rates = |answer| {
            let forces = self.force_rates[k].iter();
            forces
                .map(|force| linear.work(level, force, answer))
                .collect()
        };
        Ok(responses.iter().map(rates).collect())
    }

    /// The response on each of these grids to steps of the numbers.
    pub fn response_to_steps(
        &self,
        levels: &[GridLevel],
        steps: &[f64],
    ) -> Result<Vec<LinearResponse>, ContinuationFailure> {
        let on = |(k, level): (usize, &GridLevel)| {
            if !self.per_parameter.is_empty() {
                let mut sum = LinearResponse::zeros(&level.leaf);
                for (responses, step) in self.per_parameter.iter().zip(steps) {
                    sum.add(*step, &responses[k]);
                }
                return Ok(sum);
            }
            let mut sum = ParameterForces::zeros(level.leaf.rods());
            for (forces, step) in self.force_rates[k].iter().zip(steps) {
                sum.add(*step, forces);
            }
            let mut all = self
                .linearized
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let answer = all[k].responses_to(level, &[sum], PREDICTED_STATE_ACCURACY);
            let answer = answer.ok_or_else(singular_matrix_failure)?;
            answer
                .into_iter()
                .next()
                .ok_or_else(singular_matrix_failure)
        };
        levels.iter().enumerate().map(on).collect()
    }
}

/// Derivatives in a search have the accuracy of those of a leaf with this tolerance.
const SEARCH_DERIVATIVE_TOLERANCE: f64 = 1e-5;

impl FitModel<'_> {
    /// Computes the derivatives of a point's components with respect to the coordinates.
    pub fn differentiate_data(&self, point: &mut FitPoint) -> Result<(), ContinuationFailure> {
        let theta = point.theta.clone();
        let shared = OnceLock::new();
        let each = |(case, at): (usize, &mut CaseSolution)| {
            self.differentiate_case((case, at), &theta, &shared)
        };
        let cases = point.case_solutions.par_iter_mut().enumerate();
        cases.map(each).collect()
    }

    /// A number that changes nothing in a leaf.
    fn parameter_without_effect<'v>(
        &'v self,
        values: &'v [(&'v ParameterKeys, f64)],
    ) -> Parameter<'v> {
        Parameter {
            make: Box::new(move |_| Some(self.base.scenario_with_values(values).ok()?.scenario)),
            value: 0.0,
            unit: 1.0,
            linear: true,
        }
    }

    /// Adds the derivatives of predictions with respect to the offsets of their columns.
    fn add_offset_derivatives(&self, found: &mut CaseSolution, slopes: &[f64]) {
        let rows = found.gradients.iter_mut().zip(&found.scalar_data);
        for (row, component) in rows {
            for (k, free) in self.coordinates.iter().enumerate() {
                if component.has_offset(free) {
                    row[k] -= slopes[k];
                }
            }
        }
    }

    /// The same for one leaf. Leaves that differ by loads only share their derivatives.
    fn differentiate_case<'s>(
        &'s self,
        (case, found): (usize, &mut CaseSolution),
        theta: &[f64],
        shared: &OnceLock<Vec<LeafParameterDerivative<'s>>>,
    ) -> Result<(), ContinuationFailure> {
        if found.responses.is_some() {
            return Ok(());
        }
        let of = &self.cases[case];
        let values = self.scenario_values(of, theta);
        let numbers: Vec<Parameter> = (self.coordinates.iter().enumerate())
            .map(|(k, free)| match self.scenario_value_index(of, k) {
                Some(place) => self.base.parameter(&values, place, free.unit),
                None => self.parameter_without_effect(&values),
            })
            .collect();
        let changes =
            || -> Option<Vec<ScenarioDerivative>> { numbers.iter().map(Parameter::rate).collect() };
        let at_limit =
            || ContinuationFailure::NotAtRest("a number is at the limit of what it can be".into());
        let leaf = &found.equilibrium.levels[0].leaf.leaf;
        let own: Vec<ScenarioDerivative>;
        let own_rates: Vec<LeafParameterDerivative>;
        let (changes, rates): (&[ScenarioDerivative], &[LeafParameterDerivative]) =
            if self.has_linear_scenarios && of.differs_by_loads_only {
                let changes = self.scenario_derivatives.get_or_init(changes).as_ref();
                let changes = changes.ok_or_else(at_limit)?;
                (changes, shared.get_or_init(|| leaf_rates(leaf, changes)))
            } else {
                own = changes().ok_or_else(at_limit)?;
                own_rates = leaf_rates(leaf, &own);
                (&own, &own_rates)
            };
        let tolerance = match self.grids {
            GridPolicy::AsNeeded => self
                .base
                .scenario()
                .tolerance
                .min(self.equilibrium_tolerance()),
            GridPolicy::These => SEARCH_DERIVATIVE_TOLERANCE,
        };
        let mut responses = ParameterResponses::new(&found.equilibrium, rates, tolerance);
        let slopes = self.coordinates.iter().zip(theta);
        let slopes: Vec<f64> = slopes
            .map(|(free, theta)| free.value_derivative(*theta))
            .collect();
        if let Some(axes) = found.measured_tip_axes(numbers.len()) {
            found.gradients = found.tip_gradients(&responses, &axes, &slopes)?;
            self.add_offset_derivatives(found, &slopes);
            found.responses = Some(responses);
            return Ok(());
        }
        responses.solve_for_parameters(&found.equilibrium.levels)?;
        found.gradients = found.datum_gradients(&responses, (&numbers, changes, rates), &slopes);
        self.add_offset_derivatives(found, &slopes);
        found.responses = Some(responses);
        Ok(())
    }
}

fn leaf_rates<'c>(
    leaf: &Leaf,
    changes: &'c [ScenarioDerivative],
) -> Vec<LeafParameterDerivative<'c>> {
    let rates = changes
        .iter()
        .map(|change| LeafParameterDerivative::new(leaf, change));
    rates.collect()
}

/// How a photograph changes with each number.
fn photo_rates(changes: &[ScenarioDerivative]) -> Vec<PhotoParameterDerivative> {
    let rate = |change: &ScenarioDerivative| {
        let photos = change.iter();
        let photos = photos.filter_map(|it| Some((it.weight, it.term.photo.as_ref()?)));
        PhotoParameterDerivative::from_terms(photos)
    };
    changes.iter().map(rate).collect()
}

impl CaseSolution {
    /// Derivatives of its components with respect to the coordinates, whose `slopes` are given.
    fn datum_gradients(
        &self,
        responses: &ParameterResponses,
        (numbers, changes, rates): (
            &[Parameter],
            &[ScenarioDerivative],
            &[LeafParameterDerivative],
        ),
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut gradients = Vec::new();
        let photos = photo_rates(changes);
        // Measured more than once, a result has the same derivatives.
        let mut known: Vec<(MeasuredQuantity, Vec<f64>)> = Vec::new();
        let mut index = 0;
        while index < self.scalar_data.len() {
            let component = &self.scalar_data[index];
            match component.quantity {
                DatumQuantity::Result(quantity) => {
                    index += 1;
                    if let Some((_, row)) = known.iter().find(|(it, _)| *it == quantity) {
                        gradients.push(row.clone());
                        continue;
                    }
                    let by = |k: usize| {
                        let of = (
                            &numbers[k],
                            &rates[k],
                            responses.per_parameter[k].as_slice(),
                        );
                        slopes[k] * self.result_derivative(quantity, of)
                    };
                    let row: Vec<f64> = (0..numbers.len()).map(by).collect();
                    known.push((quantity, row.clone()));
                    gradients.push(row);
                }
                DatumQuantity::Vein { rod, sigma, .. } => {
                    // All coordinates of the point.
                    let same = |other: &&ScalarDatum| match other.quantity {
                        DatumQuantity::Vein { .. } => other.origin == component.origin,
                        DatumQuantity::Result(_) => false,
                    };
                    let point: Vec<&ScalarDatum> =
                        self.scalar_data[index..].iter().take_while(same).collect();
                    let rows = self.vein_point_gradients(
                        (responses, &photos),
                        (rod, sigma),
                        &point,
                        slopes,
                    );
                    index += point.len();
                    gradients.extend(rows);
                }
            }
        }
        gradients
    }
}

/// Iterations for the nearest point between two nodes, and its accuracy.
const NEAREST_POINT_ITERATIONS: usize = 60;

const NEAREST_POINT_ACCURACY: f64 = 1e-10;

/// A vein at the nodes of its finest grid.
pub(super) struct VeinInterpolant<'a> {
    equilibrium: &'a NestedEquilibrium,
    rod: usize,
    /// Fractions of the length, and positions in the scenario's units.
    nodes: Vec<(f64, DVec3)>,
}

impl<'a> VeinInterpolant<'a> {
    pub fn from_equilibrium(at: &'a NestedEquilibrium, rod: usize) -> Self {
        let nodes = at.levels.last().map_or(Vec::new(), |level| {
            let (base, length) = (level.state.base(rod), level.leaf.leaf.scale.length);
            let sigma = level.leaf.grid.sigma().iter().enumerate();
            sigma
                .map(|(i, sigma)| (*sigma, level.state.x[base + i] * length))
                .collect()
        });
        VeinInterpolant {
            equilibrium: at,
            rod,
            nodes,
        }
    }

    /// The point at a fraction of the length, in the scenario's units, and its derivative
    /// with respect to the fraction. The vein is extended straight beyond its ends.
    pub fn point_and_tangent(&self, sigma: f64) -> (DVec3, DVec3) {
        let length = self.equilibrium.levels[0].leaf.leaf.scale.length;
        let (mut x, mut slope) = (DVec3::ZERO, DVec3::ZERO);
        for (level, weight) in self
            .equilibrium
            .levels
            .iter()
            .zip(&self.equilibrium.weights)
        {
            if *weight != 0.0 {
                let [value, derivative] =
                    <Stencil>::value_and_derivative_stencils(&level.leaf, sigma);
                let base = level.state.base(self.rod);
                let node = |i: usize| level.state.x[base + i];
                x += *weight * value.value(node);
                slope += *weight * derivative.value(node);
            }
        }
        (x * length, slope * length)
    }

    /// The fraction of the length nearest to a point with these measured coordinates,
    /// and the point there. The vein is extended straight beyond its ends: a traced
    /// point near an end is compared across the vein like all others, so that noise along
    /// it, half of which is beyond the end, does not lengthen the vein.
    pub fn nearest_point(
        &self,
        seen: &ObservedCoordinates,
        view: &ObservationModel,
    ) -> (f64, DVec3) {
        let known = || {
            let known = seen.iter().enumerate();
            known.filter_map(|(coordinate, value)| Some((coordinate, (*value)?)))
        };
        let apart = |x: DVec3| known().map(move |(k, value)| (k, view.project_point(k, x) - value));
        let square = |node: &(f64, DVec3)| apart(node.1).map(|(_, it)| it * it).sum::<f64>();
        let order =
            |a: &usize, b: &usize| square(&self.nodes[*a]).total_cmp(&square(&self.nodes[*b]));
        let last = self.nodes.len().saturating_sub(1);
        let best = (0..=last).min_by(order).unwrap_or(0);
        let [low, high] =
            [best.saturating_sub(1), (best + 1).min(last)].map(|node| self.nodes[node].0);
        // The derivative of half the squared distance, and the point.
        let rate = |sigma: f64| {
            let (x, slope) = self.point_and_tangent(sigma);
            let (mut value, mut squared) = (0.0, 0.0);
            for (k, apart) in apart(x) {
                let slope = view.project_displacement(k, slope);
                value += slope * apart;
                squared += slope * slope;
            }
            (value, squared, x)
        };
        // Newton's method without the curvature, then the secant method; bisection where a step
        // leaves the bracket of the zero.
        let mut sigma = self.nodes[best].0;
        let (mut below, mut above) = (low, high);
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..NEAREST_POINT_ITERATIONS {
            let (value, squared, x) = rate(sigma);
            let step = match before {
                Some((other, at_other)) if (value - at_other) * (sigma - other) > 0.0 => {
                    -value * (sigma - other) / (value - at_other)
                }
                _ if squared > 0.0 => -value / squared,
                _ => 0.0,
            };
            if step.abs() < NEAREST_POINT_ACCURACY {
                return (sigma, x);
            }
            match value < 0.0 {
                true => below = sigma,
                false => above = sigma,
            }
            let next = sigma + step;
            let ends = [(0.0, below, next < low), (1.0, above, next > high)];
            let beyond = ends.iter().find(|(end, it, out)| *out && end == it);
            before = Some((sigma, value));
            sigma = match beyond {
                // On a straight extension, the first step is exact.
                Some((end, ..)) if sigma == *end => {
                    let beyond = end - value / squared;
                    return (beyond, self.point_and_tangent(beyond).0);
                }
                Some((end, ..)) => {
                    before = None;
                    *end
                }
                None if (below..=above).contains(&next) => next,
                None => 0.5 * (below + above),
            };
        }
        (sigma, self.point_and_tangent(sigma).0)
    }
}

/// Error of an iteration on them: of positions, in standard deviations.
const COARSE_ITERATION_ERROR: f64 = 10.0 * INSIGNIFICANT_PREDICTION_ERROR;

/// Largest number of grids of a leaf.
const MOST_COARSE_GRIDS: usize = 2;

/// Values, of those at which a leaf would have to jump, at which it is relaxed again.
const MOST_JUMPS_RELAXED: usize = 3;

impl<'a> FitModel<'a> {
    /// The same model on a few coarse grids, and its leaves there, started from those of
    /// this one.
    pub fn coarse_model(
        &self,
        accurate: &FitPoint,
        weighting: Weighting,
    ) -> Result<(FitModel<'a>, FitPoint), FitError> {
        let length = self.base.scenario().scale().length;
        let sd = |component: &ScalarDatum| component.sd.unwrap_or(weighting.assumed_deviation);
        let in_lengths = |component: &ScalarDatum| match component.quantity.dimension() {
            DatumDimension::Pixel => sd(component) * self.initial_pixel_length(),
            _ => sd(component),
        };
        let all = accurate.components().map(in_lengths);
        let least = all.fold(f64::INFINITY, f64::min);
        let tolerance = (COARSE_ITERATION_ERROR * least / length).min(LARGEST_TOLERANCE);
        let model = FitModel {
            options: Options {
                tolerance: Some(tolerance.max(self.equilibrium_tolerance())),
                ..self.options.clone()
            },
            grids: GridPolicy::These,
            ..self.clone()
        };
        let coarse = |case: usize| -> Result<CaseSolution, FitError> {
            let lost = |lost| self.no_equilibrium_error(&accurate.theta, case, &lost);
            let known = &accurate.case_solutions[case];
            for count in 1..=MOST_COARSE_GRIDS {
                let Some(at) = known.equilibrium.on_coarsest_grids(count) else {
                    break;
                };
                let found = self.solved_case(case, &accurate.theta, at).map_err(lost)?;
                let mut both = found.scalar_data.iter().zip(&known.scalar_data);
                if both.all(|(a, b)| {
                    (a.model - b.model).abs() < INSIGNIFICANT_PREDICTION_ERROR * sd(b)
                }) {
                    return Ok(found);
                }
            }
            self.solved_case(case, &accurate.theta, known.equilibrium.without_estimates())
                .map_err(lost)
        };
        let point = self.assemble_point(&accurate.theta, coarse)?;
        Ok((model, point))
    }

    /// The leaves relaxed from their usual starts, beyond the values at which one of
    /// `before` would have to jump; or there, if another equilibrium exists. `None`
    /// if that does not reduce the residuals.
    pub fn relax_beyond_jump(
        &self,
        jumps: &[Vec<f64>],
        before: &FitPoint,
        weighting: Weighting,
    ) -> Option<FitPoint> {
        let residuals = weighting.residuals(before);
        let bound = weighting.huber_bound(&residuals);
        let sum = weighting.huber_sum(&residuals, bound);
        // The farthest are the steps that the data ask for; close to where a leaf buckles none is followed.
        let far = jumps.iter().take(MOST_JUMPS_RELAXED);
        let near = jumps.iter().skip(MOST_JUMPS_RELAXED).next_back();
        far.chain(near).chain([&before.theta]).find_map(|theta| {
            let there = self.relax_leaves(theta).ok()?;
            let nearer = weighting.huber_sum(&weighting.residuals(&there), bound) < sum;
            nearer.then_some(there)
        })
    }
}
