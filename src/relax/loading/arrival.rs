//! The end of the path, reached on one grid or, where stability was lost, on two that agree.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System, half_of, whole_of};
use crate::newton::{Stop, Work};
use crate::relax::accuracy::richardson::distance;
use crate::relax::grids::{follow, solve};
use crate::relax::loading::partial::{resolves_loads, veins_cannot_buckle};
use crate::relax::loading::walk::Walk;
use crate::relax::grids::FINEST_RESOLVING;
use crate::relax::nested::{Failure, Found, History, NestedEquilibrium, along};
use crate::relax::path::{Event, Path, Stage};
use crate::relax::request::options::Progress;
use crate::relax::request::problem::Problem;
use crate::relax::saddle;
use crate::relax::settle::effort::{BUDGET, Effort};
use crate::relax::settle::iteration::{InitialGuess, settle};
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::prolong::{prolong, transfer};

/// Segments of the coarsest grid of a walk, and of the finest on which a lost stability is
/// confirmed.
pub const COARSEST: usize = 8;
const FINEST: usize = 64;

/// States on two grids of which no common nodes are farther apart than this (lengths) are the
/// same equilibrium.
pub const SAME_EQUILIBRIUM: f64 = 0.05;

/// Energies of the same equilibrium on one grid agree to this part, or of A/L.
const SAME_ENERGY: f64 = 1e-5;

/// The finest requested grid, in segments of the grid from which it is interpolated.
const FARTHEST_GRID: usize = 8;

/// Limits on the force evaluations of all walks, and on nodes times these: typical walks take a
/// dozen, and a few hundred for each loss of stability.
const MOST_EVALUATIONS: usize = 2500;
const BUDGET_OF_WALKS: usize = BUDGET / 8;

/// The least compliance (L^2/A) on a walk: a stiffer leaf differs from it by its strains of some
/// millionths, while the signs of the eigenvalues of its matrix would be lost to rounding.
const WALKING_COMPLIANCE: f64 = 1e-6;

/// Loads the leaf slowly, and brings it to rest on nested grids from where that leads; the
/// `half` of it where it keeps its mirror symmetry. A grid that was too coarse for the walk
/// is refined.
pub fn load_slowly<'a>(
    problem: &Problem<'a>,
    half: Option<&'a Leaf>,
    effort: &mut Effort,
) -> Found {
    let leaf = problem.leaf;
    let mut grid = coarsest_grid(leaf);
    let mut path = problem.path();
    loop {
        let Arrived {
            level,
            path: walked,
        } = match arrive(problem, grid, effort) {
            Ok(arrived) => arrived,
            Err(failure) => return release_instead(problem, failure.along(path), effort),
        };
        grid = level.leaf.grid.refined();
        path = Some(walked);
        let mut begun = NestedEquilibrium::begun(problem);
        let (on, state) = guess(problem, &mut begun.history, level, effort);
        if let Some(half) = half
            && is_mirrored(half, &state)
        {
            let reduced = problem.reduced(Some(half));
            let guesses = vec![(on.clone(), half_of(half, &state))];
            effort.spare_system = None;
            let found = follow(
                &reduced,
                NestedEquilibrium::begun(&reduced),
                guesses,
                effort,
            );
            effort.spare_system = None;
            if let Ok(found) = found
                && found.is_stable()
            {
                return Ok(found.completed(&reduced).along(path));
            }
            begun = NestedEquilibrium::begun(problem);
        }
        let last = grid.segments() > FINEST || problem.segments().is_some();
        let in_valley = Problem {
            stays_in_valley: !last,
            ..*problem
        };
        let followed = follow(&in_valley, begun, vec![(on, state)], effort);
        let (given_up, out_of_time) = (last && problem.segments().is_none(), problem.out_of_time());
        match followed {
            Ok(found)
                if !found.keeps_tolerance
                    && (given_up || !out_of_time && !path_is_stable(&path)) =>
            {
                let at = found.along(path);
                let stop = Stop::StepLimit;
                return release_instead(problem, Failure { at, stop }, effort);
            }
            Err(failure) if given_up => {
                return release_instead(problem, failure.along(path), effort);
            }
            Err(_) if !last && !out_of_time => effort.spare_system = None,
            followed => return along(followed, path),
        }
    }
}

/// Whether nothing happened on a path.
fn path_is_stable(path: &Option<Path>) -> bool {
    (path.as_ref()).is_some_and(|path| path.events().is_empty())
}

fn grid_of(leaf: &Leaf, segments: usize) -> Grid {
    Grid::new(segments.max(leaf.kinks().len() + 1), leaf.kinks())
}

/// The coarsest grid on which the leaf is loaded slowly.
fn coarsest_grid(leaf: &Leaf) -> Grid {
    let mut grid = grid_of(leaf, COARSEST);
    while grid.segments() < FINEST && !resolves_loads(&DiscreteLeaf::new(leaf, grid.clone())) {
        grid = grid.refined();
    }
    grid
}

/// A leaf whose path could not be followed is released from arcs.
fn release_instead(problem: &Problem, failure: Failure, effort: &mut Effort) -> Found {
    // Others were released before.
    if problem.out_of_time() || !problem.loads_slowly() {
        return Err(Box::new(failure));
    }
    let grid = grid_of(problem.leaf, problem.segments().unwrap_or(COARSEST));
    effort.spare_system = None;
    along(solve(problem, grid, effort), Some(Path::Released))
}

/// Where a walk arrived, and how.
pub struct Arrived {
    pub level: Level,
    pub path: Path,
}

