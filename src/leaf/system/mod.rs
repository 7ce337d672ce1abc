//! Newton's equations of the leaf, solved rod by rod.
//!
//! K = B + E, where B consists of every rod's own block-tridiagonal matrix (with its
//! neighbours fixed) and the joint tip, and E is the coupling between neighbours. B is
//! factorised in linear time and preconditions conjugate gradients for K; E is weak compared
//! with a rod's own stiffness ([`solve`]).

mod across;
mod additions;
mod coupling;
mod kernels;
mod moments;
mod solve;

use self::moments::DeadMoments;
pub use solve::Solved;

use super::chain::{Chain, Increments, Masses, TipFactor, group_and_lane, of_lane, set_lane};
use super::discrete::DiscreteLeaf;
use super::state::{Field, Increment, shift, turn};
use crate::lanes::{Four, GROUP, widest_arch};
use crate::largest::larger;
use crate::rod::NodeBlock;
use glam::DVec3;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;

/// From this many nodes on, groups of rods are distributed over threads. Measured: below it
/// waking the threads costs more than it saves.
const PARALLEL_NODES: usize = 8192;

/// Sums, and a maximum, over all rods from an assembly.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Potential energy: of the strains, the coupling and the loads.
    pub energy: f64,
    /// Largest rotation between the ends of a segment.
    pub turn: f64,
}

/// The data of a group of rods, one rod in each lane. In a lane without a rod all increments
/// and forces are zero.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub matrix: Chain,
    /// One in lanes with a rod, zero in others.
    pub active: Four,
    /// Right-hand side; with a joint tip, the last displacement slots hold
    /// the rods' shares of the tip's.
    pub rhs: Vec<Increments>,
    /// Solution, all nodes with equations, complete.
    pub solution: Vec<Increments>,
    pub sums: Sums,
    /// Nodal masses per weight: rotary, translational.
    pub(super) masses: [Four; 2],
    /// E: coupling per weight with the previous rods, with the next.
    pub(super) coupling: [[Four; 3]; 2],
    pub(super) residual: Vec<Increments>,
    pub(super) z: Vec<Increments>,
    pub(super) b_p: Vec<Increments>,
    /// Whether the last factorisation succeeded.
    pub(super) definite: bool,
    /// Its part of a scalar product.
    pub(super) partial: f64,
}

/// The linear system of a leaf, with workspace for its solution.
#[derive(Clone, Debug)]
pub struct System {
    pub(crate) groups: Vec<Group>,
    pub(super) rods: usize,
    pub(super) p: Vec<Vec<Increments>>,
    pub(super) joined: bool,
    pub(super) coupled: bool,
    pub(super) parallel: bool,
    pub(super) segments: usize,
    /// The first node of a rod with equations, from which its nodes are numbered here.
    pub(super) first: usize,
    /// Weights of the nodes with equations in the masses.
    pub(super) weights: Vec<f64>,
    /// Weights of the nodes in E: zero at a joint tip and at hinged bases, which stay.
    pub(super) coupling_weights: Vec<f64>,
    pub(super) arch: Arch,
    pub(super) tip: Option<TipFactor>,
    /// Coupling of every gap per weight; empty if the leaf has no coupling.
    pub(super) gaps: Vec<DVec3>,
    /// The blocks between neighbouring rods, gap after gap, all nodes with equations; empty without tissue.
    pub(super) across: Vec<NodeBlock>,
    /// Nodes that hinges or grips hold, with the components that are: these have no momentum.
    pub(super) held: Vec<(usize, usize, Range<usize>)>,
    /// Spatial forces of the segments, beside those of the solution, that complete the law of nearly
    /// rigid ones; empty without any.
    pub(super) law_forces: Vec<DVec3>,
    /// Dead moments on the nodes of a single rod, as of the last assembly.
    pub(super) moments: DeadMoments,
}

