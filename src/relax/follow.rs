//! A leaf at rest that follows its scenario as numbers of it change: along its branch of equilibria, on
//! the same grids, as long as they are stable, and elsewhere only where it is told so.

use crate::homotopy::{StepEnd, StepSizes};
use crate::leaf::{
    DiscreteLeaf, Grid, Leaf, LeafParameterDerivative, LinearResponse, State, Weighted,
};
use crate::newton::EquilibriumFailure;
use crate::relax::accuracy::NestedEquilibrium;
use crate::relax::accuracy::transfer::{GridLevel, StateOnGrid, transfer};
use crate::relax::linear_response::Linearized;
use crate::relax::log::WorkLog;
use crate::relax::nested_grids::{solve_from_guesses, solve_on_given_grids};
use crate::relax::plan::{GRIDS, RelaxationProblem, ValleyPolicy};
use crate::relax::request::{Options, Progress, RelaxError, check_options_without_potential};
use crate::relax::rest::{RelaxedLeaf, equilibrium_with_stability, relax_on_grids};
use crate::relax::result::Equilibrium;
use crate::relax::same_equilibrium::{is_near_prediction, is_same_beside_fold};
use crate::relax::stability::state_from_rod_shapes;
use crate::relax::{Outcome, nested_grids};
use crate::run::Instant;
use crate::scenario::Scenario;
use crate::shape::RodShape;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The grids on which an equilibrium is continued.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum GridPolicy {
    /// The present ones, and finer ones where the tolerance requires them.
    AsNeeded,
    /// The grids of the present equilibrium alone.
    These,
}

/// Why a continuation ended without an equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ContinuationFailure {
    /// The leaf does not come to rest, with the reason.
    NotAtRest(String),
    /// The equilibrium found is not the continuation of this one: the leaf would have to jump.
    OtherEquilibrium,
}

impl NestedEquilibrium {
    /// The stable equilibrium to which relaxation leads from the start of the scenario.
    pub fn relax_to_stable(
        scenario: &Scenario,
        options: &Options,
    ) -> Result<Result<NestedEquilibrium, ContinuationFailure>, RelaxError> {
        relax_with_progress(scenario, options, &mut |_| {})
    }

    /// The same in no more than so many steps; a leaf that needs more does not come to rest.
    pub fn find_within(
        scenario: &Scenario,
        options: &Options,
        most_steps: usize,
    ) -> Result<Result<NestedEquilibrium, ContinuationFailure>, RelaxError> {
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
        relax_with_progress(scenario, &limited, &mut count)
    }

    /// The equilibrium of a slightly different scenario, starting on each grid from this one
    /// plus its linear response to the difference.
    pub fn continue_to_scenario(
        &self,
        scenario: Arc<Scenario>,
        response: &[LinearResponse],
        options: &Options,
        grids: GridPolicy,
    ) -> Result<NestedEquilibrium, ContinuationFailure> {
        let scale = scenario.scale();
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let leaf = Leaf::with_scale(scenario, scale);
        let guesses: Vec<_> = (self.levels.iter().enumerate())
            .map(|(k, level)| {
                let mut state = displaced_state(level, &leaf, &response[k]);
                leaf.place_held_tips(&mut state);
                StateOnGrid {
                    grid: level.leaf.grid.clone(),
                    state,
                }
            })
            .collect();
        let expected: Vec<State> = guesses.iter().map(|guess| guess.state.clone()).collect();
        let problem = RelaxationProblem {
            valley: ValleyPolicy::StayOnBranch,
            ..RelaxationProblem::new(&leaf, options, tolerance)
        };
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let (begun, mut effort) = (
            NestedEquilibrium::without_grids(&problem),
            WorkLog::new(ignored),
        );
        let followed = match grids {
            GridPolicy::AsNeeded => solve_from_guesses(&problem, begun, guesses, &mut effort),
            GridPolicy::These => solve_on_given_grids(&problem, begun, guesses, &mut effort),
        };
        let found = followed.map_err(|failure| match failure.stop {
            EquilibriumFailure::StepLimit if problem.out_of_time() => {
                ContinuationFailure::NotAtRest("the time allowed was over".into())
            }
            _ => ContinuationFailure::OtherEquilibrium,
        })?;
        for ((level, expected), before) in found.levels.iter().zip(&expected).zip(&self.levels) {
            let before = rescale_state(before, before.state.clone(), &leaf);
            if !is_near_prediction(&before, expected, &level.state) {
                return Err(ContinuationFailure::OtherEquilibrium);
            }
        }
        Ok(found.with_work(effort.work))
    }
}

