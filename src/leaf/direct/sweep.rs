//! Symmetric sweeps: matrices inverted in place (J. H. Goodnight, A tutorial on the SWEEP operator,
//! Am. Stat. 33, 1979). A sweep of the pivots P turns the blocks [P B; B^T C] of a symmetric matrix
//! into [-P^-1 P^-1 B; B^T P^-1 C - B^T P^-1 B]; the negative pivots are as many as the negative
//! eigenvalues of P.

use crate::leaf::system::System;
use pulp::Simd;

/// The largest factor by which the elimination of a pivot may change a diagonal entry of a
/// matrix, in units of the entry that was assembled. In a positive definite one it is less than
/// one.
pub const GROWTH: f64 = 1e3;

/// Rows are padded to a multiple of so many numbers, with zeros.
pub const LANES: usize = 8;

pub type Matrix3 = [[f64; 3]; 3];

/// The matrix with these entries.
#[inline(always)]
pub fn matrix3(entry: impl Fn(usize, usize) -> f64) -> Matrix3 {
    std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)))
}

/// The length of a padded row.
pub fn padded(width: usize) -> usize {
    width.div_ceil(LANES) * LANES
}

/// Memory for the elimination of a vein.
pub struct Workspace {
    /// Displacements of a vein, and those of them that are eliminated with it.
    pub width: usize,
    pub own: usize,
    /// Sizes of the diagonal entries that were assembled.
    pub scale: Vec<f64>,
    /// Three rows of the matrix, those before them, and their multiples by an inverse pivot.
    pub rows: Vec<f64>,
    pub before: Vec<f64>,
    pub scaled: Vec<f64>,
    /// Whether the displacement of a node is eliminated.
    swept: Vec<bool>,
}

impl Workspace {
    pub fn new(system: &System) -> Self {
        let width = 3 * system.nodes();
        let rows = || vec![0.0; 3 * padded(width)];
        Workspace {
            width,
            own: if system.joined { width - 3 } else { width },
            scale: vec![0.0; width],
            rows: rows(),
            before: rows(),
            scaled: rows(),
            swept: vec![false; width / 3],
        }
    }
}

/// Sweeps the displacements of the nodes that precede row `own` of a symmetric matrix, given by its
/// upper triangle; the number of negative pivots. A node whose pivot is too small for what it
/// divides is left for later; `None` if only such are left.
#[inline(always)]
pub fn sweep<S: Simd>(simd: S, a: &mut [f64], work: &mut Workspace) -> Option<usize> {
    let Workspace { width, own, .. } = *work;
    let stride = padded(width);
    work.swept.fill(false);
    let (mut negative, mut left) = (0, own / 3);
    while left > 0 {
        let before = left;
        for node in 0..own / 3 {
            if work.swept[node] {
                continue;
            }
            let first = 3 * node;
            for r in 0..3 {
                let column = &mut work.rows[r * stride..][..stride];
                for i in 0..first + r {
                    column[i] = a[i * stride + first + r];
                }
                column[first + r..].copy_from_slice(&a[(first + r) * stride..][first + r..stride]);
            }
            let mut pivot = matrix3(|r, c| work.rows[r * stride + first + c]);
            let own_scale = std::array::from_fn(|k| work.scale[first + k]);
            let Some(below_zero) = sweep3(&mut pivot, own_scale) else {
                continue;
            };
            multiply_rows(simd, &pivot, &work.rows, &mut work.scaled);
            let (columns, scaled) = (rows_of(&work.rows), rows_of(&work.scaled));
            let is_free = |i: usize| i / 3 == node || work.swept[i / 3];
            if !are_small(columns, scaled, &work.scale, is_free) {
                continue;
            }
            negative += below_zero;
            subtract_product(simd, a, columns, scaled, width);
            for (r, z) in scaled.into_iter().enumerate() {
                for i in 0..first {
                    a[i * stride + first + r] = z[i];
                }
                let row = &mut a[(first + r) * stride..][first..stride];
                row[..3].copy_from_slice(&pivot[r]);
                row[3..].copy_from_slice(&z[first + 3..]);
            }
            work.swept[node] = true;
            left -= 1;
        }
        if left == before {
            return None;
        }
    }
    Some(negative)
}

/// Three rows of one memory.
#[inline(always)]
pub fn rows_of(rows: &[f64]) -> [&[f64]; 3] {
    let stride = rows.len() / 3;
    [0, 1, 2].map(|r| &rows[r * stride..][..stride])
}

