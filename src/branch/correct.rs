//! Newton's method to a branch, within a plane or at a parameter, and the Morse index there.
//!
//! One step along a branch, which may end where the range of the parameter does.

use crate::branch::equations::{
    ACCURACY, Equations, ITERATIONS, LARGEST, Linear, Stuck, at_rest, factorized,
};
use crate::branch::family::{OutOfRange, clamp, rate};
use crate::branch::{
    Direction, Point, Solution, add, at_same_nodes, between, dot, is_finite, largest, plus,
};
use crate::leaf::{DiscreteLeaf, Field, Solved, State, System};
use crate::newton::ForceProgress;
use crate::numbers::larger;
use crate::relax::NOISY;
use crate::relax::accuracy::transfer::prolong;
use glam::DVec3;

const CG_TOLERANCE: f64 = 1e-11;

/// A step too small to change the sign of any eigenvalue, even of a nearly neutral one.
const SAME_INDEX: f64 = 1e-9;

/// Iterations go on while an increment is at most this part of the one before, up to so many.
const CONTRACTING: f64 = 0.5;

const MOST_ITERATIONS: usize = 50;

/// A hyperplane in which a point is sought.
pub(super) struct Plane {
    /// Its normal: the increments times the mass matrix, per unit of the leaf's mass, and the
    /// component along the parameter.
    pub dual: Field,
    pub own: f64,
    /// A state in it; if none, the initial state of the search.
    pub through: Option<State>,
}

impl Plane {
    /// The plane through a point normal to the branch without its parameter: a given displacement
    /// along the branch, measured by the shifts and turns of the nodes of this grid only, lest it
    /// depend on how states are interpolated.
    pub fn across(equations: &Equations, point: &Point) -> Self {
        let direction = equations.normalised(Direction {
            increments: point.tangent.increments.clone(),
            params: [0.0],
        });
        Plane {
            dual: equations.momentum(&direction.increments),
            own: 0.0,
            through: Some(point.state.clone()),
        }
    }

    /// The same on the grid with all segments halved; `leaf` is on this one.
    pub fn refined(&self, leaf: &DiscreteLeaf) -> Self {
        Plane {
            dual: at_same_nodes(&self.dual, leaf.first_node()),
            own: self.own,
            through: (self.through.as_ref()).map(|state| prolong(leaf, state)),
        }
    }

    /// Signed distance of a state from it, without the parameter.
    fn distance(&self, state: &State) -> f64 {
        let through = self.through.as_ref();
        through.map_or(0.0, |through| {
            let first = state.segments() + 1 - self.dual[0].len();
            dot(&self.dual, &between(through, state, first))
        })
    }
}

/// Solutions of the equations of a branch at a state.
struct CorrectorStep {
    /// The increments that balance the forces, and the forces of the segments that complete the law
    /// of nearly rigid ones in them.
    forces: Field,
    law_forces: Vec<DVec3>,
    /// The rate of the increments with the parameter.
    rate: Field,
    /// Negative eigenvalues, if they were counted.
    counted: Option<usize>,
}

