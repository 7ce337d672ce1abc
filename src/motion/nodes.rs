//! Conversion of the leaf to the arrays of the explicit method, and back.

use super::kernel::{
    Array, BLOCK, GROUP, Material, Motion, Node, Past, Positions, StepTotals, blocks,
};
use super::method::Velocity;
use super::physics::Physics;
use crate::leaf::{DiscreteLeaf, State};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// One rod's arrays except its positions, which its neighbours read.
#[derive(Clone, Debug)]
pub struct Rod {
    pub motion: Motion,
    pub material: Vec<Arc<Material>>,
    pub past: Past,
    /// Sums of the last step.
    pub totals: StepTotals,
}

fn arrays<const K: usize>(length: usize) -> [Array; K] {
    std::array::from_fn(|_| Array::zeros(length))
}

fn length(segments: usize) -> usize {
    (segments + 1).next_multiple_of(GROUP) + 2 * GROUP
}

pub fn positions(leaf: &DiscreteLeaf, state: &State, j: usize) -> Positions {
    let n = leaf.segments();
    let mut x = arrays::<3>(length(n));
    for i in 0..=n {
        for c in 0..3 {
            x[c][GROUP + i] = state.x[state.base(j) + i][c];
        }
    }
    Positions { x }
}

/// A rod at rest; blocks that it has in common with the rod `neighbour` are shared.
pub fn rod(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    j: usize,
    neighbour: Option<&Rod>,
) -> Rod {
    let n = leaf.segments();
    let length = length(n);
    let mut motion = Motion {
        q: arrays(length),
        v: arrays(length),
        p: arrays(length),
    };
    motion.q[3].fill(1.0);
    let mut last = DQuat::IDENTITY;
    for i in 0..=n {
        let q = state.q[state.base(j) + i];
        // Signs of neighbouring quaternions are aligned once, and remain so.
        let flipped = i > 0 && last.dot(q) < 0.0;
        last = if flipped { -q } else { q };
        for (array, value) in motion.q.iter_mut().zip(last.to_array()) {
            array[GROUP + i] = value;
        }
    }
    let data: Vec<_> = (0..=n).map(|i| node_data(leaf, physics, j, i)).collect();
    let remembered = if physics.retardation > 0.0 { length } else { 0 };
    let past = || [arrays::<3>(remembered), arrays::<3>(remembered)];
    let (one, two) = (past(), past());
    let mut rod = Rod {
        motion,
        material: blocks(&data, neighbour.map(|rod| &*rod.material)),
        past: Past { one, two },
        totals: StepTotals::default(),
    };
    rod.pad(n);
    rod
}

/// Properties of node `i` of rod `j`, and of the segment after it.
pub fn node_data(leaf: &DiscreteLeaf, physics: &Physics, j: usize, i: usize) -> Node {
    let n = leaf.segments();
    let joined = leaf.tips_move_together();
    let mut node = Node {
        weight: leaf.grid.weight(i) * leaf.leaf.length(j),
        ..Node::default()
    };
    if i > 0 || !physics.clamped() {
        let inertia = physics.inertia(leaf, j, i);
        let [turns, shifts] = leaf.moves(i);
        if turns {
            node.per_inertia = 1.0 / inertia.transverse;
            node.per_spin = 1.0 / inertia.polar() - 1.0 / inertia.transverse;
        }
        if shifts && (i < n || !joined) {
            node.mass = inertia.mass;
            node.per_mass = 1.0 / inertia.mass;
            node.coupled = leaf.grid.weight(i);
        }
    }
    if i < n {
        let section = leaf.section(j, i);
        // A time-dependent factor is applied in each step.
        let rest = physics.constant_rest.unwrap_or(1.0);
        node.rest_length = section.rest_strain.x * section.ds;
        for c in 0..3 {
            node.stretch[c] = 1.0 / (section.compliance[c] * section.ds);
            node.bend[c] = section.couple_stiffness[c] / section.ds;
            node.rest_turn[c] = rest * section.rest_curvature[c] * section.ds;
        }
    }
    node
}

impl Rod {
    /// The block of a node, and its index there, by its index in the arrays.
    pub fn block(&self, at: usize) -> (&Material, usize) {
        let i = at - GROUP;
        (&self.material[i / BLOCK], i % BLOCK)
    }

    /// Length of rod whose loads act on a node.
    pub fn weight(&self, at: usize) -> f64 {
        let (material, i) = self.block(at);
        material.weight[i]
    }

    /// Sets the entries after the last node, up to the end of its group and of the next, to its
    /// rotation: the segments read there, which have no stiffness, are then straight.
    pub fn pad(&mut self, segments: usize) {
        let last = GROUP + segments;
        for q in &mut self.motion.q {
            let value = q[last];
            q[last + 1..=(last + 1).next_multiple_of(GROUP)].fill(value);
        }
    }

    /// The arrays that determine the motion, without positions.
    pub fn moving_arrays(&self) -> impl Iterator<Item = &Array> {
        let Motion { q, v, p, .. } = &self.motion;
        let past = self.past.one.iter().chain(&self.past.two).flatten();
        q.iter().chain(v).chain(p).chain(past)
    }

    pub fn moving_arrays_mut(&mut self) -> impl Iterator<Item = &mut Array> {
        let Motion { q, v, p, .. } = &mut self.motion;
        let past = self.past.one.iter_mut().chain(&mut self.past.two).flatten();
        q.iter_mut().chain(v).chain(p).chain(past)
    }

    /// Angular velocity of a node with rotation `q` and angular momentum `p`.
    pub fn spin(&self, at: usize, q: DQuat, p: DVec3) -> DVec3 {
        let d1 = q * DVec3::X;
        let (material, i) = self.block(at);
        p * material.per_inertia[i] + d1 * (d1.dot(p) * material.per_spin[i])
    }

    pub fn rotation(&self, at: usize) -> DQuat {
        // They are normalised at intervals only.
        DQuat::from_array([0, 1, 2, 3].map(|c| self.motion.q[c][at])).normalize()
    }

    /// Velocity and angular momentum of a node.
    pub fn moving(&self, at: usize) -> (DVec3, DVec3) {
        (vector(&self.motion.v, at), vector(&self.motion.p, at))
    }

    pub fn velocities(&self, segments: usize) -> impl Iterator<Item = Velocity> + '_ {
        (GROUP..=GROUP + segments).map(move |at| {
            let (linear, p) = self.moving(at);
            let angular = self.spin(at, self.rotation(at), p);
            Velocity { angular, linear }
        })
    }
}

pub fn vector(arrays: &[Array; 3], at: usize) -> DVec3 {
    DVec3::new(arrays[0][at], arrays[1][at], arrays[2][at])
}
