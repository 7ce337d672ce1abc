//! The first-order response of a leaf to jumps of the fields along its rods.

use crate::leaf::chain::group_and_lane;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{State, add};
use crate::leaf::system::System;
use crate::rod::{Blocks, Segment};
use glam::DVec3;

/// Jumps of a rod's position, rotation, force and moment at a node: the values before the
/// node, seen from the base, minus those beyond it.
pub type Jump = [DVec3; 4];

/// A segment with its derivatives.
pub struct Tangent {
    /// The segment.
    pub segment: Segment,
    /// Derivatives of Pi with respect to its end position and the rotations of both nodes.
    pub first: (DVec3, DVec3, DVec3),
    /// Second derivatives, the force condensed out.
    pub second: Blocks,
}

impl DiscreteLeaf {
    /// Segment `i` of rod `j` with its derivatives.
    pub fn tangent(&self, state: &State, j: usize, i: usize) -> Tangent {
        let section = self.section(j, i);
        let segment = self.segment(state, j, i, state.n[j * self.segments() + i]);
        Tangent {
            first: segment.gradient(section),
            second: segment.hessian(section),
            segment,
        }
    }

    /// Assembles the right-hand side for the first-order change that removes the `jumps` of a
    /// leaf, given rod after rod at the midpoints of equal parts; `tangents` are the segments
    /// that begin there.
    pub fn assemble_jumps(
        &self,
        tangents: &[Vec<Tangent>],
        jumps: &[Vec<Jump>],
        system: &mut System,
    ) {
        let (n, first) = (self.segments(), self.first_node());
        let mut rhs = vec![vec![[0.0; 6]; self.moving_nodes().len()]; self.rods()];
        for ((rhs, rod), tangents) in rhs.iter_mut().zip(jumps).zip(tangents) {
            let part = n / rod.len();
            for (k, (&[shift, turn, force, moment], tangent)) in
                rod.iter().zip(tangents).enumerate()
            {
                // After the change the segment beyond the node begins where the one before it
                // ends.
                let i = k * part + part / 2;
                let (second, (_, held, _)) = (&tangent.second, tangent.first);
                let pull = second.xa * turn - second.xx * shift;
                // A moment with fixed lab components does not rotate with its node.
                let at_begin =
                    second.aa * turn - second.xa.transpose() * shift + 0.5 * turn.cross(held);
                let at_end = second.ab.transpose() * turn - second.xb.transpose() * shift;
                add(&mut rhs[i - first], -at_begin - moment, pull - force);
                add(&mut rhs[i + 1 - first], -at_end, -pull);
            }
        }
        system.set_rhs(&rhs);
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[group_and_lane(j).0].rhs);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::{Grid, Leaf, Solved, shift};
    use crate::scenario::Scenario;
    use glam::DQuat;

    const ROD: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 2.0, bending_2 = 1.0, bending_3 = 1.0, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }
    "#;
    const SEGMENTS: usize = 8;

    /// The displacements of a straight rod at rest, from its first node on, due to a jump at
    /// its midpoint.
    fn displacements(jump: Jump) -> Vec<DVec3> {
        let rod = Scenario::from_toml(ROD).unwrap();
        let leaf = DiscreteLeaf::new(&Leaf::new(&rod), Grid::new(SEGMENTS, &[]));
        let x = leaf.grid.sigma().iter().map(|&sigma| sigma * DVec3::X);
        let state = State::new(SEGMENTS, x.collect(), vec![DQuat::IDENTITY; SEGMENTS + 1]);
        let mut system = System::new(&leaf);
        leaf.assemble(&state, &mut system);
        assert!(system.factorize(0.0));
        let tangent = leaf.tangent(&state, 0, SEGMENTS / 2);
        leaf.assemble_jumps(&[vec![tangent]], &[vec![jump]], &mut system);
        assert!(matches!(system.solve(None, 1e-12), Solved::Yes(_)));
        system.solution()[0].iter().map(shift).collect()
    }

    fn assert_moved(jump: Jump, expected: impl Fn(f64) -> DVec3) {
        for (i, found) in displacements(jump).into_iter().enumerate() {
            let expected = expected((i + 1) as f64 / SEGMENTS as f64);
            let off = (found - expected).length();
            assert!(off < 1e-12, "{jump:?}, {i}: {found} for {expected}");
        }
    }

    /// The part beyond the jump moves as a rigid body.
    #[test]
    fn behind_a_jump_the_free_part_follows() {
        let zero = DVec3::ZERO;
        let jump = DVec3::new(0.1, -0.2, 0.3);
        let beyond = |sigma: f64| if sigma > 0.5 { 1.0 } else { 0.0 };
        assert_moved([jump, zero, zero, zero], |sigma| beyond(sigma) * jump);
        let turned = |sigma: f64| beyond(sigma) * jump.cross((sigma - 0.5) * DVec3::X);
        assert_moved([zero, jump, zero, zero], turned);
    }

    /// Removing a jump of force or moment is equivalent to a load of that size at the
    /// midpoint.
    #[test]
    fn before_a_jump_of_a_force_the_held_part_bends_back() {
        let zero = DVec3::ZERO;
        let axial = DVec3::new(0.7, 0.0, 0.0);
        let pulled = |sigma: f64| -sigma.min(0.5) / 40.0 * axial;
        assert_moved([zero, zero, axial, zero], pulled);
        // A cantilever of half the length under a moment M at its end: M s^2/(2 A).
        let moment = DVec3::new(0.0, 0.0, 0.6);
        assert_moved([zero, zero, zero, moment], |sigma| {
            let s = sigma.min(0.5);
            -0.6 * (0.5 * s * s + (sigma - s) * s) * DVec3::Y
        });
    }
}
