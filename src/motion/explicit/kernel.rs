//! The explicit method's loop over a pack of rods: a whole time step, from the forces of
//! its segments to the new positions of its nodes.
//!
//! It processes the pack in blocks. The forces of a block's segments stay in the innermost caches
//! until its nodes have moved by a kick of all forces and a drift free of them. Nodes that have moved are not read again: the force of the segment before
//! the next block's first node is carried over from the previous block, and
//! the new positions are written to other arrays, since neighboring rods are coupled
//! to the old ones.
//!
//! The element is that of [`crate::rod`], with the force not as an independent
//! unknown but given by the strains, n = H (v - v0), which has the same
//! equilibria. With the unit quaternions q0, q1 at its ends, s = q0 + q1,
//! delta = |q1 - q0|^2 = (2 sin(psi/4))^2 = 4 - |s|^2, and w the vector part of
//! q0^* q1, of length sin(psi/2):
//!
//! ```text
//! R = R(s/|s|),   tau = 2 w/|s|^2 = tan(psi/4),   psi = 2 sigma w
//! v = R^T dx,   n = H/ds (v - ds v0),   M = 2 S A/ds (psi - ds u0)
//! force N = R n,   twice the moments on the ends G + T,  G - T,
//! G = dx x N,   T = R M - (R tau) x G
//! ```
//!
//! R w is the vector part of q1 q0^*: that of q0^* q1 is its even part minus its
//! odd part, and this their sum.
//!
//! S = sigma + c w w^T is the derivative of the rotation vector. As it maps
//! vectors along w to themselves, c = (1 - sigma)/|w|^2 = -4 B/|s|^2 if sigma is
//! written as 1 + B delta. B is a polynomial in delta ([`rotation_vector_series`]): a segment costs one
//! division and no root.
//!
//! What is the same along all directors needs none of them: H and A are split into their
//! values along d2 and the excess along d1 and d3. For round sections that are straight at
//! rest d1 alone is left, which saves a quarter of the operations.

use crate::leaf::{Loads, NodalMoment};
use crate::motion::explicit::layout::{AlignedArray, BlockMaterial, NODES_PER_BLOCK, PackLayout};
use crate::rotation::{HALF_ANGLE_POLYNOMIAL, Quaternions};
use crate::simd::{
    ArraySpan, Lanes, MAX_LANES, Vectors, array_chunks, slice, slice_mut, spans_mut,
};
use pulp::Simd;
use std::ops::Deref;
use std::sync::Arc;

/// What moves besides the positions: arrays of a pack.
#[derive(Clone, Debug)]
pub struct PackMotion {
    /// Rotations as quaternions, normalized up to rounding and the truncation error of [`COS`].
    pub q: [AlignedArray; 4],
    /// Velocities, half a step behind or ahead.
    pub v: [AlignedArray; 3],
    /// Angular momenta along the lab axes at the time of the velocities.
    pub p: [AlignedArray; 3],
}

/// Strains of the last two steps, for internal damping: R^T dx, then psi.
/// Empty without it.
#[derive(Clone, Debug)]
pub struct StrainHistory {
    pub last: [[AlignedArray; 3]; 2],
    pub earlier: [[AlignedArray; 3]; 2],
}

/// Constitutive law in a step.
#[derive(Clone, Copy, Debug)]
pub struct StepLaw {
    /// Whether there is internal friction.
    pub damped: bool,
    /// Whether the rest curvature varies, and its work is summed up.
    pub rest_varies: bool,
    /// Factor of the rest curvature if that varies, or one.
    pub rest_curvature_factor: f64,
    pub retardation: f64,
    /// Weights of the present and the previous strains in their rate.
    pub strain_rate_weights: [f64; 3],
    /// Whether the present strains are stored.
    pub stores_strains: bool,
}

/// Forces of the segments of a block on their ends. Node i of the block is at MAX_LANES + i, and at
/// MAX_LANES - 1 the last one of the block before.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct BlockForces {
    /// Force N of the segment from node i to i + 1.
    n: [[f64; MAX_LANES + NODES_PER_BLOCK]; 3],
    /// Twice the moment on its left and on its right end.
    left: [[f64; MAX_LANES + NODES_PER_BLOCK]; 3],
    right: [[f64; MAX_LANES + NODES_PER_BLOCK]; 3],
}

impl BlockForces {
    pub fn new() -> Self {
        let zeros = [[0.0; MAX_LANES + NODES_PER_BLOCK]; 3];
        BlockForces {
            n: zeros,
            left: zeros,
            right: zeros,
        }
    }

    /// Sets the entries before a pack.
    fn begin_pack(&mut self) {
        for array in self.n.iter_mut().chain(&mut self.right) {
            array[MAX_LANES - 1] = 0.0;
        }
    }

