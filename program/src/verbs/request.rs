//! The options common to all verbs, and how a verb runs over its scenarios: folders,
//! files and output.
//!
//! One scenario of a request, and the delivery of its result.

use crate::files::{Document, Kind, Selection, Written};
use crate::report::table::{list_files, rows_of_json};
use crate::report::{Refused, Reported};
use crate::verbs::help::FOR_EXPERTS;
use crate::verbs::progress::{ProgressLine, fraction_of};
use crate::verbs::{
    Interrupted, Refusal, Status, cause, limit_until_interrupt, name_options, note, refuse, show,
    show_report, what_stopped,
};
use crate::{files, live, report};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use leafdyn::memory;
use leafdyn::relax::Limit;
use leafdyn::scenario::{Entries, Place, Scenario, ScenarioError, printable};
use leafdyn::study::{Base, UnknownWord};
use rayon::prelude::*;
use std::any::Any;
use std::collections::HashMap;
use std::fmt::Display;
use std::io;
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    pub overrides: Vec<String>,

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
    #[arg(long, value_name = "SIZE", value_parser = memory::parse, help_heading = FOR_EXPERTS)]
    memory: Option<u64>,

    /// Print the result as JSON on standard output and nothing else there
    #[arg(long)]
    json: bool,

    /// Say what it took: steps, factorisations, time
    #[arg(long, short)]
    verbose: bool,
}

/// Most stations that can be requested.
const MOST_STATIONS: i64 = 1_000_000;

/// A list of kinds of files.
#[derive(Clone, Debug)]
struct Kinds(Vec<Kind>);

fn kinds(list: &str) -> Result<Kinds, String> {
    if list.trim() == "none" {
        return Ok(Kinds(Vec::new()));
    }
    let kind = |word: &str| {
        word.trim().parse().map_err(|_| {
            let words = Kind::ALL.map(Kind::word).join(", ");
            format!("{word}: must be some of {words}, with commas between them, or none")
        })
    };
    list.split(',')
        .map(kind)
        .collect::<Result<_, _>>()
        .map(Kinds)
}

/// Parses one of these words.
pub fn words<T>(words: impl IntoIterator<Item = &'static str>) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err = UnknownWord> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words).try_map(|word| word.parse::<T>())
}

/// How a verb treats its scenarios.
#[derive(Clone, Copy, Default)]
pub struct VerbTraits<'f> {
    /// Whether it varies numbers of the scenario and settings of methods.
    pub varies: bool,
    /// Whether the stations in its files can be chosen.
    pub stations: bool,
    /// Whether scenarios run in parallel; otherwise one after the other, each on all
    /// cores.
    pub parallel: bool,
    /// Whether a part of a result, as it is known at a signal, is of use; of several scenarios those
    /// that are finished are.
    pub partial: bool,
    /// Files that it reads besides its scenarios.
    pub reads: &'f [PathBuf],
    /// The option besides --set that puts values into its scenarios.
    pub puts: Option<&'f str>,
}

impl Request {
    /// Runs a verb whose results are `R` for every scenario.
    pub fn each<R: Written>(
        &self,
        traits: VerbTraits,
        run: impl Fn(&Job) -> Result<Delivered, Refusal> + Sync,
    ) -> Result<Status, Refusal> {
        self.memory.into_iter().for_each(memory::allow);
        let selection = self.selection::<R>(traits)?;
        self.check_scenarios::<R>(traits, &selection)?;
        let limit = match traits.partial || !self.single() {
            true => limit_until_interrupt(),
            false => Limit::default(),
        };
        let job = |file: &Path| self.open::<R>(file, traits, (&selection, &limit));
        if let [file] = self.scenarios.as_slice() {
            let done = attempt(&job(file)?, &run);
            let done = done.map_err(|refusal| self.as_typed(traits, refusal))?;
            match self.json {
                true => show(&done.json)?,
                false => show_report(&done.report)?,
            }
            // The JSON output includes an error.
            let refused = done.error.map(|error| refuse(&error, false));
            return Ok(refused.unwrap_or(done.status));
        }
        // All are checked before the first is solved.
        let jobs: Vec<_> = self.scenarios.iter().map(|file| job(file)).collect();
        let mut folders = HashMap::new();
        for job in jobs.iter().flatten() {
            if let Some(other) = folders.insert(&job.folder, &job.file) {
                let (file, name) = (&job.file, &job.scenario.name);
                let why = "give one of them another name";
                return Err(format!("{other} and {file} are both named {name}: {why}").into());
            }
        }
        let line = Mutex::new(ProgressLine::new("scenarios", true));
        let finished = AtomicUsize::new(0);
        let solve = |job: Result<Job, Refusal>| {
            let done = job.and_then(|job| {
                if job.is_interrupted() {
                    return Err(Interrupted("before this scenario was begun").into());
                }
                attempt(&job, &run).map_err(|refusal| self.as_typed(traits, refusal))
            });
            let done = done.map_err(|refusal| {
                let status = Status::of_refusal(&refusal);
                (name_options(refusal).to_string(), status)
            });
            let count = 1 + finished.fetch_add(1, Ordering::Relaxed);
            if let (true, Ok(mut line)) = (traits.parallel, line.lock()) {
                let all = self.scenarios.len();
                line.update(fraction_of(count, all), || format!("{count} of {all}"));
            }
            done
        };
        let done: Vec<_> = match traits.parallel {
            true => jobs.into_par_iter().map(solve).collect(),
            false => jobs.into_iter().map(solve).collect(),
        };
        self.finish::<R>(&selection, done)
    }

