//! A boundary-value solution as the result of a relaxation.

use crate::bvp::{self, Reason, Solution, Start};
use crate::leaf::{Grid, Leaf};
use crate::newton::Work;
use crate::relax::equilibrium::{Accuracy, Equilibrium, Model, Outcome, Shape, Stability};
use crate::relax::index::index_near;
use crate::relax::options::{MAX_INTERVALS, Options, RelaxError};
use crate::relax::segments::coarsest;
use crate::scenario::{Scenario, longest};
use crate::shape::RodShape;
use crate::undulation::Undulation;
use glam::DVec3;
use std::time::Instant;

/// Segments between stations, at least.
const SEGMENTS: usize = 32;

/// Tolerance to which a leaf is relaxed that shooting starts from: the coarsest
/// grids do, and Newton's method does the rest faster than finer ones.
pub const START: f64 = 1e-3;

/// The grid at whose nodes a boundary-value solution is given.
fn station_grid(scenario: &Scenario) -> Grid {
    let leaf = Leaf::new(scenario);
    let segments = coarsest(&leaf, SEGMENTS).max(leaf.kinks().len() + 1);
    Grid::new(segments, leaf.kinks())
}

/// Refuses a number of intervals that cannot be.
pub fn check_intervals(intervals: Option<usize>) -> Result<(), RelaxError> {
    match intervals {
        Some(found) if !(1..=MAX_INTERVALS).contains(&found) => {
            Err(RelaxError::Intervals { found })
        }
        _ => Ok(()),
    }
}

/// Solves the boundary-value problem from arcs.
pub fn from_arcs(
    scenario: &Scenario,
    options: &Options,
    intervals: Option<usize>,
    tolerance: f64,
) -> Result<Equilibrium, RelaxError> {
    check_intervals(intervals)?;
    Ok(shoot(scenario, options, intervals, tolerance, Start::Arcs))
}

/// Solves the boundary-value problem from a leaf that is roughly at `rest`; where
/// it is not, that is the result.
pub fn from_rest(
    scenario: &Scenario,
    options: &Options,
    intervals: Option<usize>,
    tolerance: f64,
    rest: Equilibrium,
) -> Result<Equilibrium, RelaxError> {
    if matches!(rest.outcome, Outcome::NotAtRest | Outcome::Diverged) {
        return Ok(Equilibrium {
            method: options.method,
            ..rest
        });
    }
    let start = Start::Leaf {
        stations: &rest.shape.stations,
        rods: &rest.shape.rods,
    };
    let mut found = shoot(scenario, options, intervals, tolerance, start);
    found.stability.saddle = rest.stability.saddle;
    found.work = rest.work + found.work;
    found.wall_seconds += rest.wall_seconds;
    Ok(found)
}

/// What shooting does, in the words of a relaxation: corrections are steps,
/// linearisations factorisations, evaluations of all slopes those of all forces.
impl From<bvp::Work> for Work {
    fn from(work: bvp::Work) -> Self {
        Work {
            steps: work.iterations,
            factorizations: work.linearizations,
            force_evaluations: work.slopes,
            cg_iterations: 0,
        }
    }
}

fn shoot(
    scenario: &Scenario,
    options: &Options,
    intervals: Option<usize>,
    tolerance: f64,
    start: Start,
) -> Equilibrium {
    let clock = Instant::now();
    let grid = station_grid(scenario);
    let asked = bvp::Options {
        intervals,
        limit: options.limit.clone(),
        ..bvp::Options::new(start, grid.sigma(), bvp::Precision::Error(tolerance))
    };
    let found = bvp::solve(scenario, &asked);
    let work = match &found {
        Ok(solution) => solution.work,
        Err(failure) => failure.work,
    };
    let accuracy = Accuracy {
        segments: Vec::new(),
        intervals: None,
        tolerance,
        residual: None,
        error_estimate: None,
    };
    let found = match found {
        Ok(solution) => solved(scenario, &grid, solution, accuracy),
        Err(failure) => lost(failure, accuracy),
    };
    let stations = grid.sigma().to_vec();
    let error = found.accuracy.error_estimate;
    let tips: Vec<_> = found
        .rods
        .iter()
        .filter_map(|rod| rod.nodes.last())
        .collect();
    let listed = if scenario.joined { 1 } else { tips.len() };
    let veins = found.rods.len();
    Equilibrium {
        scenario: scenario.name.clone(),
        method: options.method,
        outcome: found.outcome,
        remark: found.remark,
        rod_count: veins,
        accuracy: found.accuracy,
        energy: found.energy,
        tips: tips.iter().take(listed).map(|node| node.position).collect(),
        tip_force_sum: tips
            .iter()
            .map(|node| node.rotation * node.n)
            .sum::<DVec3>(),
        stability: Stability {
            negative_eigenvalues: found.index,
            mode_shapes: options.mode_shapes,
            ..Stability::default()
        },
        undulation: Undulation::at_stations(scenario, &stations, &found.rods, error),
        model: Model::new(veins, (veins, false), &[], [None; 2]),
        work: work.into(),
        wall_seconds: clock.elapsed().as_secs_f64(),
        shape: Shape {
            stations,
            joined: scenario.joined,
            curves: (found.rods.iter())
                .map(|rod| rod.nodes.iter().map(|node| node.position).collect())
                .collect(),
            rods: found.rods,
        },
    }
}

/// What a boundary-value solver found, solved or not.
struct Found {
    outcome: Outcome,
    remark: Option<String>,
    accuracy: Accuracy,
    energy: Option<f64>,
    index: Option<usize>,
    rods: Vec<RodShape>,
}

/// What a solution says.
fn solved(scenario: &Scenario, grid: &Grid, solution: Solution, asked: Accuracy) -> Found {
    let index = index_near(scenario, grid.clone(), &solution.rods);
    let (outcome, remark) = match index {
        _ if solution.error.position > asked.tolerance * longest(&scenario.rods) => (
            Outcome::ToleranceNotReached,
            Some("double precision does not carry more through this leaf: ask for a larger tolerance".into()),
        ),
        Some(1..) => (
            Outcome::Saddle,
            Some("shooting finds equilibria, stable or not: the method semi-implicit finds a stable one".into()),
        ),
        Some(0) => (Outcome::Converged, None),
        None => (
            Outcome::Converged,
            Some("the number of negative eigenvalues is not known: a dead moment has no energy, or the leaf is too fine to count them".into()),
        ),
    };
    Found {
        outcome,
        remark: remark.or(solution.neutral.as_ref().map(|neutral| neutral.to_string())),
        accuracy: Accuracy {
            intervals: Some(solution.intervals.len() - 1),
            residual: Some(solution.defect),
            error_estimate: Some(solution.error.position),
            ..asked
        },
        energy: Some(solution.energy),
        index,
        rods: solution.rods,
    }
}

/// What a failure says: how far it came, and why not further.
fn lost(failure: bvp::Failure, accuracy: Accuracy) -> Found {
    let way = match failure.part {
        part if part < 1.0 => format!(" (at {part:.4} of the way from arcs to this leaf)"),
        _ => String::new(),
    };
    Found {
        outcome: match failure.reason {
            Reason::Singular(_) => Outcome::Singular,
            _ => Outcome::NotAtRest,
        },
        remark: Some(format!("{}{way}", failure.reason)),
        accuracy,
        energy: None,
        index: None,
        rods: failure.rods,
    }
}
