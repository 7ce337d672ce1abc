//! A point of a boundary: an equilibrium at which the matrix is singular.

use nalgebra::DMatrix;

use super::manifold::{Direction, Manifold, Sample, Solution};
use super::search::{self, Eigen, Found, NEUTRAL, Search};
use crate::branch::events::critical::{Critical, Kind};
use crate::branch::problem::bordered::STIFF;
use crate::branch::problem::equations::Stuck;
use crate::branch::problem::field::{add, combined, dot, plus, times};
use crate::branch::verify::refined::Refined;
use crate::largest::larger;
use crate::leaf::Field;

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
        let eigen = search::eigen(&sample, self.neutral);
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
