//! What segments are made of.

use crate::lanes::{Four, GROUP, Lanes, Vectors};
use glam::DVec3;
use pulp::{Scalar, Simd};

/// What a segment is made of, taken at its midpoint.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Reference length of the segment.
    pub ds: f64,
    /// Couple stiffness A: torsion, bending about d2, about d3.
    pub couple_stiffness: DVec3,
    /// Rest curvature u0.
    pub rest_curvature: DVec3,
    /// Rest strain v0; (1, 0, 0) has neither grown nor been sheared.
    pub rest_strain: DVec3,
    /// Compliance 1/H: axial, shear along d2, along d3; zero if rigid.
    pub compliance: DVec3,
    /// Stiffness by which the force is condensed out: H, or a large one in its
    /// place if H is larger still (see [`Section::condense`]).
    pub condensing: DVec3,
}

impl Section {
    /// Sets the stiffness that condenses the force out to at most `largest`.
    /// Beyond it the matrix is that of a softer rod while the residual stays
    /// exact: a proximal step in the force, which changes no solution, costs
    /// a contraction of the order of 1/`largest` an iteration, and keeps the
    /// pivots within what double precision holds.
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
    /// Those of the lanes from `part` on.
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
