//! Regular and critical points of a branch on finer and finer grids.
//!
//! Each grid has its own critical parameters. A regular point is therefore sought at the same
//! displacement of the leaf along the branch on all grids; at the same parameter only where the
//! branch goes along that alone, or at the ends of its range.
//!
//! A critical point is where an eigenvalue of the matrix vanishes. The matrix of a nearly rigid
//! leaf loses the soft modes to rounding: there the point is that of softer matrices, extrapolated
//! to no softening. At a branch point the singular matrix does not determine the state along the
//! neutral mode; the branch is smooth there, and is interpolated between points on both sides.

use crate::branch::convergence::{
    ConvergenceTable, EXACT_PARAMETER_ERROR, ExtrapolatedPoint, GridLimits, GridQuantities,
    MAX_GRIDS, NestedGridPoint, PointQuantities, Relocation, SAME_BRANCH_COSINE,
    VerificationFailure, observed_nodes, verify_over_grids,
};
use crate::branch::correct::ArclengthConstraint;
use crate::branch::critical::{CriticalKind, CriticalPoint};
use crate::branch::equations::{BranchEquations, CorrectorFailure};
use crate::branch::family::{
    LeafFamily, STIFFEST, eigenvalue_rounding, stiffest_condensed, values_on_both_sides,
};
use crate::branch::points::{BranchDirection, EquilibriumPoint, prolong_field, restrict_field};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::numbers::larger;
use crate::relax::accuracy::transfer::{prolong, restrict};
use rayon::prelude::*;

/// Least number of finer grids that have the branch and the index of a regular point.
const FINER_GRIDS: usize = 2;

/// Least cosine between the tangent and the direction of the parameter with which a point is
/// sought at its parameter instead of at its displacement.
const FIXED_PARAMETER_COSINE: f64 = 0.995;

/// A point on a coarser grid that is farther away than this (lengths) is another.
const LARGEST_COARSE_GRID_DISTANCE: f64 = 0.1;

/// Largest number of iterations after Newton's method has converged, and the displacement
/// (lengths) at which they end.
const MAX_EXTRA_ITERATIONS: usize = 3;

const FINAL_ITERATION_DISPLACEMENT: f64 = 1e-12;

/// Number of consecutive grids with the same index, if only the index is wanted.
const AGREEING_GRIDS: usize = 3;

/// Compliances by which the matrices of nearly rigid leaves are softened, in units of
/// L^2/A, used one to four times: smaller ones increase rounding errors, larger ones the error
/// of extrapolation to zero.
pub(super) const REGULARIZATION_COMPLIANCES: [f64; 5] = [1e-4, 3e-5, 1e-5, 3e-6, 1e-6];

/// Stiffness in stretch and shear, in units of A/L^2, above which matrices are softened.
pub const NEARLY_RIGID: f64 = 1.01 * STIFFEST;

/// Whether the matrix of a leaf is softened.
pub(super) fn is_nearly_rigid(leaf: &DiscreteLeaf) -> bool {
    leaf.least_compliance() * NEARLY_RIGID < 1.0
}

/// Weights of the values at softenings of 1, 2, 3, 4 for extrapolation to zero: by the cubic
/// through all of them, and by the parabola through the first three.
pub(super) const CUBIC_EXTRAPOLATION_WEIGHTS: [f64; 4] = [4.0, -6.0, 4.0, -1.0];

pub(super) const PARABOLIC_EXTRAPOLATION_WEIGHTS: [f64; 4] = [3.0, -3.0, 1.0, 0.0];

/// Refinement of the finest grid of a critical point over the one it was found on.
pub(super) const FINEST_GRID_RATIO: f64 = 4.0;

/// Spacings (in arclength) of the points from which a branch is interpolated across a branch
/// point, in this order, until the error of the tips is below `INTERPOLATION_ERROR_FRACTION` of
/// their accuracy.
const INTERPOLATION_SPACINGS: [f64; 6] = [0.03, 0.01, 0.003, 0.001, 3e-4, 1e-4];

const INTERPOLATION_ERROR_FRACTION: f64 = 0.1;

/// From one spacing to the next, a third, errors of fourth order fall to 1/81; if they fall to
/// less than this, rounding does not matter yet.
const FOURTH_ORDER_ERROR_RATIO: f64 = 1.0 / 30.0;

