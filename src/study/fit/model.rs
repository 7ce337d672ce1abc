//! The leaves of all experiments as a function of the free numbers: relaxed from their usual starts,
//! or followed from those at other values.
//!
//! A search uses leaves that are only as accurate as its data, on a few coarse grids; the last steps
//! use all grids. [`Weighting`] makes residuals of predictions and data.

use crate::leaf::Weighted;
use crate::newton::SolverCounts;
use crate::relax::{
    ContinuationFailure, GridPolicy, LARGEST_TOLERANCE, NestedEquilibrium, Options,
};
use crate::scenario::{Scenario, longest};
use crate::study::fit::columns::{DatumDimension, FitError, MeasuredQuantity};
use crate::study::fit::data::{
    Data, DataOrigin, ExperimentCase, MeasuredValue, TracedVeinPoint, experiment_cases,
};
use crate::study::fit::free::{FitCoordinate, FreeParameterTarget};
use crate::study::fit::prediction::{CaseSolution, DatumQuantity, FrequencyAccuracy, ScalarDatum};
use crate::study::{BaseScenario, ParameterKeys};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Derivative of a scenario with respect to a number: scenarios with finite-difference weights.
pub(super) type ScenarioDerivative = Vec<Weighted<Scenario>>;

/// Largest error of a prediction during a search, in standard deviations of its datum.
pub(super) const INSIGNIFICANT_PREDICTION_ERROR: f64 = 0.05;

/// Iteration error of positions on coarse grids, in standard deviations.
const COARSE_ITERATION_ERROR: f64 = 10.0 * INSIGNIFICANT_PREDICTION_ERROR;

/// Largest number of coarse grids of a leaf.
const MOST_COARSE_GRIDS: usize = 2;

/// Largest number of steps in which leaves that are only compared come to rest: soft leaves far from
/// the data may take thousands.
pub(super) const MOST_RELAXATION_STEPS: usize = 400;

/// The largest tolerance of leaves from which a search starts.
const LARGEST_SEARCH_TOLERANCE: f64 = 1e-4;

/// How often the leaves of all experiments may be relaxed or followed in a fit, and how often they were.
pub(super) struct EvaluationBudget {
    limit: usize,
    spent: AtomicUsize,
}

impl EvaluationBudget {
    pub fn new(most: usize) -> Self {
        let spent = AtomicUsize::new(0);
        EvaluationBudget { limit: most, spent }
    }

    /// Whether it is used up. Asked where nothing is computed in parallel, so that a fit ends at the
    /// same place on any number of threads.
    pub fn is_used_up(&self) -> bool {
        self.spent.load(Ordering::Relaxed) >= self.limit
    }

    pub fn limit(&self) -> usize {
        self.limit
    }
}

/// The leaves of all experiments as a function of the free numbers.
#[derive(Clone)]
pub(super) struct FitModel<'a> {
    pub base: &'a BaseScenario,
    pub coordinates: &'a [FitCoordinate],
    pub options: Options,
    pub cases: Arc<Vec<ExperimentCase>>,
    /// The grids on which leaves are followed.
    pub grids: GridPolicy,
    /// Whether scenarios are linear in the free numbers.
    pub has_linear_scenarios: bool,
    /// The derivatives of scenarios with respect to the free numbers, if common to all.
    pub scenario_derivatives: Arc<OnceLock<Option<Vec<ScenarioDerivative>>>>,
    pub budget: Arc<EvaluationBudget>,
}

pub(super) struct FitPoint {
    pub theta: Vec<f64>,
    pub case_solutions: Vec<CaseSolution>,
}

impl FitPoint {
    pub fn components(&self) -> impl Iterator<Item = &ScalarDatum> {
        self.case_solutions
            .iter()
            .flat_map(|case| &case.scalar_data)
    }

    /// Takes over the derivatives of another point.
    pub fn take_gradients(&mut self, other: &mut FitPoint) {
        for (own, other) in self
            .case_solutions
            .iter_mut()
            .zip(&mut other.case_solutions)
        {
            own.gradients = std::mem::take(&mut other.gradients);
        }
    }

