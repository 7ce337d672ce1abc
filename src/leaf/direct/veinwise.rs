//! The matrix of a leaf factorized vein after vein, without a general sparse solver.
//!
//! The rotations of a vein are eliminated node by node. That leaves a dense symmetric matrix T_j of its
//! displacements, by which alone a vein is coupled with the next one (diagonal matrices E_j), so that
//! the veins follow one another: S_1 = T_1 and S_j+1 = T_j+1 - E_j S_j^-1 E_j. Every S_j is inverted in
//! place by symmetric sweeps (J. H. Goodnight, A tutorial on the SWEEP operator, Am. Stat. 33, 1979):
//! a sweep of the pivots P turns the blocks [P B; B^T C] of a symmetric matrix into
//! [-P^-1 P^-1 B; B^T P^-1 C - B^T P^-1 B]. The displacement of a joint tip follows all others. By
//! Sylvester's law of inertia the pivots have as many negative eigenvalues as the matrix.
//!
//! The pivots are the rotation or the displacement of a node. Where one would let the other entries
//! grow, the matrix is left to the sparse factorization, which chooses its pivots.

use crate::leaf::block_tridiagonal::{Matrix3, NodeBlocks, RodLane, rod_lane};
use crate::leaf::direct::unknowns::UnknownNumbering;
use crate::leaf::system::System;
use crate::rod::NodeBlock;
use crate::simd::MAX_LANES;
use pulp::{Arch, Simd, WithSimd};

/// The matrix of a leaf, factorized vein after vein.
pub struct CondensedFactors {
    veins: Vec<CondensedRod>,
    /// Coupling of every vein with the next, at the displacements that are eliminated.
    coupling: Vec<Vec<f64>>,
    /// Minus the inverse of the matrix that is left for the displacement of a joint tip.
    tip: Option<Matrix3>,
    /// Number of negative pivots.
    negative: usize,
    /// Number of displacements of a vein.
    displacements_per_rod: usize,
    /// Number of displacements that are eliminated with their vein: without those of a joint tip.
    eliminated_displacements: usize,
    arch: Arch,
}

impl CondensedFactors {
    /// Factorizes the matrix assembled in `system` plus `shift` times its mass matrix. `None` if
    /// pivots are too small or not numbers.
    pub fn new(system: &System, shift: f64) -> Option<Self> {
        let mut work = Workspace::new(system);
        let (width, own) = (work.displacements_per_rod, work.eliminated_displacements);
        let mut condensed = CondensedFactors {
            veins: Vec::with_capacity(system.rods()),
            coupling: (1..system.rods())
                .map(|j| gap_coupling(system, j - 1, own))
                .collect(),
            tip: None,
            negative: 0,
            displacements_per_rod: width,
            eliminated_displacements: own,
            arch: system.arch,
        };
        for j in 0..system.rods() {
            let mut vein = CondensedRod::default();
            let before = j.checked_sub(1);
            let before = before.map(|k| PrecedingVein {
                vein: &condensed.veins[k],
                coupling: &condensed.coupling[k],
            });
            condensed.negative += vein.eliminate(system, shift, j, before, &mut work)?;
            symmetrize_matrix(&mut vein.swept, width);
            condensed.veins.push(vein);
        }
        if system.joined {
            let tip = invert_tip_block(condensed.veins.last()?, &work)?;
            condensed.negative += tip.negative;
            condensed.tip = Some(tip.minus_inverse);
        }
        Some(condensed)
    }

    /// The number of negative eigenvalues alone, without the factors. `None` as for
    /// [`CondensedFactors::new`].
    pub fn count_negative_eigenvalues(system: &System, shift: f64) -> Option<usize> {
        let mut work = Workspace::new(system);
        let [mut vein, mut last] = [(); 2].map(|()| CondensedRod::default());
        let mut negative = 0;
        let mut gap = Vec::new();
        for j in 0..system.rods() {
            let before = (j > 0).then_some(PrecedingVein {
                vein: &last,
                coupling: &gap,
            });
            negative += vein.eliminate(system, shift, j, before, &mut work)?;
            gap = gap_coupling(system, j, work.eliminated_displacements);
            std::mem::swap(&mut vein, &mut last);
        }
        if system.joined {
            negative += invert_tip_block(&last, &work)?.negative;
        }
        Some(negative)
    }

