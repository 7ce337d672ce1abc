//! Relaxation and shooting agree on leaves nobody has thought of.

mod common;
#[path = "common/random.rs"]
mod random;

use common::{agree, settle, shoot_alone, shoot_near};
use leafdyn::relax::{Options, relax};
use leafdyn::scenario::Scenario;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use random::{leaves, wild_leaves};

fn drawn(leaves: impl Strategy<Value = Scenario>, count: usize) -> Vec<Scenario> {
    let mut runner = TestRunner::deterministic();
    (0..count)
        .map(|_| leaves.new_tree(&mut runner).unwrap().current())
        .collect()
}

/// How often each method failed, of how many.
#[derive(Debug, Default, PartialEq)]
struct Failed {
    relaxing: usize,
    shooting: usize,
}

/// Relaxes and shoots all leaves; where both succeed they must agree.
fn compare(what: &str, leaves: &[Scenario], tolerance: f64, within: f64) -> Failed {
    let mut failed = Failed::default();
    for (case, scenario) in leaves.iter().enumerate() {
        let options = Options {
            tolerance: Some(tolerance),
            ..Options::default()
        };
        let leaf = relax(scenario, &options, &mut |_| {}).unwrap();
        if !leaf.outcome.is_success() {
            failed.relaxing += 1;
            println!("{what} {case}: relaxation {:?}", leaf.outcome);
            continue;
        }
        match shoot_near(scenario, &leaf) {
            Ok(shot) => agree(&format!("{what} {case}"), scenario, &leaf, &shot, within),
            Err(failure) => {
                failed.shooting += 1;
                println!("{what} {case}: shooting, {}", failure.reason);
            }
        }
    }
    println!("{what}: of {} failed {failed:?}", leaves.len());
    failed
}

#[test]
fn on_leaves_of_moderate_loads() {
    let leaves = drawn(leaves(), 300);
    assert!(leaves.iter().any(|leaf| !leaf.joined));
    let failed = compare("leaf", &leaves, 1e-10, 1e-8);
    assert!(50 * failed.relaxing < leaves.len(), "{failed:?}");
    assert!(50 * failed.shooting < leaves.len(), "{failed:?}");
}

/// Sections that differ from vein to vein by orders of magnitude, dead moments,
/// loads that bend by many radians: some of these do not come to rest.
#[test]
fn on_wild_leaves() {
    let leaves = drawn(wild_leaves(), 60);
    let failed = compare("wild leaf", &leaves, 1e-8, 1e-6);
    assert!(6 * failed.relaxing < leaves.len(), "{failed:?}");
    assert!(50 * failed.shooting < leaves.len(), "{failed:?}");
}

/// Without a start continuation reaches nearly all. Where the way turns back, at
/// a fold, it stops; a few come out in another equilibrium.
#[test]
fn from_arcs_nearly_always() {
    let leaves = drawn(leaves(), 60);
    let mut lost = 0;
    let mut other = 0;
    for (case, scenario) in leaves.iter().enumerate() {
        let leaf = settle(scenario, 1e-8);
        match shoot_alone(scenario, &leaf.shape.stations) {
            Ok(alone) => {
                assert!(alone.defect < 1e-10, "leaf {case}: {:.1e}", alone.defect);
                let off = common::apart(scenario, &leaf.shape.rods, &alone.rods);
                other += usize::from(off.position > 1e-7);
            }
            Err(failure) => {
                lost += 1;
                println!("leaf {case}: {} at {}", failure.reason, failure.part);
                assert!(failure.part < 1.0);
            }
        }
    }
    println!(
        "of {}: {lost} lost, {other} in another equilibrium",
        leaves.len()
    );
    assert!(20 * lost <= leaves.len(), "{lost}");
    assert!(10 * other <= leaves.len(), "{other}");
}