    /// Names the option that put a refused value into a scenario, if it was not --set.
    fn as_typed(&self, traits: VerbTraits, refusal: Refusal) -> Refusal {
        match (traits.puts, cause(&refusal)) {
            (
                Some(option),
                Some(ScenarioError {
                    place: Place::Set { given },
                    problem,
                    ..
                }),
            ) if !self.overrides.contains(given) => {
                printable(&format!("{option}: with {given}: {problem}")).into()
            }
            _ => refusal,
        }
    }

    /// Checks what the scenarios share: standard input, and the table of several.
    fn check_scenarios<R: Written>(
        &self,
        traits: VerbTraits,
        selection: &Selection,
    ) -> Result<(), Refusal> {
        let from_input = self.scenarios.iter().filter(|path| path.as_os_str() == "-");
        if from_input.count() > 1 {
            return Err("standard input can be read only once: name one - and files".into());
        }
        if !self.single() && selection.kinds.contains(&Kind::Csv) {
            let (folder, name) = self.table::<R>();
            files::check_inputs(folder, &[&name], self.inputs(traits))?;
            if self.out.is_none() {
                files::check_table(&folder.join(name), &self.scenarios)?;
            }
        }
        Ok(())
    }

    /// All files that are read.
    fn inputs<'f>(&'f self, traits: VerbTraits<'f>) -> impl Iterator<Item = &'f PathBuf> {
        self.scenarios.iter().chain(traits.reads)
    }

    /// The folder and the name of the table of several scenarios.
    fn table<R: Written>(&self) -> (&Path, String) {
        let name = match R::JSON.and_then(|name| name.strip_suffix(".json")) {
            None | Some("summary") => "table.csv".to_string(),
            Some(verb) => format!("{verb}_table.csv"),
        };
        (self.out.as_deref().unwrap_or(Path::new("out")), name)
    }

    /// Outputs the results of several scenarios, and writes their table.
    fn finish<R: Written>(
        &self,
        selection: &Selection,
        all: Vec<Result<Delivered, (String, Status)>>,
    ) -> Result<Status, Refusal> {
        let mut status = Status::Success;
        let (mut documents, mut errors) = (Vec::new(), Vec::new());
        let mut unsolved = 0;
        for (done, file) in all.into_iter().zip(&self.scenarios) {
            let (this, error, json) = match done {
                Ok(done) => {
                    if !self.json {
                        show_report(&done.report)?;
                    }
                    (done.status, done.error, done.json)
                }
                Err((error, this)) => {
                    let mut json = Vec::new();
                    report::write_json(&Refused::new(&error, this.code()), &mut json)?;
                    unsolved += usize::from(this == Status::Interrupted);
                    let told = (this != Status::Interrupted).then_some(error);
                    (this, told, json)
                }
            };
            status = status.max(this);
            if error.is_some() {
                status = status.max(Status::Refused);
            }
            errors.extend(error);
            documents.push((file.display().to_string(), this.code(), json));
        }
        for error in errors {
            note(&format!("error: {error}"));
        }
        if unsolved > 0 {
            let count = self.scenarios.len();
            note(&format!(
                "{}: {unsolved} of {count} scenarios are not solved",
                what_stopped()
            ));
        }
        if selection.kinds.contains(&Kind::Csv) {
            let (out, name) = self.table::<R>();
            let rows = rows_of_json(&documents)?;
            let file = files::write_table(out, &name, &rows)?;
            if !self.json {
                show_report(&format!("table      {}\n", list_files(out, &[file])))?;
            }
        }
        if self.json {
            let texts = documents.iter().map(|(_, _, json)| json.trim_ascii());
            let texts: Vec<_> = texts.collect();
            show(&[b"[\n", texts.join(&b",\n"[..]).as_slice(), b"\n]\n"].concat())?;
        }
        Ok(status)
    }

