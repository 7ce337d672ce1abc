//! Numbers that vary: in the words of the program, or with the values themselves.

use leafdyn::study::{ParameterSweep, VaryError};
use pyo3::prelude::*;

use crate::errors::vary_error;

/// What a number varies over.
#[derive(FromPyObject)]
pub enum Range {
    /// `KEY=FROM..TO[:COUNT][log]`.
    Text(String),
    /// The keys, their values in ascending or descending order, and whether their logarithms are
    /// spaced evenly.
    Values(String, Vec<f64>, bool),
}

impl Range {
    /// The numbers with their values; refused as the text is that has the same ends.
    pub fn vary(&self, py: Python) -> PyResult<ParameterSweep> {
        self.parse().map_err(|error| vary_error(py, error))
    }

    fn parse(&self) -> Result<ParameterSweep, VaryError> {
        match self {
            Range::Text(text) => text.parse(),
            Range::Values(keys, values, log) => {
                let of = |from: f64, to: f64, count: usize| -> Result<ParameterSweep, VaryError> {
                    format!("{keys}={from:?}..{to:?}:{count}").parse()
                };
                let ends = (values.first(), values.last());
                let (&from, &to) = (ends.0.unwrap_or(&f64::NAN), ends.1.unwrap_or(&f64::NAN));
                let all = of(from, to, values.len())?;
                let one = |&value: &f64| Ok(of(value, value, 1)?.values[0]);
                Ok(ParameterSweep {
                    values: values.iter().map(one).collect::<Result<_, VaryError>>()?,
                    log: *log,
                    ..all
                })
            }
        }
    }
}
