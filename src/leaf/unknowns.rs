//! Numbering of the unknowns, and positions of the matrix entries, in the sparse
//! factorisation.

use super::chain::group_and_lane;
use super::state::{Field, Increment};
use super::system::System;
use faer::sparse::SymbolicSparseColMat;

/// Blocks of the grid of rods and nodes no larger than this are not dissected.
const DISSECTION_LEAF: usize = 4;

/// The numbering of the unknowns of the nodes.
pub struct Unknowns {
    /// First unknown of node i (from 0) of rod j, at j n + i.
    first: Vec<usize>,
    /// First unknown of the joint tip.
    pub tip: Option<usize>,
    pub segments: usize,
    /// Number of unknowns.
    pub count: usize,
}

impl Unknowns {
    /// Ordered by nested dissection of the grid of rods and nodes, the joint tip last.
    pub fn new(system: &System) -> Self {
        let (rods, n) = (system.rods(), system.segments);
        let mut nodes = Vec::with_capacity(rods * n);
        dissect((0, rods), (0, n), &mut nodes);
        let mut first = vec![0; rods * n];
        let mut count = 0;
        for (j, i) in nodes {
            first[j * n + i] = count;
            count += if system.joined && i + 1 == n { 3 } else { 6 };
        }
        let tip = system.joined.then_some(count);
        count += if system.joined { 3 } else { 0 };
        Unknowns {
            first,
            tip,
            segments: n,
            count,
        }
    }

    /// Component `c` of node `i` (from 0) of rod `j`.
    pub fn at(&self, j: usize, i: usize, c: usize) -> usize {
        match self.tip {
            Some(tip) if i + 1 == self.segments && c >= 3 => tip + c - 3,
            _ => self.first[j * self.segments + i] + c,
        }
    }

    /// All six unknowns of a node.
    fn of(&self, j: usize, i: usize) -> [usize; 6] {
        std::array::from_fn(|c| self.at(j, i, c))
    }

    /// Adds the forces on a node to a vector of all unknowns.
    pub fn gather(&self, j: usize, i: usize, forces: &Increment, all: &mut [f64]) {
        for c in 0..6 {
            all[self.at(j, i, c)] += forces[c];
        }
    }

    /// The values at all nodes, from a vector of all unknowns.
    pub fn field(&self, all: &[f64]) -> Field {
        let node = |j: usize, i: usize| std::array::from_fn(|c| all[self.at(j, i, c)]);
        let rods = self.first.chunks_exact(self.segments).enumerate();
        rods.map(|(j, rod)| (0..rod.len()).map(|i| node(j, i)).collect())
            .collect()
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

/// Calls `add` with row, column and value of the entries of one triangle of K and its border, some
/// of them in several parts: the same positions in the same order for all systems of a pattern.
pub fn entries(
    system: &System,
    unknowns: &Unknowns,
    border: &[Field],
    first_border: usize,
    shift: f64,
    mut add: impl FnMut(usize, usize, f64),
) {
    let n = system.segments;
    for j in 0..system.rods() {
        let (group, lane) = group_and_lane(j);
        let chain = &system.groups[group].matrix;
        for i in 0..n {
            let (own, next) = chain.blocks(i, lane);
            let mass = system.mass(j, i);
            let (here, ahead) = (unknowns.of(j, i), unknowns.of(j, (i + 1).min(n - 1)));
            for r in 0..6 {
                add(here[r], here[r], shift * mass[r / 3]);
                for c in r..6 {
                    add(here[r], here[c], own[r][c]);
                }
                for c in 0..if i + 1 < n { 6 } else { 0 } {
                    add(here[r], ahead[c], next[r][c]);
                }
            }
            if let Some(spring) = system.spring(j, i)
                && (unknowns.tip.is_none() || i + 1 < n)
            {
                for c in 0..3 {
                    add(here[3 + c], unknowns.at(j + 1, i, 3 + c), -spring[c]);
                }
            }
        }
        for (k, row) in border.iter().enumerate() {
            for (i, forces) in row[j].iter().enumerate() {
                for (at, force) in unknowns.of(j, i).into_iter().zip(forces) {
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
    let mut columns = vec![Vec::new(); size];
    for (k, [column, row]) in entries.iter().enumerate() {
        columns[*column].push((*row, k));
    }
    let (mut starts, mut rows) = (vec![0], Vec::<usize>::new());
    let mut places = vec![0; entries.len()];
    for column in &mut columns {
        column.sort_unstable();
        let start = rows.len();
        for &(row, k) in &*column {
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
