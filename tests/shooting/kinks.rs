//! Profiles with kinks, veins of different lengths, free tips and dead moments:
//! the boundary-value solution is that of the relaxation there too.

use leafdyn::internals::shooting::ShootingFailureReason;
use leafdyn::scenario::{PointLoad, Tissue};
use leafdyn_testing::*;

/// Veins that taper, with a soft joint, and curl at rest from half their length on.
fn tapered() -> Scenario {
    let mut leaf = fig04(3);
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        let joint = 0.25 + 0.2 * j as f64;
        rod.couple_stiffness[1] = linear(&[0.0, joint, 1.0], &[2.0, 0.3, 0.6]);
        rod.couple_stiffness[0] = linear(&[0.0, 1.0], &[1.0, 0.2]);
        rod.force_stiffness[0] = linear(&[0.0, 0.7, 1.0], &[100.0, 20.0, 50.0]);
        rod.rest_curvature[1] = linear(&[0.0, 0.5, 1.0], &[0.0, 0.0, 3.0]);
        rod.rest_curvature[2] = linear(&[0.0, 0.1, 0.2, 1.0], &[0.0, 1.0, 0.0, 0.0]);
    }
    leaf
}

fn unequal(mut leaf: Scenario) -> Scenario {
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        rod.length = 1.0 + 0.03 * j as f64 * (-1.0_f64).powi(j as i32);
    }
    leaf
}

/// Profiles, unequal lengths, free tips, and a dead moment on the tip.
#[test]
fn relaxation_and_both_ways_of_shooting_agree() {
    all_agree("tapered", &tapered());
    let mut single = tapered();
    single.rods.truncate(1);
    single.coupling.clear();
    all_agree("one vein", &single);
    all_agree("Fig. 4", &unequal(fig04(5)));
    all_agree("tapered, unequal", &unequal(tapered()));
    for mut leaf in [fig04(3), unequal(fig04(3)), unequal(tapered())] {
        leaf.joined = false;
        leaf.tip_force = [0.3, -0.2, 0.5];
        all_agree("coupled", &leaf);
        leaf.coupling = vec![[0.0; 3]; 2];
        all_agree("uncoupled", &leaf);
    }
    for moment in [[0.0, 0.0, 1.0], [0.4, 0.5, -0.6], [-1.0, 0.8, 0.3]] {
        let mut rod = paper_leaf(1, [0.8, 1.0, 1.5], [100.0, 80.0, 60.0], 0.5);
        rod.tip_force = [0.2, 0.1, -0.3];
        rod.tip_moment = moment;
        all_agree("moment", &rod);
        rod.rods[0].rest_curvature = tapered().rods[0].rest_curvature.clone();
        rod.rods[0].couple_stiffness = tapered().rods[0].couple_stiffness.clone();
        all_agree("moment on a tapered rod", &rod);
    }
}

