//! `leafdyn trace`: follows an equilibrium through one or two numbers of its scenario.

use crate::report::numbers::format_five_digits;
use crate::verbs::exit::{ExitStatus, InterruptedRun, Refusal};
use crate::verbs::progress::range_fraction;
use crate::verbs::request::{
    DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits, word_parser,
};
use clap::Args;
use leafdyn::study;
use leafdyn::study::{
    BoundaryRequest, MOST_POINTS, ParameterSweep, StabilityBoundary, Trace as Traced, TraceError,
    TraceRequest, TraceShow, TraceUntil,
};

/// Follow an equilibrium through one number of the scenario: through folds, with the Morse index along the way. With a second number: follow the points at which that index changes through both, as curves.
///
/// Exit status: 0 all branches, or curves, are followed to an end of a range, in a
/// circle, or to where --until ends them; 1 not (the files are still written and say how far); 2 the request
/// was refused.
#[derive(Debug, Args)]
pub struct TraceArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// What varies, once or twice: a number of the scenario as in --set, an entry of a list counted from 0 (load.gravity[2]); several keys that vary together are joined by +; COUNT values set the longest step
    #[arg(long, value_name = "KEY=FROM..TO[:COUNT][log]", required = true)]
    vary: Vec<ParameterSweep>,

    /// Also follow the branches that cross
    #[arg(long)]
    switch: bool,

    /// What ends a branch before the end of the range: the loss of its stability (where it is unstable from its beginning: of one more direction)
    #[arg(long, value_name = "WHAT", value_parser = word_parser::<TraceUntil>([TraceUntil::Unstable.word()]))]
    until: Option<TraceUntil>,

    /// Go to the first equilibrium by Newton's method, stable or not
    #[arg(long)]
    keep_unstable: bool,

    /// Follow branches on N segments a rod; left out: as the first equilibrium needs
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// Most points of a branch, or of a curve to either side
    #[arg(long, value_name = "N", default_value_t = MOST_POINTS)]
    points: usize,

    /// What the figure shows against that number, a panel each: x, y, z of the tip, reaction_x, reaction_y, reaction_z on the holder of a held tip, grip_1_x, ... on a grip, energy, twist; left out: the coordinate of the tip that varies most, of a reaction if the leaf is held
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    show: Vec<TraceShow>,

    /// Of a boundary also a coarse map under the curves: the index in so many cells along both numbers, each reached from one beside it
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = parse_cell_counts)]
    map: Option<[usize; 2]>,
}

