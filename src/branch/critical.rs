//! Critical points of a branch on one grid: folds and branch points, at which the index changes,
//! and vertices of pitchforks, where the branch turns back because another one crosses it.
//!
//! At a vertex no eigenvalue changes its sign along the branch that turns back, and the nearer its
//! points are to the vertex, the nearer to singular is the matrix. The vertex is therefore
//! interpolated from points on either side; the singular point is that of the other branch, with
//! the bordered matrix, which is regular.

use crate::branch::equations::{BorderedLinearization, BranchEquations, CorrectorFailure};
use crate::branch::family::eigenvalue_rounding;
use crate::branch::points::{
    BranchDirection, EquilibriumPoint, add_scaled, combine_fields, increments_between, scale_field,
    scaled_sum,
};
use crate::leaf::dot;
use crate::leaf::{NodalField, State};
use crate::numbers::larger;
use crate::words;

/// Additional modes in the border: others may be nearly neutral.
const EXTRA_BORDER_MODES: usize = 2;

/// How the zero of an eigenvalue, or of another function, along a curve is sought by a secant
/// method.
pub(super) struct SecantLimits {
    /// Largest number of evaluations of the function, each by Newton's method.
    pub evaluations: usize,
    /// A step below this is the last (arclength).
    pub accuracy: f64,
    /// Over a shorter step rounding errors make a difference quotient worse than that before.
    pub shortest_slope_difference: f64,
}

/// The search for a critical point: lengths are parts of the step that contains it.
const SECANT: SecantLimits = SecantLimits {
    evaluations: 40,
    accuracy: 1e-13,
    shortest_slope_difference: 1e-6,
};

/// Sign changes of eigenvalues smaller than this are ignored: the mode stays neutral.
const NEUTRAL_EIGENVALUE: f64 = 1e-6;

/// At a zero an eigenvalue is smaller than this part of its values at the ends of the step, or than
/// so many times its rounding error: where the step has led across a gap to another branch, it
/// jumps.
const ZERO_EIGENVALUE_FRACTION: f64 = 1e-6;

const ZERO_ROUNDING_FACTOR: f64 = 100.0;

/// Zeros closer than this part of a step are the same.
const COINCIDENT_ZERO_TOLERANCE: f64 = 1e-6;

/// The search ends within this part of the step from the point that the step reached, if both
/// are on the same branch.
const SEARCH_END_TOLERANCE: f64 = 0.05;

/// Two vertices nearer to each other than this are the same.
const SAME_VERTEX_DISTANCE: f64 = 1e-4;

/// What a branch does where its matrix is singular.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CriticalKind {
    /// The branch turns back in the parameter.
    Fold,
    /// Other branches cross the branch.
    Branching,
}

words! {
    /// On which side of a branch point, along a branch that loses its stability there, the branches that cross lie
    /// (Golubitsky and Schaeffer, Singularities and Groups in Bifurcation Theory I, 1985).
    pub enum BranchingKind {
        /// Beyond it: they leave steadily, and are stable where they leave a stable branch.
        Supercritical = "supercritical",
        /// Before it: they are unstable there, and the leaf jumps.
        Subcritical = "subcritical",
        /// One on either side.
        Transcritical = "transcritical",
    }
}

/// Distances (arclength) from a branch point at which the branches that cross there tell on which side they lie: of the
/// second twice as far, even parts are four times, odd ones twice as large.
const BRANCHING_DISTANCES: [f64; 2] = [0.01, 0.02];

/// By how much the ratio of both parts may differ from four and from two, as a factor.
const BRANCHING_RATIO_TOLERANCE: f64 = 1.5;

/// A point of a branch at which the matrix is singular.
#[derive(Clone, Debug)]
pub struct CriticalPoint {
    pub state: State,
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    pub tangent: BranchDirection,
    pub kind: CriticalKind,
    /// Morse index before and after; the same at the vertex of a pitchfork.
    pub indices: [usize; 2],
    /// The modes with eigenvalue zero, of mass one.
    pub modes: Vec<NodalField>,
    /// The modes of the border: the neutral and others that are nearly so.
    pub border_modes: Vec<NodalField>,
    /// Position of the vanishing one among the sorted eigenvalues of H, and its derivative with
    /// respect to arclength along the tangent.
    pub eigenvalue_position: usize,
    pub eigenvalue_slope: f64,
    /// Error of the fraction of a fold due to rounding of the forces: they balance along the
    /// neutral mode to rounding only.
    pub rounding: f64,
}

