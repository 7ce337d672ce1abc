//! The summary of a simulation that people read.

use std::path::{Path, PathBuf};

use crate::report::numbers::power_of_ten;
use crate::simulate::Record;

use super::numbers::{brief, point, seconds, significant, veins_of};
use super::table::{lay_out, named};

/// Decimals of a position, relative to the longest rod.
const DECIMALS: f64 = 7.0;

/// How far the leaf came, with what steps, and where its energy went.
pub fn report(record: &Record, files: Option<(&Path, &[PathBuf])>) -> String {
    let mut lines = vec![
        ("moved", moved(record)),
        ("grid", format!("{} segments a vein", record.segments)),
        ("step", step(record)),
    ];
    lines.extend(energy(record));
    lines.extend(tip(record));
    lines.push(("speed", speed(record)));
    if let Some((folder, files)) = files {
        let names = files.iter().filter_map(|file| file.file_name()?.to_str());
        lines.push(("written", named(folder, names)));
    }
    if let Some(stopped) = record.stopped {
        lines.push(("remark", stopped.to_string()));
    }
    let heading = format!(
        "{}: {}, method {}",
        record.scenario,
        veins_of(record.rods, record.joined),
        record.scheme.name()
    );
    lay_out(&heading, &lines)
}

fn moved(record: &Record) -> String {
    let steps = record.moments.last().map_or(0, |moment| moment.steps);
    let way = format!(
        "t = {} in {steps} steps, {} outputs",
        brief(record.time()),
        record.moments.len()
    );
    match record.stopped {
        None => format!("to {way}"),
        Some(_) => format!(
            "{}: only to {way}, of t = {}",
            record.outcome(),
            brief(record.duration)
        ),
    }
}

fn step(record: &Record) -> String {
    let longest = match record.longest_step {
        Some(step) => format!("at most {step:.3e}"),
        None => format!(
            "so that its local error is within {}",
            power_of_ten(record.tolerance)
        ),
    };
    match record.stable_step {
        Some(bound) => format!(
            "{longest}, stable up to {:.3e} ({})",
            bound.step, bound.limit
        ),
        None => longest,
    }
}

/// The energies at the end, and what should not have changed.
fn energy(record: &Record) -> Vec<(&'static str, String)> {
    let (Some(first), Some(last)) = (record.moments.first(), record.moments.last()) else {
        return Vec::new();
    };
    let e = &last.energy;
    let shown = [
        ("kinetic", e.kinetic),
        ("elastic", e.elastic),
        ("coupling", e.coupling),
        ("potential", e.potential),
        ("dissipated", e.dissipated),
        ("work put in", e.work),
    ];
    let parts: Vec<String> = shown
        .into_iter()
        .map(|(name, value)| format!("{name} {}", brief(value)))
        .collect();
    let (start, end) = (first.energy.balance(), e.balance());
    vec![
        ("energy", parts.join(", ")),
        (
            "balance",
            format!(
                "{} at the start, {} at the end: changed by {}",
                significant(start),
                significant(end),
                brief(end - start)
            ),
        ),
    ]
}

fn tip(record: &Record) -> Option<(&'static str, String)> {
    let [tip] = record.tips.as_slice() else {
        return None;
    };
    let decimals = (DECIMALS - record.length.log10().floor()).clamp(0.0, 15.0);
    Some(("tip", point(tip.to_array(), decimals as usize)))
}

fn speed(record: &Record) -> String {
    let wall = record.wall_seconds;
    let work = record.steps * record.rods * record.segments;
    match wall > 0.0 && work > 0 {
        true => format!(
            "{} in all: {} of simulated time a second, {:.0} ns a step and segment",
            seconds(wall),
            brief(record.time() / wall),
            1e9 * wall / work as f64
        ),
        false => format!("{} in all", seconds(wall)),
    }
}

#[cfg(test)]
mod tests {
    use crate::files::Recording;
    use crate::scenario::Scenario;
    use crate::simulate::{Options, Scheme, Simulation, Stopped};

    use super::*;

    fn swing(scheme: Scheme) -> Record {
        let scenario = r#"
            name = "swing"
            leaf = { rods = 1, length = 2.0, fan = [0.0] }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
            load = { gravity = [0.0, 0.0, -0.1] }
            dynamics = { duration = 0.3, output_interval = 0.1 }
        "#;
        let scenario = Scenario::from_toml(scenario).unwrap();
        let options = Options {
            scheme: Some(scheme),
            ..Options::default()
        };
        let mut simulation = Simulation::new(&scenario, &options).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mut recording = Recording::begin(folder.path(), &mut simulation).unwrap();
        while !simulation.done() {
            let frame = simulation.next_frame().unwrap();
            recording.add(&simulation, &frame).unwrap();
        }
        recording.record(&simulation, None).unwrap()
    }

    #[track_caller]
    fn says(record: &Record, parts: &[&str]) {
        let report = report(record, None);
        for part in parts {
            assert!(report.contains(part), "{part} in {report}");
        }
    }

    #[test]
    fn what_was_done() {
        says(
            &swing(Scheme::Explicit),
            &[
                "swing: 1 vein, method explicit\n",
                "  moved    to t = 0.3 in ",
                " steps, 4 outputs\n",
                "  step     at most ",
                ", stable up to ",
                " (shear with rotation)\n",
            ],
        );
        says(
            &swing(Scheme::SemiImplicit),
            &["  step     so that its local error is within 1.0×10⁻⁶\n"],
        );
    }

    #[test]
    fn an_early_end() {
        let mut record = swing(Scheme::Explicit);
        record.stopped = Some(Stopped::Diverged {
            otherwise: "--method semi-implicit",
            time: 0.4,
            percent: 70.0,
        });
        record.duration = 4.0;
        says(
            &record,
            &[
                "  moved    diverged: only to t = 0.3 in ",
                ", of t = 4\n",
                "  remark   diverged at t = ",
            ],
        );
    }
}
