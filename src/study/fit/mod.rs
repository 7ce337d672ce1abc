//! From measurements to the numbers of a scenario: least squares over experiments and
//! traced veins, and what the data determine about each number and what they do not.
//!
//! The leaves of all experiments are followed from equilibrium to equilibrium, with
//! derivatives from their linearized equations, so that a fit does not jump between
//! branches. Positive numbers are fitted by their logarithms.

mod columns;
mod data;
mod derivatives;
mod intervals;
mod lack_of_fit;
mod least_squares;
mod local_fit;
mod minima;
mod model;
mod prediction;
mod remark;
mod statistics;
mod table;

use crate::newton::SolverCounts;
use crate::relax::{Options, RelaxError, check_tolerance, without_wind};
use crate::run::{Instant, Limit};
use crate::scenario::units::LENGTH;

pub use crate::study::fit::columns::{
    ComparisonOperator, DataFileOptions, MeasuredColumn, MeasuredQuantity, RowCondition, RowFilter,
};
pub use crate::study::fit::data::{
    Data, DataFile, DataOrigin, Experiment, MeasuredValue, TracedVeinPoint,
};
use crate::study::fit::minima::{FitStart, GlobalFitSearch};
use crate::study::fit::model::{
    ASSUMED_DEVIATION_PER_LENGTH, EvaluationBudget, FitModel, Weighting,
};
pub use crate::study::fit::remark::{FitCandidateRemark, FitRemark};
use crate::study::{BaseScenario, ParameterKeys, VariableTarget, VaryError};
use crate::words;
use serde::Serialize;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// Why nothing can be fitted.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Data that cannot be used.
    #[error("{0}")]
    Data(String),
    /// A number that cannot be free.
    #[error("{0}")]
    Free(String),
    /// An experiment whose leaf does not come to rest.
    #[error("{0}")]
    NoEquilibrium(String),
    /// A scenario that is invalid.
    #[error(transparent)]
    Vary(#[from] VaryError),
    /// A relaxation that cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
}

/// A request for a fit.
#[derive(Clone, Debug)]
pub struct FitRequest {
    /// The scenario, with the initial values of its numbers.
    pub base: BaseScenario,
    /// The data.
    pub data: Data,
    /// The free numbers.
    pub free: Vec<FreeParameter>,
    /// Whether outliers have smaller weights (Huber's weights).
    pub robust: bool,
    /// Candidate experiments, to be ordered by information.
    pub candidates: Vec<Experiment>,
    /// Replaces the scenario's tolerance.
    pub tolerance: Option<f64>,
    /// Time limit.
    pub limit: Limit,
    /// How often the leaves of all experiments are relaxed or followed at most; `None`:
    /// 1000.
    pub most_evaluations: Option<usize>,
}

/// How often the leaves of all experiments are relaxed or followed in a fit, unless it is said: some
/// hundred are usual with many free numbers, and what takes more mostly has no minimum.
pub const DEFAULT_EVALUATION_LIMIT: usize = 1000;

impl FitRequest {
    /// Reads candidate experiments from a table like that of experiments, whose columns may
    /// have other names.
    ///
    /// # Errors
    /// As of [`Data::read`].
    pub fn read_candidates(
        table: impl AsRef<[u8]>,
        file: &str,
        columns: &[MeasuredColumn],
    ) -> Result<Vec<Experiment>, FitError> {
        data::read_candidate_experiments(table.as_ref(), file, columns)
    }
}

