//! Masses with which a leaf comes to rest soonest.
//!
//! Where only the equilibrium matters masses are free. With those here the
//! fastest motion of every single segment and of every tie between neighbours,
//! alone on its share of the masses, has the frequency 2: that bounds those of
//! the leaf, the longest stable time step is one, and slow motions are as fast
//! beside it as they can be (P. Underwood, Dynamic relaxation, in: Computational
//! Methods for Transient Analysis, 1983).

use super::kernel::{Node, blocks};
use super::nodes::{Rod, made_of};
use super::physics::Physics;
use crate::leaf::DiscreteLeaf;

/// Part of the squared frequency 4 of a segment that belongs to its rotating
/// ends, the other to its moving ends. Slow motions are translations mostly:
/// rotations get the smaller part of the frequency, hence the larger masses.
const ROTATING: f64 = 0.5;

/// Puts the masses into the rods; returns that of a joint tip.
pub fn masses(leaf: &DiscreteLeaf, physics: &Physics, rods: &mut [Rod]) -> f64 {
    let (n, count) = (leaf.segments(), rods.len());
    let mut tip = 0.0;
    for j in 0..count {
        let old: Vec<Node> = (0..=n).map(|i| made_of(leaf, physics, j, i)).collect();
        let mut new = old.clone();
        for i in 0..=n {
            let (mut mass, mut inertia) = (0.0, 0.0);
            let before = i.checked_sub(1).map(|before| &old[before]);
            for segment in before.into_iter().chain([&old[i]]) {
                let stretch = segment.stretch.into_iter().fold(0.0_f64, f64::max);
                let bend = segment.bend.into_iter().fold(0.0_f64, f64::max);
                let arm = 0.5 * segment.rest_length;
                mass += 2.0 * stretch / (4.0 - ROTATING);
                inertia += 2.0 * (bend + stretch * arm * arm) / ROTATING;
            }
            let node = &mut new[i];
            // Both neighbours pull on a node that may move as much as they do.
            for gap in [j.wrapping_sub(1), j] {
                if gap < count - 1 {
                    mass += 0.5 * (leaf.leaf.coupling(gap) * node.coupled).max_element();
                }
            }
            if i == n {
                tip += mass;
            }
            node.per_spin = 0.0;
            // Zero for a node that is held, and for a joint tip.
            if node.per_inertia != 0.0 {
                node.per_inertia = 1.0 / inertia;
            }
            if node.per_mass != 0.0 {
                node.mass = mass;
                node.per_mass = 1.0 / mass;
            }
        }
        let beside = j.checked_sub(1).map(|other| &*rods[other].material);
        rods[j].material = blocks(&new, beside);
    }
    tip
}
