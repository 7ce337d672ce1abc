//! Masses with which a leaf comes to rest fastest.
//!
//! If only the equilibrium matters, masses are arbitrary. With these, the
//! fastest motion of every single segment and of every coupling between neighbours,
//! alone with its share of the masses, has the frequency 2: that bounds the frequencies of
//! the leaf, the longest stable time step is one, and slow motions are as fast relative
//! to it as possible (P. Underwood, Dynamic relaxation, in: Computational
//! Methods for Transient Analysis, 1983).

use super::kernel::{Layout, Node};
use super::packs::{Pack, materials, node_data};
use crate::leaf::DiscreteLeaf;
use crate::motion::physics::Physics;

/// Part of the squared frequency 4 of a segment that is due to the rotations of its
/// ends, the rest being due to their translations. Slow motions are mostly translations:
/// rotations get the smaller part of the frequency, hence larger masses.
const ROTATING: f64 = 0.5;

/// Sets the masses of the rods; returns that of a shared tip.
pub fn masses(leaf: &DiscreteLeaf, physics: &Physics, layout: Layout, packs: &mut [Pack]) -> f64 {
    let (n, count) = (leaf.segments(), leaf.rods());
    let mut tip = 0.0;
    let mut rods: Vec<Vec<Node>> = Vec::with_capacity(count);
    for j in 0..count {
        let old: Vec<Node> = (0..=n).map(|i| node_data(leaf, physics, j, i)).collect();
        let mut new = old.clone();
        for i in 0..=n {
            let (mut mass, mut inertia) = (0.0, 0.0);
            let before = i.checked_sub(1).map(|before| &old[before]);
            for segment in before.into_iter().chain([&old[i]]) {
                let stretch = segment.stretch.into_iter().fold(0.0_f64, f64::max);
                let bend = segment.bend.into_iter().fold(0.0_f64, f64::max);
                let arm = 0.5 * segment.rest_length[0];
                mass += 2.0 * stretch / (4.0 - ROTATING);
                inertia += 2.0 * (bend + stretch * arm * arm) / ROTATING;
            }
            let node = &mut new[i];
            // Both neighbours pull on a node, and may move as much as it does.
            for (gap, coupled) in [j.wrapping_sub(1), j].into_iter().zip(node.coupled) {
                if gap < count - 1 {
                    mass += 0.5 * (leaf.leaf.coupling(gap) * coupled).max_element();
                }
            }
            for (stiffness, fold, width) in leaf.tissue_at(j, i) {
                let arm = 0.5 * width;
                mass += 2.0 * stiffness / (4.0 - ROTATING);
                inertia += 2.0 * (fold + stiffness * arm * arm) / ROTATING;
            }
            if i == n {
                tip += mass;
            }
            node.per_spin = 0.0;
            // Zero for a held node, and for a shared tip.
            if node.per_inertia != 0.0 {
                node.per_inertia = 1.0 / inertia;
            }
            if node.per_mass != 0.0 {
                node.mass = mass;
                node.per_mass = 1.0 / mass;
            }
        }
        rods.push(new);
    }
    for (pack, material) in packs.iter_mut().zip(materials(layout, |j, i| rods[j][i])) {
        pack.material = material;
    }
    tip
}
