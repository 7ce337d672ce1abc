//! The search for a point of a boundary: the zero of an eigenvalue across it.

use std::ops::Range;

use nalgebra::DMatrix;

use super::manifold::{Direction, Manifold, Sample, Solution};
use crate::branch::problem::equations::{ITERATIONS, Stuck};
use crate::branch::problem::field::{add, combined, dot, times};
use crate::largest::largest;
use crate::leaf::Field;
use crate::newton::{Contraction, converged};

/// Eigenvalues below this, or below their rounding error, belong to neutral modes.
pub const NEUTRAL: f64 = 1e-7;

/// Largest number of evaluations in the search for a zero.
const EVALUATIONS: usize = 30;

/// Differences over less than this do not give a reliable slope.
const LOCAL: f64 = 1e-6;

/// Relative accuracy of the derivative of the eigenvalue in the combined Newton method; and the
/// size below which increments that do not shrink are due to rounding.
const SLOPES: f64 = 1e-3;
const ROUNDED: f64 = 1e-9;

/// Eigenvalues of H at one evaluation.
pub struct Eigen {
    /// The mean of those that become neutral, and the largest difference between them.
    pub value: f64,
    pub spread: f64,
    /// Eigenvectors of H: first theirs, then the others; and the eigenvalues of the others.
    pub vectors: Vec<Vec<f64>>,
    pub others: Vec<f64>,
    /// Their rounding error: that of the forces on so many segments.
    pub rounding: f64,
}

impl Eigen {
    /// The least eigenvalue that does not belong to a neutral mode.
    pub fn least(&self) -> f64 {
        NEUTRAL.max(self.rounding)
    }
}

/// A search for a point of a boundary.
pub struct Search {
    /// From here,
    pub solution: Solution,
    /// in this direction, along which the eigenvalue has this derivative,
    pub across: Direction,
    pub slope: f64,
    /// in the plane normal to this,
    pub along: Direction,
    /// with these modes in the border, the first `neutral` of which become neutral,
    pub soft: Vec<Field>,
    pub neutral: usize,
    /// to this accuracy, and not further than this.
    pub accuracy: f64,
    pub furthest: f64,
}

/// A boundary point without its directions.
pub struct Found {
    pub sample: Sample,
    pub eigen: Eigen,
    /// Distance from the start of the search.
    pub distance: f64,
}

/// The eigenvalues of H; the first `neutral` modes of the border become neutral.
///
/// Modes that a symmetry keeps apart do not mix, and H couples them by no more than rounding. Where
/// their eigenvalues coincide, its eigenvectors are any mixture of them: then each part has its
/// own.
pub fn eigen(sample: &Sample, neutral: usize) -> Eigen {
    let h = &sample.solved.h;
    let (own, count) = (neutral.min(h.nrows()), h.nrows());
    let coupling = h.view((0, own), (own, count - own));
    let segments = sample.solution.state.segments() as f64;
    let rounding = sample.noise * segments * segments;
    let apart = largest(coupling.iter().map(|v| v.abs())) <= rounding;
    let mut pairs = match apart {
        true => [eigenpairs(h, 0..own), eigenpairs(h, own..count)].concat(),
        false => eigenpairs(h, 0..count),
    };
    // The neutral modes come first in the border.
    let weight = |vector: &[f64]| -> f64 { vector[..own].iter().map(|v| v * v).sum() };
    pairs.sort_by(|(_, a), (_, b)| weight(b).total_cmp(&weight(a)));
    let (values, vectors): (Vec<f64>, Vec<Vec<f64>>) = pairs.into_iter().unzip();
    let (own, others) = values.split_at(own);
    let most = own.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v));
    let least = own.iter().fold(f64::INFINITY, |m, v| m.min(*v));
    Eigen {
        value: own.iter().sum::<f64>() / neutral as f64,
        spread: most - least,
        vectors,
        others: others.to_vec(),
        rounding,
    }
}

/// Eigenvalues and eigenvectors of the part of a symmetric matrix in these rows and columns.
fn eigenpairs(h: &DMatrix<f64>, rows: Range<usize>) -> Vec<(f64, Vec<f64>)> {
    let (first, count) = (rows.start, rows.len());
    let all = h
        .view((first, first), (count, count))
        .into_owned()
        .symmetric_eigen();
    let pair = |k: usize| {
        let mut vector = vec![0.0; h.nrows()];
        let own = all.eigenvectors.column(k);
        vector[rows.clone()].copy_from_slice(own.as_slice());
        (all.eigenvalues[k], vector)
    };
    (0..count).map(pair).collect()
}

