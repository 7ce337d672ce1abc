//! The equations of a branch on one grid, linearised and solved.

use std::sync::Arc;

use glam::DVec3;

use crate::branch::problem::family::{Family, Leaves, OutOfRange, clamp};
use crate::branch::problem::field::{dot, prolong_field, times};
use crate::branch::problem::states::{advanced, forces_on, rate, stiffest_condensed};
pub use crate::branch::problem::stuck::Stuck;
use crate::branch::{Direction, Solution};
use crate::leaf::{DirectSolver, Factors, Field, Grid, State, System};
use crate::newton::{Contraction, converged};
use crate::rod::RESOLVED_TURN;

/// Largest number of Newton iterations of a corrector.
pub(in crate::branch) const ITERATIONS: usize = 10;

/// Largest increment (radians, lengths, fractions) of an iteration.
pub(in crate::branch) const LARGEST: f64 = 1.0;

/// Accuracy of a point (radians, lengths).
pub(in crate::branch) const ACCURACY: f64 = 1e-10;

/// Increments below this that do not shrink are due to rounding.
const ROUNDED: f64 = 1e-8;

/// Rounding error of a force, in units of epsilon times the largest stiffness.
const ROUNDING: f64 = 10.0;

/// The equations of a family of leaves on a grid, with workspace.
pub struct Equations<'a, const N: usize = 1> {
    /// The leaves.
    pub leaves: Leaves<'a, N>,
    /// The same with softened matrices, if these determine what is critical.
    /// Newton's method needs the true ones: near singular points of the softened it
    /// would not converge.
    softened: Option<Leaves<'a, N>>,
    /// The mass of the leaf without its base.
    pub(in crate::branch) mass: f64,
    pub(in crate::branch) system: System,
    /// Whether the equations are solved rod by rod, which needs a positive definite matrix.
    pub(in crate::branch) rodwise: bool,
    /// Matrices factorised so far.
    pub factorizations: usize,
}

/// A state whose matrix is in the system.
pub(in crate::branch) struct Linear {
    pub forces: Field,
    /// The shift that keeps neutral modes from counting as unstable.
    pub(in crate::branch) shift: f64,
    /// Rounding error of the forces.
    pub noise: f64,
}

impl<'a, const N: usize> Equations<'a, N> {
    /// Allocates the equations of `family` on `grid`.
    pub fn new(family: &'a Family<'a, N>, grid: Grid) -> Self {
        Equations::of(Leaves::new(family, grid))
    }

    fn of(leaves: Leaves<'a, N>) -> Self {
        let system = leaves.family.system(&leaves.grid);
        let one = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        let ones = vec![vec![one; system.nodes()]; system.rods()];
        Equations {
            leaves,
            softened: None,
            mass: dot(&system.momentum(&ones), &ones),
            system,
            rodwise: true,
            factorizations: 0,
        }
    }

    /// Fails once the limit of the run is reached.
    pub(in crate::branch) fn check_limit(&self) -> Result<(), Stuck> {
        match self.leaves.family.limit.reached() {
            true => Err(Stuck::Stopped),
            false => Ok(()),
        }
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        Equations::of(self.leaves.refined())
    }

    /// Lets the matrices of leaves with this additional compliance determine what is singular:
    /// see [`Leaves::softened`].
    pub(in crate::branch) fn soften(&mut self, softening: f64) {
        let (family, grid) = (self.leaves.family, self.grid().clone());
        self.softened = Some(Leaves::softened(family, grid, softening));
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.leaves.grid
    }

    /// Inner product of two increments over the mass matrix, per unit of the leaf's mass.
    pub fn product(&self, a: &Field, b: &Field) -> f64 {
        dot(&self.system.momentum(a), b) / self.mass
    }

    /// The mass matrix times increments, per unit of the leaf's mass.
    pub fn momentum(&self, a: &Field) -> Field {
        times(&self.system.momentum(a), 1.0 / self.mass)
    }

    /// The same for each of these.
    pub(in crate::branch) fn momenta(&self, all: &[Field]) -> Vec<Field> {
        all.iter().map(|a| self.momentum(a)).collect()
    }

    /// The first node of a rod with equations, with which increments begin.
    pub fn first_node(&self) -> usize {
        self.system.first()
    }

    pub(in crate::branch) fn rods(&self) -> usize {
        self.system.rods()
    }

    /// Inner product of two directions.
    pub fn inner(&self, a: &Direction<N>, b: &Direction<N>) -> f64 {
        let params = a.params.iter().zip(b.params).map(|(a, b)| a * b);
        self.product(&a.increments, &b.increments) + params.sum::<f64>()
    }

    /// Scales a direction to length one.
    pub fn normalised(&self, direction: Direction<N>) -> Direction<N> {
        let length = self.inner(&direction, &direction).sqrt();
        Direction {
            increments: times(&direction.increments, 1.0 / length),
            params: direction.params.map(|part| part / length),
        }
    }

    /// The one of two opposite directions that is more along another one.
    pub(in crate::branch) fn oriented(
        &self,
        direction: Direction<N>,
        along: &Direction<N>,
    ) -> Direction<N> {
        match self.inner(&direction, along) < 0.0 {
            true => direction.reversed(),
            false => direction,
        }
    }

    /// A direction on the grid of which this one halves all segments.
    pub(in crate::branch) fn prolonged(&self, coarse: &Direction<N>) -> Direction<N> {
        self.normalised(Direction {
            increments: prolong_field(&coarse.increments, self.first_node()),
            params: coarse.params,
        })
    }

