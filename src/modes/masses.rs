//! The mass matrix: a tensor for the turn of every node, a mass for its shift.

use crate::leaf::{DiscreteLeaf, Increment, SparsePattern, State, System, shift, turn};
use crate::motion::Physics;
use glam::{DMat3, DVec3};

/// Inertia of a node.
struct Node {
    /// Rod, number from 1.
    place: (usize, usize),
    unknowns: [usize; 2],
    tensor: DMat3,
    mass: f64,
}

/// The mass matrix of a leaf, its unknowns numbered as by the pattern of its
/// stiffness. A joint tip has the masses of all rods' ends.
pub struct Masses {
    nodes: Vec<Node>,
}

impl Masses {
    /// As they are in motion, the nodes turned as in `state`.
    pub fn new(
        leaf: &DiscreteLeaf,
        physics: &Physics,
        state: &State,
        pattern: &SparsePattern,
    ) -> Self {
        let node = |(j, i)| {
            let inertia = physics.inertia(leaf, j, i);
            let tensor = inertia.tensor(state.q[state.base(j) + i]);
            // What does not move has no part in any motion.
            let [turns, shifts] = leaf.moves(i);
            Node {
                place: (j, i),
                unknowns: pattern.unknowns(j, i),
                tensor: if turns { tensor } else { DMat3::ZERO },
                mass: if shifts { inertia.mass } else { 0.0 },
            }
        };
        let nodes = leaf.each(1..=leaf.segments()).map(node).collect();
        Masses { nodes }
    }

    /// M v.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; v.len()];
        for node in &self.nodes {
            let [turn, shift] = node.unknowns;
            let turned = node.tensor * DVec3::from_slice(&v[turn..turn + 3]);
            for c in 0..3 {
                product[turn + c] += turned[c];
                product[shift + c] += node.mass * v[shift + c];
            }
        }
        product
    }

    /// Adds `factor` M to the matrix of a system.
    pub fn add(&self, system: &mut System, factor: f64) {
        for node in &self.nodes {
            let ((j, i), none) = (node.place, (DVec3::ZERO, DVec3::ZERO));
            system.add(j, i, (node.tensor * factor, node.mass * factor), none);
        }
    }
}

/// The mass of a shape: twice its kinetic energy.
pub fn mass(leaf: &DiscreteLeaf, physics: &Physics, state: &State, shape: &[Increment]) -> f64 {
    let node = |(j, i)| {
        let inertia = physics.inertia(leaf, j, i);
        let k = state.base(j) + i;
        let (turn, shift) = (turn(&shape[k]), shift(&shape[k]));
        turn.dot(inertia.tensor(state.q[k]) * turn) + inertia.mass * shift.length_squared()
    };
    leaf.each(1..=leaf.segments()).map(node).sum()
}
