//! A point of a branch, extrapolated over finer and finer grids.

use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::{Family, Leaves, OutOfRange};
use crate::largest::largest;
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::shape_of;
use crate::shape::RodShape;
use glam::DVec3;

/// Smallest ratio of successive changes: that of a fourth-order term from grid to grid. A
/// smaller change is small by chance.
const LEAST_FALL: f64 = 1.0 / 16.0;

/// Least safety factor on the last correction of a regular point whose order of convergence is
/// not confirmed. Of 955 points of random branches of wild leaves none had an error of more
/// than 25 such corrections.
const CAUTION: f64 = 40.0;

/// A point extrapolated to zero segment length.
#[derive(Clone, Debug)]
pub struct Refined {
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
    pub error: f64,
    /// Bound on the error of the parameter, as a fraction of its range.
    pub fraction_error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// That grid.
    pub grid: Grid,
}

impl Refined {
    /// Whether its parameter may be in the range.
    pub fn is_inside(&self) -> bool {
        let beyond = (-self.fraction).max(self.fraction - 1.0);
        beyond <= self.fraction_error
    }

    /// Its leaf on the finest grid, in the scenario's units.
    ///
    /// # Errors
    /// If the extrapolated parameter is one that no leaf can have.
    pub fn shapes(&self, family: &Family) -> Result<Vec<RodShape>, OutOfRange> {
        let mut leaves = Leaves::new(family, self.grid.clone());
        Ok(shape_of(leaves.at([self.fraction])?, &self.state))
    }
}

/// Why a point is not verified.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Doubt {
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

impl From<Stuck> for Doubt {
    fn from(stuck: Stuck) -> Self {
        match stuck {
            Stuck::Separated | Stuck::Unfolded => Doubt::OtherBranch,
            _ => Doubt::Unsolved,
        }
    }
}

impl From<OutOfRange> for Doubt {
    fn from(_: OutOfRange) -> Self {
        Doubt::Unsolved
    }
}

/// Quantities of a point on one grid.
#[derive(Clone)]
pub(in crate::branch) struct Values {
    /// The coordinates of every tip; then, if the tips or others are held, those of the midpoint
    /// of every rod.
    pub points: Vec<f64>,
    pub fraction: f64,
    pub energy: f64,
    /// The forces on the holders.
    pub reactions: Vec<DVec3>,
}

/// The nodes of each rod whose positions are used.
pub(in crate::branch) fn observed_nodes(
    leaf: &DiscreteLeaf,
    segments: usize,
) -> impl Iterator<Item = usize> {
    let middle = leaf.leaf.is_held().then_some(segments / 2);
    [segments].into_iter().chain(middle)
}

impl Values {
    /// Of a leaf that can turn those of the equilibrium that stands for its circle, as it does in a
    /// relaxation: where on the circle a branch has led depends on where it began.
    pub fn of(equations: &mut Equations, state: &State, fraction: f64) -> Result<Self, Stuck> {
        let leaf = equations.leaves.at([fraction])?;
        let state = &*leaf.leaning(state);
        let nodes = observed_nodes(leaf, state.segments());
        let points = nodes.flat_map(|i| (0..state.rods()).map(move |j| state.base(j) + i));
        Ok(Values {
            points: points.flat_map(|k| state.x[k].to_array()).collect(),
            fraction,
            energy: leaf.energy(state),
            reactions: leaf.forces_on_holders(state),
        })
    }

    pub fn sum(parts: &[(f64, Values)]) -> Self {
        let sum = |of: &dyn Fn(&Values) -> f64| parts.iter().map(|(w, v)| w * of(v)).sum();
        let points = parts.first().map_or(0, |(_, values)| values.points.len());
        let holders = parts
            .first()
            .map_or(0, |(_, values)| values.reactions.len());
        let on = |k: usize| parts.iter().map(|(w, v)| *w * v.reactions[k]).sum();
        Values {
            points: (0..points)
                .map(|k| sum(&|values| values.points[k]))
                .collect(),
            fraction: sum(&|values| values.fraction),
            energy: sum(&|values| values.energy),
            reactions: (0..holders).map(on).collect(),
        }
    }

