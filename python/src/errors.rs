//! What is refused, as exceptions.

use std::error::Error;

use leafdyn::scenario::{Key, Place, ScenarioError};
use leafdyn::study::VaryError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

/// What messages call a text that is not from a file.
pub const TEXT: &str = "scenario";

static SCENARIO_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// A refused scenario: `leafdyn.ScenarioError`.
pub fn refused(py: Python, error: &ScenarioError) -> PyErr {
    let (file, line) = match &error.place {
        Place::File { file, line } => (Some(file.as_str()), *line),
        Place::Set { .. } => (None, None),
    };
    let class = match SCENARIO_ERROR.import(py, "leafdyn._errors", "ScenarioError") {
        Ok(class) => class,
        Err(error) => return error,
    };
    let key = error.key.map(|key| key.path());
    let arguments = (error.to_string(), key, file, line, remedy(&error.problem));
    match class.call1(arguments) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// What a message says to change: its end.
fn remedy(problem: &str) -> Option<&str> {
    let sentence = problem.lines().next()?;
    if sentence.starts_with("not valid TOML") {
        return None;
    }
    match sentence.rfind(": allowed") {
        Some(at) => Some(&sentence[at + 2..]),
        None => sentence.rsplit_once(": ").map(|(_, end)| end),
    }
}

/// Refuses what no TOML can be made of.
pub fn refuse_entry(found: &Bound<PyAny>, key: &str, allowed: &str) -> PyErr {
    let kind = found.get_type().name();
    let kind = kind.map_or("an object".into(), |name| name.to_string());
    let problem = format!("{key} = {kind}: {allowed}");
    let place = Place::File {
        file: TEXT.into(),
        line: None,
    };
    let error = ScenarioError {
        place,
        key: Key::from_path(key),
        problem,
    };
    refused(found.py(), &error)
}

/// A request that cannot be met: a `ValueError`.
pub fn cannot(error: impl Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A number that cannot vary, or a scenario refused for it.
pub fn cannot_vary(py: Python, error: VaryError) -> PyErr {
    match error {
        VaryError::Scenario(error) => refused(py, &error),
        error => cannot(error),
    }
}
