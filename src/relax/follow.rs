//! An equilibrium followed as its scenario changes a little, on the same grids, and
//! never into another valley.

use crate::leaf::{Leaf, Response, State};
use crate::newton::{Stop, Work};
use crate::relax::level::{Level, positions};
use crate::relax::options::{Options, Progress, RelaxError};
use crate::relax::richardson::Richardson;
use crate::relax::run::Run;
use crate::relax::solve::relax_on_grids;
use crate::relax::stencil::Stencil;
use crate::relax::{Equilibrium, Outcome};
use crate::scenario::Scenario;
use glam::DVec3;
use std::sync::Arc;

/// How far from where it was expected an equilibrium may be: of the way that was
/// expected, and in lengths of the leaf. Farther away it may be another one.
const OFF_THE_WAY: f64 = 0.5;
const NEARBY: f64 = 0.02;

/// A stable leaf at rest on nested grids.
#[derive(Clone)]
pub(crate) struct AtRest {
    /// The grids that are extrapolated, from coarse to fine.
    pub levels: Vec<Level>,
    /// What each contributes to the best values.
    pub weights: Vec<f64>,
    pub work: Work,
}

/// The grids on which an equilibrium is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Grids {
    /// Finer ones too, where the tolerance needs them.
    AsNeeded,
    /// The same.
    These,
}

/// Why there is no equilibrium to go on with.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Lost {
    /// The leaf does not come to rest; why.
    NotAtRest(String),
    /// It would have to jump.
    Elsewhere,
}

impl AtRest {
    /// From the start of the scenario.
    pub fn find(
        scenario: &Scenario,
        options: &Options,
    ) -> Result<Result<(AtRest, Equilibrium), Lost>, RelaxError> {
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let (leaf, levels) = relax_on_grids(scenario, options, tolerance, &mut |_| {})?;
        if !leaf.outcome.is_at_rest() || leaf.outcome == Outcome::Saddle {
            let remark = leaf.remark.clone();
            let why = remark.unwrap_or_else(|| leaf.outcome.word().into());
            return Ok(Err(Lost::NotAtRest(why)));
        }
        Ok(Ok((AtRest::on(levels, leaf.work), leaf)))
    }

    fn on(levels: Vec<Level>, work: Work) -> AtRest {
        let first = levels.first().map_or(1, |level| level.leaf.segments());
        let mut table = Richardson::default();
        for level in &levels {
            let segments = level.leaf.segments();
            table.push(segments, positions(level, (segments / first).max(1)));
        }
        let columns = table.best().map_or(0, |best| best.columns);
        let segments: Vec<usize> = levels.iter().map(|level| level.leaf.segments()).collect();
        AtRest {
            weights: extrapolation(&segments, columns),
            levels,
            work,
        }
    }

    /// The same on the coarsest `count` grids alone; `None` if these are not halved
    /// from one to the next.
    pub fn coarsest(&self, count: usize) -> Option<AtRest> {
        let levels = self.levels.get(..count)?;
        let halved = |pair: &[Level]| pair[1].leaf.segments() == 2 * pair[0].leaf.segments();
        let nested = levels.windows(2).all(halved);
        nested.then(|| AtRest::on(levels.to_vec(), self.work))
    }

    /// The equilibrium of a scenario that differs a little: from this one, moved as it
    /// answers the difference on each grid.
    pub fn follow(
        &self,
        scenario: Arc<Scenario>,
        answer: &[Response],
        (options, grids): (&Options, Grids),
    ) -> Result<AtRest, Lost> {
        let scale = scenario.scale();
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let leaf = Leaf::in_units(scenario, scale);
        let guesses: Vec<_> = (self.levels.iter().enumerate())
            .map(|(k, level)| {
                let mut state = moved(level, &leaf, &answer[k]);
                leaf.hold_tips(&mut state);
                (level.leaf.grid.clone(), state)
            })
            .collect();
        let expected: Vec<State> = guesses.iter().map(|(_, state)| state.clone()).collect();
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let mut run = Run::new(&leaf, options, tolerance, ignored);
        // As of a reduced leaf: it gives up where the leaf would have to move far.
        run.whole = Some(&leaf);
        let followed = match grids {
            Grids::AsNeeded => run.follow(guesses).map(|_| ()),
            Grids::These => run.follow_on_these(guesses),
        };
        match followed {
            Ok(()) => {}
            Err(Stop::StepLimit) if run.late() => {
                return Err(Lost::NotAtRest("the time allowed was over".into()));
            }
            Err(_) => return Err(Lost::Elsewhere),
        }
        for ((level, expected), before) in run.levels.iter().zip(&expected).zip(&self.levels) {
            let way = rescaled(before, before.state.clone(), &leaf).shift_to(expected);
            if level.state.shift_to(expected) > OFF_THE_WAY * way + NEARBY {
                return Err(Lost::Elsewhere);
            }
        }
        let work = run.work;
        Ok(AtRest::on(run.levels, work))
    }

    /// The best value of what is `on` each grid.
    pub fn best(&self, on: impl Fn(usize, &Level) -> DVec3) -> DVec3 {
        let levels = self.levels.iter().zip(&self.weights).enumerate();
        let known = levels.filter(|(_, (_, weight))| **weight != 0.0);
        known
            .map(|(k, (level, weight))| *weight * on(k, level))
            .sum()
    }

    /// Nodes and weights on each grid by which values at nodes are interpolated at the
    /// fraction `sigma`, and the derivatives of the weights with it; beyond the ends the
    /// values go on linearly.
    pub fn stencils(&self, sigma: f64) -> Vec<Stencil> {
        let on = |level: &Level| Stencil::new(&level.leaf, sigma);
        self.levels.iter().map(on).collect()
    }
}

/// The weights of grids in the values from which `columns` terms of the series in
/// ds^2 are removed.
pub(crate) fn extrapolation(segments: &[usize], columns: usize) -> Vec<f64> {
    let first = segments.len().saturating_sub(columns + 1);
    let squares: Vec<f64> = segments.iter().map(|&n| (n as f64).powi(2)).collect();
    let weight = |k: usize| match k < first {
        true => 0.0,
        false => (first..segments.len())
            .filter(|&other| other != k)
            .map(|other| squares[k] / (squares[k] - squares[other]))
            .product(),
    };
    (0..segments.len()).map(weight).collect()
}

/// A state of a level in the units of another leaf, whose bases hold it.
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

/// A state moved along an answer, in the units of another leaf.
fn moved(level: &Level, leaf: &Leaf, answer: &Response) -> State {
    let mut state = level.state.clone();
    for (j, rod) in answer.nodes.iter().enumerate() {
        let base = state.base(j);
        for (i, increment) in rod.iter().enumerate() {
            state.advance(base + i + 1, increment, 1.0);
        }
    }
    let forces = state.n.iter_mut().zip(&answer.carried);
    forces.for_each(|(force, change)| *force += *change);
    rescaled(level, state, leaf)
}
