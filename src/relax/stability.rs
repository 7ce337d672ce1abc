//! Whether a leaf at rest is stable: counts of negative eigenvalues, and the eigenvalues that decide.
//!
//! The decision on the stability of a leaf at rest: its Morse index is that on a grid only where
//! no eigenvalue is so close to zero that other grids may tell another sign.
//!
//! The Morse index of an equilibrium that was not found by relaxation.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::newton::Work;
use crate::relax::accuracy::richardson::distance;
use crate::relax::accuracy::transfer::prolong;
use crate::relax::accuracy::{Level, NestedEquilibrium, positions};
use crate::relax::eigenvalues::{List, Lowest, deciding_grid, small_grid};
use crate::relax::loading::arrival::{continue_on, refine};
use crate::relax::request::{MOST_MODES, Method, Options, Progress, SemiImplicit};
use crate::relax::rest::{Effort, Problem};
use crate::relax::saddle::bounds;
use crate::relax::{eigenvalues, saddle};
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};

/// What is known of the Morse index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is that counted on the finest grid.
    AsCounted,
    /// It is this, by eigenvalues extrapolated over the grids.
    Index(usize),
    /// An eigenvalue may have either sign; so many others are negative for certain.
    Undecided(usize),
    /// The eigenvalues that decide cannot be computed.
    Unknown,
}

/// The decision on a leaf.
pub struct Decision {
    /// The leaf, on further grids where these were necessary.
    pub found: NestedEquilibrium,
    pub verdict: Verdict,
    /// The requested modes, if they were computed for it.
    pub modes: Option<Lowest>,
    /// Whether stability was not clear without eigenvalues, or not on the grids before.
    pub needed: bool,
}

impl Decision {
    /// Nothing is decided on a leaf that is not at rest.
    pub fn none(found: NestedEquilibrium) -> Self {
        Decision {
            found,
            verdict: Verdict::AsCounted,
            modes: None,
            needed: false,
        }
    }
}

/// Brings the leaf to rest on this grid, and on finer ones, if it can.
pub type Again<'a> = dyn Fn(Grid, &mut Effort) -> Option<NestedEquilibrium> + 'a;

/// What to do on the grids so far.
enum Next {
    /// The count is certain.
    Nothing,
    /// A finer grid.
    Finer(Grid),
    /// Compute these eigenvalues.
    Compute(List),
    /// The matrix does not fit into memory.
    Impossible,
}

