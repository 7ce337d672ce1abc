//! Supports that give: springs at elastic bases, of grips, and of a foundation along the veins. They hold
//! nodes in the places, or the directions, in which these are in the stress-free leaf.

use crate::leaf::Leaf;
use crate::leaf::discrete::{DiscreteLeaf, NodeLoad};
use crate::leaf::springs::{NodeSpring, NodeSprings, SpringEnd};
use crate::leaf::state::{Increment, State, displacement_part, rotation_part};
use crate::leaf::system::System;
use crate::rod::Wrench;
use crate::rotation;
use crate::scenario::{RodPlace, SupportKind};
use glam::{DMat3, DQuat, DVec3};

impl Leaf {
    /// The rotation vector, along the lab axes, from the natural direction of the base of rod `j` to `q`.
    fn base_turn(&self, j: usize, q: DQuat) -> DVec3 {
        rotation::log(q * self.base_pose(j).rotation.conjugate())
    }

    /// The moment of rod `j` at a base with the rotation `q`: that of its spring, or none.
    pub fn base_spring_moment(&self, j: usize, q: DQuat) -> DVec3 {
        self.base_turn_stiffness(j) * self.base_turn(j, q)
    }

    /// The energy of the spring at the base of rod `j` with the rotation `q`.
    pub fn base_spring_energy(&self, j: usize, q: DQuat) -> f64 {
        0.5 * self.base_turn_stiffness(j) * self.base_turn(j, q).length_squared()
    }

    /// Whether a foundation holds the veins.
    pub fn has_foundation(&self) -> bool {
        self.scenario().foundation.is_some()
    }

    /// Stiffness of the foundation of rod `j` at a place, per unit of sigma.
    fn foundation_stiffness(&self, j: usize, place: RodPlace) -> DVec3 {
        let Some(foundation) = &self.scenario().foundation else {
            return DVec3::ZERO;
        };
        let along = DVec3::from_array(foundation[j].each_ref().map(|of| of.at(place)));
        let unit = self.scale.force() / self.scale.length.powi(2);
        self.share(j) * self.length(j) / unit * along
    }
}

impl DiscreteLeaf {
    /// The springs of bases, grips and foundation, whose nodes are at rest where they are in `natural`.
    pub(super) fn springs_from(&self, natural: &State) -> NodeSprings {
        let mut springs = Vec::new();
        if self.leaf.has_base_springs() {
            let elastic = (0..self.rods()).filter(|j| self.leaf.base_turn_stiffness(*j) > 0.0);
            springs.extend(elastic.map(|j| NodeSpring {
                turn_stiffness: self.leaf.base_turn_stiffness(j),
                ..self.slack_spring(natural, j, 0)
            }));
        }
        if self.leaf.has_foundation() {
            let nodes = self.rod_index_pairs(0..self.segments() + 1);
            springs.extend(nodes.map(|(j, i)| NodeSpring {
                stiffness: self.foundation_on_node(j, i),
                ..self.slack_spring(natural, j, i)
            }));
        }
        self.add_grip_springs(natural, &mut springs);
        NodeSprings::new(springs, self.rods(), self.segments() + 1)
    }

    /// A spring without stiffness at the place of a node.
    fn slack_spring(&self, natural: &State, rod: usize, node: usize) -> NodeSpring {
        let k = natural.base(rod) + node;
        NodeSpring {
            rod,
            node,
            grip: None,
            position: natural.x[k],
            stiffness: DVec3::ZERO,
            rotation: natural.q[k],
            turn_stiffness: 0.0,
        }
    }

    /// The stiffness of the foundation on a node: that on the halves of the segments on either side.
    fn foundation_on_node(&self, j: usize, i: usize) -> DVec3 {
        (self.grid).node_integral(i, |place| self.leaf.foundation_stiffness(j, place))
    }

    /// The forces of the foundation on the halves of the segments before and after node `i` of rod `j`.
    pub fn foundation_forces(&self, state: &State, j: usize, i: usize) -> [DVec3; 2] {
        let k = state.base(j) + i;
        let foundation =
            |spring: &&NodeSpring| spring.grip.is_none() && spring.turn_stiffness == 0.0;
        let Some(spring) = self.springs.on_node(k).iter().find(foundation) else {
            return [DVec3::ZERO; 2];
        };
        let stretch = spring.position - state.x[k];
        let width = |i: Option<usize>| match i {
            Some(i) if i < self.segments() => self.grid.segment_width(i),
            _ => 0.0,
        };
        let [before, after] = RodPlace::both_sides(self.grid.sigma()[i])
            .map(|place| self.leaf.foundation_stiffness(j, place) * stretch);
        [
            0.5 * width(i.checked_sub(1)) * before,
            0.5 * width(Some(i)) * after,
        ]
    }

