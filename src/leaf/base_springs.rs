//! Bases that give: springs that hold the directions of hinged bases. A spring of the stiffness c whose
//! base has turned by the rotation vector theta from its natural direction has the energy c theta^2/2.

use crate::leaf::Leaf;
use crate::leaf::discrete::{DiscreteLeaf, NodeLoad};
use crate::leaf::state::{Increment, State, rotation_part};
use crate::leaf::system::System;
use crate::rod::Wrench;
use crate::rotation;
use glam::{DMat3, DQuat, DVec3};

impl Leaf {
    /// The rotation vector, along the lab axes, from the natural direction of the base of rod `j` to `q`.
    fn base_turn(&self, j: usize, q: DQuat) -> DVec3 {
        let natural = self.base_pose(j).rotation;
        let natural = self.base_rotation.map_or(natural, |turn| turn * natural);
        rotation::log(q * natural.conjugate())
    }

    /// The moment of rod `j` at a base with the rotation `q`: that of its spring, or none.
    pub fn base_spring_moment(&self, j: usize, q: DQuat) -> DVec3 {
        self.base_turn_stiffness(j) * self.base_turn(j, q)
    }
}

impl DiscreteLeaf {
    /// Whether springs hold the directions of the bases.
    pub fn has_base_springs(&self) -> bool {
        self.leaf.has_base_springs()
    }

    /// The moment and the energy of the spring at the base of rod `j`.
    pub fn base_spring_load(&self, state: &State, j: usize) -> NodeLoad {
        let stiffness = self.leaf.base_turn_stiffness(j);
        if stiffness == 0.0 {
            return NodeLoad::default();
        }
        let turn = self.leaf.base_turn(j, state.q[state.base(j)]);
        NodeLoad {
            moment: -stiffness * turn,
            energy: 0.5 * stiffness * turn.length_squared(),
            ..NodeLoad::default()
        }
    }

    /// The second derivatives of the energy of the spring at the base of rod `j` by the rotation of the base,
    /// the symmetric part of those of its moment.
    fn base_spring_stiffness(&self, state: &State, j: usize) -> DMat3 {
        let rate = rotation::log_rate(self.leaf.base_turn(j, state.q[state.base(j)]));
        0.5 * self.leaf.base_turn_stiffness(j) * (rate + rate.transpose())
    }

    /// Adds the springs to an assembled system, to its matrix if wanted; returns their energy.
    pub(super) fn add_base_springs(&self, state: &State, system: &mut System, matrix: bool) -> f64 {
        if !self.has_base_springs() {
            return 0.0;
        }
        let mut energy = 0.0;
        for j in 0..self.rods() {
            let NodeLoad {
                moment,
                energy: own,
                ..
            } = self.base_spring_load(state, j);
            energy += own;
            system.add_load(
                j,
                0,
                Wrench {
                    moment,
                    force: DVec3::ZERO,
                },
            );
            if matrix {
                system.add_rotation_spring(j, 0, self.base_spring_stiffness(state, j));
            }
        }
        energy
    }

    /// Adds the moments of the springs to those on all nodes.
    pub fn add_base_spring_moments(&self, state: &State, nodes: &mut [Wrench]) {
        if self.has_base_springs() {
            for j in 0..self.rods() {
                nodes[state.base(j)].moment += self.base_spring_load(state, j).moment;
            }
        }
    }

    /// Second derivatives of the energy of the springs along a shape of all nodes.
    pub fn base_spring_curvature(&self, state: &State, shape: &[Increment]) -> f64 {
        if !self.has_base_springs() {
            return 0.0;
        }
        let curvature = |j: usize| {
            let turn = rotation_part(&shape[state.base(j)]);
            turn.dot(self.base_spring_stiffness(state, j) * turn)
        };
        (0..self.rods()).map(curvature).sum()
    }

    /// The largest squared frequency that a spring could give its base alone, with this least inertia of
    /// each base about an axis across.
    pub fn base_spring_frequency_bound(&self, inertia: impl Fn(usize) -> f64) -> f64 {
        let of = |j: usize| self.leaf.base_turn_stiffness(j) / inertia(j);
        (0..self.rods()).map(of).fold(0.0, f64::max)
    }
}
