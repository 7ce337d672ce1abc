//! Equilibria at places of a plane, each reached from another one beside it.

use super::plane::Plane;
use super::sheet::Spot;
use crate::branch::Point;
use crate::branch::critical::Critical;
use crate::branch::equations::{Equations, Stuck};
use crate::branch::refine::{index_at, on_finer};
use crate::branch::refine_critical::refine_critical;
use crate::branch::refined::{Doubt, Refined};
use crate::branch::walk::{End, Walk, walk};
use crate::leaf::Grid;
use crate::scenario::Scenario;

/// The longest step, as a part of the way, and most points on it.
const LONGEST: f64 = 1.0;
const MOST: usize = 100;

/// The finest grid to go on, in segments.
const FINEST: usize = 1024;

/// The grid from which on an index is counted once more.
const RECOUNTED: usize = 256;

/// Grids of a critical point at least.
const CRITICAL_GRIDS: usize = 4;

/// An equilibrium at a place of the plane.
#[derive(Clone, Debug)]
pub struct AtRest {
    /// Where it is, on a grid.
    pub spot: Spot,
    pub grid: Grid,
    /// Morse index, by finer grids.
    pub index: usize,
}

/// What was found on the straight way from an equilibrium to another place.
#[derive(Default)]
pub struct Way {
    /// The grid on which it was gone, if it could be begun.
    pub grid: Option<Grid>,
    /// Tips of all rods along it, in the family's units.
    pub tips: Vec<Vec<[f64; 3]>>,
    /// Where the index changes on that grid; the parameter goes from 0 to 1 along it.
    pub critical: Vec<Critical>,
    /// Whether the branch turns back before its end.
    turned: bool,
    /// The equilibrium there; none where the branch turns back before, or is lost.
    pub end: Option<AtRest>,
    /// Matrices factorised on the way.
    pub factorizations: usize,
}

/// The straight way between two places of a plane.
type Between<'p> = dyn Fn(f64) -> Result<Scenario, String> + Sync + 'p;

fn between<'p>(plane: &'p Plane, [from, to]: [[f64; 2]; 2]) -> Box<Between<'p>> {
    Box::new(move |part: f64| {
        let at = |i: usize| match part {
            1.0 => to[i],
            _ => from[i] + part * (to[i] - from[i]),
        };
        (plane.make)(plane.values([at(0), at(1)]))
    })
}

/// Follows the branch through an equilibrium along the straight way to another place, by
/// arclength, as long as it does not turn back; what is there counts if three finer grids
/// in a row have it with the same index. Where they have none, or that is not the index on
/// the grid of the way, this is too coarse, and the way is gone once more on a finer one.
pub fn go(plane: &Plane, from: &AtRest, to: [f64; 2]) -> Way {
    let make = between(plane, [from.spot.place, to]);
    let family = plane.family.along(&*make);
    let mut way = Way::default();
    let Ok(family) = family else { return way };
    let equations = Equations::new(&family, from.grid.clone());
    let first = equations.map_err(Stuck::from).and_then(|mut equations| {
        let (first, _) = equations.correct(&from.spot.state, 0.0, None)?;
        Ok((equations, first))
    });
    let Ok((mut equations, mut first)) = first else {
        return way;
    };
    loop {
        let last = follow(&mut equations, &first, &mut way);
        let index = last
            .as_ref()
            .and_then(|it| index_at(&mut equations, it).ok());
        let finer = 2 * first.state.segments() <= FINEST;
        if let (Some(last), Some(index)) = (last, index)
            && (index == last.index || !finer)
        {
            way.end = Some(AtRest {
                spot: Spot {
                    state: last.state,
                    place: to,
                },
                grid: equations.grid().clone(),
                index,
            });
            return way;
        }
        match on_finer(&mut equations, &first) {
            Ok(on_finer) if finer && !way.turned => (equations, first) = on_finer,
            _ => return way,
        }
    }
}

/// The index of an equilibrium counted once more, on fine grids alone; none if they do not have
/// it, or do not agree.
pub fn recount(plane: &Plane, at: &AtRest) -> Option<usize> {
    let make = between(plane, [at.spot.place; 2]);
    let family = plane.family.along(&*make).ok()?;
    let mut equations = Equations::new(&family, at.grid.clone()).ok()?;
    let (mut point, _) = equations.correct(&at.spot.state, 0.0, None).ok()?;
    while point.state.segments() < RECOUNTED {
        (equations, point) = on_finer(&mut equations, &point).ok()?;
    }
    index_at(&mut equations, &point).ok()
}

/// The point at the end of the way on this grid, if the branch comes there.
fn follow(equations: &mut Equations, first: &Point, way: &mut Way) -> Option<Point> {
    let mut first = first.clone();
    first.tangent = first.tangent.towards(true);
    let turned = |points: &[Point]| points[points.len() - 1].tangent.fraction < 0.0;
    let how = Walk {
        enough: Some(&turned),
        ..Walk::new(LONGEST, MOST)
    };
    let before = equations.factorizations;
    let branch = walk(equations, first, &how, &mut |_, _| {});
    way.factorizations += equations.factorizations - before;
    way.grid = Some(equations.grid().clone());
    way.tips = branch.points.iter().map(tips).collect();
    way.critical = branch.critical.into_iter().map(|(_, it)| it).collect();
    way.turned = matches!(branch.end, Some(End::Enough | End::Returned));
    match branch.end {
        Some(End::Reached) if branch.missed.is_empty() => branch.points.last().cloned(),
        _ => None,
    }
}

fn tips(point: &Point) -> Vec<[f64; 3]> {
    let state = &point.state;
    (0..state.rods()).map(|j| state.tip(j).to_array()).collect()
}

/// A critical point on the way from a place to another without the error of its grid.
pub fn refine_on(
    plane: &Plane,
    ends: [[f64; 2]; 2],
    grid: &Grid,
    critical: &Critical,
    accuracy: f64,
) -> Result<Refined, Doubt> {
    let make = between(plane, ends);
    let family = plane.family.along(&*make)?;
    refine_critical(&family, grid, critical, accuracy, CRITICAL_GRIDS)
}
