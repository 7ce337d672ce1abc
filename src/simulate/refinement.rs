//! A motion followed on finer and finer grids in shorter and shorter steps, each run compared with
//! the one before, until its tips are as accurate as requested. Compared are the tips and the middles
//! of the veins, at every output.
//!
//! Both methods are of second order in space and time. With the length h of segments, and steps in
//! proportion to it, the error of a run is C h^2, and the difference of two runs tells C
//! (Richardson). Differences grow in time, mostly as phases do; but they vanish at the turning
//! points of a vibration, so that the bar at an output is the largest so far. A component whose
//! phase the coarser run has lost altogether is wrong in it by up to twice its amplitude, and no
//! more in the finer run: `COMPARISON.safety` lets the bar be the difference itself.
//!
//! Where the grid and not the steps makes the error, as of most leaves with tissue, steps half as long on every finer
//! grid would be wasted. The first run by the semi-implicit method that is not accurate enough is therefore made once more
//! in longer steps: how far both are apart is the error of those, and with the order of the method that of any others. Steps of
//! finer runs are then as long as an error allows that is a small part of the bar, to which it is added.

use crate::leaf::{Grid, Leaf};
use crate::motion::Stopped;
use crate::numbers::larger;
use crate::scenario::Scenario;
use crate::simulate::cheaper::{COSTLY_SECONDS, CheaperMotion, cheaper_motions};
use crate::simulate::comparison::{COMPARISON, MotionComparison, RunTrajectory, Trajectory};
use crate::simulate::remark::MotionDoubt;
use crate::simulate::request::{DEFAULT_TIP_ERROR, Options, Scheme, SimulationError};
use crate::simulate::{SchemeChoice, Simulation, start};
use crate::{relax, scenario};

/// Seconds, on one core of a machine of 2020, that all runs of a motion may take together. The
/// first run, and that which it is compared with, take what they need.
pub const REFINEMENT_SECONDS: f64 = 10.0;

/// How runs of a refinement follow each other.
struct RefinementSteps {
    /// The coarsest grid that a motion is compared with; below, a finer one is.
    coarsest_segments: usize,
    /// The ratio of the local errors of steps of which one is half as long: they are of third
    /// order.
    local_error_ratio: f64,
    /// Bounds on the local error of a step.
    local_error: (f64, f64),
    /// The time of a run over that on a grid of half as many segments, in steps twice as long.
    cost_ratio: f64,
    /// The ratio of the local errors of the steps of a run and of longer ones, which tell what the steps do to the error.
    longer_steps: f64,
    /// The part of the expected bar that the steps may add to it.
    step_part: f64,
    /// Where the longer steps are longer by at least this factor, they tell that.
    told_step: f64,
    /// Explicit steps that are longer by no more than this factor count as equally long.
    equal_step: f64,
    /// Where runs part later than runs on coarser grids by less than this factor, they part for
    /// another reason than the phases of vibrations, and finer grids do not help.
    later_parting: f64,
    /// The local error of semi-implicit steps on the first grid, as a part of the error of the tips that is aimed at,
    /// where no tolerance is requested. That of a coarse grid is larger: of five leaves on 16 segments, with a tenth of
    /// this the bars had the same three digits, and there were two to three times as many steps; with ten times this
    /// the bar of one was two thirds larger.
    first_local_error: f64,
}

const REFINEMENT: RefinementSteps = RefinementSteps {
    coarsest_segments: 4,
    local_error_ratio: 8.0,
    local_error: (1e-12, 0.1),
    cost_ratio: 4.0,
    longer_steps: 64.0,
    step_part: 0.01,
    told_step: 2.0,
    equal_step: 1.1,
    later_parting: 1.3,
    first_local_error: 1e-2,
};

/// The grid of a run, and its steps as in [`Options`].
#[derive(Clone, Copy, Debug)]
struct Resolution {
    segments: usize,
    step: Option<f64>,
    tolerance: f64,
    /// Whether the error of its steps is known from [`StepErrors`].
    known_steps: bool,
}

