//! Speed against accuracy: all methods for an equilibrium, over their own accuracy settings,
//! measured together against one reference; and cost against the number of veins at one accuracy.
//!
//! All settings take turns, so that a varying load of the machine affects them equally.

mod reference;
mod remark;
mod result;

use crate::relax::{
    MAX_NODES, Method, Options, Outcome, RelaxError, START_TOLERANCE, check_tolerance, without_wind,
};
use crate::run::RefusedOption;
use crate::scenario::{Scenario, longest};
use crate::shooting::ShootingFailureReason;
use crate::study::chart::reference::FoundReference;
pub use crate::study::chart::reference::ReferenceSolution;
pub use crate::study::chart::remark::{ChartRemark, ChartRowRemark};
use crate::study::chart::result::PeerRows;
pub use crate::study::chart::result::{
    Chart, ChartOutcome, ChartRow, FastestByAccuracy, PeerMeasurement, PeerProgram,
};
use crate::study::judge::{MethodSolution, Timed, run_timed};
use crate::study::remark::SolutionRemark;
use crate::{read_and_write, shooting};
use serde::{Serialize, Serializer};
use std::fmt;
use thiserror::Error;

/// Options of a chart.
#[derive(Clone, Debug)]
pub struct ChartOptions {
    /// Approximate total time of the measurement, in seconds; slow runs are made once, however
    /// long they take.
    pub seconds: f64,
    /// The methods measured.
    pub contenders: Vec<SolverConfig>,
    /// Measurements of other programs.
    pub peers: Vec<PeerMeasurement>,
}

impl Default for ChartOptions {
    fn default() -> Self {
        ChartOptions {
            seconds: 10.0,
            contenders: SolverConfig::ALL.to_vec(),
            peers: Vec::new(),
        }
    }
}

/// Longest time that can be requested: a day.
const LONGEST_MEASUREMENT_SECONDS: f64 = 86_400.0;

/// Why a chart cannot be made.
#[derive(Debug, Error)]
pub enum ChartError {
    /// The leaf cannot be relaxed.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// The time requested is out of range.
    #[error("{0}")]
    Seconds(#[from] RefusedOption),
    /// The single thread for all runs cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
}

/// Charts speed against accuracy for a leaf. Everything runs on one thread.
pub fn chart(
    scenario: &Scenario,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> Result<Chart, ChartError> {
    without_wind(scenario, "a chart")?;
    let each = |&who: &SolverConfig| {
        let knobs = who.charted_settings().into_iter();
        knobs.map(move |knob| RepeatedRuns::new(scenario, who, knob))
    };
    let mut all: Vec<RepeatedRuns> = options.contenders.iter().flat_map(each).collect();
    let (reference, rows, rounds) = run_on_one_thread(options.seconds, || {
        let rounds = time_runs(&mut all, options.seconds, progress);
        let found = reference::find_reference(scenario, result::reference_stations(&all))?;
        let rows = result::chart_rows(&all, found.as_ref().map(|it| &it.solution));
        Ok((found.map(|it| it.reference), rows, rounds))
    })?;
    let rods = scenario.rods.len();
    let longest = longest(&scenario.rods);
    let PeerRows {
        peers,
        remarks: others,
    } = result::combine_peer_measurements(&options.peers, &scenario.name, rods, longest);
    let mut remarks = result::chart_remarks(&rows, &options.contenders, reference.as_ref());
    remarks.extend(others);
    let chart = Chart {
        scenario: scenario.name.clone(),
        rods,
        joined: scenario.joined,
        threads: 1,
        rounds,
        reference,
        remarks,
        rows,
        peers,
        decades: Vec::new(),
        scaling: None,
    };
    Ok(chart.with_comparisons())
}

/// Calls a function on one thread, if it may take so many `seconds`.
fn run_on_one_thread<R: Send>(
    seconds: f64,
    work: impl FnOnce() -> Result<R, RelaxError> + Send,
) -> Result<R, ChartError> {
    if !(seconds > 0.0 && seconds <= LONGEST_MEASUREMENT_SECONDS) {
        let allowed = format!("must be greater than 0 and at most {LONGEST_MEASUREMENT_SECONDS}");
        return Err(RefusedOption::new("seconds", seconds, allowed).into());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(work)?)
}

/// A method for an equilibrium, with one setting for its accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolverConfig {
    /// The method; the setting depends on whether it is used on one grid.
    pub method: Method,
    /// Whether it is used on one grid, with the number of segments as its setting, and not on
    /// nested grids with extrapolation.
    pub one_grid: bool,
}

/// The setting of a contender's accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AccuracySetting {
    /// Required accuracy, relative to the longest rod.
    Tolerance(f64),
    /// Segments per rod.
    Segments(usize),
}