/// Profiles that jump, each at its own place, between veins tied by coupling and by tissue.
#[test]
fn profiles_with_steps_agree() {
    let mut leaf = fig04(3);
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        let step = 0.25 + 0.2 * j as f64;
        rod.couple_stiffness[1] = linear(&[0.0, step, step, 1.0], &[2.0, 1.5, 0.6, 0.4]);
        rod.couple_stiffness[0] = linear(&[0.0, 0.5, 0.5, 1.0], &[1.0, 1.0, 0.3, 0.3]);
        rod.force_stiffness[0] = linear(&[0.0, 0.7, 0.7, 1.0], &[100.0, 80.0, 30.0, 50.0]);
        rod.rest_curvature[1] = linear(&[0.0, 0.5, 0.5, 1.0], &[0.0, 0.5, 1.5, 1.0]);
        rod.rest_stretch = linear(&[0.0, step, step, 1.0], &[1.0, 1.05, 0.95, 1.0]);
    }
    let load = |size: f64| linear(&[0.0, 0.6, 0.6, 1.0], &[0.0, size, -size, 0.5 * size]);
    let vein = [load(0.1), load(-0.2), load(0.4)];
    leaf.distributed = Some(vec![vein; 3]);
    leaf.g = [0.0, 0.1, -0.2];
    leaf.dynamics.density = vec![linear(&[0.0, 0.45, 0.45, 1.0], &[1.0, 2.0, 0.5, 0.5]); 3];
    all_agree("coupled", &leaf);
    all_agree("unequal", &unequal(leaf.clone()));
    for contraction in [0.0, 0.1] {
        let mut tied = leaf.clone();
        tied.tissue = Some(vec![
            Tissue {
                stiffness: [2.0, 3.0, 4.0].map(Profile::Constant),
                fold: Profile::Constant(0.3),
                contraction: Profile::Constant(contraction),
            };
            2
        ]);
        let relaxed = settle(&tied, 1e-7);
        let near = shot_near(&tied, &relaxed);
        let off = apart(&tied, &relaxed.shape.rods, &near.rods).position;
        assert!(off <= estimate(&relaxed), "{contraction}: {off:e}");
    }
}

/// Angles beyond half a turn: the quaternion at the base is the one with w >= 0,
/// as it is of the relaxed leaf.
#[test]
fn angles_beyond_a_turn() {
    let mut leaf = fig04(3);
    for (rod, turns) in leaf.rods.iter_mut().zip([1.0, -2.0, 0.0]) {
        rod.angle += turns * 2.0 * std::f64::consts::PI;
    }
    let (relaxed, shot) = all_agree("wound", &leaf);
    for (a, b) in nodes(&relaxed.shape.rods).zip(nodes(&shot.rods)) {
        assert!(a.rotation.dot(b.rotation) > 0.0);
    }
}

/// One kink, written in two ways: 0.1 + 0.2 is not 0.3 to the last digit. Nor are
/// stations and ends of intervals that ought to be equal.
#[test]
fn kinks_and_stations_a_rounding_error_apart() {
    let with_kinks = |steps: bool, kinks: [f64; 3]| {
        let mut leaf = fig04(3);
        for (rod, at) in leaf.rods.iter_mut().zip(kinks) {
            rod.couple_stiffness[1] = match steps {
                true => linear(&[0.0, at, at, 1.0], &[1.0, 0.5, 1.5, 2.0]),
                false => linear(&[0.0, at, 1.0], &[1.0, 0.5, 2.0]),
            };
        }
        leaf
    };
    for steps in [false, true] {
        let leaf = with_kinks(steps, [0.3; 3]);
        let relaxed = settle(&leaf, 1e-10);
        for kinks in [[0.3; 3], [0.3, 0.1 + 0.2, 0.3 - 1e-16]] {
            let leaf = with_kinks(steps, kinks);
            let near = shot_near(&leaf, &relaxed);
            agree("from rest", &leaf, &relaxed, &near, 1e-9);
            for intervals in [10, 20, 30] {
                let over = found(&leaf, shoot_over(Some(intervals), &leaf, &relaxed));
                agree("over intervals", &leaf, &relaxed, &over, 1e-9);
            }
            let stations: Vec<f64> = (0..=20).map(|i| 1.0 - 0.05 * (20 - i) as f64).collect();
            let alone = shot_alone(&leaf, &stations);
            assert_eq!(alone.stations, stations);
            assert!(alone.rods.iter().all(|rod| rod.nodes.len() == 21));
            let off = alone.rods[0].nodes[20].position - relaxed.tips[0];
            assert!(off.length() < 1e-9, "{off}");
        }
    }
}

/// The error of a relaxed leaf, which shooting near it tells, and its estimate.
fn error(leaf: &Scenario, tolerance: f64) -> (f64, f64) {
    let relaxed = settle(leaf, tolerance);
    let shot = shot_near(leaf, &relaxed);
    assert!(shot.error.position < 1e-10);
    let off = apart(leaf, &relaxed.shape.rods, &shot.rods).position;
    (off, estimate(&relaxed) / relaxed.shape.rods[0].length)
}