/// What the steps of a run do to the error: the distance of two runs on one grid in steps of different lengths.
struct StepErrors {
    /// The permitted local error of the longer steps.
    local_error: f64,
    /// Bars on the error of the run in longer steps, at all outputs.
    bars: Vec<f64>,
    /// Whether the steps before every output but the first were longer.
    longer: Vec<bool>,
}

impl StepErrors {
    /// From runs with these permitted local errors; `None` if they have parted.
    fn between(
        shorter: &Trajectory,
        longer: &Trajectory,
        local_errors: [f64; 2],
    ) -> Option<StepErrors> {
        let [short, long] = local_errors;
        let factor = COMPARISON.safety / (1.0 - Self::ratio(short, long));
        let distances = shorter.distances(longer);
        let (outputs, parted) = (shorter.steps.len() + 1, COMPARISON.parted);
        let last = *distances.last()?;
        if distances.len() != outputs || last > parted * shorter.largest_displacement() {
            return None;
        }
        let steps = shorter.steps.iter().zip(&longer.steps);
        Some(StepErrors {
            local_error: long,
            bars: distances.iter().map(|distance| factor * distance).collect(),
            longer: steps
                .map(|(short, long)| long.longest >= REFINEMENT.told_step * short.longest)
                .collect(),
        })
    }

    /// The ratio of the errors of runs with these permitted local errors, which are of third order in the step.
    fn ratio(local_error: f64, other: f64) -> f64 {
        (local_error / other).powf(2.0 / 3.0)
    }

    /// The bars of a run with this permitted local error.
    fn bars(&self, local_error: f64) -> Vec<f64> {
        let ratio = Self::ratio(local_error, self.local_error);
        self.bars.iter().map(|bar| ratio * bar).collect()
    }

    /// The permitted local error with which the bar of the whole motion is at most this, as far as it is known.
    fn local_error_for(&self, bar: f64) -> f64 {
        let known = self.bars.last().copied().unwrap_or(f64::INFINITY);
        self.local_error * (bar / known).powf(1.5).min(1.0)
    }
}

/// What the first run is compared with.
enum FirstComparison {
    /// A run that has ended, if there is one.
    Known(Option<MotionComparison>),
    /// One on a coarser grid, which comes before it.
    Run(Box<Simulation>),
}

/// What is told of a run that unrecorded runs make, and whether they go on.
pub type RunObserver<'a> = dyn FnMut(&Simulation) -> bool + 'a;

/// A motion on finer and finer grids. Segments or a step that are requested fix the grid and the
/// steps: then there is one run, compared with another that costs less.
///
/// ```
/// # use leafdyn::scenario::Scenario;
/// # use leafdyn::simulate::{Options, Refinement};
/// # let text = r#"
/// #     leaf = { rods = 1, length = 1.0, fan = [0.0] }
/// #     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
/// #     load = { gravity = [0.0, 0.0, -1.0] }
/// #     dynamics = { duration = 1.0 }
/// # "#;
/// # let scenario = Scenario::from_toml(text)?;
/// let mut refinement = Refinement::new(&scenario, &Options::default())?;
/// let mut error = None;
/// while let Some(mut simulation) = refinement.next_run(&mut |_| true) {
///     let mut stopped = None;
///     while !simulation.done() && stopped.is_none() {
///         stopped = simulation.next_frame().err();
///     }
///     // The last run is the result.
///     refinement.end_run(&mut simulation, stopped);
///     error = simulation.error_bar();
/// }
/// assert!(error.unwrap() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Refinement {
    scenario: Scenario,
    options: Options,
    /// The error of tips that is aimed at, if one is.
    aim: Option<f64>,
    length: f64,
    choice: SchemeChoice,
    /// The next run and the one before, as they were or will be.
    resolution: Resolution,
    before: Option<Resolution>,
    /// The next run, not begun, and the points of the run that it is compared with, if they are
    /// known.
    next: Option<Simulation>,
    /// What would make a long motion cost less.
    cheaper: Vec<CheaperMotion>,
    /// The first run on the grid that is requested or usual, while the next is one that it is compared with.
    first: Option<Simulation>,
    coarser: Option<RunTrajectory>,
    /// The points of the run before that.
    coarsest: Option<RunTrajectory>,
    /// Number of runs that have ended, and whether the next is the last in any case.
    runs: usize,
    last: bool,
    /// Why there is no run with which the first is compared, if there is none.
    not_compared: Option<String>,
    /// Whether the run before was followed to its end, until when its error is known, and its bar.
    completed: bool,
    known_until: Option<f64>,
    bar: Option<f64>,
    /// What steps do to the error, once it is known.
    step_errors: Option<StepErrors>,
    seconds: f64,
    /// What the next run but the first takes: steps and seconds.
    expected: (f64, f64),
}

