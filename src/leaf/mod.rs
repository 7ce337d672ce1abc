//! The whole leaf, dimensionless and discretised: numbering, loads, coupling,
//! the joint tip, assembly, and the linear algebra that its structure allows.

mod assembly;
mod chain;
mod derivative;
mod dimensionless;
mod direct;
mod discrete;
mod factorised;
mod flow;
mod grid;
mod holds;
mod law;
mod loads;
mod mirror;
mod moments;
#[cfg(test)]
mod not_a_number;
mod own_loads;
mod rest_shape;
mod state;
mod system;
mod tissue;
mod turning;

pub use crate::leaf::derivative::{Forces, LeafRate, Response, at_constant_force};
pub use crate::scenario::Scale;
pub use assembly::{Jump, Tangent};
pub use dimensionless::{Gripped, Leaf, Loads};
pub use direct::{Bordered, DirectError, DirectSolver, Factors};
pub use discrete::DiscreteLeaf;
pub use factorised::Factorised;
pub use flow::{Flow, RodFields, Slice};
pub use grid::Grid;
pub use mirror::{are_mirrored, half_of, is_mirrored, whole_changes, whole_fields, whole_of};
pub use state::{Field, Increment, State, add, shift, turn};
pub use system::{Solved, Sums, System};
pub use tissue::HalfTurn;
