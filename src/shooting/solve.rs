//! From a start to a solution with an error estimate: from a leaf at rest, or by continuation from the
//! leaf that rests in arcs, whose solution is known, to the scenario's.

use crate::homotopy::{StepEnd, StepSizes};
use crate::run::UnmodelledFeature;
use crate::scenario::{Scenario, Wind, longest};
use crate::shape::{Difference, equally_spaced};
use crate::shooting::equations::BoundaryValueProblem;
use crate::shooting::integrate::LeafTrajectory;
use crate::shooting::newton::{ShootingNewton, check_work};
use crate::shooting::tissue::{has_rigid_tissue, rigid_tissue_obstacle};
use crate::shooting::{
    CorrectionProgress, RequiredPrecision, ShootingCounts, ShootingFailure, ShootingFailureReason,
    ShootingLog, ShootingOptions, ShootingSolution, ShootingStart,
};

/// Local errors allowed per step of the integration, dimensionless.
struct LocalErrors {
    /// Local error as a part of the required accuracy. Doubled, integrations take 8 % fewer steps.
    accuracy_fraction: f64,
    /// Smallest local error: below it rounding dominates.
    least: f64,
    /// Largest local error: above it step control becomes unreliable.
    largest: f64,
    /// Local error of the next attempt over that of one that did not reach the accuracy.
    sharpening: f64,
    /// Local error of the solution with which the error is estimated, over that of the result.
    comparison: f64,
    /// Local error of solutions on the way from arcs.
    intermediate: f64,
}

const LOCAL_ERRORS: LocalErrors = LocalErrors {
    accuracy_fraction: 1e-4,
    least: 1e-13,
    largest: 1e-9,
    sharpening: 1e-2,
    comparison: 100.0,
    intermediate: 1e-6,
};

/// Continuation from arcs.
struct ArcContinuation {
    /// Steps of a stage, of which the first is the whole change.
    steps: StepSizes,
    /// Evaluations of slopes of single rods before a strategy is abandoned: some seconds.
    most_slope_evaluations: usize,
    /// Stations per interval at which a solution is stored as the start of the next one.
    stations_per_interval: usize,
    /// Rotation over one interval, radians. Over many short intervals Newton's method has a larger
    /// region of convergence; halved, they are twice as many.
    interval_turn: f64,
    least_intervals: usize,
    most_intervals: usize,
}

const CONTINUATION: ArcContinuation = ArcContinuation {
    steps: StepSizes {
        first: 1.0,
        shortest: 1.0 / 16384.0,
        longest: 1.0,
        growth: 2.0,
        failure: 0.5,
    },
    most_slope_evaluations: 4_000_000,
    stations_per_interval: 4,
    interval_turn: 0.3,
    least_intervals: 8,
    most_intervals: 256,
};