/// Whether the branch goes along the parameter alone, or the point is at an end of its range.
fn goes_along_parameter(point: &EquilibriumPoint) -> bool {
    let inside = point.fraction != 0.0 && point.fraction != 1.0;
    !inside || point.tangent.params[0].abs() >= FIXED_PARAMETER_COSINE
}

/// A point on the grid with all segments halved, with the equations there: in the same
/// plane, or, where the branch goes along the parameter alone, at the same parameter.
pub fn on_finer<'a>(
    equations: &mut BranchEquations<'a>,
    point: &EquilibriumPoint,
) -> Result<(BranchEquations<'a>, EquilibriumPoint), CorrectorFailure> {
    let mut plane = (!goes_along_parameter(point))
        .then(|| ArclengthConstraint::normal_to_branch(equations, point));
    let finer = point_on_next_grid(equations, point, &mut plane)?;
    Ok((finer.equations, finer.point))
}

/// A point on the next finer grid.
struct FinerGridPoint<'a> {
    equations: BranchEquations<'a>,
    point: EquilibriumPoint,
    /// Displacement from the interpolated state of the previous grid.
    displacement: f64,
    /// Cosine between the tangents on both grids.
    tangent_cosine: f64,
    /// Displacement by the last iteration, as of a [`ConvergedPoint`].
    unfinished: f64,
}

impl FinerGridPoint<'_> {
    /// Compares the point with that on the previous grid; `index` is what its index should be.
    fn relocation(&self, index: usize) -> Relocation {
        Relocation {
            displacement: self.displacement,
            tangent_cosine: self.tangent_cosine,
            same_index: self.point.index == index,
        }
    }
}

/// A point iterated until it no longer moves.
struct ConvergedPoint {
    point: EquilibriumPoint,
    /// Displacement by the last iteration: the iteration error is not larger.
    unfinished: f64,
}

/// A point in a plane, or at a parameter, iterated until the displacements are below rounding,
/// as extrapolation over grids magnifies what remains.
fn correct_to_rounding(
    equations: &mut BranchEquations,
    state: &State,
    fraction: f64,
    plane: Option<&ArclengthConstraint>,
) -> Result<ConvergedPoint, CorrectorFailure> {
    let mut linearized = None;
    let mut found = equations.correct_from(state, fraction, plane, &mut linearized)?;
    let mut unfinished = f64::INFINITY;
    for _ in 0..MAX_EXTRA_ITERATIONS {
        let next = equations.correct_from(&found.state, found.fraction, plane, &mut linearized)?;
        unfinished = found.state.largest_displacement_to(&next.state);
        found = next;
        if unfinished < FINAL_ITERATION_DISPLACEMENT {
            break;
        }
    }
    Ok(ConvergedPoint {
        point: found,
        unfinished,
    })
}

/// The point in the same plane, or at the same parameter, on the grid with all segments halved.
fn point_on_next_grid<'a>(
    equations: &mut BranchEquations<'a>,
    point: &EquilibriumPoint,
    plane: &mut Option<ArclengthConstraint>,
) -> Result<FinerGridPoint<'a>, CorrectorFailure> {
    let leaf = equations.leaves.leaf_at([point.fraction])?;
    let guess = prolong(leaf, &point.state);
    *plane = plane.as_ref().map(|plane| plane.refined(leaf));
    let mut equations = equations.refined();
    let tangent = equations.prolong_direction(&point.tangent);
    let ConvergedPoint {
        point: mut found,
        unfinished,
    } = correct_to_rounding(&mut equations, &guess, point.fraction, plane.as_ref())?;
    found.tangent = equations.orient_direction(found.tangent, &tangent);
    Ok(FinerGridPoint {
        displacement: guess.largest_displacement_to(&found.state),
        tangent_cosine: equations.direction_product(&found.tangent, &tangent),
        unfinished,
        point: found,
        equations,
    })
}

/// A regular point with the given accuracy of its tips, on as many grids as necessary;
/// they must agree on branch and index.
pub(super) fn verify_regular_point(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    accuracy: f64,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    if goes_along_parameter(point) {
        return verify_at_parameter(family, grid, point, accuracy);
    }
    let in_plane = NestedRegularPoint::new(family, grid, point, accuracy, true);
    verify_over_grids(in_plane).or_else(|doubt| {
        if family.limit.reached() {
            return Err(doubt);
        }
        let other = verify_at_parameter(family, grid, point, accuracy);
        // Beside a fold of a finer grid that grid may have no point at this parameter.
        other.map_err(|other| match doubt {
            VerificationFailure::OtherIndex => doubt,
            _ => other,
        })
    })
}