/// Decides, on further grids where necessary; `again` brings the leaf to rest on a grid whose
/// equilibrium is not near those of the grids before.
pub fn decide(
    problem: &Problem,
    mut found: NestedEquilibrium,
    effort: &mut Effort,
    again: &Again,
) -> Decision {
    let (mut needed, mut may_refine) = (false, true);
    loop {
        let next = next(problem, &found, may_refine, &mut effort.work);
        let list = match &next {
            Next::Nothing => {
                return Decision {
                    needed,
                    ..Decision::none(found)
                };
            }
            Next::Finer(_) => None,
            // More than one attempt: the leaf may be large.
            Next::Compute(list) => Some(List {
                decides: list.decides || needed,
                ..*list
            }),
            Next::Impossible => {
                return Decision {
                    verdict: Verdict::Unknown,
                    needed: true,
                    ..Decision::none(found)
                };
            }
        };
        let lowest = list.and_then(|list| eigenvalues::lowest(problem, &found, list));
        needed |= list.is_none_or(|list| list.decides);
        found = found.softened(lowest.as_ref().map_or(1.0, |lowest| lowest.softening));
        let inaccurate = found.keeps_tolerance && !found.is_accurate();
        let finer = match (next, &lowest) {
            (Next::Finer(grid), _) => Some(grid),
            (_, Some(_)) if inaccurate && may_refine => found.finer(),
            (_, Some(lowest)) => {
                (lowest.undecided).and_then(|size| deciding_grid(problem, &found, size))
            }
            _ => needed.then(|| small_grid(problem, &found)).flatten(),
        };
        if let Some(further) = finer.and_then(|finer| go_on(problem, &found, finer, effort, again))
        {
            (found, needed) = (further, true);
            continue;
        }
        let keeps_tolerance = found.keeps_tolerance && !inaccurate;
        found = found.ended(keeps_tolerance);
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
        let requested = list.above.is_none() && list.count == problem.options.modes;
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
fn go_on(
    problem: &Problem,
    found: &NestedEquilibrium,
    finer: Grid,
    effort: &mut Effort,
    again: &Again,
) -> Option<NestedEquilibrium> {
    // A saddle of the finer grid may be none of the coarser, and what it leads to not near them.
    match continue_on(problem, found.grids(), finer.clone(), effort) {
        Ok(further) => Some(further),
        Err(_) => {
            let further = again(finer, effort)?;
            let path = further.path.clone().or_else(|| found.path.clone());
            Some(further.along(path))
        }
    }
}

/// What decides on the grids so far.
fn next(problem: &Problem, found: &NestedEquilibrium, may_refine: bool, work: &mut Work) -> Next {
    let requested = List::requested(problem);
    let Some(level) = found.levels.last() else {
        return Next::Nothing;
    };
    // A single grid allows no comparison; without a potential there is nothing to compare.
    let comparable = problem.segments().is_none() && level.leaf.leaf.has_potential();
    match found.index {
        Some(0) if comparable && !found.clearly_stable => Next::Compute(List {
            count: requested.count.max(1),
            decides: true,
            ..requested
        }),
        Some(1..) if comparable => beside_zero(problem, found, may_refine, work),
        _ if requested.count == 0 => Next::Nothing,
        _ => Next::Compute(requested),
    }
}

/// What decides on a saddle: the counts of negative eigenvalues, or the few that are close to
/// zero.
fn beside_zero(
    problem: &Problem,
    found: &NestedEquilibrium,
    may_refine: bool,
    work: &mut Work,
) -> Next {
    let Some(Level { leaf, state }) = found.levels.last() else {
        return Next::Nothing;
    };
    let mut system = System::new(leaf);
    let Some(bounds) = bounds(leaf, state, &mut system, work) else {
        return Next::Impossible;
    };
    if bounds.least == bounds.finer && found.index == Some(bounds.least) {
        return Next::Nothing;
    }
    if may_refine
        && bounds.here < bounds.finer
        && let Some(finer) = small_grid(problem, found)
    {
        return Next::Finer(finer);
    }
    let count = (bounds.finer - bounds.least).max(1);
    if count > MOST_MODES {
        return Next::Impossible;
    }
    Next::Compute(List {
        count,
        above: Some((bounds.least, -bounds.close)),
        decides: true,
        exact: false,
    })
}

/// What the signs of extrapolated eigenvalues tell.
fn verdict(problem: &Problem, found: &NestedEquilibrium, list: List, lowest: &Lowest) -> Verdict {
    // On a fine grid rounding may have excused a negative eigenvalue as neutral, or hide what
    // coarser ones tell.
    let as_counted = lowest.undecided.is_none() && lowest.negative <= found.index;
    if as_counted && lowest.certainly_negative() <= found.index.unwrap_or(0) {
        return Verdict::AsCounted;
    }
    let (certain, negative) = match list.above {
        Some(_) => (lowest.certainly_negative(), lowest.negative),
        None => by_more_eigenvalues(problem, found, list, lowest),
    };
    negative.map_or(Verdict::Undecided(certain), Verdict::Index)
}

/// How many eigenvalues are negative for certain, and how many are, if that is known: of the list
/// or, where its signs are not certain or all of them are negative, of a longer and exact one.
fn by_more_eigenvalues(
    problem: &Problem,
    found: &NestedEquilibrium,
    list: List,
    lowest: &Lowest,
) -> (usize, Option<usize>) {
    let (mut certain, mut negative) = (lowest.certainly_negative(), lowest.negative);
    let mut list = List {
        decides: true,
        ..list
    };
    while list.count < MOST_MODES
        && (negative == Some(list.count) || negative.is_none() && !list.exact)
    {
        list.exact = true;
        list.count = (2 * list.count).min(MOST_MODES);
        let more = eigenvalues::lowest(problem, found, list);
        negative = (more.as_ref()).and_then(|more| more.negative_beyond(certain));
        certain = certain.max(more.map_or(0, |more| more.certainly_negative()));
    }
    // There may be more than can be listed.
    (certain, negative.filter(|negative| *negative < list.count))
}

/// The finest grid on which an equilibrium is looked for first.
const FINEST: usize = 1024;

/// Largest and smallest tolerance of further grids, on which its eigenvalues are compared: on the
/// grids that a smaller one needs, rounding hides the signs of soft ones.
const TOLERANCE: f64 = 1e-4;

const LEAST_TOLERANCE: f64 = 1e-5;

/// Equilibria farther apart than this, in lengths, are different ones, and so are those that are
/// farther apart than their errors times the second number.
const SAME_PLACE: f64 = 0.02;

const SAFETY: f64 = 10.0;

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
        method: Method::SemiImplicit(SemiImplicit {
            keep_unstable: true,
            ..SemiImplicit::default()
        }),
        modes: 0,
        ..Options::default()
    };
    let mut ignored = |_: &Progress| {};
    let error = error / leaf.scale.length;
    let tolerance = error.clamp(LEAST_TOLERANCE, TOLERANCE);
    let problem = Problem::new(&leaf, &options, tolerance);
    let mut effort = Effort::new(&mut ignored);
    let discrete = DiscreteLeaf::new(&leaf, grid);
    let state = project(&leaf, &discrete, rods);
    let given = Level {
        leaf: discrete,
        state,
    };
    let mut guess = given.clone();
    while guess.leaf.segments() <= FINEST {
        let finer = Level {
            leaf: DiscreteLeaf::new(&leaf, guess.leaf.grid.refined()),
            state: prolong(&guess.leaf, &guess.state),
        };
        if let Some(counted) = index_from(&problem, guess, (&given, error), &mut effort) {
            return counted;
        }
        guess = finer;
    }
    None
}

