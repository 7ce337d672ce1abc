//! The path of equilibria on which a leaf is slowly loaded.

pub mod arrival;
pub mod partial;
pub mod snap;
pub mod walk;