/// A regular point with the given accuracy of its tips, sought at its parameter on all grids.
pub fn verify_at_parameter(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    accuracy: f64,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    verify_over_grids(NestedRegularPoint::new(
        family, grid, point, accuracy, false,
    ))
}

/// The Morse index at a given parameter on which enough successively refined grids in a row
/// agree; on all of them the point must be on the same branch.
pub(super) fn confirmed_index(
    equations: &mut BranchEquations,
    point: &EquilibriumPoint,
) -> Result<usize, VerificationFailure> {
    verify_over_grids(IndexCount {
        finer: point_on_next_grid(equations, point, &mut None)?,
        index: point.index,
        agreeing: 1,
    })
}

/// A regular point whose index is counted on finer and finer grids.
struct IndexCount<'a> {
    finer: FinerGridPoint<'a>,
    /// The index on the present grid, and on how many grids in a row it is this.
    index: usize,
    agreeing: usize,
}

impl NestedGridPoint for IndexCount<'_> {
    type Verified = usize;

    fn locate(&mut self, level: usize) -> Result<Relocation, VerificationFailure> {
        if level > 0 {
            let FinerGridPoint {
                equations, point, ..
            } = &mut self.finer;
            self.finer = point_on_next_grid(equations, point, &mut None)?;
        }
        // Other indices are counted, and are no failure.
        Ok(self.finer.relocation(self.finer.point.index))
    }

    fn segments(&self) -> usize {
        self.finer.point.state.segments()
    }

    fn grid_limits(&self) -> GridLimits {
        GridLimits {
            least: 1,
            most: MAX_GRIDS - 1,
        }
    }

    fn tabulate(&mut self, _: usize) -> Result<(), VerificationFailure> {
        let index = self.finer.point.index;
        self.agreeing = match index == self.index {
            true => self.agreeing + 1,
            false => 1,
        };
        self.index = index;
        Ok(())
    }

    fn extrapolated(&mut self, _: usize, _: bool) -> Result<Option<usize>, VerificationFailure> {
        Ok((self.agreeing == AGREEING_GRIDS).then_some(self.index))
    }
}

/// A point on the grid with every second node.
struct CoarserGridPoint {
    row: GridQuantities,
    /// The plane in which it was sought, if it was, on the next finer grid.
    plane: Option<ArclengthConstraint>,
}

/// A point on the grid with every second node, which adds to what the series of grids tells of
/// its order. `None` if there is no such grid, or no point near on it.
fn point_on_coarser_grid(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    in_plane: bool,
) -> Option<CoarserGridPoint> {
    let mut equations = BranchEquations::new(family, grid.coarsened()?);
    let near = EquilibriumPoint {
        state: restrict(&point.state),
        tangent: equations.normalize_direction(BranchDirection {
            increments: restrict_field(&point.tangent.increments, equations.first_node()),
            ..point.tangent
        }),
        ..point.clone()
    };
    let plane = in_plane.then(|| ArclengthConstraint::normal_to_branch(&equations, &near));
    let found = correct_to_rounding(&mut equations, &near.state, point.fraction, plane.as_ref());
    let found = found.ok()?.point;
    let along = equations
        .direction_product(&found.tangent, &near.tangent)
        .abs();
    if along < SAME_BRANCH_COSINE
        || near.state.largest_displacement_to(&found.state) > LARGEST_COARSE_GRID_DISTANCE
    {
        return None;
    }
    let values = PointQuantities::at_state(&mut equations, &found.state, found.fraction).ok()?;
    let segments = equations.grid().segments();
    let leaf = equations.leaves.leaf_at([point.fraction]).ok()?;
    Some(CoarserGridPoint {
        row: GridQuantities { segments, values },
        plane: plane.map(|plane| plane.refined(leaf)),
    })
}

/// A regular point that is verified on finer and finer grids.
struct NestedRegularPoint<'a> {
    equations: BranchEquations<'a>,
    /// Where the point is on the present grid.
    point: EquilibriumPoint,
    /// The index that all grids must have.
    index: usize,
    /// The plane in which the point is sought; none if it is at its parameter.
    plane: Option<ArclengthConstraint>,
    table: ConvergenceTable,
    accuracy: f64,
}

