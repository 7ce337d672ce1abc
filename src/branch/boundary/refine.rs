//! Points of a boundary on finer and finer grids: extrapolated and thereby verified.

use super::grids::{manifold_on_coarser, manifold_on_finer};
use super::manifold::{Manifold, Plane, Solution};
use super::search::Search;
use super::singular_point::SingularPoint;
use super::special::{Special, locate_near};
use super::table::{Parameters, Table, Verified};
use crate::branch::events::critical::Kind;
use crate::branch::problem::equations::Stuck;
use crate::branch::verify::critical::{CUBIC, FINER, NEARLY_RIGID, PARABOLA, SOFTENINGS};
use crate::branch::verify::refined::Doubt;
use crate::largest::larger;
use crate::leaf::Grid;
use crate::newton::Contraction;
use crate::relax::transfer::level::Level;
use crate::relax::transfer::predict::{predict, weights};

/// Least and largest number of grids of a point, that of a nearly rigid leaf, and segments of
/// the finest grid.
const FEWEST: usize = 3;
const GRIDS: usize = 6;
const RIGID: usize = 4;
const FINEST: usize = 4096;

/// Displacements from grid to grid must decrease, unless below this (lengths).
const STILL: f64 = 1e-4;

/// Largest error of the tips (lengths) of a point whose parameters are known.
const NEUTRAL_TIPS: f64 = 1e-3;

/// Largest iteration error of Newton's method on a grid, as a part of the error allowed.
const LEFT: f64 = 1e-3;

/// Parameters with errors below this part of their ranges are exact.
const EXACT: f64 = 1e-12;

/// First compliance by which matrices of nearly rigid leaves are softened, and the largest ratio
/// of the errors of successive, smaller ones.
const FIRST_SOFTENING: f64 = 1e-3;
const LESS: f64 = 0.5;

/// Accuracy of a point on its grid, as a part of the ranges, and the largest distance from the
/// initial guess of the previous grid.
const ACCURACY: f64 = 1e-13;
const NEAR: f64 = 0.5;

/// Least angle (its sine) between the boundary and the line on which its point is sought, and the
/// least derivative of one parameter along the boundary relative to the other.
const SINE: f64 = 0.3;
const PART: f64 = 0.1;

/// Required accuracy of points: of their tips, and of both parameters as parts of their ranges.
#[derive(Clone, Copy, Debug)]
pub struct Accuracy {
    pub tips: f64,
    pub numbers: f64,
    /// That of the parameters for which further grids are tried.
    pub sought: f64,
}

impl Accuracy {
    /// Whether errors of the tips and of the parameters are small enough, on the `last` grid or on
    /// one after which there are others; `exact`: whether the parameters are as sought.
    fn is_reached(&self, tips: f64, numbers: [f64; 2], (exact, last): (bool, bool)) -> bool {
        match last {
            false => tips <= self.tips && exact,
            true => {
                tips <= larger(self.tips, NEUTRAL_TIPS)
                    && (exact || larger(numbers[0], numbers[1]) <= self.numbers)
            }
        }
    }
}

/// A point to be verified.
#[derive(Clone, Debug)]
pub struct Step {
    /// Where it is on a grid.
    pub point: SingularPoint,
    pub special: Option<Special>,
    /// The parameter that is fixed: at an end of its range.
    pub given: Option<usize>,
}

/// Verifies a point on as many grids as necessary; they must agree on index and
/// branch. For a nearly rigid leaf, whose matrix loses more digits on finer grids, starting from
/// coarser ones if possible.
pub fn refine(
    plane: &Plane,
    grid: &Grid,
    step: &Step,
    accuracy: Accuracy,
) -> Result<Verified, Doubt> {
    let rigid = Manifold::new(plane, grid.clone())
        .leaves
        .at(step.point.solution.params)?
        .least_compliance();
    if rigid * NEARLY_RIGID < 1.0
        && let Some((grid, point)) = manifold_on_coarser(plane, grid, &step.point)
    {
        let step = Step {
            point,
            ..step.clone()
        };
        if let Ok(verified) = refine(plane, &grid, &step, accuracy) {
            return Ok(verified);
        }
    }
    refine_from(plane, grid, step, accuracy)
}