/// Fits the free numbers to the data. `progress` is called at each step.
///
/// # Errors
/// Requests that cannot be met; failures of the fit itself are part of its outcome.
pub fn fit(request: &FitRequest, progress: &mut dyn FnMut(&FitStep)) -> Result<Fit, FitError> {
    let clock = Instant::now();
    let base = &request.base;
    if let Some(tolerance) = request.tolerance {
        check_tolerance(tolerance).map_err(RelaxError::from)?;
    }
    without_wind(base.scenario(), "a fit")?;
    request.data.check_columns()?;
    request.data.check_choices()?;
    let coordinates = fit_coordinates(request)?;
    let options = Options {
        tolerance: request.tolerance,
        limit: request.limit.clone(),
        ..Options::default()
    };
    let most = request.most_evaluations.unwrap_or(DEFAULT_EVALUATION_LIMIT);
    let (data, budget) = (request.data.clone(), EvaluationBudget::new(most));
    let model = FitModel::new(base, &coordinates, &options, data, budget)?;
    let weighting = Weighting {
        assumed_deviation: ASSUMED_DEVIATION_PER_LENGTH * model.data_length_unit(),
        is_robust: request.robust,
    };
    let mut told = |seconds: f64| {
        let leaves = model.cases.len();
        progress(&FitStep {
            step: 0,
            sum: f64::INFINITY,
            known: None,
            budget: Some(FitCostLimit {
                evaluations: most,
                leaves,
                seconds: seconds * most as f64,
            }),
        });
    };
    let began = FitStart::choose_start(&model, weighting, &mut told)?;
    let known = model.check_deviations(&began.point)?;
    model.check_weights(&began.point)?;
    let measured = began
        .point
        .components()
        .filter(|component| !component.is_uninformative);
    check_data_count(coordinates.len(), measured.count(), known)?;
    let minima = GlobalFitSearch {
        model: &model,
        weighting,
        has_known_deviations: known,
        candidates: &request.candidates,
        evaluations: Cell::new(0),
    };
    let mut found = minima.best_fit(began, progress)?;
    found.files = request.data.files.clone();
    found.remarks.extend(comment_lines_remark(&found.files));
    found.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(found)
}

/// The files of which lines among the rows were left out, if there are any.
fn comment_lines_remark(files: &[DataFile]) -> Option<FitRemark> {
    let left_out = files.iter().filter(|file| file.comments_among_rows > 0);
    let left_out: Vec<DataFile> = left_out.cloned().collect();
    (!left_out.is_empty()).then_some(FitRemark::CommentLines { files: left_out })
}

/// The coordinates of the free numbers, checked to be distinct.
fn fit_coordinates(request: &FitRequest) -> Result<Vec<FitCoordinate>, FitError> {
    let base = &request.base;
    let free = expand_free_parameters(request)?;
    let coordinates = free
        .iter()
        .map(|free| FitCoordinate::new(base, &request.data, free));
    let coordinates = coordinates.collect::<Result<Vec<_>, _>>()?;
    for (k, one) in coordinates.iter().enumerate() {
        if coordinates[..k]
            .iter()
            .any(|other| other.number.overlaps(&one.number))
        {
            let number = &one.number;
            return Err(FitError::Free(format!(
                "{number}: is free twice: leave one out"
            )));
        }
    }
    Ok(coordinates)
}

fn check_data_count(free: usize, count: usize, known: bool) -> Result<(), FitError> {
    if free == 0 || free > count {
        return Err(FitError::Free(match free {
            0 => "no number is free: name at least one".into(),
            _ if count == 0 => format!(
                "there are no data: columns of results are {}, or rod, x, y, z of points on veins",
                MeasuredQuantity::ALL
            ),
            _ => format!(
                "{free} numbers are free, and there are {count} data: free fewer, or measure more"
            ),
        }));
    }
    if !known && free == count {
        return Err(FitError::Free(format!(
            "{count} numbers are free, and there are as many data, whose standard deviations are not \
             known: nothing is left to tell them: add columns sd_tip_x, ..., free fewer, or measure more"
        )));
    }
    Ok(())
}

/// The free numbers, lists and profiles replaced by their entries.
fn expand_free_parameters(request: &FitRequest) -> Result<Vec<FreeParameter>, FitError> {
    let mut all = Vec::new();
    for free in &request.free {
        let entries = match &free.number {
            FreeParameterTarget::Entry(keys) => {
                let entries = request.base.keys_by_entry(keys);
                entries
                    .into_iter()
                    .map(FreeParameterTarget::Entry)
                    .collect()
            }
            offset @ FreeParameterTarget::Offset(_) => vec![offset.clone()],
        };
        all.extend(entries.into_iter().map(|number| FreeParameter {
            number,
            bounds: free.bounds,
        }));
    }
    Ok(all)
}

words! {
    /// How a fit ended.
    pub enum FitOutcome {
        /// At a minimum, and the data determine every free number.
        Converged = "converged",
        /// Not at a minimum.
        NotConverged = "not-converged",
        /// At a minimum, but some number or combination of numbers is not determined.
        UnidentifiableCombination = "undetermined",
        /// At a minimum, but the residuals are systematic there: the model lacks something.
        Systematic = "systematic",
        /// At a minimum, but the data contradict the model there.
        Contradicted = "contradicted",
    }
}

