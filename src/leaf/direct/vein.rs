//! One vein of a leaf: its matrix, condensed to the displacements and eliminated after the vein before
//! it, and solutions for its rotations.

use super::sweep::{
    GROWTH, Matrix3, Workspace, are_small, matrix3, multiply_rows, padded, rows_of,
    subtract_product, sweep, sweep3,
};
use crate::leaf::chain::{ChainBlock, group_and_lane};
use crate::leaf::system::System;
use pulp::{Simd, WithSimd};

/// A vein of a factorised leaf.
#[derive(Default)]
pub struct Vein {
    pub nodes: Vec<Node>,
    /// The swept matrix: -S^-1 and, in the columns of a joint tip, S^-1 times the matrix between
    /// the vein and the tip; rows padded, symmetric.
    pub swept: Vec<f64>,
}

/// A node of a vein: the blocks of the assembled matrix, the inverse pivot of its rotation, and
/// that times the block between it and the next rotation.
pub struct Node {
    pub own: ChainBlock,
    pub next: ChainBlock,
    inverse: Matrix3,
    ahead: Matrix3,
}

impl Vein {
    /// Eliminates vein `j` after the one `before` it, and what couples them; the number of
    /// negative pivots. Of the swept matrix the upper triangle is written.
    pub fn eliminate(
        &mut self,
        (system, shift, j): (&System, f64, usize),
        before: Option<(&Vein, &[f64])>,
        work: &mut Workspace,
    ) -> Option<usize> {
        self.assemble(system, j, shift, work.width);
        system.arch.dispatch(Elimination {
            vein: self,
            before,
            work,
        })
    }

    /// Writes the blocks of its matrix, and the matrix of its displacements, upper triangle.
    fn assemble(&mut self, system: &System, j: usize, shift: f64, width: usize) {
        let (group, lane) = group_and_lane(j);
        let chain = &system.groups[group].matrix;
        let (n, stride) = (system.nodes(), padded(width));
        self.nodes.clear();
        self.swept.clear();
        self.swept.resize(width * stride, 0.0);
        for i in 0..n {
            let (mut own, mut next) = chain.blocks(i, lane);
            let mass = system.mass(j, i);
            for r in 0..6 {
                own[r][r] += shift * mass[r / 3];
                for c in 0..r {
                    own[r][c] = own[c][r];
                }
            }
            if i + 1 == n {
                next = ChainBlock::default();
            }
            for r in 0..3 {
                let row = &mut self.swept[(3 * i + r) * stride..][..width];
                row[3 * i..3 * i + 3].copy_from_slice(&own[3 + r][3..]);
                if i + 1 < n {
                    row[3 * i + 3..3 * i + 6].copy_from_slice(&next[3 + r][3..]);
                }
            }
            self.nodes.push(Node {
                own,
                next,
                inverse: Matrix3::default(),
                ahead: Matrix3::default(),
            });
        }
    }

    /// The swept matrix times a vector of the eliminated displacements.
    #[inline(always)]
    pub fn multiply(&self, vector: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        let stride = padded(product.len());
        for (row, factor) in self.swept.chunks_exact(stride).zip(vector) {
            for (product, value) in product.iter_mut().zip(row) {
                *product += factor * value;
            }
        }
    }

    /// Solves for the rotations with the displacements held.
    #[inline(always)]
    pub fn solve_rotations(&self, turns: &mut [[f64; 3]]) {
        for (i, node) in self.nodes.iter().enumerate() {
            if i + 1 < self.nodes.len() {
                for c in 0..3 {
                    let passed: f64 = (0..3).map(|k| node.ahead[k][c] * turns[i][k]).sum();
                    turns[i + 1][c] -= passed;
                }
            }
            let turn = turns[i];
            turns[i] = node
                .inverse
                .map(|row| row[0] * turn[0] + row[1] * turn[1] + row[2] * turn[2]);
        }
        for i in (0..self.nodes.len() - 1).rev() {
            let next = turns[i + 1];
            for c in 0..3 {
                let row = self.nodes[i].ahead[c];
                turns[i][c] -= row[0] * next[0] + row[1] * next[1] + row[2] * next[2];
            }
        }
    }

    /// Subtracts from the forces on the nodes those of rotations.
    #[inline(always)]
    pub fn subtract_rotations(&self, turns: &[[f64; 3]], load: &mut [f64]) {
        for (i, Node { own, next, .. }) in self.nodes.iter().enumerate() {
            let ahead = i + 1 < self.nodes.len();
            for c in 0..3 {
                for k in 0..3 {
                    load[3 * i + c] -= own[k][3 + c] * turns[i][k];
                    if ahead {
                        load[3 * i + c] -= next[3 + c][k] * turns[i + 1][k];
                        load[3 * (i + 1) + c] -= next[k][3 + c] * turns[i][k];
                    }
                }
            }
        }
    }

