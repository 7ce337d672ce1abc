//! Folds, branch points, and the vertices of pitchforks on one grid.

pub mod critical;
pub mod vertex;
