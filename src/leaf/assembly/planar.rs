//! The equations of a leaf in its plane z = 0, three unknowns a node.

use super::Node;
use crate::leaf::chain::{Block, Chain, Increments, PLANAR};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Increment, State, shift};
use crate::leaf::system::{Sums, System};
use crate::rod::{PlanarBlocks, PlanarGradient, PlanarSegment};
use glam::{DQuat, DVec2, DVec3};

impl DiscreteLeaf {
    /// Segment `i` of rod `j` of a leaf in the plane.
    fn planar_segment(&self, state: &State, j: usize, i: usize) -> PlanarSegment {
        let k = state.base(j) + i;
        let (x, q) = ([state.x[k], state.x[k + 1]], [state.q[k], state.q[k + 1]]);
        PlanarSegment::new(self.section(j, i), x, q, state.n[j * self.segments() + i])
    }

    /// Assembles rod `j` of a leaf in the plane.
    pub(super) fn assemble_planar(
        &self,
        j: usize,
        state: &State,
        chain: &mut Chain<PLANAR>,
        rhs: &mut [Increments],
    ) -> Sums {
        let mut sums = Sums::default();
        let mut own = Node::<PLANAR>::default();
        for i in 0..self.segments() {
            let section = self.section(j, i);
            let segment = self.planar_segment(state, j, i);
            sums.energy += section.planar_strain_energy(&segment);
            sums.turn = sums.turn.max(segment.turn());
            let gradient = segment.condensed_gradient(section);
            let blocks = segment.hessian(section);
            if i > 0 {
                add_left(&mut own.block, &blocks);
                couple(&mut own.next, &blocks);
                pull_left(&mut own.rhs, &gradient);
                own.put(i - 1, j, chain, rhs);
            }
            set_right(&mut own.block, &blocks);
            self.add_coupling_stiffness(j, i + 1, &mut own.block);
            let (load, potential) = self.load(state, j, i + 1);
            sums.energy += potential;
            own.rhs = [0.0, 0.0, 0.0, load.x, load.y, 0.0];
            pull_right(&mut own.rhs, &gradient);
        }
        own.put(self.segments() - 1, j, chain, rhs);
        sums
    }

    /// See [`DiscreteLeaf::assemble_stiffening`].
    pub(super) fn stiffen_planar(
        &self,
        j: usize,
        state: &State,
        dropped: DVec3,
        rhs: &mut [Increment],
    ) {
        for i in 0..self.segments() {
            let segment = self.planar_segment(state, j, i);
            let gradient = segment.stiffening_gradient(self.section(j, i), dropped);
            if i > 0 {
                pull_left(&mut rhs[i - 1], &gradient);
            }
            pull_right(&mut rhs[i], &gradient);
        }
    }

    /// See [`DiscreteLeaf::advance`].
    pub(super) fn advance_planar(
        &self,
        state: &State,
        solution: &System,
        step: f64,
        next: &mut State,
    ) {
        let n = self.segments();
        for (j, rod) in solution.solution().iter().enumerate() {
            let base = state.base(j);
            let (mut turn, mut dx) = (0.0, DVec2::ZERO);
            for (i, increment) in rod.iter().enumerate() {
                let (after, dx_after) = (increment[2], shift(increment).truncate());
                let force = self.planar_segment(state, j, i).force_increment(
                    self.section(j, i),
                    dx_after - dx,
                    0.5 * (turn + after),
                );
                let (old, node) = (j * n + i, base + i + 1);
                next.n[old] = state.n[old] + step * force.extend(0.0);
                next.x[node] += step * dx_after.extend(0.0);
                next.q[node] = turned(state.q[node], step * after);
                (turn, dx) = (after, dx_after);
            }
        }
    }
}

/// A rotation about z by `angle` after another one.
fn turned(q: DQuat, angle: f64) -> DQuat {
    let half = DVec2::from_angle(0.5 * angle).rotate(DVec2::new(q.w, q.z));
    let half = half.normalize();
    DQuat::from_xyzw(0.0, 0.0, half.y, half.x)
}

/// The forces on a segment's left node.
fn pull_left(rhs: &mut Increment, gradient: &PlanarGradient) {
    rhs[2] -= gradient.turn[0];
    rhs[3] += gradient.x.x;
    rhs[4] += gradient.x.y;
}

/// The forces on its right node.
fn pull_right(rhs: &mut Increment, gradient: &PlanarGradient) {
    rhs[2] -= gradient.turn[1];
    rhs[3] -= gradient.x.x;
    rhs[4] -= gradient.x.y;
}

/// The block of a segment's right node.
fn set_right(block: &mut Block<PLANAR>, k: &PlanarBlocks) {
    let (xx, xt) = (&k.xx, k.xt);
    *block = [
        [k.same, xt.x, xt.y],
        [xt.x, xx.x_axis.x, xx.y_axis.x],
        [xt.y, xx.x_axis.y, xx.y_axis.y],
    ];
}

/// Adds the block of a segment's left node.
fn add_left(block: &mut Block<PLANAR>, k: &PlanarBlocks) {
    let mut left = [[0.0; PLANAR]; PLANAR];
    set_right(&mut left, &PlanarBlocks { xt: -k.xt, ..*k });
    for r in 0..PLANAR {
        for c in 0..PLANAR {
            block[r][c] += left[r][c];
        }
    }
}

/// The block between a segment's left and right node.
fn couple(block: &mut Block<PLANAR>, k: &PlanarBlocks) {
    let (xx, xt) = (&k.xx, k.xt);
    *block = [
        [k.across, xt.x, xt.y],
        [-xt.x, -xx.x_axis.x, -xx.y_axis.x],
        [-xt.y, -xx.x_axis.y, -xx.y_axis.y],
    ];
}
