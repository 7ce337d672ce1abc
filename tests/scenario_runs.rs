//! Every scenario that comes with the program runs from end to end, in short
//! time, and ends at rest: stable where stability can be told.

mod common;
mod workplace;

use std::fs;

use common::*;
use serde_json::Value;
use workplace::{Json, Workplace};

#[test]
fn every_scenario_file_ends_at_rest_within_its_tolerance() {
    let place = Workplace::new();
    let files = ["paper", "classic", "study"].map(files).concat();
    assert!(files.len() >= 24);
    for file in files {
        let name = file.file_stem().unwrap().to_str().unwrap();
        let folder = file.parent().unwrap().file_name().unwrap().display();
        let run = place.run(format!("relax scenarios/{folder}/{name}.toml --json"));
        let run = run.ends(0);
        let summary = run.json();
        let outcome = summary["outcome"].text();
        assert!(outcome.starts_with("converged"), "{name}: {outcome}");
        // A dead moment leaves stability open, and that is said.
        let moment = matches!(name, "rollup" | "helical_rollup");
        let stable = if moment { Value::Null } else { true.into() };
        assert_eq!(summary["stable"], stable, "{name}");
        // So is what softening may have decided.
        let remark = moment || run.err.contains("softened");
        assert_eq!(run.err.is_empty(), !remark, "{name}: {}", run.err);

        let number = |key: &str| summary[key].number();
        let longest = largest(read(&file, "").rods.iter().map(|rod| rod.length));
        let allowed = number("tolerance") * longest;
        assert!(number("error_estimate") <= allowed, "{name}");
        assert!(number("residual") < 1e-5, "{name}: {}", number("residual"));
        let work = &summary["work"];
        assert!(work["force_evaluations"].count() < 1000, "{name}: {work}");
        for file in "summary.json centerlines.csv figure.svg figure.png".split(' ') {
            let file = place.path("out").join(name).join(file);
            assert!(fs::metadata(&file).unwrap().len() > 500, "{file:?}");
        }
    }
}
