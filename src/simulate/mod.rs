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

mod choice;
mod record;
mod refinement;
mod remark;

pub use crate::leaf::HalfTurn;
use crate::leaf::{
    DiscreteLeaf, Grid, Increment, Leaf, State, System, displacement_part, rotation_part,
};
use crate::modes::{Eigenpair, ModeRequest, lowest};
pub use crate::motion::{Energy, Stopped};
use crate::motion::{
    Explicit, MotionTimes, Physics, RigidRodError, SemiImplicit, Snapshot, StableStep, StepControl,
    TimeIntegrator, project_constraints,
};
use crate::newton::{NewtonIteration, SolverCounts};
use crate::relax::{
    Equilibrium, EquilibriumTracker, INDEFINITE_NEWTON_EQUATIONS, RelaxError, Route, StateOnGrid,
    converge_saddle,
};
use crate::run::{Instant, Limit, RefusedOption};
use crate::scenario::{MotionStart, Scenario, Schedule, plausibility_warnings};
pub use crate::simulate::choice::{MotionCost, SchemeChoice, SchemeReason};
pub use crate::simulate::record::{
    Frame, OutputSample, Record, ShapeSnapshot, film_indices, snapshot_indices,
};
use crate::simulate::refinement::{MotionComparison, Trajectory, compared_points};
pub use crate::simulate::refinement::{REFINEMENT_SECONDS, Refinement, RunObserver};
pub use crate::simulate::remark::{Imbalance, MotionDoubt, MotionRemark};
use crate::{relax, words};
use std::f64::consts::PI;
use std::time::Duration;

/// Default number of segments per rod, unless its rest shape needs more.
pub(crate) const DEFAULT_MOTION_SEGMENTS: usize = 16;

/// The error of tips that a [`Refinement`] aims at unless a tolerance is given, relative to the
/// longest rod.
pub const DEFAULT_TIP_ERROR: f64 = 1e-3;

words! {
    /// The method of time integration.
    pub enum Scheme {
        /// [`Explicit`]: short, very cheap steps. Not for rigid rods.
        Explicit = "explicit",
        /// [`SemiImplicit`]: steps as long as accuracy allows, for any stiffness.
        SemiImplicit = "semi-implicit",
    }
}

/// Options of a simulation.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The method; `None`: the one that costs less, as [`SchemeChoice`] says.
    pub scheme: Option<Scheme>,
    /// Segments per rod; `None`: 16, or as many as the rest shape needs.
    pub segments: Option<usize>,
    /// The longest time step, in the scenario's unit of time. `None`: for the
    /// explicit method, nine tenths of the stable one; for the semi-implicit
    /// one, such that the error of a step stays below the scenario's tolerance.
    pub step: Option<f64>,
    /// Replaces the scenario's tolerance: for the semi-implicit method, the
    /// local error of a step relative to the longest rod. Of a [`Refinement`] also the error of
    /// tips that it aims at, in place of [`DEFAULT_TIP_ERROR`].
    pub tolerance: Option<f64>,
    /// When the motion ends early, as [`Stopped::Interrupted`].
    pub limit: Limit,
}

/// The simulation of a leaf in time.
pub struct Simulation {
    leaf: Leaf,
    grid: Grid,
    physics: Physics,
    choice: SchemeChoice,
    doubts: Vec<MotionDoubt>,
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

impl Simulation {
    /// The leaf at time 0.
    pub fn new(scenario: &Scenario, options: &Options) -> Result<Self, SimulationError> {
        let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
        let from =
            |leaf: &Leaf, grid: &Grid| start_state(leaf, grid, tolerance, options.limit.clone());
        Simulation::with_initial_state(scenario, options, &from)
    }

