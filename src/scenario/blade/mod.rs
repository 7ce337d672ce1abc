//! A leaf from its outline, thickness and moduli: the table `[blade]`.
//!
//! A blade of the length L and the width W(x) has N veins, of which vein j lies along
//! y = eta_j W(x)/2 in the natural leaf. Its strip, vein and tissue together, has the width h = W/N
//! and the thickness t; with a gap of the width w between two veins,
//!
//! | | |
//! | --- | --- |
//! | torsion | A1 = G h t^3/3 |
//! | bending | A2 = E h t^3/12, A3 = E t h^3/12 |
//! | stretch and shear | H1 = E h t, H2 = H3 = 5/6 G h t |
//! | tissue | k1 = G t/w, k2 = E' t/w, k3 = 5/6 G t/w, c1 = E' t^3/(12 w) |
//!
//! Its surface may be curved at rest about the y axis, kappa(x): a vein at the angle phi to its axis
//! then has u0_1 = kappa sin(phi) cos(phi) and u0_2 = kappa cos(phi)^2, so that all fit together.
//!
//! E is Young's modulus along the veins, E' the one across. A blade of constant width bends as
//! E W t^3/12 and twists as G W t^3/3, whatever N is, and in its plane as E t W^3/12, if shear
//! is stiff: for veins in the middle of equal strips whatever N is; if the outermost veins are the
//! margins, the stiffness in its plane is larger by the part 2/(N - 1) + 1/N^2.

mod given;
mod material;
mod read;
mod spline;
#[cfg(test)]
mod tests;
mod vein;

pub use given::Blade;
pub(super) use given::Parts;
pub(super) use read::blade;
pub use vein::{BladePart, BladeProperty};
