//! Arrays aligned to cache lines.
//!
//! Where the nodes of a leaf lie in arrays.
//!
//! Conversion of the leaf to the arrays of the explicit method, and back.

use crate::leaf::{DiscreteLeaf, NodeFreedom, State};
use crate::motion::Velocity;
use crate::motion::explicit::kernel::{
    BlockMaterial, NODES_PER_BLOCK, NodeData, PackMotion, StepTotals, StrainHistory,
    material_blocks,
};
use crate::motion::physics::Physics;
use crate::simd::MAX_LANES;
use glam::{DQuat, DVec3};
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Numbers in a cache line.
const NUMBERS_PER_CACHE_LINE: usize = 8;

/// An array of fixed length aligned to a cache line, so that
/// no group of nodes lies in two. Measured: otherwise steps of long rods take 1.1
/// times as long.
#[derive(Debug)]
pub struct AlignedArray {
    storage: Vec<f64>,
    aligned_range: Range<usize>,
}

impl AlignedArray {
    pub fn zeros(length: usize) -> Self {
        let room = vec![0.0; length + NUMBERS_PER_CACHE_LINE];
        let first = room
            .as_ptr()
            .align_offset(NUMBERS_PER_CACHE_LINE * size_of::<f64>());
        // The offset may be unknown; then it is only slower.
        let first = first.min(NUMBERS_PER_CACHE_LINE);
        AlignedArray {
            storage: room,
            aligned_range: first..first + length,
        }
    }
}

impl Clone for AlignedArray {
    fn clone(&self) -> Self {
        let mut copy = AlignedArray::zeros(self.len());
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for AlignedArray {
    type Target = [f64];
    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.storage[self.aligned_range.clone()]
    }
}

impl DerefMut for AlignedArray {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.storage[self.aligned_range.clone()]
    }
}

impl AsRef<[f64]> for AlignedArray {
    #[inline(always)]
    fn as_ref(&self) -> &[f64] {
        self
    }
}

impl AsMut<[f64]> for AlignedArray {
    #[inline(always)]
    fn as_mut(&mut self) -> &mut [f64] {
        self
    }
}

/// Rods lie end to end. Short ones are processed several at a time, as a pack: the segments
/// from one to the next have no stiffness. Measured: leaves of 35 rods of 50 segments take 0.9
/// times as long as rod by rod.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackLayout {
    pub rods: usize,
    pub segments: usize,
    /// Entries from a rod to the next: at least one is not a node.
    pub stride: usize,
    /// Rods of a pack; the last pack may have fewer.
    pub rods_per_pack: usize,
}

impl PackLayout {
    /// `alike`: whether all neighbors are coupled in the same way, as in a pack they must be.
    pub fn new(rods: usize, segments: usize, alike: bool) -> Self {
        let stride = (segments + 2).next_multiple_of(MAX_LANES / 2);
        // An even number, so that packs begin at multiples of the width.
        let pack = NODES_PER_BLOCK / (2 * stride) * 2;
        let (stride, pack) = match alike && rods > 1 && pack > 0 {
            true => (stride, pack),
            false => ((segments + 2).next_multiple_of(MAX_LANES), 1),
        };
        PackLayout {
            rods,
            segments,
            stride,
            rods_per_pack: pack,
        }
    }

    /// Number of packs.
    pub fn packs(&self) -> usize {
        self.rods.div_ceil(self.rods_per_pack)
    }

    /// Rods of pack `p`.
    pub fn pack_rods(&self, p: usize) -> std::ops::Range<usize> {
        p * self.rods_per_pack..((p + 1) * self.rods_per_pack).min(self.rods)
    }

    /// Entries of a full pack.
    pub fn pack_entries(&self) -> usize {
        self.rods_per_pack * self.stride
    }

    /// The pack of node `i` of rod `j`, and its index there.
    pub fn pack_position(&self, j: usize, i: usize) -> (usize, usize) {
        (
            j / self.rods_per_pack,
            j % self.rods_per_pack * self.stride + i,
        )
    }