impl Search {
    /// The same point by Newton's method for the state and the zero of the eigenvalue
    /// together, from a good initial guess; also returns the estimated iteration error. At branch
    /// points the modes are `frozen`: the manifold is that of a symmetric branch, whose forces do
    /// not excite them. For an asymmetric branch this does not find the point: with a singular
    /// matrix, the amplitude of the mode is undetermined.
    pub fn newton(
        &self,
        manifold: &mut Manifold,
        frozen: bool,
        contraction: &mut Contraction,
    ) -> Result<(Found, f64), Stuck> {
        let border = manifold.momenta(&self.soft);
        let along = manifold.momentum(&self.along.increments);
        let mut solution = manifold.with_segment_forces(&self.solution)?;
        let mut previous = f64::INFINITY;
        for iteration in 0..ITERATIONS {
            let rates = manifold.rates(&solution, false)?;
            let mut sample = manifold.sample(solution, &border, rates, false)?;
            let eigen = eigen(&sample, self.neutral);
            let forces = &sample.solved.forces.multipliers;
            let excited = |mode: &Vec<f64>| {
                let force: f64 = mode.iter().zip(forces).map(|(part, f)| part * f).sum();
                force.abs() > sample.noise
            };
            if frozen && eigen.vectors[..self.neutral].iter().any(excited) {
                break;
            }
            let (slope, numbers) = self.change(manifold, &sample, &eigen, &border, frozen)?;
            let value = eigen.value / self.slope;
            let functions = [
                (&along, self.along.params.as_slice(), 0.0),
                (&slope, numbers.as_slice(), value),
            ];
            let (next, size) = manifold.newton_step(&sample, &functions)?;
            solution = next;
            if previous > ROUNDED {
                contraction.update(size, previous);
            }
            // State and parameters have different scales: the constant may be large.
            let first = match contraction.is_measured() || size < ROUNDED {
                true => contraction.error_after_first(size, 0.0),
                false => f64::INFINITY,
            };
            let accuracy = (self.accuracy, ROUNDED);
            // With less accurate derivatives, increments cannot shrink faster than these are known;
            // and as the forces in segments follow their strains one iteration later, what the
            // first increment left may be subtracted twice by the second.
            let slopes = match iteration {
                1 => 1.0,
                _ => SLOPES.max(size / previous),
            };
            if let Some(left) = converged(size, previous, [slopes; 2], accuracy, first) {
                let moved = manifold.difference(&self.solution, &solution);
                let distance = manifold.inner(&moved, &self.across);
                sample.solution = solution;
                let found = Found {
                    sample,
                    eigen,
                    distance,
                };
                return Ok((found, left));
            }
            previous = size;
        }
        Err(Stuck::NotConverged)
    }

    /// Derivatives of the eigenvalue with respect to increments and parameters, over its slope.
    fn change(
        &self,
        manifold: &mut Manifold,
        sample: &Sample,
        eigen: &Eigen,
        border: &[Field],
        frozen: bool,
    ) -> Result<(Field, [f64; 2]), Stuck> {
        let own = &eigen.vectors[..self.neutral];
        let modes = own.iter().map(|it| combined(it, &sample.solved.modes));
        let modes: Vec<Field> = modes.collect();
        let part = 1.0 / (self.slope * self.neutral as f64);
        let mut all = times(&modes[0], 0.0);
        let mut numbers = [0.0; 2];
        for mode in &modes {
            let (change, rates) = manifold.curvature_change(&sample.solution, mode)?;
            add(&mut all, part, &change);
            for (number, rate) in numbers.iter_mut().zip(rates) {
                *number += part * rate;
            }
        }
        if frozen {
            for (vector, mode) in own.iter().zip(&modes) {
                let along = dot(&all, mode);
                add(&mut all, -along, &combined(vector, border));
            }
        }
        Ok((all, numbers))
    }

    /// The zero of the eigenvalue by a secant method.
    pub fn secant(&self, manifold: &mut Manifold) -> Result<Found, Stuck> {
        let border = manifold.momenta(&self.soft);
        let rates = manifold.rates(&self.solution, false)?;
        // From the previous solution, to which the next is close.
        let mut at = |from: &Solution, step: f64, distance: f64| -> Result<Found, Stuck> {
            let solution = manifold.moved(from, &self.across, step)?;
            let normals = [&self.along, &self.across];
            let sample = manifold.bordered(solution, normals, &border, Some(&rates), false)?;
            let eigen = eigen(&sample, self.neutral);
            Ok(Found {
                sample,
                eigen,
                distance,
            })
        };
        let (mut distance, mut slope) = (0.0, self.slope);
        let mut best = at(&self.solution, 0.0, distance)?;
        let (mut value, mut last) = (best.eigen.value, best.sample.solution.clone());
        let mut worse = 0;
        for _ in 0..EVALUATIONS {
            let step = -value / slope;
            if !step.is_finite() || (distance + step).abs() > self.furthest {
                return Err(Stuck::NotConverged);
            }
            if step.abs() < self.accuracy {
                return Ok(best);
            }
            let next = at(&last, step, distance + step)?;
            let after = next.eigen.value;
            last.clone_from(&next.sample.solution);
            if step.abs() > LOCAL {
                slope = (after - value) / step;
            }
            (distance, value) = (distance + step, after);
            match after.abs() < best.eigen.value.abs() {
                true => best = next,
                false => worse += 1,
            }
            if worse > 1 {
                return Ok(best);
            }
        }
        Err(Stuck::NotConverged)
    }
}
