//! The end of the path of slow loading, reached on one grid or, where stability was lost, on two that
//! agree; and what the leaf comes to from there.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, System};
use crate::newton::{EquilibriumFailure, SolverCounts};
use crate::relax::accuracy::transfer::{GridLevel, StateOnGrid, prolong, transfer};
use crate::relax::accuracy::{
    History, NestedEquilibrium, RelaxationFailure, RelaxationResult, result_with_path,
};
use crate::relax::loading::{LoadPath, resolves_loads, veins_cannot_buckle};
use crate::relax::log::{AttemptEnd, Extent, Strategy, WorkLog};
use crate::relax::nested_grids::{solve_from_guesses, solve_half_from_guess};
use crate::relax::path::{Event, Path, PathPosition, Stage};
use crate::relax::plan::{GRIDS, RelaxationProblem, ValleyPolicy, WORK};
use crate::relax::request::Progress;
use crate::relax::saddle;
use crate::relax::same_equilibrium::{is_same_energy, is_same_on_two_grids};
use crate::relax::solve_on_grid::{
    GridGuess, InitialGuess, find_grid_equilibrium, finest_resolving,
};

/// The finest requested grid, in segments of the grid from which it is interpolated: on a finer one
/// Newton's method might not converge.
const LARGEST_GRID_RATIO: usize = 8;

/// The least compliance (L^2/A) of a leaf that is loaded slowly: a stiffer leaf differs from it by its
/// strains of some millionths, while the signs of the eigenvalues of its matrix would be lost to rounding.
const SMALLEST_LOADING_COMPLIANCE: f64 = 1e-6;

/// What slow loading came to.
pub struct LoadingEnd {
    /// The result of the relaxation, at rest or not.
    pub found: RelaxationResult,
    /// Whether it failed so that the leaf may be released from arcs instead.
    pub given_up: bool,
}

impl LoadingEnd {
    fn with_result(found: RelaxationResult) -> Self {
        LoadingEnd {
            found,
            given_up: false,
        }
    }

    fn without_rest(failure: RelaxationFailure) -> Self {
        LoadingEnd {
            found: Err(Box::new(failure)),
            given_up: true,
        }
    }
}

/// Loads the leaf slowly, and brings it to rest on nested grids from where that leads; the
/// `half` of it where it keeps its mirror symmetry. A grid that was too coarse for slow loading
/// is refined.
pub fn load_slowly<'a>(
    problem: &RelaxationProblem<'a>,
    half: Option<&'a Leaf>,
    effort: &mut WorkLog,
) -> LoadingEnd {
    let mut grid = coarsest_grid(problem.leaf);
    let mut path = problem.undisturbed_path();
    loop {
        let segments = grid.segments();
        let LoadPathEnd {
            level,
            path: followed_path,
        } = match follow_load_path(problem, grid, effort) {
            Ok(arrived) => arrived,
            Err(failure) => {
                let end = AttemptEnd::PathLost;
                effort.log(Strategy::SlowLoading, Extent::Whole, segments, end);
                return LoadingEnd::without_rest(failure.with_path(path));
            }
        };
        grid = level.leaf.grid.refined();
        path = Some(followed_path);
        let mut begun = NestedEquilibrium::without_grids(problem);
        let guess = state_on_requested_grid(problem, &mut begun.history, level, effort);
        let by_half = half.and_then(|half| {
            solve_half_from_guess(problem, half, &guess, Strategy::SlowLoading, effort)
        });
        if let Some(found) = by_half {
            return LoadingEnd::with_result(Ok(found.with_path(path)));
        }
        let last = grid.segments() > GRIDS.finest_of_loading || problem.segments().is_some();
        let in_valley = RelaxationProblem {
            valley: match last {
                true => ValleyPolicy::MayLeave,
                false => ValleyPolicy::Stay,
            },
            ..*problem
        };
        let segments = guess.grid.segments();
        let followed = solve_from_guesses(&in_valley, begun, vec![guess], effort);
        let (given_up, out_of_time) = (last && problem.segments().is_none(), problem.out_of_time());
        let must_be_accurate = given_up || !out_of_time && !path_is_stable(&path);
        let end = end_of(&followed, |found| {
            match found.keeps_tolerance || !must_be_accurate {
                true => AttemptEnd::Accepted,
                false => AttemptEnd::Inaccurate,
            }
        });
        effort.log(Strategy::SlowLoading, Extent::Whole, segments, end);
        match followed {
            Ok(found) if end == AttemptEnd::Inaccurate => {
                let at = found.with_path(path);
                let stop = EquilibriumFailure::StepLimit;
                return LoadingEnd::without_rest(RelaxationFailure { at, stop });
            }
            Err(failure) if given_up => {
                return LoadingEnd::without_rest(failure.with_path(path));
            }
            Err(_) if !last && !out_of_time => {}
            followed => return LoadingEnd::with_result(result_with_path(followed, path)),
        }
    }
}

