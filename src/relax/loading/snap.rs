//! Where the path of slow loading loses its stability: the leaf moves on, down its energy, to another
//! equilibrium under the same part of its loading.
//!
//! The motion is one of a leaf in a very viscous medium: implicit Euler steps without inertia,
//! each solved to convergence, so that segments carry the forces of their strains however stiff
//! they are. It leaves a saddle, or the place of a fold, along the one direction in which the
//! energy falls, and ends at the bottom of the valley that this leads to. Where steps are long it
//! is Newton's method.

use crate::newton::{EquilibriumFailure, NewtonEquations, NewtonIteration, is_at_saddle};
use crate::relax::loading::LoadPath;
use crate::relax::path::StabilityLoss;
use crate::relax::saddle::{
    SideOfSaddle, converge_saddle, displace, escape_saddle, find_unstable_mode, index,
    lower_energy_side,
};

/// and the rates above which the motion fails, in general and where segments are unresolved.
pub(crate) const FIRST_RATE: f64 = 3.0;

pub(crate) const LEAST_RATE: f64 = 0.02;

pub(crate) const LARGEST_RATE: f64 = 1e12;

pub(crate) const LARGEST_UNRESOLVED_RATE: f64 = 1e6;

/// Factors by which the rate falls after the first of several successful steps and rises after
/// the first of several failed ones, each time squared, and their limits.
pub(crate) const FIRST_DECREASE: f64 = 0.8;

pub(crate) const LARGEST_DECREASE: f64 = 1.0 / 8.0;

pub(crate) const FIRST_INCREASE: f64 = 3.0;

pub(crate) const LARGEST_INCREASE: f64 = 16.0;

/// Newton iterations of a step, their accuracy, and the largest increment and the largest change
/// in a step (radians, lengths): longer steps could leave the valley.
pub(crate) const ITERATIONS: usize = 12;

pub(crate) const STEP_ACCURACY: f64 = 0.1;

pub(crate) const LARGEST_INCREMENT: f64 = 0.5;

pub(crate) const LARGEST_CHANGE: f64 = 0.5;

/// Accuracy of the equilibrium at the end of a motion.
pub(crate) const REST_ACCURACY: f64 = 1e-3;

/// Saddles that are left in one motion.
pub(crate) const MAX_SADDLE_ESCAPES: usize = 6;

/// A leaf that moves no farther (lengths, radians) has not snapped.
pub(crate) const LARGEST_CONTINUOUS_MOTION: f64 = 0.05;

impl LoadPath<'_> {
    /// From the unstable equilibrium in which Newton's method has put the next state the leaf
    /// turns to one of its sides.
    pub fn branch_aside(&mut self, part: f64) -> Result<(), EquilibriumFailure> {
        let saddle = self.next.clone();
        let leaf = &self.loading.leaf;
        let system = &mut self.system;
        if !find_unstable_mode(leaf, &saddle, system, self.bias_direction, self.work) {
            return Err(EquilibriumFailure::NoDescent);
        }
        let mode = self.system.solution();
        let mut found: [Option<SideOfSaddle>; 2] = [None, None];
        let mut stopped = EquilibriumFailure::NoDescent;
        for (found, sign) in found.iter_mut().zip([1.0, -1.0]) {
            self.next.clone_from(&saddle);
            self.system.set_solution(&mode);
            displace(&self.loading.leaf, &mut self.next, &self.system, sign);
            match self.relax_next_state() {
                Ok(()) => {
                    *found = Some(SideOfSaddle::new(&self.loading.leaf, self.next.clone()));
                }
                Err(stop) => stopped = stop,
            }
        }
        let side = lower_energy_side(found).ok_or(stopped)?;
        self.next = side.state;
        let equally_open = side.equally_open;
        self.record_event(part, StabilityLoss::Branched { equally_open });
        Ok(())
    }

    /// From the last equilibrium before the end of the path the leaf snaps.
    pub fn snap_through(&mut self, part: f64) -> Result<(), EquilibriumFailure> {
        self.carry_last(part);
        let before = self.next.clone();
        self.relax_next_state()?;
        if before.distance(&self.next) > LARGEST_CONTINUOUS_MOTION {
            self.record_event(part, StabilityLoss::Snapped);
        }
        Ok(())
    }

    /// Moves the next state to rest, leaving saddles.
    fn relax_next_state(&mut self) -> Result<(), EquilibriumFailure> {
        let leaf = &self.loading.leaf;
        leaf.strain_forces(&mut self.next);
        let mut rate = SpringRate::new();
        let mut saddles = 0;
        while self.work.force_evaluations <= self.most_evaluations && !self.limit.reached() {
            let from = self.next.clone();
            let step = NewtonIteration {
                accuracy: if rate.now > 0.0 {
                    STEP_ACCURACY
                } else {
                    REST_ACCURACY
                },
                iterations: ITERATIONS,
                work: self.work,
                progress: self.progress,
            };
            let proximal = NewtonEquations::Proximal {
                solver: &mut self.solver,
                at: &from,
                rate: rate.now,
                largest: LARGEST_INCREMENT,
            };
            let mut moved = step.solve(leaf, &mut self.next, &mut self.system, proximal);
            if moved.is_ok() && from.distance(&self.next) > LARGEST_CHANGE {
                moved = Err(EquilibriumFailure::NoDescent);
            }
            match moved {
                Ok(size)
                    if rate.now == 0.0
                        || is_at_saddle(
                            leaf,
                            &self.next,
                            self.next.largest_displacement_to(&from).max(size),
                        ) =>
                {
                    let shift = leaf.neutral_shift();
                    let (state, system) = (&mut self.next, &mut self.system);
                    let index = index(leaf, state, system, shift, self.work);
                    // Converged to rounding a neutral mode is not unstable.
                    if index == Some(0)
                        || converge_saddle(leaf, state, system, self.work) == Some(0)
                    {
                        return Ok(());
                    }
                    moved = Err(EquilibriumFailure::Saddle);
                }
                _ => {}
            }
            match moved {
                Err(EquilibriumFailure::Saddle) => {
                    saddles += 1;
                    if saddles > MAX_SADDLE_ESCAPES {
                        return Err(EquilibriumFailure::Saddle);
                    }
                    let (state, system) = (&mut self.next, &mut self.system);
                    escape_saddle(leaf, state, system, self.bias_direction, self.work);
                    leaf.strain_forces(&mut self.next);
                    rate = SpringRate::new();
                }
                Ok(_) => rate.decrease_after_success(),
                Err(stop) => {
                    self.next = from;
                    rate.increase_after_failure();
                    let unresolved = stop == EquilibriumFailure::Unresolved
                        && rate.now > LARGEST_UNRESOLVED_RATE;
                    if rate.now > LARGEST_RATE || unresolved {
                        return Err(stop);
                    }
                }
            }
        }
        Err(EquilibriumFailure::StepLimit)
    }
}

/// The spring rate of the steps.
pub(crate) struct SpringRate {
    now: f64,
    /// The factor of its last change.
    factor: f64,
}

impl SpringRate {
    fn new() -> Self {
        SpringRate {
            now: FIRST_RATE,
            factor: 1.0,
        }
    }

    /// After a step that succeeded.
    fn decrease_after_success(&mut self) {
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
    fn increase_after_failure(&mut self) {
        self.factor = match self.factor {
            rose if rose > 1.0 => (rose * rose).min(LARGEST_INCREASE),
            _ => FIRST_INCREASE,
        };
        self.now = self.factor * self.now.max(LEAST_RATE);
    }
}