/// Tolerances from coarse to fine.
const CHARTED_TOLERANCES: [f64; 11] = [
    1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11,
];

/// Single grids from coarse to fine.
pub(super) const CHARTED_SEGMENTS: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];

impl SolverConfig {
    /// All of them; the first is the default.
    pub const ALL: [SolverConfig; 7] = {
        const fn of(method: usize, one_grid: bool) -> SolverConfig {
            SolverConfig {
                method: Method::ALL[method],
                one_grid,
            }
        }
        [
            of(0, false),
            of(0, true),
            of(1, false),
            of(1, true),
            of(2, false),
            of(3, false),
            of(4, false),
        ]
    };

    /// The word used on the command line and in files.
    pub fn word(self) -> &'static str {
        match self.one_grid && !self.method.is_shooting() {
            true if self.method.is_explicit() => "explicit-grid",
            true => "semi-implicit-grid",
            false => self.method.word(),
        }
    }

    /// Its place among [`SolverConfig::ALL`], whatever the options of its method.
    pub fn number(self) -> Option<usize> {
        let word = self.word();
        SolverConfig::ALL.iter().position(|it| it.word() == word)
    }

    /// Whether it is the default of [`crate::relax::relax`].
    pub fn is_default(self) -> bool {
        self == SolverConfig::ALL[0]
    }

    /// The settings that are charted, from coarse to fine.
    pub fn charted_settings(self) -> Vec<AccuracySetting> {
        match self.one_grid {
            true => CHARTED_SEGMENTS.map(AccuracySetting::Segments).to_vec(),
            false => CHARTED_TOLERANCES.map(AccuracySetting::Tolerance).to_vec(),
        }
    }
}

read_and_write!(SolverConfig);

impl Serialize for AccuracySetting {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// As in files: `tolerance=1e-6`, `segments=64`.
impl fmt::Display for AccuracySetting {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            AccuracySetting::Tolerance(tolerance) => write!(f, "tolerance={tolerance:e}"),
            AccuracySetting::Segments(segments) => write!(f, "segments={segments}"),
        }
    }
}

/// A leaf, a contender and its setting, with the results of its runs so far.
pub struct RepeatedRuns<'s> {
    pub scenario: &'s Scenario,
    pub contender: SolverConfig,
    pub setting: AccuracySetting,
    /// The result of the first run. `None`: it was not run, since a coarser one of
    /// its contender took too long.
    pub first_result: Option<Result<MethodSolution, RelaxError>>,
    /// Seconds of each run; ascending once all are made.
    pub seconds: Vec<f64>,
}

impl<'s> RepeatedRuns<'s> {
    pub fn new(scenario: &'s Scenario, contender: SolverConfig, knob: AccuracySetting) -> Self {
        RepeatedRuns {
            scenario,
            contender,
            setting: knob,
            first_result: None,
            seconds: Vec::new(),
        }
    }

    /// The answer, unless the run was refused or not made.
    pub fn solution(&self) -> Option<&MethodSolution> {
        self.first_result.as_ref()?.as_ref().ok()
    }

    /// The answer, if the leaf is at rest.
    pub fn equilibrium(&self) -> Option<&MethodSolution> {
        self.solution().filter(|run| run.is_at_rest())
    }

    /// The distance of the leaf at rest from the reference, relative to the longest rod.
    pub fn distance_from_reference(&self, reference: Option<&MethodSolution>) -> Option<f64> {
        let distance = self.equilibrium()?.largest_distance(reference?)?;
        Some(distance / longest(&self.scenario.rods))
    }

