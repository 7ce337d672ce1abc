//! Who takes part in a chart: the methods with their accuracy settings, and their repeated runs.

use crate::relax::{Method, Options, Outcome, RelaxError, START_TOLERANCE};
use crate::run::{Instant, Limit};
use crate::scenario::{Scenario, longest};
use crate::shooting;
use crate::shooting::ShootingFailureReason;
use crate::study::judge::{MethodSolution, Timed, run_timed};
use crate::study::remark::SolutionRemark;
use serde::{Serialize, Serializer};
use std::fmt;
use std::time::Duration;

/// A method for an equilibrium, with one setting for its accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolverConfig {
    /// The method; the setting depends on whether it is used on one grid.
    pub method: Method,
    /// Whether it is used on one grid, with the number of segments as its setting, and not on
    /// nested grids with extrapolation.
    pub one_grid: bool,
}

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

/// The setting of a contender's accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AccuracySetting {
    /// Required accuracy, relative to the longest rod.
    Tolerance(f64),
    /// Segments per rod.
    Segments(usize),
}

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

/// Tolerances from coarse to fine.
pub(super) const CHARTED_TOLERANCES: [f64; 11] = [
    1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11,
];

/// Single grids from coarse to fine.
pub(in crate::study) const CHARTED_SEGMENTS: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];

/// A leaf, a contender and its setting, with the results of its runs so far.
pub struct RepeatedRuns<'s, R = MethodSolution, E = RelaxError> {
    pub scenario: &'s Scenario,
    pub contender: SolverConfig,
    pub setting: AccuracySetting,
    /// The result of the first run. `None`: it was not run, since a coarser one of
    /// its contender took too long.
    pub first_result: Option<Result<R, E>>,
    /// Seconds of each run; ascending once all are made.
    pub seconds: Vec<f64>,
    /// When a run gives up.
    pub limit: Limit,
}

impl<'s, R, E> RepeatedRuns<'s, R, E> {
    pub fn new(scenario: &'s Scenario, contender: SolverConfig, knob: AccuracySetting) -> Self {
        RepeatedRuns {
            scenario,
            contender,
            setting: knob,
            first_result: None,
            seconds: Vec::new(),
            limit: Limit::default(),
        }
    }
}

impl RepeatedRuns<'_> {
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
            return shoot_from_relaxed_leaf(self.scenario, accuracy, &self.limit);
        }
        let options = Options {
            method: self.contender.method.on_grid(segments),
            tolerance,
            limit: self.limit.clone(),
            ..Options::default()
        };
        run_timed(|| MethodSolution::from_relaxation(self.scenario, &options)).transpose()
    }
}

/// Shooting from a coarsely relaxed leaf. The work of both is added, and no time is
/// spent on counting eigenvalues.
pub(super) fn shoot_from_relaxed_leaf(
    scenario: &Scenario,
    accuracy: f64,
    limit: &Limit,
) -> Result<Timed<MethodSolution>, RelaxError> {
    shooting::check_models(scenario, true)?;
    let options = Options {
        tolerance: Some(START_TOLERANCE),
        limit: limit.clone(),
        ..Options::default()
    };
    let found = run_timed(|| {
        let rest = MethodSolution::from_relaxation(scenario, &options)?;
        let precision = shooting::RequiredPrecision::EstimatedError(accuracy);
        let asked = shooting::ShootingOptions {
            // Between veins that tissue ties shooting may take hours.
            gives_up: scenario.tissue.is_some(),
            limit: limit.clone(),
            ..shooting::ShootingOptions::new(rest.shooting_start(), &rest.stations, precision)
        };
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
                ShootingFailureReason::OutOfTime => Outcome::OutOfTime,
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
pub(super) struct RunTiming {
    /// Runs that take longer, in seconds, are not repeated.
    slow_seconds: f64,
    /// Shorter runs, in seconds, follow one that is not measured: those of the others have
    /// displaced their code and data from the processor's caches.
    short_seconds: f64,
    /// Least number of runs of a setting that is not slow.
    fewest_runs: usize,
    /// Largest number of runs.
    most_runs: usize,
    /// A run gives up after the time of the whole measurement, or after so many seconds if these are more.
    patience_seconds: f64,
}

pub(super) const TIMING: RunTiming = RunTiming {
    slow_seconds: 1.0,
    short_seconds: 0.01,
    fewest_runs: 3,
    most_runs: 101,
    patience_seconds: 10.0,
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

/// Runs a setting once; also returns the time, in seconds.
pub type RunOnce<'f, 's, R, E> = dyn Fn(&RepeatedRuns<'s, R, E>) -> Result<Timed<R>, E> + 'f;

/// Runs all settings once by `run_once`, in order, and those that are not slow a few times;
/// then repeatedly for about `budget` seconds in all, each for about the same time.
/// Settings of one contender are ordered by cost: if one takes longer than
/// the budget (or is slow), those after it are not run; far beyond the budget it gives up. Returns the number of
/// rounds.
pub fn time_runs<'s, R, E>(
    all: &mut [RepeatedRuns<'s, R, E>],
    budget: f64,
    run_once: &RunOnce<'_, 's, R, E>,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> usize {
    let mut run = |runs: &RepeatedRuns<'s, R, E>, round: usize, rounds: usize| {
        progress(&ChartProgress {
            rods: runs.scenario.rods.len(),
            contender: runs.contender,
            setting: runs.setting,
            round,
            rounds,
        });
        run_once(runs)
    };
    let longest = budget.max(TIMING.slow_seconds);
    let patience = Duration::from_secs_f64(budget.max(TIMING.patience_seconds));
    let mut too_slow = Vec::new();
    for runs in all.iter_mut() {
        if too_slow.contains(&runs.contender) {
            continue;
        }
        runs.limit = Limit::with_deadline(Instant::now() + patience);
        let first = run(runs, 1, TIMING.fewest_runs);
        runs.limit = Limit::default();
        runs.first_result = Some(first.map(|found| {
            runs.seconds.push(found.seconds);
            if found.seconds > longest {
                too_slow.push(runs.contender);
            }
            found.result
        }));
    }
    let mut run_again = |runs: &mut RepeatedRuns<'s, R, E>, round: usize, rounds: usize| {
        if runs.seconds[0] < TIMING.short_seconds {
            let _ = run(runs, round, rounds);
        }
        // The run succeeded before, and does so again.
        if let Ok(found) = run(runs, round, rounds) {
            runs.seconds.push(found.seconds);
        }
    };
    let is_fast = |runs: &RepeatedRuns<'s, R, E>| {
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
pub(super) fn repeat_count(seconds: &[f64], share: f64) -> usize {
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
pub(super) fn is_run_in_round(round: usize, repeats: usize, rounds: usize) -> bool {
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