/// Runs `f` over the groups, on all threads if `parallel`. Each group works on its
/// own data only and sums are taken in the order of the groups afterwards, so
/// that the result does not depend on the number of threads.
pub(super) fn each_group<T: Send>(
    parallel: bool,
    groups: &mut [T],
    f: impl Fn(usize, &mut T) + Sync,
) {
    if parallel {
        let groups = groups.par_iter_mut().enumerate();
        groups.for_each(|(g, group)| f(g, group));
    } else {
        let groups = groups.iter_mut().enumerate();
        groups.for_each(|(g, group)| f(g, group));
    }
}

/// The numbers of the rods of a group.
pub(super) fn rods_of(group: usize, rods: usize) -> Range<usize> {
    GROUP * group..rods.min(GROUP * (group + 1))
}

impl System {
    /// Allocates the equations of `leaf`.
    pub fn new(leaf: &DiscreteLeaf) -> Self {
        let (rods, nodes) = (leaf.rods(), leaf.moving_nodes());
        let (first, n) = (nodes.start, nodes.len());
        let joined = leaf.tips_move_together();
        let coupled = leaf.coupled() || leaf.tied();
        let gaps = match leaf.coupled() {
            true => coupling::of_gaps(leaf).collect(),
            false => Vec::new(),
        };
        let count = rods.div_ceil(GROUP);
        System {
            groups: (0..count).map(|g| Group::new(leaf, g, &gaps)).collect(),
            rods,
            p: vec![vec![Increments::default(); n]; count],
            joined,
            coupled,
            parallel: rods * n >= PARALLEL_NODES && count > 1 && rayon::current_num_threads() > 1,
            segments: leaf.segments(),
            first,
            weights: nodes.clone().map(|i| leaf.moving_weight(i)).collect(),
            coupling_weights: nodes
                .map(|i| if i == 0 { 0.0 } else { leaf.coupling_weight(i) })
                .collect(),
            arch: widest_arch(),
            tip: None,
            gaps,
            across: vec![Default::default(); if leaf.tied() { (rods - 1) * n } else { 0 }],
            held: (0..rods)
                .flat_map(|j| {
                    leaf.held_inside(j)
                        .map(move |(i, parts)| (j, i - first, parts))
                })
                .collect(),
            law_forces: Vec::new(),
            moments: DeadMoments::default(),
        }
    }

    /// Updates the coupling between rods, if there is any, from a leaf that otherwise differs
    /// from that of [`System::new`] only in what is assembled.
    pub fn set_coupling(&mut self, leaf: &DiscreteLeaf) {
        if !self.gaps.is_empty() {
            self.gaps.clear();
            self.gaps.extend(coupling::of_gaps(leaf));
            for (g, group) in self.groups.iter_mut().enumerate() {
                group.coupling = coupling::of_group(rods_of(g, self.rods), &self.gaps);
            }
        }
    }

    /// The equations of `leaf` in the memory of a `spare` system of the same leaf, if that is
    /// on a grid of as many segments.
    pub fn reused(spare: Option<System>, leaf: &DiscreteLeaf) -> Self {
        let fits = |spare: &System| {
            let same = (spare.rods, spare.segments) == (leaf.rods(), leaf.segments());
            same && spare.first == leaf.first_node()
        };
        spare.filter(fits).unwrap_or_else(|| System::new(leaf))
    }

    /// Number of rods.
    pub fn rods(&self) -> usize {
        self.rods
    }

    /// Segments of a rod.
    pub fn segments(&self) -> usize {
        self.segments
    }

    /// The first node of a rod with equations; fields begin with it.
    pub fn first(&self) -> usize {
        self.first
    }

    /// Number of nodes of a rod with equations.
    pub fn nodes(&self) -> usize {
        self.weights.len()
    }

    /// Whether neighbours are coupled, so that conjugate gradients are needed.
    pub fn coupled(&self) -> bool {
        self.coupled
    }

