//! The semi-implicit method: linearly implicit damped motion, its time step
//! growing as the leaf settles until it is Newton's method.
//!
//! With mass M (unit density, rotary inertia of a strip of blade), damping
//! c M and K, g the Hessian and gradient of the energy, a step is
//!
//! ((1/dt + c)/dt M + K) Delta = -g + M v/dt,   v <- Delta/dt,
//!
//! the linearly implicit Euler method. Time is in units of sqrt(rho L^4/A). As
//! long as K is positive definite the leaf is in the valley it will come to
//! rest in, and the step may be as long as the energy allows; where it is not,
//! the motion decides where the leaf goes, and the step is kept short enough
//! to follow it.

use crate::leaf::{DiscreteLeaf, Increment, State, System};
use crate::limit::Limit;
use crate::newton::{
    Definite, Equations, Newton, ROUNDING, Stop, Work, at_saddle, cg_tolerance, closes, converged,
};
use crate::rod::RESOLVED_TURN;

/// Damping c: critical for the lowest bending mode of a single rod, whose
/// frequency is 3.516 (canonical value beta_1^2 of the clamped-free beam).
const DAMPING: f64 = 2.0 * 3.516;

/// First time step once an unlimited one has proved too long: a thirtieth of
/// that mode's period.
const FIRST_STEP: f64 = 0.06;

/// Shortest time step; a leaf that asks for less is not settling.
const SHORTEST_STEP: f64 = 1e-7;

/// Beyond this time step the inertial terms are below the accuracy anyone
/// asks for: the step becomes Newton's.
const LONGEST_STEP: f64 = 1e3;

/// Largest rotation of a node in one step, radians.
const MAX_TURN: f64 = 1.0;

/// Largest displacement of a node in one step, in units of length.
const MAX_SHIFT: f64 = 1.0;

/// A last step of Newton's method that is smaller than this (radians, lengths) is not
/// judged by the energy, of which it changes no more than rounding does.
const SMALL: f64 = 1e-3;

/// Steps on one grid before the run is given up.
const MAX_STEPS: usize = 2000;

/// Growth of the time step from one good step to the next, at most.
const MAX_GROWTH: f64 = 4.0;

/// Relative growth of the energy that is put down to rounding.
const ENERGY_SLACK: f64 = 1e-9;

/// Smallest compliance (units of L^2/A) of a leaf that is moved by its strain
/// energy. A stiffer one is first settled with this compliance, which also
/// gives the forces it carries, and then made stiff.
pub(super) const MOVING_COMPLIANCE: f64 = 2e-3;

/// The load stretches a softened leaf by no more than about this.
pub(super) const MOVING_STRETCH: f64 = 0.05;

/// Accuracy to which a softened leaf is settled.
pub(super) const SOFT_ACCURACY: f64 = 1e-1;

/// Factor by which a softened leaf is made stiffer when Newton's method does not
/// get from it to the stiffness wanted, and where that ends.
const STIFFER: f64 = 0.1;
pub(super) const SMALLEST_MOVING_COMPLIANCE: f64 = 1e-8;

/// Newton iterations of a stiff leaf before it is made stiffer by steps.
const STIFF_ITERATIONS: usize = 12;

/// The state of a leaf that is being relaxed on one grid, and what for.
pub struct Relaxation<'a> {
    pub state: State,
    /// Of positions and rotations.
    pub accuracy: f64,
    pub work: &'a mut Work,
    /// Receives the size of every step.
    pub progress: &'a mut dyn FnMut(usize, f64),
    /// Whether the state is one that only has to be corrected: a stiff leaf is
    /// then not softened first.
    pub near_rest: bool,
    /// Relative accuracy of the conjugate gradients in the first step.
    pub cg_tolerance: f64,
    /// How often it was pushed off saddles before: each time it is softened
    /// less, since a softened leaf may return.
    pub pushes: i32,
    pub solver: Definite,
    /// Count of force evaluations at which to give up.
    pub most_evaluations: usize,
    pub limit: &'a Limit,
    /// Whether to give up at once if the leaf has to move.
    pub convex_only: bool,
    /// Whether the leaf had to move: its energy was not convex where it moved.
    pub moved: bool,
    /// Whether this is a second attempt, from the start.
    pub by_steps: bool,
    /// Whether it had to move while softened.
    pub moved_softened: bool,
    /// Part of the loads under which the leaf came to rest, in such an attempt.
    pub part: f64,
}