/// Walks on this grid, and on finer ones where it does not resolve the leaf or where
/// stability was lost; the leaf on the coarser of two grids that agree. If no grid leads to
/// rest, the last state is kept.
pub fn arrive(
    problem: &Problem,
    mut grid: Grid,
    effort: &mut Effort,
) -> Result<Arrived, Box<Failure>> {
    let mut before: Option<Level> = None;
    loop {
        let (level, events, end) = walk(problem, grid.clone(), Stage::Joining, effort);
        let finer = grid.refined();
        let spent = walks_left(effort) == 0 || problem.out_of_time();
        let last = finer.segments() > FINEST || spent;
        match end {
            Ok(()) if events.is_empty() => {
                let path = Path::STABLE;
                return Ok(Arrived { level, path });
            }
            Ok(()) => {
                let near = before.as_ref().is_some_and(|coarser| {
                    distance(&positions(coarser, 1), &positions(&level, 2)) < SAME_EQUILIBRIUM
                });
                let confirmed = near
                    || before
                        .as_ref()
                        .is_some_and(|coarser| is_alike(coarser, &level, &mut effort.work));
                if confirmed || last {
                    // On finer grids it is followed: two members of a circle of equilibria
                    // would not be extrapolated.
                    return Ok(Arrived {
                        level: before.filter(|_| confirmed).unwrap_or(level),
                        path: Path::Loaded { events, confirmed },
                    });
                }
                before = Some(level);
            }
            Err(stop) => {
                let resolved = stop != Stop::Unresolved || finer.segments() > FINEST_RESOLVING;
                if (resolved && last) || spent {
                    return NestedEquilibrium::begun(problem).with(level).failed(stop);
                }
                before = None;
            }
        }
        grid = finer;
    }
}

/// Whether the equilibrium on a coarser grid has, on the grid of `level`, the energy of that
/// there: it is one of a circle of equilibria then, as of a buckled round column, or its
/// mirror image.
fn is_alike(coarser: &Level, level: &Level, work: &mut Work) -> bool {
    let Level { leaf, state } = level;
    let mut other = prolong(&coarser.leaf, &coarser.state);
    let mut system = System::new(leaf);
    let index = saddle::polish(leaf, &mut other, &mut system, work);
    let [a, b] = [state, &other].map(|state| leaf.energy(state));
    index == Some(0) && (a - b).abs() <= SAME_ENERGY * a.abs().max(1.0)
}

/// The initial guess from where a walk arrived: on the grid of the walk, or on the requested
/// one.
pub fn guess(
    problem: &Problem,
    history: &mut History,
    arrived: Level,
    effort: &mut Effort,
) -> (Grid, State) {
    let Some(segments) = problem.segments() else {
        return (arrived.leaf.grid, arrived.state);
    };
    let grid = Grid::new(segments, problem.leaf.kinks());
    let mut finest = arrived;
    while FARTHEST_GRID * finest.leaf.segments() < segments {
        let state = prolong(&finest.leaf, &finest.state);
        let next = (finest.leaf.grid.refined(), InitialGuess::Coarser(state));
        finest = settle(problem, history, next, effort).level;
    }
    let state = transfer(&finest.leaf, &finest.state, &grid);
    (grid, state)
}

/// Nodes times force evaluations that are left for walks.
fn walks_left(effort: &Effort) -> usize {
    BUDGET_OF_WALKS.saturating_sub(effort.walked)
}

/// Whether the veins, apart, take their loads without losing their stability. A leaf that
/// came to rest at once, as was `found`, does not tell.
pub fn takes_loads_stably(
    problem: &Problem,
    found: &NestedEquilibrium,
    effort: &mut Effort,
) -> bool {
    let bounded = |level: &Level| level.leaf.tied() || veins_cannot_buckle(&level.leaf);
    if found.levels.first().is_some_and(bounded) {
        return true;
    }
    let grid = coarsest_grid(problem.leaf);
    let (_, events, end) = walk(problem, grid, Stage::Loading, effort);
    effort.reached = None;
    end.is_ok() && events.is_empty()
}

/// Walks on one grid to the end of a stage.
fn walk(
    problem: &Problem,
    grid: Grid,
    last: Stage,
    effort: &mut Effort,
) -> (Level, Vec<Event>, Result<(), Stop>) {
    let leaf = DiscreteLeaf::new(problem.leaf, grid).softened(WALKING_COMPLIANCE);
    let (segments, left) = (leaf.segments(), walks_left(effort));
    let report = &mut *effort.progress;
    let mut progress = |step: usize, residual: f64| {
        let grid = segments;
        report(&Progress::Relaxing {
            grid,
            step,
            residual,
        });
    };
    let (before, nodes) = (effort.work.force_evaluations, leaf.rods() * segments);
    let most = before + (left / nodes).min(MOST_EVALUATIONS);
    let mut walk = Walk::new(
        &leaf,
        (&mut effort.work, &mut progress),
        (&problem.options.limit, most),
    );
    walk.leaning = problem.options.leaning;
    let end = walk.run(last);
    let events = std::mem::take(&mut walk.events);
    let reached = (walk.stage, walk.part);
    let evaluations = walk.work.force_evaluations - before;
    // Walks on coarse grids are cheap, and yet not many.
    effort.walked += evaluations * nodes.max(BUDGET_OF_WALKS / MOST_EVALUATIONS);
    let mut state = walk.last();
    if leaf.tips_move_together() {
        state.join_tips();
    }
    leaf.lean_down(&mut state);
    effort.reached = end.is_err().then_some(reached);
    (Level { leaf, state }, events, end)
}

/// Distance of a state from its mirror image, lengths, that is rounding or unfinished iteration.
const MIRRORED: f64 = 1e-3;

/// Whether a state is its own mirror image.
fn is_mirrored(half: &Leaf, state: &State) -> bool {
    whole_of(half, &half_of(half, state)).shift_to(state) < MIRRORED
}
