//! Hinges that hold the spin of a base ([`HeldSpin`](crate::rotation::HeldSpin)): the increments that they allow, their moments, and
//! Newton's equations across what they hold.
//!
//! With the unit vector a of the joint, P = 1 - a a^T, the spatial gradient g of the energy by the rotation of the base
//! and its symmetric second derivatives H, the equations of the base are P H P delta = -P g, and the moment of the joint
//! is (a . g) a. As the turns that a joint allows are a great sphere, no derivative of a is in them.

use crate::leaf::block_tridiagonal::rod_lane;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{NodalField, SpinAxes, SpinAxis, State};
use crate::leaf::system::System;
use crate::rod::{NodeBlock, UNKNOWNS};
use crate::rotation::outer;
use glam::{DMat3, DVec3};

/// The entry of the matrix along a, in A/L: with the mass of a base it is a frequency above all others, and its
/// rounding, in what lies across a, is far below the stiffness of any vein.
const HELD_SPIN_STIFFNESS: f64 = 1e6;

impl DiscreteLeaf {
    /// Whether hinges hold the spin of some base.
    pub fn holds_spins(&self) -> bool {
        !self.joints.is_empty()
    }

    /// The axes about which hinges hold the bases in a state.
    pub fn spin_axes(&self, state: &State) -> SpinAxes {
        let mut axes = SpinAxes::default();
        self.set_spin_axes(state, &mut axes);
        axes
    }

    fn set_spin_axes(&self, state: &State, axes: &mut SpinAxes) {
        axes.0.clear();
        axes.0.extend(self.joints.iter().map(|joint| SpinAxis {
            rod: joint.rod,
            axis: joint.spin.axis(state.q[state.base(joint.rod)]),
        }));
    }

    /// Turns bases whose spin is held, and have spun by rounding, to the next frame that their hinges allow.
    pub fn settle_spins(&self, state: &mut State) {
        for joint in &self.joints {
            let base = state.base(joint.rod);
            state.q[base] = joint.spin.settled(state.q[base]);
        }
    }

    /// What is left of a moment on node `i` of rod `j` where a hinge balances what is along its axis.
    pub fn across_joint(&self, state: &State, j: usize, i: usize, moment: DVec3) -> DVec3 {
        if i > 0 || self.joints.is_empty() {
            return moment;
        }
        self.spin_axes(state).across(j, moment)
    }

    /// The tensor of inertia of the base of rod `j`, restricted to what its hinge allows.
    pub fn tensor_across_joint(&self, state: &State, j: usize, tensor: DMat3) -> DMat3 {
        let axes = self.spin_axes(state);
        let Some(held) = axes.iter().find(|held| held.rod == j) else {
            return tensor;
        };
        let across = DMat3::IDENTITY - outer(held.axis, held.axis);
        across * tensor * across
    }

    /// The angular acceleration, across the axis of its hinge, that a moment gives to the base of rod `j` with this tensor
    /// of inertia.
    pub fn joint_acceleration(
        &self,
        state: &State,
        j: usize,
        tensor: DMat3,
        moment: DVec3,
    ) -> DVec3 {
        let axes = self.spin_axes(state);
        let Some(held) = axes.iter().find(|held| held.rod == j) else {
            return tensor.inverse() * moment;
        };
        // Across the axis the restricted tensor is regular, and along it this one is.
        let restricted = self.tensor_across_joint(state, j, tensor) + outer(held.axis, held.axis);
        restricted.inverse() * held.across(moment)
    }

    /// Restricts assembled equations to what hinges that hold the spin allow: the right-hand side, and the matrix if
    /// wanted.
    pub(super) fn hold_spins(&self, state: &State, system: &mut System, matrix: bool) {
        if self.joints.is_empty() {
            system.spin_axes.0.clear();
            return;
        }
        self.set_spin_axes(state, &mut system.spin_axes);
        system.clear_held_spins();
        if matrix {
            for k in 0..system.spin_axes.0.len() {
                let held = system.spin_axes.0[k];
                system.hold_spin(held);
                if self.has_tissue() {
                    system.hold_spin_in_tissue(held);
                }
            }
        }
    }
}

