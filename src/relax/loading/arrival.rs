//! The end of the path, reached on one grid or, where stability was lost, on two that agree.
//!
//! Nested grids: as fine as the tolerance needs, with an error estimate.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System, half_of, whole_of};
use crate::newton::{Newton, Stop, Work};
use crate::numbers::largest;
use crate::relax::accuracy::richardson::distance;
use crate::relax::accuracy::transfer::{predict, prolong, restrict, transfer};
use crate::relax::accuracy::{Failure, Found, History, Level, NestedEquilibrium, along, positions};
use crate::relax::loading::{Walk, resolves_loads, veins_cannot_buckle};
use crate::relax::path::{Event, Path, Stage};
use crate::relax::request::Progress;
use crate::relax::rest::{BUDGET, Effort, Problem};
use crate::relax::saddle;
use crate::relax::saddle::ANY_SIGN;
use crate::relax::solve_on_grid::{COARSEST_TURN, InitialGuess, Settled, check_stability, settle};

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

/// The finest grid for this comparison.
const FINEST_COMPARED: usize = 256;

/// The finest grid that is tried when coarser ones do not resolve the bending.
pub(in crate::relax) const FINEST_RESOLVING: usize = 2048;

/// Newton iterations to the same equilibrium, of any index, on the next grid, their accuracy as a
/// part of the tolerance, and the largest displacement of a node, in lengths: farther away is
/// another equilibrium.
const NEARBY_ITERATIONS: usize = 12;

const NEARBY_ACCURACY: f64 = 1e-3;

const NEARBY: f64 = 0.02;

/// From the start to rest, on as many grids as the tolerance needs. A held leaf whose rest on a coarse
/// grid leads to none on finer ones is moved to its holders on these.
pub fn solve(problem: &Problem, mut grid: Grid, effort: &mut Effort) -> Found {
    loop {
        let found = settle_from_start(problem, grid, effort)?;
        let finer = found.levels[0].leaf.grid.refined();
        let again = problem.leaf.is_held() && problem.segments().is_none();
        match refine(problem, found, effort) {
            Err(_) if again && finer.segments() <= FINEST_COMPARED && effort.spent <= BUDGET => {
                effort.spare_system = None;
                grid = finer;
            }
            found => return found,
        }
    }
}

/// The same from initial guesses on nested grids, each close to an equilibrium.
pub fn follow(
    problem: &Problem,
    begun: NestedEquilibrium,
    guesses: Vec<(Grid, State)>,
    effort: &mut Effort,
) -> Found {
    let found = follow_on_these(problem, begun, guesses, effort)?;
    refine(problem, found, effort)
}

/// The same on these grids alone, whatever their accuracy; stability is not checked beyond
/// the positive definite matrix of the iteration.
pub fn follow_on_these(
    problem: &Problem,
    begun: NestedEquilibrium,
    guesses: Vec<(Grid, State)>,
    effort: &mut Effort,
) -> Found {
    (guesses.into_iter()).try_fold(begun, |found, (grid, state)| {
        settle_next(problem, found, (grid, InitialGuess::Coarser(state)), effort)
    })
}

/// Continues a leaf at rest to a `finer` grid, with all of its unknowns.
pub fn continue_on(
    problem: &Problem,
    found: NestedEquilibrium,
    finer: Grid,
    effort: &mut Effort,
) -> Found {
    let mut found = settle_on(problem, found, finer, effort)?;
    found.solved = problem.leaf.rods();
    refine(problem, found, effort)
}

/// Refines until the tolerance is kept by a leaf whose stability is known, or no finer grid is
/// allowed.
pub fn refine(problem: &Problem, mut found: NestedEquilibrium, effort: &mut Effort) -> Found {
    loop {
        found = found.estimated(problem, &mut effort.spare_system, &mut effort.work);
        let mut known = false;
        if found.is_accurate() {
            (found, known) = check_stability(problem, found, false, effort)?;
        }
        if known {
            let another = needs_another_grid(problem, &found);
            found.added_for_nodes |= another;
            if !another {
                return Ok(found.ended(true));
            }
        }
        if problem.out_of_time() {
            return found.failed(Stop::StepLimit);
        }
        let Some(finer) = found.finer() else {
            (found, _) = check_stability(problem, found, true, effort)?;
            return Ok(found.ended(false));
        };
        found = settle_on(problem, found, finer, effort)?;
    }
}

