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
//! | find its other equilibria | [`study::all()`] |
//! | follow one as a number varies, through folds | [`study::trace()`] |
//! | see it move | [`simulate::Simulation`] |
//! | see where methods fail, or how fast they are | [`study::map()`], [`study::chart()`] |
//! | write the files of the program | [`files::write_all`] (feature `cli`) |
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
//! **The element** (`rod`, `rotation`). The nodes of a grid carry positions and unit
//! quaternions. Each segment is oriented by the geodesic midpoint of its two nodal rotations
//! and has an energy in the strains v = R^T (x1 - x0)/ds and u = log(q0^* q1)/ds. Its
//! stationarity is the implicit midpoint rule on eqs (1) to (6). The force each segment
//! carries is an additional unknown (the mixed form), eliminated segment by segment, so that
//! the convergence of Newton's method does not depend on the stiffness in stretch and shear.
//!
//! **The leaf** (`leaf`). All last nodes are one shared point: the joint tip needs neither penalty
//! nor multiplier. Gravity and coupling act at the nodes. Newton's equations are solved rod by
//! rod: every rod's own block-tridiagonal matrix of 6 x 6 blocks (3 x 3 in the plane) is
//! factorised in linear time and preconditions conjugate gradients for the coupled system. A
//! sparse direct factorisation of the whole matrix serves where it is not positive definite.
//!
//! **The relaxation** ([`relax`]). Joined leaves start from circular arcs that meet in a
//! point, free rods from their rest shapes, and perform a damped motion in linearly implicit
//! Euler steps. While the energy has a direction of negative curvature, the time step is kept
//! short enough to resolve the motion; otherwise it grows until the step is Newton's. Of a
//! mirror-symmetric leaf one half is solved, and a leaf without loads out of its plane with
//! three unknowns a node. The explicit method ([`relax::Method::Explicit`]) integrates the
//! same motion in steps short enough for the fastest waves until the leaf is in a valley
//! (basin of attraction) of its energy, and then descends with fictitious masses and damping.
//!
//! **Grids and the error** ([`relax::relax`]). The element is symmetric and the boundary
//! conditions hold exactly at nodes, so that its error is a series in even powers of ds. The
//! leaf settles on 8 segments a rod (on 4 where that is enough), then on twice as many, and so
//! on, starting on each grid from a prediction by those before it, and Richardson
//! extrapolation removes one term of the series with every grid. The error of the extrapolated
//! leaf is estimated from its defect in the equations: these are integrated along the rods by
//! a method of order 8, and the linear response of the leaf to the remaining jumps, times two,
//! is the bound ([`relax::Accuracy::error_estimate`]); unfinished iterations and rounding are
//! added. Where only the shape is requested the response is also subtracted (iterated defect
//! correction). Grids are refined until the bound is below the tolerance. A column of the
//! table that does not show its order of convergence is not extrapolated. Kinks of a profile
//! are nodes of every grid.
//!
//! **Stability** ([`relax::Equilibrium::stable`]). The Hessian of the energy at rest is
//! factorised as L D L^T; the number of negative pivots is that of its negative eigenvalues,
//! the Morse index. Index zero means: stable. A leaf at rest at a saddle is displaced along
//! its unstable mode and relaxed further; the saddle is returned in
//! [`relax::Stability::saddle`]. The outcome of a run is a [`relax::Outcome`].
//!
//! **Undulation** ([`undulation`]). Half-waves of each vein out of the leaf's
//! surface, counted between its inflections; the twist of its section; and the
//! waves that the paper's linear theory predicts from the axial force it
//! carries.
//!
//! **Modes** (`modes`). The lowest eigenvalues of K x = lambda M x with that Hessian and the
//! masses of the leaf in motion: squared frequencies, or negative where the leaf is unstable.
//! A Lanczos method computes them with one factorisation, and the pivots of a second one show
//! whether any was missed. They are extrapolated over the grids as positions are
//! ([`relax::Stability::modes`]).
//!
//! **The independent method** (`bvp`). The same equations (1) to (6) with (a) to (e) as a
//! boundary-value problem: 13 functions per rod, integrated from the base by a Runge-Kutta
//! method of order 8 together with their sensitivities; Newton's method satisfies the
//! conditions at the tip, over as many intervals as the growth of perturbations needs
//! (multiple shooting). It starts from a relaxed leaf or from arcs. [`study::check`] compares
//! it with the relaxation; the two share neither grid nor element nor linear algebra.
//!
//! **Branches** ([`study::trace()`]). An equilibrium is continued in a number of its scenario
//! by pseudo-arclength (`branch`), also through folds. Where its Morse index changes the
//! matrix is singular; bordered by the modes that become neutral it is regular, and the
//! singular point is computed to rounding on each grid, and extrapolated. Branches that cross
//! there can be followed as well. [`study::boundary()`] continues singular points in a second
//! number. [`study::all()`] searches for equilibria from many starts instead.
//!
//! **Where methods fail** ([`study::map()`]). Numbers of a scenario vary ([`study::Vary`]),
//! and in each cell every method's result is compared with the relaxed leaf confirmed by
//! shooting: correct, another equilibrium, a saddle, less accurate than claimed, or none.
//!
//! **Speed against accuracy** ([`study::chart()`]). Every method runs over a range of its
//! accuracy parameter, in turns with all others, and is judged by its true error: the distance
//! from the relaxed leaf at the best tolerance, confirmed by shooting.
//!
//! # Layout
//!
//! [`scenario`] (TOML to a checked [`scenario::Scenario`]) and `rotation`, `rod`, `leaf`,
//! [`shape`], [`undulation`], `bvp`, `motion`, `modes`, [`relax`], `branch`, [`simulate`],
//! [`study`], `report` (console, JSON, tables), `figure`, [`files`]: each module depends only
//! on those named before it.
//!
//! `motion` integrates the dimensionless motion of a leaf on the same grid in time: by an
//! explicit method with short, cheap steps, or by a semi-implicit one for any stiffness. Both
//! implement the trait `motion::Method`, keep the balance of energy, and can be saved and
//! restored to the last bit.
//!
//! [`simulate`] integrates the motion of a scenario's leaf for its duration, from the initial
//! state of the scenario, and returns a [`simulate::Frame`] at every output. A
//! [`files::Recording`] writes these to files as they are computed, and can stop and resume.

