//! Every scenario that comes with the program runs from end to end, in short
//! time, and ends at rest: stable where stability can be told.

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

fn files() -> Vec<PathBuf> {
    let mut files = Vec::new();
    for folder in ["paper/fig04", "classic/rollup", "study/undulation"] {
        let folder = common::path(folder).parent().unwrap().to_path_buf();
        files.extend(
            fs::read_dir(folder)
                .unwrap()
                .map(|file| file.unwrap().path()),
        );
    }
    files
}

#[test]
fn every_scenario_file_ends_at_rest_within_its_tolerance() {
    let place = tempfile::tempdir().unwrap();
    let files = files();
    assert!(files.len() >= 24);
    for file in files {
        let name = file.file_stem().unwrap().to_str().unwrap();
        let output = Command::new(assert_cmd::cargo::cargo_bin!("leafdyn"))
            .current_dir(place.path())
            .arg("relax")
            .arg(&file)
            .arg("--json")
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {stderr}");
        let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
        let outcome = summary["outcome"].as_str().unwrap();
        assert!(outcome.starts_with("converged"), "{name}: {outcome}");
        // A dead moment leaves stability open, and that is said.
        let moment = matches!(name, "rollup" | "helical_rollup");
        let stable = if moment {
            Value::Null
        } else {
            Value::Bool(true)
        };
        assert_eq!(summary["stable"], stable, "{name}");
        assert_eq!(stderr.is_empty(), !moment, "{name}: {stderr}");

        let number = |key: &str| summary[key].as_f64().unwrap();
        let longest = longest(&summary);
        assert!(
            number("error_estimate") <= number("tolerance") * longest,
            "{name}"
        );
        assert!(number("residual") < 1e-5, "{name}: {}", number("residual"));
        let work = &summary["work"];
        assert!(
            work["force_evaluations"].as_u64().unwrap() < 1000,
            "{name}: {work}"
        );
        for file in [
            "summary.json",
            "centerlines.csv",
            "figure.svg",
            "figure.png",
        ] {
            let written = fs::metadata(place.path().join("out").join(name).join(file)).unwrap();
            assert!(written.len() > 500, "{name}: {file}");
        }
    }
}

/// Length of the scenario's longest rod.
fn longest(summary: &Value) -> f64 {
    let name = summary["scenario"].as_str().unwrap();
    let file = ["paper", "classic", "study"]
        .iter()
        .map(|folder| common::path(&format!("{folder}/{name}")))
        .find(|path| path.exists())
        .unwrap();
    let scenario = leafdyn::scenario::Scenario::read(&file, &[]).unwrap();
    scenario.rods.iter().fold(0.0, |m, rod| rod.length.max(m))
}
