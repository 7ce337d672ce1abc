//! The solution methods, each on one grid or without a grid.

mod by_steps;
mod damped_motion;
pub mod explicit;
pub mod moment;
pub mod semi_implicit;
pub mod shooting;
