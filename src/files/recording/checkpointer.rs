//! Writes checkpoints of a simulation from another thread.

use std::mem;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::checkpoint::{self, Checkpoint};
use crate::files::atomic;
use crate::report::{FileError, json};

/// The state of a simulation at its last output.
pub struct Latest {
    pub folder: PathBuf,
    /// Paths of the growing files, and those under which a resumed run looks for them.
    pub files: [[PathBuf; 2]; 2],
    pub checkpoint: Checkpoint,
    /// The state of the motion.
    pub state: Vec<f64>,
}

/// Writes checkpoints of a [`Recording`](super::Recording) from any thread.
#[derive(Clone, Default)]
pub struct Checkpointer(Arc<Mutex<Option<Latest>>>);

impl Checkpointer {
    pub(super) fn latest(&self) -> MutexGuard<'_, Option<Latest>> {
        // It is only replaced as a whole, so it is valid even if the lock is poisoned.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes `checkpoint.json`, and gives the unfinished files the names under which a
    /// resumed run looks for them. Returns the time of the checkpoint; `None` if there is
    /// nothing to resume.
    pub fn write(&self) -> Option<Result<f64, FileError>> {
        write(&mut self.latest())
    }

    /// As [`Checkpointer::write`], and blocks all recordings from now on: for a program
    /// about to exit.
    pub fn write_and_stop(&self) -> Option<Result<f64, FileError>> {
        let mut latest = self.latest();
        let written = write(&mut latest);
        mem::forget(latest);
        written
    }
}

fn write(latest: &mut Option<Latest>) -> Option<Result<f64, FileError>> {
    let latest = latest.take()?;
    let file = latest.folder.join(checkpoint::FILE_NAME);
    let checkpoint = latest.checkpoint.with_state(&latest.state);
    let written = atomic::write_file(&file, |out| {
        json::write(&checkpoint, out)?;
        out.flush()?;
        // Last, because an older checkpoint needs its files until this one is written and
        // only has to be renamed.
        let mut files = latest.files.iter();
        files.try_for_each(|[draft, kept]| atomic::rename(draft, kept))
    });
    let written = written.map_err(|reason| FileError::write(&file, reason));
    Some(written.map(|()| checkpoint.time))
}
