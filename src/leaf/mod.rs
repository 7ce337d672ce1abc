//! The whole leaf, dimensionless and discretised: numbering, loads, coupling,
//! the joint tip, assembly, and the linear algebra that its structure allows.

mod assembly;
mod chain;
mod dimensionless;
mod discrete;
mod grid;
mod mirror;
mod planar;
mod sparse;
mod state;
mod system;

pub use assembly::Sums;
pub use dimensionless::{Leaf, Scale};
pub use discrete::{DiscreteLeaf, Loads};
pub use grid::Grid;
pub use mirror::{half_of, whole_of};
pub use sparse::{Bordered, SparseError, SparseFactor, SparsePattern};
pub use state::{Field, Increment, State, shift, turn};
pub use system::{Solved, System};
