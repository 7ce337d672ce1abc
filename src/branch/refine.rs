//! Regular points of a branch on finer and finer grids.

use super::equations::{Equations, Plane, Stuck};
use super::family::{Family, OutOfRange};
use super::field::{at_same_nodes, every_second};
use super::refined::{Doubt, Refined, Table, Values, observed_nodes};
use super::states::both_sides;
use super::{Direction, Point};
use crate::leaf::{DiscreteLeaf, Grid, State};
use crate::relax::prolong::{prolong, restrict};
use glam::DVec3;

/// Largest number of grids of a point, and of segments of the finest.
pub(super) const GRIDS: usize = 6;
pub(super) const FINEST: usize = 4096;

/// Least number of finer grids that have the branch and the index of a point.
const FINER_GRIDS: usize = 2;

/// Displacements from grid to grid must decrease, unless below this (lengths).
pub(super) const STILL: f64 = 1e-4;

/// If the cosine between the tangents on two grids is below this, they belong to different
/// branches.
const SAME_BRANCH: f64 = 0.85;

/// Each grid has its own critical parameters: a point is sought at the same displacement of
/// the leaf on all grids. But at the same parameter at the ends of its range, and
/// where the parameter's component of the tangent is at least this.
const ALONG: f64 = 0.995;

/// A point on a coarser grid that is farther away than this (lengths) is another.
const NEAR: f64 = 0.1;

/// Iterations after Newton's method has converged, and the displacement (lengths) at which they
/// end.
const FURTHER: usize = 3;
const FINISHED: f64 = 1e-12;

/// Number of consecutive grids with the same index, if only the index is wanted.
const AGREEING: usize = 3;

/// The condition that fixes a point on a branch, the same on all grids.
enum Condition {
    /// A given value of the parameter.
    Value,
    /// A given displacement along the branch, measured by the shifts and turns of the
    /// nodes of the original grid only, lest it depend on how states are interpolated.
    Plane(Plane),
}

impl Condition {
    fn plane(equations: &Equations, point: &Point) -> Self {
        let direction = equations.normalised(Direction {
            increments: point.tangent.increments.clone(),
            params: [0.0],
        });
        Condition::Plane(Plane {
            dual: equations.momentum(&direction.increments),
            own: 0.0,
            through: Some(point.state.clone()),
        })
    }

    /// The same on the grid with all segments halved.
    fn refine(&mut self, leaf: &DiscreteLeaf) {
        if let Condition::Plane(plane) = self {
            plane.dual = at_same_nodes(&plane.dual);
            plane.through = plane.through.as_ref().map(|state| prolong(leaf, state));
        }
    }

    fn as_plane(&self) -> Option<&Plane> {
        match self {
            Condition::Value => None,
            Condition::Plane(plane) => Some(plane),
        }
    }
}

/// Whether the branch goes along the parameter alone, or the point is at an end of its range.
fn along_parameter(point: &Point) -> bool {
    let inside = point.fraction != 0.0 && point.fraction != 1.0;
    !inside || point.tangent.params[0].abs() >= ALONG
}

/// A point on the grid with all segments halved, with the equations there: in the same
/// plane, or, where the branch goes along the parameter alone, at the same parameter.
pub fn on_finer<'a>(
    equations: &mut Equations<'a>,
    point: &Point,
) -> Result<(Equations<'a>, Point), Stuck> {
    let mut condition = match along_parameter(point) {
        true => Condition::Value,
        false => Condition::plane(equations, point),
    };
    let finer = on_next_grid(equations, point, &mut condition)?;
    Ok((finer.equations, finer.point))
}

/// A point on the next finer grid.
struct Finer<'a> {
    equations: Equations<'a>,
    point: Point,
    /// The tangent of the previous grid, interpolated to this one.
    tangent: Direction,
    /// Displacement from the interpolated state.
    moved: f64,
    /// Displacement by the last iteration: its error is not larger.
    unfinished: f64,
}

/// A point in a plane, or at a parameter, iterated until the displacements are below rounding,
/// as extrapolation over grids magnifies what remains; and the last displacement.
fn finished(
    equations: &mut Equations,
    (state, fraction): (&State, f64),
    plane: Option<&Plane>,
) -> Result<(Point, f64), Stuck> {
    let mut found = equations.correct_within(state, fraction, plane)?;
    let mut unfinished = f64::INFINITY;
    for _ in 0..FURTHER {
        let next = equations.correct_within(&found.state, found.fraction, plane)?;
        unfinished = found.state.shift_to(&next.state);
        found = next;
        if unfinished < FINISHED {
            break;
        }
    }
    Ok((found, unfinished))
}

/// The point under the same condition on the grid with all segments halved.
fn on_next_grid<'a>(
    equations: &mut Equations<'a>,
    point: &Point,
    condition: &mut Condition,
) -> Result<Finer<'a>, Stuck> {
    let leaf = equations.leaves.at([point.fraction])?;
    let guess = prolong(leaf, &point.state);
    condition.refine(leaf);
    let mut equations = equations.refined();
    let tangent = equations.prolonged(&point.tangent);
    let plane = condition.as_plane();
    let (mut found, unfinished) = finished(&mut equations, (&guess, point.fraction), plane)?;
    found.tangent = equations.oriented(found.tangent, &tangent);
    Ok(Finer {
        moved: guess.shift_to(&found.state),
        unfinished,
        point: found,
        tangent,
        equations,
    })
}

/// A regular point with the given accuracy of its tips, on as many grids as necessary;
/// they must agree on branch and index.
pub fn refine(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    match along_parameter(point) {
        true => refine_in(family, grid, point, accuracy, false),
        false => refine_in(family, grid, point, accuracy, true)
            .or_else(|_| refine_in(family, grid, point, accuracy, false)),
    }
}

