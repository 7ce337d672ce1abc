//! What every verb is asked and how it delivers: scenarios, folders, files and
//! what is shown.

use std::collections::HashMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Args, ValueHint};
use rayon::prelude::*;

use crate::files::{self, Kind, Selection};
use crate::memory;
use crate::report::table::{named, rows_of_json};
use crate::report::{Refused, Written, json};
use crate::scenario::Scenario;
use crate::study::Base;

pub use super::job::{Done, Job};
use super::progress::{ProgressLine, part_of, time_left};
use super::{Refusal, Status, as_typed, fail, note, show, show_report};

/// What every verb is asked.
#[derive(Debug, Args)]
pub struct Request {
    /// The leaf, as a TOML file, or JSON of a result; - is standard input; of several each has a folder of its own, and all one table
    #[arg(value_name = "SCENARIO", required = true, value_hint = ValueHint::FilePath)]
    scenarios: Vec<PathBuf>,

    /// Wanted accuracy of the centerlines, relative to the largest rod length; in time, of a semi-implicit step; overrides the scenario's
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub tolerance: Option<f64>,

    /// Override one entry of the scenario, as in --set load.gravity=[0,0,-0.5]; may repeat
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,

    /// Where files go [default: out/<name of the scenario>]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: Option<PathBuf>,

    /// Which files to write: some of json, csv, svg, png, html, vtk, glb, gif, or none [default: those of the first four that the verb has]
    #[arg(long, value_name = "LIST", value_parser = kinds)]
    write: Option<Kinds>,

    /// Write K + 1 equally spaced stations of every vein [default: those of the finest grid, at least 17]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=MOST_STATIONS))]
    stations: Option<u32>,

    /// Most memory that the request may take, as in 2GB; what would take more is refused before it starts [default: half of what the machine has]
    #[arg(long, value_name = "SIZE", value_parser = memory::parse)]
    memory: Option<u64>,

    /// Print the result as JSON on standard output and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Most stations that can be asked for.
const MOST_STATIONS: i64 = 1_000_000;

/// A list of kinds of files.
#[derive(Clone, Debug)]
struct Kinds(Vec<Kind>);

fn kinds(list: &str) -> Result<Kinds, String> {
    if list.trim() == "none" {
        return Ok(Kinds(Vec::new()));
    }
    let kind = |word: &str| {
        let found = Kind::ALL
            .into_iter()
            .find(|kind| kind.word() == word.trim());
        found.ok_or_else(|| {
            let words = Kind::ALL.map(Kind::word).join(", ");
            format!("{word}: must be some of {words}, with commas between them, or none")
        })
    };
    list.split(',')
        .map(kind)
        .collect::<Result<_, _>>()
        .map(Kinds)
}

/// What a verb does with scenarios.
#[derive(Clone, Copy)]
pub struct How {
    /// Whether numbers are put into the scenario, and settings of methods.
    pub varies: bool,
    /// Whether its files have stations that can be chosen.
    pub stations: bool,
    /// Whether leaves are solved side by side; otherwise one after the other, each
    /// on all cores.
    pub side_by_side: bool,
}

impl Request {
    /// Does what a verb does, whose results are `R`, for every scenario.
    pub fn each<R: Written>(
        &self,
        how: How,
        run: impl Fn(&Job) -> Result<Done, Refusal> + Sync,
    ) -> Result<Status, Refusal> {
        self.memory.into_iter().for_each(memory::allow);
        let selection = self.selection::<R>(how)?;
        let job = |file: &Path| self.open(file, how, &selection);
        if let [file] = self.scenarios.as_slice() {
            let done = run(&job(file)?)?;
            self.show(&done)?;
            return match done.error {
                // It is part of the JSON that was shown.
                Some(error) => Ok(fail(&error, Status::Refused, false)),
                None => Ok(done.status),
            };
        }
        // All are looked at before the first is solved.
        let jobs: Vec<_> = self.scenarios.iter().map(|file| job(file)).collect();
        let mut folders = HashMap::new();
        for job in jobs.iter().flatten() {
            if let Some(other) = folders.insert(&job.folder, &job.file) {
                let (file, name) = (&job.file, &job.scenario.name);
                let why = "give one of them another name";
                return Err(format!("{other} and {file} are both named {name}: {why}").into());
            }
        }
        let mut line = ProgressLine::new("scenarios");
        let line = std::sync::Mutex::new(&mut line);
        let finished = AtomicUsize::new(0);
        let solve = |job: Result<Job, Refusal>| {
            let done = job.and_then(|job| run(&job));
            let done = done.map_err(|refusal| as_typed(refusal).to_string());
            let count = 1 + finished.fetch_add(1, Ordering::Relaxed);
            if let (true, Ok(mut line)) = (how.side_by_side, line.lock()) {
                let all = self.scenarios.len();
                line.say(|time| {
                    format!("{count} of {all}, {}", time_left(time, part_of(count, all)))
                });
            }
            done
        };
        let done: Vec<_> = match how.side_by_side {
            true => jobs.into_par_iter().map(solve).collect(),
            false => jobs.into_iter().map(solve).collect(),
        };
        self.finish::<R>(&selection, done)
    }

