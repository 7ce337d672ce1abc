//! Segments of rods: their sections, strains, energy and derivatives.
//!
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
//!
//! Tissue between two rods has the same element, as strips.

mod element;
mod section;
mod segment;
mod strip;

pub use crate::rod::element::{Element, LaneBlock, UNKNOWNS, nodal_gradient};
pub use crate::rod::section::{
    LaneNodes, LaneSections, NodePair, Section, SectionParameterDerivative, Wrench,
};
pub use crate::rod::segment::{Segment, SegmentGradient, SegmentHessian};
pub use crate::rod::strip::{
    CarryingStrip, ContractingStrains, NodeBlock, PairGradient, StrainFactors, StripHessian,
    StripLoads, StripStrainGradients, StripStress, TissueStrip, VeinStrain,
};

/// Largest rotation (radians) between the ends of a segment that its grid resolves.
pub const RESOLVED_TURN: f64 = 1.6;