    /// Runs once; also returns the time from the checked scenario to the result, in seconds.
    pub fn run_once(&self) -> Result<Timed<MethodSolution>, RelaxError> {
        let (tolerance, segments) = match self.setting {
            AccuracySetting::Tolerance(tolerance) => (Some(tolerance), None),
            AccuracySetting::Segments(segments) => (None, Some(segments)),
        };
        let shooting = self.contender.method.shooting();
        if shooting.is_some_and(|how| how.from_relaxed_leaf) {
            let accuracy = tolerance.unwrap_or(self.scenario.tolerance);
            return shoot_from_relaxed_leaf(self.scenario, accuracy);
        }
        let options = Options {
            method: self.contender.method.on_grid(segments),
            tolerance,
            ..Options::default()
        };
        run_timed(|| MethodSolution::from_relaxation(self.scenario, &options)).transpose()
    }
}

/// Shooting from a coarsely relaxed leaf. The work of both is added, and no time is
/// spent on counting eigenvalues.
fn shoot_from_relaxed_leaf(
    scenario: &Scenario,
    accuracy: f64,
) -> Result<Timed<MethodSolution>, RelaxError> {
    shooting::check_models(scenario, true)?;
    let options = Options {
        tolerance: Some(START_TOLERANCE),
        ..Options::default()
    };
    let found = run_timed(|| {
        let rest = MethodSolution::from_relaxation(scenario, &options)?;
        let precision = shooting::RequiredPrecision::EstimatedError(accuracy);
        let asked =
            shooting::ShootingOptions::new(rest.shooting_start(), &rest.stations, precision);
        let shot = rest
            .is_at_rest()
            .then(|| shooting::solve(scenario, &asked, &mut |_| {}));
        Ok::<_, RelaxError>((rest, shot))
    });
    let seconds = found.seconds;
    let (rest, shot) = found.result?;
    let answer = match shot {
        None => rest,
        Some(Ok(solution)) => {
            let shot = MethodSolution::from_shooting(scenario, solution, accuracy);
            MethodSolution {
                outcome: match (shot.outcome, rest.outcome) {
                    // The coarse relaxation only provides the start.
                    (Outcome::Converged, Outcome::ToleranceNotReached) => Outcome::Converged,
                    (Outcome::Converged, outcome) => outcome,
                    (outcome, _) => outcome,
                },
                work: rest.work + shot.work,
                ..shot
            }
        }
        Some(Err(failure)) => MethodSolution {
            outcome: match failure.reason {
                ShootingFailureReason::Singular(_) => Outcome::Singular,
                _ => Outcome::NotAtRest,
            },
            remark: Some(SolutionRemark::ShootingFailed(failure.reason)),
            error_estimate: None,
            work: rest.work + failure.work.into(),
            ..rest
        },
    };
    Ok(Timed {
        result: answer,
        seconds,
    })
}

/// How often a setting is run.
struct RunTiming {
    /// Runs that take longer, in seconds, are not repeated.
    slow_seconds: f64,
    /// Shorter runs, in seconds, follow one that is not measured: those of the others have
    /// displaced their code and data from the processor's caches.
    short_seconds: f64,
    /// Least number of runs of a setting that is not slow.
    fewest_runs: usize,
    /// Largest number of runs.
    most_runs: usize,
}

const TIMING: RunTiming = RunTiming {
    slow_seconds: 1.0,
    short_seconds: 0.01,
    fewest_runs: 3,
    most_runs: 101,
};

/// Progress of the measurement.
#[derive(Clone, Copy, Debug)]
pub struct ChartProgress {
    /// Veins of the leaf that is run next.
    pub rods: usize,
    /// The contender.
    pub contender: SolverConfig,
    /// Its setting.
    pub setting: AccuracySetting,
    /// Present round.
    pub round: usize,
    /// Number of rounds, as far as known.
    pub rounds: usize,
}

/// The spread of repeated measurements, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TimingSpread {
    /// Median.
    #[serde(rename = "seconds")]
    pub median: f64,
    /// Shortest.
    #[serde(rename = "seconds_min")]
    pub min: f64,
    /// First quartile.
    #[serde(rename = "seconds_q1")]
    pub q1: f64,
    /// Third quartile.
    #[serde(rename = "seconds_q3")]
    pub q3: f64,
    /// Number of measurements.
    pub runs: usize,
}

impl TimingSpread {
    /// The spread of measurements in ascending order; `None` without any.
    pub fn from_sorted(sorted: &[f64]) -> Option<Self> {
        let last = sorted.len().checked_sub(1)?;
        let at = |part: f64| {
            let position = part * last as f64;
            let below = position.floor() as usize;
            let above = (below + 1).min(last);
            let rest = position - below as f64;
            (1.0 - rest) * sorted[below] + rest * sorted[above]
        };
        Some(TimingSpread {
            min: sorted[0],
            q1: at(0.25),
            median: at(0.5),
            q3: at(0.75),
            runs: sorted.len(),
        })
    }
}