    /// The files to write; refused if the verb has no such files.
    fn selection<R: Written>(&self, traits: VerbTraits) -> Result<Selection, Refusal> {
        let has: Vec<Kind> = R::names().map(Kind::of).collect();
        let has = |kind: &Kind| has.contains(kind) || !self.single() && *kind == Kind::Csv;
        let stations = self.stations.map(|count| count as usize);
        if let (Some(count), false) = (stations, traits.stations) {
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

    /// Opens a scenario and chooses the folder for its files; refused before the run if
    /// the folder is not writable.
    fn open<R: Written>(
        &self,
        path: &Path,
        traits: VerbTraits,
        (selection, limit): (&Selection, &Limit),
    ) -> Result<Job, Refusal> {
        let (file, text) = match path.to_str() {
            Some("-") => ("standard input".into(), standard_input()?),
            _ => (path.display().to_string(), leafdyn::scenario::text(path)?),
        };
        let base = Base::new(
            &Entries::of_text(&text, &file)?,
            &self.overrides,
            traits.varies,
        )?;
        let scenario = base.scenario().clone();
        if let Some(stations) = selection.stations {
            memory::stations(scenario.rods.len(), stations)?;
        }
        let folder = match &self.out {
            Some(out) if self.single() => out.clone(),
            out => {
                // Names of scenarios are names of folders.
                let out = out.as_deref().unwrap_or(Path::new("out"));
                out.join(&scenario.name)
            }
        };
        let source = match path.to_str() {
            Some("-") => "-".into(),
            _ => files::source(&folder, path),
        };
        if !selection.kinds.is_empty() {
            files::check_writable(&folder)?;
            files::check_inputs(&folder, &R::replaced(&selection.kinds), self.inputs(traits))?;
            if self.out.is_none() || !self.single() {
                files::check_source(&folder, &source)?;
            }
        }
        Ok(Job {
            json: self.json,
            verbose: self.verbose,
            single: self.single(),
            scenario,
            base,
            folder,
            selection: selection.clone(),
            file,
            source,
            parallel: traits.parallel && !self.single(),
            limit: limit.clone(),
        })
    }

    /// Whether it is about one scenario only.
    fn single(&self) -> bool {
        self.scenarios.len() == 1
    }
}

fn standard_input() -> Result<String, Refusal> {
    let mut bytes = Vec::new();
    io::stdin()
        .lock()
        .take(leafdyn::scenario::MOST_BYTES + 1)
        .read_to_end(&mut bytes)?;
    Ok(leafdyn::scenario::utf8(bytes, "standard input")?)
}

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
            report::write_json(&document, &mut json)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use leafdyn::relax::Equilibrium;
    use std::fs;

    #[derive(Parser)]
    struct Verb {
        #[command(flatten)]
        request: Request,
    }

    /// Whichever of several scenarios ends in a panic, the table has a row for each.
    #[test]
    fn a_panic_fails_its_scenario_alone() {
        const LEAF: &str = include_str!("../../../scenarios/paper/fig13.toml");
        for parallel in [true, false] {
            let folder = tempfile::tempdir().unwrap();
            let file = |name: &str| folder.path().join(format!("{name}.toml"));
            let (names, out) = (["first", "second", "third"], folder.path().join("out"));
            let mut arguments = vec!["relax".into(), "--write".into(), "csv".into()];
            arguments.extend(["--out".into(), out.clone().into_os_string()]);
            for name in names {
                fs::write(file(name), LEAF.replace("fig13", name)).unwrap();
                arguments.push(file(name).into_os_string());
            }
            let verb = Verb::try_parse_from(arguments).unwrap();
            let traits = VerbTraits {
                parallel,
                ..VerbTraits::default()
            };
            let run = |job: &Job| match &*job.scenario.name {
                "first" => panic!("index {} out of bounds", 43),
                _ => job.deliver(&job.scenario.relax()?, true),
            };
            let status = verb.request.each::<Equilibrium>(traits, run).unwrap();
            assert_eq!(status, Status::Refused);
            let table = fs::read_to_string(out.join("table.csv")).unwrap();
            let rows: Vec<&str> = table.lines().skip(1).collect();
            assert_eq!(rows.len(), names.len(), "{table}");
            assert!(rows[0].contains("index 43 out of bounds"), "{table}");
            for (row, status) in rows.iter().zip([",2,", ",0,", ",0,"]) {
                assert!(row.contains(status), "{table}");
            }
        }
    }
}
