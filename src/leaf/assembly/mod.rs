//! Assembly of a discretised leaf: unbalanced forces, matrix, energy.

mod held;
mod jumps;
mod kernels;

pub use self::jumps::{Jump, Tangent};

use self::kernels::{Advance, Assemble, Rods, Stiffen};
use super::chain::group_and_lane;
use super::discrete::DiscreteLeaf;
use super::state::State;
use super::system::{Sums, System, each_group, rods_of};
use crate::lanes::{GROUP, run};
use crate::largest::{larger, largest};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

impl DiscreteLeaf {
    /// Assembles matrix and right-hand side of Newton's equations into
    /// `system`.
    pub fn assemble(&self, state: &State, system: &mut System) -> Sums {
        self.assemble_with::<true>(state, system)
    }

    /// Assembles the right-hand side alone; the matrix is unchanged.
    pub fn assemble_forces(&self, state: &State, system: &mut System) -> Sums {
        self.assemble_with::<false>(state, system)
    }

    fn assemble_with<const MATRIX: bool>(&self, state: &State, system: &mut System) -> Sums {
        let arch = system.arch;
        system.law_forces.clear();
        each_group(system.parallel, &mut system.groups, |g, group| {
            let rods = Rods::new(self, state, g);
            run(arch, &mut Assemble::<MATRIX> { rods, group });
        });
        let mut total = Sums {
            energy: self.add_tissue(state, system, MATRIX)
                + self.add_own_loads(state, system)
                + self.base_energy(state),
            turn: 0.0,
        };
        self.add_moments(system);
        each_group(system.parallel, &mut system.groups, |g, group| {
            for j in rods_of(g, self.rods()) {
                self.clear_held_components(j, &mut group.rhs);
                if MATRIX {
                    self.hold_components(j, &mut group.matrix);
                }
            }
        });
        if MATRIX && self.tied() {
            self.hold_across(system);
        }
        for group in &system.groups {
            total.energy += group.sums.energy;
            total.turn = larger(total.turn, group.sums.turn);
        }
        total
    }

    /// Assembles the right-hand side for the first-order change if the rods had no compliance
    /// in the components `dropped` (ones and zeros).
    pub fn assemble_stiffening(&self, state: &State, dropped: DVec3, system: &mut System) {
        let arch = system.arch;
        each_group(system.parallel, &mut system.groups, |g, group| {
            let rods = Rods::new(self, state, g);
            let mut kernel = Stiffen {
                rods,
                dropped,
                group,
            };
            run(arch, &mut kernel);
        });
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[group_and_lane(j).0].rhs);
        }
    }

    /// Subtracts `times` the excess stiffness of the elements against rotations of their nodes
    /// from an assembled matrix.
    pub fn subtract_excess_stiffness(&self, state: &State, system: &mut System, times: f64) {
        let n = self.segments();
        let excess = |j: usize, i: usize| {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            0.5 * times * segment.excess_stiffness(self.section(j, i))
        };
        for j in 0..self.rods() {
            let mut before = 0.0;
            for i in 0..=n {
                let after = if i < n { excess(j, i) } else { 0.0 };
                if self.moves(j, i)[0] {
                    let matrix = DMat3::from_diagonal(DVec3::splat(-before - after));
                    system.add(j, i, (matrix, 0.0), (DVec3::ZERO, DVec3::ZERO));
                }
                before = after;
            }
        }
    }

    /// The state after `step` times the increments in `solution` (rod after
    /// rod, all nodes with equations), written over `next`.
    pub fn advance(&self, state: &State, solution: &System, step: f64, next: &mut State) {
        next.clone_from(state);
        if self.tied() {
            self.advance_tissue(state, solution, step, next);
        }
        let (n, arch) = (self.segments(), solution.arch);
        let (nodes, forces) = (GROUP * (n + 1), GROUP * n);
        let advance = |(g, ((x, q), n)): (usize, ((&mut [_], &mut [_]), &mut [_]))| {
            let rods = Rods::new(self, state, g);
            let solution = &solution.groups[g].solution;
            let mut kernel = Advance {
                rods,
                solution,
                step,
                x,
                q,
                n,
            };
            run(arch, &mut kernel);
        };
        match solution.parallel {
            true => (next.x.par_chunks_mut(nodes))
                .zip(next.q.par_chunks_mut(nodes))
                .zip(next.n.par_chunks_mut(forces))
                .enumerate()
                .for_each(advance),
            false => (next.x.chunks_mut(nodes))
                .zip(next.q.chunks_mut(nodes))
                .zip(next.n.chunks_mut(forces))
                .enumerate()
                .for_each(advance),
        }
        for (force, more) in next.n.iter_mut().zip(&solution.law_forces) {
            *force += step * *more;
        }
    }

    /// Largest unbalanced nodal force or moment, or violation of the
    /// constitutive law (as length), of a state.
    pub fn residual(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut largest = 0.0_f64;
        let mut tip = DVec3::ZERO;
        for j in 0..self.rods() {
            let turned = self.tissue_load(state, j, 0).moment + self.moment_on(0);
            let (mut force, mut moment) = (DVec3::ZERO, turned);
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                let (g_x, g_a, g_b) = segment.gradient(self.section(j, i));
                if i >= self.first_node() {
                    let (forces, moments) = self.unbalanced_residual(j, force + g_x, moment - g_a);
                    let [turned, held] = self.is_gripped(j, i);
                    let forces = if held { 0.0 } else { forces };
                    let moments = if turned { 0.0 } else { moments };
                    largest = larger(largest, larger(forces, moments));
                }
                let load = self.load(state, j, i + 1);
                force = load.force - g_x;
                moment = load.moment + self.moment_on(i + 1) - g_b;
                largest = larger(largest, component(segment.gap));
            }
            let (unbalanced_force, unbalanced_moment) = self.unbalanced_residual(j, force, moment);
            // The holder balances the remaining force on a held tip.
            let [turned, held] = self.is_gripped(j, n);
            match &self.leaf.held {
                _ if turned => continue,
                _ if held => {}
                Some(held) if held.clamps.is_some() => continue,
                Some(_) => {}
                None if self.leaf.joined() => tip += force,
                None => largest = larger(largest, unbalanced_force),
            }
            largest = larger(largest, unbalanced_moment);
        }
        if self.leaf.mirrored {
            tip.y = 0.0;
        }
        larger(largest, component(tip))
    }

    /// Potential energy of the loads and of the coupling at the bases: none where these are in the
    /// origin.
    fn base_energy(&self, state: &State) -> f64 {
        let apart = |j: usize| state.x[state.base(j)] != DVec3::ZERO;
        if !(0..self.rods()).any(apart) {
            return 0.0;
        }
        let of = |j: usize| self.load(state, j, 0).energy - self.tissue_load(state, j, 0).energy;
        (0..self.rods()).map(of).sum()
    }

    /// Potential energy of a state: elastic, of the coupling, and of the loads.
    /// Dead moments on a rod have no potential and are left out.
    pub fn energy(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut energy = self.base_energy(state);
        for (j, i) in self.each(0..1) {
            energy += self.tissue_load(state, j, i).energy;
        }
        for j in 0..self.rods() {
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                energy +=
                    self.section(j, i).elastic_energy(&segment) + self.load(state, j, i + 1).energy;
            }
        }
        energy
    }
}

/// The largest component of a vector.
pub(super) fn component(vector: DVec3) -> f64 {
    largest(vector.abs().to_array())
}
