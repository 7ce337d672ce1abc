//! `leafdyn relax`: brings a leaf to rest.

use crate::files::{FileKind, LIVE_PAGE_FILE};
use crate::report::numbers::format_five_digits;
use crate::report::{ReportedSweep, doubt_with_option, row_status};
use crate::verbs::exit::{ExitStatus, InterruptedRun, Refusal, print_note};
use crate::verbs::help::EXPERT_OPTIONS_HEADING;
use crate::verbs::progress::{ProgressLine, completed_fraction};
use crate::verbs::request::{
    DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits, word_parser,
};
use crate::verbs::unbend::ShapeTableArguments;
use clap::{Args, ValueHint};
use leafdyn::relax::{Equilibrium, Method, Options, Outcome, Progress, Route, Settings};
use leafdyn::scenario::bytes;
use leafdyn::study;
use leafdyn::study::{
    ColumnKind, DEFAULT_VEINS_TOLERANCE, Equilibria, LeafColumn, LeafQuantity, MarginError,
    MarginProgress, ParameterKeys, ParameterSweep, RefinedBlade, SensitivityError, Sweep,
    SweepRequest, UnbendError, VaryError, VeinsError, read_postures, relax_from_points,
};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// Eigenvalues that are reported by default.
const DEFAULT_MODES: usize = 3;

/// Find how a leaf comes to rest, how accurate that is and whether it is stable.
///
/// Exit status: 0 at rest within the tolerance; 1 not (the files are still
/// written and say how far it came); 2 the request was refused.
#[derive(Debug, Args)]
pub struct RelaxArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// How the leaf is brought to rest
    #[arg(long, value_name = "NAME", value_parser = word_parser::<Method>(Method::ALL.map(Method::word)), default_value_t)]
    method: Method,

    /// One fixed grid of N segments a rod, without extrapolation; left out: as fine as the tolerance needs
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// With --method shooting: shoot over N intervals; 1 is single shooting; left out: as many as the growth of perturbations needs
    #[arg(long, value_name = "N", help_heading = EXPERT_OPTIONS_HEADING)]
    intervals: Option<usize>,

    /// Which equilibrium, where there are several: that of a leaf which is loaded slowly before its tips are brought together, or of one released from arcs under all of its loads
    #[arg(long, value_name = "NAME", value_parser = word_parser::<Route>(Route::ALL.map(Route::word)), default_value_t)]
    path: Route,

    /// Stop at a saddle instead of leaving it for a stable equilibrium
    #[arg(long)]
    keep_unstable: bool,

    /// Write and draw the K lowest modes of the leaf at rest; left out: the eigenvalues of 3 are told, unless the leaf is large; 0: none
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    modes: Option<usize>,

    /// Look for all equilibria, from many starts, and list them by energy
    #[arg(long, conflicts_with_all = ["keep_unstable", "modes", "segments"])]
    all: bool,

    /// Also find how the tip, the energy and the lowest eigenvalue change with these numbers of the scenario; all: with every one that it gives
    #[arg(
        long,
        value_name = "KEY,...",
        value_delimiter = ',',
        value_parser = parse_sensitivity,
        conflicts_with = "all"
    )]
    sensitivity: Vec<SensitivityChoice>,

    /// Also find how far a stable leaf is from losing its stability: which push at the tip unseats it, and the lowest barrier to another equilibrium
    #[arg(long, conflicts_with_all = ["all", "sensitivity"])]
    margin: bool,

    /// With so many veins, as --set leaf.rods=N; auto: a blade with as many as bring its error in veins below T times its largest displacement
    #[arg(
        long,
        value_name = "N|auto[:T]",
        value_parser = parse_veins,
    )]
    veins: Option<VeinsChoice>,

    /// Find the equilibrium nearest to a shape: points of the vein's centreline from base to tip as CSV, as of unbend; of any index with --keep-unstable
    #[arg(long, value_name = "SHAPE.csv", value_hint = ValueHint::FilePath, conflicts_with_all = ["all", "sensitivity", "margin", "veins"])]
    start: Option<PathBuf>,

    #[command(flatten)]
    start_table: ShapeTableArguments,

    /// Solve for the whole leaf, even if half of it would do
    #[arg(long, help_heading = EXPERT_OPTIONS_HEADING)]
    full_model: bool,

    /// A table of leaves in place of one: a row for every value of a number of the scenario as in --set, an entry of a list counted from 0 (load.gravity[2]), or method.segments; may repeat, for all combinations; several keys that vary together are joined by +
    #[arg(long, value_name = "KEY=FROM..TO[:COUNT][log]", conflicts_with_all = ["all", "margin", "sensitivity", "start"])]
    vary: Vec<ParameterSweep>,

    /// With --vary: what the figure shows, a panel each: columns of the table as tip_z, frequency_1, peak_stress; left out: the coordinate of the tip that varies most
    #[arg(long, value_name = "LIST", value_delimiter = ',', requires = "vary")]
    show: Vec<LeafQuantity>,
}

