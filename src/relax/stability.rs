//! Whether a leaf at rest is stable: its Morse index is that on a grid only where no eigenvalue is so
//! close to zero that other grids may tell another sign; elsewhere extrapolated eigenvalues decide. Also
//! the Morse index of an equilibrium that was not found by relaxation.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::newton::SolverCounts;
use crate::relax::accuracy::NestedEquilibrium;
use crate::relax::accuracy::richardson::distance;
use crate::relax::accuracy::transfer::{GridLevel, positions, prolong};
use crate::relax::eigenvalues::{
    EigenvalueRequest, LowestModes, OmittedEigenvalues, affordable_next_grid, deciding_grid,
};
use crate::relax::log::WorkLog;
use crate::relax::nested_grids::{continue_on, refine_to_tolerance};
use crate::relax::plan::{GRIDS, RelaxationProblem};
use crate::relax::request::{MOST_MODES, Options, Progress, SemiImplicit};
use crate::relax::saddle::bounds;
use crate::relax::same_equilibrium::{is_given_within_errors, is_near_guess};
use crate::relax::{eigenvalues, saddle};
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};

/// What is known of the Morse index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The index is that counted on the finest grid.
    AsCounted,
    /// The index is this, by eigenvalues extrapolated over the grids.
    Index(usize),
    /// An eigenvalue may have either sign; so many others are negative for certain.
    Undecided(usize),
    /// The eigenvalues that decide cannot be computed.
    Unknown,
}

/// The decision on the stability of a leaf.
pub struct Decision {
    /// The leaf, on further grids where these were necessary.
    pub found: NestedEquilibrium,
    pub verdict: Verdict,
    /// The requested modes, if they were computed for it.
    pub modes: Option<LowestModes>,
    /// Whether stability was not clear without eigenvalues, or not on the grids before.
    pub needed: bool,
}

impl Decision {
    /// Nothing is decided on a leaf that is not at rest.
    pub fn without_decision(found: NestedEquilibrium) -> Self {
        Decision {
            found,
            verdict: Verdict::AsCounted,
            modes: None,
            needed: false,
        }
    }
}

/// Brings the leaf to rest on this grid, and on finer ones, if it can.
pub type RelaxOnGrid<'a> = dyn Fn(Grid, &mut WorkLog) -> Option<NestedEquilibrium> + 'a;

/// What has to be computed next for the decision on stability.
enum NextStabilityCheck {
    /// Nothing: the count on the finest grid is certain.
    CountIsCertain,
    /// The leaf on this finer grid.
    Finer(Grid),
    /// These eigenvalues on all grids.
    Compute(EigenvalueRequest),
    /// Nothing: the matrix does not fit into memory.
    OutOfMemory,
}

