//! The whole matrix of the leaf as one sparse symmetric indefinite
//! factorisation: for the Morse index, and for Newton's method at a saddle.

use super::state::{Field, Increment};
use super::system::System;
use super::unknowns::{Unknowns, entries, lower_triangle};
use crate::memory;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

/// The pattern of a leaf's matrix: ordering and symbolic factorisation.
pub struct SparsePattern {
    symbolic: SymbolicCholesky<usize>,
    /// Pattern of the lower triangle, and the position in it of each of the [`entries`].
    lower: SymbolicSparseColMat<usize>,
    places: Vec<usize>,
    unknowns: Unknowns,
    /// Index of the first of the border rows, which follow all others.
    border: usize,
    size: usize,
}

/// The solution of a bordered system.
#[derive(Clone, Debug)]
pub struct Bordered {
    /// The increments.
    pub increments: Field,
    /// The multipliers of the border.
    pub multipliers: Vec<f64>,
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

/// Why a matrix could not be factorised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SparseError {
    /// It is too large for the memory that is allowed.
    Memory,
    /// A pivot is not a finite number: it has no sign.
    NotFinite,
}

impl SparsePattern {
    /// Orders the unknowns by nested dissection of the grid of rods and nodes,
    /// the joint tip last, and factorises symbolically.
    pub fn new(system: &System) -> Result<Self, SparseError> {
        SparsePattern::bordered(system, 0)
    }

    /// The pattern of this matrix, and of others of the same leaf with the same coupling: axes
    /// along which it is zero separate the rods.
    pub fn of_coupling(system: &System) -> Result<Self, SparseError> {
        SparsePattern::along(system, system.coupled_axes(), 0)
    }

    /// The pattern of a leaf's matrix bordered by `rows` dense rows and columns at the end.
    pub fn bordered(system: &System, rows: usize) -> Result<Self, SparseError> {
        SparsePattern::along(system, [system.coupled(); 3], rows)
    }

    /// The pattern of rods that are coupled along these axes, with border rows.
    fn along(system: &System, axes: [bool; 3], rows: usize) -> Result<Self, SparseError> {
        let unknowns = Unknowns::new(system, axes);
        let border = unknowns.count;
        let size = border + rows;
        let (rods, n) = (system.rods(), system.segments);
        let ones = vec![vec![vec![[1.0; 6]; n]; rods]; rows];
        let mut pairs = Vec::new();
        entries(system, &unknowns, &ones, border, 0.0, |a, b, _| {
            pairs.push([a.min(b), a.max(b)]);
        });
        let (lower, places) = lower_triangle(size, &pairs);
        // With its ordering given, faer reads the pattern of the upper triangle.
        let upper = lower.transpose().to_col_major();
        let upper = upper.map_err(|_| SparseError::Memory)?;
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(
            upper.as_ref(),
            Side::Upper,
            SymmetricOrdering::Identity,
            params,
        )
        .map_err(|_| SparseError::Memory)?;
        let SymbolicCholeskyRaw::Supernodal(supernodes) = symbolic.raw() else {
            unreachable!("supernodes are forced");
        };
        memory::factor(supernodes.len_val()).map_err(|_| SparseError::Memory)?;
        Ok(SparsePattern {
            symbolic,
            lower,
            places,
            unknowns,
            border,
            size,
        })
    }

    /// Number of stored entries of a factor.
    pub fn fill(&self) -> usize {
        self.supernodes().len_val()
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The unknowns of the rotation and of the displacement of node `i` (from 1) of rod `j`.
    /// A joint tip has one displacement for all rods.
    pub fn unknowns(&self, j: usize, i: usize) -> [usize; 6] {
        self.unknowns.of(j, i - 1)
    }

    /// The matrix assembled in `system` times increments: forces, those on a joint tip all
    /// on the first rod's.
    pub fn product(&self, system: &System, increments: &Field) -> Field {
        let unknowns = &self.unknowns;
        let mut x = vec![0.0; self.size];
        for (j, rod) in increments.iter().enumerate() {
            for (i, node) in rod.iter().enumerate() {
                for (c, part) in node.iter().enumerate() {
                    x[unknowns.at(j, i, c)] = *part;
                }
            }
        }
        let mut y = vec![0.0; self.size];
        entries(system, unknowns, &[], self.border, 0.0, |a, b, k| {
            y[a] += k * x[b];
            if a != b {
                y[b] += k * x[a];
            }
        });
        let mut forces = self.unknowns.field(&y);
        if unknowns.tip.is_some() {
            let others = forces.iter_mut().skip(1);
            others.for_each(|rod| rod[unknowns.segments - 1][3..].fill(0.0));
        }
        forces
    }

    /// Factorises the matrix assembled in `system`, of the same leaf, plus
    /// `shift` times its mass matrix.
    pub fn factorize(&self, system: &System, shift: f64) -> Result<SparseFactor<'_>, SparseError> {
        self.factorize_bordered(system, shift, &[])
    }