/// A spread as JSON; without a measurement the same keys are null, with no run.
pub fn serialize_spread<S: Serializer>(
    spread: &Option<TimingSpread>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Default, Serialize)]
    struct Nothing {
        seconds: (),
        seconds_min: (),
        seconds_q1: (),
        seconds_q3: (),
        runs: usize,
    }
    match spread {
        Some(spread) => spread.serialize(serializer),
        None => Nothing::default().serialize(serializer),
    }
}

/// Runs all settings once, in order, and those that are not slow a few times;
/// then repeatedly for about `budget` seconds in all, each for about the same time.
/// Settings of one contender are ordered by cost: if one takes longer than
/// the budget (or is slow), those after it are not run. Returns the number of rounds.
pub fn time_runs(
    all: &mut [RepeatedRuns],
    budget: f64,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> usize {
    let mut run = |runs: &RepeatedRuns, round: usize, rounds: usize| {
        progress(&ChartProgress {
            rods: runs.scenario.rods.len(),
            contender: runs.contender,
            setting: runs.setting,
            round,
            rounds,
        });
        runs.run_once()
    };
    let longest = budget.max(TIMING.slow_seconds);
    let mut too_slow = Vec::new();
    for runs in all.iter_mut() {
        if too_slow.contains(&runs.contender) {
            continue;
        }
        runs.first_result = Some(run(runs, 1, TIMING.fewest_runs).map(|found| {
            runs.seconds.push(found.seconds);
            if found.seconds > longest {
                too_slow.push(runs.contender);
            }
            found.result
        }));
    }
    let mut run_again = |runs: &mut RepeatedRuns, round: usize, rounds: usize| {
        if runs.seconds[0] < TIMING.short_seconds {
            let _ = run(runs, round, rounds);
        }
        // The run succeeded before, and does so again.
        if let Ok(found) = run(runs, round, rounds) {
            runs.seconds.push(found.seconds);
        }
    };
    let is_fast = |runs: &RepeatedRuns| {
        runs.seconds
            .first()
            .is_some_and(|&time| time < TIMING.slow_seconds)
    };
    for round in 1..TIMING.fewest_runs {
        for runs in all.iter_mut().filter(|runs| is_fast(runs)) {
            run_again(runs, round + 1, TIMING.fewest_runs);
        }
    }
    let share = budget / all.iter().filter(|runs| is_fast(runs)).count().max(1) as f64;
    let repeats: Vec<usize> = (all.iter())
        .map(|runs| repeat_count(&runs.seconds, share))
        .collect();
    let rest = repeats.iter().copied().max().unwrap_or(0);
    for round in 0..rest {
        for (runs, repeats) in all.iter_mut().zip(&repeats) {
            if is_run_in_round(round, *repeats, rest) {
                run_again(
                    runs,
                    TIMING.fewest_runs + round + 1,
                    TIMING.fewest_runs + rest,
                );
            }
        }
    }
    for runs in all {
        runs.seconds.sort_by(f64::total_cmp);
    }
    TIMING.fewest_runs + rest
}

/// Number of further runs after the first few, within a `share` of the time: none for a slow
/// one. The first run may be disturbed; the fastest one is used.
fn repeat_count(seconds: &[f64], share: f64) -> usize {
    let shortest = seconds.iter().copied().reduce(f64::min);
    match shortest {
        Some(time) if seconds.len() >= TIMING.fewest_runs => {
            let all = if time < TIMING.short_seconds {
                2.0 * time
            } else {
                time
            };
            ((share / all) as usize).clamp(TIMING.fewest_runs, TIMING.most_runs)
                - TIMING.fewest_runs
        }
        _ => 0,
    }
}

/// Whether a setting with so many `repeats` runs in this round: they are spread evenly over all
/// `rounds`.
fn is_run_in_round(round: usize, repeats: usize, rounds: usize) -> bool {
    (round + 1) * repeats / rounds > round * repeats / rounds
}

/// Which points (seconds, error) are on the Pareto front: no other is at least
/// as fast and as accurate. Errors below `floor` count as equal; of equal points the
/// first is on the front.
pub fn pareto_front(points: &[(f64, f64)], floor: f64) -> Vec<bool> {
    let error = |i: usize| points[i].1.max(floor);
    let beats = |j: usize, i: usize| {
        let (a, b) = (points[j].0, points[i].0);
        a <= b && error(j) <= error(i) && (a < b || error(j) < error(i) || j < i)
    };
    (0..points.len())
        .map(|i| (0..points.len()).all(|j| !beats(j, i)))
        .collect()
}

/// Cost against the number of veins.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingStudy {
    /// Name of the scenario.
    #[serde(skip)]
    pub scenario: String,
    /// Required accuracy, relative to the longest rod.
    pub tolerance: f64,
    /// Numbers of veins whose reference is not confirmed.
    pub unconfirmed: Vec<usize>,
    /// One row for each leaf and contender.
    #[serde(rename = "runs")]
    pub rows: Vec<ScalingRow>,
}