/// Decides, on further grids where necessary; `again` brings the leaf to rest on a grid whose
/// equilibrium is not near those of the grids before.
pub fn decide(
    problem: &RelaxationProblem,
    mut found: NestedEquilibrium,
    effort: &mut WorkLog,
    again: &RelaxOnGrid,
) -> Decision {
    let (mut needed, mut may_refine) = (false, true);
    loop {
        let next = next_stability_check(problem, &found, may_refine, &mut effort.work);
        let list = match &next {
            NextStabilityCheck::CountIsCertain => {
                return Decision {
                    needed,
                    ..Decision::without_decision(found)
                };
            }
            NextStabilityCheck::Finer(_) => None,
            // More than one attempt: the leaf may be large.
            NextStabilityCheck::Compute(list) => Some(EigenvalueRequest {
                decides_stability: list.decides_stability || needed,
                ..*list
            }),
            NextStabilityCheck::OutOfMemory => {
                return Decision {
                    verdict: Verdict::Unknown,
                    needed: true,
                    ..Decision::without_decision(found)
                };
            }
        };
        let lowest = list.and_then(|list| eigenvalues::lowest(problem, &found, list));
        needed |= list.is_none_or(|list| list.decides_stability);
        found = found.with_bifurcation_factor(
            lowest
                .as_ref()
                .map_or(1.0, |lowest| lowest.bifurcation_error_factor),
        );
        let inaccurate = found.keeps_tolerance && !found.is_accurate();
        let finer = match (next, &lowest) {
            (NextStabilityCheck::Finer(grid), _) => Some(grid),
            (_, Some(_)) if inaccurate && may_refine => found.next_finer_grid(),
            (_, Some(lowest)) => {
                (lowest.undecided_size).and_then(|size| deciding_grid(problem, &found, size))
            }
            _ => needed
                .then(|| affordable_next_grid(problem, &found))
                .flatten(),
        };
        if let Some(further) =
            finer.and_then(|finer| continue_on_finer_grid(problem, &found, finer, effort, again))
        {
            (found, needed) = (further, true);
            continue;
        }
        let keeps_tolerance = found.keeps_tolerance && !inaccurate;
        found = found.with_tolerance_kept(keeps_tolerance);
        let Some(list) = list else {
            // The grids so far have to do.
            may_refine = false;
            continue;
        };
        let verdict = match &lowest {
            None if needed => Verdict::Unknown,
            None => Verdict::AsCounted,
            Some(lowest) => verdict(problem, &found, list, lowest),
        };
        let requested = list.omitted_lower.is_none() && list.count == problem.options.modes;
        return Decision {
            found,
            verdict,
            modes: lowest.filter(|_| requested),
            needed,
        };
    }
}

/// Comes to rest on a finer grid. The grids before found rest; without this one the sign remains
/// undecided.
fn continue_on_finer_grid(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    finer: Grid,
    effort: &mut WorkLog,
    again: &RelaxOnGrid,
) -> Option<NestedEquilibrium> {
    // A saddle of the finer grid may be none of the coarser, and what it leads to not near them.
    match continue_on(problem, found.without_estimates(), finer.clone(), effort) {
        Ok(further) => Some(further),
        Err(_) => {
            let further = again(finer, effort)?;
            let path = further.path.clone().or_else(|| found.path.clone());
            Some(further.with_path(path))
        }
    }
}

/// What has to be computed next, with the leaf on its grids so far.
fn next_stability_check(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    may_refine: bool,
    work: &mut SolverCounts,
) -> NextStabilityCheck {
    let requested = EigenvalueRequest::requested(problem);
    let Some(level) = found.levels.last() else {
        return NextStabilityCheck::CountIsCertain;
    };
    // A single grid allows no comparison; without a potential there is nothing to compare.
    let comparable = problem.segments().is_none() && level.leaf.leaf.has_potential();
    match found.index {
        Some(0) if comparable && !found.clearly_stable => {
            NextStabilityCheck::Compute(EigenvalueRequest {
                count: requested.count.max(1),
                decides_stability: true,
                ..requested
            })
        }
        Some(1..) if comparable => check_near_zero(problem, found, may_refine, work),
        _ if requested.count == 0 => NextStabilityCheck::CountIsCertain,
        _ => NextStabilityCheck::Compute(requested),
    }
}

/// What decides on a saddle: the counts of negative eigenvalues, or the few that are close to
/// zero.
fn check_near_zero(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    may_refine: bool,
    work: &mut SolverCounts,
) -> NextStabilityCheck {
    let Some(GridLevel { leaf, state }) = found.levels.last() else {
        return NextStabilityCheck::CountIsCertain;
    };
    let mut system = System::new(leaf);
    let Some(bounds) = bounds(leaf, state, &mut system, work) else {
        return NextStabilityCheck::OutOfMemory;
    };
    if bounds.least == bounds.finer && found.index == Some(bounds.least) {
        return NextStabilityCheck::CountIsCertain;
    }
    if may_refine
        && bounds.here < bounds.finer
        && let Some(finer) = affordable_next_grid(problem, found)
    {
        return NextStabilityCheck::Finer(finer);
    }
    let count = (bounds.finer - bounds.least).max(1);
    if count > MOST_MODES {
        return NextStabilityCheck::OutOfMemory;
    }
    NextStabilityCheck::Compute(EigenvalueRequest {
        count,
        omitted_lower: Some(OmittedEigenvalues {
            count: bounds.least,
            shift: -bounds.close,
        }),
        decides_stability: true,
        needs_values: false,
    })
}

