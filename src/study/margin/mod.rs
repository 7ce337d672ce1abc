//! `relax --margin`: how far a stable leaf is from losing its stability.

mod barrier;
mod pushes;

use crate::clock::Instant;
use std::f64::consts::PI;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::branch::{Equations, Family, Point, Stuck, on_finer};
use crate::leaf::{Field, Grid, State, are_mirrored, is_mirrored};
use crate::limit::Limit;
use crate::memory;
use crate::relax::{
    Direction, Equilibrium, Level, Margin, Options, Progress, Push, RelaxError, relax_on_grids,
    without_wind,
};
use crate::scenario::Scenario;

/// The largest push: this many A/L^2, the load under which the veins buckle as columns pinned at
/// both ends (Euler), and so many weights; but no more than this part of
/// their axial stiffness.
const STIFF: f64 = PI * PI;
const WEIGHTS: f64 = 10.0;
const AXIAL: f64 = 0.2;

/// Accuracy of points on the branch (of the tips, relative to the leaf); a
/// critical one has its own error.
const ACCURACY: f64 = 1e-4;

/// Why a margin cannot be found.
#[derive(Debug, thiserror::Error)]
pub enum MarginError {
    /// A relaxation that cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// Shooting has no grids on which branches are followed.
    #[error("a margin is that of a relaxed leaf: use the method semi-implicit")]
    Method,
    /// Without energy there is neither an index nor a barrier.
    #[error(
        "a dead moment (load.tip_moment, load.point.moment) has no potential, hence no barrier; use loads that have"
    )]
    Moment,
}

/// Progress of the computation of a margin.
#[derive(Clone, Copy, Debug)]
pub enum MarginProgress {
    /// The leaf comes to rest.
    Relaxing(Progress),
    /// Number of searches done and in all; and the direction and force of one that is running.
    Searching {
        /// Searches done.
        done: usize,
        /// Number of all searches.
        all: usize,
        /// Direction and force of a running one.
        push: Option<(Direction, f64)>,
    },
}

/// Largest relative difference of the softest eigenvalue between two successive grids, or of that
/// extrapolated over them.
const ALIKE: f64 = 0.25;

/// Nodes of the finest grid in that search.
const MOST_NODES: usize = 5_000;

/// Why there is no margin if no grid satisfies it.
const UNDECIDED: &str = "its softest eigenvalue cannot be told from zero on any grid tried";

/// Remark on pushes that are not tried.
const TURNS: &str = "the leaf turns about its base without resistance, towards any push across that axis: only \
     pushes along it are tried";

/// Remark where none is tried.
const TIP_HELD: &str = "the tip is held: a force on it moves nothing";

/// Relaxes a leaf and finds how far it is from losing its stability, as
/// [`Equilibrium::margin`].
pub fn relax_with_margin(
    scenario: &Scenario,
    options: &Options,
    progress: &mut (dyn FnMut(&MarginProgress) + Send),
) -> Result<Equilibrium, MarginError> {
    if options.method.is_shooting() {
        return Err(MarginError::Method);
    }
    if scenario.has_moments() {
        return Err(MarginError::Moment);
    }
    without_wind(scenario, "the margin")?;
    let (mut leaf, found) = relax_on_grids(scenario, options, false, &mut |step| {
        progress(&MarginProgress::Relaxing(*step));
    })?;
    leaf.margin = Some(match (leaf.outcome.is_at_rest(), leaf.stable()) {
        (true, Some(true)) => margin(scenario, &leaf, &found.levels, options, progress)?,
        (true, Some(false)) => Margin::none("an unstable leaf has no margin to lose"),
        _ => Margin::none("only a leaf at rest whose stability is known has a margin"),
    });
    Ok(leaf)
}

/// A stable leaf on the grid on which it is pushed, with the options.
struct Stable<'a> {
    scenario: &'a Scenario,
    /// The scenario's leaf alone, at any value of the parameter.
    family: &'a Family<'a>,
    rest: &'a Equilibrium,
    grid: Grid,
    state: State,
    accuracy: f64,
    largest: f64,
    limit: &'a Limit,
    searches: Searches<'a>,
}

/// Counts searches and reports their progress.
struct Searches<'a> {
    done: AtomicUsize,
    all: AtomicUsize,
    progress: Mutex<&'a mut (dyn FnMut(&MarginProgress) + Send)>,
}

