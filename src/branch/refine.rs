//! Regular points of a branch on finer and finer grids.
//!
//! A point of a branch, extrapolated over finer and finer grids.
//!
//! Critical points of a branch on finer and finer grids.

use crate::branch::correct::ArclengthConstraint;
use crate::branch::critical::{CriticalKind, CriticalPoint};
use crate::branch::equations::{BranchEquations, CorrectorFailure};
use crate::branch::family::{
    LeafFamily, Leaves, OutOfRange, STIFFEST, eigenvalue_rounding, stiffest_condensed,
    values_on_both_sides,
};
use crate::branch::{BranchDirection, EquilibriumPoint, prolong_field, restrict_field};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::numbers::{larger, largest};
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::{prolong, restrict};
use crate::relax::rod_shapes;
use crate::shape::RodShape;
use glam::DVec3;
use rayon::prelude::*;

/// Largest number of grids of a point, and of segments of the finest.
pub(super) const GRIDS: usize = 6;

pub(super) const FINEST: usize = 4096;

/// Least number of finer grids that have the branch and the index of a point.
const FINER_GRIDS: usize = 2;

/// Displacements from grid to grid must decrease, unless below this (lengths).
pub(super) const NEGLIGIBLE_DISPLACEMENT: f64 = 1e-4;

/// If the cosine between the tangents on two grids is below this, they belong to different
/// branches.
const SAME_BRANCH_COSINE: f64 = 0.85;

/// Each grid has its own critical parameters: a point is sought at the same displacement of
/// the leaf on all grids. But at the same parameter at the ends of its range, and
/// where the parameter's component of the tangent is at least this.
const FIXED_PARAMETER_COSINE: f64 = 0.995;

/// A point on a coarser grid that is farther away than this (lengths) is another.
const LARGEST_COARSE_GRID_DISTANCE: f64 = 0.1;

/// Iterations after Newton's method has converged, and the displacement (lengths) at which they
/// end.
const MAX_EXTRA_ITERATIONS: usize = 3;

const FINAL_ITERATION_DISPLACEMENT: f64 = 1e-12;

/// Number of consecutive grids with the same index, if only the index is wanted.
const AGREEING: usize = 3;

/// Whether the branch goes along the parameter alone, or the point is at an end of its range.
fn along_parameter(point: &EquilibriumPoint) -> bool {
    let inside = point.fraction != 0.0 && point.fraction != 1.0;
    !inside || point.tangent.params[0].abs() >= FIXED_PARAMETER_COSINE
}

/// A point on the grid with all segments halved, with the equations there: in the same
/// plane, or, where the branch goes along the parameter alone, at the same parameter.
pub fn on_finer<'a>(
    equations: &mut BranchEquations<'a>,
    point: &EquilibriumPoint,
) -> Result<(BranchEquations<'a>, EquilibriumPoint), CorrectorFailure> {
    let mut plane =
        (!along_parameter(point)).then(|| ArclengthConstraint::normal_to_branch(equations, point));
    let finer = on_next_grid(equations, point, &mut plane)?;
    Ok((finer.equations, finer.point))
}

/// A point on the next finer grid.
struct FinerGridPoint<'a> {
    equations: BranchEquations<'a>,
    point: EquilibriumPoint,
    /// The tangent of the previous grid, interpolated to this one.
    tangent: BranchDirection,
    /// Displacement from the interpolated state.
    moved: f64,
    /// Displacement by the last iteration: its error is not larger.
    unfinished: f64,
}

/// A point in a plane, or at a parameter, iterated until the displacements are below rounding,
/// as extrapolation over grids magnifies what remains; and the last displacement.
fn correct_to_rounding(
    equations: &mut BranchEquations,
    (state, fraction): (&State, f64),
    plane: Option<&ArclengthConstraint>,
) -> Result<(EquilibriumPoint, f64), CorrectorFailure> {
    let mut found = equations.correct_within(state, fraction, plane)?;
    let mut unfinished = f64::INFINITY;
    for _ in 0..MAX_EXTRA_ITERATIONS {
        let next = equations.correct_within(&found.state, found.fraction, plane)?;
        unfinished = found.state.largest_displacement_to(&next.state);
        found = next;
        if unfinished < FINAL_ITERATION_DISPLACEMENT {
            break;
        }
    }
    Ok((found, unfinished))
}

