//! Consistent initial conditions of a leaf at rest: its forces and accelerations and, where rigid
//! segments are strained, as those of arcs with different chords, positions without such strains.

use super::step::add_inertia;
use super::{Inertia, Moving, SemiImplicit};
use crate::largest::larger;
use crate::motion::unstrained::unstrained;
use glam::{DMat3, DVec3};

/// Inverse square of the length of a first step from rest, of implicit Euler, so short that the
/// leaf hardly moves. It determines the forces in rigid segments, which do not follow from
/// strains.
const INVERSE_STEP_SQUARED: f64 = 1e6;

/// Iterations of that step, and the size of the last.
const INITIAL_ITERATIONS: usize = 30;
const LAST: f64 = 1e-15;

/// Strain of a rigid segment, as a length, that may be due to rounding.
const VIOLATION: f64 = 1e-12;

/// Strain of a rigid segment, as a length, above which positions are not consistent.
const STRAINED: f64 = 1e-8;

impl SemiImplicit {
    /// Initialises the forces of the segments and the accelerations of the nodes.
    pub(super) fn initialise(&mut self) {
        self.apply_loads_and_damping(0.0, 0.0, INVERSE_STEP_SQUARED);
        let violation = self.leaf.strain_forces(&mut self.state);
        if self.leaf.least_compliance() > 0.0 {
            return self.set_accelerations();
        }
        if violation > VIOLATION {
            let strained = self.state.clone();
            if self.first_step() {
                std::mem::swap(&mut self.state, &mut self.trial);
            }
            let forces = self.state.n.clone();
            if self.leaf.strain_forces(&mut self.state) < STRAINED {
                self.state.n = forces;
            } else {
                self.state = strained;
                self.make_consistent();
                self.leaf.strain_forces(&mut self.state);
            }
        }
        match self.first_step() {
            true => {
                std::mem::swap(&mut self.state.n, &mut self.trial.n);
                for k in 0..self.state.x.len() {
                    let w = self.increment(k).map(|d| INVERSE_STEP_SQUARED * d);
                    self.moving[k] = Moving::at_rest(w);
                }
            }
            false => self.set_accelerations(),
        }
    }

    /// Moves the nodes slightly to a state with unstrained rigid segments, if there is one.
    fn make_consistent(&mut self) {
        let mut leaf = self.leaf.clone();
        leaf.sections.clone_from(&self.sections);
        if let Some(state) = unstrained(&leaf, &self.state) {
            self.state = state;
        }
    }

    /// A first step, into the trial; false if it failed.
    fn first_step(&mut self) -> bool {
        self.trial.clone_from(&self.state);
        for _ in 0..INITIAL_ITERATIONS {
            self.leaf.assemble(&self.trial, &mut self.system);
            self.add_drag(0.0, 0.0);
            let increments: Vec<_> = (0..self.state.x.len()).map(|k| self.increment(k)).collect();
            let (inertia, per_mass) = (&self.inertia, INVERSE_STEP_SQUARED);
            let inertial = |k: usize, tensor: &DMat3| {
                let [turn, shift] = increments[k];
                let moment = -per_mass * (*tensor * turn);
                (moment, -per_mass * inertia[k].mass * shift)
            };
            add_inertia(&mut self.system, &self.trial, inertia, per_mass, inertial);
            if !self.solve() {
                return false;
            }
            self.advance_trial();
            let (turn, shift) = self.system.largest();
            if larger(turn, shift) < LAST {
                break;
            }
        }
        self.trial.x.iter().all(|x| x.is_finite())
    }

    fn set_accelerations(&mut self) {
        self.leaf.assemble(&self.state, &mut self.system);
        self.trial.clone_from(&self.state);
        self.add_drag(0.0, 0.0);
        let n = self.leaf.segments();
        let joined = self.leaf.tips_move_together();
        let (mut tip_force, mut tip_mass) = (DVec3::ZERO, 0.0);
        for (j, i) in self.leaf.each(self.leaf.moving_nodes()) {
            let k = self.state.base(j) + i;
            let (moment, force) = self.system.unbalanced(j, i);
            let Inertia { mass, .. } = self.inertia[k];
            let tensor = self.inertia[k].tensor(self.state.q[k]);
            if i == n {
                tip_force += force;
                tip_mass += mass;
            }
            self.moving[k] = Moving::at_rest([tensor.inverse() * moment, force / mass]);
        }
        if joined {
            for j in 0..self.leaf.rods() {
                let k = self.state.base(j) + n;
                self.moving[k].w[1] = tip_force / tip_mass;
                self.moving[k].a[1] = tip_force / tip_mass;
            }
        }
    }
}
