//! Why files could not be written or read.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Why a file could not be written.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The output folder, or a folder above it, is something else.
    #[error(
        "cannot write to the folder {}: {} is not a folder; name another with --out DIR",
        folder.display(), obstacle.display()
    )]
    NotAFolder {
        /// The output folder that was asked for.
        folder: PathBuf,
        /// The path that is in the way.
        obstacle: PathBuf,
    },
    /// The output folder cannot be made or written to.
    #[error(
        "cannot write to the folder {}: {reason}; make it writable or name another with --out DIR",
        folder.display()
    )]
    Unwritable {
        /// The output folder that was asked for.
        folder: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// Writing one file failed; the file that may have been there before is untouched.
    #[error(
        "cannot write {}: {reason}; make room there or name another folder with --out DIR",
        file.display()
    )]
    File {
        /// The file that was to be written.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
}

/// Why rows of a map could not be taken over or written.
#[derive(Debug, Error)]
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