/// The point in the same plane, or at the same parameter, on the grid with all segments halved.
fn on_next_grid<'a>(
    equations: &mut BranchEquations<'a>,
    point: &EquilibriumPoint,
    plane: &mut Option<ArclengthConstraint>,
) -> Result<FinerGridPoint<'a>, CorrectorFailure> {
    let leaf = equations.leaves.leaf_at([point.fraction])?;
    let guess = prolong(leaf, &point.state);
    *plane = plane.as_ref().map(|plane| plane.refined(leaf));
    let mut equations = equations.refined();
    let tangent = equations.prolong_direction(&point.tangent);
    let start = (&guess, point.fraction);
    let (mut found, unfinished) = correct_to_rounding(&mut equations, start, plane.as_ref())?;
    found.tangent = equations.orient_direction(found.tangent, &tangent);
    Ok(FinerGridPoint {
        moved: guess.largest_displacement_to(&found.state),
        unfinished,
        point: found,
        tangent,
        equations,
    })
}

/// A regular point with the given accuracy of its tips, on as many grids as necessary;
/// they must agree on branch and index.
pub fn verify_regular_point(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    accuracy: f64,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    match along_parameter(point) {
        true => verify_on_grids(family, grid, point, accuracy, false),
        false => verify_on_grids(family, grid, point, accuracy, true).or_else(|doubt| {
            let other = verify_on_grids(family, grid, point, accuracy, false);
            // Beside a fold of a finer grid that grid may have no point at this parameter.
            other.map_err(|other| match doubt {
                VerificationFailure::OtherIndex => doubt,
                _ => other,
            })
        }),
    }
}

/// The same at a given parameter.
pub fn verify_at_parameter(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    accuracy: f64,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    verify_on_grids(family, grid, point, accuracy, false)
}

/// The Morse index at a given parameter on which enough successively refined grids in a row
/// agree; on all of them the point must be on the same branch.
pub fn index_at(
    equations: &mut BranchEquations,
    point: &EquilibriumPoint,
) -> Result<usize, VerificationFailure> {
    let (mut moved, mut same, mut index) = (f64::INFINITY, 1, point.index);
    let mut finer = on_next_grid(equations, point, &mut None)?;
    for _ in 1..GRIDS {
        let along = finer
            .equations
            .direction_product(&finer.point.tangent, &finer.tangent);
        if along < SAME_BRANCH_COSINE || finer.moved > moved.max(NEGLIGIBLE_DISPLACEMENT) {
            return Err(VerificationFailure::OtherBranch);
        }
        same = if finer.point.index == index {
            same + 1
        } else {
            1
        };
        (index, moved) = (finer.point.index, finer.moved);
        if same == AGREEING {
            return Ok(index);
        }
        if 2 * finer.point.state.segments() > FINEST {
            break;
        }
        finer = on_next_grid(&mut finer.equations, &finer.point, &mut None)?;
    }
    Err(VerificationFailure::OtherIndex)
}

/// A point on the grid with every second node, and its plane on the next one. It adds to
/// what the series of grids tells of its order. `None` if there is no such grid, or no point near
/// on it.
fn on_coarser(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    in_plane: bool,
) -> Option<(usize, PointQuantities, Option<ArclengthConstraint>)> {
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
    let start = (&near.state, point.fraction);
    let (found, _) = correct_to_rounding(&mut equations, start, plane.as_ref()).ok()?;
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
    Some((segments, values, plane.map(|plane| plane.refined(leaf))))
}