#![warn(missing_docs)]

mod branch;
mod bvp;
mod checksum;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "cli")]
mod figure;
#[cfg(feature = "cli")]
pub mod files;
mod lanes;
mod leaf;
mod limit;
pub mod memory;
mod modes;
mod motion;
mod newton;
mod numbers;
pub mod relax;
#[cfg(feature = "cli")]
mod report;
mod rod;
mod rotation;
pub mod scenario;
pub mod shape;
pub mod simulate;
pub mod study;
mod tableau;
pub mod undulation;
mod words;

#[cfg(feature = "cli")]
pub use figure::view;

/// Internals for this project's own tests and benchmarks: they may change with any release.
#[doc(hidden)]
pub mod internals {
    pub mod branch {
        pub use crate::branch::{
            End, Equations, Family, Followed, Grids, Kind, Point, Refined, Walk, begin, walk,
        };
    }
    pub mod bvp {
        pub use crate::bvp::{
            Failure, Neutral, Options, Precision, Reason, Solution, Start, Work, solve,
        };
    }
    pub mod lanes {
        pub use crate::lanes::{Lanes, Vectors};
    }
    pub mod leaf {
        pub use crate::leaf::{
            DiscreteLeaf, Grid, Leaf, Scale, Solved, SparsePattern, State, System, shift, turn,
        };
    }
    pub mod modes {
        pub use crate::modes::{Eigenpair, Wanted, lowest};
    }
    pub mod motion {
        pub use crate::motion::{
            Energy, Explicit, Inertia, Method, Physics, SemiImplicit, Snapshot, Steps, Stopped,
        };
    }
    pub mod rod {
        pub use crate::rod::{
            Element, Ends, Nodes, PlanarElement, Section, Sections, Segment, SpatialElement,
        };
    }
    pub mod rotation {
        pub use crate::rotation::{exp, log, outer};
    }
    pub mod relax {
        pub use crate::relax::fall::settle_from;
        pub use crate::relax::index::{index_near, project};
        pub use crate::relax::start::start;
    }
}