/// A free number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitParameter {
    /// Its key.
    pub key: String,
    /// Its value at the minimum: if it is not determined, one of many.
    pub value: f64,
    /// Lower end of the 95 % interval; `None` if there is none.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Standard deviation of the value, to first order; `None` if the data are insensitive to it.
    pub standard_error: Option<f64>,
    /// Whether the data determine it within a factor of ten.
    pub determined: bool,
    /// Whether the interval is that of the profile likelihood, since the quadratic approximation at
    /// the minimum is inaccurate.
    pub profiled: bool,
    /// Values below and above beyond which the other numbers could not be fitted, so that an end
    /// there is not known.
    #[serde(skip)]
    pub lost: [Option<f64>; 2],
}

/// Residuals that are smooth along series of data, not scattered.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SystematicResiduals {
    /// The probability that independent errors are as smooth.
    pub p_value: f64,
    /// The columns whose residuals are.
    pub along: Vec<String>,
    /// By how much intervals are longer than those of independent errors.
    pub widened: f64,
}

/// An experiment with data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExperimentConditions {
    /// Its name.
    pub experiment: String,
    /// What was set, by keys.
    pub settings: BTreeMap<String, f64>,
}

/// One scalar datum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitResidual {
    /// The experiment.
    pub experiment: String,
    /// Its position in the data, from 1.
    #[serde(skip)]
    pub number: usize,
    /// `tip_x`, `frequency_1`, ..., or `x`, `y`, `z` of a point on a vein.
    pub what: String,
    /// The rod, counted from 1, and the fraction of its length, of a point on a vein.
    pub rod: Option<usize>,
    /// See `rod`.
    pub sigma: Option<f64>,
    /// The datum.
    pub data: f64,
    /// The prediction of the model.
    pub model: f64,
    /// Half the width of the model's 95 % band, due to the uncertainty of the determined
    /// combinations.
    pub band: f64,
    /// Standard deviation of the datum: as given, or as estimated from all residuals.
    pub sd: f64,
    /// (data - model)/sd.
    pub residual: f64,
}

/// A candidate experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitCandidate {
    /// Its name.
    pub experiment: String,
    /// The information it would add on the free numbers, in bits: the number of halvings of
    /// their uncertainty, limited to a factor of ten up and down.
    pub bits: f64,
    /// The uncertainty of the least determined combination with it, relative to that without it.
    pub shrinks: f64,
    /// Why it cannot be judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<FitCandidateRemark>,
}

/// Other values of the free numbers that fit the data as well.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitAlternative {
    /// The value of each number.
    pub values: BTreeMap<String, f64>,
    /// Sum of the squares of residuals there, as that of the fit.
    pub chi_squared: f64,
}

/// Progress of a fit.
#[derive(Clone, Copy, Debug)]
pub struct FitStep {
    /// Number of steps towards the present minimum.
    pub step: usize,
    /// The sum of squares there.
    pub sum: f64,
    /// Once the minimum is found: the number of known intervals, and that of all numbers.
    pub known: Option<(usize, usize)>,
    /// Before the first step: what the fit takes at most.
    pub budget: Option<FitCostLimit>,
}

/// What a fit takes at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitCostLimit {
    /// Number of times that the leaves of all experiments are relaxed or followed.
    pub evaluations: usize,
    /// Number of these leaves.
    pub leaves: usize,
    /// The time that this takes if each takes as long as the first, in seconds.
    pub seconds: f64,
}

/// Work of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FitWork {
    /// Number of times the leaves of all experiments were relaxed.
    pub evaluations: usize,
    /// How many of these had the required accuracy; the others were those of the
    /// search, on the coarsest grids that do not affect the fit.
    pub accurate: usize,
    /// Work for the leaves at the minimum.
    #[serde(flatten)]
    pub last: SolverCounts,
}