/// The critical points between two points of a branch, the second of them `step` along the
/// tangent of the first.
pub(super) fn locate_critical_points(
    equations: &mut BranchEquations,
    a: &EquilibriumPoint,
    b: &EquilibriumPoint,
    step: f64,
) -> Result<Vec<CriticalPoint>, CorrectorFailure> {
    let count = a.index.abs_diff(b.index) + EXTRA_BORDER_MODES;
    let soft = equations.soft_modes(a, count)?;
    let mut search = CriticalPointSearch {
        equations,
        from: a,
        soft: &soft,
        parameter_only: false,
    };
    let ends = [
        search.eigenvalues_at_distance(0.0)?,
        search.eigenvalues_at_distance(step)?,
    ];
    if ends[1]
        .sample
        .solution
        .state
        .largest_displacement_to(&b.state)
        > SEARCH_END_TOLERANCE * step
    {
        return Err(CorrectorFailure::NotConverged);
    }
    let mut found: Vec<EigenvalueZero> = Vec::new();
    for which in 0..ends[0].eigenvalues.len() {
        let values = [0, 1].map(|k| ends[k].eigenvalues[which]);
        let large = values[0].abs().max(values[1].abs()) > NEUTRAL_EIGENVALUE;
        if values[0] * values[1] < 0.0 && large {
            let zero = search.find_eigenvalue_zero(which, [0.0, step], values)?;
            match found.iter_mut().find(|other| {
                (other.distance - zero.distance).abs() < COINCIDENT_ZERO_TOLERANCE * step
            }) {
                Some(same) => same.critical.modes.extend(zero.critical.modes),
                None => found.push(zero),
            }
        }
    }
    found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    // Each accounts for its part of the change of the index, in their order along the branch.
    let mut before = a.index;
    for EigenvalueZero { critical, .. } in &mut found {
        let change = critical.modes.len();
        let after = match b.index > a.index {
            true => before + change,
            false => before.saturating_sub(change),
        };
        critical.indices = [before, after];
        before = after;
        if change > 1 {
            critical.kind = CriticalKind::Branching;
        }
    }
    Ok(found.into_iter().map(|zero| zero.critical).collect())
}

/// The zero of an eigenvalue of H along a branch.
struct EigenvalueZero {
    /// Its distance along the tangent from the point where the search began.
    distance: f64,
    critical: CriticalPoint,
}

/// Evaluates points along the tangent of one, and the eigenvalues of H there.
struct CriticalPointSearch<'s, 'a> {
    equations: &'s mut BranchEquations<'a>,
    from: &'s EquilibriumPoint,
    /// The modes that border the matrix.
    soft: &'s [NodalField],
    /// Whether the parameter alone is sought to rounding: at a fold it is known better than the
    /// shape.
    parameter_only: bool,
}

/// The eigenvalues of H at a point.
struct EvaluatedEigenvalues {
    sample: BorderedLinearization,
    eigenvalues: Vec<f64>,
    /// Eigenvectors of H, in the order of the eigenvalues.
    vectors: Vec<Vec<f64>>,
}

/// A parameter's work on a mode, relative to the largest possible, below which it is rounding.
const ROUNDING_FORCING: f64 = 1e-6;

impl CriticalPointSearch<'_, '_> {
    fn eigenvalues_at_distance(
        &mut self,
        distance: f64,
    ) -> Result<EvaluatedEigenvalues, CorrectorFailure> {
        let (equations, tangent) = (&mut *self.equations, &self.from.tangent);
        let moved = equations.displace_along_direction(&self.from.solution(), tangent, distance)?;
        let border = equations.multiply_all_by_mass(self.soft);
        let sample =
            equations.correct_bordered(moved, [tangent], &border, None, self.parameter_only)?;
        let eigen = sample.solved.h.clone().symmetric_eigen();
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let vector = |&k: &usize| eigen.eigenvectors.column(k).iter().copied().collect();
        Ok(EvaluatedEigenvalues {
            eigenvalues: order.iter().map(|&k| eigen.eigenvalues[k]).collect(),
            vectors: order.iter().map(vector).collect(),
            sample,
        })
    }

