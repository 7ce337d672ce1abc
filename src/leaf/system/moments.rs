//! Dead moments in Newton's equations of a single rod.
//!
//! A dead moment M is not conservative in three dimensions: the derivative of its node's moment
//! balance in spatial increments gains -\[M\]/2, which is skew. All of them together have a small
//! rank, and are included by the Sherman-Morrison-Woodbury formula: with the rotations C of their
//! nodes by unit moments on these and the skew S, the moments x that (1 + S C) x = S t of the
//! rotations t without them are taken off.

use super::{Group, System};
use crate::leaf::chain::Increments;
use glam::DVec3;
use pulp::Arch;

/// The dead moments as of the last assembly, with the workspace of their equations.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeadMoments {
    /// Nodes with equations (from 0) and moments.
    on_nodes: Vec<(usize, DVec3)>,
    /// Their equations, row after row, each with its right-hand side last.
    rows: Vec<f64>,
}

impl DeadMoments {
    /// Replaces them.
    pub fn set(&mut self, moments: impl Iterator<Item = (usize, DVec3)>) {
        self.on_nodes.clear();
        self.on_nodes.extend(moments);
    }

    /// Nodes (from 1) and moments.
    pub fn on_nodes(&self) -> impl Iterator<Item = (usize, DVec3)> {
        self.on_nodes.iter().copied()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.on_nodes.is_empty()
    }

    /// Writes S times the rotations of the nodes to a column of the equations.
    fn set_column(&mut self, column: usize, rotations: &[Increments]) {
        let width = 3 * self.on_nodes.len() + 1;
        for (a, (node, moment)) in self.on_nodes.iter().enumerate() {
            let turn = rotation(&rotations[*node]);
            let by = turn.cross(0.5 * *moment);
            for c in 0..3 {
                self.rows[(3 * a + c) * width + column] = by[c];
            }
        }
    }
}

fn rotation(increments: &Increments) -> DVec3 {
    let [x, y, z] = [0, 1, 2].map(|c| increments[c].0[0]);
    DVec3::new(x, y, z)
}

impl System {
    /// Includes the dead moments in the solution; false if the matrix with them is singular.
    pub(super) fn correct_for_moments(&mut self) -> bool {
        let (arch, group, dead) = (self.arch, &mut self.groups[0], &mut self.moments);
        let size = 3 * dead.on_nodes.len();
        dead.rows.resize(size * (size + 1), 0.0);
        for column in 0..size {
            let (node, axis) = (dead.on_nodes[column / 3].0, DVec3::AXES[column % 3]);
            group.respond(arch, [(node, axis)]);
            dead.set_column(column, &group.z);
            dead.rows[column * (size + 1) + column] += 1.0;
        }
        dead.set_column(size, &group.solution);
        if !eliminate(&mut dead.rows, size) {
            return false;
        }
        let part = |k: usize| dead.rows[k * (size + 1) + size];
        let taken = |(a, (node, _)): (usize, &(usize, DVec3))| {
            (
                *node,
                DVec3::new(part(3 * a), part(3 * a + 1), part(3 * a + 2)),
            )
        };
        group.respond(arch, dead.on_nodes.iter().enumerate().map(taken));
        for (solution, z) in group.solution.iter_mut().zip(&group.z) {
            for c in 0..6 {
                solution[c].0[0] -= z[c].0[0];
            }
        }
        true
    }
}

impl Group {
    /// z = B^-1 times moments on nodes with equations (from 0) of the first rod.
    fn respond(&mut self, arch: Arch, moments: impl IntoIterator<Item = (usize, DVec3)>) {
        self.residual.fill(Increments::default());
        for (node, moment) in moments {
            for c in 0..3 {
                self.residual[node][c].0[0] += moment[c];
            }
        }
        self.matrix.forward(arch, &self.residual, &mut self.z);
        (self.matrix).backward(arch, &self.residual, &mut self.z);
    }
}

/// Solves `size` equations in place by Gaussian elimination with partial pivoting: the solution is
/// left in the last column. False if they are singular, or not finite.
fn eliminate(rows: &mut [f64], size: usize) -> bool {
    let width = size + 1;
    for k in 0..size {
        let below = |i: &usize| rows[i * width + k].abs();
        let Some(pivot) = (k..size).max_by(|a, b| below(a).total_cmp(&below(b))) else {
            return false;
        };
        let largest = rows[pivot * width + k];
        if largest == 0.0 || !largest.is_finite() {
            return false;
        }
        for c in k..width {
            rows.swap(pivot * width + c, k * width + c);
        }
        for i in (0..size).filter(|i| *i != k) {
            let factor = rows[i * width + k] / largest;
            for c in k..width {
                rows[i * width + c] -= factor * rows[k * width + c];
            }
        }
    }
    for k in 0..size {
        rows[k * width + size] /= rows[k * width + k];
    }
    (0..size).all(|k| rows[k * width + size].is_finite())
}