fn verify_on_grids(
    family: &LeafFamily,
    grid: &Grid,
    point: &EquilibriumPoint,
    accuracy: f64,
    in_plane: bool,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    let mut table = ConvergenceTable::of_regular_point();
    let mut equations = BranchEquations::new(family, grid.clone());
    let mut plane = match on_coarser(family, grid, point, in_plane) {
        Some((segments, values, plane)) => {
            table.push(segments, values);
            plane
        }
        None => in_plane.then(|| ArclengthConstraint::normal_to_branch(&equations, point)),
    };
    let start = (&point.state, point.fraction);
    let (mut now, unfinished) = correct_to_rounding(&mut equations, start, plane.as_ref())?;
    now.tangent = equations.orient_direction(now.tangent, &point.tangent);
    table.noise = unfinished;
    let values = PointQuantities::at_state(&mut equations, &now.state, now.fraction)?;
    table.push(grid.segments(), values);
    let mut moved = f64::INFINITY;
    for finer_grids in 1..GRIDS {
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
        let finer = on_next_grid(&mut equations, &now, &mut plane)?;
        equations = finer.equations;
        let same = equations.direction_product(&finer.point.tangent, &finer.tangent);
        if same < SAME_BRANCH_COSINE || finer.moved > moved.max(NEGLIGIBLE_DISPLACEMENT) {
            return Err(VerificationFailure::OtherBranch);
        }
        if finer.point.index != point.index {
            return Err(VerificationFailure::OtherIndex);
        }
        moved = finer.moved;
        table.noise = larger(table.noise, finer.unfinished);
        now = finer.point;
        let values = PointQuantities::at_state(&mut equations, &now.state, now.fraction)?;
        table.push(equations.grid().segments(), values);
        table.parameter_derivatives = Some(parameter_derivatives(&mut equations, &now)?);
        if finer_grids >= FINER_GRIDS && table.error() <= accuracy {
            let leaf = equations.leaves.leaf_at([now.fraction])?;
            let state = leaf.circle_representative(&now.state).into_owned();
            return Ok(table.extrapolated_point(state, equations.grid().clone()));
        }
    }
    Err(VerificationFailure::Inaccurate)
}

/// Derivatives of a point's values with respect to the parameter: of points from the tangent;
/// of the energy, stationary in the state, from that of the loads; of the forces on holders, of
/// the energy if these may move, and of the points of a leaf that can turn, from neighbouring states.
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

/// Smallest ratio of successive changes: that of a fourth-order term from grid to grid. A
/// smaller change is small by chance.
const SMALLEST_CHANGE_RATIO: f64 = 1.0 / 16.0;

/// Least safety factor on the last correction of a regular point whose order of convergence is
/// not confirmed. Of 955 points of random branches of wild leaves none had an error of more
/// than 25 such corrections.
const CAUTION: f64 = 40.0;

/// A point extrapolated to zero segment length.
#[derive(Clone, Debug)]
pub struct ExtrapolatedPoint {
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// Energy, in the family's units.
    pub energy: f64,
    /// Tips of all rods, likewise.
    pub tips: Vec<DVec3>,
    /// The forces on the holder of held tips, if they are, and on every grip, likewise.
    pub reactions: Vec<DVec3>,
    /// Bound on the error of the tips, or of the rods' midpoints if the tips are held, and of both
    /// with grips: of the branch at this parameter, or, at a fold, of the fold itself.
    pub position_error: f64,
    /// Bound on the error of the parameter, as a fraction of its range.
    pub fraction_error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// That grid.
    pub grid: Grid,
}

impl ExtrapolatedPoint {
    /// Whether its parameter may be in the range.
    pub fn may_be_in_range(&self) -> bool {
        let beyond = (-self.fraction).max(self.fraction - 1.0);
        beyond <= self.fraction_error
    }

    /// Its leaf on the finest grid, in the scenario's units.
    ///
    /// # Errors
    /// If the extrapolated parameter is one that no leaf can have.
    pub fn shapes(&self, family: &LeafFamily) -> Result<Vec<RodShape>, OutOfRange> {
        let mut leaves = Leaves::new(family, self.grid.clone());
        Ok(rod_shapes(leaves.leaf_at([self.fraction])?, &self.state))
    }
}

/// Why a point is not verified.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum VerificationFailure {
    /// Finer grids have no solution near it.
    #[error("finer grids have no solution there")]
    Unsolved,
    /// They have a point of another branch: far away, or with another tangent.
    #[error("finer grids have another branch there")]
    OtherBranch,
    /// They have a point with another index.
    #[error("finer grids have another index there")]
    OtherIndex,
    /// The index changes without a singular matrix that explains it.
    #[error("the index changes there without a singular matrix")]
    Unexplained,
    /// The error of the tips, or of the points used instead, stays above the
    /// accuracy.
    #[error("the tolerance is not reached there on any grid")]
    Inaccurate,
}

