//! One step along a branch, which may end where the range of the parameter does.

use crate::branch::Point;
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::OutOfRange;
use crate::largest::larger;

/// A point found by a step.
pub struct Found {
    pub point: Point,
    /// Length of the step along the tangent at its start.
    pub step: f64,
    /// Distance between the predicted and the corrected point.
    pub drift: f64,
}

impl Found {
    /// Makes a step of this length, or a shorter one to the end of the range: beyond the end there
    /// may be no leaf.
    pub fn by_step(equations: &mut Equations, now: &Point, step: f64) -> Result<Self, Stuck> {
        match advance(equations, now, step) {
            Err(Stuck::OutOfRange(out)) => advance_to_edge(equations, now, step, out),
            found => found,
        }
    }

    /// If a step of this length leaves the range, shortens it to the end of the range;
    /// returns that end.
    pub fn stop_at_edge(
        &mut self,
        equations: &mut Equations,
        now: &Point,
        step: f64,
    ) -> Result<Option<f64>, Stuck> {
        let edge = match self.point.fraction {
            1.0 if now.fraction < 1.0 => return Ok(Some(1.0)),
            0.0 if now.fraction > 0.0 => return Ok(Some(0.0)),
            fraction if fraction > 1.0 => 1.0,
            fraction if fraction < 0.0 => 0.0,
            _ => return Ok(None),
        };
        let part = (edge - now.fraction) / (self.point.fraction - now.fraction);
        (self.point, _) = at_edge(equations, now, edge, part * step)?;
        self.step = part * step;
        Ok(Some(edge))
    }
}

fn advance(equations: &mut Equations, now: &Point, step: f64) -> Result<Found, Stuck> {
    let near = equations.moved(&now.solution(), &now.tangent, step)?;
    let [fraction] = near.params;
    let point = equations.correct(&near.state, fraction, Some(&now.tangent))?;
    let drift = larger(
        near.state.shift_to(&point.state),
        (point.fraction - fraction).abs(),
    );
    Ok(Found { point, step, drift })
}

/// A step to the end of the range, if one of this length would leave it.
fn advance_to_edge(
    equations: &mut Equations,
    now: &Point,
    step: f64,
    out: OutOfRange,
) -> Result<Found, Stuck> {
    let edge = if now.tangent.params[0] > 0.0 {
        1.0
    } else {
        0.0
    };
    let length = (edge - now.fraction) / now.tangent.params[0];
    if length <= 0.0 || length > step {
        return Err(out.into());
    }
    let (point, drift) = at_edge(equations, now, edge, length)?;
    let part = length / step;
    Ok(Found {
        drift: drift / part,
        point,
        step: length,
    })
}

/// The point at an end of the range, predicted `length` along the tangent, and its distance from
/// the prediction.
fn at_edge(
    equations: &mut Equations,
    now: &Point,
    edge: f64,
    length: f64,
) -> Result<(Point, f64), Stuck> {
    let state = equations.advanced(&now.state, [edge], &now.tangent.increments, length)?;
    let mut point = equations.correct(&state, edge, None)?;
    point.tangent = equations.oriented(point.tangent, &now.tangent);
    let drift = state.shift_to(&point.state);
    Ok((point, drift))
}
