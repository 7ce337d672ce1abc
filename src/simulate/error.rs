//! What cannot be simulated, and what ends a simulation early.

use crate::relax;

/// What cannot be simulated. Times are in the scenario's unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The explicit method has no stable time step.
    #[error(
        "the explicit method has no stable time step for rigid rods (a stiffness is inf): \
         use --method semi-implicit, or give a number"
    )]
    Rigid,
    /// The base is free, and the semi-implicit method clamps it.
    #[error(
        "dynamics.clamped = false: the semi-implicit method holds the base: use --method explicit{}",
        if *.rigid { ", and a number for every stiffness that is inf" } else { "" }
    )]
    Held {
        /// Whether a rod is rigid, which the explicit method cannot move.
        rigid: bool,
    },
    /// The time step is not positive.
    #[error("--step {found}: must be greater than 0")]
    NotPositive {
        /// The step asked for.
        found: f64,
    },
    /// The time step is too long for the explicit method.
    #[error(
        "--step {found}: the explicit method is stable up to {stable:.3e}, because of {limit}: \
         use a shorter step, or --method semi-implicit, or leave --step out"
    )]
    Unstable {
        /// The step asked for.
        found: f64,
        /// The longest stable one.
        stable: f64,
        /// What limits it.
        limit: &'static str,
    },
    /// The grid or the tolerance is impossible.
    #[error(transparent)]
    Request(#[from] relax::RelaxError),
    /// The leaf is to start at rest and does not come to rest.
    #[error(
        "dynamics.start = \"at-rest\": the leaf does not come to rest under its loads at time 0 ({outcome}): use start = \"released\""
    )]
    NoRest {
        /// How its relaxation ended.
        outcome: &'static str,
    },
}

/// Why a simulation ended before its time, in the scenario's unit of time.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Stopped {
    /// Energy appeared from nowhere, or a value is not a number.
    #[error(
        "diverged at t = {time:.6e}: energy grew from nowhere by {percent:.0} % of all that moved; use a shorter --step, or {otherwise}"
    )]
    Diverged {
        /// When.
        time: f64,
        /// Energy gained, in percent of the largest that ever moved.
        percent: f64,
        /// What else may help.
        otherwise: &'static str,
    },
    /// The grid is too coarse.
    #[error(
        "at t = {time:.6e} a segment is bent by {turn:.2} rad, more than it can resolve; use more segments than {segments}"
    )]
    Unresolved {
        /// When.
        time: f64,
        /// Bending of the segment, radians.
        turn: f64,
        /// Segments a rod.
        segments: usize,
    },
    /// No time step is short enough.
    #[error("at t = {time:.6e} no time step is short enough to go on; {advice}")]
    StepTooShort {
        /// When.
        time: f64,
        /// What may help.
        advice: &'static str,
    },
}

impl Stopped {
    /// The word used in `summary.json`.
    pub fn word(self) -> &'static str {
        match self {
            Stopped::Diverged { .. } => "diverged",
            Stopped::Unresolved { .. } => "unresolved",
            Stopped::StepTooShort { .. } => "step-too-short",
        }
    }
}
