//! Newton's method for the equilibrium of a discrete leaf: the iteration, its
//! convergence test, and the solution of its linear equations.
//!
//! Convergence tests of Newton's method.
//!
//! Forces that follow a leaf and have no potential, in Newton's method: their derivative makes the
//! matrix unsymmetric.
//!
//! With the symmetric matrix K without them and the derivative W of them, (1 - K^-1 W) d = K^-1 r
//! is solved by GMRES ([`solve_minimal_residual`]). K is
//! factorized once for every iteration of Newton's method; as K^-1 W is smooth, few directions are
//! enough.

mod force_progress;

use crate::krylov::{KrylovLimits, solve_minimal_residual};
use crate::leaf::{
    DirectError, DirectSolver, DiscreteLeaf, Increment, LinearSolveOutcome, MassLoad,
    MatrixFactors, NodalField, State, System,
};
pub use crate::newton::force_progress::ForceConvergence;
use crate::numbers::larger;
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
const REPEATED_SOLVE_ACCURACY: f64 = 1e-10;

/// Work done by a solver; deterministic, so that tests can check it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SolverCounts {
    /// Accepted steps (time steps or Newton iterations).
    pub steps: usize,
    /// Factorizations of a leaf matrix, rod by rod or sparse.
    pub factorizations: usize,
    /// Evaluations of all internal forces of the leaf.
    pub force_evaluations: usize,
    /// Iterations of the conjugate gradients, all steps together.
    pub cg_iterations: usize,
}

impl Add for SolverCounts {
    type Output = SolverCounts;

    fn add(self, other: SolverCounts) -> SolverCounts {
        SolverCounts {
            steps: self.steps + other.steps,
            factorizations: self.factorizations + other.factorizations,
            force_evaluations: self.force_evaluations + other.force_evaluations,
            cg_iterations: self.cg_iterations + other.cg_iterations,
        }
    }
}

/// Why an iteration or a motion on one grid did not reach a stable equilibrium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EquilibriumFailure {
    /// At rest although the energy has a direction of descent there.
    Saddle,
    /// A segment bends by more than the grid can resolve.
    Unresolved,
    /// The step limit was reached.
    StepLimit,
    /// No step lowers the energy, however short, or Newton's method fails.
    NoDescent,
    /// A matrix does not fit into the memory that is allowed.
    Memory,
}

/// Why equations that need a positive definite matrix were not solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolveFailure {
    /// The matrix is not positive definite.
    Indefinite,
    /// It does not fit into the memory that is allowed.
    Memory,
}

/// A matrix with pivots that have no sign is not positive definite.
impl From<DirectError> for LinearSolveFailure {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Memory => LinearSolveFailure::Memory,
            DirectError::NotFinite => LinearSolveFailure::Indefinite,
        }
    }
}

impl From<DirectError> for EquilibriumFailure {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Memory => EquilibriumFailure::Memory,
            DirectError::NotFinite => EquilibriumFailure::NoDescent,
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
/// by the factorized rods, or directly once these have proved too slow.
#[derive(Default)]
pub struct DefiniteSolver {
    /// The observed convergence of Newton's method so far.
    pub contraction: Contraction,
    pub direct_solver: Option<DirectSolver>,
    /// The factors of the last direct solution.
    factors: Option<MatrixFactors>,
}

impl DefiniteSolver {
    /// With the convergence of Newton's method observed before.
    pub fn with_contraction(contraction: Contraction) -> Self {
        DefiniteSolver {
            contraction,
            ..DefiniteSolver::default()
        }
    }

    /// Factorizes K + `shift` M and solves for the assembled right-hand side plus
    /// `inertia`.
    pub fn solve(
        &mut self,
        system: &mut System,
        shift: f64,
        inertia: Option<MassLoad>,
        tolerance: f64,
        work: &mut SolverCounts,
    ) -> Result<(), LinearSolveFailure> {
        work.factorizations += 1;
        self.factors = None;
        if self.direct_solver.is_none() && !system.has_tissue() {
            if !system.factorize(shift) {
                return Err(LinearSolveFailure::Indefinite);
            }
            let solved = system.solve(inertia, tolerance);
            work.cg_iterations += solved.iterations();
            match solved {
                LinearSolveOutcome::Converged(_) => return Ok(()),
                LinearSolveOutcome::Indefinite(_) | LinearSolveOutcome::Singular => {
                    return Err(LinearSolveFailure::Indefinite);
                }
                LinearSolveOutcome::TooSlow(_) => work.factorizations += 1,
            }
        }
        let pattern = match self.direct_solver.take() {
            Some(pattern) => pattern,
            None => DirectSolver::new(system)?,
        };
        let pattern = self.direct_solver.insert(pattern);
        let Some(mut factor) = pattern.factorize_definite(system, shift)? else {
            return Err(LinearSolveFailure::Indefinite);
        };
        factor.solve(system, inertia);
        self.factors = Some(factor);
        Ok(())
    }