/// The same, starting from this grid.
fn refine_from(
    plane: &Plane,
    grid: &Grid,
    step: &Step,
    accuracy: Accuracy,
) -> Result<Verified, Doubt> {
    let mut manifold = Manifold::new(plane, grid.clone());
    let mut near = step.point.clone();
    let given = step.given.or_else(|| given_at(&manifold, &near));
    let given = given.filter(|_| step.special.is_none());
    let mut table = Table::new(given.map(|which| (which, near.solution.params[which])));
    let (mut moved, mut factorizations) = (f64::INFINITY, 0);
    let mut contraction = Contraction::default();
    let (mut levels, mut params) = (Vec::<Level>::new(), Vec::new());
    let enough = accuracy.sought.max(EXACT);
    let mut softening = None;
    for level in 0..GRIDS {
        if level > 0 {
            (manifold, near) = manifold_on_finer(&mut manifold, &near)?;
        }
        let mut start = near.solution.clone();
        let believed = table.tips.best().map_or(0, |best| best.columns + 1);
        predict_spot(&levels, &params, believed, &mut start);
        let rigid =
            manifold.leaves.at(near.solution.params)?.least_compliance() * NEARLY_RIGID < 1.0;
        let (point, along) = match (step.special, rigid) {
            (None, false) => {
                let left = LEFT * enough;
                let from = (&near, &start);
                let found = newton_or_secant(&mut manifold, from, given, left, &mut contraction)?;
                table.iteration_error = larger(table.iteration_error, found.1);
                (found.0, None)
            }
            _ => relocated(&mut manifold, &near, step.special, given)?,
        };
        factorizations += manifold.factorizations;
        let shift = near.solution.state.shift_to(&point.solution.state);
        if shift > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
        }
        if point.index != step.point.index {
            return Err(Doubt::OtherIndex);
        }
        if level > 0 {
            moved = shift;
        }
        near = point;
        levels.push(Level {
            leaf: manifold.leaves.at(near.solution.params)?.clone(),
            state: near.solution.state.clone(),
        });
        params.push(near.solution.params);
        let sought = (step.special, given);
        let numbers = match (rigid, softening) {
            (false, _) => Parameters::of(near.solution.params),
            (true, Some(known)) => unsoftened(&mut manifold, &near, sought, known)?,
            (true, None) => least_softened(&mut manifold, &near, sought, (&table, along))?,
        };
        softening = rigid.then_some(numbers.softening);
        table.push(&mut manifold, (&near, along), &numbers)?;
        if level + 1 < FEWEST {
            continue;
        }
        let exact = table.is_exact(enough);
        let last = level + 1 == if rigid { RIGID } else { GRIDS }
            || 2 * manifold.grid().segments() > FINEST;
        let tips = table.tips.best().map_or(f64::INFINITY, |best| best.error);
        if accuracy.is_reached(tips, table.errors(), (exact, last)) {
            return Ok(Verified {
                factorizations,
                ..table.verified(&manifold, &near, step.special)
            });
        }
        if last {
            break;
        }
    }
    Err(Doubt::Inaccurate)
}

/// The parameter that can be fixed while a point is sought across the boundary, if there is
/// one: the second, unless the boundary goes along the first alone.
fn given_at(manifold: &Manifold, point: &SingularPoint) -> Option<usize> {
    let [first, second] = point.tangent.params.map(f64::abs);
    let sine = |which: usize| {
        let (across, _) = point.across_at(manifold, which);
        manifold.inner(&across, &point.normal).abs()
    };
    let order = if second >= PART * first {
        [1, 0]
    } else {
        [0, 1]
    };
    let changes = point.tangent.params.map(|part| part.abs() > PART * SINE);
    order.into_iter().find(|&k| changes[k] && sine(k) > SINE)
}

/// The point on this grid, to rounding; for a crossing also the derivative of the other
/// eigenvalue along the boundary, which alone determines the position of the crossing on it.
/// (At a cusp the parameters are stationary along it.)
fn relocated(
    manifold: &mut Manifold,
    near: &SingularPoint,
    special: Option<Special>,
    given: Option<usize>,
) -> Result<(SingularPoint, Option<f64>), Stuck> {
    if let Some(special) = special {
        let (point, slope) = locate_near(manifold, near, special)?;
        return Ok((point, (special == Special::Crossing).then_some(slope)));
    }
    let found = sought(manifold, near, given).secant(manifold)?;
    Ok((near.moved(manifold, found), None))
}

/// Predicts the point on the next grid from those on at least two coarser ones: the last ones,
/// as many as are taken to follow one error series.
fn predict_spot(levels: &[Level], params: &[[f64; 2]], believed: usize, solution: &mut Solution) {
    if levels.len() < 2 {
        return;
    }
    let skipped = levels.len() - believed.clamp(2, levels.len());
    let (levels, params) = (&levels[skipped..], &params[skipped..]);
    predict(&levels.iter().collect::<Vec<_>>(), &mut solution.state);
    let segments: Vec<usize> = levels.iter().map(|it| it.leaf.segments()).collect();
    let weights = weights(&segments, solution.state.segments() as f64);
    solution.params =
        [0, 1].map(|i| (params.iter().zip(&weights).map(|(at, part)| part * at[i])).sum());
}

