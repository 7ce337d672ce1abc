//! When Newton's method has converged, and to what.

use crate::leaf::{DiscreteLeaf, State};

/// An increment (radians, lengths) below this that does not shrink is rounding.
pub const ROUNDING: f64 = 1e-9;

/// Increments below this (radians, lengths) show how fast Newton's method converges.
const ASYMPTOTIC: f64 = 0.05;

/// Safety factor on what a first increment leaves. Of some 1500 first increments from
/// predicted states one in a hundred left more than thrice what is so expected.
const FIRST: f64 = 10.0;

/// Increments that do not shrink at least to this part are said not to shrink.
const SHRINKS: f64 = 0.3;

/// What the conjugate gradients may have left at most, in units of the accuracy: far
/// more than they leave of most increments.
const BOUND: f64 = 5.0;

/// A leaf that moves by less than this in a step (radians, lengths), while its
/// matrix without inertia is not positive definite, may be at a saddle: it is,
/// if no force or moment above the second number (A/L^2, A/L) is unbalanced.
const SADDLE_STEP: f64 = 1e-7;
const SADDLE_RESIDUAL: f64 = 1e-6;

/// By how much a nearly rigid rod may be too long or too short by rounding.
const CLOSED: f64 = 1e-11;

/// How fast Newton's method converges: the largest ratio of an increment to the square of
/// the one before it. Grids of the same leaf have it in common.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contraction(f64);

impl Contraction {
    /// Takes into account an increment after one of size `previous`.
    pub fn learn(&mut self, size: f64, previous: f64) {
        if previous < ASYMPTOTIC {
            self.0 = self.0.max(size / (previous * previous));
        }
    }

    /// The error that is left after a first increment, if the largest force (A/L^2)
    /// changed by so much with it; of which nothing is made where the leaf is not known to
    /// be near rest.
    pub fn after_first(&self, size: f64, force: f64) -> f64 {
        let force = if self.0 > 0.0 { force } else { 0.0 };
        FIRST * self.0.max(1.0) * size * size.max(force)
    }
}

/// The error that is left after an increment of this `size`, which follows one of
/// size `previous`: of second order at best, and never less than what the conjugate
/// gradients left. Their accuracies, of the previous increment and of this one, are in
/// the energy norm, in which soft modes hardly count; as this increment is not less
/// than what they left of the previous one, it bounds by how much more they leave
/// (an infinite one: they are not used, as rods are not coupled).
/// Of a first increment (`previous` infinite) it is given, by [`Contraction`].
/// `None` if the error is more than `accuracy` or that bound more than [`BOUND`] times
/// as much, unless the increment is below `rounding` and does not shrink.
pub fn converged(
    size: f64,
    previous: f64,
    cg_tolerances: [f64; 2],
    (accuracy, rounding): (f64, f64),
    first: f64,
) -> Option<f64> {
    let rate = (size / previous).min(1.0);
    let quadratic = match previous.is_finite() {
        true => size * (rate * rate),
        false => first,
    };
    let [before, now] = cg_tolerances;
    let remaining = quadratic.max(now * size);
    let bounded = rate * now * size <= BOUND * accuracy * before;
    match size < rounding && rate > SHRINKS {
        true => Some(size),
        false => (remaining <= accuracy && bounded).then_some(remaining),
    }
}

/// Whether nearly rigid segments of a leaf whose nodes move no more have their lengths.
pub fn closes(leaf: &DiscreteLeaf, state: &State, accuracy: f64) -> bool {
    leaf.closes(state, accuracy.max(CLOSED))
}

/// Whether a leaf whose matrix without inertia is not positive definite rests at
/// a saddle, after an increment of this size.
pub fn at_saddle(leaf: &DiscreteLeaf, state: &State, size: f64) -> bool {
    size < SADDLE_STEP && leaf.residual(state) < SADDLE_RESIDUAL
}
