//! Equilibria of leaves made of coupled Cosserat rods: the shape, an error bound on it, and
//! its stability.
//!
//! From a file to a tip position with its error and its stability:
//!
//! ```
//! use leafdyn::scenario::Scenario;
//!
//! let leaf = Scenario::read("scenarios/paper/fig04.toml")?.relax()?;
//! let error = leaf.accuracy.error_estimate;
//! println!("tip {} within {error:?}, stable: {:?}", leaf.tips[0], leaf.stable());
//! # assert!(error.is_some_and(|error| error <= leaf.accuracy.tolerance));
//! # assert_eq!(leaf.stable(), Some(true));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The result is a [`relax::Equilibrium`]; as JSON it is what the program writes.
//! [`Scenario::relaxation`](scenario::Scenario::relaxation) takes a tolerance, a method or a
//! fixed grid, reports the progress of a long run, and can be cancelled. By task:
//!
//! | to | call |
//! | --- | --- |
//! | state a leaf | [`Scenario::read`](scenario::Scenario::read), [`from_toml`](scenario::Scenario::from_toml) |
//! | bring it to rest | [`Scenario::relax`](scenario::Scenario::relax), [`relaxation`](scenario::Scenario::relaxation) |
//! | have it confirmed by an independent method | [`study::check()`] |
//! | find its other equilibria | [`study::equilibria()`] |
//! | follow one as a number varies, through folds | [`study::trace()`] |
//! | see it move | [`simulate::Simulation`] |
//! | see where methods fail, or how fast they are | [`study::map()`], [`study::chart()`] |
//!
//! # The model
//!
//! A leaf with parallel venation is N special Cosserat rods, one for each main
//! vein with the tissue around it. They start in one point as a fan, end in one
//! point, the tip, and pull on their neighbours through the tissue between
//! them. The model, the numbers of equations and figures used throughout this
//! crate, and the leaves in `scenarios/paper` are those of "the paper"
//! (Acta Biotheoretica, doi 10.1007/s10441-020-09397-6) that proposed it for
//! orchids of the genus *Epipactis* and solved its equations with scipy's
//! `solve_bvp`.
//!
//! A rod is a curve r(s), 0 <= s <= L, with a frame of directors
//! R = \[d1 d2 d3\]; d1 points along the unstrained rod, d2 lies in the plane of
//! the fan. Its strains are v (stretch and two shears) and u (twist and two
//! bends), its stress resultants n (axial and shear forces) and m (twisting and
//! bending moments), all as components along the directors; f is the force per
//! unit length on the rod, here as components along the lab axes.
//!
//! ```text
//!   r' = R v              R' = R [u]                 strains (section 2.1)
//!
//!   dn/ds + f = 0         dm/ds + v x n = 0          balance, in space          (1) (2)
//!   n' = n x u - R^T f    m' = m x u + n x v         the same, components       (3) (4)
//!
//!   m_i = A_i (u_i - u0_i)                           torsion A1, bending A2, A3     (5)
//!   n_i = H_i (v_i - v0_i)                           axial H1, shear H2, H3         (6)
//!
//!   f = g - q e3          g = sum of kappa o (r_neighbour - r)     coupling, gravity
//! ```
//!
//! A2 is the bending about d2, which moves a vein up and down; A3 the one about d3, sideways
//! within the leaf. u0 is the curvature at rest; v0 is e1 or, where a vein has grown, a
//! multiple of it (`rest.stretch`). An infinite H_i is a constraint: inextensible,
//! unshearable. The coupling acts between neighbours at equal fractions of their lengths, axis
//! by axis, and is kept per gap, so that forces between neighbours are equal and opposite. The
//! boundary conditions are those of section 2.4, with a given force and, on a single rod, a
//! given moment at the tip:
//!
//! | | at | condition |
//! | --- | --- | --- |
//! | (a) | base | r = 0 |
//! | (b) | tip | m = 0 for every rod |
//! | (c) | base | d1 = (cos phi, sin phi, 0), d2 = (-sin phi, cos phi, 0), d3 = e3 |
//! | (d) | tip | all rods meet in one point, unless `joined = false` |
//! | (e) | tip | the forces of all rods sum up to the tip force, zero by default |
//!
//! with phi_n = -pi/3 + 2 pi n/(3N), n = 1..N. (This fan is not symmetric about
//! e1, which is why the paper's leaves bend sideways; `fan = "symmetric"` is.)
//!
//! # Units
//!
//! A scenario may be in any consistent units, and results come in the same.
//! Inside, lengths are in units of the longest rod L, forces in A/L^2, moments
//! and energies in A/L, where A is the mean bending stiffness
//! ([`scenario::Scale`]): no threshold depends on the units. The paper's own
//! scaling, lengths by L0, forces by H0, moments by A0/L0, leaves the equations
//! above in their form only if H0 L0^2/A0 = 1; `scenarios/paper` is written so.
//!
//! # From the equations to the result
//!
//! `docs/methods.md` describes the methods: the element and its grids, the relaxation, the error
//! bound ([`relax::Accuracy::error_estimate`]), stability, modes, the boundary-value problem
//! with which [`study::check()`] confirms a result, branches, and motion in time.
//! `docs/how-to-read.md` explains the numbers of a result, `docs/architecture.md` the modules of
//! this crate.