impl TraceArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let traits = VerbTraits {
            varies_numbers: true,
            value_option: Some("--vary"),
            keeps_partial_result: true,
            ..VerbTraits::default()
        };
        match self.vary.as_slice() {
            [_] if self.map.is_some() => {
                Err("--map: a map is drawn over two numbers; give --vary twice".into())
            }
            [along] => (self.request)
                .run_each_scenario::<Traced>(traits, |job| self.trace_scenario(job, along)),
            [_, _] if !self.show.is_empty() => {
                Err("--show: a boundary is drawn over both numbers; give one --vary".into())
            }
            [along, across] => (self.request)
                .run_each_scenario::<StabilityBoundary>(traits, |job| {
                    self.trace_boundary(job, along, across)
                }),
            more => Err(format!(
                "--vary is given {} times: give one number to follow branches, two for a boundary",
                more.len()
            )
            .into()),
        }
    }

    fn trace_request(&self, job: &ScenarioJob, vary: &ParameterSweep) -> TraceRequest {
        TraceRequest {
            base: job.base.clone(),
            vary: vary.clone(),
            switch: self.switch,
            until: self.until,
            keep_unstable: self.keep_unstable,
            segments: self.segments,
            tolerance: self.request.tolerance,
            most_points: self.points,
            limit: job.limit.clone(),
        }
    }

    fn trace_boundary(
        &self,
        job: &ScenarioJob,
        along: &ParameterSweep,
        across: &ParameterSweep,
    ) -> Result<DeliveredResult, Refusal> {
        let request = BoundaryRequest {
            trace: self.trace_request(job, along),
            across: across.clone(),
            map: self.map,
        };
        let mut line = job.progress_line();
        let mut seen = (usize::MAX, [0.0; 2]);
        let boundary =
            study::trace_stability_boundary(&request, &mut |curve, points, [first, second]| {
                // A curve is followed to both ends of the second number's range.
                let fraction = match curve {
                    None => range_fraction(along.ends()[0], first, along.ends()[1], along.log),
                    Some(number) => {
                        if number != seen.0 {
                            seen = (number, [second; 2]);
                            line.next_phase();
                        }
                        seen.1 = [seen.1[0].min(second), seen.1[1].max(second)];
                        let [from, to] = across.ends();
                        let [low, high] = seen.1.map(|at| range_fraction(from, at, to, across.log));
                        low.zip(high).map(|(low, high)| (high - low).abs())
                    }
                };
                line.update(fraction, || {
                    let what = curve.map_or("trace".into(), |curve| format!("curve {}", curve + 1));
                    let [first, second] = [first, second].map(format_five_digits);
                    format!("{what}, {points} points, at {first}, {second}")
                });
            })
            .map_err(refusal_with_option)?;
        drop(line);
        if job.is_interrupted() && boundary.curves.is_empty() {
            return Err(InterruptedRun("no curve was found").into());
        }
        job.print_remark(boundary.remark.as_ref());
        boundary
            .doubts
            .iter()
            .for_each(|doubt| job.print_remark(Some(doubt)));
        job.write_and_deliver(&boundary, boundary.complete)
    }

    fn trace_scenario(
        &self,
        job: &ScenarioJob,
        vary: &ParameterSweep,
    ) -> Result<DeliveredResult, Refusal> {
        let request = self.trace_request(job, vary);
        let scenario = request.base.scenario();
        for show in &self.show {
            let why = match show {
                TraceShow::Reaction(_) if scenario.held_tip.is_none() => {
                    "nothing holds the tip: add [tip] with held".into()
                }
                TraceShow::Grip { grip, .. } if *grip >= scenario.grips.len() => {
                    format!("there are {} of [[grip]]", scenario.grips.len())
                }
                _ => continue,
            };
            return Err(format!("--show {show}: {why}").into());
        }
        let mut line = job.progress_line();
        let mut seen = (0, vary.ends()[0]);
        let mut trace = study::trace(&request, &mut |branch, points, value| {
            if branch != seen.0 {
                seen = (branch, value);
                line.next_phase();
            }
            // Relative to the end it moves to; the number of branches is not known.
            let [from, to] = vary.ends();
            let backwards = (value - seen.1) * (to - from) < 0.0;
            let to = if backwards { from } else { to };
            line.update(range_fraction(seen.1, value, to, vary.log), || {
                let at = format_five_digits(value);
                format!("branch {}, {points} points, at {at}", branch + 1)
            });
        })
        .map_err(refusal_with_option)?;
        drop(line);
        if job.is_interrupted() && trace.branches.iter().all(|branch| branch.points.is_empty()) {
            return Err(InterruptedRun("no point was found").into());
        }
        trace.show.clone_from(&self.show);
        job.print_remark(trace.remark.as_ref());
        trace
            .doubts
            .iter()
            .for_each(|doubt| job.print_remark(Some(doubt)));
        job.write_and_deliver(&trace, trace.complete)
    }
}

/// Parses the numbers of cells along both axes, as in 16x16.
fn parse_cell_counts(given: &str) -> Result<[usize; 2], String> {
    let sides = given.split_once('x').map(|(columns, rows)| [columns, rows]);
    let sides = sides.map(|sides| sides.map(|side| side.trim().parse().ok()));
    match sides {
        Some([Some(columns), Some(rows)]) => Ok([columns, rows]),
        _ => Err("give cells along both numbers, as 16x16".into()),
    }
}

/// An error together with the option that caused it.
fn refusal_with_option(error: TraceError) -> Refusal {
    match error {
        TraceError::Vary { .. } | TraceError::End { .. } => format!("--vary {error}").into(),
        error => error.into(),
    }
}
