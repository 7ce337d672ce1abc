//! What elements are made from: nodes, and sections, the material data of segments; one by one, or those
//! of several segments in lanes.

use crate::rotation::{Quaternions, from_quaternion};
use crate::simd::{GROUP, Lanes, NumberGroup, Vectors};
use glam::{DQuat, DVec3};
use pulp::{Scalar, Simd};

/// Moment and force on a node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    pub moment: DVec3,
    pub force: DVec3,
}

impl Wrench {
    /// A force without a moment.
    pub fn from_force(force: DVec3) -> Self {
        let moment = DVec3::ZERO;
        Wrench { moment, force }
    }
}

/// The two nodes of a segment.
#[derive(Clone, Copy, Debug)]
pub struct NodePair {
    /// Positions, first and second node.
    pub x: [DVec3; 2],
    /// Rotations of the directors as unit quaternions.
    pub q: [DQuat; 2],
}

impl From<&NodePair> for LaneNodes<Scalar> {
    fn from(ends: &NodePair) -> Self {
        LaneNodes {
            x: ends.x.map(Vectors::from),
            q: ends.q.map(from_quaternion),
        }
    }
}

/// The derivative of a section with respect to a parameter.
#[derive(Clone, Copy, Debug, Default)]
pub struct SectionParameterDerivative {
    /// Derivative of the reference length.
    pub ds: f64,
    /// Derivative of the couple stiffness.
    pub couple_stiffness: DVec3,
    /// Derivative of the rest curvature.
    pub rest_curvature: DVec3,
    /// Derivative of the rest strain.
    pub rest_strain: DVec3,
    /// Derivative of the compliance.
    pub compliance: DVec3,
}

/// The two nodes of several segments.
#[derive(Clone, Copy)]
pub struct LaneNodes<S: Simd> {
    pub x: [Vectors<S>; 2],
    pub q: [Quaternions<S>; 2],
}

/// The material data of a segment, at its midpoint.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Reference length of the segment.
    pub ds: f64,
    /// Couple stiffness A: torsion, bending about d2, about d3.
    pub couple_stiffness: DVec3,
    /// Rest curvature u0.
    pub rest_curvature: DVec3,
    /// Rest strain v0; (1, 0, 0) without growth or shear.
    pub rest_strain: DVec3,
    /// Compliance 1/H: axial, shear along d2, along d3; zero if rigid.
    pub compliance: DVec3,
    /// Stiffness with which the force is condensed out: H, or an upper limit if H is larger
    /// (see [`Section::limit_condensing_stiffness`]).
    pub condensing: DVec3,
}

impl Section {
    /// Limits the stiffness with which the force is condensed out to `largest`. Beyond it the
    /// matrix is that of a softer rod while the residual stays exact: a proximal step in the
    /// force, which leaves solutions unchanged, adds linear convergence with a factor of the
    /// order of 1/`largest`, and keeps the pivots within double precision.
    pub fn limit_condensing_stiffness(self, largest: f64) -> Self {
        self.limit_condensing_stiffnesses(DVec3::splat(largest))
    }

    /// As [`Section::limit_condensing_stiffness`], with a limit in each direction.
    pub fn limit_condensing_stiffnesses(mut self, largest: DVec3) -> Self {
        self.condensing = self.compliance.recip().min(largest);
        self
    }
}

/// Sections of several segments.
#[derive(Clone, Copy)]
pub struct LaneSections<S: Simd> {
    pub(crate) ds: Lanes<S>,
    pub(crate) per_ds: Lanes<S>,
    pub(crate) couple_stiffness: Vectors<S>,
    pub(crate) rest_curvature: Vectors<S>,
    pub(crate) rest_strain: Vectors<S>,
    pub(crate) compliance: Vectors<S>,
    pub(crate) condensing: Vectors<S>,
}

impl<S: Simd> LaneSections<S> {
    /// The sections of a group, one in every lane, from the lane `part` on.
    #[inline(always)]
    pub fn from_group_sections(simd: S, [a, b, c, d]: [&Section; GROUP], part: usize) -> Self {
        let ds = NumberGroup([a.ds, b.ds, c.ds, d.ds]);
        let ds = Lanes::load_group(simd, &ds, part);
        let vectors = |of: fn(&Section) -> DVec3| {
            Vectors::from_group(simd, [of(a), of(b), of(c), of(d)], part)
        };
        LaneSections {
            ds,
            per_ds: ds.recip(),
            couple_stiffness: vectors(|s| s.couple_stiffness),
            rest_curvature: vectors(|s| s.rest_curvature),
            rest_strain: vectors(|s| s.rest_strain),
            compliance: vectors(|s| s.compliance),
            condensing: vectors(|s| s.condensing),
        }
    }
}

impl From<&Section> for LaneSections<Scalar> {
    #[inline]
    fn from(section: &Section) -> Self {
        LaneSections::from_group_sections(Scalar, [section; GROUP], 0)
    }
}