    /// Proceeds to the next block after a whole one.
    fn advance_block(&mut self) {
        for array in self.n.iter_mut().chain(&mut self.right) {
            array[MAX_LANES - 1] = array[MAX_LANES + NODES_PER_BLOCK - 1];
        }
    }
}

/// A node at which the forces of segments are wanted.
#[derive(Clone, Copy, Debug)]
pub struct WatchedNode {
    /// Index in the arrays of the pack.
    pub entry: usize,
    /// Force and moment of its segments before the step.
    pub force: [f64; 3],
    pub moment: [f64; 3],
}

/// A time step of a pack: a kick by all forces, of length `kick`, velocities
/// before it being multiplied by `keep`, and a drift without forces for the time `drift`.
pub struct PackStep<'a> {
    pub layout: PackLayout,
    /// Number of the pack.
    pub pack: usize,
    /// Positions of the whole leaf.
    pub positions: &'a [AlignedArray; 3],
    /// Positions of the pack after the step, except a shared tip, which is set elsewhere.
    pub next: [&'a mut [f64]; 3],
    /// Force per displacement and unit of sigma of the coupling to the rod before each, and
    /// after it, if there is any coupling.
    pub coupling: Option<[[f64; 3]; 2]>,
    /// Moments and forces on the nodes of the whole leaf besides those of segments, coupling and
    /// `loads`, laid out as positions, if there are any.
    pub applied: Option<&'a [[AlignedArray; 3]; 2]>,
    pub motion: &'a mut PackMotion,
    /// Material, block by block.
    pub material: &'a [Arc<BlockMaterial>],
    pub past: &'a mut StrainHistory,
    pub law: StepLaw,
    /// Loads without the force on a shared tip.
    pub loads: Loads,
    /// Dead moments on a single rod.
    pub moments: &'a [NodalMoment],
    /// Nodes at which the forces of segments are wanted.
    pub watched: &'a mut [WatchedNode],
    pub velocity_factor: f64,
    pub kick: f64,
    pub drift: f64,
    /// Whether quaternions are normalized; rounding and truncated series slowly change their
    /// length.
    pub normalize: bool,
    pub block: &'a mut BlockForces,
}

/// Sums over a pack in a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTotals {
    /// Twice the kinetic energy in the middle of the kick.
    pub twice_kinetic: f64,
    /// Power of internal friction, divided by the retardation time.
    pub friction: f64,
    /// Derivative of the elastic energy with respect to the factor of the rest curvature.
    pub rest_factor_derivative: f64,
    /// Force of the rods' last segments.
    pub last_force: [f64; 3],
}

/// Nodes of the blocks of a pack of `rods`, up to the last node, in whole groups of `width`.
fn block_spans(layout: PackLayout, rods: usize, width: usize) -> impl Iterator<Item = ArraySpan> {
    let end = (rods - 1) * layout.stride + layout.segments + 1;
    (0..end).step_by(NODES_PER_BLOCK).map(move |start| {
        let nodes = (end - start).next_multiple_of(width);
        ArraySpan::new(start, nodes.min(NODES_PER_BLOCK))
    })
}

impl pulp::WithSimd for PackStep<'_> {
    type Output = StepTotals;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> StepTotals {
        let (layout, rods) = (self.layout, self.layout.pack_rods(self.pack));
        let mut totals = StepTotals::default();
        let (mut energy, mut sums) = (Lanes::splat(simd, 0.0), SegmentSums::zero(simd));
        self.block.begin_pack();
        for span in block_spans(layout, rods.len(), S::F64_LANES) {
            let (start, count) = (span.first, span.count);
            let nodes = BlockNodes {
                span,
                first: layout.node_index(rods.start, start),
                x: self.positions,
                q: &self.motion.q,
                material: &self.material[start / NODES_PER_BLOCK],
                law: &self.law,
            };
            let (past, block) = (&mut *self.past, &mut *self.block);
            forces(simd, nodes, past, block, &mut sums);
            for it in self.watched.iter_mut() {
                let node = it.entry.wrapping_sub(start);
                if node < count {
                    let at = MAX_LANES + node;
                    it.force = [0, 1, 2].map(|c| block.n[c][at] - block.n[c][at - 1]);
                    it.moment =
                        [0, 1, 2].map(|c| 0.5 * (block.left[c][at] + block.right[c][at - 1]));
                }
            }
            for rod in 0..rods.len() {
                // No segment follows the last node.
                let tip = (rod * layout.stride + layout.segments).wrapping_sub(start);
                if tip < count {
                    for c in 0..3 {
                        totals.last_force[c] += block.n[c][MAX_LANES + tip - 1];
                        block.n[c][MAX_LANES + tip] = self.loads.tip_force[c];
                        block.left[c][MAX_LANES + tip] = 0.0;
                    }
                }
            }
            for NodalMoment { node, moment } in self.moments {
                let node = node.wrapping_sub(start);
                if node < count {
                    for c in 0..3 {
                        block.left[c][MAX_LANES + node] += 2.0 * moment[c];
                    }
                }
            }
            energy = energy + self.kick_and_drift(simd, span);
            self.block.advance_block();
        }
        // Velocities were sums of two.
        totals.twice_kinetic = 0.25 * energy.sum();
        totals.friction = sums.friction.sum();
        totals.rest_factor_derivative = sums.rest_factor_derivative.sum();
        totals
    }
}

