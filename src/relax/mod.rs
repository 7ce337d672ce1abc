//! How a leaf comes to rest: the start, the semi-implicit motion on one grid,
//! the nested grids with their extrapolation, saddles, modes, and the result.

mod equilibrium;
mod explicit;
mod grids;
mod index;
mod method;
mod modes;
mod moment;
mod options;
pub(crate) mod prolong;
mod report;
pub(crate) mod richardson;
mod saddle;
mod semi_implicit;
mod shape;
mod shooting;
mod start;

pub use crate::shape::{NodeState, RodShape};
pub use equilibrium::{
    Accuracy, Equilibrium, Mode, Model, Outcome, Saddle, Shape, Stability, Work, serialize_index,
};
pub use grids::{check_segments, relax};
pub use index::{index_near, project};
pub use method::{Method, SemiImplicit, UnknownMethod};
pub use options::{
    LARGEST_TOLERANCE, MAX_NODES, MOST_MODES, Options, Progress, RelaxError, SMALLEST_TOLERANCE,
    check_tolerance,
};
pub(crate) use shape::node as node_state;
pub use shooting::check_intervals;
pub use start::start;
