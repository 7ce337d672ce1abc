//! `checkpoint.json`: the state in which a simulation was stopped, to resume it. It can be
//! written from another thread.
//!
//! Numbers on which the motion depends are written as the hexadecimal digits of their
//! bits, so that they are restored exactly.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::{fs, io, mem};

use serde::{Deserialize, Serialize};

use crate::files::atomic;
use crate::report::{FileError, json};
use leafdyn::simulate::Simulation;

pub const FILE_NAME: &str = "checkpoint.json";

const BEGIN_ANEW: &str = "leave out --resume to begin anew";

/// The error that a file is damaged, with the evidence.
pub fn damaged(file: &Path, what: &str) -> FileError {
    let file = file.display();
    FileError(format!(
        "cannot resume: {file} is damaged: {what}; {BEGIN_ANEW}"
    ))
}

/// The error that a file cannot be read or written.
pub fn unreadable(file: &Path, reason: io::Error) -> FileError {
    FileError(format!("cannot resume: {}: {reason}", file.display()))
}

/// Hexadecimal digits per number.
const DIGITS: usize = 16;

/// The identity of a run: runs with the same scenario and options are the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    version: String,
    scenario: String,
    /// Checksum of the whole scenario, overrides included.
    content: String,
    method: String,
    segments: usize,
    step: Option<String>,
    tolerance: String,
    /// The error that is aimed at, if one is.
    aim: Option<String>,
    /// The value of `--stations`.
    stations: Option<usize>,
}

impl Identity {
    pub fn of(simulation: &Simulation, stations: Option<usize>) -> Self {
        let scenario = simulation.leaf().scenario();
        Identity {
            version: env!("CARGO_PKG_VERSION").into(),
            scenario: scenario.name.clone(),
            // As text, floating-point numbers keep every digit.
            content: checksum(&format!("{scenario:?}")),
            method: simulation.scheme().word().into(),
            segments: simulation.segments(),
            step: simulation.longest_step().map(digits),
            tolerance: digits(simulation.tolerance()),
            aim: simulation.aim().map(digits),
            stations,
        }
    }

    /// The properties that distinguish runs, as readable text.
    fn descriptions(&self) -> [(&'static str, String); 9] {
        let number = |digits: &str| number(digits).map_or("?".into(), |number| number.to_string());
        let step = self.step.as_deref().map(number);
        let aim = self.aim.as_deref();
        let stations = self.stations.map(|count| count.to_string());
        [
            ("version", self.version.clone()),
            ("scenario", self.scenario.clone()),
            ("content", self.content.clone()),
            ("method", self.method.clone()),
            ("segments", self.segments.to_string()),
            ("time step", step.unwrap_or("left to the tolerance".into())),
            ("tolerance", number(&self.tolerance)),
            ("error aimed at", aim.map_or("left out".into(), number)),
            ("stations", stations.unwrap_or("of the grid".into())),
        ]
    }

    /// The identity of a run that this one, the first of a motion, may be refined to: that of
    /// another run if its grid is as fine or twice, four times ... as fine.
    pub fn refined_to(mut self, other: &Identity) -> Self {
        let ratio = other.segments / self.segments.max(1);
        if ratio.is_power_of_two() && ratio * self.segments == other.segments {
            self.step.clone_from(&other.step);
            if ratio > 1 {
                self.segments = other.segments;
                self.tolerance.clone_from(&other.tolerance);
            }
        }
        self
    }

    /// Describes the first difference from the requested run.
    fn difference(&self, asked: &Identity) -> Option<String> {
        let mut both = self.descriptions().into_iter().zip(asked.descriptions());
        let ((what, its), (_, now)) = both.find(|(its, now)| its != now)?;
        Some(match what {
            "content" => "the scenario, or an override of it, has changed".into(),
            _ => format!("{what} {its}, now {now}"),
        })
    }
}

/// The extent of a file at a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extent {
    pub file: String,
    pub bytes: u64,
    pub checksum: String,
}

/// The keys, in the order in which they are written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The time of `state`.
    pub time: f64,
    run: Identity,
    pub motion: Extent,
    pub energy: Extent,
    pub wall_nanoseconds: u64,
    state: String,
    checksum: String,
}

impl Checkpoint {
    /// A checkpoint without the state of the motion.
    pub fn new(
        run: Identity,
        [motion, energy]: [Extent; 2],
        time: f64,
        wall_nanoseconds: u64,
    ) -> Self {
        Checkpoint {
            time,
            run,
            motion,
            energy,
            wall_nanoseconds,
            state: String::new(),
            checksum: String::new(),
        }
    }

    /// Adds the state of the motion, and the checksum.
    fn with_state(mut self, state: &[f64]) -> Self {
        self.state = state.iter().map(|&number| digits(number)).collect();
        self.checksum = self.sum();
        self
    }

    /// Reads the checkpoint in a folder; refused if it is damaged or of another run.
    pub fn read(folder: &Path, asked: &Identity) -> Result<Self, FileError> {
        Checkpoint::read_as(folder, |_| asked.clone())
    }

