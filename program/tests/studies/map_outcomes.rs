//! A few cells of the maps in docs/where-methods-fail.md, failures included: if
//! a method comes to do better there, the page has to be written anew.

use leafdyn::study::{
    BaseScenario, MapMethod, MapOutcome, MapRequest, MapRow, ReferenceConfidence,
};
use leafdyn_testing::*;

use MapOutcome::{Diverged, NotConverged, OtherEquilibrium, OutOfTime, Right, Saddle};

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
