//! The search for a point of a boundary on one grid: across the boundary, on the manifold of
//! equilibria of leaves that differ in two parameters, for the zero of an eigenvalue of H.
//!
//! A secant method goes back to the manifold at every step by Newton's method; from a good initial
//! guess Newton's method solves for the state and the zero together, with the derivatives of the
//! eigenvalue with respect to the state and both parameters.

use crate::branch::equations::{AugmentingFunction, BranchEquations, CorrectorFailure, ITERATIONS};
use crate::branch::family::{
    LeafFamily, OutOfRange, force_parameter_derivative, unbalanced_forces,
};
use crate::branch::points::{
    add_scaled, combine_fields, increments_between, scale_field, scaled_sum,
};
use crate::branch::{equations, points};
use crate::leaf::NodalField;
use crate::leaf::dot;
use crate::newton::{Contraction, RequiredAccuracy, remaining_error};
use crate::numbers::largest;
use nalgebra::DMatrix;
use std::ops::Range;

/// Increment along a mode of mass one over which the matrix is differenced.
const MODE_DIFFERENCE_STEP: f64 = 1e-5;

/// Leaves that differ in two parameters, their equations, and what solves these.
pub type TwoParameterProblem<'a> = LeafFamily<'a, 2>;

pub type TwoParameterEquations<'a> = BranchEquations<'a, 2>;

pub type TwoParameterState = points::ParametrizedState<2>;

pub type TwoParameterDirection = points::BranchDirection<2>;

pub type TwoParameterLinearization = equations::BorderedLinearization<2>;

/// Derivatives of a function of the state and of both parameters.
pub struct TwoParameterGradient {
    /// With respect to the increments of the nodes.
    pub state: NodalField,
    /// With respect to the parameters, as fractions of their ranges.
    pub params: [f64; 2],
}

impl TwoParameterDirection {
    /// The linear combination of two directions.
    pub fn linear_combination(
        parts: [f64; 2],
        [a, b]: &[TwoParameterDirection; 2],
    ) -> TwoParameterDirection {
        let scaled = scale_field(&a.increments, parts[0]);
        TwoParameterDirection {
            increments: scaled_sum(&scaled, parts[1], &b.increments),
            params: [0, 1].map(|i| parts[0] * a.params[i] + parts[1] * b.params[i]),
        }
    }
}

impl TwoParameterEquations<'_> {
    /// The direction in which one parameter changes and nothing else.
    pub fn unit_parameter(&self, which: usize) -> TwoParameterDirection {
        let nodes = self.system.nodes();
        let mut params = [0.0; 2];
        params[which] = 1.0;
        TwoParameterDirection {
            increments: vec![vec![[0.0; 6]; nodes]; self.rods()],
            params,
        }
    }

    /// The direction, not normalized, from one solution to another.
    pub fn difference(
        &self,
        a: &TwoParameterState,
        b: &TwoParameterState,
    ) -> TwoParameterDirection {
        TwoParameterDirection {
            increments: increments_between(&a.state, &b.state, self.first_node()),
            params: [0, 1].map(|i| b.params[i] - a.params[i]),
        }
    }

    /// State and parameters `step` further along a direction from an equilibrium: parameters
    /// change first, since the forces in the segments depend on all of their change, however short
    /// the step.
    pub fn displace_equilibrium(
        &mut self,
        solution: &TwoParameterState,
        to: &TwoParameterDirection,
        step: f64,
    ) -> Result<TwoParameterState, OutOfRange> {
        let (params, none) = (solution.params, self.unit_parameter(0).increments);
        let state = self.state_after_increments(
            &solution.state,
            to.parameters_after_step(params, step),
            &none,
            1.0,
        )?;
        self.displace_along_direction(&TwoParameterState { state, params }, to, step)
    }

    /// The product of the matrix and a mode.
    fn stiffness_times(
        &mut self,
        mut solution: TwoParameterState,
        mode: &NodalField,
    ) -> Result<NodalField, CorrectorFailure> {
        self.assemble(&mut solution, true)?;
        Ok(self.pattern(0)?.product(&self.system, mode))
    }

    /// The mean second derivative of the energy along modes.
    pub fn curvature(
        &mut self,
        mut solution: TwoParameterState,
        modes: &[NodalField],
    ) -> Result<f64, CorrectorFailure> {
        self.assemble(&mut solution, true)?;
        let pattern = self.pattern(0)?;
        let along = |mode: &NodalField| dot(&pattern.product(&self.system, mode), mode);
        Ok(modes.iter().map(along).sum::<f64>() / modes.len() as f64)
    }

    /// Derivatives of the curvature of the energy along a mode, with the sign of H, with respect to
    /// all increments and both parameters. Where the mode is neutral, third derivatives of the
    /// energy are symmetric.
    pub fn curvature_change(
        &mut self,
        solution: &TwoParameterState,
        mode: &NodalField,
    ) -> Result<TwoParameterGradient, CorrectorFailure> {
        let way = TwoParameterDirection {
            increments: mode.clone(),
            params: [0.0; 2],
        };
        let mut change = scale_field(mode, 0.0);
        for step in [MODE_DIFFERENCE_STEP, -MODE_DIFFERENCE_STEP] {
            let moved = self.displace_along_direction(solution, &way, step)?;
            add_scaled(
                &mut change,
                -0.5 / step,
                &self.stiffness_times(moved, mode)?,
            );
        }
        let mut numbers = [0.0; 2];
        for (which, number) in numbers.iter_mut().enumerate() {
            let alone = self.unit_parameter(which);
            let changed = force_parameter_derivative(|step| {
                let beside = self.displace_equilibrium(solution, &alone, step)?;
                self.stiffness_times(beside, mode)
            })?;
            *number = -dot(&changed, mode);
        }
        // Last, so that the system holds the increments of this state again.
        self.forces(solution)?;
        Ok(TwoParameterGradient {
            state: change,
            params: numbers,
        })
    }

    /// A solution with the segment forces computed from its strains.
    pub fn with_segment_forces(
        &mut self,
        solution: &TwoParameterState,
    ) -> Result<TwoParameterState, OutOfRange> {
        self.forces(solution)?;
        let none = TwoParameterDirection {
            params: [0.0; 2],
            ..self.unit_parameter(0)
        };
        self.displace_along_direction(solution, &none, 1.0)
    }

    /// The unbalanced forces; the system is left with the segments of this state.
    fn forces(&mut self, solution: &TwoParameterState) -> Result<NodalField, OutOfRange> {
        let leaf = self.leaves.leaf_at(solution.params)?;
        Ok(unbalanced_forces(leaf, &solution.state, &mut self.system))
    }
}

