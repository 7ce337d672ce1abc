//! One cell of a map: the reference, and each method's answer with its verdict; and the jumps of the leaf
//! between neighboring cells.
//!
//! Explicit motion has one time step, stable or not: its answer is that of a plain simulation of the damped
//! leaf.
//!
//! Pairs of cells whose answers are farther apart than those of the neighboring pairs are
//! bisected: the leaf is relaxed at the midpoint, then at that of the half in which it moves
//! more. The displacement of a continuous branch decreases with bisection; a jump does not.

use crate::branch::value_at_fraction;
use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::motion::{Explicit, ExplicitRefusal, Physics, Stopped, TimeIntegrator};
use crate::numbers::{larger, largest};
use crate::relax::{
    Method, Options, Outcome, RelaxError, SemiImplicit, SolverCounts, index_near, initial_state,
    rod_shapes,
};
use crate::run::{Instant, Limit};
use crate::scenario::{Scenario, Tissue, longest};
use crate::shape::Undulation;
use crate::shooting::{ShootingFailureReason, ShootingStart};
use crate::simulate::request::DEFAULT_MOTION_SEGMENTS;
use crate::study::judge::{
    LEAST_EIGENVALUE_SEGMENTS, MethodSolution, SAME_LEAF_DISTANCE, Timed, eigenvalue_grid,
    morse_index_near, run_timed, single_grid_error, union_of_stations,
};
use crate::study::map::remark::{MapMotionFailure, MapRemark};
use crate::study::map::result::{
    CellSolution, CellVerdict, Map, MapJump, MapMethod, MapOutcome, MapRequest, MapRow,
    ReferenceConfidence,
};
use crate::study::remark::SolutionRemark;
use crate::study::vary::{SolverSettings, VariedScenario};
use crate::{relax, shooting};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// The tolerance of the reference is smaller than that of the answers by this factor, as far
/// as double precision allows.
const REFERENCE_TOLERANCE_RATIO: f64 = 1e-2;

const LEAST_REFERENCE_TOLERANCE: f64 = 1e-12;

/// The same factor where the reference is a relaxation on finer grids: of the leaf of nine veins in
/// scenarios/measured/blade.toml one to a tenth takes as long as the answer, and shooting thirty times as long.
const FINER_GRIDS_TOLERANCE_RATIO: f64 = 1e-1;

/// Lower bound on the seconds per node on any machine; two to four times as many are measured.
/// A grid is built and its solution started before the time limit is first checked.
const LEAST_SECONDS_PER_NODE: f64 = 3e-6;

/// Least segments a rod of a grid, or steps of shooting.
const LEAST_SEGMENTS_PER_ROD: usize = 4;

/// What is needed to solve a cell's leaf.
pub struct MapCell<'a> {
    scenario: &'a Scenario,
    solver_settings: SolverSettings,
    tolerance: f64,
    limit: Duration,
    /// Time limit for all cells.
    total_limit: &'a Limit,
    /// The default method's answer and its seconds: the start of shooting from rest.
    relaxed_answer: Timed<CellSolution>,
    reference: Option<MethodSolution>,
    confidence: ReferenceConfidence,
}

