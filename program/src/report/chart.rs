//! A chart as text, and as rows of `chart.csv` and `chart_rods.csv`, one per measurement;
//! `chart.json` has the same values under the same names.

use crate::report::document::{ReportedResult, contender_name};
use crate::report::numbers::{duration_text, format_error_bound, veins_text_for_count};
use crate::report::table::{LabelledLines, label_first_line, text_cell};
use leafdyn::scenario::Units;
use leafdyn::study::{Chart, ChartRemark, ChartRow, FastestByAccuracy, PeerProgram, ScalingStudy};
use serde::Serialize;
use serde_json::Value;
use std::io;
use std::io::Write;

/// Names of the columns that both files have.
const CHART_COLUMNS: &str = "method,knob,seconds,seconds_min,seconds_q1,seconds_q3,runs,steps,\
    factorizations,force_evaluations,true_error,error_estimate,outcome";

impl ReportedResult for Chart {
    fn heading(&self) -> String {
        let veins = veins_text_for_count(self.rods, self.joined);
        let what = if self.motion { ", in motion" } else { "" };
        format!("{}{what}: {veins}, speed against accuracy", self.scenario)
    }

    fn report_lines(&self, _: &Units) -> LabelledLines {
        let mut lines = label_first_line("errors", reference_lines(self));
        lines.push(("measured", measurement_line(self)));
        lines.extend(label_first_line("front", pareto_front_lines(self)));
        lines.extend(label_first_line("fastest", fastest_by_accuracy_lines(self)));
        lines.extend(label_first_line("failed", failure_lines(self)));
        lines.extend(label_first_line("peers", peer_lines(self)));
        lines.extend(
            (self.scaling.iter()).flat_map(|it| label_first_line("veins", scaling_lines(it))),
        );
        lines.extend((self.remarks.iter()).map(|remark| ("remark", remark.to_string())));
        lines
    }
}

fn reference_lines(chart: &Chart) -> Vec<String> {
    let Some(found) = &chart.reference else {
        let what = match chart.motion {
            true => "no method follows the motion on three grids",
            false => "no equilibrium was found to measure them against",
        };
        return vec![format!("not known: {what}")];
    };
    let within = format_error_bound(found.known_within);
    let accuracy = match found.confirmed {
        true => format!("against a solution known within {within} of the longest vein"),
        false => format!(
            "against a solution that is NOT CONFIRMED, taken to be within {within} of the longest vein"
        ),
    };
    let agreement = match found.difference {
        Some(difference) => {
            let difference = format_error_bound(difference);
            format!("{}; they differ by {difference}", found.told)
        }
        None => found.told.clone(),
    };
    vec![accuracy, agreement]
}

fn measurement_line(chart: &Chart) -> String {
    let spreads = || chart.rows.iter().filter_map(|row| row.seconds);
    let runs: usize = spreads().map(|spread| spread.runs).sum();
    let (settings, rounds) = (spreads().count(), chart.rounds);
    format!(
        "{runs} runs of {settings} settings in turns, {rounds} rounds, one thread; times are medians"
    )
}

/// A line of a table: time, error, method and setting.
fn table_line(time: f64, error: f64, method: &str, knob: &str) -> String {
    let (time, error) = (duration_text(time), format_error_bound(error));
    format!("{time:>10}  {error:<9} {method}, {knob}")
}

fn pareto_front_lines(chart: &Chart) -> Vec<String> {
    let rows = chart.rows.iter().filter(|row| row.pareto == Some(true));
    let rows = rows.filter_map(|row| {
        let (time, error) = row.seconds_and_error()?;
        let (name, knob) = (
            contender_name(row.contender, chart.motion),
            row.knob.to_string(),
        );
        Some((time, table_line(time, error, name, &knob)))
    });
    let peers = chart.peers.iter().filter(|peer| peer.pareto);
    let peers = peers.filter_map(|peer| {
        let (time, error) = peer.seconds_and_error()?;
        Some((time, table_line(time, error, &peer.name, &peer.knob)))
    });
    let mut entries: Vec<_> = rows.chain(peers).collect();
    entries.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    entries.into_iter().map(|(_, line)| line).collect()
}

