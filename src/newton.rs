//! Newton's method for the equilibrium of a discrete leaf: the iteration, its
//! convergence test, and the solution of its linear equations.

mod convergence;
mod following;
mod force_progress;

use convergence::{BALANCED, NEUTRAL_STEP, ROUNDING};
pub use convergence::{Contraction, Stalled, at_saddle, converged, satisfies_lengths};
pub use following::Following;
pub use force_progress::ForceProgress;

use crate::largest::larger;
use crate::leaf::{
    DirectError, DirectSolver, DiscreteLeaf, Factors, Field, Increment, Solved, State, System,
};
use crate::rod::RESOLVED_TURN;
use serde::Serialize;
use std::ops::Add;

/// Shift of the matrix (times the mass matrix, in squared frequencies; the lowest of a clamped
/// rod is 12) that lets Newton's method of a stiff leaf cross a region where its energy is not
/// convex: the first tried, the one below which it is set to zero, the one above which the
/// iteration fails.
const FIRST_SHIFT: f64 = 30.0;
const LEAST_SHIFT: f64 = 1.0;
const LARGEST_SHIFT: f64 = 1e6;

/// Relative accuracy of the conjugate gradients for a proximal step.
const PROXIMAL_ACCURACY: f64 = 1e-6;

/// Relative accuracy of the conjugate gradients for further right-hand sides.
const AGAIN: f64 = 1e-10;

/// Work done by a solver; deterministic, so that tests can check it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Accepted steps (time steps or Newton iterations).
    pub steps: usize,
    /// Factorisations of a leaf matrix, rod by rod or sparse.
    pub factorizations: usize,
    /// Evaluations of all internal forces of the leaf.
    pub force_evaluations: usize,
    /// Iterations of the conjugate gradients, all steps together.
    pub cg_iterations: usize,
}

impl Add for Work {
    type Output = Work;

    fn add(self, other: Work) -> Work {
        Work {
            steps: self.steps + other.steps,
            factorizations: self.factorizations + other.factorizations,
            force_evaluations: self.force_evaluations + other.force_evaluations,
            cg_iterations: self.cg_iterations + other.cg_iterations,
        }
    }
}

/// Why an iteration or a motion on one grid did not reach a stable equilibrium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// At rest although the energy has a direction of descent there.
    Saddle,
    /// A segment bends by more than the grid can resolve.
    Unresolved,
    /// The step limit was reached.
    StepLimit,
    /// No step lowers the energy, however short, or Newton's method fails.
    Stuck,
    /// A matrix does not fit into the memory that is allowed.
    Memory,
}

/// Why equations that need a positive definite matrix were not solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsolved {
    /// The matrix is not positive definite.
    Indefinite,
    /// It does not fit into the memory that is allowed.
    Memory,
}

/// A matrix with pivots that have no sign is not positive definite.
impl From<DirectError> for Unsolved {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Memory => Unsolved::Memory,
            DirectError::NotFinite => Unsolved::Indefinite,
        }
    }
}

impl From<DirectError> for Stop {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Memory => Stop::Memory,
            DirectError::NotFinite => Stop::Stuck,
        }
    }
}

/// Relative accuracy of the conjugate gradients after an increment of size `previous`: their
/// iterations are cheap compared with an assembly, so that their error should not limit the
/// next step.
pub fn cg_tolerance(previous: f64, loosest: f64) -> f64 {
    (3e-3 * previous).clamp(1e-10, loosest)
}

/// Solver for matrices that must be positive definite: by conjugate gradients preconditioned
/// by the factorised rods, or directly once these have proved too slow.
#[derive(Default)]
pub struct Definite {
    /// The observed convergence of Newton's method so far.
    pub contraction: Contraction,
    pub direct: Option<DirectSolver>,
    /// The factors of the last direct solution.
    factors: Option<Factors>,
}

impl Definite {
    /// With the convergence of Newton's method observed before.
    pub fn after(contraction: Contraction) -> Self {
        Definite {
            contraction,
            ..Definite::default()
        }
    }

