//! How much work a boundary-value solution takes. A change for the better is
//! welcome here; one for the worse is a slowdown.

use leafdyn::internals::shooting::{
    self, RequiredPrecision, ShootingCounts, ShootingFailureReason, ShootingOptions, ShootingStart,
};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Scenario;
use leafdyn_testing::*;

/// Linearisations and corrections to the last one, integration steps to a few.
#[track_caller]
fn is(what: &str, work: ShootingCounts, linearizations: usize, iterations: usize, steps: usize) {
    let found = (work.linearizations, work.iterations);
    assert_eq!(found, (linearizations, iterations), "{what}");
    let found = work.steps;
    assert!(found.abs_diff(steps) <= steps / 10, "{what}: {found} steps");
    // Twelve slopes a step, more only where one was rejected.
    let rejected = work.slopes as f64 / (12 * found) as f64;
    assert!(rejected < 1.1, "{what}: {} slopes", work.slopes);
}

/// One linearisation is enough near the solution, however many veins.
#[test]
fn from_the_relaxed_leaf() {
    for (figure, rods, steps) in [
        ("fig04", 5, 62),
        ("fig04", 21, 68),
        ("fig08", 5, 156),
        ("fig13", 5, 50),
    ] {
        let leaf = scenario(&format!("paper/{figure}"), &format!("leaf.rods={rods}"));
        let shot = shot_near(&leaf, &settle(&leaf, 1e-10));
        is(&format!("{figure}, {rods} veins"), shot.work, 1, 2, steps);
    }
}

/// Continuation takes all of a moderate load at once.
#[test]
fn from_arcs() {
    for (figure, linearizations, iterations, steps) in [("fig04", 4, 7, 190), ("fig06", 6, 11, 272)]
    {
        let leaf = scenario(&format!("paper/{figure}"), "leaf.rods=5");
        let shot = shot_alone(&leaf, &[0.0, 0.5, 1.0]);
        is(figure, shot.work, linearizations, iterations, steps);
    }
}

/// What would take far more than some seconds is not begun by who may give up; a small leaf is.
#[test]
fn too_much_work_is_not_begun() {
    let blade = scenario("measured/blade", "");
    let rest = settle(&blade, 1e-2);
    let solve = |scenario: &Scenario, rest: &Equilibrium| {
        let (stations, rods) = (&rest.shape.stations[..], &rest.shape.rods[..]);
        let start = ShootingStart::Leaf { stations, rods };
        let precision = RequiredPrecision::EstimatedError(1e-6);
        let options = ShootingOptions {
            gives_up: true,
            ..ShootingOptions::new(start, stations, precision)
        };
        shooting::solve(scenario, &options, &mut |_| {})
    };
    let failure = solve(&blade, &rest).expect_err("nine veins");
    let reason = failure.reason;
    assert!(
        matches!(reason, ShootingFailureReason::TooMuchWork { .. }),
        "{reason}"
    );
    assert_eq!(failure.work, ShootingCounts::default());
    let small = scenario("paper/fig04", "");
    assert!(solve(&small, &settle(&small, 1e-6)).is_ok());
}
