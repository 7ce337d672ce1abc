//! The methods that bring a leaf to rest, each on one grid, or without one.

mod by_steps;
pub mod explicit;
pub mod moment;
pub mod semi_implicit;
pub mod shooting;
