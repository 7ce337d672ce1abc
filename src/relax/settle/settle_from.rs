//! The equilibrium that a leaf reaches from a given state, on one grid.

use crate::leaf::{Grid, Leaf, State};
use crate::limit::Limit;
use crate::relax::nested::NestedEquilibrium;
use crate::relax::request::options::{Options, Progress};
use crate::relax::request::problem::Problem;
use crate::relax::settle::effort::Effort;
use crate::relax::settle::iteration::{InitialGuess, settle};
use crate::relax::settle::push::check_stability;

/// Accuracy of the equilibrium.
const TOLERANCE: f64 = 1e-6;

/// The stable equilibrium that a leaf reaches from a state on a grid without initial velocity:
/// saddles are left. `None` if it does not come to rest.
pub fn settle_from(leaf: &Leaf, grid: &Grid, state: State, limit: &Limit) -> Option<State> {
    let options = Options {
        limit: limit.clone(),
        ..Options::default()
    };
    let problem = Problem::new(leaf, &options, TOLERANCE);
    let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
    let mut effort = Effort::new(ignored);
    let mut found = NestedEquilibrium::begun(&problem);
    let from = (grid.clone(), InitialGuess::Pushed(state));
    let settled = settle(&problem, &mut found.history, from, &mut effort);
    settled.rest.ok()?;
    found = found.with(settled.level);
    let mut known = false;
    while !known {
        (found, known) = check_stability(&problem, found, true, &mut effort).ok()?;
    }
    found.levels.pop().map(|level| level.state)
}
