//! Soft leaves: perturbations grow from base to tip beyond all digits. Cut into
//! intervals the boundary-value problem is solved all the same; in one piece it
//! is not, and that is said.

use leafdyn::internals::shooting::{ShootingFailureReason, ShootingSolution};
use leafdyn::study::{CheckOptions, CheckVerdict, check};
use leafdyn_testing::*;

/// A figure with five veins that are softer still, under other loads.
fn soft(figure: &str, load: &str) -> Scenario {
    let entries = format!("leaf.rods=5; stiffness.bending_2=2e-4; {load}");
    scenario(&format!("paper/{figure}"), &entries)
}

fn both(leaf: &Scenario) -> (Equilibrium, ShootingSolution) {
    let relaxed = settle(leaf, 1e-10);
    let shot = shot_near(leaf, &relaxed);
    (relaxed, shot)
}

/// Pulled at the tip, or under five hundred times its weight: veins are straight
/// but for layers at the clamp and the tip.
#[test]
fn under_tension_only_many_intervals_succeed() {
    for (load, growth) in [
        ("load.tip_force=[5, 0, 0]", 25.0),
        ("load.gravity=[0, 0, -1]", 12.0),
    ] {
        let leaf = soft("fig08", load);
        let (relaxed, shot) = both(&leaf);
        agree(load, &leaf, &relaxed, &shot, 2e-9);
        assert!(shot.growth > growth, "{load}: 10^{}", shot.growth);
        assert!(shot.intervals.len() > 5);

        // Even from there a single interval does not find it.
        let mut there = relaxed.clone();
        there.shape.rods.clone_from(&shot.rods);
        let single = shoot_over(Some(1), &leaf, &there);
        let failure = single.expect_err("no digit is left at the tip");
        match failure.reason {
            ShootingFailureReason::NoConvergence { growth, .. } => {
                assert!(growth > 10.0, "{growth}")
            }
            ShootingFailureReason::Unbounded { sigma, .. } => assert!((0.0..1.0).contains(&sigma)),
            ShootingFailureReason::Singular(_)
            | ShootingFailureReason::Rounding { .. }
            | ShootingFailureReason::TooMuchMemory(_)
            | ShootingFailureReason::TooMuchWork { .. }
            | ShootingFailureReason::OutOfTime
            | ShootingFailureReason::Unmodelled(_) => {
                panic!("{}", failure.reason)
            }
        }
        assert!(failure.reason.to_string().contains("use more intervals"));
        assert_eq!(failure.lambda, 1.0);
        assert_eq!(failure.rods.len(), 5);
    }
}

/// Few intervals, or a start that is off: a failure, or the solution.
#[test]
fn a_success_is_never_false() {
    let leaf = soft("fig08", "load.tip_force=[5, 0, 0]");
    let (relaxed, shot) = both(&leaf);
    let mut succeeded = 0;
    for intervals in [1, 2, 4, 6, 8, 16] {
        for push in [0.0, 1e-5] {
            let mut start = relaxed.clone();
            for node in start.shape.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
                node.position.z += push;
                node.m.y += push;
            }
            let Ok(other) = shoot_over(Some(intervals), &leaf, &start) else {
                continue;
            };
            succeeded += 1;
            let off = apart(&leaf, &other.rods, &shot.rods);
            assert!(off.position < 1e-9, "{intervals} intervals: {off:?}");
        }
    }
    assert!((3..10).contains(&succeeded), "{succeeded}");
}

/// A blade as slender as paper: perturbations grow too much for shooting, which says so at once, and calls nothing an
/// agreement.
#[test]
fn a_slender_blade_is_not_confirmed() {
    let blade = |thickness: f64| {
        let text = format!(
            r#"
            name = "blade"
            leaf = {{ rods = 3, joined = false }}
            blade = {{ length = 1.0, width = 0.1, thickness = {thickness}, young = 1e4, poisson = 0.3, edges = true, mass_density = 2.0 }}
            load = {{ g = [0.0, 0.0, -1e-4] }}"#
        );
        let found = check(&parse(&text), &CheckOptions::default(), &mut |_| {}).unwrap();
        let work = found.shot.as_ref().unwrap().found.as_ref();
        let work = work.map_or_else(|failure| failure.work, |shot| shot.work);
        (found.verdict, work.linearizations)
    };
    let (verdict, _) = blade(0.002);
    assert_eq!(verdict, CheckVerdict::Agree);
    let (verdict, linearizations) = blade(0.0005);
    let CheckVerdict::NotIndependent(why) = verdict else {
        panic!("{verdict:?}");
    };
    let sentence = why.to_string();
    assert!(
        sentence.contains("shooting would take too much work"),
        "{sentence}"
    );
    assert_eq!(linearizations, 0);
}
