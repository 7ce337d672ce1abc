//! One step along a branch, which may end where the range of the parameter does.

use super::Point;
use super::equations::{Equations, Stuck, reversed};
use super::family::OutOfRange;

/// A point found by a step.
pub struct Found {
    pub point: Point,
    pub iterations: usize,
    /// Length of the step, along the tangent it was made from.
    pub step: f64,
    /// By how much Newton moved the prediction.
    pub drift: f64,
}

impl Found {
    /// By a step of this length, or a shorter one that ends where the range does: behind
    /// the end there may be no leaf, and at it one.
    pub fn by_step(equations: &mut Equations, now: &Point, step: f64) -> Result<Self, Stuck> {
        match advance(equations, now, step) {
            Err(Stuck::OutOfRange(out)) => advance_to_edge(equations, now, step, out),
            found => found,
        }
    }

    /// Shortens a step of this length that leaves the range to end where the range does;
    /// returns where that is.
    pub fn arrive_at_edge(
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

/// One step along the branch.
fn advance(equations: &mut Equations, now: &Point, step: f64) -> Result<Found, Stuck> {
    let tangent = &now.tangent;
    let fraction = now.fraction + step * tangent.fraction;
    let state = equations.moved(&now.state, fraction, &tangent.increments, step)?;
    let (point, iterations) = equations.correct(&state, fraction, Some(tangent))?;
    let drift = (state.shift_to(&point.state)).max((point.fraction - fraction).abs());
    Ok(Found {
        point,
        iterations,
        step,
        drift,
    })
}

/// A step that ends where the range does, if one of this length would leave it.
fn advance_to_edge(
    equations: &mut Equations,
    now: &Point,
    step: f64,
    out: OutOfRange,
) -> Result<Found, Stuck> {
    let edge = if now.tangent.fraction > 0.0 { 1.0 } else { 0.0 };
    let way = (edge - now.fraction) / now.tangent.fraction;
    if way <= 0.0 || way > step {
        return Err(out.into());
    }
    let (point, iterations) = at_edge(equations, now, edge, way)?;
    let part = way / step;
    let state = equations.moved(&now.state, edge, &now.tangent.increments, way)?;
    Ok(Found {
        drift: state.shift_to(&point.state) / part,
        point,
        iterations,
        step: way,
    })
}

/// The point at an end of the range, about so far along the tangent.
fn at_edge(
    equations: &mut Equations,
    now: &Point,
    edge: f64,
    way: f64,
) -> Result<(Point, usize), Stuck> {
    let increments = &now.tangent.increments;
    let state = equations.moved(&now.state, edge, increments, way)?;
    let (mut point, iterations) = equations.correct(&state, edge, None)?;
    if equations.along(&point.tangent, &now.tangent) < 0.0 {
        point.tangent = reversed(point.tangent);
    }
    Ok((point, iterations))
}