/// Minus a matrix times three rows.
#[inline(always)]
pub fn multiply_rows<S: Simd>(simd: S, factor: &Matrix3, rows: &[f64], product: &mut [f64]) {
    let [r0, r1, r2] = rows_of(rows).map(|row| S::as_simd_f64s(row).0);
    let products = product.chunks_exact_mut(rows.len() / 3);
    for (product, row) in products.zip(factor) {
        let [m0, m1, m2] = row.map(|value| simd.splat_f64s(-value));
        let sources = r0.iter().zip(r1).zip(r2);
        for (value, ((r0, r1), r2)) in S::as_mut_simd_f64s(product).0.iter_mut().zip(sources) {
            let sum = simd.mul_f64s(m0, *r0);
            let sum = simd.mul_add_e_f64s(m1, *r1, sum);
            *value = simd.mul_add_e_f64s(m2, *r2, sum);
        }
    }
}

/// Subtracts from the upper triangle of a matrix of padded rows, up to row and column `filled`, the
/// product of three columns and three rows. Less than a lane is written beside the triangle.
#[inline(always)]
pub fn subtract_product<S: Simd>(
    simd: S,
    a: &mut [f64],
    [c0, c1, c2]: [&[f64]; 3],
    rows: [&[f64]; 3],
    filled: usize,
) {
    let stride = c0.len();
    let lanes = size_of::<S::f64s>() / size_of::<f64>();
    let (a, blocks) = (S::as_mut_simd_f64s(a).0, stride / lanes);
    let [z0, z1, z2] = rows.map(|row| S::as_simd_f64s(row).0);
    for block in 0..filled.div_ceil(lanes) {
        let (z0, z1, z2) = (z0[block], z1[block], z2[block]);
        let last = filled.min(lanes * (block + 1));
        let column = a[block..].iter_mut().step_by(blocks);
        let factors = c0[..last].iter().zip(&c1[..last]).zip(&c2[..last]);
        for (target, ((f0, f1), f2)) in column.zip(factors) {
            let [f0, f1, f2] = [f0, f1, f2].map(|f| simd.splat_f64s(-f));
            let sum = simd.mul_add_e_f64s(f0, z0, *target);
            let sum = simd.mul_add_e_f64s(f1, z1, sum);
            *target = simd.mul_add_e_f64s(f2, z2, sum);
        }
    }
}

/// [`sweep`] of a matrix of three rows: minus its inverse.
#[inline(always)]
pub fn sweep3(a: &mut Matrix3, scale: [f64; 3]) -> Option<usize> {
    let mut swept = [false; 3];
    let mut negative = 0;
    for _ in 0..3 {
        // The pivot that is largest in its scale.
        let size = |k: &usize| a[*k][*k].abs() / scale[*k];
        let left = (0..3).filter(|&k| !swept[k]);
        let k = left.max_by(|i, k| size(i).total_cmp(&size(k)))?;
        let column = a.map(|row| row[k]);
        let pivot = column[k];
        let small = |i: usize| column[i] * column[i] <= GROWTH * scale[i] * pivot.abs();
        if !(pivot != 0.0 && (0..3).all(|i| swept[i] || small(i))) {
            return None;
        }
        negative += usize::from(pivot < 0.0);
        for i in (0..3).filter(|&i| i != k) {
            for c in (0..3).filter(|&c| c != k) {
                a[i][c] -= column[i] * column[c] / pivot;
            }
            a[i][k] = column[i] / pivot;
            a[k][i] = column[i] / pivot;
        }
        a[k][k] = -1.0 / pivot;
        swept[k] = true;
    }
    Some(negative)
}

/// Whether the product of three columns and three rows changes no diagonal entry by too much,
/// but for some; what is not a number does.
#[inline(always)]
pub fn are_small(
    [c0, c1, c2]: [&[f64]; 3],
    [z0, z1, z2]: [&[f64]; 3],
    scale: &[f64],
    is_free: impl Fn(usize) -> bool,
) -> bool {
    // By parts: those of a pivot that is not definite may cancel.
    let change = |i: usize| (c0[i] * z0[i]).abs() + (c1[i] * z1[i]).abs() + (c2[i] * z2[i]).abs();
    (0..scale.len()).all(|i| is_free(i) || change(i) <= GROWTH * scale[i])
}
