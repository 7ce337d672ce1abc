//! A second attempt for a leaf that did not come to rest: continuation in its loads and its
//! stiffness.
//!
//! For rods that are joined and stiff, or pulled strongly, the energy is a poor measure of
//! progress: nearly all of it comes from constraints not yet satisfied. The leaf is therefore
//! brought to rest under a part of its loads and with rods that stretch and shear more easily, by
//! damped motion under the exact forces of its strains; then loads and stiffness are increased by
//! factors, with Newton's method in the mixed form after each step, in which constraints are
//! equations like all others. Where no equilibrium is found nearby, the damped motion is repeated.

use crate::leaf::{DiscreteLeaf, System};
use crate::newton::{Equations, Newton, Stop, at_saddle};
use crate::relax::methods::Relaxation;
use crate::relax::methods::semi_implicit::{
    MOVING_COMPLIANCE, MOVING_STRETCH, SMALLEST_MOVING_COMPLIANCE, SOFT_ACCURACY,
};
use crate::relax::saddle;

/// Longest and shortest step in the logarithm of loads and stiffness; the shortest is longer
/// while the loads grow, since a leaf then snaps repeatedly.
const LONGEST: f64 = 1.2;
const SHORTEST: f64 = 0.05;
const SHORTEST_LOADING: f64 = 0.3;

/// Saddles that are left in one damped motion.
const SADDLES: usize = 4;

/// Spring rates (squared frequencies; the lowest of a clamped rod is 12) of the proximal
/// steps: the first, the factors by which they rise after a failed step and fall at most after
/// a successful one, the rate below which there are no springs, and the rates above which the
/// motion fails, in general and where segments are unresolved.
const FIRST_RATE: f64 = 10.0;
const RATE_INCREASE: f64 = 8.0;
const LARGEST_RATE_DECREASE: f64 = 8.0;
const LEAST_RATE: f64 = 0.1;
const LARGEST_RATE: f64 = 1e12;
const LARGEST_UNRESOLVED: f64 = 1e6;

/// Newton iterations of a step, their accuracy, and their largest increment (radians,
/// lengths).
const ITERATIONS: usize = 12;
const STEP_ACCURACY: f64 = 1e-3;
const LARGEST_STEP: f64 = 1.5;

impl Relaxation<'_> {
    /// Brings the softened leaf to rest under a part of the loads, and continues it to the
    /// full loads and its own stiffness. Its points are the logarithms of the growth of both: up
    /// to `loaded` loads and stiffness grow, beyond it the stiffness alone.
    pub(super) fn settle_by_steps(
        &mut self,
        leaf: &DiscreteLeaf,
        system: &mut System,
    ) -> Result<f64, Stop> {
        self.moved_softened = true;
        let load = leaf.leaf.loads.tip_force.length() + leaf.leaf.loads.gravity.length();
        let part = (MOVING_STRETCH / (MOVING_COMPLIANCE * load)).min(1.0);
        let stiffest = leaf.stiffest().max(SMALLEST_MOVING_COMPLIANCE);
        let loaded = -part.ln();
        let end = loaded + (MOVING_COMPLIANCE * part / stiffest).ln().max(0.0);
        let load_part = |at: f64| (at - loaded).min(0.0).exp();
        let softened = |at: f64| {
            let mut leaf = leaf.softened(MOVING_COMPLIANCE * (-at).exp());
            leaf.load_factor = load_part(at);
            leaf
        };
        let (mut reached, mut step) = (0.0, LONGEST);
        self.move_from(&softened(0.0), system)?;
        loop {
            self.load_part = load_part(reached);
            let before = self.state.clone();
            let next = match reached + step {
                next if next < end - SHORTEST => next,
                _ => end,
            };
            let found = match next < end {
                true => self.newton(&softened(next), system, SOFT_ACCURACY),
                false => self.newton(leaf, system, self.accuracy),
            };
            match found {
                Ok(remaining) if next == end => return Ok(remaining),
                Ok(_) => {
                    reached = next;
                    step = (2.0 * step).min(LONGEST);
                    continue;
                }
                Err(Stop::Memory) => return Err(Stop::Memory),
                Err(_) => self.state = before,
            }
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                return Err(Stop::StepLimit);
            }
            let shortest = match reached < loaded {
                true => SHORTEST_LOADING,
                false => SHORTEST,
            };
            if step > shortest {
                step /= 2.0;
                continue;
            }
            // The end point itself is reached by Newton's method only.
            reached = (reached + 2.0 * shortest).min(end - SHORTEST).max(reached);
            self.move_from(&softened(reached), system)?;
            step = LONGEST / 2.0;
        }
    }

    /// Moves a softened leaf to rest, leaving saddles: down its energy by implicit Euler steps
    /// without inertia. Each is solved to convergence, so that segments carry the forces of
    /// their strains however stiff they are; in the limit of long time steps it is Newton's
    /// method.
    fn move_from(&mut self, leaf: &DiscreteLeaf, system: &mut System) -> Result<(), Stop> {
        leaf.strain_forces(&mut self.state);
        let (mut rate, mut decrease): (f64, f64) = (0.0, 1.0);
        let mut saddles = 0;
        while self.work.force_evaluations <= self.most_evaluations && !self.limit.reached() {
            let from = self.state.clone();
            let accuracy = if rate > 0.0 {
                STEP_ACCURACY
            } else {
                SOFT_ACCURACY
            };
            let step = Newton {
                accuracy,
                iterations: ITERATIONS,
                work: self.work,
                progress: self.progress,
            };
            let proximal = Equations::Proximal {
                solver: &mut self.solver,
                at: &from,
                rate,
                largest: LARGEST_STEP,
            };
            match step.solve(leaf, &mut self.state, system, proximal) {
                Ok(_) if rate == 0.0 => return Ok(()),
                Ok(size) if at_saddle(leaf, &self.state, self.state.shift_to(&from).max(size)) => {
                    saddles += 1;
                    if saddles > SADDLES {
                        return Err(Stop::Saddle);
                    }
                    saddle::push_off(leaf, &mut self.state, system, self.work);
                    leaf.strain_forces(&mut self.state);
                }
                Ok(_) => {
                    rate /= decrease;
                    decrease = (2.0 * decrease).min(LARGEST_RATE_DECREASE);
                    if rate < LEAST_RATE {
                        rate = 0.0;
                    }
                }
                Err(Stop::Memory) => return Err(Stop::Memory),
                Err(stop) => {
                    self.state = from;
                    rate = (RATE_INCREASE * rate).max(FIRST_RATE);
                    decrease = 1.0;
                    if rate > LARGEST_RATE || stop == Stop::Unresolved && rate > LARGEST_UNRESOLVED
                    {
                        return Err(stop);
                    }
                }
            }
        }
        Err(Stop::StepLimit)
    }
}