/// How many veins a leaf is relaxed with in place of those of the scenario.
#[derive(Clone, Copy, Debug)]
enum VeinsChoice {
    Number(usize),
    /// As many as an error in veins needs, a fraction of the largest displacement.
    Refined(f64),
}

fn parse_veins(text: &str) -> Result<VeinsChoice, String> {
    let refused =
        || format!("{text}: must be a number of veins, or auto, or auto:T as in auto:1e-3");
    let Some(tolerance) = text.strip_prefix("auto") else {
        let number = text.parse().ok().filter(|number| *number > 0);
        return number.map(VeinsChoice::Number).ok_or_else(refused);
    };
    let tolerance = match tolerance.strip_prefix(':') {
        Some(tolerance) => tolerance.parse().map_err(|_| refused())?,
        None if tolerance.is_empty() => DEFAULT_VEINS_TOLERANCE,
        None => return Err(refused()),
    };
    Ok(VeinsChoice::Refined(tolerance))
}

/// With respect to which numbers a leaf is differentiated.
#[derive(Clone, Debug)]
enum SensitivityChoice {
    /// Every one that the scenario gives.
    Every,
    These(ParameterKeys),
}

fn parse_sensitivity(text: &str) -> Result<SensitivityChoice, VaryError> {
    match text.trim() {
        "all" => Ok(SensitivityChoice::Every),
        text => ParameterKeys::parse_with_lists(text).map(SensitivityChoice::These),
    }
}

fn update_margin_progress(line: &mut ProgressLine, progress: &MarginProgress, tolerance: f64) {
    match progress {
        MarginProgress::Relaxing(progress) => line.update_solver(progress, tolerance),
        MarginProgress::Searching { done, all, push } => {
            line.update(completed_fraction(*done, *all), || {
                let push = push.map(|(direction, force)| {
                    format!(
                        ", pushed by {} along {direction}",
                        format_five_digits(force)
                    )
                });
                format!("{done} of {all} searches{}", push.unwrap_or_default())
            });
        }
    }
}

