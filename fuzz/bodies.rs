//! What is done with an input, whatever it is: by the fuzz targets beside this
//! file, and by `program/tests/hostile/mutations.rs`. None may panic or run on.
#![allow(dead_code)]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use leafdyn::scenario::Scenario;
use leafdyn::simulate::{Options, Simulation};
use leafdyn::study::{
    BaseScenario, Data, FitRequest, ParameterSweep, ShapeFormat, ShapeTableOptions, read_postures,
};
use leafdyn_program::files::read_peer_measurements;

/// A leaf with something of everything.
pub const LEAF: &str = r#"
name = "small"
leaf = { rods = 2, length = 1.0, fan = "paper", joined = true }
stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = [1.0, 2.0], axial = 100.0, shear_2 = 100.0, shear_3 = inf }
coupling = { x = 0.0, y = 1.0, z = [1.0] }
load = { gravity = [0.0, 0.0, -1.0] }
solve = { tolerance = 1e-6 }
[rest]
twist = 0.1
bend_2 = { at = [0.0, 0.3, 1.0], value = [0.0, 1.0, 2.0] }
stretch = [1.0, 1.1]
[dynamics]
density = { at = [0.0, 1.0], value = [2.0, 1.0] }
duration = 0.02
output_interval = 0.01
gravity = { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -2.0]] }
"#;

/// More rods than this take their time.
const RODS: usize = 8;

/// A scenario is refused in a few words, or comes to rest or does not, and moves.
pub fn scenario(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    match Scenario::from_toml(text) {
        Ok(scenario) if scenario.rods.len() <= RODS => run(&scenario),
        Ok(_) => {}
        Err(error) => assert!(error.to_string().len() < 2_000 + 4 * text.len(), "{error}"),
    }
}

fn run(scenario: &Scenario) {
    let limit = Duration::from_secs(2);
    if let Ok(leaf) = scenario.relaxation().time_limit(limit).run() {
        let nodes = leaf.shape.rods.iter().flat_map(|rod| &rod.nodes);
        for node in nodes.filter(|_| leaf.outcome.is_success()) {
            assert!(node.position.is_finite() && node.rotation.is_finite());
            assert!(node.n.is_finite() && node.m.is_finite());
        }
    }
    let options = Options {
        segments: Some(8),
        ..Options::default()
    };
    let Ok(mut simulation) = Simulation::new(scenario, &options) else {
        return;
    };
    let short = |(_, seconds)| seconds < 0.05;
    if simulation.expected().is_some_and(short) && simulation.frames().0 < 100 {
        while !simulation.done() && simulation.next_frame().is_ok() {}
    }
}

/// An entry as behind `--set`, and numbers as behind `--vary`.
pub fn typed(data: &[u8]) {
    static BASE: LazyLock<BaseScenario> =
        LazyLock::new(|| BaseScenario::from_text(LEAF.into(), "leaf".into(), &[]).unwrap());
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    if let Err(refused) = BaseScenario::from_text(LEAF.into(), "leaf".into(), &[text.into()]) {
        assert!(refused.to_string().len() < 4_000 + 4 * text.len());
    }
    let Ok(vary) = text.parse::<ParameterSweep>() else {
        return;
    };
    assert!(vary.values.iter().all(|value| value.is_finite()));
    let ends = [vary.values[0], vary.values[vary.values.len() - 1]];
    for value in ends.into_iter().filter(|value| value.abs() < 1e3) {
        let _ = BASE.scenario_with_values(&[(&vary.keys, value)]);
    }
}

/// A table of measurements of other programs.
pub fn peers(data: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("peers.csv");
    fs::write(&file, data).unwrap();
    match read_peer_measurements(&file) {
        Ok(rows) => assert!(rows.iter().all(|row| row.seconds > 0.0)),
        Err(error) => assert!(error.to_string().len() < 1_000 + 4 * data.len()),
    }
}

/// A table of measured data, and one of candidate experiments.
pub fn measurements(data: &[u8]) {
    let mut measured = Data::default();
    let read = measured.read(data, "data.csv", 2);
    let candidates = FitRequest::read_candidates(data, "candidates.csv", &[]).map(drop);
    for refused in [read, candidates].into_iter().filter_map(Result::err) {
        assert!(refused.to_string().len() < 2_000 + 4 * data.len());
    }
}

/// A hanging leaf, seen in a photograph, of which points are read.
const POSTURE: &str = r#"
name = "posture"
units = { length = "m", force = "N" }
leaf = { rods = 1, length = 1.0, fan = [0.0] }
stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
photo = { scale = 0.01, x = 300.0, y = 1200.0 }
"#;

/// A table of points on leaves, by every program that may have written it, with and without names of its columns.
pub fn points(data: &[u8]) {
    static LEAF: LazyLock<Scenario> = LazyLock::new(|| Scenario::from_toml(POSTURE).unwrap());
    let numbered = ["1=x", "2=z:0.01"].map(|column| column.parse().unwrap());
    let formats = ShapeFormat::ALL.map(Some).into_iter().chain([None]);
    for (format, columns) in
        formats.flat_map(|format| [(format, &numbered[..0]), (format, &numbered[..])])
    {
        for group in [None, Some(String::from("frame"))] {
            let options = ShapeTableOptions {
                group,
                format,
                columns: columns.to_vec(),
            };
            match read_postures(data, "points.csv", &options, &LEAF) {
                Ok(leaves) => {
                    for leaf in leaves {
                        assert!(leaf.points.positions.iter().all(|point| point.is_finite()));
                        let _ = leaf.points.check(6, None);
                    }
                }
                Err(refused) => assert!(refused.to_string().len() < 4_000 + 8 * data.len()),
            }
        }
    }
}

/// What the files in a folder hold.
pub fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = fs::read_dir(folder).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let read = |file: PathBuf| (file.clone(), fs::read(file).unwrap());
    files.into_iter().map(read).collect()
}
