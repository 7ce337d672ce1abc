//! How a leaf comes to rest on one grid: from its start or a guess, by the method of the request, off
//! saddles, with the count of its negative eigenvalues; and how many segments the coarsest grid needs.

pub(crate) mod explicit;
pub(crate) mod follower_loads;
pub(crate) mod grips;
pub(crate) mod no_potential;
pub(crate) mod semi_implicit;
pub(crate) mod start;

use crate::leaf::{DiscreteLeaf, Grid, Leaf, LinearSolveOutcome, State, System, half_state};
use crate::memory;
use crate::newton::{DefiniteSolver, EquilibriumFailure, NewtonIteration, SolverCounts};
use crate::relax::accuracy::transfer::{GridLevel, mirror_level, transfer};
use crate::relax::accuracy::{
    History, NestedEquilibrium, RelaxationFailure, StrainEffects, is_large,
};
use crate::relax::log::WorkLog;
use crate::relax::path::{Event, LoadOrder, Route};
use crate::relax::plan::{GRIDS, RelaxationProblem, ValleyPolicy, WORK, WayFromStart};
use crate::relax::request::{MAX_NODES, Options, Progress, RelaxError};
use crate::relax::saddle;
use crate::relax::saddle::saddle_summary;
use crate::relax::solve_on_grid::grips::move_grips;
use crate::relax::solve_on_grid::start::{FAR_FROM_REST, GridRelaxation, disturb, initial_state};
use crate::run::{Limit, RefusedOption};
use crate::scenario::Grip;
use glam::DVec3;

/// Errors of positions and rotations that the iteration on a grid may leave. Half of any of them costs
/// a step of Newton's method on some of the finest grids.
struct IterationErrors {
    /// The error as a part of the tolerance.
    usual: f64,
    /// That part where the first grid is very coarse: a looser iteration there saves a step on the finest.
    from_coarse: f64,
    /// That part on a grid that may be the only one, where the error of the iteration is estimated,
    /// and subtracted, with that of the grid.
    alone: f64,
    /// The error on a fixed grid, whose results are meant for comparisons, in lengths and radians.
    fixed_grid: f64,
}

const ITERATION_ERRORS: IterationErrors = IterationErrors {
    usual: 1e-3,
    from_coarse: 5e-3,
    alone: 5e-2,
    fixed_grid: 1e-12,
};

/// Newton iterations towards an equilibrium of any Morse index, from a start that may be far from it.
const MAX_ITERATIONS: usize = 200;

/// Saddles that a leaf leaves before its relaxation fails.
const MAX_SADDLES: i32 = 10;

/// Accuracy, in the energy norm, of the effects of shear and stretch: stretch dominates this
/// norm, to which displacements contribute little.
const EFFECT_ACCURACY: f64 = 1e-5;

/// The initial guess of the iteration on a grid.
pub enum InitialGuess {
    /// The start of the scenario, disturbed if requested.
    Start,
    /// The equilibrium of the next coarser grid, prolonged.
    Coarser(State),
    /// The equilibrium predicted from those on several coarser grids.
    Predicted(State),
    /// A state displaced from a saddle along its unstable mode.
    Pushed(State),
}

/// A grid, and the initial guess of the iteration there.
pub struct GridGuess {
    pub grid: Grid,
    pub guess: InitialGuess,
}

/// How close the initial guess of the iteration on a grid is to an equilibrium.
#[derive(Clone, Copy)]
struct GuessQuality {
    /// Whether the iteration begins with Newton's method, without a softened leaf.
    near_rest: bool,
    /// Relative accuracy of the conjugate gradients in the first step.
    cg_tolerance: f64,
}

/// The end of the iteration on a grid, converged or not.
pub struct GridSolution {
    pub level: GridLevel,
    /// Remaining error of positions and rotations (lengths, radians), or why the iteration failed.
    pub iteration_error: Result<f64, EquilibriumFailure>,
    /// Whether the leaf had to move through states of non-convex energy, instead of coming to rest in
    /// the valley of the initial guess.
    pub left_convex_valley: bool,
    /// Where a leaf that was moved to its holders lost its stability; `None` if it was not.
    pub events: Option<Vec<Event>>,
}

