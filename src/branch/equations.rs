//! The equations of a branch on one grid, linearised and solved.

use std::sync::Arc;

use super::family::{Family, Leaves, OutOfRange, clamp};
use super::field::{add, between, dot, is_finite, largest, plus, prolong, times};
use super::states::{advanced, forces_on, rate, stiffest_condensed};
pub use super::stuck::Stuck;
use super::{Direction, Point, Solution};
use crate::leaf::{Field, Grid, Solved, SparseFactor, SparsePattern, State, System};
use crate::newton::{Contraction, converged};
use crate::relax::NOISY;
use crate::rod::RESOLVED_TURN;

/// Largest number of Newton iterations of a corrector.
pub(super) const ITERATIONS: usize = 10;

/// Largest increment (radians, lengths, fractions) of an iteration.
pub(super) const LARGEST: f64 = 1.0;

const CG_TOLERANCE: f64 = 1e-11;

/// Accuracy of a point (radians, lengths).
const ACCURACY: f64 = 1e-10;

/// Increments below this that do not shrink are due to rounding.
const ROUNDED: f64 = 1e-8;

/// A step too small to change the sign of any eigenvalue, even of a nearly neutral one.
const SAME_INDEX: f64 = 1e-9;

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
    pub(super) mass: f64,
    pub(super) system: System,
    /// Whether the equations are solved rod by rod, which needs a positive definite matrix.
    rodwise: bool,
    /// Matrices factorised so far.
    pub factorizations: usize,
}

/// A hyperplane in which a point is sought.
pub(super) struct Plane {
    /// Its normal: the increments times the mass matrix, per unit of the leaf's mass, and the
    /// component along the parameter.
    pub dual: Field,
    pub own: f64,
    /// A state in it; if none, the initial state of the search.
    pub through: Option<State>,
}

impl Plane {
    /// Signed distance of a state from it, without the parameter.
    fn distance(&self, state: &State) -> f64 {
        let through = self.through.as_ref();
        through.map_or(0.0, |through| dot(&self.dual, &between(through, state)))
    }
}