impl<'a> MapCell<'a> {
    /// Finds the reference: the relaxed leaf, and the solution of the boundary-value problem near it, or, where
    /// the forces of tissue are unknowns as well, the leaf relaxed on finer grids.
    pub fn new(
        varied: &'a VariedScenario,
        tolerance: Option<f64>,
        limit: Duration,
        all: &'a Limit,
    ) -> Self {
        let scenario = &varied.scenario;
        let tolerance = tolerance.unwrap_or(scenario.tolerance);
        let rods = scenario.rods.len();
        let relaxed = refuse_slow_grid(LEAST_SEGMENTS_PER_ROD, rods, limit).unwrap_or_else(|| {
            run_within_limit(limit, all, |limit| {
                relax_with_error_estimate(
                    scenario,
                    SemiImplicit::default().into(),
                    tolerance,
                    limit,
                )
            })
        });
        let mut cell = MapCell {
            scenario,
            solver_settings: varied.solver_settings,
            tolerance,
            limit,
            total_limit: all,
            relaxed_answer: relaxed,
            reference: None,
            confidence: ReferenceConfidence::None,
        };
        let mut tissue = scenario.tissue.iter().flatten();
        let on_finer_grids = tissue.any(Tissue::has_unknown_forces);
        let (ratio, confidence) = match on_finer_grids {
            true => (FINER_GRIDS_TOLERANCE_RATIO, ReferenceConfidence::FinerGrids),
            false => (REFERENCE_TOLERANCE_RATIO, ReferenceConfidence::Confirmed),
        };
        let sharp = (ratio * tolerance).max(LEAST_REFERENCE_TOLERANCE);
        if let Ok(relaxed) = &cell.relaxed_answer.result {
            let second = run_within_limit(limit, all, |limit| match on_finer_grids {
                true => relax_with_error_estimate(
                    scenario,
                    SemiImplicit::default().into(),
                    sharp,
                    limit,
                ),
                false => cell.shoot_from_relaxed_leaf(sharp, limit),
            });
            let chosen = choose_reference(relaxed, second.result.ok(), confidence);
            (cell.confidence, cell.reference) = (chosen.confidence, Some(chosen.solution));
        }
        cell
    }

    /// Solves by a method and judges the answer.
    pub fn solve_by_method(&self, cell: usize, method: MapMethod) -> MapRow {
        let Timed {
            result: found,
            seconds,
        } = self.timed_solution(method);
        let blank = MapRow {
            seconds,
            cell,
            method,
            reference: self.confidence,
            ..MapRow::default()
        };
        let answer = match found {
            Ok(answer) => answer,
            Err(CellVerdict { outcome, remark }) => {
                return MapRow {
                    outcome,
                    remark: remark.map(|it| *it),
                    ..blank
                };
            }
        };
        let length = longest(&self.scenario.rods);
        let reference = self.reference.as_ref();
        let distance = reference.and_then(|it| it.largest_distance(&answer));
        let CellVerdict { outcome, remark } = self.judge_solution(&answer, distance);
        let margin = answer.undulation.margin();
        let tip = answer.rods.first().and_then(|rod| rod.nodes.last());
        MapRow {
            outcome,
            remark: remark.map(|it| *it),
            index: answer.index,
            tip_x: tip.map(|node| node.position.x),
            tip_y: tip.map(|node| node.position.y),
            tip_z: tip.map(|node| node.position.z),
            energy: Some(answer.energy),
            margin_waves: margin.map(|vein| vein.waves()),
            margin_amplitude: margin.map(|vein| vein.amplitude / length),
            twist: Some(answer.undulation.twist()),
            error: distance.map(|distance| distance / length),
            error_estimate: Some(answer.error_bound() / length),
            ..blank
        }
    }

    fn timed_solution(&self, method: MapMethod) -> Timed<CellSolution> {
        let segments = self.solver_settings.segments;
        let (scenario, tolerance) = (self.scenario, self.tolerance);
        let is_relaxed = |method: Method| method.semi_implicit().is_some() && segments.is_none();
        if matches!(method, MapMethod::ToRest(method) if is_relaxed(method)) {
            return self.relaxed_answer.clone();
        }
        let on_grid = match method {
            MapMethod::ExplicitMotion => true,
            MapMethod::ToRest(method) => !method.is_shooting(),
        };
        let segments_at_least = segments
            .filter(|_| on_grid)
            .unwrap_or(LEAST_SEGMENTS_PER_ROD);
        if let Some(late) = refuse_slow_grid(segments_at_least, scenario.rods.len(), self.limit) {
            return late;
        }
        run_within_limit(self.limit, self.total_limit, |limit| match method {
            MapMethod::ExplicitMotion => {
                solve_by_explicit_motion(scenario, self.solver_settings, tolerance, limit)
            }
            MapMethod::ToRest(method) => match method.shooting() {
                None => {
                    relax_with_error_estimate(scenario, method.on_grid(segments), tolerance, limit)
                }
                Some(how) if how.from_relaxed_leaf => {
                    self.shoot_from_relaxed_leaf(tolerance, limit)
                }
                Some(how) => {
                    self.solve_by_shooting(ShootingStart::Arcs, tolerance, how.intervals, limit)
                }
            },
        })
    }