fn relax_with_progress(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Result<NestedEquilibrium, ContinuationFailure>, RelaxError> {
    let RelaxedLeaf {
        result: leaf,
        on_grids: found,
    } = relax_on_grids(scenario, options, false, progress)?;
    if !leaf.outcome.is_at_rest() || leaf.outcome == Outcome::Saddle {
        let remark = leaf.remark.as_ref();
        let why = remark.map_or_else(|| leaf.outcome.word().into(), ToString::to_string);
        return Ok(Err(ContinuationFailure::NotAtRest(why)));
    }
    let any = |has: fn(&DiscreteLeaf) -> bool| found.levels.iter().any(|level| has(&level.leaf));
    let windy = any(|leaf| leaf.leaf.in_wind());
    if (windy || any(DiscreteLeaf::has_followers)) && leaf.stable() == Some(false) {
        let why = match windy {
            true => "small motions about it grow in the wind",
            false => "small motions about it grow under loads that turn with the section",
        };
        return Ok(Err(ContinuationFailure::NotAtRest(why.into())));
    }
    Ok(Ok(found))
}

/// A state of a level in the units of another leaf, with the base rotations of that leaf.
fn rescale_state(level: &GridLevel, mut state: State, leaf: &Leaf) -> State {
    let (from, to) = (level.leaf.leaf.scale, leaf.scale);
    let (length, force) = (from.length / to.length, from.force() / to.force());
    state.x.iter_mut().for_each(|x| *x *= length);
    state.n.iter_mut().for_each(|n| *n *= force);
    leaf.place_bases(&mut state);
    state
}

/// A state displaced by a linear response, in the units of another leaf.
fn displaced_state(level: &GridLevel, leaf: &Leaf, response: &LinearResponse) -> State {
    let mut state = level.state.clone();
    response.advance(&mut state, 1.0);
    rescale_state(level, state, leaf)
}

/// Steps from one scenario to another.
const STEPS: StepSizes = StepSizes {
    first: 1.0,
    shortest: 1.0 / 4096.0,
    longest: 1.0,
    growth: 2.0,
    failure: 0.25,
};

/// Why a leaf does not follow its scenario to the end.
enum FollowEnd<E> {
    /// Its branch cannot be followed beyond this part of the way.
    Lost(f64),
    /// A scenario on the way cannot be met.
    Refused(E),
}

/// Grids on which the next equilibrium is predicted.
const MAX_PREDICTED_GRIDS: usize = 2;

/// A leaf at rest, which can follow.
///
/// ```
/// use leafdyn::relax::{EquilibriumTracker, Options, RelaxError, TrackOutcome};
/// use leafdyn::scenario::Scenario;
///
/// let scenario = Scenario::read("scenarios/paper/fig04.toml")?;
/// let weight = scenario.gravity[2];
/// let (_, tracker) = EquilibriumTracker::begin(&scenario, &Options::default())?;
/// let mut tracker = tracker.expect("the leaf is at rest");
/// let heavier = |part: f64| {
///     let mut scenario = scenario.clone();
///     scenario.gravity[2] = weight * (1.0 + part);
///     Ok::<_, RelaxError>(scenario)
/// };
/// let TrackOutcome::Arrived(heavy) = tracker.follow(&heavier)? else {
///     panic!("it bends further");
/// };
/// assert_eq!(heavy.stable(), Some(true));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct EquilibriumTracker {
    scenario: Arc<Scenario>,
    options: Options,
    at: NestedEquilibrium,
    /// Segments of the coarsest grid away from folds.
    usual_coarsest_segments: usize,
    /// Those that are tried instead, once, where it takes more than [`MAX_ECONOMICAL_GRIDS`].
    alternative_segments: Option<usize>,
}

