//! Convergence tests of Newton's method.

use crate::largest::larger;
use crate::leaf::{DiscreteLeaf, State};

/// An increment (radians, lengths) below this that does not decrease is due to rounding.
pub const ROUNDING: f64 = 1e-9;

/// Increments below this (radians, lengths) are attributed to rounding in a neutral mode if no
/// force or moment above the second number (A/L^2, A/L) is unbalanced.
pub const NEUTRAL_STEP: f64 = 1e-5;
pub const BALANCED: f64 = 1e-9;

/// So many such increments in a row are no convergence.
const STALLED: usize = 20;

/// Increments below this (radians, lengths) are used to measure quadratic convergence.
const ASYMPTOTIC: f64 = 0.05;

/// Safety factor on the error after a first increment. Of some 1500 first increments from
/// predicted states one in a hundred left more than three times the error expected.
const FIRST_SAFETY: f64 = 10.0;

/// An increment counts as decreasing if it is at most this part of the one before.
const DECREASING: f64 = 0.3;

/// Bound on the error left by the conjugate gradients, in units of the accuracy: far more than
/// they usually leave.
const BOUND: f64 = 5.0;

/// A leaf whose matrix without inertia is not positive definite is at a saddle if a step moves
/// it by less than this (radians, lengths) and no force or moment above the second number
/// (A/L^2, A/L) is unbalanced.
const SADDLE_STEP: f64 = 1e-7;
const SADDLE_RESIDUAL: f64 = 1e-6;

/// Length error of a nearly rigid rod that is attributed to rounding.
const LENGTH_ROUNDING: f64 = 1e-11;

/// The constant of quadratic convergence of Newton's method: the largest ratio of an increment
/// to the square of the one before it. It is shared by all grids of a leaf.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contraction(f64);

impl Contraction {
    /// Updates the constant with an increment after one of size `previous`.
    pub fn update(&mut self, size: f64, previous: f64) {
        if previous < ASYMPTOTIC {
            self.0 = larger(self.0, size / (previous * previous));
        }
    }

    /// Whether an increment has followed another one.
    pub fn is_measured(&self) -> bool {
        self.0 > 0.0
    }

    /// The error after a first increment with which the largest change of a force (A/L^2) is
    /// `force`; the force is ignored before any convergence has been measured.
    pub fn error_after_first(&self, size: f64, force: f64) -> f64 {
        let force = if self.0 > 0.0 { force } else { 0.0 };
        FIRST_SAFETY * self.0.max(1.0) * size * size.max(force)
    }
}

/// The remaining error after an increment of this `size`, which follows one of size
/// `previous`: of second order at best, and never less than the error of the conjugate
/// gradients. Their accuracies, of the previous increment and of this one, are in the energy
/// norm, to which soft modes contribute little; as this increment contains their error in the
/// previous one, it bounds the factor by which they may be worse (an infinite accuracy: not
/// used, as rods are not coupled). After a first increment (`previous` infinite) the error is
/// `first`, from [`Contraction`]. `None` if the error exceeds `accuracy` or that bound exceeds
/// [`BOUND`] times as much, unless the increment is below `rounding` and does not decrease.
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
    let remaining = larger(quadratic, now * size);
    let bounded = rate * now * size <= BOUND * accuracy * before;
    match size < rounding && rate > DECREASING {
        true => Some(size),
        false => (remaining <= accuracy && bounded).then_some(remaining),
    }
}

/// Counts increments in a row that very soft veins owe to rounding: they turn by more than
/// [`ROUNDING`] where all forces are balanced.
#[derive(Default)]
pub struct Stalled(usize);

impl Stalled {
    /// The size of increments that are due to rounding if they do not decrease, at a `state`
    /// after an increment of this `size`.
    pub fn rounding(&mut self, leaf: &DiscreteLeaf, state: &State, size: f64) -> f64 {
        let turns = (ROUNDING..NEUTRAL_STEP).contains(&size) && leaf.residual(state) < BALANCED;
        self.0 = if turns { self.0 + 1 } else { 0 };
        match self.0 > STALLED {
            true => NEUTRAL_STEP,
            false => ROUNDING,
        }
    }
}

/// Whether nearly rigid segments of a converged leaf have their lengths.
pub fn satisfies_lengths(leaf: &DiscreteLeaf, state: &State, accuracy: f64) -> bool {
    leaf.satisfies_lengths(state, accuracy.max(LENGTH_ROUNDING))
}

/// Whether a leaf whose matrix without inertia is not positive definite rests at
/// a saddle, after an increment of this size.
pub fn at_saddle(leaf: &DiscreteLeaf, state: &State, size: f64) -> bool {
    size < SADDLE_STEP && leaf.residual(state) < SADDLE_RESIDUAL
}
