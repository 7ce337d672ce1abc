//! Modes with the forces that they cause in the segments, for the derivatives of
//! eigenvalues.

use super::{Eigenpair, Wanted, masses, of_softened, quotient, softened};
use crate::leaf::{DiscreteLeaf, Increment, State};
use crate::limit::Limit;
use crate::motion::Physics;
use crate::rod::Section;
use glam::DVec3;

/// Accuracy of eigenvectors for the derivatives of eigenvalues.
const DERIVED: f64 = 1e-9;

/// Ratio of the softenings from which the first-order effect of softening is computed.
const SOFTER: f64 = 4.0;

/// Cosine of the angle between two shapes above which they are the same mode.
const ALIKE: f64 = 0.99;

/// A mode with the spatial forces that it causes in the segments.
#[derive(Clone, Debug)]
pub struct LoadedMode {
    /// Lambda.
    pub eigenvalue: f64,
    /// Turns and shifts of all nodes, rod after rod, base to tip.
    pub shape: Vec<Increment>,
    /// Forces of all segments, rod by rod.
    pub forces: Vec<DVec3>,
}

/// As [`lowest`], with the shapes and forces of the leaf without softening:
/// derivatives of an eigenvalue, unlike the eigenvalue itself, depend on errors of these
/// in first order. The effect of softening is removed by means of the modes of a softer leaf.
pub fn loaded(leaf: &DiscreteLeaf, state: &State, count: usize) -> Option<Vec<LoadedMode>> {
    let (physics, time) = (Physics::new(&leaf.leaf), Limit::default());
    let of = |soft: &DiscreteLeaf, near: &[Eigenpair]| {
        let wanted = Wanted {
            count,
            accuracy: DERIVED,
            near,
            time: &time,
        };
        of_softened(soft, &physics, state, wanted)
    };
    let with_forces = |soft: &DiscreteLeaf, pairs: Vec<Eigenpair>| -> Vec<LoadedMode> {
        let loaded = |pair: Eigenpair| LoadedMode {
            forces: quotient::forces(soft, state, &pair.shape),
            eigenvalue: pair.eigenvalue,
            shape: pair.shape,
        };
        pairs.into_iter().map(loaded).collect()
    };
    let soft = softened(leaf, state, 1.0);
    let pairs = of(&soft, &[])?;
    let changed = |(soft, stiff): (&Section, &Section)| soft.condensing != stiff.condensing;
    let softer = match soft.sections.iter().zip(&leaf.sections).any(changed) {
        true => {
            let softer = softened(leaf, state, SOFTER);
            let pairs = of(&softer, &pairs)?;
            with_forces(&softer, pairs)
        }
        false => Vec::new(),
    };
    let mut modes = with_forces(&soft, pairs);
    for (mode, softer) in modes.iter_mut().zip(&softer) {
        mode.remove_softening(softer);
    }
    Some(modes)
}

impl LoadedMode {
    /// The sum of two modes.
    pub fn plus(&self, other: &LoadedMode) -> LoadedMode {
        let mut sum = self.clone();
        let both = sum.shape.iter_mut().flatten();
        (both.zip(other.shape.iter().flatten())).for_each(|(value, other)| *value += other);
        (sum.forces.iter_mut().zip(&other.forces)).for_each(|(force, other)| *force += *other);
        sum
    }

    /// Removes the first-order effect of softening by means of the same mode of a softer
    /// leaf. If modes are so close together that they mix, it is not removed.
    fn remove_softening(&mut self, softer: &LoadedMode) {
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
pub fn eigenvalue(leaf: &DiscreteLeaf, state: &State, mode: &LoadedMode) -> f64 {
    let physics = Physics::new(&leaf.leaf);
    let quotient = quotient::with_forces(leaf, state, &mode.shape, &mode.forces);
    quotient / masses::mass(leaf, &physics, state, &mode.shape) * physics.time.powi(-2)
}
