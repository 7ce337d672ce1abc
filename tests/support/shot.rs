//! Leaves by shooting, alone and beside the relaxed ones.

use glam::DVec3;
use leafdyn::internals::shooting::{
    self, RequiredPrecision::LocalError, ShootingFailure, ShootingSolution, ShootingStart,
};
use leafdyn::relax::{Equilibrium, RodShape};
use leafdyn::scenario::Scenario;

use crate::{TIGHT, apart, largest, scale, scenario, settle, tip_is, tip_node};

/// Local error of the integration at which boundary-value solutions are
/// compared with others: as small as rounding allows.
pub const SHARP: f64 = 1e-13;

/// Solves the boundary-value problem, starting from a relaxed leaf.
pub fn shoot_near(
    scenario: &Scenario,
    leaf: &Equilibrium,
) -> Result<ShootingSolution, ShootingFailure> {
    shoot_over(None, scenario, leaf)
}

/// As [`shoot_near`], over so many intervals.
pub fn shoot_over(
    intervals: Option<usize>,
    scenario: &Scenario,
    leaf: &Equilibrium,
) -> Result<ShootingSolution, ShootingFailure> {
    let (stations, rods) = (&leaf.shape.stations[..], &leaf.shape.rods[..]);
    let start = ShootingStart::Leaf { stations, rods };
    let mut options = shooting::ShootingOptions::new(start, stations, LocalError(SHARP));
    options.intervals = intervals;
    shooting::solve(scenario, &options, &mut |_| {})
}

/// Solves the boundary-value problem without any start.
pub fn shoot_alone(
    scenario: &Scenario,
    stations: &[f64],
) -> Result<ShootingSolution, ShootingFailure> {
    let options = shooting::ShootingOptions::new(ShootingStart::Arcs, stations, LocalError(SHARP));
    shooting::solve(scenario, &options, &mut |_| {})
}

/// What shooting has found; the reason where it has not.
#[track_caller]
pub fn found(
    scenario: &Scenario,
    shot: Result<ShootingSolution, ShootingFailure>,
) -> ShootingSolution {
    let (name, rods) = (&scenario.name, scenario.rods.len());
    shot.unwrap_or_else(
        |ShootingFailure {
             reason,
             lambda: part,
             ..
         }| { panic!("{name}, {rods} veins: {reason}, at {part} of the load") },
    )
}

/// The boundary-value solution near a relaxed leaf, which must exist.
#[track_caller]
pub fn shot_near(scenario: &Scenario, leaf: &Equilibrium) -> ShootingSolution {
    found(scenario, shoot_near(scenario, leaf))
}

/// The boundary-value solution without any start, which must exist.
#[track_caller]
pub fn shot_alone(scenario: &Scenario, stations: &[f64]) -> ShootingSolution {
    let solution = found(scenario, shoot_alone(scenario, stations));
    let defect = solution.defect;
    assert!(defect < 1e-11, "{}: {defect:.1e}", scenario.name);
    solution
}

/// A leaf at rest by relaxation, and by shooting that knows nothing of it.
pub struct Both {
    pub relaxed: Equilibrium,
    pub shot: ShootingSolution,
}

impl Both {
    /// A scenario file with `entries` replaced.
    #[track_caller]
    pub fn solve(name: &str, overrides: &str) -> Both {
        Both::of(&scenario(name, overrides))
    }

    #[track_caller]
    pub fn of(scenario: &Scenario) -> Both {
        let relaxed = settle(scenario, TIGHT);
        let shot = shot_alone(scenario, &relaxed.shape.stations);
        Both { relaxed, shot }
    }

    /// The shapes that both have found.
    pub fn shapes(&self) -> [&[RodShape]; 2] {
        [&self.relaxed.shape.rods, &self.shot.rods]
    }

    /// As [`tip_is`], of both.
    #[track_caller]
    pub fn tip_is(&self, what: &str, wanted: DVec3, digits: f64, tolerance: f64) {
        tip_is(what, &self.relaxed, wanted, digits, tolerance);
        let off = tip_node(&self.shot.rods, 0).position - wanted;
        let error = off.abs().max_element();
        assert!(error <= tolerance, "{what}, by shooting: {error:.1e}");
    }
}

/// Asserts that a relaxed leaf and its boundary-value solution are the same to
/// `position`, and to ten times that in rotation, force, moment, and energy.
#[track_caller]
pub fn agree(
    what: &str,
    scenario: &Scenario,
    leaf: &Equilibrium,
    shot: &ShootingSolution,
    position: f64,
) {
    let found = apart(scenario, &leaf.shape.rods, &shot.rods);
    let energy = (leaf.energy.unwrap() - shot.energy).abs() / scale(scenario).moment();
    let others = largest([found.rotation, found.force, found.moment, energy]);
    let agree = found.position <= position && others <= 10.0 * position;
    assert!(agree, "{what}: {found:?}, energy {energy:.1e}");
}

/// Asserts that a relaxed leaf agrees with the boundary-value solutions from there and from
/// arcs; returns both.
#[track_caller]
pub fn all_agree(what: &str, leaf: &Scenario) -> (Equilibrium, ShootingSolution) {
    let relaxed = settle(leaf, TIGHT);
    let near = shot_near(leaf, &relaxed);
    agree(what, leaf, &relaxed, &near, 1e-9);
    let alone = shot_alone(leaf, &relaxed.shape.stations);
    agree(what, leaf, &relaxed, &alone, 1e-9);
    (relaxed, near)
}