impl Relaxation<'_> {
    /// Lets the leaf come to rest.
    pub fn settle(&mut self, leaf: &DiscreteLeaf, system: &mut System) -> Result<f64, Stop> {
        if self.by_steps {
            return self.settle_by_steps(leaf, system);
        }
        let stiffest = leaf.stiffest();
        let load = leaf.leaf.loads.tip_force.length() + leaf.leaf.loads.gravity.length();
        let moving = (MOVING_COMPLIANCE * 0.1_f64.powi(self.pushes)).min(MOVING_STRETCH / load);
        if stiffest >= moving {
            return self.move_to_rest(leaf, system, self.accuracy);
        }
        let mut floor = moving;
        let mut soften = !self.near_rest;
        loop {
            if soften {
                let moved = std::mem::take(&mut self.moved);
                let soft = leaf.softened(floor);
                if self.pushes > 0 {
                    // The forces of the saddle are those of a stiffer leaf.
                    soft.strain_forces(&mut self.state);
                }
                let rest = self.move_to_rest(&soft, system, SOFT_ACCURACY);
                self.moved_softened |= self.moved;
                self.moved |= moved;
                rest?;
            }
            let before = self.state.clone();
            match self.newton(leaf, system, self.accuracy) {
                Err(Stop::Stuck) => self.state = before,
                settled => return settled,
            }
            if soften {
                // From here to the stiffness wanted is too far: go on stiffer.
                floor *= STIFFER;
                if floor <= stiffest {
                    return self.move_to_rest(leaf, system, self.accuracy);
                }
                if floor < SMALLEST_MOVING_COMPLIANCE {
                    return Err(Stop::Stuck);
                }
            }
            soften = true;
        }
    }

    /// Newton's method in the mixed form, for a leaf that is nearly at rest.
    pub(super) fn newton(
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
        let mut resting = false;
        let (mut previous, mut previous_tolerance) = (f64::INFINITY, f64::INFINITY);
        let space = self.solver.space.is_some().then(|| leaf.in_space());
        let mut sums = leaf.assemble(&self.state, system);
        self.work.force_evaluations += 1;

        for step in 0..MAX_STEPS {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                break;
            }
            // A positive definite matrix and its solution, with as long a time
            // step as it takes.
            let tolerance = cg_tolerance(previous, self.cg_tolerance);
            while !self.solve(leaf, space.as_ref(), system, &motion, tolerance) {
                if resting {
                    return Err(Stop::Saddle);
                }
                self.moved = true;
                if self.convex_only || !motion.pace.shorten() {
                    return Err(Stop::Stuck);
                }
            }
            let (turn, shift) = system.largest();
            let size = turn.max(shift);
            let part = (MAX_TURN / turn).min(MAX_SHIFT / shift).min(1.0);
            leaf.advance(&self.state, system, part, &mut trial);
            let mut rest = None;
            if motion.is_newton() && part == 1.0 {
                let contraction = &mut self.solver.contraction;
                contraction.learn(size, motion.newton);
                motion.newton = size;
                let first = contraction.after_first(size, trial.force_change(&self.state));
                let tolerances = [previous_tolerance, tolerance];
                rest = converged(size, previous, tolerances, (accuracy, ROUNDING), first);
            } else {
                motion.newton = f64::INFINITY;
            }
            if let Some(remaining) = rest
                && size < SMALL
                && closes(leaf, &trial, accuracy)
            {
                if sums.turn > RESOLVED_TURN {
                    return Err(Stop::Unresolved);
                }
                std::mem::swap(&mut self.state, &mut trial);
                self.work.steps += 1;
                (self.progress)(step, size);
                return Ok(remaining);
            }
            let next = leaf.assemble(&trial, system);
            self.work.force_evaluations += 1;
            (self.progress)(step, size);
            if !motion.loses_energy(system, part, [sums.energy, next.energy]) {
                if !motion.pace.shorten() {
                    return Err(Stop::Stuck);
                }
                sums = leaf.assemble(&self.state, system);
                self.work.force_evaluations += 1;
                continue;
            }
            if next.turn > RESOLVED_TURN {
                return Err(Stop::Unresolved);
            }
            std::mem::swap(&mut self.state, &mut trial);
            sums = next;
            self.work.steps += 1;
            if motion.is_newton() {
                resting = false;
                if let Some(remaining) = rest
                    && closes(leaf, &self.state, accuracy)
                {
                    return Ok(remaining);
                }
            } else {
                resting = motion.goes_on(at_saddle(leaf, &self.state, size), part) || resting;
            }
            previous = size;
            if system.coupled() {
                previous_tolerance = tolerance;
            }
        }
        Err(Stop::StepLimit)
    }

    /// Factorises and solves for the next time step of a motion; false if the matrix is
    /// not positive definite. A mode that is neutral up to rounding is left
    /// where it is by a shift of that size.
    fn solve(
        &mut self,
        leaf: &DiscreteLeaf,
        space: Option<&DiscreteLeaf>,
        system: &mut System,
        motion: &Motion,
        tolerance: f64,
    ) -> bool {
        let (dt, velocity) = (motion.pace.dt, motion.velocity.as_slice());
        let inertia = dt.is_finite().then_some((velocity, 1.0 / dt));
        let shift = match dt.is_finite() {
            true => (1.0 / dt + DAMPING) / dt,
            false => leaf.neutral_shift(),
        };
        let (solver, work) = (&mut self.solver, &mut *self.work);
        solver.convex_in_space(space, &self.state, shift, work)
            && solver.solve(system, shift, inertia, tolerance, work)
    }
}