/// Computes the forces of a pack's segments without moving its nodes, and appends them to `forces`.
pub struct PackForces<'a> {
    pub layout: PackLayout,
    /// Number of the pack.
    pub pack: usize,
    pub positions: &'a [AlignedArray; 3],
    pub motion: &'a PackMotion,
    pub material: &'a [Arc<BlockMaterial>],
    pub past: &'a mut StrainHistory,
    pub law: StepLaw,
    pub forces: &'a mut Vec<[f64; 3]>,
}

impl pulp::WithSimd for PackForces<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (layout, rods) = (self.layout, self.layout.pack_rods(self.pack));
        let mut block = BlockForces::new();
        let sums = &mut SegmentSums::zero(simd);
        for span in block_spans(layout, rods.len(), S::F64_LANES) {
            let (start, count) = (span.first, span.count);
            let nodes = BlockNodes {
                span,
                first: layout.node_index(rods.start, start),
                x: self.positions,
                q: &self.motion.q,
                material: &self.material[start / NODES_PER_BLOCK],
                law: &self.law,
            };
            forces(simd, nodes, self.past, &mut block, sums);
            let of_segments = (0..count).filter(|at| {
                let (rod, i) = ((start + at) / layout.stride, (start + at) % layout.stride);
                rod < rods.len() && i < layout.segments
            });
            (self.forces)
                .extend(of_segments.map(|at| [0, 1, 2].map(|c| block.n[c][MAX_LANES + at])));
        }
    }
}

/// cos and sin(a)/a as series in a^2, for angles of a step (halved). Due to truncation
/// a node turns by slightly too much: by 2e-10 of the angle at a = 0.1,
/// increasing with a^6, which does not affect the order of the method. As the angle still
/// depends on the angular momentum alone, the method stays symplectic. cos^2 +
/// sin^2 exceeds 1 by at most 4e-4 a^8.
const COS: [f64; 4] = [1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0];

const SINC: [f64; 3] = [1.0, -1.0 / 6.0, 1.0 / 120.0];