/// What came of an attempt, by this rule if the leaf came to rest.
fn end_of(
    found: &RelaxationResult,
    rule: impl FnOnce(&NestedEquilibrium) -> AttemptEnd,
) -> AttemptEnd {
    match found {
        Ok(found) => rule(found),
        Err(failure) => AttemptEnd::Failed(failure.stop),
    }
}

/// Whether a leaf kept its stability all along its path.
fn path_is_stable(path: &Option<Path>) -> bool {
    (path.as_ref()).is_some_and(|path| path.events().is_empty())
}

/// The grid of at least so many segments, with nodes at the kinks.
pub fn grid_of(leaf: &Leaf, segments: usize) -> Grid {
    Grid::new(segments.max(leaf.kinks().len() + 1), leaf.kinks())
}

/// The coarsest grid on which the leaf is loaded slowly.
fn coarsest_grid(leaf: &Leaf) -> Grid {
    let mut grid = grid_of(leaf, GRIDS.coarsest);
    while grid.segments() < GRIDS.finest_of_loading
        && !resolves_loads(&DiscreteLeaf::new(leaf, grid.clone()))
    {
        grid = grid.refined();
    }
    grid
}

/// Where slow loading led, and how.
pub struct LoadPathEnd {
    pub level: GridLevel,
    pub path: Path,
}

