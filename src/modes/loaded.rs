//! Modes with the forces they let the segments carry, of which the derivatives of
//! eigenvalues are made.

use super::{Eigenpair, Wanted, masses, of_softened, quotient, softened};
use crate::leaf::{DiscreteLeaf, Increment, State};
use crate::limit::Limit;
use crate::motion::Physics;
use crate::rod::Section;
use glam::DVec3;

/// Accuracy of eigenvectors where the derivatives of eigenvalues are wanted.
const DERIVED: f64 = 1e-9;

/// So many times as much is softened what shows to first order what softening does.
const SOFTER: f64 = 4.0;

/// Cosine of the angle between shapes that are those of one mode.
const ALIKE: f64 = 0.99;

/// A mode with the spatial forces that it lets the segments carry.
#[derive(Clone, Debug)]
pub struct LoadedMode {
    /// Lambda.
    pub eigenvalue: f64,
    /// Turns and shifts of all nodes, rod after rod, base to tip.
    pub shape: Vec<Increment>,
    /// Of all segments, rod after rod.
    pub forces: Vec<DVec3>,
}

/// As [`lowest`], with shapes and forces that are those of the leaf as stiff as it is:
/// the derivatives of an eigenvalue, unlike itself, have an error of the first order of
/// theirs. It is taken off by the modes of a leaf that is softened more.
pub fn loaded(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    count: usize,
    time: &Limit,
) -> Option<Vec<LoadedMode>> {
    let of = |soft: &DiscreteLeaf, near: &[Eigenpair]| {
        let wanted = Wanted {
            count,
            accuracy: DERIVED,
            near,
            time,
        };
        of_softened(soft, physics, state, wanted)
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
        mode.stiffen(softer);
    }
    Some(modes)
}

impl LoadedMode {
    /// Both modes at once.
    pub fn plus(&self, other: &LoadedMode) -> LoadedMode {
        let mut sum = self.clone();
        let both = sum.shape.iter_mut().flatten();
        (both.zip(other.shape.iter().flatten())).for_each(|(value, other)| *value += other);
        (sum.forces.iter_mut().zip(&other.forces)).for_each(|(force, other)| *force += *other);
        sum
    }

    /// Takes off what softening does to first order, by the same mode of a leaf that is
    /// softened more. Where modes lie so close together that each is a mixture of
    /// several, all remains.
    fn stiffen(&mut self, softer: &LoadedMode) {
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

/// The eigenvalue by the shape and the forces of a mode, be they those of a leaf and
/// a state nearby: an error of theirs enters in the second order only. In the
/// scenario's unit of time.
pub fn eigenvalue(leaf: &DiscreteLeaf, physics: &Physics, state: &State, mode: &LoadedMode) -> f64 {
    let quotient = quotient::with_forces(leaf, state, &mode.shape, &mode.forces);
    quotient / masses::mass(leaf, physics, state, &mode.shape) * physics.time.powi(-2)
}