    /// The rotations that balance the moments of displacements, with the opposite sign.
    #[inline(always)]
    pub fn rotations_of(&self, shifts: &[f64], turns: &mut [[f64; 3]]) {
        turns.fill([0.0; 3]);
        for (i, Node { own, next, .. }) in self.nodes.iter().enumerate() {
            let ahead = i + 1 < self.nodes.len();
            for c in 0..3 {
                for k in 0..3 {
                    turns[i][k] += own[k][3 + c] * shifts[3 * i + c];
                    if ahead {
                        turns[i][k] += next[k][3 + c] * shifts[3 * (i + 1) + c];
                        turns[i + 1][k] += next[3 + c][k] * shifts[3 * i + c];
                    }
                }
            }
        }
        self.solve_rotations(turns);
    }
}

/// Condenses a vein to its displacements, subtracts what the vein `before` it leaves, and
/// eliminates its own displacements; returns the number of negative pivots.
struct Elimination<'a> {
    work: &'a mut Workspace,
    vein: &'a mut Vein,
    before: Option<(&'a Vein, &'a [f64])>,
}

impl WithSimd for Elimination<'_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<usize> {
        let Elimination { work, vein, before } = self;
        let turns = eliminate_rotations(simd, vein, work)?;
        if let Some((before, coupling)) = before {
            add_previous(&mut vein.swept, &before.swept, coupling, work)?;
        }
        Some(turns + sweep(simd, &mut vein.swept, work)?)
    }
}

/// Eliminates the rotations base to tip: the displacements of nodes up to the next one are
/// coupled with a rotation once those before it are eliminated.
#[inline(always)]
fn eliminate_rotations<S: Simd>(simd: S, vein: &mut Vein, work: &mut Workspace) -> Option<usize> {
    let Vein { nodes, swept } = vein;
    let width = work.width;
    let stride = padded(width);
    for k in 0..width {
        work.scale[k] = swept[k * stride + k].abs();
    }
    let mut negative = 0;
    for i in 0..nodes.len() {
        let filled = (3 * (i + 2)).min(width);
        let mut pivot: Matrix3 = matrix3(|r, c| nodes[i].own[r][c]);
        let turn_scale = std::array::from_fn(|k| pivot[k][k].abs());
        match i.checked_sub(1).map(|k| &nodes[k]) {
            None => work.rows.fill(0.0),
            Some(Node { next, ahead, .. }) => {
                let turned = matrix3(|r, c| ahead[c][r]);
                multiply_rows(simd, &turned, &work.before, &mut work.rows);
                for r in 0..3 {
                    for k in 0..3 {
                        for c in 0..3 {
                            pivot[r][c] -= next[k][r] * ahead[k][c];
                        }
                        work.rows[r * stride + 3 * (i - 1) + k] += next[3 + k][r];
                    }
                }
            }
        }
        let Node { own, next, .. } = &nodes[i];
        for r in 0..3 {
            let row = &mut work.rows[r * stride..][..filled];
            for c in 0..3 {
                row[3 * i + c] += own[r][3 + c];
                if i + 1 < nodes.len() {
                    row[3 * (i + 1) + c] += next[r][3 + c];
                }
            }
        }
        negative += sweep3(&mut pivot, turn_scale)?;
        multiply_rows(simd, &pivot, &work.rows, &mut work.scaled);
        let (rows, scaled) = (rows_of(&work.rows), rows_of(&work.scaled));
        if !are_small(rows, scaled, &work.scale, |_| false) {
            return None;
        }
        subtract_product(simd, swept, rows, scaled, filled);
        nodes[i].ahead = matrix3(|r, c| -(0..3).map(|k| pivot[r][k] * next[k][c]).sum::<f64>());
        nodes[i].inverse = pivot.map(|row| row.map(|value| -value));
        std::mem::swap(&mut work.rows, &mut work.before);
    }
    Some(negative)
}

/// Adds what the elimination of the vein before leaves: of it the swept matrix, upper triangle.
/// `None` if that is too large.
#[inline(always)]
fn add_previous(
    swept: &mut [f64],
    before: &[f64],
    coupling: &[f64],
    work: &Workspace,
) -> Option<()> {
    let Workspace { width, own, .. } = *work;
    let stride = padded(width);
    for a in 0..width {
        let factor = coupling.get(a).copied().unwrap_or(1.0);
        let row = &mut swept[a * stride..][..width];
        let from = &before[a * stride..][..width];
        let small = factor * from[a].abs() * factor <= GROWTH * work.scale[a];
        if a < own && !small {
            return None;
        }
        for c in a..own {
            row[c] += factor * from[c] * coupling[c];
        }
        for c in a.max(own)..width {
            row[c] += factor * from[c];
        }
    }
    Some(())
}
