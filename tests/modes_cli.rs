//! `leafdyn relax --modes`: its files, keys and report.

mod workplace;

use std::fs;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

const FILES: [&str; 4] = [
    "centerlines.csv",
    "figure.png",
    "figure.svg",
    "summary.json",
];

fn summary(place: &Workplace, arguments: &[&str]) -> Value {
    let all = [&["relax", "leaf.toml", "--json"], arguments].concat();
    let output = place.run(&all);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().expect("a list");
    list.iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn three_eigenvalues_are_told_unasked() {
    let place = Workplace::new();
    let summary = summary(&place, &[]);
    let eigenvalues = numbers(&summary["lowest_eigenvalues"]);
    assert_eq!(eigenvalues.len(), 3);
    assert!(eigenvalues[0] > 0.0 && eigenvalues.is_sorted());
    let errors = numbers(&summary["eigenvalue_errors"]);
    assert!(errors.iter().zip(&eigenvalues).all(|(e, l)| *e < 1e-3 * l));
    assert_eq!(place.names("out/small"), FILES);

    let report = place.run(&["relax", "leaf.toml"]);
    let wanted = format!("modes    lowest frequencies {:.4}", eigenvalues[0].sqrt());
    let report = text(&report.stdout);
    assert!(report.contains(&wanted[..wanted.len() - 1]), "{report}");
}

#[test]
fn modes_are_written_and_drawn_on_request() {
    let place = Workplace::new();
    let output = place.run(&["relax", "leaf.toml", "--modes", "4"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("figure.png, modes.csv, modes.svg, modes.png"));
    let names = place.names("out/small");
    assert_eq!(names.len(), FILES.len() + 3, "{names:?}");

    let file = fs::read_to_string(place.path("out/small/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&file).unwrap();
    let eigenvalues = numbers(&summary["lowest_eigenvalues"]);
    let stations = summary["stations"].as_array().unwrap().len();

    let csv = fs::read_to_string(place.path("out/small/modes.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(
        lines.next().unwrap(),
        "mode,eigenvalue,error,frequency,rod,sigma,dx,dy,dz,rx,ry,rz"
    );
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 4 * 5 * stations);
    for (k, rows) in rows.chunks(5 * stations).enumerate() {
        for row in rows {
            assert_eq!(row[0], (k + 1) as f64);
            assert_eq!(row[1], eigenvalues[k]);
            assert_eq!(row[3], eigenvalues[k].sqrt());
            // The base is clamped.
            assert!(row[5] > 0.0 || row[6..].iter().all(|value| *value == 0.0));
        }
        let far = |row: &Vec<f64>| row[6..9].iter().map(|d| d * d).sum::<f64>().sqrt();
        let largest = rows.iter().map(far).fold(0.0, f64::max);
        // On the finest grid it is 1.
        assert!((0.7..1.0 + 1e-12).contains(&largest), "{largest}");
    }

    let svg = fs::read_to_string(place.path("out/small/modes.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert_eq!(svg.matches("<g id=\"mode\">").count(), 4);
    assert_eq!(svg.matches("ω = ").count(), 4);
    assert!(!svg.contains("NaN") && !svg.contains("unstable"));
    assert!(is_whole_png(&place.path("out/small/modes.png")));

    // Of the leaf that is there now nothing like it is known.
    place.run(&["relax", "leaf.toml"]);
    assert_eq!(place.names("out/small"), FILES);
}

#[test]
fn no_modes_are_null() {
    let place = Workplace::new();
    for arguments in [
        &["--modes", "0"][..],
        &["--method", "shooting"],
        &["--set", "leaf.rods=1", "--set", "load.tip_moment=[0,0,1]"],
    ] {
        let summary = summary(&place, arguments);
        assert_eq!(summary["lowest_eigenvalues"], Value::Null, "{arguments:?}");
        assert_eq!(summary["eigenvalue_errors"], Value::Null, "{arguments:?}");
        assert_eq!(place.names("out/small"), FILES, "{arguments:?}");
    }
    let output = place.run(&["relax", "leaf.toml", "--modes", "0"]);
    assert!(!text(&output.stdout).contains("modes"));
}

#[test]
fn one_grid_has_eigenvalues_without_errors() {
    let place = Workplace::new();
    let summary = summary(&place, &["--segments", "8", "--modes", "2"]);
    assert_eq!(numbers(&summary["lowest_eigenvalues"]).len(), 2);
    assert_eq!(summary["eigenvalue_errors"], Value::Null);
    let csv = fs::read_to_string(place.path("out/small/modes.csv")).unwrap();
    let cells: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(cells[2], "");
}

/// The flat shape of this soft leaf is a saddle.
#[test]
fn unstable_modes_are_told_and_marked() {
    let place = Workplace::new();
    let soft = [
        "relax",
        "leaf.toml",
        "--set",
        "leaf.rods=1",
        "--set",
        "leaf.fan=[0.0]",
        "--set",
        "load.gravity=[0,0,0]",
        "--set",
        "load.tip_force=[-3,0,0]",
        "--keep-unstable",
        "--modes",
        "3",
    ];
    let output = place.run(&soft);
    let report = text(&output.stdout);
    assert!(report.contains("2 negative eigenvalues"), "{report}");
    assert!(report.contains("modes    growth rates "), "{report}");
    assert!(report.contains("; lowest frequencies "), "{report}");
    let svg = fs::read_to_string(place.path("out/small/modes.svg")).unwrap();
    assert_eq!(svg.matches("unstable: grows at ").count(), 2);
    assert_eq!(svg.matches("ω = ").count(), 1);
    let csv = fs::read_to_string(place.path("out/small/modes.csv")).unwrap();
    let cells: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    assert!(cells[1].starts_with('-') && cells[3].is_empty());
}

#[test]
fn impossible_numbers_of_modes_are_refused() {
    let place = Workplace::new();
    for number in ["101", "-1", "all"] {
        let output = place.run(&["relax", "leaf.toml", "--modes", number]);
        assert_eq!(output.status.code(), Some(2), "{number}");
        assert!(text(&output.stderr).contains("--modes"), "{number}");
        assert_eq!(place.names("."), ["leaf.toml"]);
    }
}
