//! A leaf followed in time: start, method, and outputs.
//!
//! ```
//! use leafdyn::scenario::Scenario;
//! use leafdyn::simulate::{Options, Simulation};
//!
//! let cantilever = r#"
//!     name = "cantilever"
//!     leaf = { rods = 1, length = 1.0, fan = [0.0] }
//!     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
//!     load = { gravity = [0.0, 0.0, -1.0] }
//! "#;
//! let scenario = Scenario::from_toml(cantilever)?;
//! let mut simulation = Simulation::new(&scenario, &Options::default())?;
//! while !simulation.done() {
//!     let frame = simulation.next_frame()?;
//!     println!("{} {}", frame.time, frame.tips(true)[0]);
//! }
//! # assert!((simulation.frame().time - 10.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cheaper;
mod choice;
mod comparison;
mod record;
mod refinement;
mod remark;
pub(crate) mod request;
pub(crate) mod start;

pub use crate::leaf::HalfTurn;
use crate::leaf::{DiscreteLeaf, Grid, Leaf, State};
pub use crate::motion::{Energy, ExplicitRefusal, Stopped};
use crate::motion::{
    Explicit, Impact, MotionTimes, Physics, SemiImplicit, Snapshot, StableStep, StepControl,
    TimeIntegrator,
};
use crate::relax;
use crate::relax::{Equilibrium, EquilibriumTracker, RelaxError, StateOnGrid};
use crate::run::{Instant, RefusedOption};
use crate::scenario::{MotionStart, Scenario, assumed_rotary_inertia, plausibility_warnings};
pub use crate::simulate::cheaper::{CheaperChange, CheaperMotion};
pub use crate::simulate::choice::{MotionCost, SchemeChoice, SchemeReason};
pub(crate) use crate::simulate::comparison::compared_points;
pub use crate::simulate::comparison::{Frame, OutputSample, ShapeSnapshot};
use crate::simulate::comparison::{MotionComparison, OutputSteps, Trajectory};
pub use crate::simulate::record::{LandingRecord, Record, film_indices, snapshot_indices};
pub use crate::simulate::refinement::{REFINEMENT_SECONDS, Refinement, RunObserver};
pub use crate::simulate::remark::{Imbalance, MotionDoubt, MotionRemark, cheaper_text};
pub(crate) use crate::simulate::request::DEFAULT_MOTION_SEGMENTS;
pub use crate::simulate::request::{
    DEFAULT_TIP_ERROR, MAX_SIMULATION_SECONDS, Options, Scheme, SimulationError,
};
use crate::simulate::start::{motion_start, start_state, unstable_start_doubt};
use std::time::Duration;

/// The simulation of a leaf in time.
pub struct Simulation {
    leaf: Leaf,
    grid: Grid,
    physics: Physics,
    choice: SchemeChoice,
    doubts: Vec<MotionDoubt>,
    /// What the motion starts from; `None`: a shape that was given.
    start: Option<MotionStart>,
    /// Speed of the fastest tip at the last output.
    tip_speed: f64,
    /// Estimated steps of the semi-implicit method where no other moves the leaf.
    forecast: Option<f64>,
    stable: Option<StableStep>,
    step: Option<f64>,
    method: Box<dyn TimeIntegrator + Send>,
    tolerance: f64,
    outputs: usize,
    made: usize,
    moving: Duration,
    /// The run that this one is compared with, and the bar that is aimed at.
    comparison: Option<MotionComparison>,
    aim: Option<f64>,
    /// The last output whose error is known.
    known_until: Option<f64>,
    /// Bounds on the steps before every output but the first; none if empty.
    longest_steps: Vec<f64>,
    /// What a finer run is compared with, if one may follow.
    trajectory: Option<Trajectory>,
}

/// The finest grid that is tried for a leaf which starts at rest, in segments a vein. On twice as many a motion takes
/// eight times as long.
const FINEST_START_SEGMENTS: usize = 256;

/// Local errors of all steps between two outputs, together, that are rounding (lengths, radians): as of a leaf that stays at
/// rest.
const NEGLIGIBLE_LOCAL_ERROR: f64 = 1e-11;