impl Searches<'_> {
    fn report(&self, push: Option<(Direction, f64)>) {
        // If another thread is reporting, this report is skipped.
        if let Ok(mut progress) = self.progress.try_lock() {
            progress(&MarginProgress::Searching {
                done: self.done.load(Ordering::Relaxed),
                all: self.all.load(Ordering::Relaxed),
                push,
            });
        }
    }

    fn finish_one(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
        self.report(None);
    }
}

/// A start point for a saddle search, on its grid, with a direction.
struct StartPoint {
    grid: Grid,
    state: State,
    direction: Field,
}

fn margin(
    scenario: &Scenario,
    rest: &Equilibrium,
    levels: &[Level],
    options: &Options,
    progress: &mut (dyn FnMut(&MarginProgress) + Send),
) -> Result<Margin, MarginError> {
    let clock = Instant::now();
    let make = |_: [f64; 1]| Ok(scenario.clone());
    let Ok(family) = Family::new(&make, [0.0, 1.0], false) else {
        return Ok(Margin::none(UNDECIDED));
    };
    let (grid, state) = match continuation_grid(&family, levels) {
        Ok(found) => found,
        Err(why) => return Ok(Margin::none(why)),
    };
    let rods = scenario.rods.len();
    memory::branches(rods, grid.segments()).map_err(RelaxError::Memory)?;
    let weight = weight(scenario);
    let directions = directions(scenario, rest);
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    let stable = Stable {
        scenario,
        family: &family,
        rest,
        grid,
        state,
        accuracy: tolerance.max(ACCURACY),
        largest: largest_push(scenario, weight),
        limit: &options.limit,
        searches: Searches {
            done: AtomicUsize::new(0),
            all: AtomicUsize::new(directions.len() + barrier::MODE_CLIMBS),
            progress: Mutex::new(progress),
        },
    };
    let pushed: Vec<_> = directions
        .into_par_iter()
        .map(|direction| {
            let pushed = pushes::push(&stable, direction, weight);
            stable.searches.finish_one();
            pushed
        })
        .collect();
    let (mut pushes, mut starts) = (Vec::new(), Vec::new());
    for (push, found) in pushed {
        starts.extend(found);
        pushes.push(push);
    }
    add_mirrored(&mut pushes, rods);
    pushes.sort_by(|a, b| {
        let [a, b] = [a, b].map(|push| push.force.unwrap_or(f64::INFINITY));
        a.total_cmp(&b)
    });
    let (barrier, climbs) = barrier::barrier(&stable, starts, weight);
    let held = scenario.holds_all_tips();
    let remark = match options.limit.reached() {
        true => Some("the time allowed was over before all was tried".into()),
        false if held => Some(TIP_HELD.into()),
        false => (rest.stability.neutral_directions > 0).then(|| TURNS.into()),
    };
    Ok(Margin {
        weight,
        every_tip: !scenario.joined && rods > 1,
        largest_push: (!held).then_some(stable.largest),
        pushes,
        barrier,
        climbs,
        remark,
        wall_seconds: clock.elapsed().as_secs_f64(),
    })
}

/// The leaf on a grid, with its softest eigenvalue there.
struct OnGrid {
    grid: Grid,
    point: Point,
    softest: f64,
}

impl OnGrid {
    fn of(equations: &mut Equations, point: &Point) -> Result<Self, Stuck> {
        Ok(OnGrid {
            grid: equations.grid().clone(),
            softest: equations.softest(point)?,
            point: point.clone(),
        })
    }
}

/// Whether the softest eigenvalue is that of the leaf on the first of these grids: it agrees with
/// that on the next; or, near a bifurcation, where that of a coarse grid differs, the values
/// extrapolated from the first two and from the last two agree, and the differences fall with the
/// square of the segments' length.
fn is_resolved(grids: &[OnGrid]) -> bool {
    let alike = |a: f64, b: f64| (a - b).abs() < ALIKE * b;
    let stable = grids.iter().all(|it| it.point.index == 0);
    let softest: Vec<f64> = grids.iter().map(|it| it.softest).collect();
    stable
        && match softest[..] {
            [a, b] => alike(a, b),
            [a, b, c] => {
                let [coarser, finer] = [[a, b], [b, c]].map(|[a, b]| b + (b - a) / 3.0);
                alike(coarser, finer) && alike((a - b) / (b - c), 4.0)
            }
            _ => false,
        }
}

