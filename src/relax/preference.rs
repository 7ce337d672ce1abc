//! The side to which a leaf turns from a saddle, the same on all grids, in all units, and in
//! whichever order its veins are numbered.

use crate::leaf::{DiscreteLeaf, Field, State};
use glam::DVec3;

/// Weight of a given direction over that of the others.
const GIVEN: f64 = 10.0;

/// Increments without symmetry, from which inverse iteration leads to the unstable mode, with the
/// sign that has most in common with them; of several modes of one eigenvalue, as of veins that
/// buckle alike, to that sum of them. They move the leaf along `leaning`, down, to the left
/// (along e2) and forward, in this order of importance, more so away from the base and, with
/// other weights, to the left. A straight rod along e1 is bent in a plane by them: one that is round
/// would turn out of any other on its way.
pub fn preference(leaf: &DiscreteLeaf, state: &State, leaning: DVec3) -> Field {
    let (down, left, forward) = (-DVec3::Z, DVec3::Y, DVec3::X);
    let given = GIVEN * leaning.normalize_or_zero();
    let everywhere = given + down + 0.5 * left + 0.25 * forward;
    let leftwards = 0.31 * down + 0.17 * left + 0.11 * forward;
    let node = |j: usize, i: usize| {
        let x = state.x[state.base(j) + i];
        let shift = (1.0 + 0.2 * x.x) * everywhere + x.y * leftwards;
        [0.0, 0.0, 0.0, shift.x, shift.y, shift.z]
    };
    let rod = |j: usize| leaf.moving_nodes().map(|i| node(j, i)).collect();
    (0..leaf.rods()).map(rod).collect()
}
