//! From a scenario to rest on nested grids: the problem, the start, rest on one grid, finer ones,
//! the decision on stability, and the result.
//!
//! What is asked of nested grids: which leaf is to come to rest, and how accurately.
//!
//! What the way to rest has cost so far, and what it leaves for reuse.

use crate::leaf::{Grid, Leaf, Loads, System};
use crate::newton::Work;
use crate::relax::accuracy::{Found, History, NestedEquilibrium, along};
use crate::relax::eigenvalues;
use crate::relax::eigenvalues::List;
use crate::relax::loading::arrival::{
    arrive, follow, guess, load_slowly, solve, takes_loads_stably,
};
use crate::relax::path::{Path, Route, Stage};
use crate::relax::request::{
    Method, Options, Progress, RelaxError, SemiImplicit, check_tolerance, points_somewhere,
    rests_in_wind,
};
use crate::relax::result::{Equilibrium, Outcome, report};
use crate::relax::solve_on_grid::{check_segments, explicit, least, reducible, softens};
use crate::relax::stability::{Decision, Verdict, decide};
use crate::run::Instant;
use crate::scenario::Scenario;

/// A leaf that rests so near to the arcs from which it starts (lengths, radians), after so few
/// steps of Newton's method without softened rods, rests where slow loading leads, stably if its veins
/// take their loads stably: so did all of 5000 random leaves. Those of up to 3 lengths that ended elsewhere had taken 20 steps and more;
/// of stiff leaves, which are softened on their way from arcs, 3 in 1000 end elsewhere.
const FIRST_VALLEY: (f64, usize) = (2.0, 8);

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
    rests_in_wind(scenario, options)?;
    points_somewhere(scenario)?;
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    if let Method::Explicit { .. } = options.method {
        explicit::check(&leaf)?;
    }
    let method = options.method;
    // Four segments are too few to be divided among panels, and for the layers of tissue.
    let few = shape_alone && leaf.kinks().is_empty() && !leaf.has_tissue();
    // What a held leaf comes to depends on the way of its holders, which few segments would change.
    let least = match leaf.is_held() {
        true => COARSEST,
        false => least(method, tolerance, few),
    };
    let first = check_segments(&leaf, method.segments(), least)?;
    let half = reducible(method).then(|| leaf.half()).flatten();
    let problem = Problem {
        planar: reducible(method) && leaf.is_planar(),
        shape_alone,
        ..Problem::new(&leaf, options, tolerance)
    };
    let mut effort = Effort::new(progress);
    let grid = Grid::new(first, leaf.kinks());
    let found = rest(&problem, half.as_ref(), grid, &mut effort);
    Ok(decided(&problem, found, clock, &mut effort))
}

/// Brings the leaf to rest, its `half` where that is enough.
fn rest<'a>(
    problem: &Problem<'a>,
    half: Option<&'a Leaf>,
    grid: Grid,
    effort: &mut Effort,
) -> Found {
    let slowly = problem.loads_slowly();
    // Where Newton's method alone leads from arcs to rest nearby, through convex states only,
    // the path need not be walked.
    let in_valley = slowly
        && matches!(problem.options.method, Method::SemiImplicit(_))
        && !softens(problem.leaf);
    if in_valley || !slowly && half.is_some() {
        let reduced = Problem {
            stays_in_valley: in_valley,
            ..problem.reduced(half)
        };
        let found = solve(&reduced, grid.clone(), effort);
        if half.is_some() {
            effort.spare_system = None;
        }
        if let Ok(found) = found
            && found.is_stable()
            && (!slowly || is_in_first_valley(&found.history))
            && (!slowly || takes_loads_stably(problem, &found, effort))
        {
            let path = problem.path();
            return Ok(found.completed(&reduced).along(path));
        }
        // The reduced model fails, as the leaf leaves its valley or breaks the mirror symmetry:
        // solve the full leaf.
        effort.spare_system = None;
    }
    if slowly {
        return load_slowly(problem, half, effort);
    }
    match solve(problem, grid, effort) {
        Err(_) if problem.may_be_loaded_instead() => {
            effort.spare_system = None;
            load_slowly(problem, None, effort)
        }
        found => along(found, problem.path()),
    }
}

