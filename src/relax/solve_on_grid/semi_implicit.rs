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

use crate::leaf::{AssemblyTotals, DiscreteLeaf, Increment, MassLoad, NodalField, State, System};
use crate::newton::{
    EquilibriumFailure, ForceConvergence, LinearSolveFailure, NewtonEquations, NewtonIteration,
    RequiredAccuracy, SolverCounts, StallCounter, cg_tolerance, is_at_saddle, remaining_error,
    satisfies_lengths,
};
use crate::relax::plan::moving_compliance;
use crate::relax::solve_on_grid::start::GridRelaxation;
use crate::rod::RESOLVED_TURN;
use crate::scenario::CLAMPED_ROD_FREQUENCY;

/// Limits on the steps of the motion.
struct MotionStepLimits {
    /// Largest rotation of a node in a step, radians.
    turn: f64,
    /// Largest displacement of a node in a step, lengths. Half of either doubles the steps of a leaf
    /// that moves far.
    shift: f64,
    /// A last step of Newton's method that is smaller than this (radians, lengths) is accepted
    /// without a test of the energy, whose change is below rounding.
    negligible: f64,
    /// Largest number of steps on one grid.
    count: usize,
}

const STEP_LIMITS: MotionStepLimits = MotionStepLimits {
    turn: 1.0,
    shift: 1.0,
    negligible: 1e-3,
    count: 2000,
};

/// How a stiff leaf is softened while it moves, and stiffened again.
struct StiffLeafSteps {
    /// Accuracy (lengths, radians) to which the softened leaf is brought to rest.
    soft_accuracy: f64,
    /// Newton iterations with the leaf's own stiffness before it is stiffened in steps.
    iterations: usize,
    /// Factor on the compliance in such a step.
    stiffening: f64,
    /// The smallest compliance (L^2/A) of a step.
    smallest_compliance: f64,
}

const STIFF_LEAF: StiffLeafSteps = StiffLeafSteps {
    soft_accuracy: 1e-1,
    iterations: 12,
    stiffening: 0.1,
    smallest_compliance: 1e-8,
};

