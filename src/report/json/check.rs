//! `check.json`: both roads to an equilibrium, and how far apart they end.

use std::io::{self, Write};

use glam::DVec3;
use serde::Serialize;

use super::{Point, points, tips, write};
use crate::bvp::{self, Failure, Neutral, Reason};
use crate::relax::Equilibrium;
use crate::report::Format;
use crate::shape::{Difference, RodShape};
use crate::study::{Check, Shot, Verdict};

/// `check.json`, which is also what `--json` prints.
pub struct CheckSummary;

impl Format<Check> for CheckSummary {
    fn file_name(&self) -> &'static str {
        "check.json"
    }

    fn write(&self, check: &Check, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(check), out)
    }
}

/// The keys, in the order in which they are written.
#[derive(Serialize)]
struct Object<'a> {
    scenario: &'a str,
    verdict: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'a str>,
    rods: usize,
    tolerance: f64,
    difference: Option<Differences>,
    within_estimates: Option<bool>,
    relaxation: Relaxation<'a>,
    shooting: Option<Shooting>,
    stations: &'a [f64],
    differences: Vec<Differences>,
}

#[derive(Serialize)]
struct Differences {
    position: f64,
    rotation: f64,
    force: f64,
    moment: f64,
}

#[derive(Serialize)]
struct Relaxation<'a> {
    outcome: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<&'a str>,
    segments: &'a [usize],
    error_estimate: Option<f64>,
    residual: Option<f64>,
    energy: Option<f64>,
    tip: Option<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tips: Option<Vec<Point>>,
    stable: Option<bool>,
    negative_eigenvalues: Option<usize>,
    wall_seconds: f64,
}

/// Without a solution, everything but the outcome, the work and perhaps the
/// neutral direction is null.
#[derive(Serialize)]
struct Shooting {
    outcome: &'static str,
    intervals: Option<usize>,
    growth_log10: Option<f64>,
    defect: Option<f64>,
    condition: Option<f64>,
    error_estimate: Option<Differences>,
    energy: Option<f64>,
    tip: Option<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tips: Option<Vec<Point>>,
    stable: Option<bool>,
    negative_eigenvalues: Option<usize>,
    neutral: Option<NeutralDirection>,
    work: Work,
    wall_seconds: Option<f64>,
}

#[derive(Serialize)]
struct NeutralDirection {
    ratio: f64,
    meaning: String,
    displacement: Vec<Vec<Point>>,
}

#[derive(Serialize)]
struct Work {
    iterations: usize,
    linearizations: usize,
    steps: usize,
    slopes: usize,
}

impl<'a> From<&'a Check> for Object<'a> {
    fn from(check: &'a Check) -> Self {
        let relaxed = &check.relaxed;
        Object {
            scenario: &relaxed.scenario,
            verdict: check.verdict.word(),
            reason: match &check.verdict {
                Verdict::NotCompared(reason) => Some(reason),
                _ => None,
            },
            rods: relaxed.shape.rods.len(),
            tolerance: relaxed.accuracy.tolerance,
            difference: check.difference.map(Differences::from),
            within_estimates: check.within_estimates(),
            relaxation: Relaxation::from(relaxed),
            shooting: check.shot.as_ref().map(|shot| {
                let shooting = match shot {
                    Ok(shot) => Shooting::solved(shot, relaxed.shape.joined),
                    Err(failure) => Shooting::failed(failure),
                };
                Shooting {
                    wall_seconds: check.shot_seconds,
                    ..shooting
                }
            }),
            stations: &relaxed.shape.stations,
            differences: check.along.iter().copied().map(Differences::from).collect(),
        }
    }
}

impl From<Difference> for Differences {
    fn from(difference: Difference) -> Self {
        let Difference {
            position,
            rotation,
            force,
            moment,
        } = difference;
        Differences {
            position,
            rotation,
            force,
            moment,
        }
    }
}

impl<'a> From<&'a Equilibrium> for Relaxation<'a> {
    fn from(relaxed: &'a Equilibrium) -> Self {
        let (tip, tips) = tips(&relaxed.tips);
        Relaxation {
            outcome: relaxed.outcome.word(),
            remark: relaxed.remark.as_deref(),
            segments: &relaxed.accuracy.segments,
            error_estimate: relaxed.accuracy.error_estimate,
            residual: relaxed.accuracy.residual,
            energy: relaxed.energy,
            tip,
            tips,
            stable: relaxed.stable(),
            negative_eigenvalues: relaxed.stability.negative_eigenvalues,
            wall_seconds: relaxed.wall_seconds,
        }
    }
}

impl Shooting {
    fn solved(shot: &Shot, joined: bool) -> Self {
        let solution = &shot.solution;
        let (tip, tips) = tips(&ends(&solution.rods, joined));
        Shooting {
            intervals: Some(solution.intervals.len() - 1),
            growth_log10: Some(solution.growth),
            defect: Some(solution.defect),
            condition: Some(solution.condition),
            error_estimate: Some(solution.error.into()),
            energy: Some(solution.energy),
            tip,
            tips,
            stable: shot.stable(),
            negative_eigenvalues: shot.negative_eigenvalues,
            neutral: solution.neutral.as_ref().map(NeutralDirection::from),
            ..Shooting::blank("converged", solution.work)
        }
    }

    fn failed(failure: &Failure) -> Self {
        let (outcome, neutral) = match &failure.reason {
            Reason::Singular(neutral) => ("singular", Some(neutral)),
            Reason::NoConvergence { .. } => ("no-convergence", None),
            Reason::Unbounded { .. } => ("unbounded", None),
        };
        Shooting {
            neutral: neutral.map(NeutralDirection::from),
            ..Shooting::blank(outcome, failure.work)
        }
    }