fn fastest_by_accuracy_lines(chart: &Chart) -> Vec<String> {
    let line = |decade: &FastestByAccuracy| -> Option<String> {
        let default = match (decade.factor, decade.default_knob) {
            (Some(1.0), _) => "the default".to_string(),
            (Some(factor), Some(knob)) => {
                format!("the default ({knob}) takes {factor:.2} times as long")
            }
            _ => "the default does not get there".to_string(),
        };
        let (time, error) = (
            duration_text(decade.seconds?),
            format!("{:e}", decade.error),
        );
        let (who, knob) = (
            contender_name(decade.contender?, chart.motion),
            decade.knob?,
        );
        Some(format!(
            "{time:>10}  to {error:<7} {who}, {knob}; {default}"
        ))
    };
    chart.decades.iter().filter_map(line).collect()
}

/// Failures, one line for each contender and kind of failure.
fn failure_lines(chart: &Chart) -> Vec<String> {
    let mut kinds: Vec<(&ChartRow, Vec<String>)> = Vec::new();
    // What is refused altogether is told by a remark.
    let is_charted = |row: &&ChartRow| {
        let mut remarks = chart.remarks.iter();
        !remarks.any(|remark| matches!(remark, ChartRemark::NotCharted { contender, .. } if *contender == row.contender))
    };
    let rows = chart.rows.iter().filter(is_charted);
    for row in rows.filter(|row| !row.ending.is_success()) {
        let same =
            |other: &ChartRow| other.contender == row.contender && other.ending == row.ending;
        match kinds.iter_mut().find(|(other, _)| same(other)) {
            Some((_, knobs)) => knobs.push(row.knob.to_string()),
            None => kinds.push((row, vec![row.knob.to_string()])),
        }
    }
    let line = |(row, knobs): (&ChartRow, Vec<String>)| {
        let why = row.remark.as_ref();
        let why = why.map_or(String::new(), |why| format!(": {why}"));
        let (who, knobs, end) = (
            contender_name(row.contender, chart.motion),
            settings_text(&knobs),
            row.ending.word(),
        );
        format!("{who}, {knobs}, {end}{why}")
    };
    kinds.into_iter().map(line).collect()
}

/// Values of one setting, with its name only once.
fn settings_text(knobs: &[String]) -> String {
    let values = knobs.iter().map(|knob| match knob.split_once('=') {
        Some((_, value)) => value,
        None => knob,
    });
    let values: Vec<&str> = values.collect();
    let name = knobs.first().and_then(|knob| knob.split_once('='));
    match name {
        Some((name, _)) => format!("{name}={}", values.join(",")),
        None => values.join(","),
    }
}

/// How many times longer each peer takes, from its largest error to its smallest.
fn peer_lines(chart: &Chart) -> Vec<String> {
    let mut names: Vec<&str> = Vec::new();
    for peer in &chart.peers {
        if !names.contains(&peer.name.as_str()) {
            names.push(&peer.name);
        }
    }
    let mut lines = Vec::new();
    for name in names {
        let rows = || chart.peers.iter().filter(|peer| peer.name == name);
        let measured = rows().filter_map(|peer| Some((peer, peer.true_error?)));
        let mut measured: Vec<(&PeerProgram, f64)> = measured.collect();
        measured.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (peer, error) in measured {
            let ratio = match peer.ratio {
                Some(ratio) => format!("{} times the default's time", format_ratio(ratio)),
                None => "the default is nowhere as accurate".into(),
            };
            let line = table_line(peer.seconds.median, error, name, &peer.knob);
            lines.push(format!("{line}: {ratio}"));
        }
        for peer in rows().filter(|peer| peer.true_error.is_none()) {
            let time = duration_text(peer.seconds.median);
            let (knob, outcome) = (&peer.knob, &peer.outcome);
            lines.push(format!("{time:>10}  {name}, {knob}, {outcome}"));
        }
    }
    lines
}

