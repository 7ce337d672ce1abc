//! Whether a leaf at rest is stable: counts of negative eigenvalues, and the eigenvalues that decide.

pub mod decide;
pub mod eigenvalue_bars;
pub mod eigenvalues;
pub mod index;
