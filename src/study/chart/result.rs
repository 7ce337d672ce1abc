//! The result of a chart, `chart.json`: rows with true errors, and measurements of other programs.
//!
//! A run that ended in another equilibrium than the reference is told apart from an inaccurate one.

use crate::motion::Stopped;
use crate::relax::Outcome;
use crate::scenario::longest;
use crate::study::chart::contender::{
    AccuracySetting, RepeatedRuns, SolverConfig, TimingSpread, pareto_front, serialize_spread,
};
use crate::study::chart::reference::ReferenceSolution;
use crate::study::chart::remark::{ChartRemark, ChartRowRemark};
use crate::study::judge::{MethodSolution, common_stations};
use serde::{Serialize, Serializer};

/// Outcome of a run in a chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChartOutcome {
    /// The outcome of the run itself.
    Ended(Outcome),
    /// At rest, but not in the reference's equilibrium.
    OtherEquilibrium,
    /// The contender does not support the request.
    Refused,
    /// The motion was followed to its end, or ended early.
    Moved(Option<Stopped>),
    /// Not run, since a coarser run of the contender took too long.
    NotRun,
}

impl ChartOutcome {
    /// The word used in files.
    pub fn word(self) -> &'static str {
        match self {
            ChartOutcome::Ended(outcome) => outcome.word(),
            ChartOutcome::OtherEquilibrium => "other-equilibrium",
            ChartOutcome::Moved(None) => COMPLETED_OUTCOME,
            ChartOutcome::Moved(Some(stopped)) => stopped.word(),
            ChartOutcome::Refused => "refused",
            ChartOutcome::NotRun => "not-run",
        }
    }

    /// Whether the leaf is at rest in the reference equilibrium, with the requested accuracy,
    /// and not known to be unstable, or was followed to the end of its motion.
    pub fn is_success(self) -> bool {
        match self {
            ChartOutcome::Ended(outcome) => {
                matches!(outcome, Outcome::Converged | Outcome::ConvergedAfterSaddle)
            }
            ChartOutcome::Moved(stopped) => stopped.is_none(),
            _ => false,
        }
    }
}

impl Serialize for ChartOutcome {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

/// One setting of one contender. Errors are relative to the longest rod.
#[derive(Clone, Debug, Serialize)]
pub struct ChartRow {
    /// The contender.
    #[serde(rename = "method")]
    pub contender: SolverConfig,
    /// Its setting.
    pub knob: AccuracySetting,
    /// Times from the checked scenario to the result; `None` if it did not run.
    #[serde(flatten, serialize_with = "serialize_spread")]
    pub seconds: Option<TimingSpread>,
    /// Steps or iterations of a run; these counts are `None` if it did not run.
    pub steps: Option<usize>,
    /// Its factorizations.
    pub factorizations: Option<usize>,
    /// Its evaluations of all forces of the leaf.
    pub force_evaluations: Option<usize>,
    /// Largest distance from the reference; `None` if the leaf is not at rest,
    /// or there is no reference.
    pub true_error: Option<f64>,
    /// The run's own error estimate.
    pub error_estimate: Option<f64>,
    /// How it ended.
    #[serde(rename = "outcome")]
    pub ending: ChartOutcome,
    /// Why it did not succeed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<ChartRowRemark>,
    /// Whether it is on the Pareto front; `None` where no front is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pareto: Option<bool>,
}

impl ChartRow {
    /// A row of a contender without a result.
    pub fn without_result(
        contender: SolverConfig,
        knob: AccuracySetting,
        ending: ChartOutcome,
    ) -> Self {
        ChartRow {
            contender,
            knob,
            seconds: None,
            steps: None,
            factorizations: None,
            force_evaluations: None,
            true_error: None,
            error_estimate: None,
            ending,
            remark: None,
            pareto: None,
        }
    }

