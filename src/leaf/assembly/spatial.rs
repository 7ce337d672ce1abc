//! The equations of a leaf in space, six unknowns a node.

use super::Node;
use crate::leaf::chain::{Block, Chain, Increments, SPATIAL};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Increment, State, shift, turn};
use crate::leaf::system::{Sums, System};
use crate::rod::Blocks;
use glam::{DMat3, DVec3};

impl DiscreteLeaf {
    /// Assembles rod `j` of a leaf in space.
    pub(super) fn assemble_spatial(
        &self,
        j: usize,
        state: &State,
        chain: &mut Chain<SPATIAL>,
        rhs: &mut [Increments],
    ) -> Sums {
        let n = self.segments();
        let mut sums = Sums::default();
        let mut own = Node::<SPATIAL>::default();
        for i in 0..n {
            let force = state.n[j * n + i];
            let section = self.section(j, i);
            let segment = self.segment(state, j, i, force);
            sums.energy += section.strain_energy(&segment);
            sums.turn = sums.turn.max(segment.turn());
            let (g_x, g_a, g_b) = segment.condensed_gradient(section);
            let blocks = segment.hessian(section);
            if i > 0 {
                add_left(&mut own.block, &blocks);
                couple(&mut own.next, &blocks);
                add(&mut own.rhs, -g_a, g_x);
                own.put(i - 1, j, chain, rhs);
            }
            set_right(&mut own.block, &blocks);
            self.add_coupling_stiffness(j, i + 1, &mut own.block);
            let (load, potential) = self.load(state, j, i + 1);
            sums.energy += potential;
            own.rhs = [0.0; 6];
            add(&mut own.rhs, -g_b, load - g_x);
        }
        add(&mut own.rhs, self.tip_moment(), DVec3::ZERO);
        own.put(n - 1, j, chain, rhs);
        sums
    }

    /// See [`DiscreteLeaf::assemble_stiffening`].
    pub(super) fn stiffen_spatial(
        &self,
        j: usize,
        state: &State,
        dropped: DVec3,
        rhs: &mut [Increment],
    ) {
        let n = self.segments();
        for i in 0..n {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            let (g_x, g_a, g_b) = segment.stiffening_gradient(self.section(j, i), dropped);
            if i > 0 {
                add(&mut rhs[i - 1], -g_a, g_x);
            }
            add(&mut rhs[i], -g_b, -g_x);
        }
    }

    /// See [`DiscreteLeaf::advance`].
    pub(super) fn advance_spatial(
        &self,
        state: &State,
        solution: &System,
        step: f64,
        next: &mut State,
    ) {
        let n = self.segments();
        for (j, rod) in solution.solution().iter().enumerate() {
            let base = state.base(j);
            let (mut a, mut dx0) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..n {
                let increment = &rod[i];
                let (b, dx1) = (turn(increment), shift(increment));
                let force = state.n[j * n + i];
                let segment = self.segment(state, j, i, force);
                next.n[j * n + i] =
                    force + step * segment.force_increment(self.section(j, i), dx1 - dx0, a, b);
                next.advance(base + i + 1, increment, step);
                (a, dx0) = (b, dx1);
            }
        }
    }
}

#[inline]
fn add(increment: &mut [f64; 6], moment: DVec3, force: DVec3) {
    for c in 0..3 {
        increment[c] += moment[c];
        increment[3 + c] += force[c];
    }
}

#[inline]
fn place(block: &mut Block<SPATIAL>, row: usize, column: usize, k: &DMat3, sign: f64) {
    for c in 0..3 {
        let values = k.col(c);
        for r in 0..3 {
            block[row + r][column + c] = sign * values[r];
        }
    }
}

/// The block of a segment's right node.
#[inline]
fn set_right(block: &mut Block<SPATIAL>, k: &Blocks) {
    place(block, 0, 0, &k.bb, 1.0);
    place(block, 0, 3, &k.xb.transpose(), 1.0);
    place(block, 3, 0, &k.xb, 1.0);
    place(block, 3, 3, &k.xx, 1.0);
}

/// Adds the block of a segment's left node.
#[inline]
fn add_left(block: &mut Block<SPATIAL>, k: &Blocks) {
    let mut left = [[0.0; 6]; 6];
    place(&mut left, 0, 0, &k.aa, 1.0);
    place(&mut left, 0, 3, &k.xa.transpose(), -1.0);
    place(&mut left, 3, 0, &k.xa, -1.0);
    place(&mut left, 3, 3, &k.xx, 1.0);
    for r in 0..6 {
        for c in 0..6 {
            block[r][c] += left[r][c];
        }
    }
}

/// The block between a segment's left and right node.
#[inline]
fn couple(block: &mut Block<SPATIAL>, k: &Blocks) {
    place(block, 0, 0, &k.ab, 1.0);
    place(block, 0, 3, &k.xa.transpose(), 1.0);
    place(block, 3, 0, &k.xb, -1.0);
    place(block, 3, 3, &k.xx, -1.0);
}
