//! The iteration to equilibrium on one grid.

use crate::leaf::{DiscreteLeaf, Grid, Solved, State, System, half_of};
use crate::newton::{Definite, Newton, Stop};
use crate::relax::nested::History;
use crate::relax::nested::error::is_large;
use crate::relax::path::Event;
use crate::relax::request::method::{Method, SemiImplicit};
use crate::relax::request::options::Progress;
use crate::relax::request::problem::Problem;
use crate::relax::saddle;
use crate::relax::saddle::saddle_of;
use crate::relax::settle::effort::{BUDGET, Effort};
use crate::relax::settle::grip::move_grips;
use crate::relax::settle::methods::{FAR_FROM_REST, Relaxation, explicit, moment, wind};
use crate::relax::settle::start::{disturb, start};
use crate::relax::transfer::level::Level;
use glam::DVec3;

/// Iteration error allowed on each grid, as a part of the tolerance: if the first grid is very
/// coarse, a looser one saves a step on the finest. On a grid that may be the only one it is
/// estimated, and subtracted, with the error of the grid.
const ITERATION_PART: f64 = 1e-3;
const ITERATION_PART_FROM_COARSE: f64 = 5e-3;
const ITERATION_PART_ALONE: f64 = 5e-2;

/// Iteration error allowed on a fixed grid, whose results are meant for comparisons.
const FIXED_ACCURACY: f64 = 1e-12;

/// Force evaluations that any leaf may use on every grid, whatever was spent before; on grids
/// of more segments than [`COARSE`] proportionally fewer, but no less than the second number.
const LEAST_EVALUATIONS: (usize, usize) = (600, 100);
const COARSE: usize = 64;

/// Newton iterations towards an equilibrium of any kind.
const MAX_ITERATIONS: usize = 200;

/// Saddles that are left before the run fails.
pub const MAX_SADDLES: i32 = 10;

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

/// The end of the iteration on a grid, converged or not.
pub struct Settled {
    pub level: Level,
    /// The remaining iteration error.
    pub rest: Result<f64, Stop>,
    /// Whether it had to move through states of non-convex energy, instead of settling in the
    /// valley of the initial guess.
    pub moved: bool,
    /// Where a leaf that was moved to its holders lost its stability; `None` if it was not.
    pub events: Option<Vec<Event>>,
}

/// Settles on one grid; leaves saddles unless they are accepted. A leaf that can turn without
/// resistance leans down. The `history` is that on the grids before, and goes on here.
pub fn settle(
    problem: &Problem,
    history: &mut History,
    (grid, guess): (Grid, InitialGuess),
    effort: &mut Effort,
) -> Settled {
    let mut settled = settle_upright(problem, history, (grid, guess), effort);
    let Level { leaf, state } = &mut settled.level;
    leaf.lean_down(state);
    settled
}

/// The same without leaning.
fn settle_upright(
    problem: &Problem,
    history: &mut History,
    (grid, guess): (Grid, InitialGuess),
    effort: &mut Effort,
) -> Settled {
    let mut leaf = DiscreteLeaf::new(problem.leaf, grid);
    let mut near_rest = matches!(guess, InitialGuess::Coarser(_) | InitialGuess::Predicted(_));
    let from_start = matches!(guess, InitialGuess::Start);
    let grip = leaf.leaf.is_held() && from_start;
    let cg_tolerance = match guess {
        InitialGuess::Start | InitialGuess::Pushed(_) => FAR_FROM_REST,
        InitialGuess::Coarser(_) => 1e-4,
        // The interpolation error is dominated by stiff modes; the error to be removed is
        // one of soft modes, a small part of the energy.
        InitialGuess::Predicted(_) => 1e-8,
    };
    let mut state = match guess {
        InitialGuess::Start => start_of(problem, &leaf),
        InitialGuess::Coarser(state)
        | InitialGuess::Predicted(state)
        | InitialGuess::Pushed(state) => state,
    };
    let dead_moment = leaf.has_moments();
    let mut moved = false;
    let mut events = None;
    if grip {
        // Dead moments act once it is held: only without them the path has an energy to follow.
        let held = match dead_moment {
            true => move_grips(problem, &leaf.without_moments(), state, effort),
            false => move_grips(problem, &leaf, state, effort),
        };
        (state, moved) = (held.state, held.moved);
        near_rest = held.near_rest && !dead_moment;
        events = Some(held.events).filter(|_| leaf.leaf.has_potential());
    } else {
        leaf.hold(&mut state);
    }
    let explicit = matches!(problem.options.method, Method::Explicit { .. });
    let windy = leaf.leaf.in_wind();
    // What was held without wind is not at rest in it; two grids must lead to the same place.
    near_rest &= !(windy && from_start);
    moved |= windy && from_start;
    if !explicit && !dead_moment && !windy && !problem.keeps_unstable() {
        let how = (near_rest, cg_tolerance);
        effort.spare_system = None;
        let mut system = System::new(&leaf);
        let begun = from_start.then(|| (state.clone(), effort.work.steps));
        let settled =
            settle_semi_implicit((problem, history), (leaf, state), &mut system, how, effort);
        if let Some((begun, steps)) = begun {
            let distance = begun.distance(&settled.level.state);
            history.from_start = Some((distance, effort.work.steps - steps));
        }
        effort.spare_system = (!is_large(&settled.level.leaf)).then_some(system);
        return Settled {
            moved: moved || settled.moved,
            events,
            ..settled
        };
    }
    let accuracy = accuracy(problem, history, &leaf);
    let mut system = System::new(&leaf);
    let progress = &mut step_reporter(&mut *effort.progress, leaf.segments());
    let out = (&mut effort.work, progress as &mut dyn FnMut(usize, f64));
    let mut relaxation = Relaxation {
        near_rest,
        moved,
        ..Relaxation::new(state, accuracy, out, &problem.options.limit)
    };
    let rest = match (explicit, dead_moment) {
        _ if windy => wind::settle_in_wind(&mut leaf, &mut system, &mut relaxation),
        (true, _) => explicit::settle(&leaf, &mut system, &mut relaxation),
        (_, true) => moment::settle_with_dead_moments(&mut leaf, &mut system, &mut relaxation),
        // To the next equilibrium, stable or not.
        _ => {
            let newton = Newton {
                accuracy,
                iterations: MAX_ITERATIONS,
                work: relaxation.work,
                progress: relaxation.progress,
            };
            newton.solve(&leaf, &mut relaxation.state, &mut system, saddle::ANY_SIGN)
        }
    };
    let Relaxation { state, moved, .. } = relaxation;
    if explicit || windy {
        history.remaining = history.remaining.max(rest.unwrap_or(0.0));
    }
    let level = Level { leaf, state };
    Settled {
        level,
        rest,
        moved,
        events,
    }
}