/// Loads a leaf slowly on this grid, and on finer ones where that does not resolve it or where
/// stability was lost; returns the leaf on the coarser of two grids that agree. If no grid leads to
/// rest, the last state is kept.
pub fn follow_load_path(
    problem: &RelaxationProblem,
    mut grid: Grid,
    effort: &mut WorkLog,
) -> Result<LoadPathEnd, Box<RelaxationFailure>> {
    let mut before: Option<GridLevel> = None;
    loop {
        let LoadPathRun { level, events, end } =
            follow_path_on_grid(problem, grid.clone(), Stage::Joining, effort);
        let finer = grid.refined();
        let spent = remaining_loading_budget(effort) == 0 || problem.out_of_time();
        let last = finer.segments() > GRIDS.finest_of_loading || spent;
        match end {
            Ok(()) if events.is_empty() => {
                let path = Path::STABLE;
                return Ok(LoadPathEnd { level, path });
            }
            Ok(()) => {
                let confirmed = before.as_ref().is_some_and(|coarser| {
                    is_same_on_two_grids(coarser, &level)
                        || is_of_same_circle(coarser, &level, &mut effort.work)
                });
                if confirmed || last {
                    // On finer grids it is followed: two members of a circle of equilibria
                    // would not be extrapolated.
                    return Ok(LoadPathEnd {
                        level: before.filter(|_| confirmed).unwrap_or(level),
                        path: Path::Loaded { events, confirmed },
                    });
                }
                before = Some(level);
            }
            Err(stop) => {
                let resolved = stop != EquilibriumFailure::Unresolved
                    || finer.segments() > finest_resolving(problem.leaf);
                if (resolved && last) || spent {
                    return NestedEquilibrium::without_grids(problem)
                        .with_finer_level(level)
                        .into_failure(stop);
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
fn is_of_same_circle(coarser: &GridLevel, level: &GridLevel, work: &mut SolverCounts) -> bool {
    let GridLevel { leaf, state } = level;
    let mut other = prolong(&coarser.leaf, &coarser.state);
    let mut system = System::new(leaf);
    let index = saddle::converge_saddle(leaf, &mut other, &mut system, work);
    let [a, b] = [state, &other].map(|state| leaf.energy(state));
    index == Some(0) && is_same_energy(a, b)
}

/// The state in which slow loading ended, on the grid where that was followed or, if a grid is
/// requested, interpolated to that one.
pub fn state_on_requested_grid(
    problem: &RelaxationProblem,
    history: &mut History,
    arrived: GridLevel,
    effort: &mut WorkLog,
) -> StateOnGrid {
    let Some(segments) = problem.segments() else {
        let least = match problem.leaf.scenario().blade {
            Some(_) => GRIDS.coarsest_of_blade,
            None => GRIDS.coarsest,
        };
        let GridLevel { leaf, state } = arrived;
        // A grid of its own: a refined one has as many segments, but others between the kinks.
        let own = grid_of(problem.leaf, least);
        return match leaf.segments() < own.segments() {
            true => StateOnGrid {
                state: transfer(&leaf, &state, &own),
                grid: own,
            },
            false => StateOnGrid {
                grid: leaf.grid,
                state,
            },
        };
    };
    let grid = Grid::new(segments, problem.leaf.kinks());
    let mut finest = arrived;
    while LARGEST_GRID_RATIO * finest.leaf.segments() < segments {
        let state = prolong(&finest.leaf, &finest.state);
        let next = GridGuess {
            grid: finest.leaf.grid.refined(),
            guess: InitialGuess::Coarser(state),
        };
        finest = find_grid_equilibrium(problem, history, next, effort).level;
    }
    let state = transfer(&finest.leaf, &finest.state, &grid);
    StateOnGrid { grid, state }
}

/// Nodes times force evaluations that are left for slow loading.
fn remaining_loading_budget(effort: &WorkLog) -> usize {
    (WORK.loading_node_evaluations).saturating_sub(effort.loading_node_evaluations)
}

/// Whether the veins, apart, take their loads without losing their stability. A leaf that
/// came to rest at once, as was `found`, does not tell.
pub fn takes_loads_stably(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    effort: &mut WorkLog,
) -> bool {
    let bounded = |level: &GridLevel| level.leaf.has_tissue() || veins_cannot_buckle(&level.leaf);
    if found.levels.first().is_some_and(bounded) {
        return true;
    }
    let grid = coarsest_grid(problem.leaf);
    let run = follow_path_on_grid(problem, grid, Stage::Loading, effort);
    effort.farthest_position = None;
    run.end.is_ok() && run.events.is_empty()
}

/// Slow loading on one grid.
struct LoadPathRun {
    /// The last state of the leaf on its path.
    level: GridLevel,
    /// Where the path lost its stability.
    events: Vec<Event>,
    /// Whether it was followed to the end of its last stage.
    end: Result<(), EquilibriumFailure>,
}

/// Loads a leaf slowly on one grid, to the end of a stage.
fn follow_path_on_grid(
    problem: &RelaxationProblem,
    grid: Grid,
    last: Stage,
    effort: &mut WorkLog,
) -> LoadPathRun {
    let leaf =
        DiscreteLeaf::new(problem.leaf, grid).with_compliance_floor(SMALLEST_LOADING_COMPLIANCE);
    let (segments, left) = (leaf.segments(), remaining_loading_budget(effort));
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
    let most = before + (left / nodes).min(WORK.loading_evaluations);
    let mut loading = LoadPath::new(
        &leaf,
        &mut effort.work,
        &mut progress,
        &problem.options.limit,
        most,
    );
    loading.bias_direction = problem.options.bias_direction;
    let end = loading.run(last);
    let events = std::mem::take(&mut loading.events);
    let reached = PathPosition {
        stage: loading.stage,
        lambda: loading.lambda,
    };
    let evaluations = loading.work.force_evaluations - before;
    // On coarse grids slow loading is cheap, and yet not repeated often.
    let least = WORK.loading_node_evaluations / WORK.loading_evaluations;
    effort.loading_node_evaluations += evaluations * nodes.max(least);
    let mut state = loading.last();
    if leaf.tips_move_together() {
        state.join_tips();
    }
    leaf.rotate_to_representative(&mut state);
    effort.farthest_position = end.is_err().then_some(reached);
    LoadPathRun {
        level: GridLevel { leaf, state },
        events,
        end,
    }
}
