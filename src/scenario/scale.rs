//! The natural units of a leaf.

use super::Rod;

/// Units that make a leaf dimensionless: lengths in units of `length`, couple
/// stiffnesses in units of `stiffness`, hence forces in A/L^2, moments and energies in
/// A/L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// L: the largest rod length.
    pub length: f64,
    /// A, the mean bending stiffness: geometric mean of the 2 N values of A2
    /// and A3 of the N rods at half their lengths, however long the rods are.
    pub stiffness: f64,
}

impl Scale {
    /// The units of these rods, of which there is at least one.
    pub fn of(rods: &[Rod]) -> Scale {
        let logs: f64 = rods
            .iter()
            .map(|rod| rod.couple_stiffness[1].at(0.5).ln() + rod.couple_stiffness[2].at(0.5).ln())
            .sum();
        Scale {
            length: longest(rods),
            stiffness: (logs / (2 * rods.len()) as f64).exp(),
        }
    }

    /// Unit of force, A/L^2.
    pub fn force(&self) -> f64 {
        self.stiffness / (self.length * self.length)
    }

    /// Unit of moment and of energy, A/L.
    pub fn moment(&self) -> f64 {
        self.stiffness / self.length
    }

    /// The factor that converts a quantity to these units, if its own unit is a product of
    /// powers of length and force with these exponents.
    pub(super) fn per(&self, length: i32, force: i32) -> f64 {
        self.length.powi(2 * force - length) / self.stiffness.powi(force)
    }
}

/// L: the longest rod.
pub(crate) fn longest(rods: &[Rod]) -> f64 {
    rods.iter()
        .fold(0.0, |longest, rod| longest.max(rod.length))
}
