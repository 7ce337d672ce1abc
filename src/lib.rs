//! leafdyn

pub mod leaf;
pub mod relax;
pub mod rod;
pub mod rotation;
pub mod scenario;
