//! One scenario of a request: what is known of it, and how its result is delivered.

use std::fmt::Display;
use std::path::PathBuf;

use crate::files::{self, Document, Selection};
use crate::report::table::named;
use crate::report::{Refused, Written, json};
use crate::scenario::Scenario;
use crate::study::Base;

use super::progress::ProgressLine;
use super::{Refusal, Status, note};

/// One scenario of a request, and where its files go.
pub struct Job<'r> {
    pub(super) overrides: &'r [String],
    /// Whether JSON is shown.
    pub(super) json: bool,
    pub scenario: Scenario,
    pub(super) base: Option<Base>,
    pub folder: PathBuf,
    pub selection: Selection,
    pub(super) text: String,
    pub(super) file: String,
    pub(super) source: String,
    /// Whether there are no others.
    pub(super) alone: bool,
    pub(super) side_by_side: bool,
}

/// What was done about a scenario.
pub struct Done {
    pub(super) status: Status,
    /// For standard output.
    pub(super) report: String,
    /// The result, where it is shown or put into a table.
    pub(super) json: Vec<u8>,
    /// Why its files could not be written.
    pub(super) error: Option<String>,
}

impl Job<'_> {
    /// The scenario into which varying numbers can be put.
    pub fn base(&self) -> Result<Base, Refusal> {
        let base = self.base.clone();
        base.ok_or_else(|| "this verb does not vary its scenario".into())
    }

    /// The scenario with one entry more overridden.
    pub fn with(&self, entry: &str) -> Result<Scenario, Refusal> {
        let overrides = [self.overrides, &[entry.into()]].concat();
        Ok(Scenario::from_toml_with(
            &self.text, &self.file, &overrides,
        )?)
    }

    /// A line that says how far it has come; of leaves side by side one for all does.
    pub fn progress(&self) -> ProgressLine {
        match self.side_by_side {
            true => ProgressLine::hidden(),
            false => ProgressLine::new(&self.scenario.name),
        }
    }

    /// A remark on the result, beside the JSON that scripts read.
    pub fn remark(&self, remark: Option<impl Display>) {
        if let (true, Some(remark)) = (self.json, remark) {
            note(&format!("{}: {remark}", self.scenario.name));
        }
    }

    /// A result with what it was made from.
    pub fn document<'a, R>(&'a self, result: &'a R) -> Document<'a, R> {
        Document::new(result, &self.scenario, Some(&self.source))
    }

    /// Writes the files of a result; the line that names them, if there are any.
    pub fn write<R: Written>(&self, result: &R) -> Result<Option<String>, Refusal> {
        let files = files::write_all(&self.folder, &self.document(result), &self.selection.kinds)?;
        Ok(self.named(&files))
    }

    /// The line that names files.
    pub fn named(&self, files: &[PathBuf]) -> Option<String> {
        (!files.is_empty()).then(|| named(&self.folder, files))
    }

    /// Writes the files of a result and says what is to be shown: JSON, or a report
    /// that is told which files there are.
    pub fn deliver<R: Written>(
        &self,
        result: &R,
        success: bool,
        report: impl FnOnce(Option<String>) -> String,
    ) -> Result<Done, Refusal> {
        self.done(result, success, self.write(result), report)
    }

    /// The same of files that are written, or could not be: what was found is shown
    /// all the same.
    pub fn done<R: Written>(
        &self,
        result: &R,
        success: bool,
        written: Result<Option<String>, Refusal>,
        report: impl FnOnce(Option<String>) -> String,
    ) -> Result<Done, Refusal> {
        let (files, error) = match written {
            Ok(files) => (files, None),
            Err(error) => (None, Some(error.to_string())),
        };
        let mut json = Vec::new();
        if self.json || !self.alone {
            let mut document = self.document(result);
            document.refused = error.as_deref().map(Refused::new);
            json::write(&document, &mut json)?;
        }
        let report = match self.json {
            true => String::new(),
            false => report(files),
        };
        let status = Status::of(success);
        Ok(Done {
            status,
            report,
            json,
            error,
        })
    }
}