impl PackStep<'_> {
    /// Moves the nodes of a block, at `span` in the arrays of the pack, with the forces in
    /// the block; returns eight times their kinetic energy in the middle of the
    /// kick. Every node rotates as a torque-free body: if it has an axis of symmetry, about its angular momentum p and about
    /// that axis. With three different moments of inertia its energy is p^2/(2 J1) + E2 + E3 with
    /// Ek = (1/Jk - 1/J1) (dk . p)^2/2, each of which alone turns it about one axis: about p, d2 or d3. The first turn
    /// commutes with the others; those are half of that about d3, that about d2, and the other half (S. Reich,
    /// Physica D 76, 1994, 375): of second order, symplectic, and the angular momentum stays.
    #[inline(always)]
    fn kick_and_drift<S: Simd>(&mut self, simd: S, span: ArraySpan) -> Lanes<S> {
        // In two loops: the processor overlaps iterations of short ones.
        let none = [[0.0; 3]; 2];
        let moving = match (self.coupling, self.applied) {
            (coupling, Some([moments, _])) => {
                self.add_moments(span, moments);
                self.translate_nodes::<S, true, true>(simd, span, coupling.unwrap_or(none))
            }
            (Some(coupling), None) => self.translate_nodes::<S, true, false>(simd, span, coupling),
            (None, None) => self.translate_nodes::<S, false, false>(simd, span, none),
        };
        let about_d1 = self.material[span.first / NODES_PER_BLOCK].spins_about_d1;
        let turning = match (about_d1, self.normalize) {
            (true, true) => self.rotate_nodes::<S, true, true>(simd, span),
            (true, false) => self.rotate_nodes::<S, true, false>(simd, span),
            (false, true) => self.rotate_nodes::<S, false, true>(simd, span),
            (false, false) => self.rotate_nodes::<S, false, false>(simd, span),
        };
        moving + turning
    }

    /// Adds moments on the nodes to those of the segments.
    fn add_moments(&mut self, span: ArraySpan, moments: &[AlignedArray; 3]) {
        let nodes = span.count;
        let first = self
            .layout
            .node_index(self.layout.pack_rods(self.pack).start, span.first);
        for (left, moments) in self.block.left.iter_mut().zip(moments) {
            let moments = &moments[first..first + nodes];
            for (left, moment) in left[MAX_LANES..].iter_mut().zip(moments) {
                *left += 2.0 * moment;
            }
        }
    }

    /// Kicks the velocities and drifts the positions of a block.
    #[inline(always)]
    fn translate_nodes<S: Simd, const COUPLED: bool, const APPLIED: bool>(
        &mut self,
        simd: S,
        span: ArraySpan,
        coupling: [[f64; 3]; 2],
    ) -> Lanes<S> {
        let (start, nodes) = (span.first, span.count);
        let own = |array| slice(array, ArraySpan::new(0, nodes));
        let blocks = self.material;
        let material = &blocks[start / NODES_PER_BLOCK];
        let weight = own(&material.load_length);
        let coupled = array_chunks(&material.coupling_weights, ArraySpan::new(0, nodes));
        let (mass, per_mass) = (own(&material.mass), own(&material.inverse_mass));
        let n_right = array_chunks(&self.block.n, ArraySpan::new(MAX_LANES, nodes));
        let n_left = array_chunks(&self.block.n, ArraySpan::new(MAX_LANES - 1, nodes));
        let stride = self.layout.stride;
        let first = self
            .layout
            .node_index(self.layout.pack_rods(self.pack).start, start);
        let of_rods = |first| array_chunks(self.positions, ArraySpan::new(first, nodes));
        let (before, x, after) = (
            of_rods(first - stride),
            of_rods(first),
            of_rods(first + stride),
        );
        let forces = array_chunks(
            self.applied.map_or(self.positions, |[_, forces]| forces),
            ArraySpan::new(first, nodes),
        );
        let [next_x, next_y, next_z] = &mut self.next;
        let mut next = [
            slice_mut(next_x, span),
            slice_mut(next_y, span),
            slice_mut(next_z, span),
        ];
        let mut v = spans_mut(&mut self.motion.v, span);
        let [to_before, to_after] = coupling.map(|coupling| Vectors::splat(simd, coupling));
        let gravity = Vectors::splat(simd, self.loads.gravity.to_array());
        let (keep, kick) = (
            Lanes::splat(simd, self.velocity_factor),
            Lanes::splat(simd, self.kick),
        );
        let step = Lanes::splat(simd, self.drift);
        let mut energy = Lanes::splat(simd, 0.0);
        let mut at = 0;
        while at + S::F64_LANES <= nodes {
            let weight = Lanes::load(simd, weight, at);
            let force = Vectors::load(simd, &n_right, at) - Vectors::load(simd, &n_left, at);
            let mut force = gravity.mul_add(weight, force);
            let x = Vectors::load(simd, &x, at);
            if COUPLED {
                let pull = (Vectors::load(simd, &before, at) - x) * to_before;
                force = pull.mul_add(Lanes::load(simd, coupled[0], at), force);
                let pull = (Vectors::load(simd, &after, at) - x) * to_after;
                force = pull.mul_add(Lanes::load(simd, coupled[1], at), force);
            }
            if APPLIED {
                force = force + Vectors::load(simd, &forces, at);
            }
            let per_mass = Lanes::load(simd, per_mass, at);
            let old = Vectors::load(simd, &v, at);
            let new = force.mul_add(kick * per_mass, old.scale(keep));
            new.store(&mut v, at);
            new.mul_add(step, x).store(&mut next, at);
            let twice = old + new;
            energy = (twice.dot(twice)).mul_add(Lanes::load(simd, mass, at), energy);
            at += S::F64_LANES;
        }
        energy
    }

    /// Kicks the angular momenta and drifts the rotations of a block.
    #[inline(always)]
    fn rotate_nodes<S: Simd, const ABOUT_D1: bool, const NORMALIZE: bool>(
        &mut self,
        simd: S,
        span: ArraySpan,
    ) -> Lanes<S> {
        let (start, nodes) = (span.first, span.count);
        let own = |array| slice(array, ArraySpan::new(0, nodes));
        let blocks = self.material;
        let material = &blocks[start / NODES_PER_BLOCK];
        let per_inertia = own(&material.inverse_inertia);
        let [first_spin, second_spin] =
            array_chunks(&material.inverse_spin_excess, ArraySpan::new(0, nodes));
        let left = array_chunks(&self.block.left, ArraySpan::new(MAX_LANES, nodes));
        let right = array_chunks(&self.block.right, ArraySpan::new(MAX_LANES - 1, nodes));
        let PackMotion { q, p, .. } = &mut *self.motion;
        let [i, j, k, l] = q;
        let q = [
            slice_mut(i, span),
            slice_mut(j, span),
            slice_mut(k, span),
            slice_mut(l, span),
        ];
        let mut p = spans_mut(p, span);
        let keep = Lanes::splat(simd, self.velocity_factor);
        let half_kick = Lanes::splat(simd, 0.5 * self.kick);
        let half_step = Lanes::splat(simd, 0.5 * self.drift);
        let one = Lanes::splat(simd, 1.0);
        let (three_halves, half) = (Lanes::splat(simd, 1.5), Lanes::splat(simd, 0.5));
        let mut energy = Lanes::splat(simd, 0.0);
        let mut at = 0;
        while at + S::F64_LANES <= nodes {
            let moment = Vectors::load(simd, &left, at) + Vectors::load(simd, &right, at);
            let before = Vectors::load(simd, &p, at);
            let after = moment.mul_add(half_kick, before.scale(keep));
            after.store(&mut p, at);
            let rotation = quaternion(simd, &q, at);
            let (r, w) = (rotation.vector, rotation.scalar);
            let per_inertia = Lanes::load(simd, per_inertia, at);
            let per_spin = Lanes::load(simd, first_spin, at);
            let twice = before + after;
            energy = (twice.dot(twice)).mul_add(per_inertia, energy);
            let length = match NORMALIZE {
                // Newton's iteration for the length, which is nearly one.
                true => half.neg_mul_add(r.dot(r) + w * w, three_halves),
                false => one,
            };
            let spun = if ABOUT_D1 {
                let d1 = first_director(rotation);
                let spin = d1.dot(twice);
                energy = (spin * spin).mul_add(per_spin, energy);
                let mut turn = half_turn(d1.dot(after) * (half_step * per_spin));
                if NORMALIZE {
                    turn = turn.map(|part| part * length);
                }
                spun_about_d1(rotation, turn)
            } else {
                let (d2, d3) = (second_director(rotation), third_director(rotation));
                let (spin_2, spin_3) = (d2.dot(twice), d3.dot(twice));
                let per_spin_3 = Lanes::load(simd, second_spin, at);
                energy = (spin_2 * spin_2).mul_add(per_spin, energy);
                energy = (spin_3 * spin_3).mul_add(per_spin_3, energy);
                let half_spin = half * half_step * per_spin_3;
                let mut turn = half_turn(d3.dot(after) * half_spin);
                if NORMALIZE {
                    turn = turn.map(|part| part * length);
                }
                let spun = spun_about_d3(rotation, turn);
                let about_2 = second_director(spun).dot(after) * (half_step * per_spin);
                let spun = spun_about_d2(spun, half_turn(about_2));
                let about_3 = third_director(spun).dot(after) * half_spin;
                spun_about_d3(spun, half_turn(about_3))
            };
            let (spun, spun_w) = (spun.vector, spun.scalar);
            // Half angle about the angular momentum.
            let a = after.scale(half_step * per_inertia);
            let squared = a.dot(a);
            let (c, s) = (squared.polynomial(&COS), squared.polynomial(&SINC));
            let a = a.scale(s);
            // q <- (a, c) q
            let turned = a.mul_add(spun_w, spun.scale(c)) + a.cross(spun);
            turned.x.store(q[0], at);
            turned.y.store(q[1], at);
            turned.z.store(q[2], at);
            (spun_w * c - a.dot(spun)).store(q[3], at);
            at += S::F64_LANES;
        }
        energy
    }
}

