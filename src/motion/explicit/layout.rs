//! Where the numbers of a leaf lie: arrays aligned to cache lines, rods in packs and nodes in arrays,
//! and the material of nodes and segments in blocks, for the loops over them.

use crate::simd::MAX_LANES;
use glam::DVec3;
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Nodes of a block. Measured: with half as many, steps of short rods take 1.05 times as long,
/// due to the beginnings and ends of the loops; more gain nothing.
pub const NODES_PER_BLOCK: usize = 224;

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
    /// The layout of rods of so many segments; `alike` tells whether all neighbors are coupled in the
    /// same way, as in a pack they must be.
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

    pub fn packs(&self) -> usize {
        self.rods.div_ceil(self.rods_per_pack)
    }

    /// Rods of pack `p`.
    pub fn pack_rods(&self, p: usize) -> Range<usize> {
        p * self.rods_per_pack..((p + 1) * self.rods_per_pack).min(self.rods)
    }

    /// Entries of a full pack.
    pub fn pack_entries(&self) -> usize {
        self.rods_per_pack * self.stride
    }

    /// Where node `i` of rod `j` is among the packs.
    pub fn pack_position(&self, j: usize, i: usize) -> PackPosition {
        PackPosition {
            pack: j / self.rods_per_pack,
            entry: j % self.rods_per_pack * self.stride + i,
        }
    }

    /// Index of node `i` of rod `j` in arrays of the whole leaf.
    pub fn node_index(&self, j: usize, i: usize) -> usize {
        self.front_padding() + j * self.stride + i
    }

    /// Entries before the first node: the first rod reads those of a neighbor there.
    pub fn front_padding(&self) -> usize {
        self.stride.next_multiple_of(MAX_LANES)
    }

    /// Length of arrays of the whole leaf: loops read up to a node beyond.
    pub fn leaf_array_length(&self) -> usize {
        self.front_padding() + self.packs() * self.pack_entries() + self.pack_array_length()
    }

    /// Length of arrays of a pack: loops read up to a node beyond.
    pub fn pack_array_length(&self) -> usize {
        self.pack_entries() + MAX_LANES
    }
}

/// Place of a node in the arrays of the packs.
#[derive(Clone, Copy, Debug)]
pub struct PackPosition {
    /// Number of the pack.
    pub pack: usize,
    /// Index in the arrays of this pack.
    pub entry: usize,
}

/// The vector of a node in three arrays.
pub fn vector_at(arrays: &[AlignedArray; 3], at: usize) -> DVec3 {
    DVec3::new(arrays[0][at], arrays[1][at], arrays[2][at])
}

/// A node, and the segment from it to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeData {
    /// H/ds.
    pub stretch_stiffness: [f64; 3],
    /// ds v0.
    pub rest_length: [f64; 3],
    /// A/ds.
    pub bending_stiffness: [f64; 3],
    /// ds u0, times its factor if that is constant.
    pub rest_turn: [f64; 3],
    /// Mass; zero for a held node and for a shared tip.
    pub mass: f64,
    /// 1/mass; zero for a held node, and for a shared tip.
    pub inverse_mass: f64,
    /// 1/J1, 1/J2 and 1/J3 of a node; zero for a held node.
    pub inverse_inertia: [f64; 3],
    /// Length of rod whose loads act on the node.
    pub load_length: f64,
    /// Fraction of the length whose coupling to the rods before and after acts on the node.
    pub coupling_weights: [f64; 2],
}