    fn solve_by_shooting(
        &self,
        start: ShootingStart,
        accuracy: f64,
        intervals: Option<usize>,
        limit: &Limit,
    ) -> CellSolution {
        let segments = match &self.relaxed_answer.result {
            Ok(relaxed) => relaxed.stations.len() - 1,
            Err(_) => LEAST_EIGENVALUE_SEGMENTS,
        };
        let grid = eigenvalue_grid(self.scenario, segments);
        let others = reference_stations(self.scenario, self.solver_settings);
        let stations = union_of_stations([grid.sigma(), &others].concat());
        let options = shooting::ShootingOptions {
            intervals,
            limit: limit.clone(),
            ..shooting::ShootingOptions::new(
                start,
                &stations,
                shooting::RequiredPrecision::EstimatedError(accuracy),
            )
        };
        let solved = shooting::solve(self.scenario, &options, &mut |_| {});
        let solution = solved.map_err(|failure| {
            let outcome = match failure.reason {
                ShootingFailureReason::Unbounded { .. } => MapOutcome::Diverged,
                ShootingFailureReason::TooMuchMemory(_) | ShootingFailureReason::Unmodelled(_) => {
                    MapOutcome::Refused
                }
                ShootingFailureReason::OutOfTime => MapOutcome::OutOfTime,
                _ => MapOutcome::NotConverged,
            };
            let remark = MapRemark::ShootingFailed {
                reason: failure.reason,
                part: failure.lambda,
            };
            CellVerdict::new(outcome, remark)
        })?;
        let remark = SolutionRemark::Shot {
            intervals: solution.intervals.len() - 1,
            growth: solution.growth,
            neutral: solution.neutral.clone(),
        };
        let answer = MethodSolution::from_shooting(self.scenario, solution, accuracy);
        if !answer.outcome.is_success() {
            let error = answer.error_bound();
            let known = MapRemark::Inaccurate { error };
            return Err(CellVerdict::new(MapOutcome::NotConverged, known));
        }
        Ok(MethodSolution {
            index: morse_index_near(
                self.scenario,
                grid,
                &answer.stations,
                &answer.rods,
                answer.error_bound(),
            ),
            remark: Some(remark),
            ..answer
        })
    }

    fn shoot_from_relaxed_leaf(&self, accuracy: f64, limit: &Limit) -> CellSolution {
        match &self.relaxed_answer.result {
            Ok(relaxed) => self.solve_by_shooting(relaxed.shooting_start(), accuracy, None, limit),
            Err(CellVerdict { outcome, remark }) => {
                let why = remark.clone();
                Err(CellVerdict::new(*outcome, MapRemark::NoStart { why }))
            }
        }
    }

    /// The verdict on an answer at this distance from the reference.
    fn judge_solution(&self, answer: &MethodSolution, distance: Option<f64>) -> CellVerdict {
        let remark = answer.remark.clone();
        if let Some(index @ 1..) = answer.index {
            let saddle = MapRemark::Saddle { index, remark };
            return CellVerdict::new(MapOutcome::Saddle, saddle);
        }
        let (Some(reference), Some(distance)) = (&self.reference, distance) else {
            return CellVerdict::new(MapOutcome::Right, MapRemark::Uncompared { remark });
        };
        if answer.agrees_within_errors(reference, distance) {
            return CellVerdict::new(MapOutcome::Right, remark.map(MapRemark::Solution));
        }
        let elsewhere = MapRemark::Elsewhere {
            distance: distance / longest(&self.scenario.rods),
            energy: answer.energy - reference.energy,
            remark,
        };
        let outcome = match self.is_other_equilibrium(answer, reference, distance) {
            true => MapOutcome::OtherEquilibrium,
            false => MapOutcome::Inaccurate,
        };
        CellVerdict::new(outcome, elsewhere)
    }