impl GridRelaxation<'_> {
    /// Lets the leaf come to rest.
    pub fn relax_semi_implicitly(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
    ) -> Result<f64, EquilibriumFailure> {
        let stiffest = match leaf.has_rigid_tissue() {
            true => 0.0,
            false => leaf.least_compliance(),
        };
        let moving_compliance = moving_compliance(&leaf.leaf, self.saddle_escapes);
        if stiffest >= moving_compliance {
            return self.move_to_rest(leaf, system, self.accuracy);
        }
        let mut compliance = moving_compliance;
        let mut soften = !self.near_rest;
        loop {
            if soften {
                let soft = leaf.with_compliance_floor(compliance);
                if self.saddle_escapes > 0 {
                    // The segment forces at the saddle belong to a stiffer leaf.
                    soft.strain_forces(&mut self.state);
                }
                self.move_to_rest(&soft, system, STIFF_LEAF.soft_accuracy)?;
            }
            let before = self.state.clone();
            match self.newton(leaf, system, self.accuracy) {
                Err(EquilibriumFailure::NoDescent) if !(self.near_rest && self.convex_only) => {
                    self.state = before
                }
                settled => return settled,
            }
            if soften {
                // The leaf's own stiffness is too far from this one: stiffen the leaf in steps.
                compliance *= STIFF_LEAF.stiffening;
                if compliance <= stiffest {
                    return self.move_to_rest(leaf, system, self.accuracy);
                }
                if compliance < STIFF_LEAF.smallest_compliance {
                    return Err(EquilibriumFailure::NoDescent);
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
    ) -> Result<f64, EquilibriumFailure> {
        let newton = NewtonIteration {
            accuracy,
            iterations: STIFF_LEAF.iterations,
            work: self.work,
            progress: self.progress,
        };
        let equations = NewtonEquations::Definite {
            solver: &mut self.solver,
            largest: STEP_LIMITS.turn.min(STEP_LIMITS.shift),
            shifted: true,
            cg_tolerance: self.cg_tolerance,
        };
        newton.solve(leaf, &mut self.state, system, equations)
    }

    /// Lets the leaf move, damped, until it is at rest; returns the remaining error.
    fn move_to_rest(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
        accuracy: f64,
    ) -> Result<f64, EquilibriumFailure> {
        let mut trial = self.state.clone();
        let mut motion = Motion::new(leaf);
        let (mut previous, mut previous_tolerance) = (f64::INFINITY, f64::INFINITY);
        let mut stalled = StallCounter::default();
        let mut forces = ForceConvergence::new(leaf);
        let mut sums = assembled(leaf, &self.state, system, self.work);
        for step in 0..STEP_LIMITS.count {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                break;
            }
            let tolerance = cg_tolerance(previous, self.cg_tolerance);
            self.solve_shortening_step(leaf, system, &mut motion, tolerance)?;
            let MotionStep { mut size, mut part } = MotionStep::new(system, &motion);
            leaf.advance(&self.state, system, part, &mut trial);
            if forces.law_lags(leaf, &self.state, &trial) {
                let solver = &mut self.solver;
                let again = &mut |system: &mut System, forces: &NodalField| {
                    solver.solve_again(system, forces)
                };
                system.complete_law(leaf, &self.state, again);
                MotionStep { size, part } = MotionStep::new(system, &motion);
                leaf.advance(&self.state, system, part, &mut trial);
            }
            forces.record_step(size, &self.state, &trial);
            let mut rest = None;
            if motion.is_newton() && part == 1.0 {
                let contraction = &mut self.solver.contraction;
                contraction.update(size, motion.newton_step_size);
                motion.newton_step_size = size;
                let first = contraction.error_after_first(size, trial.force_change(&self.state));
                let tolerances = [previous_tolerance, tolerance];
                let rounding = stalled.increment_rounding(leaf, &self.state, size);
                let required = RequiredAccuracy { accuracy, rounding };
                rest = remaining_error(size, previous, tolerances, required, first);
            } else {
                motion.newton_step_size = f64::INFINITY;
            }
            if let Some(remaining) = rest
                && size < STEP_LIMITS.negligible
                && forces.has_converged(accuracy)
                && satisfies_lengths(leaf, &trial, accuracy)
            {
                if sums.largest_turn > RESOLVED_TURN {
                    return Err(EquilibriumFailure::Unresolved);
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
                    return Err(EquilibriumFailure::NoDescent);
                }
                sums = assembled(leaf, &self.state, system, self.work);
                continue;
            }
            if next.largest_turn > RESOLVED_TURN {
                return Err(EquilibriumFailure::Unresolved);
            }
            std::mem::swap(&mut self.state, &mut trial);
            sums = next;
            self.work.steps += 1;
            if let Some(remaining) = rest
                && forces.has_converged(accuracy)
                && satisfies_lengths(leaf, &self.state, accuracy)
            {
                return Ok(remaining);
            }
            match motion.is_newton() {
                true => motion.accept_newton(),
                false => {
                    motion.accept(is_at_saddle(leaf, &self.state, size), part);
                }
            }
            previous = size;
            if system.coupled() {
                previous_tolerance = tolerance;
            }
        }
        Err(EquilibriumFailure::StepLimit)
    }

    /// Factorizes and solves for the next step, with as long a time step as makes the matrix
    /// positive definite. A small shift keeps modes that are neutral up to rounding from
    /// moving.
    fn solve_shortening_step(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
        motion: &mut Motion,
        tolerance: f64,
    ) -> Result<(), EquilibriumFailure> {
        if motion.mass_factors().is_none() {
            leaf.add_phase_conditions(&self.state, system);
        }
        loop {
            let (shift, inertia) = match motion.mass_factors() {
                Some([shift, per_step]) => {
                    let momentum = MassLoad {
                        field: &motion.velocity,
                        factor: per_step,
                    };
                    (shift, Some(momentum))
                }
                None => (leaf.neutral_shift(), None),
            };
            let (solver, work) = (&mut self.solver, &mut *self.work);
            match solver.solve(system, shift, inertia, tolerance, work) {
                Ok(()) => return Ok(()),
                Err(LinearSolveFailure::Memory) => return Err(EquilibriumFailure::Memory),
                Err(LinearSolveFailure::Indefinite) => {}
            }
            if motion.was_stationary {
                return Err(EquilibriumFailure::Saddle);
            }
            self.left_convex_valley = true;
            if self.convex_only || !motion.shorten_in_time() {
                return Err(EquilibriumFailure::NoDescent);
            }
        }
    }
}

/// The next step, as it solves the linear equations.
struct MotionStep {
    /// Largest rotation (radians) or displacement (lengths) of a node.
    size: f64,
    /// The part of the step that is taken.
    part: f64,
}

impl MotionStep {
    fn new(system: &System, motion: &Motion) -> Self {
        let size = system.largest_increment();
        let turn = STEP_LIMITS.turn / size.rotation;
        let part = turn.min(STEP_LIMITS.shift / size.displacement);
        MotionStep {
            size: size.larger(),
            part: part.min(motion.largest_step_fraction()),
        }
    }
}

/// Assembles the equations in a state.
fn assembled(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    work: &mut SolverCounts,
) -> AssemblyTotals {
    work.force_evaluations += 1;
    leaf.assemble(state, system)
}

/// The time steps of the damped motion, in units of sqrt(rho L^4/A).
struct DampedTimeSteps {
    /// Damping c: critical for the lowest bending mode of a single rod.
    damping: f64,
    /// First finite time step, after a Newton step has failed: a thirtieth of that mode's period.
    /// Twice as long a one may carry the leaf into another valley.
    first: f64,
    /// Shortest time step; a leaf that needs a shorter one does not come to rest.
    shortest: f64,
    /// Beyond this time step inertia is negligible: the step becomes Newton's.
    longest: f64,
    /// Largest growth factor of the time step.
    growth: f64,
    /// Smallest part of a Newton step near rest that is tried if the whole step raises the energy.
    smallest_newton_fraction: f64,
    /// Relative growth of the energy that is attributed to rounding.
    energy_slack: f64,
}

const TIME_STEPS: DampedTimeSteps = DampedTimeSteps {
    damping: 2.0 * CLAMPED_ROD_FREQUENCY,
    first: 0.06,
    shortest: 1e-7,
    longest: 1e3,
    growth: 4.0,
    smallest_newton_fraction: 1e-3,
    energy_slack: 1e-9,
};

/// Velocities, and the time step; an infinite time step is Newton's method.
struct Motion {
    dt: f64,
    /// Growth factor of the time step after an accepted step.
    growth: f64,
    velocity: Vec<Vec<Increment>>,
    next_velocity: Vec<Vec<Increment>>,
    /// Size of the last step if it was one of Newton's method.
    newton_step_size: f64,
    /// The part of Newton's step that the energy allows near rest: close to a bifurcation the
    /// whole step may leave a curved valley.
    newton_fraction: f64,
    /// Whether it was at a possible saddle, or at rest, before the next step of Newton's method.
    was_stationary: bool,
}

impl Motion {
    /// The motion of a leaf that is at rest so far; its first step is Newton's.
    fn new(leaf: &DiscreteLeaf) -> Self {
        let velocity = vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()];
        Motion {
            dt: f64::INFINITY,
            growth: TIME_STEPS.growth,
            next_velocity: velocity.clone(),
            velocity,
            newton_step_size: f64::INFINITY,
            newton_fraction: 1.0,
            was_stationary: false,
        }
    }

    fn is_newton(&self) -> bool {
        self.dt.is_infinite()
    }

    /// Factors (1/dt + c)/dt on the mass in the matrix of the next step, and 1/dt on the momenta;
    /// `None` if it is Newton's.
    fn mass_factors(&self) -> Option<[f64; 2]> {
        let dt = self.dt;
        (!self.is_newton()).then_some([(1.0 / dt + TIME_STEPS.damping) / dt, 1.0 / dt])
    }

    /// The longest part of the next step that may be taken.
    fn largest_step_fraction(&self) -> f64 {
        if self.is_newton() {
            self.newton_fraction
        } else {
            1.0
        }
    }

    /// Shortens a step that raises the energy: near rest a part of Newton's step is taken,
    /// otherwise a shorter time step. False if there is none.
    fn shorten(&mut self) -> bool {
        let near_rest = self.is_newton() && (self.was_stationary || self.newton_fraction < 1.0);
        if near_rest && self.newton_fraction > TIME_STEPS.smallest_newton_fraction {
            self.newton_fraction /= 2.0;
            return true;
        }
        self.shorten_in_time()
    }

    /// Shortens the time step; false if it falls below the shortest.
    fn shorten_in_time(&mut self) -> bool {
        self.dt = match self.dt.is_finite() {
            true => self.dt / 4.0,
            false => TIME_STEPS.first,
        };
        self.growth = 1.0;
        self.dt >= TIME_STEPS.shortest
    }

    /// Whether the total energy does not grow in a step, of which the fraction `part` is
    /// taken, with these potential energies before and after it.
    fn energy_does_not_grow(&mut self, system: &System, part: f64, potential: [f64; 2]) -> bool {
        let [mut energy, mut next_energy] = potential;
        if !self.is_newton() {
            energy += system.kinetic_energy(&self.velocity);
            system.write_velocity(part, self.dt, &mut self.next_velocity);
            next_energy += system.kinetic_energy(&self.next_velocity);
        }
        let slack = TIME_STEPS.energy_slack * (1.0 + energy.abs());
        next_energy.is_finite() && next_energy <= energy + slack
    }

    /// Updates velocity and time step after an accepted step. At a possible saddle the next
    /// step is Newton's, without inertia or damping: it leaves the saddle, or shows that the
    /// leaf is at rest.
    fn accept(&mut self, at_saddle: bool, part: f64) {
        std::mem::swap(&mut self.velocity, &mut self.next_velocity);
        self.was_stationary |= at_saddle;
        if at_saddle {
            self.dt = f64::INFINITY;
        } else if part == 1.0 {
            // The factor doubles up to the largest.
            self.dt *= self.growth;
            self.growth = (2.0 * self.growth).min(TIME_STEPS.growth);
            if self.dt > TIME_STEPS.longest {
                self.dt = f64::INFINITY;
            }
        }
    }

    /// After an accepted step of Newton's method.
    fn accept_newton(&mut self) {
        self.was_stationary = false;
        self.newton_fraction = (2.0 * self.newton_fraction).min(1.0);
    }
}