    /// Factorises K + `shift` M and solves for the assembled right-hand side plus
    /// `inertia`.
    pub fn solve(
        &mut self,
        system: &mut System,
        shift: f64,
        inertia: Option<(&[Vec<Increment>], f64)>,
        tolerance: f64,
        work: &mut Work,
    ) -> Result<(), Unsolved> {
        work.factorizations += 1;
        self.factors = None;
        if self.direct.is_none() && !system.tied() {
            if !system.factorize(shift) {
                return Err(Unsolved::Indefinite);
            }
            let solved = system.solve(inertia, tolerance);
            work.cg_iterations += solved.iterations();
            match solved {
                Solved::Yes(_) => return Ok(()),
                Solved::Indefinite(_) | Solved::Singular => return Err(Unsolved::Indefinite),
                Solved::TooSlow(_) => work.factorizations += 1,
            }
        }
        let pattern = match self.direct.take() {
            Some(pattern) => pattern,
            None => DirectSolver::new(system)?,
        };
        let pattern = self.direct.insert(pattern);
        let Some(mut factor) = pattern.factorize_definite(system, shift)? else {
            return Err(Unsolved::Indefinite);
        };
        factor.solve(system, inertia);
        self.factors = Some(factor);
        Ok(())
    }

    /// Solves for other forces on the nodes with the matrix of the last solution.
    pub fn solve_again(&mut self, system: &mut System, forces: &Field) -> Option<Field> {
        match &mut self.factors {
            Some(factors) => Some(factors.solve_bordered(forces, &[]).increments),
            None => {
                system.set_rhs(forces);
                let solved = system.solve(None, AGAIN);
                matches!(solved, Solved::Yes(_)).then(|| system.solution())
            }
        }
    }
}

/// The linear equations of an iteration, and its limits on increments.
pub enum Equations<'s> {
    /// With pivots of any sign, by a sparse factorisation whose pattern is reused; increments
    /// are shortened to the given size. Converges to an equilibrium nearby, stable or not,
    /// like a solver of boundary-value problems.
    AnySign { largest: f64 },
    /// Of a single rod under a dead moment: with the exact, unsymmetric matrix.
    Unsymmetric,
    /// Of a leaf on which forces act that have no potential, with their derivatives: the matrix is
    /// unsymmetric, and pivots without them have any sign. An increment above the given size ends
    /// the iteration.
    Following {
        forces: &'s dyn Following,
        largest: f64,
    },
    /// With a positive definite matrix, shifted where necessary if it may be; an increment above
    /// the given size ends the iteration.
    Definite {
        solver: &'s mut Definite,
        largest: f64,
        /// Whether a region where the energy is not convex may be crossed.
        shifted: bool,
        /// Relative accuracy of the conjugate gradients in the first step.
        cg_tolerance: f64,
    },
    /// With springs of `rate` times the masses that hold the nodes at their places in `at`: a
    /// step of implicit Euler without inertia, or of the proximal point method. The matrix
    /// must be positive definite; an increment above the given size ends the iteration.
    Proximal {
        solver: &'s mut Definite,
        at: &'s State,
        rate: f64,
        largest: f64,
    },
}

impl Equations<'_> {
    /// The size to which an increment is shortened, and that above which it is rejected.
    fn limits(&self) -> (f64, f64) {
        match self {
            Equations::AnySign { largest } => (*largest, f64::INFINITY),
            Equations::Unsymmetric => (f64::INFINITY, f64::INFINITY),
            Equations::Definite { largest, .. }
            | Equations::Proximal { largest, .. }
            | Equations::Following { largest, .. } => (f64::INFINITY, *largest),
        }
    }
}

/// The parameters of a Newton iteration.
pub struct Newton<'a> {
    /// Of positions and rotations.
    pub accuracy: f64,
    pub iterations: usize,
    pub work: &'a mut Work,
    /// Receives the size of every step.
    pub progress: &'a mut dyn FnMut(usize, f64),
}