impl<'a> NestedRegularPoint<'a> {
    /// A point of which a coarser grid, if that has it, begins the table.
    fn new(
        family: &'a LeafFamily<'a>,
        grid: &Grid,
        point: &EquilibriumPoint,
        accuracy: f64,
        in_plane: bool,
    ) -> Self {
        let mut table = ConvergenceTable::of_regular_point();
        let equations = BranchEquations::new(family, grid.clone());
        let plane = match point_on_coarser_grid(family, grid, point, in_plane) {
            Some(coarser) => {
                table.push(coarser.row);
                coarser.plane
            }
            None => in_plane.then(|| ArclengthConstraint::normal_to_branch(&equations, point)),
        };
        NestedRegularPoint {
            equations,
            point: point.clone(),
            index: point.index,
            plane,
            table,
            accuracy,
        }
    }
}

impl NestedGridPoint for NestedRegularPoint<'_> {
    type Verified = ExtrapolatedPoint;

    fn locate(&mut self, level: usize) -> Result<Relocation, VerificationFailure> {
        if level > 0 {
            let finer = point_on_next_grid(&mut self.equations, &self.point, &mut self.plane)?;
            let relocation = finer.relocation(self.index);
            self.table.noise = larger(self.table.noise, finer.unfinished);
            (self.equations, self.point) = (finer.equations, finer.point);
            return Ok(relocation);
        }
        let (near, plane) = (&self.point, self.plane.as_ref());
        let found = correct_to_rounding(&mut self.equations, &near.state, near.fraction, plane)?;
        let tangent = (self.equations).orient_direction(found.point.tangent, &near.tangent);
        self.point = EquilibriumPoint {
            tangent,
            ..found.point
        };
        self.table.noise = found.unfinished;
        Ok(Relocation::on_first_grid())
    }

    fn segments(&self) -> usize {
        self.equations.grid().segments()
    }

    fn tabulate(&mut self, level: usize) -> Result<(), VerificationFailure> {
        let (state, fraction) = (&self.point.state, self.point.fraction);
        let values = PointQuantities::at_state(&mut self.equations, state, fraction)?;
        let segments = self.segments();
        self.table.push(GridQuantities { segments, values });
        if level > 0 {
            let derivatives = parameter_derivatives(&mut self.equations, &self.point)?;
            self.table.parameter_derivatives = Some(derivatives);
        }
        Ok(())
    }

    fn extrapolated(
        &mut self,
        level: usize,
        _: bool,
    ) -> Result<Option<ExtrapolatedPoint>, VerificationFailure> {
        let accurate = level >= FINER_GRIDS && self.table.error() <= self.accuracy;
        let (state, fraction) = (&self.point.state, self.point.fraction);
        let point = || (self.table).extrapolated_point(&mut self.equations, state, fraction);
        Ok(accurate.then(point).transpose()?)
    }
}

/// Derivatives of a point's values with respect to the parameter: of points from the tangent;
/// of the energy, stationary in the state, from that of the loads; of the forces on holders, of
/// the energy if these may move, and of the points of a leaf that can turn, from neighboring states.
fn parameter_derivatives(
    equations: &mut BranchEquations,
    point: &EquilibriumPoint,
) -> Result<PointQuantities, CorrectorFailure> {
    let tangent = &point.tangent;
    let leaf = equations.leaves.leaf_at([point.fraction])?;
    let turns = !leaf.zero_energy_fields(&point.state).is_empty();
    let moves = leaf.leaf.has_placed_supports() || leaf.leaf.hinged() || turns;
    let [after, before] = values_on_both_sides(|step| {
        let at = point.fraction + step;
        if !moves {
            return Ok(PointQuantities {
                points: Vec::new(),
                fraction: at,
                energy: equations.leaves.leaf_at([at])?.energy(&point.state),
                reactions: Vec::new(),
            });
        }
        let length = step / tangent.params[0];
        let state =
            equations.state_after_increments(&point.state, [at], &tangent.increments, length)?;
        PointQuantities::at_state(equations, &state, at)
    })?;
    let way = after.fraction - before.fraction;
    let leaf = equations.leaves.leaf_at([point.fraction])?;
    let nodes = observed_nodes(leaf, leaf.segments());
    let first = leaf.first_node();
    let displacements =
        nodes.flat_map(|i| tangent.increments.iter().map(move |rod| &rod[i - first]));
    Ok(PointQuantities {
        points: match turns {
            true => (after.points.iter().zip(&before.points))
                .map(|(after, before)| (after - before) / way)
                .collect(),
            false => displacements
                .flat_map(|node| [3, 4, 5].map(|c| node[c] / tangent.params[0]))
                .collect(),
        },
        fraction: 1.0,
        energy: (after.energy - before.energy) / way,
        reactions: (after.reactions.iter().zip(before.reactions))
            .map(|(force, before)| (*force - before) / way)
            .collect(),
    })
}