/// Whether all nodes of the finest grid are requested and the leaf is not accurate enough
/// there; then one more grid is added.
fn needs_another_grid(problem: &Problem, found: &NestedEquilibrium) -> bool {
    let enough = !problem.options.every_node || found.integrated().is_some();
    if enough || found.added_for_nodes || found.finer().is_none() {
        return false;
    }
    found.finer_nodes(found.levels.len()).0 + 1 < found.levels.len()
}

/// Settles the leaf on the next finer grid, from a guess by the grids before.
fn settle_on(
    problem: &Problem,
    found: NestedEquilibrium,
    finer: Grid,
    effort: &mut Effort,
) -> Found {
    let level = found.levels.last().expect("the leaf has settled");
    let mut state = prolong(&level.leaf, &level.state);
    let guess = match found.levels_for_prediction().as_slice() {
        [_] => InitialGuess::Coarser(state),
        levels => {
            predict(levels, &mut state);
            InitialGuess::Predicted(state)
        }
    };
    settle_next(problem, found, (finer, guess), effort)
}

/// Settles the leaf on the next finer grid from this guess.
fn settle_next(
    problem: &Problem,
    mut found: NestedEquilibrium,
    next: (Grid, InitialGuess),
    effort: &mut Effort,
) -> Found {
    let Settled { level, rest, .. } = settle(problem, &mut found.history, next, effort);
    let found = found.with(level);
    match rest {
        Ok(_) => Ok(found),
        Err(stop) => found.failed(stop),
    }
}

/// The same equilibrium, of any index, on the grid next to the `finest`, predicted from a
/// `coarser` one, too; `None` if Newton's method leads elsewhere.
pub fn on_next_grid(coarser: Option<&Level>, finest: &Level, tolerance: f64) -> Option<Level> {
    let mut state = prolong(&finest.leaf, &finest.state);
    if let Some(coarser) = coarser {
        predict(&[coarser, finest], &mut state);
    }
    let leaf = DiscreteLeaf::new(&finest.leaf.leaf, finest.leaf.grid.refined());
    let mut system = System::new(&leaf);
    // What is held stays where the guess has it, which is predicted from other grids.
    leaf.hold(&mut state);
    let guess = state.clone();
    let newton = Newton {
        accuracy: NEARBY_ACCURACY * tolerance,
        iterations: NEARBY_ITERATIONS,
        work: &mut Work::default(),
        progress: &mut |_, _| {},
    };
    (newton.solve(&leaf, &mut state, &mut system, ANY_SIGN)).ok()?;
    (guess.shift_to(&state) < NEARBY).then_some(Level { leaf, state })
}