    /// State and parameters `step` further along a direction.
    pub fn moved(
        &mut self,
        solution: &Solution<N>,
        to: &Direction<N>,
        step: f64,
    ) -> Result<Solution<N>, OutOfRange> {
        let params = to.further(solution.params, step);
        let state = self.advanced(&solution.state, params, &to.increments, step)?;
        Ok(Solution { state, params })
    }

    /// A state after `step` times these increments, for the leaf at these parameters.
    pub fn advanced(
        &mut self,
        state: &State,
        params: [f64; N],
        increments: &Field,
        step: f64,
    ) -> Result<State, OutOfRange> {
        let (leaf, increments) = (self.leaves.at(params)?, (increments, [].as_slice()));
        Ok(advanced(leaf, state, &mut self.system, increments, step))
    }

    /// The same after a step of Newton's method, with the forces that complete the law of nearly
    /// rigid segments.
    pub(in crate::branch) fn corrected(
        &mut self,
        state: &State,
        params: [f64; N],
        step: (&Field, &[DVec3]),
    ) -> Result<State, OutOfRange> {
        let leaf = self.leaves.at(params)?;
        Ok(advanced(leaf, state, &mut self.system, step, 1.0))
    }

    /// Completes the law of nearly rigid segments in the increments under the forces assembled at
    /// a solution; `solve` solves with the factors at hand. Returns the forces on the nodes by which
    /// it does so, and those of the segments.
    pub(in crate::branch) fn complete_law(
        &mut self,
        at: &Solution<N>,
        increments: &mut Field,
        solve: &mut dyn FnMut(&mut System, &Field) -> Option<Field>,
    ) -> Result<(Option<Field>, Vec<DVec3>), OutOfRange> {
        let leaf = self.leaves.at(at.params)?;
        if !leaf.is_nearly_rigid() {
            return Ok((None, Vec::new()));
        }
        self.system.set_solution(increments);
        let forces = self.system.complete_law(leaf, &at.state, solve);
        *increments = self.system.solution();
        Ok((forces, self.system.law_forces().to_vec()))
    }

    /// Returns the forces; the matrix (the softened one, if `soft` and there is one) is left in
    /// the system.
    pub(in crate::branch) fn assemble(
        &mut self,
        solution: &mut Solution<N>,
        soft: bool,
    ) -> Result<Linear, Stuck> {
        let leaf = chosen(&mut self.leaves, &mut self.softened, soft).at(solution.params)?;
        clamp(leaf, &mut solution.state);
        self.system.set_coupling(leaf);
        let turn = leaf.assemble(&solution.state, &mut self.system).turn;
        leaf.hold_turn(&solution.state, &mut self.system);
        if !turn.is_finite() || turn > RESOLVED_TURN {
            return Err(Stuck::Unresolved);
        }
        let stiffest = stiffest_condensed(leaf).max(1.0);
        Ok(Linear {
            forces: self.system.rhs(),
            shift: leaf.neutral_shift(),
            noise: ROUNDING * f64::EPSILON * stiffest,
        })
    }

    /// The largest stiffness in stretch and shear with which segment forces are condensed out, in
    /// the matrix that determines what is singular.
    pub(in crate::branch) fn stiffest_condensed(
        &mut self,
        params: [f64; N],
    ) -> Result<f64, OutOfRange> {
        let leaf = chosen(&mut self.leaves, &mut self.softened, true).at(params)?;
        Ok(stiffest_condensed(leaf))
    }

    /// Derivatives of the forces with respect to all parameters; `soft` as in
    /// [`Equations::assemble`].
    pub(in crate::branch) fn rates(
        &mut self,
        solution: &Solution<N>,
        soft: bool,
    ) -> Result<Vec<Field>, OutOfRange> {
        let leaves = chosen(&mut self.leaves, &mut self.softened, soft);
        let rate_of = |which: usize| {
            rate(|step| {
                let mut params = solution.params;
                params[which] += step;
                let leaf = leaves.at(params)?;
                Ok(forces_on(leaf, &solution.state, &mut self.system))
            })
        };
        (0..N).map(rate_of).collect()
    }

    /// The sparsity pattern of the matrix with so many border rows.
    pub(in crate::branch) fn pattern(&self, border: usize) -> Result<Arc<DirectSolver>, Stuck> {
        let pattern = self.leaves.family.patterns.of(&self.system, border);
        pattern.ok_or(Stuck::TooLarge)
    }
}

/// The leaves whose matrices are assembled.
fn chosen<'l, 'a, const N: usize>(
    leaves: &'l mut Leaves<'a, N>,
    softened: &'l mut Option<Leaves<'a, N>>,
    soft: bool,
) -> &'l mut Leaves<'a, N> {
    match softened {
        Some(softened) if soft => softened,
        _ => leaves,
    }
}

/// A direct factorisation of the assembled matrix K + `shift` M.
pub(in crate::branch) fn factorized(
    pattern: &DirectSolver,
    system: &System,
    shift: f64,
) -> Result<Factors, Stuck> {
    Ok(pattern.factorize(system, shift)?)
}

/// Whether the iteration has converged with a Newton step of this size after `previous`.
pub(in crate::branch) fn at_rest(size: f64, previous: f64) -> bool {
    let first = Contraction::default().error_after_first(size, 0.0);
    converged(size, previous, [0.0; 2], (ACCURACY, ROUNDED), first).is_some()
}
