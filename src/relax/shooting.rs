//! Shooting: a boundary-value solution as a result of the same type as a relaxation's.

use crate::leaf::{Grid, Leaf};
use crate::newton::SolverCounts;
use crate::relax::accuracy::StrainEffects;
use crate::relax::remark::EquilibriumRemark;
use crate::relax::request::{
    MAX_INTERVALS, Options, Progress, RelaxError, SemiImplicit, ShootingVariant,
};
use crate::relax::rest::relax_on_grids;
use crate::relax::result::forces::{BaseReactions, Reaction, Stresses};
use crate::relax::result::report::{RunEnd, neutral_directions};
use crate::relax::result::{
    Accuracy, BladeReport, Equilibrium, Model, Outcome, Shape, Stability, report,
};
use crate::relax::solve_on_grid::coarsest;
use crate::relax::stability::index_near;
use crate::rod::Wrench;
use crate::run::{Instant, RefusedOption, UnmodelledFeature};
use crate::scenario::{BaseSupport, Scenario, longest};
use crate::shape::{NodeState, RodShape, STATION_TOLERANCE, Undulation, equally_spaced};
use crate::shooting::{ShootingFailureReason, ShootingSolution, ShootingStart};
use crate::{memory, shooting};
use glam::DVec3;

/// Smallest number of segments between the stations of a solution by shooting.
const LEAST_STATION_SEGMENTS: usize = 32;

/// Tolerance of the relaxation that shooting starts from: the coarsest grids are enough, as
/// Newton's method converges from there faster than finer grids.
pub const START_TOLERANCE: f64 = 1e-3;

/// The grid whose nodes are the stations of a boundary-value solution.
fn station_grid(scenario: &Scenario) -> Grid {
    let leaf = Leaf::new(scenario);
    let segments = coarsest(&leaf, LEAST_STATION_SEGMENTS).max(leaf.kinks().len() + 1);
    Grid::new(segments, leaf.kinks())
}

/// The stations `own` and those that divide a vein into `parts` equal parts: the solution is
/// integrated to all of them, so that none is interpolated.
fn merge_requested_stations(own: &[f64], parts: Option<usize>) -> Vec<f64> {
    let requested = parts.map(equally_spaced).unwrap_or_default();
    let mut all = own.to_vec();
    let is_own = |at: &f64| {
        let next = own.partition_point(|station| at - station >= STATION_TOLERANCE);
        own.get(next)
            .is_some_and(|station| station - at < STATION_TOLERANCE)
    };
    all.extend(requested.iter().filter(|at| !is_own(at)));
    all.sort_by(f64::total_cmp);
    all
}

/// The rods at those of their `stations` that are in `own`, too.
fn rods_at_stations(own: &[f64], stations: &[f64], rods: &[RodShape]) -> Vec<RodShape> {
    let at_own = |rod: &RodShape| {
        let nodes = rod.nodes.iter().zip(stations);
        let nodes = nodes.filter(|(_, at)| own.binary_search_by(|o| o.total_cmp(at)).is_ok());
        RodShape {
            length: rod.length,
            nodes: nodes.map(|(node, _)| *node).collect(),
        }
    };
    rods.iter().map(at_own).collect()
}

fn curve(rod: &RodShape) -> Vec<DVec3> {
    rod.nodes.iter().map(|node| node.position).collect()
}

/// Refuses a number of intervals that is out of range or needs too much memory for this number
/// of `rods`; without a number the check is for one interval, the fewest that will be chosen.
pub fn check_intervals(rods: usize, intervals: Option<usize>) -> Result<(), RelaxError> {
    if let Some(found) = intervals.filter(|found| !(1..=MAX_INTERVALS).contains(found)) {
        let allowed = format!("allowed are 1 to {MAX_INTERVALS}");
        return Err(RefusedOption::new("intervals", found, allowed).into());
    }
    let intervals = intervals.unwrap_or(1);
    Ok(memory::check_shooting_memory(rods, intervals)?)
}

/// Brings a leaf to rest by shooting: from arcs, or from a relaxed leaf.
pub fn relax(
    scenario: &Scenario,
    options: &Options,
    tolerance: f64,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let ShootingVariant {
        intervals,
        from_relaxed_leaf: from_rest,
    } = options.method.shooting().unwrap_or(ShootingVariant {
        intervals: Some(1),
        from_relaxed_leaf: false,
    });
    check_intervals(scenario.rods.len(), intervals)?;
    if !from_rest && scenario.held_tip.is_some() {
        // Shooting from arcs has no continuation to a held tip.
        let why =
            "a tip that is held (tip.held) is led there by the relaxation; use shooting-from-rest";
        return Err(RefusedOption::new("method", options.method.word(), why).into());
    }
    shooting::check_models(scenario, from_rest).map_err(|missing| match missing {
        UnmodelledFeature::FromArcs { .. } => {
            RefusedOption::new("method", options.method.word(), missing.to_string()).into()
        }
        other => RelaxError::from(other),
    })?;
    let mut found = match from_rest {
        true => relax_from_rest(scenario, options, intervals, tolerance, progress)?,
        false => {
            let start = ShootingStart::Arcs;
            shoot(scenario, options, intervals, tolerance, start, progress)
        }
    };
    found.doubts = report::implausible_properties(scenario, &found);
    Ok(found)
}

