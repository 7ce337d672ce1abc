//! What finer and finer grids say of a point of a branch, extrapolated.

use super::equations::{Equations, Stuck};
use super::family::{Family, OutOfRange};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::relax::node_state;
use crate::relax::richardson::Richardson;
use crate::shape::RodShape;
use glam::DVec3;

/// A term of fourth order falls to this part from grid to grid: a change that falls to
/// less is zero by chance.
const LEAST_FALL: f64 = 1.0 / 16.0;

/// A point without the error of its grid.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// Energy, in the family's units.
    pub energy: f64,
    /// Tips of all rods, likewise.
    pub tips: Vec<[f64; 3]>,
    /// The force that the holder of the tips feels, likewise; zero of free ones.
    pub reaction: DVec3,
    /// Bound on the error of the tips, or if they are held of the middles of the rods, as
    /// those of the branch at this parameter; at a fold, as those of the fold.
    pub error: f64,
    /// Bound on the error of the parameter, as a fraction of its range.
    pub fraction_error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// That grid.
    pub grid: Grid,
}

impl Refined {
    /// Its leaf on the finest grid, in the scenario's units.
    ///
    /// # Errors
    /// If the extrapolated parameter is one that no leaf can have.
    pub fn shapes(&self, family: &Family) -> Result<Vec<RodShape>, OutOfRange> {
        let scale = family.scale();
        let node = |leaf: &DiscreteLeaf, j: usize, i: usize| {
            let mut node = node_state(leaf, &self.state, j, i);
            node.position *= scale.length;
            node.u /= scale.length;
            node.n *= scale.force();
            node.m *= scale.moment();
            node
        };
        let rod = |leaf: &DiscreteLeaf, j: usize| RodShape {
            length: leaf.leaf.length(j) * scale.length,
            nodes: (0..=leaf.segments()).map(|i| node(leaf, j, i)).collect(),
        };
        family.with(self.fraction, &self.grid, |leaf| {
            (0..leaf.rods()).map(|j| rod(leaf, j)).collect()
        })
    }
}

/// Why a point is not verified.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Doubt {
    /// Finer grids have no solution near it.
    #[error("finer grids have no solution there")]
    Unsolved,
    /// They have one of another branch: far away, or going another way.
    #[error("finer grids have another branch there")]
    OtherBranch,
    /// They have one with another index.
    #[error("finer grids have another index there")]
    OtherIndex,
    /// The index changes, and no singular matrix explains it.
    #[error("the index changes there without a singular matrix")]
    Unexplained,
    /// The error of the tips, or of what is looked at in their place, stays above the
    /// accuracy.
    #[error("the tolerance is not reached there on any grid")]
    Inaccurate,
}

impl From<Stuck> for Doubt {
    fn from(_: Stuck) -> Self {
        Doubt::Unsolved
    }
}

impl From<OutOfRange> for Doubt {
    fn from(_: OutOfRange) -> Self {
        Doubt::Unsolved
    }
}

/// What is known of a point on one grid.
#[derive(Clone)]
pub(super) struct Values {
    /// Three coordinates of every tip, then of the middle of every rod if its tip is held
    /// and says nothing.
    pub points: Vec<f64>,
    pub fraction: f64,
    pub energy: f64,
    /// What the holder of the tips feels; zero of free ones.
    pub reaction: DVec3,
}

/// The nodes of each rod at which values are taken.
pub(super) fn looked_at(leaf: &DiscreteLeaf, segments: usize) -> impl Iterator<Item = usize> {
    let middle = leaf.leaf.held.is_some().then_some(segments / 2);
    [segments].into_iter().chain(middle)
}

impl Values {
    pub fn of(equations: &mut Equations, state: &State, fraction: f64) -> Result<Self, Stuck> {
        let leaf = equations.leaves.at(fraction)?;
        let nodes = looked_at(leaf, state.segments());
        let reaction = match leaf.leaf.held {
            Some(_) => leaf.reaction(state).0,
            None => DVec3::ZERO,
        };
        let points = nodes.flat_map(|i| (0..state.rods()).map(move |j| state.base(j) + i));
        Ok(Values {
            points: points.flat_map(|k| state.x[k].to_array()).collect(),
            fraction,
            energy: leaf.energy(state),
            reaction,
        })
    }