impl Refinement {
    /// The motion of a leaf from time 0.
    ///
    /// # Errors
    /// As of [`Simulation::new`].
    pub fn new(scenario: &Scenario, options: &Options) -> Result<Self, SimulationError> {
        let refines = options.segments.is_none() && options.step.is_none();
        let local_error = match options.tolerance {
            Some(tolerance) => tolerance,
            None if refines => larger(
                REFINEMENT.first_local_error * DEFAULT_TIP_ERROR,
                scenario.tolerance,
            ),
            None => scenario.tolerance,
        };
        let first = Simulation::with_local_error(scenario, options, local_error, true)?;
        let cheaper = match first.expected() {
            Some((_, seconds)) if seconds > COSTLY_SECONDS => {
                cheaper_motions(scenario, options, &first, seconds)
            }
            _ => Vec::new(),
        };
        let length = scenario::longest(&scenario.rods);
        let mut refinement = Refinement {
            scenario: scenario.clone(),
            options: options.clone(),
            aim: None,
            length,
            choice: first.choice(),
            resolution: Resolution {
                segments: first.segments(),
                step: first.longest_step(),
                tolerance: first.tolerance(),
                known_steps: false,
            },
            before: None,
            next: Some(first),
            cheaper,
            first: None,
            coarser: None,
            coarsest: None,
            runs: 0,
            last: false,
            not_compared: None,
            completed: false,
            known_until: None,
            bar: None,
            step_errors: None,
            seconds: 0.0,
            expected: (0.0, 0.0),
        };
        if refinement.refines() || options.tolerance.is_some() {
            refinement.aim = Some(length * options.tolerance.unwrap_or(DEFAULT_TIP_ERROR));
        }
        if let Some(first) = &mut refinement.next {
            first.aim = refinement.aim;
        }
        Ok(refinement)
    }

    /// Whether grid and steps are refined, as none of them is requested.
    pub fn refines(&self) -> bool {
        self.options.segments.is_none() && self.options.step.is_none()
    }

    /// Steps and seconds that the next run is expected to take, as far as they are known.
    pub fn expected(&self) -> Option<(f64, f64)> {
        match self.runs {
            0 => self.next.as_ref()?.expected(),
            _ => Some(self.expected).filter(|_| self.next.is_some()),
        }
    }

    /// What would make a long motion cost less, the cheapest change first; none of a short one.
    pub fn cheaper_motions(&self) -> &[CheaperMotion] {
        &self.cheaper
    }

    /// Segments of the next run.
    pub fn segments(&self) -> usize {
        self.next.as_ref().map_or(0, Simulation::segments)
    }

    /// The next run, at time 0; none behind the last, or if `watch`, which sees runs that are not recorded, or the
    /// limit ends these. Where grids are refined the first is one on a coarser grid, which the next is compared with:
    /// if the limit ends that, the coarser one is there.
    pub fn next_run(&mut self, watch: &mut RunObserver) -> Option<Simulation> {
        let mut simulation = self.next.take()?;
        let comparison = match (self.runs, &self.coarser) {
            (0, None) => match self.compare_first(&mut simulation, watch)? {
                FirstComparison::Known(comparison) => comparison,
                FirstComparison::Run(coarser) => {
                    self.first = Some(std::mem::replace(&mut simulation, *coarser));
                    None
                }
            },
            (0, Some(_)) => self.compare_next(&mut simulation),
            _ => {
                if !self.last {
                    self.lengthen_steps(&mut simulation, watch)?;
                }
                self.compare_next(&mut simulation)
            }
        };
        simulation.choice = self.choice;
        simulation.aim = self.aim;
        simulation.compare_with(comparison, self.refines());
        Some(simulation)
    }

