//! Points of a branch on finer and finer grids, which verify them.

pub mod critical;
pub mod refined;
pub mod regular;
