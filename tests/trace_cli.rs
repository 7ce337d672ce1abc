//! What scripts rely on when they follow an equilibrium: files, exit statuses,
//! messages, and results that do not depend on the threads.

mod common;
mod workplace;

use std::fs;

use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

const FILES: [&str; 4] = ["trace.csv", "trace.json", "trace.png", "trace.svg"];

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).unwrap()
}

#[test]
fn help_names_every_option_and_exit_status() {
    let output = Workplace::new().run(&["trace", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    for part in [
        "--vary",
        "--switch",
        "--keep-unstable",
        "--segments",
        "--points",
        "--cross-section",
        "--tolerance",
        "--set",
        "--out",
        "--json",
        "0 all branches",
        "2 the request",
    ] {
        assert!(text(&output.stdout).contains(part), "{part}");
    }
}

#[test]
fn a_trace_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let output = place.run(&["trace", "leaf.toml", "--vary", "load.gravity[2]=0..-3"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report = text(&output.stdout);
    for part in [
        "load.gravity[2] from 0.0 to -3.0",
        "to the end of the range",
        "stable",
        "written",
    ] {
        assert!(report.contains(part), "{part}: {report}");
    }
    assert_eq!(place.names("out/small"), FILES);
    assert!(is_whole_png(&place.path("out/small/trace.png")));
    let table = fs::read_to_string(place.path("out/small/trace.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(
        lines[0],
        "branch,point,kind,value,value_error,tip_x,tip_y,tip_z,error,energy,negative_eigenvalues,stable,multiplicity,margin_waves,margin_amplitude,twist"
    );
    assert!(lines.len() > 10);
    assert!(lines[1].starts_with("1,1,regular,0.0,,"), "{}", lines[1]);
    assert!(
        lines.last().unwrap().contains(",-3.0,,"),
        "ends at the end of the range"
    );
}

/// Every point is the leaf that `relax` finds there.
#[test]
fn points_are_what_relax_finds() {
    let place = Workplace::new();
    place.run(&[
        "trace",
        "leaf.toml",
        "--tolerance",
        "1e-8",
        "--vary",
        "load.gravity[2]=0..-3:4",
        "--out",
        "t",
    ]);
    let table = fs::read_to_string(place.path("t/trace.csv")).unwrap();
    let mut compared = 0;
    for line in table.lines().skip(1).step_by(3) {
        let columns: Vec<&str> = line.split(',').collect();
        let set = format!("load.gravity=[0,0,{}]", columns[3]);
        let output = place.run(&[
            "relax",
            "leaf.toml",
            "--tolerance",
            "1e-10",
            "--set",
            &set,
            "--json",
            "--out",
            "r",
        ]);
        let leaf = json(&output.stdout);
        for (axis, column) in [5, 6, 7].into_iter().enumerate() {
            let found: f64 = columns[column].parse().unwrap();
            let wanted = leaf["tip"][axis].as_f64().unwrap();
            assert!((found - wanted).abs() < 2e-8, "{line}: {wanted}");
        }
        let bound: f64 = columns[8].parse().unwrap();
        assert!(bound < 1e-8, "{line}");
        compared += 1;
    }
    assert!(compared >= 3);
}

/// A leaf without weight, soft across, loses its flatness at a fork; both its
/// sides are followed.
#[test]
fn a_fork_is_found_and_both_its_sides() {
    let place = Workplace::new();
    let arguments = [
        "trace",
        "leaf.toml",
        "--set",
        "load.gravity=[0,0,0]",
        "--set",
        "leaf.rods=3",
        "--vary",
        "stiffness.bending_2=1..0.3:20",
        "--switch",
        "--json",
    ];
    let one = place
        .command(&arguments)
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .unwrap();
    assert_eq!(one.status.code(), Some(0), "{}", text(&one.stderr));
    let two = place
        .command(&arguments)
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .unwrap();
    let cut = |bytes: &[u8]| {
        let mut object = json(bytes);
        object["wall_seconds"] = Value::Null;
        object
    };
    assert_eq!(cut(&one.stdout), cut(&two.stdout), "threads change nothing");
    let trace = json(&one.stdout);
    let branches = trace["branches"].as_array().unwrap();
    assert!(branches.len() >= 3, "{trace}");
    let first = &branches[0]["critical"][0];
    assert_eq!(first["kind"], "branch-point");
    assert_eq!(first["negative_eigenvalues"], 1);
    assert!(first["value_error"].as_f64().unwrap() < 1e-8);
    let tips = [1, 2].map(|b| branches[b]["last"]["tip"][2].as_f64().unwrap());
    assert!(
        tips[0].abs() > 1e-3 && (tips[0] + tips[1]).abs() < 1e-7,
        "{tips:?}"
    );
    let stable = |b: usize| branches[b]["first"]["stable"].as_bool().unwrap();
    assert!(stable(1) && stable(2), "what leaves the fork is stable");
}

/// The paper's Fig. 7: Hooke's law is a very good approximation.
#[test]
fn a_leaf_that_is_pulled_obeys_hookes_law() {
    let place = Workplace::new();
    for (name, axial, length) in [("paper/fig07a", 9.0, 1.5), ("paper/fig07b", 10.29, 1.0)] {
        let file = common::path(name);
        let output = place.run(&[
            "trace",
            file.to_str().unwrap(),
            "--vary",
            "load.tip_force[0]=0..20",
            "--cross-section",
            "0.05",
            "--json",
            "--out",
            "h",
        ]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let law = json(&output.stdout)["law"].clone();
        let number = |key: &str| law[key].as_f64().unwrap();
        println!("{name}: {law}");
        assert!(number("r_squared") > 0.99999 && number("deviation") < 1e-3);
        // The veins lie askew and shear, which takes a part of their stiffness.
        let straight = 21.0 * axial / length;
        assert!(number("slope") < straight && number("slope") > 0.7 * straight);
        let young = number("slope") * number("length") / 0.05;
        assert!((number("young") / young - 1.0).abs() < 1e-12);
        let figure = fs::read_to_string(place.path("h/trace.svg")).unwrap();
        for part in ["displacement along x (cm)", "force (N)", "slope", "N/cm"] {
            assert!(figure.contains(part), "{part}");
        }
    }
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let place = Workplace::new();
    for (vary, more, message) in [
        (
            "leaf.rods=3..9",
            vec![],
            "a whole number has nothing between",
        ),
        ("method.step=1e-3..1", vec![], "setting of a method"),
        ("dynamics.density=1..2", vec![], "no equilibrium"),
        ("solve.tolerance=1e-3..1e-6", vec![], "changes no leaf"),
        ("load.gravity[2]=1..1", vec![], "the same"),
        ("load.gravity=0..1", vec![], "give an index"),
        ("stiffness.axial=100..-5", vec![], "greater than 0"),
        ("load.gravity[2]=0..1", vec!["--points", "1"], "2 or more"),
        (
            "load.gravity[2]=0..1",
            vec!["--cross-section", "-1"],
            "greater than 0",
        ),
        (
            "load.gravity[2]=0..1",
            vec!["--tolerance", "5"],
            "tolerance",
        ),
        ("load.gravity[2]=0..1", vec!["--segments", "0"], "segments"),
    ] {
        let output = place.run(&[&["trace", "leaf.toml", "--vary", vary], &more[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{vary}");
        assert!(
            text(&output.stderr).contains(message),
            "{vary}: {}",
            text(&output.stderr)
        );
        assert!(!place.path("out").exists(), "{vary}: nothing is written");
    }
}

/// What ends early is said, with what was found until then.
#[test]
fn a_branch_that_goes_on_is_an_outcome() {
    let place = Workplace::new();
    let output = place.run(&[
        "trace",
        "leaf.toml",
        "--vary",
        "load.gravity[2]=0..-3:100",
        "--points",
        "5",
        "--json",
    ]);
    assert_eq!(output.status.code(), Some(1));
    let trace = json(&output.stdout);
    assert_eq!(trace["complete"], false);
    assert_eq!(trace["branches"][0]["end"], "most-points");
    assert_eq!(trace["branches"][0]["points"], 5);
    assert!(
        trace["branches"][0]["remark"]
            .as_str()
            .unwrap()
            .contains("allow more")
    );
    assert_eq!(place.names("out/small"), FILES);
}

/// The rest length of one vein grows.
#[test]
fn a_vein_that_grows_is_followed() {
    let place = Workplace::new();
    let output = place.run(&[
        "trace",
        "leaf.toml",
        "--vary",
        "rest.stretch[0]=1..1.2",
        "--json",
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let grown = json(&output.stdout)["branches"][0]["last"].clone();
    let set = [
        "--set",
        "rest.stretch=[1.2,1,1,1,1]",
        "--json",
        "--out",
        "r",
    ];
    let output = place.run(&[&["relax", "leaf.toml"], &set[..]].concat());
    let leaf = json(&output.stdout);
    for axis in 0..3 {
        let [a, b] = [&grown["tip"][axis], &leaf["tip"][axis]].map(|x| x.as_f64().unwrap());
        assert!((a - b).abs() < 2e-6, "{a} {b}");
    }
}
