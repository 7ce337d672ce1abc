//! Speed against accuracy: all methods for an equilibrium, or for a motion, over their own accuracy settings,
//! measured together against one reference; and cost against the number of veins at one accuracy.
//!
//! All settings take turns, so that a varying load of the machine affects them equally.

pub(super) mod contender;
mod motion;
mod reference;
mod remark;
pub(super) mod result;

use crate::read_and_write;
use crate::relax::{MAX_NODES, Outcome, RelaxError, check_tolerance, without_wind_or_followers};
use crate::run::RefusedOption;
use crate::scenario::{Scenario, longest};
use crate::simulate::SimulationError;
use crate::study::chart::contender::{
    AccuracySetting, CHARTED_SEGMENTS, ChartProgress, RepeatedRuns, SolverConfig, time_runs,
};
use crate::study::chart::reference::FoundReference;
pub use crate::study::chart::reference::ReferenceSolution;
pub use crate::study::chart::remark::{ChartRemark, ChartRowRemark};
pub use crate::study::chart::result::{
    Chart, ChartOutcome, ChartRow, FastestByAccuracy, PeerMeasurement, PeerProgram,
};
use crate::study::chart::result::{PeerRows, ScalingRow, ScalingStudy};
use crate::study::judge::MethodSolution;
use thiserror::Error;

/// Options of a chart.
#[derive(Clone, Debug)]
pub struct ChartOptions {
    /// Approximate total time of the measurement, in seconds; slow runs are made once, and give up after this time
    /// (and after ten seconds).
    pub seconds: f64,
    /// The methods measured.
    pub contenders: Vec<SolverConfig>,
    /// Measurements of other programs.
    pub peers: Vec<PeerMeasurement>,
    /// Whether the motion of the leaf is charted, and not the leaf at rest.
    pub motion: bool,
}

impl Default for ChartOptions {
    fn default() -> Self {
        ChartOptions {
            seconds: 10.0,
            contenders: SolverConfig::ALL.to_vec(),
            peers: Vec::new(),
            motion: false,
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
    /// The leaf cannot be moved.
    #[error(transparent)]
    Motion(#[from] SimulationError),
    /// The methods requested do not move leaves.
    #[error(
        "none of the methods requested moves a leaf: take explicit or semi-implicit, or leave them out"
    )]
    NoMovingMethod,
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
    if options.motion {
        return chart_motion(scenario, options, progress);
    }
    without_wind_or_followers(scenario, "a chart")?;
    let each = |&who: &SolverConfig| {
        let knobs = who.charted_settings().into_iter();
        knobs.map(move |knob| RepeatedRuns::new(scenario, who, knob))
    };
    let mut all: Vec<RepeatedRuns> = options.contenders.iter().flat_map(each).collect();
    let (reference, rows, rounds) = run_on_one_thread(options.seconds, || {
        let rounds = time_runs(&mut all, options.seconds, &RepeatedRuns::run_once, progress);
        let found = reference::find_reference(scenario, result::reference_stations(&all))?;
        let rows = result::chart_rows(&all, found.as_ref().map(|it| &it.solution));
        Ok::<_, RelaxError>((found.map(|it| it.reference), rows, rounds))
    })?;
    let measured = Measurement {
        default: SolverConfig::ALL[0],
        rounds,
        remarks: result::chart_remarks(&rows, &options.contenders, reference.as_ref()),
        reference,
        rows,
    };
    Ok(measured.into_chart(scenario, options))
}

/// What the runs of a chart have shown.
struct Measurement {
    /// The contender that a leaf has unless a method is requested.
    default: SolverConfig,
    rounds: usize,
    reference: Option<ReferenceSolution>,
    rows: Vec<ChartRow>,
    /// Remarks on the rows.
    remarks: Vec<ChartRemark>,
}

impl Measurement {
    /// The chart with the measurements of other programs.
    fn into_chart(self, scenario: &Scenario, options: &ChartOptions) -> Chart {
        let rods = scenario.rods.len();
        let PeerRows { peers, remarks } = result::combine_peer_measurements(
            &options.peers,
            &scenario.name,
            rods,
            longest(&scenario.rods),
            options.motion,
        );
        let chart = Chart {
            scenario: scenario.name.clone(),
            motion: options.motion,
            default: self.default,
            rods,
            joined: scenario.joined,
            threads: 1,
            rounds: self.rounds,
            reference: self.reference,
            remarks: self.remarks.into_iter().chain(remarks).collect(),
            rows: self.rows,
            peers,
            decades: Vec::new(),
            scaling: None,
        };
        chart.with_comparisons()
    }
}

/// Charts speed against accuracy for the motion of a leaf.
fn chart_motion(
    scenario: &Scenario,
    options: &ChartOptions,
    progress: &mut (dyn FnMut(&ChartProgress) + Send),
) -> Result<Chart, ChartError> {
    let default = motion::default_contender(scenario)?;
    let mut all = motion::charted_runs(scenario, &options.contenders);
    if all.is_empty() {
        return Err(ChartError::NoMovingMethod);
    }
    let (found, rows, rounds) = run_on_one_thread(options.seconds, || {
        let rounds = motion::time_motions(&mut all, options.seconds, progress);
        let found = motion::find_reference(scenario, options.seconds);
        let rows = motion::chart_rows(&all, found.as_ref());
        Ok::<_, SimulationError>((found, rows, rounds))
    })?;
    let reference = found.map(|it| it.reference);
    let measured = Measurement {
        default,
        rounds,
        remarks: result::motion_remarks(&rows, reference.as_ref()),
        reference,
        rows,
    };
    Ok(measured.into_chart(scenario, options))
}

/// Calls a function on one thread, if it may take so many `seconds`.
fn run_on_one_thread<R: Send, E: Send>(
    seconds: f64,
    work: impl FnOnce() -> Result<R, E> + Send,
) -> Result<R, ChartError>
where
    ChartError: From<E>,
{
    if !(seconds > 0.0 && seconds <= LONGEST_MEASUREMENT_SECONDS) {
        let allowed = format!("must be greater than 0 and at most {LONGEST_MEASUREMENT_SECONDS}");
        return Err(RefusedOption::new("seconds", seconds, allowed).into());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(work)?)
}

read_and_write!(SolverConfig);

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
    time_runs(&mut all, options.seconds, &RepeatedRuns::run_once, progress);
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
