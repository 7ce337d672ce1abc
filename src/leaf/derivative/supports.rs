//! Derivatives with respect to a number that moves supports: the effect of held nodes that move, and
//! the changes of the forces on grips and on the holder of a tip.

use crate::leaf::derivative::parameter::{
    LeafParameterDerivative, LinearResponse, ParameterForces, Weighted, hessian_at_constant_force,
};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{
    Increment, NodalField, NodeIncrement, State, add_to_increment, displacement_part, rotation_part,
};
use crate::leaf::tissue::rigid::{ForceCarriers, RigidStrip};
use crate::rod::{Segment, Wrench};
use crate::rotation;
use glam::DVec3;

impl DiscreteLeaf {
    /// The increments of held nodes by the motion of what holds them; empty for rods on which nothing
    /// moves. Grips hold nodes where these are in the stress-free leaf: their motion is the weighted
    /// sum over the stress-free leaves that differ.
    pub(super) fn support_motion_increments(
        &self,
        rate: &LeafParameterDerivative,
        each: &[Weighted<DiscreteLeaf>],
    ) -> NodalField {
        let (n, nodes) = (self.segments(), self.moving_nodes());
        let mut motion = vec![Vec::new(); self.rods()];
        let mut put = |j: usize, i: usize, by: NodeIncrement| {
            if by != NodeIncrement::default() {
                let of_rod: &mut Vec<Increment> = &mut motion[j];
                of_rod.resize(nodes.len(), [0.0; 6]);
                of_rod[i - nodes.start] = by.to_array();
            }
        };
        for j in 0..self.rods() {
            put(j, 0, rate.held_base_rate(j));
        }
        for (j, held) in (0..self.rods()).flat_map(|j| rate.held.iter().map(move |it| (j, it))) {
            put(j, n, held.tip_increment(j));
        }
        for (k, own) in self.grips.iter().enumerate() {
            let mut by = NodeIncrement::default();
            for Weighted { weight, term } in each {
                let [first, other] = [&each[0].term, term].map(|leaf| leaf.grips[k]);
                let moved = *weight * (other.position - first.position);
                by.displacement += DVec3::select(own.held_axes, moved, DVec3::ZERO);
                if let (Some(from), Some(to)) = (first.rotation, other.rotation) {
                    by.rotation += *weight * rotation::log(to * from.conjugate());
                }
            }
            put(own.rod, own.node, by);
        }
        motion
    }

    /// Adds the effect of supports that move by these increments of held nodes.
    pub(super) fn add_support_motion(
        &self,
        state: &State,
        carriers: &ForceCarriers,
        motion: NodalField,
        forces: &mut ParameterForces,
    ) {
        for (j, rod) in motion.iter().enumerate() {
            for (i, by) in rod.iter().enumerate() {
                if *by != [0.0; 6] {
                    self.add_node_motion(
                        state,
                        &carriers.segments,
                        j,
                        i + self.first_node(),
                        by,
                        forces,
                    );
                }
            }
        }
        self.add_joint_motion(state, &motion, forces);
        self.add_coupling_response(state, &motion, forces);
        self.add_strip_motion(&carriers.strips, &motion, forces);
        forces.support_increments = motion;
    }

    /// Adds the effect of moving node `i` of rod `j` on the segments on either side, and on the energy.
    fn add_node_motion(
        &self,
        state: &State,
        segments: &[Segment],
        j: usize,
        i: usize,
        by: &Increment,
        forces: &mut ParameterForces,
    ) {
        let n = self.segments();
        let (turned, moved) = (rotation_part(by), displacement_part(by));
        let free = self.node_freedom(j, i);
        let (first, count) = (self.first_node(), self.moving_nodes().len());
        if i > 0 {
            let (section, segment) = (self.section(j, i - 1), &segments[j * n + i - 1]);
            let k = hessian_at_constant_force(segment, section);
            let nodes = forces.rod_forces_mut(j, count);
            let force = k.xx * moved + k.xb * turned;
            if i > first {
                let moment = k.ab * turned + k.xa.transpose() * moved;
                add_to_increment(&mut nodes[i - 1 - first], -moment, force);
            }
            // A node that is only pinned rotates freely, and one that slides is displaced.
            let moment = k.bb * turned + k.xb.transpose() * moved;
            add_to_increment(&mut nodes[i - first], -moment, free.of_displacement(-force));
            let gap = segment.gap_increment(section, moved, DVec3::ZERO, turned);
            forces.gap_effects_mut(j, n)[i - 1] += gap;
        }
        if i < n {
            let (section, segment) = (self.section(j, i), &segments[j * n + i]);
            let k = hessian_at_constant_force(segment, section);
            let nodes = forces.rod_forces_mut(j, count);
            let moment = k.aa * turned - k.xa.transpose() * moved;
            let force = k.xx * moved - k.xa * turned;
            add_to_increment(&mut nodes[i - first], -moment, free.of_displacement(-force));
            add_to_increment(
                &mut nodes[i + 1 - first],
                k.xb.transpose() * moved - k.ab.transpose() * turned,
                force,
            );
            forces.gap_effects_mut(j, n)[i] +=
                segment.gap_increment(section, -moved, turned, DVec3::ZERO);
        }
        let load = self.unbalanced_node_load(state, j, i);
        forces.energy -= load.force.dot(moved) + load.moment.dot(turned);
    }

    /// Adds the effect of joints that turn: the moment F of a base, which is along the axis of its joint, turns with it by
    /// eta x F, of which the symmetric second derivatives of the energy leave eta x F/2 to be added.
    fn add_joint_motion(&self, state: &State, motion: &NodalField, forces: &mut ParameterForces) {
        if !self.holds_spins() {
            return;
        }
        let count = self.moving_nodes().len();
        for (j, rod) in motion.iter().enumerate() {
            if let Some(by) = rod.first().filter(|_| self.leaf.holds_base_spin(j)) {
                let held = self.support_load(state, j, 0).moment;
                let moment = -0.5 * rotation_part(by).cross(held);
                add_to_increment(&mut forces.rod_forces_mut(j, count)[0], moment, DVec3::ZERO);
            }
        }
    }

