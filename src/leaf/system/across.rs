//! What ties neighbouring rods also by moments: the blocks between their nodes.

use super::System;
use crate::leaf::chain::group_and_lane;
use crate::rod::NodeBlock;
use glam::DVec3;

impl System {
    /// Whether tissue ties neighbours, also by moments: then the matrix must be factorised as a
    /// whole, as rod by rod conjugate gradients take too many iterations.
    pub fn tied(&self) -> bool {
        !self.across.is_empty()
    }

    /// The unknowns of a node (rotation, displacement) that are coupled with those of neighbours.
    pub(in crate::leaf) fn coupled_unknowns(&self) -> [bool; 6] {
        let along = |c: usize| self.gaps.iter().any(|gap| gap[c] != 0.0);
        std::array::from_fn(|c| self.tied() || c >= 3 && along(c - 3))
    }

    /// The block between node `i` (from the first with equations) of rod `g` and that of the next, if there is tissue.
    pub(in crate::leaf) fn across(&self, g: usize, i: usize) -> Option<&NodeBlock> {
        match self.tied() && g + 1 < self.rods {
            true => Some(&self.across[g * self.nodes() + i]),
            false => None,
        }
    }

    /// The same, to be changed.
    pub(in crate::leaf) fn across_mut(&mut self, g: usize, i: usize) -> &mut NodeBlock {
        let nodes = self.nodes();
        &mut self.across[g * nodes + i]
    }

    /// Adds the upper triangle of a block to the matrix at node `i` of rod `j`.
    pub(in crate::leaf) fn add_block(&mut self, j: usize, i: usize, block: &NodeBlock) {
        let (group, lane) = group_and_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for (r, row) in block.iter().enumerate() {
            for c in r..row.len() {
                chain.diagonal(at, r, c).0[lane] += row[c];
            }
        }
    }

    /// Adds a moment and a force to the right-hand side of node `i` of rod `j`.
    pub fn add_load(&mut self, j: usize, i: usize, [moment, force]: [DVec3; 2]) {
        let (group, lane) = group_and_lane(j);
        let rhs = &mut self.groups[group].rhs[i - self.first];
        for c in 0..3 {
            rhs[c].0[lane] += moment[c];
            rhs[3 + c].0[lane] += force[c];
        }
    }
}