impl System {
    /// Removes what hinges balance from the right-hand side.
    pub fn clear_held_spins(&mut self) {
        for SpinAxis { rod, axis } in self.spin_axes.iter() {
            let at = rod_lane(rod);
            let rhs = &mut self.groups[at.group].rhs[0];
            let moment = DVec3::from([0, 1, 2].map(|c| rhs[c].0[at.lane]));
            let left = moment - moment.dot(axis) * axis;
            (0..3).for_each(|c| rhs[c].0[at.lane] = left[c]);
        }
    }

    /// Restricts the matrix of a rod to what the hinge of its base allows.
    fn hold_spin(&mut self, SpinAxis { rod, axis }: SpinAxis) {
        let at = rod_lane(rod);
        let chain = &mut self.groups[at.group].matrix;
        let mut own = NodeBlock::default();
        let mut next = NodeBlock::default();
        for r in 0..UNKNOWNS {
            for c in 0..UNKNOWNS {
                own[r][c] = chain.diagonal_entry_mut(0, r.min(c), r.max(c)).0[at.lane];
                next[r][c] = chain.off_diagonal_entry_mut(0, r, c).0[at.lane];
            }
        }
        restrict_rows(&mut own, axis);
        restrict_columns(&mut own, axis);
        restrict_rows(&mut next, axis);
        for r in 0..3 {
            for c in 0..3 {
                own[r][c] += HELD_SPIN_STIFFNESS * axis[r] * axis[c];
            }
        }
        for r in 0..UNKNOWNS {
            for c in 0..UNKNOWNS {
                if r <= c {
                    chain.diagonal_entry_mut(0, r, c).0[at.lane] = own[r][c];
                }
                chain.off_diagonal_entry_mut(0, r, c).0[at.lane] = next[r][c];
            }
        }
    }

    /// Restricts the blocks of the tissue on both sides of a rod to what the hinge of its base allows.
    fn hold_spin_in_tissue(&mut self, SpinAxis { rod, axis }: SpinAxis) {
        if rod + 1 < self.rods {
            restrict_rows(self.gap_block_mut(rod, 0), axis);
            if let Some([ahead, _]) = self.cell_blocks_mut(rod, 0) {
                restrict_rows(ahead, axis);
            }
        }
        if let Some(gap) = rod.checked_sub(1) {
            restrict_columns(self.gap_block_mut(gap, 0), axis);
            if let Some([_, crossing]) = self.cell_blocks_mut(gap, 0) {
                restrict_columns(crossing, axis);
            }
        }
    }
}

/// Removes what is along an axis from the rows of the rotation.
fn restrict_rows(block: &mut NodeBlock, axis: DVec3) {
    for c in 0..UNKNOWNS {
        let along: f64 = (0..3).map(|r| axis[r] * block[r][c]).sum();
        (0..3).for_each(|r| block[r][c] -= axis[r] * along);
    }
}

/// Removes what is along an axis from the columns of the rotation.
fn restrict_columns(block: &mut NodeBlock, axis: DVec3) {
    for row in block {
        let along: f64 = (0..3).map(|c| axis[c] * row[c]).sum();
        (0..3).for_each(|c| row[c] -= axis[c] * along);
    }
}

impl SpinAxes {
    /// Removes what is along the axes from increments of the bases, or from moments on them.
    pub fn restrict(&self, field: &mut NodalField) {
        for held in self.iter() {
            let node = &mut field[held.rod][0];
            let across = held.across(DVec3::new(node[0], node[1], node[2]));
            node[..3].copy_from_slice(&across.to_array());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::state::dot;
    use crate::leaf::{DirectSolver, Grid, Leaf};
    use crate::scenario::Scenario;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 3, length = [1.0, 0.9, 1.1], fan = [0.4, 0.0, -0.3], elevation = 0.2, joined = JOINED, base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = HELD, base_spin = "held" }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 20.0, shear_2 = 10.0, shear_3 = 15.0 }
        rest = { bend_2 = [0.3, -0.5, 0.4], bend_3 = [0.2, 0.1, -0.3], twist = 0.2 }
        coupling = { x = 2.0, y = 3.0, z = 4.0 }
        TISSUE
        load.gravity = [0.1, 0.3, -2.0]
        load.tip_force = [0.1, -0.2, 0.1]
        "#;

