//! The explicit method's loop over a pack of rods: a whole time step, from the forces of
//! its segments to the new positions of its nodes.
//!
//! It processes the pack in blocks. The forces of a block's segments
//! ([`segments`]) stay in the innermost caches until its nodes have
//! moved ([`nodes`]). Nodes that have moved are not read again: the force of the segment before
//! the next block's first node is carried over from the previous block, and
//! the new positions are written to other arrays, since neighbouring rods are coupled
//! to the old ones.

mod array;
mod layout;
mod material;
mod nodes;
mod segments;

pub use self::array::Array;
pub use self::layout::Layout;
pub use self::material::{Material, Node, blocks};
use self::segments::{Nodes, SegmentSums};
use crate::lanes::{Lanes, WIDTH};
use crate::leaf::Loads;
use glam::DVec3;
use pulp::Simd;
use std::sync::Arc;

/// Nodes of a block. Measured: with half as many, steps of short rods take 1.05 times as long,
/// due to the beginnings and ends of the loops; more gain nothing.
pub const BLOCK: usize = 224;

/// What moves besides the positions: arrays of a pack.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Rotations as quaternions, normalised up to rounding and the truncation error of [`nodes`].
    pub q: [Array; 4],
    /// Velocities, half a step behind or ahead.
    pub v: [Array; 3],
    /// Angular momenta along the lab axes, likewise.
    pub p: [Array; 3],
}

/// Strains of the last two steps, for internal damping: R^T dx, then psi.
/// Empty without it.
#[derive(Clone, Debug)]
pub struct Past {
    pub last: [[Array; 3]; 2],
    pub earlier: [[Array; 3]; 2],
}

/// Constitutive law at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Law {
    /// Whether there is internal friction.
    pub damped: bool,
    /// Whether the rest curvature varies, and its work is summed up.
    pub changes: bool,
    /// Factor of the rest curvature if that varies, or one.
    pub rest: f64,
    pub retardation: f64,
    /// Weights of the present and the previous strains in their rate.
    pub rates: [f64; 3],
    /// Whether the present strains are stored.
    pub remember: bool,
}

/// Forces of the segments of a block on their ends. Node i of the block is at WIDTH + i, and at
/// WIDTH - 1 the last one of the block before.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Block {
    /// Force N of the segment from node i to i + 1.
    n: [[f64; WIDTH + BLOCK]; 3],
    /// Twice the moment on its left and on its right end.
    left: [[f64; WIDTH + BLOCK]; 3],
    right: [[f64; WIDTH + BLOCK]; 3],
}

impl Block {
    pub fn new() -> Self {
        let zeros = [[0.0; WIDTH + BLOCK]; 3];
        Block {
            n: zeros,
            left: zeros,
            right: zeros,
        }
    }

    /// The entries before a pack.
    fn begin(&mut self) {
        for array in self.n.iter_mut().chain(&mut self.right) {
            array[WIDTH - 1] = 0.0;
        }
    }

    /// Proceeds to the next block after a whole one.
    fn advance(&mut self) {
        for array in self.n.iter_mut().chain(&mut self.right) {
            array[WIDTH - 1] = array[WIDTH + BLOCK - 1];
        }
    }
}

/// A time step of a pack: a kick by all forces, of length `kick`, velocities
/// before it being multiplied by `keep`, and a drift without forces for the time `drift`.
pub struct Step<'a> {
    pub layout: Layout,
    /// Which pack.
    pub pack: usize,
    /// Positions of the whole leaf.
    pub positions: &'a [Array; 3],
    /// Positions of the pack after the step, except a shared tip, which is set elsewhere.
    pub next: [&'a mut [f64]; 3],
    /// Force per displacement and unit of sigma of the coupling to the rod before each, and
    /// after it, if there is any coupling.
    pub coupling: Option<[[f64; 3]; 2]>,
    /// Moments and forces on the nodes of the whole leaf besides, laid out as positions, if there
    /// are any.
    pub applied: Option<&'a [[Array; 3]; 2]>,
    pub motion: &'a mut Motion,
    /// Block by block.
    pub material: &'a [Arc<Material>],
    pub past: &'a mut Past,
    pub law: Law,
    /// Without the force on a shared tip.
    pub loads: Loads,
    /// Nodes and sizes of the dead moments on a single rod.
    pub moments: &'a [(usize, DVec3)],
    pub keep: f64,
    pub kick: f64,
    pub drift: f64,
    /// Whether quaternions are normalised; rounding and truncated series slowly change their
    /// length.
    pub normalise: bool,
    pub block: &'a mut Block,
}

