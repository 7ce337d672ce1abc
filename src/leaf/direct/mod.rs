//! The whole matrix of the leaf factorised directly, whatever the signs of its eigenvalues: for the
//! Morse index, for modes, and for Newton's method at a saddle.

mod condensed;
mod sparse;
mod sweep;
#[cfg(test)]
mod tests;
mod unknowns;
mod vein;

use super::state::{Field, Increment};
use super::system::System;
use crate::memory;
use condensed::Condensed;
use sparse::{Cholesky, Sparse, Symbolic};
use std::sync::{Arc, OnceLock};
use unknowns::{Unknowns, entries};

/// Up to so many segments the matrix is factorised vein after vein. Measured with the leaf of Fig. 4:
/// the sparse factorisation takes 1 to 3 times as long on 32 segments, 2 to 5 times on 8 and 16; its
/// symbolic part takes about half as long again.
const MOST_CONDENSED: usize = 32;

/// Direct solutions with the matrices of a leaf on one grid: the numbering of its unknowns, and the
/// symbolic factorisation where one is needed.
pub struct DirectSolver {
    unknowns: Arc<Unknowns>,
    /// The first node of a rod with equations.
    first: usize,
    /// Whether the matrix is factorised vein after vein, if its pivots allow it.
    condenses: bool,
    symbolic: OnceLock<Result<Arc<Symbolic>, DirectError>>,
    /// Number of border rows, which follow all unknowns.
    border: usize,
}

/// The solution of a bordered system.
#[derive(Clone, Debug)]
pub struct Bordered {
    /// The increments.
    pub increments: Field,
    /// The multipliers of the border.
    pub multipliers: Vec<f64>,
}

/// The factors of a leaf's matrix.
pub struct Factors {
    unknowns: Arc<Unknowns>,
    border: usize,
    kind: Kind,
}

enum Kind {
    Condensed(Condensed),
    Sparse(Sparse),
    Cholesky(Cholesky),
}

/// Why a matrix could not be factorised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectError {
    /// It is too large for the memory that is allowed.
    Memory,
    /// A pivot is not a finite number: it has no sign.
    NotFinite,
}

impl DirectSolver {
    /// For the matrix of this leaf.
    pub fn new(system: &System) -> Result<Self, DirectError> {
        DirectSolver::bordered(system, 0)
    }

    /// For this matrix, and others of the same leaf with the same coupling: axes along which it is
    /// zero separate the rods.
    pub fn of_coupling(system: &System) -> Result<Self, DirectError> {
        DirectSolver::along(system, system.coupled_unknowns(), 0)
    }

    /// For the matrix bordered by `rows` dense rows and columns at the end.
    pub fn bordered(system: &System, rows: usize) -> Result<Self, DirectError> {
        let [turns, shifts] = [system.tied(), system.coupled()];
        let coupled = [turns, turns, turns, shifts, shifts, shifts];
        DirectSolver::along(system, coupled, rows)
    }

    /// For rods of whose nodes these unknowns are coupled, with border rows.
    fn along(system: &System, coupled: [bool; 6], border: usize) -> Result<Self, DirectError> {
        let (rods, n) = (system.rods(), system.nodes());
        let solver = DirectSolver {
            unknowns: Arc::new(Unknowns::new(system, coupled)),
            first: system.first(),
            condenses: border == 0
                && coupled != [false; 6]
                && !system.tied()
                && system.segments() <= MOST_CONDENSED
                && memory::factor(rods * (3 * n).pow(2)).is_ok(),
            symbolic: OnceLock::new(),
            border,
        };
        if !solver.condenses {
            solver.symbolic(system)?;
        }
        Ok(solver)
    }

    fn symbolic(&self, system: &System) -> Result<&Arc<Symbolic>, DirectError> {
        let symbolic = || Symbolic::new(system, &self.unknowns, self.border).map(Arc::new);
        self.symbolic
            .get_or_init(symbolic)
            .as_ref()
            .map_err(|&error| error)
    }

    fn factors(&self, kind: Kind) -> Factors {
        Factors {
            unknowns: self.unknowns.clone(),
            border: self.border,
            kind,
        }
    }

    /// Number of unknowns, with those of the border.
    pub fn size(&self) -> usize {
        self.unknowns.count + self.border
    }

    /// The unknowns of the rotation and of the displacement of node `i` of rod `j`.
    /// A joint tip has one displacement for all rods.
    pub fn unknowns(&self, j: usize, i: usize) -> [usize; 6] {
        self.unknowns.of(j, i - self.first)
    }

