//! The options common to all verbs, and how a verb runs over its scenarios: one after the other or in
//! parallel, each with a folder, and how the result of each is delivered: files, a report, or JSON.

use crate::files::{FileKind, FileSelection, ResultDocument, WrittenResult};
use crate::report::table::{ScenarioOutput, file_list_text, table_of_json_results};
use crate::report::{RefusalDocument, ReportedResult};
use crate::verbs::exit::{
    ExitStatus, InterruptedRun, Refusal, find_cause, limit_until_interrupt, print_note,
    refusal_with_option_names, report_refusal, show_report, signal_phrase, write_standard_output,
};
use crate::verbs::help::EXPERT_OPTIONS_HEADING;
use crate::verbs::progress::{ProgressLine, completed_fraction};
use crate::{files, live, report};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use leafdyn::memory;
use leafdyn::relax::Limit;
use leafdyn::scenario::{Entries, Scenario, ScenarioError, SourceLocation, printable};
use leafdyn::study::{BaseScenario, BladeOutline, UnknownWord};
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
pub struct ScenarioArguments {
    /// The leaf, as a TOML file, or JSON of a result; - is standard input; of several each has a folder of its own, and all one table
    #[arg(value_name = "SCENARIO", required = true, value_hint = ValueHint::FilePath)]
    scenarios: Vec<PathBuf>,

    /// Wanted accuracy of the centerlines, relative to the largest rod length; in time, of a semi-implicit step; overrides the scenario's
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub tolerance: Option<f64>,

    /// Override one entry of the scenario, as in --set load.gravity=[0,0,-0.5]; may repeat
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,

    /// The outline of the blade or of the section's width: a table of relative widths r at fractions s of the length, from base to tip, with the largest width of the scenario, or WIDTH
    #[arg(long, value_name = "OUTLINE.csv[:WIDTH]", value_hint = ValueHint::FilePath)]
    outline: Option<OutlineFile>,

    /// Where files go [default: out/<name of the scenario>]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: Option<PathBuf>,

    /// Which files to write: some of json, csv, svg, png, html, vtk, glb, surface, gif, or none [default: those of the first four that the verb has]
    #[arg(long, value_name = "LIST", value_parser = parse_file_kinds)]
    write: Option<FileKinds>,

    /// Write K + 1 equally spaced stations of every vein [default: those of the finest grid, at least 17]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=MOST_STATIONS))]
    stations: Option<u32>,

    /// Most memory that the request may take, as in 2GB; what would take more is refused before it starts [default: half of what the machine has]
    #[arg(long, value_name = "SIZE", value_parser = memory::parse, help_heading = EXPERT_OPTIONS_HEADING)]
    memory: Option<u64>,

    /// Print the result as JSON on standard output and nothing else there
    #[arg(long)]
    json: bool,

    /// Say what was tried and what it took: attempts, steps, factorisations, time
    #[arg(long, short)]
    verbose: bool,
}

/// A table with an outline, and the largest width if it is not that of the scenario.
#[derive(Clone, Debug)]
struct OutlineFile {
    path: PathBuf,
    width: Option<f64>,
}

impl FromStr for OutlineFile {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let width = |text: &str| text.trim().parse::<f64>().ok();
        let (path, width) = match text.rsplit_once(':').map(|(path, end)| (path, width(end))) {
            Some((path, Some(width))) => (path, Some(width)),
            _ => (text, None),
        };
        match width {
            Some(width) if !(width > 0.0 && width.is_finite()) => {
                Err("the largest width must be greater than 0")
            }
            _ if path.is_empty() => Err("must name a file"),
            width => Ok(OutlineFile {
                path: path.into(),
                width,
            }),
        }
    }
}

impl OutlineFile {
    /// The override that gives a scenario this outline.
    fn entry(&self, scenario: &Scenario) -> Result<String, Refusal> {
        let file = self.path.display().to_string();
        let outline = BladeOutline::read(&leafdyn::scenario::bytes(&self.path)?, &file)?;
        let entry = outline.entry(scenario, self.width);
        entry.map_err(|why| format!("--outline {file}: {why}").into())
    }
}

/// Most stations that can be requested.
const MOST_STATIONS: i64 = 1_000_000;

/// A list of kinds of files.
#[derive(Clone, Debug)]
struct FileKinds(Vec<FileKind>);