    /// Coupling of gap `g` at node `i` (from the first with equations), if there is one.
    pub(super) fn spring(&self, g: usize, i: usize) -> Option<DVec3> {
        Some(*self.gaps.get(g)? * self.coupling_weights[i])
    }

    /// Nodal mass of node `i` (from the first with equations) of rod `j`: rotary, translational.
    pub(super) fn mass(&self, j: usize, i: usize) -> [f64; 2] {
        let (group, lane) = group_and_lane(j);
        let masses = &self.groups[group].masses;
        masses.map(|mass| mass.0[lane] * self.weights[i])
    }

    /// The right-hand side of node `i` of rod `j`: moment and force on it; at a joint
    /// tip the rod's share.
    pub fn unbalanced(&self, j: usize, i: usize) -> (DVec3, DVec3) {
        let (group, lane) = group_and_lane(j);
        let rhs = of_lane(&self.groups[group].rhs[i - self.first], lane);
        (turn(&rhs), shift(&rhs))
    }

    /// Sets the right-hand side to the mass matrix times the last solution, scaled to a
    /// largest component of one: a step of inverse iteration.
    pub fn iterate_mode(&mut self) {
        let (turn, shift) = self.largest();
        let scale = 1.0 / turn.max(shift);
        let mut rhs = self.momentum(&self.solution());
        for value in rhs.iter_mut().flatten().flatten() {
            *value *= scale;
        }
        self.set_rhs(&rhs);
    }

    /// Sets a right-hand side without symmetry, the same on all grids, as the start of inverse
    /// iteration.
    pub fn seed_mode(&mut self) {
        // Multiples of the golden ratio are equidistributed: no symmetry, and deterministic.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let segments = self.segments as f64;
        let node = |j: usize, i: usize| {
            let along = (i + self.first) as f64 / segments;
            std::array::from_fn(|c| golden(12 * j + c + 1) + along * golden(12 * j + c + 7))
        };
        let rod = |j: usize| (0..self.nodes()).map(|i| node(j, i)).collect();
        let seed: Field = (0..self.rods).map(rod).collect();
        self.set_rhs(&self.momentum(&seed));
    }

    /// Whether K + shift M is positive definite even without the coupling, which is positive
    /// semidefinite: then no eigenvalue is negative. Not known with tissue. Overwrites the matrix.
    pub fn stable_without_coupling(&mut self, shift: f64) -> bool {
        if self.tied() {
            return false;
        }
        for group in &mut self.groups {
            for (i, weight) in self.coupling_weights.iter().enumerate() {
                for c in 0..3 {
                    let block = group.matrix.diagonal(i, 3 + c, 3 + c);
                    for (lane, value) in block.0.iter_mut().enumerate() {
                        let [previous, next] = group.coupling.map(|side| side[c].0[lane]);
                        *value -= (previous + next) * weight;
                    }
                }
            }
        }
        self.factorize(shift)
    }

    /// The right-hand side as of the last assembly.
    pub fn rhs(&self) -> Field {
        self.gather(|group| &group.rhs)
    }

    /// Replaces the right-hand side.
    pub fn set_rhs(&mut self, rhs: &Field) {
        self.scatter(rhs, |group| &mut group.rhs);
    }

    /// The last solution.
    pub fn solution(&self) -> Field {
        self.gather(|group| &group.solution)
    }

    /// The last solution at node `i` of rod `j`.
    pub fn increment(&self, j: usize, i: usize) -> Increment {
        let (group, lane) = group_and_lane(j);
        of_lane(&self.groups[group].solution[i - self.first], lane)
    }

    /// Replaces the last solution.
    pub fn set_solution(&mut self, increments: &Field) {
        self.law_forces.clear();
        self.scatter(increments, |group| &mut group.solution);
    }