/// d1 of unit quaternions.
#[inline(always)]
fn first_director<S: Simd>(q: Quaternions<S>) -> Vectors<S> {
    let (r, w, one) = (q.vector, q.scalar, Lanes::splat(q.scalar.simd, 1.0));
    let (y, z) = (r.y + r.y, r.z + r.z);
    Vectors::new(
        r.y.neg_mul_add(y, r.z.neg_mul_add(z, one)),
        r.x.mul_add(y, w * z),
        w.neg_mul_add(y, r.x * z),
    )
}

/// d2 of unit quaternions.
#[inline(always)]
fn second_director<S: Simd>(q: Quaternions<S>) -> Vectors<S> {
    let (r, w, one) = (q.vector, q.scalar, Lanes::splat(q.scalar.simd, 1.0));
    let (x, z) = (r.x + r.x, r.z + r.z);
    Vectors::new(
        w.neg_mul_add(z, r.y * x),
        r.x.neg_mul_add(x, r.z.neg_mul_add(z, one)),
        r.y.mul_add(z, w * x),
    )
}

/// d3 of unit quaternions.
#[inline(always)]
fn third_director<S: Simd>(q: Quaternions<S>) -> Vectors<S> {
    let (r, w, one) = (q.vector, q.scalar, Lanes::splat(q.scalar.simd, 1.0));
    let (x, y) = (r.x + r.x, r.y + r.y);
    Vectors::new(
        r.z.mul_add(x, w * y),
        w.neg_mul_add(x, r.z * y),
        r.x.neg_mul_add(x, r.y.neg_mul_add(y, one)),
    )
}

