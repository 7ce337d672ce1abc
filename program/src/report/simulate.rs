//! The text report of a simulation.

use crate::report::document::ReportedResult;
use crate::report::numbers::{
    decimals_for_error, duration_text, format_error_bound, format_five_digits, format_within_error,
    number_in_unit, position_error_text, round_to_error, tips_text, veins_text_for_count,
};
use crate::report::table::{LabelledLines, label_first_line};
use leafdyn::numbers::{format_two_digits, larger, largest};
use leafdyn::scenario::units::{DAMPING, ENERGY, LENGTH, TIME, VELOCITY};
use leafdyn::scenario::{MotionStart, Units};
use leafdyn::simulate::{LandingRecord, OutputSample, Record, SchemeReason};

/// What the rounding of many steps leaves of the largest energy in the others.
const ENERGY_ROUNDING: f64 = 1e-13;

/// Decimals of a position, relative to the longest rod.
const POSITION_DECIMALS: f64 = 7.0;

impl ReportedResult for Record {
    fn heading(&self) -> String {
        let veins = veins_text_for_count(self.rods, self.joined);
        format!("{}: {veins}, method {}", self.scenario, self.scheme)
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let mut lines = vec![
            ("moved", reached_time_line(self, units)),
            ("grid", format!("{} segments a vein", self.segments)),
            ("step", time_step_line(self, units)),
        ];
        lines.extend(self.start.map(|start| ("start", start_line(start, self))));
        if self.choice.reason != SchemeReason::Requested {
            lines.push(("choice", self.choice.to_string()));
        }
        lines.extend(self.assumed_damping.map(|damping| {
            let damping = number_in_unit(format_five_digits(damping), units, DAMPING);
            let text = format!(
                "external {damping}, assumed: critical for the lowest mode, so that a leaf creeps to rest; \
                 dynamics.external_damping sets it"
            );
            ("damping", text)
        }));
        lines.extend(energy_lines(self, units));
        lines.extend(label_first_line("landing", landing_lines(self, units)));
        let known = self.moments.iter().filter_map(|moment| moment.error);
        let decimals = match known.reduce(f64::max) {
            Some(error) => decimals_for_error(error),
            None => (POSITION_DECIMALS - self.length.log10().floor()).clamp(0.0, 15.0) as usize,
        };
        let tips = tips_text(&self.tips, decimals, units);
        lines.extend(tips.map(|tips| ("tip", tips)));
        lines.extend(farthest_tip_line(self, units).map(|line| ("farthest", line)));
        lines.push(("end", late_motion_line(self, units)));
        lines.push(("error", tip_error_line(self, units)));
        lines.push(("speed", speed_line(self)));
        lines
    }

    fn remarks(&self) -> LabelledLines {
        let remark = label_first_line("remark", self.remark().map(|it| it.to_string()));
        let doubts = self.doubts.iter().map(ToString::to_string);
        [remark, label_first_line("doubtful", doubts)].concat()
    }
}

fn reached_time_line(record: &Record, units: &Units) -> String {
    let steps = record.moments.last().map_or(0, |moment| moment.steps);
    let time = |time: f64| number_in_unit(format_five_digits(time), units, TIME);
    let (reached, outputs) = (time(record.time), record.moments.len());
    let reached = format!("t = {reached} in {steps} steps, {outputs} outputs");
    let (outcome, duration) = (record.outcome(), time(record.duration));
    match record.stopped {
        None => format!("to {reached}"),
        Some(_) => format!("{outcome}: only to {reached}, of t = {duration}"),
    }
}

fn time_step_line(record: &Record, units: &Units) -> String {
    let time = |step: f64| number_in_unit(format!("{step:.3e}"), units, TIME);
    let longest = match record.time_step {
        Some(step) => format!("at most {}", time(step)),
        None => {
            let error = format_error_bound(record.tolerance);
            format!("so that its local error is within {error}")
        }
    };
    match record.stable_step {
        Some(bound) => {
            let (step, limit) = (time(bound.step), bound.limit);
            format!("{longest}, stable up to {step} ({limit})")
        }
        None => longest,
    }
}