impl From<CorrectorFailure> for VerificationFailure {
    fn from(stuck: CorrectorFailure) -> Self {
        match stuck {
            CorrectorFailure::Separated | CorrectorFailure::Unfolded => {
                VerificationFailure::OtherBranch
            }
            _ => VerificationFailure::Unsolved,
        }
    }
}

impl From<OutOfRange> for VerificationFailure {
    fn from(_: OutOfRange) -> Self {
        VerificationFailure::Unsolved
    }
}

/// Quantities of a point on one grid.
#[derive(Clone)]
pub(super) struct PointQuantities {
    /// The coordinates of every tip; then, if the tips or others are held, those of the midpoint
    /// of every rod.
    pub points: Vec<f64>,
    pub fraction: f64,
    pub energy: f64,
    /// The forces on the holders.
    pub reactions: Vec<DVec3>,
}

/// The nodes of each rod whose positions are used.
pub(super) fn observed_nodes(leaf: &DiscreteLeaf, segments: usize) -> impl Iterator<Item = usize> {
    let middle = leaf.leaf.has_placed_supports().then_some(segments / 2);
    [segments].into_iter().chain(middle)
}

impl PointQuantities {
    /// Of a leaf that can turn those of the equilibrium that stands for its circle, as it does in a
    /// relaxation: where on the circle a branch has led depends on where it began.
    pub fn at_state(
        equations: &mut BranchEquations,
        state: &State,
        fraction: f64,
    ) -> Result<Self, CorrectorFailure> {
        let leaf = equations.leaves.leaf_at([fraction])?;
        let state = &*leaf.circle_representative(state);
        let nodes = observed_nodes(leaf, state.segments());
        let points = nodes.flat_map(|i| (0..state.rods()).map(move |j| state.base(j) + i));
        Ok(PointQuantities {
            points: points.flat_map(|k| state.x[k].to_array()).collect(),
            fraction,
            energy: leaf.energy(state),
            reactions: leaf.support_forces(state),
        })
    }

    pub fn weighted_sum(parts: &[(f64, PointQuantities)]) -> Self {
        let sum = |of: &dyn Fn(&PointQuantities) -> f64| parts.iter().map(|(w, v)| w * of(v)).sum();
        let points = parts.first().map_or(0, |(_, values)| values.points.len());
        let holders = parts
            .first()
            .map_or(0, |(_, values)| values.reactions.len());
        let on = |k: usize| parts.iter().map(|(w, v)| *w * v.reactions[k]).sum();
        PointQuantities {
            points: (0..points)
                .map(|k| sum(&|values| values.points[k]))
                .collect(),
            fraction: sum(&|values| values.fraction),
            energy: sum(&|values| values.energy),
            reactions: (0..holders).map(on).collect(),
        }
    }

    /// The largest distance between corresponding points.
    pub fn distance(&self, other: &PointQuantities) -> f64 {
        let points = self.points.chunks(3).zip(other.points.chunks(3));
        let squares = points.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum());
        largest(squares).sqrt()
    }
}

/// The values of a point on finer and finer grids.
#[derive(Default)]
pub(super) struct ConvergenceTable {
    rows: Vec<(usize, PointQuantities)>,
    /// Derivatives of the values with respect to the fraction, along the branch. With them the
    /// points are those of the branch at the stated fraction, whatever its error; without, at
    /// a fold, they are those of the critical point itself.
    pub parameter_derivatives: Option<PointQuantities>,
    /// Error of the fraction due to rounding of the matrix.
    pub rounding: f64,
    /// Error of the fraction due to softening of the matrix.
    pub regularization_error: f64,
    /// Whether the point is regular: then its fraction is extrapolated as its points are, and
    /// has no error, as it is where they are.
    regular: bool,
    /// An error of the points common to all grids, and their rounding error.
    pub common: f64,
    pub noise: f64,
}

