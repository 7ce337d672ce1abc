//! The Morse index of an equilibrium that was not found by relaxation.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::newton::Stop;
use crate::relax::decision::{Verdict, decide};
use crate::relax::level::Level;
use crate::relax::method::{Method, SemiImplicit};
use crate::relax::options::{Options, Progress};
use crate::relax::prolong::prolong;
use crate::relax::run::Run;
use crate::relax::saddle;
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};
use glam::DVec3;

/// The finest grid on which an equilibrium is looked for first.
const FINEST: usize = 1024;

/// Tolerance of further grids, on which its eigenvalues are compared.
const TOLERANCE: f64 = 1e-4;

/// Grids whose tips are farther apart than this, in lengths, have different equilibria.
const SAME_PLACE: f64 = 0.02;

/// Number of negative eigenvalues of the energy's Hessian at the equilibrium near `rods`,
/// given at the nodes of `grid` in the scenario's units, decided as that of a relaxed leaf.
/// `None` under a dead moment, which has no potential, if Newton's method finds no equilibrium
/// nearby, or if an eigenvalue may have either sign.
pub fn index_near(scenario: &Scenario, grid: Grid, rods: &[RodShape]) -> Option<usize> {
    let leaf = Leaf::new(scenario);
    if leaf.loads.tip_moment != DVec3::ZERO {
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
    let mut run = Run::new(&leaf, &options, TOLERANCE, &mut ignored);
    let mut discrete = DiscreteLeaf::new(&leaf, grid);
    let mut state = project(&leaf, &discrete, rods);
    loop {
        let mut system = System::new(&discrete);
        run.index = saddle::polish(&discrete, &mut state, &mut system, &mut run.work);
        if run.index.is_some() {
            if saddle::clearly_stable(&discrete, &state, &mut system, &mut run.work) {
                return Some(0);
            }
            break;
        }
        state = prolong(&discrete, &state);
        let finer = discrete.grid.refined();
        discrete = DiscreteLeaf::new(&leaf, finer);
        if discrete.segments() > FINEST {
            return None;
        }
    }
    run.push(Level {
        leaf: discrete,
        state,
    });
    let tips = |run: &Run, level: usize| -> Vec<DVec3> {
        let state = &run.levels[level].state;
        (0..state.rods()).map(|j| state.tip(j)).collect()
    };
    let first = tips(&run, 0);
    let mut end = run.refine();
    end.ok()?;
    // No other equilibrium is of interest.
    let lost = &mut |_: &mut Run, _| Err(Stop::StepLimit);
    let verdict = decide(&mut run, &mut end, lost).verdict;
    let last = tips(&run, run.levels.len() - 1);
    let near = |(a, b): (&DVec3, &DVec3)| a.distance(*b) < SAME_PLACE;
    if !first.iter().zip(&last).all(near) {
        return None;
    }
    match verdict {
        Verdict::AsCounted => run.index,
        Verdict::Index(index) => Some(index),
        Verdict::Undecided | Verdict::Unknown => None,
    }
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