/// A direction on the solution manifold across a boundary.
pub struct BoundaryCrossing {
    pub direction: TwoParameterDirection,
    /// Derivative of the vanishing eigenvalue along it.
    pub slope: f64,
}

/// How accurately a point of a boundary is sought, and how far (arclength on the manifold).
#[derive(Clone, Copy)]
pub struct BoundarySearchTolerance {
    pub accuracy: f64,
    pub largest_distance: f64,
}

/// Eigenvalues below this, or below their rounding error, belong to neutral modes.
pub(super) const NEUTRAL_EIGENVALUE: f64 = 1e-7;

/// Largest number of evaluations of the eigenvalue in the secant method.
const EVALUATIONS: usize = 30;

/// Over a shorter step across the boundary rounding errors make a difference quotient of the
/// eigenvalue worse than the one before.
const SHORTEST_SLOPE_DIFFERENCE: f64 = 1e-6;

/// Relative accuracy of the derivative of the eigenvalue in the combined Newton method; and the
/// size below which increments that do not shrink are due to rounding.
const EIGENVALUE_SLOPE_ACCURACY: f64 = 1e-3;

const ROUNDING_INCREMENT: f64 = 1e-9;

/// Eigenvalues of H at a state, those that become neutral together and the others.
pub struct BorderEigenvalues {
    /// The mean of those that become neutral, and the largest difference between them.
    pub value: f64,
    pub spread: f64,
    /// Eigenvectors of H, first of the modes that become neutral, then of the others; and the
    /// eigenvalues of the others.
    pub vectors: Vec<Vec<f64>>,
    pub others: Vec<f64>,
    /// Rounding error of the eigenvalues: that of the forces times the square of the segments.
    pub rounding: f64,
}

impl BorderEigenvalues {
    /// The least eigenvalue that does not belong to a neutral mode.
    pub fn smallest_nonneutral(&self) -> f64 {
        NEUTRAL_EIGENVALUE.max(self.rounding)
    }
}

/// A search for a point of a boundary.
pub struct BoundaryPointSearch {
    /// State and parameters from which the search starts.
    pub solution: TwoParameterState,
    /// The direction in which the point is sought.
    pub crossing: BoundaryCrossing,
    /// The normal of the plane in which the point is sought.
    pub along: TwoParameterDirection,
    /// The modes of the border, the first `neutral` of which become neutral.
    pub soft: Vec<NodalField>,
    pub neutral: usize,
    pub tolerance: BoundarySearchTolerance,
}

