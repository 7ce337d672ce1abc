//! Branch switching at a branch point.

use super::critical::Critical;
use super::equations::{Equations, Stuck, reversed};
use super::refine::refine;
use super::{Point, Tangent};

/// Distances from the branch point at which the other branch is sought, in this order.
const AWAY: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];

/// The first points of the branches that cross at `critical` in the plane of
/// the first of its neutral modes, one on either side: as near as possible, but so far from the
/// branch point that finer grids have them too, with this accuracy of their tips.
pub fn switch(equations: &mut Equations, critical: &Critical, accuracy: f64) -> Vec<Point> {
    let across = critical.across(equations);
    let (family, grid) = (equations.leaves.family, equations.grid().clone());
    [across.clone(), reversed(across)]
        .iter()
        .filter_map(|direction| {
            let mut nearest = None;
            for away in AWAY {
                let Ok(point) = first_point(equations, critical, direction, away) else {
                    continue;
                };
                if refine(family, &grid, &point, accuracy).is_ok() {
                    return Some(point);
                }
                nearest = nearest.or(Some(point));
            }
            nearest
        })
        .collect()
}

fn first_point(
    equations: &mut Equations,
    critical: &Critical,
    direction: &Tangent,
    away: f64,
) -> Result<Point, Stuck> {
    let increments = &direction.increments;
    let fraction = critical.fraction + away * direction.fraction;
    let state = equations.moved(&critical.state, fraction, increments, away)?;
    equations.correct(&state, fraction, Some(direction))
}