    /// Factorises the matrix plus `shift` times the mass matrix, bordered by as many rows as the
    /// pattern has, with a zero corner block.
    pub fn factorize_bordered(
        &self,
        system: &System,
        shift: f64,
        border: &[Field],
    ) -> Result<SparseFactor<'_>, SparseError> {
        let symbolic = self.supernodes();
        let mut values = vec![0.0; self.lower.compute_nnz()];
        let (unknowns, first_border) = (&self.unknowns, self.border);
        let mut places = self.places.iter();
        entries(
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
            memory: MemBuffer::try_new(scratch).map_err(|_| SparseError::Memory)?,
        };
        supernodal::factorize_supernodal_numeric_intranode_lblt(
            &mut factor.values,
            &mut factor.subdiagonal,
            &mut factor.forward,
            &mut factor.inverse,
            SparseColMatRef::new(self.lower.as_ref(), &values),
            symbolic,
            Par::Seq,
            MemStack::new(&mut factor.memory),
            Default::default(),
        );
        let finite = factor.has_finite_pivots();
        finite.then_some(factor).ok_or(SparseError::NotFinite)
    }

    fn supernodes(&self) -> &supernodal::SymbolicSupernodalCholesky<usize> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(symbolic) => symbolic,
            _ => unreachable!("supernodes are forced"),
        }
    }
}

impl SparseFactor<'_> {
    fn parts(&self) -> supernodal::SupernodalIntranodeLbltRef<'_, usize, f64> {
        let symbolic = self.pattern.supernodes();
        let perm = PermRef::new_checked(&self.forward, &self.inverse, self.pattern.size);
        supernodal::SupernodalIntranodeLbltRef::new(symbolic, &self.values, &self.subdiagonal, perm)
    }

    /// What is not a number in the matrix spreads to a pivot.
    fn has_finite_pivots(&self) -> bool {
        let parts = self.parts();
        let mut nodes = (0..parts.symbolic().n_supernodes()).map(|s| parts.supernode(s).val());
        nodes.all(|pivots| (0..pivots.ncols()).all(|k| pivots[(k, k)].is_finite()))
            && self.subdiagonal.iter().all(|value| value.is_finite())
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

    /// Solves for the right-hand side assembled in `system` plus `inertia` (see
    /// [`System::solve`]); the solution is stored in `system`.
    pub fn solve(&mut self, system: &mut System, inertia: Option<(&[Vec<Increment>], f64)>) {
        let mut rhs = system.rhs();
        if let Some((velocity, per_step)) = inertia {
            for (j, rod) in rhs.iter_mut().enumerate() {
                for (i, rhs) in rod.iter_mut().enumerate() {
                    let mass = system.mass(j, i);
                    for c in 0..6 {
                        rhs[c] += mass[c / 3] * velocity[j][i][c] * per_step;
                    }
                }
            }
        }
        system.set_solution(&self.solve_bordered(&rhs, &[]).increments);
    }

    /// Solves the bordered system for forces `rhs`, and `below` in the rows of
    /// the border.
    pub fn solve_bordered(&mut self, rhs: &Field, below: &[f64]) -> Bordered {
        let unknowns = &self.pattern.unknowns;
        let mut b = vec![0.0; self.pattern.size];
        for (j, rod) in rhs.iter().enumerate() {
            for (i, rhs) in rod.iter().enumerate() {
                unknowns.gather(j, i, rhs, &mut b);
            }
        }
        b[self.pattern.border..].copy_from_slice(below);
        self.solve_vector(&mut b);
        Bordered {
            increments: self.pattern.unknowns.field(&b),
            multipliers: b[self.pattern.border..].to_vec(),
        }
    }
}
