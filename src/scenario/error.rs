//! Why a scenario is refused: one message for a person, and where it points.

use std::fmt;

use super::excerpt::printable;
use super::key::Key;

/// Why a scenario was refused. Its text is the whole message: where, which
/// key, what was found, and what to change.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", printable(&format!("{place}: {problem}")))]
pub struct ScenarioError {
    /// Where.
    pub place: Place,
    /// The key it is about, if the format has it.
    pub key: Option<Key>,
    /// The rest of the message.
    pub problem: String,
}

impl ScenarioError {
    /// The same of a file that is no TOML itself: its lines are others.
    pub(super) fn without_line(mut self) -> Self {
        if let Place::File { line, .. } = &mut self.place {
            *line = None;
        }
        let end = self.problem.find('\n').unwrap_or(self.problem.len());
        self.problem.truncate(end);
        self
    }
}

/// Where a value was written, or is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In a file.
    File {
        /// The file.
        file: String,
        /// The line, counted from 1; none where it is the whole file.
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
            Place::Set { given } => write!(f, "--set {given}"),
        }
    }
}
