//! Points of a boundary on finer and finer grids: extrapolated and thereby verified.
//!
//! A point of a boundary, extrapolated over finer and finer grids.

use crate::branch::boundary::continuation::{Special, locate_near};
use crate::branch::boundary::singular_point::{
    Direction, Manifold, Plane, Search, SingularPoint, Solution,
};
use crate::branch::boundary::{manifold_on_coarser, manifold_on_finer};
use crate::branch::critical::Kind;
use crate::branch::equations::Stuck;
use crate::branch::family::stiffest_condensed;
use crate::branch::refine::{CUBIC, Doubt, FINER, NEARLY_RIGID, PARABOLA, SOFTENINGS};
use crate::leaf::{Grid, State};
use crate::newton::Contraction;
use crate::numbers::larger;
use crate::relax::accuracy::Level;
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::{predict, weights};
use glam::DVec3;

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

/// Amplification of rounding errors by extrapolation to zero softening: the root of the sum of
/// the squares of its weights.
const AMPLIFIED: f64 = 8.3;

/// Largest amplification of iteration errors by extrapolation.
const KEPT: f64 = 2.0;

/// A point of a boundary extrapolated to zero segment length.
#[derive(Clone, Debug)]
pub struct Verified {
    /// Both parameters, as fractions of their ranges, and bounds on their errors.
    pub params: [f64; 2],
    pub errors: [f64; 2],
    /// Tips of all rods, in the family's units, and a bound on their error.
    pub tips: Vec<DVec3>,
    pub error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// The direction across the boundary on the manifold, to where more eigenvalues are negative.
    pub across: Direction,
    /// The nodes as fractions of the length.
    pub stations: Vec<f64>,
    pub kind: Kind,
    pub special: Option<Special>,
    /// Morse indices where the first parameter is smaller and where it is larger; at a fold,
    /// of the two branches that meet there.
    pub indices: [usize; 2],
    /// Matrices factorised for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Both parameters at a point on a grid.
#[derive(Default)]
pub struct Parameters {
    pub values: [f64; 2],
    /// Compliance by which the matrix was softened, in units of L^2/A, and the error of the
    /// extrapolation to zero.
    pub softening: f64,
    pub errors: [f64; 2],
}

impl Parameters {
    /// Without softening.
    pub fn of(values: [f64; 2]) -> Self {
        Parameters {
            values,
            ..Parameters::default()
        }
    }
}

/// The values to be extrapolated.
#[derive(Default)]
pub struct Table {
    pub tips: Richardson,
    numbers: [Richardson; 2],
    /// The parameter that is fixed on all grids, if there is one, and its value.
    given: Option<(usize, f64)>,
    /// Errors of the parameters due to rounding of the matrix on a grid, and their amplification
    /// by extrapolation to zero softening.
    rounded: [f64; 2],
    amplified: f64,
    /// Errors of the parameters due to softening.
    softened: [f64; 2],
    /// Largest iteration error of Newton's method.
    pub iteration_error: f64,
}

impl Table {
    pub fn new(given: Option<(usize, f64)>) -> Self {
        Table {
            given,
            amplified: 1.0,
            ..Table::default()
        }
    }

    /// Errors of the parameters due to rounding of a matrix with so much softening, on so many
    /// segments; `along` is the derivative of the vanishing function along the boundary.
    pub fn rounding(
        &self,
        manifold: &mut Manifold,
        (point, along): (&SingularPoint, Option<f64>),
        softening: f64,
        segments: f64,
    ) -> Result<[f64; 2], Stuck> {
        let (across, slope) = match self.given {
            Some((which, _)) => point.across_at(manifold, which),
            None => (point.normal.clone(), point.slope),
        };
        let leaf = manifold.leaves.at(point.solution.params)?;
        let stiffest = stiffest_condensed(leaf).min(1.0 / softening);
        let rounding = f64::EPSILON * stiffest * segments * segments;
        Ok([0, 1].map(|i| {
            let own = (rounding / slope * across.params[i]).abs();
            let along = along.map_or(0.0, |slope| rounding / slope * point.tangent.params[i]);
            own + along.abs()
        }))
    }

    pub fn push(
        &mut self,
        manifold: &mut Manifold,
        (point, along): (&SingularPoint, Option<f64>),
        numbers: &Parameters,
    ) -> Result<(), Stuck> {
        let state = &point.solution.state;
        let segments = state.segments() as f64;
        let rounding = self.rounding(manifold, (point, along), numbers.softening, segments)?;
        if numbers.softening > 0.0 {
            self.amplified = AMPLIFIED;
        }
        for i in 0..2 {
            self.rounded[i] = larger(self.rounded[i], rounding[i]);
            self.softened[i] = larger(self.softened[i], numbers.errors[i]);
        }
        let tips = state.tips().flat_map(|tip| tip.to_array());
        self.tips.push(state.segments(), tips.collect());
        for (table, number) in self.numbers.iter_mut().zip(numbers.values) {
            table.push(state.segments(), vec![number]);
        }
        Ok(())
    }

    pub fn errors(&self) -> [f64; 2] {
        [0, 1].map(|i| match self.given_value(i) {
            Some(_) => 0.0,
            None => (self.numbers[i].best()).map_or(f64::INFINITY, |best| best.error),
        })
    }

    /// The value of a parameter, if it is fixed.
    fn given_value(&self, i: usize) -> Option<f64> {
        let given = self.given.filter(|(which, _)| *which == i);
        given.map(|(_, value)| value)
    }

    /// Whether the errors of both parameters are below this, or below rounding.
    pub fn is_exact(&self, enough: f64) -> bool {
        let mut errors = self.errors().into_iter().zip(self.rounded);
        errors.all(|(error, rounded)| error <= enough.max(rounded))
    }

    pub fn verified(
        &self,
        manifold: &Manifold,
        point: &SingularPoint,
        special: Option<Special>,
    ) -> Verified {
        let tips = self.tips.extrapolated();
        let errors = self.errors();
        let number =
            |i: usize| (self.given_value(i)).unwrap_or_else(|| self.numbers[i].extrapolated()[0]);
        let (beyond, below) = (point.index, point.index.saturating_sub(point.neutral));
        let forward = match point.kind {
            Kind::Branching => {
                let (across, slope) = point.across_at(manifold, 1);
                slope * across.params[0] > 0.0
            }
            Kind::Fold => true,
        };
        Verified {
            params: [number(0), number(1)],
            errors: [0, 1].map(|i| match self.given_value(i) {
                Some(_) => 0.0,
                None => {
                    let rounded = self.amplified * self.rounded[i];
                    errors[i] + self.softened[i] + rounded + KEPT * self.iteration_error
                }
            }),
            tips: tips.chunks(3).map(DVec3::from_slice).collect(),
            // No tip is more accurate than machine precision.
            error: (self.tips.best()).map_or(f64::INFINITY, |best| {
                best.error + KEPT * self.iteration_error + f64::EPSILON
            }),
            state: point.solution.state.clone(),
            across: point.normal.clone(),
            stations: manifold.grid().sigma().to_vec(),
            kind: point.kind,
            special,
            indices: match forward {
                true => [below, beyond],
                false => [beyond, below],
            },
            factorizations: 0,
        }
    }
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
