//! Motion in time.

mod energy_balance;
mod explicit;
mod friction;
mod method;
mod physics;
mod semi_implicit;
mod unstrained;
mod wind;

pub use explicit::{Explicit, Rigid, StableStep};
pub use method::{Energy, TimeIntegrator, Snapshot, Stopped, Velocity};
pub use physics::{Inertia, Physics};
pub use semi_implicit::{SemiImplicit, Steps};
pub use unstrained::unstrained;
pub use wind::{Drag, Wind};