fn parse_file_kinds(list: &str) -> Result<FileKinds, String> {
    if list.trim() == "none" {
        return Ok(FileKinds(Vec::new()));
    }
    let kind = |word: &str| {
        word.trim().parse().map_err(|_| {
            let words = FileKind::ALL.map(FileKind::word).join(", ");
            format!("{word}: must be some of {words}, with commas between them, or none")
        })
    };
    list.split(',')
        .map(kind)
        .collect::<Result<_, _>>()
        .map(FileKinds)
}

/// A parser of options that takes one of these words.
pub fn word_parser<T>(
    words: impl IntoIterator<Item = &'static str>,
) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err = UnknownWord> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words).try_map(|word| word.parse::<T>())
}

/// How a verb treats its scenarios.
#[derive(Clone, Copy, Default)]
pub struct VerbTraits<'f> {
    /// Whether the verb varies numbers of the scenario and settings of methods.
    pub varies_numbers: bool,
    /// Whether the stations in its files can be chosen.
    pub has_station_choice: bool,
    /// Whether scenarios run in parallel; otherwise one after the other, each on all
    /// cores.
    pub runs_in_parallel: bool,
    /// Whether a part of a result, as it is known at a signal, is of use; of several scenarios those
    /// that are finished are.
    pub keeps_partial_result: bool,
    /// Files that it reads besides its scenarios.
    pub input_files: &'f [PathBuf],
    /// The option besides --set that puts values into its scenarios.
    pub value_option: Option<&'f str>,
}