/// Brings a leaf to rest on one grid; leaves saddles unless they are accepted. A leaf that can turn
/// without resistance is turned to lean down. The `history` is that on the grids before, and goes on here.
pub fn find_grid_equilibrium(
    problem: &RelaxationProblem,
    history: &mut History,
    from: GridGuess,
    effort: &mut WorkLog,
) -> GridSolution {
    let mut settled = find_unleaned_equilibrium(problem, history, from, effort);
    let GridLevel { leaf, state } = &mut settled.level;
    leaf.rotate_to_representative(state);
    settled
}

/// Brings a leaf to rest on one grid. One that can turn without resistance is left where it came to rest.
fn find_unleaned_equilibrium(
    problem: &RelaxationProblem,
    history: &mut History,
    GridGuess { grid, guess }: GridGuess,
    effort: &mut WorkLog,
) -> GridSolution {
    let mut leaf = DiscreteLeaf::new(problem.leaf, grid);
    let mut near_rest = matches!(guess, InitialGuess::Coarser(_) | InitialGuess::Predicted(_));
    let from_start = matches!(guess, InitialGuess::Start);
    let grip = leaf.leaf.has_placed_supports() && from_start;
    let cg_tolerance = match guess {
        InitialGuess::Start | InitialGuess::Pushed(_) => FAR_FROM_REST,
        InitialGuess::Coarser(_) => 1e-4,
        // The interpolation error is dominated by stiff modes; the error to be removed is
        // one of soft modes, a small part of the energy.
        InitialGuess::Predicted(_) => 1e-8,
    };
    let mut state = match guess {
        InitialGuess::Start => scenario_start_state(problem, &leaf),
        InitialGuess::Coarser(state)
        | InitialGuess::Predicted(state)
        | InitialGuess::Pushed(state) => state,
    };
    let (followers, windy) = (leaf.has_followers(), leaf.leaf.in_wind());
    // A leaf that is released in wind moves.
    let grows = match windy {
        true => problem.options.route == Route::Loading,
        false => followers,
    };
    let dead_moment = leaf.has_moments() && !grows && !windy;
    let without_potential = leaf.has_moments() || followers;
    let mut moved = false;
    let mut events = None;
    if grip {
        // What has no potential acts once it is held: only without it the path has an energy to follow.
        let held = match without_potential {
            true => move_grips(problem, &leaf.with_load_potential(), state, effort),
            false => move_grips(problem, &leaf, state, effort),
        };
        (state, moved) = (held.state, held.left_convex_valley);
        near_rest = held.near_rest && !without_potential;
        events = Some(held.events).filter(|_| leaf.leaf.has_potential());
    } else {
        leaf.place_held_nodes(&mut state);
    }
    let explicit = problem.options.method.is_explicit();
    // What was held without wind is not at rest in it; two grids must lead to the same place.
    near_rest &= !(windy && from_start);
    moved |= windy && from_start;
    let quality = GuessQuality {
        near_rest,
        cg_tolerance,
    };
    if grows && !near_rest && !grip {
        let calm = leaf.with_load_potential();
        let loaded = problem.loaded_start.filter(|_| from_start);
        let quality = GuessQuality {
            near_rest: loaded.is_some(),
            ..quality
        };
        if let Some(loaded) = loaded {
            state = transfer(&loaded.leaf, &loaded.state, &calm.grid);
            if problem.whole_leaf.is_some() {
                state = half_state(problem.leaf, &state);
            }
        }
        let mut system = effort.workspace.equations(&calm);
        let level = GridLevel { leaf: calm, state };
        let settled = solve_semi_implicit(problem, history, level, &mut system, quality, effort);
        effort.workspace.take_back(system);
        state = settled.level.state;
        moved |= settled.left_convex_valley;
        if settled.iteration_error.is_err() {
            return GridSolution {
                level: GridLevel { leaf, state },
                iteration_error: settled.iteration_error,
                left_convex_valley: moved,
                events,
            };
        }
    }
    if !explicit && !without_potential && !windy && !problem.keeps_unstable() {
        let mut system = effort.workspace.equations(&leaf);
        let (start, steps) = (from_start.then(|| state.clone()), effort.work.steps);
        let level = GridLevel { leaf, state };
        let settled = solve_semi_implicit(problem, history, level, &mut system, quality, effort);
        if let Some(start) = start {
            history.from_start = Some(WayFromStart {
                distance: start.distance(&settled.level.state),
                steps: effort.work.steps - steps,
            });
        }
        if !is_large(&settled.level.leaf) {
            effort.workspace.take_back(system);
        }
        return GridSolution {
            left_convex_valley: moved || settled.left_convex_valley,
            events,
            ..settled
        };
    }
    let accuracy = accuracy(problem, history, &leaf);
    let mut system = System::new(&leaf);
    let (work, limit) = (&mut effort.work, &problem.options.limit);
    let progress = &mut step_reporter(&mut *effort.progress, leaf.segments());
    let mut relaxation = GridRelaxation {
        near_rest,
        left_convex_valley: moved,
        load_order: problem.load_order,
        ..GridRelaxation::new(state, accuracy, work, progress, limit)
    };
    let rest = match (explicit, dead_moment) {
        _ if grows => {
            match follower_loads::solve_with_followers(&mut leaf, &mut system, &mut relaxation) {
                // Where the path of balances ends the leaf moves on.
                Err(_) if windy && !near_rest => {
                    no_potential::solve_in_wind(&mut leaf, &mut system, &mut relaxation)
                }
                balanced => balanced,
            }
        }
        _ if windy => no_potential::solve_in_wind(&mut leaf, &mut system, &mut relaxation),
        (true, _) => explicit::relax_explicitly(&leaf, &mut system, &mut relaxation),
        (_, true) => no_potential::solve_with_dead_moments(&mut leaf, &mut system, &mut relaxation),
        // To the next equilibrium, stable or not.
        _ => {
            let newton = NewtonIteration {
                accuracy,
                iterations: MAX_ITERATIONS,
                work: relaxation.work,
                progress: relaxation.progress,
            };
            newton.solve(
                &leaf,
                &mut relaxation.state,
                &mut system,
                saddle::INDEFINITE_NEWTON_EQUATIONS,
            )
        }
    };
    let GridRelaxation {
        state,
        left_convex_valley: moved,
        borne_part,
        ..
    } = relaxation;
    let has_grown = grows && rest.is_ok() && problem.load_order == LoadOrder::PotentialFirst;
    effort.borne_part = match has_grown {
        true => None,
        false => borne_part.or(effort.borne_part),
    };
    if explicit || windy {
        history.iteration_error = history.iteration_error.max(rest.unwrap_or(0.0));
    }
    let level = GridLevel { leaf, state };
    GridSolution {
        level,
        iteration_error: rest,
        left_convex_valley: moved,
        events,
    }
}

