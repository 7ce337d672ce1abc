//! Fans of naturally curved rods of different lengths that meet in a common
//! tip, bent down by their weight.

mod common;

use common::{TIGHT, close, in_lab, set_stiffness, set_vector, solve, tip_is};
use glam::DVec3;
use leafdyn::relax::Equilibrium;

const UNCOUPLED: [&str; 3] = ["coupling.x=0", "coupling.y=0", "coupling.z=0"];

fn strings(overrides: &[&str]) -> Vec<String> {
    overrides.iter().map(|text| text.to_string()).collect()
}

/// The tip, its last digit, and that the bases carry the whole weight, which
/// is exact.
#[track_caller]
fn fan_is(what: &str, leaf: &Equilibrium, x: f64, z: f64) {
    tip_is(what, leaf, DVec3::new(x, 0.0, z), 2e-14, TIGHT);
    let weight: f64 = leaf.shape.rods.iter().map(|rod| 2.0 * rod.length).sum();
    let carried: DVec3 = leaf
        .shape
        .rods
        .iter()
        .map(|rod| in_lab(&rod.nodes[0]).0)
        .sum();
    // n is the force on the side towards the base: it pulls the base down.
    let balance = carried - DVec3::new(0.0, 0.0, -weight);
    assert!(balance.length() < 1e-9, "{what}: {balance}");
    assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
}

/// Collocation on the boundary-value problem; re-integrated by DOP853.
#[test]
fn the_tips_are_those_of_the_boundary_value_problem() {
    let leaf = solve("classic/fan_2", &[]);
    fan_is("2 rods", &leaf, 0.910506987231897, -0.405683573211535);
    let leaf = solve("classic/fan_3", &[]);
    fan_is("3 rods", &leaf, 0.934244176818460, -0.332744460157685);
    let leaf = solve("classic/fan_5", &strings(&UNCOUPLED));
    fan_is(
        "5 rods, uncoupled",
        &leaf,
        0.944393353500033,
        -0.307902124648867,
    );
    let leaf = solve("classic/fan_5", &[]);
    fan_is("5 rods", &leaf, 0.944560025935573, -0.307809400980400);
    let leaf = solve("classic/fan_5", &set_stiffness(2.5e5, 1e5));
    fan_is("5 stiff rods", &leaf, 0.944419286318834, -0.306536598218815);
}

#[test]
fn force_and_moment_at_the_base_are_those_of_the_boundary_value_problem() {
    let leaf = solve("classic/fan_5", &[]);
    let (n, m) = in_lab(&leaf.shape.rods[0].nodes[0]);
    let force = DVec3::new(-0.346390655515, 0.071950238440, -2.023136799373);
    let moment = DVec3::new(0.420128081676, 0.906963028790, -0.070957964861);
    assert!((n - force).length() < 2e-11, "{}", n - force);
    assert!((m - moment).length() < 2e-11, "{}", m - moment);
    let sum: f64 = leaf
        .shape
        .rods
        .iter()
        .map(|rod| in_lab(&rod.nodes[0]).0.z)
        .sum();
    close("sum of n_z", -sum, 11.025588509411, 1e-11);
}

/// No bifurcation is crossed on the way to the load, nor to five times it:
/// the sign of the determinant of the collocation matrix never changes.
#[test]
fn no_stability_is_lost_up_to_five_times_the_load() {
    for name in ["classic/fan_3", "classic/fan_5"] {
        for weight in [0.5, 2.0, 5.0, 10.0] {
            let gravity = set_vector("load.gravity", DVec3::new(0.0, 0.0, -weight));
            let leaf = solve(name, &[gravity]);
            assert_eq!(
                leaf.stability.negative_eigenvalues,
                Some(0),
                "{name}, {weight}"
            );
            assert!(leaf.stability.saddle.is_none(), "{name}, {weight}");
        }
    }
}