    fn gather(&self, of: impl Fn(&Group) -> &Vec<Increments>) -> Field {
        let rod = |j: usize| {
            let (group, lane) = group_and_lane(j);
            let nodes = of(&self.groups[group]).iter();
            nodes.map(|node| of_lane(node, lane)).collect()
        };
        (0..self.rods).map(rod).collect()
    }

    fn scatter(&mut self, field: &Field, of: impl Fn(&mut Group) -> &mut Vec<Increments>) {
        for (j, rod) in field.iter().enumerate() {
            let (group, lane) = group_and_lane(j);
            for (node, of_rod) in of(&mut self.groups[group]).iter_mut().zip(rod) {
                set_lane(node, lane, of_rod);
            }
        }
    }

    /// The mass matrix times increments.
    pub fn momentum(&self, increments: &Field) -> Field {
        let node = |j: usize, (i, v): (usize, &Increment)| {
            let mass = self.mass(j, i);
            std::array::from_fn(|c| mass[c / 3] * v[c])
        };
        let rods = increments.iter().enumerate();
        let mut momentum: Field = rods
            .map(|(j, rod)| rod.iter().enumerate().map(|of| node(j, of)).collect())
            .collect();
        for (j, i, held) in &self.held {
            momentum[*j][*i][held.clone()].fill(0.0);
        }
        momentum
    }

    /// Largest rotation and largest displacement of the last solution; infinite if one is not a
    /// number.
    pub fn largest(&self) -> (f64, f64) {
        let mut largest = [Four::default(); 2];
        for increment in self.groups.iter().flat_map(|group| &group.solution) {
            for c in 0..6 {
                for (most, value) in largest[c / 3].0.iter_mut().zip(&increment[c].0) {
                    *most = larger(*most, value.abs());
                }
            }
        }
        let [turn, shift] = largest.map(|four| crate::largest::largest(four.0));
        (turn, shift)
    }

    /// Kinetic energy at unit density of the given nodal velocities.
    pub fn kinetic_energy(&self, velocity: &[Vec<Increment>]) -> f64 {
        let node = |j: usize, (i, v): (usize, &Increment)| {
            let mass = self.mass(j, i);
            0.5 * (mass[0] * turn(v).length_squared() + mass[1] * shift(v).length_squared())
        };
        let rods = velocity.iter().enumerate();
        rods.map(|(j, rod)| rod.iter().enumerate().map(|of| node(j, of)).sum::<f64>())
            .sum()
    }

    /// Writes the velocity that corresponds to the fraction `part` of the last solution in a
    /// time `dt`.
    pub fn velocity(&self, part: f64, dt: f64, velocity: &mut [Vec<Increment>]) {
        for (j, rod) in velocity.iter_mut().enumerate() {
            let (group, lane) = group_and_lane(j);
            for (v, d) in rod.iter_mut().zip(&self.groups[group].solution) {
                *v = of_lane(d, lane).map(|d| part * d / dt);
            }
        }
    }
}

impl Group {
    /// Allocates the equations of a group of the rods of `leaf`.
    fn new(leaf: &DiscreteLeaf, group: usize, gaps: &[DVec3]) -> Self {
        let n = leaf.moving_nodes().len();
        let zeros = vec![Increments::default(); n];
        let (mut active, mut masses) = (Four::default(), [Four::default(); 2]);
        for (lane, j) in rods_of(group, leaf.rods()).enumerate() {
            active.0[lane] = 1.0;
            for (four, mass) in masses.iter_mut().zip(leaf.mass_per_weight(j)) {
                four.0[lane] = mass;
            }
        }
        Group {
            matrix: Chain::new(n, leaf.tips_move_together()),
            active,
            rhs: zeros.clone(),
            solution: zeros.clone(),
            sums: Sums::default(),
            masses,
            coupling: coupling::of_group(rods_of(group, leaf.rods()), gaps),
            residual: zeros.clone(),
            z: zeros.clone(),
            b_p: zeros,
            definite: false,
            partial: 0.0,
        }
    }
}
