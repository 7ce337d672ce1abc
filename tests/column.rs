//! Columns buckle at the loads of Euler, of Reissner and of Greenhill: there,
//! and nowhere else, the number of negative eigenvalues changes; on grids, and
//! along the branch of equilibria.

mod common;

use common::branch::{changes_at, follow};
use common::*;

/// A straight column, clamped at the base, EI = 1 sideways and `other` up and
/// down.
fn column(other: f64, [axial, shear]: [f64; 2], tip_force: f64, gravity: f64) -> Scenario {
    let (force, weight) = (-tip_force, -gravity);
    let loads = format!("load.tip_force=[{force}, 0, 0]; load.gravity=[{weight}, 0, 0]");
    let section = format!(
        "{}; stiffness.bending_2={other:?}",
        set_stiffness(axial, shear)
    );
    rod(&format!("{section}; {loads}"))
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
        let index = |other: f64, load: f64| index(&column(other, [stiffness; 2], load, 0.0), 64);
        assert_eq!(index(STRIP, 0.99 * euler(1)), 0);
        for k in 1..6 {
            for load in [1.01 * euler(k), 0.98 * euler(k + 1)] {
                assert_eq!(index(STRIP, load), k, "H = {stiffness}, P = {load}");
                // A round section buckles both ways at once.
                assert_eq!(index(1.0, load), 2 * k, "H = {stiffness}, P = {load}");
            }
        }
    }
}

/// Equally stiff in stretch and shear, a column buckles at Euler's load all
/// the same: see Reissner's.
#[test]
fn euler_the_first_three_critical_loads_are_the_closed_form() {
    for (k, coarsest) in [(1, 8), (2, 16), (3, 16)] {
        let exact = euler(k);
        let found = critical(0.9 * exact, 1.1 * exact, coarsest, |load, segments| {
            index(&column(STRIP, [1000.0; 2], load, 0.0), segments) >= k
        });
        close(&format!("P/P_{k}"), found / exact, 1.0, NEUTRAL);
    }
    let stiff = set_stiffness(1000.0, 1000.0);
    let strip = format!("{stiff}; stiffness.bending_2={STRIP}");
    let strip = follow(ROD, &strip, "load.tip_force[0]=0..-70", false);
    changes_at("Euler", &strip, &[1, 2, 3].map(|k| (-euler(k), 1)), 1e-8);
    let round = follow(ROD, &stiff, "load.tip_force[0]=0..-30", false);
    let twice = [1, 2].map(|k| (-euler(k), 2));
    changes_at("Euler, round", &round, &twice, 1e-8);
}

/// P (1 + P/GA - P/EA) = pi^2/4 EI/L^2 for a column that stretches and shears
/// (Engesser and Reissner): EA, GA, P.
const REISSNER: &str = "
    1000  400  2.458335976611486
     100   40  2.382272748545408
";

#[test]
fn reissner_stretch_and_shear_move_the_critical_load() {
    for [axial, shear, exact] in table(REISSNER) {
        let found = critical(2.0, 3.0, 8, |load, segments| {
            index(&column(STRIP, [axial, shear], load, 0.0), segments) > 0
        });
        close("P", found / exact, 1.0, NEUTRAL);
        let stiffness = set_stiffness(axial, shear);
        let strip = format!("{stiffness}; stiffness.bending_2={STRIP}");
        let found = follow(ROD, &strip, "load.tip_force[0]=0..-5", false);
        changes_at("Reissner", &found, &[(-exact, 1)], 1e-8);
    }
}

/// q L^3/EI = 9/4 j^2, j the first zero of the Bessel function J_(-1/3), for
/// an inextensible column (1881).
#[test]
fn greenhill_a_column_buckles_under_its_own_weight() {
    let exact = 7.837347438943484;
    let found = critical_of_rigid(7.5, 8.2, 8, |weight, segments, stiffness| {
        index(&column(STRIP, [stiffness; 2], 0.0, weight), segments) > 0
    });
    close("q", found / exact, 1.0, NEUTRAL);
    let strip = format!("{RIGID}; stiffness.bending_2=2.0");
    let found = follow(ROD, &strip, "load.gravity[0]=0..-10", false);
    changes_at("Greenhill", &found, &[(-exact, 1)], 1e-8);
}

/// Rigid in stretch and shear, exactly: the count must not be blurred by it.
#[test]
fn the_index_of_an_inextensible_column_changes_at_the_critical_load() {
    for (other, segments) in [(1.0, 64), (2.0, 64), (STRIP, 64), (1e4, 64), (1.0, 512)] {
        for part in [0.999, 1.001] {
            let rigid = column(other, [f64::INFINITY; 2], part * euler(1), 0.0);
            let ways = if other == 1.0 { 2 } else { 1 };
            let wanted = if part > 1.0 { ways } else { 0 };
            let what = format!("EI = 1 and {other}, {segments} segments, {part} P_1");
            assert_eq!(index(&rigid, segments), wanted, "{what}");
        }
    }
}
