//! The equilibrium that a leaf reaches from a given state, on one grid.

use crate::leaf::{Grid, Leaf, State};
use crate::limit::Limit;
use crate::relax::request::options::{Options, Progress};
use crate::relax::settle::iteration::InitialGuess;
use crate::relax::settle::run::Run;

/// Accuracy of the equilibrium.
const TOLERANCE: f64 = 1e-6;

/// The stable equilibrium that a leaf reaches from a state on a grid without initial velocity:
/// saddles are left. `None` if it does not come to rest.
pub fn settle_from(leaf: &Leaf, grid: &Grid, state: State, limit: &Limit) -> Option<State> {
    let options = Options {
        limit: limit.clone(),
        ..Options::default()
    };
    let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
    let mut run = Run::new(leaf, &options, TOLERANCE, ignored);
    let settled = run.settle(grid.clone(), InitialGuess::Pushed(state));
    settled.rest.ok()?;
    run.push(settled.level);
    while !run.check_stability(true).ok()? {}
    run.levels.pop().map(|level| level.state)
}
