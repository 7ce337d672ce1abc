//! From a scenario to rest on nested grids: the problem, the start, rest on one grid, finer ones,
//! the decision on stability, and the result.
//!
//! What is asked of nested grids: which leaf is to come to rest, and how accurately.
//!
//! What the way to rest has cost so far, and what it leaves for reuse.

use crate::leaf::{Grid, Leaf, Loads, System};
use crate::newton::SolverCounts;
use crate::relax::accuracy::{History, NestedEquilibrium, RelaxationResult, result_with_path};
use crate::relax::eigenvalues;
use crate::relax::eigenvalues::EigenvalueRequest;
use crate::relax::loading::arrival::{
    follow_load_path, guess, load_slowly, solve_from_guesses, solve_from_start, takes_loads_stably,
};
use crate::relax::path::{Path, Route, Stage};
use crate::relax::remark::{EquilibriumDoubt, EquilibriumRemark};
use crate::relax::request::{
    Method, Options, Progress, RelaxError, SemiImplicit, check_hinge_equilibrium, check_tolerance,
    check_wind_options,
};
use crate::relax::result::{Equilibrium, Outcome, report};
use crate::relax::solve_on_grid::{
    check_segments, explicit, least_segments, may_solve_half, softens,
};
use crate::relax::stability::{Decision, Verdict, decide};
use crate::run::Instant;
use crate::scenario::Scenario;

/// A leaf that rests so near to the arcs from which it starts (lengths, radians), after so few
/// steps of Newton's method without softened rods, rests where slow loading leads, stably if its veins
/// take their loads stably: so did all of 5000 random leaves. Those of up to 3 lengths that ended elsewhere had taken 20 steps and more;
/// of stiff leaves, which are softened on their way from arcs, 3 in 1000 end elsewhere.
const FIRST_VALLEY_BOUNDS: (f64, usize) = (2.0, 8);

/// Relaxes on nested grids, fine enough for forces and eigenvalues too or for the `shape_alone`;
/// also returns the leaf on these grids.
pub(crate) fn relax_on_grids(
    scenario: &Scenario,
    options: &Options,
    shape_alone: bool,
    progress: &mut dyn FnMut(&Progress),
) -> Result<(Equilibrium, NestedEquilibrium), RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    check_wind_options(scenario, options)?;
    check_hinge_equilibrium(scenario)?;
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    if let Method::Explicit { .. } = options.method {
        explicit::check(&leaf)?;
    }
    let method = options.method;
    // Four segments are too few to be divided among panels, and for the layers of tissue.
    let few = shape_alone && leaf.kinks().is_empty() && !leaf.has_tissue();
    // What a held leaf comes to depends on the way of its holders, which few segments would change.
    let least = match leaf.has_placed_supports() {
        true => COARSEST,
        false => least_segments(method, tolerance, few),
    };
    let first = check_segments(&leaf, method.segments(), least)?;
    let half = may_solve_half(method).then(|| leaf.mirror_half()).flatten();
    let problem = RelaxationProblem {
        planar: may_solve_half(method) && leaf.is_planar(),
        shape_alone,
        ..RelaxationProblem::new(&leaf, options, tolerance)
    };
    let mut effort = WorkLog::new(progress);
    let grid = Grid::new(first, leaf.kinks());
    let found = find_rest(&problem, half.as_ref(), grid, &mut effort);
    Ok(equilibrium_with_stability(
        &problem,
        found,
        clock,
        &mut effort,
    ))
}

/// Brings the leaf to rest, its `half` where that is enough.
fn find_rest<'a>(
    problem: &RelaxationProblem<'a>,
    half: Option<&'a Leaf>,
    grid: Grid,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let slowly = problem.loads_slowly();
    // Where Newton's method alone leads from arcs to rest nearby, through convex states only,
    // the path need not be walked.
    let in_valley = slowly
        && matches!(problem.options.method, Method::SemiImplicit(_))
        && !softens(problem.leaf);
    if in_valley || !slowly && half.is_some() {
        let reduced = RelaxationProblem {
            stays_in_valley: in_valley,
            ..problem.reduced_to_half(half)
        };
        let found = solve_from_start(&reduced, grid.clone(), effort);
        if half.is_some() {
            effort.spare_system = None;
        }
        if let Ok(found) = found
            && found.is_stable()
            && (!slowly || is_in_first_valley(&found.history))
            && (!slowly || takes_loads_stably(problem, &found, effort))
        {
            let path = problem.undisturbed_path();
            return Ok(found.mirrored_to_whole(&reduced).with_path(path));
        }
        // The reduced model fails, as the leaf leaves its valley or breaks the mirror symmetry:
        // solve the full leaf.
        effort.spare_system = None;
    }
    if slowly {
        return load_slowly(problem, half, effort);
    }
    match solve_from_start(problem, grid, effort) {
        Err(_) if problem.may_be_loaded_instead() => {
            effort.spare_system = None;
            load_slowly(problem, None, effort)
        }
        found => result_with_path(found, problem.undisturbed_path()),
    }
}