/// A fit. As JSON it is `fit.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    /// Name of the scenario.
    pub scenario: String,
    /// How it ended.
    pub outcome: FitOutcome,
    /// Why it did not converge; other remarks.
    pub remarks: Vec<FitRemark>,
    /// The free numbers.
    pub parameters: Vec<FitParameter>,
    /// Correlations of their coordinates (logarithms of positive numbers); null if
    /// one is not determined.
    pub correlations: Vec<Vec<Option<f64>>>,
    /// Combinations to which the data are insensitive: for each, exponents of
    /// positive numbers and coefficients of others.
    pub undetermined: Vec<BTreeMap<String, f64>>,
    /// Other values that fit the data as well, if such were found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<FitAlternative>,
    /// Which other values were tried to find out whether they fit as well, if any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tried: Vec<String>,
    /// The systematic part of the residuals, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub systematic: Option<SystematicResiduals>,
    /// The results in words.
    pub says: Vec<String>,
    /// Sum of the squares of residuals over their standard deviations.
    pub chi_squared: f64,
    /// Degrees of freedom: data minus determined combinations.
    pub degrees_of_freedom: usize,
    /// Half the width of a 95 % interval in standard errors: of the normal distribution, or of
    /// Student's if the deviations of the data are estimated.
    pub coverage_factor: f64,
    /// Standard deviation of all data, if none was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_deviation: Option<f64>,
    /// The files of data.
    #[serde(skip)]
    pub files: Vec<DataFile>,
    /// The experiments in the order of the data.
    pub experiments: Vec<ExperimentConditions>,
    /// Data, model and residuals.
    pub residuals: Vec<FitResidual>,
    /// Candidate experiments, the most informative first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<FitCandidate>,
    /// Work.
    pub work: FitWork,
    /// Total time, in seconds.
    pub wall_seconds: f64,
    /// The scenario with the fitted values, as TOML.
    #[serde(skip)]
    pub fitted: String,
    /// The leaf of every experiment at the minimum, with its name.
    #[serde(skip)]
    pub leaves: Vec<(String, FitLeaf)>,
}

/// A leaf at the minimum, for drawing.
#[derive(Clone, Debug)]
pub struct FitLeaf {
    /// The position of its experiment in the data, from 1.
    pub number: usize,
    /// Numbers of the scenario during that experiment.
    pub settings: Vec<(ParameterKeys, f64)>,
    /// Centerlines, one per rod.
    pub curves: Vec<Vec<glam::DVec3>>,
    /// Traced points: rod, counted from 0, and coordinates seen.
    pub traced: Vec<(usize, [Option<f64>; 3])>,
}

impl Fit {
    /// Whether the requested numbers are determined (exit status 0).
    pub fn is_success(&self) -> bool {
        self.outcome == FitOutcome::Converged
    }
}

/// Longest step of a logarithm, or of another number in its unit.
pub(super) const LONGEST_COORDINATE_STEP: f64 = 1.5;

/// Largest distance of a number without bounds from its initial value, in logarithms (a
/// factor of a thousand) or units: numbers that the data drive beyond this
/// are not determined by them.
const LARGEST_DISTANCE_FROM_INITIAL: f64 = 6.907_755_278_982_137;

/// A column of the data whose zero may be unknown.
#[derive(Clone, Debug, PartialEq)]
pub enum OffsetColumn {
    /// A number that was set in experiments.
    Setting(ParameterKeys),
    /// A result that was measured in experiments.
    Result(MeasuredQuantity),
}

/// Numbers that a fit varies.
#[derive(Clone, Debug, PartialEq)]
pub enum FreeParameterTarget {
    /// Numbers of the scenario that take the same value: `KEY`.
    Entry(ParameterKeys),
    /// What is added to the numbers in a column of the data, in the unit of that column:
    /// `offset:COLUMN`.
    Offset(OffsetColumn),
}

/// How the name of an offset begins.
const OFFSET_PREFIX: &str = "offset:";

impl FreeParameterTarget {
    /// The keys of the scenario that it stands for, if it does.
    pub(super) fn scenario_keys(&self) -> Option<&ParameterKeys> {
        match self {
            FreeParameterTarget::Entry(keys) => Some(keys),
            FreeParameterTarget::Offset(_) => None,
        }
    }

    /// Whether it is the offset of a setting of experiments by these keys.
    pub(super) fn is_offset_of(&self, setting: &ParameterKeys) -> bool {
        matches!(self, FreeParameterTarget::Offset(OffsetColumn::Setting(keys)) if keys == setting)
    }

