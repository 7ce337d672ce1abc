//! From a scenario to its equilibrium: the attempts of the plan, the decision on stability, and the
//! result; and a relaxation that begins with a given shape.

use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::newton::EquilibriumFailure;
use crate::relax::accuracy::transfer::StateOnGrid;
use crate::relax::accuracy::{History, NestedEquilibrium, RelaxationResult, result_with_path};
use crate::relax::eigenvalues::EigenvalueRequest;
use crate::relax::loading::arrival::{
    LoadingEnd, follow_load_path, grid_of, load_slowly, state_on_requested_grid, takes_loads_stably,
};
use crate::relax::log::{AttemptEnd, Extent, Strategy, WorkLog};
use crate::relax::nested_grids::{solve_from_guesses, solve_from_start};
use crate::relax::path::{LoadOrder, Path};
use crate::relax::plan::{
    Acceptance, GRIDS, LONGEST_WAY_IN_FIRST_VALLEY, PlannedAttempt, RelaxationProblem,
    ValleyPolicy, WayFromStart, least_segments, may_solve_half, plan,
};
use crate::relax::remark::{EquilibriumDoubt, EquilibriumRemark};
use crate::relax::request::{
    Method, Options, Progress, RelaxError, check_hinge_equilibrium, check_natural_tips,
    check_options_without_potential, check_tolerance,
};
use crate::relax::result::report::ReachedLoads;
use crate::relax::result::{Equilibrium, Outcome, report};
use crate::relax::small_motions::small_motions;
use crate::relax::solve_on_grid::{check_segments, explicit};
use crate::relax::stability::{Decision, Verdict, decide, state_from_rod_shapes};
use crate::relax::{eigenvalues, nested_grids};
use crate::run::{Instant, RefusedOption};
use crate::scenario::{Scenario, assumed_rotary_inertia};
use crate::shape::{NodeState, RodShape};
use glam::DVec3;

/// Tolerance of a leaf on which loads without a potential are to grow, which is brought to rest again on each grid.
const LOADED_START_TOLERANCE: f64 = 1e-3;

/// What a relaxation on nested grids found.
pub(crate) struct RelaxedLeaf {
    /// The leaf in the units of the scenario.
    pub result: Equilibrium,
    /// The leaf on the grids from which the result was extrapolated.
    pub on_grids: NestedEquilibrium,
}

/// Relaxes on nested grids, fine enough for forces and eigenvalues too or for the `shape_alone`.
pub(crate) fn relax_on_grids(
    scenario: &Scenario,
    options: &Options,
    shape_alone: bool,
    progress: &mut dyn FnMut(&Progress),
) -> Result<RelaxedLeaf, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    check_options_without_potential(scenario, options)?;
    check_hinge_equilibrium(scenario)?;
    check_natural_tips(scenario)?;
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
        true => GRIDS.coarsest,
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
    let loaded = match problem.grows_from_slow_loading() {
        true => load_with_potential(&problem, &mut effort),
        false => None,
    };
    let problem = RelaxationProblem {
        loaded_start: loaded.as_ref().and_then(|it| it.levels.last()),
        ..problem
    };
    let path = loaded.as_ref().and_then(|it| it.path.clone());
    let found = find_rest(&problem, half.as_ref(), first, &mut effort);
    // Where the other loads do not come to their full size, how these were put on explains nothing.
    let found = match path {
        Some(_) => found.map(|leaf| leaf.with_path(path)),
        None => found,
    };
    Ok(equilibrium_with_stability(
        &problem,
        found,
        clock,
        &mut effort,
    ))
}

/// Loads a leaf slowly with those of its loads that have a potential, as well as their growth needs; `None`
/// if that does not lead to rest.
fn load_with_potential(
    problem: &RelaxationProblem,
    effort: &mut WorkLog,
) -> Option<NestedEquilibrium> {
    let leaf = Leaf::new(&problem.leaf.scenario().with_potential());
    let method = problem.options.method;
    let half = may_solve_half(method).then(|| leaf.mirror_half()).flatten();
    let calm = RelaxationProblem {
        leaf: &leaf,
        tolerance: problem.tolerance.max(LOADED_START_TOLERANCE),
        shape_alone: true,
        ..*problem
    };
    let segments = check_segments(&leaf, method.segments(), GRIDS.coarsest).ok()?;
    find_rest(&calm, half.as_ref(), segments, effort).ok()
}

