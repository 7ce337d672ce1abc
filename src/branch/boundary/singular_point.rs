//! A point of a boundary: an equilibrium at which the matrix is singular.
//!
//! The search for a point of a boundary: the zero of an eigenvalue across it.
//!
//! Equilibria of leaves that differ in two parameters, a manifold, on one grid.

use crate::branch;
use crate::branch::convergence::ExtrapolatedPoint;
use crate::branch::critical::{CriticalKind, CriticalPoint};
use crate::branch::equations::{BranchEquations, CorrectorFailure, ITERATIONS, STIFF};
use crate::branch::family::{
    LeafFamily, OutOfRange, force_parameter_derivative, unbalanced_forces,
};
use crate::branch::{
    add_scaled, combine_fields, dot, equations, increments_between, scale_field, scaled_sum,
};
use crate::leaf::NodalField;
use crate::newton::{Contraction, remaining_error};
use crate::numbers::{larger, largest};
use nalgebra::DMatrix;
use std::ops::Range;

/// Step of the central differences for the derivative of an eigenvalue.
const DIFFERENCE: f64 = 3e-4;

/// A parameter's work on a mode, relative to the largest possible, below which it is rounding.
const ROUNDING_FORCING: f64 = 1e-5;

/// Eigenvalues that differ by more than this, relative to their derivative with respect to
/// arclength, do not vanish together.
const COINCIDENT_EIGENVALUE_TOLERANCE: f64 = 1e-5;

/// A point of a boundary on one grid.
#[derive(Clone, Debug)]
pub struct SingularPoint {
    pub solution: TwoParameterState,
    /// The kind of critical point, along the first parameter.
    pub kind: CriticalKind,
    /// How many modes become neutral together.
    pub neutral_modes: usize,
    /// The modes of the border: first the neutral ones.
    pub border_modes: Vec<NodalField>,
    /// Directions along the boundary and across it on the solution manifold; the latter points
    /// to where there are more negative eigenvalues.
    pub tangent: TwoParameterDirection,
    pub normal: TwoParameterDirection,
    /// Derivative of the eigenvalue of H along the latter.
    pub slope: f64,
    /// Morse index beyond the boundary, on the side of the normal.
    pub index: usize,
    /// The other eigenvalues of H.
    pub others: Vec<f64>,
    /// At a fold: the derivative of the parameters with respect to arclength along the boundary,
    /// as the component along `heading`; it changes sign at a cusp.
    pub fold_speed: f64,
    /// The direction of the curve of folds in the parameter plane.
    pub fold_direction: [f64; 2],
}

/// A critical point of a branch in the parameter plane.
#[derive(Clone, Copy)]
pub struct BoundarySeed<'c> {
    pub critical: &'c CriticalPoint,
    /// The same extrapolated over grids.
    pub refined: &'c ExtrapolatedPoint,
    /// Both parameters at the start of the branch, as fractions of their ranges,
    pub from: [f64; 2],
    /// and their derivatives with respect to its parameter.
    pub direction: [f64; 2],
}

impl BoundarySeed<'_> {
    /// Both parameters at a value of the branch's parameter.
    pub fn parameters_at(&self, parameter: f64) -> [f64; 2] {
        [0, 1].map(|i| self.from[i] + parameter * self.direction[i])
    }

    /// The parameter that is constant along the branch, if there is one.
    pub fn constant_parameter(&self) -> Option<usize> {
        [1, 0]
            .into_iter()
            .find(|&which| self.direction[which] == 0.0)
    }
}

