//! `checkpoint.json`: where a simulation was stopped, to go on from there.
//!
//! Numbers on which the motion depends are written as the hexadecimal digits
//! of their bits: no rounding, and no doubt about it.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::energy;
use super::motion::Form;
use crate::files::checksum::Checksum;
use crate::files::part::Extent;
use crate::report::json;
use crate::simulate::Simulation;

pub const FILE_NAME: &str = "checkpoint.json";

/// Digits of a number.
const DIGITS: usize = 16;

/// Why a simulation cannot go on.
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

/// What is asked of a run: two with the same identity are the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    version: String,
    scenario: String,
    /// Of all that the scenario says, overrides included.
    content: String,
    method: String,
    segments: usize,
    step: Option<String>,
    tolerance: String,
}

impl Identity {
    pub fn of(simulation: &Simulation) -> Self {
        let scenario = simulation.leaf().scenario();
        Identity {
            version: env!("CARGO_PKG_VERSION").into(),
            scenario: scenario.name.clone(),
            // As text, floating-point numbers keep every digit.
            content: Checksum::of(format_args!("{scenario:?}")).to_string(),
            method: simulation.scheme().name().into(),
            segments: simulation.segments(),
            step: simulation.longest_step().map(digits),
            tolerance: digits(simulation.tolerance()),
        }
    }

    /// The first difference from what is asked for now, in words.
    fn difference(&self, asked: &Identity) -> Option<String> {
        let both = |what: &str, its: &dyn std::fmt::Display, now: &dyn std::fmt::Display| {
            Some(format!("{what} {its}, now {now}"))
        };
        let number = |digits: &Option<String>| match digits.as_deref().and_then(number) {
            Some(number) => number.to_string(),
            None => "left to the tolerance".into(),
        };
        if self.version != asked.version {
            return both("version", &self.version, &asked.version);
        }
        if self.scenario != asked.scenario {
            return both("scenario", &self.scenario, &asked.scenario);
        }
        if self.content != asked.content {
            return Some("the scenario, or an override of it, has changed".into());
        }
        if self.method != asked.method {
            return both("method", &self.method, &asked.method);
        }
        if self.segments != asked.segments {
            return both("segments", &self.segments, &asked.segments);
        }
        if self.step != asked.step {
            return both("time step", &number(&self.step), &number(&asked.step));
        }
        if self.tolerance != asked.tolerance {
            let [its, now] = [self, asked].map(|run| number(&Some(run.tolerance.clone())));
            return both("tolerance", &its, &now);
        }
        None
    }
}

/// How much of a file belongs to the checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Kept {
    file: String,
    bytes: u64,
    checksum: String,
}

impl Kept {
    fn of(file: &str, extent: Extent) -> Self {
        Kept {
            file: file.into(),
            bytes: extent.bytes,
            checksum: extent.checksum.to_string(),
        }
    }
}

/// The keys, in the order in which they are written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// For people: `state` has it to the last digit.
    time: f64,
    run: Identity,
    motion: Kept,
    energy: Kept,
    wall_nanoseconds: u64,
    state: String,
    checksum: String,
}

impl Checkpoint {
    pub fn new(
        run: Identity,
        form: Form,
        [motion, energy]: [Extent; 2],
        time: f64,
        wall_nanoseconds: u64,
        state: &[f64],
    ) -> Self {
        let mut checkpoint = Checkpoint {
            time,
            run,
            motion: Kept::of(form.file_name(), motion),
            energy: Kept::of(energy::FILE_NAME, energy),
            wall_nanoseconds,
            state: state.iter().map(|&number| digits(number)).collect(),
            checksum: String::new(),
        };
        checkpoint.checksum = checkpoint.sum();
        checkpoint
    }

    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        json::write(self, out)
    }

    /// The checkpoint in a folder, if it is whole and of the run asked for.
    pub fn read(folder: &Path, asked: &Identity) -> Result<Self, CannotResume> {
        let file = folder.join(FILE_NAME);
        let text = match fs::read(&file) {
            Ok(text) => text,
            Err(reason) if reason.kind() == io::ErrorKind::NotFound => {
                return Err(CannotResume::Absent { file });
            }
            Err(reason) => return Err(CannotResume::Unreadable { file, reason }),
        };
        let found: Checkpoint = match serde_json::from_slice(&text) {
            Ok(found) => found,
            Err(error) => {
                let what = error.to_string();
                return Err(CannotResume::Damaged { file, what });
            }
        };
        if found.checksum != found.sum() {
            let what = "its content does not match its checksum".into();
            return Err(CannotResume::Damaged { file, what });
        }
        match found.run.difference(asked) {
            Some(what) => Err(CannotResume::Other { file, what }),
            None => Ok(found),
        }
    }

    /// The state of the motion; `None` if it is not one.
    pub fn state(&self) -> Option<Vec<f64>> {
        let whole = self.state.is_ascii() && self.state.len().is_multiple_of(DIGITS);
        let starts = (0..self.state.len()).step_by(DIGITS);
        let numbers = starts.map(|at| number(self.state.get(at..at + DIGITS)?));
        whole.then(|| numbers.collect())?
    }

    /// The extents of the motion and of the energies.
    pub fn extents(&self) -> Option<[Extent; 2]> {
        let extent = |kept: &Kept| {
            let bits = u64::from_str_radix(&kept.checksum, 16).ok()?;
            Some(Extent {
                bytes: kept.bytes,
                checksum: Checksum::from_bits(bits),
            })
        };
        Some([extent(&self.motion)?, extent(&self.energy)?])
    }

    pub fn wall_nanoseconds(&self) -> u64 {
        self.wall_nanoseconds
    }

    /// Of all that the motion and its files depend on.
    fn sum(&self) -> String {
        let Checkpoint {
            run,
            motion,
            energy,
            wall_nanoseconds,
            state,
            ..
        } = self;
        let all = format_args!("{run:?} {motion:?} {energy:?} {wall_nanoseconds} {state}");
        Checksum::of(all).to_string()
    }
}