    pub fn gradients(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.case_solutions.iter().flat_map(|case| &case.gradients)
    }
}

/// Tables of a scenario in whose numbers it is linear, independently of the others:
/// a length changes the coupling of its gap, and a section its stiffnesses.
const LINEAR_SCENARIO_TABLES: [&str; 4] = ["stiffness.", "coupling.", "load.", "rest."];

/// Whether the derivatives of a scenario with respect to these are constant.
fn is_scenario_linear(coordinates: &[FitCoordinate]) -> bool {
    coordinates.iter().all(|free| {
        free.number.scenario_keys().is_some_and(|keys| {
            let mut all = keys.targets().iter().filter_map(|target| target.key());
            let apart = all.all(|key| {
                LINEAR_SCENARIO_TABLES
                    .iter()
                    .any(|table| key.path().starts_with(table))
            });
            apart && keys.is_scenario_linear()
        })
    })
}

/// A model on a few coarse grids, and its leaves there.
pub(super) struct CoarseModel<'a> {
    pub model: FitModel<'a>,
    pub point: FitPoint,
}

impl<'a> FitModel<'a> {
    /// Whether the search ends here with the best that was found: the budget is used up, or the limit of the
    /// run is reached, after which no leaf comes to rest any more.
    pub fn must_end(&self) -> bool {
        self.budget.is_used_up() || self.options.limit.reached()
    }