/// Brings the leaf to rest, its `half` where that is enough, by the first attempt of its plan that is
/// accepted.
fn find_rest<'a>(
    problem: &RelaxationProblem<'a>,
    half: Option<&'a Leaf>,
    segments: usize,
    effort: &mut WorkLog,
) -> RelaxationResult {
    let mut failed = None;
    for attempt in plan(problem, half.is_some(), segments) {
        if attempt.needs_time && problem.out_of_time() {
            break;
        }
        let half = half.filter(|_| attempt.extent == Extent::Half);
        let found = match attempt.strategy {
            Strategy::SlowLoading => {
                let LoadingEnd { found, given_up } = load_slowly(problem, half, effort);
                if !given_up {
                    return found;
                }
                found
            }
            _ => {
                let MadeAttempt { found, end } = solve_planned(problem, half, &attempt, effort);
                effort.log(attempt.strategy, attempt.extent, attempt.segments, end);
                if found.is_ok() && end == AttemptEnd::Accepted {
                    return found;
                }
                found
            }
        };
        failed = found.err().or(failed);
    }
    match failed {
        Some(failure) => Err(failure),
        None => {
            NestedEquilibrium::without_grids(problem).into_failure(EquilibriumFailure::StepLimit)
        }
    }
}

/// An attempt to bring a leaf to rest, and what came of it.
struct MadeAttempt {
    found: RelaxationResult,
    end: AttemptEnd,
}

/// Makes an attempt from arcs, or from the start of the request, of the `half` or of the whole.
fn solve_planned<'a>(
    problem: &RelaxationProblem<'a>,
    half: Option<&'a Leaf>,
    attempt: &PlannedAttempt,
    effort: &mut WorkLog,
) -> MadeAttempt {
    let part = RelaxationProblem {
        valley: match attempt.strategy {
            Strategy::FirstValley => ValleyPolicy::Stay,
            _ => ValleyPolicy::MayLeave,
        },
        load_order: match attempt.strategy {
            Strategy::OtherLoadOrder => LoadOrder::PotentialLast,
            _ => LoadOrder::PotentialFirst,
        },
        ..problem.reduced_to_half(half)
    };
    let grid = grid_of(problem.leaf, attempt.segments);
    let found = solve_from_start(&part, grid, effort);
    let end = match &found {
        Ok(found) => acceptance_of(problem, attempt.acceptance, found, effort),
        Err(failure) => AttemptEnd::Failed(failure.stop),
    };
    let path = match attempt.needs_time && problem.leaf.has_potential() {
        // The leaf is released in place of slow loading.
        true => Some(Path::Released),
        false => problem.undisturbed_path(),
    };
    let whole = found.map(|found| found.mirrored_to_whole(&part));
    MadeAttempt {
        found: result_with_path(whole, path),
        end,
    }
}

/// Whether an equilibrium is accepted by this rule, or why not.
fn acceptance_of(
    problem: &RelaxationProblem,
    rule: Acceptance,
    found: &NestedEquilibrium,
    effort: &mut WorkLog,
) -> AttemptEnd {
    match rule {
        Acceptance::AtRest => AttemptEnd::Accepted,
        _ if !found.is_stable() => AttemptEnd::Unstable,
        Acceptance::Stable => AttemptEnd::Accepted,
        Acceptance::EndOfLoading if !is_in_first_valley(&found.history) => AttemptEnd::FarFromArcs,
        Acceptance::EndOfLoading if !takes_loads_stably(problem, found, effort) => {
            AttemptEnd::VeinsMayBuckle
        }
        Acceptance::EndOfLoading => AttemptEnd::Accepted,
    }
}

/// Whether Newton's method alone came to rest from the start, so near that this is where
/// slow loading leads.
fn is_in_first_valley(history: &History) -> bool {
    let near = |way: WayFromStart| {
        way.distance < LONGEST_WAY_IN_FIRST_VALLEY.distance
            && way.steps <= LONGEST_WAY_IN_FIRST_VALLEY.steps
    };
    history.from_start.is_some_and(near) && history.saddle.is_none()
}

/// Brings a leaf to rest from its start, on this grid and finer ones.
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
    let guess = state_on_requested_grid(problem, &mut begun.history, arrived.level, effort);
    solve_from_guesses(problem, begun, vec![guess], effort).ok()
}