impl Equations<'_> {
    /// Derivative, with respect to the parameter, of the positions of held nodes that have equations,
    /// which the forces do not contain; `None` if there are none.
    fn held_rate(&mut self, state: &State, fraction: f64) -> Result<Option<Field>, OutOfRange> {
        let leaf = &self.leaves.at([fraction])?.leaf;
        if !leaf.is_held() && !leaf.hinged() {
            return Ok(None);
        }
        let first = self.first_node();
        let held = |step: f64| {
            let mut held = state.clone();
            clamp(self.leaves.at([fraction + step])?, &mut held);
            Ok(between(state, &held, first))
        };
        rate(held).map(Some)
    }

    /// Solves for the forces and their rate with K + shift M: rod by rod if possible,
    /// else by a direct factorisation, which also counts the negative eigenvalues.
    fn solve(
        &mut self,
        at: &Solution,
        linear: &Linear,
        rate: &Field,
    ) -> Result<CorrectorStep, Stuck> {
        let shift = linear.shift;
        self.factorizations += 1;
        if self.rodwise {
            if self.system.factorize(shift) {
                let mut solved = |system: &mut System, rhs: &Field| {
                    system.set_rhs(rhs);
                    let found = system.solve(None, CG_TOLERANCE);
                    matches!(found, Solved::Yes(_)).then(|| system.solution())
                };
                let found = [&linear.forces, rate].map(|rhs| solved(&mut self.system, rhs));
                if let [Some(mut forces), Some(rate)] = found {
                    let (_, law_forces) = self.complete_law(at, &mut forces, &mut solved)?;
                    return Ok(CorrectorStep {
                        forces,
                        law_forces,
                        rate,
                        counted: None,
                    });
                }
            }
            self.rodwise = false;
            self.factorizations += 1;
        }
        let pattern = self.pattern(0)?;
        let mut factor = factorized(&pattern, &self.system, shift)?;
        let mut solved = |rhs: &Field| factor.solve_bordered(rhs, &[]).increments;
        let [mut forces, rate] = [&linear.forces, rate].map(&mut solved);
        let (_, law_forces) =
            self.complete_law(at, &mut forces, &mut |_, rhs| Some(solved(rhs)))?;
        Ok(CorrectorStep {
            forces,
            law_forces,
            rate,
            counted: Some(factor.negative()),
        })
    }

    /// Newton corrector: back to the branch within the plane normal to `normal`
    /// through the given state; without a normal, at the given parameter. The
    /// tangent of the point is oriented along `normal`.
    pub fn correct(
        &mut self,
        state: &State,
        fraction: f64,
        normal: Option<&Direction>,
    ) -> Result<Point, Stuck> {
        let plane = normal.map(|t| Plane {
            dual: self.momentum(&t.increments),
            own: t.params[0],
            through: None,
        });
        let mut point = self.correct_within(state, fraction, plane.as_ref())?;
        if let Some(normal) = normal {
            point.tangent = self.oriented(point.tangent, normal);
        }
        Ok(point)
    }

    /// As [`Equations::correct`], within any plane; the tangent points to growing
    /// values of the parameter.
    pub(super) fn correct_within(
        &mut self,
        state: &State,
        fraction: f64,
        plane: Option<&Plane>,
    ) -> Result<Point, Stuck> {
        let mut now = Solution {
            state: state.clone(),
            params: [fraction],
        };
        let mut previous = f64::INFINITY;
        let mut progress = None;
        for iterations in 1.. {
            self.check_limit()?;
            let rates = self.rates(&now, false)?;
            let linear = self.assemble(&mut now, false)?;
            let CorrectorStep {
                forces,
                law_forces,
                mut rate,
                counted,
            } = self.solve(&now, &linear, &rates[0])?;
            if let Some(held) = self.held_rate(&now.state, now.params[0])? {
                add(&mut rate, 1.0, &held);
            }
            self.exclude_turn(&now, &mut rate)?;
            let step = plane.map_or(0.0, |plane| {
                let off = plane.distance(&now.state) + dot(&plane.dual, &forces);
                -off / (dot(&plane.dual, &rate) + plane.own)
            });
            let increments = plus(&forces, step, &rate);
            let size = larger(largest(&increments), step.abs());
            if !is_finite(&increments) || !step.is_finite() || size > LARGEST {
                return Err(Stuck::NotConverged);
            }
            now.params[0] += step;
            let next = self.corrected(&now.state, now.params, (&increments, &law_forces))?;
            let progress = match &mut progress {
                Some(progress) => progress,
                none => none.insert(ForceProgress::new(self.leaves.at(now.params)?)),
            };
            progress.observe(size, &now.state, &next);
            now.state = next;
            if at_rest(size, previous) && progress.at_rest(ACCURACY) {
                clamp(self.leaves.at(now.params)?, &mut now.state);
                let tangent = self.normalised(Direction {
                    increments: rate,
                    params: [1.0],
                });
                // The factorised matrix is that of the previous state.
                let index = match counted {
                    Some(index) if size < SAME_INDEX => index,
                    _ => self.index(&now)?,
                };
                return Ok(Point {
                    state: now.state,
                    fraction: now.params[0],
                    tangent,
                    index,
                    iterations,
                });
            }
            // Where the matrix is that of a softer leaf, the method converges linearly.
            if iterations >= ITERATIONS && size > CONTRACTING * previous
                || iterations >= MOST_ITERATIONS
            {
                break;
            }
            previous = size;
        }
        Err(Stuck::NotConverged)
    }

    /// Subtracts the turns of veins that can turn without resistance, so that a tangent does not
    /// depend on where the turns are held.
    fn exclude_turn(&mut self, at: &Solution, increments: &mut Field) -> Result<(), OutOfRange> {
        let mut excluded: Vec<Field> = Vec::new();
        for mut turn in self.leaves.at(at.params)?.turns(&at.state) {
            let without = |field: &mut Field, other: &Field| {
                let amount = self.product(other, field) / self.product(other, other);
                add(field, -amount, other);
            };
            excluded.iter().for_each(|other| without(&mut turn, other));
            without(increments, &turn);
            excluded.push(turn);
        }
        Ok(())
    }

    /// Morse index of an equilibrium, without neutral modes.
    fn index(&mut self, solution: &Solution) -> Result<usize, Stuck> {
        let shift = self.leaves.at(solution.params)?.neutral_shift();
        let index = self.index_below(solution, shift)?;
        if shift > NOISY && index != self.index_below(solution, -shift)? {
            return Err(Stuck::Rounding);
        }
        Ok(index)
    }

    /// Number of eigenvalues below minus `shift`.
    fn index_below(&mut self, solution: &Solution, shift: f64) -> Result<usize, Stuck> {
        let leaf = self.leaves.at(solution.params)?;
        let system = &mut self.system;
        self.factorizations += 1;
        system.set_coupling(leaf);
        leaf.assemble(&solution.state, system);
        leaf.hold_turn(&solution.state, system);
        if system.stable_without_coupling(shift) {
            return Ok(0);
        }
        leaf.assemble(&solution.state, system);
        leaf.hold_turn(&solution.state, system);
        self.factorizations += 1;
        let pattern = self.pattern(0)?;
        Ok(factorized(&pattern, &self.system, shift)?.negative())
    }
}

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