impl Simulation {
    /// The leaf at time 0. Where it starts at rest and does not come to rest on the usual grid, it moves on the coarsest
    /// one on which it does.
    pub fn new(scenario: &Scenario, options: &Options) -> Result<Self, SimulationError> {
        let local_error = options.tolerance.unwrap_or(scenario.tolerance);
        Simulation::with_local_error(scenario, options, local_error, false)
    }

    /// As [`Simulation::new`], with this local error of semi-implicit steps; the start is as accurate as there. With
    /// `forecast` the steps are estimated, too, where one method alone moves the leaf: a fraction of a second.
    fn with_local_error(
        scenario: &Scenario,
        options: &Options,
        local_error: f64,
        forecast: bool,
    ) -> Result<Self, SimulationError> {
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let from =
            |leaf: &Leaf, grid: &Grid| start_state(leaf, grid, tolerance, options.limit.clone());
        let mut on_grid = Options {
            tolerance: Some(local_error),
            ..options.clone()
        };
        loop {
            match Simulation::with_initial_state(scenario, &on_grid, &from, forecast) {
                Err(SimulationError::NoRest { segments, .. })
                    if options.segments.is_none() && 2 * segments <= FINEST_START_SEGMENTS =>
                {
                    on_grid.segments = Some(2 * segments);
                }
                begun => return begun,
            }
        }
    }

    /// The motion from where a leaf is that followed another scenario, without velocity: what it is
    /// released from, or where its stable equilibria end.
    pub fn from_tracker(
        follower: &EquilibriumTracker,
        scenario: &Scenario,
        options: &Options,
    ) -> Result<Self, SimulationError> {
        let from = |leaf: &Leaf, grid: &Grid| Ok(follower.state_on(leaf, grid));
        let begun = Simulation::with_initial_state(scenario, options, &from, false)?;
        Ok(Simulation {
            start: None,
            ..begun
        })
    }

    /// Brings the leaf from where it is now to rest under this scenario, with which the
    /// `follower` goes on.
    ///
    /// # Errors
    /// Requests that cannot be met.
    pub fn relax_into_tracker(
        &mut self,
        follower: &mut EquilibriumTracker,
        scenario: &Scenario,
    ) -> Result<Equilibrium, RelaxError> {
        let now = self.method.snapshot();
        let guess = StateOnGrid {
            grid: self.grid.clone(),
            state: now.state,
        };
        follower.relax_from_state(scenario, guess)
    }

