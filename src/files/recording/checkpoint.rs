//! `checkpoint.json`: where a simulation was stopped, to go on from there.
//!
//! Numbers on which the motion depends are written as the hexadecimal digits
//! of their bits: no rounding, and no doubt about it.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::files::checksum::Checksum;
use crate::report::{FileError, json};
use crate::simulate::Simulation;

pub const FILE_NAME: &str = "checkpoint.json";

const BEGIN_ANEW: &str = "leave out --resume to begin anew";

/// A file is not what was written: how that is known.
pub fn damaged(file: &Path, what: &str) -> FileError {
    let file = file.display();
    FileError(format!(
        "cannot resume: {file} is damaged: {what}; {BEGIN_ANEW}"
    ))
}

/// A file cannot be read or written.
pub fn unreadable(file: &Path, reason: io::Error) -> FileError {
    FileError(format!("cannot resume: {}: {reason}", file.display()))
}

/// Digits of a number.
const DIGITS: usize = 16;

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
    /// Of `--stations`.
    stations: Option<usize>,
}

impl Identity {
    pub fn of(simulation: &Simulation, stations: Option<usize>) -> Self {
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
            stations,
        }
    }

    /// What tells runs apart, with numbers as people read them.
    fn described(&self) -> [(&'static str, String); 8] {
        let number = |digits: &str| number(digits).map_or("?".into(), |number| number.to_string());
        let step = self.step.as_deref();
        [
            ("version", self.version.clone()),
            ("scenario", self.scenario.clone()),
            ("content", self.content.clone()),
            ("method", self.method.clone()),
            ("segments", self.segments.to_string()),
            (
                "time step",
                step.map_or("left to the tolerance".into(), number),
            ),
            ("tolerance", number(&self.tolerance)),
            (
                "stations",
                (self.stations).map_or("of the grid".into(), |count| count.to_string()),
            ),
        ]
    }

    /// The first difference from what is asked for now, in words.
    fn difference(&self, asked: &Identity) -> Option<String> {
        let mut both = self.described().into_iter().zip(asked.described());
        let ((what, its), (_, now)) = both.find(|(its, now)| its != now)?;
        Some(match what {
            "content" => "the scenario, or an override of it, has changed".into(),
            _ => format!("{what} {its}, now {now}"),
        })
    }
}

/// How much of a file was written, as a checkpoint has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extent {
    pub file: String,
    pub bytes: u64,
    pub checksum: String,
}

/// The keys, in the order in which they are written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// For people: `state` has it to the last digit.
    pub time: f64,
    run: Identity,
    pub motion: Extent,
    pub energy: Extent,
    pub wall_nanoseconds: u64,
    state: String,
    checksum: String,
}

impl Checkpoint {
    /// Where a run is whose files have these extents, without its state.
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

    /// The same with the state of the motion.
    pub fn with_state(mut self, state: &[f64]) -> Self {
        self.state = state.iter().map(|&number| digits(number)).collect();
        self.checksum = self.sum();
        self
    }

    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        json::write(self, out)
    }

    /// The checkpoint in a folder, if it is whole and of the run asked for.
    pub fn read(folder: &Path, asked: &Identity) -> Result<Self, FileError> {
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
        match found.run.difference(asked) {
            Some(what) => Err(FileError(format!(
                "cannot resume: {} is of another run: {what}; ask for the same run, or {BEGIN_ANEW}",
                file.display()
            ))),
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
    use crate::report::sample;

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
        assert!(read.unwrap_err().to_string().contains(" is damaged: "));
    }

    #[test]
    fn what_is_different_is_told() {
        let (folder, _) = written();
        let mut asked = identity();
        let told = |asked: &Identity| {
            let read = Checkpoint::read(folder.path(), asked);
            read.unwrap_err().to_string()
        };
        asked.step = None;
        assert!(told(&asked).contains(", now left to the tolerance;"));
        asked.content = "1".into();
        assert!(told(&asked).contains(": the scenario, or an override of it, has changed;"));
        asked.version = "9.0.0".into();
        assert!(told(&asked).contains(", now 9.0.0; ask for the same run"));
    }
}
