//! Springs between nodes and the places, or the directions, in which supports that give hold them.
//!
//! A spring of the stiffness k along the lab axes, and c against rotations, whose node is displaced by d
//! and has turned by the rotation vector theta has the energy (d . k d + c theta^2)/2.

use crate::rotation;
use glam::{DMat3, DQuat, DVec3};

/// A spring between a node and its support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NodeSpring {
    pub rod: usize,
    pub node: usize,
    /// The grip that the spring is a part of, if any.
    pub grip: Option<usize>,
    /// Where the spring has no force.
    pub position: DVec3,
    /// Force per displacement along the lab axes.
    pub stiffness: DVec3,
    /// The rotation in which the spring has no moment.
    pub rotation: DQuat,
    /// Moment per radian.
    pub turn_stiffness: f64,
}

impl NodeSpring {
    /// The rotation vector, along the lab axes, from the natural direction to `q`.
    fn turn(&self, q: DQuat) -> DVec3 {
        rotation::log(q * self.rotation.conjugate())
    }

    /// The force of the spring on its node at `x`.
    pub fn force(&self, x: DVec3) -> DVec3 {
        self.stiffness * (self.position - x)
    }

    /// The moment of the spring on its node with the rotation `q`.
    pub fn moment(&self, q: DQuat) -> DVec3 {
        match self.turn_stiffness == 0.0 {
            true => DVec3::ZERO,
            false => -self.turn_stiffness * self.turn(q),
        }
    }

    /// The energy of the spring whose node is at `x` with the rotation `q`.
    pub fn energy(&self, x: DVec3, q: DQuat) -> f64 {
        let displacement = x - self.position;
        let energy = 0.5 * displacement.dot(self.stiffness * displacement);
        match self.turn_stiffness == 0.0 {
            true => energy,
            false => energy + 0.5 * self.turn_stiffness * self.turn(q).length_squared(),
        }
    }

    /// The second derivatives of the energy by the rotation of the node: the symmetric part of those of
    /// the moment.
    pub fn rotation_stiffness(&self, q: DQuat) -> DMat3 {
        if self.turn_stiffness == 0.0 {
            return DMat3::ZERO;
        }
        let rate = rotation::log_rate(self.turn(q));
        0.5 * self.turn_stiffness * (rate + rate.transpose())
    }
}

/// Where a spring of a grip has neither force nor moment.
#[derive(Clone, Copy, Debug)]
pub struct SpringEnd {
    pub position: DVec3,
    pub rotation: DQuat,
}

/// The springs of a leaf, in the order of its nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct NodeSprings {
    springs: Vec<NodeSpring>,
    /// For every node, rod after rod, the number of springs on the nodes before it, and at the end that of
    /// all; empty without springs.
    before: Vec<usize>,
}

impl NodeSprings {
    /// The springs of a leaf with so many rods, and nodes on each of them.
    pub fn new(mut springs: Vec<NodeSpring>, rods: usize, nodes: usize) -> Self {
        if springs.is_empty() {
            return NodeSprings::default();
        }
        springs.sort_by_key(|spring| (spring.rod, spring.node));
        let mut before = vec![0; rods * nodes + 1];
        for spring in &springs {
            before[spring.rod * nodes + spring.node + 1] += 1;
        }
        for k in 1..before.len() {
            before[k] += before[k - 1];
        }
        NodeSprings { springs, before }
    }

    pub fn is_empty(&self) -> bool {
        self.springs.is_empty()
    }

    pub fn iter(&self) -> impl Iterator<Item = &NodeSpring> {
        self.springs.iter()
    }

    /// The springs of node `k`, rod after rod, to change them.
    pub fn on_node_mut(&mut self, k: usize) -> &mut [NodeSpring] {
        match self.before.get(k..k + 2) {
            Some(range) => &mut self.springs[range[0]..range[1]],
            None => &mut [],
        }
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut NodeSpring> {
        self.springs.iter_mut()
    }

    /// The springs of node `k`, rod after rod.
    pub fn on_node(&self, k: usize) -> &[NodeSpring] {
        match self.before.get(k..k + 2) {
            Some(range) => &self.springs[range[0]..range[1]],
            None => &[],
        }
    }
}