    /// Whether the equilibrium near an answer is another than the reference.
    fn is_other_equilibrium(
        &self,
        answer: &MethodSolution,
        reference: &MethodSolution,
        distance: f64,
    ) -> bool {
        let near = run_within_limit(self.limit, self.total_limit, |limit| {
            self.solve_by_shooting(answer.shooting_start(), self.tolerance, None, limit)
        });
        match near.result {
            Ok(near) if near.largest_distance(answer) < Some(distance) => {
                near.largest_distance(reference) > Some(0.5 * distance)
            }
            _ => distance > SAME_LEAF_DISTANCE * longest(&self.scenario.rods),
        }
    }
}

/// The outcome on a grid that takes longer than the limit in any case.
fn refuse_slow_grid(segments: usize, rods: usize, limit: Duration) -> Option<Timed<CellSolution>> {
    let (nodes, seconds) = (segments.saturating_mul(rods), limit.as_secs_f64());
    let late = nodes as f64 * LEAST_SECONDS_PER_NODE > seconds;
    let why = MapRemark::TooManyNodes { nodes, seconds };
    late.then_some(Timed {
        result: Err(CellVerdict::new(MapOutcome::OutOfTime, why)),
        seconds: 0.0,
    })
}

/// Runs a method with a time limit; also returns the seconds it took.
/// A run that exceeds the limit counts as out of time, whatever its result.
fn run_within_limit(
    limit: Duration,
    all: &Limit,
    run: impl FnOnce(&Limit) -> CellSolution,
) -> Timed<CellSolution> {
    let until = Limit {
        deadline: Some(Instant::now() + limit),
        ..all.clone()
    };
    let mut found = run_timed(|| run(&until));
    let allowed = limit.as_secs_f64();
    if found.seconds > allowed {
        let late = MapRemark::OutOfTime { seconds: allowed };
        found.result = Err(CellVerdict::new(MapOutcome::OutOfTime, late));
    }
    found
}

/// Relaxes, perhaps on one grid. That has no error estimate of its own: a finer grid gives one.
pub fn relax_with_error_estimate(
    scenario: &Scenario,
    method: Method,
    tolerance: f64,
    limit: &Limit,
) -> CellSolution {
    let options = Options {
        method,
        tolerance: Some(tolerance),
        limit: limit.clone(),
        ..Options::default()
    };
    let leaf = relax::relax(scenario, &options, &mut |_| {});
    let leaf = leaf.map_err(|refused| {
        let refused = MapRemark::Refused(refused.to_string());
        CellVerdict::new(MapOutcome::Refused, refused)
    })?;
    let saddle = leaf.stability.saddle;
    let saddle = saddle.map(|saddle| saddle.negative_eigenvalues);
    let mut answer = MethodSolution::from(leaf);
    if !answer.outcome.is_success() {
        let outcome = match answer.outcome {
            Outcome::Diverged => MapOutcome::Diverged,
            _ => MapOutcome::NotConverged,
        };
        return Err(CellVerdict::new(
            outcome,
            answer.remark.map(MapRemark::Solution),
        ));
    }
    if answer.error_estimate.is_none() {
        let segments = method.segments();
        let error = segments.and_then(|n| single_grid_error(scenario, n, tolerance, limit));
        let Some(error) = error else {
            return Err(CellVerdict::new(
                MapOutcome::NotConverged,
                MapRemark::UnknownError,
            ));
        };
        answer.error_estimate = Some(error + tolerance);
    }
    if let Some(index) = saddle {
        answer.remark = Some(SolutionRemark::LeftSaddle { index });
    }
    Ok(answer)
}

