//! What a change of a leaf does to it, and how it answers.

use crate::leaf::state::{Field, Increment};
use glam::DVec3;

/// What a change of the leaf does in a state that is held. Rods that it does nothing to
/// have no entries.
#[derive(Clone, Debug)]
pub struct Forces {
    /// To the unbalanced forces on the nodes.
    pub nodes: Field,
    /// To the gaps of the segments.
    pub gaps: Vec<Vec<DVec3>>,
    /// To the energy.
    pub energy: f64,
    /// What it moves the tips by where they are held; none where it does not.
    pub tips: Vec<Increment>,
}

/// How a leaf answers forces.
#[derive(Clone, Debug)]
pub struct Response {
    /// Increments of the nodes.
    pub nodes: Field,
    /// Of the spatial forces of the segments, rod after rod.
    pub carried: Vec<DVec3>,
}

impl Forces {
    /// None on any of so many rods.
    pub fn none(rods: usize) -> Forces {
        Forces {
            nodes: vec![Vec::new(); rods],
            gaps: vec![Vec::new(); rods],
            energy: 0.0,
            tips: Vec::new(),
        }
    }

    /// Those on the nodes of rod `j`, which has so many.
    pub fn on_nodes(&mut self, j: usize, segments: usize) -> &mut [Increment] {
        let nodes = &mut self.nodes[j];
        nodes.resize(segments, [0.0; 6]);
        nodes
    }

    /// Those on the gaps of rod `j`, which has so many.
    pub fn on_gaps(&mut self, j: usize, segments: usize) -> &mut [DVec3] {
        let gaps = &mut self.gaps[j];
        gaps.resize(segments, DVec3::ZERO);
        gaps
    }

    /// Adds others, so many times.
    pub fn add(&mut self, times: f64, other: &Forces) {
        for (j, (nodes, gaps)) in other.nodes.iter().zip(&other.gaps).enumerate() {
            let count = nodes.len().max(self.nodes[j].len());
            add_nodes(self.on_nodes(j, count), times, nodes);
            let count = gaps.len().max(self.gaps[j].len());
            let sums = self.on_gaps(j, count);
            (sums.iter_mut().zip(gaps)).for_each(|(sum, more)| *sum += times * *more);
        }
        self.energy += times * other.energy;
        self.tips
            .resize(self.tips.len().max(other.tips.len()), [0.0; 6]);
        add_nodes(&mut self.tips, times, &other.tips);
    }

    /// On all nodes and all gaps of rods of so many segments.
    pub fn on_all(&self, segments: usize) -> (Field, Vec<DVec3>) {
        let mut gaps = vec![DVec3::ZERO; self.gaps.len() * segments];
        for (all, own) in gaps.chunks_mut(segments.max(1)).zip(&self.gaps) {
            all[..own.len()].copy_from_slice(own);
        }
        let rod = |nodes: &Vec<Increment>| match nodes.is_empty() {
            true => vec![[0.0; 6]; segments],
            false => nodes.clone(),
        };
        (self.nodes.iter().map(rod).collect(), gaps)
    }
}

impl Response {
    /// None of so many rods of so many segments.
    pub fn none(rods: usize, segments: usize) -> Response {
        Response {
            nodes: vec![vec![[0.0; 6]; segments]; rods],
            carried: vec![DVec3::ZERO; rods * segments],
        }
    }

    /// Adds another, so many times.
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
