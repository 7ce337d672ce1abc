//! What scripts rely on when they chart speed against accuracy: streams, files,
//! exit statuses, columns and keys. No test asks how long anything took.

use std::collections::HashMap;

use leafdyn_testing::workplace::{Json, Workplace, contains, pairs, tells};
use serde_json::{Value, json};

const FILES: &str = "chart.csv chart.json chart.png chart.svg";

const COLUMNS: &str = "method,knob,seconds,seconds_min,seconds_q1,seconds_q3,runs,steps,\
                       factorizations,force_evaluations,true_error,error_estimate,outcome,pareto";

const PEERS: &str = "program,scenario,rods,knob,seconds,error,outcome\n";

/// One row of a table, by the names of its columns.
type Row = HashMap<String, String>;

fn rows(place: &Workplace, file: &str, columns: &str) -> Vec<Row> {
    let name = || columns.split(',').map(String::from);
    let rows = place.table(file, columns).into_iter();
    rows.map(|row| name().zip(row).collect()).collect()
}

fn number(row: &Row, column: &str) -> Option<f64> {
    let cell = row[column].as_str();
    (!cell.is_empty()).then(|| cell.parse().unwrap())
}

/// What a row's knob is set to.
fn knob(row: &Row, name: &str) -> f64 {
    row["knob"].strip_prefix(name).unwrap().parse().unwrap()
}

/// Charts a leaf with some methods; returns also what is in `chart.json`.
#[track_caller]
fn chart(place: &Workplace, leaf: &str, methods: &str) -> (Vec<Row>, Value) {
    let how = format!("--methods {methods} --seconds 0.05 --json --out out");
    let run = place.run(format!("chart {leaf} {how}")).ends(0);
    assert_eq!(run.out, place.read("out/chart.json"));
    (rows(place, "out/chart.csv", COLUMNS), run.json())
}

const TWO: &str = "leaf.toml --set leaf.rods=2";

const THREE: &str = "semi-implicit,semi-implicit-grid,shooting-from-rest";

fn of<'r>(rows: &'r [Row], method: &str) -> Vec<&'r Row> {
    rows.iter().filter(|row| row["method"] == method).collect()
}

/// The least time of rows no less accurate than `error`.
fn fastest<'r>(rows: impl IntoIterator<Item = &'r Row>, error: f64) -> f64 {
    let accurate = rows.into_iter();
    let accurate = accurate.filter(|row| number(row, "true_error") <= Some(error));
    let seconds = accurate.map(|row| number(row, "seconds").unwrap());
    seconds.fold(f64::INFINITY, f64::min)
}

#[test]
fn a_leaf_is_charted_and_written_down() {
    let place = Workplace::new();
    let methods = "semi-implicit,semi-implicit-grid,single-shooting,shooting-from-rest";
    let run = place.ok(format!("chart {TWO} --seconds 0.05 --methods {methods}"));
    run.says(&[
        "small: 2 veins joined at the tip, speed against accuracy",
        "  errors   against a solution known within ",
        "relaxation and shooting agree within their error estimates",
        " runs of 41 settings in turns, ",
        "one thread",
        "  front    ",
        "  fastest  ",
        " to 1e-2 ",
        " to 1e-10 ",
        "out/small: chart.json, chart.csv, chart.svg, chart.png",
    ]);
    place.holds("out/small", FILES);
    let parts = ["small: speed against accuracy", "N = 2", "single shooting"];
    contains(&place.picture("out/small/chart"), &parts);
    assert_eq!(rows(&place, "out/small/chart.csv", COLUMNS).len(), 41);
}

