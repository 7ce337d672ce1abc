//! Arrays aligned to cache lines.
//!
//! Where the nodes of a leaf lie in arrays.
//!
//! Conversion of the leaf to the arrays of the explicit method, and back.

use crate::leaf::{DiscreteLeaf, State};
use crate::motion::Velocity;
use crate::motion::explicit::kernel::{BLOCK, Material, Motion, Node, Past, StepTotals, blocks};
use crate::motion::physics::Physics;
use crate::simd::WIDTH;
use glam::{DQuat, DVec3};
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Numbers in a cache line.
const LINE: usize = 8;

/// An array of fixed length aligned to a cache line, so that
/// no group of nodes lies in two. Measured: otherwise steps of long rods take 1.1
/// times as long.
#[derive(Debug)]
pub struct Array {
    room: Vec<f64>,
    own: Range<usize>,
}

impl Array {
    pub fn zeros(length: usize) -> Self {
        let room = vec![0.0; length + LINE];
        let first = room.as_ptr().align_offset(LINE * size_of::<f64>());
        // The offset may be unknown; then it is only slower.
        let first = first.min(LINE);
        Array {
            room,
            own: first..first + length,
        }
    }
}

impl Clone for Array {
    fn clone(&self) -> Self {
        let mut copy = Array::zeros(self.len());
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for Array {
    type Target = [f64];
    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.room[self.own.clone()]
    }
}

impl DerefMut for Array {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.room[self.own.clone()]
    }
}

impl AsRef<[f64]> for Array {
    #[inline(always)]
    fn as_ref(&self) -> &[f64] {
        self
    }
}

impl AsMut<[f64]> for Array {
    #[inline(always)]
    fn as_mut(&mut self) -> &mut [f64] {
        self
    }
}

/// Rods lie end to end. Short ones are processed several at a time, as a pack: the segments
/// from one to the next have no stiffness. Measured: leaves of 35 rods of 50 segments take 0.9
/// times as long as rod by rod.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    pub rods: usize,
    pub segments: usize,
    /// Entries from a rod to the next: at least one is not a node.
    pub stride: usize,
    /// Rods of a pack; the last pack may have fewer.
    pub pack: usize,
}

impl Layout {
    /// `alike`: whether all neighbours are coupled in the same way, as in a pack they must be.
    pub fn new(rods: usize, segments: usize, alike: bool) -> Self {
        let stride = (segments + 2).next_multiple_of(WIDTH / 2);
        // An even number, so that packs begin at multiples of the width.
        let pack = BLOCK / (2 * stride) * 2;
        let (stride, pack) = match alike && rods > 1 && pack > 0 {
            true => (stride, pack),
            false => ((segments + 2).next_multiple_of(WIDTH), 1),
        };
        Layout {
            rods,
            segments,
            stride,
            pack,
        }
    }

    /// Number of packs.
    pub fn packs(&self) -> usize {
        self.rods.div_ceil(self.pack)
    }

    /// Rods of pack `p`.
    pub fn rods_of(&self, p: usize) -> std::ops::Range<usize> {
        p * self.pack..((p + 1) * self.pack).min(self.rods)
    }

    /// Entries of a full pack.
    pub fn entries(&self) -> usize {
        self.pack * self.stride
    }

    /// The pack of node `i` of rod `j`, and its index there.
    pub fn place(&self, j: usize, i: usize) -> (usize, usize) {
        (j / self.pack, j % self.pack * self.stride + i)
    }

    /// Index of node `i` of rod `j` in arrays of the whole leaf.
    pub fn at(&self, j: usize, i: usize) -> usize {
        self.front() + j * self.stride + i
    }

    /// Entries before the first node: the first rod reads those of a neighbour there.
    pub fn front(&self) -> usize {
        self.stride.next_multiple_of(WIDTH)
    }

    /// Length of arrays of the whole leaf, and of a pack: loops read up to a node beyond.
    pub fn lengths(&self) -> [usize; 2] {
        let pack = self.entries() + WIDTH;
        [self.front() + self.packs() * self.entries() + pack, pack]
    }
}

/// The arrays of a pack of rods, except its positions, which its neighbours read.
#[derive(Clone, Debug)]
pub struct Pack {
    pub motion: Motion,
    pub material: Vec<Arc<Material>>,
    pub past: Past,
    /// Sums of the last step.
    pub totals: StepTotals,
}

fn arrays<const K: usize>(length: usize) -> [Array; K] {
    std::array::from_fn(|_| Array::zeros(length))
}

/// How the rods of a leaf are laid out.
pub fn layout(leaf: &DiscreteLeaf) -> Layout {
    let coupling = |gap| leaf.leaf.coupling(gap);
    let alike = (1..leaf.rods() - 1).all(|gap| coupling(gap) == coupling(gap - 1));
    Layout::new(leaf.rods(), leaf.segments(), alike)
}

/// The positions of all nodes.
pub fn positions(leaf: &DiscreteLeaf, state: &State, layout: Layout) -> [Array; 3] {
    let mut x = arrays::<3>(layout.lengths()[0]);
    for (j, i) in leaf.each(0..=leaf.segments()) {
        for c in 0..3 {
            x[c][layout.at(j, i)] = state.x[state.base(j) + i][c];
        }
    }
    x
}