    /// Whether they have a number in common.
    pub(super) fn overlaps(&self, other: &FreeParameterTarget) -> bool {
        match (self, other) {
            (FreeParameterTarget::Entry(one), FreeParameterTarget::Entry(two)) => one.overlaps(two),
            _ => self == other,
        }
    }
}

impl FromStr for FreeParameterTarget {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let keys = |text: &str| text.parse::<ParameterKeys>();
        let Some(column) = text.trim().strip_prefix(OFFSET_PREFIX) else {
            let keys = keys(text).map_err(|refused| FitError::Free(refused.to_string()))?;
            return Ok(FreeParameterTarget::Entry(keys));
        };
        let column = column.trim();
        if let Ok(quantity) = column.parse() {
            return Ok(FreeParameterTarget::Offset(OffsetColumn::Result(quantity)));
        }
        let refuse = |refused: VaryError| {
            FitError::Free(format!(
                "{text}: offsets are those of columns of experiments, keys of the scenario and results ({}): {refused}",
                MeasuredQuantity::ALL
            ))
        };
        let keys = keys(column).map_err(refuse)?;
        Ok(FreeParameterTarget::Offset(OffsetColumn::Setting(keys)))
    }
}

impl fmt::Display for FreeParameterTarget {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FreeParameterTarget::Entry(keys) => keys.fmt(f),
            FreeParameterTarget::Offset(OffsetColumn::Setting(keys)) => {
                write!(f, "{OFFSET_PREFIX}{keys}")
            }
            FreeParameterTarget::Offset(OffsetColumn::Result(quantity)) => {
                write!(f, "{OFFSET_PREFIX}{quantity}")
            }
        }
    }
}

/// Numbers that a fit varies together: `KEY` or `offset:COLUMN`, or with bounds `KEY=LOW..HIGH`.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParameter {
    /// What is free.
    pub number: FreeParameterTarget,
    /// Bounds, if given.
    pub bounds: Option<[f64; 2]>,
}

impl FromStr for FreeParameter {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, FitError> {
        let (number, bounds) = match text.split_once('=') {
            Some((number, bounds)) => (number, Some(bounds)),
            None => (text, None),
        };
        let number = number.parse()?;
        let Some(given) = bounds else {
            let bounds = None;
            return Ok(FreeParameter { number, bounds });
        };
        let numbers = given
            .split_once("..")
            .and_then(|(low, high)| Some([low.trim().parse().ok()?, high.trim().parse().ok()?]));
        match numbers {
            Some([low, high]) if low < high => Ok(FreeParameter {
                number,
                bounds: Some([low, high]),
            }),
            _ => {
                let why = "bounds are LOW..HIGH, two numbers, as in stiffness.axial=1..1e4";
                Err(FitError::Free(format!("{text}: {why}")))
            }
        }
    }
}

impl fmt::Display for FreeParameter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.number)?;
        match self.bounds {
            Some([low, high]) => write!(f, "={low}..{high}"),
            None => Ok(()),
        }
    }
}

/// A free number as a coordinate of the least squares: its logarithm, or the number in a
/// suitable unit.
#[derive(Clone, Debug)]
pub(super) struct FitCoordinate {
    pub number: FreeParameterTarget,
    pub is_logarithmic: bool,
    pub unit: f64,
    /// Bounds of the coordinate, and whether they were given.
    pub bounds: [f64; 2],
    pub has_given_bounds: bool,
    pub initial: f64,
}

