//! Requests that cannot be simulated.

use crate::refusal::RefusedOption;
use crate::relax;

/// Longest expected duration of a simulation that is accepted, in seconds.
pub const MOST_SECONDS: f64 = 3.0 * DAY;
const DAY: f64 = 86_400.0;

/// Why a request cannot be simulated. Times are in the scenario's unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The explicit method has no stable time step.
    #[error(
        "the explicit method has no stable time step for rigid rods (a stiffness is inf): \
         use the semi-implicit method, or give a number"
    )]
    Rigid,
    /// The base is free, and the semi-implicit method clamps it.
    #[error(
        "dynamics.clamped = false: the semi-implicit method holds the base: use the explicit method{}",
        if *.rigid { ", and a number for every stiffness that is inf" } else { "" }
    )]
    Held {
        /// Whether a rod is rigid, which the explicit method cannot move.
        rigid: bool,
    },
    /// A load has a pulse that the semi-implicit method does not resolve.
    #[error(
        "a load in time has a pulse at {at} that is shorter than a millionth of the unit of time \
         sqrt(rho L^4/A): make it longer with the same impulse{}",
        if *.rigid { "" } else { ", or use the explicit method" }
    )]
    Pulse {
        /// Its time.
        at: f64,
        /// Whether a rod is rigid, which the explicit method cannot move.
        rigid: bool,
    },
    /// An option has a value that it cannot have, such as a time step that is too long for the
    /// explicit method.
    #[error("{0}")]
    Option(#[from] RefusedOption),
    /// The time step is too short for the duration.
    #[error(
        "the time step of {step:.3e} makes {steps:.1e} steps, which take some {} days, and at most {} are allowed: \
         use {}",
        (.seconds / DAY).ceil(), MOST_SECONDS / DAY,
        match .given {
            true => "a longer step, or leave it out",
            false => "the semi-implicit method, softer rods, fewer segments, or a shorter duration",
        }
    )]
    TooLong {
        /// The step.
        step: f64,
        /// Steps to the end.
        steps: f64,
        /// Estimated duration.
        seconds: f64,
        /// Whether the step was given.
        given: bool,
    },
    /// The grid is invalid.
    #[error(transparent)]
    Request(#[from] relax::RelaxError),
    /// The leaf should start at rest, and its relaxation fails.
    #[error(
        "dynamics.start = \"at-rest\": the leaf does not come to rest under its loads at time 0 ({outcome}): use start = \"released\""
    )]
    NoRest {
        /// The outcome of its relaxation.
        outcome: &'static str,
    },
}
