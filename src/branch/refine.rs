//! Regular points of a branch on finer and finer grids.

use super::equations::{Equations, Plane, Stuck, reversed};
use super::family::Family;
use super::field::{at_same_nodes, prolong as prolong_field};
use super::refined::{Doubt, Refined, Table, Values, looked_at};
use super::states::DIFFERENCE;
use super::{Point, Tangent};
use crate::leaf::{DiscreteLeaf, Grid};
use crate::relax::prolong::prolong;
use glam::DVec3;

/// Grids of a point at most, and segments of the finest.
pub(super) const GRIDS: usize = 6;
pub(super) const FINEST: usize = 4096;

/// From grid to grid a point moves by less and less, if by more than this (lengths).
pub(super) const STILL: f64 = 1e-4;

/// Tangents on two grids that differ by more than this (cosine) are those of two
/// branches.
const SAME_WAY: f64 = 0.85;

/// A point is sought where the leaf has gone the same way on all grids, since
/// each has its own critical parameters. But at the same parameter at the ends of
/// its range, and where the branch goes at least this much along it alone.
const ALONG: f64 = 0.995;

/// Grids in a row that have the same index, where it alone matters.
const AGREEING: usize = 3;

/// Where on a branch a point of it is, the same on all grids.
enum Place {
    /// Where the parameter is what it is.
    Value,
    /// Where the leaf has gone so far along the branch: the shifts and turns of the
    /// nodes of the grid on which it was found, and of no others, lest the distance
    /// depend on how states are interpolated.
    Plane(Plane),
}

impl Place {
    fn plane(equations: &Equations, point: &Point) -> Self {
        let way = equations.normalised(Tangent {
            increments: point.tangent.increments.clone(),
            fraction: 0.0,
        });
        Place::Plane(Plane {
            dual: equations.momentum(&way.increments),
            own: 0.0,
            through: Some(point.state.clone()),
        })
    }

    /// The same on the grid with all segments halved.
    fn refine(&mut self, leaf: &DiscreteLeaf) {
        if let Place::Plane(plane) = self {
            plane.dual = at_same_nodes(&plane.dual);
            plane.through = plane.through.as_ref().map(|state| prolong(leaf, state));
        }
    }

    fn as_plane(&self) -> Option<&Plane> {
        match self {
            Place::Value => None,
            Place::Plane(plane) => Some(plane),
        }
    }
}

/// Whether the branch goes along the parameter alone, or may not leave it.
fn goes_along(point: &Point) -> bool {
    let inside = point.fraction != 0.0 && point.fraction != 1.0;
    !inside || point.tangent.fraction.abs() >= ALONG
}

/// A point on the grid with all segments halved, with the equations there: in the same
/// plane, unless the branch goes along the parameter alone.
pub fn on_finer<'a>(
    equations: &mut Equations<'a>,
    point: &Point,
) -> Result<(Equations<'a>, Point), Stuck> {
    let mut place = match goes_along(point) {
        true => Place::Value,
        false => Place::plane(equations, point),
    };
    let finer = in_place(equations, point, &mut place)?;
    Ok((finer.equations, finer.point))
}

/// A point on the next finer grid.
struct Finer<'a> {
    equations: Equations<'a>,
    point: Point,
    /// The tangent on the grid before, on this one.
    tangent: Tangent,
    /// By how much it moved.
    moved: f64,
}