/// Grids that a leaf needs on the right coarsest one: the next would cost more than all of these.
const MAX_ECONOMICAL_GRIDS: usize = 3;

/// Where a leaf is that was to follow.
pub enum TrackOutcome {
    /// In the equilibrium into which the one before has changed.
    Arrived(Box<Equilibrium>),
    /// Its stable equilibria end at this part of the way, where it stays: from there it has to move
    /// on, to another one.
    BranchEnded {
        /// From 0, where it began, to 1.
        part: f64,
    },
}

impl EquilibriumTracker {
    /// Brings a leaf to rest as [`relax`](crate::relax::relax) does; none can follow if it is not, or at
    /// a saddle.
    ///
    /// # Errors
    /// Requests that cannot be met.
    pub fn begin(
        scenario: &Scenario,
        options: &Options,
    ) -> Result<(Equilibrium, Option<EquilibriumTracker>), RelaxError> {
        let RelaxedLeaf {
            result: leaf,
            on_grids: at,
        } = relax_on_grids(scenario, options, false, &mut |_| {})?;
        let rests = leaf.outcome.is_at_rest() && leaf.stable() == Some(true);
        let follower = EquilibriumTracker::new(Arc::new(scenario.clone()), options, at);
        Ok((leaf, rests.then_some(follower)))
    }

    fn new(
        scenario: Arc<Scenario>,
        options: &Options,
        at: NestedEquilibrium,
    ) -> EquilibriumTracker {
        let usual = (at.levels.first()).map_or(0, |level| level.leaf.segments());
        EquilibriumTracker {
            scenario,
            options: options.clone(),
            at,
            usual_coarsest_segments: usual,
            alternative_segments: Some(usual + usual / 4),
        }
    }

    /// Begins with the stable equilibrium that lies near this shape of the leaf, which `begin` need not
    /// find, as a leaf may have several; where there is none, as that does.
    ///
    /// # Errors
    /// Requests that cannot be met.
    pub fn begin_near(
        scenario: &Scenario,
        options: &Options,
        (stations, rods): (&[f64], &[RodShape]),
    ) -> Result<(Equilibrium, Option<EquilibriumTracker>), RelaxError> {
        let leaf = Leaf::with_scale(Arc::new(scenario.clone()), scenario.scale());
        let alike = rods.len() == leaf.rods()
            && (stations.first(), stations.last()) == (Some(&0.0), Some(&1.0))
            && stations.is_sorted_by(|a, b| a < b)
            && rods.iter().all(|rod| rod.nodes.len() == stations.len());
        if !alike {
            return EquilibriumTracker::begin(scenario, options);
        }
        let grid = Grid::from_stations(stations, leaf.kinks());
        let mut state = state_from_rod_shapes(&leaf, &DiscreteLeaf::new(&leaf, grid.clone()), rods);
        leaf.place_bases(&mut state);
        leaf.place_held_tips(&mut state);
        EquilibriumTracker::begin_from(scenario, options, StateOnGrid { grid, state })
    }

    /// The same from this state on a grid.
    fn begin_from(
        scenario: &Scenario,
        options: &Options,
        guess: StateOnGrid,
    ) -> Result<(Equilibrium, Option<EquilibriumTracker>), RelaxError> {
        check_options_without_potential(scenario, options)?;
        let clock = Instant::now();
        let scenario = Arc::new(scenario.clone());
        let leaf = Leaf::with_scale(Arc::clone(&scenario), scenario.scale());
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let problem = RelaxationProblem::new(&leaf, options, tolerance);
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let mut effort = WorkLog::new(ignored);
        let begun = NestedEquilibrium::without_grids(&problem);
        match nested_grids::solve_from_guesses(&problem, begun, vec![guess], &mut effort) {
            Ok(found) if found.is_stable() => {
                let leaf = equilibrium_with_stability(&problem, Ok(found), clock, &mut effort);
                let follower =
                    EquilibriumTracker::new(Arc::clone(&scenario), options, leaf.on_grids);
                Ok((leaf.result, Some(follower)))
            }
            _ => EquilibriumTracker::begin(&scenario, options),
        }
    }

