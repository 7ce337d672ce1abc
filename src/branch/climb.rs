//! From a stable equilibrium uphill to a saddle.
//!
//! Along a direction v the energy is made as large as it can be, across it as
//! small: with the matrix bordered by the masses times v (as at a critical point),
//! the solution for the border's unit is the direction X of the valley floor, and
//! -H its curvature. Where that is positive the way goes on along X by a given
//! length; where it is negative both parts are Newton's (Crippen and Scheraga, Arch.
//! Biochem. Biophys. 144, 1971; Henkelman and Jonsson, J. Chem. Phys. 111, 1999).

use super::Point;
use super::equations::Equations;
use super::field::{add, largest, times};
use crate::leaf::{Field, State};

/// Steps of a climb, and the longest (radians, lengths).
const STEPS: usize = 60;
const LONGEST: f64 = 0.2;

/// Increments below this lead to the saddle by Newton's method.
const NEAR: f64 = 1e-2;

/// Shift (in squared frequencies, over the masses) that makes the matrix across the
/// way positive definite: the first tried, and that at which a climb ends.
const FIRST_SHIFT: f64 = 1.0;
const LARGEST_SHIFT: f64 = 1e6;

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
        for _ in 0..STEPS {
            if stop() {
                return None;
            }
            let linear = self.linearise(&mut state, fraction).ok()?;
            let border = [self.momentum(&way)];
            let mut shift = linear.shift;
            let solved = loop {
                let solved = self.solve_shifted(&border, &linear.forces, &[], shift);
                let solved = solved.ok()?;
                // One of them is the border's own.
                if solved.negative <= 1 {
                    break solved;
                }
                shift = (4.0 * shift).max(FIRST_SHIFT);
                if shift > LARGEST_SHIFT {
                    return None;
                }
            };
            let along = &solved.modes[0];
            let mass = self.mass * self.product(along, along);
            let curvature = -solved.h[(0, 0)] - shift * mass;
            let force = solved.forces.multipliers[0];
            let longest = LONGEST / largest(along);
            let newton = curvature < 0.0;
            let part = match newton {
                // Uphill on both sides of the pass.
                true => (force / curvature).clamp(-longest, longest),
                false => longest,
            };
            let across = &solved.forces.increments;
            let short = (LONGEST / largest(across)).min(1.0);
            let mut increments = times(across, short);
            add(&mut increments, part, along);
            state = self.moved(&state, fraction, &increments, 1.0).ok()?;
            if newton && shift == linear.shift && largest(&increments) < NEAR {
                let (point, _) = self.correct(&state, fraction, None).ok()?;
                return (point.index == 1).then_some(point);
            }
            if !newton {
                way = self.unit(along);
            }
        }
        None
    }

    /// A direction of mass one.
    fn unit(&self, way: &Field) -> Field {
        times(way, 1.0 / self.product(way, way).sqrt())
    }
}