/// The energies at the end, and their balance, which should not have changed.
fn energy_lines(record: &Record, units: &Units) -> LabelledLines {
    let (Some(first), Some(last)) = (record.moments.first(), record.moments.last()) else {
        return Vec::new();
    };
    let e = &last.energy;
    let parts = [
        ("kinetic", e.kinetic),
        ("elastic", e.elastic),
        ("coupling", e.coupling),
        ("potential", e.potential),
        ("dissipated", e.dissipated),
        ("work put in", e.work),
    ];
    let noise = ENERGY_ROUNDING * largest(parts.map(|(_, value)| value.abs()));
    let digits = |value: f64| format_five_digits(round_to_error(value, noise));
    let (start, end) = (first.energy.balance(), e.balance());
    let change = end - start;
    let [start, end] =
        [start, end].map(|value| format_within_error(value, larger(noise, change.abs())));
    let change = number_in_unit(digits(change), units, ENERGY);
    let balance = format!("{start} at the start, {end} at the end: changed by {change}");
    let parts = parts.map(|(name, value)| format!("{name} {}", digits(value)));
    let parts = number_in_unit(parts.join(", "), units, ENERGY);
    vec![("energy", parts), ("balance", balance)]
}

/// What the motion starts from.
fn start_line(start: MotionStart, record: &Record) -> String {
    let from = match (start, record.rods, record.joined) {
        (MotionStart::AtRest, ..) => "at rest under the loads at time 0",
        (MotionStart::Released, 1, _) => "released without load: the vein in its own shape",
        (MotionStart::Released, _, true) => {
            "released without load: veins as arcs that meet in the tip"
        }
        (MotionStart::Released, _, false) => "released without load: veins in their own shapes",
    };
    from.into()
}

/// When masses landed, what energy they brought, what of it their impacts lost, and what was damped until the end.
fn landing_lines(record: &Record, units: &Units) -> Vec<String> {
    let (Some(first), Some(last)) = (record.moments.first(), record.moments.last()) else {
        return Vec::new();
    };
    if record.landings.is_empty() {
        return Vec::new();
    }
    let off = (last.energy.balance() - first.energy.balance()).abs();
    let in_unit = |text: String| number_in_unit(text, units, ENERGY);
    let energy = |value: f64| in_unit(format_five_digits(round_to_error(value, off)));
    let line = |landing: &LandingRecord| {
        let LandingRecord { vein, at, .. } = landing;
        let time = number_in_unit(format_five_digits(landing.time), units, TIME);
        format!(
            "a mass on vein {vein} at {at:.3}, at t = {time}: its kinetic energy {}; the impact, after which it \
             moves with its node of the grid, loses {}, less on finer grids",
            energy(landing.kinetic_energy),
            energy(landing.lost_energy)
        )
    };
    let lost: f64 = record.landings.iter().map(|it| it.lost_energy).sum();
    let damped = energy(last.energy.dissipated - lost);
    let off = in_unit(format_error_bound(off));
    let damped = format!("damped until the end {damped}, within {off} by the balance");
    record.landings.iter().map(line).chain([damped]).collect()
}

/// How far the tip, or the mean of free ones, was from where it began at the output at which it was farthest; none of a
/// leaf that does not move.
fn farthest_tip_line(record: &Record, units: &Units) -> Option<String> {
    let start = record.moments.first()?.tip;
    let away = |moment: &&OutputSample| moment.tip.distance(start);
    let most = (record.moments.iter()).max_by(|a, b| away(a).total_cmp(&away(b)))?;
    let error = most.error.unwrap_or(0.0);
    let distance = round_to_error(away(&most), error);
    (distance > 0.0).then(|| {
        let distance = number_in_unit(format_five_digits(distance), units, LENGTH);
        let time = number_in_unit(format_five_digits(most.time), units, TIME);
        let tip = match record.joined {
            true => "the tip",
            false => "the tips on average",
        };
        format!("{tip} {distance} from the beginning, at t = {time}, of all outputs")
    })
}

/// Whether the leaf still moves at the end.
fn late_motion_line(record: &Record, units: &Units) -> String {
    let speed = format_two_digits(record.tip_speed);
    let speed = number_in_unit(speed, units, VELOCITY);
    match record.moves_at_end() {
        true => {
            let by = format_two_digits(record.late_tip_motion());
            let by = number_in_unit(by, units, LENGTH);
            format!("still moving: the tip at {speed}, and by {by} in the last tenth of the time")
        }
        false => format!("hardly moving: the tip at {speed}"),
    }
}