/// Solves the boundary-value problem starting from a relaxed leaf; if that is not at rest it is
/// returned.
fn relax_from_rest(
    scenario: &Scenario,
    options: &Options,
    intervals: Option<usize>,
    tolerance: f64,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let relaxation = Options {
        method: SemiImplicit::default().into(),
        tolerance: Some(START_TOLERANCE),
        modes: 0,
        stations: None,
        ..options.clone()
    };
    let rest = relax_on_grids(scenario, &relaxation, true, progress)?.result;
    if !rest.outcome.is_at_rest() {
        return Ok(Equilibrium {
            method: options.method,
            ..rest
        });
    }
    let start = ShootingStart::Leaf {
        stations: &rest.shape.stations,
        rods: &rest.shape.rods,
    };
    let mut found = shoot(scenario, options, intervals, tolerance, start, progress);
    found.stability.saddle = rest.stability.saddle;
    if let (Some(motions), Some(remark)) = (rest.stability.small_motions, &mut found.remark) {
        remark.add_small_motions(&motions);
        found.stability.small_motions = Some(motions);
    }
    found.work = rest.work + found.work;
    found.wall_seconds += rest.wall_seconds;
    Ok(found)
}

/// The work of shooting in terms of a relaxation: Newton corrections count as steps,
/// linearizations as factorizations, evaluations of all slopes as force evaluations.
impl From<shooting::ShootingCounts> for SolverCounts {
    fn from(work: shooting::ShootingCounts) -> Self {
        SolverCounts {
            steps: work.iterations,
            factorizations: work.linearizations,
            force_evaluations: work.slopes,
            cg_iterations: 0,
        }
    }
}