/// Cosine and sine of half of an angle, of the half angle `b`.
#[inline(always)]
fn half_turn<S: Simd>(b: Lanes<S>) -> [Lanes<S>; 2] {
    let squared = b * b;
    [squared.polynomial(&COS), b * squared.polynomial(&SINC)]
}

/// q (s, 0, 0, c): turned about its own d1.
#[inline(always)]
fn spun_about_d1<S: Simd>(q: Quaternions<S>, [c, s]: [Lanes<S>; 2]) -> Quaternions<S> {
    let (r, w) = (q.vector, q.scalar);
    Quaternions {
        vector: Vectors::new(
            r.x.mul_add(c, w * s),
            r.y.mul_add(c, r.z * s),
            r.y.neg_mul_add(s, r.z * c),
        ),
        scalar: r.x.neg_mul_add(s, w * c),
    }
}

/// q (0, s, 0, c): turned about its own d2.
#[inline(always)]
fn spun_about_d2<S: Simd>(q: Quaternions<S>, [c, s]: [Lanes<S>; 2]) -> Quaternions<S> {
    let (r, w) = (q.vector, q.scalar);
    Quaternions {
        vector: Vectors::new(
            r.z.neg_mul_add(s, r.x * c),
            r.y.mul_add(c, w * s),
            r.z.mul_add(c, r.x * s),
        ),
        scalar: r.y.neg_mul_add(s, w * c),
    }
}

/// q (0, 0, s, c): turned about its own d3.
#[inline(always)]
fn spun_about_d3<S: Simd>(q: Quaternions<S>, [c, s]: [Lanes<S>; 2]) -> Quaternions<S> {
    let (r, w) = (q.vector, q.scalar);
    Quaternions {
        vector: Vectors::new(
            r.x.mul_add(c, r.y * s),
            r.x.neg_mul_add(s, r.y * c),
            r.z.mul_add(c, w * s),
        ),
        scalar: r.z.neg_mul_add(s, w * c),
    }
}

/// One kind of strains of a block's segments at the last step and at the one before.
struct PastStrains<'a> {
    last: [&'a mut [f64]; 3],
    earlier: [&'a mut [f64]; 3],
}

impl PastStrains<'_> {
    /// The rate of a strain at the entries `at`, which is `now`, from it and the last two with these
    /// weights; stores it as the last one if `remember`.
    #[inline(always)]
    fn rate<S: Simd>(
        &mut self,
        at: usize,
        now: Vectors<S>,
        weights: [Lanes<S>; 3],
        remember: bool,
    ) -> Vectors<S> {
        let simd = now.x.simd;
        let (one, two) = (
            Vectors::load(simd, &self.last, at),
            Vectors::load(simd, &self.earlier, at),
        );
        if remember {
            one.store(&mut self.earlier, at);
            now.store(&mut self.last, at);
        }
        two.mul_add(weights[2], one.mul_add(weights[1], now.scale(weights[0])))
    }
}

/// The nodes of a block.
#[derive(Clone, Copy)]
struct BlockNodes<'a> {
    /// Where they are in the arrays of the pack.
    span: ArraySpan,
    /// Index of the first in the arrays of the leaf.
    first: usize,
    /// Positions of the leaf.
    x: &'a [AlignedArray; 3],
    /// Rotations of the pack.
    q: &'a [AlignedArray; 4],
    material: &'a BlockMaterial,
    law: &'a StepLaw,
}

/// Sums of the loops over segments, as in [`StepTotals`].
#[derive(Clone, Copy)]
struct SegmentSums<S: Simd> {
    /// Zero without internal friction.
    friction: Lanes<S>,
    /// Zero unless rest curvatures vary.
    rest_factor_derivative: Lanes<S>,
}

impl<S: Simd> SegmentSums<S> {
    #[inline(always)]
    fn zero(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        SegmentSums {
            friction: zero,
            rest_factor_derivative: zero,
        }
    }
}

/// Forces and moments of the segments after `nodes`, written to `block`.
#[inline(always)]
fn forces<S: Simd>(
    simd: S,
    nodes: BlockNodes,
    past: &mut StrainHistory,
    block: &mut BlockForces,
    sums: &mut SegmentSums<S>,
) {
    let (law, round) = (nodes.law, nodes.material.round);
    match (law.damped, law.rest_varies) {
        (false, false) if round => {
            segment_force_loop::<S, true, false, false>(simd, nodes, past, block, sums)
        }
        (false, false) => {
            segment_force_loop::<S, false, false, false>(simd, nodes, past, block, sums)
        }
        (false, true) => {
            segment_force_loop::<S, false, false, true>(simd, nodes, past, block, sums)
        }
        (true, _) => segment_force_loop::<S, false, true, true>(simd, nodes, past, block, sums),
    }
}

