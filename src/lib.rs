//! How a leaf of coupled Cosserat rods comes to rest: its shape, an error bar
//! on it, and whether it is stable.
//!
//! ```
//! use leafdyn::{relax::{Options, relax}, scenario::Scenario};
//!
//! let leaf = Scenario::read("scenarios/paper/fig04.toml".as_ref(), &[])?;
//! let rest = relax(&leaf, &Options::default(), &mut |_| {})?;
//! println!("tip at {}, within {:?}", rest.tips[0], rest.error_estimate);
//! assert_eq!(rest.stable(), Some(true));
//! assert!((rest.tips[0].z + 0.147358).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The model
//!
//! A leaf with parallel veins is N special Cosserat rods. Each is a curve r(s)
//! with a frame of directors R = \[d1 d2 d3\], d1 along the vein; its strains are
//! v = R^T r' (stretch and two shears) and u, the axial vector of R^T R' (twist
//! and two bends), its stress resultants n and m. In equilibrium
//!
//! | | |
//! | --- | --- |
//! | n' = n x u - R^T f,  m' = m x u + n x v | eqs (3), (4) |
//! | m_i = A_i (u_i - u0_i),  n_i = H_i (v_i - delta_i1) | eqs (5), (6) |
//! | f = coupling to the neighbours + gravity | section 2.3 |
//!
//! with all bases clamped at the origin in a fan of angles, moments vanishing at
//! the tips, all tips in one point, and the forces there adding up to a given
//! one (boundary conditions (a) to (e)). The numbers of equations and figures are
//! those of the paper that proposed the model for the leaves of *Epipactis* and
//! solved it with scipy's `solve_bvp`; `scenarios/paper` has its leaves.
//!
//! Any consistent units will do. Inside, lengths are in units of the longest
//! rod L and forces in A/L^2, A being the mean bending stiffness
//! ([`leaf::Scale`]), so that no threshold depends on the units.
//!
//! # From the equations to the answer
//!
//! 1. [`scenario`]: TOML as written becomes a checked [`scenario::Scenario`].
//! 2. [`rod`]: a segment between two nodes with positions and unit quaternions,
//!    oriented by their geodesic midpoint: the implicit midpoint rule on the
//!    equations above, and at the same time the minimum of a discrete energy.
//!    The segment's force is an unknown of its own and condensed out, so that
//!    stiffness in stretch and shear, up to inextensible, costs nothing.
//! 3. [`leaf`]: N rods, their coupling, loads and joint tip; the linear algebra
//!    follows that structure: every rod's chain is factorised in linear time and
//!    conjugate gradients account for the coupling.
//! 4. [`relax`]: damped motion in linearly implicit steps that turn into
//!    Newton's method; nested grids whose error is a clean series in ds^2, which
//!    is extrapolated and tells the error; the Morse index, and the way off a
//!    saddle.
//! 5. [`output`]: summary, table and figure.
//!
//! Nothing in this list knows of what comes after it.

pub mod leaf;
pub mod output;
pub mod relax;
pub mod rod;
pub mod rotation;
pub mod scenario;
