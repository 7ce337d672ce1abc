//! How a leaf comes to rest.

mod equilibrium;

pub use equilibrium::{Equilibrium, NodeState, Outcome, RodShape, Saddle, Work};
