//! From measurements to the numbers of a scenario: least squares over experiments and
//! traced veins, and what the data determine about each number and what they do not.
//!
//! The leaves of all experiments are followed from equilibrium to equilibrium, with
//! derivatives from their linearized equations, so that a fit does not jump between
//! branches. Positive numbers are fitted by their logarithms.

pub(super) mod cells;
pub(super) mod columns;
mod data;
mod derivatives;
pub(super) mod free;
mod intervals;
mod lack_of_fit;
mod least_squares;
mod local_fit;
mod minima;
mod model;
mod prediction;
mod remark;
pub(super) mod result;
mod statistics;
pub(super) mod table;

use crate::relax::{Options, RelaxError, check_tolerance};
use crate::run::{Instant, Limit};
use crate::study::BaseScenario;
use crate::study::fit::columns::FitError;
pub use crate::study::fit::columns::{
    ComparisonOperator, DataFileOptions, MeasuredColumn, MeasuredQuantity, RowCondition, RowFilter,
};
pub use crate::study::fit::data::{
    Data, DataFile, DataOrigin, Experiment, MeasuredValue, TracedVeinPoint,
};
use crate::study::fit::free::{FitCoordinate, FreeParameter, FreeParameterTarget};
use crate::study::fit::minima::{FitStart, GlobalFitSearch};
use crate::study::fit::model::{
    ASSUMED_DEVIATION_PER_LENGTH, EvaluationBudget, FitModel, Weighting,
};
pub use crate::study::fit::remark::{FitCandidateRemark, FitRemark};
use crate::study::fit::result::{Fit, FitCostLimit, FitStep};
use std::cell::Cell;

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
            "{} free, and there are as many data, whose standard deviations are not \
             known: nothing is left to tell them: add columns sd_tip_x, ..., free fewer, or measure more",
            match count {
                1 => "one number is".to_owned(),
                _ => format!("{count} numbers are"),
            }
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
