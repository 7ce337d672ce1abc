//! Points of a branch on finer and finer grids, extrapolated.

use super::critical::Critical;
use super::equations::{Equations, Stuck};
use super::family::{Family, Leaves};
use super::field::prolong as prolong_field;
use super::{Point, Tangent};
use crate::leaf::{Grid, State};
use crate::relax::prolong::prolong;
use crate::relax::richardson::Richardson;

/// Grids of a regular point at most, and of a critical one.
const GRIDS: usize = 6;
const CRITICAL_GRIDS: usize = 4;

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
    /// In the family's units, as the tips of all rods.
    pub energy: f64,
    pub tips: Vec<[f64; 3]>,
    /// Bound on the error of the tips; `None` on one grid.
    pub error: Option<f64>,
    /// Bound on the error of the parameter, as a fraction of its range.
    pub fraction_error: Option<f64>,
    /// The state on the finest grid, and that grid.
    pub state: State,
    pub grid: Grid,
}

/// A regular point to the given accuracy of its tips, on as many grids as it takes.
pub fn refine(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
) -> Result<Refined, Stuck> {
    let mut table = Table::default();
    let mut equations = Equations::new(family, grid.clone())?;
    table.push(&equations, &point.state, point.fraction)?;
    let (mut state, mut fraction) = (point.state.clone(), point.fraction);
    let mut tangent = point.tangent.clone();
    let mut error = f64::INFINITY;
    let mut reached = grid.clone();
    for _ in 1..GRIDS {
        if error <= accuracy {
            break;
        }
        let before = equations.grid();
        let finer = family.with(fraction, before, |leaf| prolong(leaf, &state))?;
        tangent = Tangent {
            increments: prolong_field(&tangent.increments),
            ..tangent
        };
        equations = equations.refined()?;
        // Next to a crossing the same plane may hold another branch, too; the
        // same way of the leaf does not.
        let along = equations.normalised(tangent.clone()).fraction.abs();
        let inside = fraction != 0.0 && fraction != 1.0;
        let normal = (inside && along < ALONG).then(|| {
            equations.normalised(Tangent {
                increments: tangent.increments.clone(),
                fraction: 0.0,
            })
        });
        let Ok((found, _)) = equations.correct(&finer, fraction, normal.as_ref()) else {
            break;
        };
        (state, fraction) = (found.state, found.fraction);
        reached.clone_from(equations.grid());
        table.push(&equations, &state, fraction)?;
        error = table.tips.best().map_or(f64::INFINITY, |best| best.error);
    }
    Ok(table.refined(state, reached))
}

/// A critical point, on four grids.
pub fn refine_critical(family: &Family, grid: &Grid, found: &Critical) -> Result<Refined, Stuck> {
    let mut table = Table::default();
    let mut equations = Equations::new(family, grid.clone())?;
    let mut critical = found.clone();
    let mut reached = grid.clone();
    for level in 0..CRITICAL_GRIDS {
        if level > 0 {
            let before = equations.grid();
            let on_finer = |leaf: &_| prolong(leaf, &critical.state);
            let state = family.with(critical.fraction, before, on_finer)?;
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
            let Ok(found) = finer.again(&mut equations) else {
                break;
            };
            critical = found;
            reached.clone_from(equations.grid());
        }
        let (rigid, rounding) = family.with(critical.fraction, equations.grid(), |leaf| {
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
            (rigid, rounding)
        })?;
        table.rounding = table.rounding.max(rounding);
        let fraction = match rigid {
            false => critical.fraction,
            true => unsoftened(family, equations.grid(), &critical)?,
        };
        table.push(&equations, &critical.state, fraction)?;
        // A finer grid would only add rounding.
        if (table.fraction.best()).is_some_and(|best| best.error < table.rounding.max(EXACT)) {
            break;
        }
    }
    Ok(table.refined(critical.state, reached))
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
    fn push(&mut self, equations: &Equations, state: &State, fraction: f64) -> Result<(), Stuck> {
        let family = equations.leaves.family;
        let energy = family.with(fraction, equations.grid(), |leaf| leaf.energy(state))?;
        let tips = (0..state.rods()).flat_map(|j| state.tip(j).to_array());
        let segments = state.segments();
        self.tips.push(segments, tips.collect());
        self.fraction.push(segments, vec![fraction]);
        self.energy.push(segments, vec![energy]);
        Ok(())
    }

    fn refined(&self, state: State, grid: Grid) -> Refined {
        let best = self.tips.best();
        let columns = best.as_ref().map_or(0, |best| best.columns);
        let tips = self.tips.column(columns);
        let own = self.fraction.best();
        let own_columns = own.as_ref().map_or(0, |best| best.columns);
        Refined {
            fraction: self.fraction.column(own_columns)[0],
            energy: self.energy.column(columns)[0],
            tips: tips.chunks(3).map(|tip| [tip[0], tip[1], tip[2]]).collect(),
            error: best.map(|best| best.error),
            fraction_error: own.map(|best| best.error + self.rounding),
            state,
            grid,
        }
    }
}
