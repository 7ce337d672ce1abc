//! The whole matrix of the leaf as one sparse symmetric indefinite
//! factorisation: for the Morse index, and for Newton's method at a saddle.

use super::chain::place;
use super::state::{Field, Increment};
use super::system::System;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

/// Blocks of the grid of rods and nodes no larger than this are not dissected.
const DISSECTION_LEAF: usize = 4;

/// The pattern of a leaf's matrix: ordering and symbolic factorisation.
pub struct SparsePattern {
    symbolic: SymbolicCholesky<usize>,
    /// Of the lower triangle, where its [`entries`] stand, and how many there are.
    lower: (SymbolicSparseColMat<usize>, Argsort<usize>),
    entries: usize,
    unknowns: Unknowns,
    /// First of the rows that border the matrix, behind all others.
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

/// The matrix could not be factorised: too large for the memory there is.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the sparse factorisation of the leaf does not fit into memory")]
pub struct SparseError;

impl SparsePattern {
    /// Orders the unknowns by nested dissection of the grid of rods and nodes,
    /// the joint tip last, and factorises symbolically.
    pub fn new(system: &System) -> Result<Self, SparseError> {
        SparsePattern::bordered(system, 0)
    }

    /// The same with so many dense rows and columns at the end.
    pub fn bordered(system: &System, rows: usize) -> Result<Self, SparseError> {
        let (rods, n) = (system.rods(), system.segments);
        let mut nodes = Vec::with_capacity(rods * n);
        dissect((0, rods), (0, n), &mut nodes);
        let mut first = vec![0; rods * n];
        let mut size = 0;
        for (j, i) in nodes {
            first[j * n + i] = size;
            size += if system.joined && i + 1 == n { 3 } else { 6 };
        }
        let tip = system.joined.then_some(size);
        size += if system.joined { 3 } else { 0 };
        let border = size;
        size += rows;
        let unknowns = Unknowns {
            first,
            tip,
            segments: n,
        };
        let ones = vec![vec![vec![[1.0; 6]; n]; rods]; rows];
        let mut pairs = Vec::new();
        entries(system, &unknowns, &ones, border, 0.0, |a, b, _| {
            let (row, col) = (a.max(b), a.min(b));
            pairs.push(Pair { row, col });
        });
        let placed = |pairs: &[Pair<usize, usize>]| {
            SymbolicSparseColMat::try_new_from_indices(size, size, pairs).map_err(|_| SparseError)
        };
        let lower = placed(&pairs)?;
        for pair in &mut pairs {
            std::mem::swap(&mut pair.row, &mut pair.col);
        }
        // With its ordering given, faer reads the pattern of the upper triangle.
        let (upper, _) = placed(&pairs)?;
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
        .map_err(|_| SparseError)?;
        Ok(SparsePattern {
            symbolic,
            lower,
            entries: pairs.len(),
            unknowns,
            border,
            size,
        })
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// First unknown of the turn and of the shift of node `i` (from 1) of rod
    /// `j`. A joint tip has one shift for all rods.
    pub fn unknowns(&self, j: usize, i: usize) -> [usize; 2] {
        [0, 3].map(|c| self.unknowns.at(j, i - 1, c))
    }

    /// Factorises the matrix assembled in `system`, of the same leaf, plus
    /// `shift` times its mass matrix.
    pub fn factorize(&self, system: &System, shift: f64) -> Result<SparseFactor<'_>, SparseError> {
        self.factorize_bordered(system, shift, &[])
    }