impl ConvergenceTable {
    /// The table of a regular point.
    pub fn of_regular_point() -> Self {
        ConvergenceTable {
            regular: true,
            ..ConvergenceTable::default()
        }
    }

    pub fn push(&mut self, segments: usize, values: PointQuantities) {
        self.rows.push((segments, values));
    }

    fn extrapolation_of(&self, what: impl Fn(&PointQuantities) -> Vec<f64>) -> Richardson {
        let rows = self.rows.iter();
        rows.map(|(segments, values)| (*segments, what(values)))
            .collect()
    }

    /// The points, moved along the branch to the fraction of the last grid.
    fn points(&self) -> Richardson {
        let last = self.rows.last().map_or(0.0, |(_, last)| last.fraction);
        let points = self.extrapolation_of(|values| match &self.parameter_derivatives {
            None => values.points.clone(),
            Some(slope) => {
                let points = values.points.iter().zip(&slope.points);
                points
                    .map(|(point, slope)| point + slope * (last - values.fraction))
                    .collect()
            }
        });
        points.with_noise(self.noise)
    }

    /// Estimate of the error of the points.
    pub fn error(&self) -> f64 {
        let points = self.points();
        let Some(best) = points.best() else {
            return f64::INFINITY;
        };
        // So many grids do not show of which order the errors of the column before were.
        let error = match best.columns {
            last if self.regular && last > 1 && last + 1 == self.rows.len() => {
                best.error.max(CAUTION * points.correction(last))
            }
            _ => best.error,
        };
        error + self.common + self.noise
    }

    /// Estimate of the error of the fraction of a critical point, without rounding.
    pub fn fraction_error(&self) -> f64 {
        if self.regular {
            return 0.0;
        }
        let Some(best) = self.extrapolation_of(|values| vec![values.fraction]).best() else {
            return f64::INFINITY;
        };
        match self.rows.as_slice() {
            [.., (_, before), (_, last), _] if best.columns == 0 => {
                let fall = SMALLEST_CHANGE_RATIO * (last.fraction - before.fraction).abs();
                best.error.max(fall)
            }
            _ => best.error,
        }
    }

    /// The extrapolated point, with its state on the finest grid.
    pub fn extrapolated_point(&self, state: State, grid: Grid) -> ExtrapolatedPoint {
        let own = self.points().best_column_number();
        let fractions = self.extrapolation_of(|values| vec![values.fraction]);
        let best = if self.regular {
            own
        } else {
            fractions.best_column_number()
        };
        let fraction = fractions.column(best)[0];
        let mut points = self
            .extrapolation_of(|values| values.points.clone())
            .column(own)
            .to_vec();
        let mut energy = self
            .extrapolation_of(|values| vec![values.energy])
            .column(own)[0];
        let flat = |values: &PointQuantities| {
            let forces = values.reactions.iter();
            forces.flat_map(|force| force.to_array()).collect()
        };
        let reactions = self.extrapolation_of(flat);
        let reactions = reactions.column(own).chunks(3);
        let mut reactions: Vec<DVec3> = reactions.map(DVec3::from_slice).collect();
        if let Some(slope) = &self.parameter_derivatives {
            let correction = fraction - fractions.column(own)[0];
            let moved = points.iter_mut().zip(&slope.points);
            moved.for_each(|(point, slope)| *point += correction * slope);
            energy += correction * slope.energy;
            let moved = reactions.iter_mut().zip(&slope.reactions);
            moved.for_each(|(force, slope)| *force += correction * *slope);
        }
        let tips = points.chunks(3).take(state.rods());
        ExtrapolatedPoint {
            fraction,
            energy,
            tips: tips.map(DVec3::from_slice).collect(),
            reactions,
            position_error: self.error(),
            fraction_error: self.fraction_error() + self.regularization_error + self.rounding,
            state,
            grid,
        }
    }
}

/// Critical parameters with errors below this part of the range are exact.
const EXACT_PARAMETER_ERROR: f64 = 1e-12;

