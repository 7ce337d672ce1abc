//! The coupling of neighbouring rods, in the lanes of their groups.

use crate::lanes::Four;
use crate::leaf::DiscreteLeaf;
use glam::DVec3;
use std::ops::Range;

/// Coupling of every gap per weight.
pub(super) fn of_gaps(leaf: &DiscreteLeaf) -> impl Iterator<Item = DVec3> {
    let gap = move |g: usize| {
        // A node in the mirror plane is not displaced across it.
        let free = match leaf.leaf.in_plane(g) {
            true => DVec3::new(1.0, 0.0, 1.0),
            false => DVec3::ONE,
        };
        free * leaf.coupling(g - 1)
    };
    (1..leaf.rods()).map(gap)
}

/// Coupling of the rods of a group with the previous and the next rods.
pub(super) fn of_group(rods: Range<usize>, gaps: &[DVec3]) -> [[Four; 3]; 2] {
    let mut coupling = [[Four::default(); 3]; 2];
    for (lane, j) in rods.enumerate() {
        for (side, gap) in [j.wrapping_sub(1), j].into_iter().enumerate() {
            for c in 0..3 {
                coupling[side][c].0[lane] = gaps.get(gap).map_or(0.0, |gap| gap[c]);
            }
        }
    }
    coupling
}
