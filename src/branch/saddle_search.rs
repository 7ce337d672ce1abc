//! From a stable equilibrium uphill to a saddle, and downhill from there.
//!
//! Along a direction v the energy is maximised, across it minimised:
//! with the matrix bordered by the mass matrix times v (as at a critical point),
//! the solution for the border's unit vector is the direction X of the valley floor, and
//! -H its curvature. While this is positive, steps go along X, by a given length or
//! to the maximum along the floor of a cubic, as near a fold; once it is not, v is set
//! to the mode of the lowest eigenvalue, and steps are Newton's (Crippen and Scheraga,
//! Arch. Biochem. Biophys. 144, 1971; Henkelman and Jonsson, J. Chem. Phys. 111, 1999).
//!
//! The descent follows the same floor, and takes Newton's steps once it is convex. The stiffness
//! of the leaf is not reduced meanwhile, which near a fold would lead elsewhere.

use crate::branch::equations::{Equations, Linear, Stuck, factorized};
use crate::branch::{Point, Solution, add, largest, plus, times};
use crate::leaf::{Field, State};

/// Largest number of steps of a climb, and the longest step (radians, lengths).
const STEPS: usize = 60;

const LONGEST: f64 = 0.2;

/// The first step, and the shortest of the cubic model, in the same measure.
const FIRST: f64 = 0.01;

/// Largest number of steps of a descent, its initial perturbation, and the growth of its steps.
const DOWN: usize = 200;

const PUSH: f64 = 0.01;

const GROWTH: f64 = 1.5;

/// Increments below this end with a Newton correction to the equilibrium.
const NEAR: f64 = 1e-2;

/// Shift (in squared frequencies, times the mass matrix) that makes the matrix across the
/// path positive definite: the first tried, and that at which a climb is abandoned.
const FIRST_SHIFT: f64 = 1.0;

const LARGEST_SHIFT: f64 = 1e6;

/// Steps of inverse iteration for the lowest mode, and the factor by which the second shift
/// exceeds the magnitude of its eigenvalue.
const INVERSE_ITERATIONS: usize = 4;

const BELOW: f64 = 1.05;

/// Number of modes in the search for the softest.
const SOFT: usize = 3;

/// The valley floor in a direction.
struct Valley {
    /// X, and the force and the curvature of the energy along it.
    along: Field,
    force: f64,
    curvature: f64,
    /// Newton's step across it.
    across: Field,
    shift: f64,
}

impl Valley {
    /// Newton's step, along the floor as well as across it.
    fn newton(&self) -> Field {
        plus(&self.across, self.force / self.curvature, &self.along)
    }

    /// Distance to the maximum of the energy along the floor, where its slope is minus the force,
    /// for a cubic, which the energy is near a fold; `before`: the curvature `by` so much before.
    /// Infinite if there is none.
    fn distance_to_maximum(&self, (before, by): (f64, f64)) -> f64 {
        let change = (self.curvature - before) / by;
        let square = self.curvature * self.curvature + 2.0 * change * self.force;
        match change < 0.0 && square >= 0.0 {
            true => -(self.curvature + square.sqrt()) / change,
            false => f64::INFINITY,
        }
    }
}

