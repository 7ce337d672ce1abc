//! Fits numbers of a scenario to measurements.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use leafdyn::scenario;
use leafdyn::study::{
    self, Data, DataFileOptions, Experiment, FitError, FitRequest, FitStep, FreeParameter,
    MeasuredColumn, RowFilter,
};
use pyo3::prelude::*;

use crate::errors::{value_error, vary_error};
use crate::result::Files;
use crate::run::{Interrupt, run_keeping};
use crate::scenario::Scenario;

/// A table of measurements.
#[derive(FromPyObject)]
pub enum Measurements {
    /// Its name in messages, and its text.
    Text(String, String),
    /// A file.
    File(PathBuf),
}

impl Measurements {
    /// Its name and its bytes.
    fn read(self) -> PyResult<(String, Vec<u8>)> {
        match self {
            Measurements::Text(name, text) => Ok((name, text.into())),
            Measurements::File(path) => {
                let bytes = scenario::bytes(&path).map_err(value_error)?;
                Ok((path.display().to_string(), bytes))
            }
        }
    }
}

/// The exception for a fit that cannot be made.
fn fit_error(py: Python, error: FitError) -> PyErr {
    match error {
        FitError::Vary(error) => vary_error(py, error),
        error => value_error(error),
    }
}

/// Fits free numbers of a scenario to measurements; after Ctrl-C the best that was found until then.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are those of the verb")]
pub fn fit(
    py: Python,
    scenario: &Scenario,
    data: Vec<Measurements>,
    free: Vec<String>,
    robust: bool,
    candidates: Option<Measurements>,
    columns: Vec<String>,
    every: NonZeroUsize,
    rows: Vec<String>,
    tolerance: Option<f64>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Files> {
    let rods = scenario.checked.rods.len();
    let columns: Result<Vec<MeasuredColumn>, FitError> =
        columns.iter().map(|column| column.parse()).collect();
    let columns = columns.map_err(|error| fit_error(py, error))?;
    let rows: Result<Vec<RowFilter>, FitError> = rows.iter().map(|choice| choice.parse()).collect();
    let mut measured = Data {
        reading: DataFileOptions {
            columns: columns.clone(),
            every,
            rows: rows.map_err(|error| fit_error(py, error))?,
        },
        ..Data::default()
    };
    for table in data {
        let (name, bytes) = table.read()?;
        measured
            .read(bytes, &name, rods)
            .map_err(|error| fit_error(py, error))?;
    }
    let free: Result<Vec<FreeParameter>, FitError> =
        free.iter().map(|number| number.parse()).collect();
    let candidates: Option<Vec<Experiment>> = match candidates {
        None => None,
        Some(table) => {
            let (name, bytes) = table.read()?;
            let candidates = FitRequest::read_candidates(bytes, &name, &columns);
            Some(candidates.map_err(|error| fit_error(py, error))?)
        }
    };
    let mut request = FitRequest {
        base: scenario.base(py)?,
        data: measured,
        free: free.map_err(|error| fit_error(py, error))?,
        robust,
        candidates: candidates.unwrap_or_default(),
        tolerance,
        limit: Default::default(),
        most_evaluations: None,
    };
    let mut interrupt = Interrupt::default();
    let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
        request.limit = monitor.limit();
        study::fit(&request, &mut |now| {
            let FitStep {
                step, sum, budget, ..
            } = *now;
            if budget.is_some() {
                return;
            }
            monitor.report(step as f64, None, || {
                format!("step {step}, sum of squares {sum:.6e}")
            });
        })
    })?;
    let fit = interrupt.or_else(found, |error| fit_error(py, error))?;
    interrupt.hand_over(py, Files::of(fit, scenario.checked.clone()))
}
