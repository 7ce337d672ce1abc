//! Packs of rods in motion: conversion of the leaf to the arrays of the explicit method, and back.

use crate::leaf::{DiscreteLeaf, NodeFreedom, State};
use crate::motion::Velocity;
use crate::motion::explicit::joints::JointedBase;
use crate::motion::explicit::kernel::{PackMotion, StepTotals, StrainHistory, WatchedNode};
use crate::motion::explicit::layout::{
    AlignedArray, BlockMaterial, NODES_PER_BLOCK, NodeData, PackLayout, PackPosition,
    material_blocks, vector_at,
};
use crate::motion::moving_supports::MovingSupports;
use crate::motion::physics::Physics;
use crate::rotation::align_quaternion_sign;
use glam::{BVec3, DQuat, DVec3};
use std::sync::Arc;

/// The arrays of a pack of rods, except its positions, which its neighbors read.
#[derive(Clone, Debug)]
pub struct Pack {
    pub motion: PackMotion,
    pub material: Vec<Arc<BlockMaterial>>,
    pub past: StrainHistory,
    /// Sums of the last step.
    pub totals: StepTotals,
    /// Nodes whose supports move.
    pub watched: Vec<WatchedNode>,
    /// Bases on hinges that hold their spin.
    pub joints: Vec<JointedBase>,
}

/// Rotation and angular momentum of a node.
#[derive(Clone, Copy, Default)]
pub struct NodeSpin {
    pub rotation: DQuat,
    pub angular_momentum: DVec3,
}

impl Pack {
    /// The mass of a node.
    pub fn mass(&self, entry: usize) -> f64 {
        self.material[entry / NODES_PER_BLOCK].mass[entry % NODES_PER_BLOCK]
    }
}

/// A node that a grip holds along some lab axes and lets slide along the others.
#[derive(Clone, Copy, Debug)]
pub struct SlidingNode {
    /// Number of the support among those that move, if it does.
    pub support: Option<usize>,
    pub place: PackPosition,
    /// Its number among the positions.
    pub node: usize,
    pub held_axes: BVec3,
    /// Where it is held.
    pub position: DVec3,
    /// The velocity of its support in the last step.
    pub velocity: DVec3,
}

/// The nodes of a leaf that slide, some on supports that move.
pub fn sliding_nodes(
    leaf: &DiscreteLeaf,
    state: &State,
    layout: PackLayout,
    supports: &Option<MovingSupports>,
) -> Vec<SlidingNode> {
    let support = |j: usize, i: usize| {
        let mut moving = supports.iter().flat_map(|it| &it.nodes);
        moving.position(|it| (it.rod, it.node) == (j, i))
    };
    let node = |(j, i): (usize, usize)| {
        let held_axes = !leaf.node_freedom(j, i).displacement;
        (held_axes.any() && !held_axes.all()).then(|| SlidingNode {
            support: support(j, i),
            velocity: DVec3::ZERO,
            place: layout.pack_position(j, i),
            node: layout.node_index(j, i),
            held_axes,
            position: state.x[state.base(j) + i],
        })
    };
    leaf.rod_index_pairs(1..=leaf.segments())
        .filter_map(node)
        .collect()
}

fn arrays<const K: usize>(length: usize) -> [AlignedArray; K] {
    std::array::from_fn(|_| AlignedArray::zeros(length))
}

/// How the rods of a leaf are laid out.
pub fn layout(leaf: &DiscreteLeaf) -> PackLayout {
    let coupling = |gap| leaf.leaf.coupling(gap);
    let alike = (1..leaf.rods() - 1).all(|gap| coupling(gap) == coupling(gap - 1));
    PackLayout::new(leaf.rods(), leaf.segments(), alike)
}

/// The positions of all nodes.
pub fn positions(leaf: &DiscreteLeaf, state: &State, layout: PackLayout) -> [AlignedArray; 3] {
    let mut x = arrays::<3>(layout.leaf_array_length());
    for (j, i) in leaf.rod_index_pairs(0..=leaf.segments()) {
        for c in 0..3 {
            x[c][layout.node_index(j, i)] = state.x[state.base(j) + i][c];
        }
    }
    x
}