    /// Ends a run, and decides whether another follows. What makes the last one doubtful is added
    /// to it.
    pub fn end_run(&mut self, simulation: &mut Simulation, stopped: Option<Stopped>) {
        if matches!(stopped, Some(Stopped::Interrupted { .. })) && !self.cheaper.is_empty() {
            let cheaper = self.cheaper.clone();
            simulation.doubts.push(MotionDoubt::Costly { cheaper });
        }
        if let Some(first) = self.first.take() {
            return self.end_comparison_run(first, simulation, stopped);
        }
        let trajectory = simulation.trajectory.take();
        self.seconds += simulation.seconds_so_far();
        self.runs += 1;
        let bar = simulation.error_bar().filter(|_| stopped.is_none());
        let met = self
            .aim
            .is_some_and(|aim| bar.is_some_and(|bar| bar <= aim));
        if !met && self.refines() && !self.last {
            self.prepare_refined_run(simulation, stopped);
        }
        if self.next.is_some() {
            let others = RunTrajectory {
                segments: simulation.segments(),
                trajectory: trajectory.unwrap_or_default(),
            };
            let before = self.coarser.replace(others);
            if self.last {
                // The run before once more, compared with what it was compared with.
                self.coarser = self.coarsest.take();
            } else {
                self.coarsest = before;
            }
            self.completed = stopped.is_none();
            self.known_until = simulation.known_until();
            self.bar = bar;
            return;
        }
        if let Some(aim) = self.aim
            && !met
            && stopped.is_none()
        {
            let doubt = match (simulation.error_bar(), simulation.known_until()) {
                (Some(error), _) => MotionDoubt::Inaccurate {
                    error,
                    aim,
                    refined_within: self.refines().then_some(REFINEMENT_SECONDS),
                    undamped: self.scenario.dynamics.internal_damping == 0.0,
                },
                (None, Some(from)) => MotionDoubt::RunsPart { from },
                (None, None) => MotionDoubt::NotCompared {
                    why: self.not_compared.take(),
                },
            };
            simulation.doubts.push(doubt);
        }
    }

    /// Ends the run on a coarser grid that the first one is compared with.
    fn end_comparison_run(
        &mut self,
        mut first: Simulation,
        coarser: &mut Simulation,
        stopped: Option<Stopped>,
    ) {
        if matches!(stopped, Some(Stopped::Interrupted { .. })) {
            return;
        }
        self.seconds += coarser.seconds_so_far();
        let trajectory = coarser.trajectory.take().unwrap_or_default();
        first.bound_steps_by_coarser(&trajectory, None);
        self.coarser = Some(RunTrajectory {
            segments: coarser.segments(),
            trajectory,
        });
        self.next = Some(first);
    }

    /// Builds the next run, if there is one.
    fn prepare_refined_run(&mut self, ended: &Simulation, stopped: Option<Stopped>) {
        if matches!(stopped, Some(Stopped::Interrupted { .. })) {
            return;
        }
        if stopped.is_some() && ended.steps() == 0 {
            // Where no step from the start is short enough, none is on a finer grid.
            return;
        }
        if stopped.is_some() && self.completed {
            // The finer grid fails: what the coarser one found is the result.
            if let Some(before) = self.before {
                self.last = true;
                self.resolution = before;
                self.next = self.build_run(before).ok();
            }
            return;
        }
        let until = ended.known_until().filter(|_| ended.error_bar().is_none());
        if let (Some(until), Some(before)) = (until, self.known_until)
            && before > 0.0
            && until < REFINEMENT.later_parting * before
        {
            return;
        }
        let part = ended.time() / self.scenario.dynamics.duration;
        let expected =
            REFINEMENT.cost_ratio * ended.seconds_so_far() / part.clamp(f64::EPSILON, 1.0);
        if self.seconds + expected > REFINEMENT_SECONDS {
            return;
        }
        let now = self.resolution;
        let halved = Resolution {
            segments: 2 * now.segments,
            step: now.step.map(|step| 0.5 * step),
            tolerance: self.local_error(now.tolerance / REFINEMENT.local_error_ratio),
            known_steps: false,
        };
        let Ok(next) = self.build_with_steps(halved) else {
            return;
        };
        // Explicit steps may have to be shorter than half as long; tissue adds nothing to what they take.
        let (steps, counted) = (next.expected()).unwrap_or((2.0 * ended.steps() as f64, expected));
        self.expected = (steps, steps * next.seconds_of_a_step());
        if self.seconds + counted <= REFINEMENT_SECONDS {
            self.before = Some(now);
            self.resolution = Resolution {
                step: next.longest_step(),
                ..halved
            };
            self.next = Some(next);
        }
    }