/// What the signs of extrapolated eigenvalues tell.
fn verdict(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    list: EigenvalueRequest,
    lowest: &LowestModes,
) -> Verdict {
    // On a fine grid rounding may have excused a negative eigenvalue as neutral, or hide what
    // coarser ones tell.
    let as_counted = lowest.undecided_size.is_none() && lowest.negative <= found.index;
    if as_counted && lowest.certainly_negative() <= found.index.unwrap_or(0) {
        return Verdict::AsCounted;
    }
    let negative = match list.omitted_lower {
        Some(_) => NegativeEigenvalues {
            certain: lowest.certainly_negative(),
            all: lowest.negative,
        },
        None => count_with_more_eigenvalues(problem, found, list, lowest),
    };
    (negative.all).map_or(Verdict::Undecided(negative.certain), Verdict::Index)
}

/// What extrapolated eigenvalues tell of the Morse index.
struct NegativeEigenvalues {
    /// Number of eigenvalues that are negative for certain.
    certain: usize,
    /// The number of negative ones, if it is known.
    all: Option<usize>,
}

/// The negative eigenvalues of the list or, where its signs are not certain or all of them are
/// negative, of a longer and exact one.
fn count_with_more_eigenvalues(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    list: EigenvalueRequest,
    lowest: &LowestModes,
) -> NegativeEigenvalues {
    let (mut certain, mut negative) = (lowest.certainly_negative(), lowest.negative);
    let mut list = EigenvalueRequest {
        decides_stability: true,
        ..list
    };
    while list.count < MOST_MODES
        && (negative == Some(list.count) || negative.is_none() && !list.needs_values)
    {
        list.needs_values = true;
        list.count = (2 * list.count).min(MOST_MODES);
        let more = eigenvalues::lowest(problem, found, list);
        negative = (more.as_ref()).and_then(|more| more.negative_beyond(certain));
        certain = certain.max(more.map_or(0, |more| more.certainly_negative()));
    }
    NegativeEigenvalues {
        certain,
        // There may be more than can be listed.
        all: negative.filter(|negative| *negative < list.count),
    }
}

/// Largest tolerance of the grids on which the eigenvalues of a given equilibrium are compared.
const LARGEST_TOLERANCE_FOR_INDEX: f64 = 1e-4;

/// Smallest tolerance of these grids: on those that a smaller one needs, rounding hides the signs of
/// soft eigenvalues.
const SMALLEST_TOLERANCE_FOR_INDEX: f64 = 1e-5;

/// Number of negative eigenvalues of the energy's Hessian at the equilibrium with the shape `rods`,
/// given at the nodes of `grid` in the scenario's units within `error`, decided as that of a
/// relaxed leaf. Close to a bifurcation a coarse grid may only have another equilibrium nearby:
/// then finer ones are tried. `None` under a dead moment, which has no potential, if no grid has
/// the equilibrium, or if an eigenvalue may have either sign.
pub fn index_near(scenario: &Scenario, grid: Grid, rods: &[RodShape], error: f64) -> Option<usize> {
    let leaf = Leaf::new(scenario);
    if !leaf.has_potential() {
        return None;
    }
    let options = Options {
        method: SemiImplicit {
            keep_unstable: true,
            ..SemiImplicit::default()
        }
        .into(),
        modes: 0,
        ..Options::default()
    };
    let mut ignored = |_: &Progress| {};
    let error = error / leaf.scale.length;
    let tolerance = error.clamp(SMALLEST_TOLERANCE_FOR_INDEX, LARGEST_TOLERANCE_FOR_INDEX);
    let problem = RelaxationProblem::new(&leaf, &options, tolerance);
    let mut effort = WorkLog::new(&mut ignored);
    let discrete = DiscreteLeaf::new(&leaf, grid);
    let state = state_from_rod_shapes(&leaf, &discrete, rods);
    let level = GridLevel {
        leaf: discrete,
        state,
    };
    let given = GivenEquilibrium { level, error };
    let mut guess = given.level.clone();
    while guess.leaf.segments() <= GRIDS.finest_of_given_equilibrium {
        let finer = GridLevel {
            leaf: DiscreteLeaf::new(&leaf, guess.leaf.grid.refined()),
            state: prolong(&guess.leaf, &guess.state),
        };
        if let Some(counted) = index_from(&problem, guess, &given, &mut effort) {
            return counted.index;
        }
        guess = finer;
    }
    None
}

