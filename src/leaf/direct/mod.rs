//! The matrix of a leaf factorized as a whole, whatever the signs of its eigenvalues: for the Morse
//! index, for modes, and for Newton's method at a saddle. On coarse grids vein after vein (`veinwise`),
//! else by a sparse factorization (`sparse`), in the numbering of `unknowns`.

mod entries;
pub(super) mod pattern;
mod sparse;
#[cfg(test)]
mod tests;
pub(super) mod unknowns;
mod veinwise;

use crate::leaf::direct::entries::for_each_matrix_entry;
use crate::leaf::direct::pattern::{DirectError, MatrixPattern, SymbolicFactorization};
use crate::leaf::direct::sparse::{BunchKaufmanFactors, CholeskyFactors};
use crate::leaf::direct::unknowns::NumberedNodes;
use crate::leaf::direct::veinwise::CondensedFactors;
use crate::leaf::state::NodalField;
use crate::leaf::system::{MassLoad, System};
use crate::memory;
use std::sync::Arc;

/// Largest number of segments of a rod with which the matrix is factorized vein after vein. Measured
/// with the leaf of Fig. 4: the sparse factorization takes 1 to 3 times as long on 32 segments, 2 to 5
/// times on 8 and 16; its symbolic part takes about half as long again.
const MAX_CONDENSED_SEGMENTS: usize = 32;

/// Direct solutions with the matrices of a leaf on one grid.
pub struct DirectSolver {
    pattern: Arc<MatrixPattern>,
    /// The first node of a rod with equations.
    first: usize,
    /// Whether the matrix is factorized vein after vein, if its pivots allow it.
    uses_condensation: bool,
}

/// The solution of a bordered system.
#[derive(Clone, Debug)]
pub struct BorderedSolution {
    /// Increments of all nodes with equations.
    pub increments: NodalField,
    /// Multipliers of the border rows.
    pub multipliers: Vec<f64>,
}

/// The factors of a leaf's matrix.
pub struct MatrixFactors {
    pattern: Arc<MatrixPattern>,
    kind: FactorizationKind,
}

enum FactorizationKind {
    Condensed(CondensedFactors),
    Sparse(BunchKaufmanFactors),
    Cholesky(CholeskyFactors),
}

impl DirectSolver {
    /// A solver for the matrix assembled in `system`, and others of the same leaf on the same grid.
    pub fn new(system: &System) -> Result<Self, DirectError> {
        DirectSolver::with_border(system, 0)
    }

    /// A solver for the matrix assembled in `system`, and others of the same leaf with the same coupling:
    /// axes along which the coupling is zero separate the rods.
    pub fn for_coupling_pattern(system: &System) -> Result<Self, DirectError> {
        DirectSolver::with_coupling(system, system.coupled_unknowns(), 0)
    }

    /// A solver for the matrix bordered by `rows` dense rows and columns at the end.
    pub fn with_border(system: &System, rows: usize) -> Result<Self, DirectError> {
        let [turns, shifts] = [system.has_tissue(), system.coupled()];
        let coupled = [turns, turns, turns, shifts, shifts, shifts];
        DirectSolver::with_coupling(system, coupled, rows)
    }

    /// A solver for rods of whose nodes these unknowns are `coupled`, with `border` rows.
    fn with_coupling(
        system: &System,
        coupled: [bool; 6],
        border: usize,
    ) -> Result<Self, DirectError> {
        let (rods, n) = (system.rods(), system.nodes());
        let of = NumberedNodes {
            rods,
            nodes: n,
            joined: system.joined,
            coupled,
            ties: [
                system.coupled(),
                system.has_tissue(),
                system.cell_blocks(0, 0).is_some(),
            ],
        };
        let pattern = system.pattern.0.of_matrix(of, border);
        let solver = DirectSolver {
            pattern,
            first: system.first_node(),
            uses_condensation: border == 0
                && coupled != [false; 6]
                && !system.has_tissue()
                && system.segments() <= MAX_CONDENSED_SEGMENTS
                && memory::check_factor_memory(rods * (3 * n).pow(2)).is_ok(),
        };
        if !solver.uses_condensation {
            solver.symbolic(system)?;
        }
        Ok(solver)
    }

