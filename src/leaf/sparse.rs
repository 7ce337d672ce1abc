//! The whole matrix of the leaf as one sparse symmetric indefinite
//! factorisation: for the Morse index, and for Newton's method at a saddle.

use super::state::Increment;
use super::system::System;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Par, Side};

/// Blocks of the grid of rods and nodes no larger than this are not dissected.
const DISSECTION_LEAF: usize = 4;

/// The pattern of a leaf's matrix: ordering and symbolic factorisation.
pub struct SparsePattern {
    symbolic: SymbolicCholesky<usize>,
    /// First unknown of node i (from 1) of rod j, at j n + i - 1.
    first: Vec<usize>,
    /// First unknown of the joint tip.
    tip: Option<usize>,
    size: usize,
    segments: usize,
}

/// L B L^T of a leaf's matrix by Bunch and Kaufman within supernodes.
pub struct SparseFactor<'a> {
    pattern: &'a SparsePattern,
    values: Vec<f64>,
    subdiagonal: Vec<f64>,
    forward: Vec<usize>,
    inverse: Vec<usize>,
    memory: MemBuffer,
}

/// The matrix could not be factorised: too large for the memory there is.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the sparse factorisation of the leaf does not fit into memory")]
pub struct SparseError;

impl SparsePattern {
    /// Orders the unknowns by nested dissection of the grid of rods and nodes,
    /// the joint tip last, and factorises symbolically.
    pub fn new(system: &System) -> Result<Self, SparseError> {
        let (rods, n) = (system.rods.len(), system.segments());
        let mut nodes = Vec::with_capacity(rods * n);
        dissect((0, rods), (0, n), &mut nodes);
        let mut first = vec![0; rods * n];
        let mut size = 0;
        for (j, i) in nodes {
            first[j * n + i] = size;
            size += if system.joined() && i + 1 == n { 3 } else { 6 };
        }
        let tip = system.joined().then_some(size);
        size += if system.joined() { 3 } else { 0 };
        // With its ordering given, faer reads the pattern of the upper triangle.
        let matrix = triangle(system, &first, tip, 0.0, Side::Upper)?;
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(
            matrix.symbolic(),
            Side::Upper,
            SymmetricOrdering::Identity,
            params,
        )
        .map_err(|_| SparseError)?;
        Ok(SparsePattern {
            symbolic,
            first,
            tip,
            size,
            segments: n,
        })
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// First unknown of the turn and of the shift of node `i` (from 1) of rod
    /// `j`. A joint tip has one shift for all rods.
    pub fn unknowns(&self, j: usize, i: usize) -> [usize; 2] {
        let first = self.first[j * self.segments + i - 1];
        match self.tip {
            Some(tip) if i == self.segments => [first, tip],
            _ => [first, first + 3],
        }
    }

    /// Factorises the matrix assembled in `system`, of the same leaf, plus
    /// `shift` times its mass matrix.
    pub fn factorize(&self, system: &System, shift: f64) -> Result<SparseFactor<'_>, SparseError> {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = self.symbolic.raw() else {
            return Err(SparseError);
        };
        let matrix = triangle(system, &self.first, self.tip, shift, Side::Lower)?;
        let scratch =
            supernodal::factorize_supernodal_numeric_intranode_lblt_scratch::<usize, f64>(
                symbolic,
                Par::Seq,
                Default::default(),
            )
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let mut factor = SparseFactor {
            pattern: self,
            values: vec![0.0; symbolic.len_val()],
            subdiagonal: vec![0.0; self.size],
            forward: vec![0; self.size],
            inverse: vec![0; self.size],
            memory: MemBuffer::try_new(scratch).map_err(|_| SparseError)?,
        };
        supernodal::factorize_supernodal_numeric_intranode_lblt(
            &mut factor.values,
            &mut factor.subdiagonal,
            &mut factor.forward,
            &mut factor.inverse,
            matrix.as_ref(),
            symbolic,
            Par::Seq,
            MemStack::new(&mut factor.memory),
            Default::default(),
        );
        Ok(factor)
    }
}

