//! The vertex of a pitchfork: where a branch turns back because another one crosses it.
//!
//! No eigenvalue changes its sign along the branch that turns back, and the nearer its points are to
//! the vertex, the nearer to singular is the matrix. So they are not sought there: the vertex
//! is interpolated from points on either side, and the singular point is that of the other branch,
//! with the bordered matrix, which is regular.

use crate::branch::events::critical::{Critical, Kind, MORE, Search};
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::field::{add, between, combined, times};
use crate::branch::{Direction, Point};
use crate::largest::larger;
use crate::leaf::Field;

/// Distances (arclength) from the vertex of a pitchfork between which the branch that crosses there
/// is searched for its singular point.
const BESIDE: [f64; 3] = [0.01, 0.003, 0.001];

/// The crossing is that of the vertex if it is within this part of the step from where a cubic
/// through the points on either side has it.
const NEAR: f64 = 0.1;

/// The point at which a branch turns back because it crosses another one there, the vertex of a
/// pitchfork: no eigenvalue changes its sign along this branch, but one does along the other, which
/// goes on beyond the vertex. The points are on either side of the vertex, `step` apart; the
/// tangent of the result is that of the other branch. Fails if that is not found.
pub fn crossing_at_vertex(
    equations: &mut Equations,
    a: &Point,
    b: &Point,
    step: f64,
) -> Result<Critical, Stuck> {
    let vertex = vertex_between(equations, [a, b], step)?;
    let soft = equations.soft_modes(&vertex, 1 + MORE)?;
    let across = crossing_direction(equations, &vertex, &soft)?;
    let mut stuck = Stuck::NotConverged;
    for beside in BESIDE {
        match crossing_beside(equations, (&vertex, &across), &soft, beside) {
            Ok(mut critical) => {
                let shift = vertex.state.shift_to(&critical.state);
                let apart = larger(shift, (critical.fraction - vertex.fraction).abs());
                if apart < NEAR * step && critical.kind == Kind::Branching {
                    critical.indices = [a.index, b.index];
                    return Ok(critical);
                }
            }
            Err(other) => stuck = other,
        }
    }
    Err(stuck)
}

/// The point between two others, `step` apart, at which the parameter of the cubic through them,
/// with their tangents, is stationary.
fn vertex_between(
    equations: &mut Equations,
    [a, b]: [&Point; 2],
    step: f64,
) -> Result<Point, Stuck> {
    let rates = [a, b].map(|point| step * point.tangent.params[0]);
    let chord = b.fraction - a.fraction;
    // The derivative of the cubic, from one rate to the other.
    let quadratic = 3.0 * (rates[0] + rates[1] - 2.0 * chord);
    let linear = 6.0 * chord - 4.0 * rates[0] - 2.0 * rates[1];
    let root = (linear * linear - 4.0 * quadratic * rates[0])
        .max(0.0)
        .sqrt();
    let part = -2.0 * rates[0] / (linear + root.copysign(linear));
    let hermite = [
        part * part * (3.0 - 2.0 * part),
        part * (1.0 - part) * (1.0 - part),
        -part * part * (1.0 - part),
    ];
    let mut increments = times(
        &between(&a.state, &b.state, equations.first_node()),
        hermite[0],
    );
    add(&mut increments, step * hermite[1], &a.tangent.increments);
    add(&mut increments, step * hermite[2], &b.tangent.increments);
    let fraction = a.fraction + hermite[0] * chord + hermite[1] * rates[0] + hermite[2] * rates[1];
    Ok(Point {
        state: equations.advanced(&a.state, [fraction], &increments, 1.0)?,
        fraction,
        ..a.clone()
    })
}

/// The direction in which the other branch leaves the vertex of a pitchfork, to growing values of
/// the parameter: that in which the neutral mode, the tangent of this branch, is not excited.
fn crossing_direction(
    equations: &mut Equations,
    vertex: &Point,
    soft: &[Field],
) -> Result<Direction, Stuck> {
    let solution = vertex.solution();
    let border = equations.momenta(soft);
    let rates = equations.rates(&solution, false)?;
    let solved = equations.sample(solution, &border, rates, false)?.solved;
    let eigen = solved.h.clone().symmetric_eigen();
    let neutral = eigen.eigenvalues.map(f64::abs).imin();
    let mut increments = solved.rates[0].increments.clone();
    for (k, vector) in eigen.eigenvectors.column_iter().enumerate() {
        if k != neutral {
            let parts = vector.iter().zip(&solved.rates[0].multipliers);
            let forcing: f64 = parts.map(|(v, d)| v * d).sum();
            let part = -forcing / eigen.eigenvalues[k];
            let parts: Vec<f64> = vector.iter().map(|v| part * v).collect();
            add(&mut increments, 1.0, &combined(&parts, &solved.modes));
        }
    }
    Ok(equations.normalised(Direction {
        increments,
        params: [1.0],
    }))
}

/// The singular point of a branch that has this direction at a vertex, at most so far from that.
fn crossing_beside(
    equations: &mut Equations,
    (vertex, across): (&Point, &Direction),
    soft: &[Field],
    beside: f64,
) -> Result<Critical, Stuck> {
    let border = equations.momenta(soft);
    let moved = equations.moved(&vertex.solution(), across, -beside)?;
    let sample = equations.bordered(moved, [across], &border, None, false)?;
    let from = Point {
        state: sample.solution.state,
        fraction: sample.solution.params[0],
        tangent: across.clone(),
        ..vertex.clone()
    };
    let mut search = Search {
        equations,
        from: &from,
        soft,
        exactly: false,
    };
    let ends = [0.0, 2.0 * beside];
    let [before, after] = [search.at(ends[0])?, search.at(ends[1])?];
    let values = before.eigenvalues.iter().zip(&after.eigenvalues);
    let values: Vec<[f64; 2]> = values.map(|(a, b)| [*a, *b]).collect();
    let changing: Vec<usize> = (0..values.len())
        .filter(|&k| values[k][0] * values[k][1] < 0.0)
        .collect();
    // Eigenvalues of other modes keep their signs.
    match changing[..] {
        [which] => Ok(search.zero(which, ends, values[which])?.1),
        _ => Err(Stuck::NotConverged),
    }
}