    fn with_initial_state(
        scenario: &Scenario,
        options: &Options,
        state: &dyn Fn(&Leaf, &Grid) -> Result<State, SimulationError>,
        forecast: bool,
    ) -> Result<Self, SimulationError> {
        if let Some(found) = options.step
            && !(found.is_finite() && found > 0.0)
        {
            let step = RefusedOption::new("step", found, "must be greater than 0");
            return Err(step.into());
        }
        let leaf = Leaf::new(scenario);
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        relax::check_tolerance(tolerance)?;
        let segments = relax::check_segments(&leaf, options.segments, DEFAULT_MOTION_SEGMENTS)?;
        let grid = Grid::new(segments, leaf.kinks());
        let physics = Physics::new(&leaf);
        let state = state(&leaf, &grid)?;
        let discrete = DiscreteLeaf::new(&leaf, grid.clone());
        let doubt = unstable_start_doubt(&discrete, &physics, &state);
        let obstacle = ExplicitRefusal::of_leaf(&discrete, &physics);
        let mut begun = None;
        let choice = match SchemeChoice::forced_choice(options, &physics, obstacle) {
            Some(choice) => choice,
            None => {
                let explicit = &begun
                    .insert(explicit_motion(&discrete, &physics, &state, None)?)
                    .method;
                let cost = choice::explicit_cost(&discrete, &physics, explicit);
                let other = choice::semi_implicit_cost(
                    &discrete,
                    &physics,
                    &state,
                    tolerance,
                    cost.seconds,
                );
                SchemeChoice::cheaper_method(cost, other)
            }
        };
        let only_method = matches!(
            choice.reason,
            SchemeReason::RigidRods | SchemeReason::MassesOffAxis
        );
        let unknown = only_method && options.step.is_none() && physics.clamped();
        let forecast = (forecast && unknown).then(|| {
            let most = f64::INFINITY;
            choice::semi_implicit_cost(&discrete, &physics, &state, tolerance, most).steps
        });
        if choice.scheme == Scheme::SemiImplicit && !physics.clamped() {
            return Err(SimulationError::Held { obstacle });
        }
        if choice.scheme == Scheme::SemiImplicit
            && let Some(at) = physics.unresolved_pulse_time()
        {
            return Err(SimulationError::Pulse { at, obstacle });
        }
        let mut step = options.step;
        let mut stable = None;
        let mut method: Box<dyn TimeIntegrator + Send> = match choice.scheme {
            Scheme::Explicit => {
                let ExplicitMotion {
                    method,
                    stable: bound,
                } = match begun {
                    Some(begun) => begun,
                    None => explicit_motion(&discrete, &physics, &state, step)?,
                };
                step = Some(method.longest_step() * physics.time_unit);
                stable = Some(bound);
                Box::new(method)
            }
            Scheme::SemiImplicit => {
                let step = step.map(|step| step / physics.time_unit);
                let steps = step.map_or(StepControl::LocalError(tolerance), StepControl::Fixed);
                let physics = physics.clone();
                Box::new(SemiImplicit::new(discrete, physics, &state, steps))
            }
        };
        method.set_limit(options.limit.clone());
        let MotionTimes { duration, interval } = physics.times();
        let warnings = plausibility_warnings(scenario).into_iter();
        let warnings = warnings.chain(assumed_rotary_inertia(scenario));
        let simulation = Simulation {
            start: Some(motion_start(&leaf)),
            tip_speed: 0.0,
            forecast,
            leaf,
            choice,
            doubts: doubt
                .into_iter()
                .chain(warnings.map(MotionDoubt::Implausible))
                .collect(),
            stable,
            step,
            method,
            // A duration that is a multiple of the interval up to rounding
            // has no short interval at its end.
            outputs: (duration / interval * (1.0 - 1e-12)).ceil().max(1.0) as usize,
            made: 0,
            moving: Duration::ZERO,
            comparison: None,
            aim: None,
            known_until: None,
            longest_steps: Vec::new(),
            trajectory: None,
            tolerance,
            grid,
            physics,
        };
        match (simulation.step, simulation.expected()) {
            (Some(step), Some((steps, seconds))) if seconds > MAX_SIMULATION_SECONDS => {
                Err(SimulationError::TooLong {
                    step,
                    steps,
                    seconds,
                    given: options.step.is_some(),
                })
            }
            _ => Ok(simulation),
        }
    }

    /// Steps from here to the end, and the approximate number of seconds they take on one core
    /// of a machine of 2020; `None` if the error determines the steps and they were not estimated.
    pub fn expected(&self) -> Option<(f64, f64)> {
        let duration = self.physics.times().duration;
        let left = (duration * self.physics.time_unit - self.time()).max(0.0);
        let estimated = self.choice.costs.map(|[_, estimated]| estimated.steps);
        let steps = match self.step {
            Some(step) => left / step,
            None => estimated.or(self.forecast)? * left / (duration * self.physics.time_unit),
        };
        Some((steps, steps * self.seconds_of_a_step()))
    }

    /// Approximate seconds of a step, with what the tissue adds.
    fn seconds_of_a_step(&self) -> f64 {
        self.seconds_without_tissue() + self.seconds_of_tissue()
    }

    fn seconds_without_tissue(&self) -> f64 {
        let (rods, segments) = (self.leaf.rods(), self.grid.segments());
        match self.choice.scheme {
            Scheme::Explicit => choice::explicit_step(rods, segments),
            Scheme::SemiImplicit => choice::semi_implicit_step(rods, segments),
        }
    }

    fn seconds_of_tissue(&self) -> f64 {
        choice::step_of_tissue(&self.leaf, self.grid.segments(), self.choice.scheme)
    }

    /// Seconds that the steps so far take on one core of a machine of 2020, without what tissue
    /// adds: they decide how far a motion is refined, in which no clock has a part.
    fn seconds_so_far(&self) -> f64 {
        self.steps() as f64 * self.seconds_without_tissue()
    }

