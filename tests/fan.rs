//! Fans of naturally curved rods of different lengths that meet in a common
//! tip, bent down by their weight; by relaxation and by shooting.

mod common;

use common::*;

/// Collocation on the boundary-value problem; re-integrated by DOP853.
#[test]
fn the_tips_are_those_of_the_boundary_value_problem() {
    let uncoupled = "coupling.x=0; coupling.y=0; coupling.z=0";
    let stiff = set_stiffness(2.5e5, 1e5);
    for (rods, entries, x, z) in [
        (2, "", 0.910506987231897, -0.405683573211535),
        (3, "", 0.934244176818460, -0.332744460157685),
        (5, uncoupled, 0.944393353500033, -0.307902124648867),
        (5, "", 0.944560025935573, -0.307809400980400),
        (5, &stiff, 0.944419286318834, -0.306536598218815),
    ] {
        let what = format!("{rods} rods, {entries}");
        let leaf = Both::solve(&format!("classic/fan_{rods}"), entries);
        // To the last digit.
        leaf.tip_is(&what, DVec3::new(x, 0.0, z), 2e-14, TIGHT);
        // The bases carry the whole weight, which is exact: n is the force on the
        // side towards the base, and pulls the base down.
        let rods = &leaf.relaxed.shape.rods;
        let weight: f64 = rods.iter().map(|rod| 2.0 * rod.length).sum();
        let balance = carried(rods) + weight * DVec3::Z;
        assert!(balance.length() < 1e-9, "{what}: {balance}");
        assert_eq!(leaf.relaxed.stable(), Some(true), "{what}");
    }
}

#[test]
fn force_and_moment_at_the_base_are_those_of_the_boundary_value_problem() {
    // Forces of the relaxed leaf are known less well than the positions.
    let leaf = Both::solve("classic/fan_5", "");
    for (rods, within) in leaf.shapes().into_iter().zip([2e-10, 2e-11]) {
        let (n, m) = in_lab(&rods[0].nodes[0]);
        let force = DVec3::new(-0.346390655515, 0.071950238440, -2.023136799373);
        let moment = DVec3::new(0.420128081676, 0.906963028790, -0.070957964861);
        assert!((n - force).length() < within, "{}", n - force);
        assert!((m - moment).length() < within, "{}", m - moment);
        close("sum of n_z", -carried(rods).z, 11.025588509411, 1e-11);
    }
}

/// No bifurcation is crossed on the way to the load, nor to five times it:
/// the sign of the determinant of the collocation matrix never changes.
#[test]
fn no_stability_is_lost_up_to_five_times_the_load() {
    for name in ["classic/fan_3", "classic/fan_5"] {
        for weight in [0.5, 2.0, 5.0, 10.0] {
            let leaf = solve(name, &format!("load.gravity=[0, 0, {:?}]", -weight));
            assert_eq!(leaf.stable(), Some(true), "{name}, {weight}");
            assert!(leaf.stability.saddle.is_none(), "{name}, {weight}");
        }
    }
}
