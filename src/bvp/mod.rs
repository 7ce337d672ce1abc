//! The independent road to the same equilibrium: the paper's boundary-value
//! problem by multiple shooting.
//!
//! It shares with the relaxation only the checked scenario and the
//! constitutive law: no grid, no element, no linear algebra. What both find is
//! therefore not an artefact of either.

mod arcs;
mod continuation;
mod dop853;
mod equations;
mod intervals;
mod march;
mod neutral;
mod newton;
mod propagate;
mod solution;
mod solve;
mod tableau;
mod trajectory;

pub use newton::Work;
pub use solution::{Failure, Neutral, Options, Reason, Solution, Start};
pub use solve::{solve, solve_within};
