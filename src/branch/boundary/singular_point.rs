//! A point of a boundary: an equilibrium at which the matrix is singular.
//!
//! The search for a point of a boundary: the zero of an eigenvalue across it.
//!
//! Equilibria of leaves that differ in two parameters, a manifold, on one grid.

use crate::branch;
use crate::branch::critical::{Critical, Kind};
use crate::branch::equations::{Equations, ITERATIONS, STIFF, Stuck};
use crate::branch::family::{Family, OutOfRange, forces_on, rate};
use crate::branch::refine::Refined;
use crate::branch::{add, between, combined, dot, equations, plus, times};
use crate::leaf::Field;
use crate::newton::{Contraction, converged};
use crate::numbers::{larger, largest};
use nalgebra::DMatrix;
use std::ops::Range;

/// Step of the central differences for the derivative of an eigenvalue.
const DIFFERENCE: f64 = 3e-4;

/// A parameter's work on a mode, relative to the largest possible, below which it is rounding.
const FORCED: f64 = 1e-5;

/// Eigenvalues that differ by more than this, relative to their derivative with respect to
/// arclength, do not vanish together.
const TOGETHER: f64 = 1e-5;

/// A point of a boundary on one grid.
#[derive(Clone, Debug)]
pub struct SingularPoint {
    pub solution: Solution,
    /// The kind of critical point, along the first parameter.
    pub kind: Kind,
    /// How many modes become neutral together.
    pub neutral: usize,
    /// The modes of the border: first the neutral ones.
    pub soft: Vec<Field>,
    /// Directions along the boundary and across it on the solution manifold; the latter points
    /// to where there are more negative eigenvalues.
    pub tangent: Direction,
    pub normal: Direction,
    /// Derivative of the eigenvalue of H along the latter.
    pub slope: f64,
    /// Morse index beyond the boundary, on the side of the normal.
    pub index: usize,
    /// The other eigenvalues of H.
    pub others: Vec<f64>,
    /// At a fold: the derivative of the parameters with respect to arclength along the boundary,
    /// as the component along `heading`; it changes sign at a cusp.
    pub speed: f64,
    /// The direction of the curve of folds in the parameter plane.
    pub heading: [f64; 2],
}

/// A critical point of a branch in the parameter plane.
#[derive(Clone, Copy)]
pub struct Seed<'c> {
    pub critical: &'c Critical,
    /// The same extrapolated over grids.
    pub refined: &'c Refined,
    /// Both parameters at the start of the branch, as fractions of their ranges,
    pub from: [f64; 2],
    /// and their derivatives with respect to its parameter.
    pub direction: [f64; 2],
}

impl Seed<'_> {
    /// Both parameters at a value of the branch's parameter.
    pub fn params(&self, parameter: f64) -> [f64; 2] {
        [0, 1].map(|i| self.from[i] + parameter * self.direction[i])
    }

    /// The parameter that is constant along the branch, if there is one.
    pub fn given(&self) -> Option<usize> {
        [1, 0]
            .into_iter()
            .find(|&which| self.direction[which] == 0.0)
    }
}

impl SingularPoint {
    /// The first point of a boundary, the normal of which is along the branch.
    pub fn begin(manifold: &mut Manifold, seed: &Seed) -> Result<SingularPoint, Stuck> {
        let (critical, direction) = (seed.critical, seed.direction);
        let modes = critical.modes.iter().chain(&critical.soft);
        let soft = independent(manifold, modes, critical.soft.len());
        let solution = Solution {
            state: critical.state.clone(),
            params: seed.params(critical.fraction),
        };
        let across = Direction {
            increments: critical.tangent.increments.clone(),
            params: direction.map(|part| part * critical.tangent.params[0]),
        };
        let slope = critical.slope / manifold.inner(&across, &across).sqrt();
        let across = manifold.normalised(across);
        let along = manifold.normalised(Direction {
            params: [-direction[1], direction[0]],
            ..manifold.unit_parameter(1)
        });
        let like = SingularPoint {
            solution,
            kind: critical.kind,
            neutral: critical.modes.len(),
            soft,
            tangent: along,
            normal: across,
            slope,
            index: 0,
            others: Vec::new(),
            speed: 0.0,
            heading: [0.0; 2],
        };
        let search = like.search(manifold, None, like.solution.clone(), (1e-11, 0.1));
        let found = search.secant(manifold)?;
        like.completed(manifold, found)
    }

