//! Sections: the material data of segments.

use crate::lanes::{Four, GROUP, Lanes, Vectors};
use glam::DVec3;
use pulp::{Scalar, Simd};

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
    /// (see [`Section::condense`]).
    pub condensing: DVec3,
}

impl Section {
    /// Limits the stiffness with which the force is condensed out to `largest`. Beyond it the
    /// matrix is that of a softer rod while the residual stays exact: a proximal step in the
    /// force, which leaves solutions unchanged, adds linear convergence with a factor of the
    /// order of 1/`largest`, and keeps the pivots within double precision.
    pub fn condense(mut self, largest: f64) -> Self {
        self.condensing = self.compliance.recip().min(DVec3::splat(largest));
        self
    }
}

/// Sections of several segments.
#[derive(Clone, Copy)]
pub struct Sections<S: Simd> {
    pub(super) ds: Lanes<S>,
    pub(super) per_ds: Lanes<S>,
    pub(super) couple_stiffness: Vectors<S>,
    pub(super) rest_curvature: Vectors<S>,
    pub(super) rest_strain: Vectors<S>,
    pub(super) compliance: Vectors<S>,
    pub(super) condensing: Vectors<S>,
}

impl<S: Simd> Sections<S> {
    /// The sections of the lanes from `part` on.
    #[inline(always)]
    pub fn gather(simd: S, [a, b, c, d]: [&Section; GROUP], part: usize) -> Self {
        let ds = Four([a.ds, b.ds, c.ds, d.ds]);
        let ds = Lanes::of(simd, &ds, part);
        let vectors =
            |of: fn(&Section) -> DVec3| Vectors::gather(simd, [of(a), of(b), of(c), of(d)], part);
        Sections {
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

impl From<&Section> for Sections<Scalar> {
    #[inline]
    fn from(section: &Section) -> Self {
        Sections::gather(Scalar, [section; GROUP], 0)
    }
}