/// The start of a leaf without an initial guess.
fn scenario_start_state(problem: &RelaxationProblem, leaf: &DiscreteLeaf) -> State {
    if let Some(whole) = problem.whole_leaf {
        let whole = DiscreteLeaf::new(whole, leaf.grid.clone());
        return half_state(problem.leaf, &initial_state(&whole));
    }
    let mut state = initial_state(leaf);
    let how = problem.options.method.semi_implicit();
    if let Some(number) = how.and_then(|how| how.disturbance) {
        disturb(leaf, number, &mut state);
    }
    state
}

/// The error that the iteration on a grid may leave in positions and rotations, in lengths and radians.
fn accuracy(problem: &RelaxationProblem, history: &History, leaf: &DiscreteLeaf) -> f64 {
    let first = history.coarsest.unwrap_or(leaf.segments());
    match problem.segments() {
        Some(_) => ITERATION_ERRORS.fixed_grid,
        None if problem.too_coarse(first) => {
            match history.coarsest.is_none() && problem.may_use_single_grid() {
                true => ITERATION_ERRORS.alone * problem.tolerance,
                false => ITERATION_ERRORS.from_coarse * problem.tolerance,
            }
        }
        None => ITERATION_ERRORS.usual * problem.tolerance,
    }
}

/// Brings a leaf to rest on one grid by the semi-implicit method, off saddles.
fn solve_semi_implicit(
    problem: &RelaxationProblem,
    history: &mut History,
    GridLevel { leaf, state }: GridLevel,
    system: &mut System,
    quality: GuessQuality,
    effort: &mut WorkLog,
) -> GridSolution {
    let accuracy = accuracy(problem, history, &leaf);
    let convex_only = problem.whole_leaf.is_some()
        || problem.valley != ValleyPolicy::MayLeave
        || problem.too_coarse(leaf.segments());
    let nodes = WORK.nodes(&leaf);
    let granted = (WORK.guaranteed * WORK.coarse_segments / leaf.segments())
        .clamp(WORK.guaranteed_on_any_grid, WORK.guaranteed);
    let left = WORK
        .node_evaluations
        .saturating_sub(effort.node_evaluations);
    let allowed = (left / nodes).max(granted);
    let most_evaluations = effort.work.force_evaluations + allowed;
    let (work, limit) = (&mut effort.work, &problem.options.limit);
    let progress = &mut step_reporter(&mut *effort.progress, leaf.segments());
    let mut relaxation = GridRelaxation {
        near_rest: quality.near_rest,
        cg_tolerance: quality.cg_tolerance,
        solver: DefiniteSolver::with_contraction(history.contraction),
        most_evaluations,
        convex_only,
        ..GridRelaxation::new(state, accuracy, work, progress, limit)
    };
    let mut rest = Err(EquilibriumFailure::StepLimit);
    // After earlier pushes off saddles at rest, the softened leaf returned to one.
    for pushes in history.saddle_escapes..history.saddle_escapes + MAX_SADDLES {
        relaxation.saddle_escapes = pushes;
        let before = relaxation.work.force_evaluations;
        let settled = relaxation.relax_semi_implicitly(&leaf, system);
        effort.node_evaluations += nodes * (relaxation.work.force_evaluations - before);
        if let Ok(remaining) = settled {
            history.iteration_error = history.iteration_error.max(remaining);
            if history.coarsest.is_none() && relaxation.solver.direct_solver.is_none() {
                history.strain_effects = strain_effects(&leaf, &relaxation.state, system);
            }
        }
        if settled != Err(EquilibriumFailure::Saddle) || convex_only {
            rest = settled;
            break;
        }
        let state = &mut relaxation.state;
        match saddle::converge_saddle(&leaf, state, system, relaxation.work) {
            Some(0) => {
                rest = Ok(accuracy);
                break;
            }
            Some(index) => history.saddle = Some(saddle_summary(&leaf, state, index)),
            None => {}
        }
        let leaning = problem.options.bias_direction;
        saddle::escape_saddle(&leaf, state, system, leaning, relaxation.work);
        relaxation.near_rest = false;
        relaxation.cg_tolerance = FAR_FROM_REST;
        relaxation.solver.direct_solver = None;
    }
    let GridRelaxation {
        state,
        left_convex_valley: moved,
        ..
    } = relaxation;
    history.contraction = relaxation.solver.contraction;
    let level = GridLevel { leaf, state };
    GridSolution {
        level,
        iteration_error: rest,
        left_convex_valley: moved,
        events: None,
    }
}

