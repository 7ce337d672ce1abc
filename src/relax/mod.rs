//! How a leaf comes to rest.

mod equilibrium;

pub use equilibrium::{Equilibrium, NodeState, Outcome, RodShape, Saddle, Work};

// STAND-IN
pub use crate::stand_in::{Method, Options, Progress, RelaxError, relax};