/// A critical point with the given accuracy of its tips, on at least so many `grids`.
pub(super) fn refine_critical(
    family: &LeafFamily,
    grid: &Grid,
    found: &CriticalPoint,
    accuracy: f64,
    grids: usize,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    verify_over_grids(NestedCriticalPoint {
        equations: BranchEquations::new(family, grid.clone()),
        critical: found.clone(),
        regularization: REGULARIZATION_COMPLIANCES[0],
        rounding_amplification: 1.0,
        table: ConvergenceTable::default(),
        accuracy,
        least_grids: grids,
    })
}

/// A critical point that is verified on finer and finer grids.
struct NestedCriticalPoint<'a> {
    equations: BranchEquations<'a>,
    /// Where the point is on the present grid.
    critical: CriticalPoint,
    /// The compliance by which the matrix of a nearly rigid leaf is softened.
    regularization: f64,
    /// The factor by which extrapolation to no softening amplifies rounding errors.
    rounding_amplification: f64,
    table: ConvergenceTable,
    accuracy: f64,
    least_grids: usize,
}

/// A critical point extrapolated to zero softening.
struct UnregularizedPoint {
    values: PointQuantities,
    /// Error of the extrapolation, for the points and for the fraction.
    error: f64,
    fraction_error: f64,
}

impl NestedGridPoint for NestedCriticalPoint<'_> {
    type Verified = ExtrapolatedPoint;

    fn locate(&mut self, level: usize) -> Result<Relocation, VerificationFailure> {
        if level == 0 {
            return Ok(Relocation::on_first_grid());
        }
        let coarse = &self.critical;
        let leaf = self.equations.leaves.leaf_at([coarse.fraction])?;
        let state = prolong(leaf, &coarse.state);
        self.equations = self.equations.refined();
        let first = self.equations.first_node();
        let soft = coarse.border_modes.iter();
        let finer = CriticalPoint {
            state,
            tangent: self.equations.prolong_direction(&coarse.tangent),
            border_modes: soft.map(|field| prolong_field(field, first)).collect(),
            ..coarse.clone()
        };
        self.critical = finer.relocate(&mut self.equations)?;
        Ok(Relocation {
            displacement: finer.state.largest_displacement_to(&self.critical.state),
            ..Relocation::on_first_grid()
        })
    }

    fn segments(&self) -> usize {
        self.equations.grid().segments()
    }

    fn tabulate(&mut self, _: usize) -> Result<(), VerificationFailure> {
        let mut values = self.quantities_on_grid()?;
        if self.critical.kind == CriticalKind::Branching {
            let (equations, fraction) = (&mut self.equations, values.fraction);
            let across = interpolate_across(equations, &self.critical, fraction, self.accuracy);
            if let Some(across) = across {
                self.table.common = larger(self.table.common, across.error);
                self.table.parameter_derivatives = Some(across.slope);
                values = across.values;
            }
        }
        let segments = self.segments();
        self.table.push(GridQuantities { segments, values });
        Ok(())
    }

    fn extrapolated(
        &mut self,
        level: usize,
        _: bool,
    ) -> Result<Option<ExtrapolatedPoint>, VerificationFailure> {
        let table = &self.table;
        let rounding = table.rounding / self.rounding_amplification;
        // If so, a finer grid would only add rounding errors.
        let exact = table.fraction_error() < rounding.max(EXACT_PARAMETER_ERROR);
        let noisy = FINEST_GRID_RATIO * table.noise > INTERPOLATION_ERROR_FRACTION * self.accuracy;
        let enough = exact || noisy || level + 1 >= self.least_grids;
        let accurate = enough && table.error() <= self.accuracy;
        let (state, fraction) = (&self.critical.state, self.critical.fraction);
        let point = || table.extrapolated_point(&mut self.equations, state, fraction);
        Ok(accurate.then(point).transpose()?)
    }
}

