//! Points of a boundary on finer and finer grids: extrapolated, and thereby verified.

use super::grids::{on_coarser, on_finer};
use super::place::Place;
use super::plane::Plane;
use super::search::{Found, Lost, Search};
use super::sheet::{Direction, Sheet, Spot};
use super::special::{Special, locate_near};
use super::table::{Numbers, Table, Verified};
use crate::branch::critical::Kind;
use crate::branch::refine_critical::{BY_PARABOLA, FINER, NEARLY_RIGID, SOFTENINGS, UNSOFTENING};
use crate::branch::refined::Doubt;
use crate::leaf::Grid;
use crate::newton::Contraction;
use crate::relax::level::Level;
use crate::relax::predict::{predict, weights};

/// Grids of a point at least and at most, those of a nearly rigid leaf, and segments of
/// the finest.
const FEWEST: usize = 3;
const GRIDS: usize = 6;
const RIGID: usize = 4;
const FINEST: usize = 4096;

/// From grid to grid a point moves by less and less, if by more than this (lengths).
const STILL: f64 = 1e-4;

/// Largest error of the tips (lengths) of a point that is known by its numbers.
const NEUTRAL_TIPS: f64 = 1e-3;

/// Newton's method leaves at most this part of the error that is allowed, on a grid.
const LEFT: f64 = 1e-3;

/// Numbers within this part of their ranges are exact.
const EXACT: f64 = 1e-12;

/// Compliance by which matrices of nearly rigid leaves are softened first, and the part of
/// what this leaves that a smaller one must leave at most.
const FIRST_SOFTENING: f64 = 1e-3;
const LESS: f64 = 0.5;

/// Accuracy of a point on its grid, as a part of the ranges, and how far it may lie from
/// where it is on the grid before.
const ACCURACY: f64 = 1e-13;
const NEAR: f64 = 0.5;

/// The line across the boundary leaves it at an angle of at least this (its sine), and one
/// of the numbers changes along the boundary by at least this part of the other.
const SINE: f64 = 0.3;
const PART: f64 = 0.1;

/// How accurate points are to be: their tips, and both numbers as parts of their ranges.
#[derive(Clone, Copy, Debug)]
pub struct Accuracy {
    pub tips: f64,
    pub numbers: f64,
}

/// A point to be verified.
#[derive(Clone, Debug)]
pub struct Step {
    /// Where it is on a grid.
    pub place: Place,
    /// What it is besides.
    pub special: Option<Special>,
    /// The number that is given: at the end of a range.
    pub given: Option<usize>,
}

/// A point on as many grids as it takes; on all of them it must be the same. Of a nearly
/// rigid leaf, of which fine grids know the matrix worse, beginning with coarser ones if
/// that can be.
pub fn refine(
    plane: Plane,
    grid: &Grid,
    step: &Step,
    accuracy: Accuracy,
) -> Result<Verified, Doubt> {
    let rigid = Sheet::new(plane, grid.clone())?
        .leaf(step.place.spot.place)?
        .stiffest();
    if rigid * NEARLY_RIGID < 1.0
        && let Some((grid, place)) = on_coarser(plane, grid, &step.place)
    {
        let step = Step {
            place,
            ..step.clone()
        };
        if let Ok(verified) = refine(plane, &grid, &step, accuracy) {
            return Ok(verified);
        }
    }
    refine_from(plane, grid, step, accuracy)
}