/// The solution against which the answers in a cell are judged.
struct CellReference {
    confidence: ReferenceConfidence,
    solution: MethodSolution,
}

/// The reference, from a relaxed leaf and, if found, a second, sharper solution. If they agree, also in their
/// numbers of negative eigenvalues, it is the second one, with this confidence; if not, only if that is stable.
fn choose_reference(
    relaxed: &MethodSolution,
    second: Option<MethodSolution>,
    confidence: ReferenceConfidence,
) -> CellReference {
    let unconfirmed = |solution: MethodSolution| CellReference {
        confidence: ReferenceConfidence::Unconfirmed,
        solution,
    };
    let Some(second) = second else {
        return unconfirmed(relaxed.clone());
    };
    let distance = relaxed.largest_distance(&second);
    let same = distance.is_some_and(|distance| relaxed.agrees_within_errors(&second, distance));
    match (same && second.index == relaxed.index, second.index) {
        (true, _) => CellReference {
            confidence,
            solution: second,
        },
        (false, Some(0)) => unconfirmed(second),
        (false, _) => unconfirmed(relaxed.clone()),
    }
}

/// Largest number of stations at which answers are compared.
const MOST_COMPARED_STATIONS: usize = 4096;

/// Steps between checks of the time limit.
const STEPS_PER_TIME_CHECK: f64 = 1000.0;

/// Moves the leaf, released from the initial state of a relaxation, for the scenario's
/// duration under the loads of its dynamics, in steps of `method.step`.
pub fn solve_by_explicit_motion(
    scenario: &Scenario,
    knobs: SolverSettings,
    tolerance: f64,
    limit: &Limit,
) -> CellSolution {
    let refused = |why: MapRemark| Err(CellVerdict::new(MapOutcome::Refused, why));
    let Some(step) = knobs.step else {
        return refused(MapRemark::NoTimeStep);
    };
    let leaf = Leaf::new(scenario);
    let grid = match motion_grid(&leaf, knobs) {
        Ok(grid) => grid,
        Err(error) => return refused(MapRemark::Refused(error.to_string())),
    };
    let physics = Physics::new(&leaf);
    if !physics.clamped() {
        return refused(MapRemark::FreeLeaf);
    }
    let discrete = DiscreteLeaf::new(&leaf, grid.clone());
    let state = initial_state(&discrete);
    let h = step / physics.time_unit;
    let mut motion = match Explicit::new(discrete, physics.clone(), &state, Some(h)) {
        Ok(motion) => motion,
        Err(ExplicitRefusal::RigidRod) => return refused(MapRemark::RigidRods),
        Err(ExplicitRefusal::MassOffAxis) => return refused(MapRemark::MassesOffAxis),
    };
    let stable = motion.stable_step();
    let stepped = SolutionRemark::Stepped {
        step,
        stable: stable.step * physics.time_unit,
        limit: stable.limit,
    };
    let failed = |outcome, motion: MapMotionFailure| {
        let step = stepped.clone();
        Err(CellVerdict::new(
            outcome,
            MapRemark::MotionFailed { motion, step },
        ))
    };
    let duration = physics.times().duration;
    while motion.time() < duration {
        let until = motion.time() + STEPS_PER_TIME_CHECK * h;
        if let Err(stopped) = motion.advance(until.min(duration)) {
            let (Stopped::Unresolved { time, .. }
            | Stopped::HalfTurn { time, .. }
            | Stopped::Diverged { time, .. }
            | Stopped::StepTooShort { time, .. }
            | Stopped::Interrupted { time }) = stopped;
            let time = time * physics.time_unit;
            return match stopped {
                Stopped::Unresolved { turn, .. } => failed(
                    MapOutcome::NotConverged,
                    MapMotionFailure::Unresolved { time, turn },
                ),
                Stopped::HalfTurn {
                    half_turn: place, ..
                } => failed(
                    MapOutcome::NotConverged,
                    MapMotionFailure::HalfTurn { time, place },
                ),
                _ => failed(MapOutcome::Diverged, MapMotionFailure::Unstable { time }),
            };
        }
        if limit.reached() {
            // Past the limit it counts as out of time, whatever is returned here.
            return failed(MapOutcome::OutOfTime, MapMotionFailure::OutOfTime);
        }
    }
    let end = motion.snapshot();
    let speeds = end
        .velocity
        .iter()
        .map(|v| [v.linear, v.angular].map(DVec3::length));
    let fastest = largest(speeds.flatten());
    if fastest > tolerance {
        let moves = MapMotionFailure::StillMoving { speed: fastest };
        return failed(MapOutcome::NotConverged, moves);
    }
    let rods = rod_shapes(&DiscreteLeaf::new(&leaf, grid.clone()), &end.state);
    let index = index_near(
        scenario,
        grid.clone(),
        &rods,
        SAME_LEAF_DISTANCE * leaf.scale.length,
    );
    if index.is_none() && !leaf.loads.has_moments() {
        return failed(MapOutcome::NotConverged, MapMotionFailure::NotAtRest);
    }
    let length = leaf.scale.length;
    let error = single_grid_error(scenario, grid.segments(), tolerance, limit);
    let estimate = error.unwrap_or(SAME_LEAF_DISTANCE * length) + tolerance * length;
    Ok(MethodSolution {
        outcome: Outcome::Converged,
        remark: Some(stepped),
        undulation: Undulation::at_stations(scenario, grid.sigma(), &rods, Some(estimate)),
        stations: grid.sigma().to_vec(),
        rods,
        energy: (end.energy.elastic + end.energy.coupling + end.energy.potential)
            * leaf.scale.moment(),
        index,
        error_estimate: Some(estimate),
        work: SolverCounts::default(),
    })
}

