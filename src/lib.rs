//! leafdyn

pub mod leaf;
pub mod output;
pub mod relax;
pub mod rod;
pub mod rotation;
pub mod scenario;
