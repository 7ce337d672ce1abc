//! One run of one cell.

use super::plan::{Cell, Setting};
use crate::bvp::{self, Reason};
use crate::relax::{Method, Options, Outcome, RelaxError, SHOOTING_START};
use crate::scenario::Scenario;
use crate::study::judge::{Answer, timed};

/// Runs a cell; also returns the time from the checked scenario to the result,
/// in seconds.
pub fn run(cell: &Cell) -> Result<(Answer, f64), RelaxError> {
    let (tolerance, segments) = match cell.knob {
        Setting::Tolerance(tolerance) => (Some(tolerance), None),
        Setting::Segments(segments) => (None, Some(segments)),
    };
    if let Method::ShootingFromRest { .. } = cell.contender.method {
        let accuracy = tolerance.unwrap_or(cell.scenario.tolerance);
        return shoot_from_rest(cell.scenario, accuracy);
    }
    let options = Options {
        method: cell.contender.method.on_grid(segments),
        tolerance,
        ..Options::default()
    };
    let (answer, seconds) = timed(|| Answer::relaxed(cell.scenario, &options));
    Ok((answer?, seconds))
}

/// Shooting from a coarsely relaxed leaf. The work of both is added, and no time is
/// spent on counting eigenvalues.
fn shoot_from_rest(scenario: &Scenario, accuracy: f64) -> Result<(Answer, f64), RelaxError> {
    let options = Options {
        tolerance: Some(SHOOTING_START),
        ..Options::default()
    };
    let (found, seconds) = timed(|| {
        let rest = Answer::relaxed(scenario, &options)?;
        let precision = bvp::Precision::Error(accuracy);
        let asked = bvp::Options::new(rest.as_start(), &rest.stations, precision);
        let shot = rest
            .at_rest()
            .then(|| bvp::solve(scenario, &asked, &mut |_| {}));
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