impl SingularPoint {
    /// The first point of a boundary, the normal of which is along the branch.
    pub fn begin(
        manifold: &mut TwoParameterEquations,
        seed: &BoundarySeed,
    ) -> Result<SingularPoint, CorrectorFailure> {
        let (critical, direction) = (seed.critical, seed.direction);
        let modes = critical.modes.iter().chain(&critical.border_modes);
        let soft = orthonormalize_modes(manifold, modes, critical.border_modes.len());
        let solution = TwoParameterState {
            state: critical.state.clone(),
            params: seed.parameters_at(critical.fraction),
        };
        let across = TwoParameterDirection {
            increments: critical.tangent.increments.clone(),
            params: direction.map(|part| part * critical.tangent.params[0]),
        };
        let slope = critical.eigenvalue_slope / manifold.direction_product(&across, &across).sqrt();
        let across = manifold.normalize_direction(across);
        let along = manifold.normalize_direction(TwoParameterDirection {
            params: [-direction[1], direction[0]],
            ..manifold.unit_parameter(1)
        });
        let like = SingularPoint {
            solution,
            kind: critical.kind,
            neutral_modes: critical.modes.len(),
            border_modes: soft,
            tangent: along,
            normal: across,
            slope,
            index: 0,
            others: Vec::new(),
            fold_speed: 0.0,
            fold_direction: [0.0; 2],
        };
        let search = like.search(manifold, None, like.solution.clone(), (1e-11, 0.1));
        let found = search.secant(manifold)?;
        like.with_own_directions(manifold, found)
    }

    /// The search for a point of the boundary near this one, from `solution`: in the plane normal
    /// to the tangent here or, if a parameter is `given`, with its value constant. To this
    /// accuracy, and not further than this.
    pub fn search(
        &self,
        manifold: &TwoParameterEquations,
        given: Option<usize>,
        solution: TwoParameterState,
        (accuracy, furthest): (f64, f64),
    ) -> BoundaryPointSearch {
        let (across, slope, along) = match given {
            Some(which) => {
                let (across, slope) = self.crossing_at_fixed_parameter(manifold, which);
                (across, slope, manifold.unit_parameter(which))
            }
            None => (self.normal.clone(), self.slope, self.tangent.clone()),
        };
        BoundaryPointSearch {
            solution,
            across,
            slope,
            along,
            soft: self.border_modes.clone(),
            neutral: self.neutral_modes,
            accuracy,
            furthest,
        }
    }

    /// The boundary point that was found from this one, with the directions of this one.
    pub fn with_search_result(
        &self,
        manifold: &TwoParameterEquations,
        found: BoundarySearchResult,
    ) -> SingularPoint {
        let BoundarySearchResult { sample, eigen, .. } = found;
        SingularPoint {
            border_modes: next_border_modes(manifold, &sample, &eigen),
            index: index(&sample, &eigen),
            others: eigen.others,
            solution: sample.solution,
            ..self.clone()
        }
    }

    /// The same with its own directions; the tangent is oriented as here.
    pub fn with_own_directions(
        &self,
        manifold: &mut TwoParameterEquations,
        found: BoundarySearchResult,
    ) -> Result<SingularPoint, CorrectorFailure> {
        let border = manifold.multiply_all_by_mass(&self.border_modes);
        let solution = found.sample.solution;
        let rates = manifold.parameter_derivatives(&solution, false)?;
        let sample = manifold.linearize_bordered(solution, &border, rates, true)?;
        let eigen = border_eigenvalues(&sample, self.neutral_modes);
        let basis = self.basis(manifold, &sample, &eigen)?;
        let soft = next_border_modes(manifold, &sample, &eigen);
        let change = self.eigenvalue_derivatives(manifold, &sample, &basis, &soft)?;
        let slope = change[0].hypot(change[1]);
        if !(slope.is_finite() && slope > NEUTRAL_EIGENVALUE) {
            return Err(CorrectorFailure::NotConverged);
        }
        if eigen.spread > COINCIDENT_EIGENVALUE_TOLERANCE * slope {
            return Err(CorrectorFailure::Separated);
        }
        let [a, b] = change.map(|part| part / slope);
        let normal = TwoParameterDirection::linear_combination([a, b], &basis);
        let mut tangent = TwoParameterDirection::linear_combination([-b, a], &basis);
        if manifold.direction_product(&tangent, &self.tangent) < 0.0 {
            tangent = tangent.reversed();
        }
        let forcing = self.forcing(&sample, &eigen, slope);
        if self.kind == CriticalKind::Branching && forcing.largest > ROUNDING_FORCING {
            return Err(CorrectorFailure::Unfolded);
        }
        // A fold moves in the direction in which the parameters do no work on the mode.
        let mut heading = forcing.free;
        if heading[0] * self.fold_direction[0] + heading[1] * self.fold_direction[1] < 0.0 {
            heading = heading.map(|part| -part);
        }
        Ok(SingularPoint {
            kind: self.kind,
            neutral_modes: self.neutral_modes,
            border_modes: soft,
            fold_speed: heading[0] * tangent.params[0] + heading[1] * tangent.params[1],
            fold_direction: heading,
            tangent,
            normal,
            slope,
            index: index(&sample, &eigen),
            others: eigen.others,
            solution: sample.solution,
        })
    }