    /// Shows what was done about several scenarios, and writes the table.
    fn finish<R: Written>(
        &self,
        selection: &Selection,
        all: Vec<Result<Done, String>>,
    ) -> Result<Status, Refusal> {
        let mut status = Status::Success;
        let (mut documents, mut errors) = (Vec::new(), Vec::new());
        for (done, file) in all.into_iter().zip(&self.scenarios) {
            let (this, error, json) = match done {
                Ok(done) => {
                    if !self.json {
                        show_report(&done.report)?;
                    }
                    (done.status, done.error, done.json)
                }
                Err(error) => {
                    let mut json = Vec::new();
                    json::write(&Refused::new(&error), &mut json)?;
                    (Status::Refused, Some(error), json)
                }
            };
            let refused = error.is_some();
            errors.extend(error);
            status = status.max(if refused { Status::Refused } else { this });
            documents.push((file.display().to_string(), this as i32, json));
        }
        for error in errors {
            note(&format!("error: {error}"));
        }
        let out = self.out.clone().unwrap_or("out".into());
        if selection.kinds.contains(&Kind::Csv) {
            let name = match R::JSON.and_then(|name| name.strip_suffix(".json")) {
                None | Some("summary") => "table.csv".to_string(),
                Some(verb) => format!("{verb}_table.csv"),
            };
            let rows = rows_of_json(&documents)?;
            let file = files::write_table(&out, &name, &rows)?;
            if !self.json {
                show_report(&format!("table      {}\n", named(&out, &[file])))?;
            }
        }
        if self.json {
            let texts: Vec<_> = documents
                .iter()
                .map(|(_, _, json)| json.trim_ascii())
                .collect();
            show(&[b"[\n", texts.join(&b",\n"[..]).as_slice(), b"\n]\n"].concat())?;
        }
        Ok(status)
    }

    /// What is written; refused if the verb has none of it.
    fn selection<R: Written>(&self, how: How) -> Result<Selection, Refusal> {
        let has = R::kinds();
        let has =
            |kind: &Kind| has.contains(kind) || self.scenarios.len() > 1 && *kind == Kind::Csv;
        let stations = self.stations.map(|count| count as usize);
        if let (Some(count), false) = (stations, how.stations) {
            return Err(format!("--stations {count}: the files of this verb have none").into());
        }
        let kinds = match &self.write {
            Some(Kinds(kinds)) => kinds.clone(),
            None => Kind::USUAL.into_iter().filter(has).collect(),
        };
        if let Some(kind) = kinds.iter().find(|kind| !has(kind)) {
            let all = Kind::ALL.into_iter().filter(has).map(Kind::word);
            let (word, all) = (kind.word(), all.collect::<Vec<_>>().join(", "));
            return Err(format!("--write {word}: this verb writes {all}").into());
        }
        Ok(Selection { kinds, stations })
    }

    /// A scenario, and the folder for its files; refused before the run if
    /// nothing could be written there.
    fn open(&self, path: &Path, how: How, selection: &Selection) -> Result<Job<'_>, Refusal> {
        let (file, text) = match path.to_str() {
            Some("-") => ("standard input".into(), standard_input()?),
            _ => (path.display().to_string(), crate::scenario::text(path)?),
        };
        let base = match how.varies {
            true => Some(Base::of_text(text.clone(), file.clone(), &self.overrides)?),
            false => None,
        };
        let scenario = match &base {
            Some(base) => base.scenario().clone(),
            None => Scenario::from_toml_with(&text, &file, &self.overrides)?,
        };
        let alone = self.scenarios.len() == 1;
        let folder = match &self.out {
            Some(out) if alone => out.clone(),
            out => {
                let out = out.as_deref().unwrap_or(Path::new("out"));
                out.join(folder_name(&scenario.name))
            }
        };
        let source = match path.to_str() {
            Some("-") => "-".into(),
            _ => files::source(&folder, path),
        };
        if !selection.kinds.is_empty() {
            files::check_writable(&folder)?;
            if self.out.is_none() || !alone {
                files::check_owner(&folder, &source)?;
            }
        }
        Ok(Job {
            overrides: &self.overrides,
            json: self.json,
            scenario,
            base,
            folder,
            selection: selection.clone(),
            text,
            file,
            source,
            alone,
            side_by_side: how.side_by_side && !alone,
        })
    }

    fn show(&self, done: &Done) -> Result<(), Refusal> {
        match self.json {
            true => show(&done.json),
            false => show_report(&done.report),
        }
    }
}

/// A scenario on standard input.
fn standard_input() -> Result<String, Refusal> {
    let mut bytes = Vec::new();
    io::stdin()
        .lock()
        .take(crate::scenario::MOST_BYTES + 1)
        .read_to_end(&mut bytes)?;
    Ok(crate::scenario::utf8(bytes, "standard input")?)
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
