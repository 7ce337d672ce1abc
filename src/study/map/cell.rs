//! One cell: the reference, and each method's answer with its verdict.
//!
//! Explicit motion with one time step, stable or not: the answer of a plain simulation
//! of the damped leaf.
//!
//! Jumps: neighbouring cells in which the leaf rests in different equilibria.
//!
//! Pairs of cells whose answers are farther apart than those of the neighbouring pairs are
//! bisected: the leaf is relaxed at the midpoint, then at that of the half in which it moves
//! more. The displacement of a continuous branch decreases with bisection; a jump does not.

use crate::branch::value_between;
use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::motion::{Explicit, Physics, Stopped, TimeIntegrator};
use crate::numbers::{larger, largest};
use crate::relax::{Method, Options, Outcome, RelaxError, Work, index_near, shape_of, start};
use crate::run::{Instant, Limit};
use crate::scenario::{Scenario, longest};
use crate::shape::Undulation;
use crate::shooting::{Reason, Start};
use crate::study::judge::{
    Answer, SAME_LEAF, SEGMENTS, fine_grid, grid_error, index_at, timed, union,
};
use crate::study::map::{Confidence, Found, Map, MapMethod, MapOutcome, MapRequest, MapRow};
use crate::study::vary::{Knobs, Varied};
use crate::{relax, shooting};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// The tolerance of the reference is smaller than that of the answers by this factor, as far
/// as double precision allows.
const SHARPER: f64 = 1e-2;

const SHARPEST: f64 = 1e-12;

/// Lower bound on the seconds per node on any machine; two to four times as many are measured.
/// A grid is built and its solution started before the time limit is first checked.
const LEAST_SECONDS: f64 = 3e-6;

/// Least segments a rod of a grid, or steps of shooting.
const LEAST_SEGMENTS: usize = 4;

/// What is needed to solve a cell's leaf.
pub struct Cell<'a> {
    scenario: &'a Scenario,
    knobs: Knobs,
    tolerance: f64,
    limit: Duration,
    /// Time limit for all cells.
    all: &'a Limit,
    /// The default method's answer and its seconds: the start of shooting from rest.
    relaxed: (Found, f64),
    reference: Option<Answer>,
    confidence: Confidence,
}

impl<'a> Cell<'a> {
    /// Finds the reference: the relaxed leaf, and the solution of the
    /// boundary-value problem near it.
    pub fn new(
        varied: &'a Varied,
        tolerance: Option<f64>,
        limit: Duration,
        all: &'a Limit,
    ) -> Self {
        let scenario = &varied.scenario;
        let tolerance = tolerance.unwrap_or(scenario.tolerance);
        let rods = scenario.rods.len();
        let relaxed = too_many(LEAST_SEGMENTS, rods, limit).unwrap_or_else(|| {
            within(limit, all, |limit| {
                relaxed(scenario, Method::default(), tolerance, limit)
            })
        });
        let mut cell = Cell {
            scenario,
            knobs: varied.knobs,
            tolerance,
            limit,
            all,
            relaxed,
            reference: None,
            confidence: Confidence::None,
        };
        let sharp = (SHARPER * tolerance).max(SHARPEST);
        let (shot, _) = within(limit, all, |limit| cell.shoot_from_rest(sharp, limit));
        if let Ok(relaxed) = &cell.relaxed.0 {
            let (confidence, reference) = confirm(relaxed, shot.ok());
            (cell.confidence, cell.reference) = (confidence, Some(reference));
        }
        cell
    }

    /// Solves by a method and judges the answer.
    pub fn row(&self, cell: usize, method: MapMethod) -> MapRow {
        let (found, seconds) = self.answer(method);
        let blank = MapRow {
            seconds,
            cell,
            method,
            reference: self.confidence,
            ..MapRow::default()
        };
        let answer = match found {
            Ok(answer) => answer,
            Err((outcome, detail)) => {
                return MapRow {
                    outcome,
                    detail: one_line(&detail),
                    ..blank
                };
            }
        };
        let length = longest(&self.scenario.rods);
        let reference = self.reference.as_ref();
        let distance = reference.and_then(|it| it.distance(&answer));
        let (outcome, detail) = self.judge(&answer, distance);
        let margin = answer.undulation.margin();
        let tip = answer.rods.first().and_then(|rod| rod.nodes.last());
        MapRow {
            outcome,
            detail: one_line(&detail),
            index: answer.index,
            tip_x: tip.map(|node| node.position.x),
            tip_y: tip.map(|node| node.position.y),
            tip_z: tip.map(|node| node.position.z),
            energy: Some(answer.energy),
            margin_waves: margin.map(|vein| vein.waves()),
            margin_amplitude: margin.map(|vein| vein.amplitude / length),
            twist: Some(answer.undulation.twist()),
            error: distance.map(|distance| distance / length),
            error_estimate: Some(answer.error() / length),
            ..blank
        }
    }

