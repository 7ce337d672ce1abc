//! Newton's equations of the leaf, solved rod by rod.
//!
//! K = B + E, where B holds every rod's own chain (its neighbours standing
//! still) meeting in the joint tip, and E the coupling between neighbours. B is
//! factorised in linear time, and conjugate gradients preconditioned by it
//! take care of E, which is weak beside a rod's own stiffness ([`solve`]).

mod solve;

pub use solve::Solved;

use super::chain::{RodMatrix, TipFactor};
use super::discrete::DiscreteLeaf;
use super::state::{Field, Increment, shift, turn};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// From this many nodes on, rods are shared out among threads. Measured: below
/// it waking the threads costs more than they bring.
const PARALLEL_NODES: usize = 8192;

/// What an assembly sums up over all rods.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Potential energy: of the strains, the coupling and the loads.
    pub energy: f64,
    /// Largest rotation between the ends of a segment.
    pub turn: f64,
}

/// All that belongs to one rod.
#[derive(Clone, Debug)]
pub(crate) struct RodSystem {
    pub matrix: RodMatrix,
    /// Nodal masses: rotary, translational.
    pub mass: Vec<[f64; 2]>,
    /// Right-hand side; with a joint tip, the last displacement slot holds
    /// the rod's share of the tip's.
    pub rhs: Vec<Increment>,
    /// Solution, nodes 1 to n, complete.
    pub solution: Vec<Increment>,
    pub sums: Sums,
    residual: Vec<Increment>,
    z: Vec<Increment>,
    b_p: Vec<Increment>,
    e_p: Vec<Increment>,
    partial: f64,
}

/// The linear system of a leaf, with room for all of its solution.
#[derive(Clone, Debug)]
pub struct System {
    pub(crate) rods: Vec<RodSystem>,
    p: Vec<Vec<Increment>>,
    pub(super) joined: bool,
    coupled: bool,
    pub(super) parallel: bool,
    pub(super) segments: usize,
    tip: Option<TipFactor>,
    /// E: coupling of gap g at nodes 1..n, none where the leaf has none.
    pub(super) springs: Vec<Vec<DVec3>>,
    /// Spatial dead moment on the tip of a single rod, as of the last assembly.
    pub(super) moment: DVec3,
}

/// Runs `f` over the rods, on all threads if `parallel`. Each rod works on its
/// own data only and sums are taken in the order of the rods afterwards, so
/// that the result does not depend on the number of threads.
pub(super) fn each_rod<T: Send>(parallel: bool, rods: &mut [T], f: impl Fn(usize, &mut T) + Sync) {
    if parallel {
        let rods = rods.par_iter_mut().enumerate();
        rods.for_each(|(j, rod)| f(j, rod));
    } else {
        let rods = rods.iter_mut().enumerate();
        rods.for_each(|(j, rod)| f(j, rod));
    }
}

impl System {
    /// Room for the equations of `leaf`.
    pub fn new(leaf: &DiscreteLeaf) -> Self {
        let (rods, n) = (leaf.rods(), leaf.segments());
        // The tip of a single rod is its own.
        let joined = leaf.leaf.joined() && rods > 1;
        let zeros = || vec![[0.0; 6]; n];
        let coupled = leaf.coupled();
        let springs = |g: usize| {
            // A node in the plane of the mirror does not answer a pull across it.
            let answer = match leaf.leaf.in_plane(g) {
                true => DVec3::new(1.0, 0.0, 1.0),
                false => DVec3::ONE,
            };
            (1..=n).map(|i| answer * leaf.spring(g - 1, i)).collect()
        };
        System {
            rods: (0..rods)
                .map(|j| RodSystem {
                    matrix: RodMatrix::new(n, joined, leaf.leaf.planar),
                    mass: (1..=n).map(|i| leaf.mass(j, i)).collect(),
                    rhs: zeros(),
                    solution: zeros(),
                    sums: Sums::default(),
                    residual: zeros(),
                    z: zeros(),
                    b_p: zeros(),
                    e_p: zeros(),
                    partial: 0.0,
                })
                .collect(),
            p: vec![zeros(); rods],
            joined,
            coupled,
            parallel: rods * n >= PARALLEL_NODES && rods > 1 && rayon::current_num_threads() > 1,
            segments: n,
            tip: None,
            springs: match coupled {
                true => (1..rods).map(springs).collect(),
                false => Vec::new(),
            },
            moment: DVec3::ZERO,
        }
    }

    /// Whether its nodes move in space, not only in a plane.
    pub fn spatial(&self) -> bool {
        matches!(self.rods[0].matrix, RodMatrix::Spatial(..))
    }

    /// Adds to the equations of node `i` (from 1) of rod `j`: to the matrix a
    /// rotary and a translational part on its diagonal, to the right-hand side
    /// a moment and a force. What inertia adds in a time step.
    pub fn add(&mut self, j: usize, i: usize, matrix: (DMat3, f64), rhs: (DVec3, DVec3)) {
        let rod = &mut self.rods[j];
        let block = &mut rod.matrix.spatial_mut().diagonal[i - 1];
        let increment = &mut rod.rhs[i - 1];
        for c in 0..3 {
            for r in 0..3 {
                block[r][c] += matrix.0.col(c)[r];
            }
            block[3 + c][3 + c] += matrix.1;
            increment[c] += rhs.0[c];
            increment[3 + c] += rhs.1[c];
        }
    }