    pub fn new(
        base: &'a BaseScenario,
        coordinates: &'a [FitCoordinate],
        options: &Options,
        data: Data,
        budget: EvaluationBudget,
    ) -> Result<Self, FitError> {
        let rods = base.scenario().rods.len();
        let cases = experiment_cases(data)?;
        for case in &cases {
            let of_a_tip = |m: &&MeasuredValue| m.quantity.dimension() == DatumDimension::Length;
            if let Some(measured) = case.measured_values().find(of_a_tip)
                && rods > 1
                && !base.scenario().joined
            {
                let why = format!(
                    "{} of free tips: there are {rods} of them: give the tips as points on \
                     veins (rod, sigma = 1, x, y, z)",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let mut traced = case.traced_points();
            if let Some(traced) = traced.find(|traced| traced.is_in_photo())
                && base.scenario().photo.is_none()
            {
                let why = format!(
                    "{}: pixels of a photograph: say in the scenario how it shows the leaf, by [photo] with \
                     scale, x and y",
                    traced.origin
                );
                return Err(FitError::Data(why));
            }
            let of_a_holder =
                |m: &&MeasuredValue| matches!(m.quantity, MeasuredQuantity::Reaction(_));
            if let Some(measured) = case.measured_values().find(of_a_holder)
                && base.scenario().held_tip.is_none()
            {
                let why = format!(
                    "{} is what the holder of a tip feels, and the scenario's tip is free: add \
                     [tip] with held = \"pinned\" or \"clamped\"",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let grips = base.scenario().grips.len();
            let of_no_grip = |m: &&MeasuredValue| matches!(m.quantity, MeasuredQuantity::Grip(grip, _) if grip >= grips);
            if let Some(measured) = case.measured_values().find(of_no_grip) {
                let why = format!(
                    "{} is what a grip feels, counted from 1, and the scenario has {grips} of \
                     [[grip]]",
                    measured.quantity
                );
                return Err(FitError::Data(why));
            }
            let both = |(keys, _): &&(ParameterKeys, f64)| {
                let mut free = coordinates
                    .iter()
                    .filter_map(|free| free.number.scenario_keys());
                free.any(|free| free.overlaps(keys))
            };
            if let Some((keys, _)) = case.settings().iter().find(both) {
                let place = case.origin_prefix();
                let why = format!("{place}{keys} is set by the experiment, and free");
                return Err(FitError::Data(why));
            }
        }
        Ok(FitModel {
            base,
            coordinates,
            options: options.clone(),
            cases: Arc::new(cases),
            grids: GridPolicy::AsNeeded,
            has_linear_scenarios: is_scenario_linear(coordinates)
                && !base.scenario().needs_stress_free_leaf(),
            scenario_derivatives: Arc::default(),
            budget: Arc::new(budget),
        })
    }

    /// The numbers of the scenario in an experiment: its settings with their offsets, and then the free
    /// ones.
    pub(super) fn scenario_values<'s>(
        &'s self,
        case: &'s ExperimentCase,
        theta: &[f64],
    ) -> Vec<(&'s ParameterKeys, f64)> {
        let free = || self.coordinates.iter().zip(theta);
        let settings = case.settings().iter().map(|(keys, value)| {
            let offsets = free().filter(|(free, _)| free.number.is_offset_of(keys));
            let offset: f64 = offsets
                .map(|(free, theta)| free.inverse_transform(*theta))
                .sum();
            (keys, value + offset)
        });
        let entries = free().filter_map(|(free, theta)| {
            Some((free.number.scenario_keys()?, free.inverse_transform(*theta)))
        });
        settings.chain(entries).collect()
    }

    /// Where the number that a coordinate changes stands among [`FitModel::scenario_values`]; none if it changes
    /// nothing in this experiment's leaf.
    pub(super) fn scenario_value_index(&self, case: &ExperimentCase, k: usize) -> Option<usize> {
        match &self.coordinates[k].number {
            FreeParameterTarget::Entry(_) => {
                let before = self.coordinates[..k].iter();
                let before = before.filter(|free| free.number.scenario_keys().is_some());
                Some(case.settings().len() + before.count())
            }
            offset @ FreeParameterTarget::Offset(_) => {
                let mut settings = case.settings().iter();
                settings.position(|(keys, _)| offset.is_offset_of(keys))
            }
        }
    }

    /// Predictions of a leaf at rest for the data of an experiment, less the offsets of their columns, on its grids and,
    /// as needed, on finer ones.
    pub(super) fn solved_case(
        &self,
        case: usize,
        theta: &[f64],
        at: NestedEquilibrium,
        grids: GridPolicy,
    ) -> Result<CaseSolution, ContinuationFailure> {
        let accuracy = match grids {
            GridPolicy::These => FrequencyAccuracy::OnTheseGrids,
            GridPolicy::AsNeeded => FrequencyAccuracy::Within {
                tolerance: self.equilibrium_tolerance(),
                limit: &self.options.limit,
            },
        };
        let mut found = CaseSolution::new(&self.cases[case], at, accuracy)?;
        for (free, theta) in self.coordinates.iter().zip(theta) {
            let offset = free.inverse_transform(*theta);
            let own = found
                .scalar_data
                .iter_mut()
                .filter(|it| it.has_offset(free));
            own.for_each(|component| component.model -= offset);
        }
        Ok(found)
    }

    pub(super) fn case_scenario(
        &self,
        case: &ExperimentCase,
        theta: &[f64],
    ) -> Result<Arc<Scenario>, FitError> {
        match self
            .base
            .scenario_with_values(&self.scenario_values(case, theta))
        {
            Ok(varied) => Ok(Arc::new(varied.scenario)),
            Err(refused) => Err(FitError::Data(format!("{}{refused}", case.origin_prefix()))),
        }
    }

    /// The leaves at rest, relaxed from their usual starts.
    pub fn relax_leaves(&self, theta: &[f64]) -> Result<FitPoint, FitError> {
        let find = |case: usize| -> Result<CaseSolution, FitError> {
            let scenario = self.case_scenario(&self.cases[case], theta)?;
            let found = NestedEquilibrium::relax_to_stable(&scenario, &self.options)?;
            let found = found.and_then(|at| self.solved_case(case, theta, at, self.grids));
            found.map_err(|lost| self.no_equilibrium_error(theta, case, &lost))
        };
        self.assemble_point(theta, find)
    }

    /// The leaves relaxed from their usual starts, each in no more than so many steps.
    pub fn relax_leaves_within_steps(
        &self,
        theta: &[f64],
        most_steps: usize,
    ) -> Result<FitPoint, FitError> {
        let find = |case: usize| -> Result<CaseSolution, FitError> {
            let scenario = self.case_scenario(&self.cases[case], theta)?;
            let found = NestedEquilibrium::find_within(&scenario, &self.options, most_steps)?;
            let found = found.and_then(|at| self.solved_case(case, theta, at, self.grids));
            found.map_err(|lost| self.no_equilibrium_error(theta, case, &lost))
        };
        self.assemble_point(theta, find)
    }

    /// The point at which `of` finds the leaf of each case.
    pub(super) fn assemble_point<E: Send>(
        &self,
        theta: &[f64],
        of: impl Fn(usize) -> Result<CaseSolution, E> + Sync + Send,
    ) -> Result<FitPoint, E> {
        self.budget.spent.fetch_add(1, Ordering::Relaxed);
        let cases = (0..self.cases.len()).into_par_iter().map(of);
        Ok(FitPoint {
            theta: theta.to_vec(),
            case_solutions: cases.collect::<Result<_, _>>()?,
        })
    }

    pub(super) fn no_equilibrium_error(
        &self,
        theta: &[f64],
        case: usize,
        lost: &ContinuationFailure,
    ) -> FitError {
        let case = &self.cases[case];
        let (place, name) = (case.origin_prefix(), case.name());
        let why = match lost {
            ContinuationFailure::NotAtRest(why) => why.as_str(),
            ContinuationFailure::OtherEquilibrium => "it jumps to another equilibrium",
        };
        let mut both = self.coordinates.iter().zip(theta);
        let numbers = match both.all(|(free, theta)| free.initial == *theta) {
            true => "the numbers of the scenario".into(),
            false => self.values_in_words(theta),
        };
        FitError::NoEquilibrium(format!(
            "{place}experiment {name}: with {numbers} there is no stable equilibrium ({why}): \
             start from other numbers, or leave this experiment out"
        ))
    }

    /// The number that each coordinate stands for.
    pub fn named_values(&self, theta: &[f64]) -> Vec<(String, f64)> {
        let both = self.coordinates.iter().zip(theta);
        both.map(|(free, theta)| (free.number.to_string(), free.inverse_transform(*theta)))
            .collect()
    }

    /// The numbers and their values in words, for messages.
    pub fn values_in_words(&self, theta: &[f64]) -> String {
        let numbers = self.named_values(theta);
        let each = numbers
            .iter()
            .map(|(key, value)| format!("{key} = {}", round_to_three_digits(*value)));
        each.collect::<Vec<_>>().join(", ")
    }

    /// The leaves at other values, followed from those of a point with derivatives.
    pub fn continue_leaves(
        &self,
        from: &FitPoint,
        theta: &[f64],
    ) -> Result<FitPoint, ContinuationFailure> {
        self.continue_leaves_on_grids(from, theta, self.grids)
    }

    /// The leaves at other values, followed on these grids.
    pub fn continue_leaves_on_grids(
        &self,
        from: &FitPoint,
        theta: &[f64],
        grids: GridPolicy,
    ) -> Result<FitPoint, ContinuationFailure> {
        let steps = self.value_increments(&from.theta, theta);
        let follow = |case: usize| -> Result<CaseSolution, ContinuationFailure> {
            let scenario = self.case_scenario(&self.cases[case], theta);
            let scenario =
                scenario.map_err(|refused| ContinuationFailure::NotAtRest(refused.to_string()))?;
            let from = &from.case_solutions[case];
            let answer = from.response_to_steps(&from.equilibrium.levels, &steps)?;
            let at =
                from.equilibrium
                    .continue_to_scenario(scenario, &answer, &self.options, grids)?;
            self.solved_case(case, theta, at, grids)
        };
        self.assemble_point(theta, follow)
    }

    /// Unit of the data: the length of the leaf, or the largest of them.
    pub fn data_length_unit(&self) -> f64 {
        let mut measured = self.cases.iter().flat_map(ExperimentCase::measured_values);
        let mut traced = self.cases.iter().flat_map(ExperimentCase::traced_points);
        let lengths =
            |measured: &MeasuredValue| measured.quantity.dimension() == DatumDimension::Length;
        let in_photo = traced.clone().any(TracedVeinPoint::is_in_photo);
        match traced.next().is_some() || measured.clone().all(lengths) {
            true if in_photo => self.base.scenario().scale().length / self.initial_pixel_length(),
            true => self.base.scenario().scale().length,
            false => {
                let sizes = measured.by_ref().filter_map(|measured| measured.value);
                let size = sizes.fold(0.0_f64, |most, value| most.max(value.abs()));
                size.max(f64::MIN_POSITIVE)
            }
        }
    }

    /// The length of a pixel of its photograph before the fit, if there is one.
    pub fn initial_pixel_length(&self) -> f64 {
        let photo = self.base.scenario().photo.as_ref();
        photo.map_or(1.0, |photo| photo.scale)
    }

    /// Values of the coordinates after `step` times a change, within their bounds.
    pub fn bounded_update(&self, from: &[f64], step: f64, change: &DVector<f64>) -> Vec<f64> {
        let coordinates = self.coordinates.iter().zip(from).zip(change.iter());
        let moved = coordinates.map(|((free, from), change)| {
            let [low, high] = free.bounds;
            (from + step * change).clamp(low, high)
        });
        moved.collect()
    }

    pub fn value_increments(&self, from: &[f64], to: &[f64]) -> Vec<f64> {
        let each = self.coordinates.iter().zip(to).zip(from);
        each.map(|((free, to), from)| free.inverse_transform(*to) - free.inverse_transform(*from))
            .collect()
    }

    /// The same model with leaves only as accurate as the resolution of its data, all of which are
    /// lengths.
    pub fn with_loose_tolerance(&self, assumed: f64) -> FitModel<'a> {
        let length = self.base.scenario().scale().length;
        let sd = |sd: Option<f64>| sd.unwrap_or(assumed) / length;
        let mut tolerance = f64::INFINITY;
        for case in self.cases.iter() {
            for measured in case.measured_values() {
                let known = match measured.quantity.dimension() {
                    DatumDimension::Length => INSIGNIFICANT_PREDICTION_ERROR * sd(measured.sd),
                    _ => 0.0,
                };
                tolerance = known.min(tolerance);
            }
            let traced = case.traced_points().map(|traced| {
                let unit = if traced.is_in_photo() {
                    self.initial_pixel_length()
                } else {
                    1.0
                };
                INSIGNIFICANT_PREDICTION_ERROR * unit * sd(traced.sd)
            });
            tolerance = traced.fold(tolerance, f64::min);
        }
        FitModel {
            options: Options {
                tolerance: Some(
                    tolerance
                        .min(LARGEST_SEARCH_TOLERANCE)
                        .max(self.equilibrium_tolerance()),
                ),
                ..self.options.clone()
            },
            ..self.clone()
        }
    }

    /// The same model on a few coarse grids, and its leaves there, started from those of
    /// this one.
    pub fn coarse_model(
        &self,
        accurate: &FitPoint,
        weighting: Weighting,
    ) -> Result<CoarseModel<'a>, FitError> {
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
                let found = self
                    .solved_case(case, &accurate.theta, at, GridPolicy::These)
                    .map_err(lost)?;
                let mut both = found.scalar_data.iter().zip(&known.scalar_data);
                if both.all(|(a, b)| {
                    (a.model - b.model).abs() < INSIGNIFICANT_PREDICTION_ERROR * sd(b)
                }) {
                    return Ok(found);
                }
            }
            let all = known.equilibrium.without_estimates();
            self.solved_case(case, &accurate.theta, all, GridPolicy::These)
                .map_err(lost)
        };
        let point = self.assemble_point(&accurate.theta, coarse)?;
        Ok(CoarseModel { model, point })
    }

    pub fn equilibrium_tolerance(&self) -> f64 {
        let scenario = self.base.scenario();
        self.options.tolerance.unwrap_or(scenario.tolerance)
    }

    /// Checks that the standard deviations are known for all data, or for none, then of one kind.
    pub fn check_deviations(&self, point: &FitPoint) -> Result<bool, FitError> {
        let known = |component: &&ScalarDatum| component.sd.is_some();
        let count = point.components().filter(known).count();
        if count == point.components().count() {
            return Ok(true);
        }
        let without = point.components().find(|component| !known(component));
        if count > 0 {
            let place = without.and_then(|c| c.origin.as_ref());
            let place = place.map(DataOrigin::to_string).unwrap_or_default();
            return Err(FitError::Data(format!(
                "{place}: has no standard deviation, and others have: give all or none"
            )));
        }
        let mut kinds = point
            .components()
            .map(|component| component.quantity.dimension());
        let first = kinds.next();
        if kinds.any(|kind| Some(kind) != first) {
            return Err(FitError::Data(
                "lengths, forces and frequencies can only be weighed against each other by their \
                 standard deviations: add columns sd_frequency_1, sd_tip_x, ... (sd of points on veins)"
                    .into(),
            ));
        }
        Ok(false)
    }

    /// Checks that double precision can weigh all data.
    pub fn check_weights(&self, point: &FitPoint) -> Result<(), FitError> {
        let all = point.case_solutions.iter();
        let all = all.flat_map(|case| case.scalar_data.iter().map(move |datum| (case, datum)));
        for (case, datum) in all {
            let (value, column) = (datum.observed, datum.quantity.column());
            let kind = datum.quantity.dimension();
            let size = match kind {
                // A vein is extended to any point that was traced.
                DatumDimension::Length | DatumDimension::Pixel => case.data_unit(kind),
                _ => case.data_unit(kind).max(datum.model.abs()),
            };
            let why = match datum.sd {
                _ if value.abs() * f64::EPSILON > size => format!(
                    "{column} = {value:e}: next to such a number the whole leaf is lost in \
                     rounding: check its unit, or leave the row out"
                ),
                Some(sd) if sd < f64::EPSILON * size.max(value.abs()) => format!(
                    "{} = {sd:e}: is less than the rounding of {column} as computed: give the \
                     standard deviation of the measurement",
                    datum.quantity.deviation_column()
                ),
                _ => continue,
            };
            let place = datum.origin.as_ref().map(DataOrigin::to_string);
            let place = place.map_or_else(String::new, |place| format!("{place}: "));
            return Err(FitError::Data(format!("{place}{why}")));
        }
        Ok(())
    }

    pub fn solver_work(point: &FitPoint) -> SolverCounts {
        let works = point
            .case_solutions
            .iter()
            .map(|case| case.equilibrium.work);
        works.fold(SolverCounts::default(), |sum, work| sum + work)
    }

    /// The root mean square of the residuals, of coordinates in lengths of the leaf, of other data
    /// relative to the largest of their kind.
    pub fn relative_misfit(&self, point: &FitPoint) -> f64 {
        let longest = longest(&self.base.scenario().rods);
        let pixel = self.initial_pixel_length();
        let largest = |kind: DatumDimension| {
            let alike = point
                .components()
                .filter(move |c| c.quantity.dimension() == kind);
            alike.fold(0.0_f64, |most, c| most.max(c.observed.abs()))
        };
        let (force, frequency) = (
            largest(DatumDimension::Force),
            largest(DatumDimension::Frequency),
        );
        let (mut squares, mut count) = (0.0, 0.0_f64);
        for component in point.components() {
            let size = match component.quantity {
                DatumQuantity::Vein { .. }
                    if component.quantity.dimension() == DatumDimension::Pixel =>
                {
                    longest / pixel
                }
                DatumQuantity::Vein { .. } | DatumQuantity::Result(MeasuredQuantity::Tip(_)) => {
                    longest
                }
                DatumQuantity::Result(
                    MeasuredQuantity::Reaction(_) | MeasuredQuantity::Grip(..),
                ) => force,
                DatumQuantity::Result(MeasuredQuantity::Frequency(_)) => frequency,
            };
            let part = (component.model - component.observed) / size.max(f64::MIN_POSITIVE);
            squares += part.powi(2);
            count += 1.0;
        }
        (squares / count.max(1.0)).sqrt()
    }
}