/// The packs of a leaf at rest.
pub fn packs_at_rest(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    layout: PackLayout,
) -> Vec<Pack> {
    let node = |j, i| node_data(leaf, physics, j, i);
    let joint = |j: usize| {
        Some(JointedBase {
            entry: layout.pack_position(j, 0).entry,
            joint: leaf.leaf.base_joint(j)?,
            inertia: physics.inertia(leaf, j, 0),
            before: DVec3::ZERO,
        })
    };
    let materials = materials(layout, node).into_iter().enumerate();
    let packs = materials.map(|(p, material)| {
        let length = layout.pack_array_length();
        let remembered = if physics.retardation > 0.0 { length } else { 0 };
        let past = || [arrays::<3>(remembered), arrays::<3>(remembered)];
        let mut motion = PackMotion {
            q: arrays(length),
            v: arrays(length),
            p: arrays(length),
        };
        motion.q[3].fill(1.0);
        for j in layout.pack_rods(p) {
            let mut last = DQuat::IDENTITY;
            for i in 0..=leaf.segments() {
                let q = state.q[state.base(j) + i];
                // Signs of neighboring quaternions are aligned once, and remain so.
                let flipped = i > 0 && last.dot(q) < 0.0;
                last = if flipped { -q } else { q };
                let at = layout.pack_position(j, i).entry;
                for (array, value) in motion.q.iter_mut().zip(last.to_array()) {
                    array[at] = value;
                }
            }
        }
        Pack {
            motion,
            material,
            past: StrainHistory {
                last: past(),
                earlier: past(),
            },
            totals: StepTotals::default(),
            watched: Vec::new(),
            joints: layout.pack_rods(p).filter_map(joint).collect(),
        }
    });
    packs.collect()
}

/// The nodes of all packs in blocks; blocks that packs have in common are shared.
pub fn materials(
    layout: PackLayout,
    node: impl Fn(usize, usize) -> NodeData,
) -> Vec<Vec<Arc<BlockMaterial>>> {
    let mut packs: Vec<Vec<Arc<BlockMaterial>>> = Vec::with_capacity(layout.packs());
    for p in 0..layout.packs() {
        let mut nodes = vec![NodeData::default(); layout.pack_entries()];
        for j in layout.pack_rods(p) {
            for i in 0..=layout.segments {
                nodes[layout.pack_position(j, i).entry] = node(j, i);
            }
        }
        let blocks = material_blocks(&nodes, packs.last().map(|pack| &**pack));
        packs.push(blocks);
    }
    packs
}

/// Properties of node `i` of rod `j`, and of the segment after it.
pub fn node_data(leaf: &DiscreteLeaf, physics: &Physics, j: usize, i: usize) -> NodeData {
    let n = leaf.segments();
    let joined = leaf.tips_move_together();
    let mut node = NodeData {
        load_length: leaf.grid.node_weight(i) * leaf.leaf.length(j),
        ..NodeData::default()
    };
    let free = match i == 0 && !physics.clamped() {
        true => NodeFreedom::FREE,
        false => leaf.node_freedom(j, i),
    };
    if !free.is_fixed() {
        let inertia = physics.inertia(leaf, j, i);
        // Bases on hinges that hold the spin are turned by themselves.
        if free.rotation && !(i == 0 && leaf.leaf.holds_base_spin(j)) {
            node.inverse_inertia = inertia.principal.recip().to_array();
        }
        if free.displacement.any() && (i < n || !joined) {
            node.mass = inertia.mass;
            node.inverse_mass = 1.0 / inertia.mass;
            let neighbours = [j > 0, j + 1 < leaf.rods()];
            node.coupling_weights =
                neighbours.map(|there| if there { leaf.grid.node_weight(i) } else { 0.0 });
        }
    }
    if i < n {
        let section = leaf.section(j, i);
        // A time-dependent factor is applied in each step.
        let rest = physics.constant_rest_factor.unwrap_or(1.0);
        for c in 0..3 {
            node.rest_length[c] = section.rest_strain[c] * section.ds;
            node.stretch_stiffness[c] = 1.0 / (section.compliance[c] * section.ds);
            node.bending_stiffness[c] = section.couple_stiffness[c] / section.ds;
            node.rest_turn[c] = rest * section.rest_curvature[c] * section.ds;
        }
    }
    node
}

/// Velocity and angular momentum of a node.
#[derive(Clone, Copy, Debug)]
pub struct NodeMomentum {
    pub velocity: DVec3,
    /// Angular momentum along the lab axes.
    pub angular: DVec3,
}