/// The same from this grid on.
fn refine_from(
    plane: Plane,
    grid: &Grid,
    step: &Step,
    accuracy: Accuracy,
) -> Result<Verified, Doubt> {
    let mut sheet = Sheet::new(plane, grid.clone())?;
    let mut near = step.place.clone();
    let given = step.given.or_else(|| given_at(&sheet, &near));
    let given = given.filter(|_| step.special.is_none());
    let mut table = Table::new(given.map(|which| (which, near.spot.place[which])));
    let (mut moved, mut factorizations) = (f64::INFINITY, 0);
    let mut contraction = Contraction::default();
    let (mut levels, mut places) = (Vec::<Level>::new(), Vec::new());
    let enough = accuracy.numbers.max(EXACT);
    let mut softening = None;
    for level in 0..GRIDS {
        if level > 0 {
            (sheet, near) = on_finer(&mut sheet, &near)?;
        }
        let mut start = near.spot.clone();
        let believed = table.tips.best().map_or(0, |best| best.columns + 1);
        predict_spot(&levels, &places, believed, &mut start);
        let rigid = sheet.leaf(near.spot.place)?.stiffest() * NEARLY_RIGID < 1.0;
        let (place, along) = match (step.special, rigid) {
            (None, false) => {
                let left = LEFT * enough;
                let from = (&near, &start);
                let found = from_near(&mut sheet, from, given, left, &mut contraction)?;
                table.left = table.left.max(found.1);
                (found.0, None)
            }
            _ => again(&mut sheet, &near, step.special, given)?,
        };
        factorizations += sheet.equations.factorizations;
        let shift = near.spot.state.shift_to(&place.spot.state);
        if shift > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
        }
        if place.index != step.place.index {
            return Err(Doubt::OtherIndex);
        }
        if level > 0 {
            moved = shift;
        }
        near = place;
        levels.push(Level {
            leaf: sheet.leaf(near.spot.place)?.clone(),
            state: near.spot.state.clone(),
        });
        places.push(near.spot.place);
        let sought = (step.special, given);
        let numbers = match (rigid, softening) {
            (false, _) => Numbers::of(near.spot.place),
            (true, Some(known)) => unsoftened(&mut sheet, &near, sought, known)?,
            (true, None) => least_softened(&mut sheet, &near, sought, (&table, along))?,
        };
        softening = rigid.then_some(numbers.softening);
        table.push(&mut sheet, (&near, along), &numbers)?;
        if level + 1 < FEWEST {
            continue;
        }
        let exact = table.is_exact(enough);
        let last =
            level + 1 == if rigid { RIGID } else { GRIDS } || 2 * sheet.grid().segments() > FINEST;
        let tips = if last { NEUTRAL_TIPS } else { accuracy.tips };
        let tips = table.tips.best().is_some_and(|best| best.error <= tips);
        let numbers = table.errors().iter().all(|error| *error <= accuracy.tips);
        if tips && (exact || last && numbers) {
            return Ok(Verified {
                factorizations,
                ..table.verified(&sheet, &near, step.special)
            });
        }
        if last {
            break;
        }
    }
    Err(Doubt::Inaccurate)
}

/// The number that may be given while a point is sought across the boundary, if there is
/// one: the second, unless the boundary goes along the first alone.
fn given_at(sheet: &Sheet, place: &Place) -> Option<usize> {
    let [first, second] = place.tangent.place.map(f64::abs);
    let sine = |which: usize| {
        let (across, _) = place.across_at(sheet, which);
        sheet.along(&across, &place.normal).abs()
    };
    let order = if second >= PART * first {
        [1, 0]
    } else {
        [0, 1]
    };
    let changes = place.tangent.place.map(|part| part.abs() > PART * SINE);
    order.into_iter().find(|&k| changes[k] && sine(k) > SINE)
}

/// The point on this grid, to rounding; of a crossing also the change of the other
/// eigenvalue along the boundary, which is all that tells where on it the crossing is. (At a
/// cusp the numbers do not change along it.)
fn again(
    sheet: &mut Sheet,
    near: &Place,
    special: Option<Special>,
    given: Option<usize>,
) -> Result<(Place, Option<f64>), Lost> {
    if let Some(special) = special {
        let (place, slope) = locate_near(sheet, near, special)?;
        return Ok((place, (special == Special::Crossing).then_some(slope)));
    }
    let found = sought(sheet, near, given).run(sheet)?;
    Ok((near.moved(sheet, found), None))
}

/// The spot on the next grid by those on coarser ones, if there are two at least: of as
/// many as are believed to be of one series.
fn predict_spot(levels: &[Level], places: &[[f64; 2]], believed: usize, spot: &mut Spot) {
    if levels.len() < 2 {
        return;
    }
    let skipped = levels.len() - believed.clamp(2, levels.len());
    let (levels, places) = (&levels[skipped..], &places[skipped..]);
    predict(&levels.iter().collect::<Vec<_>>(), &mut spot.state);
    let segments: Vec<usize> = levels.iter().map(|it| it.leaf.segments()).collect();
    let weights = weights(&segments, spot.state.segments());
    spot.place = [0, 1].map(|i| (places.iter().zip(&weights).map(|(at, part)| part * at[i])).sum());
}