    /// Number of negative eigenvalues, by Sylvester's law of inertia.
    pub fn negative_eigenvalue_count(&self) -> usize {
        self.negative
    }

    /// Solves in place, with the unknowns numbered by `unknowns`. A step of iterative refinement makes the
    /// solution as accurate as one without inverse matrices.
    pub fn solve(&self, unknowns: &UnknownNumbering, b: &mut [f64]) {
        let mut x = b.to_vec();
        self.solve_unrefined(unknowns, &mut x);
        self.subtract_product(unknowns, &x, b);
        self.solve_unrefined(unknowns, b);
        b.iter_mut().zip(&x).for_each(|(b, x)| *b += x);
    }

    /// Solves in place without refinement.
    pub fn solve_unrefined(&self, unknowns: &UnknownNumbering, b: &mut [f64]) {
        self.arch.dispatch(CondensedSolve {
            condensed: self,
            unknowns,
            b,
        });
    }

    /// Subtracts the matrix times `x` from `b`.
    fn subtract_product(&self, unknowns: &UnknownNumbering, x: &[f64], b: &mut [f64]) {
        for (j, vein) in self.veins.iter().enumerate() {
            for (i, node) in vein.nodes.iter().enumerate() {
                let here = unknowns.node_numbers(j, i);
                let own = here.map(|k| x[k]);
                for (at, row) in here.iter().zip(&node.blocks.own) {
                    b[*at] -= row_product(row, &own);
                }
                if i + 1 < vein.nodes.len() {
                    let ahead = unknowns.node_numbers(j, i + 1);
                    let next = ahead.map(|k| x[k]);
                    for (r, row) in node.blocks.next.iter().enumerate() {
                        b[here[r]] -= row_product(row, &next);
                        for (at, value) in ahead.iter().zip(row) {
                            b[*at] -= value * own[r];
                        }
                    }
                }
                if j + 1 < self.veins.len() && 3 * i < self.eliminated_displacements {
                    let other = unknowns.node_numbers(j + 1, i);
                    for c in 0..3 {
                        let coupling = self.coupling[j][3 * i + c];
                        b[here[3 + c]] += coupling * x[other[3 + c]];
                        b[other[3 + c]] += coupling * x[here[3 + c]];
                    }
                }
            }
        }
    }
}

/// A row times a column.
fn row_product(row: &[f64; 6], values: &[f64; 6]) -> f64 {
    row.iter().zip(values).map(|(a, b)| a * b).sum()
}

/// The coupling of a vein with the next at the displacements that are eliminated with it.
fn gap_coupling(system: &System, j: usize, own: usize) -> Vec<f64> {
    let spring = |k: usize| {
        system
            .node_coupling(j, k / 3)
            .map_or(0.0, |spring| spring[k % 3])
    };
    (0..own).map(spring).collect()
}

/// Fills the lower triangle of a symmetric matrix of padded rows.
fn symmetrize_matrix(a: &mut [f64], width: usize) {
    let stride = padded_length(width);
    for r in 1..width {
        for c in 0..r {
            a[r * stride + c] = a[c * stride + r];
        }
    }
}

/// The elimination of a joint tip, after all veins.
struct TipElimination {
    /// Number of negative pivots.
    negative: usize,
    /// Minus the inverse of the matrix that is left for the tip.
    minus_inverse: Matrix3,
}

/// Eliminates a joint tip after the last vein. `None` if a pivot is too small.
fn invert_tip_block(last: &CondensedRod, work: &Workspace) -> Option<TipElimination> {
    let at = |k: usize| {
        (work.eliminated_displacements + k) * padded_length(work.displacements_per_rod)
            + work.eliminated_displacements
    };
    let entry = |r: usize, c: usize| last.swept[at(r.min(c)) + r.max(c)];
    let mut tip: Matrix3 = std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)));
    let scale = std::array::from_fn(|k| tip[k][k].abs());
    Some(TipElimination {
        negative: sweep_matrix3(&mut tip, scale)?,
        minus_inverse: tip,
    })
}

