//! Newton's method for the equilibrium of a discrete leaf: the iteration, its
//! convergence test, and the solution of its linear equations.
//!
//! Convergence tests of Newton's method.
//!
//! Forces that follow a leaf and have no potential, in Newton's method: their derivative makes the
//! matrix unsymmetric.
//!
//! With the symmetric matrix K without them and the derivative W of them, (1 - K^-1 W) d = K^-1 r
//! is solved by GMRES ([`minimal_residual`]). K is
//! factorised once for every iteration of Newton's method; as K^-1 W is smooth, few directions are
//! enough.

mod force_progress;

use crate::krylov::{KrylovLimits, minimal_residual};
use crate::leaf::{
    DirectError, DirectSolver, DiscreteLeaf, Factors, Field, Increment, Solved, State, System,
};
pub use crate::newton::force_progress::ForceProgress;
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
                solve(self.factors.as_mut()?, forces, (*follow, state))
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
                let found = solve(&mut factors, &rhs, (*forces, state));
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

/// An increment (radians, lengths) below this that does not decrease is due to rounding.
pub const ROUNDING: f64 = 1e-9;

/// Increments below this (radians, lengths) are attributed to rounding in a neutral mode if no
/// force or moment above the second number (A/L^2, A/L) is unbalanced.
pub const NEUTRAL_STEP: f64 = 1e-5;

pub const BALANCED: f64 = 1e-9;

/// So many such increments in a row are no convergence.
const STALLED: usize = 20;

/// Increments below this (radians, lengths) are used to measure quadratic convergence.
const ASYMPTOTIC: f64 = 0.05;

/// Safety factor on the error after a first increment. Of some 1500 first increments from
/// predicted states one in a hundred left more than three times the error expected.
const FIRST_SAFETY: f64 = 10.0;

/// An increment counts as decreasing if it is at most this part of the one before.
const DECREASING: f64 = 0.3;

/// Bound on the error left by the conjugate gradients, in units of the accuracy: far more than
/// they usually leave.
const BOUND: f64 = 5.0;

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
        if previous < ASYMPTOTIC {
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
pub fn converged(
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
    let bounded = rate * now * size <= BOUND * accuracy * before;
    match size < rounding && rate > DECREASING {
        true => Some(size),
        false => (remaining <= accuracy && bounded).then_some(remaining),
    }
}

/// Counts increments in a row that very soft veins owe to rounding: they turn by more than
/// [`ROUNDING`] where all forces are balanced.
#[derive(Default)]
pub struct Stalled(usize);

impl Stalled {
    /// The size of increments that are due to rounding if they do not decrease, at a `state`
    /// after an increment of this `size`.
    pub fn rounding(&mut self, leaf: &DiscreteLeaf, state: &State, size: f64) -> f64 {
        let turns = (ROUNDING..NEUTRAL_STEP).contains(&size) && leaf.residual(state) < BALANCED;
        self.0 = if turns { self.0 + 1 } else { 0 };
        match self.0 > STALLED {
            true => NEUTRAL_STEP,
            false => ROUNDING,
        }
    }
}

/// Whether nearly rigid segments of a converged leaf have their lengths.
pub fn satisfies_lengths(leaf: &DiscreteLeaf, state: &State, accuracy: f64) -> bool {
    leaf.satisfies_lengths(state, accuracy.max(LENGTH_ROUNDING))
}

/// Whether a leaf whose matrix without inertia is not positive definite rests at
/// a saddle, after an increment of this size.
pub fn at_saddle(leaf: &DiscreteLeaf, state: &State, size: f64) -> bool {
    size < SADDLE_STEP && leaf.residual(state) < SADDLE_RESIDUAL
}

/// Accuracy of the solution. No direction is left out: none is undetermined.
const LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-10,
    most: 100,
    singular: 0.0,
    stagnating: None,
};

/// Forces on the nodes of a leaf that are not the derivatives of an energy.
pub trait Following {
    /// Adds them to the right-hand side of an assembled system.
    fn add_forces(&self, state: &State, system: &mut System);

    /// Adds their derivative along increments of the nodes to forces.
    fn add_change(&self, state: &State, increments: &Field, forces: &mut Field);
}

/// Solves for the increments under these forces with the factors of K; `None` if too many
/// directions would be needed.
pub fn solve(
    factors: &mut Factors,
    forces: &Field,
    (following, state): (&dyn Following, &State),
) -> Option<Field> {
    let mut solved = |forces: &Field| factors.solve_bordered(forces, &[]).increments;
    let start = solved(forces);
    let (nodes, first) = (start[0].len(), flattened(&start));
    let zero: Field = vec![vec![[0.0; 6]; nodes]; start.len()];
    let product = &mut |direction: &[f64]| {
        let mut change = zero.clone();
        following.add_change(state, &unflattened(direction, nodes), &mut change);
        let image = flattened(&solved(&change));
        Some(direction.iter().zip(image).map(|(v, w)| v - w).collect())
    };
    let found = minimal_residual(&first, LIMITS, product)?;
    let solved = found.residual <= LIMITS.accuracy;
    solved.then(|| found.sum().map_or(zero, |sum| unflattened(&sum, nodes)))
}

/// The increments of all nodes, one number after the other.
fn flattened(field: &Field) -> Vec<f64> {
    field.iter().flatten().flatten().copied().collect()
}

/// The increments again, of rods of so many nodes.
fn unflattened(numbers: &[f64], nodes: usize) -> Field {
    let increments: Vec<Increment> = (numbers.chunks_exact(6))
        .map(|six| std::array::from_fn(|c| six[c]))
        .collect();
    increments
        .chunks(nodes)
        .map(<[Increment]>::to_vec)
        .collect()
}