    /// The local error of a step; explicit steps have none.
    fn local_error(&self, tolerance: f64) -> f64 {
        match self.choice.scheme {
            Scheme::Explicit => self.resolution.tolerance,
            Scheme::SemiImplicit => {
                tolerance.clamp(REFINEMENT.local_error.0, REFINEMENT.local_error.1)
            }
        }
    }

    fn build_run(&self, at: Resolution) -> Result<Simulation, SimulationError> {
        let start_tolerance = self.options.tolerance.unwrap_or(self.scenario.tolerance);
        let options = Options {
            scheme: Some(self.choice.scheme),
            segments: Some(at.segments),
            step: at.step,
            tolerance: Some(at.tolerance),
            limit: self.options.limit.clone(),
        };
        let from = |leaf: &Leaf, grid: &Grid| {
            start::start_state(leaf, grid, start_tolerance, options.limit.clone())
        };
        Simulation::with_initial_state(&self.scenario, &options, &from, false)
    }

    /// With steps of this length or, by the explicit method, the longest stable ones if they are
    /// hardly longer, or shorter.
    fn build_with_steps(&self, at: Resolution) -> Result<Simulation, SimulationError> {
        let stable = self.build_run(Resolution { step: None, ..at })?;
        match (at.step, stable.longest_step()) {
            (Some(step), Some(longest)) if longest > REFINEMENT.equal_step * step => {
                self.build_run(at)
            }
            _ => Ok(stable),
        }
    }

    /// The points of a run that is not recorded, as far as it goes; none if `watch` or the limit
    /// ends it.
    fn run_unrecorded(
        &mut self,
        mut run: Simulation,
        watch: &mut RunObserver,
    ) -> Option<Trajectory> {
        run.choice = self.choice;
        run.compare_with(None, true);
        while !run.done() && run.next_frame().is_ok() {
            if !watch(&run) {
                return None;
            }
        }
        if self.options.limit.reached() {
            return None;
        }
        self.seconds += run.seconds_so_far();
        run.trajectory
    }

    /// What the first run is compared with; none if `watch` or the limit ends a run that is not recorded.
    fn compare_first(
        &mut self,
        first: &mut Simulation,
        watch: &mut RunObserver,
    ) -> Option<FirstComparison> {
        let not_compared = FirstComparison::Known(None);
        let own = self.resolution;
        let coarser = own.segments.div_ceil(2);
        let (segments, factor) =
            match coarser >= REFINEMENT.coarsest_segments && self.has_grid(coarser) {
                true => (coarser, 2.0),
                false => (2 * own.segments, 0.5),
            };
        let with_trajectory = |trajectory: Trajectory| RunTrajectory {
            segments,
            trajectory,
        };
        let with = |step: Option<f64>| Resolution {
            segments,
            step,
            tolerance: self.local_error(own.tolerance * f64::powi(factor, 3)),
            known_steps: false,
        };
        if let Some(step) = self.options.step {
            // Given steps are taken on the other grid, too, and steps half as long there tell what
            // they cost.
            let runs = [step, 0.5 * step].map(|step| self.build_run(with(Some(step))));
            let [same, halved] = match runs {
                [Ok(same), Ok(halved)] => [same, halved],
                [Err(why), _] | [_, Err(why)] => {
                    self.not_compared = Some(why.to_string());
                    return Some(not_compared);
                }
            };
            let same = self.run_unrecorded(same, watch)?;
            let halved = self.run_unrecorded(halved, watch)?;
            let comparison =
                MotionComparison::new(own.segments, with_trajectory(same), self.length);
            let comparison = comparison.with_half_steps(&halved);
            return Some(FirstComparison::Known(Some(comparison)));
        }
        let longer = own.step.map(|step| factor * step);
        let mut run = match self.build_with_steps(with(longer)) {
            Ok(run) => run,
            Err(why) => {
                self.not_compared = Some(why.to_string());
                return Some(not_compared);
            }
        };
        if let (Some(step), Some(longer)) = (run.longest_step(), longer)
            && factor > 1.0
            && REFINEMENT.equal_step * step < longer
        {
            // The coarser grid does not allow explicit steps twice as long.
            self.resolution.step = Some(0.5 * step);
            match self.build_run(self.resolution) {
                Ok(shorter) => *first = shorter,
                // Unreachable: the run was accepted with longer steps.
                Err(_) => return Some(not_compared),
            }
        }
        if factor > 1.0 && self.refines() {
            return Some(FirstComparison::Run(Box::new(run)));
        }
        if factor < 1.0 {
            run.halve_outputs();
        }
        let trajectory = self.run_unrecorded(run, watch)?;
        if factor > 1.0 {
            first.bound_steps_by_coarser(&trajectory, None);
        }
        let other = with_trajectory(trajectory);
        let comparison = MotionComparison::new(own.segments, other, self.length);
        Some(FirstComparison::Known(Some(comparison)))
    }