    /// How it is to come to rest from now on, and which of its modes are wanted. With a fixed grid it follows on the
    /// coarsest of its own grids alone, whatever the segments, without an error estimate: for a picture while a
    /// number is moved. Without one it then goes on to as many grids as the tolerance needs.
    pub fn options(&mut self, options: &Options) {
        self.options = options.clone();
    }

    /// The leaf on the grids of the present equilibrium.
    pub(crate) fn levels(&self) -> &[GridLevel] {
        &self.at.levels
    }

    /// Follows the scenarios that `along` has from 0, the present one, to 1.
    ///
    /// # Errors
    /// The first of `along`, and requests that cannot be met.
    pub fn follow<E: From<RelaxError>>(
        &mut self,
        along: &dyn Fn(f64) -> Result<Scenario, E>,
    ) -> Result<TrackOutcome, E> {
        let clock = Instant::now();
        let end = STEPS.follow(|step| {
            let scenario = match along(step.to) {
                Ok(scenario) => Arc::new(scenario),
                Err(refused) => return StepEnd::Ended(FollowEnd::Refused(refused)),
            };
            if let Err(refused) = check_options_without_potential(&scenario, &self.options) {
                return StepEnd::Ended(FollowEnd::Refused(E::from(refused)));
            }
            match self.step(Arc::clone(&scenario), step.to == 1.0) {
                Ok(found) => {
                    (self.at, self.scenario) = (found, scenario);
                    StepEnd::Made {
                        growth: STEPS.growth,
                    }
                }
                Err(_) if !step.is_shortest => StepEnd::TooLong(FollowEnd::Lost(step.from)),
                Err(_) if self.refine() => StepEnd::Again,
                Err(_) => StepEnd::Ended(FollowEnd::Lost(step.from)),
            }
        });
        match end {
            Ok(()) => {
                self.coarsen();
                self.choose_cheaper_grid();
                Ok(TrackOutcome::Arrived(Box::new(self.equilibrium(clock))))
            }
            Err(FollowEnd::Lost(part)) => Ok(TrackOutcome::BranchEnded { part }),
            Err(FollowEnd::Refused(refused)) => Err(refused),
        }
    }

    /// Goes on without the coarsest grid, and on a finer one if that is the last; false if it is fine
    /// enough.
    fn refine(&mut self) -> bool {
        if let [_, finer, ..] = &self.at.levels[..] {
            let fine = finer.leaf.segments() <= GRIDS.finest_of_tracking;
            if fine {
                let levels = self.at.levels[1..].to_vec();
                self.at = self.at.without_estimates().with_levels(levels);
            }
            return fine;
        }
        let only = &self.at.levels[0].leaf;
        only.segments() < GRIDS.finest_of_tracking
            && self.continue_on_grid(only.leaf.clone(), only.grid.refined())
    }

    /// Whether it is in the same equilibrium on another grid, on which it then goes on.
    fn continue_on_grid(&mut self, leaf: Leaf, grid: Grid) -> bool {
        let Ok(found) = self.equilibrium_on_grid(&leaf, grid) else {
            return false;
        };
        let (Some(own), Some(other)) = (self.at.levels.last(), found.levels.last()) else {
            return false;
        };
        let there = transfer(&own.leaf, &own.state, &other.leaf.grid);
        let same = is_same_beside_fold(&there, &other.state) && found.is_stable();
        if same {
            self.at = found;
        }
        same
    }