/// Velocities, and the time step; an infinite one is a step of Newton's method.
struct Motion {
    pace: Pace,
    velocity: Vec<Vec<Increment>>,
    next_velocity: Vec<Vec<Increment>>,
    /// Size of the last step if it was one of Newton's method.
    newton: f64,
}

impl Motion {
    /// At rest, with the longest step.
    fn new(leaf: &DiscreteLeaf) -> Self {
        let velocity = vec![vec![[0.0; 6]; leaf.segments()]; leaf.rods()];
        Motion {
            pace: Pace {
                dt: f64::INFINITY,
                growth: MAX_GROWTH,
            },
            next_velocity: velocity.clone(),
            velocity,
            newton: f64::INFINITY,
        }
    }

    fn is_newton(&self) -> bool {
        self.pace.dt.is_infinite()
    }

    /// Whether the total energy does not grow in a step, of which so great a `part` is taken,
    /// between these potential energies.
    fn loses_energy(&mut self, system: &System, part: f64, potential: [f64; 2]) -> bool {
        let [mut energy, mut next_energy] = potential;
        if !self.is_newton() {
            energy += system.kinetic_energy(&self.velocity);
            system.velocity(part, self.pace.dt, &mut self.next_velocity);
            next_energy += system.kinetic_energy(&self.next_velocity);
        }
        let slack = ENERGY_SLACK * (1.0 + energy.abs());
        next_energy.is_finite() && next_energy <= energy + slack
    }

    /// After a good step; returns whether the leaf, which may be at a saddle, goes on with
    /// neither inertia nor damping: it then falls, or rests.
    fn goes_on(&mut self, at_saddle: bool, part: f64) -> bool {
        std::mem::swap(&mut self.velocity, &mut self.next_velocity);
        if at_saddle {
            self.pace.dt = f64::INFINITY;
        } else if part == 1.0 {
            self.pace.lengthen();
        }
        at_saddle
    }
}

/// The time step, and its growth after a good one.
struct Pace {
    dt: f64,
    growth: f64,
}

impl Pace {
    /// Takes a shorter step; false if that is too short to be worth it.
    fn shorten(&mut self) -> bool {
        self.dt = match self.dt.is_finite() {
            true => self.dt / 4.0,
            false => FIRST_STEP,
        };
        self.growth = 1.0;
        self.dt >= SHORTEST_STEP
    }

    /// After a good step, the more the more of them there were.
    fn lengthen(&mut self) {
        self.dt *= self.growth;
        self.growth = (2.0 * self.growth).min(MAX_GROWTH);
        if self.dt > LONGEST_STEP {
            self.dt = f64::INFINITY;
        }
    }
}
