//! Predictions of a scenario's leaf for the data, and their derivatives with respect to the free
//! numbers.
//!
//! A leaf at rest under the conditions of its experiments, its predictions for the data, and
//! their derivatives.

use crate::leaf::{LeafParameterDerivative, LinearResponse, Weighted, displacement_part};
use crate::modes;
use crate::motion::Physics;
use crate::newton::SolverCounts;
use crate::relax::accuracy::transfer::weights;
use crate::relax::{
    ContinuationFailure, GridLevel, GridPolicy, NeighbouringEquilibria, NestedEquilibrium, Options,
    Parameter, unit_forces,
};
use crate::scenario::{Photo, PhotoParameterDerivative, Scenario};
use crate::study::fit::data::{
    COORDINATE_COLUMNS, Data, DataOrigin, DatumDimension, ExperimentCase, FIRST_PHOTO_COORDINATE,
    MeasuredQuantity, MeasuredValue, ObservationModel, ObservedExperiment, TracedVeinPoint,
};
use crate::study::fit::found::round_to_three_digits;
use crate::study::fit::responses::{ParameterResponses, VeinInterpolant};
use crate::study::fit::{FitCoordinate, FitError, FreeParameterTarget, OffsetColumn, data};
use crate::study::{BaseScenario, ParameterKeys};
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Derivative of a scenario with respect to a number: scenarios with finite-difference weights.
pub(super) type ScenarioDerivative = Vec<Weighted<Scenario>>;

/// Largest error of a prediction during a search, in standard deviations of its datum.
pub(super) const INSIGNIFICANT_PREDICTION_ERROR: f64 = 0.05;

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

/// Data common to all points of a fit.
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

/// The leaves of all experiments.
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

impl<'a> FitModel<'a> {
    pub fn new(
        base: &'a BaseScenario,
        coordinates: &'a [FitCoordinate],
        options: &Options,
        (data, budget): (Data, EvaluationBudget),
    ) -> Result<Self, FitError> {
        let rods = base.scenario().rods.len();
        let cases = data::experiment_cases(data)?;
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

    /// Where the number that a coordinate changes stands among [`Model::values`]; none if it changes
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

    /// Predictions of a leaf at rest for the data of an experiment, less the offsets of their columns.
    pub(super) fn solved_case(
        &self,
        case: usize,
        theta: &[f64],
        at: NestedEquilibrium,
    ) -> Result<CaseSolution, ContinuationFailure> {
        let mut found = CaseSolution::new(&self.cases[case], at)?;
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

    /// The scenario of an experiment.
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
            let found = found.and_then(|at| self.solved_case(case, theta, at));
            found.map_err(|lost| self.no_equilibrium_error(theta, case, &lost))
        };
        self.assemble_point(theta, find)
    }