    fn symbolic(&self, system: &System) -> Result<&Arc<SymbolicFactorization>, DirectError> {
        self.pattern.symbolic(|| {
            let ones =
                vec![vec![vec![[1.0; 6]; system.nodes()]; system.rods()]; self.pattern.border];
            let (unknowns, mut pairs) = (&self.pattern.unknowns, Vec::new());
            for_each_matrix_entry(system, unknowns, &ones, unknowns.count, 0.0, |a, b, _| {
                pairs.push([a.min(b), a.max(b)]);
            });
            pairs
        })
    }

    fn factors(&self, kind: FactorizationKind) -> MatrixFactors {
        MatrixFactors {
            pattern: self.pattern.clone(),
            kind,
        }
    }

    /// Number of unknowns, with those of the border.
    pub fn size(&self) -> usize {
        self.pattern.size()
    }

    /// The unknowns of the rotation and of the displacement of node `i` of rod `j`.
    /// A joint tip has one displacement for all rods.
    pub fn unknowns(&self, j: usize, i: usize) -> [usize; 6] {
        self.pattern.unknowns.node_numbers(j, i - self.first)
    }

    /// The matrix assembled in `system` times increments: forces, those on a joint tip all
    /// on the first rod's.
    pub fn product(&self, system: &System, increments: &NodalField) -> NodalField {
        let unknowns = &self.pattern.unknowns;
        let mut x = vec![0.0; self.size()];
        for (j, rod) in increments.iter().enumerate() {
            for (i, node) in rod.iter().enumerate() {
                for (c, part) in node.iter().enumerate() {
                    x[unknowns.component_number(j, i, c)] = *part;
                }
            }
        }
        let mut y = vec![0.0; self.size()];
        for_each_matrix_entry(system, unknowns, &[], self.size(), 0.0, |a, b, k| {
            y[a] += k * x[b];
            if a != b {
                y[b] += k * x[a];
            }
        });
        let mut forces = unknowns.to_field(&y);
        if unknowns.first_tip_unknown.is_some() {
            let others = forces.iter_mut().skip(1);
            others.for_each(|rod| rod[unknowns.nodes - 1][3..].fill(0.0));
        }
        forces
    }

    /// Factorizes the matrix assembled in `system`, of the same leaf, plus
    /// `shift` times its mass matrix.
    pub fn factorize(&self, system: &System, shift: f64) -> Result<MatrixFactors, DirectError> {
        self.factorize_bordered(system, shift, &[])
    }

    /// Factorizes the matrix assembled in `system` plus `shift` times its mass matrix; `None` if it
    /// is not positive definite.
    pub fn factorize_definite(
        &self,
        system: &System,
        shift: f64,
    ) -> Result<Option<MatrixFactors>, DirectError> {
        if self.uses_condensation {
            let factors = self.factorize(system, shift)?;
            return Ok((factors.negative_eigenvalue_count() == 0).then_some(factors));
        }
        let symbolic = self.symbolic(system)?;
        let cholesky = symbolic.factorize_definite(system, &self.pattern.unknowns, shift)?;
        Ok(cholesky.map(|cholesky| self.factors(FactorizationKind::Cholesky(cholesky))))
    }

    /// As [`DirectSolver::factorize`], by the sparse factorization, whose pivots tell the signs of
    /// eigenvalues closer to zero where veins are stiff.
    pub fn factorize_sparse(
        &self,
        system: &System,
        shift: f64,
    ) -> Result<MatrixFactors, DirectError> {
        let symbolic = self.symbolic(system)?;
        let kind = FactorizationKind::Sparse(symbolic.factorize(
            system,
            &self.pattern.unknowns,
            shift,
            &[],
        )?);
        Ok(self.factors(kind))
    }

