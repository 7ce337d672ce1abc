//! The lowest pass from a stable leaf to another equilibrium.

use crate::branch::{Equations, Point, between, on_finer, prolong_field, times};
use crate::leaf::{Field, Grid, State};
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::prolong;
use crate::relax::solve_on_grid::settle_from;
use crate::relax::{Barrier, Neighbour, Saddle};
use crate::study::margin::{Stable, StartPoint};
use rayon::prelude::*;

/// Number of modes along which saddles are sought, in both directions.
const MODES: usize = 3;

pub(super) const MODE_CLIMBS: usize = 2 * MODES;

/// Largest number of grids for the extrapolated energy of a pass, nodes of the finest,
/// and the relative error at which it is accurate enough.
const GRIDS: usize = 7;

const MOST_NODES: usize = 20_000;

const ENOUGH: f64 = 1e-7;

/// The leaf has returned to its equilibrium within this distance, in lengths and as a part of
/// the distance to the pass.
const SAME: f64 = 1e-3;

const SAME_PART: f64 = 0.1;

/// Near a fold a coarse grid may have no pass, or another one: so often the grid is refined
/// for the search, up to so many nodes.
const HALVINGS: usize = 3;

const FEW_NODES: usize = 800;

/// Passes whose heights differ by less than this, relatively, are examined once.
const SAME_HEIGHT: f64 = 1e-6;

/// Rounding error of the difference of two energies, relative to these: for a column 0.5 % beyond
/// its Euler load it was 3.1e-13.
const ROUNDING: f64 = 5e-13;

/// A saddle on the grid on which it was found, with the stable leaf there.
struct Pass {
    grid: Grid,
    saddle: Point,
    leaf: Point,
    /// Energy of the saddle above the leaf's, dimensionless.
    height: f64,
}

/// The lowest pass found from these start points and along the softest modes; also
/// the number of start points.
pub(super) fn barrier(
    stable: &Stable,
    mut starts: Vec<StartPoint>,
    weight: f64,
) -> (Option<Barrier>, usize) {
    starts.extend(along_modes(stable).unwrap_or_default());
    let all = &stable.searches.all;
    let counted = all.load(std::sync::atomic::Ordering::Relaxed);
    let pushes = counted.saturating_sub(MODE_CLIMBS);
    all.store(pushes + starts.len(), std::sync::atomic::Ordering::Relaxed);
    let count = starts.len();
    for _ in 0..HALVINGS {
        let found = lowest(stable, &starts, weight);
        if found.is_some() || stable.limit.reached() {
            return (found, count);
        }
        let finer: Option<_> = starts.iter().map(|it| on_refined(stable, it)).collect();
        match finer {
            Some(finer) => starts = finer,
            None => return (None, count),
        }
        all.fetch_add(count, std::sync::atomic::Ordering::Relaxed);
    }
    (lowest(stable, &starts, weight), count)
}

/// The lowest pass found from these start points on their grids.
fn lowest(stable: &Stable, starts: &[StartPoint], weight: f64) -> Option<Barrier> {
    let mut passes: Vec<Pass> = (starts.par_iter())
        .filter_map(|start| {
            let pass = climb(stable, start);
            stable.searches.finish_one();
            pass
        })
        .collect();
    passes.sort_by(|a, b| a.height.total_cmp(&b.height));
    passes.dedup_by(|a, b| (a.height - b.height).abs() < SAME_HEIGHT * b.height);
    let (pass, neighbour) = passes.iter().find_map(|pass| {
        let neighbour = beyond(stable, pass)?;
        Some((pass, neighbour))
    })?;
    in_units(stable, pass, &neighbour, weight)
}

/// The same start point on the grid with all segments halved; none if it has too many nodes.
fn on_refined(stable: &Stable, start: &StartPoint) -> Option<StartPoint> {
    let mut equations = Equations::new(stable.family, start.grid.clone());
    let leaf = equations.leaves.at([0.0]).ok()?;
    (2 * leaf.rods() * leaf.segments() <= FEW_NODES).then(|| StartPoint {
        grid: start.grid.refined(),
        state: prolong(leaf, &start.state),
        direction: prolong_field(&start.direction, leaf.first_node()),
    })
}

/// Both directions along the softest modes of the leaf.
fn along_modes(stable: &Stable) -> Option<Vec<StartPoint>> {
    let mut equations = Equations::new(stable.family, stable.grid.clone());
    let point = equations.correct(&stable.state, 0.0, None).ok()?;
    let modes = equations.soft_modes(&point, MODES).ok()?;
    let start = |mode: &Field, sign: f64| StartPoint {
        grid: stable.grid.clone(),
        state: point.state.clone(),
        direction: times(mode, sign),
    };
    let both = |mode: &Field| [1.0, -1.0].map(|sign| start(mode, sign));
    Some(modes.iter().flat_map(both).collect())
}

