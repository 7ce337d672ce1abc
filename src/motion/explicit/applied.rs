//! Moments and forces on the nodes besides those of segments, coupling and dead loads: of the
//! tissue between neighbouring rods, and of loads of single rods.

use super::kernel::{Array, Layout};
use super::packs::{Pack, vector};
use crate::leaf::{DiscreteLeaf, State};
use glam::DVec3;

/// The moments and forces at an instant.
pub struct Applied {
    state: State,
    nodes: Vec<[DVec3; 2]>,
    /// Moments and forces, laid out as positions.
    loads: [[Array; 3]; 2],
}

impl Applied {
    pub fn new(leaf: &DiscreteLeaf, layout: Layout) -> Self {
        let array = || Array::zeros(layout.lengths()[0]);
        let vectors = || std::array::from_fn(|_| array());
        let state = leaf.natural();
        Applied {
            nodes: vec![[DVec3::ZERO; 2]; state.x.len()],
            state,
            loads: [vectors(), vectors()],
        }
    }

    /// Moments and forces, laid out as positions.
    pub fn loads(&self) -> &[[Array; 3]; 2] {
        &self.loads
    }

    /// The sum of the forces on all tips.
    pub fn on_tips(&self, layout: Layout) -> DVec3 {
        let tips = (0..layout.rods).map(|j| vector(&self.loads[1], layout.at(j, layout.segments)));
        tips.sum()
    }

    /// Sets the moments and forces to those of the present positions and rotations.
    pub fn update(
        &mut self,
        leaf: &DiscreteLeaf,
        (layout, positions): (Layout, &[Array; 3]),
        packs: &[Pack],
    ) {
        for (j, i) in leaf.each(0..=layout.segments) {
            let ((p, at), k) = (layout.place(j, i), self.state.base(j) + i);
            self.state.x[k] = vector(positions, layout.at(j, i));
            self.state.q[k] = packs[p].rotation(at);
        }
        self.nodes.fill([DVec3::ZERO; 2]);
        leaf.add_tissue_loads(&self.state, &mut self.nodes);
        leaf.add_own_forces(&mut self.nodes);
        for (j, i) in leaf.each(0..=layout.segments) {
            let (at, node) = (layout.at(j, i), self.nodes[self.state.base(j) + i]);
            for (arrays, load) in self.loads.iter_mut().zip(node) {
                for (c, array) in arrays.iter_mut().enumerate() {
                    array[at] = load[c];
                }
            }
        }
    }
}