/// The grid, of as many segments as are set or needed.
fn motion_grid(leaf: &Leaf, knobs: SolverSettings) -> Result<Grid, RelaxError> {
    let segments = relax::check_segments(leaf, knobs.segments, DEFAULT_MOTION_SEGMENTS)?;
    Ok(Grid::new(segments, leaf.kinks()))
}

/// The longest step known to be stable.
pub fn longest_stable_step(varied: &VariedScenario) -> Option<f64> {
    let leaf = Leaf::new(&varied.scenario);
    let grid = motion_grid(&leaf, varied.solver_settings).ok()?;
    let physics = Physics::new(&leaf);
    let discrete = DiscreteLeaf::new(&leaf, grid);
    let state = initial_state(&discrete);
    let time = physics.time_unit;
    let motion = Explicit::new(discrete, physics, &state, Some(1.0)).ok()?;
    Some(motion.stable_step().step * time)
}

/// Additional stations that a reference should have.
pub fn reference_stations(scenario: &Scenario, knobs: SolverSettings) -> Vec<f64> {
    let leaf = Leaf::new(scenario);
    match relax::check_segments(&leaf, knobs.segments, DEFAULT_MOTION_SEGMENTS) {
        Ok(segments) if knobs.segments.is_some() => {
            let grid = eigenvalue_grid(scenario, segments);
            let every = grid.segments().div_ceil(MOST_COMPARED_STATIONS);
            let some = grid.sigma().iter().copied().step_by(every);
            some.chain([1.0]).collect()
        }
        _ => vec![0.0, 1.0],
    }
}

