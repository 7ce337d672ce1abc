//! The midpoint element: a segment between two nodes that carry positions x
//! and unit quaternions q.
//!
//! The segment is oriented by the geodesic midpoint R of its two nodal
//! rotations and strained by
//!
//! v = R^T (x1 - x0)/ds,   u = log(q0^* q1)/ds.
//!
//! It is used in mixed (Hellinger-Reissner) form, with the spatial force n of
//! the segment as a further unknown, nu = R^T n being its components along the
//! directors and c_k = 1/H_k the compliances of eq. (6):
//!
//! Pi = nu . (R^T (x1 - x0) - ds v0) - ds/2 sum_k c_k nu_k^2
//!      + ds/2 sum_k A_k (u_k - u0_k)^2,
//!
//! the rest strain v0 being (stretch, 0, 0), e1 without growth, unless internal friction acts.
//!
//! Stationarity in n gives the paper's law; the implicit midpoint rule on eqs (1) and (2) is
//! the stationarity condition of a discrete energy. The force is condensed out segment by
//! segment, so that the nodes see a 12 x 12 matrix, and Newton's method converges as fast for
//! any stiffness in stretch and shear: a rigid rod is c = 0.

use super::section::Sections;
use crate::lanes::{Lanes, Vectors};
use crate::rotation::Quaternions;
use pulp::Simd;

/// The two nodes of several segments.
#[derive(Clone, Copy)]
pub struct Nodes<S: Simd> {
    /// Positions.
    pub x: [Vectors<S>; 2],
    /// Rotations.
    pub q: [Quaternions<S>; 2],
}

/// Several segments between nodes of B unknowns: rotations, then displacements.
pub trait Element<S: Simd, const B: usize>: Sized {
    /// The segments between `nodes` that carry the spatial forces `n`.
    fn new(sections: &Sections<S>, nodes: &Nodes<S>, n: Vectors<S>) -> Self;

    /// Squared rotation between the two ends.
    fn squared_turn(&self) -> Lanes<S>;

    /// Elastic energy of the strains, ds/2 sum_k (H_k (v_k - v0_k)^2 +
    /// A_k (u_k - u0_k)^2). Infinite for a strained rigid rod.
    fn strain_energy(&self, sections: &Sections<S>) -> Lanes<S>;

    /// First derivatives of Pi with respect to the unknowns of both nodes, with the force
    /// condensed out: the right-hand side for [`Element::hessian`].
    fn condensed_gradient(&self, sections: &Sections<S>) -> [[Lanes<S>; B]; 2];

    /// The first-order change of the condensed gradient if the compliance of the components in
    /// `dropped` (ones and zeros) is removed.
    fn stiffening_gradient(
        &self,
        sections: &Sections<S>,
        dropped: Vectors<S>,
    ) -> [[Lanes<S>; B]; 2];

    /// Second derivatives, the force condensed out.
    fn hessian(&self, sections: &Sections<S>) -> Hessian<S, B>;

    /// The change of the spatial force for the nodal increments `dx` = dx1 - dx0 and the
    /// spatial rotations `turns` of both nodes.
    fn force_increment(
        &self,
        sections: &Sections<S>,
        dx: Vectors<S>,
        turns: [Vectors<S>; 2],
    ) -> Vectors<S>;
}

/// Second derivatives with respect to the unknowns of the two nodes.
pub struct Hessian<S: Simd, const B: usize> {
    /// The nodes' own blocks, upper triangles.
    pub own: [[[Lanes<S>; B]; B]; 2],
    /// The block between the first and the second.
    pub across: [[Lanes<S>; B]; B],
}