    /// Compares this run, which has not begun, with another from now on; `keep`s what a finer
    /// run is compared with.
    fn compare_with(&mut self, comparison: Option<MotionComparison>, keep: bool) {
        self.comparison = comparison;
        self.trajectory = keep.then(Trajectory::default);
        let mut frame = self.frame();
        self.compare_frame(&mut frame);
    }

    /// Compares the output just made, and keeps its points.
    fn compare_frame(&mut self, frame: &mut Frame) {
        if self.comparison.is_none() && self.trajectory.is_none() {
            return;
        }
        let points = compared_points(frame, self.grid.sigma(), self.leaf.joined());
        if let Some(comparison) = &mut self.comparison {
            comparison.compare_output(self.made, &points);
            frame.error = comparison.error_bar;
            self.known_until = comparison
                .error_bar
                .map(|_| frame.time)
                .or(self.known_until);
        }
        if let Some(trajectory) = &mut self.trajectory {
            trajectory.add(&points);
            if self.made > 0 {
                trajectory.steps.push(OutputSteps {
                    longest: self.method.take_longest_step(),
                    local_errors: self.method.take_local_errors(),
                });
            }
        }
    }

    /// Bounds the steps to half of those of a coarser run, but for those before outputs up to which the error of steps is
    /// `known`; where the coarser run's have no errors, to the same, as shorter ones would tell nothing.
    fn bound_steps_by_coarser(&mut self, coarser: &Trajectory, known: Option<&[bool]>) {
        let bound = |(output, steps): (usize, &OutputSteps)| {
            let known = known.and_then(|known| known.get(output)).copied();
            match steps.local_errors <= NEGLIGIBLE_LOCAL_ERROR {
                _ if known == Some(true) => f64::INFINITY,
                true => steps.longest,
                false => 0.5 * steps.longest,
            }
        };
        self.longest_steps = coarser.steps.iter().enumerate().map(bound).collect();
    }

    /// Sets the permitted local error of a step, before the first.
    fn set_local_error(&mut self, error: f64) {
        self.tolerance = error;
        self.method.set_local_error(error);
    }

    /// Bounds the steps to half of the time between outputs.
    fn halve_outputs(&mut self) {
        let interval = self.physics.times().interval;
        self.longest_steps = vec![0.5 * interval; self.outputs];
    }

    /// A bound on the error of the tips and of the middles of all rods so far, in units of
    /// length; `None` where no other run tells it, as from where two have parted.
    pub fn error_bar(&self) -> Option<f64> {
        self.comparison.as_ref()?.error_bar
    }

    /// The time of the last output whose error is known.
    pub fn known_until(&self) -> Option<f64> {
        self.known_until
    }

    /// The error of tips that is aimed at, in units of length, if one is.
    pub fn aim(&self) -> Option<f64> {
        self.aim
    }

    /// Segments of the run that this one is compared with.
    pub fn compared_segments(&self) -> Option<usize> {
        Some(self.comparison.as_ref()?.segments)
    }

    /// The moving leaf.
    pub fn leaf(&self) -> &Leaf {
        &self.leaf
    }

    /// The method of time integration.
    pub fn scheme(&self) -> Scheme {
        self.choice.scheme
    }

    /// Why it is this method.
    pub fn choice(&self) -> SchemeChoice {
        self.choice
    }

    /// What makes the motion doubtful.
    pub fn doubts(&self) -> &[MotionDoubt] {
        &self.doubts
    }

    /// Segments a rod.
    pub fn segments(&self) -> usize {
        self.grid.segments()
    }

    /// Fractions of the length at which frames have nodes.
    pub fn stations(&self) -> &[f64] {
        self.grid.sigma()
    }

    /// What the motion starts from; `None` if that is a shape that was given.
    pub fn start(&self) -> Option<MotionStart> {
        self.start
    }

    /// Speed of the fastest tip at the last output.
    pub fn tip_speed(&self) -> f64 {
        self.tip_speed
    }

    /// The longest time step, in the scenario's unit; `None` if the error
    /// determines the steps.
    pub fn longest_step(&self) -> Option<f64> {
        self.step
    }

    /// The longest stable time step of the explicit method, in the scenario's
    /// unit, and what limits it.
    pub fn stable_step(&self) -> Option<StableStep> {
        self.stable
    }

