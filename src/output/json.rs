//! `summary.json`: what scripts read.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::Formatter;

use super::Format;
use crate::relax::Equilibrium;

/// `summary.json`, which is also what `--json` prints.
pub struct Summary;

impl Format for Summary {
    fn file_name(&self) -> &'static str {
        "summary.json"
    }

    fn write(&self, equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
        let mut serializer = serde_json::Serializer::with_formatter(&mut *out, Layout::default());
        Object::from(equilibrium).serialize(&mut serializer)?;
        out.write_all(b"\n")
    }
}

type Point = [f64; 3];

/// The keys, in the order in which they are written. Numbers that are not
/// finite become null.
#[derive(Serialize)]
struct Object<'a> {
    scenario: &'a str,
    method: &'a str,
    outcome: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<&'a str>,
    rods: usize,
    segments: &'a [usize],
    #[serde(skip_serializing_if = "Option::is_none")]
    intervals: Option<usize>,
    tolerance: f64,
    residual: f64,
    error_estimate: Option<f64>,
    energy: f64,
    tip: Option<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tips: Option<Vec<Point>>,
    tip_force_sum: Point,
    stable: Option<bool>,
    negative_eigenvalues: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    saddle: Option<Saddle>,
    work: Work,
    wall_seconds: f64,
    stations: &'a [f64],
    positions: Vec<Vec<Point>>,
}

#[derive(Serialize)]
struct Saddle {
    energy: f64,
    negative_eigenvalues: usize,
    tip: Point,
}

#[derive(Serialize)]
struct Work {
    steps: usize,
    factorizations: usize,
    force_evaluations: usize,
    cg_iterations: usize,
}

impl<'a> From<&'a Equilibrium> for Object<'a> {
    fn from(equilibrium: &'a Equilibrium) -> Self {
        let tips: Vec<Point> = equilibrium.tips.iter().map(|tip| tip.to_array()).collect();
        let (tip, tips) = match tips.as_slice() {
            [only] => (Some(*only), None),
            _ => (None, Some(tips)),
        };
        let work = equilibrium.work;
        Object {
            scenario: &equilibrium.scenario,
            method: equilibrium.method,
            outcome: equilibrium.outcome.word(),
            remark: equilibrium.remark.as_deref(),
            rods: equilibrium.rods.len(),
            segments: &equilibrium.segments,
            intervals: equilibrium.intervals,
            tolerance: equilibrium.tolerance,
            residual: equilibrium.residual,
            error_estimate: equilibrium.error_estimate,
            energy: equilibrium.energy,
            tip,
            tips,
            tip_force_sum: equilibrium.tip_force_sum.to_array(),
            stable: equilibrium.stable(),
            negative_eigenvalues: equilibrium.negative_eigenvalues,
            saddle: equilibrium.saddle.map(|saddle| Saddle {
                energy: saddle.energy,
                negative_eigenvalues: saddle.negative_eigenvalues,
                tip: saddle.tip.to_array(),
            }),
            work: Work {
                steps: work.steps,
                factorizations: work.factorizations,
                force_evaluations: work.force_evaluations,
                cg_iterations: work.cg_iterations,
            },
            wall_seconds: equilibrium.wall_seconds,
            stations: &equilibrium.stations,
            positions: equilibrium
                .rods
                .iter()
                .map(|rod| {
                    rod.nodes
                        .iter()
                        .map(|node| node.position.to_array())
                        .collect()
                })
                .collect(),
        }
    }
}

/// Compact JSON with each key of the outermost object on its own line.
#[derive(Default)]
struct Layout {
    depth: usize,
}

impl Formatter for Layout {
    fn begin_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth += 1;
        out.write_all(b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth -= 1;
        out.write_all(if self.depth == 0 { b"\n}" } else { b"}" })
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        if !first {
            out.write_all(b",")?;
        }
        out.write_all(match (self.depth, first) {
            (1, _) => b"\n  ",
            (_, true) => b"",
            (_, false) => b" ",
        })
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        out.write_all(b": ")
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::output::sample;
    use crate::relax::Outcome;

    fn text(equilibrium: &Equilibrium) -> String {
        let mut bytes = Vec::new();
        Summary.write(equilibrium, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    fn value(equilibrium: &Equilibrium) -> Value {
        serde_json::from_str(&text(equilibrium)).unwrap()
    }

    /// Keys of the outermost object, in the order written.
    fn keys(text: &str) -> Vec<&str> {
        text.lines()
            .filter_map(|line| line.strip_prefix("  \""))
            .map(|line| line.split('"').next().unwrap())
            .collect()
    }

    #[test]
    fn keys_and_their_order_are_fixed() {
        let wanted = [
            "scenario",
            "method",
            "outcome",
            "rods",
            "segments",
            "tolerance",
            "residual",
            "error_estimate",
            "energy",
            "tip",
            "tip_force_sum",
            "stable",
            "negative_eigenvalues",
            "work",
            "wall_seconds",
            "stations",
            "positions",
        ];
        assert_eq!(keys(&text(&sample::fan(5, 8))), wanted);
    }

    #[test]
    fn numbers_survive_the_round_trip() {
        let mut leaf = sample::fan(2, 4);
        leaf.energy = 0.1 + 0.2;
        let text = text(&leaf);
        assert!(
            text.contains("\n  \"energy\": 0.30000000000000004,\n"),
            "{text}"
        );
        assert_eq!(
            value(&leaf)["positions"][1][4][0],
            leaf.rods[1].nodes[4].position.x
        );
    }

    #[test]
    fn what_is_not_known_is_null() {
        let mut leaf = sample::fan(2, 4);
        leaf.outcome = Outcome::NotAtRest;
        leaf.error_estimate = None;
        leaf.negative_eigenvalues = None;
        leaf.energy = f64::NAN;
        leaf.residual = f64::INFINITY;
        leaf.remark = Some("raise the step limit".into());
        let value = value(&leaf);
        for key in [
            "error_estimate",
            "negative_eigenvalues",
            "stable",
            "energy",
            "residual",
        ] {
            assert_eq!(value[key], Value::Null, "{key}");
        }
        assert_eq!(value["outcome"], "not-at-rest");
        assert_eq!(value["remark"], "raise the step limit");
    }

    #[test]
    fn free_tips_are_listed() {
        let mut leaf = sample::fan(3, 4);
        leaf.joined = false;
        leaf.tips = vec![leaf.tips[0]; 3];
        let value = value(&leaf);
        assert_eq!(value["tip"], Value::Null);
        assert_eq!(value["tips"].as_array().unwrap().len(), 3);
    }
}