/// Whether Newton's method alone came to rest from the start, so near that this is where
/// slow loading leads.
fn is_in_first_valley(history: &History) -> bool {
    let near =
        |(distance, steps): (f64, usize)| distance < FIRST_VALLEY.0 && steps <= FIRST_VALLEY.1;
    history.from_start.is_some_and(near) && history.saddle.is_none()
}

/// Rest from the start, on this grid and finer ones.
fn rest_again(problem: &Problem, grid: Grid, effort: &mut Effort) -> Option<NestedEquilibrium> {
    if !problem.loads_slowly() {
        let found = solve(problem, grid.clone(), effort);
        if found.is_ok() || !problem.may_be_loaded_instead() {
            return found.ok();
        }
    }
    let arrived = arrive(problem, grid, effort).ok()?;
    let mut begun = NestedEquilibrium::begun(problem).along(Some(arrived.path));
    let guess = guess(problem, &mut begun.history, arrived.level, effort);
    follow(problem, begun, vec![guess], effort).ok()
}

/// The result, with the stability of a leaf at rest decided and its modes: requested modes are
/// not counted in the time of the solution, unless stability depends on them.
pub(super) fn decided(
    problem: &Problem,
    found: Found,
    clock: Instant,
    effort: &mut Effort,
) -> (Equilibrium, NestedEquilibrium) {
    let requested = problem.options.modes;
    let before = clock.elapsed().as_secs_f64();
    let (decision, stopped) = match found {
        Ok(found) => {
            let again = |grid, effort: &mut Effort| rest_again(problem, grid, effort);
            (decide(problem, found, effort, &again), None)
        }
        Err(failure) => (Decision::none(failure.at), Some(failure.stop)),
    };
    let wall = match decision.needed || requested == 0 {
        true => clock.elapsed().as_secs_f64(),
        false => before,
    };
    let found = decision.found.after(effort.work);
    let outcome = report::outcome(problem, &found, stopped, effort.reached);
    let mut leaf = report::equilibrium(problem, &found, outcome, wall);
    if matches!(leaf.path, Some(Path::Held { .. })) && !leaf.outcome.is_at_rest() {
        // What the way was like, it did not end where the leaf is held.
        leaf.path = None;
    }
    leaf.doubts = report::doubts(problem.leaf.scenario(), &leaf);
    let doubt = (leaf.path.as_ref()).and_then(|path| path.doubt(problem.options.route));
    let unconfirmed = doubt.is_none() && found.unconfirmed && leaf.outcome.is_at_rest();
    leaf.doubts.extend(doubt);
    leaf.doubts
        .extend(unconfirmed.then(|| UNCONFIRMED.to_owned()));
    leaf.decide(decision.verdict);
    let modes = decision.modes.or_else(|| {
        let list = List::requested(problem);
        (stopped.is_none()).then(|| eigenvalues::lowest(problem, &found, list))?
    });
    leaf.stability.modes = modes.map(|it| it.modes);
    (leaf, found)
}

