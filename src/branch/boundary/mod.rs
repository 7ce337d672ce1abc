//! The boundary of stability as a curve: a critical point of a branch along one parameter,
//! continued in a second one.
//!
//! Equilibria of leaves that differ in two parameters l = (l1, l2) form a two-dimensional
//! manifold g(z, l) = 0. On it, the matrix K is singular along curves. With K bordered by soft
//! modes, as in [`crate::branch`], an eigenvalue h of H is zero there: the minimally augmented
//! equations of such a curve are
//!
//! ```text
//! g(z, l) = 0,   h(z, l) = 0
//! ```
//!
//! with the state and both parameters as unknowns (Govaerts, Numerical Methods for
//! Bifurcations of Dynamical Equilibria, 2000, chapters 3 to 5). The curve is followed by
//! arclength. The tangent plane of the manifold is spanned by two directions, one along the
//! curve, one across it, in which h changes: a step predicts along the first, and a secant
//! method along the second, with Newton's method back to the manifold, finds the zero of h.
//! Folds of the curve in either parameter are no obstacle.
//!
//! At branch points due to symmetry, K has a null vector that is not a tangent of the manifold
//! followed: that is the one of the symmetric branch. Several modes that become neutral
//! together are followed by the mean of their eigenvalues, as long as these coincide.
//!
//! A curve of folds turns back at a cusp; where a further eigenvalue vanishes, two curves
//! cross. Both are located along the curve, and verified as every point is: on finer and
//! finer grids, at the same value of the second parameter (of the first, where the curve goes
//! along that; in the same plane across the curve, where it goes along neither), and
//! extrapolated.

mod cells;
mod follow;
mod grids;
mod manifold;
mod neighbours;
mod refine;
mod search;
mod singular_point;
mod special;
mod table;
mod walk;

pub use cells::{AtRest, Path, follow_path, recount, refine_on_path};
pub use follow::{Boundary, follow};
pub use grids::coarsened;
#[cfg(test)]
pub use manifold::Direction;
pub use manifold::{Plane, Solution};
pub use neighbours::{Neighbour, beside};
pub use refine::Accuracy;
pub use singular_point::Seed;
pub use special::Special;
pub use table::Verified;
pub use walk::WalkOptions;