    fn answer(&self, method: MapMethod) -> (Found, f64) {
        let segments = self.knobs.segments;
        let (scenario, tolerance) = (self.scenario, self.tolerance);
        if let (MapMethod::ToRest(Method::SemiImplicit(_)), None) = (method, segments) {
            return self.relaxed.clone();
        }
        let on_grid = match method {
            MapMethod::ExplicitMotion => true,
            MapMethod::ToRest(method) => !method.is_shooting(),
        };
        let segments_at_least = segments.filter(|_| on_grid).unwrap_or(LEAST_SEGMENTS);
        if let Some(late) = too_many(segments_at_least, scenario.rods.len(), self.limit) {
            return late;
        }
        within(self.limit, self.all, |limit| match method {
            MapMethod::ExplicitMotion => answer_of_motion(scenario, self.knobs, tolerance, limit),
            MapMethod::ToRest(method) => match method {
                Method::SingleShooting => self.shoot(Start::Arcs, tolerance, Some(1), limit),
                Method::Shooting { intervals } => {
                    self.shoot(Start::Arcs, tolerance, intervals, limit)
                }
                Method::ShootingFromRest { .. } => self.shoot_from_rest(tolerance, limit),
                Method::SemiImplicit(_) | Method::Explicit { .. } => {
                    relaxed(scenario, method.on_grid(segments), tolerance, limit)
                }
            },
        })
    }

    fn shoot(&self, start: Start, accuracy: f64, intervals: Option<usize>, limit: &Limit) -> Found {
        let segments = match &self.relaxed.0 {
            Ok(relaxed) => relaxed.stations.len() - 1,
            Err(_) => SEGMENTS,
        };
        let grid = fine_grid(self.scenario, segments);
        let others = stations(self.scenario, self.knobs);
        let stations = union([grid.sigma(), &others].concat());
        let options = shooting::Options {
            intervals,
            limit: limit.clone(),
            ..shooting::Options::new(start, &stations, shooting::Precision::Error(accuracy))
        };
        let solved = shooting::solve(self.scenario, &options, &mut |_| {});
        let solution = solved.map_err(|failure| {
            let outcome = match failure.reason {
                Reason::Unbounded { .. } => MapOutcome::Diverged,
                Reason::TooMuch(_) | Reason::Unmodelled(_) => MapOutcome::Refused,
                Reason::OutOfTime => MapOutcome::OutOfTime,
                _ => MapOutcome::NotConverged,
            };
            let way = match failure.part {
                part if part < 1.0 => format!(" (at {part:.4} of the way from arcs)"),
                _ => String::new(),
            };
            (outcome, format!("{}{way}", failure.reason))
        })?;
        let intervals = match solution.intervals.len() - 1 {
            1 => "1 interval".into(),
            count => format!("{count} intervals"),
        };
        let neutral = solution.neutral.as_ref();
        let neutral = neutral.map_or(String::new(), |neutral| format!("; {neutral}"));
        let growth = solution.growth;
        let note = format!("over {intervals}, growth 10^{growth:.1}{neutral}");
        let answer = Answer::of_solution(self.scenario, solution, accuracy);
        if !answer.outcome.is_success() {
            let known = format!("the solution is only known within {:.1e}", answer.error());
            return Err((MapOutcome::NotConverged, known));
        }
        Ok(Answer {
            index: index_at(
                self.scenario,
                grid,
                (&answer.stations, &answer.rods),
                answer.error(),
            ),
            remark: Some(note),
            ..answer
        })
    }

    fn shoot_from_rest(&self, accuracy: f64, limit: &Limit) -> Found {
        match &self.relaxed.0 {
            Ok(relaxed) => self.shoot(relaxed.as_start(), accuracy, None, limit),
            Err((outcome, why)) => {
                let why = format!("the leaf to start from is not at rest: {why}");
                Err((*outcome, why))
            }
        }
    }

