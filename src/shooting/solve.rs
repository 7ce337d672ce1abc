//! From a start to a solution with an error estimate.
//!
//! A boundary-value solution without a given start: by continuation from the leaf
//! that rests in arcs, whose solution is known, to the scenario's.

use crate::homotopy::Homotopy;
use crate::run::Unmodelled;
use crate::scenario::{Hold, Scenario, longest};
use crate::shape::{Difference, equally_spaced};
use crate::shooting::equations::Equations;
use crate::shooting::integrate::Trajectory;
use crate::shooting::newton::Newton;
use crate::shooting::{
    Correction, Failure, Log, Options, Precision, Reason, Solution, Start, Work,
};

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

/// Accuracy of intermediate solutions.
const ROUGH: f64 = 1e-6;

/// Smallest step, as a part of the whole change.
const LEAST_STEP: f64 = 1.0 / 16384.0;

/// Evaluations of slopes of single rods before a strategy is abandoned: some seconds.
const BUDGET: usize = 4_000_000;

/// Stations per interval at which a solution is stored as the start of the next one.
const STATIONS: usize = 4;

/// Over many short intervals, Newton's method has a larger region of convergence.
/// Rotation over one of them, in radians, and their largest number.
const TURN: f64 = 0.3;

const LEAST_INTERVALS: usize = 8;

const MOST_INTERVALS: usize = 256;

/// A continuation that ended before the scenario's leaf was reached.
pub struct Interrupted {
    pub reason: Reason,
    /// Part of the change that was made.
    pub part: f64,
    pub near: Trajectory,
}

/// How the leaf of arcs is changed into the scenario's, in the order of attempts.
/// The last one may end far from its start.
const STRATEGIES: [Strategy; 3] = [Strategy::Near, Strategy::Stiff, Strategy::Far];

#[derive(Clone, Copy, PartialEq)]
enum Strategy {
    /// Newton's steps are limited to solutions nearby.
    Near,
    /// Steps limited like those of [`Strategy::Near`], with rods that initially have their
    /// largest stiffness in all directions.
    Stiff,
    /// Newton's steps are not limited.
    Far,
}

/// Follows the equilibrium from the leaf of arcs to the scenario's. Returns a
/// trajectory near the solution.
pub fn from_arcs(
    equations: &mut Equations,
    intervals: Option<usize>,
    log: &mut Log,
) -> Result<Trajectory, Interrupted> {
    let mut first = None;
    for strategy in STRATEGIES {
        let mut attempt = Attempt {
            strategy,
            equations,
            intervals,
            log,
        };
        match attempt.follow() {
            Ok(near) => return Ok(near),
            Err(failure) if failure.reason == Reason::OutOfTime => return Err(failure),
            Err(failure) => first = first.or(Some(failure)),
        }
    }
    Err(first.expect("there is a strategy"))
}

/// A continuation by one of the strategies.
struct Attempt<'c, 'a, 'p> {
    strategy: Strategy,
    equations: &'c mut Equations<'a>,
    intervals: Option<usize>,
    log: &'c mut Log<'p>,
}

impl Attempt<'_, '_, '_> {
    fn follow(&mut self) -> Result<Trajectory, Interrupted> {
        self.equations.part = 0.0;
        let stiff = self.strategy == Strategy::Stiff;
        self.equations.softened = if stiff { 0.0 } else { 1.0 };
        let unstressed = Trajectory::unstressed(self.equations, ROUGH);
        let near = unstressed.map_err(|unbounded| Interrupted {
            reason: unbounded.into(),
            part: 0.0,
            near: Trajectory::straight(self.equations),
        })?;
        let near = self.follow_stage(|equations| &mut equations.part, near)?;
        match stiff {
            true => self.follow_stage(|equations| &mut equations.softened, near),
            false => Ok(near),
        }
    }

    /// Changes the equations by one stage; the first attempt is the whole change.
    fn follow_stage(
        &mut self,
        stage: Stage,
        mut near: Trajectory,
    ) -> Result<Trajectory, Interrupted> {
        let mut path = Homotopy::new(1.0, [LEAST_STEP, 1.0]);
        let mut before: Option<(Trajectory, f64)> = None;
        let (begun, rods) = (self.log.work.slopes, self.equations.rods());
        while path.part < 1.0 {
            let part = path.part;
            self.log.part = part;
            *stage(self.equations) = path.next();
            let predicted = match &before {
                Some((earlier, at)) => {
                    near.beyond(self.equations, earlier, path.length() / (part - at))
                }
                None => near.clone(),
            };
            match self.solve_near(&predicted) {
                Ok(trajectory) => {
                    before = Some((std::mem::replace(&mut near, trajectory), part));
                    path.advance(2.0 * path.length());
                }
                Err(reason) => {
                    let spent = (self.log.work.slopes - begun) * rods;
                    let ends = reason == Reason::OutOfTime || spent >= BUDGET;
                    if ends || !path.shorten(0.5) {
                        return Err(Interrupted { reason, part, near });
                    }
                }
            }
        }
        self.log.part = 1.0;
        Ok(near)
    }

    fn solve_near(&mut self, near: &Trajectory) -> Result<Trajectory, Reason> {
        let equations = &*self.equations;
        let count = self.intervals.unwrap_or_else(|| {
            let turns = (near.turn(equations) / TURN).ceil() as usize;
            turns.clamp(LEAST_INTERVALS, MOST_INTERVALS)
        });
        let mut newton = Newton::from_trajectory(equations, near, Some(count), self.log)?;
        newton.only_near = self.strategy != Strategy::Far;
        newton.solve(ROUGH)?;
        let stations = equally_spaced(STATIONS * count.max(LEAST_INTERVALS));
        let sampled = Trajectory::sampled(equations, &newton.nodes, &stations, ROUGH);
        Ok(sampled?)
    }
}

/// The parameter that varies from 0 to 1 along a stage.
type Stage = for<'e> fn(&'e mut Equations) -> &'e mut f64;

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
