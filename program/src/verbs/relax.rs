//! `leafdyn relax`: brings a leaf to rest.

use crate::files::{Kind, LIVE};
use crate::report::numbers::brief;
use crate::verbs::help::FOR_EXPERTS;
use crate::verbs::progress::{ProgressLine, fraction_of};
use crate::verbs::request::{Delivered, Job, Request, VerbTraits, words};
use crate::verbs::{Interrupted, Refusal, Status};
use clap::Args;
use leafdyn::relax::{Equilibrium, Method, Options, Outcome, Route, Settings};
use leafdyn::study;
use leafdyn::study::{Equilibria, Keys, MarginError, MarginProgress, SensitivityError};

/// Eigenvalues that are reported by default.
const DEFAULT_MODES: usize = 3;

/// Find how a leaf comes to rest, how accurate that is and whether it is stable.
///
/// Exit status: 0 at rest within the tolerance; 1 not (the files are still
/// written and say how far it came); 2 the request was refused.
#[derive(Debug, Args)]
pub struct Relax {
    #[command(flatten)]
    request: Request,

    /// How the leaf is brought to rest
    #[arg(long, value_name = "NAME", value_parser = words::<Method>(Method::ALL.map(Method::word)), default_value_t)]
    method: Method,

    /// One fixed grid of N segments a rod, without extrapolation; left out: as fine as the tolerance needs
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// With --method shooting: shoot over N intervals; 1 is single shooting; left out: as many as the growth of perturbations needs
    #[arg(long, value_name = "N", help_heading = FOR_EXPERTS)]
    intervals: Option<usize>,

    /// Which equilibrium, where there are several: that of a leaf which is loaded slowly before its tips are brought together, or of one released from arcs under all of its loads
    #[arg(long, value_name = "NAME", value_parser = words::<Route>(Route::ALL.map(Route::word)), default_value_t)]
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

    /// Also find how the tip, the energy and the lowest eigenvalue change with these numbers of the scenario
    #[arg(
        long,
        value_name = "KEY,...",
        value_delimiter = ',',
        conflicts_with = "all"
    )]
    sensitivity: Vec<Keys>,

    /// Also find how far a stable leaf is from losing its stability: which push at the tip unseats it, and the lowest barrier to another equilibrium
    #[arg(long, conflicts_with_all = ["all", "sensitivity"])]
    margin: bool,

    /// Solve for the whole leaf, even if half of it would do
    #[arg(long, help_heading = FOR_EXPERTS)]
    full_model: bool,
}

fn update_margin(line: &mut ProgressLine, progress: &MarginProgress, tolerance: f64) {
    match progress {
        MarginProgress::Relaxing(progress) => line.update_solver(progress, tolerance),
        MarginProgress::Searching { done, all, push } => {
            line.update(fraction_of(*done, *all), || {
                let push = push.map(|(direction, force)| {
                    format!(", pushed by {} along {direction}", brief(force))
                });
                format!("{done} of {all} searches{}", push.unwrap_or_default())
            });
        }
    }
}

impl Relax {
    pub fn run(self) -> Result<Status, Refusal> {
        let traits = VerbTraits {
            varies: !self.sensitivity.is_empty(),
            stations: true,
            parallel: true,
            partial: self.all || self.margin,
            reads: &[],
            puts: None,
        };
        match self.all {
            true => self.request.each::<Equilibria>(traits, |job| self.all(job)),
            false => (self.request).each::<Equilibrium>(traits, |job| self.one(job)),
        }
    }

    fn one(&self, job: &Job) -> Result<Delivered, Refusal> {
        let live = match job.selection.kinds.contains(&Kind::Live) {
            true => Some(job.live()?),
            false => None,
        };
        let equilibrium = self.solve(job)?;
        if job.is_interrupted() && !equilibrium.outcome.is_at_rest() {
            return Err(Interrupted("the leaf is not at rest").into());
        }
        let equilibrium = equilibrium.at_stations(&job.scenario, job.selection.stations);
        job.remark(equilibrium.remark.as_ref());
        for doubt in &equilibrium.doubts {
            job.remark(Some(doubt));
        }
        let accepts_saddles = self.keep_unstable || equilibrium.method.is_shooting();
        let unwanted = equilibrium.outcome == Outcome::Saddle && !accepts_saddles;
        let success = equilibrium.outcome.is_success() && !unwanted;
        let live = live.map(|page| job.write_table(LIVE, page.as_bytes()));
        let written = [job.write(&equilibrium)].into_iter().chain(live);
        job.deliver_written(&equilibrium, success, &equilibrium, written)
    }

    /// The method with its options; refused if they do not fit the method.
    fn method(&self) -> Result<Method, Refusal> {
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

    fn solve(&self, job: &Job) -> Result<Equilibrium, Refusal> {
        let options = Options {
            method: self.method()?,
            route: self.path,
            tolerance: self.request.tolerance,
            modes: self.modes.unwrap_or(DEFAULT_MODES),
            mode_shapes: self.modes.is_some_and(|count| count > 0),
            every_node: true,
            limit: job.limit.clone(),
            stations: job.selection.stations,
            ..Options::default()
        };
        let mut line = job.progress();
        let tolerance = self.request.tolerance.unwrap_or(job.scenario.tolerance);
        if !self.sensitivity.is_empty() {
            let (base, keys) = (&job.base, &self.sensitivity);
            let found = study::relax_with_sensitivities(base, keys, &options, &mut |progress| {
                line.update_solver(progress, tolerance);
            });
            return found.map_err(|error| match error {
                SensitivityError::Relax(error) => error.into(),
                error => format!("--sensitivity {error}").into(),
            });
        }
        if self.margin {
            let mut searching = false;
            let found = study::relax_with_margin(&job.scenario, &options, &mut |progress| {
                if let (false, MarginProgress::Searching { .. }) = (searching, progress) {
                    searching = true;
                    line.next_phase();
                }
                update_margin(&mut line, progress, tolerance);
            });
            return found.map_err(|error| match error {
                MarginError::Relax(error) => error.into(),
                error => format!("--margin: {error}").into(),
            });
        }
        Ok(study::relax_blade(&job.base, &options, &mut |progress| {
            line.update_solver(progress, tolerance)
        })?)
    }

    fn all(&self, job: &Job) -> Result<Delivered, Refusal> {
        let Method::SemiImplicit(how) = self.method()? else {
            return Err("--all: only with the method semi-implicit".into());
        };
        let mut line = job.progress();
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
                let fraction = fraction_of(starts, last_new + study::IN_VAIN);
                line.update(fraction, || format!("{starts} starts, {found} equilibria"));
            },
        )?;
        drop(line);
        if job.is_interrupted() && all.found.is_empty() {
            return Err(Interrupted("no equilibrium was found").into());
        }
        for found in &mut all.found {
            let leaf = found.equilibrium.clone();
            found.equilibrium = leaf.at_stations(&job.scenario, job.selection.stations);
        }
        job.deliver(&all, !all.found.is_empty())
    }
}
