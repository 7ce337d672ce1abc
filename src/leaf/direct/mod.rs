//! The whole matrix of the leaf factorised directly, whatever the signs of its eigenvalues: for the
//! Morse index, for modes, and for Newton's method at a saddle.
//!
//! Numbering of the unknowns, and positions of the matrix entries, in the sparse
//! factorisation.

mod sparse;
#[cfg(test)]
mod tests;
mod veinwise;

use crate::leaf::block_tridiagonal::group_and_lane;
use crate::leaf::direct::sparse::{Cholesky, Sparse, Symbolic};
use crate::leaf::direct::veinwise::CondensedFactors;
use crate::leaf::state::{Increment, NodalField};
use crate::leaf::system::System;
use crate::memory;
use faer::sparse::SymbolicSparseColMat;
use std::sync::{Arc, OnceLock};

/// Up to so many segments the matrix is factorised vein after vein. Measured with the leaf of Fig. 4:
/// the sparse factorisation takes 1 to 3 times as long on 32 segments, 2 to 5 times on 8 and 16; its
/// symbolic part takes about half as long again.
const MAX_CONDENSED_SEGMENTS: usize = 32;

/// Direct solutions with the matrices of a leaf on one grid: the numbering of its unknowns, and the
/// symbolic factorisation where one is needed.
pub struct DirectSolver {
    unknowns: Arc<UnknownNumbering>,
    /// The first node of a rod with equations.
    first: usize,
    /// Whether the matrix is factorised vein after vein, if its pivots allow it.
    uses_condensation: bool,
    symbolic: OnceLock<Result<Arc<Symbolic>, DirectError>>,
    /// Number of border rows, which follow all unknowns.
    border: usize,
}

/// The solution of a bordered system.
#[derive(Clone, Debug)]
pub struct BorderedSolution {
    /// The increments.
    pub increments: NodalField,
    /// The multipliers of the border.
    pub multipliers: Vec<f64>,
}

/// The factors of a leaf's matrix.
pub struct MatrixFactors {
    unknowns: Arc<UnknownNumbering>,
    border: usize,
    kind: FactorizationKind,
}

