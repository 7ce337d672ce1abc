//! A discretised leaf's unbalanced forces, its matrix, its energy.

use super::chain::{Block, Chain, RodMatrix, SPATIAL, turns};
use super::discrete::DiscreteLeaf;
use super::state::{Increment, State, shift, turn};
use super::system::{System, each_rod};
use crate::rod::Blocks;
use glam::{DMat3, DVec3};

/// What an assembly sums up over all rods.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Potential energy: of the strains, the coupling and the loads.
    pub energy: f64,
    /// Largest rotation between the ends of a segment.
    pub turn: f64,
}

impl DiscreteLeaf<'_> {
    /// Assembles matrix and right-hand side of Newton's equations into
    /// `system`.
    pub fn assemble(&self, state: &State, system: &mut System) -> Sums {
        let parallel = system.parallel();
        system.moment = self.tip_moment();
        each_rod(parallel, &mut system.rods, |j, rod| {
            let rhs = &mut rod.rhs;
            rod.sums = match &mut rod.matrix {
                RodMatrix::Spatial(chain, _) => {
                    let sums = self.assemble_spatial(j, state, chain, rhs);
                    self.confine(j, chain, rhs);
                    sums
                }
                RodMatrix::Planar(chain, _) => {
                    let sums = self.assemble_planar(j, state, chain, rhs);
                    self.confine(j, chain, rhs);
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

    /// Assembles rod `j` of a leaf in space.
    fn assemble_spatial(
        &self,
        j: usize,
        state: &State,
        chain: &mut Chain<SPATIAL>,
        rhs: &mut [Increment],
    ) -> Sums {
        let n = self.segments();
        let mut sums = Sums::default();
        for i in 0..n {
            let force = state.n[j * n + i];
            let section = self.section(j, i);
            let segment = self.segment(state, j, i, force);
            sums.energy += section.strain_energy(&segment);
            sums.turn = sums.turn.max(segment.turn());
            let (g_x, g_a, g_b) = segment.condensed_gradient(section);
            let blocks = segment.hessian(section);
            if i > 0 {
                add_left(&mut chain.diagonal[i - 1], &blocks);
                couple(&mut chain.off[i - 1], &blocks);
                add(&mut rhs[i - 1], -g_a, g_x);
            }
            set_right(&mut chain.diagonal[i], &blocks);
            let (load, potential) = self.bear(state, j, i + 1, &mut chain.diagonal[i]);
            sums.energy += potential;
            rhs[i] = [0.0; 6];
            add(&mut rhs[i], -g_b, load - g_x);
        }
        add(&mut rhs[n - 1], self.tip_moment(), DVec3::ZERO);
        sums
    }

    /// Adds the stiffness of the coupling of node `i` of rod `j` to its block;
    /// tells [`DiscreteLeaf::load`].
    #[inline]
    pub(super) fn bear<const B: usize>(
        &self,
        state: &State,
        j: usize,
        i: usize,
        block: &mut Block<B>,
    ) -> (DVec3, f64) {
        let turns = turns(B);
        for g in [j.wrapping_sub(1), j] {
            if g < self.rods() - 1 {
                let spring = self.spring(g, i);
                for c in 0..B - turns {
                    block[turns + c][turns + c] += spring[c];
                }
            }
        }
        if self.leaf.beside_image(j) {
            let across = turns + 1;
            block[across][across] += 2.0 * self.spring(j, i).y;
        }
        self.load(state, j, i)
    }

    /// Writes the right-hand side of the change, to first order, if the rods
    /// had no compliance in the components `dropped` (ones and zeros).
    pub fn assemble_stiffening(&self, state: &State, dropped: DVec3, system: &mut System) {
        for (j, rod) in system.rods.iter_mut().enumerate() {
            rod.rhs.fill([0.0; 6]);
            match self.planar {
                false => self.stiffen_spatial(j, state, dropped, &mut rod.rhs),
                true => self.stiffen_planar(j, state, dropped, &mut rod.rhs),
            }
            if self.mirrored {
                for i in 0..self.segments() {
                    for &c in self.forbidden(j, i + 1) {
                        rod.rhs[i][c] = 0.0;
                    }
                }
            }
        }
    }

    fn stiffen_spatial(&self, j: usize, state: &State, dropped: DVec3, rhs: &mut [Increment]) {
        let n = self.segments();
        for i in 0..n {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            let (g_x, g_a, g_b) = segment.stiffening_gradient(self.section(j, i), dropped);
            if i > 0 {
                add(&mut rhs[i - 1], -g_a, g_x);
            }
            add(&mut rhs[i], -g_b, -g_x);
        }
    }

    /// The state after `step` times the increments in `solution` (rod after
    /// rod, nodes 1 to n), written over `next`.
    pub fn advance(&self, state: &State, solution: &System, step: f64, next: &mut State) {
        let n = self.segments();
        next.clone_from(state);
        if self.planar {
            return self.advance_planar(state, solution, step, next);
        }
        for (j, rod) in solution.rods.iter().enumerate() {
            let base = state.base(j);
            let (mut a, mut dx0) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..n {
                let increment = &rod.solution[i];
                let (b, dx1) = (turn(increment), shift(increment));
                let force = state.n[j * n + i];
                let segment = self.segment(state, j, i, force);
                next.n[j * n + i] =
                    force + step * segment.force_increment(self.section(j, i), dx1 - dx0, a, b);
                next.advance(base + i + 1, increment, step);
                (a, dx0) = (b, dx1);
            }
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
                    let (forces, moments) = self.felt(j, force + g_x, moment - g_a);
                    largest = largest.max(forces).max(moments);
                }
                force = self.load(state, j, i + 1).0 - g_x;
                moment = -g_b;
                largest = largest.max(segment.gap.abs().max_element());
            }
            moment += self.tip_moment();
            let (force_felt, moment_felt) = self.felt(j, force, moment);
            largest = largest.max(moment_felt);
            tip += force;
            if !self.leaf.joined() {
                largest = largest.max(force_felt);
            }
        }
        if self.leaf.joined() {
            if self.mirrored {
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

#[inline]
fn add(increment: &mut [f64; 6], moment: DVec3, force: DVec3) {
    for c in 0..3 {
        increment[c] += moment[c];
        increment[3 + c] += force[c];
    }
}

#[inline]
fn place(block: &mut Block<SPATIAL>, row: usize, column: usize, k: &DMat3, sign: f64) {
    for c in 0..3 {
        let values = k.col(c);
        for r in 0..3 {
            block[row + r][column + c] = sign * values[r];
        }
    }
}

/// The block of a segment's right node.
#[inline]
fn set_right(block: &mut Block<SPATIAL>, k: &Blocks) {
    place(block, 0, 0, &k.bb, 1.0);
    place(block, 0, 3, &k.xb.transpose(), 1.0);
    place(block, 3, 0, &k.xb, 1.0);
    place(block, 3, 3, &k.xx, 1.0);
}

/// Adds the block of a segment's left node.
#[inline]
fn add_left(block: &mut Block<SPATIAL>, k: &Blocks) {
    let mut left = [[0.0; 6]; 6];
    place(&mut left, 0, 0, &k.aa, 1.0);
    place(&mut left, 0, 3, &k.xa.transpose(), -1.0);
    place(&mut left, 3, 0, &k.xa, -1.0);
    place(&mut left, 3, 3, &k.xx, 1.0);
    for r in 0..6 {
        for c in 0..6 {
            block[r][c] += left[r][c];
        }
    }
}

/// The block between a segment's left and right node.
#[inline]
fn couple(block: &mut Block<SPATIAL>, k: &Blocks) {
    place(block, 0, 0, &k.ab, 1.0);
    place(block, 0, 3, &k.xa.transpose(), 1.0);
    place(block, 3, 0, &k.xb, -1.0);
    place(block, 3, 3, &k.xx, -1.0);
}