/// Solves the boundary-value problem from a start.
fn shoot(
    scenario: &Scenario,
    options: &Options,
    intervals: Option<usize>,
    tolerance: f64,
    start: ShootingStart,
    progress: &mut dyn FnMut(&Progress),
) -> Equilibrium {
    let clock = Instant::now();
    let grid = station_grid(scenario);
    let own = grid.sigma().to_vec();
    let stations = merge_requested_stations(&own, options.stations);
    let shooting_options = shooting::ShootingOptions {
        intervals,
        limit: options.limit.clone(),
        ..shooting::ShootingOptions::new(
            start,
            &stations,
            shooting::RequiredPrecision::EstimatedError(tolerance),
        )
    };
    let found = shooting::solve(scenario, &shooting_options, &mut |step| {
        progress(&Progress::Shooting(*step))
    });
    let mut accuracy = Accuracy {
        segments: Vec::new(),
        intervals: None,
        tolerance,
        residual: None,
        error_estimate: None,
        energy_error: None,
    };
    let (mut energy, mut index, mut errors) = (None, None, None);
    let (end, work, rods) = match found {
        Ok(solution) => {
            accuracy.intervals = Some(solution.intervals.len() - 1);
            accuracy.residual = Some(solution.defect);
            accuracy.error_estimate = Some(solution.error.position);
            errors = Some(solution.error);
            let rods = rods_at_stations(&own, &stations, &solution.rods);
            if without_potential(scenario).is_none() {
                energy = Some(solution.energy);
                index = index_near(scenario, grid, &rods, solution.error.position);
            }
            let end = outcome_of_solution(scenario, &solution, index, tolerance);
            (end, solution.work, solution.rods)
        }
        Err(failure) => (outcome_of_failure(&failure), failure.work, failure.rods),
    };
    let tips: Vec<_> = rods.iter().filter_map(|rod| rod.nodes.last()).collect();
    let listed = if scenario.joined { 1 } else { tips.len() };
    let tip_force_sum = tips.iter().map(|node| node.rotation * node.n).sum();
    let on_bases = errors.map(|errors| {
        let bases = || rods.iter().map(|rod| &rod.nodes[0]);
        let places: Vec<DVec3> = bases().map(|base| base.position).collect();
        let carries_moment =
            |j: usize| scenario.base_held[j] != BaseSupport::Pinned || scenario.holds_base_spin(j);
        let held: Vec<bool> = (0..scenario.rods.len()).map(carries_moment).collect();
        let wrench = |(base, held): (&NodeState, &bool)| Wrench {
            force: base.rotation * base.n,
            moment: match held {
                true => base.rotation * base.m,
                false => DVec3::ZERO,
            },
        };
        let wrenches: Vec<Wrench> = bases().zip(&held).map(wrench).collect();
        BaseReactions::from_each(&places, &wrenches, &held, [errors.force, errors.moment])
    });
    let (base_reactions, base_reaction) = on_bases.map_or((Vec::new(), None), |on_bases| {
        (on_bases.each, Some(on_bases.all))
    });
    let rods_at_own = rods_at_stations(&own, &stations, &rods);
    Equilibrium {
        scenario: scenario.name.clone(),
        method: options.method,
        outcome: end.outcome,
        remark: end.remark,
        doubts: Vec::new(),
        rod_count: rods.len(),
        energy,
        tips: tips.iter().take(listed).map(|node| node.position).collect(),
        tip_force_sum,
        grip_reactions: Vec::new(),
        base_reactions,
        base_reaction,
        reaction: scenario.held_tip.as_ref().map(|held| Reaction {
            force: DVec3::from_array(scenario.tip_force) - tip_force_sum,
            // Every rod has its part of the error.
            error: errors.map(|error| error.force * rods.len() as f64),
            moments_error: errors
                .map(|error| error.moment)
                .filter(|_| held.clamps.is_some()),
            moments: (held.clamps.is_some())
                .then(|| tips.iter().map(|node| -(node.rotation * node.m)).collect()),
        }),
        stability: Stability {
            negative_eigenvalues: index,
            neutral_directions: neutral_directions(scenario, &rods),
            mode_shapes: options.mode_shapes,
            ..Stability::default()
        },
        path: None,
        sensitivities: None,
        margin: None,
        blade: BladeReport::of(scenario),
        stress: Stresses::of(scenario, &stations, &rods).map(|it| {
            it.with_field_errors(scenario, errors.map(|error| [error.force, error.moment]))
        }),
        undulation: Undulation::at_stations(scenario, &own, &rods_at_own, accuracy.error_estimate),
        accuracy,
        model: Model::new(rods.len(), rods.len(), false, &[], StrainEffects::default()),
        attempts: Vec::new(),
        work: work.into(),
        wall_seconds: clock.elapsed().as_secs_f64(),
        shape: Shape {
            stations,
            joined: scenario.joined,
            curves: rods_at_own.iter().map(curve).collect(),
            curve_stations: own,
            rods,
        },
    }
}

/// What is said of a leaf on which forces without a potential act: it has no energy and no index.
fn without_potential(scenario: &Scenario) -> Option<EquilibriumRemark> {
    let verdict = None;
    match scenario.wind {
        Some(_) => Some(EquilibriumRemark::WindWithoutPotential { verdict }),
        None => (scenario.has_followers())
            .then_some(EquilibriumRemark::FollowersWithoutPotential { verdict }),
    }
}

/// The end of a run in which shooting found a solution.
fn outcome_of_solution(
    scenario: &Scenario,
    solution: &ShootingSolution,
    index: Option<usize>,
    tolerance: f64,
) -> RunEnd {
    let end = match index {
        _ if solution.error.position > tolerance * longest(&scenario.rods) => RunEnd::new(
            Outcome::ToleranceNotReached,
            match &solution.unsharpened {
                Some(reason) => EquilibriumRemark::NotSharpened(reason.clone()),
                None => EquilibriumRemark::DoublePrecision,
            },
        ),
        Some(1..) => RunEnd::new(Outcome::Saddle, EquilibriumRemark::ShotSaddle),
        Some(0) => RunEnd::new(Outcome::Converged, None),
        None => RunEnd::new(
            Outcome::Converged,
            without_potential(scenario).unwrap_or(EquilibriumRemark::ShotIndexUnknown),
        ),
    };
    let neutral = || (solution.neutral.clone()).map(EquilibriumRemark::NeutralDirection);
    RunEnd::new(end.outcome, end.remark.or_else(neutral))
}

/// The outcome of a failure: how far the continuation came, and why it ended.
fn outcome_of_failure(failure: &shooting::ShootingFailure) -> RunEnd {
    let outcome = match failure.reason {
        ShootingFailureReason::Singular(_) => Outcome::Singular,
        ShootingFailureReason::OutOfTime => Outcome::OutOfTime,
        _ => Outcome::NotAtRest,
    };
    let remark = EquilibriumRemark::ShootingFailed {
        reason: failure.reason.clone(),
        part: failure.lambda,
    };
    RunEnd::new(outcome, remark)
}