/// The index at the `given` equilibrium, known within `error`, counted on grids from that of the
/// `guess` on; `None` if these lead to another one.
fn index_from(
    problem: &Problem,
    mut guess: Level,
    (given, error): (&Level, f64),
    effort: &mut Effort,
) -> Option<Option<usize>> {
    let Level { leaf, state } = &mut guess;
    let mut system = System::new(leaf);
    let begun = state.clone();
    let index = saddle::polish(leaf, state, &mut system, &mut effort.work)?;
    if saddle::clearly_stable(leaf, state, &mut system, &mut effort.work) {
        return (state.shift_to(&begun) < SAME_PLACE).then_some(Some(0));
    }
    let counted = NestedEquilibrium::begun(problem).counted(false, Some(index));
    let refined = refine(problem, counted.with(guess), effort).ok()?;
    // No other equilibrium is of interest.
    let Decision { found, verdict, .. } = decide(problem, refined, effort, &|_, _| None);
    let allowed = SAME_PLACE.min(SAFETY * (error + found.error().unwrap_or(f64::INFINITY)));
    (distance_from(&found, given) <= allowed).then_some(match verdict {
        Verdict::AsCounted => found.index,
        Verdict::Index(index) => Some(index),
        Verdict::Undecided(_) | Verdict::Unknown => None,
    })
}

/// The largest distance of the extrapolated positions from those `given` on a grid whose repeated
/// halving leads to the first of those where it was found.
fn distance_from(found: &NestedEquilibrium, given: &Level) -> f64 {
    let (first, own) = (found.levels[0].leaf.segments(), given.leaf.segments());
    let rods = found.table.extrapolated().chunks(3 * (first + 1));
    let shared = rods.flat_map(|rod| rod.chunks(3).step_by(first / own).flatten());
    let shared: Vec<f64> = shared.copied().collect();
    distance(&shared, &positions(given, 1))
}

/// The state of the discrete leaf at the given nodes.
pub fn project(leaf: &Leaf, discrete: &DiscreteLeaf, rods: &[RodShape]) -> State {
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