    /// The verdict on an answer at this distance from the reference.
    fn judge(&self, answer: &Answer, distance: Option<f64>) -> (MapOutcome, String) {
        let note = answer.remark.as_deref().unwrap_or_default();
        if let Some(index @ 1..) = answer.index {
            return (MapOutcome::Saddle, format!("index {index}; {note}"));
        }
        let (Some(reference), Some(distance)) = (&self.reference, distance) else {
            let text = format!("stable, with nothing to compare with; {note}");
            return (MapOutcome::Right, text);
        };
        if answer.confirms(reference, distance) {
            return (MapOutcome::Right, note.into());
        }
        let lower = match answer.energy - reference.energy {
            lower if lower < 0.0 => format!("energy lower by {:.1e}", -lower),
            higher => format!("energy higher by {higher:.1e}"),
        };
        let apart = distance / longest(&self.scenario.rods);
        let text = format!("{apart:.1e} lengths from the reference, {lower}; {note}");
        match self.is_elsewhere(answer, reference, distance) {
            true => (MapOutcome::OtherEquilibrium, text),
            false => (MapOutcome::Inaccurate, text),
        }
    }

    /// Whether the equilibrium near an answer is another than the reference.
    fn is_elsewhere(&self, answer: &Answer, reference: &Answer, distance: f64) -> bool {
        let (near, _) = within(self.limit, self.all, |limit| {
            self.shoot(answer.as_start(), self.tolerance, None, limit)
        });
        match near {
            Ok(near) if near.distance(answer) < Some(distance) => {
                near.distance(reference) > Some(0.5 * distance)
            }
            _ => distance > SAME_LEAF * longest(&self.scenario.rods),
        }
    }
}

/// The outcome on a grid that takes longer than the limit in any case.
fn too_many(segments: usize, rods: usize, limit: Duration) -> Option<(Found, f64)> {
    let (nodes, limit) = (segments.saturating_mul(rods), limit.as_secs_f64());
    let late = nodes as f64 * LEAST_SECONDS > limit;
    let why = || format!("{nodes} nodes take longer than {limit} s");
    late.then(|| (Err((MapOutcome::OutOfTime, why())), 0.0))
}

/// Runs a method with a time limit; also returns the seconds it took.
/// A run that exceeds the limit counts as out of time, whatever its result.
fn within(limit: Duration, all: &Limit, run: impl FnOnce(&Limit) -> Found) -> (Found, f64) {
    let until = Limit {
        deadline: Some(Instant::now() + limit),
        ..all.clone()
    };
    let (found, seconds) = timed(|| run(&until));
    let limit = limit.as_secs_f64();
    match seconds > limit {
        true => {
            let late = format!("no answer within {limit} s");
            (Err((MapOutcome::OutOfTime, late)), seconds)
        }
        false => (found, seconds),
    }
}

/// Relaxes, perhaps on one grid. That has no error estimate of its own: a finer grid gives one.
pub fn relaxed(scenario: &Scenario, method: Method, tolerance: f64, limit: &Limit) -> Found {
    let options = Options {
        method,
        tolerance: Some(tolerance),
        limit: limit.clone(),
        ..Options::default()
    };
    let leaf = relax::relax(scenario, &options, &mut |_| {});
    let leaf = leaf.map_err(|refused| (MapOutcome::Refused, refused.to_string()))?;
    let saddle = leaf.stability.saddle;
    let saddle = saddle.map(|saddle| saddle.negative_eigenvalues);
    let mut answer = Answer::from(leaf);
    if !answer.outcome.is_success() {
        let outcome = match answer.outcome {
            Outcome::Diverged => MapOutcome::Diverged,
            _ => MapOutcome::NotConverged,
        };
        return Err((outcome, answer.remark.unwrap_or_default()));
    }
    if answer.error_estimate.is_none() {
        let segments = method.segments();
        let error = segments.and_then(|n| grid_error(scenario, n, tolerance, limit));
        let Some(error) = error else {
            let why = "the error of the grid cannot be told: a finer one finds no rest";
            return Err((MapOutcome::NotConverged, why.into()));
        };
        answer.error_estimate = Some(error + tolerance);
    }
    if let Some(index) = saddle {
        answer.remark = Some(format!("left a saddle of index {index}"));
    }
    Ok(answer)
}