    /// Derivatives of the eigenvalue in both directions on the manifold: with K X + B H = 0
    /// and B^T X = 1 that of H is -X^T dK X. The second-order distance of a straight line from
    /// the manifold cancels in central differences, except for stiff segments, which are corrected.
    fn eigenvalue_derivatives(
        &self,
        manifold: &mut TwoParameterEquations,
        sample: &TwoParameterLinearization,
        basis: &[TwoParameterDirection; 2],
        soft: &[NodalField],
    ) -> Result<[f64; 2], CorrectorFailure> {
        let modes = &soft[..self.neutral_modes.min(soft.len())];
        let border = manifold.multiply_all_by_mass(soft);
        let stiff = manifold
            .leaves
            .leaf_at(sample.solution.params)?
            .least_compliance()
            * STIFF
            <= 1.0;
        let mut change = [0.0; 2];
        for (change, direction) in change.iter_mut().zip(basis) {
            let mut at = |step: f64| {
                let mut solution =
                    manifold.displace_equilibrium(&sample.solution, direction, step)?;
                if stiff {
                    let (normals, rates) = ([&basis[0], &basis[1]], Some(&sample.rates[..]));
                    let corrected =
                        manifold.correct_bordered(solution, normals, &border, rates, false)?;
                    solution = corrected.solution;
                }
                Ok::<_, CorrectorFailure>((step, manifold.curvature(solution, modes)?))
            };
            let [after, before] = [DIFFERENCE, -DIFFERENCE].map(|step| match at(step) {
                // At an end of a range there may be no leaf beyond.
                Err(CorrectorFailure::OutOfRange(_)) => at(0.0),
                found => found,
            });
            let ((after, above), (before, below)) = (after?, before?);
            *change = (below - above) / (after - before);
        }
        Ok(change)
    }

