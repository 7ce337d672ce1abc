//! Columns buckle at the loads of Euler, of Reissner and of Greenhill: there,
//! and nowhere else, the number of negative eigenvalues changes.

mod common;

use std::f64::consts::PI;

use common::{close, critical, set_stiffness, set_vector, settle_on, tip};
use glam::DVec3;
use leafdyn::scenario::Scenario;

/// A straight column, clamped at the base, EI = 1 sideways and `other` up and
/// down.
fn column(other: f64, axial: f64, shear: f64, tip_force: f64, gravity: f64) -> Scenario {
    let text = r#"
        name = "column"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1.0, shear_2 = 1.0, shear_3 = 1.0 }
    "#;
    let mut overrides = set_stiffness(axial, shear).to_vec();
    overrides.push(format!("stiffness.bending_2={other:?}"));
    overrides.push(set_vector("load.tip_force", DVec3::new(-tip_force, 0.0, 0.0)));
    overrides.push(set_vector("load.gravity", DVec3::new(-gravity, 0.0, 0.0)));
    Scenario::from_toml_with(text, "column", &overrides).unwrap()
}

const RIGID: f64 = f64::INFINITY;
/// Stiff enough that it never bends up and down.
const STRIP: f64 = 1e6;

/// The index of the straight column, which is an equilibrium on every grid.
fn index(column: &Scenario, segments: usize) -> usize {
    let leaf = settle_on(column, segments, true);
    assert!(tip(&leaf).y.abs() + tip(&leaf).z.abs() < 1e-12);
    leaf.negative_eigenvalues.unwrap()
}

#[test]
fn euler_between_two_critical_loads_the_index_counts_those_below() {
    for k in 0..6 {
        // P_k = (2k - 1)^2 pi^2/4 of the clamped-free column; half-way between.
        let load = (2.0 * k as f64).powi(2) * PI * PI / 4.0 + 0.5;
        assert_eq!(index(&column(STRIP, RIGID, RIGID, load, 0.0), 64), k, "P = {load}");
        // A round section buckles both ways at once.
        assert_eq!(index(&column(1.0, RIGID, RIGID, load, 0.0), 64), 2 * k, "P = {load}");
    }
}

#[test]
fn euler_the_first_three_critical_loads_are_the_closed_form() {
    for k in 1..4 {
        let exact = (2.0 * k as f64 - 1.0).powi(2) * PI * PI / 4.0;
        let found = critical(0.8 * exact, 1.2 * exact, 16, |load, segments| {
            index(&column(STRIP, RIGID, RIGID, load, 0.0), segments) >= k
        });
        close("P/P_k", found / exact, 1.0, 2e-8 * (k as f64).powi(8) / 100.0 + 1e-10);
    }
}

/// P (1 + P/GA - P/EA) = pi^2/4 EI/L^2 for a column that stretches and shears.
#[test]
fn reissner_stretch_and_shear_move_the_critical_load() {
    for (axial, shear, exact) in [
        (1000.0, 400.0, 2.458335976611486),
        (100.0, 40.0, 2.382272748545408),
    ] {
        let found = critical(2.0, 3.0, 8, |load, segments| {
            index(&column(STRIP, axial, shear, load, 0.0), segments) > 0
        });
        close("P", found, exact, 1e-9);
    }
}

/// q L^3/EI = 9/4 j^2, j the first zero of the Bessel function J_(-1/3).
#[test]
fn greenhill_a_column_buckles_under_its_own_weight() {
    let found = critical(7.0, 9.0, 8, |weight, segments| {
        index(&column(STRIP, RIGID, RIGID, 0.0, weight), segments) > 0
    });
    close("q", found, 7.837347438943484, 1e-9);
}
