//! One cell: the reference, each method's answer, and what it is worth.

use std::time::{Duration, Instant};

use crate::bvp::Start;
use crate::relax::{Method, Options};
use crate::scenario::Scenario;
use crate::study::vary::{Knobs, Varied};

use super::answer::{
    Answer, Found, SAME_PLACE, Shooting, Timed, fine_grid, longest, relaxed, timed,
};
use super::motion;
use super::row::{Confidence, MapMethod, MapOutcome, MapRow};

/// The reference is sharper than what it judges by this factor, as far as
/// double precision allows.
const SHARPER: f64 = 1e-2;
const SHARPEST: f64 = 1e-12;

/// Segments between the stations of shooting, at least.
const SEGMENTS: usize = 32;

/// What a cell's leaf is solved with.
pub struct Cell<'a> {
    scenario: &'a Scenario,
    knobs: Knobs,
    tolerance: f64,
    limit: Duration,
    /// The default's answer: the start of shooting from rest.
    relaxed: Timed,
    reference: Option<Answer>,
    confidence: Confidence,
}

impl<'a> Cell<'a> {
    /// Finds the reference: the relaxed leaf, and the solution of the
    /// boundary-value problem near it.
    pub fn new(varied: &'a Varied, tolerance: Option<f64>, limit: Duration) -> Self {
        let scenario = &varied.scenario;
        let tolerance = tolerance.unwrap_or(scenario.tolerance);
        let relaxed = timed(limit, |deadline| {
            let options = Options {
                tolerance: Some(tolerance),
                deadline: Some(deadline),
                ..Options::default()
            };
            relaxed(scenario, &options)
        });
        let mut cell = Cell {
            scenario,
            knobs: varied.knobs,
            tolerance,
            limit,
            relaxed,
            reference: None,
            confidence: Confidence::None,
        };
        let sharp = (SHARPER * tolerance).max(SHARPEST);
        let shot = timed(limit, |deadline| cell.shoot_from_rest(sharp, deadline));
        if let Found::Rest(relaxed) = &cell.relaxed.found {
            (cell.confidence, cell.reference) = match shot.found {
                Found::Rest(shot) => {
                    let apart = relaxed.distance(&shot);
                    let known = relaxed.estimate + shot.estimate;
                    match (apart <= known, shot.index) {
                        (true, index) if index == relaxed.index => {
                            (Confidence::Confirmed, Some(*shot))
                        }
                        (_, Some(0)) => (Confidence::Unconfirmed, Some(*shot)),
                        _ => (Confidence::Unconfirmed, Some((**relaxed).clone())),
                    }
                }
                Found::Failed(..) => (Confidence::Unconfirmed, Some((**relaxed).clone())),
            };
        }
        cell
    }

    /// Solves by a method and judges.
    pub fn row(&self, cell: usize, method: MapMethod) -> MapRow {
        let Timed { found, seconds } = self.answer(method);
        let length = longest(self.scenario);
        let blank = MapRow {
            cell,
            method,
            outcome: MapOutcome::Refused,
            detail: String::new(),
            index: None,
            tip: None,
            energy: None,
            margin_waves: None,
            margin_amplitude: None,
            twist: None,
            error: None,
            error_estimate: None,
            seconds,
            reference: self.confidence,
        };
        match found {
            Found::Failed(outcome, detail) => MapRow {
                outcome,
                detail: one_line(&detail),
                ..blank
            },
            Found::Rest(answer) => {
                let error = self.reference.as_ref().map(|it| it.distance(&answer));
                let (outcome, detail) = self.judge(&answer, error);
                let margin = answer.undulation.margin();
                let tip = answer.rods.first().and_then(|rod| rod.nodes.last());
                MapRow {
                    outcome,
                    detail: one_line(&detail),
                    index: answer.index,
                    tip: tip.map(|node| node.position.to_array()),
                    energy: Some(answer.energy),
                    margin_waves: margin.map(|vein| vein.waves()),
                    margin_amplitude: margin.map(|vein| vein.amplitude / length),
                    twist: Some(answer.undulation.twist()),
                    error: error.map(|error| error / length),
                    error_estimate: Some(answer.estimate / length),
                    ..blank
                }
            }
        }
    }