/// The leaf on the coarsest grid on which its softest eigenvalue is known, or why there is none.
fn continuation_grid(family: &Family, levels: &[Level]) -> Result<(Grid, State), &'static str> {
    let first = levels[0].leaf.segments();
    let mut nested = levels.iter().filter(|level| {
        let segments = level.leaf.segments();
        segments.is_multiple_of(first) && (segments / first).is_power_of_two()
    });
    let on_level = |level: &Level| {
        let mut equations = Equations::new(family, level.leaf.grid.clone());
        let point = equations.correct(&level.state, 0.0, None)?;
        Ok::<_, Stuck>((equations, point))
    };
    let (mut equations, mut point) = on_level(&levels[0]).map_err(|_| UNDECIDED)?;
    nested.next();
    let mut grids: Vec<OnGrid> = Vec::new();
    loop {
        grids.push(OnGrid::of(&mut equations, &point).map_err(|_| UNDECIDED)?);
        for grids in [2, 3].map(|count| grids.len().checked_sub(count).map(|k| &grids[k..])) {
            if let Some(grids) = grids.filter(|grids| is_resolved(grids)) {
                return Ok((grids[0].grid.clone(), grids[0].point.state.clone()));
            }
        }
        if grids.len() > 1 && point.state.rods() * point.state.segments() > MOST_NODES {
            return Err(match point.index {
                0 => UNDECIDED,
                _ => "the leaf is unstable on grids finer than those of its relaxation",
            });
        }
        let finer = match nested.next() {
            Some(level) => on_level(level),
            None => on_finer(&mut equations, &point),
        };
        (equations, point) = finer.map_err(|_| UNDECIDED)?;
    }
}

fn weight(scenario: &Scenario) -> f64 {
    scenario.total_load().length()
}

fn largest_push(scenario: &Scenario, weight: f64) -> f64 {
    let rods = scenario.rods.iter();
    let axial: f64 = rods.map(|rod| rod.force_stiffness[0].min()).sum();
    let together = if scenario.joined {
        scenario.rods.len()
    } else {
        1
    } as f64;
    let stiff = STIFF * together * scenario.scale().force();
    (stiff + WEIGHTS * weight).min(AXIAL * axial * together / scenario.rods.len() as f64)
}

/// Veins at rest are each other's mirror images within this part of the leaf's length, and within
/// this angle (radians), or the error of the leaf: the rounding of the softest of leaves.
const IMAGES: f64 = 1e-9;

/// Whether the leaf at rest is its own mirror image in the plane y = 0.
fn is_own_image(scenario: &Scenario, rest: &Equilibrium) -> bool {
    let error = rest.accuracy.error_estimate.unwrap_or_default();
    let angle = IMAGES.max(error / rest.shape.longest());
    let distance = angle * rest.shape.longest();
    is_mirrored(scenario) && are_mirrored(&rest.shape.rods, distance, angle)
}

/// The directions of the pushes: none if all tips are held; for a mirror-symmetric leaf only the
/// first of two that are mirror images.
fn directions(scenario: &Scenario, rest: &Equilibrium) -> Vec<Direction> {
    if scenario.holds_all_tips() {
        return Vec::new();
    }
    // Veins that turn without resistance turn towards any push across their axis.
    let turnings = match rest.stability.neutral_directions {
        0 => Vec::new(),
        _ => scenario.turnings(),
    };
    let along = |direction: &Direction| {
        // What only spins turns towards nothing.
        let axes = turnings.iter().map(|it| it.axis.to_array());
        let mut axes = axes.filter(|axis| *axis != [0.0; 3]);
        axes.all(|axis| (axis[direction.axis].abs() - 1.0).abs() < IMAGES)
    };
    let mirrored = [false, is_own_image(scenario, rest), rest.model.planar];
    let own = |direction: &Direction| !(direction.negative && mirrored[direction.axis]);
    Direction::all().filter(own).filter(along).collect()
}

/// Adds the mirror images of pushes whose mirror image was not computed.
fn add_mirrored(pushes: &mut Vec<Push>, rods: usize) {
    let has = |other: Direction| pushes.iter().any(|push| push.direction == other);
    let alone = pushes.iter().filter(|push| !has(push.direction.opposite()));
    let images: Vec<Push> = alone
        .map(|push| {
            let axis = push.direction.axis;
            let mut image = push.clone();
            image.direction = push.direction.opposite();
            image.mirrored = true;
            let behind = image.neighbour.iter_mut().map(|it| &mut it.tip);
            let tips = image.tips.iter_mut().chain(behind);
            tips.for_each(|tip| tip[axis] = -tip[axis]);
            if axis == 1 && image.tips.len() == rods {
                image.tips.reverse();
            }
            image
        })
        .collect();
    pushes.extend(images);
}
