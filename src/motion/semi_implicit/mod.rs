//! The semi-implicit method: the generalised-alpha method of Chung and Hulbert
//! (J. Appl. Mech. 60, 1993) on rotations (Bruls, Cardona, Arnold, Mech. Mach.
//! Theory 48, 2012).
//!
//! It is of second order, stable at any time step for any stiffness, and damps
//! only what the step does not resolve. Every step solves the balance of
//! momentum at its end by Newton's method, with the matrices and the mixed
//! form of the relaxation, which allows rigid rods. Rotations are updated by spatial
//! increments, as everywhere.
//!
//! With d the increment over a step h, v the velocity, a an auxiliary
//! acceleration and w the true one,
//!
//! ```text
//! d = h v0 + h^2 ((1/2 - beta) a0 + beta a1),   v1 = v0 + h ((1 - gamma) a0 + gamma a1)
//! (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) w1 + alpha_f w0
//! ```

mod drag;
mod exchange;
mod initial;
mod step;

use super::energy_balance::{EnergyBalance, Exchange, measure};
use super::method::{TimeIntegrator, Snapshot, Stopped, Velocity};
use super::physics::{Inertia, Physics};
use super::wind::Wind;
use crate::leaf::{DiscreteLeaf, Loads, State, System};
use crate::limit::Limit;
use crate::newton::Definite;
use crate::rod::Section;
use glam::DVec3;

/// Spectral radius rho_inf at infinite frequency: the part of unresolved motion that
/// remains after a step. Smaller values also damp more of what is resolved.
const RHO_INF: f64 = 0.8;

/// Weights of the method.
#[derive(Clone, Copy, Debug)]
struct Weights {
    alpha_m: f64,
    alpha_f: f64,
    gamma: f64,
    beta: f64,
}

impl Weights {
    /// For a spectral radius `rho_inf` at infinite frequency.
    fn of(rho_inf: f64) -> Self {
        let alpha_m = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0);
        let alpha_f = rho_inf / (rho_inf + 1.0);
        let gamma = 0.5 + alpha_f - alpha_m;
        Weights {
            alpha_m,
            alpha_f,
            gamma,
            beta: 0.25 * (gamma + 0.5) * (gamma + 0.5),
        }
    }
}

/// Shortest step, and the part of a step below which differences of time are rounding.
const SHORTEST_STEP: f64 = 1e-10;
const NO_TIME: f64 = 1e-9;

/// Bounds on the ratio of successive steps.
const GROWTH: (f64, f64) = (0.2, 2.0);

/// Advice if energy grows, besides a shorter step, and if steps are too short.
const OTHERWISE: &str = "dynamics.start = \"at-rest\"";
const TOO_SHORT: &str = "use more segments a rod, or slower changes of the loads";
const TOO_SHORT_AT_THE_START: &str = "the arcs it is released from strain rods that are rigid, or nearly so: \
    use dynamics.start = \"at-rest\", or a lower stiffness";

/// Control of the time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// All of this length, except those that end at the times asked for.
    Fixed(f64),
    /// Such that the local error of positions (lengths) and rotations (radians)
    /// stays below this.
    Error(f64),
    /// Bounded like [`Steps::Error`], if only their number matters: equations are solved with
    /// just the accuracy that the local error is estimated with, and no energy balance is kept.
    ToCount(f64),
}

impl Steps {
    /// The permitted local error, if it determines the step.
    fn error(self) -> Option<f64> {
        match self {
            Steps::Fixed(_) => None,
            Steps::Error(error) | Steps::ToCount(error) => Some(error),
        }
    }
}

/// Motion of a node: pairs of an angular and a linear vector.
#[derive(Clone, Copy, Debug, Default)]
struct Moving {
    /// Velocity.
    v: [DVec3; 2],
    /// Auxiliary acceleration.
    a: [DVec3; 2],
    /// Acceleration.
    w: [DVec3; 2],
}

impl Moving {
    /// An acceleration without velocity.
    fn at_rest(w: [DVec3; 2]) -> Self {
        let v = [DVec3::ZERO; 2];
        Moving { v, a: w, w }
    }
}

/// A leaf in semi-implicit motion.
pub struct SemiImplicit {
    leaf: DiscreteLeaf,
    physics: Physics,
    inertia: Vec<Inertia>,
    wind: Option<Wind>,
    /// The rods' own sections, if internal damping changes them.
    sections: Vec<Section>,
    /// Strains (v, u) of all segments at the last step and the one before.
    past: [Vec<[DVec3; 2]>; 2],
    /// Length of the last step; zero if there was none.
    past_step: f64,
    /// Power of internal friction at the last step.
    friction_power: f64,
    system: System,
    solver: Definite,
    state: State,
    trial: State,
    next: State,
    moving: Vec<Moving>,
    next_moving: Vec<Moving>,
    weights: Weights,
    steps: Steps,
    step: f64,
    /// A bound on the steps, and the longest since this was asked last.
    longest: f64,
    longest_made: f64,
    time: f64,
    count: usize,
    /// Number of factorisations.
    pub factorizations: usize,
    balance: EnergyBalance,
    /// Loads by which the accelerations were corrected for the step being attempted.
    corrected: Loads,
    /// Those of the tissue's strips at the start.
    alignments: Vec<bool>,
    limit: Limit,
}

