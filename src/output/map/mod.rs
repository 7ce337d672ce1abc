//! `map.csv` and what belongs to it: rows written as cells finish, and read
//! again by the run that goes on or draws.

mod journal;
mod table;

use std::io;
use std::path::PathBuf;

pub use journal::{Journal, belongs, claim, write_rows};
pub use table::{MapTable, read_rows};

use super::OutputError;

/// Why rows of a map could not be taken over or written.
#[derive(Debug, thiserror::Error)]
pub enum MapFileError {
    /// A file cannot be read.
    #[error("cannot read {}: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// A file has other columns, values or words than this map.
    #[error(
        "{}:{line}: is no row of this map: {why}; give the same --vary as when it was made, or another --out DIR",
        file.display()
    )]
    OtherRow {
        /// The file.
        file: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// What does not fit.
        why: String,
    },
    /// The folder has the rows of another map.
    #[error(
        "{} is of another map: its {what} is not the same; name another folder with --out DIR, or remove the map there",
        file.display()
    )]
    OtherMap {
        /// The file that tells.
        file: PathBuf,
        /// What differs.
        what: String,
    },
    /// Rows could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