    fn answer(&self, method: MapMethod) -> Timed {
        let relaxation = |method: Method| {
            timed(self.limit, |deadline| {
                let options = Options {
                    method: method.on_grid(self.knobs.segments),
                    tolerance: Some(self.tolerance),
                    deadline: Some(deadline),
                    ..Options::default()
                };
                relaxed(self.scenario, &options)
            })
        };
        let from_arcs = |intervals: Option<usize>| {
            timed(self.limit, |deadline| {
                self.shooting(self.tolerance, intervals, deadline, |shooting| {
                    shooting.from(Start::Arcs)
                })
            })
        };
        match method {
            MapMethod::SemiImplicit if self.knobs.segments.is_none() => self.relaxed.clone(),
            MapMethod::SemiImplicit => relaxation(Method::default()),
            MapMethod::Explicit => relaxation(Method::Explicit { segments: None }),
            MapMethod::ExplicitMotion => timed(self.limit, |deadline| {
                motion::answer(self.scenario, self.knobs, self.tolerance, deadline)
            }),
            MapMethod::SingleShooting => from_arcs(Some(1)),
            MapMethod::Shooting => from_arcs(None),
            MapMethod::ShootingFromRest => timed(self.limit, |deadline| {
                self.shoot_from_rest(self.tolerance, deadline)
            }),
        }
    }

    /// With the stations a boundary-value solution is compared at.
    fn shooting(
        &self,
        accuracy: f64,
        intervals: Option<usize>,
        deadline: Instant,
        solve: impl FnOnce(&Shooting) -> Found,
    ) -> Found {
        let segments = match &self.relaxed.found {
            Found::Rest(relaxed) => relaxed.stations.len() - 1,
            Found::Failed(..) => SEGMENTS,
        };
        solve(&Shooting {
            scenario: self.scenario,
            accuracy,
            intervals,
            grid: &fine_grid(self.scenario, segments),
            more: &motion::stations(self.scenario, self.knobs),
            deadline,
        })
    }

    fn shoot_from_rest(&self, accuracy: f64, deadline: Instant) -> Found {
        match &self.relaxed.found {
            Found::Rest(relaxed) => self.shooting(accuracy, None, deadline, |shooting| {
                shooting.from(Start::Leaf {
                    stations: &relaxed.stations,
                    rods: &relaxed.rods,
                })
            }),
            Found::Failed(outcome, why) => Found::Failed(
                *outcome,
                format!("the leaf to start from is not at rest: {why}"),
            ),
        }
    }

    /// What an answer is worth at this distance from the reference.
    fn judge(&self, answer: &Answer, distance: Option<f64>) -> (MapOutcome, String) {
        let note = &answer.note;
        if let Some(index @ 1..) = answer.index {
            return (MapOutcome::Saddle, format!("index {index}; {note}"));
        }
        let (Some(reference), Some(distance)) = (&self.reference, distance) else {
            return (
                MapOutcome::Right,
                format!("stable, with nothing to compare with; {note}"),
            );
        };
        if distance <= answer.estimate + reference.estimate {
            return (MapOutcome::Right, note.clone());
        }
        let length = longest(self.scenario);
        let lower = match answer.energy - reference.energy {
            lower if lower < 0.0 => format!("energy lower by {:.1e}", -lower),
            higher => format!("energy higher by {higher:.1e}"),
        };
        let text = format!(
            "{:.1e} lengths from the reference, {lower}; {note}",
            distance / length
        );
        match self.is_elsewhere(answer, reference, distance) {
            true => (MapOutcome::OtherEquilibrium, text),
            false => (MapOutcome::Inaccurate, text),
        }
    }

    /// Whether the equilibrium near an answer is not the reference.
    fn is_elsewhere(&self, answer: &Answer, reference: &Answer, distance: f64) -> bool {
        let near = timed(self.limit, |deadline| {
            self.shooting(self.tolerance, None, deadline, |shooting| {
                shooting.from(Start::Leaf {
                    stations: &answer.stations,
                    rods: &answer.rods,
                })
            })
        });
        match near.found {
            Found::Rest(near) if near.distance(answer) < distance => {
                near.distance(reference) > 0.5 * distance
            }
            _ => distance > SAME_PLACE * longest(self.scenario),
        }
    }
}

/// Tables have one line a row.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
