//! leafdyn

pub mod relax;
pub mod scenario;
