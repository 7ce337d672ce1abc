//! `leafdyn relax`: a leaf comes to rest.

use std::path::Path;

use clap::{Args, ValueEnum};

use crate::relax::{self, Equilibrium, Method, Options};
use crate::report;
use crate::scenario::Scenario;
use crate::study;

use super::progress::ProgressLine;
use super::request::Request;
use super::{Refusal, Status, note};

/// Eigenvalues that are told unasked.
const MODES: usize = 3;

/// Find how a leaf comes to rest, how accurate that is and whether it is stable.
///
/// Exit status: 0 at rest within the tolerance; 1 not (the files are still
/// written and say how far it came); 2 the request was refused.
#[derive(Debug, Args)]
pub struct Relax {
    #[command(flatten)]
    request: Request,

    /// How the leaf is brought to rest
    #[arg(long, value_name = "NAME", value_enum, default_value_t = MethodName::SemiImplicit)]
    method: MethodName,

    /// One fixed grid of N segments a rod, without extrapolation; left out: as fine as the tolerance needs
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// With --method shooting: shoot over N intervals; 1 is single shooting; left out: as many as the growth of perturbations needs
    #[arg(long, value_name = "N")]
    intervals: Option<usize>,

    /// Stop at a saddle instead of leaving it for a stable equilibrium
    #[arg(long)]
    keep_unstable: bool,

    /// Write and draw the K lowest modes of the leaf at rest; left out: the eigenvalues of 3 are told, unless the leaf is large; 0: none
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    modes: Option<usize>,

    /// Look for all equilibria, from many starts, and list them by energy
    #[arg(long, conflicts_with_all = ["keep_unstable", "modes", "segments"])]
    all: bool,

    /// Solve for the whole leaf, in space, even if half of it or its plane would do
    #[arg(long)]
    full_model: bool,
}

/// The methods by the names users type.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MethodName {
    SemiImplicit,
    Explicit,
    Shooting,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::SemiImplicit => Method::SemiImplicit,
            MethodName::Explicit => Method::Explicit,
            MethodName::Shooting => Method::Shooting,
        }
    }
}

impl Relax {
    pub fn run(self) -> Result<Status, Refusal> {
        let (scenario, folder) = self.request.open()?;
        if self.all {
            return self.all(&scenario, &folder);
        }
        let equilibrium = self.solve(&scenario)?;
        if let (true, Some(remark)) = (self.request.json, &equilibrium.remark) {
            note(&format!("{}: {remark}", equilibrium.scenario));
        }
        self.request.deliver(&equilibrium, &folder, |folder| {
            report::relax_report(&equilibrium, folder)
        })?;
        Ok(match equilibrium.outcome.is_success() {
            true => Status::Success,
            false => Status::Failure,
        })
    }

    fn options(&self) -> Options {
        Options {
            method: self.method.into(),
            segments: self.segments,
            tolerance: self.request.tolerance,
            keep_unstable: self.keep_unstable,
            full_model: self.full_model,
            intervals: self.intervals,
            modes: self.modes.unwrap_or(MODES),
            mode_shapes: self.modes.is_some_and(|count| count > 0),
            ..Options::default()
        }
    }

    fn solve(&self, scenario: &Scenario) -> Result<Equilibrium, Refusal> {
        let mut line = ProgressLine::new(&scenario.name);
        Ok(relax::relax(scenario, &self.options(), &mut |progress| {
            line.update(progress)
        })?)
    }

    fn all(&self, scenario: &Scenario, folder: &Path) -> Result<Status, Refusal> {
        if !matches!(self.method, MethodName::SemiImplicit) {
            return Err("--all: only with the method semi-implicit".into());
        }
        let options = Options {
            modes: 0,
            ..self.options()
        };
        let mut line = ProgressLine::new(&scenario.name);
        let all = study::all(scenario, &options, &mut |starts, found| {
            line.say(|elapsed| {
                let seconds = elapsed.as_secs_f64();
                format!("{starts} starts, {found} equilibria, {seconds:.0} s")
            });
        })?;
        drop(line);
        self.request
            .deliver(&all, folder, |folder| report::all_report(&all, folder))?;
        Ok(match all.found.is_empty() {
            false => Status::Success,
            true => Status::Failure,
        })
    }
}