/// A state whose matrix is in the system.
pub(super) struct Linear {
    pub forces: Field,
    /// The shift that keeps neutral modes from counting as unstable.
    pub(super) shift: f64,
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
        let ones = vec![vec![one; leaves.grid.segments()]; system.rods()];
        Equations {
            leaves,
            softened: None,
            mass: dot(&system.momentum(&ones), &ones),
            system,
            rodwise: true,
            factorizations: 0,
        }
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        Equations::of(self.leaves.refined())
    }

    /// Lets the matrices of leaves with this additional compliance determine what is singular:
    /// see [`Leaves::softened`].
    pub(super) fn soften(&mut self, softening: f64) {
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
    pub(super) fn momenta(&self, all: &[Field]) -> Vec<Field> {
        all.iter().map(|a| self.momentum(a)).collect()
    }

    pub(super) fn rods(&self) -> usize {
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
    pub(super) fn oriented(&self, direction: Direction<N>, along: &Direction<N>) -> Direction<N> {
        match self.inner(&direction, along) < 0.0 {
            true => direction.reversed(),
            false => direction,
        }
    }

    /// A direction on the grid of which this one halves all segments.
    pub(super) fn prolonged(&self, coarse: &Direction<N>) -> Direction<N> {
        self.normalised(Direction {
            increments: prolong(&coarse.increments),
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
        let leaf = self.leaves.at(params)?;
        Ok(advanced(leaf, state, &mut self.system, increments, step))
    }

    /// Returns the forces; the matrix (the softened one, if `soft` and there is one) is left in
    /// the system.
    pub(super) fn assemble(
        &mut self,
        solution: &mut Solution<N>,
        soft: bool,
    ) -> Result<Linear, Stuck> {
        let leaf = chosen(&mut self.leaves, &mut self.softened, soft).at(solution.params)?;
        clamp(leaf, &mut solution.state);
        self.system.set_coupling(leaf);
        let turn = leaf.assemble(&solution.state, &mut self.system).turn;
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
    pub(super) fn stiffest_condensed(&mut self, params: [f64; N]) -> Result<f64, OutOfRange> {
        let leaf = chosen(&mut self.leaves, &mut self.softened, true).at(params)?;
        Ok(stiffest_condensed(leaf))
    }

    /// Derivatives of the forces with respect to all parameters; `soft` as in
    /// [`Equations::assemble`].
    pub(super) fn rates(
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
    pub(super) fn pattern(&self, border: usize) -> Result<Arc<SparsePattern>, Stuck> {
        let pattern = self.leaves.family.patterns.of(&self.system, border);
        pattern.ok_or(Stuck::TooLarge)
    }
}

impl Equations<'_> {
    /// Derivative, with respect to the parameter, of the positions of nodes held away from the
    /// bases, which the forces do not contain; `None` if there are none.
    fn held_rate(&mut self, state: &State, fraction: f64) -> Result<Option<Field>, OutOfRange> {
        if self.leaves.at([fraction])?.leaf.held.is_none() {
            return Ok(None);
        }
        let held = |step: f64| {
            let mut held = state.clone();
            clamp(self.leaves.at([fraction + step])?, &mut held);
            Ok(between(state, &held))
        };
        rate(held).map(Some)
    }

    /// Solves for the forces and their rate with K + shift M: rod by rod if possible,
    /// else by a direct factorisation, which also counts the negative eigenvalues.
    fn solve(
        &mut self,
        linear: &Linear,
        rate: &Field,
    ) -> Result<(Field, Field, Option<usize>), Stuck> {
        let shift = linear.shift;
        self.factorizations += 1;
        if self.rodwise {
            if self.system.factorize(shift) {
                let mut solved = |rhs: &Field| {
                    self.system.set_rhs(rhs);
                    let found = self.system.solve(None, CG_TOLERANCE);
                    matches!(found, Solved::Yes(_)).then(|| self.system.solution())
                };
                if let (Some(forces), Some(rate)) = (solved(&linear.forces), solved(rate)) {
                    return Ok((forces, rate, None));
                }
            }
            self.rodwise = false;
            self.factorizations += 1;
        }
        let pattern = self.pattern(0)?;
        let mut factor = factorized(&pattern, &self.system, shift)?;
        let forces = factor.solve_bordered(&linear.forces, &[]).increments;
        let rate = factor.solve_bordered(rate, &[]).increments;
        Ok((forces, rate, Some(factor.negative())))
    }

    /// Newton corrector: back to the branch within the plane normal to `normal`
    /// through the given state; without a normal, at the given parameter. The
    /// tangent of the point is oriented along `normal`.
    pub fn correct(
        &mut self,
        state: &State,
        fraction: f64,
        normal: Option<&Direction>,
    ) -> Result<Point, Stuck> {
        let plane = normal.map(|t| Plane {
            dual: self.momentum(&t.increments),
            own: t.params[0],
            through: None,
        });
        let mut point = self.correct_within(state, fraction, plane.as_ref())?;
        if let Some(normal) = normal {
            point.tangent = self.oriented(point.tangent, normal);
        }
        Ok(point)
    }

    /// As [`Equations::correct`], within any plane; the tangent points to growing
    /// values of the parameter.
    pub(super) fn correct_within(
        &mut self,
        state: &State,
        fraction: f64,
        plane: Option<&Plane>,
    ) -> Result<Point, Stuck> {
        let mut now = Solution {
            state: state.clone(),
            params: [fraction],
        };
        let mut previous = f64::INFINITY;
        for iterations in 1..=ITERATIONS {
            let rates = self.rates(&now, false)?;
            let linear = self.assemble(&mut now, false)?;
            let (forces, mut rate, counted) = self.solve(&linear, &rates[0])?;
            if let Some(held) = self.held_rate(&now.state, now.params[0])? {
                add(&mut rate, 1.0, &held);
            }
            let step = plane.map_or(0.0, |plane| {
                let off = plane.distance(&now.state) + dot(&plane.dual, &forces);
                -off / (dot(&plane.dual, &rate) + plane.own)
            });
            let increments = plus(&forces, step, &rate);
            let size = largest(&increments).max(step.abs());
            if !is_finite(&increments) || !step.is_finite() || size > LARGEST {
                return Err(Stuck::NotConverged);
            }
            now.params[0] += step;
            now.state = self.advanced(&now.state, now.params, &increments, 1.0)?;
            if at_rest(size, previous) {
                clamp(self.leaves.at(now.params)?, &mut now.state);
                let tangent = self.normalised(Direction {
                    increments: rate,
                    params: [1.0],
                });
                // The factorised matrix is that of the previous state.
                let index = match counted {
                    Some(index) if size < SAME_INDEX => index,
                    _ => self.index(&now)?,
                };
                return Ok(Point {
                    state: now.state,
                    fraction: now.params[0],
                    tangent,
                    index,
                    iterations,
                });
            }
            previous = size;
        }
        Err(Stuck::NotConverged)
    }

    /// Morse index of an equilibrium, without neutral modes.
    fn index(&mut self, solution: &Solution) -> Result<usize, Stuck> {
        let shift = self.leaves.at(solution.params)?.neutral_shift();
        let index = self.index_below(solution, shift)?;
        if shift > NOISY && index != self.index_below(solution, -shift)? {
            return Err(Stuck::Rounding);
        }
        Ok(index)
    }

    /// Number of eigenvalues below minus `shift`.
    fn index_below(&mut self, solution: &Solution, shift: f64) -> Result<usize, Stuck> {
        let leaf = self.leaves.at(solution.params)?;
        let system = &mut self.system;
        self.factorizations += 1;
        system.set_coupling(leaf);
        leaf.assemble(&solution.state, system);
        if system.stable_without_coupling(shift) {
            return Ok(0);
        }
        leaf.assemble(&solution.state, system);
        self.factorizations += 1;
        let pattern = self.pattern(0)?;
        Ok(factorized(&pattern, &self.system, shift)?.negative())
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
pub(super) fn factorized<'p>(
    pattern: &'p SparsePattern,
    system: &System,
    shift: f64,
) -> Result<SparseFactor<'p>, Stuck> {
    (pattern.factorize(system, shift)).map_err(|_| Stuck::TooLarge)
}

/// Whether the iteration has converged with a Newton step of this size after `previous`.
pub(super) fn at_rest(size: f64, previous: f64) -> bool {
    let first = Contraction::default().error_after_first(size, 0.0);
    converged(size, previous, [0.0; 2], (ACCURACY, ROUNDED), first).is_some()
}
