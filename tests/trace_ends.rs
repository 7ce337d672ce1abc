//! The less usual ways in which a branch ends: what is said, the exit status, and what is
//! written.

mod workplace;

use std::fs;

use serde_json::Value;
use workplace::{Workplace, contains, floats};

const FILES: [&str; 4] = ["trace.csv", "trace.json", "trace.png", "trace.svg"];

/// A rod along e1, bending up and down, with these entries besides.
fn rod(place: &Workplace, couple: [f64; 3], entries: &str) {
    let [torsion, bending_2, bending_3] = couple;
    let text = format!(
        "name = \"rod\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
         stiffness = {{ torsion = {torsion}, bending_2 = {bending_2}, bending_3 = {bending_3}, \
         axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }}\n{entries}\n"
    );
    fs::write(place.path("rod.toml"), text).unwrap();
}

/// A column that is turned from lying to standing to lying buckles sideways where it
/// stands: both its sides are one loop through the two crossings.
#[test]
fn a_loop_is_closed() {
    let place = Workplace::new();
    rod(&place, [50.0, 1.0, 50.0], "load = { gravity = [-9, 0, 0] }");
    let run = place.run("trace rod.toml --vary leaf.fan[0]=-1..1 --switch");
    run.ends(0).says(&["branches cross at", "points, closed"]);
    assert_eq!(place.names("out/rod"), FILES);
    let trace = place.json("out/rod/trace.json");
    assert_eq!(trace["complete"], true);
    let branches = trace["branches"].as_array().unwrap();
    let ends: Vec<&Value> = branches.iter().map(|branch| &branch["end"]).collect();
    assert_eq!(ends, ["reached", "closed", "closed", "closed", "closed"]);
    for branch in &branches[1..] {
        let [first, last] = ["first", "last"].map(|end| &branch[end]);
        let [a, b] = [first, last].map(|point| point["value"].as_f64().unwrap());
        assert!((a - b).abs() < 1e-6, "{a} {b}");
        for (a, b) in floats(&first["tip"]).iter().zip(floats(&last["tip"])) {
            assert!((a - b).abs() < 2e-6, "{a} {b}");
        }
        // It goes through both crossings and to both sides.
        let number = branch["points"].as_u64().unwrap();
        assert!(number > 20, "{number}");
    }
}

/// A range may end at the last leaf there is: no step leads beyond it.
#[test]
fn a_range_may_end_where_leaves_do() {
    let place = Workplace::new();
    for (range, end) in [("40..0", "0.0"), ("2..1e-9", "1e-9")] {
        let run = place.run(&format!("trace leaf.toml --vary coupling.z={range} --json"));
        let trace = run.ends(0).json();
        assert_eq!(trace["branches"][0]["end"], "reached", "{trace}");
        let last = &trace["branches"][0]["last"];
        assert_eq!(last["value"].as_f64(), end.parse().ok());
        let leaf = place.run(&format!(
            "relax leaf.toml --set coupling.z={end} --json --out r"
        ));
        let tips = [&last["tip"], &leaf.json()["tip"]].map(floats);
        for (a, b) in tips[0].iter().zip(&tips[1]) {
            assert!((a - b).abs() < 2e-6, "{a} {b}");
        }
    }
}

/// A vein that winds up more than the finest grid resolves.
#[test]
fn a_spiral_is_wound_up_until_no_grid_resolves_it() {
    let place = Workplace::new();
    rod(&place, [1.0; 3], "rest = { bend_2 = 20.0 }");
    let run = place.run("trace rod.toml --vary rest.bend_2=20..900 --tolerance 1e-4");
    run.ends(1).says(&[
        "ends: grid too coarse",
        "a vein bends by more than a right angle within one segment",
    ]);
    assert_eq!(place.names("out/rod"), FILES);
    let trace = place.json("out/rod/trace.json");
    assert_eq!(trace["complete"], false);
    let branch = &trace["branches"][0];
    assert_eq!(branch["end"], "unresolved");
    contains(branch["remark"].as_str().unwrap(), &["right angle"]);
    // 512 segments that turn by 1.6 each.
    let last = branch["last"]["value"].as_f64().unwrap();
    assert!((last - 819.2).abs() < 1.0, "{last}");
}
