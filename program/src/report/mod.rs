//! Output of results: as lines on the console, as rows of tables, as JSON.

mod blade;
mod centerlines;
mod chart;
mod check;
mod equilibria;
mod fit;
pub mod json;
mod map;
mod margin;
pub mod numbers;
mod relax;
#[cfg(test)]
pub mod sample;
mod simulate;
pub mod table;
mod trace;
pub mod words;

use std::io;
use std::path::Path;

use serde::Serialize;

use crate::report::table::{Lines, labelled};
use leafdyn::scenario::{Scenario, Units, printable};

pub use centerlines::{centerlines, modes_table, sensitivity_table};
pub use chart::{chart_table, scaling_table};
pub use fit::{fitted, table as fit_table};
pub use map::{MapWork, map_table};
pub use trace::{
    boundary_table, error_location, is_special, passes_crossings, sides, slope_unit, trace_table,
};

/// A result with a report: labelled lines under a heading.
pub trait Reported {
    fn heading(&self) -> String;

    /// What it is, in the units of the scenario.
    fn lines(&self, units: &Units) -> Lines;

    /// What it took, for those who ask.
    fn work(&self) -> Option<String> {
        None
    }

    /// What follows the list of the files that were written.
    fn remarks(&self) -> Lines {
        Lines::new()
    }

    /// All lines but that list.
    fn summary(&self, units: &Units) -> Lines {
        [
            self.lines(units),
            labelled("work", self.work()),
            self.remarks(),
        ]
        .concat()
    }

    /// The text for the console; the work only if it is `verbose`.
    fn report(&self, units: &Units, files: Vec<String>, verbose: bool) -> String {
        let work = labelled("work", self.work().filter(|_| verbose));
        let parts = [
            self.lines(units),
            work,
            labelled("written", files),
            self.remarks(),
        ];
        let lines = parts.iter().flatten();
        let lines = lines.map(|(name, line)| format!("  {name:<9}{line}\n"));
        self.heading() + "\n" + &lines.collect::<String>()
    }
}

/// A result with its input, as JSON: the content of a verb's file, and the output of
/// `--json`.
#[derive(Serialize)]
pub struct Document<'a, R> {
    /// Of the program.
    version: &'static str,
    /// The relative path from the output folder to the scenario's file, if known: it
    /// identifies the scenario whose results a folder holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<&'a str>,
    /// The result.
    #[serde(flatten)]
    pub result: &'a R,
    /// The scenario, with all defaults and overrides.
    pub input: &'a Scenario,
    /// Why its files could not be written, with the exit status.
    #[serde(flatten)]
    pub refused: Option<Refused>,
}

/// What `--json` prints of a refusal.
#[derive(Clone, Debug, Serialize)]
pub struct Refused {
    /// Why, and what to change.
    pub error: String,
    /// 2, or 130 after Ctrl-C.
    pub exit_status: i32,
}

impl Refused {
    pub fn new(error: &str, exit_status: i32) -> Self {
        Refused {
            error: printable(error).into(),
            exit_status,
        }
    }
}

impl<'a, R> Document<'a, R> {
    /// A result of a scenario in the file `source`.
    pub fn new(result: &'a R, input: &'a Scenario, source: Option<&'a str>) -> Self {
        Document {
            result,
            version: env!("CARGO_PKG_VERSION"),
            source,
            input,
            refused: None,
        }
    }
}

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