    /// Two orthonormal directions that span the tangent plane of the solution manifold.
    fn basis(
        &self,
        manifold: &TwoParameterEquations,
        sample: &TwoParameterLinearization,
        eigen: &BorderEigenvalues,
    ) -> Result<[TwoParameterDirection; 2], CorrectorFailure> {
        let solved = &sample.solved;
        let p = solved.modes.len();
        let others = eigen
            .others
            .iter()
            .zip(&eigen.vectors[self.neutral_modes..]);
        let least = eigen.smallest_nonneutral();
        let left = others.filter(|(value, _)| value.abs() < least);
        let mut frozen: Vec<&Vec<f64>> = left.map(|(_, vector)| vector).collect();
        if self.kind == CriticalKind::Branching {
            // Another branch may leave along a neutral mode: exclude that from the tangent plane.
            frozen.extend(&eigen.vectors[..self.neutral_modes]);
        }
        let rows = (p + frozen.len()).max(p + 2);
        let mut matrix = DMatrix::<f64>::zeros(rows, p + 2);
        for r in 0..p {
            for c in 0..p {
                matrix[(r, c)] = solved.h[(r, c)];
            }
            for i in 0..2 {
                matrix[(r, p + i)] = solved.rates[i].multipliers[r];
            }
        }
        for (k, vector) in frozen.iter().enumerate() {
            for c in 0..p {
                matrix[(p + k, c)] = vector[c];
            }
        }
        let svd = matrix.svd(false, true);
        let right = svd.v_t.ok_or(CorrectorFailure::NotConverged)?;
        let mut order: Vec<usize> = (0..p + 2).collect();
        order.sort_by(|&a, &b| svd.singular_values[a].total_cmp(&svd.singular_values[b]));
        let direction = |row: usize| {
            let part = |c: usize| right[(row, c)];
            let parts: Vec<f64> = (0..p).map(part).collect();
            let mut increments = combine_fields(&parts, &solved.modes);
            for i in 0..2 {
                add_scaled(&mut increments, part(p + i), &solved.rates[i].increments);
            }
            TwoParameterDirection {
                increments,
                params: [part(p), part(p + 1)],
            }
        };
        let first = manifold.normalize_direction(direction(order[0]));
        let second = direction(order[1]);
        let part = manifold.direction_product(&first, &second);
        let second = TwoParameterDirection {
            increments: scaled_sum(&second.increments, -part, &first.increments),
            params: [0, 1].map(|i| second.params[i] - part * first.params[i]),
        };
        Ok([first, manifold.normalize_direction(second)])
    }

    fn forcing(
        &self,
        sample: &TwoParameterLinearization,
        eigen: &BorderEigenvalues,
        slope: f64,
    ) -> ParameterForcing {
        let (solved, rates) = (&sample.solved, &sample.rates);
        let mut largest = 0.0_f64;
        let mut free = [0.0; 2];
        for vector in &eigen.vectors[..self.neutral_modes] {
            let mode = combine_fields(vector, &solved.modes);
            let forcing = [0, 1].map(|i| {
                let multipliers = &solved.rates[i].multipliers;
                vector
                    .iter()
                    .zip(multipliers)
                    .map(|(v, d)| v * d)
                    .sum::<f64>()
            });
            for i in 0..2 {
                let most = (dot(&rates[i], &rates[i]) * dot(&mode, &mode)).sqrt();
                largest = larger(largest, forcing[i].abs() / most.max(slope));
            }
            let size = forcing[0].hypot(forcing[1]);
            free = [-forcing[1] / size, forcing[0] / size];
        }
        ParameterForcing { largest, free }
    }

    /// The direction on the manifold, across the boundary, in which one of the parameters
    /// is constant, and the derivative of the eigenvalue along it.
    pub fn crossing_at_fixed_parameter(
        &self,
        manifold: &TwoParameterEquations,
        which: usize,
    ) -> (TwoParameterDirection, f64) {
        let parts = [self.tangent.params[which], -self.normal.params[which]];
        let both = [self.normal.clone(), self.tangent.clone()];
        let across =
            manifold.normalize_direction(TwoParameterDirection::linear_combination(parts, &both));
        let slope = self.slope * manifold.direction_product(&across, &self.normal);
        (across, slope)
    }

    /// The same point with the opposite orientation along the boundary.
    pub fn reversed(&self) -> SingularPoint {
        SingularPoint {
            tangent: self.tangent.reversed(),
            fold_speed: -self.fold_speed,
            ..self.clone()
        }
    }
}

/// The modes for the next border: from the eigenvectors of H.
fn next_border_modes(
    manifold: &TwoParameterEquations,
    sample: &TwoParameterLinearization,
    eigen: &BorderEigenvalues,
) -> Vec<NodalField> {
    let modes = eigen.vectors.iter();
    let modes: Vec<NodalField> = modes
        .map(|it| combine_fields(it, &sample.solved.modes))
        .collect();
    orthonormalize_modes(manifold, modes.iter(), modes.len())
}

