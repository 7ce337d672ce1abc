//! Why a simulation cannot go on where it was stopped.

use std::io;
use std::path::PathBuf;

/// Why a simulation cannot go on where it was stopped.
#[derive(Debug, thiserror::Error)]
pub enum CannotResume {
    /// There is no checkpoint.
    #[error(
        "cannot resume: there is no {}; leave out --resume to begin anew, or name the folder with --out DIR",
        file.display()
    )]
    Absent {
        /// The checkpoint.
        file: PathBuf,
    },
    /// The checkpoint is of another run.
    #[error(
        "cannot resume: {} is of another run: {what}; ask for the same run, or leave out --resume to begin anew",
        file.display()
    )]
    Other {
        /// The checkpoint.
        file: PathBuf,
        /// What is different.
        what: String,
    },
    /// The checkpoint, or a file it goes with, is not what was written.
    #[error(
        "cannot resume: {} is damaged: {what}; leave out --resume to begin anew",
        file.display()
    )]
    Damaged {
        /// The damaged file.
        file: PathBuf,
        /// How that is known.
        what: String,
    },
    /// A file cannot be read or written.
    #[error("cannot resume: {}: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
}
