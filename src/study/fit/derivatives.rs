//! Derivatives of predictions with respect to the free numbers, from the linearized equations of the
//! leaves at rest.
//!
//! Where only tips were measured and the equations are symmetric, one adjoint solution for each axis
//! gives the derivatives with respect to all numbers; otherwise the equations are solved for each
//! number.

use crate::leaf::{Leaf, LeafParameterDerivative, LinearResponse, displacement_part};
use crate::relax::{
    ContinuationFailure, GridLevel, GridPolicy, NeighbouringEquilibria, NeighbouringScenario,
    Parameter, unit_forces,
};
use crate::scenario::PhotoParameterDerivative;
use crate::study::ParameterKeys;
use crate::study::fit::columns::MeasuredQuantity;
use crate::study::fit::model::{FitModel, FitPoint, ScenarioDerivative};
use crate::study::fit::prediction::{
    CaseSolution, DatumQuantity, ParameterResponses, ScalarDatum, Vibrations,
};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Derivatives in a search have the accuracy of those of a leaf with this tolerance.
const SEARCH_DERIVATIVE_TOLERANCE: f64 = 1e-5;

impl FitModel<'_> {
    /// Computes the derivatives of a point's components with respect to the coordinates.
    pub fn differentiate_data(&self, point: &mut FitPoint) -> Result<(), ContinuationFailure> {
        let theta = point.theta.clone();
        let shared = OnceLock::new();
        let each = |(case, found): (usize, &mut CaseSolution)| {
            self.differentiate_case(case, found, &theta, &shared)
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

    /// Computes the derivatives of the components of one leaf. Leaves that differ by loads only share their derivatives.
    fn differentiate_case<'s>(
        &'s self,
        case: usize,
        found: &mut CaseSolution,
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
        let parameters = ParameterDerivatives {
            parameters: &numbers,
            scenarios: changes,
            leaves: rates,
        };
        found.gradients = found.datum_gradients(&responses, &parameters, &slopes);
        self.add_offset_derivatives(found, &slopes);
        found.responses = Some(responses);
        Ok(())
    }
}