impl ScenarioArguments {
    /// Runs a verb whose results are `R` for every scenario.
    pub fn run_each_scenario<R: WrittenResult>(
        &self,
        traits: VerbTraits,
        run: impl Fn(&ScenarioJob) -> Result<DeliveredResult, Refusal> + Sync,
    ) -> Result<ExitStatus, Refusal> {
        self.memory.into_iter().for_each(memory::allow);
        let selection = self.selected_files::<R>(traits)?;
        self.check_scenarios::<R>(traits, &selection)?;
        let limit = match traits.keeps_partial_result || !self.is_single_scenario() {
            true => limit_until_interrupt(),
            false => Limit::default(),
        };
        let job = |file: &Path| self.open_job::<R>(file, traits, &selection, &limit);
        if let [file] = self.scenarios.as_slice() {
            let done = run_catching_panics(&job(file)?, &run);
            let done = done.map_err(|refusal| self.refusal_with_option(traits, refusal))?;
            match self.json {
                true => write_standard_output(&done.json)?,
                false => show_report(&done.report)?,
            }
            // The JSON output includes an error.
            let refused = done.error.map(|error| report_refusal(&error, false));
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
        let solve = |job: Result<ScenarioJob, Refusal>| {
            let done = job.and_then(|job| {
                if job.is_interrupted() {
                    return Err(InterruptedRun("before this scenario was begun").into());
                }
                run_catching_panics(&job, &run)
                    .map_err(|refusal| self.refusal_with_option(traits, refusal))
            });
            let done = done.map_err(|refusal| {
                let status = ExitStatus::from_refusal(&refusal);
                UnsolvedScenario {
                    refusal: refusal_with_option_names(refusal).to_string(),
                    status,
                }
            });
            let count = 1 + finished.fetch_add(1, Ordering::Relaxed);
            if let (true, Ok(mut line)) = (traits.runs_in_parallel, line.lock()) {
                let all = self.scenarios.len();
                line.update(completed_fraction(count, all), || {
                    format!("{count} of {all}")
                });
            }
            done
        };
        let done: Vec<_> = match traits.runs_in_parallel {
            true => jobs.into_par_iter().map(solve).collect(),
            false => jobs.into_iter().map(solve).collect(),
        };
        self.output_results::<R>(&selection, done)
    }

    /// Names the option that put a refused value into a scenario, if it was not --set.
    fn refusal_with_option(&self, traits: VerbTraits, refusal: Refusal) -> Refusal {
        match (traits.value_option, find_cause(&refusal)) {
            (
                Some(option),
                Some(ScenarioError {
                    place: SourceLocation::Set { given },
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
    fn check_scenarios<R: WrittenResult>(
        &self,
        traits: VerbTraits,
        selection: &FileSelection,
    ) -> Result<(), Refusal> {
        let from_input = self.scenarios.iter().filter(|path| path.as_os_str() == "-");
        if from_input.count() > 1 {
            return Err("standard input can be read only once: name one - and files".into());
        }
        if !self.is_single_scenario() && selection.kinds.contains(&FileKind::Csv) {
            let (folder, name) = (self.table_folder(), Self::table_name::<R>());
            files::check_inputs(folder, &[&name], self.input_files(traits))?;
            if self.out.is_none() {
                files::check_table(&folder.join(name), &self.scenarios)?;
            }
        }
        Ok(())
    }

    /// The scenarios and the other files that the verb reads.
    fn input_files<'f>(&'f self, traits: VerbTraits<'f>) -> impl Iterator<Item = &'f PathBuf> {
        let outline = self.outline.iter().map(|outline| &outline.path);
        (self.scenarios.iter())
            .chain(traits.input_files)
            .chain(outline)
    }

    /// The folder of the table of several scenarios.
    fn table_folder(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new("out"))
    }

    /// The file name of a table of several results.
    fn table_name<R: WrittenResult>() -> String {
        match R::JSON.and_then(|name| name.strip_suffix(".json")) {
            None | Some("summary") => "table.csv".to_string(),
            // A sweep of each of them is a table itself.
            Some("table") => "tables.csv".to_string(),
            Some(verb) => format!("{verb}_table.csv"),
        }
    }

    /// Outputs the results of several scenarios, and writes their table.
    fn output_results<R: WrittenResult>(
        &self,
        selection: &FileSelection,
        all: Vec<Result<DeliveredResult, UnsolvedScenario>>,
    ) -> Result<ExitStatus, Refusal> {
        let mut status = ExitStatus::Success;
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
                Err(UnsolvedScenario { refusal, status }) => {
                    let mut json = Vec::new();
                    let document = RefusalDocument::new(&refusal, status.exit_code());
                    report::write_json(&document, &mut json)?;
                    unsolved += usize::from(status == ExitStatus::Interrupted);
                    let told = (status != ExitStatus::Interrupted).then_some(refusal);
                    (status, told, json)
                }
            };
            status = status.max(this);
            if error.is_some() {
                status = status.max(ExitStatus::Refused);
            }
            errors.extend(error);
            documents.push(ScenarioOutput {
                file: file.display().to_string(),
                exit_status: this.exit_code(),
                json,
            });
        }
        for error in errors {
            print_note(&format!("error: {error}"));
        }
        if unsolved > 0 {
            let count = self.scenarios.len();
            print_note(&format!(
                "{}: {unsolved} of {count} scenarios are not solved",
                signal_phrase()
            ));
        }
        if selection.kinds.contains(&FileKind::Csv) {
            let (out, name) = (self.table_folder(), Self::table_name::<R>());
            let rows = table_of_json_results(&documents)?;
            let file = files::write_table(out, &name, &rows)?;
            if !self.json {
                show_report(&format!("table      {}\n", file_list_text(out, &[file])))?;
            }
        }
        if self.json {
            let texts = documents.iter().map(|output| output.json.trim_ascii());
            let texts: Vec<_> = texts.collect();
            write_standard_output(
                &[b"[\n", texts.join(&b",\n"[..]).as_slice(), b"\n]\n"].concat(),
            )?;
        }
        Ok(status)
    }

    /// The files to write; refused if the verb has no such files.
    fn selected_files<R: WrittenResult>(
        &self,
        traits: VerbTraits,
    ) -> Result<FileSelection, Refusal> {
        let has: Vec<FileKind> = R::file_names().map(FileKind::from_file_name).collect();
        let has = |kind: &FileKind| {
            has.contains(kind) || !self.is_single_scenario() && *kind == FileKind::Csv
        };
        let stations = self.stations.map(|count| count as usize);
        if let (Some(count), false) = (stations, traits.has_station_choice) {
            return Err(format!("--stations {count}: the files of this verb have none").into());
        }
        let kinds = match &self.write {
            Some(FileKinds(kinds)) => kinds.clone(),
            None => FileKind::DEFAULT_KINDS.into_iter().filter(has).collect(),
        };
        if let Some(kind) = kinds.iter().find(|kind| !has(kind)) {
            let all = FileKind::ALL.into_iter().filter(has).map(FileKind::word);
            let (word, all) = (kind.word(), all.collect::<Vec<_>>().join(", "));
            return Err(format!("--write {word}: this verb writes {all}").into());
        }
        Ok(FileSelection { kinds, stations })
    }

    /// Opens a scenario and chooses the folder for its files; refused before the run if
    /// the folder is not writable.
    fn open_job<R: WrittenResult>(
        &self,
        path: &Path,
        traits: VerbTraits,
        selection: &FileSelection,
        limit: &Limit,
    ) -> Result<ScenarioJob, Refusal> {
        let (file, text) = match path.to_str() {
            Some("-") => ("standard input".into(), read_standard_input()?),
            _ => (path.display().to_string(), leafdyn::scenario::text(path)?),
        };
        let entries = Entries::from_text(&text, &file)?;
        let mut base = BaseScenario::new(&entries, &self.overrides, traits.varies_numbers)?;
        if let Some(outline) = &self.outline {
            let own = [outline.entry(base.scenario())?];
            let overrides = [self.overrides.as_slice(), &own].concat();
            base = BaseScenario::new(&entries, &overrides, traits.varies_numbers)?;
        }
        let scenario = base.scenario().clone();
        if let Some(stations) = selection.stations {
            memory::check_station_memory(scenario.rods.len(), stations)?;
        }
        let folder = match &self.out {
            Some(out) if self.is_single_scenario() => out.clone(),
            out => {
                // Names of scenarios are names of folders.
                let out = out.as_deref().unwrap_or(Path::new("out"));
                out.join(&scenario.name)
            }
        };
        let source = match path.to_str() {
            Some("-") => "-".into(),
            _ => files::relative_source_path(&folder, path),
        };
        if !selection.kinds.is_empty() {
            files::check_writable(&folder)?;
            files::check_inputs(
                &folder,
                &R::replaced_files(&selection.kinds),
                self.input_files(traits),
            )?;
            if self.out.is_none() || !self.is_single_scenario() {
                files::check_source(&folder, &source)?;
            }
        }
        Ok(ScenarioJob {
            json: self.json,
            verbose: self.verbose,
            is_only_scenario: self.is_single_scenario(),
            scenario,
            base,
            folder,
            selection: selection.clone(),
            file,
            source,
            runs_in_parallel: traits.runs_in_parallel && !self.is_single_scenario(),
            limit: limit.clone(),
        })
    }

    fn is_single_scenario(&self) -> bool {
        self.scenarios.len() == 1
    }
}

fn read_standard_input() -> Result<String, Refusal> {
    let mut bytes = Vec::new();
    io::stdin()
        .lock()
        .take(leafdyn::scenario::MOST_BYTES + 1)
        .read_to_end(&mut bytes)?;
    Ok(leafdyn::scenario::decode_utf8(bytes, "standard input")?)
}

/// One scenario of a request, and where its files go.
#[derive(Clone)]
pub struct ScenarioJob {
    /// Whether its result is printed as JSON.
    pub(super) json: bool,
    /// Whether the report says what it took.
    pub(super) verbose: bool,
    /// Whether the request names no other scenario.
    pub(super) is_only_scenario: bool,
    pub scenario: Scenario,
    /// The scenario as a base for varied numbers.
    pub base: BaseScenario,
    pub folder: PathBuf,
    pub selection: FileSelection,
    pub(super) file: String,
    pub(super) source: String,
    /// Whether scenarios of the request run in parallel.
    pub(super) runs_in_parallel: bool,
    /// When the run ends with what it has found: at a signal, if that is of use.
    pub limit: Limit,
}

/// The lines that list files, or why these could not be written.
type FileLines = Result<Vec<String>, Refusal>;

/// The delivered result of a scenario.
pub struct DeliveredResult {
    pub(super) status: ExitStatus,
    /// The text for standard output.
    pub(super) report: String,
    /// The result as JSON, if it is printed or part of a table.
    pub(super) json: Vec<u8>,
    /// Why its files could not be written.
    pub(super) error: Option<String>,
}

impl DeliveredResult {
    /// Ends with a status that is at least this one.
    pub fn raise_status(&mut self, status: ExitStatus) {
        self.status = self.status.max(status);
    }
}

/// One of several scenarios without a result: why it was refused, or that the run was stopped.
struct UnsolvedScenario {
    refusal: String,
    status: ExitStatus,
}

/// Runs a verb on a scenario. A panic, which is an error of the program, fails this scenario alone.
fn run_catching_panics(
    job: &ScenarioJob,
    run: impl Fn(&ScenarioJob) -> Result<DeliveredResult, Refusal>,
) -> Result<DeliveredResult, Refusal> {
    // What a panic leaves half done is dropped with the job; files are complete or absent.
    let done = catch_unwind(AssertUnwindSafe(|| run(job)));
    done.unwrap_or_else(|cause| Err(format!("{}: {}", job.file, panic_message(&*cause)).into()))
}

/// What a panic says.
fn panic_message(cause: &(dyn Any + Send)) -> String {
    let text = (cause.downcast_ref::<&str>().copied())
        .or_else(|| cause.downcast_ref::<String>().map(String::as_str));
    let cause = text.unwrap_or("no cause is known");
    format!("an error of the program, not of the scenario, ended the run: {cause}")
}

impl ScenarioJob {
    /// The same job for a scenario with other numbers.
    pub fn with_base(&self, base: BaseScenario) -> ScenarioJob {
        ScenarioJob {
            scenario: base.scenario().clone(),
            base,
            ..self.clone()
        }
    }

    /// The progress line of the scenario; hidden if scenarios run in parallel, which share one.
    pub fn progress_line(&self) -> ProgressLine {
        ProgressLine::new(&self.scenario.name, !self.runs_in_parallel)
    }

    /// Prints a remark on the result to standard error if the output is JSON.
    pub fn print_remark(&self, remark: Option<impl Display>) {
        if let (true, Some(remark)) = (self.json, remark) {
            print_note(&format!("{}: {remark}", self.scenario.name));
        }
    }

    /// Whether a signal has ended the run.
    pub fn is_interrupted(&self) -> bool {
        let cancel = self.limit.cancel.as_ref();
        cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }

    /// A result with its input; of a run that a signal has ended it says so.
    pub fn result_document<'a, R>(&'a self, result: &'a R) -> ResultDocument<'a, R> {
        let mut document = ResultDocument::new(result, &self.scenario, Some(&self.source));
        let status = ExitStatus::Interrupted.exit_code();
        let interrupted = self.is_interrupted();
        document.refused = interrupted.then(|| RefusalDocument::new(signal_phrase(), status));
        document
    }

    /// Writes the files of a result; returns the line that lists them, if there are any.
    pub fn write_files<R: WrittenResult>(&self, result: &R) -> FileLines {
        let files = files::write_result_files(
            &self.folder,
            &self.result_document(result),
            &self.selection.kinds,
        )?;
        Ok(self.list_files(&files))
    }

    /// The live page with its scenario.
    pub fn write_live_page(&self) -> Result<String, Refusal> {
        let given = match self.base.overrides().is_empty() {
            true => Some(self.base.text().to_owned()),
            false => self.base.toml(&[]),
        };
        let name = format!("{}.toml", self.scenario.name);
        let page = live::live_page(&given.unwrap_or_default(), &name, &[]);
        page.map_err(|why| format!("--write live: {why}").into())
    }

    /// Writes a file of this content; returns the line that lists it.
    pub fn write_table(&self, name: &str, content: &[u8]) -> FileLines {
        let file = files::write_table(&self.folder, name, content)?;
        Ok(self.list_files(&[file]))
    }

    /// The line that lists files, if there are any.
    pub fn list_files(&self, files: &[PathBuf]) -> Vec<String> {
        let list = (!files.is_empty()).then(|| file_list_text(&self.folder, files));
        list.into_iter().collect()
    }

    /// Writes the files of a result and returns its output: JSON, or the report.
    pub fn write_and_deliver<R: WrittenResult + ReportedResult>(
        &self,
        result: &R,
        success: bool,
    ) -> Result<DeliveredResult, Refusal> {
        self.deliver_written(result, success, result, [self.write_files(result)])
    }

    /// Returns the output of a result, JSON or a report, with files that are written as they
    /// are listed, up to one that cannot be: the result is output in either case.
    pub fn deliver_written<R: WrittenResult>(
        &self,
        result: &R,
        success: bool,
        report: &impl ReportedResult,
        written: impl IntoIterator<Item = FileLines>,
    ) -> Result<DeliveredResult, Refusal> {
        let (mut files, mut written) = (Vec::new(), written.into_iter());
        let error = written.try_for_each(|list| list.map(|list| files.extend(list)));
        let error = error.err().map(|error| error.to_string());
        let mut json = Vec::new();
        if self.json || !self.is_only_scenario {
            let mut document = self.result_document(result);
            if let Some(error) = &error {
                document.refused = Some(RefusalDocument::new(error, ExitStatus::Refused as i32));
            }
            report::write_json(&document, &mut json)?;
        }
        let report = match self.json {
            true => String::new(),
            false => report.report(&self.scenario.units, files, self.verbose),
        };
        Ok(DeliveredResult {
            status: match self.is_interrupted() {
                true => ExitStatus::Interrupted,
                false => ExitStatus::from_success(success),
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
        request: ScenarioArguments,
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
                runs_in_parallel: parallel,
                ..VerbTraits::default()
            };
            let run = |job: &ScenarioJob| match &*job.scenario.name {
                "first" => panic!("index {} out of bounds", 43),
                _ => job.write_and_deliver(&job.scenario.relax()?, true),
            };
            let status = verb
                .request
                .run_each_scenario::<Equilibrium>(traits, run)
                .unwrap();
            assert_eq!(status, ExitStatus::Refused);
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
