//! Columns on rollers and on elastic ground: where they buckle.

use leafdyn_testing::branch::{changes_at, follow};
use leafdyn_testing::*;

/// A column on a hinge whose tip slides along its axis; the ground holds it along e3.
const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 6.0, axial = inf, shear_2 = inf, shear_3 = inf }
    grip = [{ vein = 1, at = 1.0, stiffness = [0.0, inf, inf] }]
    foundation = { stiffness = [0.0, 0.0, 500.0] }
"#;

/// The loads (n pi)^2 EI + k/(n pi)^2 of the modes on the ground, and those of Euler across it.
#[test]
fn columns_on_ground_buckle_in_waves() {
    let on_ground = |n: f64| (n * PI).powi(2) + 500.0 / (n * PI).powi(2);
    let mut loads = [
        on_ground(1.0),
        on_ground(2.0),
        on_ground(3.0),
        6.0 * PI * PI,
    ];
    loads.sort_by(f64::total_cmp);
    close("first", loads[0], on_ground(2.0), 1e-12);
    let found = follow(COLUMN, "", "load.tip_force[0]=-40..-100:20", false);
    let wanted: Vec<_> = loads.iter().map(|load| (-load, 1)).collect();
    changes_at("column", &found, &wanted, 1e-7 * loads[0]);
}

/// A tip that a clamp guides along its axis is pushed until it sways: 4 pi^2 between clamps, pi^2 where the
/// clamp may be displaced across.
#[test]
fn guided_columns_buckle_as_euler_says() {
    let strip = "stiffness.bending_3=1000.0; leaf.base_held=clamped; foundation.stiffness=[0, 0, 0]; grip[0].held=clamped";
    for (stiffness, load) in [
        ("[0.0, inf, inf]", 4.0 * PI * PI),
        ("[0.0, inf, 0.0]", PI * PI),
    ] {
        let entries = format!("{strip}; grip[0].stiffness={stiffness}");
        let range = format!("load.tip_force[0]={:?}..{:?}:20", -0.9 * load, -1.2 * load);
        let found = follow(COLUMN, &entries, &range, false);
        changes_at(&entries, &found, &[(-load, 1)], 1e-7 * load);
    }
}

/// A tip that a spring of the stiffness k holds across: tan(kL) = kL - (kL)^3 EI/(k L^3) of a column that is clamped
/// at its base (S. Timoshenko and J. Gere, Theory of elastic stability).
#[test]
fn springs_brace_columns() {
    let clamped =
        "stiffness.bending_3=1000.0; leaf.base_held=clamped; foundation.stiffness=[0, 0, 0]";
    for spring in [1.0_f64, 20.0, 300.0] {
        // u = kL between the free and the pinned column's.
        let off = |u: f64| u.tan() - u + u.powi(3) / spring;
        let (mut low, mut high) = (PI / 2.0 + 1e-9, 4.493409457909064);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            match off(middle) < 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        let load = low * low;
        let entries = format!("{clamped}; grip[0].stiffness=[0.0, inf, {spring:?}]");
        let range = format!("load.tip_force[0]={:?}..{:?}:20", -0.9 * load, -1.1 * load);
        let found = follow(COLUMN, &entries, &range, false);
        changes_at(&entries, &found, &[(-load, 1)], 1e-7 * load);
    }
}
