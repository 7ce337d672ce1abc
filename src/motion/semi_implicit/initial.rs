//! Consistent initial conditions of a leaf at rest: its forces and accelerations and, where rigid
//! segments are strained, as those of arcs with different chords, positions without such strains.

use super::curves::meeting;
use super::step::add_inertia;
use super::{Inertia, Moving, SemiImplicit};
use crate::leaf::{DiscreteLeaf, State};
use crate::newton::{Definite, Equations, Newton, Work};
use glam::{DMat3, DVec3};

/// Inverse square of the length of a first step from rest, of implicit Euler, so short that the
/// leaf hardly moves. It determines the forces in rigid segments, which do not follow from
/// strains.
const INVERSE_STEP_SQUARED: f64 = 1e6;

/// Iterations of that step, and the size of the last.
const ITERATIONS: usize = 30;
const LAST: f64 = 1e-15;

/// Strain of a rigid segment, as a length, that may be due to rounding.
const VIOLATION: f64 = 1e-12;

/// Strain of a rigid segment, as a length, above which positions are not consistent.
const STRAINED: f64 = 1e-8;

/// Squared frequencies of the springs that hold the nodes while their positions are made
/// consistent: stiff ones first; a straight vein that must buckle may need softer ones.
const HOLDS: [f64; 3] = [1e3, 30.0, 1.0];

/// Compliances (L^2/A) through which the leaf is made rigid: the first, the ratio of
/// successive ones, and the last.
const FIRST_COMPLIANCE: f64 = 0.1;
const COMPLIANCE_RATIO: f64 = 0.3;
const LAST_COMPLIANCE: f64 = 1e-9;

/// Iterations at each of them, and their accuracy.
const CONSISTENT_ITERATIONS: usize = 20;
const NEARLY_CONSISTENT: f64 = 1e-4;
const CONSISTENT: f64 = 1e-13;

impl SemiImplicit {
    /// Initialises the forces of the segments and the accelerations of the nodes.
    pub(super) fn initialise(&mut self) {
        self.apply_loads_and_damping(0.0, 0.0, INVERSE_STEP_SQUARED);
        let violation = self.leaf.strain_forces(&mut self.state);
        if self.leaf.stiffest() > 0.0 {
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

    /// Moves the nodes slightly to a state with unstrained rigid segments: the
    /// leaf is made rigid in steps, without loads, while springs in proportion to
    /// the masses hold its nodes. If that fails, since the side to which straight rods buckle is
    /// undetermined, the rods become curves with a common tip. If there are none, the nodes are
    /// not moved.
    fn make_consistent(&mut self) {
        let mut leaf = self.leaf.clone();
        leaf.sections.clone_from(&self.sections);
        leaf.load_factor = 0.0;
        let found = HOLDS.iter().find_map(|&rate| self.consistent(&leaf, rate));
        let held = leaf.leaf.held.is_some();
        let found = found.or_else(|| meeting(&leaf).filter(|_| !held));
        if let Some(state) = found {
            self.state = state;
        }
    }

    /// The equilibrium with springs of this `rate`, if there is one.
    fn consistent(&mut self, leaf: &DiscreteLeaf, rate: f64) -> Option<State> {
        let mut state = self.state.clone();
        let mut floor = FIRST_COMPLIANCE;
        leaf.softened(floor).strain_forces(&mut state);
        while floor > LAST_COMPLIANCE {
            self.hold(&leaf.softened(floor), &mut state, rate, NEARLY_CONSISTENT)?;
            floor *= COMPLIANCE_RATIO;
        }
        self.hold(leaf, &mut state, rate, CONSISTENT)?;
        Some(state)
    }

    /// Solves for the equilibrium of `leaf` with springs at the present positions of its nodes.
    fn hold(
        &mut self,
        leaf: &DiscreteLeaf,
        state: &mut State,
        rate: f64,
        accuracy: f64,
    ) -> Option<f64> {
        let newton = Newton {
            accuracy,
            iterations: CONSISTENT_ITERATIONS,
            work: &mut Work::default(),
            progress: &mut |_, _| {},
        };
        let held = Equations::Proximal {
            solver: &mut Definite::default(),
            at: &self.state,
            rate,
            largest: f64::INFINITY,
        };
        newton.solve(leaf, state, &mut self.system, held).ok()
    }

    /// A first step, into the trial; false if it failed.
    fn first_step(&mut self) -> bool {
        self.trial.clone_from(&self.state);
        for _ in 0..ITERATIONS {
            self.leaf.assemble(&self.trial, &mut self.system);
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
            if turn.max(shift) < LAST {
                break;
            }
        }
        self.trial.x.iter().all(|x| x.is_finite())
    }

    fn set_accelerations(&mut self) {
        self.leaf.assemble(&self.state, &mut self.system);
        let n = self.leaf.segments();
        let joined = self.leaf.tips_move_together();
        let (mut tip_force, mut tip_mass) = (DVec3::ZERO, 0.0);
        for (j, i) in self.leaf.each(1..=n) {
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