/// Refuses scenarios with what the boundary-value problem does not contain and, unless the start is
/// a leaf at rest, those to which the continuation from arcs does not lead.
///
/// [`solve`] refuses them itself: whoever asks before saves a relaxation.
pub fn check_models(scenario: &Scenario, from_rest: bool) -> Result<(), UnmodelledFeature> {
    if !scenario.grips.is_empty() {
        return Err(UnmodelledFeature::Grips { what: "shooting" });
    }
    let changing = |wind: &Wind| !wind.velocity.is_constant();
    if scenario.wind.as_ref().is_some_and(changing) {
        return Err(UnmodelledFeature::Wind {
            what: "shooting in wind that changes",
        });
    }
    if let Some(what) = rigid_tissue_obstacle(scenario) {
        return Err(UnmodelledFeature::RigidTissue { what });
    }
    let from_arcs = |why| Err(UnmodelledFeature::FromArcs { why });
    if from_rest {
        return Ok(());
    }
    if scenario.joined && scenario.rods.len() > 1 && !scenario.is_fan() {
        return from_arcs("veins that begin apart are led to their joint tip by the relaxation");
    }
    if scenario.joined && has_rigid_tissue(scenario) {
        // The arcs do not keep its strains.
        return from_arcs(
            "a joint leaf with rigid tissue (tissue.along, tissue.normal) is led to rest by the relaxation",
        );
    }
    if scenario.has_followers() {
        return from_arcs(
            "a leaf under loads that turn with the section is led to rest by the relaxation",
        );
    }
    if scenario.wind.is_some() {
        return from_arcs("a leaf in wind is led to rest by the relaxation");
    }
    if scenario.foundation.is_some() {
        return from_arcs("a leaf on a foundation is led to rest by the relaxation");
    }
    if !scenario.all_bases_clamped() {
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
    options: &ShootingOptions,
    progress: &mut dyn FnMut(&CorrectionProgress),
) -> Result<ShootingSolution, ShootingFailure> {
    let accuracy = match options.precision {
        RequiredPrecision::EstimatedError(accuracy) => accuracy,
        RequiredPrecision::LocalError(tolerance) => {
            return solve_once(scenario, options.start, tolerance, options, progress);
        }
    };
    let tolerance =
        (LOCAL_ERRORS.accuracy_fraction * accuracy).clamp(LOCAL_ERRORS.least, LOCAL_ERRORS.largest);
    let solution = solve_once(scenario, options.start, tolerance, options, progress)?;
    let enough = accuracy * longest(&scenario.rods);
    Ok(sharpened(
        solution,
        tolerance,
        enough,
        |solution, tolerance| {
            let (stations, rods) = (options.stations, &solution.rods[..]);
            let start = ShootingStart::Leaf { stations, rods };
            solve_once(scenario, start, tolerance, options, progress)
        },
    ))
}

/// A solution with the local error `tolerance`, or the last of the attempts with smaller ones that
/// start from the one before, until the error of its positions is at most `enough`.
fn sharpened(
    mut solution: ShootingSolution,
    mut tolerance: f64,
    enough: f64,
    mut attempt: impl FnMut(&ShootingSolution, f64) -> Result<ShootingSolution, ShootingFailure>,
) -> ShootingSolution {
    while solution.error.position > enough && tolerance > LOCAL_ERRORS.least {
        tolerance = (LOCAL_ERRORS.sharpening * tolerance).max(LOCAL_ERRORS.least);
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
    start: ShootingStart,
    tolerance: f64,
    options: &ShootingOptions,
    progress: &mut dyn FnMut(&CorrectionProgress),
) -> Result<ShootingSolution, ShootingFailure> {
    let mut equations = BoundaryValueProblem::new(scenario);
    equations.limit = options.limit.clone();
    let mut log = ShootingLog {
        work: ShootingCounts::default(),
        lambda: 1.0,
        progress,
    };
    let from_leaf = matches!(start, ShootingStart::Leaf { .. });
    let modelled = check_models(scenario, from_leaf);
    let found = match (modelled, start) {
        (Err(missing), _) => Err(InterruptedHomotopy {
            reason: missing.into(),
            lambda: 1.0,
            last_trajectory: LeafTrajectory::straight(&equations),
        }),
        (Ok(()), ShootingStart::Arcs) => {
            continue_from_arcs(&mut equations, options.intervals, &mut log)
        }
        (Ok(()), ShootingStart::Leaf { stations, rods }) => {
            Ok(LeafTrajectory::from_leaf_shape(&equations, stations, rods))
        }
    };
    let end = match found {
        Err(end) => end,
        Ok(near) => match solve_near(&equations, &near, tolerance, options, &mut log) {
            Ok(solution) => {
                let work = log.work;
                return Ok(ShootingSolution { work, ..solution });
            }
            Err(reason) => InterruptedHomotopy {
                reason,
                lambda: 1.0,
                last_trajectory: near,
            },
        },
    };
    let states = options
        .stations
        .iter()
        .map(|&sigma| end.last_trajectory.interpolate_state(sigma));
    let near = LeafTrajectory::new(&equations, options.stations.to_vec(), states.collect());
    Err(ShootingFailure {
        reason: (end.reason).in_context(options.intervals.is_some(), from_leaf),
        lambda: end.lambda,
        rods: near.shape(&equations),
        work: log.work,
    })
}

fn solve_near(
    equations: &BoundaryValueProblem,
    near: &LeafTrajectory,
    tolerance: f64,
    options: &ShootingOptions,
    log: &mut ShootingLog,
) -> Result<ShootingSolution, ShootingFailureReason> {
    let stations = options.stations;
    if options.gives_up && options.intervals.is_none() {
        check_work(equations, near, LOCAL_ERRORS.comparison * tolerance)?;
    }
    let mut newton = ShootingNewton::from_trajectory(equations, near, options.intervals, log)?;
    // Over intervals that are given perturbations may grow too much for another reason.
    newton.gives_up = options.gives_up && options.intervals.is_none();
    let mut at = |tolerance: f64| -> Result<LeafTrajectory, ShootingFailureReason> {
        newton.solve(tolerance)?;
        let sampled =
            LeafTrajectory::sample_solution(equations, &newton.nodes, stations, tolerance);
        Ok(sampled?)
    };
    let (coarse, fine) = (at(LOCAL_ERRORS.comparison * tolerance)?, at(tolerance)?);
    let (rods, tip) = (fine.shape(equations), fine.tip());
    let of_ends = equations.tip_potential(tip) + equations.base_potential(&newton.nodes.states[0]);
    let energy = tip[tip.len() - 1] + of_ends;
    // Steps that end at the same stations share errors, which the
    // difference does not show: it is at least one local error.
    let difference = Difference::between(&coarse.shape(equations), &rods);
    let (length, force) = (equations.length_unit, equations.force_unit);
    let error = Difference {
        position: difference.position + tolerance * length,
        rotation: difference.rotation + tolerance,
        force: difference.force + tolerance * newton.units.total_force() * force,
        moment: difference.moment + tolerance * newton.units.largest_moment() * force * length,
    };
    Ok(ShootingSolution {
        stations: stations.to_vec(),
        error,
        rods,
        energy: energy * force * length,
        defect: newton.defect,
        growth: newton.growth.iter().map(|growth| growth.log10()).sum(),
        condition: newton.singular_value_ratio(),
        neutral: newton.neutral(stations),
        unsharpened: None,
        intervals: newton.nodes.sigma,
        work: ShootingCounts::default(),
    })
}

/// A continuation that ended before the scenario's leaf was reached.
struct InterruptedHomotopy {
    reason: ShootingFailureReason,
    /// Part of the change that was made.
    lambda: f64,
    last_trajectory: LeafTrajectory,
}

/// How the leaf of arcs is changed into the scenario's, in the order of attempts.
/// The last one may end far from its start.
const STRATEGIES: [HomotopyStrategy; 3] = [
    HomotopyStrategy::LimitedSteps,
    HomotopyStrategy::InitiallyStiff,
    HomotopyStrategy::UnlimitedSteps,
];

#[derive(Clone, Copy, PartialEq)]
enum HomotopyStrategy {
    /// Newton's steps are limited to solutions nearby.
    LimitedSteps,
    /// Steps limited like those of [`HomotopyStrategy::LimitedSteps`], with rods that initially have their
    /// largest stiffness in all directions.
    InitiallyStiff,
    /// Newton's steps are not limited.
    UnlimitedSteps,
}

/// Follows the equilibrium from the leaf of arcs to the scenario's. Returns a
/// trajectory near the solution.
fn continue_from_arcs(
    equations: &mut BoundaryValueProblem,
    intervals: Option<usize>,
    log: &mut ShootingLog,
) -> Result<LeafTrajectory, InterruptedHomotopy> {
    let mut first = None;
    for strategy in STRATEGIES {
        let mut attempt = HomotopyAttempt {
            strategy,
            equations,
            intervals,
            log,
        };
        match attempt.follow_stages() {
            Ok(near) => return Ok(near),
            Err(failure) if failure.reason == ShootingFailureReason::OutOfTime => {
                return Err(failure);
            }
            Err(failure) => first = first.or(Some(failure)),
        }
    }
    Err(first.expect("there is a strategy"))
}

/// A solution on the way from arcs.
struct PathPoint {
    lambda: f64,
    trajectory: LeafTrajectory,
}

/// A continuation by one of the strategies.
struct HomotopyAttempt<'c, 'a, 'p> {
    strategy: HomotopyStrategy,
    equations: &'c mut BoundaryValueProblem<'a>,
    intervals: Option<usize>,
    log: &'c mut ShootingLog<'p>,
}

impl HomotopyAttempt<'_, '_, '_> {
    fn follow_stages(&mut self) -> Result<LeafTrajectory, InterruptedHomotopy> {
        self.equations.load_lambda = 0.0;
        let stiff = self.strategy == HomotopyStrategy::InitiallyStiff;
        self.equations.softening_lambda = if stiff { 0.0 } else { 1.0 };
        let unstressed = LeafTrajectory::unstressed_leaf(self.equations, LOCAL_ERRORS.intermediate);
        let near = unstressed.map_err(|unbounded| InterruptedHomotopy {
            reason: unbounded.into(),
            lambda: 0.0,
            last_trajectory: LeafTrajectory::straight(self.equations),
        })?;
        let near = self.follow_stage(|equations| &mut equations.load_lambda, near)?;
        match stiff {
            true => self.follow_stage(|equations| &mut equations.softening_lambda, near),
            false => Ok(near),
        }
    }

    /// Changes the equations by one stage; the first attempt is the whole change.
    fn follow_stage(
        &mut self,
        stage: HomotopyParameter,
        mut near: LeafTrajectory,
    ) -> Result<LeafTrajectory, InterruptedHomotopy> {
        let mut before: Option<PathPoint> = None;
        let (begun, rods) = (self.log.work.slopes, self.equations.rods());
        let end = CONTINUATION.steps.follow(|step| {
            self.log.lambda = step.from;
            *stage(self.equations) = step.to;
            let predicted = match &before {
                Some(earlier) => near.extrapolate(
                    self.equations,
                    &earlier.trajectory,
                    step.length() / (step.from - earlier.lambda),
                ),
                None => near.clone(),
            };
            match self.solve_near(&predicted) {
                Ok(trajectory) => {
                    before = Some(PathPoint {
                        lambda: step.from,
                        trajectory: std::mem::replace(&mut near, trajectory),
                    });
                    StepEnd::Made {
                        growth: CONTINUATION.steps.growth,
                    }
                }
                Err(reason) => {
                    let spent = (self.log.work.slopes - begun) * rods;
                    let ends = reason == ShootingFailureReason::OutOfTime
                        || spent >= CONTINUATION.most_slope_evaluations;
                    match ends {
                        true => StepEnd::Ended((reason, step.from)),
                        false => StepEnd::TooLong((reason, step.from)),
                    }
                }
            }
        });
        match end {
            Ok(()) => {
                self.log.lambda = 1.0;
                Ok(near)
            }
            Err((reason, lambda)) => Err(InterruptedHomotopy {
                reason,
                lambda,
                last_trajectory: near,
            }),
        }
    }

    fn solve_near(
        &mut self,
        near: &LeafTrajectory,
    ) -> Result<LeafTrajectory, ShootingFailureReason> {
        let equations = &*self.equations;
        let count = self.intervals.unwrap_or_else(|| {
            let turns = (near.largest_turn(equations) / CONTINUATION.interval_turn).ceil() as usize;
            turns.clamp(CONTINUATION.least_intervals, CONTINUATION.most_intervals)
        });
        let mut newton = ShootingNewton::from_trajectory(equations, near, Some(count), self.log)?;
        newton.requires_near_start = self.strategy != HomotopyStrategy::UnlimitedSteps;
        newton.solve(LOCAL_ERRORS.intermediate)?;
        let stations = equally_spaced(
            CONTINUATION.stations_per_interval * count.max(CONTINUATION.least_intervals),
        );
        let sampled = LeafTrajectory::sample_solution(
            equations,
            &newton.nodes,
            &stations,
            LOCAL_ERRORS.intermediate,
        );
        Ok(sampled?)
    }
}

