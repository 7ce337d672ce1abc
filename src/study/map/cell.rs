//! One cell: the reference, and each method's answer with its verdict.

use crate::clock::Instant;
use std::time::Duration;

use crate::limit::Limit;
use crate::relax::{self, Method, Options, Outcome};
use crate::scenario::{Scenario, longest};
use crate::shooting;
use crate::shooting::{Reason, Start};
use crate::study::judge::{
    Answer, SAME_LEAF, SEGMENTS, fine_grid, grid_error, index_at, timed, union,
};
use crate::study::vary::{Knobs, Varied};

use super::motion;
use super::row::{Confidence, Found, MapMethod, MapOutcome, MapRow};

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
            MapMethod::ExplicitMotion => motion::answer_of_motion(scenario, self.knobs, tolerance, limit),
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
        let others = motion::stations(self.scenario, self.knobs);
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