/// Reports the steps on a grid of `grid` segments.
fn step_reporter(
    progress: &mut dyn FnMut(&Progress),
    grid: usize,
) -> impl FnMut(usize, f64) + use<'_> {
    move |step, residual| {
        progress(&Progress::Relaxing {
            grid,
            step,
            residual,
        });
    }
}

/// The effects of shear and stretch, by the factorization of the last iteration.
fn strain_effects(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> StrainEffects {
    if system.has_tissue() {
        return StrainEffects::default();
    }
    let mut effect = |dropped: DVec3| {
        leaf.assemble_stiffening(state, dropped, system);
        match system.solve(None, EFFECT_ACCURACY) {
            LinearSolveOutcome::Converged(_) => Some(system.largest_increment().displacement),
            _ => None,
        }
    };
    StrainEffects {
        shear: effect(DVec3::new(0.0, 1.0, 1.0)),
        stretch: effect(DVec3::X),
    }
}

/// What is known of the stability of a leaf on one grid.
struct Count {
    /// Whether the leaf is clearly stable.
    clearly_stable: bool,
    /// The number of negative eigenvalues, if it is known; `None` if they were not counted.
    index: Option<Option<usize>>,
}

/// Counts the negative eigenvalues on one grid, and whether the leaf is clearly stable. If
/// it is not and will be `compared` with another grid nothing is counted.
fn count_negative(
    problem: &RelaxationProblem,
    level: &GridLevel,
    system: &mut System,
    compared: bool,
    work: &mut SolverCounts,
) -> Count {
    let GridLevel { leaf, state } = level;
    let clearly_stable = saddle::clearly_stable(leaf, state, system, work);
    let index = match clearly_stable {
        true => Some(0),
        false if compared => {
            return Count {
                clearly_stable,
                index: None,
            };
        }
        false if leaf.neutral_shift() > saddle::NOISY_EIGENVALUE_THRESHOLD => {
            let within = saddle::index_within_rounding(leaf, state, system, work);
            // Whatever is unstable is pushed off, however many its unstable modes.
            let known = |&[least, most]: &[usize; 2]| {
                least == most || (least > 0 && !problem.keeps_unstable())
            };
            within.filter(known).map(|[least, _]| least)
        }
        false => saddle::index(leaf, state, system, 0.0, work),
    };
    Count {
        clearly_stable,
        index: Some(index),
    }
}

/// A leaf whose negative eigenvalues were counted on its finest grid.
pub struct StabilityCheck {
    pub found: NestedEquilibrium,
    /// Whether stability is known, as far as possible; if not, finer grids are needed.
    pub known: bool,
}

impl StabilityCheck {
    fn new(found: NestedEquilibrium, known: bool) -> Self {
        StabilityCheck { found, known }
    }
}

/// Counts the negative eigenvalues on the finest grid. On the first, unless it is the `last`,
/// the leaf must be clearly stable. If saddles are accepted the number must be that on the
/// grid before. Otherwise the leaf is pushed off a saddle, and the grids start again from the
/// equilibrium reached.
pub fn check_stability(
    problem: &RelaxationProblem,
    mut found: NestedEquilibrium,
    last: bool,
    effort: &mut WorkLog,
) -> Result<StabilityCheck, Box<RelaxationFailure>> {
    let level = found.levels.last().expect("the leaf is at rest on a grid");
    if !level.leaf.leaf.has_potential() {
        return Ok(StabilityCheck::new(found, true));
    }
    let compared = !last && found.levels.len() == 1 && problem.segments().is_none();
    if problem.whole_leaf.is_some() || problem.valley == ValleyPolicy::StayOnBranch {
        let level = match problem.whole_leaf {
            Some(whole) => mirror_level(problem.leaf, whole, level),
            None => level.clone(),
        };
        let mut system = System::new(&level.leaf);
        let count = count_negative(problem, &level, &mut system, compared, &mut effort.work);
        let index = count.index.unwrap_or(found.index);
        let found = found.with_index(count.clearly_stable, index);
        return match (count.index, found.index) {
            (None, _) => Ok(StabilityCheck::new(found, false)),
            (_, Some(0)) => Ok(StabilityCheck::new(found, true)),
            _ => found.into_failure(EquilibriumFailure::Saddle),
        };
    }
    let before = found.index;
    let mut level = found.take_finest();
    if found.levels.is_empty() && !effort.workspace.fits(&level.leaf) {
        // Further grids have equations of their own.
        let linear = found.factorized_level.take();
        if let Some(linear) = linear {
            effort.workspace.take_back(linear.system);
        }
    }
    let mut system = effort.workspace.equations(&level.leaf);
    let work = &mut effort.work;
    let mut count = count_negative(problem, &level, &mut system, compared, work);
    if matches!(count.index, Some(Some(1..))) && !problem.keeps_unstable() {
        let GridLevel { leaf, state } = &mut level;
        let exact = saddle::converge_saddle(leaf, state, &mut system, work);
        count.index = exact.map(Some).or(count.index);
    }
    found = found.with_index(count.clearly_stable, count.index.unwrap_or(before));
    let Some(Some(index @ 1..)) = count.index else {
        let known = count.index.is_some();
        return Ok(StabilityCheck::new(found.rejoin_finest(level), known));
    };
    if problem.keeps_unstable() {
        let known = before == found.index || problem.segments().is_some();
        return Ok(StabilityCheck::new(found.rejoin_finest(level), known));
    }
    if problem.valley == ValleyPolicy::Stay {
        return found
            .rejoin_finest(level)
            .into_failure(EquilibriumFailure::Saddle);
    }
    found.history.saddle = Some(saddle_summary(&level.leaf, &level.state, index));
    found.history.saddle_escapes += 1;
    if found.history.saddle_escapes > MAX_SADDLES {
        return found
            .rejoin_finest(level)
            .into_failure(EquilibriumFailure::StepLimit);
    }
    let GridLevel { leaf, mut state } = level;
    let leaning = problem.options.bias_direction;
    saddle::escape_saddle(&leaf, &mut state, &mut system, leaning, work);
    let pushed = GridGuess {
        grid: leaf.grid,
        guess: InitialGuess::Pushed(state),
    };
    let GridSolution {
        level,
        iteration_error: rest,
        ..
    } = find_grid_equilibrium(problem, &mut found.history, pushed, effort);
    let found = found.with_levels(vec![level]);
    match (rest, problem.segments()) {
        (Err(stop), _) => found.into_failure(stop),
        (Ok(_), Some(_)) => check_stability(problem, found, last, effort),
        (Ok(_), None) => Ok(StabilityCheck::new(found, false)),
    }
}

/// Tolerance of an equilibrium to which a leaf moves on its own on one grid.
const MOVED_TO_TOLERANCE: f64 = 1e-6;

/// The stable equilibrium that a leaf reaches from a state on a grid without initial velocity:
/// saddles are left. `None` if it does not come to rest.
pub fn relax_from_state(leaf: &Leaf, grid: &Grid, state: State, limit: &Limit) -> Option<State> {
    let options = Options {
        limit: limit.clone(),
        ..Options::default()
    };
    let problem = RelaxationProblem::new(leaf, &options, MOVED_TO_TOLERANCE);
    let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
    let mut effort = WorkLog::new(ignored);
    let mut found = NestedEquilibrium::without_grids(&problem);
    let from = GridGuess {
        grid: grid.clone(),
        guess: InitialGuess::Pushed(state),
    };
    let settled = find_grid_equilibrium(&problem, &mut found.history, from, &mut effort);
    settled.iteration_error.ok()?;
    let mut check = StabilityCheck::new(found.with_finer_level(settled.level), false);
    while !check.known {
        check = check_stability(&problem, check.found, true, &mut effort).ok()?;
    }
    check.found.levels.pop().map(|level| level.state)
}

/// Rotation per segment (radians) that the coarsest grid must resolve where rest curvature and
/// dead moments alone determine it, and the largest allowed at rest on the coarsest grid of a
/// loose tolerance.
pub const COARSEST_TURN: f64 = 0.8;

/// Segments of a grid: as requested, or at least `least` and as many as the kinks of the
/// profiles, the rest shape and the dead moments need.
pub fn check_segments(
    leaf: &Leaf,
    requested: Option<usize>,
    least: usize,
) -> Result<usize, RelaxError> {
    let panels = leaf.kinks().len() + 1;
    let found = requested.unwrap_or_else(|| coarsest(leaf, least).max(panels));
    let (rods, segments, least) = (leaf.rods(), found, panels);
    let nodes = rods.saturating_mul(segments);
    if found < least {
        let why = format!(
            "at least {least} are needed, one for every piece between the knots of the profiles"
        );
        return Err(RefusedOption::new("segments", found, why).into());
    }
    if nodes > MAX_NODES {
        return Err(RelaxError::TooManyNodes {
            rods,
            segments,
            nodes,
        });
    }
    memory::check_grid_memory(rods, segments)?;
    Ok(segments)
}

/// Least segments of a span between holders on the coarsest grid, where positions on all grids are compared. In the
/// middle of a span the deflection may vanish on every grid: an antisymmetric one does.
const LEAST_SPAN_SEGMENTS: usize = 4;

/// The largest factor by which that refines the coarsest grid.
const LARGEST_SPAN_REFINEMENT: usize = 4;

/// Whether rigid grips divide a vein into spans of which some have too few segments to be compared.
pub fn has_coarse_span(leaf: &Leaf, segments: usize) -> bool {
    let grips = &leaf.scenario().grips;
    let grid = Grid::new(segments, leaf.kinks());
    let is_coarse = |vein: usize, to: f64| {
        let beside = grips.iter().filter(|it| it.vein == vein);
        let before = beside.map(|it| it.at[1]).filter(|end| *end < to);
        let from = before.fold(0.0, f64::max);
        let count = grid
            .nearest_node(to)
            .saturating_sub(grid.nearest_node(from));
        (1..LEAST_SPAN_SEGMENTS).contains(&count)
    };
    let held_tip = leaf.tip_support.is_some();
    let is_coarse_beside =
        |grip: &Grip| is_coarse(grip.vein, grip.at[0]) || held_tip && is_coarse(grip.vein, 1.0);
    grips.iter().any(is_coarse_beside)
}

/// Segments of the finest grid that is tried where coarser ones do not resolve the bending: as many as usual, or as
/// rest curvature and dead moments alone need.
pub fn finest_resolving(leaf: &Leaf) -> usize {
    let wound = 2 * coarsest(leaf, 1);
    GRIDS.finest_resolving.max(wound).min(GRIDS.finest)
}

/// Segments of the coarsest grid: `least`, or as many as resolve rest curvature, dead moments and spans between
/// holders.
pub fn coarsest(leaf: &Leaf, least: usize) -> usize {
    let moment = leaf.moment_integral_bound();
    let turn = |j: usize| {
        let section = leaf.section(j, 0.5, 1.0);
        let bending = moment / section.couple_stiffness.min_element();
        (section.rest_curvature.length() + bending) * leaf.length(j)
    };
    let turn = match no_potential::moment_curvature(leaf, GRIDS.finest) {
        Some(rate) => rate * leaf.length(0),
        None => (0..leaf.rods()).map(turn).fold(0.0, f64::max),
    };
    let mut segments = match leaf.scenario().blade {
        Some(_) => least.max(GRIDS.coarsest_of_blade),
        None => least,
    };
    while (segments as f64) * COARSEST_TURN < turn && segments < GRIDS.finest {
        segments *= 2;
    }
    let most = (LARGEST_SPAN_REFINEMENT * segments).min(GRIDS.finest);
    while segments < most && has_coarse_span(leaf, segments) {
        segments *= 2;
    }
    segments
}