impl SemiImplicit {
    /// A leaf at rest in `state`.
    pub fn new(leaf: DiscreteLeaf, physics: Physics, state: &State, steps: Steps) -> Self {
        let nodes = leaf.each(0..=leaf.segments());
        let mut motion = SemiImplicit {
            inertia: nodes.map(|(j, i)| physics.inertia(&leaf, j, i)).collect(),
            wind: Wind::new(&leaf, &physics),
            sections: leaf.sections.clone(),
            past: [Vec::new(), Vec::new()],
            past_step: 0.0,
            friction_power: 0.0,
            system: System::new(&leaf),
            solver: Definite::default(),
            state: state.clone(),
            trial: state.clone(),
            next: state.clone(),
            moving: vec![Moving::default(); state.x.len()],
            next_moving: vec![Moving::default(); state.x.len()],
            step: match steps {
                Steps::Fixed(h) => h,
                Steps::Error(error) | Steps::ToCount(error) => 0.1 * error.cbrt(),
            },
            longest: f64::INFINITY,
            longest_made: 0.0,
            weights: Weights::of(RHO_INF),
            steps,
            time: 0.0,
            count: 0,
            factorizations: 0,
            balance: EnergyBalance::default(),
            corrected: Loads::default(),
            alignments: leaf.alignments(state),
            limit: Limit::default(),
            leaf,
            physics,
        };
        motion.initialise();
        motion.past = [motion.strains(), motion.strains()];
        let start = motion.snapshot();
        motion.balance.begin(&start);
        motion
    }

    /// Attempts a step that does not go beyond `until`.
    ///
    /// # Errors
    /// If it would be too short, or sections passed half a turn against each other.
    pub fn step_towards(&mut self, until: f64) -> Result<(), Stopped> {
        let left = until - self.time;
        if left < NO_TIME * self.step {
            self.time = until;
            return Ok(());
        }
        let step = self.step.min(self.longest);
        let count = (left / step * (1.0 - 1e-12)).ceil().max(1.0);
        // The last two steps divide the remaining time equally.
        let last = count == 1.0;
        let h = match self.steps {
            Steps::Fixed(_) => left / count,
            _ if count <= 2.0 => left / count,
            _ => step,
        };
        let error = self.attempt(h);
        if let (Some(allowed), Some(error)) = (self.steps.error(), error) {
            let factor = 0.9 * (allowed / error.max(1e-300)).cbrt();
            let next = h * factor.clamp(GROWTH.0, GROWTH.1);
            if error > allowed {
                self.step = next;
                return Ok(());
            }
            // A step cut short by `until` does not limit the next.
            self.step = if last { next.max(self.step) } else { next };
        }
        match error {
            Some(_) => self.accept(h),
            None => self.step = 0.25 * h,
        }
        if let (Steps::Fixed(longest), Some(_)) = (self.steps, error) {
            self.step = longest.min(GROWTH.1 * self.step);
        }
        let time = self.time;
        // Beyond the jump of the law no step may converge.
        let half_turn = match self.step < SHORTEST_STEP {
            true => self.leaf.half_turn_near(&self.state),
            false => (self.leaf).half_turn_since(&self.alignments, &self.state),
        };
        if let Some(half_turn) = half_turn {
            return Err(Stopped::HalfTurn { time, half_turn });
        }
        if self.step < SHORTEST_STEP {
            let started = time > 0.0;
            let advice = if started {
                TOO_SHORT
            } else {
                TOO_SHORT_AT_THE_START
            };
            return Err(Stopped::StepTooShort { time, advice });
        }
        if error.is_some() && last {
            self.time = until;
        }
        Ok(())
    }
}

impl TimeIntegrator for SemiImplicit {
    fn time(&self) -> f64 {
        self.time
    }

    fn steps(&self) -> usize {
        self.count
    }

    fn limit_steps(&mut self, longest: f64) {
        self.longest = longest;
    }

    fn take_longest_step(&mut self) -> f64 {
        std::mem::take(&mut self.longest_made)
    }

    fn set_limit(&mut self, limit: Limit) {
        self.limit = limit;
    }

    fn advance(&mut self, until: f64) -> Result<Snapshot, Stopped> {
        while self.time < until {
            if self.limit.reached() {
                return Err(Stopped::Interrupted { time: self.time });
            }
            // Within a step loads are linear in time: no pulse is stepped over.
            let knot = self.physics.next_knot(self.time);
            self.step_towards(until.min(knot))?;
        }
        let now = self.snapshot();
        (self.balance).judge(&self.leaf, &self.physics, &now, self.step, OTHERWISE)?;
        Ok(now)
    }

    fn snapshot(&mut self) -> Snapshot {
        let velocity = self.moving.iter().map(|m| {
            let [angular, linear] = m.v;
            Velocity { angular, linear }
        });
        let (time, state, velocity) = (self.time, self.state.clone(), velocity.collect::<Vec<_>>());
        self.leaf.sections.clone_from(&self.sections);
        let energy = measure(&mut self.leaf, &self.physics, time, &state, &velocity);
        Snapshot {
            time,
            energy: self.balance.complete(energy, Exchange::default()),
            state,
            velocity,
        }
    }
}
