//! The end of the path of slow loading, reached on one grid or, where stability was lost, on two that
//! agree; and rest on nested grids, as fine as the tolerance needs, from there or from arcs.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, System, half_state};
use crate::newton::{EquilibriumFailure, NewtonIteration, SolverCounts};
use crate::numbers::largest;
use crate::relax::accuracy::transfer::{
    GridLevel, StateOnGrid, predict_on_finer_grid, prolong, restrict, transfer,
};
use crate::relax::accuracy::{
    History, NestedEquilibrium, RelaxationFailure, RelaxationResult, result_with_path,
};
use crate::relax::loading::{LoadPath, resolves_loads, veins_cannot_buckle};
use crate::relax::log::{AttemptEnd, Extent, Strategy, WorkLog};
use crate::relax::path::{Event, Path, PathPosition, Stage};
use crate::relax::plan::{GRIDS, RelaxationProblem, ValleyPolicy, WORK};
use crate::relax::request::Progress;
use crate::relax::saddle;
use crate::relax::saddle::INDEFINITE_NEWTON_EQUATIONS;
use crate::relax::same_equilibrium::{
    is_near_guess, is_own_mirror_image, is_same_energy, is_same_on_two_grids,
};
use crate::relax::solve_on_grid::{
    COARSEST_TURN, GridGuess, GridSolution, InitialGuess, StabilityCheck, check_stability,
    find_grid_equilibrium,
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
        let StateOnGrid { grid: on, state } =
            state_on_requested_grid(problem, &mut begun.history, level, effort);
        if let Some(half) = half
            && is_own_mirror_image(half, &state)
        {
            let reduced = problem.reduced_to_half(Some(half));
            let guesses = vec![StateOnGrid {
                grid: on.clone(),
                state: half_state(half, &state),
            }];
            let found = solve_from_guesses(
                &reduced,
                NestedEquilibrium::without_grids(&reduced),
                guesses,
                effort,
            );
            let end = end_of(&found, |found| match found.is_stable() {
                true => AttemptEnd::Accepted,
                false => AttemptEnd::Unstable,
            });
            effort.log(Strategy::SlowLoading, Extent::Half, on.segments(), end);
            if let (Ok(found), AttemptEnd::Accepted) = (found, end) {
                let whole = found.mirrored_to_whole(&reduced).with_path(path);
                return LoadingEnd::with_result(Ok(whole));
            }
            begun = NestedEquilibrium::without_grids(problem);
        }
        let last = grid.segments() > GRIDS.finest_of_loading || problem.segments().is_some();
        let in_valley = RelaxationProblem {
            valley: match last {
                true => ValleyPolicy::MayLeave,
                false => ValleyPolicy::Stay,
            },
            ..*problem
        };
        let segments = on.segments();
        let guesses = vec![StateOnGrid { grid: on, state }];
        let followed = solve_from_guesses(&in_valley, begun, guesses, effort);
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
                    || finer.segments() > GRIDS.finest_resolving;
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
        return StateOnGrid {
            grid: arrived.leaf.grid,
            state: arrived.state,
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

/// Newton iterations to the same equilibrium, of any index, on the next grid.
const NEXT_GRID_ITERATIONS: usize = 12;

/// The accuracy of these, as a part of the tolerance.
const NEXT_GRID_ACCURACY: f64 = 1e-3;

/// Brings a leaf to rest from its start, on as many grids as the tolerance needs. A held leaf whose rest
/// on a coarse grid leads to none on finer ones is moved to its holders on these.
pub fn solve_from_start(
    problem: &RelaxationProblem,
    mut grid: Grid,
    effort: &mut WorkLog,
) -> RelaxationResult {
    loop {
        let found = solve_first_grid(problem, grid, effort)?;
        let finer = found.levels[0].leaf.grid.refined();
        let again = problem.leaf.has_placed_supports() && problem.segments().is_none();
        match refine_to_tolerance(problem, found, effort) {
            Err(_)
                if again
                    && finer.segments() <= GRIDS.finest_of_release
                    && effort.node_evaluations <= WORK.node_evaluations =>
            {
                grid = finer;
            }
            found => return found,
        }
    }
}

/// Brings a leaf to rest from initial guesses on nested grids, each close to an equilibrium, and on as
/// many finer grids as the tolerance needs.
pub fn solve_from_guesses(
    problem: &RelaxationProblem,
    begun: NestedEquilibrium,
    guesses: Vec<StateOnGrid>,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let found = solve_on_given_grids(problem, begun, guesses, effort)?;
    refine_to_tolerance(problem, found, effort)
}

/// Brings a leaf to rest from initial guesses on these grids alone, whatever their accuracy; stability
/// is not checked beyond the positive definite matrix of the iteration.
pub fn solve_on_given_grids(
    problem: &RelaxationProblem,
    begun: NestedEquilibrium,
    guesses: Vec<StateOnGrid>,
    effort: &mut WorkLog,
) -> RelaxationResult {
    (guesses.into_iter()).try_fold(begun, |found, StateOnGrid { grid, state }| {
        let guess = InitialGuess::Coarser(state);
        solve_from_guess(problem, found, GridGuess { grid, guess }, effort)
    })
}

/// Continues a leaf at rest to a `finer` grid, with all of its unknowns.
pub fn continue_on(
    problem: &RelaxationProblem,
    found: NestedEquilibrium,
    finer: Grid,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let mut found = predict_and_solve(problem, found, finer, effort)?;
    found.solved_rods = problem.leaf.rods();
    refine_to_tolerance(problem, found, effort)
}

/// Refines until the tolerance is kept by a leaf whose stability is known, or no finer grid is
/// allowed.
pub fn refine_to_tolerance(
    problem: &RelaxationProblem,
    mut found: NestedEquilibrium,
    effort: &mut WorkLog,
) -> RelaxationResult {
    loop {
        found = found.with_error_estimate(problem, &mut effort.workspace, &mut effort.work);
        let mut known = false;
        if found.is_accurate() {
            StabilityCheck { found, known } = check_stability(problem, found, false, effort)?;
        }
        if known {
            let another = needs_another_grid(problem, &found);
            found.added_for_nodes |= another;
            if !another {
                return Ok(found.with_tolerance_kept(true));
            }
        }
        if problem.out_of_time() {
            return found.into_failure(EquilibriumFailure::StepLimit);
        }
        let Some(finer) = found.next_finer_grid() else {
            let found = check_stability(problem, found, true, effort)?.found;
            return Ok(found.with_tolerance_kept(false));
        };
        found = predict_and_solve(problem, found, finer, effort)?;
    }
}

/// Whether all nodes of the finest grid are requested and the leaf is not accurate enough
/// there; then one more grid is added.
fn needs_another_grid(problem: &RelaxationProblem, found: &NestedEquilibrium) -> bool {
    let enough = !problem.options.every_node || found.integrated_leaf().is_some();
    if enough || found.added_for_nodes || found.next_finer_grid().is_none() {
        return false;
    }
    found.finer_nodes(found.levels.len()).grid + 1 < found.levels.len()
}

/// Brings a leaf to rest on the next finer grid, from a guess by the grids before.
fn predict_and_solve(
    problem: &RelaxationProblem,
    found: NestedEquilibrium,
    finer: Grid,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let level = found.levels.last().expect("the leaf is at rest on a grid");
    let mut state = prolong(&level.leaf, &level.state);
    let guess = match found.levels_for_prediction().as_slice() {
        [_] => InitialGuess::Coarser(state),
        levels => {
            predict_on_finer_grid(levels, &mut state);
            InitialGuess::Predicted(state)
        }
    };
    let next = GridGuess { grid: finer, guess };
    solve_from_guess(problem, found, next, effort)
}

/// Brings a leaf to rest on its next finer grid from this guess.
fn solve_from_guess(
    problem: &RelaxationProblem,
    mut found: NestedEquilibrium,
    next: GridGuess,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let GridSolution {
        level,
        iteration_error: rest,
        ..
    } = find_grid_equilibrium(problem, &mut found.history, next, effort);
    let found = found.with_finer_level(level);
    match rest {
        Ok(_) => Ok(found),
        Err(stop) => found.into_failure(stop),
    }
}

/// An equilibrium, of any index, continued to the grid next to the `finest`, predicted from a
/// `coarser` one, too; `None` if Newton's method leads elsewhere.
pub fn on_next_grid(
    coarser: Option<&GridLevel>,
    finest: &GridLevel,
    tolerance: f64,
) -> Option<GridLevel> {
    let mut state = prolong(&finest.leaf, &finest.state);
    if let Some(coarser) = coarser {
        predict_on_finer_grid(&[coarser, finest], &mut state);
    }
    let leaf = DiscreteLeaf::new(&finest.leaf.leaf, finest.leaf.grid.refined());
    let mut system = System::new(&leaf);
    // What is held stays where the guess has it, which is predicted from other grids.
    leaf.place_held_nodes(&mut state);
    let guess = state.clone();
    let newton = NewtonIteration {
        accuracy: NEXT_GRID_ACCURACY * tolerance,
        iterations: NEXT_GRID_ITERATIONS,
        work: &mut SolverCounts::default(),
        progress: &mut |_, _| {},
    };
    (newton.solve(&leaf, &mut state, &mut system, INDEFINITE_NEWTON_EQUATIONS)).ok()?;
    is_near_guess(&guess, &state).then_some(GridLevel { leaf, state })
}

/// Brings a leaf to rest from its start on the first grid that resolves it. A leaf that had to move far
/// must reach the same equilibrium on two grids.
fn solve_first_grid(
    problem: &RelaxationProblem,
    mut grid: Grid,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let mut found = NestedEquilibrium::without_grids(problem);
    let mut before: Option<GridLevel> = None;
    let mut failed: Vec<Grid> = Vec::new();
    loop {
        let from_start = GridGuess {
            grid: grid.clone(),
            guess: InitialGuess::Start,
        };
        let settled = find_grid_equilibrium(problem, &mut found.history, from_start, effort);
        let GridSolution {
            level,
            iteration_error: rest,
            left_convex_valley: moved,
            events,
        } = settled;
        if !problem.keeps_unstable() {
            found.path = events.map(|events| Path::Held { events });
        }
        let finer = grid.refined();
        let fixed = problem.segments().is_some();
        let last = fixed || finer.segments() > GRIDS.finest_of_release || problem.out_of_time();
        match rest {
            // On so coarse a grid the equilibrium that a moving leaf reaches is not reliable.
            _ if problem.too_coarse(level.leaf.segments())
                && (moved || rest.is_err() || largest_turn(&level) > COARSEST_TURN) => {}
            Ok(_) if !moved || fixed => return Ok(found.with_finer_level(level)),
            Ok(_) => {
                if let Some(coarser) = before.take()
                    && is_same_on_two_grids(&coarser, &level)
                {
                    return Ok(found.with_levels(vec![coarser, level]));
                }
                if before.is_none()
                    && let [.., coarse, _] = failed.as_slice()
                    && is_confirmed_on(problem, &mut found, &level, coarse.tripled(), effort)
                {
                    let found = found.with_finer_level(level);
                    return Ok(add_coarser_grids(problem, found, &failed, effort));
                }
                if last {
                    // An equilibrium, but not one to which two grids led.
                    found.unconfirmed = true;
                    return Ok(found.with_finer_level(level));
                }
                before = Some(level);
            }
            Err(stop) => {
                let at_limit = effort.node_evaluations > WORK.node_evaluations
                    || match stop {
                        EquilibriumFailure::Unresolved => {
                            fixed
                                || finer.segments() > GRIDS.finest_resolving
                                || problem.out_of_time()
                        }
                        _ => last,
                    };
                if problem.whole_leaf.is_some() || at_limit {
                    return found.with_finer_level(level).into_failure(stop);
                }
                before = None;
                failed.push(grid);
            }
        }
        grid = finer;
    }
}

/// Whether the leaf reaches the same equilibrium on a grid with three quarters of the
/// segments.
fn is_confirmed_on(
    problem: &RelaxationProblem,
    found: &mut NestedEquilibrium,
    level: &GridLevel,
    grid: Grid,
    effort: &mut WorkLog,
) -> bool {
    let from_start = GridGuess {
        grid,
        guess: InitialGuess::Start,
    };
    let GridSolution {
        level: other,
        iteration_error: rest,
        ..
    } = find_grid_equilibrium(problem, &mut found.history, from_start, effort);
    rest.is_ok() && is_same_on_two_grids(level, &other)
}

/// The leaf with up to two of the coarser grids that failed from the start, brought to rest there from
/// the restricted equilibrium of its only grid so far.
fn add_coarser_grids(
    problem: &RelaxationProblem,
    mut found: NestedEquilibrium,
    grids: &[Grid],
    effort: &mut WorkLog,
) -> NestedEquilibrium {
    for grid in grids.iter().rev().take(2) {
        let restricted = GridGuess {
            grid: grid.clone(),
            guess: InitialGuess::Coarser(restrict(&found.levels[0].state)),
        };
        let settled = find_grid_equilibrium(problem, &mut found.history, restricted, effort);
        let there = is_same_on_two_grids(&settled.level, &found.levels[0]);
        if settled.iteration_error.is_err() || settled.left_convex_valley || !there {
            break;
        }
        let coarser = std::iter::once(settled.level);
        let levels = coarser.chain(std::mem::take(&mut found.levels)).collect();
        found = found.with_levels(levels);
    }
    found
}

/// Largest rotation between the ends of a segment.
fn largest_turn(level: &GridLevel) -> f64 {
    let n = level.leaf.segments();
    let rods = level.state.q.chunks_exact(n + 1);
    let ends = rods.flat_map(|rod| rod.windows(2));
    largest(ends.map(|ends| ends[0].angle_between(ends[1])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::Leaf;
    use crate::relax::accuracy::richardson::distance;
    use crate::relax::request::{Options, Progress};
    use crate::scenario::Scenario;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 3, length = 1.0, fan = "symmetric", joined = true }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 50.0, shear_3 = 50.0 }
        load = { gravity = [0.0, 0.0, -1.0] }
    "#;

    /// Extrapolated positions on one more grid are within the bar of those before, their own bar is
    /// smaller, and what is asked for it leaves the equilibrium before as it was.
    #[test]
    fn a_finer_equilibrium_is_within_the_bar_of_the_one_before() {
        let scenario = Scenario::from_toml(LEAF).unwrap();
        let (leaf, options) = (Leaf::new(&scenario), Options::default());
        let problem = RelaxationProblem::new(&leaf, &options, 1e-5);
        let mut ignored = |_: &Progress| {};
        let mut effort = WorkLog::new(&mut ignored);
        let solved = solve_from_start(&problem, Grid::new(8, &[]), &mut effort);
        let found = solved.ok().expect("the leaf comes to rest");
        let bar = found.error().unwrap();
        let (finer, own) = (
            found.next_finer_grid().unwrap(),
            found.segments_of_estimate(),
        );
        let continued = continue_on(&problem, found.without_estimates(), finer, &mut effort);
        let further = continued.ok().expect("so it does on the next grid");
        assert!(found.keeps_tolerance && found.is_stable() && bar <= 1e-5);
        assert_eq!(further.levels.len(), found.levels.len() + 1);
        let moved = distance(
            found.convergence_table.extrapolated(),
            further.convergence_table.extrapolated(),
        );
        assert!(0.0 < moved && moved <= bar, "{moved} beyond {bar}");
        assert!(further.error().unwrap() < bar);
        assert_eq!(
            (found.error(), found.segments_of_estimate()),
            (Some(bar), own)
        );
    }
}