enum FactorizationKind {
    Condensed(CondensedFactors),
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
        DirectSolver::with_border(system, 0)
    }

    /// For this matrix, and others of the same leaf with the same coupling: axes along which it is
    /// zero separate the rods.
    pub fn for_coupling_pattern(system: &System) -> Result<Self, DirectError> {
        DirectSolver::with_coupling(system, system.coupled_unknowns(), 0)
    }

    /// For the matrix bordered by `rows` dense rows and columns at the end.
    pub fn with_border(system: &System, rows: usize) -> Result<Self, DirectError> {
        let [turns, shifts] = [system.has_tissue(), system.coupled()];
        let coupled = [turns, turns, turns, shifts, shifts, shifts];
        DirectSolver::with_coupling(system, coupled, rows)
    }

    /// For rods of whose nodes these unknowns are coupled, with border rows.
    fn with_coupling(
        system: &System,
        coupled: [bool; 6],
        border: usize,
    ) -> Result<Self, DirectError> {
        let (rods, n) = (system.rods(), system.nodes());
        let solver = DirectSolver {
            unknowns: Arc::new(UnknownNumbering::new(system, coupled)),
            first: system.first(),
            uses_condensation: border == 0
                && coupled != [false; 6]
                && !system.has_tissue()
                && system.segments() <= MAX_CONDENSED_SEGMENTS
                && memory::check_factor_memory(rods * (3 * n).pow(2)).is_ok(),
            symbolic: OnceLock::new(),
            border,
        };
        if !solver.uses_condensation {
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

    fn factors(&self, kind: FactorizationKind) -> MatrixFactors {
        MatrixFactors {
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
        self.unknowns.node_numbers(j, i - self.first)
    }

    /// The matrix assembled in `system` times increments: forces, those on a joint tip all
    /// on the first rod's.
    pub fn product(&self, system: &System, increments: &NodalField) -> NodalField {
        let unknowns = &self.unknowns;
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
        let mut forces = self.unknowns.to_field(&y);
        if unknowns.first_tip_unknown.is_some() {
            let others = forces.iter_mut().skip(1);
            others.for_each(|rod| rod[unknowns.nodes - 1][3..].fill(0.0));
        }
        forces
    }

    /// Factorises the matrix assembled in `system`, of the same leaf, plus
    /// `shift` times its mass matrix.
    pub fn factorize(&self, system: &System, shift: f64) -> Result<MatrixFactors, DirectError> {
        self.factorize_bordered(system, shift, &[])
    }

    /// Factorises the matrix assembled in `system` plus `shift` times its mass matrix; `None` if it
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
        let cholesky = symbolic.factorize_definite(system, &self.unknowns, shift)?;
        Ok(cholesky.map(|cholesky| self.factors(FactorizationKind::Cholesky(cholesky))))
    }

    /// As [`DirectSolver::factorize`], by the sparse factorisation, whose pivots tell the signs of
    /// eigenvalues closer to zero where veins are stiff.
    pub fn factorize_sparse(
        &self,
        system: &System,
        shift: f64,
    ) -> Result<MatrixFactors, DirectError> {
        let symbolic = self.symbolic(system)?;
        let kind =
            FactorizationKind::Sparse(symbolic.factorize(system, &self.unknowns, shift, &[])?);
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

    /// Factorises the matrix plus `shift` times the mass matrix, bordered by as many rows as the
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
                    &self.unknowns,
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
            FactorizationKind::Condensed(condensed) => condensed.negative(),
            FactorizationKind::Sparse(sparse) => sparse.negative_eigenvalue_count(),
            FactorizationKind::Cholesky(_) => 0,
        }
    }

    /// Solves in place, with unknowns numbered as by [`DirectSolver::unknowns`].
    pub fn solve_vector(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            FactorizationKind::Condensed(condensed) => condensed.solve(&self.unknowns, b),
            FactorizationKind::Sparse(sparse) => sparse.solve(b),
            FactorizationKind::Cholesky(cholesky) => cholesky.solve(b),
        }
    }

    /// As [`MatrixFactors::solve_vector`], in half of the time where the matrix is factorised vein after
    /// vein, and without the last digits of stiff veins: for directions that are orthogonalised.
    pub fn solve_unrefined(&mut self, b: &mut [f64]) {
        match &mut self.kind {
            FactorizationKind::Condensed(condensed) => condensed.solve_unrefined(&self.unknowns, b),
            FactorizationKind::Sparse(sparse) => sparse.solve(b),
            FactorizationKind::Cholesky(cholesky) => cholesky.solve(b),
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
    pub fn solve_bordered(&mut self, rhs: &NodalField, below: &[f64]) -> BorderedSolution {
        let unknowns = self.unknowns.clone();
        let mut b = vec![0.0; unknowns.count + self.border];
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

/// Blocks of the grid of rods and nodes no larger than this are not dissected.
const UNDISSECTED_BLOCK_SIZE: usize = 4;

/// Of a block this many times wider than it is long, in unknowns, the rods are eliminated one
/// after the other.
const WIDE_BLOCK_RATIO: f64 = 2.5;

/// The numbering of the unknowns of the nodes.
pub struct UnknownNumbering {
    /// The unknowns of node i (from the first with equations) of rod j, at j n + i.
    numbers: Vec<[usize; 6]>,
    /// First unknown of the joint tip.
    pub first_tip_unknown: Option<usize>,
    /// Nodes of a rod that have equations.
    pub nodes: usize,
    /// Number of unknowns.
    pub count: usize,
    /// Unknowns of a node that are coupled with those of the next rod.
    coupled: [bool; 6],
}

impl UnknownNumbering {
    /// Ordered by nested dissection of the grid of rods and nodes, the joint tip last, for rods
    /// of which these unknowns are coupled only.
    pub fn new(system: &System, coupled: [bool; 6]) -> Self {
        let (rods, n) = (system.rods(), system.nodes());
        let mut order = DissectionOrder {
            numbers: vec![[0; 6]; rods * n],
            count: 0,
            nodes: n,
            joined: system.joined,
            coupled,
        };
        order.dissect((0, rods), (0, n));
        let DissectionOrder {
            mut numbers,
            mut count,
            ..
        } = order;
        let tip = system.joined.then_some(count);
        if let Some(tip) = tip {
            for last in numbers.iter_mut().skip(n - 1).step_by(n) {
                last[3..].copy_from_slice(&[tip, tip + 1, tip + 2]);
            }
            count += 3;
        }
        UnknownNumbering {
            numbers,
            first_tip_unknown: tip,
            nodes: n,
            count,
            coupled,
        }
    }

    /// Component `c` of node `i` (from 0) of rod `j`.
    pub fn component_number(&self, j: usize, i: usize, c: usize) -> usize {
        self.node_numbers(j, i)[c]
    }

    /// All six unknowns of node `i` (from 0) of rod `j`.
    pub fn node_numbers(&self, j: usize, i: usize) -> [usize; 6] {
        self.numbers[j * self.nodes + i]
    }

    /// Adds the forces on a node to a vector of all unknowns.
    pub fn add_node_forces(&self, j: usize, i: usize, forces: &Increment, all: &mut [f64]) {
        for c in 0..6 {
            all[self.component_number(j, i, c)] += forces[c];
        }
    }

    /// The values at all nodes, from a vector of all unknowns.
    pub fn to_field(&self, all: &[f64]) -> NodalField {
        let node =
            |j: usize, i: usize| std::array::from_fn(|c| all[self.component_number(j, i, c)]);
        let rods = self.numbers.chunks_exact(self.nodes).enumerate();
        rods.map(|(j, rod)| (0..rod.len()).map(|i| node(j, i)).collect())
            .collect()
    }
}

/// The numbering, as far as it has come.
struct DissectionOrder {
    numbers: Vec<[usize; 6]>,
    count: usize,
    nodes: usize,
    joined: bool,
    coupled: [bool; 6],
}

impl DissectionOrder {
    /// Nested dissection of the nodes `nodes` of the rods `rods`: both halves
    /// first, then the line between them. A rod is separated from its neighbours by the
    /// unknowns that are coupled to theirs alone: its others precede these.
    fn dissect(&mut self, rods: (usize, usize), nodes: (usize, usize)) {
        let (width, length) = (rods.1 - rods.0, nodes.1 - nodes.0);
        let axes = self.coupled.iter().filter(|&&coupled| coupled).count();
        let (across, along) = (6 * width, axes * length);
        if width == 0 || length == 0 {
        } else if width == 1 {
            self.dissect_rod(rods.0, nodes, |_| true);
        } else if width * length <= UNDISSECTED_BLOCK_SIZE {
            for j in rods.0..rods.1 {
                (nodes.0..nodes.1).for_each(|i| self.number_node(j, i, |_| true));
            }
        } else if across as f64 >= WIDE_BLOCK_RATIO * along as f64 {
            (rods.0..rods.1).for_each(|j| self.number_rod(j, nodes));
        } else if across > along {
            let middle = rods.0 + width / 2;
            self.dissect((rods.0, middle), nodes);
            self.dissect((middle + 1, rods.1), nodes);
            self.number_rod(middle, nodes);
        } else {
            let middle = nodes.0 + length / 2;
            self.dissect(rods, (nodes.0, middle));
            self.dissect(rods, (middle + 1, nodes.1));
            (rods.0..rods.1).for_each(|j| self.number_node(j, middle, |_| true));
        }
    }

    /// A rod's own unknowns, then those that are coupled.
    fn number_rod(&mut self, j: usize, nodes: (usize, usize)) {
        let coupled = self.coupled;
        let is_coupled = |c: usize| coupled[c];
        self.dissect_rod(j, nodes, |c| !is_coupled(c));
        (nodes.0..nodes.1).for_each(|i| self.number_node(j, i, is_coupled));
    }

    /// Nested dissection of the nodes of a rod, some components of each.
    fn dissect_rod(
        &mut self,
        j: usize,
        nodes: (usize, usize),
        some: impl Fn(usize) -> bool + Copy,
    ) {
        if nodes.0 == nodes.1 {
            return;
        }
        let middle = nodes.0 + (nodes.1 - nodes.0) / 2;
        self.dissect_rod(j, (nodes.0, middle), some);
        self.dissect_rod(j, (middle + 1, nodes.1), some);
        self.number_node(j, middle, some);
    }

    /// Some components of a node; not those of the joint tip, which follows.
    fn number_node(&mut self, j: usize, i: usize, some: impl Fn(usize) -> bool) {
        let own = match self.joined && i + 1 == self.nodes {
            true => 3,
            false => 6,
        };
        for c in (0..own).filter(|&c| some(c)) {
            self.numbers[j * self.nodes + i][c] = self.count;
            self.count += 1;
        }
    }
}

/// Calls `add` with row, column and value of the entries of one triangle of K and its border, some
/// of them in several parts: the same positions in the same order for all systems of a pattern.
pub fn for_each_matrix_entry(
    system: &System,
    unknowns: &UnknownNumbering,
    border: &[NodalField],
    first_border: usize,
    shift: f64,
    mut add: impl FnMut(usize, usize, f64),
) {
    let n = system.nodes();
    for j in 0..system.rods() {
        let (group, lane) = group_and_lane(j);
        let chain = &system.groups[group].matrix;
        for i in 0..n {
            let (own, next) = chain.blocks(i, lane);
            let mass = system.mass(j, i);
            let (here, ahead) = (
                unknowns.node_numbers(j, i),
                unknowns.node_numbers(j, (i + 1).min(n - 1)),
            );
            for r in 0..6 {
                add(here[r], here[r], shift * mass[r / 3]);
                for c in r..6 {
                    add(here[r], here[c], own[r][c]);
                }
                for c in 0..if i + 1 < n { 6 } else { 0 } {
                    add(here[r], ahead[c], next[r][c]);
                }
            }
            if let Some(spring) = system.node_coupling(j, i)
                && (unknowns.first_tip_unknown.is_none() || i + 1 < n)
            {
                let other = unknowns.node_numbers(j + 1, i);
                for c in (0..3).filter(|&c| unknowns.coupled[3 + c]) {
                    add(here[3 + c], other[3 + c], -spring[c]);
                }
            }
            if let Some(across) = system.gap_block(j, i) {
                let other = unknowns.node_numbers(j + 1, i);
                for (r, row) in across.iter().enumerate() {
                    for (c, value) in row.iter().enumerate() {
                        // The displacement of a joint tip meets itself, in either order.
                        let both = if here[r] == other[c] { 2.0 } else { 1.0 };
                        add(here[r], other[c], both * value);
                    }
                }
            }
        }
        for (k, row) in border.iter().enumerate() {
            for (i, forces) in row[j].iter().enumerate() {
                for (at, force) in unknowns.node_numbers(j, i).into_iter().zip(forces) {
                    add(at, first_border + k, *force);
                }
            }
        }
    }
    for k in 0..border.len() {
        add(first_border + k, first_border + k, 0.0);
    }
}

/// The pattern of a lower triangle with entries in these columns and rows, possibly repeated,
/// and the position of each of them in it.
pub fn lower_triangle(
    size: usize,
    entries: &[[usize; 2]],
) -> (SymbolicSparseColMat<usize>, Vec<usize>) {
    // Sorted by rows and then, in this order, by columns: the rows of each column ascend.
    let sorted = |by: usize, order: &mut dyn Iterator<Item = usize>| {
        let mut ends = vec![0; size + 1];
        entries.iter().for_each(|entry| ends[entry[by] + 1] += 1);
        for k in 0..size {
            ends[k + 1] += ends[k];
        }
        let mut sorted = vec![0; entries.len()];
        for k in order {
            let end = &mut ends[entries[k][by]];
            sorted[*end] = k;
            *end += 1;
        }
        (sorted, ends)
    };
    let (by_rows, _) = sorted(1, &mut (0..entries.len()));
    let (sorted, ends) = sorted(0, &mut by_rows.into_iter());
    let (mut starts, mut rows) = (vec![0], Vec::<usize>::new());
    let mut places = vec![0; entries.len()];
    let mut begin = 0;
    for &end in &ends[..size] {
        let column = &sorted[begin..end];
        begin = end;
        let start = rows.len();
        for &k in column {
            let row = entries[k][1];
            if rows[start..].last() != Some(&row) {
                rows.push(row);
            }
            places[k] = rows.len() - 1;
        }
        starts.push(rows.len());
    }
    let pattern = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
    (pattern, places)
}