/// Compliances by which the matrices of nearly rigid leaves are softened, in units of
/// L^2/A, used one to four times: smaller ones increase rounding errors, larger ones the error
/// of extrapolation to zero. And the stiffness above which matrices are softened.
pub const REGULARIZATION_COMPLIANCES: [f64; 5] = [1e-4, 3e-5, 1e-5, 3e-6, 1e-6];

pub const NEARLY_RIGID: f64 = 1.01 * STIFFEST;

/// Weights of the values at softenings of 1, 2, 3, 4 for extrapolation to zero: by the cubic
/// through all of them, and by the parabola through the first three.
pub const CUBIC_EXTRAPOLATION_WEIGHTS: [f64; 4] = [4.0, -6.0, 4.0, -1.0];

pub const PARABOLIC_EXTRAPOLATION_WEIGHTS: [f64; 4] = [3.0, -3.0, 1.0, 0.0];

/// Refinement of the finest grid of a critical point over the one it was found on.
pub const FINEST_GRID_RATIO: f64 = 4.0;

/// Spacings (in arclength) of the points from which a branch is interpolated across a branch
/// point, in this order, until the error of the tips is below `ENOUGH` times their accuracy.
const INTERPOLATION_SPACINGS: [f64; 6] = [0.03, 0.01, 0.003, 0.001, 3e-4, 1e-4];

const INTERPOLATION_ERROR_FRACTION: f64 = 0.1;

/// From one spacing to the next, a third, errors of fourth order fall to 1/81; if they fall to
/// less than this, rounding does not matter yet.
const FOURTH_ORDER_ERROR_RATIO: f64 = 1.0 / 30.0;

/// A critical point with the given accuracy of its tips, on at least so many `grids`.
pub fn refine_critical(
    family: &LeafFamily,
    grid: &Grid,
    found: &CriticalPoint,
    accuracy: f64,
    grids: usize,
) -> Result<ExtrapolatedPoint, VerificationFailure> {
    let mut table = ConvergenceTable::default();
    let mut equations = BranchEquations::new(family, grid.clone());
    let mut critical = found.clone();
    let mut softening = Regularization(REGULARIZATION_COMPLIANCES[0]);
    let mut moved = f64::INFINITY;
    for level in 0..GRIDS {
        if level > 0 {
            let leaf = equations.leaves.leaf_at([critical.fraction])?;
            let state = prolong(leaf, &critical.state);
            equations = equations.refined();
            let first = equations.first_node();
            let soft = critical.border_modes.iter();
            let finer = CriticalPoint {
                state,
                tangent: equations.prolong_direction(&critical.tangent),
                border_modes: soft.map(|field| prolong_field(field, first)).collect(),
                ..critical.clone()
            };
            critical = finer.relocate(&mut equations)?;
            let shift = finer.state.largest_displacement_to(&critical.state);
            if shift > moved.max(NEGLIGIBLE_DISPLACEMENT) {
                return Err(VerificationFailure::OtherBranch);
            }
            moved = shift;
        }
        let (mut values, growth) =
            softening.critical_quantities_on_grid(family, &mut equations, &critical, &mut table)?;
        if critical.kind == CriticalKind::Branching {
            let across = interpolate_across(&mut equations, &critical, values.fraction, accuracy);
            if let Some(across) = across {
                table.common = larger(table.common, across.error);
                table.parameter_derivatives = Some(across.slope);
                values = across.values;
            }
        }
        table.push(equations.grid().segments(), values);
        // If so, a finer grid would only add rounding errors.
        let exact = table.fraction_error() < (table.rounding / growth).max(EXACT_PARAMETER_ERROR);
        let noisy = FINEST_GRID_RATIO * table.noise > INTERPOLATION_ERROR_FRACTION * accuracy;
        let enough = exact || noisy || level + 1 >= grids;
        if enough && table.error() <= accuracy {
            let leaf = equations.leaves.leaf_at([critical.fraction])?;
            let state = leaf.circle_representative(&critical.state).into_owned();
            return Ok(table.extrapolated_point(state, equations.grid().clone()));
        }
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
    }
    Err(VerificationFailure::Inaccurate)
}

/// The compliance by which matrices are softened.
struct Regularization(f64);

