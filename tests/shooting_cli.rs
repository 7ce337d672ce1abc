//! `leafdyn relax --method shooting`: what is printed and written, and what is
//! refused.

mod workplace;

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use workplace::{Workplace, text};

const FILES: [&str; 4] = [
    "centerlines.csv",
    "figure.png",
    "figure.svg",
    "summary.json",
];

fn scenario(name: &str) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    scenarios.join(name).to_str().unwrap().into()
}

/// A run by shooting into `out`: status, report and `summary.json`.
fn shoot(place: &Workplace, arguments: &[&str]) -> (i32, String, Value) {
    let method = ["--method", "shooting", "--out", "out"];
    let output = place.run(&[&["relax"], arguments, &method].concat());
    assert_eq!(text(&output.stderr), "");
    assert_eq!(place.names("out"), FILES);
    let summary = fs::read(place.path("out/summary.json")).unwrap();
    (
        output.status.code().unwrap(),
        text(&output.stdout).into(),
        serde_json::from_slice(&summary).unwrap(),
    )
}

#[test]
fn a_stable_leaf() {
    let place = Workplace::new();
    let (status, report, summary) = shoot(&place, &["leaf.toml"]);
    assert_eq!(status, 0);
    for part in [
        "method shooting",
        "found    stable equilibrium",
        ", by single shooting",
        " corrections, ",
    ] {
        assert!(report.contains(part), "{part} in {report}");
    }
    assert_eq!(summary["method"], "shooting");
    assert_eq!(summary["outcome"], "converged");
    assert_eq!(summary["segments"], json!([]));
    assert_eq!(summary["intervals"], 1);
    assert_eq!(summary["stable"], true);
    let svg = fs::read_to_string(place.path("out/figure.svg")).unwrap();
    assert!(svg.contains("by single shooting"));
}

#[test]
fn intervals_are_as_asked() {
    let place = Workplace::new();
    let (status, report, summary) = shoot(&place, &["leaf.toml", "--intervals", "4"]);
    assert_eq!(status, 0);
    assert!(report.contains("by multiple shooting over 4 intervals"));
    assert_eq!(summary["intervals"], 4);
}

#[test]
fn a_saddle_is_found_and_called_unstable() {
    let fig10 = scenario("paper/fig10.toml");
    let place = Workplace::new();
    let (status, report, summary) = shoot(&place, &[&fig10, "--set", "leaf.rods=5"]);
    assert_eq!(status, 0);
    assert!(report.contains("unstable equilibrium of index 18"));
    assert_eq!(summary["outcome"], "saddle");
    assert_eq!(summary["stable"], false);
    assert_eq!(summary["negative_eigenvalues"], 18);
}

#[test]
fn a_failure_shows_no_numbers_that_are_none() {
    let column = scenario("classic/cantilever_tip.toml");
    let pulled = "load.tip_force=[1e5,0,1]";
    let place = Workplace::new();
    let arguments = [&column, "--set", pulled, "--intervals", "1"];
    let (status, report, summary) = shoot(&place, &arguments);
    assert_eq!(status, 1);
    assert!(report.contains("found    no equilibrium\n"), "{report}");
    assert!(report.contains("use more intervals"), "{report}");
    for part in ["NaN", "inf", "residual", "energy", "tip  "] {
        assert!(!report.contains(part), "{part} in {report}");
    }
    assert_eq!(summary["outcome"], "not-at-rest");
    for key in ["residual", "energy", "error_estimate", "stable"] {
        assert_eq!(summary[key], Value::Null, "{key}");
    }
    let svg = fs::read_to_string(place.path("out/figure.svg")).unwrap();
    assert!(svg.contains("how far shooting came"));
}

#[test]
fn options_of_another_method_are_refused() {
    for (arguments, message) in [
        (
            vec!["--method", "shooting", "--segments", "8"],
            "--segments 8: shooting has no grid",
        ),
        (vec!["--intervals", "4"], "add --method shooting"),
        (
            vec!["--method", "shooting", "--intervals", "0"],
            "--intervals 0: allowed are 1 to 4096",
        ),
        (
            vec!["--method", "explicit", "--keep-unstable"],
            "--keep-unstable: explicit motion leaves unstable equilibria; use --method semi-implicit",
        ),
    ] {
        let place = Workplace::new();
        let output = place.run(&[&["relax", "leaf.toml"], &arguments[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(text(&output.stdout), "", "{arguments:?}");
        let said = text(&output.stderr);
        assert!(said.contains(message), "{message} in {said}");
        assert_eq!(place.names("."), ["leaf.toml"], "{arguments:?}");
    }
}