/// One contender on one leaf.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingRow {
    /// Number of veins.
    pub rods: usize,
    /// The measurement.
    #[serde(flatten)]
    pub row: ChartRow,
}

/// Measures all contenders on these leaves, from few veins to many, at one
/// tolerance. A contender on one grid gets the coarsest that is accurate
/// enough.
pub fn scaling(
    leaves: &[Scenario],
    tolerance: f64,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> Result<ScalingStudy, ChartError> {
    check_tolerance(tolerance)?;
    let mut leaves: Vec<&Scenario> = leaves.iter().collect();
    leaves.sort_by_key(|leaf| leaf.rods.len());
    leaves.dedup_by_key(|leaf| leaf.rods.len());
    let MeasuredScaling { rows, unconfirmed } = run_on_one_thread(options.seconds, || {
        measure_scaling(&leaves, tolerance, options, progress)
    })?;
    let first = leaves.first();
    Ok(ScalingStudy {
        scenario: first.map_or(String::new(), |leaf| leaf.name.clone()),
        tolerance,
        unconfirmed,
        rows,
    })
}

/// Cost against the number of veins, before it is named.
struct MeasuredScaling {
    rows: Vec<ScalingRow>,
    /// Numbers of veins whose reference is not confirmed.
    unconfirmed: Vec<usize>,
}

/// A leaf, its reference, and the coarsest grid that is accurate enough for it.
struct ScalingLeaf<'s> {
    scenario: &'s Scenario,
    reference: Option<MethodSolution>,
    grid: Option<usize>,
}