    /// Adds the springs of grips that do not hold rigidly. The spring of a stretch is spread over its nodes
    /// by the lengths that belong to them.
    fn add_grip_springs(&self, natural: &State, springs: &mut Vec<NodeSpring>) {
        let sigma = self.grid.sigma();
        let scale = self.leaf.scale;
        for (number, grip) in self.leaf.scenario().grips.iter().enumerate() {
            let clamped = grip.held == SupportKind::Clamped;
            let finite = |stiffness: f64| {
                if stiffness.is_finite() {
                    stiffness
                } else {
                    0.0
                }
            };
            let stiffness = DVec3::from_array(grip.stiffness.map(finite));
            let turn_stiffness = if clamped {
                finite(grip.turn_stiffness)
            } else {
                0.0
            };
            if grip.is_rigid() {
                continue;
            }
            let [from, to] = grip.at.map(|at| self.grid.nearest_node(at));
            let length_of_node = |i: usize| match from == to {
                true => 1.0,
                false => 0.5 * (sigma[(i + 1).min(to)] - sigma[i.max(from + 1) - 1]),
            };
            let whole: f64 = (from..=to).map(length_of_node).sum();
            let moved = DVec3::from_array(grip.displacement) / scale.length;
            springs.extend((from..=to).map(|i| {
                let part = length_of_node(i) / whole;
                let slack = self.slack_spring(natural, grip.vein, i);
                NodeSpring {
                    grip: Some(number),
                    position: slack.position + moved,
                    stiffness: part * scale.length / scale.force() * stiffness,
                    turn_stiffness: part / scale.moment() * turn_stiffness,
                    ..slack
                }
            }));
        }
    }

    /// Turns the springs of elastic bases by `turn` from where they are in the stress-free leaf.
    pub fn turn_base_springs(&mut self, turn: DQuat) {
        let leaf = &self.leaf;
        let of_bases = |spring: &&mut NodeSpring| spring.node == 0 && spring.turn_stiffness > 0.0;
        for spring in self.springs.iter_mut().filter(of_bases) {
            let natural = leaf.base_pose(spring.rod).rotation;
            spring.rotation = (turn * natural).normalize();
        }
    }

    /// Moves the springs of a grip on node `k`, rod after rod, to this place.
    pub fn move_grip_springs(&mut self, k: usize, grip: usize, position: DVec3) {
        let springs = self.springs.on_node_mut(k).iter_mut();
        for spring in springs.filter(|spring| spring.grip == Some(grip)) {
            spring.position = position;
        }
    }

    /// What the springs of a grip on node `k`, rod after rod, exert on the grip with the node at `x`.
    pub fn grip_spring_force(&self, k: usize, grip: usize, x: DVec3) -> DVec3 {
        let springs = self.springs.on_node(k).iter();
        let own = springs.filter(|spring| spring.grip == Some(grip));
        -own.map(|spring| spring.force(x)).sum::<DVec3>()
    }

    /// The ends of the springs of grips that would have no force in a state.
    pub fn grip_spring_ends(&self, state: &State) -> Vec<SpringEnd> {
        let of_grips = self.springs.iter().filter(|spring| spring.grip.is_some());
        let end = |spring: &NodeSpring| {
            let k = state.base(spring.rod) + spring.node;
            SpringEnd {
                position: state.x[k],
                rotation: state.q[k],
            }
        };
        of_grips.map(end).collect()
    }

    /// Puts the springs of grips on the way from `starts` to where they are in the leaf `placed`, at the
    /// fraction `lambda` of it.
    pub fn place_grip_springs(&mut self, placed: &DiscreteLeaf, starts: &[SpringEnd], lambda: f64) {
        let grips = |spring: &NodeSpring| spring.grip.is_some();
        let own = self.springs.iter_mut().filter(|spring| grips(spring));
        let ends = placed.springs.iter().filter(|spring| grips(spring));
        for ((spring, end), start) in own.zip(ends).zip(starts) {
            if lambda == 1.0 {
                *spring = *end;
                continue;
            }
            let turn = rotation::log(end.rotation * start.rotation.conjugate());
            let left = rotation::exp((lambda - 1.0) * turn);
            spring.position = start.position.lerp(end.position, lambda);
            spring.rotation = (left * end.rotation).normalize();
        }
    }

