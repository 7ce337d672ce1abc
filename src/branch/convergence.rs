//! A point sought again on finer and finer grids, extrapolated over them and thereby verified.
//!
//! [`verify_over_grids`] is the loop of regular points, of critical points and of points of
//! stability boundaries: on every grid the point must be on the same branch, nearer to its place
//! on the grid before than that was to the one before it, and have the same index. Its values on
//! each grid are rows of a convergence table, from which Richardson's extrapolation takes the
//! point on a grid of segments of length zero, and a bound on its error.

use crate::branch::equations::{BranchEquations, CorrectorFailure};
use crate::branch::family::{LeafFamily, Leaves, OutOfRange};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::numbers::largest;
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::rod_shapes;
use crate::shape::RodShape;
use glam::DVec3;

/// Number of segments beyond which no finer grid is tried: rounding errors of the matrix, which
/// grow with their square, exceed those of extrapolation there.
const FINEST: usize = 4096;

/// Largest number of grids on which a point is sought.
pub(super) const MAX_GRIDS: usize = 6;

/// Displacements of a point from grid to grid must decrease, unless below this (lengths).
const NEGLIGIBLE_DISPLACEMENT: f64 = 1e-4;

/// If the cosine between the tangents on two grids is below this, they belong to different
/// branches.
pub(super) const SAME_BRANCH_COSINE: f64 = 0.85;

/// Critical parameters with errors below this part of their ranges are exact.
pub(super) const EXACT_PARAMETER_ERROR: f64 = 1e-12;

/// A point that is located on one grid after another and extrapolated over them.
pub(super) trait NestedGridPoint {
    type Verified;

    /// Locates the point on its own grid at `level` 0, else on the grid with all segments of the
    /// present one halved.
    fn locate(&mut self, level: usize) -> Result<Relocation, VerificationFailure>;

    /// Segments of the present grid.
    fn segments(&self) -> usize;

    /// Between how many grids the search must end.
    fn grid_limits(&self) -> GridLimits {
        GridLimits {
            least: 1,
            most: MAX_GRIDS,
        }
    }

    /// Adds the values of the point on the present grid to its convergence table.
    fn tabulate(&mut self, level: usize) -> Result<(), VerificationFailure>;

    /// The extrapolated point, if its error is small enough; `last`: whether no grid follows.
    fn extrapolated(
        &mut self,
        level: usize,
        last: bool,
    ) -> Result<Option<Self::Verified>, VerificationFailure>;
}

/// A point on a grid compared with the same point on the grid before.
pub(super) struct Relocation {
    /// Largest displacement of a node (lengths, radians); infinite on the first grid.
    pub displacement: f64,
    /// Cosine between the tangents of both grids; one if they are not compared.
    pub tangent_cosine: f64,
    pub same_index: bool,
}

impl Relocation {
    /// On the first grid there is nothing to compare with.
    pub fn on_first_grid() -> Self {
        Relocation {
            displacement: f64::INFINITY,
            tangent_cosine: 1.0,
            same_index: true,
        }
    }
}

/// Number of grids on which a point is sought.
pub(super) struct GridLimits {
    /// So many are used even if the last ones have more than 4096 segments.
    pub least: usize,
    pub most: usize,
}

/// Seeks a point on finer and finer grids until its error is small enough.
pub(super) fn verify_over_grids<P: NestedGridPoint>(
    mut point: P,
) -> Result<P::Verified, VerificationFailure> {
    let mut displacement = f64::INFINITY;
    for level in 0..MAX_GRIDS {
        let found = point.locate(level)?;
        if found.tangent_cosine < SAME_BRANCH_COSINE
            || found.displacement > displacement.max(NEGLIGIBLE_DISPLACEMENT)
        {
            return Err(VerificationFailure::OtherBranch);
        }
        if !found.same_index {
            return Err(VerificationFailure::OtherIndex);
        }
        displacement = found.displacement;
        point.tabulate(level)?;
        let (grids, limits) = (level + 1, point.grid_limits());
        let last = grids >= limits.least && (grids == limits.most || 2 * point.segments() > FINEST);
        if let Some(verified) = point.extrapolated(level, last)? {
            return Ok(verified);
        }
        if last {
            break;
        }
    }
    Err(VerificationFailure::Inaccurate)
}

/// Why a point is not verified over nested grids.
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

/// Smallest ratio of successive changes of a parameter from grid to grid, that of a fourth-order
/// term. A smaller change is small by chance.
const SMALLEST_CHANGE_RATIO: f64 = 1.0 / 16.0;

/// Least safety factor on the last correction of a regular point whose order of convergence is
/// not confirmed. Of 955 points of random branches of wild leaves none had an error of more
/// than 25 such corrections.
const UNCONFIRMED_ORDER_SAFETY: f64 = 40.0;