/// The result, with the stability of a leaf at rest decided and its modes: requested modes are
/// not counted in the time of the solution, unless stability depends on them.
pub(super) fn equilibrium_with_stability(
    problem: &RelaxationProblem,
    found: RelaxationResult,
    clock: Instant,
    effort: &mut WorkLog,
) -> RelaxedLeaf {
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
    let reached = ReachedLoads {
        position: effort.farthest_position,
        borne_part: effort.borne_part,
    };
    let outcome = report::outcome(problem, &found, stopped, reached);
    let mut leaf = report::equilibrium(problem, &found, outcome, wall);
    if matches!(leaf.path, Some(Path::Held { .. })) && !leaf.outcome.is_at_rest() {
        // What the way was like, it did not end where the leaf is held.
        leaf.path = None;
    }
    leaf.doubts = report::implausible_properties(problem.leaf.scenario(), &leaf);
    if leaf.outcome.is_at_rest() && (requested > 0 || !problem.leaf.has_potential()) {
        // Small motions depend on it, and a leaf at rest does not.
        let assumed = assumed_rotary_inertia(problem.leaf.scenario());
        (leaf.doubts).extend(assumed.map(EquilibriumDoubt::Implausible));
    }
    let doubt = (leaf.path.as_ref())
        .and_then(|path| EquilibriumDoubt::about_path(path, problem.options.route));
    let unconfirmed = doubt.is_none() && found.unconfirmed && leaf.outcome.is_at_rest();
    leaf.doubts.extend(doubt);
    leaf.doubts
        .extend(unconfirmed.then_some(EquilibriumDoubt::UnconfirmedEquilibrium));
    let reordered = effort.attempts.last().is_some_and(|last| {
        last.strategy == Strategy::OtherLoadOrder && last.end == AttemptEnd::Accepted
    });
    if let Some(part) = effort.borne_part.filter(|_| reordered) {
        leaf.doubts.push(EquilibriumDoubt::OtherLoadOrder {
            part,
            loads: problem.leaf.keys_without_potential(),
        });
    }
    leaf.apply_stability_verdict(decision.verdict);
    let modes = decision.modes.or_else(|| {
        let list = EigenvalueRequest::requested(problem);
        (stopped.is_none()).then(|| eigenvalues::lowest(problem, &found, list))?
    });
    leaf.stability.modes = modes.map(|it| it.modes);
    // What cancels a run, rather than its time, needs no word.
    let late = (problem.options.limit.deadline).is_some_and(|deadline| Instant::now() >= deadline);
    let asked_for_modes = requested > 0 && problem.leaf.has_potential();
    if late && asked_for_modes && leaf.outcome.is_at_rest() {
        leaf.doubts.push(EquilibriumDoubt::ModesOutOfTime {
            told: leaf.stability.modes.is_some(),
        });
    }
    if leaf.outcome.is_at_rest() && !problem.leaf.has_potential() {
        leaf.stability.small_motions = small_motions(problem, &found);
        leaf.tell_small_motions();
        let told = leaf.stability.small_motions.as_ref();
        let told = told.map_or(requested, |motions| motions.growth_rates.len());
        leaf.doubts.extend(
            (told < requested).then_some(EquilibriumDoubt::FewerMotions {
                asked: requested,
                found: told,
            }),
        );
    }
    leaf.attempts = std::mem::take(&mut effort.attempts);
    RelaxedLeaf {
        result: leaf,
        on_grids: found,
    }
}

impl Equilibrium {
    /// Says what the linearised motion tells of a leaf that has no potential.
    fn tell_small_motions(&mut self) {
        if let (Some(motions), Some(remark)) = (&self.stability.small_motions, &mut self.remark) {
            remark.add_small_motions(motions);
        }
    }

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
            // The remark was that the index is not known.
            self.remark = None;
        }
    }
}

