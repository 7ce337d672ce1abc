//! Modes for the derivatives of eigenvalues.

use super::{Eigenpair, Wanted, masses, of_softened, quotient, softened};
use crate::leaf::{DiscreteLeaf, Increment, State};
use crate::limit::Limit;
use crate::motion::Physics;
use crate::rod::Section;

/// Accuracy of eigenvectors for the derivatives of eigenvalues.
const DERIVED: f64 = 1e-9;

/// Ratio of the softenings from which the first-order effect of softening is computed.
const SOFTER: f64 = 4.0;

/// Cosine of the angle between two shapes above which they are the same mode.
const ALIKE: f64 = 0.99;

/// As [`lowest`](super::lowest), with the shapes and forces of the leaf without softening:
/// derivatives of an eigenvalue, unlike the eigenvalue itself, depend on errors of these
/// in first order. The effect of softening is removed by means of the modes of a softer leaf.
pub fn loaded(leaf: &DiscreteLeaf, state: &State, count: usize) -> Option<Vec<Eigenpair>> {
    let (physics, time) = (Physics::new(&leaf.leaf), Limit::default());
    let of = |soft: &DiscreteLeaf, near: &[Vec<Increment>]| {
        let wanted = Wanted {
            count,
            above: None,
            accuracy: DERIVED,
            near,
            time: &time,
        };
        of_softened(soft, &physics, state, wanted)
    };
    let soft = softened(leaf, state, 1.0);
    let mut modes = of(&soft, &[])?;
    let changed = |(soft, stiff): (&Section, &Section)| soft.condensing != stiff.condensing;
    if soft.sections.iter().zip(&leaf.sections).any(changed) {
        let near: Vec<_> = modes.iter().map(|mode| mode.shape.clone()).collect();
        let softer = of(&softened(leaf, state, SOFTER), &near)?;
        for (mode, softer) in modes.iter_mut().zip(&softer) {
            mode.remove_softening(softer);
        }
    }
    Some(modes)
}

impl Eigenpair {
    /// The sum of two modes.
    pub fn plus(&self, other: &Eigenpair) -> Eigenpair {
        let mut sum = self.clone();
        let both = sum.shape.iter_mut().flatten();
        (both.zip(other.shape.iter().flatten())).for_each(|(value, other)| *value += other);
        (sum.forces.iter_mut().zip(&other.forces)).for_each(|(force, other)| *force += *other);
        sum
    }

    /// Removes the first-order effect of softening by means of the same mode of a softer
    /// leaf. If modes are so close together that they mix, it is not removed.
    fn remove_softening(&mut self, softer: &Eigenpair) {
        let dot = |a: &[Increment], b: &[Increment]| -> f64 {
            let both = a.iter().flatten().zip(b.iter().flatten());
            both.map(|(a, b)| a * b).sum()
        };
        let (a, b) = (&self.shape, &softer.shape);
        let product = dot(a, b);
        if product.abs() < ALIKE * (dot(a, a) * dot(b, b)).sqrt() {
            return;
        }
        let sign = product.signum();
        let part = 1.0 / (SOFTER - 1.0);
        let both = (self.shape.iter_mut().flatten()).zip(softer.shape.iter().flatten());
        both.for_each(|(value, softer)| *value += part * (*value - sign * softer));
        for (force, softer) in self.forces.iter_mut().zip(&softer.forces) {
            *force += part * (*force - sign * *softer);
        }
    }
}

/// The eigenvalue from the shape and the forces of a mode, possibly those of a neighbouring
/// leaf and state: their errors have only a second-order effect. In the
/// scenario's unit of time.
pub fn eigenvalue(leaf: &DiscreteLeaf, state: &State, mode: &Eigenpair) -> f64 {
    let physics = Physics::new(&leaf.leaf);
    let quotient = quotient(leaf, state, &mode.shape, &mode.forces);
    quotient / masses::mass(leaf, &physics, state, &mode.shape) * physics.time.powi(-2)
}
