//! Points of a branch on finer and finer grids: extrapolated, and thereby verified.

use super::critical::Critical;
use super::equations::{Equations, Stuck, reversed};
use super::family::{Family, Leaves, OutOfRange};
use super::field::prolong as prolong_field;
use super::{Point, Tangent};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::relax::node_state;
use crate::relax::prolong::prolong;
use crate::relax::richardson::Richardson;
use crate::shape::RodShape;

/// Grids of a point at most, those of a critical point unless its tips need more,
/// and segments of the finest.
const GRIDS: usize = 6;
const CRITICAL_GRIDS: usize = 4;
const FINEST: usize = 4096;

/// From grid to grid a point moves by less and less, if by more than this (lengths).
const STILL: f64 = 1e-4;

/// Tangents on two grids that differ by more than this (cosine) are those of two
/// branches.
const SAME_WAY: f64 = 0.85;

/// Largest error of the tips of a critical point (lengths).
const NEUTRAL_TIPS: f64 = 1e-3;

/// A critical parameter within this part of its range is exact.
const EXACT: f64 = 1e-12;

/// A point is sought where the leaf has gone the same way on all grids, since
/// each has its own critical parameters. But at the same parameter at the ends of
/// its range, and where the branch goes at least this much along it alone.
const ALONG: f64 = 0.995;

/// Compliance by which matrices of nearly rigid leaves are softened, in units
/// of L^2/A, times one to four; and the stiffness from which on they are.
const SOFTENING: f64 = 1e-4;
const NEARLY_RIGID: f64 = 1.01e5;

/// A point without the error of its grid.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// Energy, in the family's units.
    pub energy: f64,
    /// Tips of all rods, likewise.
    pub tips: Vec<[f64; 3]>,
    /// Bound on the error of the tips.
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

/// A point on the next finer grid.
pub(super) struct Finer<'a> {
    pub equations: Equations<'a>,
    pub point: Point,
    /// By how much it moved.
    pub moved: f64,
}

/// A point on the grid with all segments halved.
pub(super) fn on_finer<'a>(
    equations: &mut Equations<'a>,
    point: &Point,
) -> Result<Finer<'a>, Stuck> {
    let guess = prolong(equations.leaves.at(point.fraction)?, &point.state);
    let increments = prolong_field(&point.tangent.increments);
    let mut equations = equations.refined()?;
    let tangent = equations.normalised(Tangent {
        increments,
        ..point.tangent
    });
    // Next to a crossing the same plane may hold another branch, too; the
    // same way of the leaf does not.
    let inside = point.fraction != 0.0 && point.fraction != 1.0;
    let normal = (inside && tangent.fraction.abs() < ALONG).then(|| {
        equations.normalised(Tangent {
            increments: tangent.increments.clone(),
            fraction: 0.0,
        })
    });
    let (mut found, _) = equations.correct(&guess, point.fraction, normal.as_ref())?;
    if equations.along(&found.tangent, &tangent) < 0.0 {
        found.tangent = reversed(found.tangent);
    }
    Ok(Finer {
        moved: guess.shift_to(&found.state),
        point: found,
        equations,
    })
}

/// A regular point to the given accuracy of its tips, on as many grids as it takes;
/// on all of them it must be the same.
pub fn refine(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    let mut table = Table::default();
    let mut equations = Equations::new(family, grid.clone())?;
    table.push(&mut equations, &point.state, point.fraction)?;
    let mut now = point.clone();
    let mut moved = f64::INFINITY;
    for _ in 1..GRIDS {
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
        let finer = on_finer(&mut equations, &now)?;
        equations = finer.equations;
        // In the same plane on all grids, for the sake of the series.
        let tangent = Tangent {
            increments: prolong_field(&now.tangent.increments),
            ..now.tangent
        };
        let same = equations.normalised(tangent.clone());
        let same = equations.along(&finer.point.tangent, &same);
        if same < SAME_WAY || finer.moved > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
        }
        if finer.point.index != point.index {
            return Err(Doubt::OtherIndex);
        }
        moved = finer.moved;
        now = Point {
            tangent,
            ..finer.point
        };
        table.push(&mut equations, &now.state, now.fraction)?;
        if table.error() <= accuracy {
            return Ok(table.refined(now.state, equations.grid().clone()));
        }
    }
    Err(Doubt::Inaccurate)
}

