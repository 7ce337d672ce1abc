//! The map under the curves of a boundary, against Euler's load; and the page.

use leafdyn_testing::PI;
use leafdyn_testing::branch::weak_veins;
use leafdyn_testing::workplace::{Json, Workplace, contains, floats, timeless};
use serde_json::{Value, json};

/// A column without weight.
const COLUMN: &str =
    "trace leaf.toml --set leaf.rods=1 --set leaf.fan=[0] --set load.gravity=[0,0,0]";

/// That buckles in one plane alone.
const STRIP: &str = "--set stiffness.bending_2=1000";

/// The map, in which no cell is other than the curves say.
#[track_caller]
fn map(found: &Value) -> &Value {
    let map = &found["map"];
    assert_eq!(map["disagreeing"], json!([]), "{map:#}");
    map
}

/// The indices of the cells.
fn indices(map: &Value) -> Vec<usize> {
    let rows = map["index"].list().iter();
    rows.flat_map(Json::list).map(Json::count).collect()
}

/// Cells on both sides of the load, which is nearly that of an inextensible column, and none
/// that the curve contradicts.
#[test]
fn cells_are_stable_below_the_load_and_not_above() {
    let place = Workplace::new();
    let axes = "--vary load.tip_force[0]=0..-6 --vary stiffness.bending_3=0.5..2";
    let how = "--map 6x4 --write json,svg,html";
    let run = place.run(format!("{COLUMN} {STRIP} {axes} {how}"));
    run.ends(0).says(&["6 x 4 cells", "all as the curves say"]);
    let found = place.json("out/small/boundary.json");
    let map = map(&found);
    let (first, second) = (floats(&map["first"]), floats(&map["second"]));
    assert_eq!([first.len(), second.len()], [6, 4]);
    let mut both = [0, 0];
    for (r, ei) in second.iter().enumerate() {
        for (c, load) in first.iter().enumerate() {
            let beyond = -load / (0.25 * PI * PI * ei);
            if (beyond - 1.0).abs() > 0.1 {
                let index = map["index"][r][c].count();
                assert_eq!(index, usize::from(beyond > 1.0), "{load} at {ei}");
                both[index] += 1;
            }
        }
    }
    assert!(both[0] > 3 && both[1] > 3, "{both:?}");
    let page = place.read("out/small/boundary.html");
    contains(&page, &["\"curve 1\"", "load.tip_force[0]", "branch point"]);
}

/// Of a column that buckles in two planes only one load lies on the first trace: 2.467 for
/// the bending that stays. That for the other, 2.467 times its bending, meets the map's
/// lower rows alone, and becomes a curve as soon as one of them tells of it; once, and
/// bit by bit the same on any number of threads.
#[test]
fn curves_that_do_not_pass_the_first_trace_begin_at_rows_of_the_map() {
    let place = Workplace::new();
    let column = "--set stiffness.bending_2=1.2 --set stiffness.bending_3=1.5 \
        --set stiffness.axial=inf --set stiffness.shear_2=inf --set stiffness.shear_3=inf \
        --vary load.tip_force[0]=0..-3.3 --vary stiffness.bending_3=1.5..0.5";
    let curves = |threads: &str, more: &str| {
        let asked = format!("{COLUMN} {column} --write json --json {more}");
        timeless(place.run_on(threads, &asked).ends(0).json())
    };
    assert_eq!(curves("2", "")["curves"].list().len(), 1);
    let [one, two] = ["1", "2"].map(|threads| curves(threads, "--map 4x5"));
    assert_eq!(one, two);
    let [other, new] = one["curves"].list() else {
        panic!("{one:#}");
    };
    let euler = 0.25 * PI * PI;
    for (curve, own) in [(other, false), (new, true)] {
        assert_eq!(curve["ends"], json!(["reached", "reached"]));
        for point in curve["points"].list() {
            let [load, bending] = [0, 1].map(|k| point["values"][k].number());
            let error = floats(&point["errors"]);
            let right = -euler * if own { bending } else { 1.2 };
            let stated = error[0] + euler * error[1];
            assert!((load - right).abs() <= stated + 1e-11, "{point}: {right}");
            // Numbers of a curve that begins at the map are known to the tolerance of 1e-6, as
            // parts of their ranges.
            assert!(stated < if own { 5e-6 } else { 1e-6 }, "{point}");
        }
    }
    map(&one);
}

