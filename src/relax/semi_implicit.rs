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

use crate::leaf::{DiscreteLeaf, Increment, Solved, SparsePattern, State, System};
use crate::relax::equilibrium::Work;
use crate::relax::options::past;
use crate::rod::RESOLVED_TURN;
use std::time::Instant;

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

/// Steps on one grid before the run is given up.
const MAX_STEPS: usize = 2000;

/// Growth of the time step from one good step to the next, at most.
const MAX_GROWTH: f64 = 4.0;

/// Relative growth of the energy that is put down to rounding.
const ENERGY_SLACK: f64 = 1e-9;

/// A leaf that moves by less than this in a step (radians, lengths), while its
/// matrix without inertia is not positive definite, may be at a saddle: it is,
/// if no force or moment above the second number (A/L^2, A/L) is unbalanced.
const SADDLE_STEP: f64 = 1e-7;
const SADDLE_RESIDUAL: f64 = 1e-6;

/// How a leaf settled on one grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settled {
    /// At rest in a valley: the last increments were of this size.
    Rest(f64),
    /// At rest although the energy has a direction of descent there.
    Saddle,
    /// A segment bends by more than the grid can resolve.
    Unresolved,
    /// The step limit came first.
    StepLimit,
    /// No step however short lowers the energy.
    Stuck,
}

/// Smallest compliance (units of L^2/A) of a leaf that is moved by its strain
/// energy. A stiffer one is first settled with this compliance, which also
/// tells the forces it carries, and then made stiff.
const MOVING_COMPLIANCE: f64 = 2e-3;

/// The load stretches a softened leaf by no more than about this.
const MOVING_STRETCH: f64 = 0.05;

/// Accuracy to which a softened leaf is settled.
const SOFT_ACCURACY: f64 = 1e-1;

/// Factor by which a softened leaf is made stiffer when Newton's method does not
/// get from it to the stiffness wanted, and where that ends.
const STIFFER: f64 = 0.1;
const SMALLEST_MOVING_COMPLIANCE: f64 = 1e-8;

/// Newton iterations of a stiff leaf before it is made stiffer by steps.
const STIFF_ITERATIONS: usize = 12;

/// Shift of the matrix (times the mass matrix, in squared frequencies; the
/// lowest of a clamped rod is 12) that carries Newton's method of a stiff leaf
/// over a region where its energy is not convex: the first tried, the one below
/// which it is dropped, the one at which the attempt ends.
const FIRST_STIFFENING: f64 = 30.0;
const LEAST_STIFFENING: f64 = 1.0;
const LARGEST_STIFFENING: f64 = 1e6;

/// The state of a leaf that is being relaxed on one grid, and what for.
pub struct Relaxation<'a> {
    /// The state.
    pub state: State,
    /// Wanted accuracy of positions and rotations.
    pub accuracy: f64,
    /// Work done so far.
    pub work: &'a mut Work,
    /// Told the size of every step.
    pub progress: &'a mut dyn FnMut(usize, f64),
    /// Whether the state is one that only has to be corrected: a stiff leaf is
    /// then not softened first.
    pub near_rest: bool,
    /// Relative accuracy of the conjugate gradients in the first step.
    pub cg_tolerance: f64,
    /// How often it was pushed off saddles before: each time it is softened
    /// less, since a softened leaf may find its way back.
    pub pushes: i32,
    /// Pattern of the direct factorisation, once that had to take over.
    pub direct: Option<SparsePattern>,
    /// Count of force evaluations at which to give up.
    pub most_evaluations: usize,
    /// When to give up.
    pub deadline: Option<Instant>,
    /// Whether to give up at once if the leaf has to move.
    pub convex_only: bool,
    /// Of a leaf in its plane: room for its matrix in space, which must be positive
    /// definite wherever that in the plane is, lest the leaf in space move.
    pub space: Option<System>,
    /// Whether the leaf had to move: its energy was not convex on the way.
    pub moved: bool,
}