/// A critical point on four grids, or more if its tips need them to be as accurate.
pub fn refine_critical(
    family: &Family,
    grid: &Grid,
    found: &Critical,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    let mut table = Table::default();
    let mut equations = Equations::new(family, grid.clone())?;
    let mut critical = found.clone();
    let mut moved = f64::INFINITY;
    for level in 0..GRIDS {
        if level > 0 {
            let leaf = equations.leaves.at(critical.fraction)?;
            let state = prolong(leaf, &critical.state);
            equations = equations.refined()?;
            let tangent = equations.normalised(Tangent {
                increments: prolong_field(&critical.tangent.increments),
                ..critical.tangent
            });
            let finer = Critical {
                state,
                tangent,
                held: critical.held.iter().map(prolong_field).collect(),
                ..critical.clone()
            };
            critical = finer.again(&mut equations)?;
            let way = finer.state.shift_to(&critical.state);
            if way > moved.max(STILL) {
                return Err(Doubt::OtherBranch);
            }
            moved = way;
        }
        let leaf = equations.leaves.at(critical.fraction)?;
        let rigid = leaf.stiffest() * NEARLY_RIGID < 1.0;
        let limit = if rigid {
            1.0 / SOFTENING
        } else {
            f64::INFINITY
        };
        let condensing = leaf.sections.iter().map(|it| it.condensing.max_element());
        let stiffest = condensing.fold(0.0_f64, |most, it| most.max(it.min(limit)));
        let segments = leaf.segments() as f64;
        let rounding = f64::EPSILON * stiffest * segments * segments / critical.steepness();
        table.rounding = table.rounding.max(rounding);
        let fraction = match rigid {
            false => critical.fraction,
            true => unsoftened(family, equations.grid(), &critical)?,
        };
        table.push(&mut equations, &critical.state, fraction)?;
        // A finer grid would only add rounding.
        let exact =
            (table.fraction.best()).is_some_and(|best| best.error < table.rounding.max(EXACT));
        let enough = exact || level + 1 >= CRITICAL_GRIDS;
        if enough && table.error() <= accuracy {
            return Ok(table.refined(critical.state, equations.grid().clone()));
        }
        let grids = if rigid { CRITICAL_GRIDS } else { GRIDS };
        let last = level + 1 == grids || 2 * equations.grid().segments() > FINEST;
        // Along the neutral mode a singular matrix leaves tips as rounding has them, and
        // that of a nearly rigid leaf the more, the finer the grid: the point is known by
        // its parameter, and says how well its tips are.
        if last && table.error() <= NEUTRAL_TIPS {
            return Ok(table.refined(critical.state, equations.grid().clone()));
        }
        if last {
            break;
        }
    }
    Err(Doubt::Inaccurate)
}

/// The parameter of a critical point of a nearly rigid leaf: by softened
/// matrices, extrapolated to none.
fn unsoftened(family: &Family, grid: &Grid, critical: &Critical) -> Result<f64, Stuck> {
    let mut fractions = [0.0; 4];
    let mut near = critical.clone();
    for (k, fraction) in fractions.iter_mut().enumerate().rev() {
        let soft = family.softened(SOFTENING * (k + 1) as f64);
        let mut equations = Equations::new(family, grid.clone())?;
        equations.softened = Some(Leaves::new(&soft, grid.clone()));
        near = near.again(&mut equations)?;
        *fraction = near.fraction;
    }
    // The cubic through values at 1, 2, 3, 4 at zero.
    let [a, b, c, d] = fractions;
    Ok(4.0 * a - 6.0 * b + 4.0 * c - d)
}

/// What is extrapolated.
#[derive(Default)]
struct Table {
    tips: Richardson,
    fraction: Richardson,
    energy: Richardson,
    /// What rounding of the matrix may have done to the fraction.
    rounding: f64,
}

impl Table {
    fn push(
        &mut self,
        equations: &mut Equations,
        state: &State,
        fraction: f64,
    ) -> Result<(), Stuck> {
        let energy = equations.leaves.at(fraction)?.energy(state);
        let tips = (0..state.rods()).flat_map(|j| state.tip(j).to_array());
        let segments = state.segments();
        self.tips.push(segments, tips.collect());
        self.fraction.push(segments, vec![fraction]);
        self.energy.push(segments, vec![energy]);
        Ok(())
    }

    /// Estimate of the error of the tips.
    fn error(&self) -> f64 {
        self.tips.best().map_or(f64::INFINITY, |best| best.error)
    }

    fn refined(&self, state: State, grid: Grid) -> Refined {
        let columns = |table: &Richardson| table.best().map_or(0, |best| best.columns);
        let own = self
            .fraction
            .best()
            .map_or(f64::INFINITY, |best| best.error);
        let tips = self.tips.column(columns(&self.tips));
        Refined {
            fraction: self.fraction.column(columns(&self.fraction))[0],
            energy: self.energy.column(columns(&self.tips))[0],
            tips: tips.chunks(3).map(|tip| [tip[0], tip[1], tip[2]]).collect(),
            error: self.error(),
            fraction_error: own + self.rounding,
            state,
            grid,
        }
    }
}
