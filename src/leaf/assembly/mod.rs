//! A discretised leaf's unbalanced forces, its matrix, its energy.

mod held;
mod planar;
mod spatial;

use super::chain::{Block, Chain, GroupMatrix, Increments, place, set_lane};
use super::discrete::DiscreteLeaf;
use super::state::{Increment, State};
use super::system::{Sums, System, each_group, rods_of};
use glam::DVec3;

impl DiscreteLeaf {
    /// Assembles matrix and right-hand side of Newton's equations into
    /// `system`.
    pub fn assemble(&self, state: &State, system: &mut System) -> Sums {
        system.moment = self.tip_moment();
        each_group(system.parallel, &mut system.groups, |g, group| {
            let rhs = &mut group.rhs;
            group.sums = Sums::default();
            for j in rods_of(g, self.rods()) {
                let sums = match &mut group.matrix {
                    GroupMatrix::Spatial(chain) => {
                        let sums = self.assemble_spatial(j, state, chain, rhs);
                        self.hold_components(j, chain, rhs);
                        sums
                    }
                    GroupMatrix::Planar(chain) => {
                        let sums = self.assemble_planar(j, state, chain, rhs);
                        self.hold_components(j, chain, rhs);
                        sums
                    }
                };
                group.sums.energy += sums.energy;
                group.sums.turn = group.sums.turn.max(sums.turn);
            }
        });
        let mut total = Sums::default();
        for group in &system.groups {
            total.energy += group.sums.energy;
            total.turn = total.turn.max(group.sums.turn);
        }
        total
    }

    /// Writes the right-hand side of the change, to first order, if the rods
    /// had no compliance in the components `dropped` (ones and zeros).
    pub fn assemble_stiffening(&self, state: &State, dropped: DVec3, system: &mut System) {
        let mut all = vec![vec![[0.0; 6]; self.segments()]; self.rods()];
        for (j, rhs) in all.iter_mut().enumerate() {
            match self.leaf.planar {
                false => self.stiffen_spatial(j, state, dropped, rhs),
                true => self.stiffen_planar(j, state, dropped, rhs),
            }
        }
        system.set_rhs(&all);
        for j in 0..self.rods() {
            self.clear_held_components(j, &mut system.groups[place(j).0].rhs);
        }
    }

    /// The state after `step` times the increments in `solution` (rod after
    /// rod, nodes 1 to n), written over `next`.
    pub fn advance(&self, state: &State, solution: &System, step: f64, next: &mut State) {
        next.clone_from(state);
        match self.leaf.planar {
            false => self.advance_spatial(state, solution, step, next),
            true => self.advance_planar(state, solution, step, next),
        }
    }

    /// Largest unbalanced nodal force or moment, or violation of the
    /// constitutive law (as length), of a state.
    pub fn residual(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut largest = 0.0_f64;
        let mut tip = DVec3::ZERO;
        for j in 0..self.rods() {
            let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                let (g_x, g_a, g_b) = segment.gradient(self.section(j, i));
                if i > 0 {
                    let (forces, moments) = self.unbalanced_residual(j, force + g_x, moment - g_a);
                    largest = largest.max(forces).max(moments);
                }
                force = self.load(state, j, i + 1).0 - g_x;
                moment = -g_b;
                largest = largest.max(segment.gap.abs().max_element());
            }
            moment += self.tip_moment();
            let (unbalanced_force, unbalanced_moment) = self.unbalanced_residual(j, force, moment);
            largest = largest.max(unbalanced_moment);
            tip += force;
            if !self.leaf.joined() {
                largest = largest.max(unbalanced_force);
            }
        }
        if self.leaf.joined() {
            if self.leaf.mirrored {
                tip.y = 0.0;
            }
            largest.max(tip.abs().max_element())
        } else {
            largest
        }
    }

    /// Potential energy of a state: elastic, of the coupling, and of the loads.
    /// The dead moment on a rod's tip has no potential and is left out.
    pub fn energy(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut energy = 0.0;
        for j in 0..self.rods() {
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                energy +=
                    self.section(j, i).elastic_energy(&segment) + self.load(state, j, i + 1).1;
            }
        }
        energy
    }
}

/// The equations of a node while its segments are assembled.
struct Node<const B: usize> {
    block: Block<B>,
    next: Block<B>,
    rhs: Increment,
}

impl<const B: usize> Default for Node<B> {
    fn default() -> Self {
        Node {
            block: [[0.0; B]; B],
            next: [[0.0; B]; B],
            rhs: [0.0; 6],
        }
    }
}

impl<const B: usize> Node<B> {
    /// Writes them for node `i` (from 0) of rod `j`.
    fn put(&self, i: usize, j: usize, chain: &mut Chain<B>, rhs: &mut [Increments]) {
        let lane = place(j).1;
        for r in 0..B {
            for c in 0..B {
                chain.off(i, r, c).0[lane] = self.next[r][c];
                if r <= c {
                    chain.diagonal(i, r, c).0[lane] = self.block[r][c];
                }
            }
        }
        set_lane(&mut rhs[i], lane, &self.rhs);
    }
}
