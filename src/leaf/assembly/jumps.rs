//! What jumps of the fields along the rods do to a leaf, to first order.

use crate::leaf::chain::place;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::State;
use crate::leaf::system::System;
use glam::DVec3;

/// Jumps of a rod's position, rotation, force and moment: how much larger they are where
/// they come to, from the base, than where they go on.
pub type Jump = [DVec3; 4];

impl DiscreteLeaf {
    /// Writes the right-hand side of the change, to first order, of a leaf that has no
    /// `jumps`, from one that has them, rod after rod at every second node from 1 on.
    ///
    /// The segment before such a node ends in another place than the next begins: seen
    /// from its end it is the node that jumps back, and what it carries does.
    pub fn assemble_jumps(&self, state: &State, jumps: &[Vec<Jump>], system: &mut System) {
        let n = self.segments();
        let mut rhs = vec![vec![[0.0; 6]; n]; self.rods()];
        for (j, rod) in jumps.iter().enumerate() {
            for (k, &[shift, turn, force, moment]) in rod.iter().enumerate() {
                let i = 2 * k;
                let section = self.section(j, i);
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                let second = segment.hessian(section);
                let (_, _, end_moment) = segment.gradient(section);
                let pull = second.xx * shift + second.xb * turn;
                let at_begin = second.xa.transpose() * shift + second.ab * turn;
                // The last term: a moment along the lab axes does not turn with its node.
                let at_end =
                    second.xb.transpose() * shift + second.bb * turn + 0.5 * turn.cross(end_moment);
                let mut add = |node: usize, moment: DVec3, force: DVec3| {
                    let Some(node) = node.checked_sub(1) else {
                        return;
                    };
                    for c in 0..3 {
                        rhs[j][node][c] += moment[c];
                        rhs[j][node][3 + c] += force[c];
                    }
                };
                add(i, at_begin, -pull);
                add(i + 1, at_end - moment, pull - force);
            }
        }
        system.set_rhs(&rhs);
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[place(j).0].rhs);
        }
    }
}