/// The packs of a leaf at rest.
pub fn at_rest(leaf: &DiscreteLeaf, physics: &Physics, state: &State, layout: Layout) -> Vec<Pack> {
    let node = |j, i| node_data(leaf, physics, j, i);
    let materials = materials(layout, node).into_iter().enumerate();
    let packs = materials.map(|(p, material)| {
        let length = layout.lengths()[1];
        let remembered = if physics.retardation > 0.0 { length } else { 0 };
        let past = || [arrays::<3>(remembered), arrays::<3>(remembered)];
        let mut motion = Motion {
            q: arrays(length),
            v: arrays(length),
            p: arrays(length),
        };
        motion.q[3].fill(1.0);
        for j in layout.rods_of(p) {
            let mut last = DQuat::IDENTITY;
            for i in 0..=leaf.segments() {
                let q = state.q[state.base(j) + i];
                // Signs of neighbouring quaternions are aligned once, and remain so.
                let flipped = i > 0 && last.dot(q) < 0.0;
                last = if flipped { -q } else { q };
                let at = layout.place(j, i).1;
                for (array, value) in motion.q.iter_mut().zip(last.to_array()) {
                    array[at] = value;
                }
            }
        }
        Pack {
            motion,
            material,
            past: Past {
                last: past(),
                earlier: past(),
            },
            totals: StepTotals::default(),
        }
    });
    packs.collect()
}

/// The nodes of all packs in blocks; those that packs have in common are shared.
pub fn materials(layout: Layout, node: impl Fn(usize, usize) -> Node) -> Vec<Vec<Arc<Material>>> {
    let mut packs: Vec<Vec<Arc<Material>>> = Vec::with_capacity(layout.packs());
    for p in 0..layout.packs() {
        let mut nodes = vec![Node::default(); layout.entries()];
        for j in layout.rods_of(p) {
            for i in 0..=layout.segments {
                nodes[layout.place(j, i).1] = node(j, i);
            }
        }
        let blocks = blocks(&nodes, packs.last().map(|pack| &**pack));
        packs.push(blocks);
    }
    packs
}

/// Properties of node `i` of rod `j`, and of the segment after it.
pub fn node_data(leaf: &DiscreteLeaf, physics: &Physics, j: usize, i: usize) -> Node {
    let n = leaf.segments();
    let joined = leaf.tips_move_together();
    let mut node = Node {
        weight: leaf.grid.weight(i) * leaf.leaf.length(j),
        ..Node::default()
    };
    let [turns, shifts] = match i == 0 && !physics.clamped() {
        true => [true; 2],
        false => leaf.moves(j, i),
    };
    if turns || shifts {
        let inertia = physics.inertia(leaf, j, i);
        if turns {
            node.per_inertia = 1.0 / inertia.transverse;
            node.per_spin = 1.0 / inertia.polar() - 1.0 / inertia.transverse;
        }
        if shifts && (i < n || !joined) {
            node.mass = inertia.mass;
            node.per_mass = 1.0 / inertia.mass;
            let neighbours = [j > 0, j + 1 < leaf.rods()];
            node.coupled = neighbours.map(|there| if there { leaf.grid.weight(i) } else { 0.0 });
        }
    }
    if i < n {
        let section = leaf.section(j, i);
        // A time-dependent factor is applied in each step.
        let rest = physics.constant_rest.unwrap_or(1.0);
        for c in 0..3 {
            node.rest_length[c] = section.rest_strain[c] * section.ds;
            node.stretch[c] = 1.0 / (section.compliance[c] * section.ds);
            node.bend[c] = section.couple_stiffness[c] / section.ds;
            node.rest_turn[c] = rest * section.rest_curvature[c] * section.ds;
        }
    }
    node
}

impl Pack {
    /// The block of a node, and its index there, by its index in the arrays.
    pub fn block(&self, at: usize) -> (&Material, usize) {
        let length = self.material[0].mass.len();
        (&self.material[at / length], at % length)
    }

    /// Length of rod whose loads act on a node.
    pub fn weight(&self, at: usize) -> f64 {
        let (material, i) = self.block(at);
        material.weight[i]
    }

    /// Angular velocity of a node with rotation `q` and angular momentum `p`.
    pub fn spin(&self, at: usize, q: DQuat, p: DVec3) -> DVec3 {
        let d1 = q * DVec3::X;
        let (material, i) = self.block(at);
        p * material.per_inertia[i] + d1 * (d1.dot(p) * material.per_spin[i])
    }

    /// The quaternion of a node, normalised at intervals only.
    pub fn quaternion(&self, at: usize) -> DQuat {
        DQuat::from_array([0, 1, 2, 3].map(|c| self.motion.q[c][at]))
    }

    pub fn rotation(&self, at: usize) -> DQuat {
        self.quaternion(at).normalize()
    }

    /// Velocity and angular momentum of a node.
    pub fn moving(&self, at: usize) -> (DVec3, DVec3) {
        (vector(&self.motion.v, at), vector(&self.motion.p, at))
    }

    /// Linear and angular velocity of a node.
    pub fn velocity(&self, at: usize) -> Velocity {
        let (linear, p) = self.moving(at);
        let angular = self.spin(at, self.rotation(at), p);
        Velocity { angular, linear }
    }
}

pub fn vector(arrays: &[Array; 3], at: usize) -> DVec3 {
    DVec3::new(arrays[0][at], arrays[1][at], arrays[2][at])
}
