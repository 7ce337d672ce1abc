//! Components of increments that are constrained to zero: by the mirror plane of half a leaf,
//! at a pinned or clamped tip, at a hinged base, or by grips.

use super::component;
use crate::lanes::Four;
use crate::leaf::chain::{Chain, Increments, group_and_lane};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::Field;
use crate::leaf::system::System;
use crate::rod::UNKNOWNS;
use glam::DVec3;

/// Components of a node's increment (rotation, displacement) that are zero for a node in the
/// mirror plane: rotations about x and z, the displacement along y.
const ACROSS_THE_PLANE: [usize; 3] = [0, 2, 4];

/// All components; displacements are the last three.
const ALL: [usize; UNKNOWNS] = [0, 1, 2, 3, 4, 5];

/// The entry on the diagonal of held components: with the masses of nodes within a vein it is a
/// frequency above all others.
const HELD: f64 = 1e9;

impl DiscreteLeaf {
    /// The components that are zero in the increments of node `i` of rod `j`.
    fn held_components(&self, j: usize, i: usize) -> &'static [usize] {
        if i == 0 || !self.grips.is_empty() {
            match self.is_gripped(j, i) {
                [true, _] => return &ALL,
                [false, true] => return &ALL[3..],
                [false, false] => {}
            }
        }
        if let Some(held) = self.leaf.held.as_ref().filter(|_| i == self.segments()) {
            match held.clamps {
                Some(_) => &ALL,
                None => &ALL[3..],
            }
        } else if self.leaf.in_plane(j) {
            &ACROSS_THE_PLANE
        } else if self.leaf.mirrored && self.leaf.joined() && i == self.segments() {
            &ACROSS_THE_PLANE[2..]
        } else {
            &[]
        }
    }

    /// The first node with equations that may be held.
    fn first_held(&self) -> usize {
        match (self.leaf.mirrored, &self.leaf.held) {
            _ if self.leaf.hinged() || !self.grips.is_empty() => self.first_node(),
            (true, _) => self.first_node(),
            (false, Some(_)) => self.segments(),
            (false, None) => self.segments() + 1,
        }
    }

    /// Sets the held components of rod `j` to zero in the right-hand side of its
    /// group.
    pub(super) fn clear_held_components(&self, j: usize, rhs: &mut [Increments]) {
        for i in self.first_held()..self.segments() + 1 {
            let rhs = &mut rhs[i - self.first_node()];
            for &c in self.held_components(j, i) {
                rhs[c].0[group_and_lane(j).1] = 0.0;
            }
        }
    }

    /// Sets the held components of forces on the nodes to zero.
    pub(in crate::leaf) fn clear_held_forces(&self, forces: &mut Field) {
        for (j, i) in self.each(self.first_held()..self.segments() + 1) {
            for &c in self.held_components(j, i) {
                forces[j][i - self.first_node()][c] = 0.0;
            }
        }
    }

    /// Replaces rows and columns of the held components of rod `j` in the matrix by those of
    /// the identity, which makes them zero.
    pub(super) fn hold_components(&self, j: usize, chain: &mut Chain) {
        let set = |four: &mut Four, value: f64| four.0[group_and_lane(j).1] = value;
        for i in self.first_held()..self.segments() + 1 {
            let at = i - self.first_node();
            for &c in self.held_components(j, i) {
                for k in 0..UNKNOWNS {
                    set(chain.diagonal(at, c.min(k), c.max(k)), 0.0);
                    set(chain.off(at, c, k), 0.0);
                    if at > 0 {
                        set(chain.off(at - 1, k, c), 0.0);
                    }
                }
                let gripped = self.is_gripped(j, i)[1];
                set(chain.diagonal(at, c, c), if gripped { HELD } else { 1.0 });
            }
        }
    }

    /// Sets the entries of held components between neighbouring rods to zero.
    pub(super) fn hold_across(&self, system: &mut System) {
        for (g, i) in self.each(self.first_held()..self.segments() + 1) {
            if g + 1 < self.rods() {
                let across = system.across_mut(g, i - self.first_node());
                for &c in self.held_components(g, i) {
                    across[c] = [0.0; UNKNOWNS];
                }
                for &c in self.held_components(g + 1, i) {
                    across.iter_mut().for_each(|row| row[c] = 0.0);
                }
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
