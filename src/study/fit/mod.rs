//! From measurements to the numbers of a scenario: least squares over experiments and
//! traced veins, and what the data determine about each number and what they do not.
//!
//! The leaves of all experiments are followed from equilibrium to equilibrium, with
//! derivatives from their linearised equations, so that a fit does not jump between
//! branches. Positive numbers are fitted by their logarithms.

mod candidates;
mod case;
mod coarse;
mod columns;
mod contradiction;
mod data;
mod derivatives;
mod directions;
mod end;
mod experiments;
mod found;
mod free;
mod interval;
mod lack_of_fit;
mod least_squares;
mod minima;
mod model;
mod neighbourhood;
mod profile;
mod quantity;
mod responses;
mod result;
mod search;
mod starts;
mod statistics;
mod table;
mod vein;
mod view;
mod words;

pub use columns::{Comparison, MeasuredColumn, Reading, RowChoice, RowCondition};
pub use data::{Data, DataFile, Experiment, Measured, Origin, Traced};
pub use free::{Free, FreeNumber, OffsetColumn};
pub use quantity::Quantity as MeasuredQuantity;
pub use result::{
    Fit, FitAlternative, FitBudget, FitCandidate, FitExperiment, FitLeaf, FitOutcome, FitParameter,
    FitResidual, FitStep, FitSystematic, FitWork,
};

use crate::clock::Instant;
use std::cell::Cell;

use super::{Base, VaryError};
use crate::limit::Limit;
use crate::relax::{Options, RelaxError, check_tolerance, without_wind};
use free::Coordinate;
use least_squares::{ASSUMED, Weighting};
use minima::{Beginning, Minima};
use model::{Budget, Model};
use quantity::Quantity;

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
    pub base: Base,
    /// The data.
    pub data: Data,
    /// The free numbers.
    pub free: Vec<Free>,
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
pub const MOST_EVALUATIONS: usize = 1000;

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
        data::candidates(table.as_ref(), file, columns)
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
    let coordinates = coordinates(request)?;
    let options = Options {
        tolerance: request.tolerance,
        limit: request.limit.clone(),
        ..Options::default()
    };
    let most = request.most_evaluations.unwrap_or(MOST_EVALUATIONS);
    let data = (request.data.clone(), Budget::new(most));
    let model = Model::new(base, &coordinates, &options, data)?;
    let weighting = Weighting {
        assumed: ASSUMED * model.unit(),
        robust: request.robust,
    };
    let mut told = |seconds: f64| {
        let leaves = model.cases.len();
        progress(&FitStep {
            step: 0,
            sum: f64::INFINITY,
            known: None,
            budget: Some(FitBudget {
                evaluations: most,
                leaves,
                seconds: seconds * most as f64,
            }),
        });
    };
    let began = Beginning::find(&model, weighting, &mut told)?;
    let known = model.check_deviations(&began.point)?;
    model.check_weights(&began.point)?;
    let measured = began.point.components().filter(|component| !component.free);
    check_count(coordinates.len(), measured.count(), known)?;
    let minima = Minima {
        model: &model,
        weighting,
        known,
        candidates: &request.candidates,
        evaluations: Cell::new(0),
    };
    let mut found = minima.best(began, progress)?;
    found.files = request.data.files.clone();
    found.remarks.extend(comments(&found.files));
    found.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(found)
}

/// How many lines among the rows of data were left out.
fn comments(files: &[DataFile]) -> Option<String> {
    let left_out = files.iter().filter(|file| file.comments_among_rows > 0);
    let left_out = left_out.map(|file| format!("{} of {}", file.comments_among_rows, file.file));
    let left_out: Vec<String> = left_out.collect();
    (!left_out.is_empty()).then(|| {
        format!(
            "lines among the rows that begin with # were left out as comments: {}",
            left_out.join(", ")
        )
    })
}

/// The coordinates of the free numbers, checked to be distinct.
fn coordinates(request: &FitRequest) -> Result<Vec<Coordinate>, FitError> {
    let base = &request.base;
    let free = expanded(request)?;
    let coordinates = free
        .iter()
        .map(|free| Coordinate::new(base, &request.data, free));
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

fn check_count(free: usize, count: usize, known: bool) -> Result<(), FitError> {
    if free == 0 || free > count {
        return Err(FitError::Free(match free {
            0 => "no number is free: name at least one".into(),
            _ if count == 0 => format!(
                "there are no data: columns of results are {}, or rod, x, y, z of points on veins",
                Quantity::ALL
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
fn expanded(request: &FitRequest) -> Result<Vec<Free>, FitError> {
    let mut all = Vec::new();
    for free in &request.free {
        let entries = match &free.number {
            FreeNumber::Entry(keys) => {
                let entries = request.base.entries_of(keys);
                entries.into_iter().map(FreeNumber::Entry).collect()
            }
            offset @ FreeNumber::Offset(_) => vec![offset.clone()],
        };
        all.extend(entries.into_iter().map(|number| Free {
            number,
            bounds: free.bounds,
        }));
    }
    Ok(all)
}
