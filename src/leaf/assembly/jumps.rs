//! What jumps of the fields along the rods do to a leaf, to first order.

use crate::leaf::chain::place;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::State;
use crate::leaf::system::System;
use glam::DVec3;

/// Jumps of a rod's position, rotation, force and moment at a node: what they are before
/// it, seen from the base, less what they are behind it.
pub type Jump = [DVec3; 4];

impl DiscreteLeaf {
    /// Writes the right-hand side of the change, to first order, by which a leaf loses
    /// its `jumps`, rod after rod in the middles of so many equal parts.
    pub fn assemble_jumps(&self, state: &State, jumps: &[Vec<Jump>], system: &mut System) {
        let n = self.segments();
        let mut rhs = vec![vec![[0.0; 6]; n]; self.rods()];
        for (rhs, (j, rod)) in rhs.iter_mut().zip(jumps.iter().enumerate()) {
            for (k, &[shift, turn, force, moment]) in rod.iter().enumerate() {
                // The segment behind the node begins where the one before ends.
                let part = n / rod.len();
                let i = k * part + part / 2;
                let section = self.section(j, i);
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                let (second, (_, held, _)) = (segment.hessian(section), segment.gradient(section));
                let pull = second.xa * turn - second.xx * shift;
                // A moment along the lab axes does not turn with its node.
                let at_begin =
                    second.aa * turn - second.xa.transpose() * shift + 0.5 * turn.cross(held);
                let at_end = second.ab.transpose() * turn - second.xb.transpose() * shift;
                let mut add = |node: usize, moment: DVec3, force: DVec3| {
                    for c in 0..3 {
                        rhs[node - 1][c] += moment[c];
                        rhs[node - 1][3 + c] += force[c];
                    }
                };
                add(i, -at_begin - moment, pull - force);
                add(i + 1, -at_end, -pull);
            }
        }
        system.set_rhs(&rhs);
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[place(j).0].rhs);
        }
    }
}
