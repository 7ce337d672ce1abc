//! Columns buckle at the loads of Euler, of Reissner and of Greenhill: there,
//! and nowhere else, the number of negative eigenvalues changes.

mod common;

use std::f64::consts::PI;

use common::{
    NEUTRAL, close, critical, critical_of_rigid, set_stiffness, set_vector, settle_on, tip,
};
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
    overrides.push(set_vector(
        "load.tip_force",
        DVec3::new(-tip_force, 0.0, 0.0),
    ));
    overrides.push(set_vector("load.gravity", DVec3::new(-gravity, 0.0, 0.0)));
    Scenario::from_toml_with(text, "column", &overrides).unwrap()
}

/// A thousand times as stiff up and down: it never buckles that way here.
const STRIP: f64 = 1000.0;

/// The index of the straight column, which is an equilibrium on every grid.
fn index(column: &Scenario, segments: usize) -> usize {
    let leaf = settle_on(column, segments, true);
    assert!(tip(&leaf).y.abs() + tip(&leaf).z.abs() < 1e-12);
    leaf.stability.negative_eigenvalues.unwrap()
}

/// P_k = (2k - 1)^2 pi^2/4 EI/L^2 of the clamped-free column.
fn euler(k: usize) -> f64 {
    (2.0 * k as f64 - 1.0).powi(2) * PI * PI / 4.0
}

#[test]
fn euler_between_two_critical_loads_the_index_counts_those_below() {
    for stiffness in [1e3, 1e6, f64::INFINITY] {
        assert_eq!(
            index(
                &column(STRIP, stiffness, stiffness, 0.99 * euler(1), 0.0),
                64
            ),
            0
        );
        for k in 1..6 {
            for load in [1.01 * euler(k), 0.98 * euler(k + 1)] {
                let strip = column(STRIP, stiffness, stiffness, load, 0.0);
                assert_eq!(index(&strip, 64), k, "H = {stiffness}, P = {load}");
                // A round section buckles both ways at once.
                let round = column(1.0, stiffness, stiffness, load, 0.0);
                assert_eq!(index(&round, 64), 2 * k, "H = {stiffness}, P = {load}");
            }
        }
    }
}

/// Equally stiff in stretch and shear, a column buckles at Euler's load all
/// the same: see the next test.
#[test]
fn euler_the_first_three_critical_loads_are_the_closed_form() {
    for (k, coarsest) in [(1, 8), (2, 16), (3, 16)] {
        let exact = euler(k);
        let found = critical(0.9 * exact, 1.1 * exact, coarsest, |load, segments| {
            index(&column(STRIP, 1000.0, 1000.0, load, 0.0), segments) >= k
        });
        close(&format!("P/P_{k}"), found / exact, 1.0, NEUTRAL);
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
        close("P", found / exact, 1.0, NEUTRAL);
    }
}

/// q L^3/EI = 9/4 j^2, j the first zero of the Bessel function J_(-1/3), for
/// an inextensible column.
#[test]
fn greenhill_a_column_buckles_under_its_own_weight() {
    let exact = 7.837347438943484;
    let found = critical_of_rigid(7.5, 8.2, 8, |weight, segments, stiffness| {
        index(&column(STRIP, stiffness, stiffness, 0.0, weight), segments) > 0
    });
    close("q", found / exact, 1.0, NEUTRAL);
}

/// Rigid in stretch and shear, exactly: the count must not be blurred by it.
#[test]
fn the_index_of_an_inextensible_column_changes_at_the_critical_load() {
    for (other, segments) in [(1.0, 64), (2.0, 64), (STRIP, 64), (1e4, 64), (1.0, 512)] {
        for part in [0.999, 1.001] {
            let load = part * euler(1);
            let rigid = column(other, f64::INFINITY, f64::INFINITY, load, 0.0);
            let ways = if other == 1.0 { 2 } else { 1 };
            let wanted = if part > 1.0 { ways } else { 0 };
            let found = index(&rigid, segments);
            assert_eq!(
                found, wanted,
                "EI = 1 and {other}, {segments} segments, {part} P_1"
            );
        }
    }
}
