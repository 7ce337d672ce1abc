//! The Morse index of an equilibrium that was not found by relaxation.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::newton::Work;
use crate::relax::prolong::prolong;
use crate::relax::saddle;
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};
use glam::DVec3;

/// The finest grid on which eigenvalues are counted.
const FINEST: usize = 1024;

/// Number of negative eigenvalues of the energy's Hessian at the equilibrium near `rods`,
/// given at the nodes of `grid` in the scenario's units. Counted on successively refined grids
/// until two agree. `None` under a dead moment, which has no potential, and if the counts
/// never agree (Newton's method may not find an equilibrium nearby).
pub fn index_near(scenario: &Scenario, grid: Grid, rods: &[RodShape]) -> Option<usize> {
    let leaf = Leaf::new(scenario);
    if leaf.loads.tip_moment != DVec3::ZERO {
        return None;
    }
    let mut discrete = DiscreteLeaf::new(&leaf, grid);
    let mut state = project(&leaf, &discrete, rods);
    let mut before = None;
    let mut work = Work::default();
    while discrete.segments() <= FINEST {
        let mut system = System::new(&discrete);
        let index = saddle::polish(&discrete, &mut state, &mut system, &mut work);
        if index.is_some() && index == before {
            return index;
        }
        before = index;
        state = prolong(&discrete, &state);
        let finer = discrete.grid.refined();
        discrete = DiscreteLeaf::new(&leaf, finer);
    }
    None
}

/// The state of the discrete leaf at the given nodes.
pub fn project(leaf: &Leaf, discrete: &DiscreteLeaf, rods: &[RodShape]) -> State {
    let scale = leaf.scale;
    let nodes = || rods.iter().flat_map(|rod| &rod.nodes);
    let x = nodes().map(|node| node.position / scale.length).collect();
    let q = nodes().map(|node| node.rotation).collect();
    let mut state = State::new(discrete.segments(), x, q);
    let ends = rods.iter().flat_map(|rod| rod.nodes.windows(2));
    let force = |node: &NodeState| node.rotation * node.n;
    let middle = |ends: &[_]| 0.5 * (force(&ends[0]) + force(&ends[1])) / scale.force();
    state.n = ends.map(middle).collect();
    state
}
