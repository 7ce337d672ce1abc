//! The semi-implicit method: linearly implicit damped motion, its time step
//! growing as the leaf settles until it is Newton's method.
//!
//! With mass M (unit density, rotary inertia of a strip of blade), damping
//! c M and K, g the Hessian and gradient of the energy, a step is
//!
//! ((1/dt + c)/dt M + K) Delta = -g + M v/dt,   v <- Delta/dt,
//!
//! the linearly implicit Euler method. Time is in units of sqrt(rho L^4/A). As long as K is
//! positive definite the leaf is in the valley (basin of attraction) of its equilibrium, and
//! the step may be as long as the energy allows; where it is not, the motion decides which
//! equilibrium is reached, and the step is kept short enough to resolve it.

use crate::leaf::{DiscreteLeaf, Field, Leaf, State, Sums, System};
use crate::newton::{
    Equations, ForceProgress, Newton, Stalled, Stop, Unsolved, Work, at_saddle, cg_tolerance,
    converged, satisfies_lengths,
};
use crate::relax::settle::methods::Relaxation;
use crate::relax::settle::methods::damped_motion::Motion;
use crate::rod::RESOLVED_TURN;

/// Largest rotation of a node in one step, radians.
const MAX_TURN: f64 = 1.0;

/// Largest displacement of a node in one step, in units of length.
const MAX_SHIFT: f64 = 1.0;

/// A last step of Newton's method that is smaller than this (radians, lengths) is accepted
/// without a test of the energy, whose change is below rounding.
const SMALL: f64 = 1e-3;

/// Largest number of steps on one grid.
const MAX_STEPS: usize = 2000;

/// Smallest compliance (units of L^2/A) of a leaf that moves with its strain energy. A stiffer
/// one is first settled with this compliance, which also gives its segment forces, and then
/// with its own.
const MOVING_COMPLIANCE: f64 = 2e-3;

/// Approximate largest stretch of a softened leaf by its load.
const MOVING_STRETCH: f64 = 0.05;

/// Accuracy to which a softened leaf is settled.
const SOFT_ACCURACY: f64 = 1e-1;

/// Factor on the compliance of a softened leaf if Newton's method does not converge from it
/// with the leaf's own stiffness, and its lower limit.
const STIFFER: f64 = 0.1;
const SMALLEST_MOVING_COMPLIANCE: f64 = 1e-8;

/// Newton iterations of a stiff leaf before it is stiffened in steps.
const STIFF_ITERATIONS: usize = 12;

/// The least compliance of a leaf that moves after so many pushes off saddles.
fn moving_compliance(leaf: &Leaf, pushes: i32) -> f64 {
    let load = leaf.loads.tip_force.length() + leaf.loads.gravity.length();
    (MOVING_COMPLIANCE * 0.1_f64.powi(pushes)).min(MOVING_STRETCH / load)
}

/// Whether a leaf is so stiff that it is softened while it moves.
pub fn softens(leaf: &Leaf) -> bool {
    let compliance = (0..leaf.rods()).map(|j| leaf.section(j, 0.5, 1.0).compliance.min_element());
    compliance.fold(f64::INFINITY, f64::min) < moving_compliance(leaf, 0)
}