    /// Seconds and error, if it succeeded.
    pub fn seconds_and_error(&self) -> Option<(f64, f64)> {
        let point = (self.seconds?.median, self.true_error?);
        self.ending.is_success().then_some(point)
    }
}

/// Speed against accuracy.
#[derive(Clone, Debug, Serialize)]
pub struct Chart {
    /// Name of the scenario.
    pub scenario: String,
    /// Whether it is that of a motion.
    pub motion: bool,
    /// The contender that a leaf has unless a method is requested.
    #[serde(skip)]
    pub default: SolverConfig,
    /// Number of veins.
    pub rods: usize,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// Threads that every run had.
    pub threads: usize,
    /// Number of rounds in which all contenders took turns.
    pub rounds: usize,
    /// The reference for errors; `None` if no equilibrium was found.
    pub reference: Option<ReferenceSolution>,
    /// Remarks on the measurement.
    pub remarks: Vec<ChartRemark>,
    /// All settings of all contenders.
    #[serde(rename = "runs")]
    pub rows: Vec<ChartRow>,
    /// Measurements of other programs.
    pub peers: Vec<PeerProgram>,
    /// The fastest contender for every power of ten.
    pub decades: Vec<FastestByAccuracy>,
    /// Cost against the number of veins, if requested.
    pub scaling: Option<ScalingStudy>,
}

/// The fastest contender for an accuracy, and how much slower the default one is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FastestByAccuracy {
    /// The accuracy.
    pub error: f64,
    /// The fastest contender that is as accurate.
    #[serde(rename = "method")]
    pub contender: Option<SolverConfig>,
    /// Its setting.
    pub knob: Option<AccuracySetting>,
    /// Its time.
    pub seconds: Option<f64>,
    /// The setting at which the default contender is as accurate.
    pub default_knob: Option<AccuracySetting>,
    /// Its time.
    pub default_seconds: Option<f64>,
    /// Ratio of the default contender's time to the fastest.
    pub factor: Option<f64>,
}

/// Accuracies for which the fastest contender is given: powers of ten.
const ACCURACY_DECADES: [i32; 9] = [-2, -3, -4, -5, -6, -7, -8, -9, -10];

impl Chart {
    /// Whether two independent methods agree on the reference.
    pub fn is_reference_confirmed(&self) -> bool {
        self.reference.as_ref().is_some_and(|found| found.confirmed)
    }

    /// Errors below this cannot be distinguished from zero.
    fn error_floor(&self) -> f64 {
        self.reference
            .as_ref()
            .map_or(0.0, |found| found.known_within)
    }

    /// The chart with its Pareto front, the ratios of its peers, and the fastest contenders.
    pub fn with_comparisons(mut self) -> Self {
        self.mark_pareto_front();
        let floor = self.error_floor();
        let ratio = |peer: &PeerProgram| {
            let (seconds, error) = peer.seconds_and_error()?;
            // Errors indistinguishable from zero count as equal.
            let ours = self.fastest_row(error.max(floor), |row| row.contender == self.default)?;
            Some(seconds / ours.seconds?.median)
        };
        let ratios: Vec<Option<f64>> = self.peers.iter().map(ratio).collect();
        for (peer, ratio) in self.peers.iter_mut().zip(ratios) {
            peer.ratio = ratio;
        }
        self.decades = ACCURACY_DECADES
            .map(|power| self.fastest_by_accuracy(10f64.powi(power)))
            .to_vec();
        self
    }

    /// The fastest row with an error of at most `error` among those wanted.
    fn fastest_row(&self, error: f64, wanted: impl Fn(&ChartRow) -> bool) -> Option<&ChartRow> {
        let rows = self.rows.iter().filter(|row| wanted(row));
        let timed = rows.filter_map(|row| Some((row.seconds_and_error()?, row)));
        let accurate = timed.filter(|((_, its_error), _)| *its_error <= error);
        let fastest = accurate.min_by(|((a, _), _), ((b, _), _)| a.total_cmp(b));
        fastest.map(|(_, row)| row)
    }

    fn fastest_by_accuracy(&self, error: f64) -> FastestByAccuracy {
        let fastest = self.fastest_row(error, |_| true);
        let default = self.fastest_row(error, |row| row.contender == self.default);
        let median = |row: &ChartRow| row.seconds.map(|spread| spread.median);
        let [seconds, default_seconds] = [fastest, default].map(|row| row.and_then(median));
        let both = default_seconds.zip(seconds);
        FastestByAccuracy {
            error,
            contender: fastest.map(|row| row.contender),
            knob: fastest.map(|row| row.knob),
            seconds,
            default_knob: default.map(|row| row.knob),
            default_seconds,
            factor: both.map(|(default, best)| default / best),
        }
    }

