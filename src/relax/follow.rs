//! Continuation of an equilibrium under a small change of its scenario, on the same grids,
//! without jumps to another equilibrium.

use crate::leaf::{Leaf, Response, State};
use crate::newton::{Stop, Work};
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::request::options::{Options, Progress, RelaxError};
use crate::relax::settle::run::Run;
use crate::relax::solve::relax_on_grids;
use crate::relax::transfer::level::{Level, positions};
use crate::relax::transfer::predict::weights;
use crate::relax::transfer::stencil::Stencil;
use crate::relax::{Equilibrium, Outcome};
use crate::scenario::Scenario;
use glam::DVec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest distance of an equilibrium from its prediction, as a part of the predicted displacement
/// plus a length (in lengths of the leaf). Farther away it may be another equilibrium.
const DRIFT: f64 = 0.5;
const DRIFT_LENGTH: f64 = 0.02;

/// A stable leaf at rest on nested grids.
#[derive(Clone)]
pub(crate) struct AtRest {
    /// The grids that are extrapolated, from coarse to fine.
    pub levels: Vec<Level>,
    /// Weight of each in the extrapolated values.
    pub weights: Vec<f64>,
    pub work: Work,
}

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

impl AtRest {
    /// By relaxation from the start of the scenario.
    pub fn find(
        scenario: &Scenario,
        options: &Options,
    ) -> Result<Result<(AtRest, Equilibrium), Lost>, RelaxError> {
        AtRest::observed(scenario, options, &mut |_| {})
    }

    /// The same in no more than so many steps; a leaf that needs more does not come to rest.
    pub fn find_within(
        scenario: &Scenario,
        options: &Options,
        most_steps: usize,
    ) -> Result<Result<AtRest, Lost>, RelaxError> {
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
        let found = AtRest::observed(scenario, &limited, &mut count)?;
        Ok(found.map(|(at, _)| at))
    }

    fn observed(
        scenario: &Scenario,
        options: &Options,
        progress: &mut dyn FnMut(&Progress),
    ) -> Result<Result<(AtRest, Equilibrium), Lost>, RelaxError> {
        let (leaf, levels) = relax_on_grids(scenario, options, false, progress)?;
        if !leaf.outcome.is_at_rest() || leaf.outcome == Outcome::Saddle {
            let remark = leaf.remark.clone();
            let why = remark.unwrap_or_else(|| leaf.outcome.word().into());
            return Ok(Err(Lost::NotAtRest(why)));
        }
        Ok(Ok((AtRest::on(levels, leaf.work), leaf)))
    }

    fn on(levels: Vec<Level>, work: Work) -> AtRest {
        let segments: Vec<usize> = levels.iter().map(|level| level.leaf.segments()).collect();
        let on = |level: &Level| {
            let own = level.leaf.segments();
            (own, positions(level, (own / segments[0]).max(1)))
        };
        let table: Richardson = levels.iter().map(on).collect();
        let first = segments.len() - 1 - table.columns();
        let mut extrapolation = vec![0.0; first];
        extrapolation.extend(weights(&segments[first..], f64::INFINITY));
        AtRest {
            weights: extrapolation,
            levels,
            work,
        }
    }

    /// The same on the coarsest `count` grids alone; `None` unless each of them halves the
    /// segments of the one before.
    pub fn coarsest(&self, count: usize) -> Option<AtRest> {
        let levels = self.levels.get(..count)?;
        let halved = |pair: &[Level]| pair[1].leaf.segments() == 2 * pair[0].leaf.segments();
        let nested = levels.windows(2).all(halved);
        nested.then(|| AtRest::on(levels.to_vec(), self.work))
    }

    /// The equilibrium of a slightly different scenario, starting on each grid from this one
    /// plus its linear response to the difference.
    pub fn follow(
        &self,
        scenario: Arc<Scenario>,
        response: &[Response],
        (options, grids): (&Options, Grids),
    ) -> Result<AtRest, Lost> {
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
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let mut run = Run::new(&leaf, options, tolerance, ignored);
        // As for a reduced leaf: the run fails if the leaf would have to move far.
        run.whole = Some(&leaf);
        let followed = match grids {
            Grids::AsNeeded => run.follow(guesses).map(|_| ()),
            Grids::These => run.follow_on_these(guesses),
        };
        match followed {
            Ok(()) => {}
            Err(Stop::StepLimit) if run.out_of_time() => {
                return Err(Lost::NotAtRest("the time allowed was over".into()));
            }
            Err(_) => return Err(Lost::Elsewhere),
        }
        for ((level, expected), before) in run.levels.iter().zip(&expected).zip(&self.levels) {
            let predicted = rescaled(before, before.state.clone(), &leaf).shift_to(expected);
            if level.state.shift_to(expected) > DRIFT * predicted + DRIFT_LENGTH {
                return Err(Lost::Elsewhere);
            }
        }
        let work = run.work;
        Ok(AtRest::on(run.levels, work))
    }

    /// The extrapolated value of a quantity given by `on` on each grid.
    pub fn best(&self, on: impl Fn(usize, &Level) -> DVec3) -> DVec3 {
        let levels = self.levels.iter().zip(&self.weights).enumerate();
        let known = levels.filter(|(_, (_, weight))| **weight != 0.0);
        known
            .map(|(k, (level, weight))| *weight * on(k, level))
            .sum()
    }

    /// Interpolation stencils of each grid at the fraction `sigma`, of values and of their
    /// derivatives; extrapolation beyond the ends is linear.
    pub fn stencils(&self, sigma: f64) -> Vec<[Stencil; 2]> {
        let on = |level: &Level| Stencil::at(&level.leaf, sigma);
        self.levels.iter().map(on).collect()
    }
}

/// A state of a level in the units of another leaf, with the base rotations of that leaf.
fn rescaled(level: &Level, mut state: State, leaf: &Leaf) -> State {
    let (from, to) = (level.leaf.leaf.scale, leaf.scale);
    let (length, force) = (from.length / to.length, from.force() / to.force());
    state.x.iter_mut().for_each(|x| *x *= length);
    state.n.iter_mut().for_each(|n| *n *= force);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        state.q[base] = leaf.base(j);
    }
    state
}

/// A state displaced by a linear response, in the units of another leaf.
fn moved(level: &Level, leaf: &Leaf, response: &Response) -> State {
    let mut state = level.state.clone();
    response.advance(&mut state, 1.0);
    rescaled(level, state, leaf)
}
