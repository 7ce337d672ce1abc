//! How thick veins are, where a scenario says so: for pictures.

use std::sync::Arc;

use super::Section;

/// Radii of the veins, from their sections. Nothing is computed with them: leaves that
/// differ in nothing else are equal.
#[derive(Clone, Debug, Default)]
pub struct Radii(Vec<Arc<Section>>);

impl Radii {
    pub(super) fn of(sections: &[Arc<Section>]) -> Self {
        Radii(sections.to_vec())
    }

    /// That of a rod at a fraction of its length: of a circle of the same area as its
    /// section. `None` where stiffnesses are given, and no sections.
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
