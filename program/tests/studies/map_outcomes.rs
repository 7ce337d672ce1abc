//! Maps: a few cells of those in docs/where-methods-fail.md, failures included, as the page has to be
//! written anew if a method comes to do better there; and the files and rows that scripts rely on.

use MapOutcome::{Diverged, NotConverged, OtherEquilibrium, OutOfTime, Right, Saddle};
use leafdyn::study::{
    BaseScenario, MapMethod, MapOutcome, MapRequest, MapRow, ReferenceConfidence,
};
use leafdyn_testing::workplace::{Workplace, contains};
use leafdyn_testing::*;

const SEMI_IMPLICIT: MapMethod = MapMethod::ToRest(Method::ALL[0]);
const EXPLICIT: MapMethod = MapMethod::ToRest(Method::ALL[1]);
const EXPLICIT_MOTION: MapMethod = MapMethod::ExplicitMotion;
const SINGLE_SHOOTING: MapMethod = MapMethod::ToRest(Method::ALL[2]);
const SHOOTING: MapMethod = MapMethod::ToRest(Method::ALL[3]);
const SHOOTING_FROM_REST: MapMethod = MapMethod::ToRest(Method::ALL[4]);

const H: &str = "stiffness.axial+stiffness.shear_2+stiffness.shear_3";

/// One cell of a leaf of the paper, by some methods.
fn cell(
    figure: &str,
    set: &str,
    values: &[(&str, &str)],
    methods: &[MapMethod],
    seconds: f64,
) -> Vec<MapRow> {
    let base = BaseScenario::read(&path(&format!("paper/{figure}")), &entries(set)).unwrap();
    let axis = |(key, value): &(&str, &str)| format!("{key}={value}..{value}:1");
    let axes = values.iter().map(|of| axis(of).parse().unwrap()).collect();
    let request = MapRequest::new(base, axes, Some(methods.to_vec()), None, seconds).unwrap();
    request.solve_cell(0, methods)
}

#[track_caller]
fn expect(rows: &[MapRow], expected: &[MapOutcome]) {
    let found: Vec<MapOutcome> = rows.iter().map(|row| row.outcome).collect();
    let details: Vec<_> = rows.iter().map(|row| (row.method, row.detail())).collect();
    assert_eq!(found, expected, "{details:#?}");
}

/// Long enough that no cell's answer depends on the machine.
const LONG: f64 = 300.0;

/// Too short for what takes a method many seconds to fail at.
const SHORT: f64 = 1.5;

/// Map (a): explicit motion, time step against stiffness.
#[test]
fn explicit_motion_is_right_only_below_its_bound_and_where_little_is_stretched() {
    let set = "leaf.rods=3; method.segments=16; dynamics.duration=30";
    for (h, step, outcome, says) in [
        ("100", "2e-3", Right, "stable up to 5.965e-3"),
        ("100", "1e-2", Diverged, "numerical instability"),
        ("1e6", "1e-3", Diverged, "stable up to 5.965e-5"),
        // The leaf starts stretched: what h = 10,000 stores throws it elsewhere,
        ("1e4", "2e-4", OtherEquilibrium, "energy higher by"),
        // and what a million stores bends it beyond its grid.
        ("1e6", "2e-5", NotConverged, "a segment bends by"),
        // Soft in shear, it is slow.
        ("1", "5e-3", NotConverged, "still moves"),
    ] {
        let values = [(H, h), ("method.step", step)];
        let rows = cell("fig04", set, &values, &[EXPLICIT_MOTION], LONG);
        expect(&rows, &[outcome]);
        let detail = rows[0].detail();
        assert!(detail.contains(says), "{detail}");
        assert_eq!(rows[0].reference, ReferenceConfidence::Confirmed);
    }
}