    /// The zero of one eigenvalue by the Anderson-Bjorck method.
    fn find_eigenvalue_zero(
        &mut self,
        which: usize,
        mut distance: [f64; 2],
        mut value: [f64; 2],
    ) -> Result<EigenvalueZero, CorrectorFailure> {
        let whole = distance[1] - distance[0];
        let largest = larger(value[0].abs(), value[1].abs());
        let mut slope = (value[1] - value[0]) / whole;
        let mut best: Option<(f64, EvaluatedEigenvalues)> = None;
        let (mut last, mut last_value) = (distance[1], value[1]);
        for _ in 0..SECANT.evaluations {
            let at = (distance[0] * value[1] - distance[1] * value[0]) / (value[1] - value[0]);
            let next = self.eigenvalues_at_distance(at)?;
            let now = next.eigenvalues[which];
            let done = (at - last).abs() < SECANT.accuracy * whole || now == 0.0;
            if (at - last).abs() > SECANT.shortest_slope_difference * whole {
                slope = (now - last_value) / (at - last);
            }
            let least = best.as_ref().map(|(_, best)| best.eigenvalues[which].abs());
            if least.is_none_or(|least| now.abs() <= least) {
                best = Some((at, next));
            }
            if done {
                break;
            }
            (last, last_value) = (at, now);
            if now * value[1] < 0.0 {
                distance[0] = distance[1];
                value[0] = value[1];
            } else {
                let shrunk = 1.0 - now / value[1];
                value[0] *= if shrunk > 0.0 { shrunk } else { 0.5 };
            }
            (distance[1], value[1]) = (at, now);
        }
        let (at, best) = best.ok_or(CorrectorFailure::NotConverged)?;
        let params = best.sample.solution.params;
        let stiffest = self.equations.stiffest_condensed(params)?;
        let rounding = eigenvalue_rounding(stiffest, self.from.state.segments());
        let least = best.eigenvalues[which].abs();
        let vanishes = least
            <= larger(
                ZERO_EIGENVALUE_FRACTION * largest,
                ZERO_ROUNDING_FACTOR * rounding,
            );
        if !vanishes {
            return Err(CorrectorFailure::NotConverged);
        }
        Ok(EigenvalueZero {
            distance: at,
            critical: self.critical_point_at_zero(best, which, slope),
        })
    }

    /// The critical point from what was evaluated at a zero.
    fn critical_point_at_zero(
        &self,
        zero: EvaluatedEigenvalues,
        which: usize,
        slope: f64,
    ) -> CriticalPoint {
        let (vector, sample) = (&zero.vectors[which], zero.sample);
        let mode = combine_fields(vector, &sample.solved.modes);
        let norm = self.equations.mass_product(&mode, &mode).sqrt();
        let parts = vector.iter().zip(&sample.solved.rates[0].multipliers);
        let forcing: f64 = parts.map(|(v, d)| v * d).sum();
        let rate = &sample.rates[0];
        let most = (dot(rate, rate) * dot(&mode, &mode)).sqrt();
        let fold = forcing.abs() > ROUNDING_FORCING * most.max(slope.abs());
        CriticalPoint {
            kind: if fold {
                CriticalKind::Fold
            } else {
                CriticalKind::Branching
            },
            rounding: if fold {
                sample.noise / forcing.abs()
            } else {
                0.0
            },
            state: sample.solution.state,
            fraction: sample.solution.params[0],
            tangent: self.from.tangent.clone(),
            indices: [self.from.index; 2],
            modes: vec![scale_field(&mode, 1.0 / norm)],
            border_modes: self.soft.to_vec(),
            eigenvalue_position: which,
            eigenvalue_slope: slope,
        }
    }
}

impl CriticalPoint {
    /// Whether the index does not change along the branch: see [`crate::branch::critical`].
    pub fn is_vertex(&self) -> bool {
        self.indices[0] == self.indices[1]
    }