/// The free numbers of a case, with the derivatives of its scenario and of its leaf with respect to
/// each.
struct ParameterDerivatives<'d> {
    parameters: &'d [Parameter<'d>],
    scenarios: &'d [ScenarioDerivative],
    leaves: &'d [LeafParameterDerivative<'d>],
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
        with: &ParameterDerivatives,
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let mut gradients = Vec::new();
        let photos = photo_rates(with.scenarios);
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
                        slopes[k]
                            * self.result_derivative(
                                quantity,
                                &with.parameters[k],
                                &with.leaves[k],
                                &responses.per_parameter[k],
                            )
                    };
                    let row: Vec<f64> = (0..with.parameters.len()).map(by).collect();
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
                    let rows =
                        self.vein_point_gradients(responses, &photos, rod, sigma, &point, slopes);
                    index += point.len();
                    gradients.extend(rows);
                }
            }
        }
        gradients
    }

    /// The axes along which its tip was measured, if there are no other data, and the equations of
    /// the leaf are symmetric: adjoint solutions for each axis then give the derivatives with
    /// respect to all numbers. `None` if solving for each number takes no more work.
    pub fn measured_tip_axes(&self, numbers: usize) -> Option<Vec<usize>> {
        let leaf = &self.equilibrium.levels[0].leaf;
        let symmetric = !leaf.leaf.has_placed_supports() && leaf.leaf.has_potential();
        let tip = |component: &ScalarDatum| match component.quantity {
            DatumQuantity::Result(MeasuredQuantity::Tip(axis)) => Some(axis),
            _ => None,
        };
        let mut axes: Vec<usize> = self.scalar_data.iter().map(tip).collect::<Option<_>>()?;
        axes.sort_unstable();
        axes.dedup();
        // One more is for the next step.
        (symmetric && axes.len() + 1 < numbers).then_some(axes)
    }

    /// The gradients of the components from these solutions.
    pub fn tip_gradients(
        &self,
        responses: &ParameterResponses,
        axes: &[usize],
        slopes: &[f64],
    ) -> Result<Vec<Vec<f64>>, ContinuationFailure> {
        let mut sums = [(); 3].map(|()| vec![0.0; slopes.len()]);
        for (k, level) in self.equilibrium.levels.iter().enumerate() {
            let weight = self.equilibrium.weights[k] * self.leaf_length();
            if weight == 0.0 {
                continue;
            }
            let all = unit_forces(&level.leaf, 1);
            let units: Vec<_> = axes.iter().map(|&axis| all[axis].clone()).collect();
            let rates = responses.adjoint_derivatives(k, level, &units)?;
            for (axis, rates) in axes.iter().zip(rates) {
                let sums = sums[*axis].iter_mut().zip(rates).zip(slopes);
                sums.for_each(|((sum, rate), slope)| *sum += weight * rate * slope);
            }
        }
        let row = |component: &ScalarDatum| match component.quantity {
            DatumQuantity::Result(MeasuredQuantity::Tip(axis)) => sums[axis].clone(),
            _ => Vec::new(),
        };
        Ok(self.scalar_data.iter().map(row).collect())
    }

    /// In wind the scenarios between which forces on supports are differences, as these bear the drag on their
    /// nodes too; none of leaves without wind.
    fn scenarios_of_drag(&self, number: &Parameter) -> Option<Vec<NeighbouringScenario>> {
        let windy = self.equilibrium.levels[0].leaf.leaf.in_wind();
        windy.then(|| number.neighbouring_scenarios().unwrap_or_default())
    }

    /// The derivative of a result with respect to a number of the scenario.
    pub fn result_derivative(
        &self,
        quantity: MeasuredQuantity,
        number: &Parameter,
        rate: &LeafParameterDerivative,
        responses: &[LinearResponse],
    ) -> f64 {
        match quantity {
            MeasuredQuantity::Tip(axis) => {
                let tip = |k: usize, level: &GridLevel| {
                    displacement_part(&responses[k].node_increment(
                        &level.leaf,
                        0,
                        level.leaf.segments(),
                    ))
                };
                self.equilibrium.extrapolated_value(tip)[axis] * self.leaf_length()
            }
            MeasuredQuantity::Reaction(axis) => {
                let scenarios = self.scenarios_of_drag(number);
                let force = |k: usize, level: &GridLevel| match &scenarios {
                    Some(near) => NeighbouringEquilibria::new(level, near, rate, &responses[k])
                        .reaction_force_rate(level),
                    None => level.leaf.reaction_rate(&level.state, rate, &responses[k]),
                };
                self.equilibrium.extrapolated_value(force)[axis] * self.force_unit()
            }
            MeasuredQuantity::Grip(grip, axis) => {
                let scenarios = self.scenarios_of_drag(number);
                let force = |k: usize, level: &GridLevel| match &scenarios {
                    Some(near) => NeighbouringEquilibria::new(level, near, rate, &responses[k])
                        .grip_force_rates(level)[grip],
                    None => {
                        let GridLevel { leaf, state } = level;
                        leaf.grip_force_rates(state, rate, &responses[k])[grip]
                    }
                };
                self.equilibrium.extrapolated_value(force)[axis] * self.force_unit()
            }
            MeasuredQuantity::Frequency(mode) => {
                let scenarios = number.neighbouring_scenarios().unwrap_or_default();
                let near = |k: usize| {
                    let level = &self.equilibrium.levels[k];
                    NeighbouringEquilibria::new(level, &scenarios, rate, &responses[k])
                };
                match &self.vibrations {
                    Vibrations::Modes(modes) => {
                        let of = |k: usize| near(k).eigenvalue_rate(&modes[k][mode - 1]);
                        // omega^2 = (2 pi f)^2.
                        let frequency = self.predicted_result(quantity);
                        self.extrapolate_over_grids(of) / (2.0 * TAU.powi(2) * frequency)
                    }
                    Vibrations::Motions(motions) => {
                        let of = |k: usize| {
                            let level = &self.equilibrium.levels[k];
                            near(k).root_rate(level, &motions[k][mode - 1]).im
                        };
                        self.extrapolate_over_grids(of) / TAU
                    }
                }
            }
        }
    }

    /// The derivatives of the coordinates of a point on a vein by numbers that change the leaf and its
    /// photograph; for the nearest point to an unmarked one, only the components normal to the vein.
    pub fn vein_point_gradients(
        &self,
        responses: &ParameterResponses,
        photos: &[PhotoParameterDerivative],
        rod: usize,
        sigma: f64,
        point: &[&ScalarDatum],
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let (view, stencils) = (self.photo_projection(), self.equilibrium.stencils(sigma));
        let coordinates = point.iter().map(|component| match component.quantity {
            DatumQuantity::Vein { coordinate, .. } => coordinate,
            DatumQuantity::Result(_) => 0,
        });
        let coordinates: Vec<usize> = coordinates.collect();
        let of_vein = |derivative: usize| {
            self.equilibrium.extrapolated_value(|k, level| {
                let base = level.state.base(rod);
                stencils[k][derivative].value(|i| level.state.x[base + i])
            })
        };
        let mut along = vec![0.0; coordinates.len()];
        if point.iter().any(|component| component.is_uninformative) {
            let slope = of_vein(1);
            let seen = coordinates
                .iter()
                .map(|k| view.project_displacement(*k, slope));
            along = normalize_or_zero(seen.collect());
        }
        let place = of_vein(0) * self.leaf_length();
        let change =
            |(responses, photo): (&Vec<LinearResponse>, &PhotoParameterDerivative)| -> Vec<f64> {
                let change = self.equilibrium.extrapolated_value(|k, level| {
                    stencils[k][0].value(|i| {
                        displacement_part(&responses[k].node_increment(&level.leaf, rod, i))
                    })
                }) * self.leaf_length();
                let seen = |k: &usize| {
                    view.project_displacement(*k, change) + view.photo_derivative(*k, place, photo)
                };
                let seen: Vec<f64> = coordinates.iter().map(seen).collect();
                let part: f64 = seen.iter().zip(&along).map(|(a, b)| a * b).sum();
                let both = seen.iter().zip(&along);
                both.map(|(seen, along)| seen - part * along).collect()
            };
        let changes: Vec<Vec<f64>> = responses
            .per_parameter
            .iter()
            .zip(photos)
            .map(change)
            .collect();
        let row = |place: usize| {
            let all = changes.iter().zip(slopes);
            all.map(|(change, slope)| change[place] * slope).collect()
        };
        (0..coordinates.len()).map(row).collect()
    }
}

/// A vector of length one, or zero.
fn normalize_or_zero(vector: Vec<f64>) -> Vec<f64> {
    let length = vector.iter().map(|it| it * it).sum::<f64>().sqrt();
    let by = if length > 0.0 { 1.0 / length } else { 0.0 };
    vector.into_iter().map(|it| it * by).collect()
}