    /// The sum of values, each times its weight.
    pub fn sum(parts: &[(f64, Values)]) -> Self {
        let sum = |of: &dyn Fn(&Values) -> f64| parts.iter().map(|(w, v)| w * of(v)).sum();
        let points = parts.first().map_or(0, |(_, values)| values.points.len());
        Values {
            points: (0..points)
                .map(|k| sum(&|values| values.points[k]))
                .collect(),
            fraction: sum(&|values| values.fraction),
            energy: sum(&|values| values.energy),
            reaction: parts.iter().map(|(w, v)| *w * v.reaction).sum(),
        }
    }

    /// The largest distance between points.
    pub fn distance(&self, other: &Values) -> f64 {
        let points = self.points.chunks(3).zip(other.points.chunks(3));
        let squares = points.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum());
        squares.fold(0.0, f64::max).sqrt()
    }
}

/// The values of a point on ever finer grids.
#[derive(Default)]
pub(super) struct Table {
    rows: Vec<(usize, Values)>,
    /// Change of the values with the fraction along the branch. Points are those of the
    /// branch at the fraction that is stated, whatever the error of that; where there is
    /// no such change, at a fold, they are those of the point itself.
    pub slope: Option<Values>,
    /// What rounding of the matrix may have done to the fraction.
    pub rounding: f64,
    /// What softening of the matrix may have left in the fraction.
    pub softening: f64,
    /// An error of the points that all grids have, and their rounding.
    pub common: f64,
    pub noise: f64,
}

impl Table {
    pub fn push(&mut self, segments: usize, values: Values) {
        self.rows.push((segments, values));
    }

    fn of(&self, what: impl Fn(&Values) -> Vec<f64>) -> Richardson {
        let mut table = Richardson::default();
        for (segments, values) in &self.rows {
            table.push(*segments, what(values));
        }
        table
    }

    /// The points at the fraction of the last grid.
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
        let best = self.points().best();
        best.map_or(f64::INFINITY, |best| best.error + self.common + self.noise)
    }

    /// Estimate of the error of the fraction of a critical point, but for rounding.
    pub fn fraction_error(&self) -> f64 {
        let Some(best) = self.of(|values| vec![values.fraction]).best() else {
            return f64::INFINITY;
        };
        let fraction = |back: usize| {
            Some(
                self.rows
                    .get(self.rows.len().checked_sub(back)?)?
                    .1
                    .fraction,
            )
        };
        match (best.columns, fraction(2), fraction(3)) {
            (0, Some(last), Some(before)) => best.error.max(LEAST_FALL * (last - before).abs()),
            _ => best.error,
        }
    }

    /// The point, with its state on the finest grid.
    pub fn refined(&self, state: State, grid: Grid) -> Refined {
        let columns = |table: &Richardson| table.best().map_or(0, |best| best.columns);
        let own = columns(&self.points());
        let fractions = self.of(|values| vec![values.fraction]);
        let fraction = fractions.column(columns(&fractions))[0];
        let mut points = self.of(|values| values.points.clone()).column(own).to_vec();
        let mut energy = self.of(|values| vec![values.energy]).column(own)[0];
        let reaction = self.of(|values| values.reaction.to_array().to_vec());
        let mut reaction = DVec3::from_slice(reaction.column(own));
        if let Some(slope) = &self.slope {
            let way = fraction - fractions.column(own)[0];
            let moved = points.iter_mut().zip(&slope.points);
            moved.for_each(|(point, slope)| *point += way * slope);
            energy += way * slope.energy;
            reaction += way * slope.reaction;
        }
        let tips = points.chunks(3).take(state.rods());
        Refined {
            fraction,
            energy,
            tips: tips.map(|tip| [tip[0], tip[1], tip[2]]).collect(),
            reaction,
            error: self.error(),
            fraction_error: self.fraction_error() + self.softening + self.rounding,
            state,
            grid,
        }
    }
}
