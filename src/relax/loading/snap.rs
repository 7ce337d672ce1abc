//! Where the path loses its stability: the leaf moves on, down its energy, to another equilibrium
//! under the same part of the loading.
//!
//! The motion is one of a leaf in a very viscous medium: implicit Euler steps without inertia,
//! each solved to convergence, so that segments carry the forces of their strains however stiff
//! they are. It leaves a saddle, or the place of a fold, along the one direction in which the
//! energy falls, and ends at the bottom of the valley that this leads to. Where steps are long it
//! is Newton's method.

use crate::leaf::State;
use crate::newton::{Equations, Newton, Stop, at_saddle};
use crate::relax::loading::walk::Walk;
use crate::relax::path::Happening;
use crate::relax::saddle;

/// Spring rates (squared frequencies; the lowest of a clamped rod is 12) of the steps: the
/// first, the rate below which there are no springs (beside a bifurcation a leaf moves slowly),
/// and the rates above which the motion fails, in general and where segments are unresolved.
const FIRST_RATE: f64 = 3.0;
const LEAST_RATE: f64 = 0.02;
const LARGEST_RATE: f64 = 1e12;
const LARGEST_UNRESOLVED: f64 = 1e6;

/// Factors by which the rate falls after the first of several successful steps and rises after
/// the first of several failed ones, each time squared, and their limits.
const FIRST_DECREASE: f64 = 0.8;
const LARGEST_DECREASE: f64 = 1.0 / 8.0;
const FIRST_INCREASE: f64 = 3.0;
const LARGEST_INCREASE: f64 = 16.0;

/// Newton iterations of a step, their accuracy, and the largest increment and the largest change
/// in a step (radians, lengths): longer steps could leave the valley.
const ITERATIONS: usize = 12;
const STEP_ACCURACY: f64 = 0.1;
const LARGEST_INCREMENT: f64 = 0.5;
const LARGEST_CHANGE: f64 = 0.5;

/// Accuracy of the equilibrium at the end of a motion.
const AT_REST: f64 = 1e-3;

/// Saddles that are left in one motion.
const SADDLES: usize = 6;

/// A leaf that moves no farther (lengths, radians) has not snapped.
const NEARBY: f64 = 0.05;

impl Walk<'_> {
    /// From the unstable equilibrium in which Newton's method has put the next state the leaf
    /// turns to one of its sides.
    pub fn turn_aside(&mut self, part: f64) -> Result<(), Stop> {
        let saddle = self.next.clone();
        let leaf = &self.loading.leaf;
        let system = &mut self.system;
        if !saddle::find_unstable_mode(leaf, &saddle, system, self.leaning, self.work) {
            return Err(Stop::Stuck);
        }
        let mode = self.system.solution();
        let mut found: [Option<(f64, State)>; 2] = [None, None];
        let mut stopped = Stop::Stuck;
        for (found, sign) in found.iter_mut().zip([1.0, -1.0]) {
            self.next.clone_from(&saddle);
            self.system.set_solution(&mode);
            saddle::displace(&self.loading.leaf, &mut self.next, &self.system, sign);
            match self.move_to_rest() {
                Ok(()) => *found = Some((self.loading.leaf.energy(&self.next), self.next.clone())),
                Err(stop) => stopped = stop,
            }
        }
        let (state, equally_open) = saddle::lower_side(found).ok_or(stopped)?;
        self.next = state;
        self.note(part, Happening::Branched { equally_open });
        Ok(())
    }

    /// From the last equilibrium before the end of the path the leaf snaps.
    pub fn snap(&mut self, part: f64) -> Result<(), Stop> {
        self.carry_last(part);
        let before = self.next.clone();
        self.move_to_rest()?;
        if before.distance(&self.next) > NEARBY {
            self.note(part, Happening::Snapped);
        }
        Ok(())
    }

    /// Moves the next state to rest, leaving saddles.
    fn move_to_rest(&mut self) -> Result<(), Stop> {
        let leaf = &self.loading.leaf;
        leaf.strain_forces(&mut self.next);
        let mut rate = Rate::new();
        let mut saddles = 0;
        while self.work.force_evaluations <= self.most_evaluations && !self.limit.reached() {
            let from = self.next.clone();
            let step = Newton {
                accuracy: if rate.now > 0.0 {
                    STEP_ACCURACY
                } else {
                    AT_REST
                },
                iterations: ITERATIONS,
                work: self.work,
                progress: self.progress,
            };
            let proximal = Equations::Proximal {
                solver: &mut self.solver,
                at: &from,
                rate: rate.now,
                largest: LARGEST_INCREMENT,
            };
            let mut moved = step.solve(leaf, &mut self.next, &mut self.system, proximal);
            if moved.is_ok() && from.distance(&self.next) > LARGEST_CHANGE {
                moved = Err(Stop::Stuck);
            }
            match moved {
                Ok(size)
                    if rate.now == 0.0
                        || at_saddle(leaf, &self.next, self.next.shift_to(&from).max(size)) =>
                {
                    let shift = leaf.neutral_shift();
                    let (state, system) = (&mut self.next, &mut self.system);
                    let index = saddle::index(leaf, state, system, shift, self.work);
                    // Converged to rounding a neutral mode is not unstable.
                    if index == Some(0) || saddle::polish(leaf, state, system, self.work) == Some(0)
                    {
                        return Ok(());
                    }
                    moved = Err(Stop::Saddle);
                }
                _ => {}
            }
            match moved {
                Err(Stop::Saddle) => {
                    saddles += 1;
                    if saddles > SADDLES {
                        return Err(Stop::Saddle);
                    }
                    let (state, system) = (&mut self.next, &mut self.system);
                    saddle::push_off(leaf, state, system, self.leaning, self.work);
                    leaf.strain_forces(&mut self.next);
                    rate = Rate::new();
                }
                Ok(_) => rate.fall(),
                Err(stop) => {
                    self.next = from;
                    rate.rise();
                    let unresolved = stop == Stop::Unresolved && rate.now > LARGEST_UNRESOLVED;
                    if rate.now > LARGEST_RATE || unresolved {
                        return Err(stop);
                    }
                }
            }
        }
        Err(Stop::StepLimit)
    }
}

/// The spring rate of the steps.
struct Rate {
    now: f64,
    /// The factor of its last change.
    factor: f64,
}

impl Rate {
    fn new() -> Self {
        Rate {
            now: FIRST_RATE,
            factor: 1.0,
        }
    }

    /// After a step that succeeded.
    fn fall(&mut self) {
        self.factor = match self.factor {
            fell if fell < 1.0 => (fell * fell).max(LARGEST_DECREASE),
            _ => FIRST_DECREASE,
        };
        self.now *= self.factor;
        if self.now < LEAST_RATE {
            self.now = 0.0;
        }
    }

    /// After a step that failed.
    fn rise(&mut self) {
        self.factor = match self.factor {
            rose if rose > 1.0 => (rose * rose).min(LARGEST_INCREASE),
            _ => FIRST_INCREASE,
        };
        self.now = self.factor * self.now.max(LEAST_RATE);
    }
}