#![warn(missing_docs)]
mod branch;
mod homotopy;
mod krylov;
mod leaf;
pub mod memory;
mod modes;
mod motion;
pub mod natural;
mod newton;
pub mod numbers;
pub mod posture;
pub mod relax;
mod rod;
mod rotation;
pub mod run;
pub mod scenario;
pub mod shape;
mod shooting;
mod simd;
pub mod simulate;
pub mod study;
pub mod surface;

#[doc(hidden)]
#[deprecated(note = "is leafdyn::run")]
pub mod clock {
    pub use crate::run::Instant;
}
#[doc(hidden)]
#[deprecated(note = "is leafdyn::numbers")]
pub mod largest {
    pub use crate::numbers::{larger, largest};
}
#[doc(hidden)]
#[deprecated(note = "is leafdyn::shape")]
pub mod undulation {
    pub use crate::shape::Undulation;
}

/// Internals for this project's own tests and benchmarks: they may change with any release.
#[doc(hidden)]
pub mod internals {
    pub mod branch {
        pub use crate::branch::{
            BranchEnd, BranchEquations, ContinuationOptions, CriticalKind, EquilibriumPoint,
            ExtrapolatedPoint, LeafFamily, NestedBranchEquations, VerifiedBranch, begin_branch,
            follow_branch,
        };
    }
    pub mod shooting {
        pub use crate::shooting::{
            NeutralDirection, RequiredPrecision, ShootingCounts, ShootingFailure,
            ShootingFailureReason, ShootingOptions, ShootingSolution, ShootingStart, solve,
        };
    }
    pub mod lanes {
        pub use crate::simd::{Lanes, Vectors};
    }
    pub mod leaf {
        pub use crate::leaf::{
            DirectSolver, DiscreteLeaf, Grid, Leaf, LinearSolveOutcome, Scale, State, System,
            displacement_part, rotation_part,
        };
    }
    pub mod modes {
        pub use crate::modes::{Eigenpair, ModeRequest, lowest};
    }
    pub mod motion {
        pub use crate::motion::{
            Energy, Explicit, Inertia, Physics, SemiImplicit, Snapshot, StepControl, Stopped,
            TimeIntegrator,
        };
    }
    pub mod rod {
        pub use crate::rod::{NodePair, Section, Segment};
    }
    pub mod rotation {
        pub use crate::rotation::{exp, log, outer};
    }
    pub mod relax {
        pub use crate::relax::solve_on_grid::relax_from_state;
        pub use crate::relax::solve_on_grid::start::initial_state;
        pub use crate::relax::stability::{index_near, state_from_rod_shapes};
    }
}