    /// Whether this vertex is the same point, found again after a step that was rejected.
    pub fn is_same_point(&self, other: &CriticalPoint) -> bool {
        let apart = self.state.largest_displacement_to(&other.state);
        larger(apart, (self.fraction - other.fraction).abs()) < SAME_VERTEX_DISTANCE
    }

    /// This critical point on another grid or of a softened matrix, by a secant method from
    /// the known state.
    pub fn relocate(
        &self,
        equations: &mut BranchEquations,
    ) -> Result<CriticalPoint, CorrectorFailure> {
        let from = EquilibriumPoint {
            state: self.state.clone(),
            fraction: self.fraction,
            tangent: self.tangent.clone(),
            index: self.indices[0],
            iterations: 0,
        };
        let mut search = CriticalPointSearch {
            equations,
            from: &from,
            soft: &self.border_modes,
            parameter_only: self.kind == CriticalKind::Fold,
        };
        let least = match self.kind {
            // Shorter steps follow the rounding of the eigenvalue, and the parameter of a fold
            // depends on their squares.
            CriticalKind::Fold => {
                let stiffest = search.equations.stiffest_condensed([self.fraction])?;
                let rounding = eigenvalue_rounding(stiffest, self.state.segments());
                (rounding / self.eigenvalue_slope.abs()).max(SECANT.accuracy)
            }
            CriticalKind::Branching => SECANT.accuracy,
        };
        let (mut distance, mut slope) = (0.0, self.eigenvalue_slope);
        let mut best = search.eigenvalues_at_distance(distance)?;
        let mut value = best.eigenvalues[self.eigenvalue_position];
        let mut worse = 0;
        for _ in 0..SECANT.evaluations {
            let step = -value / slope;
            if !step.is_finite() || step.abs() > 1.0 {
                return Err(CorrectorFailure::NotConverged);
            }
            let next = search.eigenvalues_at_distance(distance + step)?;
            let after = next.eigenvalues[self.eigenvalue_position];
            if step.abs() > SECANT.shortest_slope_difference {
                slope = (after - value) / step;
            }
            (distance, value) = (distance + step, after);
            match after.abs() < best.eigenvalues[self.eigenvalue_position].abs() {
                true => best = next,
                false => worse += 1,
            }
            if step.abs() < least || worse > 1 {
                break;
            }
        }
        Ok(CriticalPoint {
            kind: self.kind,
            indices: self.indices,
            ..search.critical_point_at_zero(best, self.eigenvalue_position, slope)
        })
    }

    /// The equilibrium at a distance from it along a direction, in the plane normal to that.
    pub fn equilibrium_along_direction(
        &self,
        equations: &mut BranchEquations,
        to: &BranchDirection,
        distance: f64,
    ) -> Result<EquilibriumPoint, CorrectorFailure> {
        let [fraction] = to.parameters_after_step([self.fraction], distance);
        let state =
            equations.state_after_increments(&self.state, [fraction], &to.increments, distance)?;
        equations.correct(&state, fraction, Some(to))
    }

    /// On which side the branches lie that cross here, where one mode becomes unstable, or stable, along the branch;
    /// `None` where that is not to be seen near the point.
    pub fn branching_kind(&self, equations: &mut BranchEquations) -> Option<BranchingKind> {
        if self.kind != CriticalKind::Branching || self.modes.len() != 1 || self.is_vertex() {
            return None;
        }
        let direction = self.branching_direction(equations);
        let mut shift_at = |direction: &BranchDirection, distance: f64| -> Option<f64> {
            let point = self.equilibrium_along_direction(equations, direction, distance);
            Some(point.ok()?.fraction - self.fraction)
        };
        // The parameter is c1 a + c2 a^2 + ... away at the distance a, to either side.
        let (mut even, mut odd) = ([0.0; 2], [0.0; 2]);
        for (k, distance) in BRANCHING_DISTANCES.into_iter().enumerate() {
            let ahead = shift_at(&direction, distance)?;
            let back = shift_at(&direction.reversed(), distance)?;
            (even[k], odd[k]) = (0.5 * (ahead + back), 0.5 * (ahead - back));
        }
        let grows = |parts: [f64; 2], by: f64| {
            let ratio = parts[1] / parts[0] / by;
            ratio < BRANCHING_RATIO_TOLERANCE && ratio > BRANCHING_RATIO_TOLERANCE.recip()
        };
        let to_unstable_side = match self.indices[1] > self.indices[0] {
            true => self.tangent.params[0],
            false => -self.tangent.params[0],
        };
        match odd[0].abs() > even[0].abs() {
            true => grows(odd, 2.0).then_some(BranchingKind::Transcritical),
            false if !grows(even, 4.0) => None,
            false if even[0] * to_unstable_side > 0.0 => Some(BranchingKind::Supercritical),
            false => Some(BranchingKind::Subcritical),
        }
    }

