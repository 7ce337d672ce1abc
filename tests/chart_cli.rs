//! What scripts rely on when they chart speed against accuracy: streams, files,
//! exit statuses, columns and keys. No test asks how long anything took.

mod workplace;

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

const FILES: [&str; 4] = ["chart.csv", "chart.json", "chart.png", "chart.svg"];

const COLUMNS: &str = "method,knob,seconds,seconds_min,seconds_q1,seconds_q3,runs,steps,\
                       factorizations,force_evaluations,true_error,error_estimate,outcome,pareto";

const PEERS: &str = "program,scenario,rods,knob,seconds,error,outcome\n";

/// The path of a scenario that comes with the program.
fn scenario(name: &str) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    scenarios.join(name).to_str().unwrap().into()
}

/// One row of a table, by the names of its columns.
type Row = HashMap<String, String>;

fn table(file: &Path) -> Vec<Row> {
    let mut table = csv::Reader::from_path(file).unwrap();
    table
        .deserialize()
        .map(|row: Result<Row, _>| row.unwrap())
        .collect()
}

fn number(row: &Row, column: &str) -> Option<f64> {
    let cell = row[column].as_str();
    (!cell.is_empty()).then(|| cell.parse().unwrap())
}

/// Charts a leaf with some methods; returns also what is in `chart.json`.
fn chart(place: &Workplace, leaf: &str, methods: &str, more: &[&str]) -> (Vec<Row>, Value) {
    let common = ["chart", leaf, "--methods", methods, "--seconds", "0.05"];
    let output = place.run(&[&common[..], &["--json", "--out", "out"], more].concat());
    let status = output.status.code();
    assert_eq!(status, Some(0), "{}", text(&output.stderr));
    let written = fs::read(place.path("out/chart.json")).unwrap();
    assert_eq!(text(&output.stdout), text(&written));
    let rows = table(&place.path("out/chart.csv"));
    (rows, serde_json::from_slice(&output.stdout).unwrap())
}

fn of<'r>(rows: &'r [Row], method: &str) -> Vec<&'r Row> {
    rows.iter().filter(|row| row["method"] == method).collect()
}

