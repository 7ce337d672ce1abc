//! The equations of a branch on one grid, linearised and solved.
//!
//! Bordered equations of a branch: where the matrix is singular, or nearly so.

pub use crate::branch::Stuck;
use crate::branch::family::{
    Family, Leaves, OutOfRange, advanced, clamp, forces_on, rate, stiffest_condensed,
};
use crate::branch::{
    Direction, Point, Solution, add, combined, dot, is_finite, largest, plus, prolong_field, times,
};
use crate::leaf::{Bordered, DirectSolver, Factors, Field, Grid, State, System};
use crate::newton::{Contraction, converged};
use crate::numbers::larger;
use crate::rod::RESOLVED_TURN;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use std::array::from_fn;
use std::sync::Arc;

/// Largest number of Newton iterations of a corrector.
pub(super) const ITERATIONS: usize = 10;

/// Largest increment (radians, lengths, fractions) of an iteration.
pub(super) const LARGEST: f64 = 1.0;

/// Accuracy of a point (radians, lengths).
pub(super) const ACCURACY: f64 = 1e-10;

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
    pub(super) mass: f64,
    pub(super) system: System,
    /// Whether the equations are solved rod by rod, which needs a positive definite matrix.
    pub(super) rodwise: bool,
    /// Matrices factorised so far.
    pub factorizations: usize,
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
    pub(super) fn check_limit(&self) -> Result<(), Stuck> {
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

    /// The first node of a rod with equations, with which increments begin.
    pub fn first_node(&self) -> usize {
        self.system.first()
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
    pub(super) fn corrected(
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
    pub(super) fn complete_law(
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
    pub(super) fn assemble(
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
    pub(super) fn pattern(&self, border: usize) -> Result<Arc<DirectSolver>, Stuck> {
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
pub(super) fn factorized(
    pattern: &DirectSolver,
    system: &System,
    shift: f64,
) -> Result<Factors, Stuck> {
    Ok(pattern.factorize(system, shift)?)
}

/// Whether the iteration has converged with a Newton step of this size after `previous`.
pub(super) fn at_rest(size: f64, previous: f64) -> bool {
    let first = Contraction::default().error_after_first(size, 0.0);
    converged(size, previous, [0.0; 2], (ACCURACY, ROUNDED), first).is_some()
}

/// Singular values below this, relative to the largest, count as zero.
const NEUTRAL: f64 = 1e-7;

/// Stiffness in stretch and shear, in units of A/L^2, above which segments count as stiff.
pub const STIFF: f64 = 1e4;

/// Subspace iterations: few suffice, since the wanted modes are far softer than the rest.
const SUBSPACE_ITERATIONS: usize = 8;

/// Shift of the matrix (times the mass matrix) in inverse iteration: it keeps
/// pivots away from zero.
const SHIFT: f64 = 1e-9;

/// Solutions of the bordered equations at a state and parameters.
pub struct Sample<const N: usize = 1> {
    pub solution: Solution<N>,
    pub solved: Solved,
    /// Derivatives of the forces with respect to the parameters.
    pub rates: Vec<Field>,
    /// Rounding error of the forces.
    pub noise: f64,
    /// Forces of the segments that complete the law of nearly rigid ones in the increments.
    law_forces: Vec<DVec3>,
}

impl<const N: usize> Equations<'_, N> {
    /// Newton's method to the equilibria within the planes normal to directions through a state.
    /// The matrix may be singular: it is bordered by `border`, and components that remain
    /// undetermined are left unchanged. The rates, if given, may be those of a nearby state: they
    /// only affect the rate of convergence, and leaves at other parameters cost more than an
    /// iteration. Unless `exactly`, a converged leaf with stiff segments is corrected once more:
    /// an error in the length of such a segment causes a large force.
    pub fn bordered(
        &mut self,
        mut solution: Solution<N>,
        normals: [&Direction<N>; N],
        border: &[Field],
        rates: Option<&[Field]>,
        exactly: bool,
    ) -> Result<Sample<N>, Stuck> {
        let duals = normals.map(|normal| self.momentum(&normal.increments));
        let normals: [_; N] = from_fn(|k| (&duals[k], normals[k].params.as_slice(), 0.0));
        let mut previous = f64::INFINITY;
        let mut finished = false;
        let mut corrected =
            !exactly && self.leaves.at(solution.params)?.least_compliance() * STIFF > 1.0;
        for _ in 0..=ITERATIONS + 1 {
            self.check_limit()?;
            let rates = match rates {
                Some(rates) => rates.to_vec(),
                None => self.rates(&solution, finished)?,
            };
            let sample = self.sample(solution, border, rates, finished)?;
            if finished {
                return Ok(sample);
            }
            let (next, size) = self.newton_step(&sample, &normals)?;
            solution = next;
            let rests = at_rest(size, previous);
            finished = rests && corrected;
            corrected |= rests;
            previous = size;
        }
        Err(Stuck::NotConverged)
    }

    /// The state and parameters after the step of [`Solved::step`], and its size.
    pub(super) fn newton_step(
        &mut self,
        sample: &Sample<N>,
        functions: &[(&Field, &[f64], f64)],
    ) -> Result<(Solution<N>, f64), Stuck> {
        let Solution { state, params } = &sample.solution;
        let (increments, changes, size) = sample.solved.step(functions, sample.noise)?;
        let params = from_fn(|i| params[i] + changes[i]);
        let state = self.corrected(state, params, (&increments, &sample.law_forces))?;
        Ok((Solution { state, params }, size))
    }

    /// Solves the bordered equations at a state, in equilibrium or not, given the rates of the
    /// parameters; `soft` as in [`Equations::assemble`].
    pub(super) fn sample(
        &mut self,
        mut solution: Solution<N>,
        border: &[Field],
        rates: Vec<Field>,
        soft: bool,
    ) -> Result<Sample<N>, Stuck> {
        let linear = self.assemble(&mut solution, soft)?;
        let (mut solved, mut factor) = self.solve_bordered(border, &linear.forces, &rates, 0.0)?;
        let none = vec![0.0; border.len()];
        let mut increments = solved.forces.increments.clone();
        // The softened matrix determines what is singular, and no step.
        let (completing, law_forces) = match soft {
            true => (None, Vec::new()),
            false => self.complete_law(&solution, &mut increments, &mut |_, forces| {
                Some(factor.solve_bordered(forces, &none).increments)
            })?,
        };
        if let Some(completing) = completing {
            solved.forces = factor.solve_bordered(&plus(&linear.forces, 1.0, &completing), &none);
        }
        Ok(Sample {
            solved,
            solution,
            rates,
            noise: linear.noise,
            law_forces,
        })
    }

    /// Solves the bordered equations with K + `shift` M, where K is the assembled matrix: for the
    /// forces, their rates, and the unit vectors of the border. Also returns the factors.
    pub(super) fn solve_bordered(
        &mut self,
        border: &[Field],
        forces: &Field,
        rates: &[Field],
        shift: f64,
    ) -> Result<(Solved, Factors), Stuck> {
        let p = border.len();
        let pattern = self.pattern(p)?;
        self.factorizations += 1;
        let factor = pattern.factorize_bordered(&self.system, shift, border);
        let mut factor = factor.map_err(|_| Stuck::TooLarge)?;
        let none = vec![0.0; p];
        let zero = times(forces, 0.0);
        let unit = |i: usize| (0..p).map(|k| if k == i { 1.0 } else { 0.0 }).collect();
        let units: Vec<Vec<f64>> = (0..p).map(unit).collect();
        let columns = units.iter().map(|unit| factor.solve_bordered(&zero, unit));
        let columns: Vec<Bordered> = columns.collect();
        let solved = Solved {
            h: DMatrix::from_fn(p, p, |r, c| {
                0.5 * (columns[c].multipliers[r] + columns[r].multipliers[c])
            }),
            modes: columns.into_iter().map(|it| it.increments).collect(),
            forces: factor.solve_bordered(forces, &none),
            rates: (rates.iter())
                .map(|rate| factor.solve_bordered(rate, &none))
                .collect(),
            negative: factor.negative(),
        };
        Ok((solved, factor))
    }
}

impl Equations<'_> {
    /// The `count` modes whose eigenvalues are nearest to zero at a point, by
    /// subspace inverse iteration; of mass one, in the order of these eigenvalues.
    pub fn soft_modes(&mut self, point: &Point, count: usize) -> Result<Vec<Field>, Stuck> {
        self.assemble(&mut point.solution(), false)?;
        let count = count
            .min(6 * self.rods() * self.grid().segments() / 2)
            .max(1);
        let pattern = self.pattern(0)?;
        let mut factor = factorized(&pattern, &self.system, SHIFT)?;
        let mut modes: Vec<Field> = (0..count).map(|k| seed(&mut self.system, k)).collect();
        for _ in 0..SUBSPACE_ITERATIONS {
            for mode in &mut modes {
                *mode = factor.solve_bordered(mode, &[]).increments;
            }
            // Gram-Schmidt in the mass product, then Rayleigh-Ritz: the operator is
            // K^-1 M, whose largest eigenvalues belong to the softest modes.
            for k in 0..count {
                for l in 0..k {
                    let part = self.product(&modes[l], &modes[k]);
                    let other = modes[l].clone();
                    add(&mut modes[k], -part, &other);
                }
                let norm = self.product(&modes[k], &modes[k]).sqrt();
                modes[k] = times(&modes[k], 1.0 / norm);
            }
            let momenta = self.momenta(&modes);
            let image = |momentum| factor.solve_bordered(momentum, &[]).increments;
            let images: Vec<Field> = momenta.iter().map(image).collect();
            let ritz = DMatrix::from_fn(count, count, |r, c| {
                0.5 * (dot(&momenta[r], &images[c]) + dot(&momenta[c], &images[r]))
            });
            let eigen = ritz.symmetric_eigen();
            let mut order: Vec<usize> = (0..count).collect();
            let size = |k: usize| eigen.eigenvalues[k].abs();
            order.sort_by(|&a, &b| size(b).total_cmp(&size(a)));
            let mode = |&k: &usize| combined(eigen.eigenvectors.column(k).as_slice(), &modes);
            modes = order.iter().map(mode).collect();
            // Back to forces, for the next inverse iteration.
            if !modes.iter().all(is_finite) {
                return Err(Stuck::NotConverged);
            }
            modes = self.momenta(&modes);
        }
        let modes = modes.iter().map(|momentum| {
            let mode = factor.solve_bordered(momentum, &[]).increments;
            let norm = self.product(&mode, &mode).sqrt();
            times(&mode, 1.0 / norm)
        });
        let modes = modes.collect();
        Ok(modes)
    }
}

/// Solutions of the bordered equations at some state.
pub struct Solved {
    /// For the forces, and for their rates with respect to each parameter.
    pub forces: Bordered,
    pub rates: Vec<Bordered>,
    /// H and X of the border.
    pub h: DMatrix<f64>,
    pub modes: Vec<Field>,
    /// Negative eigenvalues of the bordered matrix: those of the matrix and those of H
    /// together.
    pub negative: usize,
}

impl Solved {
    /// Newton increments and changes of the parameters by which as many additional functions
    /// become zero, and their size; fails if that is too large. Each function is given by its derivatives with respect to the increments and
    /// to the parameters, and its value: for the plane normal to a direction, the momentum of that
    /// direction, its parameter components, and zero.
    pub fn step(
        &self,
        functions: &[(&Field, &[f64], f64)],
        noise: f64,
    ) -> Result<(Field, Vec<f64>, f64), Stuck> {
        let (p, numbers) = (self.modes.len(), self.rates.len());
        let mut matrix = self.h.clone().resize(p + numbers, p + numbers, 0.0);
        let mut right = DVector::zeros(p + numbers);
        for r in 0..p {
            for (i, rate) in self.rates.iter().enumerate() {
                matrix[(r, p + i)] = rate.multipliers[r];
            }
            for (k, (dual, _, _)) in functions.iter().enumerate() {
                matrix[(p + k, r)] = dot(dual, &self.modes[r]);
            }
            // Forces below rounding are ignored.
            right[r] = match -self.forces.multipliers[r] {
                force if force.abs() < noise => -0.0,
                force => force,
            };
        }
        for (k, (dual, own, value)) in functions.iter().enumerate() {
            for (i, rate) in self.rates.iter().enumerate() {
                matrix[(p + k, p + i)] = dot(dual, &rate.increments) + own[i];
            }
            right[p + k] = -value - dot(dual, &self.forces.increments);
        }
        let svd = matrix.svd(true, true);
        let least = NEUTRAL * svd.singular_values.max();
        let solution = svd.solve(&right, least).map_err(|_| Stuck::NotConverged)?;
        let mut increments = self.forces.increments.clone();
        for (i, rate) in self.rates.iter().enumerate() {
            add(&mut increments, solution[p + i], &rate.increments);
        }
        for (mode, part) in self.modes.iter().zip(solution.iter()) {
            add(&mut increments, *part, mode);
        }
        let changes: Vec<f64> = solution.iter().skip(p).copied().collect();
        let sizes = changes.iter().map(|v| v.abs());
        let size = sizes.fold(largest(&increments), larger);
        match is_finite(&increments) && size <= LARGEST {
            true => Ok((increments, changes, size)),
            false => Err(Stuck::NotConverged),
        }
    }
}

/// Forces that excite many modes, with a different pattern along the rods for each `k`.
fn seed(system: &mut System, k: usize) -> Field {
    system.seed_mode();
    let mut seed = system.rhs();
    for (j, rod) in seed.iter_mut().enumerate() {
        for (i, forces) in rod.iter_mut().enumerate() {
            for (c, force) in forces.iter_mut().enumerate() {
                let phase = (k * (3 * i + 7 * c + 11 * j + 1)) as f64;
                *force *= (0.7 * phase).cos();
            }
        }
    }
    seed
}
