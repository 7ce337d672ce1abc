//! Nested grids: as fine as the tolerance needs, with an error estimate.

use crate::largest::largest;
use crate::leaf::{DiscreteLeaf, Grid, State, System};
use crate::newton::{Newton, Stop, Work};
use crate::relax::accuracy::richardson::distance;
use crate::relax::loading::arrival::SAME_EQUILIBRIUM;
use crate::relax::nested::{Found, NestedEquilibrium};
use crate::relax::path::Path;
use crate::relax::request::problem::Problem;
use crate::relax::saddle::ANY_SIGN;
use crate::relax::settle::effort::{BUDGET, Effort};
use crate::relax::settle::iteration::{InitialGuess, Settled, settle};
use crate::relax::settle::push::check_stability;
use crate::relax::settle::segments::COARSEST_TURN;
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::predict::predict;
use crate::relax::transfer::prolong::{prolong, restrict};

/// The finest grid for this comparison.
const FINEST_COMPARED: usize = 256;

/// The finest grid that is tried when coarser ones do not resolve the bending.
pub(super) const FINEST_RESOLVING: usize = 2048;

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
    use crate::relax::request::options::{Options, Progress};
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
