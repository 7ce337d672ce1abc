//! The Morse index of an equilibrium that was not found by relaxation.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::relax::accuracy::richardson::distance;
use crate::relax::grids::refine;
use crate::relax::nested::NestedEquilibrium;
use crate::relax::request::method::{Method, SemiImplicit};
use crate::relax::request::options::{Options, Progress};
use crate::relax::request::problem::Problem;
use crate::relax::saddle;
use crate::relax::settle::effort::Effort;
use crate::relax::stability::decide::{Decision, Verdict, decide};
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::prolong::prolong;
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};

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