/// Solves for a vector of all unknowns, in place.
struct CondensedSolve<'a> {
    condensed: &'a CondensedFactors,
    unknowns: &'a UnknownNumbering,
    b: &'a mut [f64],
}

impl WithSimd for CondensedSolve<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let CondensedSolve {
            condensed,
            unknowns,
            b,
        } = self;
        let CondensedFactors {
            displacements_per_rod: width,
            eliminated_displacements: own,
            ..
        } = *condensed;
        let rods = condensed.veins.len();
        let mut turns = vec![[0.0; 3]; width / 3];
        // S^-1 times what is left for the displacements of every vein, then these themselves.
        let mut shifts = vec![0.0; rods * width];
        let mut load = vec![0.0; width];
        let mut tip = unknowns
            .first_tip_unknown
            .map_or([0.0; 3], |tip| [b[tip], b[tip + 1], b[tip + 2]]);
        for (j, vein) in condensed.veins.iter().enumerate() {
            load.fill(0.0);
            for (i, turn) in turns.iter_mut().enumerate() {
                let at = unknowns.node_numbers(j, i);
                for c in 0..3 {
                    turn[c] = b[at[c]];
                    if 3 * i < own {
                        load[3 * i + c] = b[at[3 + c]];
                    }
                }
            }
            vein.solve_rotations(&mut turns);
            for (i, turn) in turns.iter().enumerate() {
                let at = unknowns.node_numbers(j, i);
                for c in 0..3 {
                    b[at[c]] = turn[c];
                }
            }
            vein.subtract_rotations(&turns, &mut load);
            let (before, here) = shifts.split_at_mut(j * width);
            if j > 0 {
                let before = &before[(j - 1) * width..];
                for k in 0..own {
                    load[k] += condensed.coupling[j - 1][k] * before[k];
                }
            }
            let here = &mut here[..width];
            vein.multiply_swept(&load[..own], here);
            for c in 0..width - own {
                tip[c] += load[own + c] - here[own + c];
            }
            here[..own].iter_mut().for_each(|value| *value = -*value);
        }
        if let Some(inverse) = condensed.tip {
            tip = inverse.map(|row| -(row[0] * tip[0] + row[1] * tip[1] + row[2] * tip[2]));
            let first = unknowns.first_tip_unknown.expect("a joint tip has numbers");
            b[first..first + 3].copy_from_slice(&tip);
        }
        let mut product = vec![0.0; width];
        for (j, vein) in condensed.veins.iter().enumerate().rev() {
            let (here, next) = shifts.split_at_mut((j + 1) * width);
            let here = &mut here[j * width..];
            if j + 1 < rods {
                for k in 0..own {
                    load[k] = condensed.coupling[j][k] * next[k];
                }
                vein.multiply_swept(&load[..own], &mut product);
                for k in 0..own {
                    here[k] -= product[k];
                }
            }
            for (c, tip) in tip.iter().enumerate().take(width - own) {
                let column = &vein.swept[(own + c) * padded_length(width)..];
                for k in 0..own {
                    here[k] -= column[k] * tip;
                }
                here[own + c] = *tip;
            }
            vein.balancing_rotations(here, &mut turns);
            for (i, turn) in turns.iter().enumerate() {
                let at = unknowns.node_numbers(j, i);
                for c in 0..3 {
                    b[at[c]] -= turn[c];
                    if 3 * i < own {
                        b[at[3 + c]] = here[3 * i + c];
                    }
                }
            }
        }
    }
}

/// A vein of a factorized leaf.
#[derive(Default)]
struct CondensedRod {
    nodes: Vec<CondensedNode>,
    /// The swept matrix: -S^-1 and, in the columns of a joint tip, S^-1 times the matrix between
    /// the vein and the tip; rows padded, symmetric.
    swept: Vec<f64>,
}

