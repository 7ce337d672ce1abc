//! `summary.json`: what scripts read.

use std::io::{self, Write};

use serde::Serialize;

use super::{Point, points, tips, write};
use crate::relax::Equilibrium;
use crate::report::{Format, words};
use crate::undulation::Undulation;

/// `summary.json`, which is also what `--json` prints.
pub struct Summary;

impl Format<Equilibrium> for Summary {
    fn file_name(&self) -> &'static str {
        "summary.json"
    }

    fn write(&self, equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(equilibrium), out)
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
    lowest_eigenvalues: Option<Vec<f64>>,
    eigenvalue_errors: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    saddle: Option<Saddle>,
    undulation: Waves,
    model: String,
    shear_effect: Option<f64>,
    stretch_effect: Option<f64>,
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

/// Waves and twist of the veins; lengths in units of length, angles in radians.
#[derive(Serialize)]
struct Waves {
    handedness: &'static str,
    twist: f64,
    margins: Option<Margins>,
    veins: Vec<VeinWaves>,
}

/// Of the margin that has more waves, or higher ones.
#[derive(Serialize)]
struct Margins {
    waves: f64,
    amplitude: f64,
    wavelength: Option<f64>,
    predicted_waves: f64,
}

#[derive(Serialize)]
struct VeinWaves {
    waves: f64,
    amplitude: f64,
    wavelength: Option<f64>,
    twist: f64,
    tension: f64,
    load_number: f64,
    predicted_waves: f64,
}

impl From<&Undulation> for Waves {
    fn from(undulation: &Undulation) -> Self {
        Waves {
            handedness: undulation.hand().word(),
            twist: undulation.twist(),
            margins: undulation.margin().map(|vein| Margins {
                waves: vein.waves(),
                amplitude: vein.amplitude,
                wavelength: vein.wavelength,
                predicted_waves: vein.predicted_waves(),
            }),
            veins: (undulation.veins.iter())
                .map(|vein| VeinWaves {
                    waves: vein.waves(),
                    amplitude: vein.amplitude,
                    wavelength: vein.wavelength,
                    twist: vein.twist,
                    tension: vein.tension,
                    load_number: vein.load_number,
                    predicted_waves: vein.predicted_waves(),
                })
                .collect(),
        }
    }
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
        let (tip, tips) = tips(&equilibrium.tips);
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
            lowest_eigenvalues: eigenvalues(equilibrium),
            eigenvalue_errors: errors(equilibrium),
            saddle: equilibrium.saddle.map(|saddle| Saddle {
                energy: saddle.energy,
                negative_eigenvalues: saddle.negative_eigenvalues,
                tip: saddle.tip.to_array(),
            }),
            undulation: Waves::from(&equilibrium.undulation),
            model: words::model(equilibrium),
            shear_effect: equilibrium.model.shear,
            stretch_effect: equilibrium.model.stretch,
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
                .map(|rod| points(rod.nodes.iter().map(|node| node.position)))
                .collect(),
        }
    }
}

fn eigenvalues(equilibrium: &Equilibrium) -> Option<Vec<f64>> {
    let modes = equilibrium.modes.as_ref()?;
    Some(modes.iter().map(|mode| mode.eigenvalue).collect())
}

/// Only all together.
fn errors(equilibrium: &Equilibrium) -> Option<Vec<f64>> {
    let modes = equilibrium.modes.as_ref()?;
    modes.iter().map(|mode| mode.error).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::super::tests::{keys, text};
    use super::*;
    use crate::relax::Outcome;
    use crate::report::sample;

    fn value(equilibrium: &Equilibrium) -> Value {
        serde_json::from_str(&text(&Summary, equilibrium)).unwrap()
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
            "lowest_eigenvalues",
            "eigenvalue_errors",
            "undulation",
            "model",
            "shear_effect",
            "stretch_effect",
            "work",
            "wall_seconds",
            "stations",
            "positions",
        ];
        assert_eq!(keys(&text(&Summary, &sample::fan(5, 8))), wanted);
    }

    #[test]
    fn numbers_survive_the_round_trip() {
        let mut leaf = sample::fan(2, 4);
        leaf.energy = 0.1 + 0.2;
        let text = text(&Summary, &leaf);
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