/// The data kept from one linear solution to the next.
struct Linear<'s> {
    equations: Equations<'s>,
    pattern: Option<DirectSolver>,
    /// The factors of the last direct solution.
    factors: Option<Factors>,
    /// The shift that keeps neutral modes from moving.
    neutral: f64,
    /// The additional shift that makes the matrix positive definite.
    shift: f64,
    /// Increments back to the positions where springs hold the nodes.
    back: Field,
}

impl Newton<'_> {
    /// Newton's method from a state; returns the remaining iteration error. The last
    /// factorisation stays in the system.
    pub fn solve(
        self,
        leaf: &DiscreteLeaf,
        state: &mut State,
        system: &mut System,
        equations: Equations,
    ) -> Result<f64, Stop> {
        let (longest, refused) = equations.limits();
        let any_sign = matches!(equations, Equations::AnySign { .. });
        let mut linear = Linear {
            equations,
            pattern: None,
            factors: None,
            neutral: leaf.neutral_shift(),
            shift: 0.0,
            back: Field::new(),
        };
        let mut forces = ForceProgress::new(leaf);
        let mut next = state.clone();
        let (mut previous, mut previous_tolerance) = (f64::INFINITY, f64::INFINITY);
        for step in 0..self.iterations {
            let turn = leaf.assemble(state, system).turn;
            if !linear.moves() {
                leaf.hold_turn(state, system);
            }
            self.work.force_evaluations += 1;
            if let Equations::Following { forces, .. } = &linear.equations {
                forces.add_forces(state, system);
            }
            if turn > RESOLVED_TURN {
                return Err(Stop::Unresolved);
            }
            let tolerance = linear.solve(state, previous, system, self.work)?;
            let mut size = largest_increment(system);
            if !size.is_finite() || size > refused {
                return Err(Stop::Stuck);
            }
            leaf.advance(state, system, (longest / size).min(1.0), &mut next);
            if forces.law_lags(leaf, state, &next) {
                let again = &mut |system: &mut System, forces: &Field| {
                    linear.solve_again(state, system, forces)
                };
                system.complete_law(leaf, state, again);
                size = largest_increment(system);
                if !size.is_finite() || size > refused {
                    return Err(Stop::Stuck);
                }
                leaf.advance(state, system, (longest / size).min(1.0), &mut next);
            }
            forces.observe(size, state, &next);
            std::mem::swap(state, &mut next);
            self.work.steps += 1;
            (self.progress)(step, size);
            let at_rest = forces.at_rest(self.accuracy);
            if any_sign && size < NEUTRAL_STEP && at_rest && leaf.residual(state) < BALANCED {
                return Ok(size.min(self.accuracy));
            }
            if linear.shift > 0.0 {
                if at_saddle(leaf, state, size) {
                    return Err(Stop::Saddle);
                }
            } else if size < longest {
                let first = match &mut linear.equations {
                    Equations::Definite { solver, .. } => {
                        solver.contraction.update(size, previous);
                        let force = state.force_change(&next);
                        solver.contraction.error_after_first(size, force)
                    }
                    _ => Contraction::default().error_after_first(size, 0.0),
                };
                let tolerances = [previous_tolerance, tolerance];
                let accuracy = (self.accuracy, ROUNDING);
                let remaining = converged(size, previous, tolerances, accuracy, first);
                if let Some(remaining) = remaining
                    && at_rest
                    && satisfies_lengths(leaf, state, self.accuracy)
                {
                    return Ok(remaining);
                }
            }
            linear.shift /= 10.0;
            if linear.shift < LEAST_SHIFT {
                linear.shift = 0.0;
            }
            previous = size;
            if system.coupled() {
                previous_tolerance = tolerance;
            }
        }
        let stop = if any_sign {
            Stop::StepLimit
        } else {
            Stop::Stuck
        };
        Err(stop)
    }
}

/// The largest rotation or displacement of the last solution.
fn largest_increment(system: &System) -> f64 {
    let (turn, shift) = system.largest();
    larger(turn, shift)
}

