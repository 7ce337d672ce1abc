//! Small vibrations of a leaf at rest: its stiffness and mass matrices, dense, and its modes.

use std::ops::Range;

use glam::DMat3;
use leafdyn::internals::leaf::{DirectSolver, DiscreteLeaf, Leaf, State, System};
use leafdyn::internals::modes::{Eigenpair, ModeRequest, lowest};
use leafdyn::internals::motion::Physics;
use nalgebra::{DMatrix, DVector};

use crate::Limit;
use crate::motion::discrete;

/// A leaf in a state, whose segments bear what their strains say, with its unknowns numbered:
/// turns about and shifts along the lab axes. Clamped bases have none; a joint tip is one point.
pub struct Linear {
    numbers: DirectSolver,
    rods: usize,
    nodes: Range<usize>,
    stiffness: DMatrix<f64>,
    /// One over the root of the mass matrix.
    pub per_root_mass: DMatrix<f64>,
}

impl Linear {
    pub fn new(leaf: &DiscreteLeaf, physics: &Physics, state: &State) -> Self {
        let mut state = state.clone();
        leaf.strain_forces(&mut state);
        let mut system = System::new(leaf);
        leaf.assemble(&state, &mut system);
        let numbers = DirectSolver::new(&system).unwrap();
        let zeros = DMatrix::zeros(numbers.size(), numbers.size());
        let mut linear = Linear {
            rods: leaf.rods(),
            nodes: leaf.moving_nodes(),
            stiffness: zeros.clone(),
            per_root_mass: zeros,
            numbers,
        };
        for k in 0..linear.numbers.size() {
            let node = |j: usize, i: usize| {
                let numbers = linear.numbers.unknowns(j, i);
                numbers.map(|number| f64::from(u8::from(number == k)))
            };
            let rod = |j: usize| leaf.moving_nodes().map(|i| node(j, i)).collect();
            let field = (0..linear.rods).map(rod).collect();
            let forces = linear.numbers.product(&system, &field);
            let column = linear.numbered(|j, i| forces[j][i - leaf.first_node()]);
            linear.stiffness.set_column(k, &column);
        }
        linear.add_masses(leaf, physics, &state);
        linear
    }

    fn add_masses(&mut self, leaf: &DiscreteLeaf, physics: &Physics, state: &State) {
        let mut masses = vec![0.0; self.numbers.size()];
        for (j, i) in leaf.rod_index_pairs(leaf.moving_nodes()) {
            let node = state.base(j) + i;
            let [turn, _, _, shift, ..] = self.numbers.unknowns(j, i);
            let inertia = physics.inertia(leaf, j, i);
            let frame = DMat3::from_quat(state.q[node]);
            let root = DMat3::from_diagonal(inertia.principal.map(f64::sqrt).recip());
            let root = frame * root * frame.transpose();
            for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
                self.per_root_mass[(turn + r, turn + c)] = root.col(c)[r];
            }
            masses[shift] += inertia.mass;
        }
        for (shift, mass) in masses.into_iter().enumerate() {
            for c in (0..3).filter(|_| mass > 0.0) {
                self.per_root_mass[(shift + c, shift + c)] = mass.sqrt().recip();
            }
        }
    }

    /// Stiffness over mass, symmetric.
    pub fn scaled(&self) -> DMatrix<f64> {
        &self.per_root_mass * &self.stiffness * &self.per_root_mass
    }

    /// Increments of nodes, or forces on them, as one vector; of a joint tip the first rod's.
    pub fn numbered(&self, node: impl Fn(usize, usize) -> [f64; 6]) -> DVector<f64> {
        let mut all = DVector::zeros(self.numbers.size());
        for j in (0..self.rods).rev() {
            for i in self.nodes.clone() {
                for (at, part) in self.numbers.unknowns(j, i).into_iter().zip(node(j, i)) {
                    all[at] = part;
                }
            }
        }
        all
    }
}

/// The lowest modes of a leaf in a state.
pub fn modes(leaf: &Leaf, state: &State, count: usize, near: &[Vec<[f64; 6]>]) -> Vec<Eigenpair> {
    let grid = discrete(leaf, state.segments());
    let mut state = state.clone();
    grid.strain_forces(&mut state);
    let wanted = ModeRequest {
        count,
        modes_below: None,
        accuracy: 1e-7,
        approximate_modes: near,
        time: &Limit::default(),
    };
    lowest(&grid, &Physics::new(leaf), &state, wanted).unwrap()
}

/// The state displaced by a mode, the largest turn or shift being `size`.
pub fn displaced(state: &State, mode: &Eigenpair, size: f64) -> State {
    let largest = mode
        .shape
        .iter()
        .flatten()
        .fold(0.0, |m: f64, x| m.max(x.abs()));
    let mut displaced = state.clone();
    for (node, increment) in mode.shape.iter().enumerate() {
        displaced.advance_node(node, increment, size / largest);
    }
    displaced
}