impl Equilibrium {
    /// Takes the Morse index by extrapolated eigenvalues, if it is known, where those of single
    /// grids may have other signs.
    fn decide(&mut self, verdict: Verdict) {
        let index = match verdict {
            Verdict::AsCounted => return,
            Verdict::Undecided(certain)
                if certain > self.stability.negative_eigenvalues.unwrap_or(0) =>
            {
                self.doubts.push(AT_LEAST.to_owned());
                certain
            }
            Verdict::Undecided(_) => {
                self.doubts.push(UNDECIDED.to_owned());
                return;
            }
            Verdict::Unknown => {
                self.doubts.push(UNDECIDED.to_owned());
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
            self.remark = Some(BESIDE_BIFURCATION.to_owned());
        } else if unknown {
            // It said so.
            self.remark = None;
        }
    }
}

/// Remark on a leaf that two grids never bring to the same equilibrium.
const UNCONFIRMED: &str = "from its start the leaf moves to different equilibria on different grids: \
     this is one in which it can rest; relax with --all looks for the others";

/// Remark on a leaf with an eigenvalue that may have either sign.
const UNDECIDED: &str = "an eigenvalue may be negative or positive for all that these grids tell: \
     whether the leaf is stable is not certain";

/// Remark on a leaf with an eigenvalue that may have either sign beside others that are negative.
const AT_LEAST: &str = "an eigenvalue may be negative or positive for all that these grids tell: \
     the index is the number of those that are certainly negative, or larger";

/// Remark on a leaf at rest on all grids that is at a saddle.
const BESIDE_BIFURCATION: &str = "just beyond a bifurcation: unstable, by eigenvalues extrapolated over grids on which it is \
     still stable; a load that is a little larger, or a small disturbance, shows where it goes";

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
pub const COARSEST: usize = 8;

/// The smallest tolerance for which the first grid is tried alone: below it nodes would be too
/// few for stations between them.
const LEAST_ALONE: f64 = 5e-7;

/// Largest number of corrections by the estimated error.
const CORRECTIONS: usize = 4;

/// The leaf that is to come to rest, and how.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    pub leaf: &'a Leaf,
    /// The full leaf, if `leaf` is half of it.
    pub whole: Option<&'a Leaf>,
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

impl<'a> Problem<'a> {
    /// The leaf with forces and eigenvalues, wherever it comes to rest.
    pub fn new(leaf: &'a Leaf, options: &'a Options, tolerance: f64) -> Self {
        Problem {
            leaf,
            whole: None,
            options,
            tolerance,
            shape_alone: false,
            planar: false,
            stays_in_valley: false,
        }
    }

    /// The same for the half of the leaf, if there is one.
    pub fn reduced(self, half: Option<&'a Leaf>) -> Self {
        match half {
            None => self,
            Some(half) => Problem {
                leaf: half,
                whole: Some(self.leaf),
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
        self.options.route == Route::Loading
            && !released
            && !self.leaf.is_held()
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
            && self.options.route == Route::Loading
            && !self.leaf.is_held()
            && !self.leaf.hinged()
            && !self.leaf.loads.has_moments()
            && !self.out_of_time()
    }

    /// The path of the leaf as far as nothing happens on it, if it has one.
    pub fn path(&self) -> Option<Path> {
        if self.loads_slowly() {
            return Some(Path::STABLE);
        }
        let released = self.options.route == Route::Release && !self.keeps_unstable();
        let moved = self.leaf.is_held() || self.leaf.loads.has_moments();
        (released && !moved).then_some(Path::Released)
    }

    /// The largest number of corrections.
    pub fn corrections(&self) -> usize {
        let grids = matches!(self.options.method, Method::SemiImplicit(_));
        let free = !self.leaf.is_held() && self.segments().is_none();
        match grids && free && self.shape_alone {
            true => CORRECTIONS,
            false => 0,
        }
    }

    /// Whether the first grid may be enough.
    pub fn may_be_alone(&self) -> bool {
        self.corrections() > 0 && self.tolerance >= LEAST_ALONE
    }
}

/// Limit on nodes times force evaluations for a leaf to come to rest: some seconds.
pub const BUDGET: usize = 10_000_000;

/// Counts of the work on all grids, whatever becomes of them, and its progress.
pub struct Effort<'o> {
    pub progress: &'o mut dyn FnMut(&Progress),
    pub work: Work,
    /// Nodes times force evaluations so far.
    pub spent: usize,
    /// Nodes times force evaluations of all walks.
    pub walked: usize,
    /// How far the leaf came on its path before it failed.
    pub reached: Option<(Stage, f64)>,
    /// The linear system of the last grid, for reuse.
    pub spare_system: Option<System>,
}

impl<'o> Effort<'o> {
    /// None so far.
    pub fn new(progress: &'o mut dyn FnMut(&Progress)) -> Self {
        Effort {
            progress,
            work: Work::default(),
            spent: 0,
            walked: 0,
            reached: None,
            spare_system: None,
        }
    }
}