/// The point on this grid by Newton's method from its prediction, or by the secant method if
/// that fails; and the estimated iteration error.
fn newton_or_secant(
    manifold: &mut Manifold,
    (near, start): (&SingularPoint, &Solution),
    given: Option<usize>,
    accuracy: f64,
    contraction: &mut Contraction,
) -> Result<(SingularPoint, f64), Stuck> {
    let search = near.search(manifold, given, start.clone(), (accuracy, NEAR));
    let frozen = near.kind == Kind::Branching;
    let found = search.newton(manifold, frozen, contraction);
    let (found, left) = found.or_else(|_| {
        let search = sought(manifold, near, given);
        search.secant(manifold).map(|found| (found, 0.0))
    })?;
    Ok((near.moved(manifold, found), left))
}

/// The search for the point, starting from that on the previous grid.
fn sought(manifold: &Manifold, near: &SingularPoint, given: Option<usize>) -> Search {
    near.search(manifold, given, near.solution.clone(), (ACCURACY, NEAR))
}

/// The parameters at a point of a nearly rigid leaf on its first grid: the softening is reduced
/// until rounding errors, here or on the finest grid, exceed those of extrapolation.
fn least_softened(
    manifold: &mut Manifold,
    near: &SingularPoint,
    sought: (Option<Special>, Option<usize>),
    (table, along): (&Table, Option<f64>),
) -> Result<Parameters, Stuck> {
    let largest = |[a, b]: [f64; 2]| larger(a, b);
    let mut numbers = unsoftened(manifold, near, sought, FIRST_SOFTENING)?;
    let finest = FINER * manifold.grid().segments() as f64;
    for softening in SOFTENINGS {
        let rounding = table.rounding(manifold, (near, along), softening, finest)?;
        let left = largest(numbers.errors);
        if largest(rounding) > left {
            break;
        }
        match unsoftened(manifold, near, sought, softening) {
            Ok(better) if largest(better.errors) < LESS * left => numbers = better,
            _ => break,
        }
    }
    Ok(numbers)
}

/// The parameters at a point of a nearly rigid leaf: from matrices softened by one to four times
/// as much, extrapolated to zero.
fn unsoftened(
    manifold: &mut Manifold,
    near: &SingularPoint,
    (special, given): (Option<Special>, Option<usize>),
    softening: f64,
) -> Result<Parameters, Stuck> {
    let grid = manifold.grid().clone();
    let mut values_by_softening = [[0.0; 2]; 4];
    let mut search = sought(manifold, near, given);
    for (k, params) in values_by_softening.iter_mut().enumerate().rev() {
        let mut soft = Manifold::new(manifold.leaves.family, grid.clone());
        soft.soften(softening * (k + 1) as f64);
        search.solution = match special {
            Some(special) => {
                let solution = search.solution;
                let near = SingularPoint {
                    solution,
                    ..near.clone()
                };
                locate_near(&mut soft, &near, special)?.0.solution
            }
            None => search.secant(&mut soft)?.sample.solution,
        };
        *params = search.solution.params;
    }
    let by = |weights: [f64; 4]| {
        let sum = |i: usize| {
            weights
                .iter()
                .zip(&values_by_softening)
                .map(|(w, at)| w * at[i])
                .sum()
        };
        [0, 1].map(sum)
    };
    let (values, parabola): ([f64; 2], [f64; 2]) = (by(CUBIC), by(PARABOLA));
    Ok(Parameters {
        values,
        softening,
        errors: [0, 1].map(|i| (values[i] - parabola[i]).abs()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where no finer grid is left parameters need not be as exact as sought, but as required; the
    /// bound of the tips is theirs alone, and a last grid is not judged more strictly.
    #[test]
    fn each_error_is_compared_with_its_own_bound() {
        let accuracy = Accuracy {
            tips: 1e-2,
            numbers: 1e-5,
            sought: 1e-7,
        };
        let reached = |tips, number, last| {
            accuracy.is_reached(tips, [0.0, number], (number <= accuracy.sought, last))
        };
        assert!(reached(1e-2, 1e-7, false) && reached(1e-2, 1e-5, true));
        assert!(!reached(1e-2, 1e-6, false) && !reached(1e-2, 1e-4, true));
        assert!(!reached(2e-2, 1e-7, false) && !reached(2e-2, 1e-7, true));
    }
}
