//! Newton's method for the equilibrium of a discrete leaf: the iteration and the solution of its linear
//! equations, also with forces that follow the leaf and have no potential, whose derivative makes the
//! matrix unsymmetric.
//!
//! With the symmetric matrix K without these forces and their derivative W, (1 - K^-1 W) d = K^-1 r
//! is solved by GMRES ([`solve_minimal_residual`]). K is
//! factorized once for every iteration of Newton's method; as K^-1 W is smooth, few directions are
//! enough.

mod convergence;

use crate::krylov::{KrylovLimits, solve_minimal_residual};
use crate::leaf::{
    DirectError, DirectSolver, DiscreteLeaf, Increment, LinearSolveOutcome, MassLoad,
    MatrixFactors, NodalField, State, System,
};
use crate::newton::convergence::INCREMENTS;
pub use crate::newton::convergence::{
    Contraction, ForceConvergence, RequiredAccuracy, StallCounter, is_at_saddle, remaining_error,
    satisfies_lengths,
};
use crate::rod::RESOLVED_TURN;
use serde::Serialize;
use std::ops::Add;

/// Shift of the matrix (times the mass matrix, in squared frequencies; the lowest of a clamped
/// rod is 12) that lets Newton's method of a stiff leaf cross a region where its energy is not
/// convex.
struct ConvexityShifts {
    /// The first shift tried.
    first: f64,
    /// The shift below which it is set to zero.
    least: f64,
    /// The shift above which the iteration fails.
    largest: f64,
}

const SHIFTS: ConvexityShifts = ConvexityShifts {
    first: 30.0,
    least: 1.0,
    largest: 1e6,
};

/// Relative accuracies of the conjugate gradients, in the energy norm. Ten times as accurate they take a
/// few iterations more.
struct CgAccuracies {
    /// Accuracy for an increment over the size of the one before.
    per_increment: f64,
    /// Best accuracy asked for.
    best: f64,
    /// Accuracy for a proximal step.
    proximal: f64,
    /// Accuracy for further right-hand sides.
    repeated: f64,
}

const CG: CgAccuracies = CgAccuracies {
    per_increment: 3e-3,
    best: 1e-10,
    proximal: 1e-6,
    repeated: 1e-10,
};

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
    /// The leaf is at rest although its energy has a direction of descent there.
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
    /// The matrix does not fit into the memory that is allowed.
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
    (CG.per_increment * previous).clamp(CG.best, loosest)
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
    /// A solver with the convergence of Newton's method observed before.
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

    /// Solves for the right-hand side assembled in `system` with the matrix of the last solution, which is still that of
    /// `system`; false if that cannot be done.
    pub fn solve_with_last_matrix(&mut self, system: &mut System, tolerance: f64) -> bool {
        match &mut self.factors {
            Some(factors) => {
                factors.solve(system, None);
                true
            }
            None => matches!(
                system.solve(None, tolerance),
                LinearSolveOutcome::Converged(_)
            ),
        }
    }

    /// Solves for other forces on the nodes with the matrix of the last solution.
    pub fn solve_again(&mut self, system: &mut System, forces: &NodalField) -> Option<NodalField> {
        match &mut self.factors {
            Some(factors) => Some(factors.solve_bordered(forces, &[]).increments),
            None => {
                system.set_rhs(forces);
                let solved = system.solve(None, CG.repeated);
                matches!(solved, LinearSolveOutcome::Converged(_)).then(|| system.solution())
            }
        }
    }
}

/// The linear equations of an iteration, and its limits on increments.
pub enum NewtonEquations<'s> {
    /// Equations with pivots of any sign, by a sparse factorization whose pattern is reused; increments
    /// are shortened to the given size. Converges to an equilibrium nearby, stable or not,
    /// like a solver of boundary-value problems.
    Indefinite { largest: f64 },
    /// Equations of a single rod under a dead moment: with the exact, unsymmetric matrix.
    Unsymmetric,
    /// Equations of a leaf on which forces act that have no potential, with their derivatives: the matrix is
    /// unsymmetric, and pivots without them have any sign. An increment above the given size ends
    /// the iteration.
    Following {
        forces: &'s dyn FollowerForces,
        largest: f64,
    },
    /// Equations with a positive definite matrix, shifted where necessary if it may be; an increment above
    /// the given size ends the iteration.
    Definite {
        solver: &'s mut DefiniteSolver,
        largest: f64,
        /// Whether a region where the energy is not convex may be crossed.
        shifted: bool,
        /// Relative accuracy of the conjugate gradients in the first step.
        cg_tolerance: f64,
    },
    /// Equations with springs of `rate` times the masses that hold the nodes at their places in `at`: a
    /// step of implicit Euler without inertia, or of the proximal point method. The matrix
    /// must be positive definite; an increment above the given size ends the iteration.
    Proximal {
        solver: &'s mut DefiniteSolver,
        at: &'s State,
        rate: f64,
        largest: f64,
    },
}

/// Limits on the sizes of increments (radians, lengths).
struct IncrementLimits {
    /// Size to which an increment is shortened.
    longest: f64,
    /// Size above which an increment is rejected.
    refused: f64,
}