impl Relaxation<'_> {
    /// Lets the leaf come to rest.
    pub fn settle(&mut self, leaf: &DiscreteLeaf, system: &mut System) -> Settled {
        let stiffest = leaf.stiffest();
        let load = leaf.leaf.tip_force.length() + leaf.leaf.gravity.length();
        let moving = (MOVING_COMPLIANCE * 0.1_f64.powi(self.pushes)).min(MOVING_STRETCH / load);
        if stiffest >= moving {
            return self.move_to_rest(leaf, system, self.accuracy);
        }
        if self.near_rest {
            let before = self.state.clone();
            match self.newton(leaf, system) {
                Settled::Stuck => self.state = before,
                settled => return settled,
            }
        }
        let mut floor = moving;
        loop {
            let soft = self.move_to_rest(&leaf.softened(floor), system, SOFT_ACCURACY);
            if !matches!(soft, Settled::Rest(_)) {
                return soft;
            }
            let before = self.state.clone();
            match self.newton(leaf, system) {
                Settled::Stuck => self.state = before,
                settled => return settled,
            }
            // From here to the stiffness wanted is too far: go on stiffer.
            floor *= STIFFER;
            if floor <= stiffest {
                return self.move_to_rest(leaf, system, self.accuracy);
            }
            if floor < SMALLEST_MOVING_COMPLIANCE {
                return Settled::Stuck;
            }
        }
    }

    /// Newton's method in the mixed form, for a leaf that is nearly at rest.
    fn newton(&mut self, leaf: &DiscreteLeaf, system: &mut System) -> Settled {
        let mut next = self.state.clone();
        let space = self.space.is_some().then(|| leaf.in_space());
        let (mut stiffening, neutral) = (0.0, leaf.neutral_shift());
        let mut previous = f64::INFINITY;
        for step in 0..STIFF_ITERATIONS {
            let turn = leaf.assemble(&self.state, system).turn;
            self.work.force_evaluations += 1;
            if turn > RESOLVED_TURN {
                return Settled::Unresolved;
            }
            let tolerance = cg_tolerance(previous, self.cg_tolerance);
            loop {
                let shift = neutral + stiffening;
                if self.convex_in_space(space.as_ref(), shift)
                    && self.solve_shifted(system, shift, None, tolerance)
                {
                    break;
                }
                stiffening = (4.0 * stiffening).max(FIRST_STIFFENING);
                if stiffening > LARGEST_STIFFENING {
                    return Settled::Stuck;
                }
            }
            let (turn, shift) = system.largest();
            let size = turn.max(shift);
            if !size.is_finite() || turn > MAX_TURN || shift > MAX_SHIFT {
                return Settled::Stuck;
            }
            leaf.advance(&self.state, system, 1.0, &mut next);
            std::mem::swap(&mut self.state, &mut next);
            self.work.steps += 1;
            (self.progress)(step, size);
            if stiffening == 0.0
                && let Some(rest) = at_rest(size, previous, tolerance, self.accuracy)
            {
                return rest;
            }
            if stiffening > 0.0
                && size < SADDLE_STEP
                && leaf.residual(&self.state) < SADDLE_RESIDUAL
            {
                return Settled::Saddle;
            }
            stiffening /= 10.0;
            if stiffening < LEAST_STIFFENING {
                stiffening = 0.0;
            }
            previous = size;
        }
        Settled::Stuck
    }

    /// Damped motion until rest.
    fn move_to_rest(&mut self, leaf: &DiscreteLeaf, system: &mut System, accuracy: f64) -> Settled {
        let n = leaf.segments();
        let mut trial = self.state.clone();
        let mut velocity = vec![vec![[0.0; 6]; n]; leaf.rods()];
        let mut next_velocity = velocity.clone();
        let mut dt = f64::INFINITY;
        let mut growth = MAX_GROWTH;
        let mut resting = false;
        let mut previous = f64::INFINITY;
        let space = self.space.is_some().then(|| leaf.in_space());
        let mut sums = leaf.assemble(&self.state, system);
        self.work.force_evaluations += 1;

        for step in 0..MAX_STEPS {
            if self.work.force_evaluations > self.most_evaluations || past(self.deadline) {
                break;
            }
            // A positive definite matrix and its solution, with as long a time
            // step as it takes.
            let tolerance = cg_tolerance(previous, self.cg_tolerance);
            while !self.solve(leaf, space.as_ref(), system, dt, &velocity, tolerance) {
                if resting {
                    return Settled::Saddle;
                }
                self.moved = true;
                if self.convex_only {
                    return Settled::Stuck;
                }
                dt = shorter(dt);
                growth = 1.0;
                if dt < SHORTEST_STEP {
                    return Settled::Stuck;
                }
            }
            let (turn, shift) = system.largest();
            let size = turn.max(shift);
            let part = (MAX_TURN / turn).min(MAX_SHIFT / shift).min(1.0);
            leaf.advance(&self.state, system, part, &mut trial);
            let mut energy = sums.energy;
            let next = leaf.assemble(&trial, system);
            self.work.force_evaluations += 1;
            (self.progress)(step, size);
            let mut next_energy = next.energy;
            if dt.is_finite() {
                energy += system.kinetic_energy(&velocity);
                system.velocity(part, dt, &mut next_velocity);
                next_energy += system.kinetic_energy(&next_velocity);
            }
            let slack = ENERGY_SLACK * (1.0 + energy.abs());
            if !next_energy.is_finite() || next_energy > energy + slack {
                dt = shorter(dt);
                growth = 1.0;
                if dt < SHORTEST_STEP {
                    return Settled::Stuck;
                }
                sums = leaf.assemble(&self.state, system);
                self.work.force_evaluations += 1;
                continue;
            }
            if next.turn > RESOLVED_TURN {
                return Settled::Unresolved;
            }
            std::mem::swap(&mut self.state, &mut trial);
            sums = next;
            self.work.steps += 1;
            if dt.is_finite() {
                std::mem::swap(&mut velocity, &mut next_velocity);
                if size < SADDLE_STEP && leaf.residual(&self.state) < SADDLE_RESIDUAL {
                    // With neither inertia nor damping it falls, or it rests.
                    resting = true;
                    dt = f64::INFINITY;
                } else if part == 1.0 {
                    dt *= growth;
                    growth = (2.0 * growth).min(MAX_GROWTH);
                }
                if dt > LONGEST_STEP {
                    dt = f64::INFINITY;
                }
            } else {
                resting = false;
                if part == 1.0
                    && let Some(rest) = at_rest(size, previous, tolerance, accuracy)
                {
                    return rest;
                }
            }
            previous = size;
        }
        Settled::StepLimit
    }

    /// Factorises and solves for a time step of `dt`; false if the matrix is
    /// not positive definite. A mode that is neutral up to rounding is left
    /// where it is by a shift of that size.
    fn solve(
        &mut self,
        leaf: &DiscreteLeaf,
        space: Option<&DiscreteLeaf>,
        system: &mut System,
        dt: f64,
        velocity: &[Vec<Increment>],
        tolerance: f64,
    ) -> bool {
        let inertia = dt.is_finite().then_some((velocity, 1.0 / dt));
        let shift = if dt.is_finite() {
            (1.0 / dt + DAMPING) / dt
        } else {
            leaf.neutral_shift()
        };
        self.convex_in_space(space, shift) && self.solve_shifted(system, shift, inertia, tolerance)
    }

    /// Whether K + `shift` M of `leaf`, the one in space, is positive definite
    /// rod by rod: then the leaf takes the step in its plane that it takes in space.
    fn convex_in_space(&mut self, leaf: Option<&DiscreteLeaf>, shift: f64) -> bool {
        let (Some(leaf), Some(system)) = (leaf, &mut self.space) else {
            return true;
        };
        leaf.assemble(&self.state, system);
        self.work.force_evaluations += 1;
        self.work.factorizations += 1;
        system.factorize(shift)
    }

    /// Factorises K + `shift` M and solves, rod by rod, or directly from when
    /// on that proved too slow; false if the matrix is not positive definite.
    fn solve_shifted(
        &mut self,
        system: &mut System,
        shift: f64,
        inertia: Option<(&[Vec<Increment>], f64)>,
        tolerance: f64,
    ) -> bool {
        self.work.factorizations += 1;
        if self.direct.is_none() {
            if !system.factorize(shift) {
                return false;
            }
            match system.solve(inertia, tolerance) {
                Solved::Yes(iterations) => {
                    self.work.cg_iterations += iterations;
                    return true;
                }
                Solved::Indefinite(iterations) => {
                    self.work.cg_iterations += iterations;
                    return false;
                }
                Solved::TooSlow(iterations) => {
                    self.work.cg_iterations += iterations;
                    if !system.spatial() {
                        return false;
                    }
                    self.work.factorizations += 1;
                    self.direct = SparsePattern::new(system).ok();
                }
            }
        }
        let Some(Ok(mut factor)) = self.direct.as_ref().map(|p| p.factorize(system, shift)) else {
            return false;
        };
        let positive = factor.negative() == 0;
        if positive {
            factor.solve(system, inertia);
        }
        positive
    }
}

/// Whether a Newton step of this `size`, after one of size `previous`, ends at
/// rest: what remains is of second order at best, and never less than what
/// the solution of its equations left.
pub fn at_rest(size: f64, previous: f64, cg_tolerance: f64, accuracy: f64) -> Option<Settled> {
    let rate = (size / previous).min(1.0);
    let quadratic = if previous.is_finite() {
        size * (rate * rate)
    } else {
        10.0 * size * size
    };
    let remaining = quadratic.max(cg_tolerance * size);
    let rounding = size < 1e-9 && rate > 0.3;
    match rounding {
        true => Some(Settled::Rest(size)),
        false => (remaining <= accuracy).then_some(Settled::Rest(remaining)),
    }
}

/// Relative accuracy of the conjugate gradients after a step of size
/// `previous`: an iteration is cheap beside a new assembly, so that the next
/// step is never held up by them.
fn cg_tolerance(previous: f64, loosest: f64) -> f64 {
    (3e-3 * previous).clamp(1e-10, loosest)
}

fn shorter(dt: f64) -> f64 {
    if dt.is_finite() { dt / 4.0 } else { FIRST_STEP }
}