    /// Derivative of the eigenvalue with respect to the parameter; infinite at a fold, where the
    /// parameter has no first-order error.
    pub fn eigenvalue_parameter_derivative(&self) -> f64 {
        match self.kind {
            CriticalKind::Fold => f64::INFINITY,
            CriticalKind::Branching => (self.eigenvalue_slope / self.tangent.params[0]).abs(),
        }
    }

    /// A direction along which another branch may leave: the first neutral mode
    /// orthogonalized against this branch; at the vertex of a pitchfork the tangent, that of the
    /// other branch.
    pub fn branching_direction(&self, equations: &BranchEquations) -> BranchDirection {
        if self.is_vertex() {
            return self.tangent.clone();
        }
        let mode = &self.modes[0];
        let part = equations.mass_product(&self.tangent.increments, mode);
        equations.normalize_direction(BranchDirection {
            increments: scaled_sum(mode, -part, &self.tangent.increments),
            params: [-part * self.tangent.params[0]],
        })
    }
}

/// Distances (arclength) from the vertex of a pitchfork between which the branch that crosses there
/// is searched for its singular point.
const VERTEX_SEARCH_DISTANCES: [f64; 3] = [0.01, 0.003, 0.001];

/// The crossing is that of the vertex if it is within this part of the step from where a cubic
/// through the points on either side has it.
const LARGEST_VERTEX_OFFSET: f64 = 0.1;

/// The point at which a branch turns back because it crosses another one there, the vertex of a
/// pitchfork: no eigenvalue changes its sign along this branch, but one does along the other, which
/// goes on beyond the vertex. The points are on either side of the vertex, `step` apart; the
/// tangent of the result is that of the other branch. Fails if that is not found.
pub(super) fn locate_pitchfork_vertex(
    equations: &mut BranchEquations,
    a: &EquilibriumPoint,
    b: &EquilibriumPoint,
    step: f64,
) -> Result<CriticalPoint, CorrectorFailure> {
    let vertex = vertex_between(equations, [a, b], step)?;
    let soft = equations.soft_modes(&vertex, 1 + EXTRA_BORDER_MODES)?;
    let across = crossing_direction(equations, &vertex, &soft)?;
    let mut stuck = CorrectorFailure::NotConverged;
    for beside in VERTEX_SEARCH_DISTANCES {
        match locate_on_crossing_branch(equations, &vertex, &across, &soft, beside) {
            Ok(mut critical) => {
                let shift = vertex.state.largest_displacement_to(&critical.state);
                let apart = larger(shift, (critical.fraction - vertex.fraction).abs());
                if apart < LARGEST_VERTEX_OFFSET * step && critical.kind == CriticalKind::Branching
                {
                    critical.indices = [a.index, b.index];
                    return Ok(critical);
                }
            }
            Err(other) => stuck = other,
        }
    }
    Err(stuck)
}

