//! Rest on nested grids: on the first grid that resolves the leaf, from its start or from guesses, and on
//! finer ones until the tolerance is kept by a leaf whose stability is known.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, System, half_state};
use crate::newton::{EquilibriumFailure, NewtonIteration, SolverCounts};
use crate::numbers::largest;
use crate::relax::accuracy::transfer::{
    GridLevel, StateOnGrid, predict_on_finer_grid, prolong, restrict,
};
use crate::relax::accuracy::{NestedEquilibrium, RelaxationResult};
use crate::relax::log::{AttemptEnd, Extent, Strategy, WorkLog};
use crate::relax::path::Path;
use crate::relax::plan::{GRIDS, RelaxationProblem, WORK};
use crate::relax::saddle::INDEFINITE_NEWTON_EQUATIONS;
use crate::relax::same_equilibrium::{is_near_guess, is_own_mirror_image, is_same_on_two_grids};
use crate::relax::solve_on_grid::follower_loads::balance_on_next_grid;
use crate::relax::solve_on_grid::{
    COARSEST_TURN, GridGuess, GridSolution, InitialGuess, StabilityCheck, check_stability,
    find_grid_equilibrium, finest_resolving, has_coarse_span,
};
use crate::run::Limit;

/// Newton iterations to the same equilibrium, of any index, on the next grid.
pub(super) const NEXT_GRID_ITERATIONS: usize = 12;

/// The accuracy of these, as a part of the tolerance.
pub(super) const NEXT_GRID_ACCURACY: f64 = 1e-3;

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

/// Brings the `half` of a leaf to rest from a guess for the whole that is its own mirror image; `None`
/// unless it comes to a rest in which the whole is stable.
pub fn solve_half_from_guess<'a>(
    problem: &RelaxationProblem<'a>,
    half: &'a Leaf,
    guess: &StateOnGrid,
    strategy: Strategy,
    effort: &mut WorkLog,
) -> Option<NestedEquilibrium> {
    if !is_own_mirror_image(half, &guess.state) {
        return None;
    }
    let reduced = problem.reduced_to_half(Some(half));
    let of_half = StateOnGrid {
        grid: guess.grid.clone(),
        state: half_state(half, &guess.state),
    };
    let begun = NestedEquilibrium::without_grids(&reduced);
    let found = solve_from_guesses(&reduced, begun, vec![of_half], effort);
    let end = match &found {
        Ok(found) if found.is_stable() => AttemptEnd::Accepted,
        Ok(_) => AttemptEnd::Unstable,
        Err(failure) => AttemptEnd::Failed(failure.stop),
    };
    effort.log(strategy, Extent::Half, guess.grid.segments(), end);
    let accepted = found.ok().filter(|_| end == AttemptEnd::Accepted);
    accepted.map(|found| found.mirrored_to_whole(&reduced))
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
            if !another && !needs_third_grid(problem, &found) {
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

/// Whether the leaf has two grids, on which the spans between some holders have so few segments that their forces on
/// two grids tell only the first digits.
fn needs_third_grid(problem: &RelaxationProblem, found: &NestedEquilibrium) -> bool {
    let [coarsest, _] = found.levels.as_slice() else {
        return false;
    };
    found.corrected_estimate().is_none()
        && has_coarse_span(problem.leaf, coarsest.leaf.segments() / 2)
        && found.next_finer_grid().is_some()
}

/// Whether all nodes of the finest grid are requested and the leaf is not accurate enough
/// there; then one more grid is added.
pub(super) fn needs_another_grid(problem: &RelaxationProblem, found: &NestedEquilibrium) -> bool {
    let enough = !problem.options.every_node || found.integrated_leaf().is_some();
    if enough || found.added_for_nodes || found.next_finer_grid().is_none() {
        return false;
    }
    found.finer_nodes(found.levels.len()).grid + 1 < found.levels.len()
}

/// Brings a leaf to rest on the next finer grid, from a guess by the grids before.
pub(super) fn predict_and_solve(
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
pub(super) fn solve_from_guess(
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

impl NestedEquilibrium {
    /// The equilibrium continued to the next finer grid; `None` if there is none, or Newton's method leads elsewhere.
    pub(crate) fn level_on_next_grid(&self, limit: &Limit) -> Option<GridLevel> {
        self.next_finer_grid()?;
        let (finest, others) = self.levels.split_last()?;
        match finest.leaf.leaf.has_potential() {
            true => on_next_grid(others.last(), finest, self.requested_tolerance()),
            false => balance_on_next_grid(finest, limit),
        }
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
pub(super) fn solve_first_grid(
    problem: &RelaxationProblem,
    mut grid: Grid,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let mut found = NestedEquilibrium::without_grids(problem);
    let mut before: Option<GridLevel> = None;
    let mut failed: Vec<Grid> = Vec::new();
    let (finest, finest_resolving) = match problem.keeps_unstable() {
        true => {
            let finest = GRIDS.finest_of_any_index.max(2 * grid.segments());
            (finest, finest)
        }
        false => (GRIDS.finest_of_release, finest_resolving(problem.leaf)),
    };
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
        let last = fixed || finer.segments() > finest || problem.out_of_time();
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
                    && 4 * coarse.segments() == level.leaf.segments()
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
                            fixed || finer.segments() > finest_resolving || problem.out_of_time()
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
pub(super) fn is_confirmed_on(
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

/// The leaf with the two next coarser grids, which failed from the start, brought to rest there from
/// the restricted equilibrium of its only grid so far.
pub(super) fn add_coarser_grids(
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
pub(super) fn largest_turn(level: &GridLevel) -> f64 {
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
