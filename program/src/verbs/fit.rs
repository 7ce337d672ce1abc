//! `leafdyn fit`: fits numbers of a scenario to measurements.

use crate::verbs::exit::{ExitStatus, InterruptedRun, Refusal, print_note};
use crate::verbs::progress::{completed_fraction, format_duration};
use crate::verbs::request::{DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits};
use clap::{Args, ValueHint};
use leafdyn::scenario::bytes;
use leafdyn::study;
use leafdyn::study::{
    Data, DataFileOptions, Fit as Fitted, FitCostLimit, FitRequest, FitStep, FreeParameter,
    MeasuredColumn, RowFilter,
};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Fit numbers of the scenario to measurements, and say what these determine and what they do not.
///
/// Exit status: 0 a minimum at which the data determine every free number; 1 not
/// (the files are still written and say which); 2 the request was refused.
#[derive(Debug, Args)]
pub struct FitArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// Measured data as CSV, with a header: experiments (keys of the scenario, results, their sd_), or points on veins (rod, sigma, x, y, z, sd, experiment); may repeat
    #[arg(long, value_name = "FILE.csv", required = true, value_hint = ValueHint::FilePath)]
    data: Vec<PathBuf>,

    /// What a column of the data is: its name in the file, and a key, a result or another column of the data, with a factor and an offset, as in 'Extension=tip.position[0]:1e-3+0.12'; other columns of that file are left out; may repeat
    #[arg(long, value_name = "NAME=QUANTITY[:FACTOR[+OFFSET]]")]
    column: Vec<MeasuredColumn>,

    /// Read the first row of each file of data, and then every K-th
    #[arg(long, value_name = "K", default_value = "1", hide_default_value = true, value_parser = parse_row_stride)]
    every: NonZeroUsize,

    /// Read only rows whose number in a column is so, as in 'load.tip_force[0]>0.5' (also <, >=, <=, =); several are joined by ' and ', or by repeating it
    #[arg(long, value_name = "COLUMN>VALUE")]
    rows: Vec<RowFilter>,

    /// A number that is free, by its key as in --vary, and its bounds; of a quantity given as a list or a profile every entry; or offset:COLUMN, what is added to a column of experiments, as for slack; may repeat
    #[arg(
        long,
        value_name = "KEY[=LOW..HIGH]",
        required = true,
        allow_negative_numbers = true
    )]
    free: Vec<FreeParameter>,

    /// Let data far off the others count less
    #[arg(long)]
    robust: bool,

    /// Relax or follow the leaves of all experiments at most K times; 1000 if left out
    #[arg(long, value_name = "K")]
    most_evaluations: Option<usize>,

    /// Experiments that could be made, as CSV like the data: which would say most?
    #[arg(long, value_name = "FILE.csv", value_hint = ValueHint::FilePath)]
    candidates: Option<PathBuf>,
}

/// Fits that may take less than so many seconds are announced in the line of progress alone.
const UNANNOUNCED_FIT_SECONDS: f64 = 300.0;

/// Says what a fit takes at most, if that may be long.
fn announce_budget(name: &str, budget: FitCostLimit) {
    if budget.seconds > UNANNOUNCED_FIT_SECONDS {
        let (most, time) = (budget.evaluations, format_duration(budget.seconds));
        let leaves = match budget.leaves {
            1 => "one leaf".into(),
            leaves => format!("{leaves} leaves"),
        };
        print_note(&format!(
            "{name}: at most {most} evaluations of {leaves}, {time} if all take as long as the first; most fits need a tenth"
        ));
    }
}

fn parse_row_stride(text: &str) -> Result<NonZeroUsize, &'static str> {
    text.parse().map_err(|_| "must be a whole number from 1")
}

impl FitArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let reads: Vec<_> = self.data.iter().chain(&self.candidates).cloned().collect();
        let traits = VerbTraits {
            varies_numbers: true,
            keeps_partial_result: true,
            input_files: &reads,
            ..VerbTraits::default()
        };
        self.request
            .run_each_scenario::<Fitted>(traits, |job| self.run_scenario(job))
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let base = job.base.clone();
        let mut data = Data {
            reading: DataFileOptions {
                columns: self.column.clone(),
                every: self.every,
                rows: self.rows.clone(),
            },
            ..Data::default()
        };
        let rods = base.scenario().rods.len();
        for file in &self.data {
            data.read(bytes(file)?, &file.display().to_string(), rods)?;
        }
        let candidates = match &self.candidates {
            Some(file) => FitRequest::read_candidates(
                bytes(file)?,
                &file.display().to_string(),
                &self.column,
            )?,
            None => Vec::new(),
        };
        let request = FitRequest {
            base,
            data,
            free: self.free.clone(),
            robust: self.robust,
            candidates,
            tolerance: self.request.tolerance,
            limit: job.limit.clone(),
            most_evaluations: self.most_evaluations,
        };
        let mut line = job.progress_line();
        let (mut profiling, mut most) = (false, String::new());
        let found = study::fit(&request, &mut |now| {
            let FitStep {
                step,
                sum,
                known,
                budget,
            } = *now;
            if let Some(budget) = budget {
                announce_budget(&job.scenario.name, budget);
                most = format!(" (at most {} in all)", format_duration(budget.seconds));
                return;
            }
            if known.is_some() && !std::mem::replace(&mut profiling, true) {
                line.next_phase();
            }
            let fraction = known.and_then(|(known, all)| completed_fraction(known, all));
            let intervals = known.map_or(String::new(), |(known, all)| {
                format!("{known} of {all} intervals, ")
            });
            line.update(fraction, || {
                format!("{intervals}step {step}, sum of squares {sum:.6e}{most}")
            });
        });
        drop(line);
        let fit = match found {
            Err(_) if job.is_interrupted() => {
                return Err(InterruptedRun("no values were found").into());
            }
            found => found?,
        };
        job.print_remark(fit.remarks.first());
        job.write_and_deliver(&fit, fit.is_success())
    }
}