/// Tuning constant of Huber's weights: 95 % efficient for normal errors.
const HUBER_TUNING_CONSTANT: f64 = 1.345;

/// The standard deviation assumed if none is known, in lengths of the
/// leaf, until it is estimated from the residuals.
pub(super) const ASSUMED_DEVIATION_PER_LENGTH: f64 = 1e-3;

#[derive(Clone, Copy, Debug)]
pub(super) struct Weighting {
    /// Replaces unknown standard deviations.
    pub assumed_deviation: f64,
    /// Whether large residuals have smaller weights.
    pub is_robust: bool,
}

pub(super) struct WeightedDerivatives {
    /// Square roots of the weights of residuals.
    pub roots: DVector<f64>,
    /// Derivatives of the residuals times these, a row for each datum.
    pub jacobian: DMatrix<f64>,
}

impl Weighting {
    /// Residuals divided by their standard deviations.
    pub fn residuals(&self, point: &FitPoint) -> DVector<f64> {
        let components = point.components();
        let residual =
            components.map(|c| (c.model - c.observed) / c.sd.unwrap_or(self.assumed_deviation));
        DVector::from_vec(residual.collect())
    }

    /// Derivatives of the residuals, a row for each datum; zero if they are not known.
    pub fn jacobian(&self, point: &FitPoint) -> DMatrix<f64> {
        let components = point.components();
        let sd: Vec<f64> = components
            .map(|c| c.sd.unwrap_or(self.assumed_deviation))
            .collect();
        let rows = point.case_solutions.iter().flat_map(|case| {
            let components = 0..case.scalar_data.len();
            components.map(|i| case.gradients.get(i))
        });
        let rows: Vec<Option<&Vec<f64>>> = rows.collect();
        let gradient = |i: usize, k: usize| rows[i].map_or(0.0, |row| row[k]);
        DMatrix::from_fn(sd.len(), point.theta.len(), |i, k| gradient(i, k) / sd[i])
    }