    /// The same, of a run that is `asked` for as that in the checkpoint allows.
    pub fn read_as(
        folder: &Path,
        asked: impl FnOnce(&Identity) -> Identity,
    ) -> Result<Self, FileError> {
        let file = &folder.join(FILE_NAME);
        let text = fs::read(file).map_err(|reason| match reason.kind() {
            io::ErrorKind::NotFound => {
                let change = format!("{BEGIN_ANEW}, or name the folder with --out DIR");
                let file = file.display();
                FileError(format!("cannot resume: there is no {file}; {change}"))
            }
            _ => unreadable(file, reason),
        })?;
        let found: Checkpoint =
            serde_json::from_slice(&text).map_err(|error| damaged(file, &error.to_string()))?;
        if found.checksum != found.sum() {
            return Err(damaged(file, "its content does not match its checksum"));
        }
        match found.run.difference(&asked(&found.run)) {
            Some(what) => {
                let (file, change) = (file.display(), "ask for the same run");
                let why = format!("{file} is of another run: {what}");
                Err(FileError(format!(
                    "cannot resume: {why}; {change}, or {BEGIN_ANEW}"
                )))
            }
            None => Ok(found),
        }
    }

    /// The state of the motion; `None` if it is malformed.
    pub fn state(&self) -> Option<Vec<f64>> {
        let well_formed = self.state.is_ascii() && self.state.len().is_multiple_of(DIGITS);
        let starts = (0..self.state.len()).step_by(DIGITS);
        let numbers = starts.map(|at| number(self.state.get(at..at + DIGITS)?));
        well_formed.then(|| numbers.collect())?
    }

    /// The checksum of everything on which the motion and its files depend.
    fn sum(&self) -> String {
        let Checkpoint {
            run,
            motion,
            energy,
            wall_nanoseconds,
            state,
            ..
        } = self;
        checksum(&format!(
            "{run:?} {motion:?} {energy:?} {wall_nanoseconds} {state}"
        ))
    }
}

/// The CRC-32 checksum of a text: it detects damage and changes, not malice.
fn checksum(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

fn digits(number: f64) -> String {
    format!("{:016x}", number.to_bits())
}

fn number(digits: &str) -> Option<f64> {
    u64::from_str_radix(digits, 16).ok().map(f64::from_bits)
}

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
    let file = latest.folder.join(FILE_NAME);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{json, sample};

    fn identity() -> Identity {
        Identity::of(&sample::swing(1, 4).0, None)
    }

    fn written() -> (tempfile::TempDir, Checkpoint) {
        let extent = Extent {
            file: "a.csv".into(),
            bytes: 7,
            checksum: "0".into(),
        };
        let state = [0.1, -0.0, f64::MIN_POSITIVE / 3.0, f64::NAN, 1e300 / 3.0];
        let extents = [extent.clone(), extent];
        let checkpoint = Checkpoint::new(identity(), extents, 0.3, 12).with_state(&state);
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = Vec::new();
        json::write(&checkpoint, &mut bytes).unwrap();
        fs::write(folder.path().join(FILE_NAME), bytes).unwrap();
        (folder, checkpoint)
    }

    #[test]
    fn every_bit_comes_back() {
        let (folder, checkpoint) = written();
        let read = Checkpoint::read(folder.path(), &identity()).unwrap();
        assert_eq!(read, checkpoint);
        let state = read.state().unwrap();
        assert_eq!(state.len(), 5);
        assert_eq!(state[1].to_bits(), (-0.0_f64).to_bits());
        assert_eq!(state[2], f64::MIN_POSITIVE / 3.0);
        assert!(state[3].is_nan());
    }

    #[test]
    fn any_changed_byte_is_noticed() {
        let (folder, checkpoint) = written();
        let file = folder.path().join(FILE_NAME);
        let text = fs::read(&file).unwrap();
        for at in 0..text.len() {
            let mut changed = text.clone();
            changed[at] = if changed[at] == b'7' { b'8' } else { b'7' };
            fs::write(&file, &changed).unwrap();
            match Checkpoint::read(folder.path(), &identity()) {
                Err(error) if error.to_string().contains(" is damaged: ") => (),
                // The time is compared with that of the state, and white space is not used.
                Ok(read) => assert_eq!(Checkpoint { time: 0.3, ..read }, checkpoint, "{at}"),
                Err(other) => panic!("{other}"),
            }
        }
        fs::write(&file, &text[..text.len() / 2]).unwrap();
        let read = Checkpoint::read(folder.path(), &identity());
        assert!(read.unwrap_err().to_string().contains(" is damaged: "));
    }

    #[test]
    fn differences_are_reported() {
        let (folder, _) = written();
        let mut asked = identity();
        let message = |asked: &Identity| {
            let read = Checkpoint::read(folder.path(), asked);
            read.unwrap_err().to_string()
        };
        asked.step = None;
        assert!(message(&asked).contains(", now left to the tolerance;"));
        asked.content = "1".into();
        assert!(message(&asked).contains(": the scenario, or an override of it, has changed;"));
        asked.version = "9.0.0".into();
        assert!(message(&asked).contains(", now 9.0.0; ask for the same run"));
    }
}