/// Relaxed to few digits a leaf is known at few stations, and between them badly
/// where strong loads confine the bending to layers. From such starts shooting
/// used to fail, or to end in another equilibrium.
#[test]
fn starts_known_at_few_stations() {
    for entries in [
        "stiffness.torsion=0.17; stiffness.bending_2=0.126; stiffness.bending_3=21.7; \
         stiffness.axial={at=[0.0, 0.27, 0.55, 1.0], value=[11000.0, 17000.0, 19000.0, 3800.0]}; \
         stiffness.shear_2=80.0; stiffness.shear_3=9.2; \
         load.gravity=[6.9, -24.3, 26.8]; load.tip_force=[-10.4, -2.7, 16.4]",
        "stiffness.torsion=0.02; stiffness.bending_2=0.01; stiffness.axial=inf; \
         stiffness.shear_2=inf; stiffness.shear_3=50.0; \
         load.gravity=[3.0, -20.0, 10.0]; load.tip_force=[0.0, 5.0, 5.0]",
        "stiffness.torsion=0.05; stiffness.bending_2=0.05; stiffness.bending_3=0.05; \
         load.gravity=[-2.0, 0.5, 20.0]",
    ] {
        let leaf = rod(&format!("leaf.length=1.26; leaf.fan=[1.09]; {entries}"));
        for tolerance in [1e-6, 1e-8] {
            let (off, estimate) = error(&leaf, tolerance);
            assert!(off <= estimate, "{entries}: {off:.1e}, {estimate:.1e}");
        }
    }
}

/// Strong coupling has layers as thin; the strongest is refused in short time
/// and little memory.
#[test]
fn strong_coupling() {
    let coupled = |coupling: f64| {
        let mut leaf = fig04(5);
        leaf.coupling = vec![[coupling; 3]; 4];
        leaf
    };
    for coupling in [1e2, 1e4, 1e5] {
        let (off, estimate) = error(&coupled(coupling), 1e-8);
        assert!(off <= estimate, "{coupling:e}: {off:.1e}, {estimate:.1e}");
    }
    let glued = coupled(1e12);
    let relaxed = relaxed(&glued, &to(1e-2));
    let failure = shoot_near(&glued, &relaxed).expect_err("tens of thousands of intervals");
    assert!(matches!(
        failure.reason,
        ShootingFailureReason::Unbounded { .. }
    ));
}

/// Stations that are asked for are integrated to, and not interpolated: beside knots that are
/// close to each other interpolation was worse than stated, at every tolerance.
#[test]
fn stations_asked_for_are_within_their_estimate() {
    let mut leaf = fig04(3);
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        let soft = 0.25 + 0.1 * j as f64;
        let knots = [0.0, 0.263, 0.298, 1.0];
        rod.couple_stiffness[1] = linear(&knots, &[0.7, 1.5, soft, 1.9]);
        rod.rest_curvature[1] = linear(&[0.0, 1.0], &[1.8, -2.0]);
    }
    let asked = |parts: usize, options: Options| {
        let options = Options {
            stations: Some(parts),
            ..options
        };
        settled(&leaf, &options).at_stations(&leaf, Some(parts))
    };
    let arcs = Method::Shooting { intervals: None };
    let rest = Method::ShootingFromRest { intervals: None };
    for parts in [3, 16, 33, 64] {
        let exact = asked(parts, to(TIGHT));
        for (method, tolerance) in [(rest, 1e-4), (arcs, 1e-6), (rest, 1e-8)] {
            let shot = asked(
                parts,
                Options {
                    method,
                    ..to(tolerance)
                },
            );
            assert_eq!(shot.shape.stations, exact.shape.stations);
            let off = apart(&leaf, &shot.shape.rods, &exact.shape.rods).position;
            let estimate = (estimate(&shot) + estimate(&exact)) / leaf.rods[0].length;
            let what = format!("{parts} parts, {tolerance:e}: {off:.1e}, {estimate:.1e}");
            assert!(off <= estimate, "{what}");
        }
    }
}