/// Brings a scenario's leaf to rest from a shape with as many rods, given at `stations` from 0 to 1:
/// in the valley in which that lies, where a relaxation may find another. Where that leads nowhere it
/// relaxes as without, and one of the doubts says so.
///
/// # Errors
/// Requests that cannot be met, as of [`relax`](crate::relax::relax); other methods than the
/// semi-implicit one, and shapes of other leaves.
pub fn relax_from(
    scenario: &Scenario,
    (stations, rods): (&[f64], &[RodShape]),
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    check_options_without_potential(scenario, options)?;
    check_hinge_equilibrium(scenario)?;
    check_natural_tips(scenario)?;
    check_start(scenario, stations, rods)?;
    let method = options.method;
    let Method::SemiImplicit(how) = method else {
        let why = "only the method semi-implicit begins from a given shape";
        return Err(RefusedOption::new("method", method.word(), why).into());
    };
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    let problem = RelaxationProblem::new(&leaf, options, tolerance);
    let segments = check_segments(
        &leaf,
        method.segments(),
        least_segments(method, tolerance, false),
    )?;
    let grid = Grid::new(segments, leaf.kinks());
    let discrete = DiscreteLeaf::new(&leaf, grid.clone());
    let there = (rods.iter())
        .map(|rod| interpolate_rod_shape(stations, rod, grid.sigma()))
        .collect::<Vec<_>>();
    let mut state = state_from_rod_shapes(&leaf, &discrete, &there);
    leaf.place_bases(&mut state);
    leaf.place_held_tips(&mut state);
    let mut effort = WorkLog::new(progress);
    let guess = StateOnGrid { grid, state };
    let half = may_solve_half(method).then(|| leaf.mirror_half()).flatten();
    let by_half = half.as_ref().and_then(|half| {
        nested_grids::solve_half_from_guess(
            &problem,
            half,
            &guess,
            Strategy::GivenShape,
            &mut effort,
        )
    });
    if let Some(found) = by_half {
        return Ok(equilibrium_with_stability(&problem, Ok(found), clock, &mut effort).result);
    }
    let begun = NestedEquilibrium::without_grids(&problem);
    let found = nested_grids::solve_from_guesses(&problem, begun, vec![guess], &mut effort);
    let (settled, end) = match &found {
        Ok(found) if found.is_stable() || how.keep_unstable => (true, AttemptEnd::Accepted),
        Ok(_) => (false, AttemptEnd::Unstable),
        Err(failure) => (problem.out_of_time(), AttemptEnd::Failed(failure.stop)),
    };
    effort.log(Strategy::GivenShape, Extent::Whole, segments, end);
    if settled {
        return Ok(equilibrium_with_stability(&problem, found, clock, &mut effort).result);
    }
    let given = effort.attempts;
    let mut leaf = relax_on_grids(scenario, options, false, progress)?.result;
    leaf.attempts.splice(0..0, given);
    leaf.doubts.push(EquilibriumDoubt::RelaxedAnew);
    Ok(leaf)
}

/// Refuses the shape of another leaf, and one that is no shape.
fn check_start(
    scenario: &Scenario,
    stations: &[f64],
    rods: &[RodShape],
) -> Result<(), RefusedOption> {
    let refuse = |value: String, why: String| Err(RefusedOption::new("start", value, why));
    let (own, given) = (scenario.rods.len(), rods.len());
    if own != given {
        let why = format!("must have as many rods as the scenario, {own}");
        return refuse(format!("a leaf of {given} rods"), why);
    }
    let ascending = stations.windows(2).all(|pair| pair[0] < pair[1]);
    let whole = stations.first() == Some(&0.0) && stations.last() == Some(&1.0);
    let finite = |node: &NodeState| {
        node.position.is_finite() && node.n.is_finite() && node.rotation.is_normalized()
    };
    let complete =
        |rod: &RodShape| rod.nodes.len() == stations.len() && rod.nodes.iter().all(finite);
    if !ascending || !whole || !rods.iter().all(complete) {
        let why = "must be at rest, with numbers at all of its stations from 0 to 1";
        return refuse("a leaf".into(), why.into());
    }
    Ok(())
}

/// A rod at other stations: on chords, with the directors turned evenly from node to node.
fn interpolate_rod_shape(stations: &[f64], rod: &RodShape, to: &[f64]) -> RodShape {
    let node = |&sigma: &f64| {
        let next = stations.partition_point(|&at| at < sigma);
        let next = next.clamp(1, stations.len() - 1);
        let (a, b) = (&rod.nodes[next - 1], &rod.nodes[next]);
        let weight = (sigma - stations[next - 1]) / (stations[next] - stations[next - 1]);
        let mean = |of: fn(&NodeState) -> DVec3| of(a).lerp(of(b), weight);
        NodeState {
            position: mean(|node| node.position),
            rotation: a.rotation.slerp(b.rotation, weight),
            v: mean(|node| node.v),
            u: mean(|node| node.u),
            n: mean(|node| node.n),
            m: mean(|node| node.m),
        }
    };
    RodShape {
        length: rod.length,
        nodes: to.iter().map(node).collect(),
    }
}