/// Sums over a pack in a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTotals {
    /// Twice the kinetic energy in the middle of the kick.
    pub twice_kinetic: f64,
    /// Power of internal friction, divided by the retardation time.
    pub friction: f64,
    /// Derivative of the elastic energy with respect to the factor of the rest curvature.
    pub rest: f64,
    /// Force of the rods' last segments.
    pub last_force: [f64; 3],
}

/// Nodes of the blocks of a pack of `rods`, up to the last node, in whole groups of `width`: the
/// index of the first and their number.
fn spans(layout: Layout, rods: usize, width: usize) -> impl Iterator<Item = (usize, usize)> {
    let end = (rods - 1) * layout.stride + layout.segments + 1;
    (0..end).step_by(BLOCK).map(move |start| {
        let nodes = (end - start).next_multiple_of(width);
        (start, nodes.min(BLOCK))
    })
}

impl pulp::WithSimd for Step<'_> {
    type Output = StepTotals;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> StepTotals {
        let (layout, rods) = (self.layout, self.layout.rods_of(self.pack));
        let mut totals = StepTotals::default();
        let (mut energy, mut sums) = (Lanes::splat(simd, 0.0), SegmentSums::zero(simd));
        self.block.begin();
        for (start, count) in spans(layout, rods.len(), S::F64_LANES) {
            let nodes = Nodes {
                start,
                count,
                first: layout.at(rods.start, start),
                x: self.positions,
                q: &self.motion.q,
                material: &self.material[start / BLOCK],
                law: &self.law,
            };
            let (past, block) = (&mut *self.past, &mut *self.block);
            segments::forces(simd, nodes, past, block, &mut sums);
            for rod in 0..rods.len() {
                // No segment follows the last node.
                let tip = (rod * layout.stride + layout.segments).wrapping_sub(start);
                if tip < count {
                    for c in 0..3 {
                        totals.last_force[c] += block.n[c][WIDTH + tip - 1];
                        block.n[c][WIDTH + tip] = self.loads.tip_force[c];
                        block.left[c][WIDTH + tip] = 0.0;
                    }
                }
            }
            for (node, moment) in self.moments {
                let node = node.wrapping_sub(start);
                if node < count {
                    for c in 0..3 {
                        block.left[c][WIDTH + node] += 2.0 * moment[c];
                    }
                }
            }
            energy = energy + self.kick_and_drift(simd, (start, count));
            self.block.advance();
        }
        // Velocities were sums of two.
        totals.twice_kinetic = 0.25 * energy.sum();
        totals.friction = sums.friction.sum();
        totals.rest = sums.rest.sum();
        totals
    }
}

/// Only the forces of a pack's segments, written to `forces`.
pub struct Forces<'a> {
    pub layout: Layout,
    /// Which pack.
    pub pack: usize,
    pub positions: &'a [Array; 3],
    pub motion: &'a Motion,
    pub material: &'a [Arc<Material>],
    pub past: &'a mut Past,
    pub law: Law,
    pub forces: &'a mut Vec<[f64; 3]>,
}

impl pulp::WithSimd for Forces<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (layout, rods) = (self.layout, self.layout.rods_of(self.pack));
        let mut block = Block::new();
        let sums = &mut SegmentSums::zero(simd);
        for (start, count) in spans(layout, rods.len(), S::F64_LANES) {
            let nodes = Nodes {
                start,
                count,
                first: layout.at(rods.start, start),
                x: self.positions,
                q: &self.motion.q,
                material: &self.material[start / BLOCK],
                law: &self.law,
            };
            segments::forces(simd, nodes, self.past, &mut block, sums);
            let of_segments = (0..count).filter(|at| {
                let (rod, i) = ((start + at) / layout.stride, (start + at) % layout.stride);
                rod < rods.len() && i < layout.segments
            });
            (self.forces).extend(of_segments.map(|at| [0, 1, 2].map(|c| block.n[c][WIDTH + at])));
        }
    }
}
