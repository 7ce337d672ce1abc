//! Shapes from which leaves start.

use glam::{DQuat, DVec3};
use leafdyn::relax::{NodeState, RodShape};
use pyo3::prelude::*;

/// The arrays of a leaf, one number after the other.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Start {
    pub stations: Vec<f64>,
    lengths: Vec<f64>,
    positions: Vec<f64>,
    rotations: Vec<f64>,
    forces: Vec<f64>,
}

impl Start {
    /// Its rods; strains and moments, which no start needs, are left out.
    pub fn rods(&self) -> Vec<RodShape> {
        let vector = |numbers: &[f64]| DVec3::from_slice(numbers);
        let node = |((x, q), n): ((&[f64], &[f64]), &[f64])| NodeState {
            position: vector(x),
            rotation: DQuat::from_xyzw(q[1], q[2], q[3], q[0]),
            v: DVec3::X,
            u: DVec3::ZERO,
            n: vector(n),
            m: DVec3::ZERO,
        };
        let positions = self.positions.chunks_exact(3);
        let nodes = positions.zip(self.rotations.chunks_exact(4));
        let mut nodes = nodes.zip(self.forces.chunks_exact(3)).map(node);
        let rods = self.lengths.iter().map(|&length| RodShape {
            length,
            nodes: nodes.by_ref().take(self.stations.len()).collect(),
        });
        rods.collect()
    }
}
