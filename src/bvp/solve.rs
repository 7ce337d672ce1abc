//! From a start to a solution with an error estimate.

use super::continuation::{Interrupted, from_arcs};
use super::dop853::Unbounded;
use super::equations::Equations;
use super::newton::{Newton, Work};
use super::solution::{Failure, Options, Reason, Solution, Start};
use super::trajectory::Trajectory;
use crate::limit::Limit;
use crate::scenario::Scenario;
use crate::shape::Difference;

/// The error is estimated by comparing with a solution whose local errors may
/// be larger by this factor.
const COARSER: f64 = 100.0;

/// Local error allowed per step of the integration, as a part of the accuracy
/// wanted, and its bounds: beyond them rounding rules, or step control loses
/// its ground.
const LOCAL_PART: f64 = 1e-4;
const LEAST_LOCAL: f64 = 1e-13;
const MOST_LOCAL: f64 = 1e-9;

/// Factor between attempts to reach the accuracy.
const SHARPER: f64 = 1e-2;

/// Solves the boundary-value problem of a scenario with an estimated error of
/// the positions below `accuracy` (relative to the longest rod), or as far as
/// double precision allows: see [`Solution::error`].
///
/// # Errors
/// If no solution is found: why, and how far it came.
pub fn solve_within(
    scenario: &Scenario,
    start: Start,
    accuracy: f64,
    intervals: Option<usize>,
    stations: &[f64],
) -> Result<Solution, Failure> {
    solve_before(
        scenario,
        start,
        accuracy,
        intervals,
        stations,
        &Limit::default(),
    )
}

/// As [`solve_within`], but Newton's method gives up at a limit.
///
/// # Errors
/// If no solution is found: why, and how far it came.
pub fn solve_before(
    scenario: &Scenario,
    start: Start,
    accuracy: f64,
    intervals: Option<usize>,
    stations: &[f64],
    limit: &Limit,
) -> Result<Solution, Failure> {
    let longest = scenario
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max);
    let mut asked = Options {
        tolerance: (LOCAL_PART * accuracy).clamp(LEAST_LOCAL, MOST_LOCAL),
        intervals,
        stations: stations.to_vec(),
    };
    let mut solution = solve_once(scenario, start, &asked, limit)?;
    while solution.error.position > accuracy * longest && asked.tolerance > LEAST_LOCAL {
        asked.tolerance = (SHARPER * asked.tolerance).max(LEAST_LOCAL);
        let from = Start::Leaf {
            stations,
            rods: &solution.rods,
        };
        let sharper = solve_once(scenario, from, &asked, limit)?;
        let mut work = solution.work;
        work.add(sharper.work);
        solution = Solution { work, ..sharper };
    }
    Ok(solution)
}

/// Solves the boundary-value problem of a scenario.
///
/// # Errors
/// If no solution is found: why, and how far it came.
pub fn solve(scenario: &Scenario, start: Start, options: &Options) -> Result<Solution, Failure> {
    solve_once(scenario, start, options, &Limit::default())
}

fn solve_once(
    scenario: &Scenario,
    start: Start,
    options: &Options,
    limit: &Limit,
) -> Result<Solution, Failure> {
    let mut equations = Equations::new(scenario);
    equations.limit = limit.clone();
    let mut work = Work::default();
    let found = match start {
        Start::Arcs => from_arcs(&mut equations, options.intervals, &mut work),
        Start::Leaf { stations, rods } => Ok(Trajectory::of_leaf(&equations, stations, rods)),
    };
    let failure = |equations: &Equations, end: Interrupted, work: Work| {
        let states = options.stations.iter().map(|&sigma| end.near.at(sigma));
        let near = Trajectory::new(equations, options.stations.clone(), states.collect());
        Failure {
            reason: end.reason,
            part: end.part,
            rods: near.shape(equations),
            work,
        }
    };
    let near = match found {
        Ok(near) => near,
        Err(end) => return Err(failure(&equations, end, work)),
    };
    let failed = |reason: Reason, near: Trajectory, work: Work| {
        let part = 1.0;
        failure(&equations, Interrupted { reason, part, near }, work)
    };
    let mut newton = match Newton::near(&equations, &near, options.intervals) {
        Ok(newton) => newton,
        Err(Unbounded { sigma }) => return Err(failed(Reason::Unbounded { sigma }, near, work)),
    };
    let settled = settle(&mut newton, options);
    work.add(newton.work);
    let (coarse, fine) = match settled {
        Ok(solutions) => solutions,
        Err(reason) => return Err(failed(reason, near, work)),
    };
    let (rods, tip) = (fine.shape(&equations), fine.tip());
    let energy = tip[tip.len() - 1] + equations.tip_potential(tip);
    // Steps that end at the same stations share their errors, which the
    // difference then does not show: it is not less than a local error.
    let difference = Difference::between(&coarse.shape(&equations), &rods);
    let (force, local) = (equations.force, options.tolerance);
    let error = Difference {
        position: difference.position + local * equations.length,
        rotation: difference.rotation + local,
        force: difference.force + local * newton.units.total_force() * force,
        moment: difference.moment
            + local * newton.units.largest_moment() * force * equations.length,
    };
    Ok(Solution {
        stations: options.stations.clone(),
        error,
        rods,
        energy: energy * equations.force * equations.length,
        defect: newton.defect,
        growth: newton.growth.iter().map(|growth| growth.log10()).sum(),
        condition: newton.condition(),
        neutral: newton.neutral(&options.stations),
        intervals: newton.nodes.sigma,
        work,
    })
}

/// Solves at two tolerances.
fn settle(newton: &mut Newton, options: &Options) -> Result<(Trajectory, Trajectory), Reason> {
    let mut at = |tolerance: f64| {
        let solved = newton.solve(tolerance);
        solved.map_err(|stuck| newton.reason(stuck))?;
        Trajectory::sampled(
            newton.equations,
            &newton.nodes,
            &options.stations,
            tolerance,
        )
        .map_err(|Unbounded { sigma }| Reason::Unbounded { sigma })
    };
    Ok((at(COARSER * options.tolerance)?, at(options.tolerance)?))
}