/// The point on this grid from where it is predicted, if it can be found from there, and
/// what is left of its error on this grid.
fn from_near(
    sheet: &mut Sheet,
    (near, start): (&Place, &Spot),
    given: Option<usize>,
    accuracy: f64,
    contraction: &mut Contraction,
) -> Result<(Place, f64), Lost> {
    let mut owned = sought(sheet, near, given);
    let own = std::mem::replace(&mut owned.near.spot, start.clone());
    let frozen = near.kind == Kind::Branching;
    let found = owned.search(accuracy).near(sheet, frozen, contraction);
    let (found, left) = found.or_else(|_| {
        owned.near.spot = own;
        owned.run(sheet).map(|found| (found, 0.0))
    })?;
    Ok((near.moved(sheet, found), left))
}

/// How the point is sought, from where it is on the grid before.
fn sought(sheet: &Sheet, near: &Place, given: Option<usize>) -> Owned {
    let (across, slope, along) = match given {
        Some(which) => {
            let (across, slope) = near.across_at(sheet, which);
            (across, slope, sheet.number(which))
        }
        None => (near.normal.clone(), near.slope, near.tangent.clone()),
    };
    Owned {
        near: near.clone(),
        across,
        slope,
        along,
    }
}

/// A search that owns its directions.
struct Owned {
    near: Place,
    across: Direction,
    slope: f64,
    along: Direction,
}

impl Owned {
    fn run(&self, sheet: &mut Sheet) -> Result<Found, Lost> {
        self.search(ACCURACY).run(sheet)
    }

    fn search(&self, accuracy: f64) -> Search<'_> {
        Search {
            spot: &self.near.spot,
            across: &self.across,
            slope: self.slope,
            along: &self.along,
            held: &self.near.held,
            neutral: self.near.neutral,
            accuracy,
            furthest: NEAR,
        }
    }
}

/// The numbers at a point of a nearly rigid leaf on a first grid, by matrices softened less
/// and less until rounding leaves more than that, here or on a grid that is finer.
fn least_softened(
    sheet: &mut Sheet,
    near: &Place,
    sought: (Option<Special>, Option<usize>),
    (table, along): (&Table, Option<f64>),
) -> Result<Numbers, Lost> {
    let largest = |[a, b]: [f64; 2]| a.max(b);
    let mut numbers = unsoftened(sheet, near, sought, FIRST_SOFTENING)?;
    let finest = FINER * sheet.grid().segments() as f64;
    for softening in SOFTENINGS {
        let rounding = table.rounding(sheet, (near, along), softening, finest)?;
        let left = largest(numbers.left);
        if largest(rounding) > left {
            break;
        }
        match unsoftened(sheet, near, sought, softening) {
            Ok(better) if largest(better.left) < LESS * left => numbers = better,
            _ => break,
        }
    }
    Ok(numbers)
}

/// The numbers at a point of a nearly rigid leaf: by matrices softened by one to four times
/// as much, extrapolated to none.
fn unsoftened(
    sheet: &mut Sheet,
    near: &Place,
    (special, given): (Option<Special>, Option<usize>),
    softening: f64,
) -> Result<Numbers, Lost> {
    let grid = sheet.grid().clone();
    let mut places = [[0.0; 2]; 4];
    let mut owned = sought(sheet, near, given);
    for (k, place) in places.iter_mut().enumerate().rev() {
        let mut soft = Sheet::new(sheet.plane, grid.clone())?;
        soft.soften(softening * (k + 1) as f64);
        owned.near.spot = match special {
            Some(special) => locate_near(&mut soft, &owned.near, special)?.0.spot,
            None => owned.run(&mut soft)?.spot().clone(),
        };
        *place = owned.near.spot.place;
    }
    let by = |weights: [f64; 4]| {
        let sum = |i: usize| weights.iter().zip(&places).map(|(w, at)| w * at[i]).sum();
        [0, 1].map(sum)
    };
    let (values, parabola): ([f64; 2], [f64; 2]) = (by(UNSOFTENING), by(BY_PARABOLA));
    Ok(Numbers {
        values,
        softening,
        left: [0, 1].map(|i| (values[i] - parabola[i]).abs()),
    })
}

impl From<Lost> for Doubt {
    fn from(lost: Lost) -> Self {
        match lost {
            Lost::Stuck(stuck) => stuck.into(),
            Lost::Parted | Lost::Unfolded => Doubt::OtherBranch,
        }
    }
}
