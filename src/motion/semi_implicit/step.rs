//! A time step.

use super::super::friction::rates;
use super::super::physics::Inertia;
use super::{SemiImplicit, Steps};
use crate::largest::larger;
use crate::leaf::{Loads, State, System};
use crate::newton::Work;
use crate::rotation;
use glam::{DMat3, DVec3};

/// Newton iterations in a step, and the size of the last (radians, lengths),
/// as a part of the permitted error and as an upper limit; for steps of given length.
const ITERATIONS: usize = 12;
const LAST_ITERATION: f64 = 1e-3;
const LARGEST_LAST: f64 = 1e-9;
const FIXED_LAST: f64 = 1e-12;

/// Iteration error if steps are only counted, as a part of the permitted error.
const LAST_TO_COUNT: f64 = 1e-2;

/// Relative accuracy of the conjugate gradients, and, if steps are only counted, as a part of the
/// permitted error: increments are less than one, so that this is noise far below it.
const CG_TOLERANCE: f64 = 1e-10;
const CG_TO_COUNT: f64 = 1e-2;

/// Largest rotation of a node in a step, radians.
const LARGEST_TURN: f64 = 0.5;

/// The stiffness with which the forces of rigid segments are condensed out is
/// at least this multiple of the resistance of inertia: iterations then converge
/// equally fast for all steps.
const STIFFER: f64 = 1e3;

impl SemiImplicit {
    /// Factorises and solves; false if the matrix is not positive definite.
    pub(super) fn solve(&mut self) -> bool {
        self.factorizations += 1;
        let mut uncounted = Work::default();
        let accuracy = match self.steps {
            Steps::ToCount(error) => CG_TO_COUNT * error,
            _ => CG_TOLERANCE,
        };
        self.solver
            .solve(&mut self.system, 0.0, None, accuracy, &mut uncounted)
            .is_ok()
    }

    /// Adds the solved increments to the trial.
    pub(super) fn advance_trial(&mut self) {
        let (leaf, next) = (&self.leaf, &mut self.next);
        leaf.advance(&self.trial, &self.system, 1.0, next);
        std::mem::swap(&mut self.trial, next);
    }

    /// Rotation and displacement of a node from the state to the trial; exactly zero for a held
    /// base or tip.
    pub(super) fn increment(&self, k: usize) -> [DVec3; 2] {
        let nodes = self.leaf.segments() + 1;
        let [turns, shifts] = self.leaf.moves(k / nodes, k % nodes);
        let turn = || rotation::log(self.trial.q[k] * self.state.q[k].conjugate());
        let shift = || self.trial.x[k] - self.state.x[k];
        [
            if turns { turn() } else { DVec3::ZERO },
            if shifts { shift() } else { DVec3::ZERO },
        ]
    }

    /// Motion at the end of a step of h that leads from the state to the trial.
    fn update_motion(&mut self, h: f64) {
        let nodes = self.leaf.segments() + 1;
        let w = self.weights;
        let (of_increment, of_mean) = (1.0 / (w.beta * h * h), 1.0 / (1.0 - w.alpha_f));
        let of_before = (0.5 - w.beta) / w.beta;
        let first = self.leaf.first_node();
        for k in (0..self.state.x.len()).filter(|k| k % nodes >= first) {
            let (m, d) = (self.moving[k], self.increment(k));
            let next = &mut self.next_moving[k];
            for c in 0..2 {
                let a1 = of_increment * (d[c] - h * m.v[c]) - of_before * m.a[c];
                let mean = (1.0 - w.alpha_m) * a1 + w.alpha_m * m.a[c];
                next.a[c] = a1;
                next.v[c] = m.v[c] + h * ((1.0 - w.gamma) * m.a[c] + w.gamma * a1);
                next.w[c] = of_mean * (mean - w.alpha_f * m.w[c]);
            }
        }
    }