/// Smallest |s|^2: between two rods, whose segment has no stiffness, it could be zero.
const MIN_SQUARED_NORM: f64 = 1e-8;

/// Delta (of a segment bent by 0.2) up to which [`SERIES_TERMS`] terms of B are accurate to rounding.
const SERIES_DELTA_LIMIT: f64 = 0.01;

/// Number of terms of B for segments that bend little.
const SERIES_TERMS: usize = 5;

/// B(delta), the slope of sigma.
#[inline(always)]
fn rotation_vector_series<S: Simd>(delta: Lanes<S>) -> Lanes<S> {
    let [a, b, c, d, e, ..] = HALF_ANGLE_POLYNOMIAL;
    let short: [f64; SERIES_TERMS] = [a, b, c, d, e];
    match delta.largest() < SERIES_DELTA_LIMIT {
        true => delta.polynomial(&short),
        false => delta.polynomial(&HALF_ANGLE_POLYNOMIAL),
    }
}

/// The directors of the quaternion s of any length, `twice` being 2/|s|^2: with additions in
/// place of some multiplications, of which there are more here.
#[inline(always)]
fn directors<S: Simd>(quaternions: Quaternions<S>, twice: Lanes<S>) -> [Vectors<S>; 3] {
    let (s, sw) = (quaternions.vector, quaternions.scalar);
    let one = Lanes::splat(twice.simd, 1.0);
    let r = s.scale(twice);
    let (xx, yy, zz) = (s.x * r.x, s.y * r.y, s.z * r.z);
    let (xy, xz, yz) = (s.x * r.y, s.x * r.z, s.y * r.z);
    let (wx, wy, wz) = (sw * r.x, sw * r.y, sw * r.z);
    [
        Vectors::new(one - (yy + zz), xy + wz, xz - wy),
        Vectors::new(xy - wz, one - (xx + zz), yz + wx),
        Vectors::new(xz + wy, yz - wx, one - (xx + yy)),
    ]
}

/// A stiffness along the directors: that along d2, and the excess along d1 and d3 over it.
#[inline(always)]
fn stiffness<S: Simd>(along_2: Lanes<S>, excess_1: Lanes<S>, excess_3: Lanes<S>) -> Vectors<S> {
    Vectors::new(along_2 + excess_1, along_2, along_2 + excess_3)
}