    /// The motion from where a leaf is that followed another scenario, without velocity: what it is
    /// released from, or where its stable equilibria end.
    pub fn from_tracker(
        follower: &EquilibriumTracker,
        scenario: &Scenario,
        options: &Options,
    ) -> Result<Self, SimulationError> {
        let from = |leaf: &Leaf, grid: &Grid| Ok(follower.state_on(leaf, grid));
        Simulation::with_initial_state(scenario, options, &from)
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
        let rigid = discrete.least_compliance() == 0.0;
        let mut begun = None;
        let choice = match SchemeChoice::forced_choice(options, &physics, rigid) {
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
        if choice.scheme == Scheme::SemiImplicit && !physics.clamped() {
            return Err(SimulationError::Held { rigid });
        }
        if choice.scheme == Scheme::SemiImplicit
            && let Some(at) = physics.unresolved_pulse_time()
        {
            return Err(SimulationError::Pulse { at, rigid });
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
        let simulation = Simulation {
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
        let steps = match (self.step, self.choice.costs) {
            (Some(step), _) => left / step,
            (None, Some([_, estimated])) => {
                estimated.steps * left / (duration * self.physics.time_unit)
            }
            (None, None) => return None,
        };
        Some((steps, steps * self.seconds_of_a_step()))
    }

    fn seconds_of_a_step(&self) -> f64 {
        let (rods, segments) = (self.leaf.rods(), self.grid.segments());
        match self.choice.scheme {
            Scheme::Explicit => choice::explicit_step(rods, segments),
            Scheme::SemiImplicit => choice::semi_implicit_step(rods, segments),
        }
    }

    /// Seconds that the steps so far take on one core of a machine of 2020: no clock decides how
    /// far a motion is refined.
    fn seconds_so_far(&self) -> f64 {
        self.steps() as f64 * self.seconds_of_a_step()
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
                let longest = self.method.take_longest_step();
                trajectory.longest_steps.push(longest);
            }
        }
    }

    /// Bounds the steps to half of those of a coarser run.
    fn halve_coarser_steps(&mut self, coarser: &Trajectory) {
        let halves = coarser.longest_steps.iter().map(|longest| 0.5 * longest);
        self.longest_steps = halves.collect();
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
    let method = Explicit::new(leaf.clone(), physics.clone(), state, own)
        .map_err(|RigidRodError| SimulationError::Rigid)?;
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

/// Largest force in a segment of the arcs that a leaf is released from, in units of A/L^2 of its
/// rod. A rod under a larger one buckles in waves shorter than an eighth of its length, which few
/// segments do not resolve.
const LARGEST_FORCE: f64 = 256.0 * PI * PI;

/// The positions and rotations at time 0.
pub(super) fn start_state(
    leaf: &Leaf,
    grid: &Grid,
    tolerance: f64,
    limit: Limit,
) -> Result<State, SimulationError> {
    match leaf.scenario().dynamics.start {
        MotionStart::Released if !leaf.has_placed_supports() => {
            Ok(released_state(&DiscreteLeaf::new(leaf, grid.clone())))
        }
        // Held tips and grips are moved to their positions by the relaxation.
        MotionStart::Released | MotionStart::ConfirmedEquilibrium => {
            state_at_rest(leaf, grid, tolerance, limit)
        }
    }
}

/// The initial state of a relaxation or, where its arcs would strain rods that hardly yield, a
/// state near it without such strains: otherwise the energy of these would drive the motion.
fn released_state(leaf: &DiscreteLeaf) -> State {
    let mut arcs = relax::initial_state(leaf);
    leaf.strain_forces(&mut arcs);
    let strained = leaf.rod_index_pairs(0..leaf.segments()).any(|(j, i)| {
        let softest = leaf.section(j, i).couple_stiffness.min_element();
        let unit = softest / leaf.leaf.length(j).powi(2);
        arcs.n[j * leaf.segments() + i].length() > LARGEST_FORCE * unit
    });
    let unstrained = strained.then(|| project_constraints(leaf, &arcs)).flatten();
    unstrained.unwrap_or(arcs)
}

/// The equilibrium under the loads, in the wind and with the rest shape at time 0.
fn state_at_rest(
    leaf: &Leaf,
    grid: &Grid,
    tolerance: f64,
    limit: Limit,
) -> Result<State, SimulationError> {
    let scenario = scenario_at_start(leaf.scenario());
    let options = relax::Options {
        method: relax::SemiImplicit::on_grid(Some(grid.segments())).into(),
        tolerance: Some(tolerance),
        limit,
        route: match scenario.wind {
            Some(_) => Route::Release,
            None => Route::default(),
        },
        ..relax::Options::default()
    };
    let found = relax::relax(&scenario, &options, &mut |_| {})?;
    if !found.outcome.is_success() {
        return Err(SimulationError::NoRest {
            outcome: found.outcome.word(),
        });
    }
    let nodes = || found.shape.rods.iter().flat_map(|rod| &rod.nodes);
    let x = nodes().map(|node| node.position / leaf.scale.length);
    let q = nodes().map(|node| node.rotation);
    Ok(State::new(grid.segments(), x.collect(), q.collect()))
}

/// The scenario with the loads, the wind and the rest shape at time 0.
fn scenario_at_start(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    let dynamics = &scenario.dynamics;
    scenario.gravity = dynamics.gravity.at(0.0);
    scenario.tip_force = dynamics.tip_force.at(0.0);
    scenario.tip_moment = dynamics.tip_moment.at(0.0);
    let factor = dynamics.rest.at(0.0);
    let air = scenario.wind.as_ref().map(|wind| wind.velocity.at(0.0));
    match (&mut scenario.wind, air) {
        (Some(wind), Some(air)) if air != [0.0; 3] => wind.velocity = Schedule::constant(air),
        (wind, _) => *wind = None,
    }
    let rods = scenario.rods.iter_mut();
    for curvature in rods.flat_map(|rod| &mut rod.rest_curvature) {
        *curvature = curvature.scaled(factor);
    }
    scenario
}

/// Longest expected duration of a simulation that is accepted, in seconds.
pub const MAX_SIMULATION_SECONDS: f64 = 3.0 * DAY;

const DAY: f64 = 86_400.0;

/// Why a request cannot be simulated. Times are in the scenario's unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// The explicit method has no stable time step.
    #[error(
        "the explicit method has no stable time step for rigid rods (a stiffness is inf): \
         use the semi-implicit method, or give a number"
    )]
    Rigid,
    /// The base is free, and the semi-implicit method clamps it.
    #[error(
        "dynamics.clamped = false: the semi-implicit method holds the base: use the explicit method{}",
        if *.rigid { ", and a number for every stiffness that is inf" } else { "" }
    )]
    Held {
        /// Whether a rod is rigid, which the explicit method cannot move.
        rigid: bool,
    },
    /// A load has a pulse that the semi-implicit method does not resolve.
    #[error(
        "a load in time has a pulse at {at} that is shorter than a millionth of the unit of time \
         sqrt(rho L^4/A): make it longer with the same impulse{}",
        if *.rigid { "" } else { ", or use the explicit method" }
    )]
    Pulse {
        /// Its time.
        at: f64,
        /// Whether a rod is rigid, which the explicit method cannot move.
        rigid: bool,
    },
    /// An option has a value that it cannot have, such as a time step that is too long for the
    /// explicit method.
    #[error("{0}")]
    Option(#[from] RefusedOption),
    /// The time step is too short for the duration.
    #[error(
        "the time step of {step:.3e} makes {steps:.1e} steps, which take some {} days, and at most {} are allowed: \
         use {}",
        (.seconds / DAY).ceil(), MAX_SIMULATION_SECONDS / DAY,
        match .given {
            true => "a longer step, or leave it out",
            false => "the semi-implicit method, softer rods, fewer segments, or a shorter duration",
        }
    )]
    TooLong {
        /// The step.
        step: f64,
        /// Steps to the end.
        steps: f64,
        /// Estimated duration.
        seconds: f64,
        /// Whether the step was given.
        given: bool,
    },
    /// The grid is invalid.
    #[error(transparent)]
    Request(#[from] relax::RelaxError),
    /// The leaf should start at rest, and its relaxation fails.
    #[error(
        "dynamics.start = \"at-rest\": the leaf does not come to rest under its loads at time 0 ({outcome}): use start = \"released\""
    )]
    NoRest {
        /// The outcome of its relaxation.
        outcome: &'static str,
    },
}