#[test]
fn table_and_json_say_the_same_and_the_front_is_not_beaten() {
    let place = Workplace::new();
    let (rows, chart) = chart(&place, TWO, THREE);
    tells(&chart, "scenario=small rods=2 threads=1");
    assert!(chart["rounds"].count() >= 3);
    let reference = &chart["reference"];
    assert_eq!(reference["confirmed"], true);
    let floor = reference["known_within"].number();
    assert!(floor < 1e-11 && reference["difference"].number() < 1e-11);

    let runs = chart["runs"].list();
    assert_eq!(runs.len(), rows.len());
    for (row, run) in rows.iter().zip(runs) {
        for column in COLUMNS.split(',') {
            let said = match &run[column] {
                Value::String(word) => word.clone(),
                Value::Null => String::new(),
                Value::Bool(yes) => yes.to_string(),
                value => {
                    let (value, cell) = (value.number(), number(row, column).unwrap());
                    assert!((value - cell).abs() <= 1e-12 * cell, "{column}");
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
        let beaten = |(t, e): (f64, f64)| t < time && e <= error || t <= time && e < error;
        let beaten = rows.iter().map(point).any(beaten);
        assert_eq!(row["pareto"] == "true", !beaten, "{row:?}");
    }

    let decades = chart["decades"].list();
    assert_eq!(decades.len(), 9);
    for decade in decades {
        let value = |key: &str| decade[key].number();
        let fastest = fastest(&rows, value("error"));
        assert!((value("seconds") / fastest - 1.0).abs() < 1e-12);
        let factor = value("default_seconds") / fastest;
        assert!((value("factor") / factor - 1.0).abs() < 1e-12);
        assert!(factor > 1.0 - 1e-12);
    }
}

#[test]
fn tolerances_are_kept_and_estimates_are_bounds() {
    let methods = "semi-implicit,explicit,single-shooting,shooting,shooting-from-rest";
    let (rows, chart) = chart(&Workplace::new(), TWO, methods);
    let floor = chart["reference"]["known_within"].number();
    assert_eq!(rows.len(), 55);
    let converged = |row: &&Row| row["outcome"] == "converged";
    for row in rows.iter().filter(converged) {
        let estimate = number(row, "error_estimate").unwrap();
        let error = number(row, "true_error").unwrap();
        assert!(estimate <= knob(row, "tolerance="), "{row:?}");
        assert!(error <= estimate.max(floor), "{row:?}");
    }
    for method in methods.split(',') {
        let count = of(&rows, method).into_iter().filter(converged).count();
        assert!(count >= 5, "{method}");
    }
    let remarks = chart["remarks"].to_string();
    contains(&remarks, &["no knob for its time step"]);
    assert!(!remarks.contains("underestimates"), "{remarks}");
}

#[test]
fn all_but_times_is_the_same_every_time() {
    let place = Workplace::new();
    let two = || {
        let (mut rows, _) = chart(&place, TWO, THREE);
        let timed = |column: &str| column.starts_with("seconds") || column == "runs";
        for row in &mut rows {
            row.retain(|column, _| !timed(column) && column != "pareto");
        }
        rows
    };
    assert_eq!(two(), two());
}

/// Perturbations grow 10^38 times from base to tip of this leaf.
#[test]
fn what_fails_is_shown_with_the_reason() {
    let place = Workplace::new();
    let pulled = "scenarios/paper/fig08.toml --set leaf.rods=2 --set load.tip_force=[5,0,0]";
    let (rows, chart) = chart(&place, pulled, "single-shooting,shooting-from-rest");
    let single = of(&rows, "single-shooting");
    assert_eq!(single.len(), 11, "failures are not left out");
    assert_eq!(single[0]["outcome"], "not-at-rest");
    assert!(number(single[0], "seconds").is_some());
    for row in single {
        assert!(["not-at-rest", "not-run"].contains(&row["outcome"].as_str()));
        assert_eq!(row["true_error"], "");
        assert_eq!(row["pareto"], "false");
    }
    contains(chart["runs"][0]["remark"].text(), &["use more intervals"]);
    let relaxed = of(&rows, "shooting-from-rest");
    assert!(relaxed.iter().any(|row| row["pareto"] == "true"));
    contains(&place.picture("out/chart"), &[">not-at-rest</text>"]);
}

/// A buckled round column may do so in any direction: its turn is left out.
#[test]
fn a_turn_without_resistance_hides_no_errors() {
    let round = "leaf.toml --set leaf.rods=1 --set leaf.fan=[0.0] \
                 --set load.gravity=[0,0,0] --set load.tip_force=[-4,0,0]";
    let (_, chart) = chart(&Workplace::new(), round, "semi-implicit-grid");
    assert!(chart["reference"]["neutral"].is_null());
    let remarks = chart["remarks"].to_string();
    assert!(!remarks.contains("errors tell little"), "{remarks}");
}

/// A straight column under more than Euler's load.
#[test]
fn a_saddle_is_no_solution() {
    let column = "scenarios/classic/elastica_buckled.toml";
    let methods = "semi-implicit,shooting";
    let (rows, chart) = chart(&Workplace::new(), column, methods);
    assert_eq!(chart["reference"]["confirmed"], true);
    for row in of(&rows, "shooting") {
        assert_eq!(row["outcome"], "saddle");
        assert!(number(row, "true_error").unwrap() > 1e-2);
        assert_eq!(row["pareto"], "false");
    }
    let default = of(&rows, "semi-implicit");
    assert!(default.iter().any(|row| row["pareto"] == "true"));
}

#[test]
fn what_a_method_cannot_do_is_told_and_the_others_are_charted() {
    let rigid = "leaf.toml --set stiffness.axial=inf --set leaf.rods=1";
    let (rows, chart) = chart(&Workplace::new(), rigid, "semi-implicit,explicit");
    let explicit = of(&rows, "explicit");
    assert!(explicit.iter().all(|row| row["outcome"] == "refused"));
    assert!(explicit.iter().all(|row| row["seconds"].is_empty()));
    let remarks = chart["remarks"].to_string();
    contains(&remarks, &["explicit is not charted: "]);
    let default = of(&rows, "semi-implicit");
    assert!(default.iter().all(|row| row["outcome"] == "converged"));
}

#[test]
fn profiles_with_knots_anywhere_have_a_reference_at_every_station() {
    let knots = "stiffness.bending_2={at=[0.0,0.3,0.37,1.0],value=[1.0,0.9,0.3,0.2]}";
    let leaf = format!("{TWO} --set {knots}");
    let (rows, chart) = chart(&Workplace::new(), &leaf, THREE);
    assert_eq!(chart["reference"]["confirmed"], true);
    let grids = of(&rows, "semi-implicit-grid");
    assert!(grids.iter().all(|row| row["error_estimate"].is_empty()));
    let errors = [1, 7].map(|k| number(grids[k], "true_error").unwrap());
    let [coarse, fine] = errors;
    assert!(fine < 1e-5 && coarse / fine > 500.0, "{errors:?}");
    for row in of(&rows, "semi-implicit") {
        assert!(number(row, "true_error") <= number(row, "error_estimate"));
    }
}

#[test]
fn without_an_equilibrium_the_exit_status_says_so() {
    let place = Workplace::new();
    let heavy = "leaf.toml --set leaf.rods=1 --set load.gravity=[-1e6,0,0]";
    let how = "--methods semi-implicit --seconds 0.05";
    let chart = place.told(1, format!("chart {heavy} {how}"));
    place.holds("out/small", FILES);
    assert_eq!(chart["reference"], Value::Null);
    for run in chart["runs"].list() {
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
    place.write("a.csv", format!("{PEERS}{rows}"));
    let other = "fast,small,2,n=10,1e-9,1e-2,at-rest\nslow,small,3,n=1,1,1e-2,at-rest\n";
    place.write("b.csv", format!("{PEERS}{other}"));
    let leaf = format!("{TWO} --peers a.csv --peers b.csv");
    let (rows, chart) = chart(&place, &leaf, "semi-implicit");
    let slow = of(&rows, "slow");
    assert_eq!(slow.len(), 2);
    assert_eq!(number(slow[0], "seconds"), Some(2000.0));
    assert_eq!(number(slow[0], "true_error"), Some(1e-5));
    assert_eq!(slow[0]["runs"], "2");
    assert_eq!(slow[1]["outcome"], "not-converged max-nodes");
    let fast = &of(&rows, "fast")[0]["pareto"];
    assert_eq!(fast, "true", "who is faster is on the front");

    let ours = fastest(of(&rows, "semi-implicit"), 1e-5);
    let ratio = chart["peers"][0]["ratio"].number();
    assert!((ratio * ours / 2000.0 - 1.0).abs() < 1e-12);
    assert_eq!(chart["peers"][1]["ratio"], Value::Null);
    let remarks = chart["remarks"].to_string();
    contains(&remarks, &["1 row of peers is about another leaf"]);
    let parts = [">slow</text>", ">not-converged max-nodes</text>"];
    contains(&place.picture("out/chart"), &parts);
}

/// Columns of the table over the number of veins.
const OF_RODS: &str = "rods,method,knob,seconds,seconds_min,seconds_q1,seconds_q3,runs,steps,\
                       factorizations,force_evaluations,true_error,error_estimate,outcome";

#[test]
fn cost_is_charted_against_the_number_of_veins() {
    let place = Workplace::new();
    let how = "--seconds 0.05 --rods 3,2 --tolerance 1e-3";
    let run = place.run(format!("chart {TWO} --methods {THREE} {how}"));
    run.ends(0).says(&[
        "  veins    to a tolerance of 1e-3\n",
        "semi-implicit, extrapolated, N = 2: ",
        ", N = 3: ",
        "chart_rods.csv, chart_rods.svg, chart_rods.png",
    ]);
    place.picture("out/small/chart_rods");
    place.read("out/small/chart.csv");
    let rows = rows(&place, "out/small/chart_rods.csv", OF_RODS);
    let who = rows.iter().map(|row| [&row["method"][..], &row["rods"]]);
    let wanted = THREE.split(',').flat_map(|it| [[it, "2"], [it, "3"]]);
    assert!(who.eq(wanted), "{rows:?}");
    for row in &rows {
        assert!(number(row, "true_error").unwrap() <= 1e-3, "{row:?}");
        assert_eq!(row["outcome"], "converged");
    }
    let chart = place.json("out/small/chart.json");
    assert_eq!(chart["scaling"]["tolerance"], 1e-3);
    assert_eq!(chart["scaling"]["unconfirmed"], json!([]));
    assert_eq!(chart["scaling"]["runs"].list().len(), 6);
}

/// Without resistance to torsion a vein may turn in any way, so that shooting cannot confirm it.
#[test]
fn a_leaf_of_rods_alone_that_is_not_confirmed_is_a_failure() {
    let asked = "chart leaf.toml --seconds 0.1 --methods semi-implicit-grid --write none \
                 --set leaf.rods=2 --set leaf.fan=symmetric --set load.gravity=[0,0,0] \
                 --set load.tip_force=[-12,0,0] --rods 1";
    for (torsion, status, unconfirmed) in [("1e-9", 1, json!([1])), ("1.0", 0, json!([]))] {
        let entry = format!("--set stiffness.torsion={torsion}");
        let chart = Workplace::new().told(status, format!("{asked} {entry}"));
        assert_eq!(chart["scaling"]["unconfirmed"], unconfirmed);
    }
}

#[test]
fn malformed_tables_are_refused_with_file_and_line() {
    let place = Workplace::new();
    let tables = "
        PEERS a,small,5,n=1,fast,1e-2,converged => 2: seconds = \"fast\"
        PEERS a,small,5,n=1,1,1e-2,converged b,small,5,n=1,1,1e-2 => 3: 6 cells, not 7
        PEERS a,small,none,n=1,1,1e-2,converged => 2: rods = \"none\"
        no,such,columns => 1: the first line must name the columns program,";
    for (lines, message) in pairs(tables) {
        let table = lines.replace(' ', "\n").replace("PEERS\n", PEERS);
        place.write("peers.csv", table + "\n");
        let message = format!("peers.csv:{message}");
        place.refuses("chart leaf.toml --peers peers.csv", &message);
    }
    place.refuses("chart leaf.toml --peers absent.csv", "absent.csv");
}

/// A leaf with a grip, which shooting does not take into account.
fn gripped(place: &Workplace) {
    place.write(
        "gripped.toml",
        "leaf = { rods = 1, length = 1.0, fan = [0.0] }\n\
         stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 1e3, shear_2 = 1e3, shear_3 = 1e3 }\n\
         load = { gravity = [0.0, 0.0, -8.0] }\n\
         grip = [{ vein = 1, at = 0.7 }]\n",
    );
}

/// No method is asked for a leaf that it does not model: its rows say so, and the reference is not
/// called confirmed by it.
#[test]
fn shooting_is_not_charted_for_a_leaf_with_grips() {
    let place = Workplace::empty();
    gripped(&place);
    for methods in ["shooting", "semi-implicit,shooting-from-rest"] {
        let asked = format!("chart gripped.toml --methods {methods} --seconds 0.01 --write none");
        let chart = place.told(1, &asked);
        assert_eq!(chart["reference"]["confirmed"], false, "{methods}");
        let runs = chart["runs"].list();
        let shot = |run: &&Value| run["method"].text().starts_with("shooting");
        assert!(runs.iter().any(|run| shot(&run)));
        for run in runs.iter().filter(shot) {
            assert_eq!(run["outcome"], "refused", "{run}");
        }
    }
}

/// The same of a map, whose other methods are right.
#[test]
fn shooting_is_not_right_about_a_leaf_with_grips() {
    let place = Workplace::empty();
    gripped(&place);
    let map = place.told(
        0,
        "map gripped.toml --vary load.gravity[2]=-1..-8:3 --write none",
    );
    assert_eq!(map["confirmed"], 0);
    for counted in map["outcomes"].list() {
        let wanted = match counted["method"].text().contains("shooting") {
            true => json!({ "refused": 3 }),
            false => json!({ "right": 3 }),
        };
        assert_eq!(counted["counts"], wanted, "{counted}");
    }
}

/// Motions have the files of charts, with the settings of both integrators.
#[test]
fn motions_are_charted() {
    let place = Workplace::new();
    let leaf = "scenarios/motion/swing.toml --set leaf.rods=2 --set dynamics.duration=0.2";
    let how = "--motion --seconds 0.05 --json --out out";
    let run = place.run(format!("chart {leaf} {how}"));
    // On grids as coarse as these the reference may not be confirmed.
    assert!([Some(0), Some(1)].contains(&run.status), "{}", run.err);
    let found = run.json();
    assert_eq!(found["motion"], json!(true));
    let rows = rows(&place, "out/chart.csv", COLUMNS);
    assert!(!of(&rows, "explicit-grid").is_empty());
    assert!(rows.iter().any(|row| row["outcome"] == "completed"));
    for (more, why) in [
        ("--rods 3,5", "--rods: is about leaves at rest"),
        (
            "--methods shooting",
            "none of the methods requested moves a leaf",
        ),
    ] {
        let refused = place
            .run(format!("chart {leaf} --motion {more} --out out2"))
            .ends(2);
        contains(&refused.err, &[why]);
    }
}
