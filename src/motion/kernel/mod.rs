//! The explicit method's loop over a rod: a whole time step, from the forces of
//! its segments to the new positions of its nodes.
//!
//! It processes the rod in blocks. The forces of a block's segments
//! ([`segments`]) stay in the innermost caches until its nodes have
//! moved ([`nodes`]). Nodes that have moved are not read again: the force of the segment before
//! the next block's first node is carried over from the previous block, and
//! the new positions are written to other arrays, since neighbouring rods are coupled
//! to the old ones.

mod array;
mod material;
mod nodes;
mod segments;

pub use self::array::Array;
pub use self::material::{Material, Node, blocks};
use self::segments::{Nodes, SegmentSums};
use crate::lanes::Lanes;
pub use crate::lanes::{GROUP, arch};
use crate::leaf::Loads;
use pulp::{Arch, Simd};
use std::sync::Arc;

/// Nodes of a block. Measured: with half as many, steps take 1.06 times as long,
/// due to the beginnings and ends of the loops; twice as many gain nothing.
pub const BLOCK: usize = 32 * GROUP;

/// Positions of a rod's nodes, one array per component. Nodes come in groups, and arrays are
/// a group longer at both ends: node i is at GROUP + i; the padding is read, but not used.
#[derive(Clone, Debug)]
pub struct Positions {
    pub x: [Array; 3],
}

/// Other variables of the motion.
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
    pub one: [[Array; 3]; 2],
    pub two: [[Array; 3]; 2],
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

/// Forces of the segments of a block on their ends.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Block {
    /// Force N of the segment from node i to i + 1, node i of the block at
    /// GROUP + i; at GROUP - 1 the last segment's of the block before.
    n: [[f64; GROUP + BLOCK]; 3],
    /// Twice the moment on its left and on its right end.
    left: [[f64; GROUP + BLOCK]; 3],
    right: [[f64; GROUP + BLOCK]; 3],
    /// 2/|s|^2 (see [`segments`]).
    twice_inverse: [f64; BLOCK],
}

impl Block {
    pub fn new() -> Self {
        let zeros = [[0.0; GROUP + BLOCK]; 3];
        Block {
            n: zeros,
            left: zeros,
            right: zeros,
            twice_inverse: [0.0; BLOCK],
        }
    }

    /// Proceeds to the next block after one of `nodes` nodes.
    fn advance(&mut self, nodes: usize) {
        for array in self.n.iter_mut().chain(&mut self.right) {
            array[GROUP - 1] = array[GROUP + nodes - 1];
        }
    }
}

/// Coupling with a neighbour.
#[derive(Clone, Copy)]
pub struct Neighbour<'a> {
    pub positions: &'a Positions,
    /// Force per displacement and unit of sigma.
    pub stiffness: [f64; 3],
}

/// A time step of a rod: a kick by all forces, of length `kick`, velocities
/// before it being multiplied by `keep`, and a drift without forces for the time `drift`.
pub struct Step<'a> {
    pub segments: usize,
    pub positions: &'a Positions,
    /// Their positions after the step, except a shared tip, which is set elsewhere.
    pub next: &'a mut Positions,
    pub neighbours: [Option<Neighbour<'a>>; 2],
    pub motion: &'a mut Motion,
    /// Block by block.
    pub material: &'a [Arc<Material>],
    pub past: &'a mut Past,
    pub law: Law,
    /// Without the force on a shared tip.
    pub loads: Loads,
    pub keep: f64,
    pub kick: f64,
    pub drift: f64,
    /// Whether quaternions are normalised; rounding and truncated series slowly change their
    /// length.
    pub normalise: bool,
    pub block: &'a mut Block,
}

/// Sums over a rod in a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTotals {
    /// Twice the kinetic energy in the middle of the kick.
    pub twice_kinetic: f64,
    /// Power of internal friction, divided by the retardation time.
    pub friction: f64,
    /// Derivative of the elastic energy with respect to the factor of the rest curvature.
    pub rest: f64,
    /// Largest (2 sin(psi/4))^2 of a segment bent by psi, before the step.
    pub largest_delta: f64,
    /// Force of the last segment.
    pub last_force: [f64; 3],
}

impl Step<'_> {
    pub fn make(self, arch: Arch) -> StepTotals {
        match (self.law.damped, self.law.changes) {
            (true, true) => arch.dispatch(Dispatched::<true, true>(self)),
            (true, false) => arch.dispatch(Dispatched::<true, false>(self)),
            (false, true) => arch.dispatch(Dispatched::<false, true>(self)),
            (false, false) => arch.dispatch(Dispatched::<false, false>(self)),
        }
    }
}

/// Nodes of the block that begins at node `start` of a rod, in whole groups.
fn length(segments: usize, start: usize) -> usize {
    ((segments + 1).next_multiple_of(GROUP) - start).min(BLOCK)
}

struct Dispatched<'a, const DAMPED: bool, const CHANGES: bool>(Step<'a>);

impl<const DAMPED: bool, const CHANGES: bool> pulp::WithSimd for Dispatched<'_, DAMPED, CHANGES> {
    type Output = StepTotals;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> StepTotals {
        let mut step = self.0;
        let segments = step.segments;
        let mut totals = StepTotals::default();
        let (mut energy, mut sums) = (Lanes::splat(simd, 0.0), SegmentSums::zero(simd));
        for array in step.block.n.iter_mut().chain(&mut step.block.right) {
            array[GROUP - 1] = 0.0;
        }
        let mut start = 0;
        while start <= segments {
            let nodes = length(segments, start);
            let range = (GROUP + start, nodes);
            let part = Nodes {
                range,
                x: &step.positions.x,
                q: &step.motion.q,
                material: &step.material[start / BLOCK],
                law: &step.law,
            };
            let (past, block) = (&mut *step.past, &mut *step.block);
            segments::forces::<S, DAMPED, CHANGES>(simd, part, past, block, &mut sums);
            // The tip is the last node; no segment follows it.
            if start + nodes > segments {
                let tip = GROUP + segments - start;
                for c in 0..3 {
                    totals.last_force[c] = block.n[c][tip - 1];
                    block.n[c][tip] = step.loads.tip_force[c];
                    block.left[c][tip] = 2.0 * step.loads.tip_moment[c];
                }
            }
            energy = energy + step.kick_and_drift(simd, range);
            step.block.advance(nodes);
            start += nodes;
        }
        // Velocities were sums of two.
        totals.twice_kinetic = 0.25 * energy.sum();
        totals.friction = sums.friction.sum();
        totals.rest = sums.rest.sum();
        totals.largest_delta = sums.largest_delta.largest();
        totals
    }
}

/// Only the forces of a rod's segments, written to `forces`.
pub struct Forces<'a> {
    pub segments: usize,
    pub positions: &'a Positions,
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
        let mut block = Block::new();
        let sums = &mut SegmentSums::zero(simd);
        let mut start = 0;
        while start < self.segments {
            let nodes = length(self.segments, start);
            let part = Nodes {
                range: (GROUP + start, nodes),
                x: &self.positions.x,
                q: &self.motion.q,
                material: &self.material[start / BLOCK],
                law: &self.law,
            };
            let (past, block) = (&mut *self.past, &mut block);
            match self.law.damped {
                true => segments::forces::<S, true, true>(simd, part, past, block, sums),
                false => segments::forces::<S, false, true>(simd, part, past, block, sums),
            }
            let own = GROUP..GROUP + nodes.min(self.segments - start);
            (self.forces).extend(own.map(|at| [0, 1, 2].map(|c| block.n[c][at])));
            start += nodes;
        }
    }
}
