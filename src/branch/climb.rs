//! From a stable equilibrium uphill to a saddle, and down from there.
//!
//! Along a direction v the energy is made as large as it can be, across it as
//! small: with the matrix bordered by the masses times v (as at a critical point),
//! the solution for the border's unit is the direction X of the valley floor, and
//! -H its curvature. Where that is positive the way goes on along X, by a given length or
//! to where the floor is highest by a cubic, as near a fold it is; where it is not, v
//! becomes the mode of the lowest eigenvalue, and the steps Newton's (Crippen and Scheraga,
//! Arch. Biochem. Biophys. 144, 1971; Henkelman and Jonsson, J. Chem. Phys. 111, 1999).
//!
//! The way down follows the same floor, whose lowest point is Newton's once it is convex. No
//! stiffness is taken from the leaf meanwhile, which near a fold would lead elsewhere.

use super::Point;
use super::deflation::Solved;
use super::equations::{Equations, Linear, Stuck, factorized};
use super::field::{add, largest, times};
use crate::leaf::{Field, State};

/// Steps of a climb, and the longest (radians, lengths).
const STEPS: usize = 60;
const LONGEST: f64 = 0.2;

/// The first step, and the shortest by the cubic model, in the same measure.
const FIRST: f64 = 0.01;

/// Steps of a way down, the push at its beginning, and the growth of its steps.
const DOWN: usize = 200;
const PUSH: f64 = 0.01;
const GROWTH: f64 = 1.5;

/// Increments below this lead to the equilibrium by Newton's method.
const NEAR: f64 = 1e-2;

/// Shift (in squared frequencies, over the masses) that makes the matrix across the
/// way positive definite: the first tried, and that at which a climb ends.
const FIRST_SHIFT: f64 = 1.0;
const LARGEST_SHIFT: f64 = 1e6;

/// Steps of inverse iteration for the lowest mode, and how far below its eigenvalue the
/// second shift is.
const INVERSE_ITERATIONS: usize = 4;
const BELOW: f64 = 1.05;

/// Modes among which the softest is sought.
const SOFT: usize = 3;

/// The valley floor in some direction.
struct Valley {
    /// Solutions with the bordered matrix.
    solved: Solved,
    /// By how much it was shifted.
    shift: f64,
    /// Curvature of the floor.
    curvature: f64,
}

