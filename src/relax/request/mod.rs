//! What is asked of a relaxation: the method, the options, and the leaf on nested grids.

pub mod method;
pub mod options;
pub mod problem;