/// A point of a boundary that a search has found, without the directions of the boundary.
pub struct BoundarySearchResult {
    pub sample: TwoParameterLinearization,
    pub eigen: BorderEigenvalues,
    /// Distance from the start of the search.
    pub distance: f64,
    /// Estimated iteration error of Newton's method; a secant method iterates to rounding.
    pub iteration_error: f64,
}

/// The eigenvalues of H; the first `neutral` modes of the border become neutral.
///
/// Modes that a symmetry keeps apart do not mix, and H couples them by no more than rounding. Where
/// their eigenvalues coincide, its eigenvectors are any mixture of them: then each part has its
/// own.
pub(super) fn border_eigenvalues(
    sample: &TwoParameterLinearization,
    neutral: usize,
) -> BorderEigenvalues {
    let h = &sample.solved.h;
    let (own, count) = (neutral.min(h.nrows()), h.nrows());
    let coupling = h.view((0, own), (own, count - own));
    let segments = sample.solution.state.segments() as f64;
    let rounding = sample.noise * segments * segments;
    let apart = largest(coupling.iter().map(|v| v.abs())) <= rounding;
    let mut pairs: Vec<EigenPair> = match apart {
        true => (eigenpairs(h, 0..own).into_iter())
            .chain(eigenpairs(h, own..count))
            .collect(),
        false => eigenpairs(h, 0..count),
    };
    // The neutral modes come first in the border.
    let weight = |vector: &[f64]| -> f64 { vector[..own].iter().map(|v| v * v).sum() };
    pairs.sort_by(|a, b| weight(&b.vector).total_cmp(&weight(&a.vector)));
    let values: Vec<f64> = pairs.iter().map(|pair| pair.value).collect();
    let vectors = pairs.into_iter().map(|pair| pair.vector).collect();
    let (own, others) = values.split_at(own);
    let most = own.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v));
    let least = own.iter().fold(f64::INFINITY, |m, v| m.min(*v));
    BorderEigenvalues {
        value: own.iter().sum::<f64>() / neutral as f64,
        spread: most - least,
        vectors,
        others: others.to_vec(),
        rounding,
    }
}

/// An eigenvalue of H and its eigenvector.
struct EigenPair {
    value: f64,
    vector: Vec<f64>,
}

/// Eigenvalues and eigenvectors of the part of a symmetric matrix in these rows and columns.
fn eigenpairs(h: &DMatrix<f64>, rows: Range<usize>) -> Vec<EigenPair> {
    let (first, count) = (rows.start, rows.len());
    let all = h
        .view((first, first), (count, count))
        .into_owned()
        .symmetric_eigen();
    let pair = |k: usize| {
        let mut vector = vec![0.0; h.nrows()];
        let own = all.eigenvectors.column(k);
        vector[rows.clone()].copy_from_slice(own.as_slice());
        EigenPair {
            value: all.eigenvalues[k],
            vector,
        }
    };
    (0..count).map(pair).collect()
}

impl BoundaryPointSearch {
    /// The point by Newton's method for the state and the zero of the eigenvalue together, from a
    /// good initial guess. At branch points the modes are `frozen`: the manifold is that of a symmetric branch, whose forces do
    /// not excite them. For an asymmetric branch this does not find the point: with a singular
    /// matrix, the amplitude of the mode is undetermined.
    pub fn newton(
        &self,
        manifold: &mut TwoParameterEquations,
        frozen: bool,
        contraction: &mut Contraction,
    ) -> Result<BoundarySearchResult, CorrectorFailure> {
        let border = manifold.multiply_all_by_mass(&self.soft);
        let along = manifold.multiply_by_mass(&self.along.increments);
        let mut solution = manifold.with_segment_forces(&self.solution)?;
        let mut previous = f64::INFINITY;
        for iteration in 0..ITERATIONS {
            let rates = manifold.parameter_derivatives(&solution, false)?;
            let mut sample = manifold.linearize_bordered(solution, &border, rates, false)?;
            let eigen = border_eigenvalues(&sample, self.neutral);
            let forces = &sample.solved.forces.multipliers;
            let excited = |mode: &Vec<f64>| {
                let force: f64 = mode.iter().zip(forces).map(|(part, f)| part * f).sum();
                force.abs() > sample.noise
            };
            if frozen && eigen.vectors[..self.neutral].iter().any(excited) {
                break;
            }
            let gradient = self.eigenvalue_gradient(manifold, &sample, &eigen, &border, frozen)?;
            let functions = [
                AugmentingFunction {
                    state_gradient: &along,
                    parameter_gradient: &self.along.params,
                    value: 0.0,
                },
                AugmentingFunction {
                    state_gradient: &gradient.state,
                    parameter_gradient: &gradient.params,
                    value: eigen.value / self.crossing.slope,
                },
            ];
            let next = manifold.newton_step(&sample, &functions)?;
            let size = next.size;
            solution = next.solution;
            if previous > ROUNDING_INCREMENT {
                contraction.update(size, previous);
            }
            // State and parameters have different scales: the constant may be large.
            let first = match contraction.is_measured() || size < ROUNDING_INCREMENT {
                true => contraction.error_after_first(size, 0.0),
                false => f64::INFINITY,
            };
            let required = RequiredAccuracy {
                accuracy: self.tolerance.accuracy,
                rounding: ROUNDING_INCREMENT,
            };
            // With less accurate derivatives, increments cannot shrink faster than these are known;
            // and as the forces in segments follow their strains one iteration later, what the
            // first increment left may be subtracted twice by the second.
            let slopes = match iteration {
                1 => 1.0,
                _ => EIGENVALUE_SLOPE_ACCURACY.max(size / previous),
            };
            if let Some(left) = remaining_error(size, previous, [slopes; 2], required, first) {
                let moved = manifold.difference(&self.solution, &solution);
                let distance = manifold.direction_product(&moved, &self.crossing.direction);
                sample.solution = solution;
                return Ok(BoundarySearchResult {
                    sample,
                    eigen,
                    distance,
                    iteration_error: left,
                });
            }
            previous = size;
        }
        Err(CorrectorFailure::NotConverged)
    }

