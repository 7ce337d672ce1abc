//! From a start to a solution with an error estimate.

use crate::refusal::Unmodelled;
use crate::scenario::{Hold, Scenario, longest};
use crate::shape::Difference;
use crate::shooting::continuation::{Interrupted, from_arcs};
use crate::shooting::equations::Equations;
use crate::shooting::newton::Newton;
use crate::shooting::solution::{
    Correction, Failure, Log, Options, Precision, Reason, Solution, Start, Work,
};
use crate::shooting::trajectory::Trajectory;

/// The error is estimated by comparison with a solution whose local errors may
/// be larger by this factor.
const COARSER: f64 = 100.0;

/// Local error allowed per step of the integration, as a part of the required
/// accuracy, and its bounds: below them rounding dominates, above them step control
/// becomes unreliable.
const LOCAL_PART: f64 = 1e-4;
const LEAST_LOCAL: f64 = 1e-13;
const MOST_LOCAL: f64 = 1e-9;

/// Factor between attempts to reach the accuracy.
const SHARPER: f64 = 1e-2;

/// Refuses scenarios with what the boundary-value problem does not contain and, unless the start is
/// a leaf at rest, those to which the continuation from arcs does not lead.
///
/// [`solve`] refuses them itself: whoever asks before saves a relaxation.
pub fn check_models(scenario: &Scenario, from_rest: bool) -> Result<(), Unmodelled> {
    if !scenario.grips.is_empty() {
        return Err(Unmodelled::Grips { what: "shooting" });
    }
    if scenario.wind.is_some() {
        return Err(Unmodelled::Wind { what: "shooting" });
    }
    let from_arcs = |why| Err(Unmodelled::FromArcs { why });
    if from_rest {
        return Ok(());
    }
    if scenario.joined && scenario.rods.len() > 1 && !scenario.is_fan() {
        return from_arcs("veins that begin apart are led to their joint tip by the relaxation");
    }
    if scenario.base_held == Hold::Pinned {
        // Without loads the leaf of arcs turns about its hinges.
        return from_arcs("a leaf on hinges (leaf.base_held) is led to rest by the relaxation");
    }
    Ok(())
}

/// Solves the boundary-value problem of a scenario, as accurately as possible if not as required.
/// `progress` is called for each correction.
///
/// # Errors
/// If no solution is found at all: the reason, and the last shape.
pub fn solve(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Correction),
) -> Result<Solution, Failure> {
    let accuracy = match options.precision {
        Precision::Error(accuracy) => accuracy,
        Precision::LocalError(tolerance) => {
            return solve_once(scenario, options.start, tolerance, options, progress);
        }
    };
    let tolerance = (LOCAL_PART * accuracy).clamp(LEAST_LOCAL, MOST_LOCAL);
    let solution = solve_once(scenario, options.start, tolerance, options, progress)?;
    let enough = accuracy * longest(&scenario.rods);
    Ok(sharpened(
        solution,
        tolerance,
        enough,
        |solution, tolerance| {
            let (stations, rods) = (options.stations, &solution.rods[..]);
            let start = Start::Leaf { stations, rods };
            solve_once(scenario, start, tolerance, options, progress)
        },
    ))
}

/// A solution with the local error `tolerance`, or the last of the attempts with smaller ones that
/// start from the one before, until the error of its positions is at most `enough`.
fn sharpened(
    mut solution: Solution,
    mut tolerance: f64,
    enough: f64,
    mut attempt: impl FnMut(&Solution, f64) -> Result<Solution, Failure>,
) -> Solution {
    while solution.error.position > enough && tolerance > LEAST_LOCAL {
        tolerance = (SHARPER * tolerance).max(LEAST_LOCAL);
        match attempt(&solution, tolerance) {
            Ok(mut sharper) => {
                sharper.work += solution.work;
                solution = sharper;
            }
            Err(failure) => {
                solution.work += failure.work;
                solution.unsharpened = Some(failure.reason);
                break;
            }
        }
    }
    solution
}

