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

/// Why a motion cannot go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Broken {
    /// A value is not finite, or energy appeared from nowhere: its balance is
    /// off by so much of the energy that ever moved.
    Diverged {
        /// When.
        time: f64,
        /// The part.
        imbalance: f64,
    },
    /// A segment bends by more than its grid can resolve (radians).
    Unresolved {
        /// When.
        time: f64,
        /// By how much.
        turn: f64,
    },
    /// No time step is short enough.
    StepTooShort {
        /// When.
        time: f64,
    },
}

/// A method that moves a leaf on in time. Dimensionless throughout.
pub trait Method {
    /// Its name.
    fn name(&self) -> &'static str;

    /// The time now.
    fn time(&self) -> f64;

    /// Time steps made.
    fn steps(&self) -> usize;

    /// Moves on to exactly `until`.
    ///
    /// # Errors
    /// If the motion cannot be trusted any more.
    fn advance(&mut self, until: f64) -> Result<(), Broken>;

    /// The leaf now, positions and velocities at the same instant.
    fn snapshot(&mut self) -> Snapshot;

    /// All numbers the motion depends on from here, to go on bit for bit.
    fn save(&self) -> Vec<f64>;

    /// Goes back to what [`Method::save`] told of the same leaf and method;
    /// false if it does not fit.
    fn restore(&mut self, numbers: &[f64]) -> bool;
}
