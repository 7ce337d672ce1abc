//! Leaves that nothing pulls or bends out of their plane z = 0.
//!
//! Such a leaf has an equilibrium in the plane, for which a node has three
//! unknowns: its turn about z and its shifts along x and y. Whether it stays
//! there is for the full matrix to say. Coupling along z, torsion, and bending
//! about d2 do nothing as long as it does.

use super::assembly::Sums;
use super::chain::{Block, Chain, PLANAR};
use super::dimensionless::Leaf;
use super::discrete::DiscreteLeaf;
use super::state::{Increment, State, shift};
use super::system::System;
use crate::rod::{PlanarBlocks, PlanarGradient, PlanarSegment};
use crate::scenario::Scenario;
use glam::{DQuat, DVec2, DVec3};

/// Whether no load, rest curvature or coupling acts out of the plane.
pub(super) fn is_planar(scenario: &Scenario) -> bool {
    let in_plane = |load: &[f64; 3]| load[2] == 0.0;
    in_plane(&scenario.gravity)
        && in_plane(&scenario.tip_force)
        && scenario.tip_moment == [0.0; 3]
        && (scenario.rods.iter())
            .flat_map(|rod| &rod.rest_curvature[..2])
            .all(|curvature| curvature.max_abs() == 0.0)
}

impl Leaf<'_> {
    /// Whether the leaf is solved in its plane.
    pub fn planar(&self) -> bool {
        self.planar
    }
}

impl DiscreteLeaf<'_> {
    /// Whether it is solved in its plane.
    pub fn planar(&self) -> bool {
        self.planar
    }

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
        rhs: &mut [Increment],
    ) -> Sums {
        let mut sums = Sums::default();
        for i in 0..self.segments() {
            let section = self.section(j, i);
            let segment = self.planar_segment(state, j, i);
            sums.energy += section.planar_strain_energy(&segment);
            sums.turn = sums.turn.max(segment.turn());
            let gradient = segment.condensed_gradient(section);
            let blocks = segment.hessian(section);
            if i > 0 {
                add_left(&mut chain.diagonal[i - 1], &blocks);
                couple(&mut chain.off[i - 1], &blocks);
                pull_left(&mut rhs[i - 1], &gradient);
            }
            set_right(&mut chain.diagonal[i], &blocks);
            let (load, potential) = self.bear(state, j, i + 1, &mut chain.diagonal[i]);
            sums.energy += potential;
            rhs[i] = [0.0, 0.0, 0.0, load.x, load.y, 0.0];
            pull_right(&mut rhs[i], &gradient);
        }
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
        for (j, rod) in solution.rods.iter().enumerate() {
            let base = state.base(j);
            let (mut turn, mut dx) = (0.0, DVec2::ZERO);
            for (i, increment) in rod.solution.iter().enumerate() {
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

#[cfg(test)]
mod tests {
    use super::*;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 3, length = 1.0, fan = "paper" }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
        coupling = { x = 1.0, y = 1.0, z = 1.0 }
    "#;

    #[test]
    fn planar_leaves_are_known() {
        let planar = |entry: &str| {
            let scenario = Scenario::from_toml_with(LEAF, "leaf", &[entry.into()]).unwrap();
            is_planar(&scenario)
        };
        for entry in [
            "load.gravity=[1.0, -2.0, 0.0]",
            "load.tip_force=[1.0, -2.0, 0.0]",
            "rest.bend_3=[1.0, 2.0, -3.0]",
            "rest.stretch=[1.0, 1.1, 1.0]",
        ] {
            assert!(planar(entry), "{entry}");
        }
        for entry in [
            "load.gravity=[0.0, 0.0, 1e-9]",
            "load.tip_force=[0.0, 0.0, 1e-9]",
            "rest.twist=[0.0, 0.0, 1e-9]",
            "rest.bend_2=[0.0, 1e-9, 0.0]",
        ] {
            assert!(!planar(entry), "{entry}");
        }
    }

    #[test]
    fn turns_add() {
        let q = turned(turned(DQuat::IDENTITY, 2.5), 1.5);
        let wanted = DQuat::from_rotation_z(4.0);
        assert!((q.dot(wanted).abs() - 1.0).abs() < 1e-15);
    }
}