/// The search for jumps between neighbouring cells.
struct JumpSearch {
    /// Leaves closer than this, in lengths, count as the same.
    same_leaf: f64,
    /// A pair is examined if its tips, or its twists, are farther apart than those of a
    /// neighbouring pair by this factor.
    suspicious_ratio: f64,
    /// At the midpoint, a leaf on a continuous branch is nearer to the mean of both ends than this
    /// part of their distance.
    continuous_part: f64,
    /// Number of bisections: near a fold or a branch point a leaf moves as the square root of the
    /// distance from it, here a sixty-fourth.
    bisections: usize,
}

const JUMP_SEARCH: JumpSearch = JumpSearch {
    same_leaf: 0.01,
    suspicious_ratio: 1.5,
    continuous_part: 0.1,
    bisections: 12,
};

/// Two neighbouring cells along an axis.
struct NeighbouringCells {
    axis: usize,
    cells: [usize; 2],
}

impl Map {
    /// Searches for jumps of the leaf to another equilibrium between neighbouring cells, by the
    /// default method, and stores them in `jumps`.
    /// `progress` is called with the number of pairs examined and their total number.
    pub fn find_jumps(&mut self, progress: &(dyn Fn(usize, usize) + Sync)) {
        self.jumps = Some(locate_jumps(&self.request, &self.rows, progress));
    }
}