impl NestedCriticalPoint<'_> {
    /// The quantities of the point on the present grid, the errors of which are recorded in the
    /// table.
    fn quantities_on_grid(&mut self) -> Result<PointQuantities, CorrectorFailure> {
        let critical = &self.critical;
        let leaf = self.equations.leaves.leaf_at([critical.fraction])?;
        let rigid = is_nearly_rigid(leaf);
        let mut stiffest = stiffest_condensed(leaf);
        let segments = leaf.segments();
        let fold = critical.kind == CriticalKind::Fold;
        let mut growth = 1.0;
        let values = match rigid {
            false => {
                let (state, fraction) = (&critical.state, critical.fraction);
                PointQuantities::at_state(&mut self.equations, state, fraction)?
            }
            true => {
                let slope =
                    critical.eigenvalue_slope.abs() / (FINEST_GRID_RATIO * segments as f64).powi(2);
                let found = self.remove_regularization(slope)?;
                let table = &mut self.table;
                table.regularization_error =
                    larger(table.regularization_error, found.fraction_error);
                if fold {
                    table.common = larger(table.common, found.error);
                }
                stiffest = stiffest.min(1.0 / self.regularization);
                growth = CUBIC_EXTRAPOLATION_WEIGHTS
                    .iter()
                    .map(|weight| weight.abs())
                    .sum();
                found.values
            }
        };
        let (critical, table) = (&self.critical, &mut self.table);
        let rounding = eigenvalue_rounding(stiffest, segments);
        let along = rounding / critical.eigenvalue_slope.abs();
        if fold {
            table.noise = larger(table.noise, along);
        }
        // Near a fold the parameter depends quadratically on arclength.
        let of_value = larger(
            rounding / critical.eigenvalue_parameter_derivative(),
            growth * along * along,
        );
        table.rounding = larger(table.rounding, growth * (of_value + critical.rounding));
        self.rounding_amplification = growth;
        Ok(values)
    }

    /// The point of a nearly rigid leaf, from softened matrices, extrapolated to zero.
    /// The softening is reduced until the rounding error, that of the stiffness over the
    /// derivative of the eigenvalue, exceeds the error of the extrapolation: at a fold also that of
    /// its shape, but not at a branch point, which a singular matrix leaves undetermined along the
    /// neutral mode, and where the shape is interpolated.
    fn remove_regularization(
        &mut self,
        slope: f64,
    ) -> Result<UnregularizedPoint, CorrectorFailure> {
        let (family, critical) = (self.equations.leaves.family, &self.critical);
        loop {
            let softening = self.regularization;
            let found =
                extrapolate_regularization(family, self.equations.grid(), critical, softening)?;
            let rounding = f64::EPSILON / softening / slope;
            let error = match critical.kind {
                CriticalKind::Fold => larger(found.error, found.fraction_error),
                CriticalKind::Branching => found.fraction_error,
            };
            let less = REGULARIZATION_COMPLIANCES
                .into_iter()
                .find(|less| *less < softening);
            match less {
                Some(less) if error > rounding => self.regularization = less,
                _ => return Ok(found),
            }
        }
    }
}

/// A critical point from four softened matrices.
fn extrapolate_regularization(
    family: &LeafFamily,
    grid: &Grid,
    critical: &CriticalPoint,
    softening: f64,
) -> Result<UnregularizedPoint, CorrectorFailure> {
    let softened = |k: usize| {
        let mut equations = BranchEquations::new(family, grid.clone());
        equations.regularize(softening * (k + 1) as f64);
        let near = critical.relocate(&mut equations)?;
        PointQuantities::at_state(&mut equations, &near.state, near.fraction)
    };
    let found: Result<Vec<PointQuantities>, CorrectorFailure> = (0..CUBIC_EXTRAPOLATION_WEIGHTS
        .len())
        .into_par_iter()
        .map(softened)
        .collect();
    let found = found?;
    let by = |weights: [f64; 4]| {
        PointQuantities::weighted_sum(&weights, &found.iter().collect::<Vec<_>>())
    };
    let (values, parabola) = (
        by(CUBIC_EXTRAPOLATION_WEIGHTS),
        by(PARABOLIC_EXTRAPOLATION_WEIGHTS),
    );
    Ok(UnregularizedPoint {
        error: values.distance(&parabola),
        fraction_error: (values.fraction - parabola.fraction).abs(),
        values,
    })
}