impl Linear<'_> {
    /// Solves for other forces on the nodes with the matrix of the last solution.
    fn solve_again(&mut self, state: &State, system: &mut System, forces: &Field) -> Option<Field> {
        match &mut self.equations {
            Equations::Proximal { solver, .. } | Equations::Definite { solver, .. } => {
                solver.solve_again(system, forces)
            }
            Equations::Unsymmetric => {
                system.set_rhs(forces);
                let solved = system.solve(None, 0.0);
                matches!(solved, Solved::Yes(_)).then(|| system.solution())
            }
            Equations::AnySign { .. } => {
                let factors = self.factors.as_mut()?;
                Some(factors.solve_bordered(forces, &[]).increments)
            }
            Equations::Following { forces: follow, .. } => {
                following::solve(self.factors.as_mut()?, forces, (*follow, state))
            }
        }
    }

    /// Whether springs hold the nodes, so that a step depends on where it starts.
    fn moves(&self) -> bool {
        matches!(self.equations, Equations::Proximal { rate, .. } if rate > 0.0)
    }

    /// Solves the assembled equations; returns the relative accuracy of the solution.
    fn solve(
        &mut self,
        state: &State,
        previous: f64,
        system: &mut System,
        work: &mut Work,
    ) -> Result<f64, Stop> {
        match &mut self.equations {
            Equations::AnySign { .. } => {
                let pattern = match self.pattern.take() {
                    Some(pattern) => pattern,
                    None => DirectSolver::new(system)?,
                };
                let pattern = self.pattern.insert(pattern);
                let mut factor = pattern.factorize(system, self.neutral)?;
                factor.solve(system, None);
                self.factors = Some(factor);
                work.factorizations += 1;
                Ok(0.0)
            }
            Equations::Following { forces, .. } => {
                let pattern = match self.pattern.take() {
                    Some(pattern) => pattern,
                    None => DirectSolver::new(system)?,
                };
                work.factorizations += 1;
                let pattern = self.pattern.insert(pattern);
                let mut factors = pattern.factorize(system, self.neutral)?;
                let rhs = system.rhs();
                let found = following::solve(&mut factors, &rhs, (*forces, state));
                system.set_solution(&found.ok_or(Stop::Stuck)?);
                self.factors = Some(factors);
                Ok(0.0)
            }
            Equations::Unsymmetric => {
                work.factorizations += 1;
                // One rod has no coupling: this is a direct solution.
                let regular = system.factorize_indefinite();
                match regular && matches!(system.solve(None, 0.0), Solved::Yes(_)) {
                    true => Ok(0.0),
                    false => Err(Stop::Stuck),
                }
            }
            Equations::Proximal {
                solver, at, rate, ..
            } => {
                state.increments_to(at, system.first(), &mut self.back);
                let springs = Some((self.back.as_slice(), *rate));
                let shift = self.neutral + *rate;
                match solver.solve(system, shift, springs, PROXIMAL_ACCURACY, work) {
                    Ok(()) => Ok(PROXIMAL_ACCURACY),
                    Err(Unsolved::Indefinite) => Err(Stop::Stuck),
                    Err(Unsolved::Memory) => Err(Stop::Memory),
                }
            }
            Equations::Definite {
                solver,
                shifted,
                cg_tolerance: loosest,
                ..
            } => {
                let tolerance = cg_tolerance(previous, *loosest);
                loop {
                    let shift = self.neutral + self.shift;
                    match solver.solve(system, shift, None, tolerance, work) {
                        Ok(()) => return Ok(tolerance),
                        Err(Unsolved::Memory) => return Err(Stop::Memory),
                        Err(Unsolved::Indefinite) => {}
                    }
                    self.shift = (4.0 * self.shift).max(FIRST_SHIFT);
                    if !*shifted || self.shift > LARGEST_SHIFT {
                        return Err(Stop::Stuck);
                    }
                }
            }
        }
    }
}
