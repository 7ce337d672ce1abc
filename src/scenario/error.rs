//! The error of a refused scenario: one message for people, and its place.

use std::fmt;

use super::excerpt::printable;
use super::key::Key;

pub(super) type ScenarioResult<T> = std::result::Result<T, ScenarioError>;

/// Why a scenario was refused. Its text is the whole message: the place, the key, the
/// value found, and what to change.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.told("set"))]
pub struct ScenarioError {
    /// Where.
    pub place: Place,
    /// The key, if it is one of the format.
    pub key: Option<Key>,
    /// The rest of the message.
    pub problem: String,
    /// Errors about other entries that do not follow from this one, in the order of the format, as far
    /// as they can be told; the message has all in the order of their lines.
    pub others: Vec<ScenarioError>,
}

impl ScenarioError {
    /// The error about a file, or a line of it, that is not one about the value of a key.
    pub(super) fn in_file(file: &str, line: Option<usize>, problem: String) -> Self {
        let file = file.to_string();
        ScenarioError {
            place: Place::File { file, line },
            key: None,
            problem,
            others: Vec::new(),
        }
    }

    /// The whole message, where overrides are given by this option.
    pub fn told(&self, option: &str) -> String {
        let mut all: Vec<&ScenarioError> = [self].into_iter().chain(&self.others).collect();
        // In the order of the lines of the file, then what it lacks, then what is set.
        all.sort_by_key(|error| match error.place {
            Place::File { line, .. } => line.unwrap_or(usize::MAX - 1),
            Place::Set { .. } => usize::MAX,
        });
        let all = all.into_iter().map(|error| match &error.place {
            Place::Set { given } => format!("{option} {given}: {}", error.problem),
            place => format!("{place}: {}", error.problem),
        });
        let all: Vec<String> = all.collect();
        printable(&all.join("\n")).into_owned()
    }
}

/// Where a value was written, or is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In a file.
    File {
        /// The file.
        file: String,
        /// The line, counted from 1; `None` for the whole file.
        line: Option<usize>,
    },
    /// In an override.
    Set {
        /// The whole `KEY=VALUE`.
        given: String,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::File { file, line } => {
                f.write_str(file)?;
                line.map_or(Ok(()), |line| write!(f, ":{line}"))
            }
            Place::Set { given } => write!(f, "set {given}"),
        }
    }
}
