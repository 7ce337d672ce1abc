//! Converts errors to exceptions.

use std::error::Error;

use leafdyn::scenario::{Key, ScenarioError, SourceLocation};
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
        SourceLocation::File { file, line } => (Some(file.as_str()), *line),
        SourceLocation::Set { .. } => (None, None),
    };
    let class = match SCENARIO_ERROR.import(py, "leafdyn._errors", "ScenarioError") {
        Ok(class) => class,
        Err(error) => return error,
    };
    let key = key_of(error);
    let message = error.to_string();
    let remedy = remedy(error.problem.lines().next().unwrap_or_default());
    let arguments = (message, key, file, line, remedy);
    match class.call1(arguments) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// The key of a message, also one that is no key of the format.
fn key_of(error: &ScenarioError) -> Option<&str> {
    if let Some(key) = error.key {
        return Some(key.path());
    }
    let sentence = error.problem.lines().next()?;
    if let Some(rest) = sentence.strip_prefix("unknown key ") {
        let end = rest.find(" (did you mean ").or_else(|| rest.find(": "));
        return Some(&rest[..end.unwrap_or(rest.len())]);
    }
    match &error.place {
        SourceLocation::Set { given } => given.split(['[', '=']).next(),
        // A value in place of a table.
        SourceLocation::File { .. } => {
            let (start, _) = sentence.split_once(" = ")?;
            (!start.contains(": ")).then_some(start)
        }
    }
}

/// How clauses begin that say what to change.
const ADVICE: [&str; 13] = [
    "add ", "allowed ", "check ", "choose ", "give ", "leave ", "lower ", "must ", "needs ",
    "raise ", "save ", "use ", "write ",
];

/// The part of a message that says what to change: what was probably meant, or the first clause that
/// gives advice and what follows it. If none does, everything after the value that was found.
fn remedy(sentence: &str) -> Option<&str> {
    if sentence.starts_with("not valid ") {
        return None;
    }
    if let Some(at) = sentence.find("(did you mean ") {
        let meant = &sentence[at + 1..];
        return meant.find("?)").map(|end| &meant[..=end]);
    }
    let ends = || {
        let colons = sentence.match_indices(": ");
        colons.map(|(at, colon)| &sentence[at + colon.len()..])
    };
    let advises = |end: &&str| ADVICE.iter().any(|verb| end.starts_with(verb));
    if let Some(advice) = ends().find(advises) {
        return Some(advice);
    }
    let (start, end) = sentence.split_once(": ").unwrap_or((sentence, sentence));
    let has_value = start.contains(" = ") || start.starts_with("unknown key ");
    Some(if has_value { end } else { sentence })
}

/// The exception for an entry of a dictionary, or of `set`, that cannot be converted to TOML.
pub fn entry_error(py: Python, key: &str, in_set: bool, problem: String) -> PyErr {
    let place = match in_set {
        true => SourceLocation::Set { given: key.into() },
        false => SourceLocation::File {
            file: TEXT.into(),
            line: None,
        },
    };
    let error = ScenarioError {
        place,
        key: Key::from_path(key),
        problem,
        others: Vec::new(),
    };
    scenario_error(py, &error)
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