    /// Number of negative eigenvalues of the matrix assembled in `system` plus `shift` times its
    /// mass matrix.
    pub fn count_negative(&self, system: &System, shift: f64) -> Result<usize, DirectError> {
        let condensed = match self.uses_condensation {
            true => CondensedFactors::count_negative_eigenvalues(system, shift),
            false => None,
        };
        match condensed {
            Some(negative) => Ok(negative),
            None => Ok(self.factorize(system, shift)?.negative_eigenvalue_count()),
        }
    }

    /// Factorizes the matrix plus `shift` times the mass matrix, bordered by as many rows as the
    /// solver is for, with a zero corner block.
    pub fn factorize_bordered(
        &self,
        system: &System,
        shift: f64,
        border: &[NodalField],
    ) -> Result<MatrixFactors, DirectError> {
        let condensed = match self.uses_condensation {
            true => CondensedFactors::new(system, shift),
            false => None,
        };
        let kind = match condensed {
            Some(condensed) => FactorizationKind::Condensed(condensed),
            None => {
                let symbolic = self.symbolic(system)?;
                FactorizationKind::Sparse(symbolic.factorize(
                    system,
                    &self.pattern.unknowns,
                    shift,
                    border,
                )?)
            }
        };
        Ok(self.factors(kind))
    }
}

impl MatrixFactors {
    /// Number of negative eigenvalues, by Sylvester's law of inertia.
    pub fn negative_eigenvalue_count(&self) -> usize {
        match &self.kind {
            FactorizationKind::Condensed(condensed) => condensed.negative_eigenvalue_count(),
            FactorizationKind::Sparse(sparse) => sparse.negative_eigenvalue_count(),
            FactorizationKind::Cholesky(_) => 0,
        }
    }

    /// Solves in place, with unknowns numbered as by [`DirectSolver::unknowns`].
    pub fn solve_vector(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            FactorizationKind::Condensed(condensed) => condensed.solve(&self.pattern.unknowns, b),
            FactorizationKind::Sparse(sparse) => sparse.solve(b),
            FactorizationKind::Cholesky(cholesky) => cholesky.solve(b),
        }
    }

    /// As [`MatrixFactors::solve_vector`], in half of the time where the matrix is factorized vein after
    /// vein, and without the last digits of stiff veins: for directions that are orthogonalised.
    pub fn solve_unrefined(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            FactorizationKind::Condensed(condensed) => {
                condensed.solve_unrefined(&self.pattern.unknowns, b)
            }
            FactorizationKind::Sparse(sparse) => sparse.solve(b),
            FactorizationKind::Cholesky(cholesky) => cholesky.solve(b),
        }
    }

    /// Solves for the right-hand side assembled in `system` plus `inertia`; the solution is stored in
    /// `system`.
    pub fn solve(&mut self, system: &mut System, inertia: Option<MassLoad>) {
        let mut rhs = system.rhs();
        if let Some(MassLoad { field, factor }) = inertia {
            for (j, rod) in rhs.iter_mut().enumerate() {
                for (i, rhs) in rod.iter_mut().enumerate() {
                    let mass = system.mass(j, i);
                    for c in 0..6 {
                        rhs[c] += mass.of_component(c) * field[j][i][c] * factor;
                    }
                }
            }
            // Velocities of before are across the axes of before.
            system.spin_axes.restrict(&mut rhs);
        }
        system.set_solution(&self.solve_bordered(&rhs, &[]).increments);
    }

    /// Solves the bordered system for forces `rhs`, and `below` in the rows of
    /// the border.
    pub fn solve_bordered(&mut self, rhs: &NodalField, below: &[f64]) -> BorderedSolution {
        let pattern = self.pattern.clone();
        let unknowns = &pattern.unknowns;
        let mut b = vec![0.0; pattern.size()];
        for (j, rod) in rhs.iter().enumerate() {
            for (i, rhs) in rod.iter().enumerate() {
                unknowns.add_node_forces(j, i, rhs, &mut b);
            }
        }
        b[unknowns.count..].copy_from_slice(below);
        self.solve_vector(&mut b);
        BorderedSolution {
            increments: unknowns.to_field(&b),
            multipliers: b[unknowns.count..].to_vec(),
        }
    }
}