/// The start of a leaf without an initial guess.
pub(in crate::relax) fn start_of(problem: &Problem, leaf: &DiscreteLeaf) -> State {
    if let Some(whole) = problem.whole {
        let whole = DiscreteLeaf::new(whole, leaf.grid.clone());
        return half_of(problem.leaf, &start(&whole));
    }
    let mut state = start(leaf);
    if let Method::SemiImplicit(SemiImplicit {
        disturbance: Some(number),
        ..
    }) = problem.options.method
    {
        disturb(leaf, number, &mut state);
    }
    state
}

/// Iteration error allowed on a grid.
fn accuracy(problem: &Problem, history: &History, leaf: &DiscreteLeaf) -> f64 {
    let first = history.coarsest.unwrap_or(leaf.segments());
    match problem.segments() {
        Some(_) => FIXED_ACCURACY,
        None if problem.too_coarse(first) => {
            match history.coarsest.is_none() && problem.may_be_alone() {
                true => ITERATION_PART_ALONE * problem.tolerance,
                false => ITERATION_PART_FROM_COARSE * problem.tolerance,
            }
        }
        None => ITERATION_PART * problem.tolerance,
    }
}

/// Settles by the semi-implicit method.
fn settle_semi_implicit(
    (problem, history): (&Problem, &mut History),
    (leaf, state): (DiscreteLeaf, State),
    system: &mut System,
    (near_rest, cg_tolerance): (bool, f64),
    effort: &mut Effort,
) -> Settled {
    let accuracy = accuracy(problem, history, &leaf);
    let convex_only =
        problem.whole.is_some() || problem.stays_in_valley || problem.too_coarse(leaf.segments());
    let nodes = leaf.rods() * leaf.segments();
    let (most, least) = LEAST_EVALUATIONS;
    let granted = (most * COARSE / leaf.segments()).clamp(least, most);
    let allowed = (BUDGET.saturating_sub(effort.spent) / nodes).max(granted);
    let most_evaluations = effort.work.force_evaluations + allowed;
    let progress = &mut step_reporter(&mut *effort.progress, leaf.segments());
    let out = (&mut effort.work, progress as &mut dyn FnMut(usize, f64));
    let mut relaxation = Relaxation {
        near_rest,
        cg_tolerance,
        solver: Definite::after(history.contraction),
        most_evaluations,
        convex_only,
        ..Relaxation::new(state, accuracy, out, &problem.options.limit)
    };
    let mut rest = Err(Stop::StepLimit);
    // After earlier pushes off saddles at rest, the softened leaf returned to one.
    for pushes in history.pushes..history.pushes + MAX_SADDLES {
        relaxation.pushes = pushes;
        let before = relaxation.work.force_evaluations;
        let settled = relaxation.settle(&leaf, system);
        effort.spent += nodes * (relaxation.work.force_evaluations - before);
        if let Ok(remaining) = settled {
            history.remaining = history.remaining.max(remaining);
            if history.coarsest.is_none() && relaxation.solver.direct.is_none() {
                history.effects = effects(&leaf, &relaxation.state, system);
            }
        }
        if settled != Err(Stop::Saddle) || convex_only {
            rest = settled;
            break;
        }
        let state = &mut relaxation.state;
        match saddle::polish(&leaf, state, system, relaxation.work) {
            Some(0) => {
                rest = Ok(accuracy);
                break;
            }
            Some(index) => history.saddle = Some(saddle_of(&leaf, state, index)),
            None => {}
        }
        let leaning = problem.options.leaning;
        saddle::push_off(&leaf, state, system, leaning, relaxation.work);
        relaxation.near_rest = false;
        relaxation.cg_tolerance = FAR_FROM_REST;
        relaxation.solver.direct = None;
    }
    let Relaxation { state, moved, .. } = relaxation;
    history.contraction = relaxation.solver.contraction;
    let level = Level { leaf, state };
    Settled {
        level,
        rest,
        moved,
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

/// Largest displacements, to first order, if shear, or stretch, were suppressed; uses the
/// factorisation of the last iteration.
fn effects(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> [Option<f64>; 2] {
    if system.tied() {
        return [None; 2];
    }
    [DVec3::new(0.0, 1.0, 1.0), DVec3::X].map(|dropped| {
        leaf.assemble_stiffening(state, dropped, system);
        match system.solve(None, EFFECT_ACCURACY) {
            Solved::Yes(_) => Some(system.largest().1),
            _ => None,
        }
    })
}
