//! What another thread needs to keep a simulation that is being stopped.

use std::mem;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::checkpoint::{self, Checkpoint, Identity};
use super::motion::Form;
use crate::files::atomic;
use crate::files::part::{Extent, Keepable};
use crate::report::OutputError;

/// Where a simulation was at its last output.
pub struct Latest {
    pub run: Identity,
    pub folder: PathBuf,
    pub form: Form,
    pub parts: [Keepable; 2],
    pub extents: [Extent; 2],
    pub time: f64,
    pub wall_nanoseconds: u64,
    pub state: Vec<f64>,
}

/// Keeps a [`Recording`](super::Recording) where it is, from any thread.
#[derive(Clone, Default)]
pub struct Keeper(Arc<Mutex<Option<Latest>>>);

impl Keeper {
    pub(super) fn latest(&self) -> MutexGuard<'_, Option<Latest>> {
        // It is replaced as a whole: whatever its last user did, it is sound.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes `checkpoint.json`, and gives the unfinished files the names under
    /// which a resumed run looks for them. Returns the time of the checkpoint;
    /// `None` if there is nothing to keep.
    pub fn keep(&self) -> Option<Result<f64, OutputError>> {
        keep(&mut self.latest())
    }

    /// As [`Keeper::keep`], and no recording goes on ever after: for a program
    /// about to exit.
    pub fn keep_for_good(&self) -> Option<Result<f64, OutputError>> {
        let mut latest = self.latest();
        let kept = keep(&mut latest);
        mem::forget(latest);
        kept
    }
}

fn keep(latest: &mut Option<Latest>) -> Option<Result<f64, OutputError>> {
    let latest = latest.take()?;
    let checkpoint = Checkpoint::new(
        latest.run,
        latest.form,
        latest.extents,
        latest.time,
        latest.wall_nanoseconds,
        &latest.state,
    );
    let file = latest.folder.join(checkpoint::FILE_NAME);
    let written = atomic::write_file(&file, |out| {
        checkpoint.write(out)?;
        out.flush()?;
        // Only now: an older checkpoint needs the files it goes with until
        // nothing but renaming is left to be done.
        latest.parts.iter().try_for_each(Keepable::keep)
    });
    Some(match written {
        Ok(()) => Ok(latest.time),
        Err(reason) => Err(OutputError::File { file, reason }),
    })
}