    /// The permitted local error of a step of the semi-implicit method, relative
    /// to the longest rod.
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Wall-clock time of the motion since this was created.
    pub fn wall_time(&self) -> Duration {
        self.moving
    }

    /// Number of time steps.
    pub fn steps(&self) -> usize {
        self.method.steps()
    }

    /// Number of frames of the whole motion, and of those so far, both without the first.
    pub fn frames(&self) -> (usize, usize) {
        (self.outputs, self.made)
    }

    /// The masses that have landed so far.
    pub fn landings(&self) -> Vec<LandingRecord> {
        let scenario = self.leaf.scenario();
        let record = |impact: &Impact| LandingRecord {
            point: impact.point + 1,
            vein: scenario.points[impact.point].vein + 1,
            at: scenario.points[impact.point].at,
            time: impact.time * self.physics.time_unit,
            kinetic_energy: impact.kinetic_energy * self.leaf.scale.moment(),
            lost_energy: impact.lost_energy * self.leaf.scale.moment(),
        };
        self.method.impacts().iter().map(record).collect()
    }

    /// The time now, in the scenario's unit.
    pub fn time(&self) -> f64 {
        self.method.time() * self.physics.time_unit
    }

    /// Whether the duration is over.
    pub fn done(&self) -> bool {
        self.made == self.outputs
    }

    /// The leaf now.
    pub fn frame(&mut self) -> Frame {
        let now = self.method.snapshot();
        self.frame_of(&now)
    }

    fn frame_of(&self, now: &Snapshot) -> Frame {
        let mut frame = Frame::new(&self.leaf, &self.physics, now, self.method.steps());
        frame.error = self.error_bar();
        frame
    }

    /// Advances to the time of the next output.
    ///
    /// # Errors
    /// If the motion is not reliable any more; [`Simulation::frame`] then
    /// returns its present state.
    pub fn next_frame(&mut self) -> Result<Frame, Stopped> {
        let (clock, unit) = (Instant::now(), self.physics.time_unit);
        if let Some(&longest) = self.longest_steps.get(self.made) {
            self.method.limit_steps(longest);
        }
        let advanced = self.method.advance(self.output_time(self.made + 1));
        let frame = advanced
            .map_err(|stopped| stopped.in_unit(unit))
            .map(|now| {
                self.made += 1;
                self.frame_of(&now)
            });
        self.moving += clock.elapsed();
        frame.map(|mut frame| {
            self.tip_speed = frame.tip_speed();
            self.compare_frame(&mut frame);
            frame
        })
    }

    /// The time of an output, in the method's unit.
    fn output_time(&self, number: usize) -> f64 {
        let MotionTimes { duration, interval } = self.physics.times();
        match number >= self.outputs {
            true => duration,
            false => interval * number as f64,
        }
    }
}

/// The explicit method, and its stable step in the scenario's unit of time.
struct ExplicitMotion {
    method: Explicit,
    stable: StableStep,
}

/// The explicit method with a `step` that must not exceed the stable one.
fn explicit_motion(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    step: Option<f64>,
) -> Result<ExplicitMotion, SimulationError> {
    let own = step.map(|step| step / physics.time_unit);
    let method =
        Explicit::new(leaf.clone(), physics.clone(), state, own).map_err(
            |obstacle| match obstacle {
                ExplicitRefusal::RigidRod => SimulationError::Rigid {
                    keys: leaf.leaf.scenario().rigid_keys_text(),
                },
                ExplicitRefusal::MassOffAxis => SimulationError::MassOffAxis,
            },
        )?;
    let bound = method.stable_step();
    let stable = bound.step * physics.time_unit;
    match step {
        Some(found) if found > stable => {
            let why = format!(
                "the explicit method is stable up to {stable:.3e}, because of {}: use a shorter \
                 step, or the semi-implicit method, or leave the step out",
                bound.limit
            );
            Err(RefusedOption::new("step", found, why).into())
        }
        _ => {
            let step = stable;
            Ok(ExplicitMotion {
                method,
                stable: StableStep { step, ..bound },
            })
        }
    }
}

crate::renamed! {
    Choice => SchemeChoice,
    Cost => MotionCost,
    Moment => OutputSample,
    Refused => SimulationError,
    Still => ShapeSnapshot,
}