    /// Derivatives of the eigenvalue with respect to increments and parameters, over its slope.
    fn eigenvalue_gradient(
        &self,
        manifold: &mut TwoParameterEquations,
        sample: &TwoParameterLinearization,
        eigen: &BorderEigenvalues,
        border: &[NodalField],
        frozen: bool,
    ) -> Result<TwoParameterGradient, CorrectorFailure> {
        let own = &eigen.vectors[..self.neutral];
        let modes = own
            .iter()
            .map(|it| combine_fields(it, &sample.solved.modes));
        let modes: Vec<NodalField> = modes.collect();
        let part = 1.0 / (self.crossing.slope * self.neutral as f64);
        let mut all = scale_field(&modes[0], 0.0);
        let mut numbers = [0.0; 2];
        for mode in &modes {
            let change = manifold.curvature_change(&sample.solution, mode)?;
            add_scaled(&mut all, part, &change.state);
            for (number, rate) in numbers.iter_mut().zip(change.params) {
                *number += part * rate;
            }
        }
        if frozen {
            for (vector, mode) in own.iter().zip(&modes) {
                let along = dot(&all, mode);
                add_scaled(&mut all, -along, &combine_fields(vector, border));
            }
        }
        Ok(TwoParameterGradient {
            state: all,
            params: numbers,
        })
    }

    /// The zero of the eigenvalue by a secant method.
    pub fn secant(
        &self,
        manifold: &mut TwoParameterEquations,
    ) -> Result<BoundarySearchResult, CorrectorFailure> {
        let border = manifold.multiply_all_by_mass(&self.soft);
        let rates = manifold.parameter_derivatives(&self.solution, false)?;
        // From the previous solution, to which the next is close.
        let mut at = |from: &TwoParameterState,
                      step: f64,
                      distance: f64|
         -> Result<BoundarySearchResult, CorrectorFailure> {
            let across = &self.crossing.direction;
            let solution = manifold.displace_along_direction(from, across, step)?;
            let normals = [&self.along, across];
            let sample =
                manifold.correct_bordered(solution, normals, &border, Some(&rates), false)?;
            let eigen = border_eigenvalues(&sample, self.neutral);
            Ok(BoundarySearchResult {
                sample,
                eigen,
                distance,
                iteration_error: 0.0,
            })
        };
        let (mut distance, mut slope) = (0.0, self.crossing.slope);
        let mut best = at(&self.solution, 0.0, distance)?;
        let (mut value, mut last) = (best.eigen.value, best.sample.solution.clone());
        let mut worse = 0;
        for _ in 0..EVALUATIONS {
            let step = -value / slope;
            if !step.is_finite() || (distance + step).abs() > self.tolerance.largest_distance {
                return Err(CorrectorFailure::NotConverged);
            }
            if step.abs() < self.tolerance.accuracy {
                return Ok(best);
            }
            let next = at(&last, step, distance + step)?;
            let after = next.eigen.value;
            last.clone_from(&next.sample.solution);
            if step.abs() > SHORTEST_SLOPE_DIFFERENCE {
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
        Err(CorrectorFailure::NotConverged)
    }
}