fn locate_jumps(
    request: &MapRequest,
    rows: &[MapRow],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Vec<MapJump> {
    let method = MapMethod::default();
    let mut known: Vec<Option<&MapRow>> = vec![None; request.cells()];
    let at_rest = |row: &&MapRow| row.method == method && row.tip_x.is_some();
    for row in rows.iter().filter(at_rest) {
        known[row.cell] = Some(row);
    }
    let pairs: Vec<NeighbouringCells> = neighbouring_cell_pairs(request)
        .filter(|pair| may_jump(request, &known, pair))
        .collect();
    let done = AtomicUsize::new(0);
    let found = pairs.par_iter().map(|pair| {
        let found = locate_jump(request, pair);
        progress(1 + done.fetch_add(1, Ordering::Relaxed), pairs.len());
        found
    });
    found.flatten().collect()
}

fn neighbouring_cell_pairs(request: &MapRequest) -> impl Iterator<Item = NeighbouringCells> {
    (0..request.cells()).flat_map(move |cell| {
        (0..request.axes.len()).filter_map(move |axis| {
            let next = neighbouring_cell(request, cell, axis, 1)?;
            let cells = [cell, next];
            Some(NeighbouringCells { axis, cells })
        })
    })
}

/// The cell at a signed offset along an axis.
fn neighbouring_cell(
    request: &MapRequest,
    cell: usize,
    axis: usize,
    offset: isize,
) -> Option<usize> {
    let later = request.axes.iter().skip(axis + 1);
    let stride: usize = later.map(|axis| axis.values.len()).product();
    let at = request.cell_position(cell)[axis].checked_add_signed(offset)?;
    let there = at < request.axes[axis].values.len();
    there.then(|| cell.wrapping_add_signed(offset * stride as isize))
}

/// Whether the leaf may jump between two cells, by comparison with neighbouring rows. If
/// its tip is held, only its shape can show it.
fn may_jump(request: &MapRequest, known: &[Option<&MapRow>], pair: &NeighbouringCells) -> bool {
    let [a, b] = pair.cells;
    let distances = |a: usize, b: usize| Some(tip_and_twist_distances(known[a]?, known[b]?));
    let Some(own) = distances(a, b) else {
        return false;
    };
    let scenario = request.base.scenario();
    if scenario.held_tip.is_some() {
        return true;
    }
    let before =
        neighbouring_cell(request, a, pair.axis, -1).and_then(|before| distances(before, a));
    let after = neighbouring_cell(request, b, pair.axis, 1).and_then(|after| distances(b, after));
    let units = [longest(&scenario.rods), 1.0];
    (0..2).any(|k| {
        let others = [before, after].into_iter().flatten().map(|it| it[k]);
        let least = others.fold(f64::INFINITY, f64::min);
        own[k] > JUMP_SEARCH.same_leaf * units[k]
            && (!least.is_finite() || own[k] > JUMP_SEARCH.suspicious_ratio * least)
    })
}

/// Distances of the tips and of the twists.
fn tip_and_twist_distances(a: &MapRow, b: &MapRow) -> [f64; 2] {
    let difference = |of: fn(&MapRow) -> Option<f64>| of(a).zip(of(b)).map_or(0.0, |(a, b)| a - b);
    let tip = [difference(|row| row.tip_x), difference(|row| row.tip_y)];
    let tip = tip[0].hypot(tip[1]).hypot(difference(|row| row.tip_z));
    [tip, difference(|row| row.twist).abs()]
}

/// The jump between two cells, if there certainly is one.
fn locate_jump(request: &MapRequest, pair: &NeighbouringCells) -> Option<MapJump> {
    let axis = &request.axes[pair.axis];
    let ends = pair.cells.map(|cell| request.values(cell)[pair.axis].1);
    let value = |part: f64| value_at_fraction(ends, axis.log, part);
    let at = |part: f64| relax_between_cells(request, pair, value(part));
    let length = longest(&request.base.scenario().rods);
    let [mut low, mut high] = [(0.0, at(0.0)?), (1.0, at(1.0)?)];
    let mut distance = low.1.largest_distance(&high.1)?;
    for half in 0..JUMP_SEARCH.bisections {
        if distance < JUMP_SEARCH.same_leaf * length {
            return None;
        }
        let part = 0.5 * (low.0 + high.0);
        let middle = at(part)?;
        if half == 0
            && distance_from_mean(&low.1, &middle, &high.1)?
                < JUMP_SEARCH.continuous_part * distance
        {
            return None;
        }
        let [below, above] = [
            low.1.largest_distance(&middle)?,
            middle.largest_distance(&high.1)?,
        ];
        match below > above {
            true => (high, distance) = ((part, middle), below),
            false => (low, distance) = ((part, middle), above),
        }
    }
    (distance >= JUMP_SEARCH.same_leaf * length).then(|| MapJump {
        key: axis.keys.to_string(),
        from: request.texts(pair.cells[0]),
        to: request.texts(pair.cells[1]),
        between: [value(low.0), value(high.0)],
        distance,
    })
}

/// The relaxed leaf at another value along the axis of a pair.
fn relax_between_cells(
    request: &MapRequest,
    pair: &NeighbouringCells,
    value: f64,
) -> Option<MethodSolution> {
    let mut values = request.values(pair.cells[0]);
    values[pair.axis].1 = value;
    let varied = request.base.scenario_with_values(&values).ok()?;
    let limit = Limit {
        deadline: Some(Instant::now() + Duration::from_secs_f64(request.cell_seconds)),
        ..request.limit.clone()
    };
    let method = SemiImplicit::on_grid(varied.solver_settings.segments).into();
    let tolerance = request.tolerance.unwrap_or(varied.scenario.tolerance);
    relax_with_error_estimate(&varied.scenario, method, tolerance, &limit).ok()
}

/// Largest distance of a leaf from the mean of two others.
fn distance_from_mean(
    low: &MethodSolution,
    middle: &MethodSolution,
    high: &MethodSolution,
) -> Option<f64> {
    let common = |sigma: f64, of: &MethodSolution| of.stations.iter().position(|it| *it == sigma);
    let mut most: f64 = 0.0;
    for (i, &sigma) in middle.stations.iter().enumerate() {
        let (Some(a), Some(b)) = (common(sigma, low), common(sigma, high)) else {
            continue;
        };
        for ((low, middle), high) in low.rods.iter().zip(&middle.rods).zip(&high.rods) {
            let between = 0.5 * (low.nodes[a].position + high.nodes[b].position);
            most = larger(most, (middle.nodes[i].position - between).length());
        }
    }
    most.is_finite().then_some(most)
}
