//! The equations of a branch on one grid, linearised and solved.

use std::sync::Arc;

use super::family::{Family, Leaves, OutOfRange, clamp};
use super::field::{add, between, dot, is_finite, largest, plus, times};
use super::states::{advanced, forces_on, rate, stiffest_condensed};
pub use super::stuck::Stuck;
use super::{Point, Tangent};
use crate::leaf::{DiscreteLeaf, Field, Grid, Solved, SparseFactor, SparsePattern, State, System};
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
pub struct Equations<'a> {
    /// The leaves.
    pub leaves: Leaves<&'a Family<'a>>,
    /// The same with softened matrices, if these determine what is critical.
    /// Newton's method needs the true ones: near singular points of the softened it
    /// would not converge.
    pub softened: Option<Leaves<&'a Family<'a>>>,
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

/// Forces and their derivatives at a state.
pub(super) struct Linear {
    pub forces: Field,
    /// Their derivative with respect to the parameter.
    pub rate: Field,
    /// The shift that keeps neutral modes from counting as unstable.
    pub(super) shift: f64,
    /// Rounding error of the forces.
    pub noise: f64,
}

impl<'a> Equations<'a> {
    /// Allocates the equations of `family` on `grid`.
    pub fn new(family: &'a Family<'a>, grid: Grid) -> Result<Self, OutOfRange> {
        Equations::of(Leaves::new(family, grid))
    }