/// Whether Newton's method alone came to rest from the start, so near that this is where
/// slow loading leads.
fn is_in_first_valley(history: &History) -> bool {
    let near = |(distance, steps): (f64, usize)| {
        distance < FIRST_VALLEY_BOUNDS.0 && steps <= FIRST_VALLEY_BOUNDS.1
    };
    history.from_start.is_some_and(near) && history.saddle.is_none()
}

/// Rest from the start, on this grid and finer ones.
fn find_rest_on_grid(
    problem: &RelaxationProblem,
    grid: Grid,
    effort: &mut WorkLog,
) -> Option<NestedEquilibrium> {
    if !problem.loads_slowly() {
        let found = solve_from_start(problem, grid.clone(), effort);
        if found.is_ok() || !problem.may_be_loaded_instead() {
            return found.ok();
        }
    }
    let arrived = follow_load_path(problem, grid, effort).ok()?;
    let mut begun = NestedEquilibrium::without_grids(problem).with_path(Some(arrived.path));
    let guess = guess(problem, &mut begun.history, arrived.level, effort);
    solve_from_guesses(problem, begun, vec![guess], effort).ok()
}

/// The result, with the stability of a leaf at rest decided and its modes: requested modes are
/// not counted in the time of the solution, unless stability depends on them.
pub(super) fn equilibrium_with_stability(
    problem: &RelaxationProblem,
    found: RelaxationResult,
    clock: Instant,
    effort: &mut WorkLog,
) -> (Equilibrium, NestedEquilibrium) {
    let requested = problem.options.modes;
    let before = clock.elapsed().as_secs_f64();
    let (decision, stopped) = match found {
        Ok(found) => {
            let again = |grid, effort: &mut WorkLog| find_rest_on_grid(problem, grid, effort);
            (decide(problem, found, effort, &again), None)
        }
        Err(failure) => (Decision::without_decision(failure.at), Some(failure.stop)),
    };
    let wall = match decision.needed || requested == 0 {
        true => clock.elapsed().as_secs_f64(),
        false => before,
    };
    let found = decision.found.with_work(effort.work);
    let outcome = report::outcome(problem, &found, stopped, effort.farthest_stage);
    let mut leaf = report::equilibrium(problem, &found, outcome, wall);
    if matches!(leaf.path, Some(Path::Held { .. })) && !leaf.outcome.is_at_rest() {
        // What the way was like, it did not end where the leaf is held.
        leaf.path = None;
    }
    leaf.doubts = report::implausible_properties(problem.leaf.scenario(), &leaf);
    let doubt = (leaf.path.as_ref()).and_then(|path| path.doubt(problem.options.route));
    let unconfirmed = doubt.is_none() && found.unconfirmed && leaf.outcome.is_at_rest();
    leaf.doubts.extend(doubt);
    leaf.doubts
        .extend(unconfirmed.then_some(EquilibriumDoubt::UnconfirmedEquilibrium));
    leaf.apply_stability_verdict(decision.verdict);
    let modes = decision.modes.or_else(|| {
        let list = EigenvalueRequest::requested(problem);
        (stopped.is_none()).then(|| eigenvalues::lowest(problem, &found, list))?
    });
    leaf.stability.modes = modes.map(|it| it.modes);
    (leaf, found)
}

impl Equilibrium {
    /// Takes the Morse index by extrapolated eigenvalues, if it is known, where those of single
    /// grids may have other signs.
    fn apply_stability_verdict(&mut self, verdict: Verdict) {
        let index = match verdict {
            Verdict::AsCounted => return,
            Verdict::Undecided(certain)
                if certain > self.stability.negative_eigenvalues.unwrap_or(0) =>
            {
                self.doubts.push(EquilibriumDoubt::UndecidedIndex);
                certain
            }
            Verdict::Undecided(_) => {
                self.doubts.push(EquilibriumDoubt::UndecidedStability);
                return;
            }
            Verdict::Unknown => {
                self.doubts.push(EquilibriumDoubt::UndecidedStability);
                self.stability.negative_eigenvalues = None;
                return;
            }
            Verdict::Index(index) => index,
        };
        let unknown = (self.stability.negative_eigenvalues.replace(index)).is_none();
        if !self.outcome.is_success() {
            return;
        }
        if index > 0 {
            self.outcome = Outcome::Saddle;
            self.remark = Some(EquilibriumRemark::BeyondBifurcation);
        } else if unknown {
            // It said so.
            self.remark = None;
        }
    }
}

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
pub const COARSEST: usize = 8;

/// The smallest tolerance for which the first grid is tried alone: below it nodes would be too
/// few for stations between them.
const SMALLEST_SINGLE_GRID_TOLERANCE: f64 = 5e-7;

/// Largest number of corrections by the estimated error.
const CORRECTIONS: usize = 4;

