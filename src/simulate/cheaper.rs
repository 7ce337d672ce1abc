//! What would make a long motion cost less, each with the cost that it would then have.
//!
//! The veins of a joined leaf that is released are stretched, or bend in short waves to meet: the waves that
//! follow are fast, and every method has to follow them until they have died. Nothing in the request tells which
//! change helps: the costs of changed requests do, known or estimated as that of the motion itself.

use crate::motion::Physics;
use crate::numbers::format_two_digits;
use crate::scenario::{CLAMPED_ROD_FREQUENCY, MotionStart, Scenario};
use crate::simulate::Simulation;
use crate::simulate::request::{Options, Scheme};
use std::fmt;

/// Motions that are expected to take longer, in seconds on one core of a machine of 2020, are told what would make
/// them cost less. To find that takes a second or so.
pub(super) const COSTLY_SECONDS: f64 = 10.0;

/// A change is told if the motion then costs less than this part, and of these at most so many.
const WORTHWHILE_PART: f64 = 0.5;
const MOST_CHANGES: usize = 3;

/// Part of critical damping that the internal damping of a change has in the lowest mode: hardly seen there, and
/// in proportion to their frequencies larger in fast waves.
const LOWEST_MODE_DAMPING: f64 = 0.01;

/// Segments below which the shape of a vein in motion is hardly resolved.
const FEWEST_SEGMENTS: usize = 8;

/// The largest tolerance that is proposed.
const LARGEST_TOLERANCE: f64 = 1e-2;

/// A change of a request after which a motion costs less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CheaperChange {
    /// The leaf starts at rest.
    StartAtRest,
    /// Its material has this retardation time, in the scenario's unit.
    InternalDamping(f64),
    /// Steps of this method.
    Method(Scheme),
    /// So many segments a vein.
    Segments(usize),
    /// This error of the tips, and of steps on the first grid, relative to the longest rod.
    Tolerance(f64),
}

impl fmt::Display for CheaperChange {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            CheaperChange::StartAtRest => f.write_str("dynamics.start = \"at-rest\""),
            CheaperChange::InternalDamping(time) => write!(
                f,
                "dynamics.internal_damping = {time:e}, by which fast waves die, and the lowest mode has {} % of its \
                 critical damping",
                100.0 * LOWEST_MODE_DAMPING
            ),
            CheaperChange::Method(scheme) => write!(f, "the {} method", scheme.word()),
            CheaperChange::Segments(count) => write!(f, "{count} segments a vein"),
            CheaperChange::Tolerance(tolerance) => write!(f, "a tolerance of {tolerance:e}"),
        }
    }
}

/// A change, and what the motion then costs on its first grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheaperMotion {
    /// The change.
    pub change: CheaperChange,
    /// Seconds on one core of a machine of 2020, approximately.
    pub seconds: f64,
}

impl fmt::Display for CheaperMotion {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let seconds = format_two_digits(self.seconds);
        write!(f, "{}: some {seconds} s", self.change)
    }
}

/// The changes after which a motion costs much less than these `seconds`, the cheapest first.
pub(super) fn cheaper_motions(
    scenario: &Scenario,
    options: &Options,
    first: &Simulation,
    seconds: f64,
) -> Vec<CheaperMotion> {
    let mut found = Vec::new();
    for change in possible_changes(scenario, options, first) {
        if options.limit.reached() {
            break;
        }
        let (mut scenario, mut options) = (scenario.clone(), options.clone());
        match change {
            CheaperChange::StartAtRest => scenario.dynamics.start = MotionStart::AtRest,
            CheaperChange::InternalDamping(time) => scenario.dynamics.internal_damping = time,
            CheaperChange::Method(scheme) => options.scheme = Some(scheme),
            CheaperChange::Segments(count) => options.segments = Some(count),
            CheaperChange::Tolerance(tolerance) => options.tolerance = Some(tolerance),
        }
        let local_error = options.tolerance.unwrap_or(scenario.tolerance);
        let changed = Simulation::with_local_error(&scenario, &options, local_error, true);
        // Where there is no such motion the change is none.
        let expected = changed.ok().and_then(|changed| changed.expected());
        if let Some((_, less)) = expected
            && less < WORTHWHILE_PART * seconds
        {
            found.push(CheaperMotion {
                change,
                seconds: less,
            });
        }
    }
    found.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    found.truncate(MOST_CHANGES);
    found
}

/// What may be changed.
fn possible_changes(
    scenario: &Scenario,
    options: &Options,
    first: &Simulation,
) -> Vec<CheaperChange> {
    let dynamics = &scenario.dynamics;
    let mut changes = Vec::new();
    if first.start() == Some(MotionStart::Released) && dynamics.clamped && is_driven(first) {
        changes.push(CheaperChange::StartAtRest);
    }
    if dynamics.internal_damping == 0.0 {
        let lowest = CLAMPED_ROD_FREQUENCY / dynamics.natural_time(&scenario.rods);
        let time = 2.0 * LOWEST_MODE_DAMPING / lowest;
        // One digit is enough.
        let time = format!("{time:.0e}").parse().unwrap_or(time);
        changes.push(CheaperChange::InternalDamping(time));
    }
    if options.scheme == Some(Scheme::Explicit) {
        changes.push(CheaperChange::Method(Scheme::SemiImplicit));
    }
    if options.segments.is_none_or(|count| count > FEWEST_SEGMENTS)
        && first.segments() / 2 >= FEWEST_SEGMENTS
    {
        changes.push(CheaperChange::Segments(first.segments() / 2));
    }
    let tolerance = options.tolerance.unwrap_or(first.tolerance());
    if options.step.is_none() && tolerance < LARGEST_TOLERANCE {
        changes.push(CheaperChange::Tolerance(LARGEST_TOLERANCE));
    }
    changes
}

/// Whether a leaf that starts at rest is moved by anything.
fn is_driven(motion: &Simulation) -> bool {
    let physics: &Physics = &motion.physics;
    physics.loads_vary()
        || physics.rest_curvature_varies()
        || physics.next_landing_time().is_finite()
        || motion.leaf().scenario().support_motion.is_some()
}
