//! A branch: an equilibrium followed through a parameter, through folds, with
//! its Morse index and the points at which this changes.
//!
//! With the unbalanced forces g(z, l) of a leaf in the state z at the parameter
//! l, a branch is a curve g = 0. It is followed by pseudo-arclength continuation (Keller, in:
//! Applications of Bifurcation Theory, 1977): from a point with tangent t a step
//! is predicted along t, and Newton's method corrects it within the
//! plane normal to t. Matrices are those of the relaxation.
//!
//! Where the index changes, the matrix K is singular. There it is bordered by
//! P, the mass matrix times the modes that become neutral,
//!
//! ```text
//! [ K   P ] [ X ]   [ 0 ]
//! [ P^T 0 ] [ H ] = [ 1 ]
//! ```
//!
//! which is regular (Govaerts, Numerical Methods for Bifurcations of Dynamical
//! Equilibria, 2000). An eigenvalue of H vanishes where one of K does, and is smooth,
//! so that a secant method finds its zero to rounding.
//!
//! All this holds on one grid. A point counts as verified once finer grids have it too: on
//! the same branch, with the same orientation and index, its tips known to the
//! accuracy asked for. Otherwise the branch is continued on a finer grid
//! from the last verified point.
//!
//! Equations (`equations`) of a family of leaves (`family`) are solved at a step (`correct`);
//! steps make a branch on one grid (`continuation`) with its critical points (`critical`);
//! points are verified on finer grids (`convergence`, `refine`), and so is the branch
//! (`verified_branch`). Where forces act that have no potential, a branch (`motion_branch`) is critical where its
//! small motions begin to grow (`motion_critical`). Boundaries of stability have a room of their own (`boundary`).

pub(crate) mod boundary;
mod continuation;
mod convergence;
mod correct;
mod critical;
mod equations;
mod family;
mod motion_branch;
mod motion_critical;
mod points;
mod refine;
mod saddle_search;
mod verified_branch;

pub use crate::branch::continuation::{BranchEnd, ContinuationOptions, follow_branch};
pub use crate::branch::convergence::{ExtrapolatedPoint, VerificationFailure};
pub use crate::branch::critical::{BranchingKind, CriticalKind, CriticalPoint};
pub use crate::branch::equations::{BranchEquations, CorrectorFailure};
pub use crate::branch::family::{LeafFamily, ParameterRange, value_at_fraction};
pub(crate) use crate::branch::motion_branch::{
    MotionBranch, MotionBranchPoint, MotionContinuation,
};
pub use crate::branch::points::EquilibriumPoint;
pub(crate) use crate::branch::points::{increments_between, prolong_field, scale_field};
pub(crate) use crate::branch::refine::{NEARLY_RIGID, on_finer, verify_at_parameter};
pub use crate::branch::verified_branch::{
    NestedBranchEquations, VerifiedBranch, begin_branch, switch_branches,
};
