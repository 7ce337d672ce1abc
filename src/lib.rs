//! leafdyn

pub mod output;
pub mod relax;
pub mod scenario;
mod stand_in;