    /// The same, bordered by as many rows as the pattern has, zero where they meet.
    pub fn factorize_bordered(
        &self,
        system: &System,
        shift: f64,
        border: &[Field],
    ) -> Result<SparseFactor<'_>, SparseError> {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = self.symbolic.raw() else {
            return Err(SparseError);
        };
        let (pattern, order) = &self.lower;
        let mut values = Vec::with_capacity(self.entries);
        let (unknowns, first_border) = (&self.unknowns, self.border);
        entries(
            system,
            unknowns,
            border,
            first_border,
            shift,
            |_, _, value| {
                values.push(value);
            },
        );
        let matrix = SparseColMat::new_from_argsort(pattern.clone(), order, &values);
        let matrix = matrix.map_err(|_| SparseError)?;
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
        let unknowns = &self.pattern.unknowns;
        let mut b = vec![0.0; self.pattern.size];
        for (j, rod) in system.rhs().iter().enumerate() {
            for (i, mut rhs) in rod.iter().copied().enumerate() {
                if let Some((velocity, per_step)) = inertia {
                    let mass = system.mass(j, i);
                    for c in 0..6 {
                        rhs[c] += mass[c / 3] * velocity[j][i][c] * per_step;
                    }
                }
                unknowns.gather(j, i, &rhs, &mut b);
            }
        }
        self.solve_vector(&mut b);
        system.set_solution(&self.increments(&b));
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
            increments: self.increments(&b),
            multipliers: b[self.pattern.border..].to_vec(),
        }
    }

    /// The increments of all nodes.
    fn increments(&self, all: &[f64]) -> Field {
        let unknowns = &self.pattern.unknowns;
        let rods = unknowns.first.chunks_exact(unknowns.segments).enumerate();
        let nodes = |j: usize| (0..unknowns.segments).map(move |i| unknowns.scatter(j, i, all));
        rods.map(|(j, _)| nodes(j).collect()).collect()
    }
}

/// Where the unknowns of the nodes stand.
struct Unknowns {
    /// First unknown of node i (from 0) of rod j, at j n + i.
    first: Vec<usize>,
    /// First unknown of the joint tip.
    tip: Option<usize>,
    segments: usize,
}

impl Unknowns {
    /// Component `c` of node `i` (from 0) of rod `j`.
    fn at(&self, j: usize, i: usize, c: usize) -> usize {
        match self.tip {
            Some(tip) if i + 1 == self.segments && c >= 3 => tip + c - 3,
            _ => self.first[j * self.segments + i] + c,
        }
    }

    /// Adds the forces on a node.
    fn gather(&self, j: usize, i: usize, forces: &Increment, all: &mut [f64]) {
        for c in 0..6 {
            all[self.at(j, i, c)] += forces[c];
        }
    }

    /// The increments of a node.
    fn scatter(&self, j: usize, i: usize, all: &[f64]) -> Increment {
        std::array::from_fn(|c| all[self.at(j, i, c)])
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

/// Tells where one triangle of K and its border has entries, some in several parts, and
/// how large they are: the same places in the same order for all systems of a pattern.
fn entries(
    system: &System,
    unknowns: &Unknowns,
    border: &[Field],
    first_border: usize,
    shift: f64,
    mut add: impl FnMut(usize, usize, f64),
) {
    let n = system.segments;
    for j in 0..system.rods() {
        let at = |i: usize, c: usize| unknowns.at(j, i, c);
        let (group, lane) = place(j);
        let chain = system.groups[group].matrix.spatial();
        for i in 0..n {
            let (own, next) = chain.blocks(i, lane);
            let mass = system.mass(j, i);
            for r in 0..6 {
                add(at(i, r), at(i, r), shift * mass[r / 3]);
                for c in r..6 {
                    add(at(i, r), at(i, c), own[r][c]);
                }
                for c in 0..if i + 1 < n { 6 } else { 0 } {
                    add(at(i, r), at(i + 1, c), next[r][c]);
                }
            }
            if let Some(spring) = system.spring(j, i)
                && (unknowns.tip.is_none() || i + 1 < n)
            {
                for c in 0..3 {
                    add(at(i, 3 + c), unknowns.at(j + 1, i, 3 + c), -spring[c]);
                }
            }
        }
        for (k, row) in border.iter().enumerate() {
            for (i, forces) in row[j].iter().enumerate() {
                for c in 0..6 {
                    add(at(i, c), first_border + k, forces[c]);
                }
            }
        }
    }
    for k in 0..border.len() {
        add(first_border + k, first_border + k, 0.0);
    }
}
