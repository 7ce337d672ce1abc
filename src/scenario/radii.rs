//! Radii of veins whose sections are given: for pictures.

use std::sync::Arc;

use super::Section;

/// Radii of the veins, from their sections. Computations use the stiffnesses alone: scenarios that
/// differ only in radii are equal.
#[derive(Clone, Debug, Default)]
pub struct Radii(Vec<Arc<Section>>);

impl Radii {
    pub(super) fn of(sections: &[Arc<Section>]) -> Self {
        Radii(sections.to_vec())
    }

    /// The sections; none where stiffnesses are given in place of them.
    pub(super) fn sections(&self) -> &[Arc<Section>] {
        &self.0
    }

    /// The radius of a rod at a fraction of its length: that of a circle with the area of
    /// its section. `None` if stiffnesses are given in place of sections.
    pub fn at(&self, rod: usize, sigma: f64) -> Option<f64> {
        let section = self.0.get(rod)?;
        Some((section.area(sigma) / std::f64::consts::PI).sqrt())
    }
}

impl PartialEq for Radii {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
