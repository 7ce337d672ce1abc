//! The forces by which a parameter change unbalances a leaf, and the linear response to them.

use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Field, Increment, State};
use glam::DVec3;

/// The effect of a parameter change in a fixed state. Unaffected rods have no entries.
#[derive(Clone, Debug)]
pub struct Forces {
    /// On the unbalanced forces at the nodes.
    pub nodes: Field,
    /// On the gaps of the segments (residuals of their constitutive laws).
    pub gaps: Vec<Vec<DVec3>>,
    /// On the energy.
    pub energy: f64,
    /// Increments of held nodes. Rods on which it moves none have no entries.
    pub moved: Field,
}

/// The linear response of a leaf to forces.
#[derive(Clone, Debug)]
pub struct Response {
    /// Increments of the nodes.
    pub nodes: Field,
    /// Changes of the spatial forces of the segments, rod after rod.
    pub carried: Vec<DVec3>,
}

impl Forces {
    /// Zero, for `rods` rods.
    pub fn zeros(rods: usize) -> Forces {
        Forces {
            nodes: vec![Vec::new(); rods],
            gaps: vec![Vec::new(); rods],
            energy: 0.0,
            moved: vec![Vec::new(); rods],
        }
    }

    /// The forces on the nodes of rod `j`, of which `count` have equations.
    pub fn on_nodes(&mut self, j: usize, count: usize) -> &mut [Increment] {
        let nodes = &mut self.nodes[j];
        nodes.resize(count, [0.0; 6]);
        nodes
    }

    /// The effects on the gaps of rod `j`, which has `segments` of them.
    pub fn on_gaps(&mut self, j: usize, segments: usize) -> &mut [DVec3] {
        let gaps = &mut self.gaps[j];
        gaps.resize(segments, DVec3::ZERO);
        gaps
    }

    /// Adds `times` other forces.
    pub fn add(&mut self, times: f64, other: &Forces) {
        for (j, (nodes, gaps)) in other.nodes.iter().zip(&other.gaps).enumerate() {
            let count = nodes.len().max(self.nodes[j].len());
            add_nodes(self.on_nodes(j, count), times, nodes);
            let count = gaps.len().max(self.gaps[j].len());
            let sums = self.on_gaps(j, count);
            (sums.iter_mut().zip(gaps)).for_each(|(sum, more)| *sum += times * *more);
        }
        self.energy += times * other.energy;
        for (moved, more) in self.moved.iter_mut().zip(&other.moved) {
            moved.resize(moved.len().max(more.len()), [0.0; 6]);
            add_nodes(moved, times, more);
        }
    }

    /// Forces on all nodes and effects on all gaps of the rods of `leaf`, zeros included.
    pub fn dense(&self, leaf: &DiscreteLeaf) -> (Field, Vec<DVec3>) {
        let (segments, count) = (leaf.segments(), leaf.moving_nodes().len());
        let mut gaps = vec![DVec3::ZERO; self.gaps.len() * segments];
        for (all, own) in gaps.chunks_mut(segments.max(1)).zip(&self.gaps) {
            all[..own.len()].copy_from_slice(own);
        }
        let rod = |nodes: &Vec<Increment>| match nodes.is_empty() {
            true => vec![[0.0; 6]; count],
            false => nodes.clone(),
        };
        (self.nodes.iter().map(rod).collect(), gaps)
    }
}

impl Response {
    /// Zero, for the rods of `leaf`.
    pub fn zeros(leaf: &DiscreteLeaf) -> Response {
        Response {
            nodes: vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()],
            carried: vec![DVec3::ZERO; leaf.rods() * leaf.segments()],
        }
    }

    /// Moves a state, but not clamped bases, by `step` times the response.
    pub fn advance(&self, state: &mut State, step: f64) {
        for (j, rod) in self.nodes.iter().enumerate() {
            let first = state.base(j) + state.segments() + 1 - rod.len();
            for (i, increment) in rod.iter().enumerate() {
                state.advance(first + i, increment, step);
            }
        }
        let forces = state.n.iter_mut().zip(&self.carried);
        forces.for_each(|(force, change)| *force += step * *change);
    }

    /// The increment of node `i` of rod `j` of `leaf`; zero for a clamped base.
    pub fn of_node(&self, leaf: &DiscreteLeaf, j: usize, i: usize) -> Increment {
        let known = i.checked_sub(leaf.first_node());
        known.map_or([0.0; 6], |k| self.nodes[j][k])
    }

    /// Adds `times` another response.
    pub fn add(&mut self, times: f64, other: &Response) {
        for (sums, more) in self.nodes.iter_mut().zip(&other.nodes) {
            add_nodes(sums, times, more);
        }
        let carried = self.carried.iter_mut().zip(&other.carried);
        carried.for_each(|(sum, more)| *sum += times * *more);
    }
}

fn add_nodes(sums: &mut [Increment], times: f64, more: &[Increment]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        (sum.iter_mut().zip(more)).for_each(|(sum, more)| *sum += times * more);
    }
}
