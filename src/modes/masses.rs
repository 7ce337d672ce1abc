//! The mass matrix: for every node an inertia tensor and a mass.

use crate::leaf::{DirectSolver, DiscreteLeaf, Increment, State, System, shift, turn};
use crate::motion::Physics;
use glam::{DMat3, DVec3};

/// Inertia of a node.
struct Node {
    /// Rod, and number of the node.
    index: (usize, usize),
    unknowns: [usize; 6],
    tensor: DMat3,
    mass: f64,
}

/// The mass matrix of a leaf, its unknowns numbered as in the pattern of its
/// stiffness. A shared tip has the masses of all rods' ends.
pub struct Masses {
    nodes: Vec<Node>,
}

impl Masses {
    /// The masses of the moving leaf, its nodes rotated as in `state`.
    pub fn new(
        leaf: &DiscreteLeaf,
        physics: &Physics,
        state: &State,
        pattern: &DirectSolver,
    ) -> Self {
        let node = |(j, i)| {
            let inertia = physics.inertia(leaf, j, i);
            let tensor = inertia.tensor(state.q[state.base(j) + i]);
            // Fixed components have no mass.
            let [turns, shifts] = leaf.moves(j, i);
            Node {
                index: (j, i),
                unknowns: pattern.unknowns(j, i),
                tensor: if turns { tensor } else { DMat3::ZERO },
                mass: if shifts { inertia.mass } else { 0.0 },
            }
        };
        let nodes = leaf.each(leaf.moving_nodes()).map(node).collect();
        Masses { nodes }
    }

    /// M v.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; v.len()];
        for node in &self.nodes {
            let [a, b, c, shifts @ ..] = node.unknowns;
            let turned = node.tensor * DVec3::new(v[a], v[b], v[c]);
            for (at, turned) in [a, b, c].into_iter().zip(turned.to_array()) {
                product[at] += turned;
            }
            for at in shifts {
                product[at] += node.mass * v[at];
            }
        }
        product
    }

    /// Adds `factor` M to the matrix of a system.
    pub fn add(&self, system: &mut System, factor: f64) {
        for node in &self.nodes {
            let ((j, i), none) = (node.index, (DVec3::ZERO, DVec3::ZERO));
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
    leaf.each(leaf.moving_nodes()).map(node).sum()
}