    /// Solves for other forces on the nodes with the matrix of the last solution.
    pub fn solve_again(&mut self, system: &mut System, forces: &NodalField) -> Option<NodalField> {
        match &mut self.factors {
            Some(factors) => Some(factors.solve_bordered(forces, &[]).increments),
            None => {
                system.set_rhs(forces);
                let solved = system.solve(None, REPEATED_SOLVE_ACCURACY);
                matches!(solved, LinearSolveOutcome::Converged(_)).then(|| system.solution())
            }
        }
    }
}

/// The linear equations of an iteration, and its limits on increments.
pub enum NewtonEquations<'s> {
    /// With pivots of any sign, by a sparse factorization whose pattern is reused; increments
    /// are shortened to the given size. Converges to an equilibrium nearby, stable or not,
    /// like a solver of boundary-value problems.
    Indefinite { largest: f64 },
    /// Of a single rod under a dead moment: with the exact, unsymmetric matrix.
    Unsymmetric,
    /// Of a leaf on which forces act that have no potential, with their derivatives: the matrix is
    /// unsymmetric, and pivots without them have any sign. An increment above the given size ends
    /// the iteration.
    Following {
        forces: &'s dyn FollowerForces,
        largest: f64,
    },
    /// With a positive definite matrix, shifted where necessary if it may be; an increment above
    /// the given size ends the iteration.
    Definite {
        solver: &'s mut DefiniteSolver,
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
        solver: &'s mut DefiniteSolver,
        at: &'s State,
        rate: f64,
        largest: f64,
    },
}

impl NewtonEquations<'_> {
    /// The size to which an increment is shortened, and that above which it is rejected.
    fn limits(&self) -> (f64, f64) {
        match self {
            NewtonEquations::Indefinite { largest } => (*largest, f64::INFINITY),
            NewtonEquations::Unsymmetric => (f64::INFINITY, f64::INFINITY),
            NewtonEquations::Definite { largest, .. }
            | NewtonEquations::Proximal { largest, .. }
            | NewtonEquations::Following { largest, .. } => (f64::INFINITY, *largest),
        }
    }
}

/// The parameters of a Newton iteration.
pub struct NewtonIteration<'a> {
    /// Of positions and rotations.
    pub accuracy: f64,
    pub iterations: usize,
    pub work: &'a mut SolverCounts,
    /// Receives the size of every step.
    pub progress: &'a mut dyn FnMut(usize, f64),
}

/// The data kept from one linear solution to the next.
struct NewtonLinearSolver<'s> {
    equations: NewtonEquations<'s>,
    direct_solver: Option<DirectSolver>,
    /// The factors of the last direct solution.
    factors: Option<MatrixFactors>,
    /// The shift that keeps neutral modes from moving.
    neutral: f64,
    /// The additional shift that makes the matrix positive definite.
    shift: f64,
    /// Increments back to the positions where springs hold the nodes.
    return_increments: NodalField,
}

