//! Convergence tests of Newton's method: of the increments of positions and rotations, whose remaining
//! error follows from quadratic convergence, and of the forces that segments carry.
//!
//! Where loads determine forces they converge with the positions. Where holders, or other rods,
//! determine the strain of a rod, a length error multiplied by its stiffness is an error of its
//! force, however small it is as a position: then forces have a convergence test of their own, and
//! the constitutive law of nearly rigid segments is completed in every step.

use crate::leaf::{DiscreteLeaf, State};
use crate::numbers::{larger, largest};

/// What increments of an iteration tell. Increments are in radians and lengths, forces in A/L^2 and
/// moments in A/L.
pub struct IncrementCriteria {
    /// An increment below this that does not decrease is due to rounding.
    pub rounding: f64,
    /// Increments below this are attributed to rounding in a neutral mode if nothing above
    /// [`IncrementCriteria::balanced_residual`] is unbalanced.
    pub neutral_step: f64,
    /// Force or moment up to which a node is balanced.
    pub balanced_residual: f64,
    /// Increments in a row that count as rounding in a neutral mode before they count as no convergence.
    most_stalled: usize,
    /// Increments below this are used to measure quadratic convergence.
    asymptotic: f64,
    /// An increment counts as decreasing if it is at most this part of the one before.
    decreasing: f64,
    /// Safety factor on the error after a first increment. Of some 1500 first increments from
    /// predicted states one in a hundred left more than three times the error expected.
    first_safety: f64,
    /// Bound on the error left by the conjugate gradients, in units of the accuracy: far more than
    /// they usually leave.
    cg_error_bound: f64,
    /// A leaf whose matrix without inertia is not positive definite is at a saddle if a step moves
    /// it by less than this and nothing above [`IncrementCriteria::saddle_residual`] is unbalanced.
    saddle_step: f64,
    saddle_residual: f64,
    /// Length error of a nearly rigid rod that is attributed to rounding.
    length_rounding: f64,
}

pub const INCREMENTS: IncrementCriteria = IncrementCriteria {
    rounding: 1e-9,
    neutral_step: 1e-5,
    balanced_residual: 1e-9,
    most_stalled: 20,
    asymptotic: 0.05,
    decreasing: 0.3,
    first_safety: 10.0,
    cg_error_bound: 5.0,
    saddle_step: 1e-7,
    saddle_residual: 1e-6,
    length_rounding: 1e-11,
};

/// What changes of forces in an iteration tell.
struct ForceCriteria {
    /// The law lags behind where a step misses more than this part of the strain that the step before
    /// missed.
    law_lag: f64,
    /// Missed strain below which nothing lags behind: it is rounding.
    strain_noise: f64,
    /// Rounding error of a strain, per segment of a rod.
    strain_rounding: f64,
    /// Changes of forces below this part of the largest that do not decrease are due to rounding.
    noise: f64,
    /// Accuracy of a leaf on the way to rest above which its forces are not asked for.
    rough_accuracy: f64,
}

const FORCES: ForceCriteria = ForceCriteria {
    law_lag: 0.03,
    strain_noise: 1e-14,
    strain_rounding: 10.0 * f64::EPSILON,
    noise: 1e-9,
    rough_accuracy: 1e-3,
};

/// The constant of quadratic convergence of Newton's method: the largest ratio of an increment
/// to the square of the one before it. It is shared by all grids of a leaf.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contraction(f64);