#[inline(always)]
fn segment_force_loop<S: Simd, const ROUND: bool, const DAMPED: bool, const REST_VARIES: bool>(
    simd: S,
    nodes: BlockNodes,
    past: &mut StrainHistory,
    block: &mut BlockForces,
    sums: &mut SegmentSums<S>,
) {
    let BlockNodes {
        span,
        material,
        law,
        ..
    } = nodes;
    let (start, count) = (span.first, span.count);
    let (x0, x1) = (
        array_chunks(nodes.x, ArraySpan::new(nodes.first, count)),
        array_chunks(nodes.x, ArraySpan::new(nodes.first + 1, count)),
    );
    let (q0, q1) = (
        array_chunks(nodes.q, ArraySpan::new(start, count)),
        array_chunks(nodes.q, ArraySpan::new(start + 1, count)),
    );
    let own = |array| slice(array, ArraySpan::new(0, count));
    let (shear, bend) = (own(&material.shear), own(&material.bending_stiffness));
    let stretch_excess = array_chunks(&material.stretch_excess, ArraySpan::new(0, count));
    let bend_excess = array_chunks(&material.bend_excess, ArraySpan::new(0, count));
    let rest_force = array_chunks(&material.rest_force, ArraySpan::new(0, count));
    let rest_moment = array_chunks(&material.rest_moment, ArraySpan::new(0, count));
    let rest_turn = array_chunks(&material.rest_turn, ArraySpan::new(0, count));
    let mut force = spans_mut(&mut block.n, ArraySpan::new(MAX_LANES, count));
    let mut left = spans_mut(&mut block.left, ArraySpan::new(MAX_LANES, count));
    let mut right = spans_mut(&mut block.right, ArraySpan::new(MAX_LANES, count));
    let ([last_v, last_psi], [earlier_v, earlier_psi]) = (&mut past.last, &mut past.earlier);
    let mut past = DAMPED.then(|| {
        [
            PastStrains {
                last: spans_mut(last_v, span),
                earlier: spans_mut(earlier_v, span),
            },
            PastStrains {
                last: spans_mut(last_psi, span),
                earlier: spans_mut(earlier_psi, span),
            },
        ]
    });
    let rates = law.strain_rate_weights.map(|rate| Lanes::splat(simd, rate));
    let retardation = Lanes::splat(simd, law.retardation);
    let rest = Lanes::splat(simd, law.rest_curvature_factor);
    let (two, four) = (Lanes::splat(simd, 2.0), Lanes::splat(simd, 4.0));
    let (quarter, least) = (
        Lanes::splat(simd, 0.25),
        Lanes::splat(simd, MIN_SQUARED_NORM),
    );
    let mut at = 0;
    while at + S::F64_LANES <= count {
        let (q0, q1) = (quaternion(simd, &q0, at), quaternion(simd, &q1, at));
        let (a, aw) = (q0.vector, q0.scalar);
        let (b, bw) = (q1.vector, q1.scalar);
        let (d, dw) = (b - a, bw - aw);
        let delta = d.x.mul_add(d.x, d.y * d.y) + d.z.mul_add(d.z, dw * dw);
        let inverse = (four - delta).max(least).recip();
        let twice = inverse + inverse;
        let (even, odd) = (a.neg_mul_add(bw, b.scale(aw)), a.cross(b));
        // Along the directors in the middle, and along the lab axes.
        let (w, w_lab) = (even - odd, even + odd);
        let series = rotation_vector_series(delta);
        let two_sigma = series.mul_add(delta + delta, two);
        // The moment A (2 sigma w - u0) = A2 2 sigma w + extra.
        let bend = Lanes::load(simd, bend, at);
        let load = |arrays: &[&[f64]; 3]| Vectors::load(simd, arrays, at);
        let [excess_1, excess_3] = [0, 1].map(|c| Lanes::load(simd, bend_excess[c], at));
        let stiff = bend * two_sigma;
        let mut extra = -load(&rest_moment);
        if REST_VARIES {
            extra = extra.scale(rest);
        }
        extra.x = (excess_1 * two_sigma).mul_add(w.x, extra.x);
        if !ROUND {
            extra.z = (excess_3 * two_sigma).mul_add(w.z, extra.z);
        }
        if REST_VARIES {
            sums.rest_factor_derivative =
                sums.rest_factor_derivative + load(&rest_turn).dot(w.mul_add(stiff, extra));
        }
        if let Some([_, turn]) = &mut past {
            let rate = turn.rate(at, w.scale(two_sigma), rates, law.stores_strains);
            let friction = rate * stiffness(bend, excess_1, excess_3);
            sums.friction = sums.friction + rate.dot(friction);
            extra = friction.mul_add(retardation, extra);
        }
        let along_extra = match ROUND {
            true => extra.x * w.x,
            false => extra.dot(w),
        };
        // |w|^2 = sin^2(psi/2).
        let squared = (delta * delta).neg_mul_add(quarter, delta);
        let along = stiff.mul_add(squared, along_extra);
        let four_inverse = twice + twice;
        let c = series * (four_inverse + four_inverse) * along;
        let mut m = w_lab.scale(two_sigma * stiff - c);

        // Along the lab axes: R (v x n) = dx x N.
        let dx = Vectors::load(simd, &x1, at) - Vectors::load(simd, &x0, at);
        let shear = Lanes::load(simd, shear, at);
        let [excess_1, excess_3] = [0, 1].map(|c| Lanes::load(simd, stretch_excess[c], at));
        let sum = Quaternions {
            vector: a + b,
            scalar: aw + bw,
        };
        let directors = directors(sum, twice);
        let n = if ROUND {
            let [d1, ..] = directors;
            let rest_force = Lanes::load(simd, rest_force[0], at);
            m = d1.mul_add(two_sigma * extra.x, m);
            d1.mul_add(excess_1 * d1.dot(dx) - rest_force, dx.scale(shear))
        } else {
            m = m + extra.scale(two_sigma).from_director_components(directors);
            let v = dx.director_components(directors);
            let rest_force = load(&rest_force);
            let mut extra = Vectors::new(
                excess_1 * v.x - rest_force.x,
                -rest_force.y,
                excess_3 * v.z - rest_force.z,
            );
            if let Some([stretch, _]) = &mut past {
                let rate = stretch.rate(at, v, rates, law.stores_strains);
                let friction = rate * stiffness(shear, excess_1, excess_3);
                sums.friction = sums.friction + rate.dot(friction);
                extra = friction.mul_add(retardation, extra);
            }
            extra.from_director_components(directors) + dx.scale(shear)
        };
        n.store(&mut force, at);
        let g = dx.cross(n);
        let t = m.subtract_cross(w_lab.scale(twice), g);
        (g + t).store(&mut left, at);
        (g - t).store(&mut right, at);
        at += S::F64_LANES;
    }
}

/// Vector and scalar parts of unit quaternions.
#[inline(always)]
fn quaternion<S: Simd>(simd: S, q: &[impl Deref<Target = [f64]>; 4], at: usize) -> Quaternions<S> {
    let vector = Vectors::new(
        Lanes::load(simd, &q[0], at),
        Lanes::load(simd, &q[1], at),
        Lanes::load(simd, &q[2], at),
    );
    Quaternions {
        vector,
        scalar: Lanes::load(simd, &q[3], at),
    }
}