/// An equilibrium that was not found by relaxation.
struct GivenEquilibrium {
    level: GridLevel,
    /// Bound on the error of its positions, in lengths of the leaf.
    error: f64,
}

/// The Morse index of a given equilibrium; `None` if an eigenvalue may have either sign.
struct CountedIndex {
    index: Option<usize>,
}

/// The index at the `given` equilibrium, counted on grids from that of the `guess` on; `None` if these
/// lead to another one.
fn index_from(
    problem: &RelaxationProblem,
    mut guess: GridLevel,
    given: &GivenEquilibrium,
    effort: &mut WorkLog,
) -> Option<CountedIndex> {
    let GridLevel { leaf, state } = &mut guess;
    let mut system = System::new(leaf);
    let begun = state.clone();
    let index = saddle::converge_saddle(leaf, state, &mut system, &mut effort.work)?;
    if saddle::clearly_stable(leaf, state, &mut system, &mut effort.work) {
        return is_near_guess(&begun, state).then_some(CountedIndex { index: Some(0) });
    }
    let counted = NestedEquilibrium::without_grids(problem).with_index(false, Some(index));
    let refined = refine_to_tolerance(problem, counted.with_finer_level(guess), effort).ok()?;
    // No other equilibrium is of interest.
    let Decision { found, verdict, .. } = decide(problem, refined, effort, &|_, _| None);
    let error = given.error + found.error().unwrap_or(f64::INFINITY);
    let same = is_given_within_errors(distance_from_given(&found, &given.level), error);
    let index = match verdict {
        Verdict::AsCounted => found.index,
        Verdict::Index(index) => Some(index),
        Verdict::Undecided(_) | Verdict::Unknown => None,
    };
    same.then_some(CountedIndex { index })
}

/// The largest distance of the extrapolated positions from those `given` on a grid whose repeated
/// halving leads to the first of those where it was found.
fn distance_from_given(found: &NestedEquilibrium, given: &GridLevel) -> f64 {
    let (first, own) = (found.levels[0].leaf.segments(), given.leaf.segments());
    let rods = found
        .convergence_table
        .extrapolated()
        .chunks(3 * (first + 1));
    let shared = rods.flat_map(|rod| rod.chunks(3).step_by(first / own).flatten());
    let shared: Vec<f64> = shared.copied().collect();
    distance(&shared, &positions(given, 1))
}

/// The state of the discrete leaf at the given nodes.
pub fn state_from_rod_shapes(leaf: &Leaf, discrete: &DiscreteLeaf, rods: &[RodShape]) -> State {
    let scale = leaf.scale;
    let nodes = || rods.iter().flat_map(|rod| &rod.nodes);
    let x = nodes().map(|node| node.position / scale.length).collect();
    let q = nodes().map(|node| node.rotation).collect();
    let mut state = State::new(discrete.segments(), x, q);
    if leaf.joined() {
        // They meet to the accuracy of what they come from.
        state.join_tips();
    }
    let ends = rods.iter().flat_map(|rod| rod.nodes.windows(2));
    let force = |node: &NodeState| node.rotation * node.n;
    let middle = |ends: &[_]| 0.5 * (force(&ends[0]) + force(&ends[1])) / scale.force();
    state.n = ends.map(middle).collect();
    state
}
