//! Results as documents: a text report of labeled lines under a heading, and JSON for scripts, compact and
//! with null for numbers that are not finite; why a file of a result cannot be written or read; and the
//! phrases about results that reports, figures and pages share.

use crate::report::table::{LabelledLines, label_first_line};
use leafdyn::relax::{Equilibrium, Outcome};
use leafdyn::scenario::{Scenario, Units, printable};
use leafdyn::study::{BranchEnd, CheckVerdict, CorrectorFailure, MapShow, SolverConfig};
use serde::Serialize;
use serde_json::ser::Formatter;
use std::io;
use std::io::Write;
use std::path::Path;

/// A result with a report: labelled lines under a heading.
pub trait ReportedResult {
    fn heading(&self) -> String;

    /// What was found, in the units of the scenario.
    fn report_lines(&self, units: &Units) -> LabelledLines;

    /// What the result took: steps and time, told if the report is verbose.
    fn work_line(&self) -> Option<String> {
        None
    }

    /// What was tried for it, and what came of that.
    fn attempt_lines(&self) -> Vec<String> {
        Vec::new()
    }

    /// What follows the list of the files that were written.
    fn remarks(&self) -> LabelledLines {
        LabelledLines::new()
    }

    /// All lines except the list of written files.
    fn summary(&self, units: &Units) -> LabelledLines {
        [
            self.report_lines(units),
            label_first_line("work", self.work_line()),
            self.remarks(),
        ]
        .concat()
    }

