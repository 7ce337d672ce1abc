//! `chart.json`: speed against accuracy, for scripts.

use std::io::{self, Write};

use serde::Serialize;

use super::write;
use crate::report::Format;
use crate::study::{Chart, Decade, Peer, Reference, Row, Scaling, Spread};

/// `chart.json`, which is also what `--json` prints.
pub struct ChartSummary;

impl Format<Chart> for ChartSummary {
    fn file_name(&self) -> &'static str {
        "chart.json"
    }

    fn write(&self, chart: &Chart, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(chart), out)
    }
}

/// The keys, in the order in which they are written.
#[derive(Serialize)]
struct Object<'a> {
    scenario: &'a str,
    rods: usize,
    threads: usize,
    rounds: usize,
    reference: Option<ReferenceObject<'a>>,
    remarks: &'a [String],
    runs: Vec<RunObject<'a>>,
    peers: Vec<PeerObject<'a>>,
    decades: Vec<DecadeObject>,
    scaling: Option<ScalingObject<'a>>,
}

#[derive(Serialize)]
struct ReferenceObject<'a> {
    confirmed: bool,
    told: &'a str,
    known_within: f64,
    relaxation_estimate: Option<f64>,
    shooting_estimate: Option<f64>,
    difference: Option<f64>,
    neutral: Option<&'a str>,
}

#[derive(Serialize)]
struct RunObject<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    rods: Option<usize>,
    method: &'static str,
    knob: String,
    seconds: Option<f64>,
    seconds_min: Option<f64>,
    seconds_q1: Option<f64>,
    seconds_q3: Option<f64>,
    runs: usize,
    steps: Option<usize>,
    factorizations: Option<usize>,
    force_evaluations: Option<usize>,
    true_error: Option<f64>,
    error_estimate: Option<f64>,
    outcome: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pareto: Option<bool>,
}

#[derive(Serialize)]
struct PeerObject<'a> {
    program: &'a str,
    knob: &'a str,
    seconds: f64,
    seconds_min: f64,
    seconds_q1: f64,
    seconds_q3: f64,
    runs: usize,
    true_error: Option<f64>,
    outcome: &'a str,
    pareto: bool,
    ratio: Option<f64>,
}

/// The fastest way to an error, and how much slower the default one is.
#[derive(Serialize)]
struct DecadeObject {
    error: f64,
    method: Option<&'static str>,
    knob: Option<String>,
    seconds: Option<f64>,
    default_knob: Option<String>,
    default_seconds: Option<f64>,
    factor: Option<f64>,
}

#[derive(Serialize)]
struct ScalingObject<'a> {
    tolerance: f64,
    unconfirmed: &'a [usize],
    runs: Vec<RunObject<'a>>,
}

impl<'a> From<&'a Chart> for Object<'a> {
    fn from(chart: &'a Chart) -> Self {
        let run = |row: &'a Row| RunObject {
            pareto: Some(row.pareto),
            ..RunObject::from(row)
        };
        let peer = |peer: &'a Peer| PeerObject {
            program: &peer.name,
            knob: &peer.knob,
            seconds: peer.seconds.median,
            seconds_min: peer.seconds.min,
            seconds_q1: peer.seconds.q1,
            seconds_q3: peer.seconds.q3,
            runs: peer.seconds.runs,
            true_error: peer.true_error,
            outcome: &peer.outcome,
            pareto: peer.pareto,
            ratio: chart.ratio(peer),
        };
        Object {
            scenario: &chart.scenario,
            rods: chart.rods,
            threads: 1,
            rounds: chart.rounds,
            reference: chart.reference.as_ref().map(ReferenceObject::from),
            remarks: &chart.remarks,
            runs: chart.rows.iter().map(run).collect(),
            peers: chart.peers.iter().map(peer).collect(),
            decades: chart
                .decades()
                .iter()
                .map(|decade| DecadeObject::new(chart, decade))
                .collect(),
            scaling: chart.scaling.as_ref().map(ScalingObject::from),
        }
    }
}

impl<'a> From<&'a Reference> for ReferenceObject<'a> {
    fn from(reference: &'a Reference) -> Self {
        ReferenceObject {
            confirmed: reference.confirmed,
            told: &reference.told,
            known_within: reference.known_within,
            relaxation_estimate: reference.relaxed,
            shooting_estimate: reference.shot,
            difference: reference.difference,
            neutral: reference.neutral.as_deref(),
        }
    }
}

