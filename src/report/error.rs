//! Why files could not be written or read.

use std::io;
use std::path::Path;

/// Why a file could not be written or read, and what to change.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct FileError(pub String);

impl FileError {
    /// The system's reason why a file cannot be written. What may have been there
    /// before is untouched.
    pub fn write(file: &Path, reason: io::Error) -> Self {
        let file = file.display();
        FileError(format!(
            "cannot write {file}: {reason}; make room there or name another folder with --out DIR"
        ))
    }

    /// The system's reason why a file cannot be read.
    pub fn read(file: &Path, reason: io::Error) -> Self {
        FileError(format!("cannot read {}: {reason}", file.display()))
    }

    /// A file that is not of this run or map, or damaged.
    pub fn unfit(file: &Path, why: &str) -> Self {
        FileError(format!("{} {why}", file.display()))
    }
}