impl Relaxation<'_> {
    /// Lets the leaf come to rest.
    pub fn settle(&mut self, leaf: &DiscreteLeaf, system: &mut System) -> Result<f64, Stop> {
        let stiffest = leaf.least_compliance();
        let moving_compliance = moving_compliance(&leaf.leaf, self.pushes);
        if stiffest >= moving_compliance {
            return self.move_to_rest(leaf, system, self.accuracy);
        }
        let mut compliance = moving_compliance;
        let mut soften = !self.near_rest;
        loop {
            if soften {
                let soft = leaf.softened(compliance);
                if self.pushes > 0 {
                    // The segment forces at the saddle belong to a stiffer leaf.
                    soft.strain_forces(&mut self.state);
                }
                self.move_to_rest(&soft, system, SOFT_ACCURACY)?;
            }
            let before = self.state.clone();
            match self.newton(leaf, system, self.accuracy) {
                Err(Stop::Stuck) if !(self.near_rest && self.convex_only) => self.state = before,
                settled => return settled,
            }
            if soften {
                // The leaf's own stiffness is too far from this one: stiffen the leaf in steps.
                compliance *= STIFFER;
                if compliance <= stiffest {
                    return self.move_to_rest(leaf, system, self.accuracy);
                }
                if compliance < SMALLEST_MOVING_COMPLIANCE {
                    return Err(Stop::Stuck);
                }
            }
            soften = true;
        }
    }

    /// Newton's method in the mixed form, for a leaf that is nearly at rest.
    fn newton(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
        accuracy: f64,
    ) -> Result<f64, Stop> {
        let newton = Newton {
            accuracy,
            iterations: STIFF_ITERATIONS,
            work: self.work,
            progress: self.progress,
        };
        let equations = Equations::Definite {
            solver: &mut self.solver,
            largest: MAX_TURN.min(MAX_SHIFT),
            shifted: true,
            cg_tolerance: self.cg_tolerance,
        };
        newton.solve(leaf, &mut self.state, system, equations)
    }

    /// Damped motion until rest.
    fn move_to_rest(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
        accuracy: f64,
    ) -> Result<f64, Stop> {
        let mut trial = self.state.clone();
        let mut motion = Motion::new(leaf);
        let (mut previous, mut previous_tolerance) = (f64::INFINITY, f64::INFINITY);
        let mut stalled = Stalled::default();
        let mut forces = ForceProgress::new(leaf);
        let mut sums = assembled(leaf, &self.state, system, self.work);
        for step in 0..MAX_STEPS {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                break;
            }
            let tolerance = cg_tolerance(previous, self.cg_tolerance);
            self.solve_shortening(leaf, system, &mut motion, tolerance)?;
            let (mut size, mut part) = step_size(system, &motion);
            leaf.advance(&self.state, system, part, &mut trial);
            if forces.law_lags(leaf, &self.state, &trial) {
                let solver = &mut self.solver;
                let again =
                    &mut |system: &mut System, forces: &Field| solver.solve_again(system, forces);
                system.complete_law(leaf, &self.state, again);
                (size, part) = step_size(system, &motion);
                leaf.advance(&self.state, system, part, &mut trial);
            }
            forces.observe(size, &self.state, &trial);
            let mut rest = None;
            if motion.is_newton() && part == 1.0 {
                let contraction = &mut self.solver.contraction;
                contraction.update(size, motion.newton);
                motion.newton = size;
                let first = contraction.error_after_first(size, trial.force_change(&self.state));
                let tolerances = [previous_tolerance, tolerance];
                let rounding = stalled.rounding(leaf, &self.state, size);
                rest = converged(size, previous, tolerances, (accuracy, rounding), first);
            } else {
                motion.newton = f64::INFINITY;
            }
            if let Some(remaining) = rest
                && size < SMALL
                && forces.at_rest(accuracy)
                && satisfies_lengths(leaf, &trial, accuracy)
            {
                if sums.turn > RESOLVED_TURN {
                    return Err(Stop::Unresolved);
                }
                std::mem::swap(&mut self.state, &mut trial);
                self.work.steps += 1;
                (self.progress)(step, size);
                return Ok(remaining);
            }
            let next = assembled(leaf, &trial, system, self.work);
            (self.progress)(step, size);
            if !motion.energy_does_not_grow(system, part, [sums.energy, next.energy]) {
                if !motion.shorten() {
                    return Err(Stop::Stuck);
                }
                sums = assembled(leaf, &self.state, system, self.work);
                continue;
            }
            if next.turn > RESOLVED_TURN {
                return Err(Stop::Unresolved);
            }
            std::mem::swap(&mut self.state, &mut trial);
            sums = next;
            self.work.steps += 1;
            if let Some(remaining) = rest
                && forces.at_rest(accuracy)
                && satisfies_lengths(leaf, &self.state, accuracy)
            {
                return Ok(remaining);
            }
            match motion.is_newton() {
                true => motion.accept_newton(),
                false => {
                    motion.accept(at_saddle(leaf, &self.state, size), part);
                }
            }
            previous = size;
            if system.coupled() {
                previous_tolerance = tolerance;
            }
        }
        Err(Stop::StepLimit)
    }

    /// Factorises and solves for the next step, with as long a time step as makes the matrix
    /// positive definite. A small shift keeps modes that are neutral up to rounding from
    /// moving.
    fn solve_shortening(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
        motion: &mut Motion,
        tolerance: f64,
    ) -> Result<(), Stop> {
        if motion.inertia().is_none() {
            leaf.hold_turn(&self.state, system);
        }
        loop {
            let (shift, inertia) = match motion.inertia() {
                Some([shift, per_step]) => (shift, Some((motion.velocity.as_slice(), per_step))),
                None => (leaf.neutral_shift(), None),
            };
            let (solver, work) = (&mut self.solver, &mut *self.work);
            match solver.solve(system, shift, inertia, tolerance, work) {
                Ok(()) => return Ok(()),
                Err(Unsolved::Memory) => return Err(Stop::Memory),
                Err(Unsolved::Indefinite) => {}
            }
            if motion.resting {
                return Err(Stop::Saddle);
            }
            self.moved = true;
            if self.convex_only || !motion.shorten_in_time() {
                return Err(Stop::Stuck);
            }
        }
    }
}

/// The size of the next step, and the part of it that is taken.
fn step_size(system: &System, motion: &Motion) -> (f64, f64) {
    let (turn, shift) = system.largest();
    let part = (MAX_TURN / turn).min(MAX_SHIFT / shift);
    (turn.max(shift), part.min(motion.longest_part()))
}

/// Assembles the equations in a state.
fn assembled(leaf: &DiscreteLeaf, state: &State, system: &mut System, work: &mut Work) -> Sums {
    work.force_evaluations += 1;
    leaf.assemble(state, system)
}