/// From the start to rest on the first grid that resolves it. A leaf that had to move far
/// must reach the same equilibrium on two grids.
fn settle_from_start(problem: &Problem, mut grid: Grid, effort: &mut Effort) -> Found {
    let mut found = NestedEquilibrium::begun(problem);
    let mut before: Option<Level> = None;
    let mut failed: Vec<Grid> = Vec::new();
    loop {
        let from_start = (grid.clone(), InitialGuess::Start);
        let settled = settle(problem, &mut found.history, from_start, effort);
        let Settled {
            level,
            rest,
            moved,
            events,
        } = settled;
        if !problem.keeps_unstable() {
            found.path = events.map(|events| Path::Held { events });
        }
        let finer = grid.refined();
        let fixed = problem.segments().is_some();
        let last = fixed || finer.segments() > FINEST_COMPARED || problem.out_of_time();
        match rest {
            // On so coarse a grid the equilibrium that a moving leaf reaches is not reliable.
            _ if problem.too_coarse(level.leaf.segments())
                && (moved || rest.is_err() || largest_turn(&level) > COARSEST_TURN) => {}
            Ok(_) if !moved || fixed => return Ok(found.with(level)),
            Ok(_) => {
                if let Some(coarser) = before.take()
                    && distance(&positions(&coarser, 1), &positions(&level, 2)) < SAME_EQUILIBRIUM
                {
                    return Ok(found.on(vec![coarser, level]));
                }
                if before.is_none()
                    && let [.., coarse, _] = failed.as_slice()
                    && is_confirmed_on(problem, &mut found, &level, coarse.tripled(), effort)
                {
                    let found = found.with(level);
                    return Ok(with_coarser(problem, found, &failed, effort));
                }
                if last {
                    // An equilibrium, but not one to which two grids led.
                    found.unconfirmed = true;
                    return Ok(found.with(level));
                }
                before = Some(level);
            }
            Err(stop) => {
                let at_limit = effort.spent > BUDGET
                    || match stop {
                        Stop::Unresolved => {
                            fixed || finer.segments() > FINEST_RESOLVING || problem.out_of_time()
                        }
                        _ => last,
                    };
                if problem.whole.is_some() || at_limit {
                    return found.with(level).failed(stop);
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
    problem: &Problem,
    found: &mut NestedEquilibrium,
    level: &Level,
    grid: Grid,
    effort: &mut Effort,
) -> bool {
    let from_start = (grid, InitialGuess::Start);
    let Settled {
        level: other, rest, ..
    } = settle(problem, &mut found.history, from_start, effort);
    let (a, b) = (positions(level, 4), positions(&other, 3));
    rest.is_ok() && distance(&a, &b) < SAME_EQUILIBRIUM
}

/// With up to two of the coarser grids that failed from the start, settled from the
/// restricted equilibrium of the only grid so far.
fn with_coarser(
    problem: &Problem,
    mut found: NestedEquilibrium,
    grids: &[Grid],
    effort: &mut Effort,
) -> NestedEquilibrium {
    for grid in grids.iter().rev().take(2) {
        let fine = &found.levels[0];
        let (guess, fine) = (restrict(&fine.state), positions(fine, 2));
        let restricted = (grid.clone(), InitialGuess::Coarser(guess));
        let settled = settle(problem, &mut found.history, restricted, effort);
        let there = distance(&positions(&settled.level, 1), &fine) < SAME_EQUILIBRIUM;
        if settled.rest.is_err() || settled.moved || !there {
            break;
        }
        let coarser = std::iter::once(settled.level);
        let levels = coarser.chain(std::mem::take(&mut found.levels)).collect();
        found = found.on(levels);
    }
    found
}

/// Largest rotation between the ends of a segment.
fn largest_turn(level: &Level) -> f64 {
    let n = level.leaf.segments();
    let rods = level.state.q.chunks_exact(n + 1);
    let ends = rods.flat_map(|rod| rod.windows(2));
    largest(ends.map(|ends| ends[0].angle_between(ends[1])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::Leaf;
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
        let problem = Problem::new(&leaf, &options, 1e-5);
        let mut ignored = |_: &Progress| {};
        let mut effort = Effort::new(&mut ignored);
        let solved = solve(&problem, Grid::new(8, &[]), &mut effort);
        let found = solved.ok().expect("the leaf comes to rest");
        let bar = found.error().unwrap();
        let (finer, own) = (found.finer().unwrap(), found.segments_of_estimate());
        let continued = continue_on(&problem, found.grids(), finer, &mut effort);
        let further = continued.ok().expect("so it does on the next grid");
        assert!(found.keeps_tolerance && found.is_stable() && bar <= 1e-5);
        assert_eq!(further.levels.len(), found.levels.len() + 1);
        let moved = distance(found.table.extrapolated(), further.table.extrapolated());
        assert!(0.0 < moved && moved <= bar, "{moved} beyond {bar}");
        assert!(further.error().unwrap() < bar);
        assert_eq!(
            (found.error(), found.segments_of_estimate()),
            (Some(bar), own)
        );
    }
}
