//! Continuation of an equilibrium under a small change of its scenario, on the same grids,
//! without jumps to another equilibrium.

use crate::leaf::{Leaf, Response, State};
use crate::newton::Stop;
use crate::relax::Outcome;
use crate::relax::grids::{follow, follow_on_these};
use crate::relax::nested::NestedEquilibrium;
use crate::relax::request::options::{Options, Progress, RelaxError};
use crate::relax::request::problem::Problem;
use crate::relax::rest::relax_on_grids;
use crate::relax::settle::effort::Effort;
use crate::relax::transfer::level::Level;
use crate::scenario::Scenario;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest distance of an equilibrium from its prediction, as a part of the predicted displacement
/// plus a length (in lengths of the leaf). Farther away it may be another equilibrium.
const DRIFT: f64 = 0.5;
const DRIFT_LENGTH: f64 = 0.02;

/// The grids on which an equilibrium is continued.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Grids {
    /// The present ones, and finer ones where the tolerance requires them.
    AsNeeded,
    /// The present ones only.
    These,
}

/// Why a continuation ended without an equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Lost {
    /// The leaf does not come to rest, with the reason.
    NotAtRest(String),
    /// The equilibrium found is not the continuation of this one: the leaf would have to jump.
    Elsewhere,
}

impl NestedEquilibrium {
    /// The stable equilibrium to which relaxation leads from the start of the scenario.
    pub fn find(
        scenario: &Scenario,
        options: &Options,
    ) -> Result<Result<NestedEquilibrium, Lost>, RelaxError> {
        observed(scenario, options, &mut |_| {})
    }

    /// The same in no more than so many steps; a leaf that needs more does not come to rest.
    pub fn find_within(
        scenario: &Scenario,
        options: &Options,
        most_steps: usize,
    ) -> Result<Result<NestedEquilibrium, Lost>, RelaxError> {
        let cancel = Arc::new(AtomicBool::new(false));
        let mut limited = options.clone();
        limited.limit.cancel = Some(cancel.clone());
        let mut steps = 0;
        let mut count = |_: &Progress| {
            steps += 1;
            if steps > most_steps || options.limit.reached() {
                cancel.store(true, Ordering::Relaxed);
            }
        };
        observed(scenario, &limited, &mut count)
    }

    /// The equilibrium of a slightly different scenario, starting on each grid from this one
    /// plus its linear response to the difference.
    pub fn follow(
        &self,
        scenario: Arc<Scenario>,
        response: &[Response],
        (options, grids): (&Options, Grids),
    ) -> Result<NestedEquilibrium, Lost> {
        let scale = scenario.scale();
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let leaf = Leaf::in_units(scenario, scale);
        let guesses: Vec<_> = (self.levels.iter().enumerate())
            .map(|(k, level)| {
                let mut state = moved(level, &leaf, &response[k]);
                leaf.hold_tips(&mut state);
                (level.leaf.grid.clone(), state)
            })
            .collect();
        let expected: Vec<State> = guesses.iter().map(|(_, state)| state.clone()).collect();
        let problem = Problem {
            // As for a reduced leaf: it fails if the leaf would have to move far.
            whole: Some(&leaf),
            ..Problem::new(&leaf, options, tolerance)
        };
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let (begun, mut effort) = (NestedEquilibrium::begun(&problem), Effort::new(ignored));
        let followed = match grids {
            Grids::AsNeeded => follow(&problem, begun, guesses, &mut effort),
            Grids::These => follow_on_these(&problem, begun, guesses, &mut effort),
        };
        let found = followed.map_err(|failure| match failure.stop {
            Stop::StepLimit if problem.out_of_time() => {
                Lost::NotAtRest("the time allowed was over".into())
            }
            _ => Lost::Elsewhere,
        })?;
        for ((level, expected), before) in found.levels.iter().zip(&expected).zip(&self.levels) {
            let predicted = rescaled(before, before.state.clone(), &leaf).shift_to(expected);
            if level.state.shift_to(expected) > DRIFT * predicted + DRIFT_LENGTH {
                return Err(Lost::Elsewhere);
            }
        }
        Ok(found.after(effort.work))
    }
}

fn observed(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Result<NestedEquilibrium, Lost>, RelaxError> {
    let (leaf, found) = relax_on_grids(scenario, options, false, progress)?;
    if !leaf.outcome.is_at_rest() || leaf.outcome == Outcome::Saddle {
        let remark = leaf.remark.clone();
        let why = remark.unwrap_or_else(|| leaf.outcome.word().into());
        return Ok(Err(Lost::NotAtRest(why)));
    }
    Ok(Ok(found))
}

/// A state of a level in the units of another leaf, with the base rotations of that leaf.
pub(super) fn rescaled(level: &Level, mut state: State, leaf: &Leaf) -> State {
    let (from, to) = (level.leaf.leaf.scale, leaf.scale);
    let (length, force) = (from.length / to.length, from.force() / to.force());
    state.x.iter_mut().for_each(|x| *x *= length);
    state.n.iter_mut().for_each(|n| *n *= force);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        (state.x[base], state.q[base]) = leaf.base(j);
    }
    state
}

/// A state displaced by a linear response, in the units of another leaf.
fn moved(level: &Level, leaf: &Leaf, response: &Response) -> State {
    let mut state = level.state.clone();
    response.advance(&mut state, 1.0);
    rescaled(level, state, leaf)
}