    /// The right-hand side of node `i` (from 1) of rod `j`: moment and force
    /// on it, or on the joint tip the rod's share of it.
    pub fn unbalanced(&self, j: usize, i: usize) -> (DVec3, DVec3) {
        let rhs = &self.rods[j].rhs[i - 1];
        (turn(rhs), shift(rhs))
    }

    /// Makes the last solution the right-hand side, times the mass matrix and
    /// scaled to a largest component of one: a step of inverse iteration.
    pub fn iterate_mode(&mut self) {
        let (turn, shift) = self.largest();
        let scale = 1.0 / turn.max(shift);
        for rod in &mut self.rods {
            for ((rhs, solution), m) in rod.rhs.iter_mut().zip(&rod.solution).zip(&rod.mass) {
                for c in 0..6 {
                    rhs[c] = m[c / 3] * solution[c] * scale;
                }
            }
        }
    }

    /// A right-hand side without any symmetry, the same on all grids, to begin
    /// inverse iteration with.
    pub fn seed_mode(&mut self) {
        // Multiples of the golden ratio spread evenly: no symmetry, no chance.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let segments = self.segments as f64;
        for (j, rod) in self.rods.iter_mut().enumerate() {
            for (i, (rhs, m)) in rod.rhs.iter_mut().zip(&rod.mass).enumerate() {
                for c in 0..6 {
                    let along = (i + 1) as f64 / segments;
                    rhs[c] = m[c / 3] * (golden(12 * j + c + 1) + along * golden(12 * j + c + 7));
                }
            }
        }
    }

    /// Whether K + shift M is positive definite already without the coupling,
    /// which can only add to it: then no eigenvalue is negative. Overwrites
    /// the matrix.
    pub fn stable_without_coupling(&mut self, shift: f64) -> bool {
        for (j, rod) in self.rods.iter_mut().enumerate() {
            for gap in [j.wrapping_sub(1), j] {
                let springs = self.springs.get(gap).into_iter().flatten();
                for (block, spring) in rod.matrix.spatial_mut().diagonal.iter_mut().zip(springs) {
                    for c in 0..3 {
                        block[3 + c][3 + c] -= spring[c];
                    }
                }
            }
        }
        self.factorize(shift)
    }

    /// The right-hand side as of the last assembly.
    pub fn rhs(&self) -> Field {
        self.rods.iter().map(|rod| rod.rhs.clone()).collect()
    }

    /// Puts another right-hand side in its place.
    pub fn set_rhs(&mut self, rhs: &Field) {
        for (rod, rhs) in self.rods.iter_mut().zip(rhs) {
            rod.rhs.copy_from_slice(rhs);
        }
    }

    /// The last solution.
    pub fn solution(&self) -> Field {
        self.rods.iter().map(|rod| rod.solution.clone()).collect()
    }

    /// Puts other increments in its place.
    pub fn set_solution(&mut self, increments: &Field) {
        for (rod, increments) in self.rods.iter_mut().zip(increments) {
            rod.solution.copy_from_slice(increments);
        }
    }

    /// The mass matrix times increments.
    pub fn momentum(&self, increments: &Field) -> Field {
        let of = |(v, m): (&Increment, &[f64; 2])| std::array::from_fn(|c| m[c / 3] * v[c]);
        let rods = self.rods.iter().zip(increments);
        rods.map(|(rod, v)| v.iter().zip(&rod.mass).map(of).collect())
            .collect()
    }

    /// Largest rotation and largest displacement of the last solution.
    pub fn largest(&self) -> (f64, f64) {
        let (mut turn, mut shift) = (0.0_f64, 0.0_f64);
        for increment in self.rods.iter().flat_map(|rod| &rod.solution) {
            for c in 0..3 {
                turn = turn.max(increment[c].abs());
                shift = shift.max(increment[3 + c].abs());
            }
        }
        (turn, shift)
    }

    /// Kinetic energy at unit density of the given nodal velocities.
    pub fn kinetic_energy(&self, velocity: &[Vec<Increment>]) -> f64 {
        let of = |(v, m): (&Increment, &[f64; 2])| {
            0.5 * (m[0] * dot(&v[..3], &v[..3]) + m[1] * dot(&v[3..], &v[3..]))
        };
        let rods = self.rods.iter().zip(velocity);
        rods.map(|(rod, v)| v.iter().zip(&rod.mass).map(of).sum::<f64>())
            .sum()
    }

    /// Writes the velocity that covers `part` of the last solution in `dt`.
    pub fn velocity(&self, part: f64, dt: f64, velocity: &mut [Vec<Increment>]) {
        for (rod, velocity) in self.rods.iter().zip(velocity) {
            for (v, d) in velocity.iter_mut().zip(&rod.solution) {
                *v = d.map(|d| part * d / dt);
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
