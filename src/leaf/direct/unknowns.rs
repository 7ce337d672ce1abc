//! The numbering of the unknowns of a leaf's nodes, by nested dissection or rod after rod.

use crate::leaf::state::{Increment, NodalField};
use std::ops::Range;

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

/// The nodes with equations that are numbered, and which of their unknowns couple neighboring rods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberedNodes {
    pub rods: usize,
    /// Nodes of a rod that have equations.
    pub nodes: usize,
    /// Whether all tips are one point that moves.
    pub joined: bool,
    /// Unknowns of a node that are coupled with those of the next rod.
    pub coupled: [bool; 6],
    /// What ties neighbours, each with entries of its own: springs, tissue at nodes, cells of it.
    pub ties: [bool; 3],
}

/// The numbering of the unknowns of the nodes.
#[derive(Debug)]
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
    pub coupled: [bool; 6],
}

impl UnknownNumbering {
    /// Numbers the unknowns by nested dissection of the grid of rods and nodes, the joint tip last.
    pub fn new(of: NumberedNodes) -> Self {
        let NumberedNodes {
            rods,
            nodes: n,
            joined,
            coupled,
            ..
        } = of;
        let mut order = DissectionOrder {
            numbers: vec![[0; 6]; rods * n],
            count: 0,
            nodes: n,
            joined,
            coupled,
        };
        order.dissect(0..rods, 0..n);
        let DissectionOrder {
            mut numbers,
            mut count,
            ..
        } = order;
        let tip = joined.then_some(count);
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
