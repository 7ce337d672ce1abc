//! `leafdyn simulate`: follows the motion of a leaf.

use std::time::Instant;

use super::job::{Delivered, Job};
use super::progress::{ProgressLine, duration, fraction_between};
use super::request::{Request, VerbTraits, words};
use super::{OnInterrupt, note, on_interrupt, show_checkpoint};
use super::{Refusal, Status};
use crate::files::Recording;
use crate::report::FileError;
use crate::report::numbers::brief;
use clap::Args;
use leafdyn::memory;
use leafdyn::simulate::{Options, Record, Scheme, Simulation, Stopped};

/// Longer simulations, in seconds, are announced with their expected duration.
const ANNOUNCED: f64 = 60.0;

/// Larger recordings, in bytes, are announced with their expected size.
const LARGE: u64 = 1_000_000_000;

/// Follow a leaf as it moves: its shape, velocities and energies in time.
///
/// Exit status: 0 followed to its end; 1 ended early, as the motion could not
/// be trusted any more (the files are still written and say how far it came);
/// 2 the request was refused; 130 stopped by Ctrl-C (--resume goes on).
#[derive(Debug, Args)]
pub struct Simulate {
    #[command(flatten)]
    request: Request,

    /// How the leaf is moved; left out: in the way that costs less, as the report says
    #[arg(long, value_name = "NAME", value_parser = words::<Scheme>(Scheme::ALL.map(Scheme::word)))]
    method: Option<Scheme>,

    /// N segments a rod; left out: 16, or as many as the rest shape needs
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// The longest time step; left out: explicit: nine tenths of the longest stable one; semi-implicit: as the tolerance, the local error of a step, allows
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    step: Option<f64>,

    /// Go on where the same run was stopped by Ctrl-C
    #[arg(long)]
    resume: bool,
}

impl Simulate {
    pub fn run(self) -> Result<Status, Refusal> {
        let traits = VerbTraits {
            stations: true,
            ..VerbTraits::default()
        };
        self.request.each::<Record>(traits, |job| self.one(job))
    }

    fn one(&self, job: &Job) -> Result<Delivered, Refusal> {
        let options = Options {
            scheme: self.method,
            segments: self.segments,
            step: self.step,
            tolerance: self.request.tolerance,
        };
        let mut simulation = Simulation::new(&job.scenario, &options)?;
        let (folder, selection) = (&job.folder, &job.selection);
        let mut recording = match self.resume {
            true => Recording::resume(folder, &mut simulation, selection)?,
            false => Recording::begin(folder, &mut simulation, selection)?,
        };
        if let Some((steps, seconds)) = simulation.expected()
            && seconds > ANNOUNCED
        {
            let (name, steps) = (&job.scenario.name, brief(steps));
            let time = duration(seconds);
            note(&format!("{name}: {steps} steps to make, some {time}"));
        }
        let bytes = recording.expected_bytes(&simulation);
        if bytes > LARGE {
            let (name, size) = (&job.scenario.name, memory::size(bytes));
            note(&format!("{name}: some {size} to record"));
        }
        *on_interrupt() = Some(OnInterrupt::Write(recording.checkpointer()));
        let ended = self.follow(&mut simulation, &mut recording, job);
        if ended.is_err() {
            write_checkpoint(&recording);
        }
        ended
    }

    fn follow(
        &self,
        simulation: &mut Simulation,
        recording: &mut Recording,
        job: &Job,
    ) -> Result<Delivered, Refusal> {
        let stopped = record(simulation, recording, job.progress())?;
        let record = recording.record(simulation, stopped)?;
        job.remark(record.remark());
        for doubt in &record.doubts {
            job.remark(Some(doubt));
        }
        let written = recording.finish(&job.document(&record));
        if written.is_err() {
            // The motion so far need not be lost.
            write_checkpoint(recording);
        }
        let written = written.map(|files| job.list_files(&files));
        let written = [written.map_err(Refusal::from)];
        job.deliver_written(&record, stopped.is_none(), &record, written)
    }
}

/// Writes a checkpoint, if possible, and reports it.
fn write_checkpoint(recording: &Recording) {
    if let Some(kept) = recording.checkpointer().write() {
        show_checkpoint(&kept);
    }
}

/// Runs the simulation to its end, or until it stops early, and records it.
fn record(
    simulation: &mut Simulation,
    recording: &mut Recording,
    mut line: ProgressLine,
) -> Result<Option<Stopped>, FileError> {
    let duration = simulation.leaf().scenario().dynamics.duration;
    let (clock, begin) = (Instant::now(), simulation.time());
    while !simulation.done() {
        let frame = match simulation.next_frame() {
            Ok(frame) => frame,
            Err(stopped) => return Ok(Some(stopped)),
        };
        recording.add(simulation, &frame)?;
        let fraction = fraction_between(begin, frame.time, duration, false);
        line.update(fraction, || {
            let speed = (frame.time - begin) / clock.elapsed().as_secs_f64();
            let [time, duration, speed] = [frame.time, duration, speed].map(brief);
            format!("t = {time} of {duration}, {speed} a second")
        });
    }
    Ok(None)
}