impl FitCoordinate {
    pub fn new(
        base: &BaseScenario,
        data: &Data,
        free: &FreeParameter,
    ) -> Result<FitCoordinate, FitError> {
        let number = free.number.clone();
        let (value, log, unit) = match &number {
            FreeParameterTarget::Entry(keys) => {
                let value = base.differentiable_value(keys);
                let value = value.map_err(|refused| FitError::Free(refused.to_string()))?;
                match keys.is_positive() && value > 0.0 {
                    true => (value, true, 1.0),
                    false => (
                        value,
                        false,
                        value.abs().max(keys.reference_magnitude(base.scenario())),
                    ),
                }
            }
            FreeParameterTarget::Offset(column) => (0.0, false, offset_unit(column, data)?),
        };
        let mut coordinate = FitCoordinate {
            number,
            is_logarithmic: log,
            unit,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            has_given_bounds: free.bounds.is_some(),
            initial: 0.0,
        };
        if let Some([low, high]) = free.bounds {
            if !(low..=high).contains(&value) {
                let why = match &free.number {
                    FreeParameterTarget::Entry(_) => {
                        format!("the scenario has {value}, which is not between the bounds")
                    }
                    FreeParameterTarget::Offset(_) => {
                        "an offset begins at 0, which is not between the bounds".into()
                    }
                };
                return Err(FitError::Free(format!("{free}: {why}")));
            }
            if log && low <= 0.0 {
                let why = "the number is positive, and so must be its bounds";
                return Err(FitError::Free(format!("{free}: {why}")));
            }
            coordinate.bounds = [low, high].map(|bound| coordinate.transform(bound));
        }
        coordinate.initial = coordinate.transform(value);
        if free.bounds.is_none() {
            let farthest = if log {
                LARGEST_DISTANCE_FROM_INITIAL
            } else {
                LARGEST_DISTANCE_FROM_INITIAL.exp()
            };
            coordinate.bounds = [-farthest, farthest].map(|far| coordinate.initial + far);
        }
        Ok(coordinate)
    }

    /// Whether its order of magnitude may be unknown: that of stiffnesses and other positive numbers, but
    /// not of lengths, which are measured.
    pub fn is_searched_in_decades(&self) -> bool {
        let mut keys = self
            .number
            .scenario_keys()
            .into_iter()
            .flat_map(ParameterKeys::targets);
        let is_length =
            |target: &VariableTarget| target.key().is_some_and(|it| it.dimension() == LENGTH);
        self.is_logarithmic && !keys.any(is_length)
    }

    /// The same coordinate with another initial value. Bounds that were not given move with it.
    pub fn with_initial_value(&self, start: f64) -> FitCoordinate {
        let moved = start - self.initial;
        let bounds = match self.has_given_bounds {
            true => self.bounds,
            false => self.bounds.map(|bound| bound + moved),
        };
        FitCoordinate {
            initial: start,
            bounds,
            ..self.clone()
        }
    }

    pub fn transform(&self, value: f64) -> f64 {
        match self.is_logarithmic {
            true => value.ln(),
            false => value / self.unit,
        }
    }

    pub fn inverse_transform(&self, coordinate: f64) -> f64 {
        match self.is_logarithmic {
            true => coordinate.exp(),
            false => coordinate * self.unit,
        }
    }

    /// The bound at which the coordinate stands.
    pub fn active_bound(&self, coordinate: f64) -> Option<f64> {
        let [low, high] = self.bounds;
        [low, high].into_iter().find(|bound| *bound == coordinate)
    }

    /// So far on the way from the initial value to another, by orders of magnitude.
    pub fn interpolate_from_initial(&self, to: f64, part: f64) -> f64 {
        let way = to - self.initial;
        let far = match self.is_logarithmic {
            true => part * way.abs(),
            false => (1.0 + way.abs()).powf(part) - 1.0,
        };
        self.initial + far * way.signum()
    }

    /// d value/d coordinate.
    pub fn value_derivative(&self, coordinate: f64) -> f64 {
        match self.is_logarithmic {
            true => coordinate.exp(),
            false => self.unit,
        }
    }
}

/// The range of the numbers in a column, or their size where there is one: how far its zero may be off.
fn offset_unit(column: &OffsetColumn, data: &Data) -> Result<f64, FitError> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for experiment in &data.experiments {
        let set = experiment.settings.iter().filter_map(|(keys, value)| {
            matches!(column, OffsetColumn::Setting(of) if of == keys).then_some(*value)
        });
        let measured = experiment.measured.iter().filter_map(|measured| {
            let is_it = matches!(column, OffsetColumn::Result(of) if *of == measured.quantity);
            measured.value.filter(|_| is_it)
        });
        for value in set.chain(measured) {
            (low, high) = (low.min(value), high.max(value));
        }
    }
    if low > high {
        let name = FreeParameterTarget::Offset(column.clone());
        let why = "no file of experiments has that column";
        return Err(FitError::Free(format!("{name}: {why}")));
    }
    let range = high - low;
    let size = if range > 0.0 { range } else { high.abs() };
    Ok(if size > 0.0 { size } else { 1.0 })
}
