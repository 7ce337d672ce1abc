//! `leafdyn check`: compares the shapes found by two independent methods.

use crate::verbs::request::{Delivered, Job, Request, VerbTraits};
use crate::verbs::{Refusal, Status};
use clap::Args;
use leafdyn::study;
use leafdyn::study::{Check as Checked, CheckOptions, Verdict};

/// Relax a leaf, solve its boundary-value problem by shooting from there, and compare.
///
/// Exit status: 0 both methods agree; 1 they differ or could not be compared
/// (the files are still written and say why); 2 the request was refused.
#[derive(Debug, Args)]
pub struct Check {
    #[command(flatten)]
    request: Request,

    /// Shoot over N intervals; 1 is single shooting; left out: as many as the growth of perturbations needs
    #[arg(long, value_name = "N")]
    intervals: Option<usize>,

    /// Compare at a saddle, if the leaf comes to one, instead of leaving it for a stable equilibrium
    #[arg(long)]
    keep_unstable: bool,
}

impl Check {
    pub fn run(self) -> Result<Status, Refusal> {
        self.request
            .each::<Checked>(VerbTraits::default(), |job| self.one(job))
    }

    fn one(&self, job: &Job) -> Result<Delivered, Refusal> {
        let options = CheckOptions {
            tolerance: self.request.tolerance,
            keep_unstable: self.keep_unstable,
            intervals: self.intervals,
            ..CheckOptions::default()
        };
        let mut line = job.progress();
        let tolerance = self.request.tolerance.unwrap_or(job.scenario.tolerance);
        let check = study::check(&job.scenario, &options, &mut |progress| {
            line.update_solver(progress, tolerance)
        })?;
        drop(line);
        if let Verdict::NotCompared(reason) | Verdict::NotIndependent(reason) = &check.verdict {
            job.remark(Some(reason));
        }
        let success = matches!(check.verdict, Verdict::Agree);
        job.deliver(&check, success)
    }
}
