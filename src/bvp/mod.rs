//! The same equilibrium independently: the paper's boundary-value problem by
//! multiple shooting.
//!
//! It shares with the relaxation only the checked scenario and the
//! constitutive law: no grid, no element, no linear algebra. What both find is
//! therefore not an artefact of either.
//!
//! **Unknown functions.** The paper integrates 18 functions per rod: r, the nine
//! components of three directors, n and m along the directors, by eqs (1) to (6)
//! and the nine equations d_i' = u x d_i. Nothing keeps the directors orthonormal
//! then, which the paper names as its difficulty. Here orientation is a unit
//! quaternion, returned to unit length after every step, and n and m are carried
//! along the lab axes, where their balance has no frame in it: 13 functions.
//!
//! **Boundary conditions.** (a) and (c) fix r and the directors at the base;
//! n and m there are the unknowns, 6 N in all. (b), (d) and (e) are 6 N
//! conditions at the tip: all moments vanish (or equal the given one), all
//! positions agree with the first rod's, all forces sum up to the given one.
//!
//! **Initial-value problems** are integrated by the explicit Runge-Kutta method
//! of order 8 of Dormand and Prince with step control. Sensitivities obey the
//! linearised equations, integrated through the same steps.
//!
//! **Multiple shooting.** Perturbations can grow beyond all digits from base to
//! tip: like exp(L sqrt(T/A2)) in a vein under tension T. The length is
//! therefore cut into intervals over which growth stays below a thousand, the
//! state at the beginning of each is unknown too, and the linear equations
//! are condensed without ever forming the product of all sensitivities.
//! [`Options::intervals`] = 1 is plain single shooting, to see where it fails.
//!
//! **Newton's method** is damped by a test that depends on no scaling. It starts
//! from a relaxed leaf, or from arcs by continuation: a leaf whose rest shape is
//! those arcs solves the equations without loads, and is changed step by step
//! into the scenario's.
//!
//! **Error.** Every problem is solved with two tolerances; the difference is the
//! estimate ([`Solution::error`]). Near a bifurcation [`Solution::neutral`] says
//! how the leaf could move without resistance.

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
mod state;
mod trajectory;

pub use solution::{
    Correction, Failure, Neutral, Options, Precision, Reason, Solution, Start, Work,
};
pub use solve::solve;