    /// The largest distance between corresponding points.
    pub fn distance(&self, other: &Values) -> f64 {
        let points = self.points.chunks(3).zip(other.points.chunks(3));
        let squares = points.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum());
        largest(squares).sqrt()
    }
}

/// The values of a point on finer and finer grids.
#[derive(Default)]
pub(in crate::branch) struct Table {
    rows: Vec<(usize, Values)>,
    /// Derivatives of the values with respect to the fraction, along the branch. With them the
    /// points are those of the branch at the stated fraction, whatever its error; without, at
    /// a fold, they are those of the critical point itself.
    pub slope: Option<Values>,
    /// Error of the fraction due to rounding of the matrix.
    pub rounding: f64,
    /// Error of the fraction due to softening of the matrix.
    pub softening: f64,
    /// Whether the point is regular: then its fraction is extrapolated as its points are, and
    /// has no error, as it is where they are.
    regular: bool,
    /// An error of the points common to all grids, and their rounding error.
    pub common: f64,
    pub noise: f64,
}

impl Table {
    /// The table of a regular point.
    pub fn of_regular_point() -> Self {
        Table {
            regular: true,
            ..Table::default()
        }
    }

    pub fn push(&mut self, segments: usize, values: Values) {
        self.rows.push((segments, values));
    }

    fn of(&self, what: impl Fn(&Values) -> Vec<f64>) -> Richardson {
        let rows = self.rows.iter();
        rows.map(|(segments, values)| (*segments, what(values)))
            .collect()
    }

    /// The points, moved along the branch to the fraction of the last grid.
    fn points(&self) -> Richardson {
        let last = self.rows.last().map_or(0.0, |(_, last)| last.fraction);
        let points = self.of(|values| match &self.slope {
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
        let Some(best) = self.of(|values| vec![values.fraction]).best() else {
            return f64::INFINITY;
        };
        match self.rows.as_slice() {
            [.., (_, before), (_, last), _] if best.columns == 0 => {
                let fall = LEAST_FALL * (last.fraction - before.fraction).abs();
                best.error.max(fall)
            }
            _ => best.error,
        }
    }

    /// The extrapolated point, with its state on the finest grid.
    pub fn refined(&self, state: State, grid: Grid) -> Refined {
        let own = self.points().columns();
        let fractions = self.of(|values| vec![values.fraction]);
        let best = if self.regular {
            own
        } else {
            fractions.columns()
        };
        let fraction = fractions.column(best)[0];
        let mut points = self.of(|values| values.points.clone()).column(own).to_vec();
        let mut energy = self.of(|values| vec![values.energy]).column(own)[0];
        let flat = |values: &Values| {
            let forces = values.reactions.iter();
            forces.flat_map(|force| force.to_array()).collect()
        };
        let reactions = self.of(flat);
        let reactions = reactions.column(own).chunks(3);
        let mut reactions: Vec<DVec3> = reactions.map(DVec3::from_slice).collect();
        if let Some(slope) = &self.slope {
            let correction = fraction - fractions.column(own)[0];
            let moved = points.iter_mut().zip(&slope.points);
            moved.for_each(|(point, slope)| *point += correction * slope);
            energy += correction * slope.energy;
            let moved = reactions.iter_mut().zip(&slope.reactions);
            moved.for_each(|(force, slope)| *force += correction * *slope);
        }
        let tips = points.chunks(3).take(state.rods());
        Refined {
            fraction,
            energy,
            tips: tips.map(DVec3::from_slice).collect(),
            reactions,
            error: self.error(),
            fraction_error: self.fraction_error() + self.softening + self.rounding,
            state,
            grid,
        }
    }
}