    /// The matrix assembled in `system` times increments: forces, those on a joint tip all
    /// on the first rod's.
    pub fn product(&self, system: &System, increments: &Field) -> Field {
        let unknowns = &self.unknowns;
        let mut x = vec![0.0; self.size()];
        for (j, rod) in increments.iter().enumerate() {
            for (i, node) in rod.iter().enumerate() {
                for (c, part) in node.iter().enumerate() {
                    x[unknowns.at(j, i, c)] = *part;
                }
            }
        }
        let mut y = vec![0.0; self.size()];
        entries(system, unknowns, &[], self.size(), 0.0, |a, b, k| {
            y[a] += k * x[b];
            if a != b {
                y[b] += k * x[a];
            }
        });
        let mut forces = self.unknowns.field(&y);
        if unknowns.tip.is_some() {
            let others = forces.iter_mut().skip(1);
            others.for_each(|rod| rod[unknowns.nodes - 1][3..].fill(0.0));
        }
        forces
    }

    /// Factorises the matrix assembled in `system`, of the same leaf, plus
    /// `shift` times its mass matrix.
    pub fn factorize(&self, system: &System, shift: f64) -> Result<Factors, DirectError> {
        self.factorize_bordered(system, shift, &[])
    }

    /// Factorises the matrix assembled in `system` plus `shift` times its mass matrix; `None` if it
    /// is not positive definite.
    pub fn factorize_definite(
        &self,
        system: &System,
        shift: f64,
    ) -> Result<Option<Factors>, DirectError> {
        if self.condenses {
            let factors = self.factorize(system, shift)?;
            return Ok((factors.negative() == 0).then_some(factors));
        }
        let symbolic = self.symbolic(system)?;
        let cholesky = symbolic.factorize_definite(system, &self.unknowns, shift)?;
        Ok(cholesky.map(|cholesky| self.factors(Kind::Cholesky(cholesky))))
    }

    /// As [`DirectSolver::factorize`], by the sparse factorisation, whose pivots tell the signs of
    /// eigenvalues closer to zero where veins are stiff.
    pub fn factorize_sparse(&self, system: &System, shift: f64) -> Result<Factors, DirectError> {
        let symbolic = self.symbolic(system)?;
        let kind = Kind::Sparse(symbolic.factorize(system, &self.unknowns, shift, &[])?);
        Ok(self.factors(kind))
    }

    /// Number of negative eigenvalues of the matrix assembled in `system` plus `shift` times its
    /// mass matrix.
    pub fn count_negative(&self, system: &System, shift: f64) -> Result<usize, DirectError> {
        let condensed = match self.condenses {
            true => Condensed::count(system, shift),
            false => None,
        };
        match condensed {
            Some(negative) => Ok(negative),
            None => Ok(self.factorize(system, shift)?.negative()),
        }
    }

    /// Factorises the matrix plus `shift` times the mass matrix, bordered by as many rows as the
    /// solver is for, with a zero corner block.
    pub fn factorize_bordered(
        &self,
        system: &System,
        shift: f64,
        border: &[Field],
    ) -> Result<Factors, DirectError> {
        let condensed = match self.condenses {
            true => Condensed::new(system, shift),
            false => None,
        };
        let kind = match condensed {
            Some(condensed) => Kind::Condensed(condensed),
            None => {
                let symbolic = self.symbolic(system)?;
                Kind::Sparse(symbolic.factorize(system, &self.unknowns, shift, border)?)
            }
        };
        Ok(self.factors(kind))
    }
}

impl Factors {
    /// Number of negative eigenvalues, by Sylvester's law of inertia.
    pub fn negative(&self) -> usize {
        match &self.kind {
            Kind::Condensed(condensed) => condensed.negative(),
            Kind::Sparse(sparse) => sparse.negative(),
            Kind::Cholesky(_) => 0,
        }
    }

    /// Solves in place, with unknowns numbered as by [`DirectSolver::unknowns`].
    pub fn solve_vector(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            Kind::Condensed(condensed) => condensed.solve(&self.unknowns, b),
            Kind::Sparse(sparse) => sparse.solve(b),
            Kind::Cholesky(cholesky) => cholesky.solve(b),
        }
    }

    /// As [`Factors::solve_vector`], in half of the time where the matrix is factorised vein after
    /// vein, and without the last digits of stiff veins: for directions that are orthogonalised.
    pub fn solve_quickly(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            Kind::Condensed(condensed) => condensed.solve_once(&self.unknowns, b),
            Kind::Sparse(sparse) => sparse.solve(b),
            Kind::Cholesky(cholesky) => cholesky.solve(b),
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
        let unknowns = self.unknowns.clone();
        let mut b = vec![0.0; unknowns.count + self.border];
        for (j, rod) in rhs.iter().enumerate() {
            for (i, rhs) in rod.iter().enumerate() {
                unknowns.gather(j, i, rhs, &mut b);
            }
        }
        b[unknowns.count..].copy_from_slice(below);
        self.solve_vector(&mut b);
        Bordered {
            increments: unknowns.field(&b),
            multipliers: b[unknowns.count..].to_vec(),
        }
    }
}