    /// Index of node `i` of rod `j` in arrays of the whole leaf.
    pub fn node_index(&self, j: usize, i: usize) -> usize {
        self.front_padding() + j * self.stride + i
    }

    /// Entries before the first node: the first rod reads those of a neighbor there.
    pub fn front_padding(&self) -> usize {
        self.stride.next_multiple_of(MAX_LANES)
    }

    /// Length of arrays of the whole leaf, and of a pack: loops read up to a node beyond.
    pub fn array_lengths(&self) -> [usize; 2] {
        let pack = self.pack_entries() + MAX_LANES;
        [
            self.front_padding() + self.packs() * self.pack_entries() + pack,
            pack,
        ]
    }
}

/// The arrays of a pack of rods, except its positions, which its neighbors read.
#[derive(Clone, Debug)]
pub struct Pack {
    pub motion: PackMotion,
    pub material: Vec<Arc<BlockMaterial>>,
    pub past: StrainHistory,
    /// Sums of the last step.
    pub totals: StepTotals,
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
    let mut x = arrays::<3>(layout.array_lengths()[0]);
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
    let materials = materials(layout, node).into_iter().enumerate();
    let packs = materials.map(|(p, material)| {
        let length = layout.array_lengths()[1];
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
                let at = layout.pack_position(j, i).1;
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
        }
    });
    packs.collect()
}

/// The nodes of all packs in blocks; those that packs have in common are shared.
pub fn materials(
    layout: PackLayout,
    node: impl Fn(usize, usize) -> NodeData,
) -> Vec<Vec<Arc<BlockMaterial>>> {
    let mut packs: Vec<Vec<Arc<BlockMaterial>>> = Vec::with_capacity(layout.packs());
    for p in 0..layout.packs() {
        let mut nodes = vec![NodeData::default(); layout.pack_entries()];
        for j in layout.pack_rods(p) {
            for i in 0..=layout.segments {
                nodes[layout.pack_position(j, i).1] = node(j, i);
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
        if free.rotation {
            node.inverse_inertia = 1.0 / inertia.transverse;
            node.inverse_spin_excess = 1.0 / inertia.polar() - 1.0 / inertia.transverse;
        }
        if free.displacement && (i < n || !joined) {
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

impl Pack {
    /// The block of a node, and its index there, by its index in the arrays.
    pub fn node_material(&self, at: usize) -> (&BlockMaterial, usize) {
        let length = self.material[0].mass.len();
        (&self.material[at / length], at % length)
    }

    /// Length of rod whose loads act on a node.
    pub fn load_length(&self, at: usize) -> f64 {
        let (material, i) = self.node_material(at);
        material.load_length[i]
    }

    /// Angular velocity of a node with rotation `q` and angular momentum `p`.
    pub fn angular_velocity(&self, at: usize, q: DQuat, p: DVec3) -> DVec3 {
        let d1 = q * DVec3::X;
        let (material, i) = self.node_material(at);
        p * material.inverse_inertia[i] + d1 * (d1.dot(p) * material.inverse_spin_excess[i])
    }

    /// The quaternion of a node, normalized at intervals only.
    pub fn quaternion(&self, at: usize) -> DQuat {
        DQuat::from_array([0, 1, 2, 3].map(|c| self.motion.q[c][at]))
    }

    pub fn rotation(&self, at: usize) -> DQuat {
        self.quaternion(at).normalize()
    }

    /// Velocity and angular momentum of a node.
    pub fn moving(&self, at: usize) -> (DVec3, DVec3) {
        (vector_at(&self.motion.v, at), vector_at(&self.motion.p, at))
    }

    /// Linear and angular velocity of a node.
    pub fn velocity(&self, at: usize) -> Velocity {
        let (linear, p) = self.moving(at);
        let angular = self.angular_velocity(at, self.rotation(at), p);
        Velocity { angular, linear }
    }
}

pub fn vector_at(arrays: &[AlignedArray; 3], at: usize) -> DVec3 {
    DVec3::new(arrays[0][at], arrays[1][at], arrays[2][at])
}