/// The equilibrium nearest to the shape in a file.
fn relax_from_shape(
    job: &ScenarioJob,
    (path, table): (&Path, &ShapeTableArguments),
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, Refusal> {
    let file = path.display().to_string();
    let read = read_postures(&bytes(path)?, &file, &table.options(None), &job.scenario)?;
    let Some(shape) = read.into_iter().next() else {
        return Err(format!("--start {file}: has no points").into());
    };
    if let Some(taken) = shape.taken {
        print_note(&format!("{}: {taken}", job.scenario.name));
    }
    let found = relax_from_points(&job.scenario, &shape.points, options, progress);
    found.map_err(|error| match error {
        UnbendError::Relax(error) => error.into(),
        error => format!("--start {file}: {error}").into(),
    })
}

impl RelaxArguments {
    pub fn run(mut self) -> Result<ExitStatus, Refusal> {
        if self.start.is_none() && self.start_table.any_given() {
            return Err("--format, --column: say how the points of --start are read: give --start SHAPE.csv".into());
        }
        match self.veins {
            Some(VeinsChoice::Number(veins)) => {
                self.request.overrides.push(format!("leaf.rods={veins}"));
            }
            Some(VeinsChoice::Refined(_))
                if self.all || self.margin || !self.sensitivity.is_empty() =>
            {
                let why = "not with --all, --margin or --sensitivity: ask for these with the number that it finds";
                return Err(format!("--veins auto: {why}").into());
            }
            _ => {}
        }
        if !self.vary.is_empty() {
            return self.run_sweeps();
        }
        let start: Vec<PathBuf> = self.start.iter().cloned().collect();
        let traits = VerbTraits {
            varies_numbers: !self.sensitivity.is_empty(),
            has_station_choice: true,
            runs_in_parallel: true,
            keeps_partial_result: self.all || self.margin,
            input_files: &start,
            value_option: None,
        };
        match self.all {
            true => self
                .request
                .run_each_scenario::<Equilibria>(traits, |job| self.find_all_equilibria(job)),
            false => (self.request)
                .run_each_scenario::<Equilibrium>(traits, |job| self.run_scenario(job)),
        }
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let is_live = job.selection.kinds.contains(&FileKind::Live);
        let live_page = |job: &ScenarioJob| is_live.then(|| job.write_live_page()).transpose();
        let mut live = live_page(job)?;
        let refined;
        let (job, equilibrium) = match self.veins {
            Some(VeinsChoice::Refined(tolerance)) => {
                let RefinedBlade { base, leaf } = self.refine_blade(job, tolerance)?;
                refined = job.with_base(base);
                live = live_page(&refined)?;
                (&refined, leaf)
            }
            _ => (job, self.solve_equilibrium(job)?),
        };
        if job.is_interrupted() && !equilibrium.outcome.is_at_rest() {
            return Err(InterruptedRun("the leaf is not at rest").into());
        }
        let equilibrium = equilibrium.at_stations(&job.scenario, job.selection.stations);
        job.print_remark(equilibrium.remark.as_ref());
        for doubt in &equilibrium.doubts {
            job.print_remark(Some(doubt_with_option(doubt)));
        }
        let accepts_saddles = self.keep_unstable || equilibrium.method.is_shooting();
        let unwanted = equilibrium.outcome == Outcome::Saddle && !accepts_saddles;
        let success = equilibrium.outcome.is_success() && !unwanted;
        let live = live.map(|page| job.write_table(LIVE_PAGE_FILE, page.as_bytes()));
        let written = [job.write_files(&equilibrium)].into_iter().chain(live);
        job.deliver_written(&equilibrium, success, &equilibrium, written)
    }

    /// Relaxes the leaves over a grid of numbers of every scenario.
    fn run_sweeps(&self) -> Result<ExitStatus, Refusal> {
        if let Some(VeinsChoice::Refined(_)) = self.veins {
            let why = "not with --vary: vary leaf.rods";
            return Err(format!("--veins auto: {why}").into());
        }
        let is_number =
            |show: &&LeafQuantity| matches!(show.kind(), ColumnKind::Number | ColumnKind::Count);
        if let Some(show) = self.show.iter().find(|show| !is_number(show)) {
            return Err(format!("--show {show}: is no number, of which a figure is made").into());
        }
        let traits = VerbTraits {
            varies_numbers: true,
            value_option: Some("--vary"),
            keeps_partial_result: true,
            ..VerbTraits::default()
        };
        (self.request).run_each_scenario::<Sweep>(traits, |job| self.sweep_scenario(job))
    }

    fn sweep_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let method = self.method_with_options()?;
        let options = Options {
            modes: match self.modes {
                None if method.is_shooting() => 0,
                asked => asked.unwrap_or(DEFAULT_MODES),
            },
            mode_shapes: !method.is_shooting() || self.modes.is_some_and(|count| count > 0),
            ..self.options(job)?
        };
        let mut request = SweepRequest::new(job.base.clone(), self.vary.clone(), options)?;
        for &quantity in &self.show {
            let is_there = |column: &LeafColumn| column.quantity == quantity;
            if !request.columns.iter().any(is_there) {
                if quantity.modes() > request.options.modes {
                    let modes = quantity.modes();
                    return Err(format!("--show {quantity}: ask for it by --modes {modes}").into());
                }
                request.columns.extend(LeafColumn::with_errors(&[quantity]));
            }
        }
        let (all, clock) = (request.leaves(), Instant::now());
        let line = Mutex::new(job.progress_line());
        let mut sweep = study::sweep(request, &|done| {
            if let Ok(mut line) = line.lock() {
                line.update(completed_fraction(done, all), || {
                    format!("{done} of {all} leaves")
                });
            }
        });
        drop(line);
        if job.is_interrupted() && sweep.rows.is_empty() {
            return Err(InterruptedRun("no leaf was finished").into());
        }
        sweep.show.clone_from(&self.show);
        let reported = ReportedSweep {
            sweep: &sweep,
            seconds: clock.elapsed().as_secs_f64(),
        };
        let status = sweep.rows.iter().map(row_status).max();
        let written = [job.write_files(&sweep)];
        let mut delivered = job.deliver_written(&sweep, true, &reported, written)?;
        delivered.raise_status(ExitStatus::of_leaf(status.unwrap_or_default()));
        Ok(delivered)
    }

    /// The method with its options; refused if they do not fit the method.
    fn method_with_options(&self) -> Result<Method, Refusal> {
        let settings = Settings {
            segments: self.segments,
            intervals: self.intervals,
            keep_unstable: self.keep_unstable,
            full_model: self.full_model,
            route: self.path,
        };
        self.method.with(settings).map_err(|unfit| {
            let value = unfit.value.map(|value| format!(" {value}"));
            let flag = unfit.setting.replace('_', "-");
            format!("--{flag}{}: {}", value.unwrap_or_default(), unfit.why).into()
        })
    }

    fn options(&self, job: &ScenarioJob) -> Result<Options, Refusal> {
        Ok(Options {
            method: self.method_with_options()?,
            route: self.path,
            tolerance: self.request.tolerance,
            modes: self.modes.unwrap_or(DEFAULT_MODES),
            mode_shapes: self.modes.is_some_and(|count| count > 0),
            every_node: true,
            limit: job.limit.clone(),
            stations: job.selection.stations,
            ..Options::default()
        })
    }

    /// A blade with as many veins as its accuracy needs.
    fn refine_blade(&self, job: &ScenarioJob, tolerance: f64) -> Result<RefinedBlade, Refusal> {
        let options = self.options(job)?;
        let mut line = job.progress_line();
        let wanted = self.request.tolerance.unwrap_or(job.scenario.tolerance);
        let refined = study::refine_veins(&job.base, tolerance, &options, &mut |progress| {
            line.update_solver(progress, wanted)
        });
        refined.map_err(|error| match error {
            VeinsError::Relax(error) => error.into(),
            error => format!("--veins auto: {error}").into(),
        })
    }

    /// The leaf at rest, a blade with its error in veins.
    fn solve_equilibrium(&self, job: &ScenarioJob) -> Result<Equilibrium, Refusal> {
        let options = self.options(job)?;
        let mut leaf = self.relax_with_questions(job, &options)?;
        study::estimate_error_in_veins(&job.base, &mut leaf, &options);
        Ok(leaf)
    }

    /// The leaf at rest, with what else is asked of it.
    fn relax_with_questions(
        &self,
        job: &ScenarioJob,
        options: &Options,
    ) -> Result<Equilibrium, Refusal> {
        let mut line = job.progress_line();
        let tolerance = self.request.tolerance.unwrap_or(job.scenario.tolerance);
        if !self.sensitivity.is_empty() {
            let base = &job.base;
            let keys: Vec<ParameterKeys> = (self.sensitivity.iter())
                .flat_map(|choice| match choice {
                    SensitivityChoice::Every => base.differentiable_numbers(),
                    SensitivityChoice::These(keys) => vec![keys.clone()],
                })
                .collect();
            let found = study::relax_with_sensitivities(base, &keys, options, &mut |progress| {
                line.update_solver(progress, tolerance);
            });
            return found.map_err(|error| match error {
                SensitivityError::Relax(error) => error.into(),
                error => format!("--sensitivity {error}").into(),
            });
        }
        if self.margin {
            let mut searching = false;
            let found = study::relax_with_margin(&job.scenario, options, &mut |progress| {
                if let (false, MarginProgress::Searching { .. }) = (searching, progress) {
                    searching = true;
                    line.next_phase();
                }
                update_margin_progress(&mut line, progress, tolerance);
            });
            return found.map_err(|error| match error {
                MarginError::Relax(error) => error.into(),
                error => format!("--margin: {error}").into(),
            });
        }
        if let Some(file) = &self.start {
            return relax_from_shape(job, (file, &self.start_table), options, &mut |progress| {
                line.update_solver(progress, tolerance)
            });
        }
        Ok(study::relax_blade(&job.base, options, &mut |progress| {
            line.update_solver(progress, tolerance)
        })?)
    }

    fn find_all_equilibria(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let Some(how) = self.method_with_options()?.semi_implicit() else {
            return Err("--all: only with the method semi-implicit".into());
        };
        let mut line = job.progress_line();
        let (mut known, mut last_new) = (0, 0);
        let mut all = study::equilibria(
            &job.scenario,
            how,
            self.request.tolerance,
            &job.limit,
            &mut |starts, found| {
                if found > known {
                    (known, last_new) = (found, starts);
                }
                // Assuming that no more are found.
                let fraction = completed_fraction(starts, last_new + study::MOST_FRUITLESS_STARTS);
                line.update(fraction, || format!("{starts} starts, {found} equilibria"));
            },
        )?;
        drop(line);
        if job.is_interrupted() && all.found.is_empty() {
            return Err(InterruptedRun("no equilibrium was found").into());
        }
        for found in &mut all.found {
            let leaf = found.equilibrium.clone();
            found.equilibrium = leaf.at_stations(&job.scenario, job.selection.stations);
        }
        job.write_and_deliver(&all, !all.found.is_empty())
    }
}
