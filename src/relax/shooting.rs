//! A boundary-value solution as the result of a relaxation.

use crate::bvp::{self, Reason, Solution, Start};
use crate::leaf::{Grid, Leaf};
use crate::relax::equilibrium::{Equilibrium, Model, Outcome, Work};
use crate::relax::grids::coarsest;
use crate::relax::index::index_near;
use crate::relax::options::{MAX_INTERVALS, Options, RelaxError};
use crate::scenario::Scenario;
use crate::shape::RodShape;
use crate::undulation::Undulation;
use glam::DVec3;
use std::time::Instant;

/// Segments between stations, at least.
const SEGMENTS: usize = 32;

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
pub fn relax(
    scenario: &Scenario,
    options: &Options,
    tolerance: f64,
) -> Result<Equilibrium, RelaxError> {
    if let Some(found) = options.segments {
        return Err(RelaxError::NoGrid { found });
    }
    check_intervals(options.intervals)?;
    let clock = Instant::now();
    let grid = station_grid(scenario);
    let longest = scenario
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max);
    let found = bvp::solve_before(
        scenario,
        Start::Arcs,
        tolerance,
        options.intervals,
        grid.sigma(),
        options.deadline,
    );
    let work = match &found {
        Ok(solution) => solution.work,
        Err(failure) => failure.work,
    };
    let mut result = match found {
        Ok(solution) => solved(scenario, &grid, solution, tolerance * longest),
        Err(failure) => lost(scenario, failure),
    };
    result.tolerance = tolerance;
    result.mode_shapes = options.mode_shapes;
    result.stations = grid.sigma().to_vec();
    result.curves = (result.rods.iter())
        .map(|rod| rod.nodes.iter().map(|node| node.position).collect())
        .collect();
    result.undulation = Undulation::at_stations(
        scenario,
        &result.stations,
        &result.rods,
        result.error_estimate,
    );
    result.work = Work {
        steps: work.iterations,
        factorizations: work.linearizations,
        force_evaluations: work.slopes,
        cg_iterations: 0,
    };
    result.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(result)
}

/// What a solution says.
fn solved(scenario: &Scenario, grid: &Grid, solution: Solution, wanted: f64) -> Equilibrium {
    let index = index_near(scenario, grid.clone(), &solution.rods);
    let (outcome, remark) = match index {
        _ if solution.error.position > wanted => (
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
    Equilibrium {
        outcome,
        remark: remark.or(solution.neutral.as_ref().map(|neutral| neutral.to_string())),
        intervals: Some(solution.intervals.len() - 1),
        residual: solution.defect,
        error_estimate: Some(solution.error.position),
        energy: solution.energy,
        negative_eigenvalues: index,
        ..blank(scenario, solution.rods)
    }
}

/// What a failure says: how far it came, and why not further.
fn lost(scenario: &Scenario, failure: bvp::Failure) -> Equilibrium {
    let outcome = match failure.reason {
        Reason::Singular(_) => Outcome::Singular,
        _ => Outcome::NotAtRest,
    };
    let way = match failure.part {
        part if part < 1.0 => format!(" (at {part:.4} of the way from arcs to this leaf)"),
        _ => String::new(),
    };
    Equilibrium {
        outcome,
        remark: Some(format!("{}{way}", failure.reason)),
        ..blank(scenario, failure.rods)
    }
}

fn blank(scenario: &Scenario, rods: Vec<RodShape>) -> Equilibrium {
    let tips: Vec<_> = rods.iter().filter_map(|rod| rod.nodes.last()).collect();
    let listed = if scenario.joined { 1 } else { tips.len() };
    Equilibrium {
        scenario: scenario.name.clone(),
        method: "shooting",
        outcome: Outcome::NotAtRest,
        remark: None,
        segments: Vec::new(),
        intervals: None,
        tolerance: f64::NAN,
        residual: f64::NAN,
        error_estimate: None,
        energy: f64::NAN,
        joined: scenario.joined,
        tips: tips.iter().take(listed).map(|node| node.position).collect(),
        tip_force_sum: tips
            .iter()
            .map(|node| node.rotation * node.n)
            .sum::<DVec3>(),
        negative_eigenvalues: None,
        modes: None,
        mode_shapes: false,
        saddle: None,
        model: Model {
            rods: scenario.rods.len(),
            ..Model::default()
        },
        work: Work::default(),
        wall_seconds: 0.0,
        stations: Vec::new(),
        rods,
        curves: Vec::new(),
        undulation: Undulation::default(),
    }
}
