//! `summary.json` of a simulation.

use std::io::{self, Write};

use serde::Serialize;

use super::{Point, tips, write};
use crate::motion::StableStep;
use crate::report::Format;
use crate::simulate::Record;

/// `summary.json` of a simulation, which is also what `--json` prints.
pub struct MotionSummary;

impl Format<Record> for MotionSummary {
    fn file_name(&self) -> &'static str {
        "summary.json"
    }

    fn write(&self, record: &Record, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(record), out)
    }
}

/// The keys, in the order in which they are written. Numbers that are not
/// finite become null.
#[derive(Serialize)]
struct Object<'a> {
    scenario: &'a str,
    method: &'a str,
    outcome: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<String>,
    rods: usize,
    segments: usize,
    tolerance: f64,
    duration: f64,
    time: f64,
    time_step: Option<f64>,
    stable_step: Option<Bound>,
    steps: usize,
    frames: usize,
    energy: Option<Energies>,
    tip: Option<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tips: Option<Vec<Point>>,
    wall_seconds: f64,
}

#[derive(Serialize)]
struct Bound {
    step: f64,
    limit: &'static str,
}

/// All of them at the last output, and what no motion can change at the first
/// and at the last.
#[derive(Serialize)]
struct Energies {
    kinetic: f64,
    elastic: f64,
    coupling: f64,
    potential: f64,
    dissipated: f64,
    work: f64,
    balance_start: f64,
    balance_end: f64,
}

impl<'a> From<&'a Record> for Object<'a> {
    fn from(record: &'a Record) -> Self {
        let (tip, tips) = tips(&record.tips);
        let ends = record.moments.first().zip(record.moments.last());
        let energy = ends.map(|(first, last)| {
            let energy = &last.energy;
            Energies {
                kinetic: energy.kinetic,
                elastic: energy.elastic,
                coupling: energy.coupling,
                potential: energy.potential,
                dissipated: energy.dissipated,
                work: energy.work,
                balance_start: first.energy.balance(),
                balance_end: energy.balance(),
            }
        });
        Object {
            scenario: &record.scenario,
            method: record.scheme.name(),
            outcome: record.outcome(),
            remark: record.stopped.map(|stopped| stopped.to_string()),
            rods: record.rods,
            segments: record.segments,
            tolerance: record.tolerance,
            duration: record.duration,
            time: record.time(),
            time_step: record.longest_step,
            stable_step: record
                .stable_step
                .map(|StableStep { step, limit }| Bound { step, limit }),
            steps: record.steps,
            frames: record.moments.len(),
            energy,
            tip,
            tips,
            wall_seconds: record.wall_seconds,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::super::tests::{keys, text};
    use super::*;
    use crate::report::sample;
    use crate::simulate::Stopped;

    fn value(record: &Record) -> Value {
        serde_json::from_str(&text(&MotionSummary, record)).unwrap()
    }

    #[test]
    fn keys_and_their_order_are_fixed() {
        let mut wanted = vec![
            "scenario",
            "method",
            "outcome",
            "rods",
            "segments",
            "tolerance",
            "duration",
            "time",
            "time_step",
            "stable_step",
            "steps",
            "frames",
            "energy",
            "tip",
            "wall_seconds",
        ];
        let mut record = sample::record(5, 8);
        assert_eq!(keys(&text(&MotionSummary, &record)), wanted);
        wanted.insert(3, "remark");
        record.stopped = Some(Stopped::StepTooShort {
            time: 3.0,
            advice: "use more segments a rod",
        });
        assert_eq!(keys(&text(&MotionSummary, &record)), wanted);
    }

    #[test]
    fn the_end_is_that_of_the_last_output() {
        let record = sample::record(3, 4);
        let value = value(&record);
        assert_eq!(value["outcome"], "completed");
        assert_eq!(value["frames"], 101);
        assert_eq!(value["time"], record.moments[100].time);
        assert_eq!(value["stable_step"]["limit"], "shear with rotation");
        let energy = &value["energy"];
        assert_eq!(energy["kinetic"], record.moments[100].energy.kinetic);
        let balance = |moment: usize| record.moments[moment].energy.balance();
        assert_eq!(energy["balance_start"], balance(0));
        assert_eq!(energy["balance_end"], balance(100));
        assert_eq!(value["tip"].as_array().unwrap().len(), 3);
    }

    #[test]
    fn what_is_not_known_is_null() {
        let mut record = sample::record(3, 4);
        record.longest_step = None;
        record.stable_step = None;
        record.tips = vec![record.tips[0]; 3];
        let value = value(&record);
        for key in ["time_step", "stable_step", "tip"] {
            assert_eq!(value[key], Value::Null, "{key}");
        }
        assert_eq!(value["tips"].as_array().unwrap().len(), 3);
    }
}