/// The point between two others, `step` apart, at which the parameter of the cubic through them,
/// with their tangents, is stationary.
fn vertex_between(
    equations: &mut BranchEquations,
    [a, b]: [&EquilibriumPoint; 2],
    step: f64,
) -> Result<EquilibriumPoint, CorrectorFailure> {
    let rates = [a, b].map(|point| step * point.tangent.params[0]);
    let chord = b.fraction - a.fraction;
    // The derivative of the cubic, from one rate to the other.
    let quadratic = 3.0 * (rates[0] + rates[1] - 2.0 * chord);
    let linear = 6.0 * chord - 4.0 * rates[0] - 2.0 * rates[1];
    let root = (linear * linear - 4.0 * quadratic * rates[0])
        .max(0.0)
        .sqrt();
    let part = -2.0 * rates[0] / (linear + root.copysign(linear));
    let hermite = [
        part * part * (3.0 - 2.0 * part),
        part * (1.0 - part) * (1.0 - part),
        -part * part * (1.0 - part),
    ];
    let mut increments = scale_field(
        &increments_between(&a.state, &b.state, equations.first_node()),
        hermite[0],
    );
    add_scaled(&mut increments, step * hermite[1], &a.tangent.increments);
    add_scaled(&mut increments, step * hermite[2], &b.tangent.increments);
    let fraction = a.fraction + hermite[0] * chord + hermite[1] * rates[0] + hermite[2] * rates[1];
    Ok(EquilibriumPoint {
        state: equations.state_after_increments(&a.state, [fraction], &increments, 1.0)?,
        fraction,
        ..a.clone()
    })
}

/// The direction in which the other branch leaves the vertex of a pitchfork, to growing values of
/// the parameter: that in which the neutral mode, the tangent of this branch, is not excited.
fn crossing_direction(
    equations: &mut BranchEquations,
    vertex: &EquilibriumPoint,
    soft: &[NodalField],
) -> Result<BranchDirection, CorrectorFailure> {
    let solution = vertex.solution();
    let border = equations.multiply_all_by_mass(soft);
    let rates = equations.parameter_derivatives(&solution, false)?;
    let solved = equations
        .linearize_bordered(solution, &border, rates, false)?
        .solved;
    let eigen = solved.h.clone().symmetric_eigen();
    let neutral = eigen.eigenvalues.map(f64::abs).imin();
    let mut increments = solved.rates[0].increments.clone();
    for (k, vector) in eigen.eigenvectors.column_iter().enumerate() {
        if k != neutral {
            let parts = vector.iter().zip(&solved.rates[0].multipliers);
            let forcing: f64 = parts.map(|(v, d)| v * d).sum();
            let part = -forcing / eigen.eigenvalues[k];
            let parts: Vec<f64> = vector.iter().map(|v| part * v).collect();
            add_scaled(&mut increments, 1.0, &combine_fields(&parts, &solved.modes));
        }
    }
    Ok(equations.normalize_direction(BranchDirection {
        increments,
        params: [1.0],
    }))
}

/// The singular point of a branch that has this direction at a vertex, at most so far from that.
fn locate_on_crossing_branch(
    equations: &mut BranchEquations,
    vertex: &EquilibriumPoint,
    across: &BranchDirection,
    soft: &[NodalField],
    beside: f64,
) -> Result<CriticalPoint, CorrectorFailure> {
    let border = equations.multiply_all_by_mass(soft);
    let moved = equations.displace_along_direction(&vertex.solution(), across, -beside)?;
    let sample = equations.correct_bordered(moved, [across], &border, None, false)?;
    let from = EquilibriumPoint {
        state: sample.solution.state,
        fraction: sample.solution.params[0],
        tangent: across.clone(),
        ..vertex.clone()
    };
    let mut search = CriticalPointSearch {
        equations,
        from: &from,
        soft,
        parameter_only: false,
    };
    let ends = [0.0, 2.0 * beside];
    let [before, after] = [
        search.eigenvalues_at_distance(ends[0])?,
        search.eigenvalues_at_distance(ends[1])?,
    ];
    let values = before.eigenvalues.iter().zip(&after.eigenvalues);
    let values: Vec<[f64; 2]> = values.map(|(a, b)| [*a, *b]).collect();
    let changing: Vec<usize> = (0..values.len())
        .filter(|&k| values[k][0] * values[k][1] < 0.0)
        .collect();
    // Eigenvalues of other modes keep their signs.
    match changing[..] {
        [which] => {
            let zero = search.find_eigenvalue_zero(which, ends, values[which])?;
            Ok(zero.critical)
        }
        _ => Err(CorrectorFailure::NotConverged),
    }
}
