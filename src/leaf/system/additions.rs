//! Additions to the equations of single nodes.

use super::System;
use crate::leaf::chain::group_and_lane;
use glam::{DMat3, DVec3};

impl System {
    /// Adds to the equations of node `i` of rod `j`: to the matrix a rotary and a
    /// translational part on its diagonal, to the right-hand side a moment and a force.
    pub fn add(&mut self, j: usize, i: usize, matrix: (DMat3, f64), rhs: (DVec3, DVec3)) {
        let (group, lane) = group_and_lane(j);
        let (at, group) = (i - self.first, &mut self.groups[group]);
        let chain = &mut group.matrix;
        let increment = &mut group.rhs[at];
        for c in 0..3 {
            for r in 0..=c {
                chain.diagonal(at, r, c).0[lane] += matrix.0.col(c)[r];
            }
            chain.diagonal(at, 3 + c, 3 + c).0[lane] += matrix.1;
            increment[c].0[lane] += rhs.0[c];
            increment[3 + c].0[lane] += rhs.1[c];
        }
    }

    /// Adds a spring's `stiffness` to the matrix at node `i` of rod `j`, against its
    /// displacement.
    pub fn hold(&mut self, j: usize, i: usize, stiffness: DMat3) {
        let (group, lane) = group_and_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for c in 0..3 {
            for r in 0..=c {
                chain.diagonal(at, 3 + r, 3 + c).0[lane] += stiffness.col(c)[r];
            }
        }
    }

    /// Adds a spring's `stiffness` to the matrix at node `i` of rod `j`, against its rotation.
    pub fn hold_rotation(&mut self, j: usize, i: usize, stiffness: DMat3) {
        let none = (DVec3::ZERO, DVec3::ZERO);
        self.add(j, i, (stiffness, 0.0), none);
    }

    /// Adds `stiffness` to the matrix between the displacements of nodes `i` and `i` + 1 of
    /// rod `j`.
    pub fn hold_together(&mut self, j: usize, i: usize, stiffness: DMat3) {
        let (group, lane) = group_and_lane(j);
        let (at, chain) = (i - self.first, &mut self.groups[group].matrix);
        for c in 0..3 {
            for r in 0..3 {
                chain.off(at, 3 + r, 3 + c).0[lane] += stiffness.col(c)[r];
            }
        }
    }
}
