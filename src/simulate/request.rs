//! What is asked of a simulation: its options, and the errors of requests that cannot be met.

use crate::motion::ExplicitRefusal;
use crate::run::{Limit, RefusedOption};
use crate::{relax, words};

/// Default number of segments per rod, unless its rest shape needs more.
pub(crate) const DEFAULT_MOTION_SEGMENTS: usize = 16;

/// The error of tips that a [`Refinement`](crate::simulate::Refinement) aims at unless a tolerance is given, relative to the
/// longest rod.
pub const DEFAULT_TIP_ERROR: f64 = 1e-3;

words! {
    /// The method of time integration.
    pub enum Scheme {
        /// `Explicit`: short, very cheap steps. Not for rigid rods.
        Explicit = "explicit",
        /// `SemiImplicit`: steps as long as accuracy allows, for any stiffness.
        SemiImplicit = "semi-implicit",
    }
}

/// Options of a simulation.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The method; `None`: the one that costs less, as [`SchemeChoice`](crate::simulate::SchemeChoice) says.
    pub scheme: Option<Scheme>,
    /// Segments per rod; `None`: 16, or as many as the rest shape needs.
    pub segments: Option<usize>,
    /// The longest time step, in the scenario's unit of time. `None`: for the
    /// explicit method, nine tenths of the stable one; for the semi-implicit
    /// one, such that the error of a step stays below the scenario's tolerance.
    pub step: Option<f64>,
    /// Replaces the scenario's tolerance: for the semi-implicit method, the
    /// local error of a step relative to the longest rod. Of a [`Refinement`](crate::simulate::Refinement) also the error of
    /// tips that it aims at, in place of [`DEFAULT_TIP_ERROR`].
    pub tolerance: Option<f64>,
    /// When the motion ends early, as [`Stopped::Interrupted`](crate::simulate::Stopped::Interrupted).
    pub limit: Limit,
}

/// Longest expected duration of a simulation that is accepted, in seconds.
pub const MAX_SIMULATION_SECONDS: f64 = 3.0 * DAY;

pub(super) const DAY: f64 = 86_400.0;

/// Why a request cannot be simulated. Times are in the scenario's unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// The explicit method has no stable time step.
    #[error(
        "{keys}: the explicit method has no stable time step for rigid rods: use the semi-implicit method, or give \
         numbers"
    )]
    Rigid {
        /// The keys that make rods rigid, with their value.
        keys: String,
    },
    /// The explicit method does not move masses off the axis.
    #[error(
        "load.point.offset: the explicit method does not move masses off the axis: use the semi-implicit method, or \
         leave the offset out"
    )]
    MassOffAxis,
    /// The base is free, and the semi-implicit method clamps it.
    #[error(
        "dynamics.clamped = false: the semi-implicit method holds the base: use the explicit method{}",
        match .obstacle {
            None => "",
            Some(ExplicitRefusal::RigidRod) => ", and a number for every stiffness that is inf",
            Some(ExplicitRefusal::MassOffAxis) => ", and no load.point.offset of a mass",
        }
    )]
    Held {
        /// What the explicit method cannot move.
        obstacle: Option<ExplicitRefusal>,
    },
    /// A load has a pulse that the semi-implicit method does not resolve.
    #[error(
        "a load in time has a pulse at {at} that is shorter than a millionth of the unit of time \
         sqrt(rho L^4/A): make it longer with the same impulse{}",
        match .obstacle {
            Some(_) => "",
            None => ", or use the explicit method",
        }
    )]
    Pulse {
        /// Its time.
        at: f64,
        /// What the explicit method cannot move.
        obstacle: Option<ExplicitRefusal>,
    },
    /// An option has a value that it cannot have, such as a time step that is too long for the
    /// explicit method.
    #[error("{0}")]
    Option(#[from] RefusedOption),
    /// The time step is too short for the duration.
    #[error(
        "the time step of {step:.3e} makes {steps:.1e} steps, which take some {} days, and at most {} are allowed: \
         use {}",
        (.seconds / DAY).ceil(), MAX_SIMULATION_SECONDS / DAY,
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
        "dynamics.start = \"at-rest\": on {segments} segments a vein the leaf does not come to rest under its loads at time 0 \
         ({outcome}): give more segments, or use start = \"released\""
    )]
    NoRest {
        /// The outcome of its relaxation.
        outcome: &'static str,
        /// Segments of a vein.
        segments: usize,
    },
}
