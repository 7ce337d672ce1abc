//! What `summary.json` is like.

use serde_json::Value;

use super::Json;
use super::tests::{keys, text};
use crate::relax::{Equilibrium, Outcome};
use crate::report::sample;

const SUMMARY: Json = Json("summary.json");

fn value(equilibrium: &Equilibrium) -> Value {
    serde_json::from_str(&text(&SUMMARY, equilibrium)).unwrap()
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
    assert_eq!(keys(&text(&SUMMARY, &sample::fan(5, 8))), wanted);
}

#[test]
fn numbers_survive_the_round_trip() {
    let mut leaf = sample::fan(2, 4);
    leaf.energy = Some(0.1 + 0.2);
    let text = text(&SUMMARY, &leaf);
    assert!(
        text.contains("\n  \"energy\": 0.30000000000000004,\n"),
        "{text}"
    );
    assert_eq!(
        value(&leaf)["positions"][1][4][0],
        leaf.shape.rods[1].nodes[4].position.x
    );
}

#[test]
fn what_is_not_known_is_null() {
    let mut leaf = sample::fan(2, 4);
    leaf.outcome = Outcome::NotAtRest;
    leaf.accuracy.error_estimate = None;
    leaf.stability.negative_eigenvalues = None;
    leaf.energy = None;
    leaf.accuracy.residual = Some(f64::INFINITY);
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
    leaf.shape.joined = false;
    leaf.tips = vec![leaf.tips[0]; 3];
    let value = value(&leaf);
    assert_eq!(value["tip"], Value::Null);
    assert_eq!(value["tips"].as_array().unwrap().len(), 3);
}