    /// Marks the Pareto front of all rows and peers together.
    fn mark_pareto_front(&mut self) {
        const NEVER_ON_FRONT: (f64, f64) = (f64::INFINITY, f64::INFINITY);
        let points = self.rows.iter().map(ChartRow::seconds_and_error);
        let points = points.chain(self.peers.iter().map(PeerProgram::seconds_and_error));
        let points: Vec<(f64, f64)> = points
            .map(|point| point.unwrap_or(NEVER_ON_FRONT))
            .collect();
        let mut marks = pareto_front(&points, self.error_floor()).into_iter();
        for (row, on_front) in self.rows.iter_mut().zip(&mut marks) {
            row.pareto = Some(on_front && row.seconds_and_error().is_some());
        }
        for (peer, on_front) in self.peers.iter_mut().zip(marks) {
            peer.pareto = on_front && peer.seconds_and_error().is_some();
        }
    }
}

/// Errors above this are not due to discretization if the run's own estimate is
/// less than half as large: it is another equilibrium.
const OTHER_EQUILIBRIUM_ERROR: f64 = 1e-2;

const UNDERESTIMATED_ERROR_RATIO: f64 = 0.5;

/// Stations required of the reference: those of all runs, so that
/// nothing has to be interpolated. The stations of runs on one grid are usually among those of
/// the others; only those that are not are added.
pub fn reference_stations(all: &[RepeatedRuns]) -> Vec<f64> {
    let runs = || all.iter().filter_map(RepeatedRuns::solution);
    let Some(fewest) = runs().min_by_key(|run| run.stations.len()) else {
        return Vec::new();
    };
    let mut wanted = fewest.stations.clone();
    for run in runs() {
        if common_stations(&run.stations, &fewest.stations).len() < fewest.stations.len() {
            wanted.extend(&run.stations);
        }
    }
    wanted
}

pub fn chart_rows(all: &[RepeatedRuns], reference: Option<&MethodSolution>) -> Vec<ChartRow> {
    let errors: Vec<Option<f64>> = all
        .iter()
        .map(|runs| runs.distance_from_reference(reference))
        .collect();
    let row = |i: usize| {
        chart_row(
            &all[i],
            errors[i],
            ended_in_other_equilibrium(i, all, &errors),
        )
    };
    (0..all.len()).map(row).collect()
}

/// Whether the error of a run is due to another equilibrium.
fn ended_in_other_equilibrium(i: usize, all: &[RepeatedRuns], errors: &[Option<f64>]) -> bool {
    let this = &all[i];
    let (Some(answer), Some(error)) = (this.equilibrium(), errors[i]) else {
        return false;
    };
    if error <= OTHER_EQUILIBRIUM_ERROR {
        return false;
    }
    let unit = longest(&this.scenario.rods);
    if !this.contender.one_grid {
        let estimate = answer.error_estimate.map(|estimate| estimate / unit);
        return estimate.is_some_and(|estimate| estimate < UNDERESTIMATED_ERROR_RATIO * error);
    }
    // On one grid, without an error estimate: if a coarser grid is much more accurate,
    // or the next grid has nearly the same shape.
    let alike = |other: &usize| all[*other].contender == this.contender;
    let mut coarser = (0..i).filter(alike);
    if coarser.any(|it| errors[it].is_some_and(|there| there < UNDERESTIMATED_ERROR_RATIO * error))
    {
        return true;
    }
    let at_rest = |other: usize| all[other].equilibrium();
    let finer = (i + 1..all.len()).find(alike).and_then(at_rest);
    let next = finer.or_else(|| (0..i).rfind(alike).and_then(at_rest));
    let apart = next.and_then(|next| answer.largest_distance(next));
    apart.is_some_and(|apart| apart / unit < UNDERESTIMATED_ERROR_RATIO * error)
}

