//! What every verb is asked and how it delivers: a scenario, a folder, files
//! and what is shown.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};

use crate::files;
use crate::report::Written;
use crate::scenario::Scenario;
use crate::study::Base;

use super::{Refusal, Status, note, show};

/// What every verb is asked.
#[derive(Debug, Args)]
pub struct Request {
    /// The leaf, as a TOML file
    #[arg(value_hint = ValueHint::FilePath)]
    scenario: PathBuf,

    /// Wanted accuracy of the centerlines, relative to the largest rod length; in time, of a semi-implicit step; overrides the scenario's
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub tolerance: Option<f64>,

    /// Override one entry of the scenario, as in --set load.gravity=[0,0,-0.5]; may repeat
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,

    /// Where files go [default: out/<name of the scenario>]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: Option<PathBuf>,

    /// Print the result as JSON on standard output and nothing else there
    #[arg(long)]
    pub json: bool,
}

impl Request {
    /// The scenario, and the folder for the files; refused before the run if
    /// nothing could be written there.
    pub fn open(&self) -> Result<(Scenario, PathBuf), Refusal> {
        let scenario = Scenario::read_with(&self.scenario, &self.overrides)?;
        let folder = self.folder(&scenario.name)?;
        Ok((scenario, folder))
    }

    /// The same, but a scenario into which varying numbers can be put.
    pub fn open_base(&self) -> Result<(Base, PathBuf), Refusal> {
        let base = Base::read(&self.scenario, &self.overrides)?;
        let folder = self.folder(&base.scenario().name)?;
        Ok((base, folder))
    }

    fn folder(&self, name: &str) -> Result<PathBuf, Refusal> {
        let folder = match &self.out {
            Some(folder) => folder.clone(),
            None => Path::new("out").join(folder_name(name)),
        };
        files::check_writable(&folder)?;
        Ok(folder)
    }

    /// The scenario with one entry more overridden.
    pub fn with(&self, entry: &str) -> Result<Scenario, Refusal> {
        let overrides = [self.overrides.as_slice(), &[entry.into()]].concat();
        Ok(Scenario::read_with(&self.scenario, &overrides)?)
    }

    /// A remark on a result, beside the JSON that scripts read.
    pub fn remark(&self, scenario: &str, remark: Option<impl Display>) {
        if let (true, Some(remark)) = (self.json, remark) {
            note(&format!("{scenario}: {remark}"));
        }
    }

    /// Writes the files and shows the result: as JSON, or as a report that is
    /// told the folder if there are files in it. What was found is shown even
    /// if the files could not be written. Returns whether it is a success.
    pub fn deliver<R: Written>(
        &self,
        result: &R,
        folder: &Path,
        success: bool,
        report: impl FnOnce(Option<&Path>) -> String,
    ) -> Result<Status, Refusal> {
        let written = files::write_all(folder, result);
        self.show(result, || report(written.is_ok().then_some(folder)))?;
        written?;
        Ok(Status::of(success))
    }

    /// Shows a result: as JSON, or as a report.
    pub fn show<R: Written>(
        &self,
        result: &R,
        report: impl FnOnce() -> String,
    ) -> Result<(), Refusal> {
        match self.json {
            true => {
                let mut json = Vec::new();
                R::FORMATS[0].write(result, &mut json)?;
                show(&json)
            }
            false => show(report().as_bytes()),
        }
    }
}

/// The scenario's name as one folder below `out`, whatever is in it.
fn folder_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_.+ ".contains(c) {
            c
        } else {
            '_'
        }
    };
    let folder: String = name.trim().chars().map(plain).collect();
    match folder.as_str() {
        "" => "leaf".into(),
        _ if folder.starts_with('.') => folder.replacen('.', "_", 1),
        _ => folder,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stay_below_out() {
        for (name, folder) in [
            ("fig04", "fig04"),
            ("../../etc", "_._.._etc"),
            ("..", "_."),
            ("a/b", "a_b"),
            ("", "leaf"),
            ("Blatt 3, süß", "Blatt 3_ süß"),
        ] {
            assert_eq!(folder_name(name), folder);
        }
    }
}
