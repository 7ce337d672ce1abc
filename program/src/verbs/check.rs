//! `leafdyn check`: compares the shapes found by two independent methods.

use crate::verbs::exit::{ExitStatus, Refusal};
use crate::verbs::request::{DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits};
use clap::Args;
use leafdyn::study;
use leafdyn::study::{Check as Checked, CheckOptions, CheckVerdict};

/// Relax a leaf, solve its boundary-value problem by shooting from there, and compare.
///
/// Exit status: 0 both methods agree; 1 they differ or could not be compared
/// (the files are still written and say why); 2 the request was refused.
#[derive(Debug, Args)]
pub struct CheckArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// Shoot over N intervals; 1 is single shooting; left out: as many as the growth of perturbations needs
    #[arg(long, value_name = "N")]
    intervals: Option<usize>,

    /// Compare at a saddle, if the leaf comes to one, instead of leaving it for a stable equilibrium
    #[arg(long)]
    keep_unstable: bool,
}

impl CheckArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        self.request
            .run_each_scenario::<Checked>(VerbTraits::default(), |job| self.run_scenario(job))
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let options = CheckOptions {
            tolerance: self.request.tolerance,
            keep_unstable: self.keep_unstable,
            intervals: self.intervals,
            ..CheckOptions::default()
        };
        let mut line = job.progress_line();
        let tolerance = self.request.tolerance.unwrap_or(job.scenario.tolerance);
        let check = study::check(&job.scenario, &options, &mut |progress| {
            line.update_solver(progress, tolerance)
        })?;
        drop(line);
        if let CheckVerdict::NotCompared(reason) | CheckVerdict::NotIndependent(reason) =
            &check.verdict
        {
            job.print_remark(Some(reason));
        }
        let success = matches!(check.verdict, CheckVerdict::Agree);
        job.write_and_deliver(&check, success)
    }
}