/// Where the material of a node is.
#[derive(Clone, Copy)]
pub struct NodeMaterial<'a> {
    pub block: &'a BlockMaterial,
    /// Index in the arrays of the block.
    pub node: usize,
}

impl Pack {
    /// The material of the node at an index in the arrays.
    pub fn node_material(&self, at: usize) -> NodeMaterial<'_> {
        let length = self.material[0].mass.len();
        NodeMaterial {
            block: &self.material[at / length],
            node: at % length,
        }
    }

    /// Whether a node moves by the forces on it alone: it is not held, and is no shared tip.
    pub fn moves_freely(&self, at: usize) -> bool {
        let NodeMaterial { block, node } = self.node_material(at);
        block.inverse_mass[node] > 0.0
    }

    /// Adds a mass to a node, unless it is held.
    pub fn add_mass(&mut self, at: usize, mass: f64) {
        if self.moves_freely(at) {
            let length = self.material[0].mass.len();
            let block = Arc::make_mut(&mut self.material[at / length]);
            block.mass[at % length] += mass;
            block.inverse_mass[at % length] = block.mass[at % length].recip();
        }
    }

    /// Length of rod whose loads act on a node.
    pub fn load_length(&self, at: usize) -> f64 {
        let NodeMaterial { block, node } = self.node_material(at);
        block.load_length[node]
    }

    /// Angular velocity of a node with rotation `q` and angular momentum `p`.
    pub fn angular_velocity(&self, at: usize, q: DQuat, p: DVec3) -> DVec3 {
        if let Some(base) = self.joints.iter().find(|base| base.entry == at) {
            return base.angular_velocity(q, p);
        }
        let NodeMaterial { block, node } = self.node_material(at);
        let about = |axis: DVec3, excess: f64| axis * (axis.dot(p) * excess);
        let isotropic = p * block.inverse_inertia[node];
        match block.spins_about_d1 {
            true => isotropic + about(q * DVec3::X, block.inverse_spin_excess[0][node]),
            false => {
                let [excess_2, excess_3] = &block.inverse_spin_excess;
                let transverse = about(q * DVec3::Y, excess_2[node]);
                isotropic + transverse + about(q * DVec3::Z, excess_3[node])
            }
        }
    }

    /// Notes the angular momenta of bases on hinges that hold the spin, before a kick.
    pub fn begin_joint_step(&mut self) {
        for base in &mut self.joints {
            base.before = vector_at(&self.motion.p, base.entry);
        }
    }

    /// Turns the bases on hinges that hold the spin for the time `drift` after a kick; returns twice the kinetic energy
    /// that they had in its middle, at the mean of their angular momenta before and after it.
    pub fn turn_joints(&mut self, drift: f64) -> f64 {
        let mut energy = 0.0;
        for k in 0..self.joints.len() {
            let base = &self.joints[k];
            let at = base.entry;
            let (q, after) = (self.quaternion(at), vector_at(&self.motion.p, at));
            let mean = 0.5 * (base.before + after);
            energy += mean.dot(base.angular_velocity(q.normalize(), mean));
            let (turned, momentum) = base.turned(q, after, drift);
            let turned = align_quaternion_sign(turned, q);
            for (array, value) in self.motion.q.iter_mut().zip(turned.to_array()) {
                array[at] = value;
            }
            for (array, value) in self.motion.p.iter_mut().zip(momentum.to_array()) {
                array[at] = value;
            }
        }
        energy
    }

    /// The quaternion of a node, normalized at intervals only.
    pub fn quaternion(&self, at: usize) -> DQuat {
        DQuat::from_array([0, 1, 2, 3].map(|c| self.motion.q[c][at]))
    }

    /// The rotation of a node.
    pub fn rotation(&self, at: usize) -> DQuat {
        self.quaternion(at).normalize()
    }

    /// Velocity and angular momentum of a node.
    pub fn momentum(&self, at: usize) -> NodeMomentum {
        NodeMomentum {
            velocity: vector_at(&self.motion.v, at),
            angular: vector_at(&self.motion.p, at),
        }
    }

    /// Linear and angular velocity of a node.
    pub fn velocity(&self, at: usize) -> Velocity {
        let momentum = self.momentum(at);
        Velocity {
            angular: self.angular_velocity(at, self.rotation(at), momentum.angular),
            linear: momentum.velocity,
        }
    }
}
