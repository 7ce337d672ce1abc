//! Speed against accuracy of motions: both integrators over their own accuracy settings, each run compared
//! with one reference at all of its outputs.
//!
//! Both integrators are of second order in space and time, so that with steps in proportion to the length h
//! of segments the error of a run is C h^2. The reference is extrapolated from runs on two grids (Richardson),
//! by both integrators, which have nothing in common but the discrete leaf and its start. It is confirmed
//! where they agree within the changes of their extrapolations from one grid to the next.

use crate::motion::Stopped;
use crate::relax;
use crate::run::Limit;
use crate::scenario::{Scenario, longest};
use crate::simulate::{Options, Refinement, Scheme, Simulation, SimulationError, compared_points};
use crate::study::chart::contender::{
    AccuracySetting, CHARTED_SEGMENTS, ChartProgress, RepeatedRuns, SolverConfig, TimingSpread,
    time_runs,
};
use crate::study::chart::reference::ReferenceSolution;
use crate::study::chart::remark::ChartRowRemark;
use crate::study::chart::result::{ChartOutcome, ChartRow};
use crate::study::judge::{Timed, run_timed};
use glam::DVec3;

/// Errors of the tips that refined motions aim at, relative to the longest rod.
const AIMED_ERRORS: [f64; 6] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// Bounds on the local error of a semi-implicit step on a single grid.
const LOCAL_ERRORS: [f64; 2] = [relax::SMALLEST_TOLERANCE, 0.1];

/// Part of the time of the whole measurement that a run of the reference may take and be followed by one on
/// a grid twice as fine, which takes four to eight times as long.
const REFERENCE_PART: f64 = 0.3;

/// The error of an extrapolation over its change from the grids before: it is a fifteenth where errors are
/// series in h^2; more is left to the start of the motion, where steps are not in proportion.
const EXTRAPOLATION_SAFETY: f64 = 0.5;

/// A motion by one method with one setting.
pub struct MotionRun {
    /// The tips and the middles of all rods, output after output.
    points: Vec<DVec3>,
    steps: usize,
    /// The bar of the run itself, in units of length.
    error_estimate: Option<f64>,
    /// Why the motion ended early, if it did.
    stopped: Option<Stopped>,
}

impl MotionRun {
    /// A motion that ended before its first output.
    fn without_outputs(stopped: Stopped) -> Self {
        MotionRun {
            points: Vec::new(),
            steps: 0,
            error_estimate: None,
            stopped: Some(stopped),
        }
    }
}

/// Repeated runs of a motion.
pub type MotionRuns<'s> = RepeatedRuns<'s, MotionRun, SimulationError>;

/// The method of time integration of a contender; `None` for shooting.
fn scheme(contender: SolverConfig) -> Option<Scheme> {
    match contender.method.is_shooting() {
        true => None,
        false if contender.method.is_explicit() => Some(Scheme::Explicit),
        false => Some(Scheme::SemiImplicit),
    }
}

/// The contender that a motion has unless a method is requested.
pub fn default_contender(scenario: &Scenario) -> Result<SolverConfig, SimulationError> {
    let scheme_of_leaf = Simulation::new(scenario, &Options::default())?.scheme();
    let mut all = SolverConfig::ALL.into_iter();
    let default = all.find(|it| !it.one_grid && scheme(*it) == Some(scheme_of_leaf));
    Ok(default.unwrap_or(SolverConfig::ALL[0]))
}

/// The runs of all settings of these contenders, of which those that move leaves are charted.
pub fn charted_runs<'s>(
    scenario: &'s Scenario,
    contenders: &[SolverConfig],
) -> Vec<MotionRuns<'s>> {
    let moving = contenders.iter().filter(|it| scheme(**it).is_some());
    let each = moving.flat_map(|&contender| {
        let settings: Vec<AccuracySetting> = match contender.one_grid {
            true => CHARTED_SEGMENTS.map(AccuracySetting::Segments).to_vec(),
            false => AIMED_ERRORS.map(AccuracySetting::Tolerance).to_vec(),
        };
        let runs = move |setting| RepeatedRuns::new(scenario, contender, setting);
        settings.into_iter().map(runs)
    });
    each.collect()
}

