//! What cannot be simulated.

use crate::relax;

/// What cannot be simulated. Times are in the scenario's unit.
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
    /// The time step is not positive.
    #[error("step = {found}: must be greater than 0")]
    NotPositive {
        /// The step asked for.
        found: f64,
    },
    /// The time step is too long for the explicit method.
    #[error(
        "step = {found}: the explicit method is stable up to {stable:.3e}, because of {limit}: \
         use a shorter step, or the semi-implicit method, or leave the step out"
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