fn measure_scaling(
    leaves: &[&Scenario],
    tolerance: f64,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> Result<MeasuredScaling, RelaxError> {
    let mut contenders = options.contenders.iter();
    let any_grid = contenders.any(|contender| contender.one_grid);
    let mut unconfirmed = Vec::new();
    let leaves = leaves.iter().map(|&scenario| {
        let found = reference::find_reference(scenario, Vec::new())?;
        if !(found.as_ref()).is_some_and(|found| found.reference.confirmed) {
            unconfirmed.push(scenario.rods.len());
        }
        let reference = found.map(|found: FoundReference| found.solution);
        let grid = match &reference {
            Some(reference) if any_grid => coarsest_accurate_grid(scenario, reference, tolerance),
            _ => None,
        };
        Ok(ScalingLeaf {
            scenario,
            reference,
            grid,
        })
    });
    let leaves: Vec<ScalingLeaf> = leaves.collect::<Result<_, RelaxError>>()?;
    // From few veins to many: if a contender takes too long for one leaf,
    // it is not tried on larger ones.
    let (mut all, mut of_leaf, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for &contender in &options.contenders {
        for leaf in &leaves {
            let knob = match (contender.one_grid, leaf.grid) {
                (false, _) => AccuracySetting::Tolerance(tolerance),
                (true, Some(segments)) => AccuracySetting::Segments(segments),
                (true, None) => {
                    rows.push(row_without_grid(leaf.scenario, contender));
                    continue;
                }
            };
            all.push(RepeatedRuns::new(leaf.scenario, contender, knob));
            of_leaf.push(leaf);
        }
    }
    time_runs(&mut all, options.seconds, progress);
    for (runs, leaf) in all.into_iter().zip(of_leaf) {
        let rods = leaf.scenario.rods.len();
        let row = result::chart_rows(&[runs], leaf.reference.as_ref());
        rows.extend(row.into_iter().map(|row| ScalingRow { rods, row }));
    }
    rows.sort_by_key(|found| (found.row.contender.number(), found.rods));
    Ok(MeasuredScaling { rows, unconfirmed })
}

/// The coarsest single grid whose error is within the tolerance.
fn coarsest_accurate_grid(
    scenario: &Scenario,
    reference: &MethodSolution,
    tolerance: f64,
) -> Option<usize> {
    let fits = |segments: &usize| scenario.rods.len() * segments <= MAX_NODES;
    let grids = SolverConfig {
        one_grid: true,
        ..SolverConfig::ALL[0]
    };
    let accurate = |&segments: &usize| {
        let mut run = RepeatedRuns::new(scenario, grids, AccuracySetting::Segments(segments));
        run.first_result = Some(run.run_once().map(|found| found.result));
        let error = run.distance_from_reference(Some(reference));
        error.is_some_and(|error| error <= tolerance)
    };
    CHARTED_SEGMENTS.into_iter().take_while(fits).find(accurate)
}

fn row_without_grid(scenario: &Scenario, contender: SolverConfig) -> ScalingRow {
    let finest = CHARTED_SEGMENTS[CHARTED_SEGMENTS.len() - 1];
    let ending = ChartOutcome::Ended(Outcome::ToleranceNotReached);
    ScalingRow {
        rods: scenario.rods.len(),
        row: ChartRow {
            remark: Some(ChartRowRemark::NoAccurateGrid { finest }),
            ..ChartRow::without_result(contender, AccuracySetting::Segments(finest), ending)
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knobs_are_written_as_they_are_typed() {
        assert_eq!(
            AccuracySetting::Tolerance(1e-11).to_string(),
            "tolerance=1e-11"
        );
        assert_eq!(
            AccuracySetting::Tolerance(1e-2).to_string(),
            "tolerance=1e-2"
        );
        assert_eq!(AccuracySetting::Segments(64).to_string(), "segments=64");
    }

    #[test]
    fn every_contender_has_its_own_word() {
        for contender in SolverConfig::ALL {
            assert_eq!(contender.word().parse(), Ok(contender));
        }
    }
}

#[cfg(test)]
mod timing_tests {
    use super::*;

    #[test]
    fn repeats_are_as_many_as_wanted_and_spread() {
        for repeats in [0, 1, 2, 7, 100] {
            let rounds: Vec<usize> = (0..100)
                .filter(|&r| is_run_in_round(r, repeats, 100))
                .collect();
            assert_eq!(rounds.len(), repeats);
            let gaps = rounds.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(gaps.max().unwrap_or(0) <= 100_usize.div_ceil(repeats.max(1)));
        }
    }

    #[test]
    fn fast_runs_are_repeated_often_and_slow_ones_not() {
        assert_eq!(
            repeat_count(&[1e-6; 3], 0.1),
            TIMING.most_runs - TIMING.fewest_runs
        );
        assert_eq!(
            repeat_count(&[0.3, 0.01, 0.02], 0.1),
            10 - TIMING.fewest_runs
        );
        assert_eq!(repeat_count(&[2.0], 0.1), 0);
    }

    #[test]
    fn quartiles() {
        let spread = TimingSpread::from_sorted(&[1.0, 2.0, 3.0, 4.0, 10.0]).unwrap();
        let found = [spread.min, spread.q1, spread.median, spread.q3];
        assert_eq!(found, [1.0, 2.0, 3.0, 4.0]);
        let spread = TimingSpread::from_sorted(&[1.0, 2.0]).unwrap();
        assert_eq!((spread.q1, spread.median), (1.25, 1.5));
        assert_eq!(TimingSpread::from_sorted(&[]), None);
    }
}

#[cfg(test)]
mod front_tests {
    use super::*;

    #[test]
    fn of_equal_points_one_is_on_the_front_and_small_errors_are_equal() {
        assert_eq!(pareto_front(&[(1.0, 1e-3); 3], 0.0), [true, false, false]);
        let points = [(1.0, 1e-13), (2.0, 1e-15), (3.0, 0.0)];
        assert_eq!(pareto_front(&points, 1e-12), [true, false, false]);
        assert_eq!(pareto_front(&points, 0.0), [true, true, true]);
    }
}
