//! Sparse factorizations of a leaf's matrix, with its unknowns ordered by nested dissection: indefinite
//! ones, also bordered, and definite ones without a search for pivots.

use crate::leaf::direct::entries::for_each_matrix_entry;
use crate::leaf::direct::pattern::{DirectError, SymbolicFactorization};
use crate::leaf::direct::unknowns::UnknownNumbering;
use crate::leaf::state::NodalField;
use crate::leaf::system::System;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::supernodal;
use faer::{Conj, MatMut, Par};
use std::sync::Arc;

/// L B L^T by Bunch and Kaufman within supernodes.
pub struct BunchKaufmanFactors {
    symbolic: Arc<SymbolicFactorization>,
    values: Vec<f64>,
    subdiagonal: Vec<f64>,
    forward: Vec<usize>,
    inverse: Vec<usize>,
    memory: MemBuffer,
}

/// L L^T of a positive definite matrix.
pub struct CholeskyFactors {
    symbolic: Arc<SymbolicFactorization>,
    values: Vec<f64>,
    memory: MemBuffer,
}

impl Drop for BunchKaufmanFactors {
    fn drop(&mut self) {
        self.symbolic.spare.keep(std::mem::take(&mut self.values));
    }
}

impl Drop for CholeskyFactors {
    fn drop(&mut self) {
        self.symbolic.spare.keep(std::mem::take(&mut self.values));
    }
}

impl CholeskyFactors {
    /// Solves in place.
    pub fn solve(&mut self, b: &mut [f64]) {
        let size = b.len();
        supernodal::SupernodalLltRef::new(self.symbolic.supernodes(), &self.values)
            .solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(b, size, 1),
                Par::Seq,
                MemStack::new(&mut self.memory),
            );
    }
}

impl SymbolicFactorization {
    /// The entries of the lower triangle of the matrix assembled in `system` plus `shift` times the
    /// mass matrix, and of its border.
    fn matrix_entries(
        &self,
        system: &System,
        unknowns: &UnknownNumbering,
        shift: f64,
        border: &[NodalField],
    ) -> Vec<f64> {
        let mut values = self.spare.take(self.lower.pattern.compute_nnz());
        values.fill(0.0);
        let mut places = self.lower.places.iter();
        let first_border = unknowns.count;
        for_each_matrix_entry(
            system,
            unknowns,
            border,
            first_border,
            shift,
            |_, _, value| {
                if let Some(&place) = places.next() {
                    values[place] += value;
                }
            },
        );
        values
    }

    /// Factorizes the matrix plus `shift` times the mass matrix if it is positive definite, without
    /// a search for pivots. `None` if it is not.
    pub fn factorize_definite(
        self: &Arc<Self>,
        system: &System,
        unknowns: &UnknownNumbering,
        shift: f64,
    ) -> Result<Option<CholeskyFactors>, DirectError> {
        let symbolic = self.supernodes();
        let entries = self.matrix_entries(system, unknowns, shift, &[]);
        let scratch = supernodal::factorize_supernodal_numeric_llt_scratch::<usize, f64>(
            symbolic,
            Par::Seq,
            Default::default(),
        )
        .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let mut factor = CholeskyFactors {
            symbolic: self.clone(),
            values: self.spare.take(symbolic.len_val()),
            memory: MemBuffer::try_new(scratch).map_err(|_| DirectError::Memory)?,
        };
        let done = supernodal::factorize_supernodal_numeric_llt(
            &mut factor.values,
            SparseColMatRef::new(self.lower.pattern.as_ref(), &entries),
            Default::default(),
            symbolic,
            Par::Seq,
            MemStack::new(&mut factor.memory),
            Default::default(),
        );
        self.spare.keep(entries);
        Ok(done.is_ok().then_some(factor))
    }

    /// Factorizes the matrix assembled in `system` plus `shift` times the mass matrix, bordered
    /// with a zero corner block.
    pub fn factorize(
        self: &Arc<Self>,
        system: &System,
        unknowns: &UnknownNumbering,
        shift: f64,
        border: &[NodalField],
    ) -> Result<BunchKaufmanFactors, DirectError> {
        let symbolic = self.supernodes();
        let values = self.matrix_entries(system, unknowns, shift, border);
        let scratch =
            supernodal::factorize_supernodal_numeric_intranode_lblt_scratch::<usize, f64>(
                symbolic,
                Par::Seq,
                Default::default(),
            )
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let mut factor = BunchKaufmanFactors {
            symbolic: self.clone(),
            values: self.spare.take(symbolic.len_val()),
            subdiagonal: vec![0.0; self.size],
            forward: vec![0; self.size],
            inverse: vec![0; self.size],
            memory: MemBuffer::try_new(scratch).map_err(|_| DirectError::Memory)?,
        };
        supernodal::factorize_supernodal_numeric_intranode_lblt(
            &mut factor.values,
            &mut factor.subdiagonal,
            &mut factor.forward,
            &mut factor.inverse,
            SparseColMatRef::new(self.lower.pattern.as_ref(), &values),
            symbolic,
            Par::Seq,
            MemStack::new(&mut factor.memory),
            Default::default(),
        );
        self.spare.keep(values);
        let finite = factor.has_finite_pivots();
        finite.then_some(factor).ok_or(DirectError::NotFinite)
    }
}

impl BunchKaufmanFactors {
    fn factor_view(&self) -> supernodal::SupernodalIntranodeLbltRef<'_, usize, f64> {
        let symbolic = self.symbolic.supernodes();
        let perm = PermRef::new_checked(&self.forward, &self.inverse, self.symbolic.size);
        supernodal::SupernodalIntranodeLbltRef::new(symbolic, &self.values, &self.subdiagonal, perm)
    }

    /// What is not a number in the matrix spreads to a pivot.
    fn has_finite_pivots(&self) -> bool {
        let parts = self.factor_view();
        let mut nodes = (0..parts.symbolic().n_supernodes()).map(|s| parts.supernode(s).val());
        nodes.all(|pivots| (0..pivots.ncols()).all(|k| pivots[(k, k)].is_finite()))
            && self.subdiagonal.iter().all(|value| value.is_finite())
    }

    /// Number of negative eigenvalues, by Sylvester's law of inertia: the
    /// negative 1 x 1 pivots, and one for each 2 x 2 pivot (two if negative definite).
    pub fn negative_eigenvalue_count(&self) -> usize {
        let parts = self.factor_view();
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

    /// Solves in place.
    pub fn solve(&mut self, b: &mut [f64]) {
        let mut x: Vec<f64> = self.forward.iter().map(|&k| b[k]).collect();
        let mut memory = std::mem::replace(&mut self.memory, MemBuffer::new(Default::default()));
        self.factor_view()
            .solve_in_place_no_numeric_permute_with_conj(
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
}