    /// The most displacement and rotation of the springs of grips on their ways from `starts`.
    pub fn grip_spring_way(&self, starts: &[SpringEnd]) -> [f64; 2] {
        let ends = self.springs.iter().filter(|spring| spring.grip.is_some());
        let mut way = [0.0_f64; 2];
        for (end, start) in ends.zip(starts) {
            let moved = DVec3::select(
                end.stiffness.cmpgt(DVec3::ZERO),
                end.position - start.position,
                DVec3::ZERO,
            );
            way[0] = way[0].max(moved.length());
            if end.turn_stiffness > 0.0 {
                let turn = rotation::log(end.rotation * start.rotation.conjugate());
                way[1] = way[1].max(turn.length());
            }
        }
        way
    }

    /// Whether springs hold nodes.
    pub fn has_springs(&self) -> bool {
        !self.springs.is_empty()
    }

    /// The forces, moments and energies of the springs on node `i` of rod `j` together.
    pub fn spring_load(&self, state: &State, j: usize, i: usize) -> NodeLoad {
        let k = state.base(j) + i;
        let mut sum = NodeLoad::default();
        for spring in self.springs.on_node(k) {
            sum.moment += spring.moment(state.q[k]);
            sum.force += spring.force(state.x[k]);
            sum.energy += spring.energy(state.x[k], state.q[k]);
        }
        sum
    }

    /// The energy of all springs.
    pub(super) fn spring_energy(&self, state: &State) -> f64 {
        let energy = |spring: &NodeSpring| {
            let k = state.base(spring.rod) + spring.node;
            spring.energy(state.x[k], state.q[k])
        };
        self.springs.iter().map(energy).sum()
    }

    /// Adds the springs to an assembled system, to its matrix if wanted; returns their energy.
    pub(super) fn add_springs(&self, state: &State, system: &mut System, matrix: bool) -> f64 {
        let mut energy = 0.0;
        for spring in self.springs.iter() {
            let (j, i) = (spring.rod, spring.node);
            let k = state.base(j) + i;
            energy += spring.energy(state.x[k], state.q[k]);
            if i < self.first_node() {
                continue;
            }
            let load = Wrench {
                moment: spring.moment(state.q[k]),
                force: spring.force(state.x[k]),
            };
            system.add_load(j, i, load);
            if matrix && spring.turn_stiffness > 0.0 {
                system.add_rotation_spring(j, i, spring.rotation_stiffness(state.q[k]));
            }
            if matrix && spring.stiffness != DVec3::ZERO {
                system.add_displacement_spring(j, i, DMat3::from_diagonal(spring.stiffness));
            }
        }
        energy
    }

    /// Adds the forces and moments of the springs to those on all nodes.
    pub fn add_spring_loads(&self, state: &State, nodes: &mut [Wrench]) {
        for spring in self.springs.iter() {
            let k = state.base(spring.rod) + spring.node;
            nodes[k].moment += spring.moment(state.q[k]);
            nodes[k].force += spring.force(state.x[k]);
        }
    }

    /// Second derivatives of the energy of the springs along a shape of all nodes.
    pub fn spring_curvature(&self, state: &State, shape: &[Increment]) -> f64 {
        let curvature = |spring: &NodeSpring| {
            let k = state.base(spring.rod) + spring.node;
            let [turn, shift] = [rotation_part(&shape[k]), displacement_part(&shape[k])];
            turn.dot(spring.rotation_stiffness(state.q[k]) * turn)
                + shift.dot(spring.stiffness * shift)
        };
        self.springs.iter().map(curvature).sum()
    }

    /// The largest squared frequency that springs could give their nodes alone, with this least inertia of
    /// a node about an axis across, and its mass.
    pub fn spring_frequency_bound(&self, inertia: impl Fn(usize, usize) -> [f64; 2]) -> f64 {
        let mut largest = 0.0_f64;
        for (j, i) in self.rod_index_pairs(0..self.segments() + 1) {
            let springs = self.springs.on_node(j * (self.segments() + 1) + i);
            if !springs.is_empty() {
                let [rotary, mass] = inertia(j, i);
                let turn: f64 = springs.iter().map(|it| it.turn_stiffness).sum();
                let shift: DVec3 = springs.iter().map(|it| it.stiffness).sum();
                largest = largest.max(turn / rotary).max(shift.max_element() / mass);
            }
        }
        largest
    }
}
