//! Where the path of slow loading loses its stability: the leaf moves on, down its energy, to another
//! equilibrium under the same part of its loading.
//!
//! The motion is one of a leaf in a very viscous medium: implicit Euler steps without inertia,
//! each solved to convergence, so that segments carry the forces of their strains however stiff
//! they are. It leaves a saddle, or the place of a fold, along the one direction in which the
//! energy falls, and ends at the bottom of the valley that this leads to. Where steps are long it
//! is Newton's method.

use crate::homotopy::{StepEnd, StepSizes};
use crate::leaf::{BucklingMode, NodalField, State, dot};
use crate::newton::{EquilibriumFailure, NewtonEquations, NewtonIteration, is_at_saddle};
use crate::relax::loading::{LoadPath, LoadStepOutcome, PathState};
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

/// Steps back along the path from an equilibrium to which the leaf has moved, as parts of the way to the last one before:
/// beside a bifurcation of a nearly perfect leaf they are short.
const RETURN_STEPS: StepSizes = StepSizes {
    first: 0.25,
    shortest: 1e-3,
    longest: 0.25,
    growth: 2.0,
    failure: 0.25,
};

/// Least amplitude of the mode (lengths, radians) by which a leaf moves between an equilibrium before a bifurcation and
/// the unstable one behind it that is no rounding.
const LEAST_IMPERFECTION: f64 = 1e-6;

/// The amplitude of a mode in which the last equilibrium before a bifurcation differs from the unstable one behind it:
/// zero of a perfect leaf. An imperfect one has e/|m| before and -e/m behind, where 0 = e + m a - a^3 for an
/// imperfection e (M. Golubitsky and D. Schaeffer, Singularities and Groups in Bifurcation Theory I, 1985), and bends to
/// the side of e.
fn imperfection(before: &State, behind: &State, mode: &NodalField, first: usize) -> f64 {
    let mut way = NodalField::new();
    behind.increments_to(before, first, &mut way);
    let largest = mode
        .iter()
        .flatten()
        .flatten()
        .fold(0.0_f64, |m, it| m.max(it.abs()));
    largest * dot(&way, mode) / dot(mode, mode)
}

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
        let last = self.previous_states.last().expect("states");
        let amplitude = imperfection(&last.state, &saddle, &mode, leaf.first_node());
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
        if let Some(side) = self.only_continuation(part, &found, amplitude) {
            self.next = side;
            self.record_event(part, StabilityLoss::BentSharply);
            return Ok(());
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
            let lost = match self.leads_back(part) {
                true => StabilityLoss::BentSharply,
                false => StabilityLoss::Snapped,
            };
            self.record_event(part, lost);
        }
        Ok(())
    }

    /// Of an imperfect leaf the one of two sides from which the path leads back to the last equilibrium: then nothing was
    /// lost, and the other side is one of another path. Where that path is too near to be told apart it leads back from
    /// both, and the imperfection decides.
    fn only_continuation(
        &mut self,
        part: f64,
        sides: &[Option<SideOfSaddle>; 2],
        amplitude: f64,
    ) -> Option<State> {
        let [Some(one), Some(other)] = sides else {
            return None;
        };
        if amplitude.abs() <= LEAST_IMPERFECTION {
            return None;
        }
        let [one, other] = [one, other].map(|side| side.state.clone());
        let leads_back = [&one, &other].map(|side| {
            self.next.clone_from(side);
            self.leads_back(part)
        });
        match leads_back {
            [true, false] => Some(one),
            [false, true] => Some(other),
            [true, true] if amplitude > 0.0 => Some(one),
            [true, true] => Some(other),
            [false, false] => None,
        }
    }

    /// Whether slow unloading leads from the next state, at this part, to the last one before it, stably all the way.
    /// The next state stays as it is.
    fn leads_back(&mut self, part: f64) -> bool {
        let arrived = self.next.clone();
        let (before, reached) = (std::mem::take(&mut self.previous_states), self.lambda);
        let Some(last) = before.last() else {
            return false;
        };
        let from = last.lambda;
        self.previous_states.push(PathState {
            lambda: part,
            state: arrived.clone(),
        });
        let back = RETURN_STEPS.follow(|step| {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                return StepEnd::Ended(EquilibriumFailure::StepLimit);
            }
            let to = part + step.to * (from - part);
            let stable = matches!(self.step_to(to, false), LoadStepOutcome::Stable(_));
            // A leaf that moves farther may have come to another path.
            let last = self.previous_states.last();
            let moved = last.map_or(0.0, |last| self.next.distance(&last.state));
            match stable && moved <= LARGEST_CONTINUOUS_MOTION {
                true => {
                    self.accept(to);
                    StepEnd::Made {
                        growth: RETURN_STEPS.growth,
                    }
                }
                false => StepEnd::TooLong(EquilibriumFailure::NoDescent),
            }
        });
        let there = back.is_ok() && self.next.distance(&last.state) <= LARGEST_CONTINUOUS_MOTION;
        (self.previous_states, self.lambda) = (before, reached);
        self.next = arrived;
        self.loading.carry_to_lambda([part; 2], &mut self.next);
        self.system.set_coupling(&self.loading.leaf);
        there
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    /// A column beyond the weight under which a perfect one buckles, a little out of plumb or not.
    fn column(bending: [f64; 2], push: f64) -> Scenario {
        let text = format!(
            r#"
            name = "column"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 1.0, bending_2 = {:?}, bending_3 = {:?}, axial = inf, shear_2 = inf, shear_3 = inf }}
            load = {{ gravity = [-9.0, 0.0, {push:?}] }}
            "#,
            bending[0], bending[1]
        );
        Scenario::from_toml(&text).unwrap()
    }

    #[test]
    fn an_imperfect_column_bends_to_its_side_and_a_perfect_one_turns_aside() {
        for push in [4e-6, -4e-6, -2e-4] {
            let leaf = column([1.0, 1.3], push).relax().unwrap();
            assert!(leaf.tips[0].z * push > 0.0, "{push}: {}", leaf.tips[0]);
            let path = leaf.path.unwrap();
            assert_eq!(path.word(), "stable-throughout", "{push}: {path:?}");
            assert_eq!(path.events()[0].happening, StabilityLoss::BentSharply);
        }
        for bending in [[1.0, 1.3], [1.0, 1.0]] {
            let leaf = column(bending, 0.0).relax().unwrap();
            assert_eq!(leaf.path.unwrap().word(), "branched", "{bending:?}");
            assert!(leaf.work.steps < 500, "{bending:?}: {:?}", leaf.work);
        }
    }
}
