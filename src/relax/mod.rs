//! How a leaf comes to rest: the start, the semi-implicit motion on one grid,
//! the nested grids with their extrapolation, saddles, and the result.

mod equilibrium;
mod grids;
mod moment;
mod options;
mod prolong;
mod report;
mod richardson;
mod saddle;
mod semi_implicit;
mod shape;
mod start;

pub use crate::shape::{NodeState, RodShape};
pub use equilibrium::{Equilibrium, Outcome, Saddle, Work};
pub use grids::relax;
pub use options::{Method, Options, Progress, RelaxError};
pub use start::start;