/// A point in its place on the grid with all segments halved.
fn in_place<'a>(
    equations: &mut Equations<'a>,
    point: &Point,
    place: &mut Place,
) -> Result<Finer<'a>, Stuck> {
    let leaf = equations.leaves.at(point.fraction)?;
    let guess = prolong(leaf, &point.state);
    place.refine(leaf);
    let mut equations = equations.refined()?;
    let tangent = equations.normalised(Tangent {
        increments: prolong_field(&point.tangent.increments),
        ..point.tangent
    });
    let found = equations.correct_within(&guess, point.fraction, place.as_plane())?;
    let (mut found, _) = found;
    if equations.along(&found.tangent, &tangent) < 0.0 {
        found.tangent = reversed(found.tangent);
    }
    Ok(Finer {
        moved: guess.shift_to(&found.state),
        point: found,
        tangent,
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
    match goes_along(point) {
        true => refine_in(family, grid, point, accuracy, false),
        false => refine_in(family, grid, point, accuracy, true)
            .or_else(|_| refine_in(family, grid, point, accuracy, false)),
    }
}

/// The same where the parameter is what it is.
pub fn refine_at(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    refine_in(family, grid, point, accuracy, false)
}

/// The Morse index of a point at its parameter, which so many grids in a row have, each with
/// half of the segments of the one before; on all of them it must be the same point.
pub fn index_at(equations: &mut Equations, point: &Point) -> Result<usize, Doubt> {
    let (mut moved, mut same, mut index) = (f64::INFINITY, 1, point.index);
    let mut finer = in_place(equations, point, &mut Place::Value)?;
    for _ in 1..GRIDS {
        let along = finer.equations.along(&finer.point.tangent, &finer.tangent);
        if along < SAME_WAY || finer.moved > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
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
        finer = in_place(&mut finer.equations, &finer.point, &mut Place::Value)?;
    }
    Err(Doubt::OtherIndex)
}

fn refine_in(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
    in_plane: bool,
) -> Result<Refined, Doubt> {
    let mut table = Table::default();
    let mut equations = Equations::new(family, grid.clone())?;
    let mut place = match in_plane {
        true => Place::plane(&equations, point),
        false => Place::Value,
    };
    let values = Values::of(&mut equations, &point.state, point.fraction)?;
    table.push(grid.segments(), values);
    let mut now = point.clone();
    let mut moved = f64::INFINITY;
    for _ in 1..GRIDS {
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
        let finer = in_place(&mut equations, &now, &mut place)?;
        equations = finer.equations;
        let same = equations.along(&finer.point.tangent, &finer.tangent);
        if same < SAME_WAY || finer.moved > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
        }
        if finer.point.index != point.index {
            return Err(Doubt::OtherIndex);
        }
        moved = finer.moved;
        now = finer.point;
        let values = Values::of(&mut equations, &now.state, now.fraction)?;
        table.push(equations.grid().segments(), values);
        table.slope = Some(slope(&mut equations, &now)?);
        if table.error() <= accuracy {
            return Ok(table.refined(now.state, equations.grid().clone()));
        }
    }
    Err(Doubt::Inaccurate)
}

/// Change of a point's values with the parameter: points go as the tangent; the energy,
/// stationary in the state, as the work of what varies; the reaction as on the states
/// beside it.
fn slope(equations: &mut Equations, point: &Point) -> Result<Values, Stuck> {
    let tangent = &point.tangent;
    let mut energy = |step: f64| {
        let at = point.fraction + step;
        let leaf = equations
            .leaves
            .at(at)
            .map(|leaf| (at, leaf.energy(&point.state)));
        leaf.ok()
    };
    // At an end of the range there may be nothing beyond.
    let here = energy(0.0);
    let (after, before) = (energy(DIFFERENCE).or(here), energy(-DIFFERENCE).or(here));
    let (after, before) = after.zip(before).ok_or(Stuck::NotConverged)?;
    let reaction = reaction_rate(equations, point)?;
    let leaf = equations.leaves.at(point.fraction)?;
    let nodes = looked_at(leaf, leaf.segments());
    let ways = nodes.flat_map(|i| tangent.increments.iter().map(move |rod| &rod[i - 1]));
    Ok(Values {
        points: ways
            .flat_map(|way| [3, 4, 5].map(|c| way[c] / tangent.fraction))
            .collect(),
        fraction: 1.0,
        energy: (after.1 - before.1) / (after.0 - before.0),
        reaction,
    })
}

/// Change of the force that the holder of the tips feels with the parameter.
fn reaction_rate(equations: &mut Equations, point: &Point) -> Result<DVec3, Stuck> {
    if equations.leaves.at(point.fraction)?.leaf.held.is_none() {
        return Ok(DVec3::ZERO);
    }
    let tangent = &point.tangent;
    let mut beside = |step: f64| {
        let at = point.fraction + step;
        let way = step / tangent.fraction;
        let state = equations.moved(&point.state, at, &tangent.increments, way)?;
        Ok((at, equations.leaves.at(at)?.reaction(&state).0))
    };
    let [after, before] = [DIFFERENCE, -DIFFERENCE].map(|step| {
        // At an end of the range there may be nothing beyond.
        beside(step).or_else(|_: Stuck| beside(0.0))
    });
    let ((after, force), (before, force_before)) = (after?, before?);
    Ok((force - force_before) / (after - before))
}
