//! The midpoint element of a segment that stays in the plane z = 0.
//!
//! Rotations about one axis commute: they are angles theta, whose geodesic
//! midpoint is their mean. With psi = theta1 - theta0, d1 the direction of
//! the mean angle and R its rotation,
//!
//! Pi = nu . (R^T (x1 - x0) - ds v0) - ds/2 sum_k c_k nu_k^2
//!      + A_3/(2 ds) (psi - ds u0)^2,
//!
//! what [`Segment`](super::Segment) is if nothing leaves the plane. The turns
//! of both nodes act alike on all but the bending: by their mean.

use super::Section;
use crate::rotation;
use glam::{DMat2, DQuat, DVec2, DVec3};

/// A segment in the plane in a given state.
#[derive(Clone, Copy, Debug)]
pub struct PlanarSegment {
    /// Midpoint director d1.
    d1: DVec2,
    /// Angle psi between the two ends.
    psi: f64,
    /// Stress couple about d3.
    m: f64,
    /// Director components of the force the segment carries.
    nu: DVec2,
    /// The strain that goes with that force, v0 + c nu.
    w: DVec2,
    /// R^T (x1 - x0) - ds w.
    gap: DVec2,
    /// D with d(R w) = R D dtheta at constant spatial force, theta the mean angle.
    law_rate: DVec2,
}

/// First derivatives: with respect to x1 (that to x0 is its negative), and to
/// the angles of the two nodes.
#[derive(Clone, Copy, Debug)]
pub struct PlanarGradient {
    /// d/dx
    pub x: DVec2,
    /// d/da, d/db
    pub turn: [f64; 2],
}

/// Second derivatives with respect to (x1 - x0) and the angles a, b of the two
/// nodes, the force being condensed out.
#[derive(Clone, Copy, Debug)]
pub struct PlanarBlocks {
    /// d2/dx dx
    pub xx: DMat2,
    /// d2/dx da and d2/dx db
    pub xt: DVec2,
    /// d2/da da and d2/db db
    pub same: f64,
    /// d2/da db
    pub across: f64,
}

impl Section {
    /// [`Section::strain_energy`] of a segment in the plane.
    #[inline]
    pub fn planar_strain_energy(&self, segment: &PlanarSegment) -> f64 {
        let gamma = segment.gap / self.ds + segment.w - self.rest_strain.truncate();
        let bending = segment.m * (segment.psi / self.ds - self.rest_curvature.z);
        0.5 * self.ds * ((gamma * gamma / self.compliance.truncate()).element_sum() + bending)
    }
}

impl PlanarSegment {
    /// The segment between two nodes at `x`, turned by `q` about z, that
    /// carries the spatial force `n`; of all of them what lies in the plane.
    #[inline]
    pub fn new(section: &Section, x: [DVec3; 2], q: [DQuat; 2], n: DVec3) -> Self {
        let [a, b] = q.map(|q| DVec2::new(q.w, q.z));
        let sign = if a.dot(b) < 0.0 { -1.0 } else { 1.0 };
        let (cos, sin) = (sign * a.dot(b), sign * a.perp_dot(b));
        let psi = 2.0 * rotation::half_over_sin(sin * sin, cos) * sin;
        // Half angles add, and twice their mean is the mean angle.
        let sum = a + sign * b;
        let d1 = sum.rotate(sum) / sum.length_squared();
        let compliance = section.compliance.truncate();
        let nu = to_directors(d1, n.truncate());
        let w = section.rest_strain.truncate() + compliance * nu;
        PlanarSegment {
            d1,
            psi,
            m: section.couple_stiffness.z * (psi / section.ds - section.rest_curvature.z),
            nu,
            w,
            gap: to_directors(d1, (x[1] - x[0]).truncate()) - section.ds * w,
            law_rate: w.perp() - compliance * nu.perp(),
        }
    }

    /// Rotation between the two ends, in radians.
    #[inline]
    pub fn turn(&self) -> f64 {
        self.psi.abs()
    }

    /// See [`Segment::condensed_gradient`](super::Segment::condensed_gradient).
    #[inline]
    pub fn condensed_gradient(&self, section: &Section) -> PlanarGradient {
        let correction = section.condensing.truncate() * self.gap;
        let mean = section.ds * self.nu.perp_dot(self.w) - self.law_rate.dot(correction);
        PlanarGradient {
            x: self.d1.rotate(self.nu + correction / section.ds),
            turn: [0.5 * mean - self.m, 0.5 * mean + self.m],
        }
    }

    /// See [`Segment::stiffening_gradient`](super::Segment::stiffening_gradient).
    #[inline]
    pub fn stiffening_gradient(&self, section: &Section, dropped: DVec3) -> PlanarGradient {
        let gap = section.ds * (dropped * section.compliance).truncate() * self.nu;
        let correction = section.condensing.truncate() * gap;
        let mean = -self.nu.perp_dot(gap) - self.law_rate.dot(correction);
        PlanarGradient {
            x: self.d1.rotate(correction / section.ds),
            turn: [0.5 * mean; 2],
        }
    }

    /// Second derivatives, the force condensed out.
    #[inline]
    pub fn hessian(&self, section: &Section) -> PlanarBlocks {
        let (ds, stiffness) = (section.ds, section.condensing.truncate());
        let across = self.nu.perp();
        let geometric = self.w.dot(self.nu) - (section.compliance.truncate() * across).dot(across);
        let stiff_rate = stiffness * self.law_rate;
        let mean = 0.25 * ds * (self.law_rate.dot(stiff_rate) + geometric);
        let bending = section.couple_stiffness.z / ds;
        let frame = DMat2::from_cols(self.d1, self.d1.perp());
        PlanarBlocks {
            xx: frame * DMat2::from_diagonal(stiffness / ds) * frame.transpose(),
            xt: self.d1.rotate(-0.5 * stiff_rate),
            same: mean + bending,
            across: mean - bending,
        }
    }

    /// The change of the spatial force that goes with the increment `dx` of
    /// x1 - x0 and the mean `turn` of the two nodes.
    #[inline]
    pub fn force_increment(&self, section: &Section, dx: DVec2, turn: f64) -> DVec2 {
        let gap = to_directors(self.d1, dx) - section.ds * turn * self.law_rate + self.gap;
        self.d1
            .rotate(section.condensing.truncate() * gap / section.ds)
    }
}

/// R^T v.
#[inline]
fn to_directors(d1: DVec2, v: DVec2) -> DVec2 {
    DVec2::new(d1.dot(v), d1.perp_dot(v))
}
