//! Bordered equations of a branch: where the matrix is singular, or nearly so.

use std::array::from_fn;

use nalgebra::{DMatrix, DVector};

use crate::branch::problem::equations::{
    Equations, ITERATIONS, LARGEST, Stuck, at_rest, factorized,
};
use crate::branch::problem::field::{add, combined, dot, is_finite, largest, plus, times};
use crate::branch::{Direction, Point, Solution};
use crate::largest::larger;
use crate::leaf::{Bordered, Factors, Field, System};
use glam::DVec3;

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
    pub(in crate::branch) fn newton_step(
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
    pub(in crate::branch) fn sample(
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
    pub(in crate::branch) fn solve_bordered(
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