/// Morse index beyond the boundary: from the inertia of the bordered matrix, which is that of
/// the matrix and that of H together. Only the boundary's own neutral modes count as negative.
fn index(sample: &TwoParameterLinearization, eigen: &BorderEigenvalues) -> usize {
    let least = eigen.smallest_nonneutral();
    let held_negative = eigen.others.iter().filter(|&&h| h < least).count();
    sample.solved.negative.saturating_sub(held_negative)
}

/// Work of the parameters' force rates on the neutral modes.
struct ParameterForcing {
    /// The largest, relative to the largest possible.
    largest: f64,
    /// The direction in the parameter plane in which it vanishes.
    free: [f64; 2],
}

/// At most `count` of these modes, orthonormal in the mass product; linearly dependent ones
/// are left out.
fn orthonormalize_modes<'m>(
    manifold: &TwoParameterEquations,
    modes: impl Iterator<Item = &'m NodalField>,
    count: usize,
) -> Vec<NodalField> {
    let mut kept: Vec<NodalField> = Vec::new();
    for mode in modes {
        let size = manifold.mass_product(mode, mode).sqrt();
        let mut mode = scale_field(mode, 1.0 / size);
        for _ in 0..2 {
            for other in &kept {
                let part = manifold.mass_product(other, &mode);
                add_scaled(&mut mode, -part, other);
            }
        }
        let size = manifold.mass_product(&mode, &mode).sqrt();
        if size > 1e-6 && kept.len() < count {
            kept.push(scale_field(&mode, 1.0 / size));
        }
    }
    kept
}

/// Eigenvalues below this, or below their rounding error, belong to neutral modes.
pub const NEUTRAL_EIGENVALUE: f64 = 1e-7;

/// Largest number of evaluations in the search for a zero.
const EVALUATIONS: usize = 30;

/// Differences over less than this do not give a reliable slope.
const SHORTEST_SLOPE_DIFFERENCE: f64 = 1e-6;

/// Relative accuracy of the derivative of the eigenvalue in the combined Newton method; and the
/// size below which increments that do not shrink are due to rounding.
const EIGENVALUE_SLOPE_ACCURACY: f64 = 1e-3;

const ROUNDING_INCREMENT: f64 = 1e-9;

/// Eigenvalues of H at one evaluation.
pub struct BorderEigenvalues {
    /// The mean of those that become neutral, and the largest difference between them.
    pub value: f64,
    pub spread: f64,
    /// Eigenvectors of H: first theirs, then the others; and the eigenvalues of the others.
    pub vectors: Vec<Vec<f64>>,
    pub others: Vec<f64>,
    /// Their rounding error: that of the forces on so many segments.
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
    /// From here,
    pub solution: TwoParameterState,
    /// in this direction, along which the eigenvalue has this derivative,
    pub across: TwoParameterDirection,
    pub slope: f64,
    /// in the plane normal to this,
    pub along: TwoParameterDirection,
    /// with these modes in the border, the first `neutral` of which become neutral,
    pub soft: Vec<NodalField>,
    pub neutral: usize,
    /// to this accuracy, and not further than this.
    pub accuracy: f64,
    pub furthest: f64,
}

/// A boundary point without its directions.
pub struct BoundarySearchResult {
    pub sample: TwoParameterLinearization,
    pub eigen: BorderEigenvalues,
    /// Distance from the start of the search.
    pub distance: f64,
}

