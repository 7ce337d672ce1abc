//! Motion in time.

mod explicit;
mod fictitious;
mod kernel;
mod lanes;
mod ledger;
mod method;
mod nodes;
mod physics;
mod semi_implicit;

pub use explicit::{Explicit, Rigid, StableStep};
pub use method::{Broken, Energy, Method, Snapshot, Velocity};
pub use physics::{Inertia, Physics};
pub use semi_implicit::{SemiImplicit, Steps};
