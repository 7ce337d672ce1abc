//! What every method of moving a leaf can do.

use crate::leaf::State;
use glam::DVec3;

/// Angular and linear velocity of a node, along the lab axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Angular velocity.
    pub angular: DVec3,
    /// Velocity.
    pub linear: DVec3,
}

/// Where the energy of a moving leaf is. Dimensionless: A/L.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Energy {
    /// Of motion.
    pub kinetic: f64,
    /// Of the strains.
    pub elastic: f64,
    /// Of the coupling between rods.
    pub coupling: f64,
    /// Potential of the loads as they are now.
    pub potential: f64,
    /// Taken by damping since the beginning.
    pub dissipated: f64,
    /// Put in since the beginning by loads and rest shapes that change, and by
    /// the moment on a tip, which has no potential.
    pub work: f64,
}

impl Energy {
    /// What the motion cannot change: all energies less the work put in.
    pub fn balance(&self) -> f64 {
        self.kinetic + self.elastic + self.coupling + self.potential + self.dissipated - self.work
    }

    /// All of them changed alike.
    pub(crate) fn map(self, change: impl Fn(f64) -> f64) -> Self {
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

/// Why a motion ended before its time. Times are dimensionless as a [`Method`]
/// returns them, and in the scenario's unit as a simulation does.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Stopped {
    /// Energy appeared from nowhere, or a value is not a number.
    #[error(
        "diverged at t = {time:.6e}: energy grew from nowhere by {percent:.0} % of all that moved; use a shorter step, or {otherwise}"
    )]
    Diverged {
        /// When.
        time: f64,
        /// Energy gained, in percent of the largest that ever moved.
        percent: f64,
        /// What else may help.
        otherwise: &'static str,
    },
    /// The grid is too coarse.
    #[error(
        "at t = {time:.6e} a segment is bent by {turn:.2} rad, more than it can resolve; use more segments than {segments}"
    )]
    Unresolved {
        /// When.
        time: f64,
        /// Bending of the segment, radians.
        turn: f64,
        /// Segments a rod.
        segments: usize,
    },
    /// No time step is short enough.
    #[error("at t = {time:.6e} no time step is short enough to go on; {advice}")]
    StepTooShort {
        /// When.
        time: f64,
        /// What may help.
        advice: &'static str,
    },
}

impl Stopped {
    /// The word used in `summary.json`.
    pub fn word(self) -> &'static str {
        match self {
            Stopped::Diverged { .. } => "diverged",
            Stopped::Unresolved { .. } => "unresolved",
            Stopped::StepTooShort { .. } => "step-too-short",
        }
    }

    /// The same with its time in another unit: `unit` is that of the present one.
    pub fn in_unit(mut self, unit: f64) -> Self {
        match &mut self {
            Stopped::Diverged { time, .. }
            | Stopped::Unresolved { time, .. }
            | Stopped::StepTooShort { time, .. } => *time *= unit,
        }
        self
    }
}

/// A method that moves a leaf on in time. Dimensionless throughout.
pub trait Method {
    /// The time now.
    fn time(&self) -> f64;

    /// Time steps made.
    fn steps(&self) -> usize;

    /// Moves on to exactly `until`.
    ///
    /// # Errors
    /// If the motion cannot be trusted any more.
    fn advance(&mut self, until: f64) -> Result<(), Stopped>;

    /// The leaf now, positions and velocities at the same instant.
    fn snapshot(&mut self) -> Snapshot;

    /// All numbers the motion depends on from here, to go on bit for bit.
    fn save(&self) -> Vec<f64>;

    /// Goes back to the numbers that [`Method::save`] returned of the same leaf and
    /// method; false if they do not fit.
    fn restore(&mut self, numbers: &[f64]) -> bool;
}