impl<'a> From<&'a Row> for RunObject<'a> {
    fn from(row: &'a Row) -> Self {
        let time = |part: fn(Spread) -> f64| row.seconds.map(part);
        let count = |count: usize| row.seconds.map(|_| count);
        RunObject {
            rods: None,
            method: row.contender.word(),
            knob: row.knob.to_string(),
            seconds: time(|spread| spread.median),
            seconds_min: time(|spread| spread.min),
            seconds_q1: time(|spread| spread.q1),
            seconds_q3: time(|spread| spread.q3),
            runs: row.seconds.map_or(0, |spread| spread.runs),
            steps: count(row.work.steps),
            factorizations: count(row.work.factorizations),
            force_evaluations: count(row.work.force_evaluations),
            true_error: row.true_error,
            error_estimate: row.error_estimate,
            outcome: row.ending.word(),
            remark: row.remark.as_deref(),
            pareto: None,
        }
    }
}

impl DecadeObject {
    fn new(chart: &Chart, decade: &Decade) -> Self {
        let row = |place: Option<usize>| place.and_then(|place| chart.rows.get(place));
        let (fastest, default) = (row(decade.fastest), row(decade.default));
        let knob = |row: Option<&Row>| row.map(|row| row.knob.to_string());
        let seconds = |row: Option<&Row>| row?.seconds.map(|spread| spread.median);
        DecadeObject {
            error: decade.error,
            method: fastest.map(|row| row.contender.word()),
            knob: knob(fastest),
            seconds: seconds(fastest),
            default_knob: knob(default),
            default_seconds: seconds(default),
            factor: decade.factor,
        }
    }
}

impl<'a> From<&'a Scaling> for ScalingObject<'a> {
    fn from(scaling: &'a Scaling) -> Self {
        let runs = scaling.rows.iter().map(|found| RunObject {
            rods: Some(found.rods),
            ..RunObject::from(&found.row)
        });
        ScalingObject {
            tolerance: scaling.tolerance,
            unconfirmed: &scaling.unconfirmed,
            runs: runs.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::super::tests::{keys, text};
    use super::*;
    use crate::report::sample;

    fn value(chart: &Chart) -> Value {
        serde_json::from_str(&text(&ChartSummary, chart)).unwrap()
    }

    #[test]
    fn keys_and_their_order_are_fixed() {
        let chart = sample::chart();
        let wanted = [
            "scenario",
            "rods",
            "threads",
            "rounds",
            "reference",
            "remarks",
            "runs",
            "peers",
            "decades",
            "scaling",
        ];
        assert_eq!(keys(&text(&ChartSummary, &chart)), wanted);
        let chart = value(&chart);
        let names =
            |value: &Value| -> Vec<String> { value.as_object().unwrap().keys().cloned().collect() };
        let mut wanted = vec![
            "method",
            "knob",
            "seconds",
            "seconds_min",
            "seconds_q1",
            "seconds_q3",
            "runs",
            "steps",
            "factorizations",
            "force_evaluations",
            "true_error",
            "error_estimate",
            "outcome",
            "pareto",
        ];
        wanted.sort_unstable();
        let mut found = names(&chart["runs"][0]);
        found.sort_unstable();
        assert_eq!(found, wanted);
    }

    #[test]
    fn runs_peers_and_decades() {
        let mut chart = sample::chart();
        chart.scaling = Some(sample::scaling());
        let chart = value(&chart);
        assert_eq!(chart["reference"]["confirmed"], true);
        assert_eq!(chart["runs"][0]["seconds"], 1e-3);
        assert_eq!(chart["runs"][0]["pareto"], true);
        assert_eq!(chart["peers"][0]["ratio"], 125.0);
        assert_eq!(chart["decades"].as_array().unwrap().len(), 9);
        assert_eq!(chart["decades"][0]["factor"], 2.0);
        assert_eq!(chart["decades"][0]["method"], "semi-implicit-grid");
        assert_eq!(chart["scaling"]["runs"][0]["rods"], 5);
        assert_eq!(chart["scaling"]["runs"][0].get("pareto"), None);
    }

    #[test]
    fn what_did_not_run_or_succeed_is_there_all_the_same() {
        let mut chart = sample::chart();
        chart.reference = None;
        let chart = value(&chart);
        assert_eq!(chart["reference"], Value::Null);
        let runs = chart["runs"].as_array().unwrap();
        let not_run = runs.iter().find(|run| run["outcome"] == "not-run").unwrap();
        assert_eq!(not_run["seconds"], Value::Null);
        assert_eq!(not_run["runs"], 0);
        let failed = runs
            .iter()
            .find(|run| run["outcome"] == "not-at-rest")
            .unwrap();
        assert_eq!(failed["true_error"], Value::Null);
        assert_eq!(failed["remark"], "perturbations grow");
    }
}
