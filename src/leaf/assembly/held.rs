//! Components of increments that are constrained to zero: by the mirror plane of half a leaf,
//! or at a pinned or clamped tip.

use super::component;
use crate::lanes::Four;
use crate::leaf::chain::{Chain, Increments, group_and_lane};
use crate::leaf::discrete::DiscreteLeaf;
use crate::rod::UNKNOWNS;
use glam::DVec3;

/// Components of a node's increment (rotation, displacement) that are zero for a node in the
/// mirror plane: rotations about x and z, the displacement along y.
const ACROSS_THE_PLANE: [usize; 3] = [0, 2, 4];

impl DiscreteLeaf {
    /// The components that are zero in the increments of node `i` (from 1) of
    /// rod `j`.
    fn held_components(&self, j: usize, i: usize) -> &'static [usize] {
        if let Some(held) = self.leaf.held.as_ref().filter(|_| i == self.segments()) {
            match held.clamps {
                Some(_) => &[0, 1, 2, 3, 4, 5],
                None => &[3, 4, 5],
            }
        } else if self.leaf.in_plane(j) {
            &ACROSS_THE_PLANE
        } else if self.leaf.mirrored && self.leaf.joined() && i == self.segments() {
            &ACROSS_THE_PLANE[2..]
        } else {
            &[]
        }
    }

    /// The number (from 0) of the first node that may be held.
    fn first_held(&self) -> usize {
        match (self.leaf.mirrored, &self.leaf.held) {
            (true, _) => 0,
            (false, Some(_)) => self.segments() - 1,
            (false, None) => self.segments(),
        }
    }

    /// Sets the held components of rod `j` to zero in the right-hand side of its
    /// group.
    pub(super) fn clear_held_components(&self, j: usize, rhs: &mut [Increments]) {
        for (i, rhs) in rhs.iter_mut().enumerate().skip(self.first_held()) {
            for &c in self.held_components(j, i + 1) {
                rhs[c].0[group_and_lane(j).1] = 0.0;
            }
        }
    }

    /// Replaces rows and columns of the held components of rod `j` in the matrix by those of
    /// the identity, which makes them zero.
    pub(super) fn hold_components(&self, j: usize, chain: &mut Chain) {
        let set = |four: &mut Four, value: f64| four.0[group_and_lane(j).1] = value;
        for i in self.first_held()..self.segments() {
            for &c in self.held_components(j, i + 1) {
                for k in 0..UNKNOWNS {
                    set(chain.diagonal(i, c.min(k), c.max(k)), 0.0);
                    set(chain.off(i, c, k), 0.0);
                    if i > 0 {
                        set(chain.off(i - 1, k, c), 0.0);
                    }
                }
                set(chain.diagonal(i, c, c), 1.0);
            }
        }
    }

    /// The largest components of an unbalanced force and moment on a node of
    /// rod `j`, without those that the mirror image balances.
    pub(super) fn unbalanced_residual(&self, j: usize, force: DVec3, moment: DVec3) -> (f64, f64) {
        match self.leaf.in_plane(j) {
            true => (component(force.with_y(0.0)), moment.y.abs()),
            false => (component(force), component(moment)),
        }
    }
}
