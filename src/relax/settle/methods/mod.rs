//! The solution methods, each on one grid or without a grid.

mod damped_motion;
pub mod explicit;
pub mod moment;
pub mod semi_implicit;
pub mod wind;

pub use crate::relax::settle::methods::semi_implicit::softens;

use crate::leaf::State;
use crate::limit::Limit;
use crate::newton::{Definite, Work};

/// Accuracy of the first solutions with conjugate gradients far from rest.
pub const FAR_FROM_REST: f64 = 1e-2;

/// A relaxation on one grid: its state and its parameters.
pub struct Relaxation<'a> {
    pub state: State,
    /// Of positions and rotations.
    pub accuracy: f64,
    pub work: &'a mut Work,
    /// Receives the size of every step or, with the explicit method, the largest unbalanced
    /// force or moment.
    pub progress: &'a mut dyn FnMut(usize, f64),
    pub limit: &'a Limit,
    /// Whether the state is close to equilibrium: a stiff leaf is then not softened first.
    pub near_rest: bool,
    /// Whether the leaf moved through states of non-convex energy.
    pub moved: bool,
    /// Relative accuracy of the conjugate gradients in the first step.
    pub cg_tolerance: f64,
    /// How often it was pushed off saddles before: each time it is softened less, since a
    /// softened leaf may return to the saddle.
    pub pushes: i32,
    pub solver: Definite,
    /// Count of force evaluations at which the iteration ends without success.
    pub most_evaluations: usize,
    /// Whether to fail at once where the energy is not convex.
    pub convex_only: bool,
}

impl<'a> Relaxation<'a> {
    /// From a state far from rest, without a limit on its work but `limit`.
    pub fn new(
        state: State,
        accuracy: f64,
        (work, progress): (&'a mut Work, &'a mut dyn FnMut(usize, f64)),
        limit: &'a Limit,
    ) -> Self {
        Relaxation {
            state,
            accuracy,
            work,
            progress,
            limit,
            near_rest: false,
            moved: false,
            cg_tolerance: FAR_FROM_REST,
            pushes: 0,
            solver: Definite::default(),
            most_evaluations: usize::MAX,
            convex_only: false,
        }
    }
}