    /// Goes back to the usual grids, if the equilibrium exists on these.
    fn coarsen(&mut self) {
        let coarsest = &self.at.levels[0].leaf;
        if coarsest.segments() > self.usual_coarsest_segments {
            let grid = Grid::new(self.usual_coarsest_segments, coarsest.leaf.kinks());
            self.continue_on_grid(coarsest.leaf.clone(), grid);
        }
    }

    /// Goes on from a coarsest grid that is a little finer, if that saves the finest of too many.
    fn choose_cheaper_grid(&mut self) {
        let first = &self.at.levels[0].leaf;
        let too_many = self.at.levels.len() > MAX_ECONOMICAL_GRIDS
            && first.segments() == self.usual_coarsest_segments;
        if let Some(segments) = self.alternative_segments.take_if(|_| too_many) {
            let (leaf, before) = (first.leaf.clone(), self.at.without_estimates());
            let grid = Grid::new(segments, leaf.kinks());
            match self.continue_on_grid(leaf, grid) && self.at.levels.len() <= MAX_ECONOMICAL_GRIDS
            {
                true => self.usual_coarsest_segments = segments,
                false => self.at = before,
            }
        }
    }

    /// Comes to rest under another scenario from where it is, and leaves its branch where it must.
    ///
    /// # Errors
    /// Requests that cannot be met.
    pub fn settle(&mut self, scenario: &Scenario) -> Result<Equilibrium, RelaxError> {
        let leaf = Leaf::with_scale(Arc::new(scenario.clone()), scenario.scale());
        let grid = self.grid(&leaf);
        let state = self.state_on(&leaf, &grid);
        self.relax_from_state(scenario, StateOnGrid { grid, state })
    }

    /// The same from this state on a grid; where that leads nowhere, as a relaxation begins.
    pub(crate) fn relax_from_state(
        &mut self,
        scenario: &Scenario,
        guess: StateOnGrid,
    ) -> Result<Equilibrium, RelaxError> {
        let (result, follower) = EquilibriumTracker::begin_from(scenario, &self.options, guess)?;
        if let Some(follower) = follower {
            // What it is brought to on a finer grid need not stay there.
            let (usual, other) = (
                self.usual_coarsest_segments
                    .min(follower.usual_coarsest_segments),
                self.alternative_segments,
            );
            *self = follower;
            (self.usual_coarsest_segments, self.alternative_segments) = (usual, other);
        }
        Ok(result)
    }

    /// The present equilibrium as a result.
    fn equilibrium(&mut self, clock: Instant) -> Equilibrium {
        let leaf = Leaf::with_scale(Arc::clone(&self.scenario), self.scenario.scale());
        let problem = RelaxationProblem::new(&leaf, &self.options, self.tolerance(&self.scenario));
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let mut effort = WorkLog::new(ignored);
        effort.work = self.at.work;
        let found = std::mem::replace(&mut self.at, NestedEquilibrium::without_grids(&problem));
        let leaf = equilibrium_with_stability(&problem, Ok(found), clock, &mut effort);
        self.at = leaf.on_grids;
        leaf.result
    }

    fn tolerance(&self, scenario: &Scenario) -> f64 {
        self.options.tolerance.unwrap_or(scenario.tolerance)
    }