/// The same at a given parameter.
pub fn refine_at(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    refine_in(family, grid, point, accuracy, false)
}

/// The Morse index at a given parameter on which enough successively refined grids in a row
/// agree; on all of them the point must be on the same branch.
pub fn index_at(equations: &mut Equations, point: &Point) -> Result<usize, Doubt> {
    let (mut moved, mut same, mut index) = (f64::INFINITY, 1, point.index);
    let mut finer = on_next_grid(equations, point, &mut Condition::Value)?;
    for _ in 1..GRIDS {
        let along = finer.equations.inner(&finer.point.tangent, &finer.tangent);
        if along < SAME_BRANCH || finer.moved > moved.max(STILL) {
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
        finer = on_next_grid(&mut finer.equations, &finer.point, &mut Condition::Value)?;
    }
    Err(Doubt::OtherIndex)
}

/// A point on the grid with every second node, and the condition on the next one. It adds to
/// what the series of grids tells of its order. `None` if there is no such grid, or no point near
/// on it.
fn on_coarser(
    family: &Family,
    grid: &Grid,
    point: &Point,
    in_plane: bool,
) -> Option<(usize, Values, Condition)> {
    let mut equations = Equations::new(family, grid.coarsened()?);
    let near = Point {
        state: restrict(&point.state),
        tangent: equations.normalised(Direction {
            increments: every_second(&point.tangent.increments),
            ..point.tangent
        }),
        ..point.clone()
    };
    let mut condition = match in_plane {
        true => Condition::plane(&equations, &near),
        false => Condition::Value,
    };
    let plane = condition.as_plane();
    let start = (&near.state, point.fraction);
    let (found, _) = finished(&mut equations, start, plane).ok()?;
    let along = equations.inner(&found.tangent, &near.tangent).abs();
    if along < SAME_BRANCH || near.state.shift_to(&found.state) > NEAR {
        return None;
    }
    let values = Values::of(&mut equations, &found.state, found.fraction).ok()?;
    let segments = equations.grid().segments();
    condition.refine(equations.leaves.at([point.fraction]).ok()?);
    Some((segments, values, condition))
}

fn refine_in(
    family: &Family,
    grid: &Grid,
    point: &Point,
    accuracy: f64,
    in_plane: bool,
) -> Result<Refined, Doubt> {
    let mut table = Table::of_regular_point();
    let mut equations = Equations::new(family, grid.clone());
    let mut condition = match on_coarser(family, grid, point, in_plane) {
        Some((segments, values, condition)) => {
            table.push(segments, values);
            condition
        }
        None if in_plane => Condition::plane(&equations, point),
        None => Condition::Value,
    };
    let start = (&point.state, point.fraction);
    let (mut now, unfinished) = finished(&mut equations, start, condition.as_plane())?;
    now.tangent = equations.oriented(now.tangent, &point.tangent);
    table.noise = unfinished;
    let values = Values::of(&mut equations, &now.state, now.fraction)?;
    table.push(grid.segments(), values);
    let mut moved = f64::INFINITY;
    for finer_grids in 1..GRIDS {
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
        let finer = on_next_grid(&mut equations, &now, &mut condition)?;
        equations = finer.equations;
        let same = equations.inner(&finer.point.tangent, &finer.tangent);
        if same < SAME_BRANCH || finer.moved > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
        }
        if finer.point.index != point.index {
            return Err(Doubt::OtherIndex);
        }
        moved = finer.moved;
        table.noise = table.noise.max(finer.unfinished);
        now = finer.point;
        let values = Values::of(&mut equations, &now.state, now.fraction)?;
        table.push(equations.grid().segments(), values);
        table.slope = Some(slope(&mut equations, &now)?);
        if finer_grids >= FINER_GRIDS && table.error() <= accuracy {
            return Ok(table.refined(now.state, equations.grid().clone()));
        }
    }
    Err(Doubt::Inaccurate)
}

/// Derivatives of a point's values with respect to the parameter: of points from the tangent;
/// of the energy, stationary in the state, from that of the loads; of the reaction from
/// neighbouring states.
fn slope(equations: &mut Equations, point: &Point) -> Result<Values, Stuck> {
    let tangent = &point.tangent;
    let [after, before] = both_sides(|step| {
        let at = point.fraction + step;
        let leaf = equations.leaves.at([at])?;
        Ok::<_, OutOfRange>((at, leaf.energy(&point.state)))
    })?;
    let reaction = reaction_rate(equations, point)?;
    let leaf = equations.leaves.at([point.fraction])?;
    let nodes = observed_nodes(leaf, leaf.segments());
    let displacements = nodes.flat_map(|i| tangent.increments.iter().map(move |rod| &rod[i - 1]));
    Ok(Values {
        points: displacements
            .flat_map(|node| [3, 4, 5].map(|c| node[c] / tangent.params[0]))
            .collect(),
        fraction: 1.0,
        energy: (after.1 - before.1) / (after.0 - before.0),
        reaction,
    })
}

/// Derivative of the reaction at held tips with respect to the parameter.
fn reaction_rate(equations: &mut Equations, point: &Point) -> Result<DVec3, Stuck> {
    if equations.leaves.at([point.fraction])?.leaf.held.is_none() {
        return Ok(DVec3::ZERO);
    }
    let tangent = &point.tangent;
    let [(after, force), (before, force_before)] = both_sides(|step| {
        let at = point.fraction + step;
        let length = step / tangent.params[0];
        let state = equations.advanced(&point.state, [at], &tangent.increments, length)?;
        Ok::<_, OutOfRange>((at, equations.leaves.at([at])?.reaction(&state).0))
    })?;
    Ok((force - force_before) / (after - before))
}
