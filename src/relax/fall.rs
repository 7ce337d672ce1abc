//! Where a leaf comes to rest from a given state, on one grid.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::limit::Limit;
use crate::newton::Work;
use crate::relax::options::{Options, Progress};
use crate::relax::run::Run;
use crate::relax::saddle::push_along;
use crate::relax::settle::InitialGuess;

/// Accuracy to which it comes to rest.
const TOLERANCE: f64 = 1e-6;

/// Where a leaf comes to rest that sets out from a state on a grid, with no motion; none
/// if it does not.
pub fn settle_from(leaf: &Leaf, grid: &Grid, state: State, limit: &Limit) -> Option<State> {
    let options = Options {
        limit: limit.clone(),
        ..Options::default()
    };
    let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
    let mut run = Run::new(leaf, &options, TOLERANCE, ignored);
    let settled = run.settle(grid.clone(), InitialGuess::Pushed(state));
    settled.rest.ok().map(|_| settled.level.state)
}

/// Where a leaf comes to rest that leaves a saddle along its unstable mode, pushed so far
/// (radians, lengths), and against it.
pub fn fall(
    leaf: &Leaf,
    grid: &Grid,
    saddle: &State,
    push: f64,
    limit: &Limit,
) -> [Option<State>; 2] {
    let discrete = DiscreteLeaf::new(leaf, grid.clone());
    let mut system = System::new(&discrete);
    [push, -push].map(|by| {
        let mut state = saddle.clone();
        push_along(&discrete, &mut state, &mut system, &mut Work::default(), by);
        settle_from(leaf, grid, state, limit)
    })
}
