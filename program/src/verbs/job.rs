//! One scenario of a request, and the delivery of its result.

use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::Ordering;

use crate::files::{self, Document, Selection, Written};
use crate::live;
use crate::report::table::list_files;
use crate::report::{Refused, Reported, json};
use leafdyn::relax::Limit;
use leafdyn::scenario::Scenario;
use leafdyn::study::Base;

use super::progress::ProgressLine;
use super::{Refusal, Status, note, what_stopped};

/// One scenario of a request, and where its files go.
pub struct Job {
    /// Whether its result is printed as JSON.
    pub(super) json: bool,
    /// Whether the report says what it took.
    pub(super) verbose: bool,
    /// Whether it is the only one of its request.
    pub(super) single: bool,
    pub scenario: Scenario,
    /// The scenario as a base for varied numbers.
    pub base: Base,
    pub folder: PathBuf,
    pub selection: Selection,
    pub(super) file: String,
    pub(super) source: String,
    /// Whether several run in parallel.
    pub(super) parallel: bool,
    /// When the run ends with what it has found: at a signal, if that is of use.
    pub limit: Limit,
}

/// The lines that list files, or why these could not be written.
pub type Listed = Result<Vec<String>, Refusal>;

/// The delivered result of a scenario.
pub struct Delivered {
    pub(super) status: Status,
    /// The text for standard output.
    pub(super) report: String,
    /// The result as JSON, if it is printed or part of a table.
    pub(super) json: Vec<u8>,
    /// Why its files could not be written.
    pub(super) error: Option<String>,
}

/// Runs a verb on a scenario. A panic, which is an error of the program, fails this scenario alone.
pub fn attempt(
    job: &Job,
    run: impl Fn(&Job) -> Result<Delivered, Refusal>,
) -> Result<Delivered, Refusal> {
    // What a panic leaves half done is dropped with the job; files are complete or absent.
    let done = catch_unwind(AssertUnwindSafe(|| run(job)));
    done.unwrap_or_else(|cause| Err(format!("{}: {}", job.file, program_error(&*cause)).into()))
}

/// What a panic says.
fn program_error(cause: &(dyn Any + Send)) -> String {
    let text = (cause.downcast_ref::<&str>().copied())
        .or_else(|| cause.downcast_ref::<String>().map(String::as_str));
    let cause = text.unwrap_or("no cause is known");
    format!("an error of the program, not of the scenario, ended the run: {cause}")
}

impl Job {
    /// Its progress line; hidden if scenarios run in parallel, which share one.
    pub fn progress(&self) -> ProgressLine {
        ProgressLine::new(&self.scenario.name, !self.parallel)
    }

    /// Prints a remark on the result to standard error if the output is JSON.
    pub fn remark(&self, remark: Option<impl Display>) {
        if let (true, Some(remark)) = (self.json, remark) {
            note(&format!("{}: {remark}", self.scenario.name));
        }
    }

    /// Whether a signal has ended the run.
    pub fn is_interrupted(&self) -> bool {
        let cancel = self.limit.cancel.as_ref();
        cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }

    /// A result with its input; of a run that a signal has ended it says so.
    pub fn document<'a, R>(&'a self, result: &'a R) -> Document<'a, R> {
        let mut document = Document::new(result, &self.scenario, Some(&self.source));
        let status = Status::Interrupted.code();
        let interrupted = self.is_interrupted();
        document.refused = interrupted.then(|| Refused::new(what_stopped(), status));
        document
    }

    /// Writes the files of a result; returns the line that lists them, if there are any.
    pub fn write<R: Written>(&self, result: &R) -> Listed {
        let files = files::write_all(&self.folder, &self.document(result), &self.selection.kinds)?;
        Ok(self.list_files(&files))
    }

    /// The live page with its scenario.
    pub fn live(&self) -> Result<String, Refusal> {
        let given = match self.base.overrides().is_empty() {
            true => Some(self.base.text().to_owned()),
            false => self.base.toml(&[]),
        };
        let name = format!("{}.toml", self.scenario.name);
        let page = live::page(&given.unwrap_or_default(), &name, &[]);
        page.map_err(|why| format!("--write live: {why}").into())
    }

    /// Writes a file of this content; returns the line that lists it.
    pub fn write_table(&self, name: &str, content: &[u8]) -> Listed {
        let file = files::write_table(&self.folder, name, content)?;
        Ok(self.list_files(&[file]))
    }

    /// The line that lists files, if there are any.
    pub fn list_files(&self, files: &[PathBuf]) -> Vec<String> {
        let list = (!files.is_empty()).then(|| list_files(&self.folder, files));
        list.into_iter().collect()
    }

    /// Writes the files of a result and returns its output: JSON, or the report.
    pub fn deliver<R: Written + Reported>(
        &self,
        result: &R,
        success: bool,
    ) -> Result<Delivered, Refusal> {
        self.deliver_written(result, success, result, [self.write(result)])
    }

    /// Returns the output of a result, JSON or a report, with files that are written as they
    /// are listed, up to one that cannot be: the result is output in either case.
    pub fn deliver_written<R: Written>(
        &self,
        result: &R,
        success: bool,
        report: &impl Reported,
        written: impl IntoIterator<Item = Listed>,
    ) -> Result<Delivered, Refusal> {
        let (mut files, mut written) = (Vec::new(), written.into_iter());
        let error = written.try_for_each(|list| list.map(|list| files.extend(list)));
        let error = error.err().map(|error| error.to_string());
        let mut json = Vec::new();
        if self.json || !self.single {
            let mut document = self.document(result);
            if let Some(error) = &error {
                document.refused = Some(Refused::new(error, Status::Refused as i32));
            }
            json::write_json(&document, &mut json)?;
        }
        let report = match self.json {
            true => String::new(),
            false => report.report(&self.scenario.units, files, self.verbose),
        };
        Ok(Delivered {
            status: match self.is_interrupted() {
                true => Status::Interrupted,
                false => Status::of(success),
            },
            report,
            json,
            error,
        })
    }
}