/// The tissue of a blade is rigid along and normal to its veins: the leaf relaxed on finer grids is the reference, and
/// tells the error of a coarse grid.
#[test]
fn a_blade_is_compared_with_itself_on_finer_grids() {
    let base = BaseScenario::read(&path("measured/blade"), &entries("leaf.rods=5")).unwrap();
    let axes = vec!["method.segments=16..32:2".parse().unwrap()];
    let methods = [SEMI_IMPLICIT];
    let request = MapRequest::new(base, axes, Some(methods.to_vec()), None, LONG).unwrap();
    let errors = [0, 1].map(|number| {
        let rows = request.solve_cell(number, &methods);
        expect(&rows, &[Right]);
        assert_eq!(rows[0].reference, ReferenceConfidence::FinerGrids);
        let (error, bar) = (rows[0].error.unwrap(), rows[0].error_estimate.unwrap());
        assert!(error <= bar, "{error:e} beyond {bar:e}");
        error
    });
    // Grids are of second order; one of twice as many segments need not halve each.
    let ratio = errors[0] / errors[1];
    assert!(ratio > 2.5 && ratio < 7.0, "{ratio}");
}

fn soft(bending: &str, load: &str, methods: &[MapMethod], seconds: f64) -> Vec<MapRow> {
    let values = [("stiffness.bending_2", bending), ("load.gravity[2]", load)];
    cell("fig04", "leaf.rods=3", &values, methods, seconds)
}

/// Map (b): soft veins under load.
#[test]
fn all_methods_are_right_on_a_stiff_leaf() {
    let methods = Method::ALL.map(MapMethod::ToRest);
    let rows = soft("1", "-1", &methods, LONG);
    expect(&rows, &[Right; 5]);
    for row in &rows {
        assert!(row.error.unwrap() <= row.error_estimate.unwrap() + 1e-8);
        assert_eq!(row.index, Some(0));
    }
}

#[test]
fn shooting_from_arcs_stays_on_the_flat_branch_of_a_softer_leaf() {
    let methods = [SEMI_IMPLICIT, SINGLE_SHOOTING, SHOOTING, SHOOTING_FROM_REST];
    let rows = soft("0.056234132519", "-1e-3", &methods, LONG);
    expect(&rows, &[Right, Saddle, Saddle, Right]);
    assert_eq!(rows[1].index, Some(2));
    assert_eq!(rows[2].index, Some(2));
    let rows = soft("0.056234132519", "-1e-2", &methods, LONG);
    expect(&rows, &[Right, Right, Saddle, Right]);
}

#[test]
fn single_shooting_loses_a_soft_heavy_leaf() {
    let rows = soft("3.16227766017e-3", "-10", &[SINGLE_SHOOTING], SHORT);
    let outcome = rows[0].outcome;
    assert!([OutOfTime, NotConverged].contains(&outcome), "{rows:?}");
    let rows = soft("3.16227766017e-3", "-10", &[SHOOTING_FROM_REST], LONG);
    expect(&rows, &[Right]);
}

/// Map (c): stiffness against stretch and shear.
#[test]
fn only_explicit_methods_feel_how_stiff_a_leaf_is() {
    let set = "leaf.rods=3; method.step=1e-3";
    let mut methods = Method::ALL.map(MapMethod::ToRest);
    methods[1] = EXPLICIT_MOTION;
    let rows = cell("fig04", set, &[(H, "1e10")], &methods, LONG);
    expect(&rows, &[Right, Diverged, Right, Right, Right]);
    let rows = cell("fig04", set, &[(H, "1e10")], &[EXPLICIT], SHORT);
    expect(&rows, &[OutOfTime]);
    // It begins where slow loading leads.
    let rows = cell("fig04", set, &[(H, "1e4")], &[EXPLICIT], LONG);
    expect(&rows, &[Right]);
    let rigid = format!("{set}; stiffness.axial=inf");
    let values = [("stiffness.shear_2", "100")];
    let rows = cell("fig04", &rigid, &values, &[SEMI_IMPLICIT, EXPLICIT], LONG);
    expect(&rows, &[Right, MapOutcome::Refused]);
}