impl NewtonIteration<'_> {
    /// Newton's method from a state; returns the remaining iteration error. The last
    /// factorization stays in the system.
    pub fn solve(
        self,
        leaf: &DiscreteLeaf,
        state: &mut State,
        system: &mut System,
        equations: NewtonEquations,
    ) -> Result<f64, EquilibriumFailure> {
        let (longest, refused) = equations.limits();
        let any_sign = matches!(equations, NewtonEquations::Indefinite { .. });
        let mut linear = NewtonLinearSolver {
            equations,
            direct_solver: None,
            factors: None,
            neutral: leaf.neutral_shift(),
            shift: 0.0,
            return_increments: NodalField::new(),
        };
        let mut forces = ForceConvergence::new(leaf);
        let mut next = state.clone();
        let (mut previous, mut previous_tolerance) = (f64::INFINITY, f64::INFINITY);
        for step in 0..self.iterations {
            let turn = leaf.assemble(state, system).largest_turn;
            if !linear.is_proximal() {
                leaf.add_phase_conditions(state, system);
            }
            self.work.force_evaluations += 1;
            if let NewtonEquations::Following { forces, .. } = &linear.equations {
                forces.add_forces(state, system);
            }
            if turn > RESOLVED_TURN {
                return Err(EquilibriumFailure::Unresolved);
            }
            let tolerance = linear.solve(state, previous, system, self.work)?;
            let mut size = largest_increment(system);
            if !size.is_finite() || size > refused {
                return Err(EquilibriumFailure::NoDescent);
            }
            leaf.advance(state, system, (longest / size).min(1.0), &mut next);
            if forces.law_lags(leaf, state, &next) {
                let again = &mut |system: &mut System, forces: &NodalField| {
                    linear.solve_again(state, system, forces)
                };
                system.complete_law(leaf, state, again);
                size = largest_increment(system);
                if !size.is_finite() || size > refused {
                    return Err(EquilibriumFailure::NoDescent);
                }
                leaf.advance(state, system, (longest / size).min(1.0), &mut next);
            }
            forces.record_step(size, state, &next);
            std::mem::swap(state, &mut next);
            self.work.steps += 1;
            (self.progress)(step, size);
            let at_rest = forces.has_converged(self.accuracy);
            if any_sign
                && size < NEUTRAL_STEP
                && at_rest
                && leaf.residual(state) < BALANCED_RESIDUAL
            {
                return Ok(size.min(self.accuracy));
            }
            if linear.shift > 0.0 {
                if is_at_saddle(leaf, state, size) {
                    return Err(EquilibriumFailure::Saddle);
                }
            } else if size < longest {
                let first = match &mut linear.equations {
                    NewtonEquations::Definite { solver, .. } => {
                        solver.contraction.update(size, previous);
                        let force = state.force_change(&next);
                        solver.contraction.error_after_first(size, force)
                    }
                    _ => Contraction::default().error_after_first(size, 0.0),
                };
                let tolerances = [previous_tolerance, tolerance];
                let accuracy = (self.accuracy, INCREMENT_ROUNDING);
                let remaining = remaining_error(size, previous, tolerances, accuracy, first);
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
            EquilibriumFailure::StepLimit
        } else {
            EquilibriumFailure::NoDescent
        };
        Err(stop)
    }
}

/// The largest rotation or displacement of the last solution.
fn largest_increment(system: &System) -> f64 {
    system.largest_increment().larger()
}

impl NewtonLinearSolver<'_> {
    /// Solves for other forces on the nodes with the matrix of the last solution.
    fn solve_again(
        &mut self,
        state: &State,
        system: &mut System,
        forces: &NodalField,
    ) -> Option<NodalField> {
        match &mut self.equations {
            NewtonEquations::Proximal { solver, .. } | NewtonEquations::Definite { solver, .. } => {
                solver.solve_again(system, forces)
            }
            NewtonEquations::Unsymmetric => {
                system.set_rhs(forces);
                let solved = system.solve(None, 0.0);
                matches!(solved, LinearSolveOutcome::Converged(_)).then(|| system.solution())
            }
            NewtonEquations::Indefinite { .. } => {
                let factors = self.factors.as_mut()?;
                Some(factors.solve_bordered(forces, &[]).increments)
            }
            NewtonEquations::Following { forces: follow, .. } => {
                solve_with_follower_forces(self.factors.as_mut()?, forces, (*follow, state))
            }
        }
    }

    /// Whether springs hold the nodes, so that a step depends on where it starts.
    fn is_proximal(&self) -> bool {
        matches!(self.equations, NewtonEquations::Proximal { rate, .. } if rate > 0.0)
    }

    /// Solves the assembled equations; returns the relative accuracy of the solution.
    fn solve(
        &mut self,
        state: &State,
        previous: f64,
        system: &mut System,
        work: &mut SolverCounts,
    ) -> Result<f64, EquilibriumFailure> {
        match &mut self.equations {
            NewtonEquations::Indefinite { .. } => {
                let pattern = match self.direct_solver.take() {
                    Some(pattern) => pattern,
                    None => DirectSolver::new(system)?,
                };
                let pattern = self.direct_solver.insert(pattern);
                let mut factor = pattern.factorize(system, self.neutral)?;
                factor.solve(system, None);
                self.factors = Some(factor);
                work.factorizations += 1;
                Ok(0.0)
            }
            NewtonEquations::Following { forces, .. } => {
                let pattern = match self.direct_solver.take() {
                    Some(pattern) => pattern,
                    None => DirectSolver::new(system)?,
                };
                work.factorizations += 1;
                let pattern = self.direct_solver.insert(pattern);
                let mut factors = pattern.factorize(system, self.neutral)?;
                let rhs = system.rhs();
                let found = solve_with_follower_forces(&mut factors, &rhs, (*forces, state));
                system.set_solution(&found.ok_or(EquilibriumFailure::NoDescent)?);
                self.factors = Some(factors);
                Ok(0.0)
            }
            NewtonEquations::Unsymmetric => {
                work.factorizations += 1;
                // One rod has no coupling: this is a direct solution.
                let regular = system.factorize_indefinite();
                match regular && matches!(system.solve(None, 0.0), LinearSolveOutcome::Converged(_))
                {
                    true => Ok(0.0),
                    false => Err(EquilibriumFailure::NoDescent),
                }
            }
            NewtonEquations::Proximal {
                solver, at, rate, ..
            } => {
                state.increments_to(at, system.first_node(), &mut self.return_increments);
                let springs = Some(MassLoad {
                    field: &self.return_increments,
                    factor: *rate,
                });
                let shift = self.neutral + *rate;
                match solver.solve(system, shift, springs, PROXIMAL_ACCURACY, work) {
                    Ok(()) => Ok(PROXIMAL_ACCURACY),
                    Err(LinearSolveFailure::Indefinite) => Err(EquilibriumFailure::NoDescent),
                    Err(LinearSolveFailure::Memory) => Err(EquilibriumFailure::Memory),
                }
            }
            NewtonEquations::Definite {
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
                        Err(LinearSolveFailure::Memory) => return Err(EquilibriumFailure::Memory),
                        Err(LinearSolveFailure::Indefinite) => {}
                    }
                    self.shift = (4.0 * self.shift).max(FIRST_SHIFT);
                    if !*shifted || self.shift > LARGEST_SHIFT {
                        return Err(EquilibriumFailure::NoDescent);
                    }
                }
            }
        }
    }
}

