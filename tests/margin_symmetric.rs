//! Margins next to symmetric bifurcations: below its Euler load a column has no pass and
//! gives way where it must, beyond it the pass is the straight column, and its energy
//! vanishes like the square of the distance. On coarse grids these loads are larger.

mod common;

use std::f64::consts::PI;

use common::*;
use leafdyn::relax::{Loss, Margin};
use leafdyn::study::relax_with_margin;

const EULER: f64 = 0.25 * PI * PI;

/// Distances from the bifurcation, as parts of its load.
const PARTS: [f64; 5] = [0.1, 0.05, 0.02, 0.01, 0.005];

fn margin(scenario: &Scenario) -> Margin {
    let leaf = relax_with_margin(scenario, &to(1e-8), &mut |_| {}).unwrap();
    leaf.margin.unwrap()
}

/// A clamped strip, or a round column, under a load along it.
fn column(load: f64, round: bool) -> Scenario {
    let other = if round { 1.0 } else { 50.0 };
    let load = format!("load.tip_force=[{:?}, 0, 0]", -load);
    rod(&format!("{RIGID}; stiffness.bending_2={other:?}; {load}"))
}

#[test]
fn below_its_load_a_column_gives_way_at_what_is_left_of_it() {
    for (round, part) in [(true, 0.1), (false, 0.02), (true, 0.01)] {
        let found = margin(&column((1.0 - part) * EULER, round));
        let least = &found.pushes[0];
        let (force, error) = (least.force.unwrap(), least.error.unwrap());
        assert_eq!(least.direction.to_string(), "-x");
        assert_eq!(least.kind, Loss::BranchPoint);
        close(&format!("{part}"), force, part * EULER, error);
        assert!(error < 1e-4 * force, "{part}: {force} within {error}");
        assert!(found.barrier.is_none(), "{found:?}");
    }
}

/// The energy of the straight column above that of the elastica under a load P: with the sine
/// k of half of its tip's angle K(k) = sqrt P, its tip is at 2 E/K - 1, and the first integral
/// theta'^2 = 2 P (cos theta - cos alpha) makes the difference P (4 - 2 k^2 - 4 E/K).
fn barrier(load: f64) -> f64 {
    let k = elastica_modulus(load);
    let [first, second] = elliptic(k);
    load * (4.0 - 2.0 * k * k - 4.0 * second / first)
}

#[test]
fn beyond_its_load_the_barrier_of_a_strip_is_that_of_the_elastica() {
    for part in PARTS {
        let load = (1.0 + part) * EULER;
        let found = margin(&column(load, false)).barrier;
        let found = found.unwrap_or_else(|| panic!("{part}"));
        let (energy, error) = (found.energy, found.error.unwrap());
        // The closed form is a difference of numbers of the order of the load.
        close(
            &format!("{part}"),
            energy,
            barrier(load),
            error + 1e-14 * load,
        );
        assert!(error < 1e-6 * energy);
        assert!((found.saddle.tip.x - 1.0).abs() < 1e-9);
    }
}

/// A round one can be turned without a force.
#[test]
fn a_buckled_round_column_has_no_margin() {
    let found = margin(&column(1.02 * EULER, true));
    assert!(found.barrier.is_none() && found.pushes.is_empty());
    assert!(found.remark.unwrap().contains("cannot be told from zero"));
}

/// Axial stiffness, and the load under which a column that is clamped at both ends buckles:
/// P (1 - P/H) = 4 pi^2.
const AXIAL: f64 = 1000.0;

fn shortened(beyond: f64) -> Scenario {
    let load = 0.5 * AXIAL * (1.0 - (1.0 - 16.0 * PI * PI / AXIAL).sqrt());
    let tip = 1.0 - (1.0 + beyond) * load / AXIAL;
    let stiffness = set_stiffness(AXIAL, f64::INFINITY);
    rod(&format!(
        "stiffness.torsion=50; stiffness.bending_2=50; {stiffness}; \
         tip.held='clamped'; tip.position=[{tip:?}, 0, 0]"
    ))
}

/// Held at both ends, from 10 to 0.5 % beyond: H/2 times the square of the strain beyond, but
/// for terms of the next order.
#[test]
fn a_column_that_is_shortened_has_a_barrier() {
    for beyond in [-0.02, -0.005] {
        let found = margin(&shortened(beyond));
        assert!(found.barrier.is_none(), "{beyond}: {found:?}");
        assert!(found.remark.unwrap().contains("the tip is held"));
    }
    let relative = PARTS.map(|beyond| {
        let found = margin(&shortened(beyond)).barrier;
        found.unwrap_or_else(|| panic!("{beyond}")).energy / (beyond * beyond)
    });
    for pair in relative.windows(2) {
        assert!((pair[0] / pair[1] - 1.0).abs() < 0.01, "{relative:?}");
    }
}