fn digits(number: f64) -> String {
    format!("{:016x}", number.to_bits())
}

fn number(digits: &str) -> Option<f64> {
    u64::from_str_radix(digits, 16).ok().map(f64::from_bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity() -> Identity {
        Identity {
            version: "0.1.0".into(),
            scenario: "leaf".into(),
            content: "0".into(),
            method: "explicit".into(),
            segments: 16,
            step: Some(digits(0.1)),
            tolerance: digits(1e-6),
        }
    }

    fn written() -> (tempfile::TempDir, Checkpoint) {
        let extent = Extent {
            bytes: 7,
            checksum: Checksum::new(),
        };
        let state = [0.1, -0.0, f64::MIN_POSITIVE / 3.0, f64::NAN, 1e300 / 3.0];
        let form = Form::Table;
        let checkpoint = Checkpoint::new(identity(), form, [extent; 2], 0.3, 12, &state);
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = Vec::new();
        checkpoint.write(&mut bytes).unwrap();
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
        assert_eq!(read.extents().unwrap()[1].bytes, 7);
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
                Err(CannotResume::Damaged { .. }) => (),
                // The time is not used, nor is white space.
                Ok(read) => assert_eq!(
                    Checkpoint { time: 0.3, ..read },
                    checkpoint,
                    "{}",
                    String::from_utf8_lossy(&changed)
                ),
                Err(other) => panic!("{other}"),
            }
        }
        fs::write(&file, &text[..text.len() / 2]).unwrap();
        let read = Checkpoint::read(folder.path(), &identity());
        assert!(matches!(read, Err(CannotResume::Damaged { .. })));
    }

    #[test]
    fn what_is_different_is_told() {
        let (folder, _) = written();
        let same = identity();
        let text = |text: &str| text.to_string();
        for (asked, told) in [
            (
                Identity {
                    version: text("9.0.0"),
                    ..same.clone()
                },
                "version 0.1.0, now 9.0.0",
            ),
            (
                Identity {
                    scenario: text("b"),
                    ..same.clone()
                },
                "scenario leaf, now b",
            ),
            (
                Identity {
                    content: text("1"),
                    ..same.clone()
                },
                "has changed",
            ),
            (
                Identity {
                    method: text("x"),
                    ..same.clone()
                },
                "method explicit, now x",
            ),
            (
                Identity {
                    segments: 8,
                    ..same.clone()
                },
                "segments 16, now 8",
            ),
            (
                Identity {
                    step: None,
                    ..same.clone()
                },
                "time step 0.1, now left to the tolerance",
            ),
            (
                Identity {
                    tolerance: digits(0.1),
                    ..same.clone()
                },
                "tolerance 0.000001, now 0.1",
            ),
        ] {
            let error = Checkpoint::read(folder.path(), &asked)
                .unwrap_err()
                .to_string();
            assert!(error.contains(told), "{error}");
            assert!(error.contains("is of another run") && error.contains("--resume"));
        }
    }

    #[test]
    fn no_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let read = Checkpoint::read(folder.path(), &identity());
        assert!(matches!(read, Err(CannotResume::Absent { .. })));
    }
}