#[test]
fn help_names_every_option_and_exit_status() {
    let output = Workplace::new().run(&["chart", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    for part in [
        "--seconds",
        "--methods",
        "--peers",
        "--rods",
        "--tolerance",
        "--set",
        "--out",
        "--json",
        "relaxed-shooting",
        "0 charted",
        "do not confirm the reference",
        "2 the request was refused",
    ] {
        let help: Vec<&str> = text(&output.stdout).split_whitespace().collect();
        assert!(help.join(" ").contains(part), "{part}");
    }
}

#[test]
fn a_leaf_is_charted_and_written_down() {
    let place = Workplace::new();
    let arguments = [
        "chart",
        "leaf.toml",
        "--set",
        "leaf.rods=2",
        "--seconds",
        "0.05",
    ];
    let methods = [
        "--methods",
        "semi-implicit,semi-implicit-grid,single-shooting,relaxed-shooting",
    ];
    let output = place.run(&[&arguments[..], &methods].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    for part in [
        "small: 2 veins joined at the tip, speed against accuracy",
        "  errors   against a solution known within ",
        "relaxation and shooting agree within their error estimates",
        " runs of 38 settings in turns, ",
        "one thread",
        "  front    ",
        "  fastest  ",
        " to 1e-2 ",
        " to 1e-10 ",
        "out/small: chart.json, chart.csv, chart.svg, chart.png",
    ] {
        let report = text(&output.stdout);
        assert!(report.contains(part), "{part} in {report}");
    }
    assert_eq!(place.names("out/small"), FILES);
    assert!(is_whole_png(&place.path("out/small/chart.png")));
    let svg = fs::read_to_string(place.path("out/small/chart.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    for part in ["small: speed against accuracy", "N = 2", "single shooting"] {
        assert!(svg.contains(part), "{part}");
    }
    let csv = fs::read_to_string(place.path("out/small/chart.csv")).unwrap();
    assert_eq!(csv.lines().next(), Some(COLUMNS));
    assert_eq!(csv.lines().count(), 1 + 38);
}

#[test]
fn table_and_json_say_the_same_and_the_front_is_not_beaten() {
    let place = Workplace::new();
    let methods = "semi-implicit,semi-implicit-grid,relaxed-shooting";
    let (rows, chart) = chart(&place, "leaf.toml", methods, &["--set", "leaf.rods=2"]);
    assert_eq!(chart["scenario"], "small");
    assert_eq!(chart["rods"], 2);
    assert_eq!(chart["threads"], 1);
    assert!(chart["rounds"].as_u64().unwrap() >= 3);
    let reference = &chart["reference"];
    assert_eq!(reference["confirmed"], true);
    let floor = reference["known_within"].as_f64().unwrap();
    assert!(floor < 1e-11 && reference["difference"].as_f64().unwrap() < 1e-11);

    let runs = chart["runs"].as_array().unwrap();
    assert_eq!(runs.len(), rows.len());
    for (row, run) in rows.iter().zip(runs) {
        for column in COLUMNS.split(',') {
            let said = match &run[column] {
                Value::String(word) => word.clone(),
                Value::Null => String::new(),
                Value::Bool(yes) => yes.to_string(),
                number => {
                    let cell: f64 = row[column].parse().unwrap();
                    let number = number.as_f64().unwrap();
                    assert!((number - cell).abs() <= 1e-12 * cell, "{column}");
                    continue;
                }
            };
            assert_eq!(row[column], said, "{column}");
        }
        assert_eq!(row["outcome"], "converged");
        let times = ["seconds_min", "seconds_q1", "seconds", "seconds_q3"];
        let times = times.map(|column| number(row, column).unwrap());
        assert!(times.is_sorted() && times[0] > 0.0, "{row:?}");
        assert!(number(row, "runs").unwrap() >= 3.0);
        for column in ["steps", "factorizations", "force_evaluations"] {
            assert!(number(row, column).unwrap() > 0.0, "{column}");
        }
    }

    let point = |row: &Row| {
        let error = number(row, "true_error").unwrap();
        (number(row, "seconds").unwrap(), error.max(floor))
    };
    for row in &rows {
        let (time, error) = point(row);
        let beaten = rows
            .iter()
            .map(point)
            .any(|(t, e)| t < time && e <= error || t <= time && e < error);
        assert_eq!(row["pareto"] == "true", !beaten, "{row:?}");
    }

    let decades = chart["decades"].as_array().unwrap();
    assert_eq!(decades.len(), 9);
    for decade in decades {
        let error = decade["error"].as_f64().unwrap();
        let accurate = rows
            .iter()
            .filter(|row| number(row, "true_error") <= Some(error));
        let fastest = accurate
            .map(|row| point(row).0)
            .fold(f64::INFINITY, f64::min);
        let seconds = |key: &str| decade[key].as_f64().unwrap();
        assert!((seconds("seconds") / fastest - 1.0).abs() < 1e-12);
        let factor = seconds("default_seconds") / fastest;
        assert!((decade["factor"].as_f64().unwrap() / factor - 1.0).abs() < 1e-12);
        assert!(factor > 1.0 - 1e-12);
    }
}

#[test]
fn single_grids_are_of_second_order() {
    let place = Workplace::new();
    let methods = "semi-implicit-grid,explicit-grid";
    let (rows, _) = chart(&place, "leaf.toml", methods, &["--set", "leaf.rods=2"]);
    for (method, finest) in [("semi-implicit-grid", 512), ("explicit-grid", 64)] {
        let errors: Vec<f64> = of(&rows, method)
            .iter()
            .filter(|row| {
                let segments: usize = row["knob"]
                    .strip_prefix("segments=")
                    .unwrap()
                    .parse()
                    .unwrap();
                (8..=finest).contains(&segments)
            })
            .map(|row| number(row, "true_error").unwrap())
            .collect();
        assert!(errors.len() >= 4);
        for pair in errors.windows(2) {
            let ratio = pair[0] / pair[1];
            assert!((ratio - 4.0).abs() < 0.2, "{method}: {errors:?}");
        }
        let estimates = of(&rows, method);
        assert!(estimates.iter().all(|row| row["error_estimate"].is_empty()));
    }
}

#[test]
fn tolerances_are_kept_and_estimates_are_bounds() {
    let place = Workplace::new();
    let methods = "semi-implicit,explicit,single-shooting,multiple-shooting,relaxed-shooting";
    let (rows, chart) = chart(&place, "leaf.toml", methods, &["--set", "leaf.rods=2"]);
    let floor = chart["reference"]["known_within"].as_f64().unwrap();
    assert_eq!(rows.len(), 50);
    for row in rows.iter().filter(|row| row["outcome"] == "converged") {
        let tolerance: f64 = row["knob"]
            .strip_prefix("tolerance=")
            .unwrap()
            .parse()
            .unwrap();
        let estimate = number(row, "error_estimate").unwrap();
        let error = number(row, "true_error").unwrap();
        assert!(estimate <= tolerance, "{row:?}");
        assert!(error <= estimate.max(floor), "{row:?}");
    }
    for method in methods.split(',') {
        let converged = of(&rows, method);
        let converged = converged.iter().filter(|row| row["outcome"] == "converged");
        assert!(converged.count() >= 5, "{method}");
    }
    let remarks = chart["remarks"].to_string();
    assert!(remarks.contains("no knob for its time step"), "{remarks}");
    assert!(!remarks.contains("underestimates"), "{remarks}");
}

#[test]
fn all_but_times_is_the_same_every_time() {
    let place = Workplace::new();
    let two = || {
        let (mut rows, _) = chart(
            &place,
            "leaf.toml",
            "semi-implicit,semi-implicit-grid,relaxed-shooting",
            &["--set", "leaf.rods=2"],
        );
        for row in &mut rows {
            row.retain(|column, _| {
                !column.starts_with("seconds") && column != "runs" && column != "pareto"
            });
        }
        rows
    };
    assert_eq!(two(), two());
}

/// Perturbations grow 10^38 times from base to tip of this leaf.
#[test]
fn what_fails_is_shown_with_the_reason() {
    let place = Workplace::new();
    let fig08 = scenario("paper/fig08.toml");
    let pulled = ["--set", "leaf.rods=5", "--set", "load.tip_force=[5,0,0]"];
    let methods = "single-shooting,relaxed-shooting";
    let (rows, chart) = chart(&place, &fig08, methods, &pulled);
    let single = of(&rows, "single-shooting");
    assert_eq!(single.len(), 10, "failures are not left out");
    assert_eq!(single[0]["outcome"], "not-at-rest");
    assert!(number(single[0], "seconds").is_some());
    for row in single {
        assert!(["not-at-rest", "not-run"].contains(&row["outcome"].as_str()));
        assert_eq!(row["true_error"], "");
        assert_eq!(row["pareto"], "false");
    }
    let remark = chart["runs"][0]["remark"].as_str().unwrap();
    assert!(remark.contains("use more intervals"), "{remark}");
    let relaxed = of(&rows, "relaxed-shooting");
    assert!(relaxed.iter().any(|row| row["pareto"] == "true"));
    let svg = fs::read_to_string(place.path("out/chart.svg")).unwrap();
    assert!(svg.contains(">not-at-rest</text>"));
}

/// A buckled round column may do so in any direction.
#[test]
fn where_errors_tell_little_it_is_said() {
    let place = Workplace::new();
    let round = [
        "leaf.rods=1",
        "leaf.fan=[0.0]",
        "load.gravity=[0,0,0]",
        "load.tip_force=[-4,0,0]",
    ];
    let round: Vec<&str> = round.iter().flat_map(|entry| ["--set", *entry]).collect();
    let (_, chart) = chart(&place, "leaf.toml", "semi-implicit-grid", &round);
    let neutral = chart["reference"]["neutral"].as_str().unwrap();
    assert!(neutral.contains("vein 1 would move"), "{neutral}");
    let remarks = chart["remarks"].to_string();
    assert!(remarks.contains("errors tell little"), "{remarks}");
}

/// A straight column under more than Euler's load.
#[test]
fn a_saddle_is_no_solution() {
    let place = Workplace::new();
    let column = scenario("classic/elastica_buckled.toml");
    let (rows, chart) = chart(&place, &column, "semi-implicit,multiple-shooting", &[]);
    assert_eq!(chart["reference"]["confirmed"], true);
    for row in of(&rows, "multiple-shooting") {
        assert_eq!(row["outcome"], "saddle");
        assert!(number(row, "true_error").unwrap() > 1e-2);
        assert_eq!(row["pareto"], "false");
    }
    let default = of(&rows, "semi-implicit");
    assert!(default.iter().any(|row| row["pareto"] == "true"));
}

#[test]
fn what_a_method_cannot_do_is_told_and_the_others_are_charted() {
    let place = Workplace::new();
    let rigid = ["--set", "stiffness.axial=inf", "--set", "leaf.rods=1"];
    let (rows, chart) = chart(&place, "leaf.toml", "semi-implicit,explicit", &rigid);
    let explicit = of(&rows, "explicit");
    assert!(explicit.iter().all(|row| row["outcome"] == "refused"));
    assert!(explicit.iter().all(|row| row["seconds"].is_empty()));
    let remarks = chart["remarks"].to_string();
    assert!(remarks.contains("explicit is not charted: "), "{remarks}");
    let default = of(&rows, "semi-implicit");
    assert!(default.iter().all(|row| row["outcome"] == "converged"));
}

#[test]
fn profiles_with_knots_anywhere_have_a_reference_at_every_station() {
    let place = Workplace::new();
    let knots = "stiffness.bending_2={at=[0.0,0.3,0.37,1.0],value=[1.0,0.9,0.3,0.2]}";
    let more = ["--set", "leaf.rods=2", "--set", knots];
    let methods = "semi-implicit,semi-implicit-grid,relaxed-shooting";
    let (rows, chart) = chart(&place, "leaf.toml", methods, &more);
    assert_eq!(chart["reference"]["confirmed"], true);
    let grids = of(&rows, "semi-implicit-grid");
    let errors: Vec<f64> = grids
        .iter()
        .map(|row| number(row, "true_error").unwrap())
        .collect();
    assert!(
        errors[7] < 1e-5 && errors[1] / errors[7] > 500.0,
        "{errors:?}"
    );
    for row in of(&rows, "semi-implicit") {
        assert!(number(row, "true_error") <= number(row, "error_estimate"));
    }
}

#[test]
fn without_an_equilibrium_the_exit_status_says_so() {
    let place = Workplace::new();
    let output = place.run(&[
        "chart",
        "leaf.toml",
        "--methods",
        "semi-implicit",
        "--seconds",
        "0.05",
        "--set",
        "leaf.rods=1",
        "--set",
        "load.gravity=[-1e6,0,0]",
        "--json",
    ]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert_eq!(place.names("out/small"), FILES);
    let chart: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(chart["reference"], Value::Null);
    for run in chart["runs"].as_array().unwrap() {
        assert_ne!(run["outcome"], "converged");
        assert_eq!(run["true_error"], Value::Null);
    }
}

#[test]
fn peers_stand_beside_our_own_methods() {
    let place = Workplace::new();
    let rows = "slow,small,2,tol=1e-3,1000,1e-5,converged\n\
                slow,small,2,tol=1e-3,3000,1e-5,converged\n\
                slow,small,2,tol=1e-6,5000,,not-converged max-nodes\n";
    fs::write(place.path("a.csv"), format!("{PEERS}{rows}")).unwrap();
    let other = "fast,small,2,n=10,1e-9,1e-2,at-rest\nslow,small,3,n=1,1,1e-2,at-rest\n";
    fs::write(place.path("b.csv"), format!("{PEERS}{other}")).unwrap();
    let more = [
        "--peers",
        "a.csv",
        "--peers",
        "b.csv",
        "--set",
        "leaf.rods=2",
    ];
    let (rows, chart) = chart(&place, "leaf.toml", "semi-implicit", &more);
    let slow = of(&rows, "slow");
    assert_eq!(slow.len(), 2);
    assert_eq!(number(slow[0], "seconds"), Some(2000.0));
    assert_eq!(number(slow[0], "true_error"), Some(1e-5));
    assert_eq!(slow[0]["runs"], "2");
    assert_eq!(slow[1]["outcome"], "not-converged max-nodes");
    assert_eq!(
        of(&rows, "fast")[0]["pareto"],
        "true",
        "who is faster is on the front"
    );

    let peers = chart["peers"].as_array().unwrap();
    let default = of(&rows, "semi-implicit");
    let accurate = default
        .iter()
        .filter(|row| number(row, "true_error") <= Some(1e-5));
    let ours = accurate.map(|row| number(row, "seconds").unwrap());
    let ours = ours.fold(f64::INFINITY, f64::min);
    let ratio = peers[0]["ratio"].as_f64().unwrap();
    assert!((ratio * ours / 2000.0 - 1.0).abs() < 1e-12);
    assert_eq!(peers[1]["ratio"], Value::Null);
    let remarks = chart["remarks"].to_string();
    assert!(
        remarks.contains("1 row of --peers is about another leaf"),
        "{remarks}"
    );
    let svg = fs::read_to_string(place.path("out/chart.svg")).unwrap();
    assert!(svg.contains(">slow</text>") && svg.contains(">not-converged max-nodes</text>"));
}

#[test]
fn malformed_tables_are_refused_with_file_and_line() {
    for (content, message) in [
        (
            "a,small,5,n=1,fast,1e-2,converged\n",
            "peers.csv:2: seconds = \"fast\"",
        ),
        (
            "a,small,5,n=1,1,1e-2,converged\nb,small,5,n=1,1,1e-2\n",
            "peers.csv:3: 6 cells, not 7",
        ),
        (
            "a,small,none,n=1,1,1e-2,converged\n",
            "peers.csv:2: rods = \"none\"",
        ),
    ] {
        let place = Workplace::new();
        fs::write(place.path("peers.csv"), format!("{PEERS}{content}")).unwrap();
        refused(&place, &["leaf.toml", "--peers", "peers.csv"], message);
    }
    let place = Workplace::new();
    fs::write(place.path("peers.csv"), "no,such,columns\n").unwrap();
    let message = "peers.csv:1: the first line must name the columns program, ";
    refused(&place, &["leaf.toml", "--peers", "peers.csv"], message);
    refused(
        &place,
        &["leaf.toml", "--peers", "absent.csv"],
        "absent.csv",
    );
}

#[test]
fn cost_is_charted_against_the_number_of_veins() {
    let place = Workplace::new();
    let output = place.run(&[
        "chart",
        "leaf.toml",
        "--methods",
        "semi-implicit,semi-implicit-grid,relaxed-shooting",
        "--seconds",
        "0.05",
        "--rods",
        "3,2",
        "--tolerance",
        "1e-3",
        "--set",
        "leaf.rods=2",
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for part in [
        "  veins    to a tolerance of 1e-3\n",
        "semi-implicit, extrapolated, N = 2: ",
        ", N = 3: ",
        "chart_rods.csv, chart_rods.svg, chart_rods.png",
    ] {
        let report = text(&output.stdout);
        assert!(report.contains(part), "{part} in {report}");
    }
    let more = ["chart_rods.csv", "chart_rods.png", "chart_rods.svg"];
    let mut files = [&FILES[..], &more].concat();
    files.sort_unstable();
    assert_eq!(place.names("out/small"), files);
    assert!(is_whole_png(&place.path("out/small/chart_rods.png")));
    let csv = place.path("out/small/chart_rods.csv");
    let header = fs::read_to_string(&csv).unwrap();
    let shared = COLUMNS.strip_suffix(",pareto").unwrap();
    assert_eq!(
        header.lines().next(),
        Some(format!("rods,{shared}").as_str())
    );
    let rows = table(&csv);
    let who: Vec<(&str, &str)> = rows
        .iter()
        .map(|row| (row["method"].as_str(), row["rods"].as_str()))
        .collect();
    assert_eq!(
        who,
        [
            ("semi-implicit", "2"),
            ("semi-implicit", "3"),
            ("semi-implicit-grid", "2"),
            ("semi-implicit-grid", "3"),
            ("relaxed-shooting", "2"),
            ("relaxed-shooting", "3"),
        ]
    );
    for row in &rows {
        assert!(number(row, "true_error").unwrap() <= 1e-3, "{row:?}");
        assert_eq!(row["outcome"], "converged");
    }
    let json = fs::read(place.path("out/small/chart.json")).unwrap();
    let chart: Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(chart["scaling"]["tolerance"], 1e-3);
    assert_eq!(chart["scaling"]["unconfirmed"], serde_json::json!([]));
    assert_eq!(chart["scaling"]["runs"].as_array().unwrap().len(), 6);
}

#[track_caller]
fn refused(place: &Workplace, arguments: &[&str], message: &str) {
    let before = place.names(".");
    let output = place.run(&[&["chart"], arguments].concat());
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert_eq!(text(&output.stdout), "", "{arguments:?}");
    let said = text(&output.stderr);
    assert!(said.contains(message), "{message} in {said}");
    assert_eq!(place.names("."), before, "{arguments:?}");
}

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    for (arguments, message) in [
        (
            vec!["leaf.toml", "--seconds", "0"],
            "--seconds 0: must be greater than 0",
        ),
        (vec!["leaf.toml", "--seconds", "-1"], "--seconds -1"),
        (vec!["leaf.toml", "--seconds", "nan"], "--seconds NaN"),
        (vec!["leaf.toml", "--seconds", "1e9"], "at most 86400"),
        (
            vec!["leaf.toml", "--methods", "newton"],
            "semi-implicit-grid",
        ),
        (vec!["leaf.toml", "--tolerance", "1e-3"], "--rods"),
        (
            vec!["leaf.toml", "--tolerance", "2", "--rods", "2"],
            "tolerance = 2",
        ),
        (vec!["leaf.toml", "--rods", "2,many"], "--rods"),
        (vec!["leaf.toml", "--rods", "2,0"], "leaf.rods"),
        (vec!["leaf.toml", "--set", "leaf.rods=0"], "rods"),
        (vec!["leaf.toml", "--out", "leaf.toml/out"], "--out DIR"),
        (vec!["absent.toml"], "absent.toml"),
        (vec![], "SCENARIO"),
    ] {
        refused(&Workplace::new(), &arguments, message);
    }
}
