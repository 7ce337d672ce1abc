//! The numbering of the unknowns of a leaf's nodes, by nested dissection or rod after rod, and the
//! entries of its matrix in that numbering.

use crate::leaf::block_tridiagonal::group_and_lane;
use crate::leaf::state::{Increment, NodalField};
use crate::leaf::system::System;
use faer::sparse::SymbolicSparseColMat;

/// Why a matrix could not be factorised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectError {
    /// It is too large for the memory that is allowed.
    Memory,
    /// A pivot is not a finite number: it has no sign.
    NotFinite,
}

/// Blocks of the grid of rods and nodes no larger than this are not dissected.
pub(super) const UNDISSECTED_BLOCK_SIZE: usize = 4;

/// Of a block this many times wider than it is long, in unknowns, the rods are eliminated one
/// after the other.
pub(super) const WIDE_BLOCK_RATIO: f64 = 2.5;

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
pub(super) struct DissectionOrder {
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