    fn of(mut leaves: Leaves<&'a Family<'a>>) -> Result<Self, OutOfRange> {
        // Veins may be coupled at one end of the range only.
        let coupled = leaves.at(0.0)?.coupled();
        let system = System::new(leaves.at(if coupled { 0.0 } else { 1.0 })?);
        let one = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        let ones = vec![vec![one; leaves.grid.segments()]; system.rods()];
        Ok(Equations {
            leaves,
            softened: None,
            mass: dot(&system.momentum(&ones), &ones),
            system,
            rodwise: true,
            factorizations: 0,
        })
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Result<Self, OutOfRange> {
        Equations::of(self.leaves.refined())
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
    pub fn inner(&self, a: &Tangent, b: &Tangent) -> f64 {
        self.product(&a.increments, &b.increments) + a.fraction * b.fraction
    }

    /// Scales a direction to length one.
    pub fn normalised(&self, t: Tangent) -> Tangent {
        let length = self.inner(&t, &t).sqrt();
        Tangent {
            increments: times(&t.increments, 1.0 / length),
            fraction: t.fraction / length,
        }
    }

    /// The one of two opposite directions that is more along another one.
    pub(super) fn oriented(&self, t: Tangent, along: &Tangent) -> Tangent {
        match self.inner(&t, along) < 0.0 {
            true => reversed(t),
            false => t,
        }
    }

    /// The state `step` further along a direction, for the leaf at this fraction.
    pub fn moved(
        &mut self,
        state: &State,
        fraction: f64,
        increments: &Field,
        step: f64,
    ) -> Result<State, OutOfRange> {
        let leaf = self.leaves.at(fraction)?;
        Ok(advanced(leaf, state, &mut self.system, increments, step))
    }

    /// Derivative, with respect to the parameter, of the positions of nodes held away from the
    /// bases, which the forces do not contain; `None` if there are none.
    fn held_rate(&mut self, state: &State, fraction: f64) -> Result<Option<Field>, OutOfRange> {
        if self.leaves.at(fraction)?.leaf.held.is_none() {
            return Ok(None);
        }
        let held = |step: f64| {
            let mut held = state.clone();
            clamp(self.leaves.at(fraction + step)?, &mut held);
            Ok(between(state, &held))
        };
        rate(held).map(Some)
    }

    /// Returns the forces and their rates; the matrix is left in the system.
    pub(super) fn linearise(&mut self, state: &mut State, fraction: f64) -> Result<Linear, Stuck> {
        linearise(&mut self.leaves, &mut self.system, state, fraction)
    }

    /// The same with the softened matrix, if there is one.
    pub(super) fn linearise_softened(
        &mut self,
        state: &mut State,
        fraction: f64,
    ) -> Result<Linear, Stuck> {
        let leaves = self.softened.as_mut().unwrap_or(&mut self.leaves);
        linearise(leaves, &mut self.system, state, fraction)
    }

    /// Solves for the forces and their rate with K + shift M: rod by rod if possible,
    /// else by a direct factorisation, which also counts the negative eigenvalues.
    fn solve(&mut self, linear: &Linear) -> Result<(Field, Field, Option<usize>), Stuck> {
        let shift = linear.shift;
        self.factorizations += 1;
        if self.rodwise {
            if self.system.factorize(shift) {
                let mut solved = |rhs: &Field| {
                    self.system.set_rhs(rhs);
                    let found = self.system.solve(None, CG_TOLERANCE);
                    matches!(found, Solved::Yes(_)).then(|| self.system.solution())
                };
                if let (Some(forces), Some(rate)) = (solved(&linear.forces), solved(&linear.rate)) {
                    return Ok((forces, rate, None));
                }
            }
            self.rodwise = false;
            self.factorizations += 1;
        }
        let pattern = self.pattern(0)?;
        let mut factor = factorized(&pattern, &self.system, shift)?;
        let forces = factor.solve_bordered(&linear.forces, &[]).increments;
        let rate = factor.solve_bordered(&linear.rate, &[]).increments;
        Ok((forces, rate, Some(factor.negative())))
    }

    /// Newton corrector: back to the branch within the plane normal to `normal`
    /// through the given state; without a normal, at the given parameter. The
    /// tangent of the point is oriented along `normal`.
    pub fn correct(
        &mut self,
        state: &State,
        fraction: f64,
        normal: Option<&Tangent>,
    ) -> Result<Point, Stuck> {
        let plane = normal.map(|t| Plane {
            dual: self.momentum(&t.increments),
            own: t.fraction,
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
        let (mut state, mut fraction) = (state.clone(), fraction);
        let mut previous = f64::INFINITY;
        for iterations in 1..=ITERATIONS {
            let linear = self.linearise(&mut state, fraction)?;
            let (forces, mut rate, counted) = self.solve(&linear)?;
            if let Some(held) = self.held_rate(&state, fraction)? {
                add(&mut rate, 1.0, &held);
            }
            let step = plane.map_or(0.0, |plane| {
                let off = plane.distance(&state) + dot(&plane.dual, &forces);
                -off / (dot(&plane.dual, &rate) + plane.own)
            });
            let increments = plus(&forces, step, &rate);
            let size = largest(&increments).max(step.abs());
            if !is_finite(&increments) || !step.is_finite() || size > LARGEST {
                return Err(Stuck::NotConverged);
            }
            fraction += step;
            state = self.moved(&state, fraction, &increments, 1.0)?;
            if at_rest(size, previous) {
                clamp(self.leaves.at(fraction)?, &mut state);
                let tangent = self.normalised(Tangent {
                    increments: rate,
                    fraction: 1.0,
                });
                // The factorised matrix is that of the previous state.
                let index = match counted {
                    Some(index) if size < SAME_INDEX => index,
                    _ => self.index(&state, fraction)?,
                };
                return Ok(Point {
                    state,
                    fraction,
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
    fn index(&mut self, state: &State, fraction: f64) -> Result<usize, Stuck> {
        let shift = self.leaves.at(fraction)?.neutral_shift();
        let index = self.index_below(state, fraction, shift)?;
        if shift > NOISY && index != self.index_below(state, fraction, -shift)? {
            return Err(Stuck::Rounding);
        }
        Ok(index)
    }

    /// Number of eigenvalues below minus `shift`.
    fn index_below(&mut self, state: &State, fraction: f64, shift: f64) -> Result<usize, Stuck> {
        let leaf = self.leaves.at(fraction)?;
        let system = &mut self.system;
        self.factorizations += 1;
        system.set_coupling(leaf);
        leaf.assemble(state, system);
        if system.stable_without_coupling(shift) {
            return Ok(0);
        }
        leaf.assemble(state, system);
        self.factorizations += 1;
        let pattern = self.pattern(0)?;
        Ok(factorized(&pattern, &self.system, shift)?.negative())
    }

    /// The sparsity pattern of the matrix with so many border rows.
    pub(super) fn pattern(&self, border: usize) -> Result<Arc<SparsePattern>, Stuck> {
        let pattern = self.leaves.family.patterns.of(&self.system, border);
        pattern.ok_or(Stuck::TooLarge)
    }
}

/// Returns the forces and their rates; the matrix is left in the system.
fn linearise(
    leaves: &mut Leaves<&Family>,
    system: &mut System,
    state: &mut State,
    fraction: f64,
) -> Result<Linear, Stuck> {
    let rate = rate(|step| {
        let leaf = leaves.at(fraction + step)?;
        Ok::<_, OutOfRange>(forces_on(leaf, state, system))
    })?;
    let leaf = leaves.at(fraction)?;
    let (forces, noise) = assembled(leaf, system, state)?;
    Ok(Linear {
        forces,
        rate,
        shift: leaf.neutral_shift(),
        noise,
    })
}

/// Returns the forces and their rounding error; the matrix is left in the system.
pub(super) fn assembled(
    leaf: &DiscreteLeaf,
    system: &mut System,
    state: &mut State,
) -> Result<(Field, f64), Stuck> {
    clamp(leaf, state);
    system.set_coupling(leaf);
    let turn = leaf.assemble(state, system).turn;
    if !turn.is_finite() || turn > RESOLVED_TURN {
        return Err(Stuck::Unresolved);
    }
    let stiffest = stiffest_condensed(leaf).max(1.0);
    Ok((system.rhs(), ROUNDING * f64::EPSILON * stiffest))
}

/// A direct factorisation of the assembled matrix K + `shift` M.
pub(super) fn factorized<'p>(
    pattern: &'p SparsePattern,
    system: &System,
    shift: f64,
) -> Result<SparseFactor<'p>, Stuck> {
    (pattern.factorize(system, shift)).map_err(|_| Stuck::TooLarge)
}

pub fn reversed(t: Tangent) -> Tangent {
    Tangent {
        increments: times(&t.increments, -1.0),
        fraction: -t.fraction,
    }
}

/// Whether the iteration has converged with a Newton step of this size after `previous`.
pub(super) fn at_rest(size: f64, previous: f64) -> bool {
    let first = Contraction::default().error_after_first(size, 0.0);
    converged(size, previous, [0.0; 2], (ACCURACY, ROUNDED), first).is_some()
}