    fn blank(outcome: &'static str, work: bvp::Work) -> Self {
        Shooting {
            outcome,
            intervals: None,
            growth_log10: None,
            defect: None,
            condition: None,
            error_estimate: None,
            energy: None,
            tip: None,
            tips: None,
            stable: None,
            negative_eigenvalues: None,
            neutral: None,
            work: Work {
                iterations: work.iterations,
                linearizations: work.linearizations,
                steps: work.steps,
                slopes: work.slopes,
            },
            wall_seconds: None,
        }
    }
}

/// The joint tip alone, or one tip per rod.
fn ends(rods: &[RodShape], joined: bool) -> Vec<DVec3> {
    let listed = if joined { 1 } else { rods.len() };
    let ends = rods.iter().take(listed).filter_map(|rod| rod.nodes.last());
    ends.map(|node| node.position).collect()
}

impl From<&Neutral> for NeutralDirection {
    fn from(neutral: &Neutral) -> Self {
        let moved = neutral.displacement.iter();
        NeutralDirection {
            ratio: neutral.ratio,
            meaning: neutral.to_string(),
            displacement: moved.map(|rod| points(rod.iter().copied())).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::tests::{keys, text};
    use super::*;
    use crate::report::sample;

    fn value(check: &Check) -> Value {
        serde_json::from_str(&text(&CheckSummary, check)).unwrap()
    }

    fn failed(reason: Reason) -> Check {
        let mut check = sample::check(3, 8, 0.0);
        check.verdict = Verdict::NotCompared(reason.to_string());
        check.shot = Some(Err(Failure {
            reason,
            part: 1.0,
            rods: check.relaxed.shape.rods.clone(),
            work: bvp::Work::default(),
        }));
        check.difference = None;
        check.along.clear();
        check
    }

    #[test]
    fn keys_and_their_order_are_fixed() {
        let mut wanted = vec![
            "scenario",
            "verdict",
            "rods",
            "tolerance",
            "difference",
            "within_estimates",
            "relaxation",
            "shooting",
            "stations",
            "differences",
        ];
        assert_eq!(
            keys(&text(&CheckSummary, &sample::check(3, 8, 0.0))),
            wanted
        );
        wanted.insert(2, "reason");
        let check = failed(Reason::Unbounded { sigma: 0.5 });
        assert_eq!(keys(&text(&CheckSummary, &check)), wanted);
    }

    #[test]
    fn both_solutions_and_their_differences() {
        let check = value(&sample::check(3, 8, 0.1));
        assert_eq!(check["verdict"], "differ");
        assert_eq!(check["within_estimates"], false);
        assert!((check["difference"]["rotation"].as_f64().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(check["differences"].as_array().unwrap().len(), 9);
        assert_eq!(check["differences"][0]["position"], 0.0);
        assert_eq!(check["relaxation"]["stable"], true);
        let shooting = &check["shooting"];
        assert_eq!(shooting["outcome"], "converged");
        assert_eq!(shooting["stable"], false);
        assert_eq!(shooting["negative_eigenvalues"], 2);
        assert_eq!(shooting["intervals"], 2);
        assert_eq!(shooting["growth_log10"], 4.2);
        assert_eq!(shooting["error_estimate"]["force"], 3e-9);
        assert_eq!(
            shooting["neutral"]["displacement"][2][8],
            json!([0.0, 0.0, 0.0])
        );
        assert_eq!(shooting["wall_seconds"], 0.02);
    }

    #[test]
    fn failures_keep_all_keys() {
        let solved = value(&sample::check(3, 8, 0.0));
        let neutral = Neutral {
            ratio: 1e-15,
            displacement: vec![vec![DVec3::Z; 9]; 3],
        };
        for (reason, outcome) in [
            (Reason::Unbounded { sigma: 0.5 }, "unbounded"),
            (
                Reason::NoConvergence {
                    correction: 0.1,
                    growth: 2.0,
                },
                "no-convergence",
            ),
            (Reason::Singular(neutral), "singular"),
        ] {
            let check = value(&failed(reason));
            let shooting = &check["shooting"];
            assert_eq!(shooting["outcome"], outcome);
            let names = |value: &Value| -> Vec<String> {
                value.as_object().unwrap().keys().cloned().collect()
            };
            assert_eq!(names(shooting), names(&solved["shooting"]));
            for key in ["defect", "tip", "stable", "error_estimate"] {
                assert_eq!(shooting[key], Value::Null, "{key}");
            }
            assert_eq!(shooting["neutral"] == Value::Null, outcome != "singular");
            assert_eq!(check["difference"], Value::Null);
            assert_eq!(check["differences"], json!([]));
        }
    }

    #[test]
    fn what_is_not_finite_is_null() {
        let mut check = sample::check(2, 4, 0.0);
        check.along[1].force = f64::INFINITY;
        if let Some(Ok(shot)) = &mut check.shot {
            shot.solution.growth = f64::NAN;
        }
        let check = value(&check);
        assert_eq!(check["differences"][1]["force"], Value::Null);
        assert_eq!(check["shooting"]["growth_log10"], Value::Null);
    }

    #[test]
    fn free_tips_are_listed() {
        let mut check = sample::check(3, 4, 0.0);
        check.relaxed.shape.joined = false;
        check.relaxed.tips = vec![check.relaxed.tips[0]; 3];
        let check = value(&check);
        for method in ["relaxation", "shooting"] {
            assert_eq!(check[method]["tip"], Value::Null);
            assert_eq!(check[method]["tips"].as_array().unwrap().len(), 3);
        }
    }
}