/// The parameter that varies from 0 to 1 along a stage.
type HomotopyParameter = for<'e> fn(&'e mut BoundaryValueProblem) -> &'e mut f64;

#[cfg(test)]
mod tests {
    use super::*;

    /// A solution with this error of its positions.
    fn solution_with_error(position: f64) -> ShootingSolution {
        ShootingSolution {
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
            work: ShootingCounts {
                iterations: 1,
                ..ShootingCounts::default()
            },
        }
    }

    fn failed_solution() -> ShootingFailure {
        ShootingFailure {
            reason: ShootingFailureReason::OutOfTime,
            lambda: 1.0,
            rods: Vec::new(),
            work: ShootingCounts {
                iterations: 10,
                ..ShootingCounts::default()
            },
        }
    }

    /// What was found is not lost when an attempt to improve it fails, and says why it was not
    /// improved.
    #[test]
    fn a_failed_attempt_leaves_the_solution_before() {
        let mut attempts = vec![Err(failed_solution()), Ok(solution_with_error(1e-5))];
        let mut tolerances = Vec::new();
        let found = sharpened(
            solution_with_error(1e-3),
            1e-9,
            1e-6,
            |before, tolerance| {
                tolerances.push((before.error.position, tolerance));
                attempts.pop().unwrap()
            },
        );
        for (found, wanted) in tolerances.iter().zip([(1e-3, 1e-11), (1e-5, 1e-13)]) {
            assert_eq!(found.0, wanted.0);
            assert!((found.1 / wanted.1 - 1.0).abs() < 1e-12, "{tolerances:?}");
        }
        assert_eq!(tolerances.len(), 2);
        assert_eq!(found.error.position, 1e-5);
        assert_eq!(found.unsharpened, Some(ShootingFailureReason::OutOfTime));
        assert_eq!(found.work.iterations, 12);

        let enough = sharpened(solution_with_error(1e-6), 1e-9, 1e-6, |_, _| {
            Err(failed_solution())
        });
        assert_eq!(enough.unsharpened, None);
    }
}
