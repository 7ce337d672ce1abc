//! Motion in time.

mod energy_balance;
mod explicit;
mod fictitious;
mod friction;
mod kernel;
mod method;
mod nodes;
mod physics;
mod semi_implicit;
mod stable;

pub use explicit::{Explicit, Rigid};
pub use method::{Energy, Method, Snapshot, Stopped, Velocity};
pub use physics::{Inertia, Physics};
pub use semi_implicit::{SemiImplicit, Steps};
pub use stable::StableStep;
