//! Masses with which a leaf comes to rest soonest.
//!
//! Where only the equilibrium matters masses are free. With those here the
//! fastest motion of every single segment and of every tie between neighbours,
//! alone on its share of the masses, has the frequency 2: that bounds those of
//! the leaf, the longest stable time step is one, and slow motions are as fast
//! beside it as they can be (P. Underwood, Dynamic relaxation, in: Computational
//! Methods for Transient Analysis, 1983).

use super::kernel::GROUP;
use super::nodes::Rod;
use crate::leaf::DiscreteLeaf;

/// Part of the squared frequency 4 of a segment that belongs to its rotating
/// ends, the other to its moving ends. Slow motions are translations mostly:
/// rotations get the smaller part of the frequency, hence the larger masses.
const ROTATING: f64 = 0.5;

/// Puts the masses into the rods; returns that of a joint tip.
pub fn masses(leaf: &DiscreteLeaf, rods: &mut [Rod]) -> f64 {
    let n = leaf.segments();
    let count = rods.len();
    let mut tip = 0.0;
    for (j, rod) in rods.iter_mut().enumerate() {
        let m = &mut rod.material;
        let held = m.per_inertia[GROUP] == 0.0;
        for i in 0..=n {
            let at = GROUP + i;
            let (mut mass, mut inertia) = (0.0, 0.0);
            for segment in [at - 1, at] {
                let stretch = (0..3).fold(0.0_f64, |s, c| s.max(m.stretch[c][segment]));
                let bend = (0..3).fold(0.0_f64, |s, c| s.max(m.bend[c][segment]));
                let arm = 0.5 * m.rest_length[segment];
                mass += 2.0 * stretch / (4.0 - ROTATING);
                inertia += 2.0 * (bend + stretch * arm * arm) / ROTATING;
            }
            // Both neighbours pull on a node that may move as much as they do.
            for gap in [j.wrapping_sub(1), j] {
                if gap < count - 1 {
                    mass += 0.5 * (leaf.leaf.coupling(gap) * m.coupled[at]).max_element();
                }
            }
            if i == n {
                tip += mass;
            }
            let moves = !(held && i == 0);
            let tied = m.per_mass[at] == 0.0;
            m.per_inertia[at] = if moves { 1.0 / inertia } else { 0.0 };
            m.per_spin[at] = 0.0;
            if !tied {
                m.mass[at] = mass;
                m.per_mass[at] = 1.0 / mass;
            }
        }
    }
    tip
}