/// A branch interpolated at a branch point from points on both sides.
struct InterpolatedBranchPoint {
    values: PointQuantities,
    /// A bound on the error of the tips.
    error: f64,
    /// Derivatives of the values with respect to the fraction of the parameter.
    slope: PointQuantities,
}

/// Interpolates a branch across a branch point at this fraction. There the singular matrix
/// leaves the component along the neutral mode undetermined to rounding; but the branch is
/// smooth, and points on both sides are well determined. None if there is no point on one side:
/// at an end of the range.
fn interpolate_across(
    equations: &mut BranchEquations,
    critical: &CriticalPoint,
    fraction: f64,
    accuracy: f64,
) -> Option<InterpolatedBranchPoint> {
    let mut best: Option<InterpolatedBranchPoint> = None;
    let mut last: Option<(PointQuantities, f64)> = None;
    for apart in INTERPOLATION_SPACINGS {
        let Some(mut now) = interpolate_from_spacing(equations, critical, fraction, apart) else {
            continue;
        };
        let fourth = now.error;
        if let Some((values, before)) = last {
            // Then those of sixth order fall at least as much.
            let fall = fourth / before;
            if fall < FOURTH_ORDER_ERROR_RATIO {
                now.error = fourth.min(fall * now.values.distance(&values));
            }
        }
        last = Some((now.values.clone(), fourth));
        if best.as_ref().is_none_or(|best| now.error < best.error) {
            best = Some(now);
        }
        if best
            .as_ref()
            .is_some_and(|best| best.error < INTERPOLATION_ERROR_FRACTION * accuracy)
        {
            break;
        }
    }
    best
}

/// Interpolates a branch across a branch point from points `apart`, in planes across the tangent:
/// next to a fold the branch is not smooth over the parameter. The error is that of the fourth
/// order, the values are of the sixth.
fn interpolate_from_spacing(
    equations: &mut BranchEquations,
    critical: &CriticalPoint,
    fraction: f64,
    apart: f64,
) -> Option<InterpolatedBranchPoint> {
    // Weights of values at -3, -2, -1, 1, 2, 3: for the value at 0 and the slope to sixth
    // order, and, from four of them, for the value at 0 to fourth order.
    const SIXTH: [f64; 3] = [0.75, -0.3, 0.05];
    const FOURTH: [f64; 3] = [2.0 / 3.0, -1.0 / 6.0, 0.0];
    const SLOPE: [f64; 3] = [0.75, -0.15, 1.0 / 60.0];
    let tangent = &critical.tangent;
    let mut values_at = |side: f64| {
        let point = critical
            .equilibrium_along_direction(equations, tangent, side * apart)
            .ok()?;
        PointQuantities::at_state(equations, &point.state, point.fraction).ok()
    };
    let pairs = [1.0, 2.0, 3.0].into_iter();
    let pairs: Option<Vec<[PointQuantities; 2]>> = pairs
        .map(|k| Some([values_at(-k)?, values_at(k)?]))
        .collect();
    let pairs = pairs?;
    let terms: Vec<&PointQuantities> = pairs.iter().flatten().collect();
    let sum = |weights: [f64; 3], sign: f64| {
        let weights: Vec<f64> = weights.iter().flat_map(|w| [sign * w, *w]).collect();
        PointQuantities::weighted_sum(&weights, &terms)
    };
    let along = sum(SLOPE, -1.0);
    let slope = PointQuantities::weighted_sum(&[1.0 / along.fraction], &[&along]);
    let at_fraction = |weights: [f64; 3]| {
        let across = sum(weights, 1.0);
        let shift = fraction - across.fraction;
        PointQuantities::weighted_sum(&[1.0, shift], &[&across, &slope])
    };
    let values = at_fraction(SIXTH);
    Some(InterpolatedBranchPoint {
        error: values.distance(&at_fraction(FOURTH)),
        values,
        slope,
    })
}
