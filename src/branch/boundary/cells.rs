//! Equilibria at points of the parameter plane, each continued from a neighbouring one.

use glam::DVec3;

use super::manifold::{Plane, Solution};
use crate::branch::Point;
use crate::branch::events::critical::Critical;
use crate::branch::problem::equations::Equations;
use crate::branch::verify::critical::refine_critical;
use crate::branch::verify::refined::{Doubt, Refined};
use crate::branch::verify::regular::{index_at, on_finer};
use crate::branch::walk::steps::{End, Walk, walk};
use crate::leaf::Grid;
use crate::scenario::Scenario;

/// The longest step, as a part of the path, and the largest number of points on it.
const LONGEST: f64 = 1.0;
const MOST: usize = 100;

/// The finest grid for repeating a path, in segments.
const FINEST: usize = 1024;

/// Segments of the coarsest grid for counting an index again.
const RECOUNTED: usize = 256;

/// Least number of grids for a critical point.
const CRITICAL_GRIDS: usize = 4;

/// An equilibrium at a point of the parameter plane.
#[derive(Clone, Debug)]
pub struct AtRest {
    /// State and parameters on a grid, and that grid.
    pub solution: Solution,
    pub grid: Grid,
    /// Morse index, confirmed on finer grids.
    pub index: usize,
}

/// What was found on the straight path from an equilibrium to another point of the plane.
pub struct Path {
    /// The grid on which it was followed.
    pub grid: Grid,
    /// Tips of all rods along it, in the family's units.
    pub tips: Vec<Vec<DVec3>>,
    /// Its critical points on that grid; the parameter goes from 0 to 1 along the path.
    pub critical: Vec<Critical>,
    /// Whether the branch turns back before the end of the path.
    turned: bool,
    /// The equilibrium at the end; none if the branch turns back before, or is lost.
    pub end: Option<AtRest>,
    pub factorizations: usize,
}

/// The scenarios on the straight path between two points of the plane.
type Between<'p> = dyn Fn([f64; 1]) -> Result<Scenario, String> + Sync + 'p;

fn between<'p>(plane: &'p Plane, [from, to]: [[f64; 2]; 2]) -> Box<Between<'p>> {
    Box::new(move |[part]: [f64; 1]| {
        let at = |i: usize| match part {
            1.0 => to[i],
            _ => from[i] + part * (to[i] - from[i]),
        };
        plane.scenario([at(0), at(1)]).map_err(|out| out.0)
    })
}

/// Follows the branch through an equilibrium along the straight path to another point of the
/// plane, by arclength, unless it turns back. The equilibrium at the end is accepted if three
/// finer grids in a row have it with the same index. If they do not, or this is not the index
/// on the grid of the path, that grid is too coarse, and a finer one is tried.
pub fn follow_path(plane: &Plane, from: &AtRest, to: [f64; 2]) -> Path {
    let make = between(plane, [from.solution.params, to]);
    let family = plane.along_path(&*make);
    let mut path = Path {
        grid: from.grid.clone(),
        tips: Vec::new(),
        critical: Vec::new(),
        turned: false,
        end: None,
        factorizations: 0,
    };
    let Ok(family) = family else { return path };
    let mut equations = Equations::new(&family, from.grid.clone());
    let Ok(mut first) = equations.correct(&from.solution.state, 0.0, None) else {
        return path;
    };
    loop {
        let last = follow_on_grid(&mut equations, &first, &mut path);
        let index = last
            .as_ref()
            .and_then(|it| index_at(&mut equations, it).ok());
        let finer = 2 * first.state.segments() <= FINEST;
        if let (Some(last), Some(index)) = (last, index)
            && (index == last.index || !finer)
        {
            path.end = Some(AtRest {
                solution: Solution {
                    state: last.state,
                    params: to,
                },
                grid: equations.grid().clone(),
                index,
            });
            return path;
        }
        match on_finer(&mut equations, &first) {
            Ok(on_finer) if finer && !path.turned => (equations, first) = on_finer,
            _ => return path,
        }
    }
}

/// The index of an equilibrium counted again, on fine grids alone; none if they do not have
/// it, or do not agree.
pub fn recount(plane: &Plane, at: &AtRest) -> Option<usize> {
    let make = between(plane, [at.solution.params; 2]);
    let family = plane.along_path(&*make).ok()?;
    let mut equations = Equations::new(&family, at.grid.clone());
    let mut point = equations.correct(&at.solution.state, 0.0, None).ok()?;
    while point.state.segments() < RECOUNTED {
        (equations, point) = on_finer(&mut equations, &point).ok()?;
    }
    index_at(&mut equations, &point).ok()
}

/// The point at the end of the path on this grid, if the branch reaches it.
fn follow_on_grid(equations: &mut Equations, first: &Point, path: &mut Path) -> Option<Point> {
    let mut first = first.clone();
    first.tangent = first.tangent.growing();
    let turned = |points: &[Point]| points[points.len() - 1].tangent.params[0] < 0.0;
    let how = Walk {
        enough: Some(&turned),
        ..Walk::new(LONGEST, MOST)
    };
    let before = equations.factorizations;
    let branch = walk(equations, first, &how, &mut |_, _| {});
    path.factorizations += equations.factorizations - before;
    path.grid.clone_from(equations.grid());
    let tips = |point: &Point| point.state.tips().collect();
    path.tips = branch.points.iter().map(tips).collect();
    path.critical = branch.critical.into_iter().map(|(_, it)| it).collect();
    path.turned = matches!(branch.end, Some(End::Enough | End::Returned));
    match branch.end {
        Some(End::Reached) if branch.missed.is_empty() => branch.points.last().cloned(),
        _ => None,
    }
}

/// A critical point on the path between two points of the plane, extrapolated over grids.
pub fn refine_on_path(
    plane: &Plane,
    ends: [[f64; 2]; 2],
    grid: &Grid,
    critical: &Critical,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    let make = between(plane, ends);
    let family = plane.along_path(&*make)?;
    refine_critical(&family, grid, critical, accuracy, CRITICAL_GRIDS)
}