/// Makes the runs in turns for so many seconds; returns the number of rounds.
pub fn time_motions(
    all: &mut [MotionRuns],
    seconds: f64,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> usize {
    time_runs(all, seconds, &run_once, progress)
}

/// Runs once; also returns the time from the checked scenario to the last output, in seconds.
fn run_once(runs: &MotionRuns) -> Result<Timed<MotionRun>, SimulationError> {
    let scheme = scheme(runs.contender);
    match runs.setting {
        AccuracySetting::Tolerance(aim) => {
            run_timed(|| refined_motion(runs.scenario, scheme, aim, &runs.limit)).transpose()
        }
        AccuracySetting::Segments(segments) => {
            run_timed(|| motion_on_grid(runs.scenario, scheme, segments, &runs.limit)).transpose()
        }
    }
}

/// The motion on grids and in steps that are refined until the tips have this error.
fn refined_motion(
    scenario: &Scenario,
    scheme: Option<Scheme>,
    aim: f64,
    limit: &Limit,
) -> Result<MotionRun, SimulationError> {
    let options = Options {
        scheme,
        tolerance: Some(aim),
        limit: limit.clone(),
        ..Options::default()
    };
    let mut refinement = Refinement::new(scenario, &options)?;
    let mut steps = 0;
    let mut last = None;
    while let Some(mut simulation) = refinement.next_run(&mut |_| true) {
        let run = follow(&mut simulation);
        steps += run.steps;
        refinement.end_run(&mut simulation, run.stopped);
        last = Some(MotionRun { steps, ..run });
    }
    if limit.reached() && last.is_none() {
        // Not even the run with which the first is compared was made.
        return Ok(MotionRun::without_outputs(Stopped::Interrupted {
            time: 0.0,
        }));
    }
    // The first run of a refinement is always made.
    last.ok_or_else(|| SimulationError::Rigid {
        keys: scenario.rigid_keys_text(),
    })
}

/// Segments of the grid on which the local error of semi-implicit steps is the scenario's tolerance: on finer
/// and coarser ones errors in space and time remain in proportion, of the same size in most motions.
const BALANCED_SEGMENTS: f64 = 64.0;

/// The motion on one grid. Local errors of steps are of third order: so steps of the semi-implicit method
/// are in proportion to the length of segments, as those of the explicit one are.
fn motion_on_grid(
    scenario: &Scenario,
    scheme: Option<Scheme>,
    segments: usize,
    limit: &Limit,
) -> Result<MotionRun, SimulationError> {
    let finer = segments as f64 / BALANCED_SEGMENTS;
    let [least, most] = LOCAL_ERRORS;
    let options = Options {
        scheme,
        segments: Some(segments),
        tolerance: Some((scenario.tolerance / finer.powi(3)).clamp(least, most)),
        limit: limit.clone(),
        ..Options::default()
    };
    Ok(follow(&mut Simulation::new(scenario, &options)?))
}

/// Follows a motion from its start to its end.
fn follow(simulation: &mut Simulation) -> MotionRun {
    let mut points = Vec::new();
    let mut stopped = None;
    let mut frame = simulation.frame();
    loop {
        let (stations, joined) = (simulation.stations(), simulation.leaf().joined());
        points.extend(compared_points(&frame, stations, joined));
        if simulation.done() {
            break;
        }
        match simulation.next_frame() {
            Ok(next) => frame = next,
            Err(ended) => {
                stopped = Some(ended);
                break;
            }
        }
    }
    MotionRun {
        points,
        steps: simulation.steps(),
        error_estimate: simulation.error_bar(),
        stopped,
    }
}

/// The reference of motions: how it was found, and the points of its outputs.
pub struct FoundMotion {
    pub reference: ReferenceSolution,
    points: Vec<DVec3>,
}

/// An extrapolated motion.
struct Extrapolation {
    points: Vec<DVec3>,
    /// What its error is taken to be.
    error: f64,
    /// Segments of the finer of the two grids.
    segments: usize,
}

/// The motion against which all are measured, by runs of which each takes a small part of so many `seconds`.
/// `None` if neither method follows the leaf on three grids.
pub fn find_reference(scenario: &Scenario, seconds: f64) -> Option<FoundMotion> {
    let both = [Scheme::SemiImplicit, Scheme::Explicit];
    let [semi_implicit, explicit] = both.map(|scheme| extrapolate(scenario, scheme, seconds));
    let unit = longest(&scenario.rods);
    let mut reference = ReferenceSolution {
        confirmed: false,
        told: String::new(),
        known_within: 0.0,
        relaxation_estimate: None,
        shooting_estimate: None,
        difference: None,
        neutral: None,
    };
    let (better, told) = match (semi_implicit, explicit) {
        (Some(one), Some(other)) => {
            let apart = largest_distance(&one.points, &other.points);
            reference.difference = Some(apart / unit);
            reference.confirmed = apart <= one.error + other.error;
            let grids = [&one, &other].map(|it| it.segments);
            let better = if one.error <= other.error { one } else { other };
            let told = match reference.confirmed {
                true => "both methods agree within their error estimates",
                false => "the methods differ by more than their error estimates",
            };
            let [a, b] = grids;
            (
                better,
                format!("{told}, each extrapolated from two grids of up to {a} and {b} segments"),
            )
        }
        (Some(only), None) | (None, Some(only)) => {
            let told = "one method alone, extrapolated from two grids: the other does not follow this leaf";
            (only, told.into())
        }
        (None, None) => return None,
    };
    reference.known_within = match reference.difference {
        Some(difference) if reference.confirmed => difference.max(better.error / unit),
        _ => better.error / unit,
    };
    reference.told = told;
    Some(FoundMotion {
        reference,
        points: better.points,
    })
}

/// The motion by one method, extrapolated from the two finest grids that are affordable.
fn extrapolate(scenario: &Scenario, scheme: Scheme, seconds: f64) -> Option<Extrapolation> {
    let mut before: Option<MotionRun> = None;
    let mut found: Option<Extrapolation> = None;
    let mut error = None;
    for segments in CHARTED_SEGMENTS.into_iter().skip(1) {
        let Timed {
            result: Ok(run),
            seconds: taken,
        } = run_timed(|| motion_on_grid(scenario, Some(scheme), segments, &Limit::default()))
        else {
            break;
        };
        if run.stopped.is_some() {
            // A finer grid may resolve what this one does not.
            (before, found) = (None, None);
        } else {
            if let Some(coarser) = &before {
                let pairs = run.points.iter().zip(&coarser.points);
                let points: Vec<DVec3> = pairs.map(|(a, b)| *a + (*a - *b) / 3.0).collect();
                error =
                    found.map(|it| EXTRAPOLATION_SAFETY * largest_distance(&it.points, &points));
                found = Some(Extrapolation {
                    points,
                    error: error.unwrap_or(f64::INFINITY),
                    segments,
                });
            }
            before = Some(run);
        }
        if taken > REFERENCE_PART * seconds && error.is_some() {
            break;
        }
    }
    found.filter(|it| it.error.is_finite())
}

/// The largest distance of points of the same outputs; of motions of which one ended early that of their
/// common outputs.
fn largest_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    crate::numbers::largest(a.iter().zip(b).map(|(a, b)| a.distance(*b)))
}