fn chart_row(runs: &RepeatedRuns, error: Option<f64>, elsewhere: bool) -> ChartRow {
    let blank = ChartRow {
        seconds: TimingSpread::from_sorted(&runs.seconds),
        ..ChartRow::without_result(runs.contender, runs.setting, ChartOutcome::NotRun)
    };
    let run = match &runs.first_result {
        None => return blank,
        Some(Err(refusal)) => {
            return ChartRow {
                ending: ChartOutcome::Refused,
                remark: Some(ChartRowRemark::Refused(refusal.clone())),
                ..blank
            };
        }
        Some(Ok(run)) => run,
    };
    let ending = match run.outcome {
        Outcome::Saddle => ChartOutcome::Ended(Outcome::Saddle),
        _ if elsewhere => ChartOutcome::OtherEquilibrium,
        outcome => ChartOutcome::Ended(outcome),
    };
    let unit = longest(&runs.scenario.rods);
    ChartRow {
        steps: Some(run.work.steps),
        factorizations: Some(run.work.factorizations),
        force_evaluations: Some(run.work.force_evaluations),
        true_error: error,
        error_estimate: run.error_estimate.map(|estimate| estimate / unit),
        ending,
        // An unknown number of negative eigenvalues is not a failure.
        remark: (run.remark.clone())
            .filter(|_| !ending.is_success())
            .map(ChartRowRemark::Solution),
        ..blank
    }
}

/// Remarks on these rows and their reference.
pub fn chart_remarks(
    rows: &[ChartRow],
    contenders: &[SolverConfig],
    reference: Option<&ReferenceSolution>,
) -> Vec<ChartRemark> {
    let floor = reference.map_or(0.0, |found| found.known_within);
    let neutral = reference.and_then(|found| found.neutral.as_ref());
    let mut remarks = Vec::new();
    if contenders.iter().any(|it| it.method.is_explicit()) {
        remarks.push(ChartRemark::ExplicitStep);
    }
    if let Some(neutral) = neutral {
        remarks.push(ChartRemark::NeutralDirection(neutral.clone()));
    }
    for &contender in contenders {
        remarks.extend(contender_remarks(contender, rows, floor, neutral.is_some()));
    }
    remarks
}

/// Remarks on these rows of motions and their reference.
pub fn motion_remarks(
    rows: &[ChartRow],
    reference: Option<&ReferenceSolution>,
) -> Vec<ChartRemark> {
    let floor = reference.map_or(0.0, |found| found.known_within);
    let each = SolverConfig::ALL.into_iter();
    let charted = each.filter(|who| rows.iter().any(|row| row.contender == *who));
    charted
        .flat_map(|who| contender_remarks(who, rows, floor, false))
        .collect()
}

fn contender_remarks(
    contender: SolverConfig,
    rows: &[ChartRow],
    floor: f64,
    neutral: bool,
) -> Vec<ChartRemark> {
    let mut remarks = Vec::new();
    let of_it = || rows.iter().filter(|row| row.contender == contender);
    if of_it().all(|row| row.ending == ChartOutcome::Refused)
        && let Some(why) = of_it().find_map(|row| row.remark.as_ref())
    {
        remarks.push(ChartRemark::NotCharted {
            contender,
            why: why.clone(),
        });
    }
    if let Some(first) = of_it().find(|row| row.ending == ChartOutcome::NotRun) {
        remarks.push(ChartRemark::NotRun {
            contender,
            from: first.knob,
        });
    }
    // Estimates that are smaller than the true error are reported here.
    let too_small = |row: &&ChartRow| {
        let estimate = row.error_estimate.unwrap_or(f64::INFINITY).max(floor);
        row.ending.is_success() && row.true_error.is_some_and(|error| error > estimate)
    };
    let at: Vec<AccuracySetting> = of_it().filter(too_small).map(|row| row.knob).collect();
    if !at.is_empty() && !neutral {
        remarks.push(ChartRemark::Underestimated { contender, at });
    }
    remarks
}

/// First words of outcomes that are equilibria.
const EQUILIBRIUM_OUTCOMES: [&str; 2] = ["converged", "at-rest"];

/// First word of the outcome of a motion that was followed to its end.
const COMPLETED_OUTCOME: &str = "completed";

/// One measurement of another program.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerMeasurement {
    /// The program.
    pub program: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Veins of the leaf.
    pub rods: usize,
    /// The setting for its accuracy; other settings follow after a blank.
    pub knob: String,
    /// The time it took.
    pub seconds: f64,
    /// Largest distance of its positions from the solution, in units of length.
    pub error: Option<f64>,
    /// How it ended.
    pub outcome: String,
}

