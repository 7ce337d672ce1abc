//! What a leaf does is independent of where it is looked at from: turned,
//! mirrored, in other units or numbered backwards it does the same.
//!
//! A scenario states turns about e3, along which the fan's plane lies, for any
//! leaf, and about e1 for a rod clamped along it: a quarter turn for any
//! section, any turn for a round one.

use glam::{DMat3, DQuat};
use leafdyn_testing::random::cases;
use leafdyn_testing::*;
use proptest::prelude::*;

/// The iteration error is a thousandth of this.
const TOLERANCE: f64 = 1e-10;
const EQUAL: f64 = 1e-12;

/// Leaves that are coupled alike along x and y.
fn leaves() -> impl Strategy<Value = Scenario> {
    leafdyn_testing::random::leaves().prop_map(|mut leaf| {
        leaf.coupling.iter_mut().for_each(|gap| gap[0] = gap[1]);
        leaf
    })
}

/// Turned about `axis`, all loads.
fn turn_loads(scenario: &mut Scenario, turn: DQuat) {
    for load in [&mut scenario.gravity, &mut scenario.tip_force] {
        *load = (turn * DVec3::from_array(*load)).to_array();
    }
}

/// A straight rod of a leaf, alone.
fn first_rod(mut leaf: Scenario) -> Scenario {
    leaf.rods.truncate(1);
    leaf.coupling.clear();
    leaf.rods[0].angle = 0.0;
    leaf
}

/// A leaf that is mirrored along an axis: so are its loads, and the rest curvatures about
/// two of its directors change their signs.
fn mirrored(leaf: &Scenario, axis: usize, curvatures: [usize; 2]) -> Scenario {
    let mut mirrored = leaf.clone();
    mirrored.gravity[axis] *= -1.0;
    mirrored.tip_force[axis] *= -1.0;
    for rod in &mut mirrored.rods {
        for k in curvatures {
            rod.rest_curvature[k] = rod.rest_curvature[k].scaled(-1.0);
        }
    }
    mirrored
}

/// Both leaves at rest: see [`assert_mapped`].
#[track_caller]
fn assert_does_the_same(
    leaf: &Scenario,
    other: &Scenario,
    map: DMat3,
    directors: impl Fn(DMat3) -> DMat3,
) {
    let [a, b] = [leaf, other].map(|leaf| settle(leaf, TOLERANCE));
    assert_mapped(&a, &b, map, directors, EQUAL);
}

/// Positions of `b` are those of `a`, mapped, within `tolerance`; so are
/// rotations, when the directors are mapped too.
#[track_caller]
fn assert_mapped(
    a: &Equilibrium,
    b: &Equilibrium,
    map: DMat3,
    directors: impl Fn(DMat3) -> DMat3,
    tolerance: f64,
) {
    assert_eq!(a.shape.stations, b.shape.stations);
    assert_eq!(a.accuracy.segments, b.accuracy.segments);
    let [energy, other] = [a, b].map(|leaf| leaf.energy.unwrap());
    let allowed = tolerance * (1.0 + energy.abs());
    let off = (energy - other).abs();
    assert!(off <= allowed, "energy off by {off:.1e}");
    for (a, b) in a.shape.rods.iter().zip(&b.shape.rods) {
        for (a, b) in a.nodes.iter().zip(&b.nodes) {
            let error = (map * a.position - b.position).length();
            assert!(error <= tolerance, "off by {error:.1e}");
            let error = directors(DMat3::from_quat(a.rotation)) - DMat3::from_quat(b.rotation);
            let entry = largest(error.to_cols_array().map(f64::abs));
            assert!(entry <= 10.0 * tolerance, "turned by {error}");
        }
    }
}

