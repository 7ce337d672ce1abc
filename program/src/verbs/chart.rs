//! `leafdyn chart`: charts speed against accuracy.

use crate::files;
use crate::report::contender_name;
use crate::verbs::exit::{ExitStatus, Refusal};
use crate::verbs::help::EXPERT_OPTIONS_HEADING;
use crate::verbs::progress::completed_fraction;
use crate::verbs::request::{
    DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits, word_parser,
};
use clap::{Args, ValueHint};
use leafdyn::study::{
    Chart as Charted, ChartOptions, ChartProgress, ParameterKeys, SolverConfig, VaryError,
};
use leafdyn::{relax, study};
use std::path::PathBuf;

/// Measure every method over its own accuracy, and chart time against true error.
///
/// Exit status: 0 charted; 1 two independent methods do not confirm the
/// reference that errors are measured against (the files are still written and
/// say so); 2 the request was refused.
#[derive(Debug, Args)]
pub struct ChartArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// About how long to measure; slow runs are made once, and give up after this time and 10 s
    #[arg(long, value_name = "S", default_value_t = ChartOptions::default().seconds, allow_negative_numbers = true)]
    seconds: f64,

    /// Chart these methods only
    #[arg(long, value_name = "LIST", value_parser = word_parser::<SolverConfig>(SolverConfig::ALL.map(SolverConfig::word)), value_delimiter = ',')]
    methods: Vec<SolverConfig>,

    /// Measurements of other programs, as benches/peers writes them; may repeat
    #[arg(long, value_name = "FILE.csv", value_hint = ValueHint::FilePath, help_heading = EXPERT_OPTIONS_HEADING)]
    peers: Vec<PathBuf>,

    /// Chart the motion of `simulate` by both integrators, and not the leaf at rest
    #[arg(long)]
    motion: bool,

    /// Also chart time against the number of veins, at the tolerance: --rods 5,15,35
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    rods: Vec<usize>,
}

impl ChartArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let traits = VerbTraits {
            input_files: &self.peers,
            value_option: Some("--rods"),
            ..VerbTraits::default()
        };
        self.request
            .run_each_scenario::<Charted>(traits, |job| self.run_scenario(job))
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let scenario = &job.scenario;
        if self.request.tolerance.is_some() && self.rods.is_empty() {
            let why = "a chart runs over all tolerances; it is that of --rods";
            return Err(format!("--tolerance: {why}").into());
        }
        let rods: ParameterKeys = "leaf.rods".parse()?;
        let leaf = |&count: &usize| {
            Ok(job
                .base
                .scenario_with_values(&[(&rods, count as f64)])?
                .scenario)
        };
        let leaves: Result<Vec<_>, VaryError> = self.rods.iter().map(leaf).collect();
        let leaves = leaves?;
        if self.motion && !self.rods.is_empty() {
            return Err("--rods: is about leaves at rest; leave --motion out"
                .to_string()
                .into());
        }
        let mut options = ChartOptions {
            seconds: self.seconds,
            motion: self.motion,
            ..ChartOptions::default()
        };
        if !self.methods.is_empty() {
            let wanted = |who: &SolverConfig| self.methods.contains(who);
            options.contenders.retain(wanted);
        }
        for file in &self.peers {
            options.peers.extend(files::read_peer_measurements(file)?);
        }
        let mut line = job.progress_line();
        let (mut rounds, mut first) = (0, 1);
        let mut progress = |turn: &ChartProgress| {
            // All contenders run in the first rounds; later the number of rounds changes.
            if turn.rounds != rounds {
                (rounds, first) = (turn.rounds, turn.round);
                line.next_phase();
            }
            let fraction = completed_fraction(turn.round - first, rounds - first + 1);
            line.update(fraction, || {
                let ChartProgress {
                    rods,
                    setting: knob,
                    round,
                    ..
                } = turn;
                let who = contender_name(turn.contender, self.motion);
                format!("{rods} veins, {who}, {knob}, round {round} of {rounds}")
            });
        };
        // The options of the scaling are checked before the chart is made.
        let tolerance = self.request.tolerance.unwrap_or(scenario.tolerance);
        relax::check_tolerance(tolerance)?;
        let mut chart = study::chart(scenario, &options, &mut progress)?;
        if !leaves.is_empty() {
            chart.scaling = Some(study::scaling(&leaves, tolerance, &options, &mut progress)?);
        }
        drop(line);
        for remark in &chart.remarks {
            job.print_remark(Some(remark));
        }
        let scaling = chart.scaling.iter();
        let mut confirmed = scaling.map(|scaling| scaling.unconfirmed.is_empty());
        let success = chart.is_reference_confirmed() && confirmed.all(|confirmed| confirmed);
        let scaling = chart.scaling.iter().map(|scaling| job.write_files(scaling));
        let written = [job.write_files(&chart)].into_iter().chain(scaling);
        job.deliver_written(&chart, success, &chart, written)
    }
}
