//! A point of a boundary on one grid: an equilibrium on the manifold of leaves that differ in two
//! parameters, at which the matrix is singular, with the directions along the boundary and across
//! it. On the grid with all segments halved, or with every second node, it is the initial guess for
//! the point there.

use crate::branch::boundary::point_search::{
    BorderEigenvalues, BoundaryCrossing, BoundaryPointSearch, BoundarySearchResult,
    BoundarySearchTolerance, NEUTRAL_EIGENVALUE, TwoParameterDirection, TwoParameterEquations,
    TwoParameterLinearization, TwoParameterProblem, TwoParameterState, border_eigenvalues,
};
use crate::branch::convergence::ExtrapolatedPoint;
use crate::branch::critical::{CriticalKind, CriticalPoint};
use crate::branch::equations::{CorrectorFailure, STIFF};
use crate::branch::points::{
    add_scaled, combine_fields, prolong_field, restrict_field, scale_field, scaled_sum,
};
use crate::leaf::dot;
use crate::leaf::{Grid, NodalField, State};
use crate::numbers::larger;
use crate::relax::accuracy::transfer::{prolong, restrict};
use nalgebra::DMatrix;

/// Step of the central differences for the derivative of an eigenvalue.
const DIFFERENCE: f64 = 3e-4;

/// A parameter's work on a mode, relative to the largest possible, below which it is rounding.
const ROUNDING_FORCING: f64 = 1e-5;

/// Eigenvalues that differ by more than this, relative to their derivative with respect to
/// arclength, do not vanish together.
pub(super) const COINCIDENT_EIGENVALUE_TOLERANCE: f64 = 1e-5;

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
    /// Derivative of the eigenvalue of H along the normal.
    pub slope: f64,
    /// Morse index beyond the boundary, on the side of the normal.
    pub index: usize,
    /// The eigenvalues of H of the modes that do not become neutral here.
    pub others: Vec<f64>,
    /// At a fold: the derivative of the parameters with respect to arclength along the boundary,
    /// as the component along `fold_direction`; it changes sign at a cusp.
    pub fold_speed: f64,
    /// The direction of the curve of folds in the parameter plane.
    pub fold_direction: [f64; 2],
}

/// The first point of a boundary is near the critical point of the branch.
const FIRST_POINT_TOLERANCE: BoundarySearchTolerance = BoundarySearchTolerance {
    accuracy: 1e-11,
    largest_distance: 0.1,
};