/// The bar on the tips, and where it ends.
fn tip_error_line(record: &Record, units: &Units) -> String {
    let mut known = record.moments.iter().filter_map(|moment| moment.error);
    let (Some(bar), Some(segments)) = (known.next_back(), record.compared_segments) else {
        return "of the tips not known: there is no second run to compare with".into();
    };
    let bar = position_error_text(bar, units);
    let tips = format!("tips within {bar}, as a run on {segments} segments a vein tells");
    match (record.error_estimate, record.error_known_until) {
        (None, Some(until)) => {
            let until = number_in_unit(format_five_digits(until), units, TIME);
            format!("{tips}, until t = {until}: then the two part")
        }
        _ => tips,
    }
}

fn speed_line(record: &Record) -> String {
    let wall = record.wall_seconds;
    let work = record.steps * record.rods * record.segments;
    let all = format!("{} in all", duration_text(wall));
    if !(wall > 0.0 && work > 0) {
        return all;
    }
    let (speed, each) = (
        format_five_digits(record.time / wall),
        1e9 * wall / work as f64,
    );
    format!("{all}: {speed} of simulated time a second, {each:.0} ns a step and segment")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;
    use glam::DVec3;
    use leafdyn::simulate::Stopped;

    /// The balance has the digits that its change leaves, and what is rounding is none.
    #[test]
    fn energies_have_the_digits_that_are_known() {
        let mut record = sample::sample_record(1, 4);
        let last = record.moments.len() - 1;
        let zero = record.moments[0].energy.map(|_| 0.0);
        record.moments[0].energy = zero;
        record.moments[0].energy.elastic = 4.068881005;
        record.moments[last].energy = zero;
        record.moments[last].energy.elastic = 4.076036413;
        record.moments[last].energy.kinetic = 8.4e-30;
        let report = record.report(&Units::default(), Vec::new(), false);
        for part in [
            "  energy   kinetic 0, elastic 4.076, ",
            "  balance  4.07 at the start, 4.08 at the end: changed by 0.0071554\n",
        ] {
            assert!(report.contains(part), "{part} in {report}");
        }
        record.moments[last].energy.elastic = 4.068881005 * (1.0 + 4e-16);
        let report = record.report(&Units::default(), Vec::new(), false);
        assert!(report.contains(": changed by 0\n"), "{report}");
    }

    /// What a mass brings, what its impact loses and what is damped have the digits that the balance leaves, and a leaf
    /// that stays where it is at the end does not move.
    #[test]
    fn energies_of_a_landing_and_a_leaf_that_rests() {
        let mut record = sample::sample_record(1, 4);
        let last = record.moments.len() - 1;
        for moment in &mut record.moments {
            moment.energy = moment.energy.map(|_| 0.0);
            moment.tip = DVec3::X;
        }
        record.moments[last].energy.dissipated = 1.25;
        record.moments[last].energy.work = 1.25 + 1.0 / 8192.0;
        record.tip_speed = 1e-9;
        record.landings = vec![LandingRecord {
            point: 1,
            vein: 1,
            at: 0.5,
            time: 1.0,
            kinetic_energy: 2.0,
            lost_energy: 0.50001,
        }];
        let report = record.report(&Units::default(), Vec::new(), false);
        for part in [
            "  landing  a mass on vein 1 at 0.500, at t = 1: its kinetic energy 2; the impact",
            ", loses 0.5, less on finer grids\n           damped until the end 0.75, within 1.3×10⁻⁴ by the balance\n",
            "  start    released without load: the vein in its own shape\n",
            "  end      hardly moving: the tip at 1.0×10⁻⁹\n",
        ] {
            assert!(report.contains(part), "{part} in {report}");
        }
    }

    #[test]
    fn an_early_end_without_a_step_of_its_own() {
        let mut record = sample::sample_record(1, 4);
        record.time_step = None;
        record.stable_step = None;
        record.stopped = Some(Stopped::Diverged {
            otherwise: "another method",
            time: 10.1,
            percent: 70.0,
        });
        record.duration = 40.0;
        let report = record.report(&Units::default(), Vec::new(), false);
        for part in [
            "swing: 1 vein, method explicit\n",
            "  moved    diverged: only to t = 10 in ",
            " steps, 101 outputs, of t = 40\n",
            "  step     so that its local error is within 1.0×10⁻⁶\n",
            "  remark   diverged at t = ",
        ] {
            assert!(report.contains(part), "{part} in {report}");
        }
    }
}