impl NewtonEquations<'_> {
    /// The limits on the sizes of increments.
    fn limits(&self) -> IncrementLimits {
        let mut limits = IncrementLimits {
            longest: f64::INFINITY,
            refused: f64::INFINITY,
        };
        match self {
            NewtonEquations::Indefinite { largest } => limits.longest = *largest,
            NewtonEquations::Unsymmetric => {}
            NewtonEquations::Definite { largest, .. }
            | NewtonEquations::Proximal { largest, .. }
            | NewtonEquations::Following { largest, .. } => limits.refused = *largest,
        }
        limits
    }
}

/// Largest number of iterations of a leaf whose nodes are at rest, and whose forces converge linearly.
const MOST_FORCE_ITERATIONS: usize = 300;

/// The parameters of a Newton iteration.
pub struct NewtonIteration<'a> {
    /// Accuracy of positions and rotations (lengths, radians).
    pub accuracy: f64,
    /// Largest number of iterations, unless only forces are still to converge.
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
        let IncrementLimits { longest, refused } = equations.limits();
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
        for step in 0..MOST_FORCE_ITERATIONS.max(self.iterations) {
            if step >= self.iterations && !forces.converges_linearly() {
                break;
            }
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
                && size < INCREMENTS.neutral_step
                && at_rest
                && leaf.residual(state) < INCREMENTS.balanced_residual
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
                let required = RequiredAccuracy {
                    accuracy: self.accuracy,
                    rounding: INCREMENTS.rounding,
                };
                let remaining = remaining_error(size, previous, tolerances, required, first);
                if let Some(remaining) = remaining
                    && at_rest
                    && satisfies_lengths(leaf, state, self.accuracy)
                {
                    return Ok(remaining);
                }
            }
            linear.shift /= 10.0;
            if linear.shift < SHIFTS.least {
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

/// A state at rest after two further steps of Newton's method.
pub struct BalancedState {
    pub state: State,
    /// The state after the first of both.
    pub before: State,
}

/// Takes two steps of Newton's method, with the factors of one matrix, from a state that is at rest within a tolerance.
/// From then on steps differ by rounding alone. `None` if memory is short, or if a step is larger than `largest`
/// (radians, lengths).
pub fn balance_further(leaf: &DiscreteLeaf, state: &State, largest: f64) -> Option<BalancedState> {
    let mut system = System::new(leaf);
    leaf.assemble(state, &mut system);
    leaf.add_phase_conditions(state, &mut system);
    let solver = DirectSolver::new(&system).ok()?;
    let mut factors = solver.factorize(&system, leaf.neutral_shift()).ok()?;
    let mut step = |state: &State, system: &mut System| {
        factors.solve(system, None);
        let mut next = state.clone();
        leaf.advance(state, system, 1.0, &mut next);
        (largest_increment(system) <= largest).then_some(next)
    };
    let before = step(state, &mut system)?;
    leaf.assemble_forces(&before, &mut system);
    let state = step(&before, &mut system)?;
    Some(BalancedState { state, before })
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
                solve_with_follower_forces(self.factors.as_mut()?, forces, *follow, state)
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
                let found = solve_with_follower_forces(&mut factors, &rhs, *forces, state);
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
                match solver.solve(system, shift, springs, CG.proximal, work) {
                    Ok(()) => Ok(CG.proximal),
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
                    self.shift = (4.0 * self.shift).max(SHIFTS.first);
                    if !*shifted || self.shift > SHIFTS.largest {
                        return Err(EquilibriumFailure::NoDescent);
                    }
                }
            }
        }
    }
}

/// Limits of GMRES with follower forces. No direction is left out: none is undetermined.
const FOLLOWER_KRYLOV_LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-10,
    most: 100,
    singular_value_limit: 0.0,
    stagnation: None,
};

/// Forces on the nodes of a leaf that are not the derivatives of an energy.
pub trait FollowerForces {
    /// Adds them to the right-hand side of an assembled system.
    fn add_forces(&self, state: &State, system: &mut System);

    /// Adds their derivative along increments of the nodes to forces.
    fn add_derivative(&self, state: &State, increments: &NodalField, forces: &mut NodalField);

    /// Adds their derivative along velocities of the nodes of a leaf at rest to forces.
    fn add_velocity_derivative(
        &self,
        state: &State,
        velocities: &NodalField,
        forces: &mut NodalField,
    );
}

/// Solves for the increments under `forces`, with the derivative of the `following` ones, from the factors
/// of K; `None` if too many directions would be needed.
pub fn solve_with_follower_forces(
    factors: &mut MatrixFactors,
    forces: &NodalField,
    following: &dyn FollowerForces,
    state: &State,
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

/// The field of these numbers, of rods of so many nodes.
fn unflattened(numbers: &[f64], nodes: usize) -> NodalField {
    let increments: Vec<Increment> = (numbers.chunks_exact(6))
        .map(|six| std::array::from_fn(|c| six[c]))
        .collect();
    increments
        .chunks(nodes)
        .map(<[Increment]>::to_vec)
        .collect()
}
