//! The numbering of the unknowns of a leaf's nodes, by nested dissection or rod after rod, and the
//! entries of its matrix in that numbering.

use crate::leaf::block_tridiagonal::{NodeBlocks, RodLane, rod_lane};
use crate::leaf::state::{Increment, NodalField};
use crate::leaf::system::System;
use faer::sparse::SymbolicSparseColMat;
use std::ops::Range;

/// Why a matrix could not be factorized.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectError {
    /// The factors are too large for the memory that is allowed.
    Memory,
    /// A pivot is not a finite number: it has no sign.
    NotFinite,
}

/// Shapes of blocks of the grid of rods and nodes that are not dissected further.
const DISSECTION_LIMITS: DissectionLimits = DissectionLimits {
    block_size: 4,
    width_ratio: 2.5,
};

struct DissectionLimits {
    /// Largest number of nodes of a block that are numbered one after the other.
    block_size: usize,
    /// Ratio of width to length, in unknowns, from which on the rods of a block are eliminated one
    /// after the other.
    width_ratio: f64,
}

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
    /// Numbers the unknowns by nested dissection of the grid of rods and nodes, the joint tip last, for
    /// rods that are coupled by the unknowns `coupled` alone.
    pub fn new(system: &System, coupled: [bool; 6]) -> Self {
        let (rods, n) = (system.rods(), system.nodes());
        let mut order = DissectionOrder {
            numbers: vec![[0; 6]; rods * n],
            count: 0,
            nodes: n,
            joined: system.joined,
            coupled,
        };
        order.dissect(0..rods, 0..n);
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

/// A numbering that is being made.
struct DissectionOrder {
    numbers: Vec<[usize; 6]>,
    /// Number of unknowns that have a number.
    count: usize,
    /// Nodes of a rod that have equations.
    nodes: usize,
    joined: bool,
    coupled: [bool; 6],
}

impl DissectionOrder {
    /// Nested dissection of the nodes `nodes` of the rods `rods`: both halves first, then the line
    /// between them. The coupled unknowns of a rod alone separate its neighbors: its other unknowns
    /// precede them.
    fn dissect(&mut self, rods: Range<usize>, nodes: Range<usize>) {
        let (width, length) = (rods.len(), nodes.len());
        let axes = self.coupled.iter().filter(|&&coupled| coupled).count();
        let (across, along) = (6 * width, axes * length);
        if width == 0 || length == 0 {
        } else if width == 1 {
            self.dissect_rod(rods.start, nodes, |_| true);
        } else if width * length <= DISSECTION_LIMITS.block_size {
            for j in rods {
                (nodes.clone()).for_each(|i| self.number_node(j, i, |_| true));
            }
        } else if across as f64 >= DISSECTION_LIMITS.width_ratio * along as f64 {
            rods.for_each(|j| self.number_rod(j, nodes.clone()));
        } else if across > along {
            let middle = rods.start + width / 2;
            self.dissect(rods.start..middle, nodes.clone());
            self.dissect(middle + 1..rods.end, nodes.clone());
            self.number_rod(middle, nodes);
        } else {
            let middle = nodes.start + length / 2;
            self.dissect(rods.clone(), nodes.start..middle);
            self.dissect(rods.clone(), middle + 1..nodes.end);
            rods.for_each(|j| self.number_node(j, middle, |_| true));
        }
    }

    /// Numbers the unknowns of a rod that are not coupled with neighbors, then those that are.
    fn number_rod(&mut self, j: usize, nodes: Range<usize>) {
        let coupled = self.coupled;
        let is_coupled = |c: usize| coupled[c];
        self.dissect_rod(j, nodes.clone(), |c| !is_coupled(c));
        nodes.for_each(|i| self.number_node(j, i, is_coupled));
    }

    /// Nested dissection of the nodes of a rod, some components of each.
    fn dissect_rod(&mut self, j: usize, nodes: Range<usize>, some: impl Fn(usize) -> bool + Copy) {
        if nodes.is_empty() {
            return;
        }
        let middle = nodes.start + nodes.len() / 2;
        self.dissect_rod(j, nodes.start..middle, some);
        self.dissect_rod(j, middle + 1..nodes.end, some);
        self.number_node(j, middle, some);
    }

    /// Numbers some components of a node, without those of the joint tip, which follows.
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

/// Calls `add` with row, column and value of the entries of one triangle of K and its border. Some
/// entries come in several parts; positions and order are the same for all systems of a pattern.
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
        let RodLane { group, lane } = rod_lane(j);
        let chain = &system.groups[group].matrix;
        for i in 0..n {
            let NodeBlocks { own, next } = chain.node_blocks(i, lane);
            let mass = system.mass(j, i);
            let (here, ahead) = (
                unknowns.node_numbers(j, i),
                unknowns.node_numbers(j, (i + 1).min(n - 1)),
            );
            for r in 0..6 {
                add(here[r], here[r], shift * mass.of_component(r));
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
        for i in 0..n - 1 {
            let Some([ahead, crossing]) = system.cell_blocks(j, i) else {
                break;
            };
            let [here, next] = [i, i + 1].map(|i| unknowns.node_numbers(j, i));
            let [other, beyond] = [i, i + 1].map(|i| unknowns.node_numbers(j + 1, i));
            for (from, block, to) in [(here, ahead, beyond), (next, crossing, other)] {
                for (r, row) in block.iter().enumerate() {
                    for (c, value) in row.iter().enumerate() {
                        add(from[r], to[c], *value);
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

/// The pattern of the lower triangle of a matrix that is a sum of entries.
pub struct TrianglePattern {
    /// Rows of the nonzero entries of every column.
    pub pattern: SymbolicSparseColMat<usize>,
    /// Position in the pattern of each entry of the sum.
    pub places: Vec<usize>,
}

/// The pattern of a lower triangle with entries in these columns and rows, possibly repeated.
pub fn lower_triangle(size: usize, entries: &[[usize; 2]]) -> TrianglePattern {
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
    TrianglePattern {
        pattern: SymbolicSparseColMat::new_checked(size, size, starts, None, rows),
        places,
    }
}
