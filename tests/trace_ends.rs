//! The less usual ways in which a branch ends: what is said, the exit status, and what is
//! written.

mod workplace;

use serde_json::Value;
use workplace::{Json, Workplace, contains, near};

const FILES: &str = "trace.csv trace.json trace.png trace.svg";

/// A rod along e1, bending up and down, with these entries besides.
fn rod(place: &Workplace, couple: [f64; 3], entries: &str) {
    let [torsion, bending_2, bending_3] = couple;
    let text = format!(
        "name = \"rod\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
         stiffness = {{ torsion = {torsion}, bending_2 = {bending_2}, bending_3 = {bending_3}, \
         axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }}\n{entries}\n"
    );
    place.write("rod.toml", text);
}

/// A column that is turned from lying to standing to lying buckles sideways where it
/// stands: both its sides are one loop through the two crossings.
#[test]
fn a_loop_is_closed() {
    let place = Workplace::new();
    rod(&place, [50.0, 1.0, 50.0], "load = { gravity = [-9, 0, 0] }");
    let run = place.run("trace rod.toml --vary leaf.fan[0]=-1..1 --switch");
    run.ends(0).says(&["branches cross at", "points, closed"]);
    place.holds("out/rod", FILES);
    let trace = place.json("out/rod/trace.json");
    assert_eq!(trace["complete"], true);
    let branches = trace["branches"].list();
    let ends: Vec<&Value> = branches.iter().map(|branch| &branch["end"]).collect();
    assert_eq!(ends, ["reached", "closed", "closed", "closed", "closed"]);
    for branch in &branches[1..] {
        let [first, last] = ["first", "last"].map(|end| &branch[end]);
        let [a, b] = [first, last].map(|point| point["value"].number());
        assert!((a - b).abs() < 1e-6, "{a} {b}");
        near(&first["tip"], &last["tip"], 2e-6);
        // It goes through both crossings and to both sides.
        let number = branch["points"].count();
        assert!(number > 20, "{number}");
    }
}

/// A range may end at the last leaf there is: no step leads beyond it.
#[test]
fn a_range_may_end_where_leaves_do() {
    let place = Workplace::new();
    for (range, end) in [("40..0", "0.0"), ("2..1e-9", "1e-9")] {
        let trace = place.told(0, format!("trace leaf.toml --vary coupling.z={range}"));
        assert_eq!(trace["branches"][0]["end"], "reached", "{trace}");
        let last = &trace["branches"][0]["last"];
        assert_eq!(last["value"].as_f64(), end.parse().ok());
        let leaf = place.told(0, format!("relax leaf.toml --set coupling.z={end} --out r"));
        near(&last["tip"], &leaf["tip"], 2e-6);
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
    place.holds("out/rod", FILES);
    let trace = place.json("out/rod/trace.json");
    assert_eq!(trace["complete"], false);
    let branch = &trace["branches"][0];
    assert_eq!(branch["end"], "unresolved");
    contains(branch["remark"].text(), &["right angle"]);
    // 512 segments that turn by 1.6 each.
    let last = branch["last"]["value"].number();
    assert!((last - 819.2).abs() < 1.0, "{last}");
}
