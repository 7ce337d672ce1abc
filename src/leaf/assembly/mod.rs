//! A discretised leaf's unbalanced forces, its matrix, its energy.

mod held;
mod planar;
mod spatial;

use super::chain::RodMatrix;
use super::discrete::DiscreteLeaf;
use super::state::State;
use super::system::{Sums, System, each_rod};
use glam::DVec3;

impl DiscreteLeaf {
    /// Assembles matrix and right-hand side of Newton's equations into
    /// `system`.
    pub fn assemble(&self, state: &State, system: &mut System) -> Sums {
        system.moment = self.tip_moment();
        each_rod(system.parallel, &mut system.rods, |j, rod| {
            let rhs = &mut rod.rhs;
            rod.sums = match &mut rod.matrix {
                RodMatrix::Spatial(chain, _) => {
                    let sums = self.assemble_spatial(j, state, chain, rhs);
                    self.hold_components(j, chain, rhs);
                    sums
                }
                RodMatrix::Planar(chain, _) => {
                    let sums = self.assemble_planar(j, state, chain, rhs);
                    self.hold_components(j, chain, rhs);
                    sums
                }
            };
        });
        let mut total = Sums::default();
        for rod in &system.rods {
            total.energy += rod.sums.energy;
            total.turn = total.turn.max(rod.sums.turn);
        }
        total
    }

    /// Writes the right-hand side of the change, to first order, if the rods
    /// had no compliance in the components `dropped` (ones and zeros).
    pub fn assemble_stiffening(&self, state: &State, dropped: DVec3, system: &mut System) {
        for (j, rod) in system.rods.iter_mut().enumerate() {
            rod.rhs.fill([0.0; 6]);
            match self.leaf.planar {
                false => self.stiffen_spatial(j, state, dropped, &mut rod.rhs),
                true => self.stiffen_planar(j, state, dropped, &mut rod.rhs),
            }
            self.clear_held_components(j, &mut rod.rhs);
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