/// The curve turns back between two weights and meets every row above twice: it is found
/// from a first trace that does not meet it, once.
#[test]
fn a_curve_that_rows_meet_twice_is_followed_once() {
    let found = Workplace::new().told(
        0,
        "trace scenarios/classic/hanging_curved.toml --set rest.bend_3=5 --map 3x5 \
        --vary load.gravity[0]=8..20 --vary rest.bend_3=5..6.4 --write json",
    );
    let curve = found["curves"].only();
    assert_eq!(curve["ends"], json!(["reached", "reached"]));
    let points = curve["points"].list();
    let rest = |k: usize| points[k]["values"][1].number();
    let least = (0..points.len()).map(rest).fold(f64::INFINITY, f64::min);
    assert!((5.5..5.6).contains(&least) && rest(points.len() - 1) == 6.4);
    map(&found);
}

/// Both loads of a column meet where its bendings are the same, at the end of a range:
/// a crossing and an end nearly coincide there. Rows beside them know the curves.
#[test]
fn curves_that_cross_at_the_end_of_a_range_are_followed_once() {
    let found = Workplace::new().told(
        0,
        "trace scenarios/classic/elastica_buckled.toml --set stiffness.bending_2=0.55 --map 2x8 \
        --vary load.tip_force[0]=-1..-30 --vary stiffness.bending_3=0.5..0.55 --write none",
    );
    assert_eq!(found["curves"].list().len(), 4);
    map(&found);
}

/// A column that is pushed askew: beyond its folds the branch from the left is gone, but
/// others are reached round the cusp, where the sheet of equilibria is single.
#[test]
fn cells_behind_a_fold_are_reached_round_its_cusp() {
    let askew = "--set load.tip_force=[-2.8,0,0] --vary load.tip_force[1]=1..-1 \
        --vary load.tip_force[0]=-4..-1 --map 6x6 --write none";
    let found = Workplace::new().told(0, format!("{COLUMN} {STRIP} {askew}"));
    assert_eq!(indices(map(&found)), [0; 36]);
}

/// Both modes of the flat undulating leaf become neutral along rows of cells, on a coarse grid
/// elsewhere than on a fine one. (docs/tried.md: over 9 to 6 a row leaves the sheet.)
#[test]
fn rows_that_run_along_a_curve_stay_on_its_sheet() {
    let (keys, half) = (weak_veins(), ["0.07"; 5].join(","));
    let asked = format!(
        "trace scenarios/study/undulation.toml --set load.gravity=[0,0,0] --tolerance 1e-4 \
        --set stiffness.bending_2=[{half},1000,{half}] --map 2x3 --write none \
        --vary stiffness.torsion=9..6.001 --vary {keys}=0.07..0.06"
    );
    let found = Workplace::new().told(0, asked);
    let cells = indices(map(&found));
    assert!(cells.contains(&0) && cells.contains(&2), "{cells:?}");
}

/// A column with 2·10⁻⁵ more than its load: grids of 16, 32 and 64 segments still bear it.
#[test]
fn a_cell_close_beyond_a_curve_is_counted_on_finer_grids() {
    let place = Workplace::new();
    let column = format!("{COLUMN} {STRIP} --write none --vary load.tip_force[0]=0..");
    let trace = place.told(0, format!("{column}-6"));
    let load = trace["branches"][0]["critical"][0]["value"].number();
    let end = load * (1.0 + 2e-5) / 0.75;
    let wide = format!("{column}{end} --vary stiffness.torsion=1..2 --map 2x2");
    let found = place.told(0, wide);
    assert_eq!(map(&found)["index"], json!([[0, 1], [0, 1]]));
}