    /// The equilibrium of a scenario nearby, if it is the continuation of the present one and stable.
    fn step(
        &self,
        scenario: Arc<Scenario>,
        last: bool,
    ) -> Result<NestedEquilibrium, ContinuationFailure> {
        let leaf = Leaf::with_scale(Arc::clone(&scenario), scenario.scale());
        let predicted = match self.options.method.segments() {
            Some(_) => 1,
            None => MAX_PREDICTED_GRIDS.min(self.at.levels.len()),
        };
        let near = self.at.on_coarsest_grids(predicted);
        let near = near.unwrap_or_else(|| self.at.without_estimates());
        let found = match self.has_same_structure(&leaf) {
            true => {
                let terms = [(-1.0, &self.scenario), (1.0, &scenario)];
                let terms = terms.map(|(weight, scenario)| Weighted {
                    weight,
                    term: Scenario::clone(scenario),
                });
                let rate = LeafParameterDerivative::new(&near.levels[0].leaf.leaf, &terms);
                let mut responses = Vec::new();
                for level in &near.levels {
                    let mut linear = Linearized::new(level, self.tolerance(&scenario));
                    let forces = linear.forces(level, std::slice::from_ref(&rate));
                    let response = linear.responses(level, &forces);
                    let response = response.and_then(|all| all.into_iter().next());
                    responses.push(response.ok_or(ContinuationFailure::OtherEquilibrium)?);
                }
                let grids = match last {
                    true => GridPolicy::AsNeeded,
                    false => GridPolicy::These,
                };
                near.continue_to_scenario(scenario, &responses, &self.options, grids)?
            }
            false => self.equilibrium_on_grid(&leaf, self.grid(&leaf))?,
        };
        match last && !found.is_stable() {
            true => Err(ContinuationFailure::OtherEquilibrium),
            false => Ok(found),
        }
    }

    /// The equilibrium of a leaf whose nodes lie elsewhere: from where this one is, on a grid, without
    /// leaving its valley.
    fn equilibrium_on_grid(
        &self,
        leaf: &Leaf,
        grid: Grid,
    ) -> Result<NestedEquilibrium, ContinuationFailure> {
        let problem = RelaxationProblem {
            valley: ValleyPolicy::StayOnBranch,
            ..RelaxationProblem::new(leaf, &self.options, self.tolerance(leaf.scenario()))
        };
        let state = self.state_on(leaf, &grid);
        let guess = StateOnGrid { grid, state };
        let ignored: &mut dyn FnMut(&Progress) = &mut |_| {};
        let mut effort = WorkLog::new(ignored);
        let begun = NestedEquilibrium::without_grids(&problem);
        let found = nested_grids::solve_from_guesses(&problem, begun, vec![guess], &mut effort);
        Ok(found
            .map_err(|_| ContinuationFailure::OtherEquilibrium)?
            .with_work(effort.work))
    }

    /// Whether the scenario of a leaf differs from the present one in numbers alone that leave the
    /// nodes, and what is held and tied, where they are.
    fn has_same_structure(&self, leaf: &Leaf) -> bool {
        let (own, other) = (&*self.scenario, leaf.scenario());
        let held = |of: &Scenario| of.held_tip.as_ref().map(|tip| tip.clamps.is_some());
        let grips = own.grips.iter().zip(&other.grips);
        let points = own.points.iter().zip(&other.points);
        own.rods.len() == other.rods.len()
            && own.joined == other.joined
            && (&own.base_held, own.base_spin) == (&other.base_held, other.base_spin)
            && own.tissue.is_some() == other.tissue.is_some()
            && own.wind.is_none()
            && other.wind.is_none()
            && !own.has_followers()
            && !other.has_followers()
            && held(own) == held(other)
            && own.points.len() == other.points.len()
            && own.grips.len() == other.grips.len()
            && { points }.all(|(a, b)| (a.vein, a.at) == (b.vein, b.at))
            && own.foundation.is_some() == other.foundation.is_some()
            && { grips }.all(|(a, b)| a.holds_same_components(b))
            && self.at.levels[0].leaf.leaf.kinks() == leaf.kinks()
    }

    /// A grid like the coarsest of its own, with nodes where this leaf needs them.
    fn grid(&self, leaf: &Leaf) -> Grid {
        let own = &self.at.levels[0].leaf;
        match own.leaf.kinks() == leaf.kinks() {
            true => own.grid.clone(),
            false => Grid::new(own.segments(), leaf.kinks()),
        }
    }

    /// Its state on a grid of a leaf with as many rods, in the units of that leaf.
    pub(crate) fn state_on(&self, leaf: &Leaf, grid: &Grid) -> State {
        let level = &self.at.levels[0];
        let mut state = rescale_state(level, level.state.clone(), leaf);
        state = transfer(&level.leaf, &state, grid);
        leaf.place_held_tips(&mut state);
        state
    }
}
