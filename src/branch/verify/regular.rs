//! Regular points of a branch on finer and finer grids.

use crate::branch::problem::correct::Plane;
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::Family;
use crate::branch::problem::field::every_second;
use crate::branch::problem::states::both_sides;
use crate::branch::verify::refined::{Doubt, Refined, Table, Values, observed_nodes};
use crate::branch::{Direction, Point};
use crate::largest::larger;
use crate::leaf::{Grid, State};
use crate::relax::transfer::prolong::{prolong, restrict};

/// Largest number of grids of a point, and of segments of the finest.
pub(in crate::branch) const GRIDS: usize = 6;
pub(in crate::branch) const FINEST: usize = 4096;

/// Least number of finer grids that have the branch and the index of a point.
const FINER_GRIDS: usize = 2;

/// Displacements from grid to grid must decrease, unless below this (lengths).
pub(in crate::branch) const STILL: f64 = 1e-4;

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
    let mut plane = (!along_parameter(point)).then(|| Plane::across(equations, point));
    let finer = on_next_grid(equations, point, &mut plane)?;
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

/// The point in the same plane, or at the same parameter, on the grid with all segments halved.
fn on_next_grid<'a>(
    equations: &mut Equations<'a>,
    point: &Point,
    plane: &mut Option<Plane>,
) -> Result<Finer<'a>, Stuck> {
    let leaf = equations.leaves.at([point.fraction])?;
    let guess = prolong(leaf, &point.state);
    *plane = plane.as_ref().map(|plane| plane.refined(leaf));
    let mut equations = equations.refined();
    let tangent = equations.prolonged(&point.tangent);
    let start = (&guess, point.fraction);
    let (mut found, unfinished) = finished(&mut equations, start, plane.as_ref())?;
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
        false => refine_in(family, grid, point, accuracy, true).or_else(|doubt| {
            let other = refine_in(family, grid, point, accuracy, false);
            // Beside a fold of a finer grid that grid may have no point at this parameter.
            other.map_err(|other| match doubt {
                Doubt::OtherIndex => doubt,
                _ => other,
            })
        }),
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
    let mut finer = on_next_grid(equations, point, &mut None)?;
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
        finer = on_next_grid(&mut finer.equations, &finer.point, &mut None)?;
    }
    Err(Doubt::OtherIndex)
}

/// A point on the grid with every second node, and its plane on the next one. It adds to
/// what the series of grids tells of its order. `None` if there is no such grid, or no point near
/// on it.
fn on_coarser(
    family: &Family,
    grid: &Grid,
    point: &Point,
    in_plane: bool,
) -> Option<(usize, Values, Option<Plane>)> {
    let mut equations = Equations::new(family, grid.coarsened()?);
    let near = Point {
        state: restrict(&point.state),
        tangent: equations.normalised(Direction {
            increments: every_second(&point.tangent.increments, equations.first_node()),
            ..point.tangent
        }),
        ..point.clone()
    };
    let plane = in_plane.then(|| Plane::across(&equations, &near));
    let start = (&near.state, point.fraction);
    let (found, _) = finished(&mut equations, start, plane.as_ref()).ok()?;
    let along = equations.inner(&found.tangent, &near.tangent).abs();
    if along < SAME_BRANCH || near.state.shift_to(&found.state) > NEAR {
        return None;
    }
    let values = Values::of(&mut equations, &found.state, found.fraction).ok()?;
    let segments = equations.grid().segments();
    let leaf = equations.leaves.at([point.fraction]).ok()?;
    Some((segments, values, plane.map(|plane| plane.refined(leaf))))
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
    let mut plane = match on_coarser(family, grid, point, in_plane) {
        Some((segments, values, plane)) => {
            table.push(segments, values);
            plane
        }
        None => in_plane.then(|| Plane::across(&equations, point)),
    };
    let start = (&point.state, point.fraction);
    let (mut now, unfinished) = finished(&mut equations, start, plane.as_ref())?;
    now.tangent = equations.oriented(now.tangent, &point.tangent);
    table.noise = unfinished;
    let values = Values::of(&mut equations, &now.state, now.fraction)?;
    table.push(grid.segments(), values);
    let mut moved = f64::INFINITY;
    for finer_grids in 1..GRIDS {
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
        let finer = on_next_grid(&mut equations, &now, &mut plane)?;
        equations = finer.equations;
        let same = equations.inner(&finer.point.tangent, &finer.tangent);
        if same < SAME_BRANCH || finer.moved > moved.max(STILL) {
            return Err(Doubt::OtherBranch);
        }
        if finer.point.index != point.index {
            return Err(Doubt::OtherIndex);
        }
        moved = finer.moved;
        table.noise = larger(table.noise, finer.unfinished);
        now = finer.point;
        let values = Values::of(&mut equations, &now.state, now.fraction)?;
        table.push(equations.grid().segments(), values);
        table.slope = Some(slope(&mut equations, &now)?);
        if finer_grids >= FINER_GRIDS && table.error() <= accuracy {
            let leaf = equations.leaves.at([now.fraction])?;
            let state = leaf.leaning(&now.state).into_owned();
            return Ok(table.refined(state, equations.grid().clone()));
        }
    }
    Err(Doubt::Inaccurate)
}

/// Derivatives of a point's values with respect to the parameter: of points from the tangent;
/// of the energy, stationary in the state, from that of the loads; of the forces on holders, of
/// the energy if these may move, and of the points of a leaf that can turn, from neighbouring states.
fn slope(equations: &mut Equations, point: &Point) -> Result<Values, Stuck> {
    let tangent = &point.tangent;
    let leaf = equations.leaves.at([point.fraction])?;
    let turns = !leaf.turns(&point.state).is_empty();
    let moves = leaf.leaf.is_held() || leaf.leaf.hinged() || turns;
    let [after, before] = both_sides(|step| {
        let at = point.fraction + step;
        if !moves {
            return Ok(Values {
                points: Vec::new(),
                fraction: at,
                energy: equations.leaves.at([at])?.energy(&point.state),
                reactions: Vec::new(),
            });
        }
        let length = step / tangent.params[0];
        let state = equations.advanced(&point.state, [at], &tangent.increments, length)?;
        Values::of(equations, &state, at)
    })?;
    let way = after.fraction - before.fraction;
    let leaf = equations.leaves.at([point.fraction])?;
    let nodes = observed_nodes(leaf, leaf.segments());
    let first = leaf.first_node();
    let displacements =
        nodes.flat_map(|i| tangent.increments.iter().map(move |rod| &rod[i - first]));
    Ok(Values {
        points: match turns {
            true => (after.points.iter().zip(&before.points))
                .map(|(after, before)| (after - before) / way)
                .collect(),
            false => displacements
                .flat_map(|node| [3, 4, 5].map(|c| node[c] / tangent.params[0]))
                .collect(),
        },
        fraction: 1.0,
        energy: (after.energy - before.energy) / way,
        reactions: (after.reactions.iter().zip(before.reactions))
            .map(|(force, before)| (*force - before) / way)
            .collect(),
    })
}
