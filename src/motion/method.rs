//! The interface of all methods of time integration.

use crate::leaf::{HalfTurn, State};
use crate::limit::Limit;
use glam::DVec3;

/// Angular and linear velocity of a node, along the lab axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Angular velocity.
    pub angular: DVec3,
    /// Velocity.
    pub linear: DVec3,
}

/// The energies of a moving leaf. Dimensionless: in A/L.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Energy {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Elastic energy of the strains.
    pub elastic: f64,
    /// Energy of the coupling between rods.
    pub coupling: f64,
    /// Potential of the loads at their present values.
    pub potential: f64,
    /// Energy dissipated by damping since the start.
    pub dissipated: f64,
    /// Work done since the start by varying loads and rest shapes, and by what has no potential:
    /// the moment on a tip, and wind.
    pub work: f64,
}

impl Energy {
    /// The conserved quantity: all energies minus the work.
    pub fn balance(&self) -> f64 {
        self.kinetic + self.elastic + self.coupling + self.potential + self.dissipated - self.work
    }

    /// The energy that has moved, present, dissipated or put in by loads, in a motion that began
    /// with this `potential`.
    pub(crate) fn moved(&self, potential: f64) -> f64 {
        let there = self.kinetic + self.elastic + self.coupling + self.dissipated;
        there.max((self.potential - potential - self.work).abs())
    }

    /// Applies a function to all of them.
    pub fn map(self, change: impl Fn(f64) -> f64) -> Self {
        Energy {
            kinetic: change(self.kinetic),
            elastic: change(self.elastic),
            coupling: change(self.coupling),
            potential: change(self.potential),
            dissipated: change(self.dissipated),
            work: change(self.work),
        }
    }
}

/// A leaf at an instant.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time.
    pub time: f64,
    /// Positions, rotations and segment forces.
    pub state: State,
    /// Velocities of all nodes, as in the state.
    pub velocity: Vec<Velocity>,
    /// Energies.
    pub energy: Energy,
}

/// Why a motion ended early. Times are dimensionless as a [`TimeIntegrator`]
/// returns them, and in the scenario's unit in a simulation.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Stopped {
    /// Energy appeared without cause, or a value is not a number.
    #[error(
        "diverged at t = {time:.6e}: the energy grew {}, which is numerical instability; use a shorter step, or {otherwise}",
        match .percent.is_finite() {
            true => format!("by {percent:.0} % of all that moved"),
            false => "without bound".into(),
        }
    )]
    Diverged {
        /// Time.
        time: f64,
        /// Energy gained, in percent of the largest energy that moved.
        percent: f64,
        /// Further advice.
        otherwise: &'static str,
    },
    /// The grid is too coarse.
    #[error(
        "at t = {time:.6e} a segment is bent by {turn:.2} rad, more than it can resolve; use more segments than {segments}"
    )]
    Unresolved {
        /// Time.
        time: f64,
        /// Bending of the segment, radians.
        turn: f64,
        /// Segments per rod.
        segments: usize,
    },
    /// Sections of neighbouring veins passed half a turn against each other.
    #[error("at t = {time:.6e} {}; the motion cannot be followed beyond: end it before", half_turn.sentence())]
    HalfTurn {
        /// Time.
        time: f64,
        /// Where.
        half_turn: HalfTurn,
    },
    /// No time step is short enough.
    #[error("at t = {time:.6e} no time step is short enough to go on; {advice}")]
    StepTooShort {
        /// Time.
        time: f64,
        /// Advice.
        advice: &'static str,
    },
    /// The limit of the run was reached, e.g. by Ctrl-C.
    #[error("interrupted at t = {time:.6e}")]
    Interrupted {
        /// Time.
        time: f64,
    },
}

impl Stopped {
    /// The word used in `motion.json`.
    pub fn word(self) -> &'static str {
        match self {
            Stopped::Diverged { .. } => "diverged",
            Stopped::Unresolved { .. } => "unresolved",
            Stopped::HalfTurn { .. } => "half-turn",
            Stopped::StepTooShort { .. } => "step-too-short",
            Stopped::Interrupted { .. } => "interrupted",
        }
    }

    /// This reason with its time in another unit, of which the present unit is `unit`.
    pub fn in_unit(mut self, unit: f64) -> Self {
        match &mut self {
            Stopped::Diverged { time, .. }
            | Stopped::Unresolved { time, .. }
            | Stopped::HalfTurn { time, .. }
            | Stopped::StepTooShort { time, .. }
            | Stopped::Interrupted { time } => *time *= unit,
        }
        self
    }
}

/// A method that integrates the motion of a leaf. Dimensionless throughout.
pub trait TimeIntegrator {
    /// Present time.
    fn time(&self) -> f64;

    /// Number of time steps.
    fn steps(&self) -> usize;

    /// Bounds the steps from now on, of a method whose error determines them: the steps of a
    /// finer run that is compared with a coarser one are shorter everywhere, also where the times
    /// asked for limit both.
    fn limit_steps(&mut self, _longest: f64) {}

    /// The longest step since this was asked last, of such a method.
    fn take_longest_step(&mut self) -> f64 {
        f64::INFINITY
    }

    /// Ends the motion at the first step behind a limit.
    fn set_limit(&mut self, limit: Limit);

    /// Advances to exactly `until`; returns the state there, in which the motion is reliable.
    fn advance(&mut self, until: f64) -> Result<Snapshot, Stopped>;

    /// The present state, with positions and velocities at the same instant.
    fn snapshot(&mut self) -> Snapshot;
}