/// The rows of a chart of these runs.
pub fn chart_rows(all: &[MotionRuns], reference: Option<&FoundMotion>) -> Vec<ChartRow> {
    all.iter().map(|runs| chart_row(runs, reference)).collect()
}

fn chart_row(runs: &MotionRuns, reference: Option<&FoundMotion>) -> ChartRow {
    let blank = ChartRow {
        seconds: TimingSpread::from_sorted(&runs.seconds),
        ..ChartRow::without_result(runs.contender, runs.setting, ChartOutcome::NotRun)
    };
    let unit = longest(&runs.scenario.rods);
    match &runs.first_result {
        None => blank,
        Some(Err(refusal)) => ChartRow {
            ending: ChartOutcome::Refused,
            remark: Some(ChartRowRemark::MotionRefused(refusal.clone())),
            ..blank
        },
        Some(Ok(run)) => {
            let error = reference.map(|it| largest_distance(&run.points, &it.points) / unit);
            ChartRow {
                steps: Some(run.steps),
                true_error: error.filter(|_| run.stopped.is_none()),
                error_estimate: run.error_estimate.map(|bar| bar / unit),
                ending: ChartOutcome::Moved(run.stopped),
                remark: run.stopped.map(ChartRowRemark::MotionStopped),
                ..blank
            }
        }
    }
}