    /// The text for the console; the attempts and the work only if it is `verbose`.
    fn report(&self, units: &Units, files: Vec<String>, verbose: bool) -> String {
        let (attempts, work) = match verbose {
            true => (self.attempt_lines(), self.work_line()),
            false => Default::default(),
        };
        let parts = [
            self.report_lines(units),
            label_first_line("attempts", attempts),
            label_first_line("work", work),
            label_first_line("written", files),
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
pub struct ResultDocument<'a, R> {
    /// Version of the program.
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
    pub refused: Option<RefusalDocument>,
}

/// What `--json` prints of a refusal.
#[derive(Clone, Debug, Serialize)]
pub struct RefusalDocument {
    /// Why, and what to change.
    pub error: String,
    /// 2, or 130 after Ctrl-C.
    pub exit_status: i32,
}

impl RefusalDocument {
    pub fn new(error: &str, exit_status: i32) -> Self {
        RefusalDocument {
            error: printable(error).into(),
            exit_status,
        }
    }
}

impl<'a, R> ResultDocument<'a, R> {
    /// A result of a scenario in the file `source`.
    pub fn new(result: &'a R, input: &'a Scenario, source: Option<&'a str>) -> Self {
        ResultDocument {
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
    pub fn cannot_write(file: &Path, reason: io::Error) -> Self {
        let file = file.display();
        FileError(format!(
            "cannot write {file}: {reason}; make room there or name another folder with --out DIR"
        ))
    }

    /// A file cannot be read, for the system's reason.
    pub fn cannot_read(file: &Path, reason: io::Error) -> Self {
        FileError(format!("cannot read {}: {reason}", file.display()))
    }

    /// A file belongs to another run or map, or is damaged.
    pub fn mismatched_file(file: &Path, why: &str) -> Self {
        FileError(format!("{} {why}", file.display()))
    }
}

/// Writes the whole file. Numbers that are not finite are null.
pub fn write_json(object: &impl Serialize, out: &mut dyn Write) -> io::Result<()> {
    let mut serializer = serde_json::Serializer::with_formatter(&mut *out, JsonLayout::default());
    object.serialize(&mut serializer)?;
    out.write_all(b"\n")
}

/// Compact JSON with each key of the outermost object on its own line.
#[derive(Default)]
struct JsonLayout {
    depth: usize,
}

impl Formatter for JsonLayout {
    fn begin_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth += 1;
        out.write_all(b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth -= 1;
        out.write_all(if self.depth == 0 { b"\n}" } else { b"}" })
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        if !first {
            out.write_all(b",")?;
        }
        out.write_all(match (self.depth, first) {
            (1, _) => b"\n  ",
            (_, true) => b"",
            (_, false) => b" ",
        })
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        out.write_all(b": ")
    }
}

/// How the run ended and what was found, in one phrase.
pub fn relaxation_verdict(equilibrium: &Equilibrium) -> String {
    match equilibrium.outcome {
        Outcome::Converged => rest_phrase(equilibrium),
        Outcome::ConvergedAfterSaddle => {
            let saddle = equilibrium.stability.saddle.as_ref();
            let index = saddle.map(|saddle| format!(" of index {}", saddle.negative_eigenvalues));
            let left = format!(", after leaving a saddle{}", index.unwrap_or_default());
            rest_phrase(equilibrium) + &left
        }
        Outcome::Saddle => rest_phrase(equilibrium),
        Outcome::ToleranceNotReached => {
            format!("{}, tolerance not reached", rest_phrase(equilibrium))
        }
        Outcome::NotAtRest if equilibrium.method.is_shooting() => "no equilibrium".into(),
        Outcome::NotAtRest => "not at rest".into(),
        Outcome::OutOfTime => "not at rest in time".into(),
        Outcome::Singular => "singular equations".into(),
        Outcome::Diverged => "diverged".into(),
    }
}

fn rest_phrase(equilibrium: &Equilibrium) -> String {
    let Some(motions) = &equilibrium.stability.small_motions else {
        return equilibrium_kind(equilibrium.stability.negative_eigenvalues);
    };
    match (motions.stable, motions.instability) {
        (Some(true), _) => "stable equilibrium".into(),
        (Some(false), Some(how)) => format!("unstable equilibrium ({})", how.word()),
        _ => "equilibrium of unknown stability".into(),
    }
}

/// The title of what a map shows.
pub fn map_title(show: MapShow) -> &'static str {
    match show {
        MapShow::Outcomes => "where methods fail",
        MapShow::Waves => "waves along the margins",
    }
}

/// The kind of equilibrium with this number of negative eigenvalues.
pub fn equilibrium_kind(negative_eigenvalues: Option<usize>) -> String {
    match negative_eigenvalues {
        Some(0) => "stable equilibrium".into(),
        Some(index) => format!("unstable equilibrium of index {index}"),
        None => "equilibrium of unknown stability".into(),
    }
}

/// The kind of equilibrium of a known index in a word or two.
pub fn stability_phrase(index: usize) -> String {
    match index {
        0 => "stable".into(),
        index => format!("index {index}"),
    }
}

pub fn shooting_method_name(intervals: usize) -> String {
    match intervals {
        1 => "single shooting".into(),
        count => format!("multiple shooting over {count} intervals"),
    }
}

/// The verdict of a check, in one phrase.
pub fn check_verdict_phrase(verdict: &CheckVerdict) -> &'static str {
    match verdict {
        CheckVerdict::Agree => "both methods agree",
        CheckVerdict::Differ => "the methods differ",
        CheckVerdict::NotCompared(_) => "could not be compared",
        CheckVerdict::NotIndependent(_) => "not confirmed by an independent solution",
    }
}

/// The name of a contender in a chart of leaves at rest, or of a `motion`.
pub fn contender_name(contender: SolverConfig, motion: bool) -> &'static str {
    /// In the order of [`SolverConfig::ALL`].
    const NAMES: [&str; SolverConfig::ALL.len()] = [
        "semi-implicit, extrapolated",
        "semi-implicit, single grids",
        "explicit, extrapolated",
        "explicit, single grids",
        "single shooting",
        "multiple shooting",
        "shooting from the relaxed leaf",
    ];
    match NAMES[contender.number().unwrap_or(0)] {
        "semi-implicit, extrapolated" if motion => "semi-implicit, refined",
        "explicit, extrapolated" if motion => "explicit, refined",
        name => name,
    }
}

/// How a branch ended, in a phrase.
pub fn branch_end_phrase(end: &BranchEnd) -> &'static str {
    match end {
        BranchEnd::RangeEndReached => "to the end of the range",
        BranchEnd::RangeStartReached => "back to the start of the range",
        BranchEnd::LoopClosed => "closed",
        BranchEnd::KnownBoundaryMet => "met",
        BranchEnd::PointLimitReached | BranchEnd::StopCriterionMet => "goes on",
        BranchEnd::StabilityLost => "ends: loses its stability",
        BranchEnd::RunLimitReached | BranchEnd::StepFailed(CorrectorFailure::Stopped) => {
            "goes on: stopped"
        }
        BranchEnd::StepFailed(CorrectorFailure::OutOfRange(_)) => "ends where no leaf is",
        BranchEnd::StepFailed(CorrectorFailure::Unresolved) => "ends: grid too coarse",
        BranchEnd::StepFailed(CorrectorFailure::TurnsBack) => "ends: turns back",
        BranchEnd::StepFailed(_) => "lost",
        BranchEnd::PointUnverified(_) => "ends: not verified further",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn numbers_keep_every_digit_or_are_null() {
        let mut leaf = sample::sample_equilibrium(5, 8);
        leaf.energy = Some(0.1 + 0.2);
        leaf.accuracy.residual = Some(f64::INFINITY);
        let mut bytes = Vec::new();
        write_json(&leaf, &mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        for line in ["\"energy\": 0.30000000000000004", "\"residual\": null"] {
            assert!(text.contains(&format!("\n  {line},\n")), "{text}");
        }
    }
}
