//! Converts errors to exceptions.

use std::error::Error;

use leafdyn::scenario::{Key, Place, ScenarioError};
use leafdyn::study::VaryError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

/// The name in messages of a text that is not from a file.
pub const TEXT: &str = "scenario";

static SCENARIO_ERROR: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// `leafdyn.ScenarioError`, for a refused scenario.
pub fn scenario_error(py: Python, error: &ScenarioError) -> PyErr {
    let (file, line) = match &error.place {
        Place::File { file, line } => (Some(file.as_str()), *line),
        Place::Set { .. } => (None, None),
    };
    let class = match SCENARIO_ERROR.import(py, "leafdyn._errors", "ScenarioError") {
        Ok(class) => class,
        Err(error) => return error,
    };
    let known = error.key.map(|key| key.path());
    let key = known.or_else(|| unknown_key(&error.problem));
    // As the argument `set`, not the program's option.
    let message = error.to_string();
    let message = message.strip_prefix("--").unwrap_or(&message);
    let arguments = (message, key, file, line, remedy(&error.problem));
    match class.call1(arguments) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// The key of a message about an unknown one.
fn unknown_key(problem: &str) -> Option<&str> {
    let rest = problem.lines().next()?.strip_prefix("unknown key ")?;
    let end = rest.find(" (did you mean ").or_else(|| rest.find(": "));
    Some(&rest[..end.unwrap_or(rest.len())])
}

/// The part of a message that says what to change: what was probably meant, or its end.
fn remedy(problem: &str) -> Option<&str> {
    let sentence = problem.lines().next()?;
    if sentence.starts_with("not valid TOML") {
        return None;
    }
    if let Some(at) = sentence.find("(did you mean ") {
        let meant = &sentence[at + 1..];
        return meant.find("?)").map(|end| &meant[..=end]);
    }
    match sentence.rfind(": allowed") {
        Some(at) => Some(&sentence[at + 2..]),
        None => sentence.rsplit_once(": ").map(|(_, end)| end),
    }
}

/// The exception for an entry that cannot be converted to TOML.
pub fn entry_error(found: &Bound<PyAny>, key: &str, allowed: &str) -> PyErr {
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
    scenario_error(found.py(), &error)
}

/// A `ValueError`, for a request that cannot be met.
pub fn value_error(error: impl Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The exception for a number that cannot vary, or for a scenario refused with it.
pub fn vary_error(py: Python, error: VaryError) -> PyErr {
    match error {
        VaryError::Scenario(error) => scenario_error(py, &error),
        error => value_error(error),
    }
}