/// When a start counts as an unstable equilibrium.
struct UnstableStartTest {
    /// Largest distance of a start from the equilibrium that it is compared with, in lengths.
    largest_distance: f64,
    /// Largest deviation from that equilibrium along an unstable mode, radians or lengths, that is
    /// none: it would have to grow by e fourteen times.
    negligible_deviation: f64,
    /// Accuracy of these modes.
    mode_accuracy: f64,
}

const UNSTABLE_START: UnstableStartTest = UnstableStartTest {
    largest_distance: 0.1,
    negligible_deviation: 1e-6,
    mode_accuracy: 1e-9,
};

/// The doubt about a start at an unstable equilibrium, or beside one but without a deviation along
/// its unstable modes, such as that of a straight column under its weight.
pub(super) fn unstable_start_doubt(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    start: &State,
) -> Option<MotionDoubt> {
    let mut leaf = leaf.clone();
    leaf.loads = physics.loads(0.0);
    if leaf.leaf.in_wind() || leaf.loads.has_moments() || !physics.clamped() {
        // Its rest is no minimum of an energy, or it has none.
        return None;
    }
    leaf.scale_rest_curvatures(physics.rest_curvature_factor(0.0));
    let (mut system, mut work) = (System::new(&leaf), SolverCounts::default());
    if !may_be_near(&leaf, start, &mut system) {
        return None;
    }
    let mut exact = start.clone();
    let index =
        converge_saddle(&leaf, &mut exact, &mut system, &mut work).filter(|&index| index > 0)?;
    let wanted = ModeRequest {
        count: index,
        modes_below: None,
        accuracy: UNSTABLE_START.mode_accuracy,
        approximate_modes: &[],
        time: &Limit::default(),
    };
    let mut modes = lowest(&leaf, physics, &exact, wanted)?;
    modes.retain(|mode| mode.eigenvalue < 0.0);
    let fastest = -modes.first()?.eigenvalue;
    let deviates = |mode: &Eigenpair| {
        mode_deviation(&leaf, physics, (&exact, start), &mode.shape)
            > UNSTABLE_START.negligible_deviation
    };
    if modes.iter().any(deviates) {
        return None;
    }
    Some(MotionDoubt::UnstableStart {
        index,
        growth_time: physics.time_unit / fastest.sqrt(),
    })
}