/// An increment (radians, lengths) below this that does not decrease is due to rounding.
pub const INCREMENT_ROUNDING: f64 = 1e-9;

/// Increments below this (radians, lengths) are attributed to rounding in a neutral mode if no
/// force or moment above the second number (A/L^2, A/L) is unbalanced.
pub const NEUTRAL_STEP: f64 = 1e-5;

pub const BALANCED_RESIDUAL: f64 = 1e-9;

/// So many such increments in a row are no convergence.
const MAX_STALLED_INCREMENTS: usize = 20;

/// Increments below this (radians, lengths) are used to measure quadratic convergence.
const ASYMPTOTIC_INCREMENT: f64 = 0.05;

/// Safety factor on the error after a first increment. Of some 1500 first increments from
/// predicted states one in a hundred left more than three times the error expected.
const FIRST_SAFETY: f64 = 10.0;

/// An increment counts as decreasing if it is at most this part of the one before.
const DECREASING: f64 = 0.3;

/// Bound on the error left by the conjugate gradients, in units of the accuracy: far more than
/// they usually leave.
const CG_ERROR_BOUND: f64 = 5.0;

/// A leaf whose matrix without inertia is not positive definite is at a saddle if a step moves
/// it by less than this (radians, lengths) and no force or moment above the second number
/// (A/L^2, A/L) is unbalanced.
const SADDLE_STEP: f64 = 1e-7;

const SADDLE_RESIDUAL: f64 = 1e-6;

/// Length error of a nearly rigid rod that is attributed to rounding.
const LENGTH_ROUNDING: f64 = 1e-11;

/// The constant of quadratic convergence of Newton's method: the largest ratio of an increment
/// to the square of the one before it. It is shared by all grids of a leaf.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contraction(f64);

impl Contraction {
    /// Updates the constant with an increment after one of size `previous`.
    pub fn update(&mut self, size: f64, previous: f64) {
        if previous < ASYMPTOTIC_INCREMENT {
            self.0 = larger(self.0, size / (previous * previous));
        }
    }

    /// Whether an increment has followed another one.
    pub fn is_measured(&self) -> bool {
        self.0 > 0.0
    }

    /// The error after a first increment with which the largest change of a force (A/L^2) is
    /// `force`; the force is ignored before any convergence has been measured.
    pub fn error_after_first(&self, size: f64, force: f64) -> f64 {
        let force = if self.0 > 0.0 { force } else { 0.0 };
        FIRST_SAFETY * self.0.max(1.0) * size * size.max(force)
    }
}