/// A node of a vein.
struct CondensedNode {
    /// The blocks of the assembled matrix, that of the node complete.
    blocks: NodeBlocks,
    /// The inverse pivot of the rotation.
    inverse: Matrix3,
    /// The inverse pivot times the block between the rotation and that of the next node.
    inverse_times_next: Matrix3,
}

/// A vein that has been eliminated.
struct PrecedingVein<'a> {
    vein: &'a CondensedRod,
    /// Coupling with the next vein at the displacements that were eliminated.
    coupling: &'a [f64],
}

impl CondensedRod {
    /// Eliminates vein `j` after the vein `before` it; returns the number of negative pivots. Of the
    /// swept matrix the upper triangle is written.
    fn eliminate(
        &mut self,
        system: &System,
        shift: f64,
        j: usize,
        before: Option<PrecedingVein>,
        work: &mut Workspace,
    ) -> Option<usize> {
        self.assemble(system, j, shift, work.displacements_per_rod);
        system.arch.dispatch(RodElimination {
            vein: self,
            before,
            work,
        })
    }

    /// Writes the blocks of the matrix of vein `j`, and the upper triangle of the matrix of its
    /// displacements.
    fn assemble(&mut self, system: &System, j: usize, shift: f64, width: usize) {
        let RodLane { group, lane } = rod_lane(j);
        let chain = &system.groups[group].matrix;
        let (n, stride) = (system.nodes(), padded_length(width));
        self.nodes.clear();
        self.swept.clear();
        self.swept.resize(width * stride, 0.0);
        for i in 0..n {
            let mut blocks = chain.node_blocks(i, lane);
            let NodeBlocks { own, next } = &mut blocks;
            let mass = system.mass(j, i);
            for r in 0..6 {
                own[r][r] += shift * mass.of_component(r);
                for c in 0..r {
                    own[r][c] = own[c][r];
                }
            }
            if i + 1 == n {
                *next = NodeBlock::default();
            }
            for r in 0..3 {
                let row = &mut self.swept[(3 * i + r) * stride..][..width];
                row[3 * i..3 * i + 3].copy_from_slice(&own[3 + r][3..]);
                if i + 1 < n {
                    row[3 * i + 3..3 * i + 6].copy_from_slice(&next[3 + r][3..]);
                }
            }
            self.nodes.push(CondensedNode {
                blocks,
                inverse: Matrix3::default(),
                inverse_times_next: Matrix3::default(),
            });
        }
    }

    /// The swept matrix times a vector of the eliminated displacements.
    #[inline(always)]
    fn multiply_swept(&self, vector: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        let stride = padded_length(product.len());
        for (row, factor) in self.swept.chunks_exact(stride).zip(vector) {
            for (product, value) in product.iter_mut().zip(row) {
                *product += factor * value;
            }
        }
    }