/// Map (d): Fig. 10 and around it.
#[test]
fn shooting_from_arcs_takes_saddles_for_answers_around_fig_10() {
    let around = |bending: &str, load: &str, methods: &[MapMethod]| {
        let values = [("stiffness.bending_2", bending), ("load.gravity[2]", load)];
        cell("fig10", "leaf.rods=5", &values, methods, LONG)
    };
    let methods = [SEMI_IMPLICIT, SINGLE_SHOOTING, SHOOTING, SHOOTING_FROM_REST];
    let rows = around("0.1", "-0.002", &methods);
    expect(&rows, &[Right, Saddle, Saddle, Right]);
    assert_eq!(rows[2].index, Some(18));
    let rows = around("0.158489319246", "-0.2", &[SEMI_IMPLICIT, EXPLICIT]);
    // Explicit motion begins where slow loading leads.
    expect(&rows, &[Right, Right]);
}

const FILES: &str = "map.csv map.json map.png map.svg";

/// Twelve cells, one of which the format refuses.
const CELLS: &str =
    "map leaf.toml --vary load.gravity[2]=-1e-2..-10:4log --vary coupling.y=-1..1:3";

/// The cells by three quick methods.
fn small(more: &str) -> String {
    format!("{CELLS} --methods semi-implicit,shooting,shooting-from-rest {more}")
}

#[track_caller]
fn run(place: &Workplace, more: &str, threads: &str) -> String {
    let arguments = small(&format!("--out out {more}"));
    place.run_on(threads, &arguments).ok().out
}

fn lines(place: &Workplace, name: &str) -> Vec<String> {
    let table = place.read(name);
    assert!(table.ends_with('\n'));
    table.lines().map(String::from).collect()
}

/// The rows of a table without their times: the last column but one.
fn timeless(place: &Workplace, name: &str) -> Vec<String> {
    let without = |line: String| {
        let columns: Vec<&str> = line.rsplitn(3, ',').collect();
        format!("{},{}", columns[2], columns[0])
    };
    lines(place, name).into_iter().map(without).collect()
}

#[test]
fn a_map_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let report = run(&place, "", "2");
    let parts = [
        "small: where methods fail",
        "load.gravity[2] from -0.01 to -10.0: 4 values, logarithmic",
        "coupling.y from -1.0 to 1.0: 3 values",
        "12 of 12, reference confirmed in ",
        "36 computed in ",
        "shooting-from-rest",
        "refused",
        "out: map.json, map.csv, map.svg, map.png",
    ];
    contains(&report, &parts);
    place.holds("out", FILES);
    let svg = place.picture("out/map");
    assert!(svg.contains("where methods fail") && !svg.contains("no waves"));

    let rows = lines(&place, "out/map.csv");
    assert_eq!(
        rows[0],
        "load.gravity[2],coupling.y,method,outcome,detail,index,tip_x,tip_y,tip_z,energy,error,error_estimate,margin_waves,margin_amplitude,twist,seconds,reference"
    );
    assert_eq!(rows.len(), 1 + 36);
    assert!(rows[1].starts_with("-0.01,-1.0,semi-implicit,refused,"));
    assert!(rows[1].contains("coupling.y = -1.0: "), "{}", rows[1]);
    assert!(rows[1].ends_with(",none"));
    assert!(rows[36].starts_with("-10.0,1.0,shooting-from-rest,right,"));
    assert!(rows[36].ends_with(",confirmed"));

    // The same rows, drawn by their waves.
    run(&place, "--show waves", "2");
    let parts = ["waves along the margins", "stable, no waves"];
    contains(&place.picture("out/map"), &parts);

    let json = place.json("out/map.json");
    assert_eq!(json["scenario"], "small");
    assert_eq!(json["cells"], 12);
    assert_eq!(json["request"]["vary"][1]["keys"], "coupling.y");
    assert_eq!(json["outcomes"][0]["counts"]["refused"], 4);
}

#[test]
fn one_and_two_threads_give_the_same_rows() {
    let [one, two] = ["1", "2"].map(|threads| {
        let place = Workplace::new();
        run(&place, "", threads);
        timeless(&place, "out/map.csv")
    });
    assert_eq!(one, two);
}