proptest! {
    #![proptest_config(cases(48))]

    #[test]
    fn turned_about_e3(leaf in leaves(), angle in -3.0..3.0_f64) {
        let turn = DQuat::from_rotation_z(angle);
        let mut turned = leaf.clone();
        turn_loads(&mut turned, turn);
        for rod in &mut turned.rods {
            rod.angle += angle;
        }
        // Couplings are alike along x and y only as long as they are not turned.
        let map = DMat3::from_quat(turn);
        assert_does_the_same(&leaf, &turned, map, |directors| map * directors);
    }

    /// A quarter turn about e1 exchanges d2 and d3; with directors R' = Q R Q^T,
    /// curvatures and stiffnesses turn along.
    #[test]
    fn a_rod_turned_about_its_clamp_by_a_quarter(leaf in leaves()) {
        let rod = first_rod(leaf);
        let quarter = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let mut turned = rod.clone();
        turn_loads(&mut turned, quarter);
        let of = &mut turned.rods[0];
        of.couple_stiffness.swap(1, 2);
        of.force_stiffness.swap(1, 2);
        let [twist, bend_2, bend_3] = of.rest_curvature.clone();
        of.rest_curvature = [twist, bend_3.scaled(-1.0), bend_2];
        let map = DMat3::from_quat(quarter);
        assert_does_the_same(&rod, &turned, map, |directors| map * directors * map.transpose());
    }

    #[test]
    fn a_round_rod_turned_about_its_clamp(leaf in leaves(), angle in -3.0..3.0_f64) {
        let mut rod = first_rod(leaf);
        let of = &mut rod.rods[0];
        of.couple_stiffness[2] = of.couple_stiffness[1].clone();
        of.force_stiffness[2] = of.force_stiffness[1].clone();
        let rest = DVec3::from_array(of.rest_curvature.each_ref().map(|u| u.at(0.0)));
        of.rest_curvature = rest.to_array().map(Profile::Constant);
        let turn = DQuat::from_rotation_x(angle);
        let mut turned = rod.clone();
        turn_loads(&mut turned, turn);
        turned.rods[0].rest_curvature = (turn * rest).to_array().map(Profile::Constant);
        let map = DMat3::from_quat(turn);
        assert_does_the_same(&rod, &turned, map, |directors| map * directors * map.transpose());
    }

    /// y -> -y: a mirror keeps the directors d1 and d3 and reverses d2, so that
    /// twist and the bend about d3 change their signs.
    #[test]
    fn mirrored_from_left_to_right(leaf in leaves()) {
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        let mut mirrored = mirrored(&leaf, 1, [0, 2]);
        for rod in &mut mirrored.rods {
            rod.angle = -rod.angle;
        }
        assert_does_the_same(&leaf, &mirrored, mirror, |directors| mirror * directors * mirror);
    }

    /// z -> -z: d3 is reversed, twist and the bend about d2 change their signs.
    #[test]
    fn mirrored_from_top_to_bottom(leaf in leaves()) {
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        let mirrored = mirrored(&leaf, 2, [0, 1]);
        assert_does_the_same(&leaf, &mirrored, mirror, |directors| mirror * directors * mirror);
    }

    /// Lengths times 1000, forces times 1e-5: lengths come out times 1000.
    #[test]
    fn in_other_units(leaf in leaves()) {
        let (length, force) = (1e3, 1e-5);
        let mut scaled = leaf.clone();
        for k in 0..3 {
            scaled.gravity[k] *= force / length;
            scaled.tip_force[k] *= force;
            for gap in &mut scaled.coupling {
                gap[k] *= force / (length * length);
            }
        }
        for rod in &mut scaled.rods {
            rod.length *= length;
            for k in 0..3 {
                rod.couple_stiffness[k] = rod.couple_stiffness[k].scaled(force * length * length);
                rod.force_stiffness[k] = rod.force_stiffness[k].scaled(force);
                rod.rest_curvature[k] = rod.rest_curvature[k].scaled(1.0 / length);
            }
        }
        let a = settle(&leaf, TOLERANCE);
        let mut b = settle(&scaled, TOLERANCE);
        close("estimate", estimate(&b) / length / estimate(&a), 1.0, 0.1);
        b.energy = b.energy.map(|energy| energy / (force * length));
        for (rod, of) in b.shape.rods.iter_mut().zip(&a.shape.rods) {
            for (node, of) in rod.nodes.iter_mut().zip(&of.nodes) {
                node.position /= length;
                prop_assert!((node.n / force - of.n).length() < 1e-9);
                prop_assert!((node.m / (force * length) - of.m).length() < 1e-9);
                prop_assert!((node.u * length - of.u).length() < 1e-9);
                prop_assert!((node.v - of.v).length() < 1e-9);
            }
        }
        assert_mapped(&a, &b, DMat3::IDENTITY, |directors| directors, 1e-10);
    }

    #[test]
    fn numbered_backwards(leaf in leaves()) {
        let mut reversed = leaf.clone();
        reversed.rods.reverse();
        reversed.coupling.reverse();
        let a = settle(&leaf, TOLERANCE);
        let mut b = settle(&reversed, TOLERANCE);
        b.shape.rods.reverse();
        assert_mapped(&a, &b, DMat3::IDENTITY, |directors| directors, EQUAL);
    }
}
