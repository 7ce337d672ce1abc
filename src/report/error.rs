//! Errors of reading and writing files.

use std::io;
use std::path::Path;

/// Why a file could not be written or read, and what to change.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct FileError(pub String);

impl FileError {
    /// A file cannot be written, for the system's reason. A previous file is unchanged.
    pub fn write(file: &Path, reason: io::Error) -> Self {
        let file = file.display();
        FileError(format!(
            "cannot write {file}: {reason}; make room there or name another folder with --out DIR"
        ))
    }

    /// A file cannot be read, for the system's reason.
    pub fn read(file: &Path, reason: io::Error) -> Self {
        FileError(format!("cannot read {}: {reason}", file.display()))
    }

    /// A file belongs to another run or map, or is damaged.
    pub fn unfit(file: &Path, why: &str) -> Self {
        FileError(format!("{} {why}", file.display()))
    }
}