impl Equations<'_> {
    /// A saddle of index one that is reached from `state` uphill, initially along
    /// `direction`; none if none is reached, or if `stop` returns true.
    pub fn climb(
        &mut self,
        state: &State,
        fraction: f64,
        direction: &Field,
        stop: &dyn Fn() -> bool,
    ) -> Option<Point> {
        let mut direction = self.unit(direction);
        let mut now = Solution {
            state: state.clone(),
            params: [fraction],
        };
        // The last step along the floor, and the curvature before it.
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            if stop() {
                return None;
            }
            let linear = self.assemble(&mut now, false).ok()?;
            let mut valley = self.valley(&direction, &linear)?;
            if valley.curvature < 0.0 || valley.shift > linear.shift {
                // Beyond the inflection follow the mode of the lowest eigenvalue.
                direction = self.lowest_mode(&direction)?;
                valley = self.valley(&direction, &linear)?;
            }
            // With exactly one negative eigenvalue the full step is Newton's.
            let newton = valley.curvature < 0.0 && valley.shift == linear.shift;
            let increments = match newton {
                true => valley.newton(),
                false => valley.across.clone(),
            };
            let size = largest(&increments);
            let mut step = times(&increments, (LONGEST / size).min(1.0));
            if !newton && largest(&valley.across) < LONGEST {
                let [shortest, longest] = [FIRST, LONGEST].map(|by| by / largest(&valley.along));
                let length = match before {
                    None => shortest,
                    Some(before) => valley.distance_to_maximum(before).clamp(shortest, longest),
                };
                before = Some((valley.curvature, length));
                add(&mut step, length, &valley.along);
                direction = self.unit(&valley.along);
            }
            now.state = self.advanced(&now.state, now.params, &step, 1.0).ok()?;
            if newton && size < NEAR {
                let point = self.correct(&now.state, fraction, None).ok()?;
                return (point.index == 1).then_some(point);
            }
        }
        None
    }

    /// The eigenvalue nearest to zero at a point, with respect to the mass matrix.
    pub fn softest(&mut self, point: &Point) -> Result<f64, Stuck> {
        let modes = self.soft_modes(point, SOFT)?;
        let linear = self.assemble(&mut point.solution(), false)?;
        let border = [self.momentum(&modes[0])];
        let (solved, _) = self.solve_bordered(&border, &linear.forces, &[], 0.0)?;
        Ok(-solved.h[(0, 0)] / self.mass)
    }

    /// The equilibria to which the leaf descends from a saddle along its unstable mode, on the side
    /// of `direction` and on the other: see [`Equations::descend`].
    pub fn fall(
        &mut self,
        saddle: &Point,
        direction: &Field,
        stop: &dyn Fn() -> bool,
    ) -> Result<[Result<Point, State>; 2], Stuck> {
        self.assemble(&mut saddle.solution(), false)?;
        let mode = self.lowest_mode(direction).ok_or(Stuck::NotConverged)?;
        Ok([1.0, -1.0].map(|sign| {
            let direction = times(&mode, sign);
            self.descend(&saddle.state, saddle.fraction, &direction, stop)
        }))
    }

    /// The stable equilibrium reached downhill from a state at most marginally in equilibrium,
    /// initially along `direction`; if none is reached, the last state.
    pub fn descend(
        &mut self,
        state: &State,
        fraction: f64,
        direction: &Field,
        stop: &dyn Fn() -> bool,
    ) -> Result<Point, State> {
        let (mut direction, mut length) = (self.unit(direction), PUSH);
        let push = times(&direction, PUSH / largest(&direction));
        let params = [fraction];
        let pushed = self.advanced(state, params, &push, 1.0);
        let state = pushed.map_err(|_| state.clone())?;
        let mut now = Solution { state, params };
        for _ in 0..DOWN {
            let next = match stop() {
                true => None,
                false => self.descend_step(&mut now, &mut direction, &mut length),
            };
            let Some((next, near)) = next else {
                return Err(now.state);
            };
            now.state = next;
            if near {
                let rest = self.correct(&now.state, fraction, None).ok();
                return rest.filter(|point| point.index == 0).ok_or(now.state);
            }
        }
        Err(now.state)
    }

    /// A step down the valley floor; the flag says whether it was a short Newton step.
    fn descend_step(
        &mut self,
        now: &mut Solution,
        direction: &mut Field,
        length: &mut f64,
    ) -> Option<(State, bool)> {
        let linear = self.assemble(now, false).ok()?;
        let valley = self.valley(direction, &linear)?;
        let newton = valley.curvature > 0.0 && valley.shift == linear.shift;
        let increments = if newton {
            valley.newton()
        } else if largest(&valley.across) < LONGEST {
            let part = length.copysign(valley.force) / largest(&valley.along);
            *length = (GROWTH * *length).min(LONGEST);
            plus(&valley.across, part, &valley.along)
        } else {
            valley.across
        };
        *direction = self.unit(&valley.along);
        let size = largest(&increments);
        let step = times(&increments, (LONGEST / size).min(1.0));
        let next = self.advanced(&now.state, now.params, &step, 1.0).ok()?;
        Some((next, newton && size < NEAR))
    }

    /// The valley along `direction`, from the assembled matrix.
    fn valley(&mut self, direction: &Field, linear: &Linear) -> Option<Valley> {
        let border = [self.momentum(direction)];
        let mut shift = linear.shift;
        while shift < LARGEST_SHIFT {
            let solved = self.solve_bordered(&border, &linear.forces, &[], shift);
            let (mut solved, _) = solved.ok()?;
            // One negative eigenvalue is due to the border.
            if solved.negative <= 1 {
                let along = solved.modes.swap_remove(0);
                let mass = self.mass * self.product(&along, &along);
                return Some(Valley {
                    along,
                    force: solved.forces.multipliers[0],
                    curvature: -solved.h[(0, 0)] - shift * mass,
                    across: solved.forces.increments,
                    shift,
                });
            }
            shift = (4.0 * shift).max(FIRST_SHIFT);
        }
        None
    }

    /// The mode of the lowest eigenvalue of the assembled matrix, oriented along `direction`, by
    /// inverse iteration from `direction`; the second time with a shift near that eigenvalue.
    fn lowest_mode(&mut self, direction: &Field) -> Option<Field> {
        let pattern = self.pattern(0).ok()?;
        let mut mode = direction.clone();
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
        let same = self.product(&mode, direction) >= 0.0;
        Some(if same { mode } else { times(&mode, -1.0) })
    }

    /// Scales a direction to mass one.
    fn unit(&self, direction: &Field) -> Field {
        times(direction, 1.0 / self.product(direction, direction).sqrt())
    }
}