impl SparseFactor<'_> {
    fn parts(&self) -> supernodal::SupernodalIntranodeLbltRef<'_, usize, f64> {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = self.pattern.symbolic.raw() else {
            unreachable!("a pattern that is not supernodal is not factorised");
        };
        let perm = PermRef::new_checked(&self.forward, &self.inverse, self.pattern.size);
        supernodal::SupernodalIntranodeLbltRef::new(symbolic, &self.values, &self.subdiagonal, perm)
    }

    /// Number of negative eigenvalues, by Sylvester's law of inertia: the
    /// negative 1 x 1 pivots, and one for each 2 x 2 pivot (two if negative definite).
    pub fn negative(&self) -> usize {
        let parts = self.parts();
        let mut negative = 0;
        for s in 0..parts.symbolic().n_supernodes() {
            let node = parts.supernode(s);
            let (pivots, start) = (node.val(), node.start());
            let mut k = 0;
            while k < pivots.ncols() {
                let off = self.subdiagonal[start + k];
                if off == 0.0 {
                    negative += usize::from(pivots[(k, k)] < 0.0);
                    k += 1;
                } else {
                    let (a, b) = (pivots[(k, k)], pivots[(k + 1, k + 1)]);
                    negative += match a * b < off * off {
                        true => 1,
                        false if a < 0.0 => 2,
                        false => 0,
                    };
                    k += 2;
                }
            }
        }
        negative
    }

    /// Solves in place, with unknowns numbered as by [`SparsePattern::unknowns`].
    pub fn solve_vector(&mut self, b: &mut [f64]) {
        let mut x: Vec<f64> = self.forward.iter().map(|&k| b[k]).collect();
        let mut memory = std::mem::replace(&mut self.memory, MemBuffer::new(Default::default()));
        self.parts().solve_in_place_no_numeric_permute_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut x, b.len(), 1),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        self.memory = memory;
        for (b, &k) in b.iter_mut().zip(&self.inverse) {
            *b = x[k];
        }
    }

    /// Solves for the right-hand side assembled in `system` plus `inertia`
    /// (see [`System::solve`]); the solution stands in `system` afterwards.
    pub fn solve(&mut self, system: &mut System, inertia: Option<(&[Vec<Increment>], f64)>) {
        let (size, n) = (self.pattern.size, system.segments());
        let mut b = vec![0.0; size];
        system.each_rhs(inertia, |j, i, rhs| {
            let first = self.pattern.first[j * n + i];
            match self.pattern.tip {
                Some(tip) if i + 1 == n => {
                    b[first..first + 3].copy_from_slice(&rhs[..3]);
                    for c in 0..3 {
                        b[tip + c] += rhs[3 + c];
                    }
                }
                _ => b[first..first + 6].copy_from_slice(rhs),
            }
        });
        self.solve_vector(&mut b);
        system.each_solution(|j, i, solution: &mut Increment| {
            let first = self.pattern.first[j * n + i];
            solution[..3].copy_from_slice(&b[first..first + 3]);
            let shift = match self.pattern.tip {
                Some(tip) if i + 1 == n => tip,
                _ => first + 3,
            };
            solution[3..].copy_from_slice(&b[shift..shift + 3]);
        });
    }
}

/// Nested dissection of the nodes `nodes` of the rods `rods`: both halves
/// first, then the line between them.
fn dissect(rods: (usize, usize), nodes: (usize, usize), order: &mut Vec<(usize, usize)>) {
    let (width, length) = (rods.1 - rods.0, nodes.1 - nodes.0);
    if width == 0 || length == 0 {
        return;
    }
    if width * length <= DISSECTION_LEAF {
        order.extend((rods.0..rods.1).flat_map(|j| (nodes.0..nodes.1).map(move |i| (j, i))));
    } else if width > length {
        let middle = rods.0 + width / 2;
        dissect((rods.0, middle), nodes, order);
        dissect((middle + 1, rods.1), nodes, order);
        order.extend((nodes.0..nodes.1).map(|i| (middle, i)));
    } else {
        let middle = nodes.0 + length / 2;
        dissect(rods, (nodes.0, middle), order);
        dissect(rods, (middle + 1, nodes.1), order);
        order.extend((rods.0..rods.1).map(|j| (j, middle)));
    }
}

/// One triangle of K.
fn triangle(
    system: &System,
    first: &[usize],
    tip: Option<usize>,
    shift: f64,
    side: Side,
) -> Result<SparseColMat<usize, f64>, SparseError> {
    let n = system.segments();
    let unknown = |j: usize, i: usize, c: usize| match tip {
        Some(tip) if i + 1 == n && c >= 3 => tip + c - 3,
        _ => first[j * n + i] + c,
    };
    let mut entries = Vec::new();
    let mut size = 0;
    let mut add = |a: usize, b: usize, value: f64| {
        let (low, high) = (a.min(b), a.max(b));
        entries.push(match side {
            Side::Lower => Triplet::new(high, low, value),
            Side::Upper => Triplet::new(low, high, value),
        });
    };
    for (j, rod) in system.rods.iter().enumerate() {
        for (i, block) in rod.chain.diagonal.iter().enumerate() {
            size = size.max(unknown(j, i, 2) + 1).max(unknown(j, i, 5) + 1);
            for r in 0..6 {
                add(
                    unknown(j, i, r),
                    unknown(j, i, r),
                    shift * rod.mass[i][r / 3],
                );
                for c in r..6 {
                    add(unknown(j, i, r), unknown(j, i, c), block[r][c]);
                }
            }
        }
        for (i, block) in rod.chain.off.iter().enumerate() {
            for r in 0..6 {
                for c in 0..6 {
                    add(unknown(j, i, r), unknown(j, i + 1, c), block[r][c]);
                }
            }
        }
        if let Some(springs) = system.springs.get(j) {
            for (i, spring) in springs.iter().enumerate() {
                if tip.is_none() || i + 1 < n {
                    for c in 0..3 {
                        add(unknown(j, i, 3 + c), unknown(j + 1, i, 3 + c), -spring[c]);
                    }
                }
            }
        }
    }
    SparseColMat::try_new_from_triplets(size, size, &entries).map_err(|_| SparseError)
}