/// A critical point of a branch in the parameter plane.
#[derive(Clone, Copy)]
pub struct BoundarySeed<'c> {
    pub critical: &'c CriticalPoint,
    /// The critical point extrapolated over grids.
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
        let search = like.search(manifold, None, like.solution.clone(), FIRST_POINT_TOLERANCE);
        let found = search.secant(manifold)?;
        like.with_own_directions(manifold, found)
    }

    /// The search for a point of the boundary near this one, from `solution`: in the plane normal
    /// to the tangent here or, if a parameter is `given`, with its value constant.
    pub fn search(
        &self,
        manifold: &TwoParameterEquations,
        given: Option<usize>,
        solution: TwoParameterState,
        tolerance: BoundarySearchTolerance,
    ) -> BoundaryPointSearch {
        let along = match given {
            Some(which) => manifold.unit_parameter(which),
            None => self.tangent.clone(),
        };
        BoundaryPointSearch {
            solution,
            crossing: self.crossing(manifold, given),
            along,
            soft: self.border_modes.clone(),
            neutral: self.neutral_modes,
            tolerance,
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

    /// The boundary point that was found from this one, with directions of its own; the tangent
    /// is oriented as here.
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

    /// The direction across the boundary: in which this parameter is constant, if one is given,
    /// else that of the normal.
    pub fn crossing(
        &self,
        manifold: &TwoParameterEquations,
        fixed_parameter: Option<usize>,
    ) -> BoundaryCrossing {
        let Some(which) = fixed_parameter else {
            return BoundaryCrossing {
                direction: self.normal.clone(),
                slope: self.slope,
            };
        };
        let parts = [self.tangent.params[which], -self.normal.params[which]];
        let both = [self.normal.clone(), self.tangent.clone()];
        let across =
            manifold.normalize_direction(TwoParameterDirection::linear_combination(parts, &both));
        BoundaryCrossing {
            slope: self.slope * manifold.direction_product(&across, &self.normal),
            direction: across,
        }
    }

    /// This point with the opposite orientation along the boundary.
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

/// A point of a boundary and the grid of its state.
pub struct GridBoundaryPoint<P> {
    pub grid: Grid,
    pub point: P,
}

/// Segments of the coarsest grid to which a point of a boundary is transferred.
const COARSEST_BOUNDARY_GRID: usize = 8;

/// A point of a boundary with the equations on its grid.
pub struct FinerBoundaryPoint<'a> {
    pub manifold: TwoParameterEquations<'a>,
    pub point: SingularPoint,
}

/// Initial guess for a boundary point on the grid with all segments halved, with its
/// directions.
pub fn boundary_point_on_finer<'a>(
    manifold: &mut TwoParameterEquations<'a>,
    point: &SingularPoint,
) -> Result<FinerBoundaryPoint<'a>, CorrectorFailure> {
    let state = prolong(
        manifold.leaves.leaf_at(point.solution.params)?,
        &point.solution.state,
    );
    let finer = manifold.refined();
    let point = transferred(point, state, |field| {
        prolong_field(field, manifold.first_node())
    });
    let point = SingularPoint {
        tangent: finer.normalize_direction(point.tangent),
        normal: finer.normalize_direction(point.normal),
        ..point
    };
    Ok(FinerBoundaryPoint {
        manifold: finer,
        point,
    })
}

/// Initial guess for the point on the grid with every second node.
pub fn boundary_point_on_coarser(
    plane: &TwoParameterProblem,
    grid: &Grid,
    point: &SingularPoint,
) -> Option<GridBoundaryPoint<SingularPoint>> {
    let coarse = coarser_grid(plane, grid)?;
    let first = usize::from(!plane.first_leaf().hinged());
    let state = restrict(&point.solution.state);
    let point = transferred(point, state, |field| restrict_field(field, first));
    Some(GridBoundaryPoint {
        grid: coarse,
        point,
    })
}

/// The point on the grid of this state, to which `field` transfers increments.
fn transferred(
    point: &SingularPoint,
    state: State,
    field: impl Fn(&NodalField) -> NodalField,
) -> SingularPoint {
    let direction = |it: &TwoParameterDirection| TwoParameterDirection {
        increments: field(&it.increments),
        params: it.params,
    };
    SingularPoint {
        solution: TwoParameterState {
            state,
            ..point.solution
        },
        border_modes: point.border_modes.iter().map(&field).collect(),
        tangent: direction(&point.tangent),
        normal: direction(&point.normal),
        ..point.clone()
    }
}

/// The grid with every second node; none if that would be too coarse, or if `grid` is not its
/// refinement.
pub fn coarser_grid(plane: &TwoParameterProblem, grid: &Grid) -> Option<Grid> {
    let half = grid.segments() / 2;
    if half < COARSEST_BOUNDARY_GRID || 2 * half != grid.segments() {
        return None;
    }
    let coarse = coarsened(grid, half, plane.first_leaf().kinks());
    (coarse.refined() == *grid).then_some(coarse)
}

/// The grid of so many segments that this one refines.
pub fn coarsened(grid: &Grid, segments: usize, kinks: &[f64]) -> Grid {
    let stations = grid.sigma().iter().copied();
    let stations: Vec<f64> = stations.step_by(grid.segments() / segments).collect();
    Grid::from_stations(&stations, kinks)
}
