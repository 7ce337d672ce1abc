//! Where the path of slow loading loses its stability: the leaf moves on, down its energy, to another
//! equilibrium under the same part of its loading.
//!
//! The motion is one of a leaf in a very viscous medium: implicit Euler steps without inertia,
//! each solved to convergence, so that segments carry the forces of their strains however stiff
//! they are. It leaves a saddle, or the place of a fold, along the one direction in which the
//! energy falls, and ends at the bottom of the valley that this leads to. Where steps are long it
//! is Newton's method.

use crate::leaf::BucklingMode;
use crate::newton::{EquilibriumFailure, NewtonEquations, NewtonIteration, is_at_saddle};
use crate::relax::loading::LoadPath;
use crate::relax::path::StabilityLoss;
use crate::relax::saddle::{
    SideOfSaddle, converge_saddle, displace, escape_saddle, find_unstable_mode, index,
    lower_energy_side,
};

/// The viscous motion of a leaf that has lost its stability. Its implicit Euler steps have springs to the
/// state before, whose rates are squared frequencies; the lowest of a clamped rod is 12.
struct ViscousMotion {
    /// The first spring rate. A smaller one makes longer steps, which may leave the valley.
    first_rate: f64,
    /// The rate below which there are no springs: beside a bifurcation a leaf moves slowly.
    least_rate: f64,
    /// The rate above which the motion fails.
    largest_rate: f64,
    /// The rate above which it fails where segments are unresolved.
    largest_unresolved_rate: f64,
    /// Factor on the rate after the first of several successful steps, squared after each further one.
    first_decrease: f64,
    /// The least of these factors.
    largest_decrease: f64,
    /// Factor on the rate after the first of several failed steps, squared after each further one.
    first_increase: f64,
    /// The largest of these factors.
    largest_increase: f64,
    /// Newton iterations of a step.
    iterations: usize,
    /// Accuracy of a step, lengths and radians.
    step_accuracy: f64,
    /// Largest increment of an iteration (radians, lengths): a longer one could leave the valley.
    largest_increment: f64,
    /// Largest change in a step (radians, lengths), for the same reason.
    largest_change: f64,
    /// Accuracy of the equilibrium at the end, lengths and radians.
    rest_accuracy: f64,
    /// Saddles that are left in one motion.
    most_saddles: usize,
}

const MOTION: ViscousMotion = ViscousMotion {
    first_rate: 3.0,
    least_rate: 0.02,
    largest_rate: 1e12,
    largest_unresolved_rate: 1e6,
    first_decrease: 0.8,
    largest_decrease: 1.0 / 8.0,
    first_increase: 3.0,
    largest_increase: 16.0,
    iterations: 12,
    step_accuracy: 0.1,
    largest_increment: 0.5,
    largest_change: 0.5,
    rest_accuracy: 1e-3,
    most_saddles: 6,
};

/// A leaf that moves no farther (lengths, radians) has not snapped.
const LARGEST_CONTINUOUS_MOTION: f64 = 0.05;

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
        let mode = BucklingMode::of_increments(&saddle, &mode);
        self.record_event(part, StabilityLoss::Branched { equally_open, mode });
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
                    MOTION.step_accuracy
                } else {
                    MOTION.rest_accuracy
                },
                iterations: MOTION.iterations,
                work: self.work,
                progress: self.progress,
            };
            let proximal = NewtonEquations::Proximal {
                solver: &mut self.solver,
                at: &from,
                rate: rate.now,
                largest: MOTION.largest_increment,
            };
            let mut moved = step.solve(leaf, &mut self.next, &mut self.system, proximal);
            if moved.is_ok() && from.distance(&self.next) > MOTION.largest_change {
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
                    if saddles > MOTION.most_saddles {
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
                        && rate.now > MOTION.largest_unresolved_rate;
                    if rate.now > MOTION.largest_rate || unresolved {
                        return Err(stop);
                    }
                }
            }
        }
        Err(EquilibriumFailure::StepLimit)
    }
}

/// The spring rate of the steps.
struct SpringRate {
    now: f64,
    /// The factor of its last change.
    factor: f64,
}

impl SpringRate {
    fn new() -> Self {
        SpringRate {
            now: MOTION.first_rate,
            factor: 1.0,
        }
    }

    /// Lowers the spring rate after a step that succeeded.
    fn decrease_after_success(&mut self) {
        self.factor = match self.factor {
            fell if fell < 1.0 => (fell * fell).max(MOTION.largest_decrease),
            _ => MOTION.first_decrease,
        };
        self.now *= self.factor;
        if self.now < MOTION.least_rate {
            self.now = 0.0;
        }
    }

    /// Raises the spring rate after a step that failed.
    fn increase_after_failure(&mut self) {
        self.factor = match self.factor {
            rose if rose > 1.0 => (rose * rose).min(MOTION.largest_increase),
            _ => MOTION.first_increase,
        };
        self.now = self.factor * self.now.max(MOTION.least_rate);
    }
}