/// The eigenvalues of H; the first `neutral` modes of the border become neutral.
///
/// Modes that a symmetry keeps apart do not mix, and H couples them by no more than rounding. Where
/// their eigenvalues coincide, its eigenvectors are any mixture of them: then each part has its
/// own.
pub fn border_eigenvalues(sample: &TwoParameterLinearization, neutral: usize) -> BorderEigenvalues {
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
    BorderEigenvalues {
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

impl BoundaryPointSearch {
    /// The same point by Newton's method for the state and the zero of the eigenvalue
    /// together, from a good initial guess; also returns the estimated iteration error. At branch
    /// points the modes are `frozen`: the manifold is that of a symmetric branch, whose forces do
    /// not excite them. For an asymmetric branch this does not find the point: with a singular
    /// matrix, the amplitude of the mode is undetermined.
    pub fn newton(
        &self,
        manifold: &mut TwoParameterEquations,
        frozen: bool,
        contraction: &mut Contraction,
    ) -> Result<(BoundarySearchResult, f64), CorrectorFailure> {
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
            let (slope, numbers) =
                self.eigenvalue_gradient(manifold, &sample, &eigen, &border, frozen)?;
            let value = eigen.value / self.slope;
            let functions = [
                (&along, self.along.params.as_slice(), 0.0),
                (&slope, numbers.as_slice(), value),
            ];
            let (next, size) = manifold.newton_step(&sample, &functions)?;
            solution = next;
            if previous > ROUNDING_INCREMENT {
                contraction.update(size, previous);
            }
            // State and parameters have different scales: the constant may be large.
            let first = match contraction.is_measured() || size < ROUNDING_INCREMENT {
                true => contraction.error_after_first(size, 0.0),
                false => f64::INFINITY,
            };
            let accuracy = (self.accuracy, ROUNDING_INCREMENT);
            // With less accurate derivatives, increments cannot shrink faster than these are known;
            // and as the forces in segments follow their strains one iteration later, what the
            // first increment left may be subtracted twice by the second.
            let slopes = match iteration {
                1 => 1.0,
                _ => EIGENVALUE_SLOPE_ACCURACY.max(size / previous),
            };
            if let Some(left) = remaining_error(size, previous, [slopes; 2], accuracy, first) {
                let moved = manifold.difference(&self.solution, &solution);
                let distance = manifold.direction_product(&moved, &self.across);
                sample.solution = solution;
                let found = BoundarySearchResult {
                    sample,
                    eigen,
                    distance,
                };
                return Ok((found, left));
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
    ) -> Result<(NodalField, [f64; 2]), CorrectorFailure> {
        let own = &eigen.vectors[..self.neutral];
        let modes = own
            .iter()
            .map(|it| combine_fields(it, &sample.solved.modes));
        let modes: Vec<NodalField> = modes.collect();
        let part = 1.0 / (self.slope * self.neutral as f64);
        let mut all = scale_field(&modes[0], 0.0);
        let mut numbers = [0.0; 2];
        for mode in &modes {
            let (change, rates) = manifold.curvature_change(&sample.solution, mode)?;
            add_scaled(&mut all, part, &change);
            for (number, rate) in numbers.iter_mut().zip(rates) {
                *number += part * rate;
            }
        }
        if frozen {
            for (vector, mode) in own.iter().zip(&modes) {
                let along = dot(&all, mode);
                add_scaled(&mut all, -along, &combine_fields(vector, border));
            }
        }
        Ok((all, numbers))
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
            let solution = manifold.displace_along_direction(from, &self.across, step)?;
            let normals = [&self.along, &self.across];
            let sample =
                manifold.correct_bordered(solution, normals, &border, Some(&rates), false)?;
            let eigen = border_eigenvalues(&sample, self.neutral);
            Ok(BoundarySearchResult {
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
                return Err(CorrectorFailure::NotConverged);
            }
            if step.abs() < self.accuracy {
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

/// Increment along a mode of mass one over which the matrix is differenced.
const MODE_DIFFERENCE_STEP: f64 = 1e-5;

/// Leaves that differ in two parameters, their equations, and what solves these.
pub type TwoParameterProblem<'a> = LeafFamily<'a, 2>;

pub type TwoParameterEquations<'a> = BranchEquations<'a, 2>;

pub type TwoParameterState = branch::ParametrizedState<2>;

pub type TwoParameterDirection = branch::BranchDirection<2>;

pub type TwoParameterLinearization = equations::BorderedLinearization<2>;

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

    /// What leads from one solution to another.
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
    ) -> Result<(NodalField, [f64; 2]), CorrectorFailure> {
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
        Ok((change, numbers))
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