/// The leaf that is to come to rest, and how.
#[derive(Clone, Copy)]
pub struct RelaxationProblem<'a> {
    pub leaf: &'a Leaf,
    /// The full leaf, if `leaf` is half of it.
    pub whole_leaf: Option<&'a Leaf>,
    pub options: &'a Options,
    pub tolerance: f64,
    /// Whether only the shape and its stability are requested, without forces on the grids,
    /// eigenvalues or derivatives.
    pub shape_alone: bool,
    /// Whether to tell that the rods stay in their plane, as nothing acts out of it.
    pub planar: bool,
    /// Whether it fails where the leaf would have to leave the valley of its initial guess.
    pub stays_in_valley: bool,
}

impl<'a> RelaxationProblem<'a> {
    /// The leaf with forces and eigenvalues, wherever it comes to rest.
    pub fn new(leaf: &'a Leaf, options: &'a Options, tolerance: f64) -> Self {
        RelaxationProblem {
            leaf,
            whole_leaf: None,
            options,
            tolerance,
            shape_alone: false,
            planar: false,
            stays_in_valley: false,
        }
    }

    /// The same for the half of the leaf, if there is one.
    pub fn reduced_to_half(self, half: Option<&'a Leaf>) -> Self {
        match half {
            None => self,
            Some(half) => RelaxationProblem {
                leaf: half,
                whole_leaf: Some(self.leaf),
                ..self
            },
        }
    }

    /// Segments of the fixed grid, if there is one.
    pub fn segments(&self) -> Option<usize> {
        self.options.method.segments()
    }

    /// Whether unstable equilibria are accepted.
    pub fn keeps_unstable(&self) -> bool {
        matches!(self.options.method, Method::SemiImplicit(how) if how.keep_unstable)
    }

    /// Whether the time limit is reached or the run is cancelled.
    pub fn out_of_time(&self) -> bool {
        self.options.limit.reached()
    }

    /// Whether a grid is so coarse that it only serves leaves that settle in the valley they
    /// start in.
    pub fn too_coarse(&self, segments: usize) -> bool {
        self.segments().is_none() && segments < COARSEST
    }

    /// Whether the leaf is loaded slowly, rather than released.
    pub fn loads_slowly(&self) -> bool {
        let disturbed = |how: SemiImplicit| how.keep_unstable || how.disturbance.is_some();
        let released = match self.options.method {
            Method::SemiImplicit(how) => disturbed(how),
            _ => false,
        };
        // What is held is moved to its holder by a method of its own; without loads hinges turn freely.
        self.options.route == Route::LoadedLeaf
            && !released
            && !self.leaf.has_placed_supports()
            && !self.leaf.hinged()
            && self.leaf.loads != Loads::default()
            && !self.leaf.loads.has_moments()
    }

    /// Whether a leaf that was released may be loaded slowly.
    pub fn may_be_loaded_instead(&self) -> bool {
        let settles = matches!(
            self.options.method,
            Method::SemiImplicit(how) if !how.keep_unstable && how.disturbance.is_none()
        );
        settles
            && self.options.route == Route::LoadedLeaf
            && !self.leaf.has_placed_supports()
            && !self.leaf.hinged()
            && !self.leaf.loads.has_moments()
            && !self.out_of_time()
    }

    /// The path of the leaf as far as nothing happens on it, if it has one.
    pub fn undisturbed_path(&self) -> Option<Path> {
        if self.loads_slowly() {
            return Some(Path::STABLE);
        }
        let released = self.options.route == Route::Release && !self.keeps_unstable();
        let moved = self.leaf.has_placed_supports() || self.leaf.loads.has_moments();
        (released && !moved).then_some(Path::Released)
    }

    /// The largest number of corrections.
    pub fn corrections(&self) -> usize {
        let grids = matches!(self.options.method, Method::SemiImplicit(_));
        let free = !self.leaf.has_placed_supports() && self.segments().is_none();
        match grids && free && self.shape_alone {
            true => CORRECTIONS,
            false => 0,
        }
    }

    /// Whether the first grid may be enough.
    pub fn may_use_single_grid(&self) -> bool {
        self.corrections() > 0 && self.tolerance >= SMALLEST_SINGLE_GRID_TOLERANCE
    }
}

/// Limit on nodes times force evaluations for a leaf to come to rest: some seconds.
pub const BUDGET: usize = 10_000_000;

/// Counts of the work on all grids, whatever becomes of them, and its progress.
pub struct WorkLog<'o> {
    pub progress: &'o mut dyn FnMut(&Progress),
    pub work: SolverCounts,
    /// Nodes times force evaluations so far.
    pub node_evaluations: usize,
    /// Nodes times force evaluations of all walks.
    pub loading_node_evaluations: usize,
    /// How far the leaf came on its path before it failed.
    pub farthest_stage: Option<(Stage, f64)>,
    /// The linear system of the last grid, for reuse.
    pub spare_system: Option<System>,
}

impl<'o> WorkLog<'o> {
    /// None so far.
    pub fn new(progress: &'o mut dyn FnMut(&Progress)) -> Self {
        WorkLog {
            progress,
            work: SolverCounts::default(),
            node_evaluations: 0,
            loading_node_evaluations: 0,
            farthest_stage: None,
            spare_system: None,
        }
    }
}
