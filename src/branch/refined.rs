//! What finer and finer grids say of a point of a branch, extrapolated.

use super::equations::{Equations, Stuck};
use super::family::{Family, OutOfRange};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::relax::node_state;
use crate::relax::richardson::Richardson;
use crate::shape::RodShape;

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
    /// Bound on the error of the tips, as those of the branch at this parameter; at a
    /// fold, as those of the fold.
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
    /// The error of the tips stays above the accuracy.
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
    /// Three coordinates of every tip.
    pub tips: Vec<f64>,
    pub fraction: f64,
    pub energy: f64,
}

impl Values {
    pub fn of(equations: &mut Equations, state: &State, fraction: f64) -> Result<Self, Stuck> {
        let tips = (0..state.rods()).flat_map(|j| state.tip(j).to_array());
        Ok(Values {
            tips: tips.collect(),
            fraction,
            energy: equations.leaves.at(fraction)?.energy(state),
        })
    }

    /// The sum of values, each times its weight.
    pub fn sum(parts: &[(f64, Values)]) -> Self {
        let sum = |of: &dyn Fn(&Values) -> f64| parts.iter().map(|(w, v)| w * of(v)).sum();
        let tips = parts.first().map_or(0, |(_, values)| values.tips.len());
        Values {
            tips: (0..tips).map(|k| sum(&|values| values.tips[k])).collect(),
            fraction: sum(&|values| values.fraction),
            energy: sum(&|values| values.energy),
        }
    }

    /// The largest distance between tips.
    pub fn distance(&self, other: &Values) -> f64 {
        let tips = self.tips.chunks(3).zip(other.tips.chunks(3));
        let squares = tips.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum());
        squares.fold(0.0, f64::max).sqrt()
    }
}

/// The values of a point on ever finer grids.
#[derive(Default)]
pub(super) struct Table {
    rows: Vec<(usize, Values)>,
    /// Change of the values with the fraction along the branch. Tips are those of the
    /// branch at the fraction that is stated, whatever the error of that; where there is
    /// no such change, at a fold, they are those of the point itself.
    pub slope: Option<Values>,
    /// What rounding of the matrix may have done to the fraction.
    pub rounding: f64,
    /// An error of the tips that all grids have.
    pub common: f64,
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

    /// The tips at the fraction of the last grid.
    fn tips(&self) -> Richardson {
        let last = self.rows.last().map_or(0.0, |(_, last)| last.fraction);
        self.of(|values| match &self.slope {
            None => values.tips.clone(),
            Some(slope) => {
                let tips = values.tips.iter().zip(&slope.tips);
                tips.map(|(tip, slope)| tip + slope * (last - values.fraction))
                    .collect()
            }
        })
    }

    /// Estimate of the error of the tips.
    pub fn error(&self) -> f64 {
        let best = self.tips().best();
        best.map_or(f64::INFINITY, |best| best.error + self.common)
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
        let own = columns(&self.tips());
        let fractions = self.of(|values| vec![values.fraction]);
        let fraction = fractions.column(columns(&fractions))[0];
        let mut tips = self.of(|values| values.tips.clone()).column(own).to_vec();
        let mut energy = self.of(|values| vec![values.energy]).column(own)[0];
        if let Some(slope) = &self.slope {
            let way = fraction - fractions.column(own)[0];
            let moved = tips.iter_mut().zip(&slope.tips);
            moved.for_each(|(tip, slope)| *tip += way * slope);
            energy += way * slope.energy;
        }
        Refined {
            fraction,
            energy,
            tips: (tips.chunks(3).map(|tip| [tip[0], tip[1], tip[2]])).collect(),
            error: self.error(),
            fraction_error: self.fraction_error() + self.rounding,
            state,
            grid,
        }
    }
}