impl Contraction {
    /// Updates the constant with an increment after one of size `previous`.
    pub fn update(&mut self, size: f64, previous: f64) {
        if previous < INCREMENTS.asymptotic {
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
        INCREMENTS.first_safety * self.0.max(1.0) * size * size.max(force)
    }
}

/// When an iteration has converged.
#[derive(Clone, Copy, Debug)]
pub struct RequiredAccuracy {
    /// Largest remaining error.
    pub accuracy: f64,
    /// Increments below this that do not decrease are rounding.
    pub rounding: f64,
}

/// The remaining error after an increment of this `size`, which follows one of size
/// `previous`: of second order at best, and never less than the error of the conjugate
/// gradients. Their accuracies, of the previous increment and of this one, are in the energy
/// norm, to which soft modes contribute little; as this increment contains their error in the
/// previous one, it bounds the factor by which they may be worse (an infinite accuracy: not
/// used, as rods are not coupled). After a first increment (`previous` infinite) the error is
/// `first`, from [`Contraction`]. `None` if the error exceeds the required accuracy or that bound exceeds
/// `cg_error_bound` times as much, unless the increment is rounding and does not decrease.
pub fn remaining_error(
    size: f64,
    previous: f64,
    cg_tolerances: [f64; 2],
    required: RequiredAccuracy,
    first: f64,
) -> Option<f64> {
    let RequiredAccuracy { accuracy, rounding } = required;
    let rate = (size / previous).min(1.0);
    let quadratic = match previous.is_finite() {
        true => size * (rate * rate),
        false => first,
    };
    let [before, now] = cg_tolerances;
    let remaining = larger(quadratic, now * size);
    let bounded = rate * now * size <= INCREMENTS.cg_error_bound * accuracy * before;
    match size < rounding && rate > INCREMENTS.decreasing {
        true => Some(size),
        false => (remaining <= accuracy && bounded).then_some(remaining),
    }
}

/// Counts increments in a row that very soft veins owe to rounding: they turn by more than
/// [`IncrementCriteria::rounding`] where all forces are balanced.
#[derive(Default)]
pub struct StallCounter(usize);

impl StallCounter {
    /// The size of increments that are due to rounding if they do not decrease, at a `state`
    /// after an increment of this `size`.
    pub fn increment_rounding(&mut self, leaf: &DiscreteLeaf, state: &State, size: f64) -> f64 {
        let turns = (INCREMENTS.rounding..INCREMENTS.neutral_step).contains(&size)
            && leaf.residual(state) < INCREMENTS.balanced_residual;
        self.0 = if turns { self.0 + 1 } else { 0 };
        match self.0 > INCREMENTS.most_stalled {
            true => INCREMENTS.neutral_step,
            false => INCREMENTS.rounding,
        }
    }
}

/// Whether nearly rigid segments of a converged leaf have their lengths.
pub fn satisfies_lengths(leaf: &DiscreteLeaf, state: &State, accuracy: f64) -> bool {
    leaf.satisfies_lengths(state, accuracy.max(INCREMENTS.length_rounding))
}

/// Whether a leaf whose matrix without inertia is not positive definite rests at
/// a saddle, after an increment of this size.
pub fn is_at_saddle(leaf: &DiscreteLeaf, state: &State, size: f64) -> bool {
    size < INCREMENTS.saddle_step && leaf.residual(state) < INCREMENTS.saddle_residual
}

/// The convergence test of the forces of a leaf in an iteration.
pub struct ForceConvergence {
    nearly_rigid: bool,
    /// Whether strains determine the forces of some rods.
    is_indeterminate: bool,
    /// The strain that the last step missed.
    missed_strain: f64,
    /// The largest stiffness in stretch and shear, and the rounding error of forces.
    stiffness: f64,
    rounding: f64,
    largest_force: f64,
    /// The last change of a force, and the one before.
    change: f64,
    previous: f64,
    /// Size of the last increment of the nodes.
    increment: f64,
}

impl ForceConvergence {
    /// The test of a leaf before the first step.
    pub fn new(leaf: &DiscreteLeaf) -> Self {
        let stiffness = leaf.largest_force_stiffness();
        let rounding = FORCES.strain_rounding * leaf.segments() as f64 * stiffness;
        ForceConvergence {
            nearly_rigid: leaf.is_nearly_rigid(),
            is_indeterminate: leaf.leaf.has_placed_supports() || leaf.has_rigid_tissue(),
            missed_strain: f64::INFINITY,
            stiffness,
            rounding,
            largest_force: 0.0,
            change: f64::INFINITY,
            previous: f64::INFINITY,
            increment: f64::INFINITY,
        }
    }

    /// Whether the law of nearly rigid segments lags behind in a step between two states, so that
    /// it must be completed.
    pub fn law_lags(&mut self, leaf: &DiscreteLeaf, before: &State, after: &State) -> bool {
        if !self.nearly_rigid {
            return false;
        }
        let missing = leaf.missing_strain(before, after);
        self.is_indeterminate |=
            missing > FORCES.law_lag * self.missed_strain && missing > FORCES.strain_noise;
        self.missed_strain = missing;
        self.is_indeterminate
    }

    /// Takes note of a step of this size between two states.
    pub fn record_step(&mut self, size: f64, before: &State, after: &State) {
        if self.is_indeterminate {
            self.previous = self.change;
            self.change = after.force_change(before);
            self.largest_force = largest(after.n.iter().map(|n| n.length()));
            self.increment = size;
        }
    }

    /// Whether forces still approach their values while the nodes are at rest: where rods and tissue that are rigid bear
    /// forces against each other, each step of the law closes a part of what is missing, and not all of it.
    pub fn converges_linearly(&self) -> bool {
        self.is_indeterminate
            && self.increment < INCREMENTS.neutral_step
            && self.change < self.previous
    }

    /// Whether the error that remains in the forces is at most this part of the largest, or
    /// rounding.
    pub fn has_converged(&self, accuracy: f64) -> bool {
        if !self.is_indeterminate || accuracy > FORCES.rough_accuracy {
            return true;
        }
        let scale = self.largest_force.max(1.0);
        let rounding = larger(FORCES.noise, self.rounding / scale);
        // Rotations of the size of the increment shorten a segment by their square.
        let first =
            INCREMENTS.first_safety * self.stiffness * self.increment * self.increment / scale;
        let (size, previous) = (self.change / scale, self.previous / scale);
        let required = RequiredAccuracy { accuracy, rounding };
        size == 0.0 || remaining_error(size, previous, [0.0; 2], required, first).is_some()
    }
}
