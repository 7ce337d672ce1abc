//! `leafdyn simulate`: follows the motion of a leaf.

use crate::files::MotionRecording;
use crate::report::numbers::format_five_digits;
use crate::verbs::exit::{ExitStatus, InterruptedRun, Refusal, print_note};
use crate::verbs::progress::{ProgressLine, format_duration, range_fraction};
use crate::verbs::request::{
    DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits, word_parser,
};
use clap::Args;
use leafdyn::memory;
use leafdyn::simulate::{Options, Record, Refinement, Scheme, Simulation, Stopped, cheaper_text};

/// Longer runs, in seconds, are announced with their expected duration.
const ANNOUNCED_SECONDS: f64 = 5.0;

/// Larger recordings, in bytes, are announced with their expected size.
const ANNOUNCED_BYTES: u64 = 1_000_000_000;

/// What is told of an option that is gone.
const RESUME_REFUSAL: &str = "--resume is gone: a motion that is stopped has whole files up to its last output, and \
                      none is continued; leave it out to simulate from the beginning";

/// What is told where no output but the first was made.
const NOT_MOVED: InterruptedRun = InterruptedRun("no output was made");

/// Follow a leaf as it moves: its shape, velocities and energies in time.
///
/// Exit status: 0 followed to its end; 1 ended early, as the motion could not
/// be trusted any more (the files are still written and say how far it came);
/// 2 the request was refused; 130 stopped by Ctrl-C (the files are whole, up
/// to the last output).
#[derive(Debug, Args)]
pub struct SimulateArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// How the leaf is moved; left out: in the way that costs less, as the report says
    #[arg(long, value_name = "NAME", value_parser = word_parser::<Scheme>(Scheme::ALL.map(Scheme::word)))]
    method: Option<Scheme>,

    /// N segments a rod; left out: 16, or as many as the rest shape needs, and doubled until the tips are as accurate as the tolerance, within some 10 s
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// The longest time step; left out: explicit: at most nine tenths of the longest stable one; semi-implicit: as the tolerance, the local error of a step, allows; halved with the segments
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    step: Option<f64>,

    /// Refused: replaced by files that end with the last output
    #[arg(long, hide = true)]
    resume: bool,
}

/// A simulation that has ended, with what was recorded of it.
struct RecordedRun {
    simulation: Simulation,
    recording: MotionRecording,
    /// Why it ended early.
    stopped: Option<Stopped>,
}

impl SimulateArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let traits = VerbTraits {
            has_station_choice: true,
            keeps_partial_result: true,
            ..VerbTraits::default()
        };
        if self.resume {
            return Err(RESUME_REFUSAL.into());
        }
        self.request
            .run_each_scenario::<Record>(traits, |job| self.run_scenario(job))
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let options = Options {
            scheme: self.method,
            segments: self.segments,
            step: self.step,
            tolerance: self.request.tolerance,
            limit: job.limit.clone(),
        };
        let mut motion = match Refinement::new(&job.scenario, &options) {
            Err(_) if job.is_interrupted() => return Err(NOT_MOVED.into()),
            motion => motion?,
        };
        let mut announced = announce_duration(&motion, job, None);
        if !motion.cheaper_motions().is_empty() {
            let (name, cheaper) = (&job.scenario.name, cheaper_text(motion.cheaper_motions()));
            print_note(&format!("{name}: less would be taken with {cheaper}"));
        }
        let mut line = job.progress_line();
        let mut last = None;
        while let Some(run) = motion.next_run(&mut |run| {
            show_progress(&mut line, run);
            true
        }) {
            let run = self.run_and_record(run, &mut line, job)?;
            if job.is_interrupted() && (last.is_some() || run.simulation.frames().1 == 0) {
                // A run on a coarser grid is whole.
                break;
            }
            let run = last.insert(run);
            motion.end_run(&mut run.simulation, run.stopped);
            announced = announce_duration(&motion, job, announced);
        }
        drop(line);
        match last {
            Some(run) => self.deliver(run, job),
            None if job.is_interrupted() => Err(NOT_MOVED.into()),
            None => Err("the motion was not followed".into()),
        }
    }

    /// Runs a simulation to its end, or until it stops early, and records it.
    fn run_and_record(
        &self,
        mut simulation: Simulation,
        line: &mut ProgressLine,
        job: &ScenarioJob,
    ) -> Result<RecordedRun, Refusal> {
        let (folder, selection) = (&job.folder, &job.selection);
        let mut recording = MotionRecording::begin(folder, &mut simulation, selection)?;
        let bytes = recording.expected_bytes(&simulation);
        if bytes > ANNOUNCED_BYTES {
            let (name, size) = (&job.scenario.name, memory::format_bytes(bytes));
            print_note(&format!("{name}: some {size} to record"));
        }
        let mut stopped = None;
        while stopped.is_none() && !simulation.done() {
            match simulation.next_frame() {
                Err(why) => stopped = Some(why),
                Ok(frame) => {
                    recording.add_output(&simulation, &frame)?;
                    show_progress(line, &simulation);
                }
            }
        }
        Ok(RecordedRun {
            simulation,
            recording,
            stopped,
        })
    }

    fn deliver(&self, mut run: RecordedRun, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let (recording, stopped) = (&mut run.recording, run.stopped);
        let record = recording.finished_record(&run.simulation, stopped)?;
        job.print_remark(record.remark());
        for doubt in &record.doubts {
            job.print_remark(Some(doubt));
        }
        let written = recording.finish(&job.result_document(&record));
        let written = written.map(|files| job.list_files(&files));
        let written = [written.map_err(Refusal::from)];
        job.deliver_written(&record, stopped.is_none(), &record, written)
    }
}

/// Says what the next run takes, if it takes long and that was not told of this grid; returns its segments.
fn announce_duration(
    motion: &Refinement,
    job: &ScenarioJob,
    announced: Option<usize>,
) -> Option<usize> {
    if announced == Some(motion.segments()) {
        return announced;
    }
    if let Some((steps, expected)) = motion.expected()
        && expected > ANNOUNCED_SECONDS
    {
        let (name, segments, steps) = (
            &job.scenario.name,
            motion.segments(),
            format_five_digits(steps),
        );
        let time = format_duration(expected);
        print_note(&format!(
            "{name}: {steps} steps to make on {segments} segments a vein, some {time}"
        ));
    }
    Some(motion.segments())
}

fn show_progress(line: &mut ProgressLine, simulation: &Simulation) {
    let (time, duration) = (
        simulation.time(),
        simulation.leaf().scenario().dynamics.duration,
    );
    // Another run begins.
    if simulation.frames().1 == 1 {
        line.next_phase();
    }
    line.update(range_fraction(0.0, time, duration, false), || {
        let segments = simulation.segments();
        let [time, duration] = [time, duration].map(format_five_digits);
        format!("t = {time} of {duration}, {segments} segments a vein")
    });
}