/// A critical point extrapolated to zero softening.
struct UnregularizedPoint {
    values: PointQuantities,
    /// Error of the extrapolation, for the points and for the fraction.
    error: f64,
    fraction_error: f64,
}

impl Regularization {
    /// A critical point on a grid, and the factor by which extrapolation amplifies rounding;
    /// records both errors in the table.
    fn critical_quantities_on_grid(
        &mut self,
        family: &LeafFamily,
        equations: &mut BranchEquations,
        critical: &CriticalPoint,
        table: &mut ConvergenceTable,
    ) -> Result<(PointQuantities, f64), CorrectorFailure> {
        let leaf = equations.leaves.leaf_at([critical.fraction])?;
        let rigid = leaf.least_compliance() * NEARLY_RIGID < 1.0;
        let mut stiffest = stiffest_condensed(leaf);
        let segments = leaf.segments();
        let fold = critical.kind == CriticalKind::Fold;
        let mut growth = 1.0;
        let values = match rigid {
            false => PointQuantities::at_state(equations, &critical.state, critical.fraction)?,
            true => {
                let slope =
                    critical.eigenvalue_slope.abs() / (FINEST_GRID_RATIO * segments as f64).powi(2);
                let found = self.remove_regularization(family, equations, critical, slope)?;
                table.regularization_error =
                    larger(table.regularization_error, found.fraction_error);
                if fold {
                    table.common = larger(table.common, found.error);
                }
                stiffest = stiffest.min(1.0 / self.0);
                growth = CUBIC_EXTRAPOLATION_WEIGHTS
                    .iter()
                    .map(|weight| weight.abs())
                    .sum();
                found.values
            }
        };
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
        Ok((values, growth))
    }

    /// A critical point of a nearly rigid leaf, from softened matrices, extrapolated to zero.
    /// The softening is reduced until the rounding error, that of the stiffness over the
    /// derivative of the eigenvalue, exceeds the error of the extrapolation: at a fold also that of
    /// its shape, but not at a branch point, which a singular matrix leaves undetermined along the
    /// neutral mode, and where the shape is interpolated.
    fn remove_regularization(
        &mut self,
        family: &LeafFamily,
        equations: &BranchEquations,
        critical: &CriticalPoint,
        slope: f64,
    ) -> Result<UnregularizedPoint, CorrectorFailure> {
        loop {
            let found = extrapolate_regularization(family, equations.grid(), critical, self.0)?;
            let rounding = f64::EPSILON / self.0 / slope;
            let error = match critical.kind {
                CriticalKind::Fold => larger(found.error, found.fraction_error),
                CriticalKind::Branching => found.fraction_error,
            };
            let less = REGULARIZATION_COMPLIANCES
                .into_iter()
                .find(|less| *less < self.0);
            match less {
                Some(less) if error > rounding => self.0 = less,
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
        let parts: Vec<_> = weights.into_iter().zip(found.iter().cloned()).collect();
        PointQuantities::weighted_sum(&parts)
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

/// A branch at a branch point.
struct InterpolatedBranchPoint {
    values: PointQuantities,
    /// A bound on the error of the tips.
    error: f64,
    /// Derivatives of the values with respect to the fraction.
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

/// The same from points `apart`, in planes across the tangent: next to a fold the branch is not
/// smooth over the parameter. The error is that of the fourth order, the values are of the sixth.
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
    let sum = |weights: [f64; 3], sign: f64| {
        let parts = pairs.iter().zip(weights);
        let parts = parts.flat_map(|([before, after], weight)| {
            [(sign * weight, before.clone()), (weight, after.clone())]
        });
        PointQuantities::weighted_sum(&parts.collect::<Vec<_>>())
    };
    let along = sum(SLOPE, -1.0);
    let slope = PointQuantities::weighted_sum(&[(1.0 / along.fraction, along)]);
    let at_fraction = |weights: [f64; 3]| {
        let across = sum(weights, 1.0);
        let shift = fraction - across.fraction;
        PointQuantities::weighted_sum(&[(1.0, across), (shift, slope.clone())])
    };
    let values = at_fraction(SIXTH);
    Some(InterpolatedBranchPoint {
        error: values.distance(&at_fraction(FOURTH)),
        values,
        slope,
    })
}
