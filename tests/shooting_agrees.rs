//! Relaxation and shooting, which share neither grid nor element nor linear
//! algebra, find the same leaf: position, directors, forces, moments, energy.

mod common;

use common::random::{drawn, leaves, wild_leaves};
use common::*;

/// Of position, in lengths of the leaf; ten times that of all else.
const CLOSE: f64 = 1e-9;

#[track_caller]
fn both_agree(scenario: &Scenario, within: f64) {
    let what = format!("{}, {} veins", scenario.name, scenario.rods.len());
    let leaf = settle(scenario, TIGHT);
    let shot = shot_near(scenario, &leaf);
    agree(&what, scenario, &leaf, &shot, within);
    // The boundary-value problem itself is solved, and it is told how well.
    assert!(shot.defect < 1e-11, "{what}: defect {:.1e}", shot.defect);
    let error = shot.error.position / scale(scenario).length;
    assert!(error < 1e-10, "{what}: estimated error {error:.1e}");
}

#[test]
fn on_every_figure_of_the_paper() {
    let paper = files("paper");
    assert_eq!(paper.len(), 9);
    for file in paper {
        for rods in [1, 2, 3, 5] {
            both_agree(&read(&file, &format!("leaf.rods={rods}")), CLOSE);
        }
    }
    // With as many veins as the paper.
    for entry in ["leaf.rods=21", "leaf.rods=35"] {
        both_agree(&scenario("paper/fig04", entry), 1e-8);
    }
}

/// And on the same sections and loads in fans of other numbers of veins, where what
/// the file lists vein by vein does not forbid it.
#[test]
fn on_every_classic_problem() {
    let (classic, mut accepted) = (files("classic"), 0);
    assert!(classic.len() >= 18);
    for file in &classic {
        both_agree(&read(file, ""), CLOSE);
        for rods in [2, 3, 5] {
            let fan = entries(&format!("leaf.rods={rods}; leaf.fan='symmetric'"));
            if let Ok(fan) = Scenario::read_with(file, &fan) {
                accepted += 1;
                both_agree(&fan, CLOSE);
            }
        }
    }
    assert!(accepted >= 30, "{accepted}");
}

/// The solution does not remember where it came from: from leaves relaxed to
/// one digit it is the same as from leaves relaxed to eleven.
#[test]
fn from_rough_starts_too() {
    for figure in ["fig04", "fig05", "fig06", "fig13"] {
        let leaf = scenario(&format!("paper/{figure}"), "leaf.rods=5");
        let (mut rough, fine) = (settle_on(&leaf, 8, false), settle(&leaf, TIGHT));
        for node in rough.shape.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
            node.position.z += 0.01;
            node.n.x += 0.1;
            node.m.y -= 0.1;
        }
        let shot = shot_near(&leaf, &rough);
        assert_eq!(rough.shape.stations, fine.shape.stations);
        agree(figure, &leaf, &fine, &shot, CLOSE);
    }
}

/// How often relaxation and shooting fail on leaves nobody has thought of; where both
/// succeed they must agree.
fn failed(leaves: &[Scenario], tolerance: f64, within: f64) -> [usize; 2] {
    let mut failed = [0, 0];
    for (case, scenario) in leaves.iter().enumerate() {
        let leaf = relaxed(scenario, &to(tolerance));
        if !leaf.outcome.is_success() {
            failed[0] += 1;
            println!("leaf {case}: relaxation {:?}", leaf.outcome);
            continue;
        }
        match shoot_near(scenario, &leaf) {
            Ok(shot) => agree(&format!("leaf {case}"), scenario, &leaf, &shot, within),
            Err(failure) => {
                failed[1] += 1;
                println!("leaf {case}: shooting, {}", failure.reason);
            }
        }
    }
    println!("of {} failed {failed:?}", leaves.len());
    failed
}

#[test]
fn on_random_leaves_of_moderate_loads() {
    let leaves = drawn(leaves(), 300);
    assert!(leaves.iter().any(|leaf| !leaf.joined));
    let [relaxing, shooting] = failed(&leaves, 1e-10, 1e-8);
    assert!(50 * relaxing < leaves.len() && 50 * shooting < leaves.len());
}

/// Sections that differ from vein to vein by orders of magnitude, dead moments,
/// loads that bend by many radians: some of these do not come to rest.
#[test]
fn on_wild_leaves() {
    let leaves = drawn(wild_leaves(), 60);
    let [relaxing, shooting] = failed(&leaves, 1e-8, 1e-6);
    assert!(6 * relaxing < leaves.len() && 50 * shooting < leaves.len());
}

/// Without a start continuation reaches nearly all. Where the way turns back, at
/// a fold, it stops; a few come out in another equilibrium.
#[test]
fn from_arcs_nearly_always() {
    let leaves = drawn(leaves(), 60);
    let (mut lost, mut other) = (0, 0);
    for (case, scenario) in leaves.iter().enumerate() {
        let leaf = settle(scenario, 1e-8);
        match shoot_alone(scenario, &leaf.shape.stations) {
            Ok(alone) => {
                assert!(alone.defect < 1e-10, "leaf {case}: {:.1e}", alone.defect);
                let off = apart(scenario, &leaf.shape.rods, &alone.rods);
                other += usize::from(off.position > 1e-7);
            }
            Err(failure) => {
                lost += 1;
                println!("leaf {case}: {} at {}", failure.reason, failure.part);
                assert!(failure.part < 1.0);
            }
        }
    }
    println!("of {}: {lost} lost, {other} elsewhere", leaves.len());
    assert!(20 * lost <= leaves.len(), "{lost}");
    assert!(10 * other <= leaves.len(), "{other}");
}