    /// Whether the leaf has a grid of so many segments.
    fn has_grid(&self, segments: usize) -> bool {
        relax::check_segments(&Leaf::new(&self.scenario), Some(segments), segments).is_ok()
    }

    /// Lets the steps of the next run be longer than half of those of the run before, if their error stays a small part
    /// of the bar; none inside if `watch` or the limit ends the run that tells it.
    fn lengthen_steps(&mut self, next: &mut Simulation, watch: &mut RunObserver) -> Option<()> {
        let (Some(bar), Scheme::SemiImplicit) = (self.bar, self.choice.scheme) else {
            return Some(());
        };
        if self.runs == 1 {
            self.step_errors = self.measure_step_errors(watch)?;
        }
        if let Some(errors) = &self.step_errors {
            // The error of the next run is a fourth of that of this one.
            let allowed = 0.25 * REFINEMENT.step_part * bar;
            let tolerance = self.local_error(errors.local_error_for(allowed));
            if tolerance > self.resolution.tolerance {
                self.resolution.tolerance = tolerance;
                self.resolution.known_steps = true;
                next.set_local_error(tolerance);
            }
        }
        Some(())
    }

    /// Makes the run before once more, in longer steps; none inside if these tell nothing.
    fn measure_step_errors(&mut self, watch: &mut RunObserver) -> Option<Option<StepErrors>> {
        let Some(before) = self.before else {
            return Some(None);
        };
        let longer = Resolution {
            tolerance: self.local_error(REFINEMENT.longer_steps * before.tolerance),
            ..before
        };
        if longer.tolerance < REFINEMENT.local_error_ratio * before.tolerance {
            // Already they have the largest local error that is allowed.
            return Some(None);
        }
        let Ok(run) = self.build_run(longer) else {
            return Some(None);
        };
        let trajectory = self.run_unrecorded(run, watch)?;
        let local_errors = [before.tolerance, longer.tolerance];
        let errors = (self.coarser.as_ref()).and_then(|shorter| {
            StepErrors::between(&shorter.trajectory, &trajectory, local_errors)
        });
        Some(errors)
    }

    /// The comparison of a later run with the one before.
    fn compare_next(&self, next: &mut Simulation) -> Option<MotionComparison> {
        let coarser = self.coarser.clone()?;
        let errors = (self.step_errors.as_ref()).filter(|_| self.resolution.known_steps);
        next.bound_steps_by_coarser(&coarser.trajectory, errors.map(|it| it.longer.as_slice()));
        let comparison = MotionComparison::new(next.segments(), coarser, self.length);
        Some(match errors {
            Some(errors) => comparison.with_step_bars(errors.bars(self.resolution.tolerance)),
            None => comparison,
        })
    }
}