impl Equations<'_> {
    /// A saddle of index one that is reached from `state` uphill, first in the direction
    /// `way`; none if the way does not lead to one, or `stop` says so.
    pub fn climb(
        &mut self,
        state: &State,
        fraction: f64,
        way: &Field,
        stop: &dyn Fn() -> bool,
    ) -> Option<Point> {
        let (mut state, mut way) = (state.clone(), self.unit(way));
        // Curvature of the floor before the last step along it, and that step.
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            if stop() {
                return None;
            }
            let linear = self.linearise(&mut state, fraction).ok()?;
            let mut valley = self.valley(&way, &linear)?;
            if valley.curvature < 0.0 || valley.shift > linear.shift {
                // Past the rim the way is that of the lowest eigenvalue.
                way = self.lowest_mode(&way)?;
                valley = self.valley(&way, &linear)?;
            }
            let Valley {
                solved,
                shift,
                curvature,
            } = valley;
            let (along, force) = (&solved.modes[0], solved.forces.multipliers[0]);
            let across = &solved.forces.increments;
            let mut increments = across.clone();
            // With one negative eigenvalue the whole step is Newton's.
            let newton = curvature < 0.0 && shift == linear.shift;
            if newton {
                add(&mut increments, force / curvature, along);
            }
            let (size, settled) = (largest(&increments), largest(across) < LONGEST);
            let mut step = times(&increments, (LONGEST / size).min(1.0));
            if !newton && settled {
                let [shortest, longest] = [FIRST, LONGEST].map(|by| by / largest(along));
                let far = match before {
                    None => shortest,
                    Some((last, by)) => {
                        let change = (curvature - last) / by;
                        to_rim(force, curvature, change).clamp(shortest, longest)
                    }
                };
                before = Some((curvature, far));
                add(&mut step, far, along);
                way = self.unit(along);
            }
            state = self.moved(&state, fraction, &step, 1.0).ok()?;
            if newton && size < NEAR {
                let (point, _) = self.correct(&state, fraction, None).ok()?;
                return (point.index == 1).then_some(point);
            }
        }
        None
    }

    /// The eigenvalue over the masses that is next to zero at a point.
    pub fn softest(&mut self, point: &Point) -> Result<f64, Stuck> {
        let modes = self.soft_modes(point, SOFT)?;
        let linear = self.linearise(&mut point.state.clone(), point.fraction)?;
        let border = [self.momentum(&modes[0])];
        let solved = self.solve_shifted(&border, &linear.forces, &[], 0.0)?;
        Ok(-solved.h[(0, 0)] / self.mass)
    }

    /// Where the leaf comes to rest that leaves a saddle along its unstable mode, to the side
    /// of `way` and to the other: see [`Equations::descend`].
    pub fn fall(
        &mut self,
        saddle: &Point,
        way: &Field,
        stop: &dyn Fn() -> bool,
    ) -> Result<[Result<Point, State>; 2], Stuck> {
        self.linearise(&mut saddle.state.clone(), saddle.fraction)?;
        let mode = self.lowest_mode(way).ok_or(Stuck::NotConverged)?;
        Ok([1.0, -1.0].map(|sign| {
            let way = times(&mode, sign);
            self.descend(&saddle.state, saddle.fraction, &way, stop)
        }))
    }

    /// The stable equilibrium that is reached downhill from a state that is none, or hardly
    /// one, first in the direction `way`; if none is, how far the way led.
    pub fn descend(
        &mut self,
        state: &State,
        fraction: f64,
        way: &Field,
        stop: &dyn Fn() -> bool,
    ) -> Result<Point, State> {
        let (mut way, mut far) = (self.unit(way), PUSH);
        let push = times(&way, PUSH / largest(&way));
        let mut state = (self.moved(state, fraction, &push, 1.0)).map_err(|_| state.clone())?;
        for _ in 0..DOWN {
            let next = match stop() {
                true => None,
                false => self.step_down(&mut state, fraction, &mut way, &mut far),
            };
            let Some((next, near)) = next else {
                return Err(state);
            };
            state = next;
            if near {
                let rest = self.correct(&state, fraction, None).ok();
                let rest = rest.filter(|(point, _)| point.index == 0);
                return rest.map(|(point, _)| point).ok_or(state);
            }
        }
        Err(state)
    }

    /// A step down the valley floor; also whether it was a short one of Newton's method.
    fn step_down(
        &mut self,
        state: &mut State,
        fraction: f64,
        way: &mut Field,
        far: &mut f64,
    ) -> Option<(State, bool)> {
        let linear = self.linearise(state, fraction).ok()?;
        let Valley {
            solved,
            shift,
            curvature,
        } = self.valley(way, &linear)?;
        let (along, force) = (&solved.modes[0], solved.forces.multipliers[0]);
        let across = &solved.forces.increments;
        let newton = curvature > 0.0 && shift == linear.shift;
        let mut increments = across.clone();
        if newton {
            add(&mut increments, force / curvature, along);
        } else if largest(across) < LONGEST {
            add(&mut increments, far.copysign(force) / largest(along), along);
            *far = (GROWTH * *far).min(LONGEST);
        }
        *way = self.unit(along);
        let size = largest(&increments);
        let step = times(&increments, (LONGEST / size).min(1.0));
        let next = self.moved(state, fraction, &step, 1.0).ok()?;
        Some((next, newton && size < NEAR))
    }

    /// The valley in the direction `way`, by the matrix that is assembled.
    fn valley(&mut self, way: &Field, linear: &Linear) -> Option<Valley> {
        let border = [self.momentum(way)];
        let mut shift = linear.shift;
        while shift < LARGEST_SHIFT {
            let solved = self
                .solve_shifted(&border, &linear.forces, &[], shift)
                .ok()?;
            // One of them is the border's own.
            if solved.negative <= 1 {
                let along = &solved.modes[0];
                let mass = self.mass * self.product(along, along);
                return Some(Valley {
                    curvature: -solved.h[(0, 0)] - shift * mass,
                    solved,
                    shift,
                });
            }
            shift = (4.0 * shift).max(FIRST_SHIFT);
        }
        None
    }

    /// The mode of the lowest eigenvalue of the matrix that is assembled, near `way` and
    /// to its side; by inverse iteration, the second time with a shift near that value.
    fn lowest_mode(&mut self, way: &Field) -> Option<Field> {
        let pattern = self.pattern(0).ok()?;
        let mut mode = way.clone();
        let mut shift = FIRST_SHIFT;
        for _ in 0..2 {
            let mut factor = factorized(&pattern, &self.system, shift).ok()?;
            while factor.negative() > 0 {
                shift *= 2.0;
                if shift > LARGEST_SHIFT {
                    return None;
                }
                factor = factorized(&pattern, &self.system, shift).ok()?;
            }
            let mut eigenvalue = 0.0;
            for _ in 0..INVERSE_ITERATIONS {
                let next = factor.solve_bordered(&self.momentum(&mode), &[]).increments;
                eigenvalue = 1.0 / (self.mass * self.product(&mode, &next)) - shift;
                mode = self.unit(&next);
            }
            shift = BELOW * eigenvalue.abs();
        }
        let same = self.product(&mode, way) >= 0.0;
        Some(if same { mode } else { times(&mode, -1.0) })
    }

    /// A direction of mass one.
    fn unit(&self, way: &Field) -> Field {
        times(way, 1.0 / self.product(way, way).sqrt())
    }
}

/// How far the highest point of the floor is, where its slope is minus `force`, its
/// curvature positive, and this changes so much with the way: as of a cubic, which the
/// energy is near a fold. Infinite if there is none.
fn to_rim(force: f64, curvature: f64, change: f64) -> f64 {
    let square = curvature * curvature + 2.0 * change * force;
    match change < 0.0 && square >= 0.0 {
        true => -(curvature + square.sqrt()) / change,
        false => f64::INFINITY,
    }
}