/// Solves with one tolerance, and with a coarser one for comparison.
fn solve_once(
    scenario: &Scenario,
    start: Start,
    tolerance: f64,
    options: &Options,
    progress: &mut dyn FnMut(&Correction),
) -> Result<Solution, Failure> {
    let mut equations = Equations::new(scenario);
    equations.limit = options.limit.clone();
    let mut log = Log {
        work: Work::default(),
        part: 1.0,
        progress,
    };
    let from_leaf = matches!(start, Start::Leaf { .. });
    let modelled = check_models(scenario, from_leaf);
    let found = match (modelled, start) {
        (Err(missing), _) => Err(Interrupted {
            reason: missing.into(),
            part: 1.0,
            near: Trajectory::straight(&equations),
        }),
        (Ok(()), Start::Arcs) => from_arcs(&mut equations, options.intervals, &mut log),
        (Ok(()), Start::Leaf { stations, rods }) => {
            Ok(Trajectory::of_leaf(&equations, stations, rods))
        }
    };
    let end = match found {
        Err(end) => end,
        Ok(near) => match solve_near(&equations, &near, tolerance, options, &mut log) {
            Ok(solution) => {
                let work = log.work;
                return Ok(Solution { work, ..solution });
            }
            Err(reason) => Interrupted {
                reason,
                part: 1.0,
                near,
            },
        },
    };
    let states = options.stations.iter().map(|&sigma| end.near.at(sigma));
    let near = Trajectory::new(&equations, options.stations.to_vec(), states.collect());
    Err(Failure {
        reason: (end.reason).in_context(options.intervals.is_some(), from_leaf),
        part: end.part,
        rods: near.shape(&equations),
        work: log.work,
    })
}

fn solve_near(
    equations: &Equations,
    near: &Trajectory,
    tolerance: f64,
    options: &Options,
    log: &mut Log,
) -> Result<Solution, Reason> {
    let stations = options.stations;
    let mut newton = Newton::from_trajectory(equations, near, options.intervals, log)?;
    // Over intervals that are given perturbations may grow too much for another reason.
    newton.gives_up = options.gives_up && options.intervals.is_none();
    let mut at = |tolerance: f64| -> Result<Trajectory, Reason> {
        newton.solve(tolerance)?;
        let sampled = Trajectory::sampled(equations, &newton.nodes, stations, tolerance);
        Ok(sampled?)
    };
    let (coarse, fine) = (at(COARSER * tolerance)?, at(tolerance)?);
    let (rods, tip) = (fine.shape(equations), fine.tip());
    let energy = tip[tip.len() - 1] + equations.tip_potential(tip);
    // Steps that end at the same stations share errors, which the
    // difference does not show: it is at least one local error.
    let difference = Difference::between(&coarse.shape(equations), &rods);
    let (length, force) = (equations.length, equations.force);
    let error = Difference {
        position: difference.position + tolerance * length,
        rotation: difference.rotation + tolerance,
        force: difference.force + tolerance * newton.units.total_force() * force,
        moment: difference.moment + tolerance * newton.units.largest_moment() * force * length,
    };
    Ok(Solution {
        stations: stations.to_vec(),
        error,
        rods,
        energy: energy * force * length,
        defect: newton.defect,
        growth: newton.growth.iter().map(|growth| growth.log10()).sum(),
        condition: newton.condition(),
        neutral: newton.neutral(stations),
        unsharpened: None,
        intervals: newton.nodes.sigma,
        work: Work::default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A solution with this error of its positions.
    fn within(position: f64) -> Solution {
        Solution {
            stations: vec![0.0, 1.0],
            rods: Vec::new(),
            energy: 1.0,
            error: Difference {
                position,
                ..Difference::default()
            },
            defect: 0.0,
            intervals: vec![0.0, 1.0],
            growth: 0.0,
            condition: 1.0,
            neutral: None,
            unsharpened: None,
            work: Work {
                iterations: 1,
                ..Work::default()
            },
        }
    }

    fn failed() -> Failure {
        Failure {
            reason: Reason::OutOfTime,
            part: 1.0,
            rods: Vec::new(),
            work: Work {
                iterations: 10,
                ..Work::default()
            },
        }
    }

    /// What was found is not lost when an attempt to improve it fails, and says why it was not
    /// improved.
    #[test]
    fn a_failed_attempt_leaves_the_solution_before() {
        let mut attempts = vec![Err(failed()), Ok(within(1e-5))];
        let mut tolerances = Vec::new();
        let found = sharpened(within(1e-3), 1e-9, 1e-6, |before, tolerance| {
            tolerances.push((before.error.position, tolerance));
            attempts.pop().unwrap()
        });
        for (found, wanted) in tolerances.iter().zip([(1e-3, 1e-11), (1e-5, 1e-13)]) {
            assert_eq!(found.0, wanted.0);
            assert!((found.1 / wanted.1 - 1.0).abs() < 1e-12, "{tolerances:?}");
        }
        assert_eq!(tolerances.len(), 2);
        assert_eq!(found.error.position, 1e-5);
        assert_eq!(found.unsharpened, Some(Reason::OutOfTime));
        assert_eq!(found.work.iterations, 12);

        let enough = sharpened(within(1e-6), 1e-9, 1e-6, |_, _| Err(failed()));
        assert_eq!(enough.unsharpened, None);
    }
}