/// Two digits, or all digits before the decimal point.
fn format_ratio(ratio: f64) -> String {
    match ratio {
        ratio if ratio >= 10.0 => format!("{ratio:.0}"),
        ratio => format!("{ratio:.1}"),
    }
}

/// The time of each contender on each leaf.
fn scaling_lines(scaling: &ScalingStudy) -> Vec<String> {
    let mut lines = vec![format!("to a tolerance of {:e}", scaling.tolerance)];
    if !scaling.unconfirmed.is_empty() {
        let rods: Vec<String> = scaling.unconfirmed.iter().map(usize::to_string).collect();
        let rods = rods.join(", ");
        lines.push(format!("reference NOT CONFIRMED for N = {rods}"));
    }
    let mut last = None;
    for found in &scaling.rows {
        let row = &found.row;
        let what = match (row.seconds_and_error(), row.seconds) {
            (Some((time, _)), _) => duration_text(time),
            (None, _) => row.ending.word().to_string(),
        };
        let cell = format!("N = {}: {what}", found.rods);
        match lines.last_mut().filter(|_| last == Some(row.contender)) {
            Some(line) => *line = format!("{line}, {cell}"),
            None => lines.push(format!("{}, {cell}", contender_name(row.contender, false))),
        }
        last = Some(row.contender);
    }
    lines
}

/// `chart.csv`: one row per contender and setting, then those of the peers.
pub fn write_chart_table(chart: &Chart, out: &mut dyn Write) -> io::Result<()> {
    let rows = chart.rows.iter().map(json_object);
    let peers = chart.peers.iter().map(|peer| {
        let mut row = json_object(peer);
        row["method"] = row["program"].take();
        row
    });
    write_columns(&format!("{CHART_COLUMNS},pareto"), rows.chain(peers), out)
}

/// `chart_rods.csv`: one row per leaf and contender.
pub fn write_scaling_table(scaling: &ScalingStudy, out: &mut dyn Write) -> io::Result<()> {
    let rows = scaling.rows.iter().map(json_object);
    write_columns(&format!("rods,{CHART_COLUMNS}"), rows, out)
}

fn json_object(row: &impl Serialize) -> Value {
    serde_json::to_value(row).unwrap_or_default()
}

/// Writes these columns; missing values, and numbers that are not finite, are empty cells.
fn write_columns(
    columns: &str,
    rows: impl Iterator<Item = Value>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(columns.split(','))?;
    for row in rows {
        let cell = |column: &str| match &row[column] {
            Value::String(text) => text_cell(text).into(),
            Value::Bool(yes) => yes.to_string(),
            Value::Number(count) if count.is_u64() => match row["seconds"].is_null() {
                // Nothing was measured.
                true if column == "runs" => String::new(),
                _ => count.to_string(),
            },
            Value::Number(number) => format!("{:e}", number.as_f64().unwrap_or(f64::NAN)),
            _ => String::new(),
        };
        table.write_record(columns.split(',').map(cell))?;
    }
    table.flush()
}

#[cfg(test)]
mod tests {
    use crate::report::sample;

    use leafdyn::study::ChartOutcome;

    use super::*;

    #[test]
    fn unconfirmed_references_are_reported_and_failures_of_a_kind_are_one_line() {
        let mut chart = sample::sample_chart();
        if let Some(reference) = &mut chart.reference {
            reference.confirmed = false;
        }
        for row in chart.rows.iter_mut().take(2) {
            row.ending = ChartOutcome::OtherEquilibrium;
        }
        let text = chart.report(&Units::default(), Vec::new(), false);
        assert!(text.contains("that is NOT CONFIRMED"), "{text}");
        let failed = "semi-implicit, extrapolated, tolerance=1e-2,1e-6, other-equilibrium\n";
        assert!(text.contains(failed), "{text}");
        chart.reference = None;
        let text = chart.report(&Units::default(), Vec::new(), false);
        let unknown = "  errors   not known: no equilibrium was found";
        assert!(text.contains(unknown), "{text}");
    }
}