/// Under moments and forces of about the same size: Newton's method ran away, so that steps of
/// the load must be shorter; and a path of loading that ends at a fold is left for another.
#[test]
fn loads_beyond_folds_of_their_path() {
    for entries in [
        "leaf.fan=[-0.951]; stiffness.torsion={at=[0.0, 1.0], value=[0.644, 2.741]}; \
         stiffness.bending_2={at=[0.0, 0.423, 0.938, 0.941, 1.0], value=[0.3356, 0.8345, 0.428, 0.7094, 1.859]}; \
         stiffness.bending_3=0.2325; stiffness.axial=86.92; stiffness.shear_2=75.78; stiffness.shear_3=148.7; \
         rest.twist={at=[0.0, 0.059, 0.57, 0.731, 1.0], value=[2.473, -1.698, -2.337, -1.171, 2.934]}; \
         rest.bend_2=0.118; rest.bend_3=-2.656; rest.stretch=0.81; load.gravity=[-0.1203, 0.1083, 0.018]; \
         load.tip_force=[1.559, -0.2177, 1.8605]; load.tip_moment=[3.221, 0.488, 0.973]",
        "leaf.fan=[0.522]; stiffness.torsion=0.4895; \
         stiffness.bending_2={at=[0.0, 0.701, 1.0], value=[2.617, 0.6908, 1.789]}; stiffness.bending_3=0.2124; \
         stiffness.axial={at=[0.0, 0.441, 0.513, 1.0], value=[68.85, 67.17, 92.21, 70.5]}; \
         stiffness.shear_2=124.7; stiffness.shear_3=113.4; rest.stretch=1.386; \
         load.gravity=[0.025, -0.0392, -0.0408]; load.tip_force=[0.3783, -2.7083, 1.2672]; \
         load.tip_moment=[0.81, -1.959, 0.856]",
    ] {
        let leaf = rod(entries);
        let relaxed = settle(&leaf, TIGHT);
        agree(entries, &leaf, &relaxed, &shot_near(&leaf, &relaxed), 1e-9);
    }
}

/// A point that is loaded is a kink; a station within rounding of it is there, and passes the load
/// once.
#[test]
fn stations_a_rounding_error_from_a_point_that_is_loaded() {
    for at in [0.37_f64, 0.3, 0.1 + 0.2, 0.58, 0.77] {
        let mut rod = paper_leaf(1, [0.8, 1.0, 1.5], [100.0, 80.0, 60.0], 0.5);
        rod.points = vec![PointLoad {
            vein: 0,
            at,
            force: [0.2, 0.3, 1.0],
            moment: [0.4, -0.5, 0.6],
            follows: false,
            mass: 0.0,
            offset: [0.0; 2],
            in_time: None,
            landing: None,
        }];
        let (relaxed, _) = all_agree("point", &rod);
        for station in [at.next_down(), at, at.next_up()] {
            let alone = shot_alone(&rod, &[0.0, station, 1.0]);
            let off = tip_node(&alone.rods, 0).position.distance(relaxed.tips[0]);
            assert!(off < 1e-9, "{at}: {off:e}");
            let tip = tip_node(&alone.rods, 0);
            assert!(tip.m.length() < 1e-9, "{at}: {}", tip.m);
            let k = relaxed
                .shape
                .stations
                .iter()
                .position(|s| (s - at).abs() < 1e-12);
            let before = in_lab(&relaxed.shape.rods[0].nodes[k.unwrap()]).1;
            let found = in_lab(&alone.rods[0].nodes[1]).1;
            assert!(found.distance(before) < 1e-7, "{at}: {found} for {before}");
        }
    }
}
