//! Reduction by symmetry: half of a leaf that is its own mirror image, and a
//! leaf in its plane. The equations of both are assembled in `assembly`.

mod mirror;
mod planar;

pub use mirror::{half_of, whole_of};

use super::dimensionless::Leaf;

impl Leaf {
    /// The leaf with no more unknowns than its symmetries leave it, if it has
    /// any: half of it if it is its own mirror image, that in its plane if
    /// nothing acts out of it.
    pub fn reduced(&self) -> Option<Leaf> {
        let mut reduced = self.clone();
        reduced.mirrored = mirror::is_mirrored(self.scenario());
        reduced.planar = planar::is_planar(self.scenario());
        (reduced.mirrored || reduced.planar).then_some(reduced)
    }
}