    /// Adds the changes of the forces of coupling and tissue by increments of the nodes. At a joint
    /// tip neighbors are displaced alike, and rotations that are prescribed there are held.
    fn add_coupling_response(
        &self,
        state: &State,
        increments: &NodalField,
        forces: &mut ParameterForces,
    ) {
        let (n, first, count) = (
            self.segments(),
            self.first_node(),
            self.moving_nodes().len(),
        );
        let by = |j: usize, i: usize| increments[j].get(i - first).copied().unwrap_or([0.0; 6]);
        let last = if self.leaf.joined() { n } else { n + 1 };
        for (g, i) in (0..self.rods() - 1).flat_map(|g| (first..last).map(move |i| (g, i))) {
            let both = [by(g, i), by(g + 1, i)];
            if both == [[0.0; 6]; 2] {
                continue;
            }
            let pull = self.node_coupling(g, i)
                * (displacement_part(&both[1]) - displacement_part(&both[0]));
            let mut add = |j: usize, i: usize, load: Wrench| {
                if i >= first {
                    let on_node = &mut forces.rod_forces_mut(j, count)[i - first];
                    add_to_increment(on_node, load.moment, load.force);
                }
            };
            for (j, load) in [(g, pull), (g + 1, -pull)] {
                add(j, i, Wrench::from_force(load));
            }
            self.for_each_tissue_response(state, g, i, &both, add);
        }
    }

    /// Adds the changes of the gaps of rigid tissue by increments of its nodes.
    fn add_strip_motion(
        &self,
        strips: &[RigidStrip],
        increments: &NodalField,
        forces: &mut ParameterForces,
    ) {
        let first = self.first_node();
        for (k, strip) in strips.iter().enumerate() {
            let by = |rod: usize| {
                let i = strip.node.checked_sub(first);
                let known = i.and_then(|i| increments[rod].get(i)).copied();
                known.unwrap_or([0.0; 6])
            };
            let [a, b] = [strip.gap, strip.gap + 1].map(by);
            if a == [0.0; 6] && b == [0.0; 6] {
                continue;
            }
            let dx = displacement_part(&b) - displacement_part(&a);
            let turns = [&a, &b].map(rotation_part);
            let change = (strip.element).gap_increment(&strip.section, dx, turns[0], turns[1]);
            forces.tissue_gaps.resize(strips.len(), DVec3::ZERO);
            forces.tissue_gaps[k] += strip.rigid * change;
        }
    }

    /// The changes of the forces on all grips, as in [`DiscreteLeaf::grip_reactions`]: by loads,
    /// coupling and tissue, and by the forces in the segments on either side.
    pub fn grip_force_rates(
        &self,
        state: &State,
        rate: &LeafParameterDerivative,
        response: &LinearResponse,
    ) -> Vec<DVec3> {
        let n = self.segments();
        let mut loads = ParameterForces::zeros(self.rods());
        for j in 0..self.rods() {
            self.add_load_changes(state, j, rate, &mut loads);
        }
        let each = self.weighted_leaves_on_grid(rate);
        self.add_tissue_and_own_load_changes(state, &each, &mut loads);
        self.add_coupling_response(state, &response.nodes, &mut loads);
        let mut rates = vec![DVec3::ZERO; self.leaf.scenario().grips.len()];
        for held in &self.grips {
            let (j, i) = (held.rod, held.node);
            let carried = |segment: usize| response.force_changes[j * n + segment];
            let mut force =
                displacement_part(&loads.nodes[j][i - self.first_node()]) - carried(i - 1);
            if i < n {
                force += carried(i);
            }
            force += self.spring_response(j, i, response);
            force += self.follower_response(state, j, i, response);
            let free = self.freedom_without_tip_support(j, i);
            rates[held.grip] += force - free.of_displacement(force);
        }
        self.add_spring_force_rates(state, &each, response, &mut rates);
        rates
    }

    /// The change of the force on the holder of the tip, as in [`DiscreteLeaf::reaction`]: of
    /// the loads on the tip, and of the forces in the last segments.
    pub fn reaction_rate(
        &self,
        state: &State,
        rate: &LeafParameterDerivative,
        response: &LinearResponse,
    ) -> DVec3 {
        let n = self.segments();
        let mut leaves = rate.weighted_leaves.iter();
        let differ =
            leaves.any(|it| it.term.has_foundation() || it.term.scenario().has_followers());
        let each = match differ {
            true => self.weighted_leaves_on_grid(rate),
            false => Vec::new(),
        };
        let weight = self.load_factor * self.grid.node_weight(n);
        let mut force = self.load_factor * rate.tip_force;
        for (j, rod) in rate.rods.iter().enumerate() {
            let gravity = self.loads.gravity * rod.length + rate.gravity * self.leaf.length(j);
            force += weight * gravity - response.force_changes[j * n + n - 1];
            force += self.load_factor * self.own_load_rate(rate, j, n);
            let springs =
                |it: &Weighted<DiscreteLeaf>| it.weight * it.term.spring_load(state, j, n).force;
            force += each.iter().map(springs).sum::<DVec3>();
            let followers = |it: &Weighted<DiscreteLeaf>| {
                it.weight * it.term.follower_wrench(state, j, n).force
            };
            force += each.iter().map(followers).sum::<DVec3>();
            force += self.spring_response(j, n, response);
            force += self.follower_response(state, j, n, response);
        }
        force
    }
}