    /// The search for a point of the boundary near this one, from `solution`: in the plane normal
    /// to the tangent here or, if a parameter is `given`, with its value constant. To this
    /// accuracy, and not further than this.
    pub fn search(
        &self,
        manifold: &Manifold,
        given: Option<usize>,
        solution: Solution,
        (accuracy, furthest): (f64, f64),
    ) -> Search {
        let (across, slope, along) = match given {
            Some(which) => {
                let (across, slope) = self.across_at(manifold, which);
                (across, slope, manifold.unit_parameter(which))
            }
            None => (self.normal.clone(), self.slope, self.tangent.clone()),
        };
        Search {
            solution,
            across,
            slope,
            along,
            soft: self.soft.clone(),
            neutral: self.neutral,
            accuracy,
            furthest,
        }
    }

    /// The boundary point that was found from this one, with the directions of this one.
    pub fn moved(&self, manifold: &Manifold, found: Found) -> SingularPoint {
        let Found { sample, eigen, .. } = found;
        SingularPoint {
            soft: soft(manifold, &sample, &eigen),
            index: index(&sample, &eigen),
            others: eigen.others,
            solution: sample.solution,
            ..self.clone()
        }
    }

    /// The same with its own directions; the tangent is oriented as here.
    pub fn completed(&self, manifold: &mut Manifold, found: Found) -> Result<SingularPoint, Stuck> {
        let border = manifold.momenta(&self.soft);
        let solution = found.sample.solution;
        let rates = manifold.rates(&solution, false)?;
        let sample = manifold.sample(solution, &border, rates, true)?;
        let eigen = eigen(&sample, self.neutral);
        let basis = self.basis(manifold, &sample, &eigen)?;
        let soft = soft(manifold, &sample, &eigen);
        let change = self.change(manifold, &sample, &basis, &soft)?;
        let slope = change[0].hypot(change[1]);
        if !(slope.is_finite() && slope > NEUTRAL) {
            return Err(Stuck::NotConverged);
        }
        if eigen.spread > TOGETHER * slope {
            return Err(Stuck::Separated);
        }
        let [a, b] = change.map(|part| part / slope);
        let normal = Direction::mixed([a, b], &basis);
        let mut tangent = Direction::mixed([-b, a], &basis);
        if manifold.inner(&tangent, &self.tangent) < 0.0 {
            tangent = tangent.reversed();
        }
        let forcing = self.forcing(&sample, &eigen, slope);
        if self.kind == Kind::Branching && forcing.largest > FORCED {
            return Err(Stuck::Unfolded);
        }
        // A fold moves in the direction in which the parameters do no work on the mode.
        let mut heading = forcing.free;
        if heading[0] * self.heading[0] + heading[1] * self.heading[1] < 0.0 {
            heading = heading.map(|part| -part);
        }
        Ok(SingularPoint {
            kind: self.kind,
            neutral: self.neutral,
            soft,
            speed: heading[0] * tangent.params[0] + heading[1] * tangent.params[1],
            heading,
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
    fn change(
        &self,
        manifold: &mut Manifold,
        sample: &Sample,
        basis: &[Direction; 2],
        soft: &[Field],
    ) -> Result<[f64; 2], Stuck> {
        let modes = &soft[..self.neutral.min(soft.len())];
        let border = manifold.momenta(soft);
        let stiff = manifold
            .leaves
            .at(sample.solution.params)?
            .least_compliance()
            * STIFF
            <= 1.0;
        let mut change = [0.0; 2];
        for (change, direction) in change.iter_mut().zip(basis) {
            let mut at = |step: f64| {
                let mut solution = manifold.beside(&sample.solution, direction, step)?;
                if stiff {
                    let (normals, rates) = ([&basis[0], &basis[1]], Some(&sample.rates[..]));
                    let corrected = manifold.bordered(solution, normals, &border, rates, false)?;
                    solution = corrected.solution;
                }
                Ok::<_, Stuck>((step, manifold.curvature(solution, modes)?))
            };
            let [after, before] = [DIFFERENCE, -DIFFERENCE].map(|step| match at(step) {
                // At an end of a range there may be no leaf beyond.
                Err(Stuck::OutOfRange(_)) => at(0.0),
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
        manifold: &Manifold,
        sample: &Sample,
        eigen: &Eigen,
    ) -> Result<[Direction; 2], Stuck> {
        let solved = &sample.solved;
        let p = solved.modes.len();
        let others = eigen.others.iter().zip(&eigen.vectors[self.neutral..]);
        let least = eigen.least();
        let left = others.filter(|(value, _)| value.abs() < least);
        let mut frozen: Vec<&Vec<f64>> = left.map(|(_, vector)| vector).collect();
        if self.kind == Kind::Branching {
            // Another branch may leave along a neutral mode: exclude that from the tangent plane.
            frozen.extend(&eigen.vectors[..self.neutral]);
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
        let right = svd.v_t.ok_or(Stuck::NotConverged)?;
        let mut order: Vec<usize> = (0..p + 2).collect();
        order.sort_by(|&a, &b| svd.singular_values[a].total_cmp(&svd.singular_values[b]));
        let direction = |row: usize| {
            let part = |c: usize| right[(row, c)];
            let parts: Vec<f64> = (0..p).map(part).collect();
            let mut increments = combined(&parts, &solved.modes);
            for i in 0..2 {
                add(&mut increments, part(p + i), &solved.rates[i].increments);
            }
            Direction {
                increments,
                params: [part(p), part(p + 1)],
            }
        };
        let first = manifold.normalised(direction(order[0]));
        let second = direction(order[1]);
        let part = manifold.inner(&first, &second);
        let second = Direction {
            increments: plus(&second.increments, -part, &first.increments),
            params: [0, 1].map(|i| second.params[i] - part * first.params[i]),
        };
        Ok([first, manifold.normalised(second)])
    }

    fn forcing(&self, sample: &Sample, eigen: &Eigen, slope: f64) -> Forcing {
        let (solved, rates) = (&sample.solved, &sample.rates);
        let mut largest = 0.0_f64;
        let mut free = [0.0; 2];
        for vector in &eigen.vectors[..self.neutral] {
            let mode = combined(vector, &solved.modes);
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
        Forcing { largest, free }
    }

    /// The direction on the manifold, across the boundary, in which one of the parameters
    /// is constant, and the derivative of the eigenvalue along it.
    pub fn across_at(&self, manifold: &Manifold, which: usize) -> (Direction, f64) {
        let parts = [self.tangent.params[which], -self.normal.params[which]];
        let both = [self.normal.clone(), self.tangent.clone()];
        let across = manifold.normalised(Direction::mixed(parts, &both));
        let slope = self.slope * manifold.inner(&across, &self.normal);
        (across, slope)
    }

    /// The same point with the opposite orientation along the boundary.
    pub fn turned(&self) -> SingularPoint {
        SingularPoint {
            tangent: self.tangent.reversed(),
            speed: -self.speed,
            ..self.clone()
        }
    }
}

/// The modes for the next border: from the eigenvectors of H.
fn soft(manifold: &Manifold, sample: &Sample, eigen: &Eigen) -> Vec<Field> {
    let modes = eigen.vectors.iter();
    let modes: Vec<Field> = modes.map(|it| combined(it, &sample.solved.modes)).collect();
    independent(manifold, modes.iter(), modes.len())
}

/// Morse index beyond the boundary: from the inertia of the bordered matrix, which is that of
/// the matrix and that of H together. Only the boundary's own neutral modes count as negative.
fn index(sample: &Sample, eigen: &Eigen) -> usize {
    let least = eigen.least();
    let held_negative = eigen.others.iter().filter(|&&h| h < least).count();
    sample.solved.negative.saturating_sub(held_negative)
}

/// Work of the parameters' force rates on the neutral modes.
struct Forcing {
    /// The largest, relative to the largest possible.
    largest: f64,
    /// The direction in the parameter plane in which it vanishes.
    free: [f64; 2],
}

/// At most `count` of these modes, orthonormal in the mass product; linearly dependent ones
/// are left out.
fn independent<'m>(
    manifold: &Manifold,
    modes: impl Iterator<Item = &'m Field>,
    count: usize,
) -> Vec<Field> {
    let mut kept: Vec<Field> = Vec::new();
    for mode in modes {
        let size = manifold.product(mode, mode).sqrt();
        let mut mode = times(mode, 1.0 / size);
        for _ in 0..2 {
            for other in &kept {
                let part = manifold.product(other, &mode);
                add(&mut mode, -part, other);
            }
        }
        let size = manifold.product(&mode, &mode).sqrt();
        if size > 1e-6 && kept.len() < count {
            kept.push(times(&mode, 1.0 / size));
        }
    }
    kept
}

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

/// Increment along a mode of mass one over which the matrix is differenced.
const ALONG_MODE: f64 = 1e-5;

/// Leaves that differ in two parameters, their equations, and what solves these.
pub type Plane<'a> = Family<'a, 2>;

pub type Manifold<'a> = Equations<'a, 2>;

pub type Solution = branch::Solution<2>;

pub type Direction = branch::Direction<2>;

pub type Sample = equations::Sample<2>;

impl Direction {
    /// The linear combination of two directions.
    pub fn mixed(parts: [f64; 2], [a, b]: &[Direction; 2]) -> Direction {
        let scaled = times(&a.increments, parts[0]);
        Direction {
            increments: plus(&scaled, parts[1], &b.increments),
            params: [0, 1].map(|i| parts[0] * a.params[i] + parts[1] * b.params[i]),
        }
    }
}

impl Manifold<'_> {
    /// The direction in which one parameter changes and nothing else.
    pub fn unit_parameter(&self, which: usize) -> Direction {
        let nodes = self.system.nodes();
        let mut params = [0.0; 2];
        params[which] = 1.0;
        Direction {
            increments: vec![vec![[0.0; 6]; nodes]; self.rods()],
            params,
        }
    }

    /// What leads from one solution to another.
    pub fn difference(&self, a: &Solution, b: &Solution) -> Direction {
        Direction {
            increments: between(&a.state, &b.state, self.first_node()),
            params: [0, 1].map(|i| b.params[i] - a.params[i]),
        }
    }

    /// State and parameters `step` further along a direction from an equilibrium: parameters
    /// change first, since the forces in the segments depend on all of their change, however short
    /// the step.
    pub fn beside(
        &mut self,
        solution: &Solution,
        to: &Direction,
        step: f64,
    ) -> Result<Solution, OutOfRange> {
        let (params, none) = (solution.params, self.unit_parameter(0).increments);
        let state = self.advanced(&solution.state, to.further(params, step), &none, 1.0)?;
        self.moved(&Solution { state, params }, to, step)
    }

    /// The product of the matrix and a mode.
    fn stiffness_times(&mut self, mut solution: Solution, mode: &Field) -> Result<Field, Stuck> {
        self.assemble(&mut solution, true)?;
        Ok(self.pattern(0)?.product(&self.system, mode))
    }

    /// The mean second derivative of the energy along modes.
    pub fn curvature(&mut self, mut solution: Solution, modes: &[Field]) -> Result<f64, Stuck> {
        self.assemble(&mut solution, true)?;
        let pattern = self.pattern(0)?;
        let along = |mode: &Field| dot(&pattern.product(&self.system, mode), mode);
        Ok(modes.iter().map(along).sum::<f64>() / modes.len() as f64)
    }

    /// Derivatives of the curvature of the energy along a mode, with the sign of H, with respect to
    /// all increments and both parameters. Where the mode is neutral, third derivatives of the
    /// energy are symmetric.
    pub fn curvature_change(
        &mut self,
        solution: &Solution,
        mode: &Field,
    ) -> Result<(Field, [f64; 2]), Stuck> {
        let way = Direction {
            increments: mode.clone(),
            params: [0.0; 2],
        };
        let mut change = times(mode, 0.0);
        for step in [ALONG_MODE, -ALONG_MODE] {
            let moved = self.moved(solution, &way, step)?;
            add(
                &mut change,
                -0.5 / step,
                &self.stiffness_times(moved, mode)?,
            );
        }
        let mut numbers = [0.0; 2];
        for (which, number) in numbers.iter_mut().enumerate() {
            let alone = self.unit_parameter(which);
            let changed = rate(|step| {
                let beside = self.beside(solution, &alone, step)?;
                self.stiffness_times(beside, mode)
            })?;
            *number = -dot(&changed, mode);
        }
        // Last, so that the system holds the increments of this state again.
        self.forces(solution)?;
        Ok((change, numbers))
    }

    /// A solution with the segment forces computed from its strains.
    pub fn with_segment_forces(&mut self, solution: &Solution) -> Result<Solution, OutOfRange> {
        self.forces(solution)?;
        let none = Direction {
            params: [0.0; 2],
            ..self.unit_parameter(0)
        };
        self.moved(solution, &none, 1.0)
    }

    /// The unbalanced forces; the system is left with the segments of this state.
    fn forces(&mut self, solution: &Solution) -> Result<Field, OutOfRange> {
        let leaf = self.leaves.at(solution.params)?;
        Ok(forces_on(leaf, &solution.state, &mut self.system))
    }
}