/// Whether the first step of Newton's method is short enough for an equilibrium nearby.
fn may_be_near(leaf: &DiscreteLeaf, start: &State, system: &mut System) -> bool {
    let mut next = start.clone();
    let first = NewtonIteration {
        accuracy: 0.0,
        iterations: 1,
        work: &mut SolverCounts::default(),
        progress: &mut |_, _| {},
    };
    // It is not converged after one step.
    let _ = first.solve(leaf, &mut next, system, INDEFINITE_NEWTON_EQUATIONS);
    start.largest_displacement_to(&next) < UNSTABLE_START.largest_distance
}

/// The largest rotation or displacement in the part along a mode of what leads from one state to
/// another. Modes are orthonormal in the mass product.
fn mode_deviation(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    (from, to): (&State, &State),
    mode: &[Increment],
) -> f64 {
    let (mut field, mut along, mut largest) = (Vec::new(), 0.0, 0.0_f64);
    from.increments_to(to, leaf.first_node(), &mut field);
    for (j, i) in leaf.rod_index_pairs(leaf.moving_nodes()) {
        let (k, inertia) = (from.base(j) + i, physics.inertia(leaf, j, i));
        let (off, mode, tensor) = (
            &field[j][i - leaf.first_node()],
            &mode[k],
            inertia.tensor(from.q[k]),
        );
        along += rotation_part(mode).dot(tensor * rotation_part(off))
            + inertia.mass * displacement_part(mode).dot(displacement_part(off));
        largest = largest
            .max(rotation_part(mode).length())
            .max(displacement_part(mode).length());
    }
    along.abs() * largest
}

crate::renamed! {
    Choice => SchemeChoice,
    Cost => MotionCost,
    Moment => OutputSample,
    Refused => SimulationError,
    Still => ShapeSnapshot,
}
