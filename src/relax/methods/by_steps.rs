//! A second attempt for a leaf that did not come to rest: by steps of its loads and
//! of its stiffness.
//!
//! Of rods that are joined and stiff, or pulled strongly, the energy alone does not
//! say what is progress: nearly all of it is that of constraints not yet met. The
//! leaf is therefore brought to rest under a part of its loads and with rods that
//! stretch and shear more easily, by damped motion under the exact forces of its
//! strains; then loads and stiffness grow in ratio, each time followed by Newton's
//! method in the mixed form, to which constraints are equations like the others.
//! Where there is no equilibrium nearby any more the leaf moves on.

use crate::leaf::{DiscreteLeaf, System};
use crate::newton::{Equations, Newton, Stop, at_saddle};
use crate::relax::methods::semi_implicit::{
    MOVING_COMPLIANCE, MOVING_STRETCH, Relaxation, SMALLEST_MOVING_COMPLIANCE, SOFT_ACCURACY,
};
use crate::relax::saddle;

/// Longest and shortest step in the logarithm of loads and stiffness; while the
/// loads grow, a leaf snaps again and again, and the shortest one is longer.
const LONGEST: f64 = 1.2;
const SHORTEST: f64 = 0.05;
const SHORTEST_LOADING: f64 = 0.3;

/// Saddles that are left on the way at one place.
const SADDLES: usize = 4;

/// Rates (squared frequencies; the lowest of a clamped rod is 12) of steps: the
/// first, by what they rise after a step that fails and fall at most after one that
/// succeeds, below which there is none, and where motion ends, resolved or not.
const FIRST_RATE: f64 = 10.0;
const HARDER: f64 = 8.0;
const LARGEST_EASE: f64 = 8.0;
const LEAST_RATE: f64 = 0.1;
const LARGEST_RATE: f64 = 1e12;
const LARGEST_UNRESOLVED: f64 = 1e6;

/// Newton iterations of a step, their accuracy, and the largest of them (radians,
/// lengths).
const ITERATIONS: usize = 12;
const STEP_ACCURACY: f64 = 1e-3;
const LARGEST_STEP: f64 = 1.5;

/// The leaves on the way, by the logarithm of what has grown.
struct Way<'a> {
    leaf: &'a DiscreteLeaf,
    /// Until here the loads grow, and with them the stiffness.
    loaded: f64,
    end: f64,
}

impl Way<'_> {
    /// Part of the loads that acts.
    fn part(&self, at: f64) -> f64 {
        (at - self.loaded).min(0.0).exp()
    }

    fn leaf(&self, at: f64) -> DiscreteLeaf {
        if at == self.end {
            return self.leaf.clone();
        }
        let mut leaf = self.leaf.softened(MOVING_COMPLIANCE * (-at).exp());
        leaf.load_factor = self.part(at);
        leaf
    }
}

impl Relaxation<'_> {
    /// Lets the leaf come to rest under a part of the loads, softened, and follows it
    /// to all of them and its own stiffness.
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
        let way = Way {
            leaf,
            loaded,
            end: loaded + (MOVING_COMPLIANCE * part / stiffest).ln().max(0.0),
        };
        let (mut reached, mut step) = (0.0, LONGEST);
        let mut first = leaf.softened(MOVING_COMPLIANCE);
        first.load_factor = part;
        self.move_from(&first, system)?;
        loop {
            self.part = way.part(reached);
            let next = match reached + step {
                next if next < way.end - SHORTEST => next,
                _ => way.end,
            };
            let there = way.leaf(next);
            let wanted = match next == way.end {
                true => self.accuracy,
                false => SOFT_ACCURACY,
            };
            let before = self.state.clone();
            let found = self.newton(&there, system, wanted);
            match found {
                Ok(remaining) if next == way.end => return Ok(remaining),
                Ok(_) => {
                    reached = next;
                    step = (2.0 * step).min(LONGEST);
                    continue;
                }
                Err(_) => self.state = before,
            }
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                return Err(Stop::StepLimit);
            }
            let shortest = match reached < way.loaded {
                true => SHORTEST_LOADING,
                false => SHORTEST,
            };
            if step > shortest {
                step /= 2.0;
                continue;
            }
            // The end itself is reached by Newton's method alone.
            reached = (reached + 2.0 * shortest)
                .min(way.end - SHORTEST)
                .max(reached);
            self.move_from(&way.leaf(reached), system)?;
            step = LONGEST / 2.0;
        }
    }

    /// Moves a softened leaf to rest, off saddles too: down its energy, by steps of
    /// implicit Euler without inertia. Each is solved to its end, so that segments
    /// carry the forces of their strains however stiff they are; without end in
    /// time such a step is Newton's.
    fn move_from(&mut self, leaf: &DiscreteLeaf, system: &mut System) -> Result<(), Stop> {
        leaf.strain_forces(&mut self.state);
        let (mut rate, mut ease): (f64, f64) = (0.0, 1.0);
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
            let held = Equations::Held {
                solver: &mut self.solver,
                at: &from,
                rate,
                largest: LARGEST_STEP,
            };
            match step.solve(leaf, &mut self.state, system, held) {
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
                    rate /= ease;
                    ease = (2.0 * ease).min(LARGEST_EASE);
                    if rate < LEAST_RATE {
                        rate = 0.0;
                    }
                }
                Err(stop) => {
                    self.state = from;
                    rate = (HARDER * rate).max(FIRST_RATE);
                    ease = 1.0;
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