/// The reference, from a relaxed leaf and, if found, the shooting solution started from it.
/// If they agree, also in their numbers of negative eigenvalues, it is the shooting solution;
/// if not, only if that is stable.
fn confirm(relaxed: &Answer, shot: Option<Answer>) -> (Confidence, Answer) {
    let Some(shot) = shot else {
        return (Confidence::Unconfirmed, relaxed.clone());
    };
    let distance = relaxed.distance(&shot);
    let same = distance.is_some_and(|distance| relaxed.confirms(&shot, distance));
    match (same && shot.index == relaxed.index, shot.index) {
        (true, _) => (Confidence::Confirmed, shot),
        (false, Some(0)) => (Confidence::Unconfirmed, shot),
        (false, _) => (Confidence::Unconfirmed, relaxed.clone()),
    }
}

/// Puts a text on one line, as tables require.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Default number of segments per rod: as in a simulation.
const MOTION_SEGMENTS: usize = 16;

/// Largest number of stations at which answers are compared.
const MOST_STATIONS: usize = 4096;

/// Steps between checks of the time limit.
const LOOK: f64 = 1000.0;

/// Moves the leaf, released from the initial state of a relaxation, for the scenario's
/// duration under the loads of its dynamics, in steps of `method.step`.
pub fn answer_of_motion(scenario: &Scenario, knobs: Knobs, tolerance: f64, limit: &Limit) -> Found {
    let refused = |why: String| Err((MapOutcome::Refused, why));
    let Some(step) = knobs.step else {
        return refused("explicit motion needs method.step".into());
    };
    let leaf = Leaf::new(scenario);
    let grid = match grid(&leaf, knobs) {
        Ok(grid) => grid,
        Err(error) => return refused(error.to_string()),
    };
    let physics = Physics::new(&leaf);
    if !physics.clamped() {
        return refused("a free leaf has no place to rest in".into());
    }
    let discrete = DiscreteLeaf::new(&leaf, grid.clone());
    let state = start(&discrete);
    let h = step / physics.time;
    let Ok(mut motion) = Explicit::new(discrete, physics.clone(), &state, Some(h)) else {
        return refused("no time step is stable for rigid rods (a stiffness is inf)".into());
    };
    let stable = motion.stable_step();
    let (most, why) = (stable.step * physics.time, stable.limit);
    let note = format!("step {step:.3e}, stable up to {most:.3e} because of {why}");
    let failed = |outcome, what: String| Err((outcome, format!("{what}; {note}")));
    let (duration, _) = physics.duration();
    while motion.time() < duration {
        let until = motion.time() + LOOK * h;
        if let Err(stopped) = motion.advance(until.min(duration)) {
            let (Stopped::Unresolved { time, .. }
            | Stopped::HalfTurn { time, .. }
            | Stopped::Diverged { time, .. }
            | Stopped::StepTooShort { time, .. }
            | Stopped::Interrupted { time }) = stopped;
            let at = format!("at t = {:.3e}", time * physics.time);
            return match stopped {
                Stopped::Unresolved { turn, .. } => {
                    let bent = format!("a segment bends by {turn:.2} rad, more than it resolves");
                    failed(MapOutcome::NotConverged, format!("{at} {bent}"))
                }
                Stopped::HalfTurn { half_turn, .. } => failed(
                    MapOutcome::NotConverged,
                    format!("{at} {}", half_turn.sentence()),
                ),
                _ => failed(MapOutcome::Diverged, format!("numerical instability {at}")),
            };
        }
        if limit.reached() {
            // Past the limit it counts as out of time, whatever is returned here.
            return failed(MapOutcome::OutOfTime, "still moving".into());
        }
    }
    let end = motion.snapshot();
    let speeds = end
        .velocity
        .iter()
        .map(|v| [v.linear, v.angular].map(DVec3::length));
    let fastest = largest(speeds.flatten());
    if fastest > tolerance {
        let moves = format!("still moves by {fastest:.1e} lengths in a unit of time");
        return failed(MapOutcome::NotConverged, moves);
    }
    let rods = shape_of(&DiscreteLeaf::new(&leaf, grid.clone()), &end.state);
    let index = index_near(scenario, grid.clone(), &rods, SAME_LEAF * leaf.scale.length);
    if index.is_none() && !leaf.loads.has_moments() {
        return failed(MapOutcome::NotConverged, "slow, but not at rest".into());
    }
    let length = leaf.scale.length;
    let error = grid_error(scenario, grid.segments(), tolerance, limit);
    let estimate = error.unwrap_or(SAME_LEAF * length) + tolerance * length;
    Ok(Answer {
        outcome: Outcome::Converged,
        remark: Some(note),
        undulation: Undulation::at_stations(scenario, grid.sigma(), &rods, Some(estimate)),
        stations: grid.sigma().to_vec(),
        rods,
        energy: (end.energy.elastic + end.energy.coupling + end.energy.potential)
            * leaf.scale.moment(),
        index,
        error_estimate: Some(estimate),
        work: Work::default(),
    })
}