/// A peer's measurements at one setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PeerProgram {
    /// The program, with its other settings.
    #[serde(rename = "program")]
    pub name: String,
    /// The value of its accuracy setting.
    pub knob: String,
    /// Times of all rows with these settings.
    #[serde(flatten)]
    pub seconds: TimingSpread,
    /// The largest error of these rows, relative to the longest rod; `None`
    /// if it did not come to rest.
    pub true_error: Option<f64>,
    /// How it ended.
    pub outcome: String,
    /// Whether it is on the Pareto front.
    pub pareto: bool,
    /// Its time over that of the default contender at an error at most as large.
    pub ratio: Option<f64>,
}

impl PeerProgram {
    /// Seconds and error, if it came to rest.
    pub fn seconds_and_error(&self) -> Option<(f64, f64)> {
        Some((self.seconds.median, self.true_error?))
    }
}

/// Measurements of other programs on a leaf.
pub struct PeerRows {
    /// Rows with equal settings are combined; errors are relative to the longest rod.
    pub peers: Vec<PeerProgram>,
    /// On the rows that are left out.
    pub remarks: Vec<ChartRemark>,
}

/// The rows for a leaf of this name and number of rods, at rest or in `motion`.
pub fn combine_peer_measurements(
    rows: &[PeerMeasurement],
    scenario: &str,
    rods: usize,
    longest: f64,
    motion: bool,
) -> PeerRows {
    let mut peers: Vec<PeerProgram> = Vec::new();
    let mut times: Vec<Vec<f64>> = Vec::new();
    let (mut other, mut silent) = (0, 0);
    for row in rows {
        if row.scenario != scenario || row.rods != rods {
            other += 1;
            continue;
        }
        let word = row.outcome.split_whitespace().next().unwrap_or_default();
        let at_rest = EQUILIBRIUM_OUTCOMES.contains(&word);
        let moved = word == COMPLETED_OUTCOME;
        if row.error.is_none() && (at_rest || moved) {
            silent += 1;
            continue;
        }
        // A motion is no search for an equilibrium, and the other way round.
        if at_rest && motion || moved && !motion {
            other += 1;
            continue;
        }
        let true_error = row
            .error
            .filter(|_| at_rest || moved)
            .map(|error| error / longest);
        let (knob, settings) = row.knob.split_once(' ').unwrap_or((&row.knob, ""));
        let name = format!("{} {settings}", row.program).trim_end().to_string();
        let same = |peer: &PeerProgram| {
            peer.name == name && peer.knob == knob && peer.outcome == row.outcome
        };
        let same = peers.iter().position(same);
        let same = same.unwrap_or_else(|| {
            peers.push(PeerProgram {
                name,
                knob: knob.into(),
                seconds: TimingSpread::default(),
                true_error,
                outcome: row.outcome.clone(),
                pareto: false,
                ratio: None,
            });
            times.push(Vec::new());
            times.len() - 1
        });
        times[same].push(row.seconds);
        if true_error > peers[same].true_error {
            peers[same].true_error = true_error;
        }
    }
    for (peer, seconds) in peers.iter_mut().zip(&mut times) {
        seconds.sort_by(f64::total_cmp);
        peer.seconds = TimingSpread::from_sorted(seconds).unwrap_or_default();
    }
    let of_another_leaf = (other > 0).then_some(ChartRemark::PeersOfAnotherLeaf { rows: other });
    let without_error = (silent > 0).then_some(ChartRemark::PeersWithoutError { rows: silent });
    PeerRows {
        peers,
        remarks: of_another_leaf.into_iter().chain(without_error).collect(),
    }
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scenario::Scenario;
    use crate::study::judge::tests::rod;
    use crate::study::remark::SolutionRemark;

    const STATIONS: [f64; 3] = [0.0, 0.5, 1.0];

    fn scenario() -> Scenario {
        let leaf = r#"
            name = "cantilever"
            leaf = { rods = 1, length = 2.0, fan = [0.0] }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
        "#;
        Scenario::from_toml(leaf).unwrap()
    }

    /// Straight but for a shift of its tip; the estimate is relative to the length
    /// of 2.
    fn answer(outcome: Outcome, shift: f64, estimate: Option<f64>) -> MethodSolution {
        MethodSolution {
            outcome,
            remark: Some(SolutionRemark::LeftSaddle { index: 1 }),
            error_estimate: estimate.map(|estimate| 2.0 * estimate),
            ..rod(&STATIONS, 2.0, |sigma| {
                DVec3::new(2.0 * sigma, 0.0, shift * sigma)
            })
        }
    }

    type Found = Option<Result<MethodSolution, crate::relax::RelaxError>>;

    fn found(outcome: Outcome, shift: f64, estimate: Option<f64>) -> Found {
        Some(Ok(answer(outcome, shift, estimate)))
    }

    /// The runs of a contender with these results at its first settings.
    fn runs(
        scenario: &Scenario,
        contender: SolverConfig,
        found: Vec<Found>,
    ) -> Vec<RepeatedRuns<'_>> {
        let runs = contender.charted_settings().into_iter().zip(found);
        runs.map(|(knob, found)| RepeatedRuns {
            first_result: found,
            seconds: vec![1.0],
            ..RepeatedRuns::new(scenario, contender, knob)
        })
        .collect()
    }

    /// Their rows, and those of its other settings, which are not run.
    fn judged(contender: &str, found: Vec<Found>) -> Vec<ChartRow> {
        let (scenario, contender) = (scenario(), contender.parse::<SolverConfig>().unwrap());
        let mut runs = runs(&scenario, contender, found);
        let rest = contender.charted_settings().into_iter().skip(runs.len());
        runs.extend(rest.map(|knob| RepeatedRuns::new(&scenario, contender, knob)));
        chart_rows(&runs, Some(&answer(Outcome::Converged, 0.0, None)))
    }

    fn words(rows: &[ChartRow]) -> Vec<&'static str> {
        rows.iter().map(|row| row.ending.word()).collect()
    }

    #[test]
    fn errors_are_relative_and_what_ends_elsewhere_is_no_success() {
        let rows = judged(
            "shooting",
            vec![
                found(Outcome::Converged, 2e-4, Some(3e-4)),
                found(Outcome::Converged, 0.5, Some(1e-3)),
                found(Outcome::Saddle, 0.5, Some(1e-3)),
                found(Outcome::NotAtRest, 0.5, None),
                found(Outcome::Converged, 0.03, Some(1e-2)),
            ],
        );
        let wanted = ["converged", "other-equilibrium", "saddle", "not-at-rest"];
        assert_eq!(words(&rows)[..4], wanted);
        assert_eq!(words(&rows)[4..6], ["converged", "not-run"]);
        assert_eq!(rows[0].seconds_and_error(), Some((1.0, 1e-4)));
        assert_eq!(rows[0].error_estimate, Some(3e-4));
        assert_eq!((rows[1].true_error, rows[3].true_error), (Some(0.25), None));
        // Remarks are for failures.
        assert_eq!(rows[0].remark, None);
        let why = SolutionRemark::LeftSaddle { index: 1 };
        assert_eq!(rows[3].remark, Some(ChartRowRemark::Solution(why)));
    }

    /// A coarse grid may have a large error because it is coarse, unless the next grid has
    /// the same one.
    #[test]
    fn a_coarse_grid_is_not_called_another_equilibrium() {
        let elsewhere = |shifts: &[f64]| -> Vec<bool> {
            let at = |shift: &f64| found(Outcome::Converged, *shift, None);
            let rows = judged("semi-implicit-grid", shifts.iter().map(at).collect());
            let rows = rows.iter().take(shifts.len());
            rows.map(|row| row.ending == ChartOutcome::OtherEquilibrium)
                .collect()
        };
        assert_eq!(elsewhere(&[1.6, 0.4, 0.1, 0.025]), [false; 4]);
        assert_eq!(elsewhere(&[0.52, 0.51, 0.505]), [true; 3]);
        let astray = elsewhere(&[0.4, 0.1, 0.5, 6e-3]);
        assert_eq!(astray, [false, false, true, false]);
    }

    #[test]
    fn underestimates_are_told() {
        let told = [(2e-4, 1e-5), (2e-12, 1e-15)];
        let told = told.map(|(shift, told)| found(Outcome::Converged, shift, Some(told)));
        let rows = judged("semi-implicit", told.into());
        let mut reference = ReferenceSolution {
            confirmed: true,
            told: String::new(),
            known_within: 1e-11,
            relaxation_estimate: None,
            shooting_estimate: None,
            difference: None,
            neutral: None,
        };
        let contenders = [SolverConfig::ALL[0]];
        let told = chart_remarks(&rows, &contenders, Some(&reference));
        let from = AccuracySetting::Tolerance(1e-3);
        let [contender] = contenders;
        assert_eq!(told[0], ChartRemark::NotRun { contender, from });
        let wrong = "semi-implicit underestimates its error at tolerance=1e-1";
        assert_eq!(told[1].to_string(), wrong);
        assert_eq!(told.len(), 2, "{told:?}");
        // Along a neutral direction no estimate can be wrong.
        reference.neutral = Some("the leaf can move".into());
        let told = chart_remarks(&rows, &contenders, Some(&reference));
        assert_eq!(told[0].code(), "neutral-direction");
        assert_eq!(told.len(), 2, "{told:?}");
    }

    #[test]
    fn the_reference_is_wanted_where_a_run_has_stations_of_its_own() {
        let scenario = scenario();
        let with = |stations: &[f64]| {
            let run = MethodSolution {
                stations: stations.to_vec(),
                ..answer(Outcome::Converged, 0.0, None)
            };
            let contender = SolverConfig::ALL[0];
            RepeatedRuns {
                first_result: Some(Ok(run)),
                ..RepeatedRuns::new(&scenario, contender, contender.charted_settings()[0])
            }
        };
        let nested = [with(&[0.0, 0.25, 0.5, 0.75, 1.0]), with(&STATIONS)];
        assert_eq!(reference_stations(&nested), STATIONS);
        let other = [with(&[0.0, 0.3, 0.6, 1.0]), with(&STATIONS)];
        assert_eq!(
            reference_stations(&other),
            [0.0, 0.5, 1.0, 0.0, 0.3, 0.6, 1.0]
        );
        assert!(reference_stations(&[]).is_empty());
    }
}

