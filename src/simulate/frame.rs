//! A leaf at an instant, in the units of its scenario.

use crate::leaf::Leaf;
use crate::motion::{Energy, Physics, Snapshot, Velocity};
use crate::shape::weights;
use glam::{DQuat, DVec3};

/// Number of nodes for cubic interpolation.
const CUBIC: usize = 4;

/// A leaf at an instant, in the units of its scenario. Nodes are numbered rod
/// by rod, base to tip.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time.
    pub time: f64,
    /// Number of time steps so far.
    pub steps: usize,
    /// Number of rods.
    pub rods: usize,
    /// Positions of all nodes.
    pub positions: Vec<DVec3>,
    /// Rotations of all nodes.
    pub rotations: Vec<DQuat>,
    /// Velocities of all nodes, along the lab axes.
    pub velocities: Vec<Velocity>,
    /// Energies.
    pub energy: Energy,
}

impl Frame {
    pub(super) fn new(leaf: &Leaf, physics: &Physics, snapshot: &Snapshot, steps: usize) -> Self {
        let (length, time, energy) = (leaf.scale.length, physics.time, leaf.scale.moment());
        let velocity = |v: &Velocity| Velocity {
            angular: v.angular / time,
            linear: v.linear * (length / time),
        };
        Frame {
            time: snapshot.time * time,
            steps,
            rods: leaf.rods(),
            positions: snapshot.state.x.iter().map(|x| *x * length).collect(),
            rotations: snapshot.state.q.clone(),
            velocities: snapshot.velocity.iter().map(velocity).collect(),
            energy: snapshot.energy.map(|e| e * energy),
        }
    }

    /// The same with nodes at the fractions `to` of the length, by cubic interpolation between
    /// those at the fractions `from`.
    pub fn at(&self, from: &[f64], to: &[f64]) -> Frame {
        let weights: Vec<_> = to.iter().map(|&at| weights(from, at, CUBIC)).collect();
        let mut there = Frame {
            positions: Vec::new(),
            rotations: Vec::new(),
            velocities: Vec::new(),
            ..self.clone()
        };
        for base in (0..self.rods).map(|rod| rod * from.len()) {
            for (first, weights) in &weights {
                let near = || (base + first..).zip(weights.iter().copied());
                let sum = |of: &dyn Fn(usize) -> DVec3| near().map(|(i, w)| w * of(i)).sum();
                // Quaternions of equal rotations may differ in sign: align them.
                let side = self.rotations[base + first];
                let rotation = near().fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, (i, w)| {
                    let q = self.rotations[i];
                    sum + q * w.copysign(w * q.dot(side))
                });
                there.positions.push(sum(&|i| self.positions[i]));
                there.rotations.push(rotation.normalize());
                there.velocities.push(Velocity {
                    linear: sum(&|i| self.velocities[i].linear),
                    angular: sum(&|i| self.velocities[i].angular),
                });
            }
        }
        there
    }

    /// Nodes of a rod: positions from base to tip.
    pub fn centerline(&self, rod: usize) -> &[DVec3] {
        let nodes = self.positions.len() / self.rods;
        &self.positions[rod * nodes..(rod + 1) * nodes]
    }

    /// The shared tip alone, or one tip per rod.
    pub fn tips(&self, joined: bool) -> Vec<DVec3> {
        let ends = self.positions.chunks(self.positions.len() / self.rods);
        let tips = ends.map(|rod| rod[rod.len() - 1]);
        tips.take(if joined { 1 } else { self.rods }).collect()
    }
}