/// The grid, of as many segments as are set or needed.
fn grid(leaf: &Leaf, knobs: Knobs) -> Result<Grid, RelaxError> {
    let segments = relax::check_segments(leaf, knobs.segments, MOTION_SEGMENTS)?;
    Ok(Grid::new(segments, leaf.kinks()))
}

/// The longest step known to be stable.
pub fn stable_step(varied: &Varied) -> Option<f64> {
    let leaf = Leaf::new(&varied.scenario);
    let grid = grid(&leaf, varied.knobs).ok()?;
    let physics = Physics::new(&leaf);
    let discrete = DiscreteLeaf::new(&leaf, grid);
    let state = start(&discrete);
    let time = physics.time;
    let motion = Explicit::new(discrete, physics, &state, Some(1.0)).ok()?;
    Some(motion.stable_step().step * time)
}

/// Additional stations that a reference should have.
pub fn stations(scenario: &Scenario, knobs: Knobs) -> Vec<f64> {
    let leaf = Leaf::new(scenario);
    match relax::check_segments(&leaf, knobs.segments, MOTION_SEGMENTS) {
        Ok(segments) if knobs.segments.is_some() => {
            let grid = fine_grid(scenario, segments);
            let every = grid.segments().div_ceil(MOST_STATIONS);
            let some = grid.sigma().iter().copied().step_by(every);
            some.chain([1.0]).collect()
        }
        _ => vec![0.0, 1.0],
    }
}

/// Leaves closer than this, in lengths, count as the same.
const SAME: f64 = 0.01;

/// A pair is examined if its tips, or its twists, are farther apart than those of
/// a neighbouring pair by this factor.
const FARTHER: f64 = 1.5;

/// At the midpoint, a leaf on a continuous branch is nearer to the mean of both ends than this
/// part of their distance.
const NEAR_MIDDLE: f64 = 0.1;

/// Number of bisections: near a fold or a branch point a leaf moves as the square root of the
/// distance from it, here a sixty-fourth.
const HALVES: usize = 12;

/// Two neighbouring cells between which the leaf jumps to another equilibrium.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapJump {
    /// The key that varies between them.
    pub key: String,
    /// The varied values of one cell.
    pub from: Vec<String>,
    /// Those of the other.
    pub to: Vec<String>,
    /// The two values of the key between which it jumps.
    pub between: [f64; 2],
    /// Size of the jump, in units of length.
    pub distance: f64,
}

/// Two neighbouring cells along an axis.
struct Pair {
    axis: usize,
    cells: [usize; 2],
}

impl Map {
    /// Searches for jumps of the leaf to another equilibrium between neighbouring cells, by the
    /// default method, and stores them in `jumps`.
    /// `progress` is called with the number of pairs examined and their total number.
    pub fn find_jumps(&mut self, progress: &(dyn Fn(usize, usize) + Sync)) {
        self.jumps = Some(jumps(&self.request, &self.rows, progress));
    }
}

fn jumps(
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
    let pairs: Vec<Pair> = pairs(request)
        .filter(|pair| may_jump(request, &known, pair))
        .collect();
    let done = AtomicUsize::new(0);
    let found = pairs.par_iter().map(|pair| {
        let found = jump(request, pair);
        progress(1 + done.fetch_add(1, Ordering::Relaxed), pairs.len());
        found
    });
    found.flatten().collect()
}

fn pairs(request: &MapRequest) -> impl Iterator<Item = Pair> {
    (0..request.cells()).flat_map(move |cell| {
        (0..request.axes.len()).filter_map(move |axis| {
            let next = neighbour(request, cell, axis, 1)?;
            let cells = [cell, next];
            Some(Pair { axis, cells })
        })
    })
}