/// Climbs to a saddle, and finds the stable leaf on the same grid.
fn climb(stable: &Stable, start: &StartPoint) -> Option<Pass> {
    let mut equations = Equations::new(stable.family, start.grid.clone());
    let stop = || stable.limit.reached();
    let saddle = equations.climb(&start.state, 0.0, &start.direction, &stop)?;
    let mut own = Equations::new(stable.family, stable.grid.clone());
    let mut leaf = own.correct(&stable.state, 0.0, None).ok()?;
    while own.grid().segments() < start.grid.segments() {
        (own, leaf) = on_finer(&mut own, &leaf).ok()?;
    }
    let discrete = equations.leaves.at([0.0]).ok()?;
    let height = discrete.energy(&saddle.state) - discrete.energy(&leaf.state);
    (height > 0.0).then(|| Pass {
        grid: start.grid.clone(),
        saddle,
        leaf,
        height,
    })
}

/// The equilibrium beyond a pass, if the one on this side is the leaf.
fn beyond(stable: &Stable, pass: &Pass) -> Option<State> {
    let distance = pass.saddle.state.shift_to(&pass.leaf.state);
    let same = |state: &State| state.shift_to(&pass.leaf.state) < SAME.min(SAME_PART * distance);
    let mut equations = Equations::new(stable.family, pass.grid.clone());
    let towards = between(&pass.saddle.state, &pass.leaf.state, equations.first_node());
    let stop = || stable.limit.reached();
    let both = equations.fall(&pass.saddle, &towards, &stop).ok()?;
    let rest = |fallen: Result<Point, State>| match fallen {
        Ok(point) => Some(point.state),
        // Not reached by the descent: relax from its last state.
        Err(state) => settle_from(stable.family.first(), &pass.grid, state, stable.limit),
    };
    let both = both.map(rest);
    match both {
        [Some(one), Some(other)] if same(&one) && !same(&other) => Some(other),
        [Some(one), Some(other)] if same(&other) && !same(&one) => Some(one),
        _ => None,
    }
}

/// A pass in the scenario's units, its energy extrapolated over grids.
fn in_units(stable: &Stable, pass: &Pass, neighbour: &State, weight: f64) -> Option<Barrier> {
    let mut equations = Equations::new(stable.family, pass.grid.clone());
    let neighbour = equations.correct(neighbour, 0.0, None).ok()?;
    let mut three = [pass.saddle.clone(), neighbour, pass.leaf.clone()];
    let rounding = ROUNDING
        * equations
            .leaves
            .at([0.0])
            .ok()?
            .energy(&three[0].state)
            .abs();
    let mut table = Richardson::default();
    table.push(
        pass.grid.segments(),
        heights(&mut equations, &three, pass.height)?,
    );
    for _ in 1..GRIDS {
        let (rods, segments) = (three[0].state.rods(), 2 * equations.grid().segments());
        let known = table.best().is_some_and(|best| best.error < ENOUGH);
        if known || rods * segments > MOST_NODES || stable.limit.reached() {
            break;
        }
        let finer: Result<Vec<_>, _> = (three.iter())
            .map(|point| on_finer(&mut equations, point))
            .collect();
        let [(finer, saddle), (_, neighbour), (_, leaf)] = <[_; 3]>::try_from(finer.ok()?).ok()?;
        (equations, three) = (finer, [saddle, neighbour, leaf]);
        // Otherwise a finer grid has no such pass.
        if three.each_ref().map(|point| point.index) != [1, 0, 0] {
            return None;
        }
        table.push(segments, heights(&mut equations, &three, pass.height)?);
    }
    let [saddle, neighbour, _] = three;
    let scale = stable.family.scale();
    let (best, values) = (table.best(), table.extrapolated());
    let [energy, above] = [values[0], values[3]].map(|it| it * pass.height * scale.moment());
    let own = stable.rest.energy?;
    Some(Barrier {
        energy,
        error: best.map(|best| (best.error * pass.height + rounding) * scale.moment()),
        height: (weight > 0.0).then(|| energy / weight),
        relative: (weight > 0.0).then(|| energy / (weight * scale.length)),
        saddle: Saddle {
            energy: own + energy,
            negative_eigenvalues: saddle.index,
            tip: saddle.state.tip(0) * scale.length,
        },
        neighbour: Neighbour {
            energy: own + above,
            tip: neighbour.state.tip(0) * scale.length,
        },
    })
}

/// Energies of a saddle and of the equilibrium beyond it above that of the leaf, divided by
/// `unit`, so that tolerances are relative.
fn heights(equations: &mut Equations, three: &[Point; 3], unit: f64) -> Option<Vec<f64>> {
    let leaf = equations.leaves.at([0.0]).ok()?;
    let [saddle, neighbour, own] = [0, 1, 2].map(|k| leaf.energy(&three[k].state));
    Some(vec![
        (saddle - own) / unit,
        0.0,
        0.0,
        (neighbour - own) / unit,
        0.0,
        0.0,
    ])
}