#[cfg(test)]
mod peers_tests {
    use super::*;

    /// program, scenario, rods, knob, seconds, error, outcome.
    fn row(text: &str) -> PeerMeasurement {
        let cell: Vec<&str> = text.split(',').collect();
        PeerMeasurement {
            program: cell[0].into(),
            scenario: cell[1].into(),
            rods: cell[2].parse().unwrap(),
            knob: cell[3].into(),
            seconds: cell[4].parse().unwrap(),
            error: cell[5].parse().ok(),
            outcome: cell[6].into(),
        }
    }

    #[test]
    fn equal_rows_are_taken_together_and_others_counted() {
        let rows = [
            "a,leaf,5,n=10,3,4e-3,converged",
            "a,leaf,5,n=10,1,4e-3,converged",
            "a,leaf,5,n=10,2,4e-3,converged",
            "a,leaf,5,n=10 own-law,2,6e-3,at-rest",
            "a,leaf,5,n=20,2,,not-converged newton",
            "a,leaf,5,n=30,2,,converged",
            "a,leaf,5,n=30 steps=9,2,,completed",
            "a,leaf,7,n=10,2,1e-3,converged",
            "a,tree,5,n=10,2,1e-3,converged",
            "a,tree,5,n=20,2,1e-3,converged",
        ]
        .map(row);
        let PeerRows { peers, remarks } = combine_peer_measurements(&rows, "leaf", 5, 2.0, false);
        let names = peers.iter().map(|peer| (&peer.name[..], &peer.knob[..]));
        let names: Vec<(&str, &str)> = names.collect();
        assert_eq!(names, [("a", "n=10"), ("a own-law", "n=10"), ("a", "n=20")]);
        assert_eq!((peers[0].seconds.median, peers[0].seconds.runs), (2.0, 3));
        assert_eq!(peers[0].true_error, Some(2e-3));
        assert_eq!(peers[2].true_error, None);
        let wanted = [
            "3 rows of peers are about another leaf, and left out",
            "2 rows of peers are without the error of a leaf at rest, and left out",
        ];
        let remarks: Vec<String> = remarks.iter().map(ToString::to_string).collect();
        assert_eq!(remarks, wanted);
    }
}
