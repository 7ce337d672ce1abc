//! Dead moments on a single rod, and their power.

use super::kernel::Layout;
use super::packs::Pack;
use glam::{DQuat, DVec3};

/// The dead moments of a step.
#[derive(Default)]
pub struct Moments {
    /// Nodes and sizes.
    all: Vec<(usize, DVec3)>,
    /// Rotations and angular momenta of these nodes before the step.
    before: Vec<(DQuat, DVec3)>,
}

impl Moments {
    /// Nodes and sizes.
    pub fn all(&self) -> &[(usize, DVec3)] {
        &self.all
    }

    /// Takes over those of a step that begins.
    pub fn begin(
        &mut self,
        moments: impl Iterator<Item = (usize, DVec3)>,
        layout: Layout,
        packs: &[Pack],
    ) {
        self.all.clear();
        self.all.extend(moments);
        self.before.clear();
        for (node, _) in &self.all {
            let (p, at) = layout.place(0, *node);
            let pack = &packs[p];
            self.before.push((pack.rotation(at), pack.moving(at).1));
        }
    }

    /// Their power at the mean of the angular momenta before the step and of these.
    pub fn power(&self, layout: Layout, packs: &[Pack]) -> f64 {
        let nodes = self.all.iter().zip(&self.before);
        let power = nodes.map(|((node, moment), (rotation, before))| {
            let (p, at) = layout.place(0, *node);
            let momentum = 0.5 * (*before + packs[p].moving(at).1);
            moment.dot(packs[p].spin(at, *rotation, momentum))
        });
        power.sum()
    }
}