    /// Increments of all nodes without symmetry, those that supports hold being zero.
    fn increments(leaf: &DiscreteLeaf, state: &State, seed: usize) -> NodalField {
        let golden = |k: usize| ((k + seed) as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let count = leaf.moving_nodes().len();
        let node =
            |j: usize, i: usize| std::array::from_fn(|c| golden(1 + c + 6 * (i + count * j)));
        let rod = |j: usize| (0..count).map(|i| node(j, i)).collect();
        let mut field: NodalField = (0..leaf.rods()).map(rod).collect();
        leaf.zero_held_components(&leaf.spin_axes(state), &mut field);
        if leaf.leaf.joined() {
            let tip = field[0][count - 1];
            for rod in &mut field {
                rod[count - 1][3..].copy_from_slice(&tip[3..]);
            }
        }
        field
    }

    /// In any state, along any increments d that the hinges allow, energy and forces f of the states exp(t d) have
    /// dE/dt = -f . d and d(f . d)/dt = -d . K d.
    #[test]
    fn forces_and_matrix_are_derivatives_of_the_energy() {
        let tissue = "tissue = { along = 20.0, across = 10.0, normal = 15.0, fold = 0.4 }";
        let cells = "tissue = { along = 20.0, across = 10.0, normal = 15.0, fold = 0.4, contraction = 0.3 }";
        for (held, joined) in [
            (r#""pinned""#, true),
            (r#"["pinned", "clamped", "pinned"]"#, false),
        ] {
            for tissue in ["", tissue, cells] {
                let text = LEAF.replace("HELD", held).replace("TISSUE", tissue);
                let text = text.replace("JOINED", if joined { "true" } else { "false" });
                let scenario = Scenario::from_toml(&text).unwrap();
                let leaf = DiscreteLeaf::new(&Leaf::new(&scenario), Grid::new(6, &[]));
                let mut system = System::new(&leaf);
                let moved = |from: &State, by: &NodalField, t: f64, system: &mut System| {
                    let mut next = from.clone();
                    system.set_solution(by);
                    leaf.advance(from, system, t, &mut next);
                    leaf.strain_forces(&mut next);
                    next
                };
                let mut state = leaf.stress_free_state();
                if joined {
                    state.join_tips();
                }
                for seed in 0..4 {
                    let far = increments(&leaf, &state, 100 * seed);
                    state = moved(&state, &far, 0.7, &mut system);
                }
                let base = state.q[0];
                let turned = base.angle_between(leaf.leaf.base_pose(0).rotation);
                assert!(turned > 0.3, "{turned}");
                for seed in [7, 70] {
                    let by = increments(&leaf, &state, seed);
                    leaf.assemble(&state, &mut system);
                    let solver = DirectSolver::new(&system).unwrap();
                    let matrix = dot(&solver.product(&system, &by), &by);
                    let power = dot(&system.rhs(), &by);
                    let mut at = |t: f64| {
                        let there = moved(&state, &by, t, &mut system);
                        leaf.assemble_forces(&there, &mut system);
                        (leaf.energy(&there), dot(&system.rhs(), &by))
                    };
                    let h = 1e-4;
                    let ([after, before], [far_after, far_before]) =
                        ([h, -h].map(&mut at), [2.0 * h, -2.0 * h].map(&mut at));
                    let slope = |near: f64, far: f64| (8.0 * near - far) / (12.0 * h);
                    let energy = slope(after.0 - before.0, far_after.0 - far_before.0);
                    let forces = slope(after.1 - before.1, far_after.1 - far_before.1);
                    let what = format!("{held} {tissue} {seed}");
                    assert!(
                        (energy + power).abs() < 1e-7 * (1.0 + power.abs()),
                        "{what}: {energy} {power}"
                    );
                    assert!(
                        (forces + matrix).abs() < 1e-7 * matrix.abs(),
                        "{what}: {forces} {matrix}"
                    );
                }
            }
        }
    }
}
