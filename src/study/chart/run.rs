//! The runs of one contender with one setting on a leaf.

use super::plan::{Contender, Setting};
use crate::relax::{Method, Options, Outcome, RelaxError, SHOOTING_START};
use crate::scenario::{Scenario, longest};
use crate::shooting;
use crate::shooting::Reason;
use crate::study::judge::{Answer, timed};

/// A leaf, a contender and its setting, with the results of its runs so far.
pub struct Runs<'s> {
    pub scenario: &'s Scenario,
    pub contender: Contender,
    pub knob: Setting,
    /// The result of the first run. `None`: it was not run, since a coarser one of
    /// its contender took too long.
    pub found: Option<Result<Answer, RelaxError>>,
    /// Seconds of each run; ascending once all are made.
    pub seconds: Vec<f64>,
}

impl<'s> Runs<'s> {
    /// Before the first run.
    pub fn new(scenario: &'s Scenario, contender: Contender, knob: Setting) -> Self {
        Runs {
            scenario,
            contender,
            knob,
            found: None,
            seconds: Vec::new(),
        }
    }

    /// The answer, unless the run was refused or not made.
    pub fn answer(&self) -> Option<&Answer> {
        self.found.as_ref()?.as_ref().ok()
    }

    /// The answer, if the leaf is at rest.
    pub fn at_rest(&self) -> Option<&Answer> {
        self.answer().filter(|run| run.at_rest())
    }

    /// The distance of the leaf at rest from the reference, relative to the longest rod.
    pub fn error(&self, reference: Option<&Answer>) -> Option<f64> {
        let distance = self.at_rest()?.distance(reference?)?;
        Some(distance / longest(&self.scenario.rods))
    }

    /// Runs once; also returns the time from the checked scenario to the result, in seconds.
    pub fn once(&self) -> Result<(Answer, f64), RelaxError> {
        let (tolerance, segments) = match self.knob {
            Setting::Tolerance(tolerance) => (Some(tolerance), None),
            Setting::Segments(segments) => (None, Some(segments)),
        };
        if let Method::ShootingFromRest { .. } = self.contender.method {
            let accuracy = tolerance.unwrap_or(self.scenario.tolerance);
            return shoot_from_rest(self.scenario, accuracy);
        }
        let options = Options {
            method: self.contender.method.on_grid(segments),
            tolerance,
            ..Options::default()
        };
        let (answer, seconds) = timed(|| Answer::relaxed(self.scenario, &options));
        Ok((answer?, seconds))
    }
}

/// Shooting from a coarsely relaxed leaf. The work of both is added, and no time is
/// spent on counting eigenvalues.
fn shoot_from_rest(scenario: &Scenario, accuracy: f64) -> Result<(Answer, f64), RelaxError> {
    shooting::check_models(scenario, true)?;
    let options = Options {
        tolerance: Some(SHOOTING_START),
        ..Options::default()
    };
    let (found, seconds) = timed(|| {
        let rest = Answer::relaxed(scenario, &options)?;
        let precision = shooting::Precision::Error(accuracy);
        let asked = shooting::Options::new(rest.as_start(), &rest.stations, precision);
        let shot = rest
            .at_rest()
            .then(|| shooting::solve(scenario, &asked, &mut |_| {}));
        Ok::<_, RelaxError>((rest, shot))
    });
    let (rest, shot) = found?;
    let answer = match shot {
        None => rest,
        Some(Ok(solution)) => {
            let shot = Answer::of_solution(scenario, solution, accuracy);
            Answer {
                outcome: match (shot.outcome, rest.outcome) {
                    // The coarse relaxation only provides the start.
                    (Outcome::Converged, Outcome::ToleranceNotReached) => Outcome::Converged,
                    (Outcome::Converged, outcome) => outcome,
                    (outcome, _) => outcome,
                },
                work: rest.work + shot.work,
                ..shot
            }
        }
        Some(Err(failure)) => Answer {
            outcome: match failure.reason {
                Reason::Singular(_) => Outcome::Singular,
                _ => Outcome::NotAtRest,
            },
            remark: Some(failure.reason.to_string()),
            error_estimate: None,
            work: rest.work + failure.work.into(),
            ..rest
        },
    };
    Ok((answer, seconds))
}