    /// The weights of these residuals, and the derivatives times their roots.
    pub fn weighted_derivatives(
        &self,
        point: &FitPoint,
        residuals: &DVector<f64>,
    ) -> WeightedDerivatives {
        let (roots, mut jacobian) = (self.weight_roots(residuals), self.jacobian(point));
        for (mut row, root) in jacobian.row_iter_mut().zip(roots.iter()) {
            row *= *root;
        }
        WeightedDerivatives { roots, jacobian }
    }

    /// Square roots of the weights of residuals: less than one beyond Huber's
    /// bound, in units of the spread of all.
    pub fn weight_roots(&self, residuals: &DVector<f64>) -> DVector<f64> {
        if !self.is_robust {
            return DVector::from_element(residuals.len(), 1.0);
        }
        let bound = HUBER_TUNING_CONSTANT * median_deviation(residuals);
        residuals.map(|r| match r.abs() > bound {
            true => (bound / r.abs()).sqrt(),
            false => 1.0,
        })
    }

    /// The sum of their squares, linear beyond Huber's bound.
    pub fn huber_sum(&self, residuals: &DVector<f64>, bound: f64) -> f64 {
        let term = |r: &f64| match self.is_robust && r.abs() > bound {
            true => bound * (2.0 * r.abs() - bound),
            false => r * r,
        };
        residuals.iter().map(term).sum()
    }

    pub fn huber_bound(&self, residuals: &DVector<f64>) -> f64 {
        HUBER_TUNING_CONSTANT * median_deviation(residuals)
    }

    /// The sum of squares at a point.
    pub fn sum_of_squares(&self, point: &FitPoint) -> f64 {
        let residuals = self.residuals(point);
        self.huber_sum(&residuals, self.huber_bound(&residuals))
    }
}

/// The standard deviation of normal variables, from the median of their magnitudes.
fn median_deviation(residuals: &DVector<f64>) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    (1.4826 * median).max(1e-12)
}

/// Three significant digits.
pub(super) fn round_to_three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}
