//! A leaf on one grid, and from grid to grid: prolongation and prediction.

pub mod level;
pub mod predict;
pub mod prolong;
pub mod stencil;
pub mod strains;