    /// The same in no more than so many steps of each leaf.
    pub fn relax_leaves_within_steps(
        &self,
        theta: &[f64],
        most_steps: usize,
    ) -> Result<FitPoint, FitError> {
        let find = |case: usize| -> Result<CaseSolution, FitError> {
            let scenario = self.case_scenario(&self.cases[case], theta)?;
            let found = NestedEquilibrium::find_within(&scenario, &self.options, most_steps)?;
            let found = found.and_then(|at| self.solved_case(case, theta, at));
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

    /// These in words.
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

    /// The same on these grids.
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
            let how = (&self.options, grids);
            let answer = from.response_to_steps(&from.equilibrium.levels, &steps)?;
            let at = from
                .equilibrium
                .continue_to_scenario(scenario, &answer, how)?;
            self.solved_case(case, theta, at)
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
}

/// Largest number of unknowns of a grid on which modes are computed, except the first.
const MOST_UNKNOWNS_FOR_MODES: usize = 4_000;

/// One scalar datum.
#[derive(Clone, Debug)]
pub(super) struct ScalarDatum {
    /// The number of its experiment.
    pub experiment: usize,
    pub quantity: DatumQuantity,
    pub observed: f64,
    pub model: f64,
    /// Its standard deviation, if known.
    pub sd: Option<f64>,
    /// Whether it does not count as a datum: the distance of a point from a curve contains no
    /// information on the position along it.
    pub is_uninformative: bool,
    pub origin: Option<DataOrigin>,
}

impl ScalarDatum {
    /// Whether a coordinate is the offset of its column.
    pub fn has_offset(&self, free: &FitCoordinate) -> bool {
        match (&free.number, self.quantity) {
            (
                FreeParameterTarget::Offset(OffsetColumn::Result(of)),
                DatumQuantity::Result(what),
            ) => *of == what,
            _ => false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DatumQuantity {
    Result(MeasuredQuantity),
    /// One of [`COORDINATES`] of a point on a rod, at this fraction of its length.
    Vein {
        rod: usize,
        coordinate: usize,
        sigma: f64,
    },
}

impl DatumQuantity {
    pub fn dimension(self) -> DatumDimension {
        match self {
            DatumQuantity::Result(quantity) => quantity.dimension(),
            DatumQuantity::Vein { coordinate, .. } if coordinate >= FIRST_PHOTO_COORDINATE => {
                DatumDimension::Pixel
            }
            DatumQuantity::Vein { .. } => DatumDimension::Length,
        }
    }

    /// The name of its column in the data.
    pub fn column(self) -> String {
        match self {
            DatumQuantity::Result(quantity) => quantity.to_string(),
            DatumQuantity::Vein { coordinate, .. } => COORDINATE_COLUMNS[coordinate].into(),
        }
    }

    /// The name of the column of its standard deviation.
    pub fn deviation_column(self) -> String {
        match self {
            DatumQuantity::Result(quantity) => format!("sd_{quantity}"),
            DatumQuantity::Vein { .. } => "sd".into(),
        }
    }
}

/// A leaf at rest at some values of the free numbers.
pub(super) struct CaseSolution {
    pub equilibrium: NestedEquilibrium,
    /// Modes on the first grids.
    pub modes: Vec<Vec<modes::Eigenpair>>,
    pub scalar_data: Vec<ScalarDatum>,
    /// Its response to the numbers, once computed.
    pub responses: Option<ParameterResponses>,
    /// The gradients of the components; empty until computed.
    pub gradients: Vec<Vec<f64>>,
}

impl CaseSolution {
    /// Predictions of a leaf at rest for the data under these conditions.
    pub fn new(
        of: &ExperimentCase,
        at: NestedEquilibrium,
    ) -> Result<CaseSolution, ContinuationFailure> {
        let frequencies = of
            .measured_values()
            .filter_map(|measured| match measured.quantity {
                MeasuredQuantity::Frequency(mode) => Some(mode),
                _ => None,
            });
        let count = frequencies.max().unwrap_or(0);
        let mut modes = Vec::new();
        for level in at.levels.iter().filter(|_| count > 0) {
            let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
            if modes.is_empty() || unknowns < MOST_UNKNOWNS_FOR_MODES {
                let pairs = modes::unsoftened_modes(&level.leaf, &level.state, count);
                let lost =
                    || ContinuationFailure::NotAtRest("its frequencies cannot be found".into());
                let pairs = pairs
                    .filter(|pairs| pairs.len() == count)
                    .ok_or_else(lost)?;
                modes.push(pairs);
            }
        }
        let mut found = CaseSolution {
            equilibrium: at,
            modes,
            scalar_data: Vec::new(),
            responses: None,
            gradients: Vec::new(),
        };
        let mut veins = Vec::new();
        let observed = of.experiments.iter();
        let components = observed.flat_map(|of| found.experiment_data(of, &mut veins));
        found.scalar_data = components.collect();
        Ok(found)
    }

    /// The components of an experiment.
    fn experiment_data<'v>(
        &'v self,
        of: &ObservedExperiment,
        veins: &mut Vec<Option<VeinInterpolant<'v>>>,
    ) -> Vec<ScalarDatum> {
        let mut components = Vec::new();
        let view = self.photo_projection();
        for measured in &of.experiment.measured {
            components.push(ScalarDatum {
                experiment: of.number,
                quantity: DatumQuantity::Result(measured.quantity),
                observed: measured.value.unwrap_or(f64::NAN),
                model: self.predicted_result(measured.quantity),
                sd: measured.sd,
                is_uninformative: false,
                origin: of.experiment.origin.clone(),
            });
        }
        for traced in &of.traced {
            veins.resize_with(veins.len().max(traced.rod + 1), || None);
            let vein = veins[traced.rod].get_or_insert_with(|| {
                VeinInterpolant::from_equilibrium(&self.equilibrium, traced.rod)
            });
            let beside = traced.sigma.is_none();
            let (sigma, model) = match traced.sigma {
                Some(sigma) => (sigma, vein.point_and_tangent(sigma).0),
                None => vein.nearest_point(&traced.coordinates, &view),
            };
            let seen = traced.coordinates.iter().enumerate();
            let seen = seen.filter_map(|(k, value)| value.map(|value| (k, value)));
            for (number, (coordinate, observed)) in seen.enumerate() {
                components.push(ScalarDatum {
                    experiment: of.number,
                    quantity: DatumQuantity::Vein {
                        rod: traced.rod,
                        coordinate,
                        sigma,
                    },
                    observed,
                    model: view.project_point(coordinate, model),
                    sd: traced.sd,
                    is_uninformative: beside && number == 0,
                    origin: Some(traced.origin.clone()),
                });
            }
        }
        components
    }

    /// The axes along which its tip was measured, if there are no other data, and the equations of
    /// the leaf are symmetric: adjoint solutions for each axis then give the derivatives with
    /// respect to all numbers. `None` if solving for each number takes no more work.
    pub fn measured_tip_axes(&self, numbers: usize) -> Option<Vec<usize>> {
        let leaf = &self.equilibrium.levels[0].leaf;
        let symmetric = !leaf.leaf.has_placed_supports() && !leaf.has_moments();
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
            let rates = responses.adjoint_derivatives((k, level), &units)?;
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

    /// Its response to steps of the numbers on these grids, each of which must be one of its
    /// own; empty if there are no steps.
    pub fn response_to_steps(
        &self,
        levels: &[GridLevel],
        steps: &[f64],
    ) -> Result<Vec<LinearResponse>, ContinuationFailure> {
        let none = |level: &GridLevel| LinearResponse::zeros(&level.leaf);
        match &self.responses {
            Some(responses) if steps.iter().any(|step| *step != 0.0) => {
                responses.response_to_steps(levels, steps)
            }
            _ => Ok(levels.iter().map(none).collect()),
        }
    }

    /// How points on its veins are seen.
    pub fn photo_projection(&self) -> ObservationModel<'_> {
        ObservationModel::new(self.photograph())
    }

    fn photograph(&self) -> Option<&Photo> {
        let leaf = &self.equilibrium.levels[0].leaf.leaf;
        leaf.scenario().photo.as_ref()
    }

    fn leaf_length(&self) -> f64 {
        self.equilibrium.levels[0].leaf.leaf.scale.length
    }

    fn force_unit(&self) -> f64 {
        self.equilibrium.levels[0].leaf.leaf.scale.force()
    }

    /// The unit of such data in which numbers of the leaf are about one.
    pub fn data_unit(&self, kind: DatumDimension) -> f64 {
        match kind {
            DatumDimension::Length => self.leaf_length(),
            DatumDimension::Pixel => {
                self.leaf_length() / self.photograph().map_or(1.0, |photo| photo.scale)
            }
            DatumDimension::Force => self.force_unit(),
            DatumDimension::Frequency => {
                let physics = Physics::new(&self.equilibrium.levels[0].leaf.leaf);
                1.0 / (std::f64::consts::TAU * physics.time_unit)
            }
        }
    }

    pub fn predicted_result(&self, quantity: MeasuredQuantity) -> f64 {
        match quantity {
            MeasuredQuantity::Tip(axis) => {
                let tip = self
                    .equilibrium
                    .extrapolated_value(|_, level| level.state.tip(0));
                tip[axis] * self.leaf_length()
            }
            MeasuredQuantity::Reaction(axis) => {
                let force = self
                    .equilibrium
                    .extrapolated_value(|_, level| level.leaf.reaction(&level.state).force);
                force[axis] * self.force_unit()
            }
            MeasuredQuantity::Grip(grip, axis) => {
                let force =
                    |_, level: &GridLevel| level.leaf.grip_reactions(&level.state)[grip].force;
                self.equilibrium.extrapolated_value(force)[axis] * self.force_unit()
            }
            MeasuredQuantity::Frequency(mode) => {
                self.extrapolated_eigenvalue(mode).max(0.0).sqrt()
                    * self.data_unit(DatumDimension::Frequency)
            }
        }
    }

    /// An eigenvalue, extrapolated over the grids with modes.
    fn extrapolated_eigenvalue(&self, mode: usize) -> f64 {
        self.extrapolate_over_grids(|level| self.modes[level][mode - 1].eigenvalue)
    }

    fn extrapolate_over_grids(&self, value: impl Fn(usize) -> f64) -> f64 {
        let segments = self
            .equilibrium
            .levels
            .iter()
            .map(|level| level.leaf.segments());
        let segments: Vec<usize> = segments.take(self.modes.len()).collect();
        let weights = weights(&segments, f64::INFINITY);
        weights
            .iter()
            .enumerate()
            .map(|(k, weight)| weight * value(k))
            .sum()
    }

    /// The derivative of a result with respect to a number of the scenario.
    pub fn result_derivative(
        &self,
        quantity: MeasuredQuantity,
        (number, rate, responses): (&Parameter, &LeafParameterDerivative, &[LinearResponse]),
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
                let force =
                    |k: usize, level: &GridLevel| level.leaf.reaction_rate(rate, &responses[k]);
                self.equilibrium.extrapolated_value(force)[axis] * self.force_unit()
            }
            MeasuredQuantity::Grip(grip, axis) => {
                let force = |k: usize, level: &GridLevel| {
                    let GridLevel { leaf, state } = level;
                    leaf.grip_force_rates(state, rate, &responses[k])[grip]
                };
                self.equilibrium.extrapolated_value(force)[axis] * self.force_unit()
            }
            MeasuredQuantity::Frequency(mode) => {
                let scenarios = number.neighbouring_scenarios().unwrap_or_default();
                let of = |k: usize| {
                    let near = NeighbouringEquilibria::new(
                        &self.equilibrium.levels[k],
                        &scenarios,
                        (rate, &responses[k]),
                    );
                    near.eigenvalue_rate(&self.modes[k][mode - 1])
                };
                // omega^2 = (2 pi f)^2.
                let frequency = self.predicted_result(quantity);
                self.extrapolate_over_grids(of) / (2.0 * std::f64::consts::TAU.powi(2) * frequency)
            }
        }
    }

    /// The derivatives of the coordinates of a point on a vein by numbers that change the leaf and its
    /// photograph; for the nearest point to an unmarked one, only the components normal to the vein.
    pub fn vein_point_gradients(
        &self,
        (responses, photos): (&ParameterResponses, &[PhotoParameterDerivative]),
        (rod, sigma): (usize, f64),
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