/// The nodes of a block, one array for each number of a [`NodeData`], and derived
/// quantities.
#[derive(Clone, Debug, PartialEq)]
#[repr(align(64))]
pub struct BlockMaterial {
    /// Whether all segments are as stiff along d3 as along d2, and straight at rest.
    pub round: bool,
    /// H2/ds, and the excess of H1/ds and H3/ds over it.
    pub shear: [f64; NODES_PER_BLOCK],
    pub stretch_excess: [[f64; NODES_PER_BLOCK]; 2],
    /// H v0: minus the force where the segment has no length.
    pub rest_force: [[f64; NODES_PER_BLOCK]; 3],
    /// A2/ds, and the excess of A1/ds and A3/ds over it.
    pub bending_stiffness: [f64; NODES_PER_BLOCK],
    pub bend_excess: [[f64; NODES_PER_BLOCK]; 2],
    pub rest_turn: [[f64; NODES_PER_BLOCK]; 3],
    /// A u0: minus the moment where the segment is straight.
    pub rest_moment: [[f64; NODES_PER_BLOCK]; 3],
    pub mass: [f64; NODES_PER_BLOCK],
    pub inverse_mass: [f64; NODES_PER_BLOCK],
    /// Whether all nodes have the same inertia about d2 and d3: besides their rotation about the angular momentum they
    /// spin about d1 alone.
    pub spins_about_d1: bool,
    /// 1/J2 if they do, else 1/J1, the least one of plane sections: no part of a rotation is then larger than the whole.
    pub inverse_inertia: [f64; NODES_PER_BLOCK],
    /// The excess over that of 1/J1, and zero; else that of 1/J2 and of 1/J3.
    pub inverse_spin_excess: [[f64; NODES_PER_BLOCK]; 2],
    pub load_length: [f64; NODES_PER_BLOCK],
    pub coupling_weights: [[f64; NODES_PER_BLOCK]; 2],
}

impl BlockMaterial {
    fn new(nodes: &[NodeData]) -> Self {
        let gather = |number: &dyn Fn(&NodeData) -> f64| {
            let mut array = [0.0; NODES_PER_BLOCK];
            for (slot, node) in array.iter_mut().zip(nodes) {
                *slot = number(node);
            }
            array
        };
        let round = |node: &NodeData| {
            let [_, bend_2, bend_3] = node.bending_stiffness;
            let [_, shear_2, shear_3] = node.stretch_stiffness;
            let straight = [&node.rest_turn, &node.rest_length].map(|rest| rest[1..] == [0.0, 0.0]);
            bend_2 == bend_3 && shear_2 == shear_3 && straight == [true; 2]
        };
        let spins_about_d1 = { nodes.iter() }.all(|node| {
            let [_, about_2, about_3] = node.inverse_inertia;
            about_2 == about_3
        });
        let (base, spins) = match spins_about_d1 {
            true => (1, [0, 1]),
            false => (0, [1, 2]),
        };
        BlockMaterial {
            round: nodes.iter().all(round),
            spins_about_d1,
            shear: gather(&|node| node.stretch_stiffness[1]),
            stretch_excess: [0, 2]
                .map(|c| gather(&|node| node.stretch_stiffness[c] - node.stretch_stiffness[1])),
            rest_force: [0, 1, 2]
                .map(|c| gather(&|node| node.stretch_stiffness[c] * node.rest_length[c])),
            bending_stiffness: gather(&|node| node.bending_stiffness[1]),
            bend_excess: [0, 2]
                .map(|c| gather(&|node| node.bending_stiffness[c] - node.bending_stiffness[1])),
            rest_turn: [0, 1, 2].map(|c| gather(&|node| node.rest_turn[c])),
            rest_moment: [0, 1, 2]
                .map(|c| gather(&|node| node.bending_stiffness[c] * node.rest_turn[c])),
            mass: gather(&|node| node.mass),
            inverse_mass: gather(&|node| node.inverse_mass),
            inverse_inertia: gather(&|node| node.inverse_inertia[base]),
            inverse_spin_excess: spins.map(|axis| {
                gather(&|node| node.inverse_inertia[axis] - node.inverse_inertia[base])
            }),
            load_length: gather(&|node| node.load_length),
            coupling_weights: [0, 1].map(|side| gather(&|node| node.coupling_weights[side])),
        }
    }
}

/// The nodes of a pack in blocks. Blocks that equal the previous one, or the one
/// at the same position in the pack before, are shared: they stay in the innermost
/// cache, and most leaves have few that differ.
pub fn material_blocks(
    nodes: &[NodeData],
    before: Option<&[Arc<BlockMaterial>]>,
) -> Vec<Arc<BlockMaterial>> {
    let mut blocks: Vec<Arc<BlockMaterial>> =
        Vec::with_capacity(nodes.len().div_ceil(NODES_PER_BLOCK));
    for nodes in nodes.chunks(NODES_PER_BLOCK) {
        let material = BlockMaterial::new(nodes);
        let above = before.and_then(|pack| pack.get(blocks.len()));
        let near = [blocks.last(), above].into_iter().flatten();
        let same = { near }.find(|other| ***other == material).cloned();
        blocks.push(same.unwrap_or_else(|| Arc::new(material)));
    }
    blocks
}
