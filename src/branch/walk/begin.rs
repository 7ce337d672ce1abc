//! The first points of branches: the equilibrium that a relaxation found, and those beside a
//! branch point.

use crate::branch::events::critical::Critical;
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::Family;
use crate::branch::verify::regular::refine;
use crate::branch::walk::follow::Grids;
use crate::branch::{Direction, Point};
use crate::largest::larger;
use crate::leaf::{DiscreteLeaf, Grid, System};
use crate::relax::transfer::prolong::prolong;
use crate::relax::{Equilibrium, Options, Work, polish, project, relax};

/// The finest grid on which the first point is sought.
const FINEST_FIRST_POINT: usize = 512;

/// Largest distance between the tips of one grid and the extrapolated ones, relative to
/// the length.
const SAME_LEAF: f64 = 0.02;

/// A relaxation on fewer segments counts as one on this many.
const COARSEST: usize = 8;

/// Distances from the branch point at which the other branch is sought, in this order.
const AWAY: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];

/// Where the first of these distances leads out of the range of the parameter, it is shortened by
/// this factor, fewer times than that.
const NEARER: f64 = 0.3;
const NEARER_TRIES: i32 = 8;

/// Fractions of the range by which a point may be beyond an end of it, due to rounding.
const WITHIN: f64 = 1e-12;

/// The first point of a branch and its grid: the equilibrium `rest` at this `fraction`, found with
/// these `options`; on a grid of at least `segments` segments, or, if none is given, on
/// the first one, at least twice as fine as the stations of the relaxation, on which the index
/// is that of `rest`.
///
/// # Errors
/// The failure on the finest grid, if Newton's method converges on none.
pub fn begin<'a>(
    family: &'a Family<'a>,
    (rest, fraction): (&Equilibrium, f64),
    options: &Options,
    segments: Option<usize>,
) -> Result<(Grids<'a>, Point), Stuck> {
    let coarsest = (rest.shape.stations.len() - 1).max(COARSEST);
    let least = segments.unwrap_or(2 * coarsest);
    let rest_at = (rest, fraction);
    search(family, rest_at, least, segments.is_some()).or_else(|stuck| {
        // Interpolation between the stations may be too inaccurate: relax once more, on the
        // finest grid alone, and begin there.
        let finest = rest.accuracy.segments.iter().max().copied();
        let options = Options {
            method: options.method.on_grid(finest),
            ..options.clone()
        };
        let alone = relax(&family.scenario([fraction])?, &options, &mut |_| {});
        let Ok(alone) = alone else {
            return Err(stuck);
        };
        let mut tips = rest.tips.iter().zip(&alone.tips);
        let near = SAME_LEAF * family.scale().length;
        match tips.all(|(a, b)| a.distance(*b) < near) {
            true => search(
                family,
                (&alone, fraction),
                alone.shape.stations.len() - 1,
                true,
            ),
            false => Err(stuck),
        }
    })
}

/// The first point on a grid of at least `least` segments; of any index, or on the first grid
/// with the index of `rest`.
fn search<'a>(
    family: &'a Family<'a>,
    (rest, fraction): (&Equilibrium, f64),
    least: usize,
    any_index: bool,
) -> Result<(Grids<'a>, Point), Stuck> {
    let leaf = &family.leaf([fraction])?;
    let mut grid = Grid::through(&rest.shape.stations, leaf.kinks());
    let mut discrete = DiscreteLeaf::new(leaf, grid.clone());
    let mut state = project(leaf, &discrete, &rest.shape.rods);
    let mut found = Err(Stuck::NotConverged);
    loop {
        if grid.segments() >= least {
            let mut grids = Grids::new(family, grid.clone());
            let point = grids
                .of(&state)
                .correct(&state, fraction, None)
                .or_else(|_| {
                    let mut system = System::new(&discrete);
                    polish(&discrete, &mut state, &mut system, &mut Work::default());
                    grids.of(&state).correct(&state, fraction, None)
                });
            match point {
                Ok(point) => {
                    let same = Some(point.index) == rest.stability.negative_eigenvalues;
                    found = Ok((grids, point));
                    if same || any_index {
                        return found;
                    }
                }
                Err(stuck) if found.is_err() => found = Err(stuck),
                Err(_) => {}
            }
            if grid.segments() >= FINEST_FIRST_POINT {
                return found.and(Err(Stuck::BesideBifurcation));
            }
        }
        state = prolong(&discrete, &state);
        grid = grid.refined();
        discrete = DiscreteLeaf::new(leaf, grid.clone());
    }
}

/// The first points of the branches that cross at `critical` in the plane of
/// the first of its neutral modes, one on either side: as near as possible, but so far from the
/// branch point that finer grids have them too, with this accuracy of their tips. A side is
/// missing where its branch leaves the range of the parameter at once.
pub fn switch(equations: &mut Equations, critical: &Critical, accuracy: f64) -> Vec<Point> {
    let across = critical.across(equations);
    [across.clone(), across.reversed()]
        .iter()
        .filter_map(|direction| first_beside(equations, critical, direction, accuracy))
        .collect()
}

/// The first point of the branch that leaves a branch point in this direction, within the range.
fn first_beside(
    equations: &mut Equations,
    critical: &Critical,
    direction: &Direction,
    accuracy: f64,
) -> Option<Point> {
    let (family, grid) = (equations.leaves.family, equations.grid().clone());
    let mut at = |away: f64| {
        let point = critical.beside(equations, direction, away).ok()?;
        let beyond = larger(-point.fraction, point.fraction - 1.0);
        (beyond <= WITHIN).then_some(point)
    };
    let mut nearest = None;
    for (k, away) in AWAY.into_iter().enumerate() {
        let Some(point) = at(away) else {
            if k == 0 {
                // Over a short range the parameter changes by more than all of it there.
                let nearer = (1..NEARER_TRIES).map(|k| away * NEARER.powi(k));
                let found = nearer.into_iter().find_map(&mut at);
                if found.is_some() {
                    return found;
                }
            }
            continue;
        };
        if refine(family, &grid, &point, accuracy).is_ok() {
            return Some(point);
        }
        nearest = nearest.or(Some(point));
    }
    nearest
}