/// The remaining error after an increment of this `size`, which follows one of size
/// `previous`: of second order at best, and never less than the error of the conjugate
/// gradients. Their accuracies, of the previous increment and of this one, are in the energy
/// norm, to which soft modes contribute little; as this increment contains their error in the
/// previous one, it bounds the factor by which they may be worse (an infinite accuracy: not
/// used, as rods are not coupled). After a first increment (`previous` infinite) the error is
/// `first`, from [`Contraction`]. `None` if the error exceeds `accuracy` or that bound exceeds
/// [`BOUND`] times as much, unless the increment is below `rounding` and does not decrease.
pub fn remaining_error(
    size: f64,
    previous: f64,
    cg_tolerances: [f64; 2],
    (accuracy, rounding): (f64, f64),
    first: f64,
) -> Option<f64> {
    let rate = (size / previous).min(1.0);
    let quadratic = match previous.is_finite() {
        true => size * (rate * rate),
        false => first,
    };
    let [before, now] = cg_tolerances;
    let remaining = larger(quadratic, now * size);
    let bounded = rate * now * size <= CG_ERROR_BOUND * accuracy * before;
    match size < rounding && rate > DECREASING {
        true => Some(size),
        false => (remaining <= accuracy && bounded).then_some(remaining),
    }
}

/// Counts increments in a row that very soft veins owe to rounding: they turn by more than
/// [`ROUNDING`] where all forces are balanced.
#[derive(Default)]
pub struct StallCounter(usize);

impl StallCounter {
    /// The size of increments that are due to rounding if they do not decrease, at a `state`
    /// after an increment of this `size`.
    pub fn increment_rounding(&mut self, leaf: &DiscreteLeaf, state: &State, size: f64) -> f64 {
        let turns = (INCREMENT_ROUNDING..NEUTRAL_STEP).contains(&size)
            && leaf.residual(state) < BALANCED_RESIDUAL;
        self.0 = if turns { self.0 + 1 } else { 0 };
        match self.0 > MAX_STALLED_INCREMENTS {
            true => NEUTRAL_STEP,
            false => INCREMENT_ROUNDING,
        }
    }
}

/// Whether nearly rigid segments of a converged leaf have their lengths.
pub fn satisfies_lengths(leaf: &DiscreteLeaf, state: &State, accuracy: f64) -> bool {
    leaf.satisfies_lengths(state, accuracy.max(LENGTH_ROUNDING))
}

/// Whether a leaf whose matrix without inertia is not positive definite rests at
/// a saddle, after an increment of this size.
pub fn is_at_saddle(leaf: &DiscreteLeaf, state: &State, size: f64) -> bool {
    size < SADDLE_STEP && leaf.residual(state) < SADDLE_RESIDUAL
}

/// Accuracy of the solution. No direction is left out: none is undetermined.
const FOLLOWER_KRYLOV_LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-10,
    most: 100,
    singular_value_limit: 0.0,
    stagnation_limit: None,
};

/// Forces on the nodes of a leaf that are not the derivatives of an energy.
pub trait FollowerForces {
    /// Adds them to the right-hand side of an assembled system.
    fn add_forces(&self, state: &State, system: &mut System);

    /// Adds their derivative along increments of the nodes to forces.
    fn add_derivative(&self, state: &State, increments: &NodalField, forces: &mut NodalField);
}

/// Solves for the increments under these forces with the factors of K; `None` if too many
/// directions would be needed.
pub fn solve_with_follower_forces(
    factors: &mut MatrixFactors,
    forces: &NodalField,
    (following, state): (&dyn FollowerForces, &State),
) -> Option<NodalField> {
    let mut solved = |forces: &NodalField| factors.solve_bordered(forces, &[]).increments;
    let start = solved(forces);
    let (nodes, first) = (start[0].len(), flattened(&start));
    let zero: NodalField = vec![vec![[0.0; 6]; nodes]; start.len()];
    let product = &mut |direction: &[f64]| {
        let mut change = zero.clone();
        following.add_derivative(state, &unflattened(direction, nodes), &mut change);
        let image = flattened(&solved(&change));
        Some(direction.iter().zip(image).map(|(v, w)| v - w).collect())
    };
    let found = solve_minimal_residual(&first, FOLLOWER_KRYLOV_LIMITS, product)?;
    let solved = found.residual <= FOLLOWER_KRYLOV_LIMITS.accuracy;
    solved.then(|| {
        found
            .solution()
            .map_or(zero, |sum| unflattened(&sum, nodes))
    })
}

/// The increments of all nodes, one number after the other.
fn flattened(field: &NodalField) -> Vec<f64> {
    field.iter().flatten().flatten().copied().collect()
}

/// The increments again, of rods of so many nodes.
fn unflattened(numbers: &[f64], nodes: usize) -> NodalField {
    let increments: Vec<Increment> = (numbers.chunks_exact(6))
        .map(|six| std::array::from_fn(|c| six[c]))
        .collect();
    increments
        .chunks(nodes)
        .map(<[Increment]>::to_vec)
        .collect()
}