    /// Solves for the rotations with the displacements held.
    #[inline(always)]
    fn solve_rotations(&self, turns: &mut [[f64; 3]]) {
        for (i, node) in self.nodes.iter().enumerate() {
            if i + 1 < self.nodes.len() {
                for c in 0..3 {
                    let passed: f64 = (0..3)
                        .map(|k| node.inverse_times_next[k][c] * turns[i][k])
                        .sum();
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
                let row = self.nodes[i].inverse_times_next[c];
                turns[i][c] -= row[0] * next[0] + row[1] * next[1] + row[2] * next[2];
            }
        }
    }

    /// Subtracts the forces by rotations of the nodes from `load`.
    #[inline(always)]
    fn subtract_rotations(&self, turns: &[[f64; 3]], load: &mut [f64]) {
        for (i, node) in self.nodes.iter().enumerate() {
            let NodeBlocks { own, next } = &node.blocks;
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
    fn balancing_rotations(&self, shifts: &[f64], turns: &mut [[f64; 3]]) {
        turns.fill([0.0; 3]);
        for (i, node) in self.nodes.iter().enumerate() {
            let NodeBlocks { own, next } = &node.blocks;
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
struct RodElimination<'a> {
    work: &'a mut Workspace,
    vein: &'a mut CondensedRod,
    before: Option<PrecedingVein<'a>>,
}

impl WithSimd for RodElimination<'_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<usize> {
        let RodElimination { work, vein, before } = self;
        let turns = eliminate_rotations(simd, vein, work)?;
        if let Some(before) = before {
            add_previous(&mut vein.swept, before, work)?;
        }
        Some(turns + sweep_out_displacements(simd, &mut vein.swept, work)?)
    }
}

/// Eliminates the rotations base to tip. Once the rotations before a node are eliminated, its rotation is
/// coupled with the displacements of all nodes up to the next.
#[inline(always)]
fn eliminate_rotations<S: Simd>(
    simd: S,
    vein: &mut CondensedRod,
    work: &mut Workspace,
) -> Option<usize> {
    let CondensedRod { nodes, swept } = vein;
    let width = work.displacements_per_rod;
    let stride = padded_length(width);
    for k in 0..width {
        work.diagonal_sizes[k] = swept[k * stride + k].abs();
    }
    let mut negative = 0;
    for i in 0..nodes.len() {
        let filled = (3 * (i + 2)).min(width);
        let mut pivot: Matrix3 = matrix3(|r, c| nodes[i].blocks.own[r][c]);
        let turn_scale = std::array::from_fn(|k| pivot[k][k].abs());
        match i.checked_sub(1).map(|k| &nodes[k]) {
            None => work.rows.fill(0.0),
            Some(previous) => {
                let (next, ahead) = (&previous.blocks.next, &previous.inverse_times_next);
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
        let NodeBlocks { own, next } = &nodes[i].blocks;
        for r in 0..3 {
            let row = &mut work.rows[r * stride..][..filled];
            for c in 0..3 {
                row[3 * i + c] += own[r][3 + c];
                if i + 1 < nodes.len() {
                    row[3 * (i + 1) + c] += next[r][3 + c];
                }
            }
        }
        negative += sweep_matrix3(&mut pivot, turn_scale)?;
        multiply_rows(simd, &pivot, &work.rows, &mut work.scaled);
        let (rows, scaled) = (split_three_rows(&work.rows), split_three_rows(&work.scaled));
        if !is_growth_bounded(rows, scaled, &work.diagonal_sizes, |_| false) {
            return None;
        }
        subtract_rank_three_product(simd, swept, rows, scaled, filled);
        nodes[i].inverse_times_next =
            matrix3(|r, c| -(0..3).map(|k| pivot[r][k] * next[k][c]).sum::<f64>());
        nodes[i].inverse = pivot.map(|row| row.map(|value| -value));
        std::mem::swap(&mut work.rows, &mut work.before);
    }
    Some(negative)
}

/// Adds to the matrix of a vein what the elimination of the preceding vein leaves, upper triangle.
/// `None` if that is too large.
#[inline(always)]
fn add_previous(swept: &mut [f64], before: PrecedingVein, work: &Workspace) -> Option<()> {
    let PrecedingVein { vein, coupling } = before;
    let Workspace {
        displacements_per_rod: width,
        eliminated_displacements: own,
        ..
    } = *work;
    let stride = padded_length(width);
    for a in 0..width {
        let factor = coupling.get(a).copied().unwrap_or(1.0);
        let row = &mut swept[a * stride..][..width];
        let from = &vein.swept[a * stride..][..width];
        let small = factor * from[a].abs() * factor <= MAX_PIVOT_GROWTH * work.diagonal_sizes[a];
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

/// The largest change of a diagonal entry of a matrix by the elimination of a pivot, in units of the
/// entry that was assembled. In a positive definite matrix it is less than one.
const MAX_PIVOT_GROWTH: f64 = 1e3;

/// Number of lanes to a multiple of which rows are padded, with zeros.
const ROW_PADDING: usize = MAX_LANES;

/// The matrix with these entries.
#[inline(always)]
fn matrix3(entry: impl Fn(usize, usize) -> f64) -> Matrix3 {
    std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)))
}

/// The length of a padded row.
fn padded_length(width: usize) -> usize {
    width.div_ceil(ROW_PADDING) * ROW_PADDING
}

/// Memory for the elimination of a vein.
struct Workspace {
    /// Number of displacements of a vein.
    displacements_per_rod: usize,
    /// Number of displacements that are eliminated with their vein: without those of a joint tip.
    eliminated_displacements: usize,
    /// Sizes of the diagonal entries that were assembled.
    diagonal_sizes: Vec<f64>,
    /// Three rows of the matrix, which belong to a node.
    rows: Vec<f64>,
    /// The rows of the node before.
    before: Vec<f64>,
    /// The rows times an inverse pivot.
    scaled: Vec<f64>,
    /// Whether the displacement of a node is eliminated.
    swept: Vec<bool>,
}

impl Workspace {
    fn new(system: &System) -> Self {
        let width = 3 * system.nodes();
        let rows = || vec![0.0; 3 * padded_length(width)];
        Workspace {
            displacements_per_rod: width,
            eliminated_displacements: if system.joined { width - 3 } else { width },
            diagonal_sizes: vec![0.0; width],
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
fn sweep_out_displacements<S: Simd>(simd: S, a: &mut [f64], work: &mut Workspace) -> Option<usize> {
    let Workspace {
        displacements_per_rod: width,
        eliminated_displacements: own,
        ..
    } = *work;
    let stride = padded_length(width);
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
            let own_scale = std::array::from_fn(|k| work.diagonal_sizes[first + k]);
            let Some(below_zero) = sweep_matrix3(&mut pivot, own_scale) else {
                continue;
            };
            multiply_rows(simd, &pivot, &work.rows, &mut work.scaled);
            let (columns, scaled) = (split_three_rows(&work.rows), split_three_rows(&work.scaled));
            let is_free = |i: usize| i / 3 == node || work.swept[i / 3];
            if !is_growth_bounded(columns, scaled, &work.diagonal_sizes, is_free) {
                continue;
            }
            negative += below_zero;
            subtract_rank_three_product(simd, a, columns, scaled, width);
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
fn split_three_rows(rows: &[f64]) -> [&[f64]; 3] {
    let stride = rows.len() / 3;
    [0, 1, 2].map(|r| &rows[r * stride..][..stride])
}

/// Minus a matrix times three rows.
#[inline(always)]
fn multiply_rows<S: Simd>(simd: S, factor: &Matrix3, rows: &[f64], product: &mut [f64]) {
    let [r0, r1, r2] = split_three_rows(rows).map(|row| S::as_simd_f64s(row).0);
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
fn subtract_rank_three_product<S: Simd>(
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

/// [`sweep_out_displacements`] of a matrix of three rows: minus its inverse.
#[inline(always)]
fn sweep_matrix3(a: &mut Matrix3, scale: [f64; 3]) -> Option<usize> {
    let mut swept = [false; 3];
    let mut negative = 0;
    for _ in 0..3 {
        // The pivot that is largest in its scale.
        let size = |k: &usize| a[*k][*k].abs() / scale[*k];
        let left = (0..3).filter(|&k| !swept[k]);
        let k = left.max_by(|i, k| size(i).total_cmp(&size(k)))?;
        let column = a.map(|row| row[k]);
        let pivot = column[k];
        let small = |i: usize| column[i] * column[i] <= MAX_PIVOT_GROWTH * scale[i] * pivot.abs();
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

/// Whether the product of three columns and three rows changes no diagonal entry by too much, but for
/// entries that are free to change. Not-a-number is too much.
#[inline(always)]
fn is_growth_bounded(
    [c0, c1, c2]: [&[f64]; 3],
    [z0, z1, z2]: [&[f64]; 3],
    scale: &[f64],
    is_free: impl Fn(usize) -> bool,
) -> bool {
    // Sizes of the three products: those of a pivot that is not definite may cancel.
    let change = |i: usize| (c0[i] * z0[i]).abs() + (c1[i] * z1[i]).abs() + (c2[i] * z2[i]).abs();
    (0..scale.len()).all(|i| is_free(i) || change(i) <= MAX_PIVOT_GROWTH * scale[i])
}