/// A point extrapolated to zero segment length.
#[derive(Clone, Debug)]
pub struct ExtrapolatedPoint {
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// Energy, in the family's units.
    pub energy: f64,
    /// Tips of all rods, in the family's units.
    pub tips: Vec<DVec3>,
    /// The forces on the holder of held tips, if tips are held, and on every grip, in the family's
    /// units.
    pub reactions: Vec<DVec3>,
    /// Bound on the error of the tips, or of the rods' midpoints if the tips are held, and of both
    /// with grips: of the branch at this parameter, or, at a fold, of the fold itself.
    pub position_error: f64,
    /// Bound on the error of the parameter, as a fraction of its range.
    pub fraction_error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// The finest grid.
    pub grid: Grid,
}

impl ExtrapolatedPoint {
    /// Whether the parameter may be in its range, given the error.
    pub fn may_be_in_range(&self) -> bool {
        let beyond = (-self.fraction).max(self.fraction - 1.0);
        beyond <= self.fraction_error
    }

    /// The leaf at the point on the finest grid, in the scenario's units.
    ///
    /// # Errors
    /// If the extrapolated parameter is one that no leaf can have.
    pub fn shapes(&self, family: &LeafFamily) -> Result<Vec<RodShape>, OutOfRange> {
        let mut leaves = Leaves::new(family, self.grid.clone());
        Ok(rod_shapes(leaves.leaf_at([self.fraction])?, &self.state))
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
    /// The forces on the holder of held tips and on grips, in the family's units.
    pub reactions: Vec<DVec3>,
}

/// The nodes of each rod whose positions are used.
pub(super) fn observed_nodes(leaf: &DiscreteLeaf, segments: usize) -> impl Iterator<Item = usize> {
    let middle = leaf.leaf.has_placed_supports().then_some(segments / 2);
    [segments].into_iter().chain(middle)
}

impl PointQuantities {
    /// The quantities of an equilibrium. If the leaf can turn, they are those of the equilibrium
    /// that stands for the circle of equilibria, as in a relaxation: where on the circle a branch has
    /// led depends on where it began.
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

    /// The linear combination of quantities with these weights.
    pub fn weighted_sum(weights: &[f64], terms: &[&PointQuantities]) -> Self {
        let parts = || weights.iter().zip(terms);
        let sum = |of: &dyn Fn(&PointQuantities) -> f64| parts().map(|(w, v)| w * of(v)).sum();
        let points = terms.first().map_or(0, |values| values.points.len());
        let holders = terms.first().map_or(0, |values| values.reactions.len());
        let on = |k: usize| parts().map(|(w, v)| *w * v.reactions[k]).sum();
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

/// The quantities of a point on a grid of so many segments.
pub(super) struct GridQuantities {
    pub segments: usize,
    pub values: PointQuantities,
}

/// The values of a point on finer and finer grids.
#[derive(Default)]
pub(super) struct ConvergenceTable {
    rows: Vec<GridQuantities>,
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

    pub fn push(&mut self, row: GridQuantities) {
        self.rows.push(row);
    }

    fn extrapolation_of(&self, what: impl Fn(&PointQuantities) -> Vec<f64>) -> Richardson {
        let rows = self.rows.iter();
        rows.map(|row| (row.segments, what(&row.values))).collect()
    }

    /// The points, moved along the branch to the fraction of the last grid.
    fn points(&self) -> Richardson {
        let last = self.rows.last().map_or(0.0, |last| last.values.fraction);
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
            last if self.regular && last > 1 && last + 1 == self.rows.len() => best
                .error
                .max(UNCONFIRMED_ORDER_SAFETY * points.correction(last)),
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
            [.., before, last, _] if best.columns == 0 => {
                let change = (last.values.fraction - before.values.fraction).abs();
                best.error.max(SMALLEST_CHANGE_RATIO * change)
            }
            _ => best.error,
        }
    }

    /// The extrapolated point, with its state on the finest grid, that of these equations; of a
    /// leaf that can turn, with the state that stands for its circle.
    pub fn extrapolated_point(
        &self,
        equations: &mut BranchEquations,
        state: &State,
        fraction: f64,
    ) -> Result<ExtrapolatedPoint, OutOfRange> {
        let leaf = equations.leaves.leaf_at([fraction])?;
        let state = leaf.circle_representative(state).into_owned();
        let grid = equations.grid().clone();
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
        Ok(ExtrapolatedPoint {
            fraction,
            energy,
            tips: tips.map(DVec3::from_slice).collect(),
            reactions,
            position_error: self.error(),
            fraction_error: self.fraction_error() + self.regularization_error + self.rounding,
            state,
            grid,
        })
    }
}
