//! An independent method for the same equilibrium: the paper's boundary-value problem by
//! multiple shooting.
//!
//! It shares with the relaxation only the checked scenario and, with its error estimate, the
//! coefficients of a Runge-Kutta method: no grid, no element, no linear algebra. A solution
//! found by both is therefore not an artefact of either.
//!
//! **Unknown functions.** The paper integrates 18 functions per rod: r, the nine
//! components of three directors, n and m along the directors, by eqs (1) to (6)
//! and the nine equations d_i' = u x d_i. These do not keep the directors orthonormal,
//! which the paper names as its difficulty. Here orientation is a unit
//! quaternion, normalised after every step, and n and m are components
//! along the lab axes, in which their balance contains no frame: 13 functions.
//!
//! **Boundary conditions.** (a) and (c) fix r and the directors at the base;
//! n and m there are the unknowns, 6 N in all. (b), (d) and (e) are 6 N
//! conditions at the tip: all moments vanish (or equal the given one), all
//! positions agree with the first rod's, all forces sum up to the given one.
//!
//! **Initial-value problems** are integrated by the explicit Runge-Kutta method
//! of order 8 of Dormand and Prince with step control. Sensitivities satisfy the
//! linearised equations, integrated with the same steps.
//!
//! **Multiple shooting.** Perturbations can grow beyond machine precision from base to
//! tip: like exp(L sqrt(T/A2)) in a vein under tension T. The length is
//! therefore divided into intervals over which growth stays below a thousand, the
//! state at the beginning of each is unknown too, and the linear equations
//! are condensed without forming the product of all sensitivities.
//! [`Options::intervals`] = 1 is plain single shooting, to show where it fails.
//!
//! **Newton's method** is damped by an affine-invariant test. It starts
//! from a relaxed leaf, or from arcs by continuation: a leaf whose rest shape is
//! those arcs solves the equations without loads, and is changed step by step
//! into the scenario's.
//!
//! **Error.** Every problem is solved with two tolerances; the difference is the
//! estimate ([`Solution::error`]). Near a bifurcation [`Solution::neutral`] is
//! the direction in which the leaf can move without resistance.

mod arcs;
mod condensed;
mod continuation;
mod dop853;
mod equations;
mod intervals;
mod newton;
mod own_loads;
mod propagate;
mod solution;
mod solve;
mod state;
mod tissue;
mod trajectory;

pub use crate::shooting::solution::{
    Correction, Failure, Neutral, Options, Precision, Reason, Solution, Start, Work,
};
pub use crate::shooting::solve::{check_models, solve};
