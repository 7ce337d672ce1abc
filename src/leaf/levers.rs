//! Dead forces off the axis of a rod: the weight of a mass beside it, or a force on an arm.
//!
//! A force F at the offset o, along the directors of a section with the rotation R, acts at r + R o. Its energy
//! -F . (r + R o) is that of a force on the axis, which is a load of the vein like others, and the lever's
//! -F . a with a = R o. A spatial rotation t of the section changes a by t x a + t x (t x a)/2: the lever has the
//! moment a x F and the second derivatives (a . F) 1 - (a F + F a)/2, which are symmetric.

use crate::leaf::Leaf;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::loads::{NODE_COINCIDENCE_TOLERANCE, PointForce};
use crate::leaf::nodal_loads::Lever;
use crate::leaf::state::{Increment, State, rotation_part};
use crate::leaf::system::System;
use crate::rod::Wrench;
use crate::scenario::PointLoad;
use glam::{DQuat, DVec3};

impl Leaf {
    /// Where force and mass of a point are off the axis, along the directors.
    pub fn point_offset(&self, point: &PointLoad) -> DVec3 {
        point.arm() / self.scale.length
    }

    /// The dead forces on points off the axis.
    fn forces_off_axis(&self) -> impl Iterator<Item = PointForce> {
        let forces = self.point_forces();
        forces.filter(|it| it.offset != DVec3::ZERO && it.force != DVec3::ZERO)
    }
}

impl DiscreteLeaf {
    /// A force on a point, at its node.
    pub(super) fn node_lever(&self, point: &PointLoad, force: DVec3) -> Lever {
        Lever {
            rod: point.vein,
            node: self.grid.nearest_node(point.at),
            offset: self.leaf.point_offset(point),
            force,
        }
    }

    /// The dead forces off the axis of a leaf on this grid, before their factor.
    pub(super) fn nodal_levers(&self, leaf: &Leaf) -> Vec<Lever> {
        let forces = leaf.forces_off_axis();
        let on_node = |it: PointForce| Lever {
            rod: it.rod,
            node: self.grid.nearest_node(it.sigma),
            offset: it.offset,
            force: it.force,
        };
        forces.map(on_node).collect()
    }

    /// Whether dead forces act off the axes.
    pub fn has_levers(&self) -> bool {
        !self.levers.is_empty()
    }

    /// The present dead forces off the axes.
    pub(super) fn present_levers(&self) -> impl Iterator<Item = Lever> {
        let factor = self.rod_load_factor();
        self.levers.iter().map(move |lever| Lever {
            force: factor * lever.force,
            ..*lever
        })
    }

    /// The dead forces off the axis on node `i` of rod `j`.
    pub(super) fn levers_on(&self, j: usize, i: usize) -> impl Iterator<Item = Lever> {
        let here = move |it: &Lever| (it.rod, it.node) == (j, i);
        self.present_levers().filter(here)
    }

    /// The moment of the dead forces off the axis of rod `j` at `sigma`, whose section has the rotation `q`: by it
    /// the moment of the rod jumps there.
    pub fn lever_moment_at(&self, j: usize, sigma: f64, q: DQuat) -> DVec3 {
        self.levers_at(j, sigma).map(|lever| lever.moment(q)).sum()
    }

    /// The energy of these forces, without that of the forces on the axis.
    pub fn lever_energy_at(&self, j: usize, sigma: f64, q: DQuat) -> f64 {
        self.levers_at(j, sigma).map(|lever| lever.energy(q)).sum()
    }

    fn levers_at(&self, j: usize, sigma: f64) -> impl Iterator<Item = Lever> {
        let here =
            move |node: usize| (self.grid.sigma()[node] - sigma).abs() < NODE_COINCIDENCE_TOLERANCE;
        let levers = self.present_levers();
        levers.filter(move |it| it.rod == j && here(it.node))
    }

    /// Adds the levers of forces off the axes to an assembled system, to its matrix if wanted; returns their
    /// energy, without that of levers on bases.
    pub(super) fn add_levers(&self, state: &State, system: &mut System, matrix: bool) -> f64 {
        let mut energy = 0.0;
        for lever in self.present_levers() {
            let (j, i) = (lever.rod, lever.node);
            let q = state.q[state.base(j) + i];
            if i > 0 {
                energy += lever.energy(q);
            }
            if i >= self.first_node() {
                let load = Wrench {
                    moment: lever.moment(q),
                    force: DVec3::ZERO,
                };
                system.add_load(j, i, load);
                if matrix {
                    system.add_rotation_spring(j, i, lever.rotation_stiffness(q));
                }
            }
        }
        energy
    }

    /// Adds the moments of forces off the axes to the moments and forces on all nodes.
    pub fn add_lever_moments(&self, state: &State, nodes: &mut [Wrench]) {
        for lever in self.present_levers() {
            let k = state.base(lever.rod) + lever.node;
            nodes[k].moment += lever.moment(state.q[k]);
        }
    }

    /// Second derivatives of the energy of these levers along a shape of all nodes.
    pub fn lever_curvature(&self, state: &State, shape: &[Increment]) -> f64 {
        let curvature = |lever: Lever| {
            let k = state.base(lever.rod) + lever.node;
            let turn = rotation_part(&shape[k]);
            turn.dot(lever.rotation_stiffness(state.q[k]) * turn)
        };
        self.present_levers().map(curvature).sum()
    }

    /// The largest squared frequency that these levers could give their nodes alone, with this least moment of
    /// inertia of a node.
    pub fn lever_frequency_bound(&self, inertia: impl Fn(usize, usize) -> f64) -> f64 {
        let levers = self.present_levers();
        let each = levers.map(|it| {
            let stiffness = it.offset.length() * it.force.length();
            stiffness / inertia(it.rod, it.node)
        });
        each.sum()
    }
}