/// The cell at a signed offset along an axis.
fn neighbour(request: &MapRequest, cell: usize, axis: usize, offset: isize) -> Option<usize> {
    let later = request.axes.iter().skip(axis + 1);
    let stride: usize = later.map(|axis| axis.values.len()).product();
    let at = request.place(cell)[axis].checked_add_signed(offset)?;
    let there = at < request.axes[axis].values.len();
    there.then(|| cell.wrapping_add_signed(offset * stride as isize))
}

/// Whether the leaf may jump between two cells, by comparison with neighbouring rows. If
/// its tip is held, only its shape can show it.
fn may_jump(request: &MapRequest, known: &[Option<&MapRow>], pair: &Pair) -> bool {
    let [a, b] = pair.cells;
    let distances = |a: usize, b: usize| Some(distances(known[a]?, known[b]?));
    let Some(own) = distances(a, b) else {
        return false;
    };
    let scenario = request.base.scenario();
    if scenario.held_tip.is_some() {
        return true;
    }
    let before = neighbour(request, a, pair.axis, -1).and_then(|before| distances(before, a));
    let after = neighbour(request, b, pair.axis, 1).and_then(|after| distances(b, after));
    let units = [longest(&scenario.rods), 1.0];
    (0..2).any(|k| {
        let others = [before, after].into_iter().flatten().map(|it| it[k]);
        let least = others.fold(f64::INFINITY, f64::min);
        own[k] > SAME * units[k] && (!least.is_finite() || own[k] > FARTHER * least)
    })
}

/// Distances of the tips and of the twists.
fn distances(a: &MapRow, b: &MapRow) -> [f64; 2] {
    let difference = |of: fn(&MapRow) -> Option<f64>| of(a).zip(of(b)).map_or(0.0, |(a, b)| a - b);
    let tip = [difference(|row| row.tip_x), difference(|row| row.tip_y)];
    let tip = tip[0].hypot(tip[1]).hypot(difference(|row| row.tip_z));
    [tip, difference(|row| row.twist).abs()]
}

/// The jump between two cells, if there certainly is one.
fn jump(request: &MapRequest, pair: &Pair) -> Option<MapJump> {
    let axis = &request.axes[pair.axis];
    let ends = pair.cells.map(|cell| request.values(cell)[pair.axis].1);
    let value = |part: f64| value_between(ends, axis.log, part);
    let at = |part: f64| answer_between(request, pair, value(part));
    let length = longest(&request.base.scenario().rods);
    let [mut low, mut high] = [(0.0, at(0.0)?), (1.0, at(1.0)?)];
    let mut distance = low.1.distance(&high.1)?;
    for half in 0..HALVES {
        if distance < SAME * length {
            return None;
        }
        let part = 0.5 * (low.0 + high.0);
        let middle = at(part)?;
        if half == 0 && distance_from_middle(&low.1, &middle, &high.1)? < NEAR_MIDDLE * distance {
            return None;
        }
        let [below, above] = [low.1.distance(&middle)?, middle.distance(&high.1)?];
        match below > above {
            true => (high, distance) = ((part, middle), below),
            false => (low, distance) = ((part, middle), above),
        }
    }
    (distance >= SAME * length).then(|| MapJump {
        key: axis.keys.to_string(),
        from: request.texts(pair.cells[0]),
        to: request.texts(pair.cells[1]),
        between: [value(low.0), value(high.0)],
        distance,
    })
}

/// The relaxed leaf at another value along the axis of a pair.
fn answer_between(request: &MapRequest, pair: &Pair, value: f64) -> Option<Answer> {
    let mut values = request.values(pair.cells[0]);
    values[pair.axis].1 = value;
    let varied = request.base.at(&values).ok()?;
    let limit = Limit {
        deadline: Some(Instant::now() + Duration::from_secs_f64(request.cell_seconds)),
        ..request.limit.clone()
    };
    let method = Method::default().on_grid(varied.knobs.segments);
    let tolerance = request.tolerance.unwrap_or(varied.scenario.tolerance);
    relaxed(&varied.scenario, method, tolerance, &limit).ok()
}

/// Largest distance of a leaf from the mean of two others.
fn distance_from_middle(low: &Answer, middle: &Answer, high: &Answer) -> Option<f64> {
    let common = |sigma: f64, of: &Answer| of.stations.iter().position(|it| *it == sigma);
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