    /// Attempts a step of h; returns its local error, or `None` if it was too long.
    pub(super) fn attempt(&mut self, h: f64) -> Option<f64> {
        let damping = self.physics.damping;
        let w = self.weights;
        let of_acceleration = (1.0 - w.alpha_m) / ((1.0 - w.alpha_f) * w.beta * h * h);
        let per_mass = of_acceleration + damping * w.gamma / (w.beta * h);
        self.apply_loads_and_damping(self.time + h, h, per_mass);
        self.correct_lag(h);
        self.predict(h);
        let last = match self.steps {
            Steps::Fixed(_) => FIXED_LAST,
            Steps::ToCount(error) => LAST_TO_COUNT * error,
            Steps::Error(allowed) => (LAST_ITERATION * allowed).min(LARGEST_LAST),
        };
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.update_motion(h);
            self.leaf.assemble(&self.trial, &mut self.system);
            self.add_drag(self.time + h, w.gamma / (w.beta * h));
            let (moving, inertia) = (&self.next_moving, &self.inertia);
            let inertial = |k: usize, tensor: &DMat3| {
                let m = &moving[k];
                let momentum = *tensor * m.v[0];
                let moment = *tensor * m.w[0] + m.v[0].cross(momentum) + damping * momentum;
                (-moment, -inertia[k].mass * (m.w[1] + damping * m.v[1]))
            };
            add_inertia(&mut self.system, &self.trial, inertia, per_mass, inertial);
            if !self.solve() {
                return None;
            }
            let (turn, shift) = self.system.largest();
            let size = larger(turn, shift);
            if !size.is_finite() || size > before.max(LARGEST_TURN) {
                return None;
            }
            self.advance_trial();
            let remaining = match self.steps {
                // Two iterations show how fast they converge: the size of the next one.
                Steps::ToCount(_) if before.is_finite() => size * size / before,
                _ => size,
            };
            if remaining <= last || (size < 1e-11 && size > 0.3 * before) {
                self.update_motion(h);
                return Some(self.local_error(h));
            }
            before = size;
        }
        None
    }

    fn local_error(&self, h: f64) -> f64 {
        let mut error: f64 = 0.0;
        for (next, now) in self.next_moving.iter().zip(&self.moving) {
            for c in 0..2 {
                error = larger(error, (next.a[c] - now.a[c]).length());
            }
        }
        // Local error: this times h^2 times the change of acceleration.
        error * (self.weights.beta - 1.0 / 6.0).abs() * h * h
    }

    /// Predicts the trial with constant accelerations.
    fn predict(&mut self, h: f64) {
        self.trial.clone_from(&self.state);
        for (k, m) in self.moving.iter().enumerate() {
            let d = |c: usize| h * m.v[c] + 0.5 * h * h * m.a[c];
            // If the prediction is far away, the present state is better.
            let turn = d(0);
            if turn.length() < LARGEST_TURN {
                self.trial.q[k] = (rotation::exp(turn) * self.trial.q[k]).normalize();
                self.trial.x[k] += d(1);
            }
        }
    }

    /// Corrects the auxiliary accelerations for an attempted step of `h`. Under a load that is
    /// linear in time that of a free body is the acceleration alpha_f - alpha_m steps ago, and
    /// then the method has the exact impulse of the load. Where the load changes its slope, or
    /// steps change their length, the lag is another one: without a correction a pulse of few
    /// steps would have another impulse, and go on acting in the longer steps after it.
    fn correct_lag(&mut self, h: f64) {
        if !self.physics.loads_change() {
            return;
        }
        let (now, w) = (self.time, self.weights);
        let [before, now, after] =
            [now - self.past_step, now, now + h].map(|t| self.physics.loads(t));
        let lag = ((after - now) - (now - before)) * (w.alpha_m - w.alpha_f);
        let change = lag - self.corrected;
        self.corrected = lag;
        if change != Loads::default() {
            self.accelerate(change);
        }
    }

    /// Adds the accelerations of free nodes under these loads.
    fn accelerate(&mut self, loads: Loads) {
        let n = self.leaf.segments();
        let force = |j: usize, i: usize| {
            let weight = self.leaf.grid.weight(i) * self.leaf.leaf.length(j);
            weight * self.leaf.leaf.share(j) * loads.gravity
        };
        let rods = 0..self.leaf.rods();
        // The shared tip, if there is one.
        let mut tip = (loads.tip_force, 0.0);
        for j in rods {
            tip.0 += force(j, n);
            tip.1 += self.inertia[self.state.base(j) + n].mass;
        }
        let together = self.leaf.tips_move_together();
        for (j, i) in self.leaf.each(1..=n) {
            let k = self.state.base(j) + i;
            let [_, shifts] = self.leaf.moves(j, i);
            let mass = self.inertia[k].mass;
            let linear = match i == n {
                true if together => tip.0 / tip.1,
                true => (force(j, i) + loads.tip_force) / mass,
                false => force(j, i) / mass,
            };
            if shifts {
                self.moving[k].a[1] += linear;
            }
        }
        for (node, moment) in self.leaf.moments_of(loads) {
            if self.leaf.moves(0, node)[0] {
                let tensor = self.inertia[node].tensor(self.state.q[node]);
                self.moving[node].a[0] += tensor.inverse() * moment;
            }
        }
    }

    /// Sets the leaf's loads and rest shapes at a time, and in its sections the
    /// internal friction of a step of `h` that ends then: with the strain
    /// rate c0 v + c1 v1 + c2 v2 from this and the last two strains, a rod is
    /// stiffer by 1 + eta c0 and has another rest shape. Inertia enters the matrix as
    /// `per_mass` times the masses.
    pub(super) fn apply_loads_and_damping(&mut self, time: f64, h: f64, per_mass: f64) {
        self.leaf.loads = self.physics.loads(time);
        let (rest, eta) = (self.physics.rest(time), self.physics.retardation);
        let [c0, c1, c2] = rates(h, self.past_step).map(|c| eta * c);
        let n = self.leaf.segments();
        let both = self.leaf.sections.iter_mut().zip(&self.sections);
        for (i, (section, own)) in both.enumerate() {
            *section = *own;
            section.rest_curvature *= rest;
            let stiffer = 1.0 + c0;
            if c0 > 0.0 {
                let before = |kind: usize| c1 * self.past[0][i][kind] + c2 * self.past[1][i][kind];
                section.rest_strain = (section.rest_strain - before(0)) / stiffer;
                section.rest_curvature = (section.rest_curvature - before(1)) / stiffer;
                section.compliance /= stiffer;
                section.couple_stiffness *= stiffer;
            }
            let node = i / n * (n + 1) + i % n;
            let mass = 0.5 * (self.inertia[node].mass + self.inertia[node + 1].mass);
            let inertial = DVec3::splat(STIFFER * per_mass * mass * section.ds);
            let condensing = (stiffer * own.condensing).max(inertial);
            section.condensing = condensing.min(section.compliance.recip());
        }
    }
}

/// Adds mass times `per_mass` to the matrix, and a moment and a force to the
/// right-hand side, at all nodes with equations.
pub(super) fn add_inertia(
    system: &mut System,
    state: &State,
    inertia: &[Inertia],
    per_mass: f64,
    load: impl Fn(usize, &DMat3) -> (DVec3, DVec3),
) {
    let n = state.segments();
    for j in 0..state.rods() {
        for i in system.first()..=n {
            let k = state.base(j) + i;
            let tensor = inertia[k].tensor(state.q[k]);
            let matrix = (tensor * per_mass, inertia[k].mass * per_mass);
            system.add(j, i, matrix, load(k, &tensor));
        }
    }
}
