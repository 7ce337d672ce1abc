//! Along a branch on one grid: where it begins, its steps, and Newton's method back to it.

pub mod begin;
pub mod climb;
pub mod follow;
pub mod steps;
