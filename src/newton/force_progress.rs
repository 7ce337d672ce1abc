//! How the forces that segments carry converge in Newton's method.
//!
//! Where loads determine them they converge with the positions. Where holders, or other rods,
//! determine the strain of a rod, a length error multiplied by its stiffness is an error of its
//! force, however small it is as a position: then forces have a convergence test of their own, and
//! the constitutive law of nearly rigid segments is completed in every step.

use crate::leaf::{DiscreteLeaf, State};
use crate::newton::remaining_error;
use crate::numbers::{larger, largest};

/// The law lags behind where a step misses more than this part of the strain that the step before
/// missed; below the second number the strain is rounding.
const LAW_LAG_FRACTION: f64 = 0.03;

const STRAIN_NOISE: f64 = 1e-14;

/// Rounding error of a strain, per segment of a rod.
const STRAIN_ROUNDING: f64 = 10.0 * f64::EPSILON;

/// Changes of forces below this part of the largest that do not decrease are due to rounding.
const FORCE_NOISE_FRACTION: f64 = 1e-9;

/// On the way to a leaf at rest, to more than this accuracy, its forces are not asked for.
const ROUGH_ACCURACY: f64 = 1e-3;

/// Safety factor on the error of forces after a first increment.
const FIRST_SAFETY: f64 = 10.0;

/// The forces of a leaf in an iteration.
pub struct ForceConvergence {
    nearly_rigid: bool,
    /// Whether strains determine the forces of some rods.
    is_indeterminate: bool,
    /// The strain that the last step missed.
    missed_strain: f64,
    /// The largest stiffness in stretch and shear, and the rounding error of forces.
    stiffness: f64,
    rounding: f64,
    /// The largest force, its last change, and the one before.
    largest_force: f64,
    change: f64,
    previous: f64,
    /// Size of the last increment of the nodes.
    increment: f64,
}

impl ForceConvergence {
    /// Before the first step.
    pub fn new(leaf: &DiscreteLeaf) -> Self {
        let stiffness = leaf.largest_force_stiffness();
        let rounding = STRAIN_ROUNDING * leaf.segments() as f64 * stiffness;
        ForceConvergence {
            nearly_rigid: leaf.is_nearly_rigid(),
            is_indeterminate: leaf.leaf.has_placed_supports(),
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
            missing > LAW_LAG_FRACTION * self.missed_strain && missing > STRAIN_NOISE;
        self.missed_strain = missing;
        self.is_indeterminate
    }

    /// After a step of this size between two states.
    pub fn record_step(&mut self, size: f64, before: &State, after: &State) {
        if self.is_indeterminate {
            self.previous = self.change;
            self.change = after.force_change(before);
            self.largest_force = largest(after.n.iter().map(|n| n.length()));
            self.increment = size;
        }
    }

    /// Whether the error that remains in the forces is at most this part of the largest, or
    /// rounding.
    pub fn has_converged(&self, accuracy: f64) -> bool {
        if !self.is_indeterminate || accuracy > ROUGH_ACCURACY {
            return true;
        }
        let scale = self.largest_force.max(1.0);
        let rounding = larger(FORCE_NOISE_FRACTION, self.rounding / scale);
        // Rotations of the size of the increment shorten a segment by their square.
        let first = FIRST_SAFETY * self.stiffness * self.increment * self.increment / scale;
        let (size, previous) = (self.change / scale, self.previous / scale);
        size == 0.0
            || remaining_error(size, previous, [0.0; 2], (accuracy, rounding), first).is_some()
    }
}
