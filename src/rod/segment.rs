//! A single segment, in scalar arithmetic: its strains, energy and derivatives.

use crate::rod::element::{Element, FirstDerivatives};
use crate::rod::section::{NodePair, Section, SectionParameterDerivative};
use crate::rotation::RelativeRotation;
use crate::simd::Vectors;
use glam::{DMat3, DVec3};
use pulp::Scalar;

/// The derivative of a segment with respect to a parameter of its section, with nodes and
/// force fixed.
#[derive(Clone, Copy, Debug)]
pub struct SegmentParameterDerivative {
    /// Derivative of the derivatives of Pi with respect to the rotations of its nodes; that with
    /// respect to their positions does not change.
    pub gradient: [DVec3; 2],
    /// Derivative of the gap, the residual of the constitutive law.
    pub gap: DVec3,
    /// Derivative of Pi itself, the elastic energy at rest.
    pub energy: f64,
}

/// A segment in a given state.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Midpoint directors as columns.
    pub frame: DMat3,
    /// Curvature u.
    pub u: DVec3,
    /// Stress couple m = A (u - u0).
    pub m: DVec3,
    /// Director components nu of the force the segment carries.
    pub nu: DVec3,
    /// The strain for that force, v0 + c nu.
    pub w: DVec3,
    /// R^T (x1 - x0) - ds w: the residual of the constitutive law.
    pub gap: DVec3,
    relative: RelativeRotation<Scalar>,
}

/// First derivatives with respect to x = x1 - x0 and the spatial rotation increments a, b of the two
/// nodes.
#[derive(Clone, Copy, Debug)]
pub struct SegmentGradient {
    pub x: DVec3,
    pub a: DVec3,
    pub b: DVec3,
}

impl From<FirstDerivatives<Scalar>> for SegmentGradient {
    fn from(first: FirstDerivatives<Scalar>) -> Self {
        SegmentGradient {
            x: first.x.into(),
            a: first.a.into(),
            b: first.b.into(),
        }
    }
}

/// Second derivatives with respect to (x1 - x0) and the spatial rotation
/// increments a, b of the two nodes, the force being condensed out.
#[derive(Clone, Copy, Debug)]
pub struct SegmentHessian {
    /// d2/dx dx
    pub xx: DMat3,
    /// d2/dx da
    pub xa: DMat3,
    /// d2/dx db
    pub xb: DMat3,
    /// d2/da da
    pub aa: DMat3,
    /// d2/da db
    pub ab: DMat3,
    /// d2/db db
    pub bb: DMat3,
}

impl Section {
    /// ds/2 sum_k A_k (u_k - u0_k)^2.
    #[inline]
    pub fn bending_energy(&self, segment: &Segment) -> f64 {
        0.5 * self.ds * segment.m.dot(segment.u - self.rest_curvature)
    }

    /// Elastic energy in terms of the force carried, which equals the strain energy if the
    /// constitutive law holds: bending plus ds/2 sum_k c_k nu_k^2.
    #[inline]
    pub fn elastic_energy(&self, segment: &Segment) -> f64 {
        self.bending_energy(segment)
            + 0.5 * self.ds * (self.compliance * segment.nu * segment.nu).element_sum()
    }
}

impl Segment {
    /// The segment between `ends` that carries the spatial force `n`.
    pub fn new(section: &Section, ends: &NodePair, n: DVec3) -> Self {
        let element = Element::new(&section.into(), &ends.into(), n.into());
        let [d1, d2, d3] = element.frame.map(DVec3::from);
        Segment {
            frame: DMat3::from_cols(d1, d2, d3),
            u: element.u.into(),
            m: element.m.into(),
            nu: element.nu.into(),
            w: element.w.into(),
            gap: element.gap.into(),
            relative: element.relative,
        }
    }

    /// The segment between `ends` that carries the force of its strains; in rigid directions it
    /// carries none, and the gap is what it is strained there.
    pub fn with_strain_force(section: &Section, ends: &NodePair) -> Self {
        let idle = Segment::new(section, ends, DVec3::ZERO);
        let strain = idle.v(section) - section.rest_strain;
        let rigid = section.compliance.cmpeq(DVec3::ZERO);
        let force = DVec3::select(rigid, DVec3::ZERO, strain / section.compliance);
        Segment::new(section, ends, idle.frame * force)
    }

    fn element(&self) -> Element<Scalar> {
        let DMat3 {
            x_axis,
            y_axis,
            z_axis,
        } = self.frame;
        Element {
            frame: [x_axis, y_axis, z_axis].map(Vectors::from),
            u: self.u.into(),
            m: self.m.into(),
            nu: self.nu.into(),
            w: self.w.into(),
            gap: self.gap.into(),
            relative: self.relative,
        }
    }

    /// Strain v = R^T (x1 - x0)/ds.
    pub fn v(&self, section: &Section) -> DVec3 {
        self.gap / section.ds + self.w
    }

    /// Rotation between the two ends, in radians.
    pub fn end_rotation(&self) -> f64 {
        DVec3::from(self.relative.psi).length()
    }

    /// Bound on the excess stiffness of this element over the rod against rotations, about any
    /// axis, in a neutral mode: twice the energy per squared radian.
    ///
    /// The wave number k of such a mode is at most
    ///
    /// k^2 = p/A + m1^2/(A2 A3) + m2^2/(A3 A1) + m3^2/(A1 A2),   p = (|nu| - nu1)/2,
    ///
    /// A being the least of the couple stiffnesses and -p the least eigenvalue of nu1
    /// (theta2^2 + theta3^2) - theta1 (nu2 theta2 + nu3 theta3), the work of the force carried
    /// in rotations theta of the directors. The midpoint rule makes a wave (2/(k ds) tan(k
    /// ds/2))^2 - 1 = (k ds)^2/6 + ... times stiffer.
    pub fn excess_stiffness(&self, section: &Section) -> f64 {
        let (stiffness, m, ds) = (section.couple_stiffness, self.m, section.ds);
        let least = stiffness.min_element();
        let compression = 0.5 * (self.nu.length() - self.nu.x);
        let squared_wave_number =
            compression / least + (m * m).dot(stiffness) / stiffness.element_product();
        least * (squared_wave_number * ds).powi(2) * ds / 6.0
    }

    /// First derivatives of Pi at fixed force.
    pub fn gradient(&self, section: &Section) -> SegmentGradient {
        self.element().gradient(&section.into()).into()
    }

    /// First derivatives as [`Segment::gradient`], with the force condensed out: the right-hand side for
    /// [`Segment::hessian`].
    pub fn condensed_gradient(&self, section: &Section) -> SegmentGradient {
        self.element().condensed(&section.into()).into()
    }

    /// Second derivatives, the force condensed out.
    pub fn hessian(&self, section: &Section) -> SegmentHessian {
        let second = self.element().second(&section.into());
        let matrix = |rows: [Vectors<Scalar>; 3]| {
            let [a, b, c] = rows.map(DVec3::from);
            DMat3::from_cols(a, b, c).transpose()
        };
        SegmentHessian {
            xx: matrix(second.xx),
            xa: matrix(second.xa),
            xb: matrix(second.xb),
            aa: matrix(second.aa),
            ab: matrix(second.ab),
            bb: matrix(second.bb),
        }
    }

    /// The change of the spatial force for the nodal increments `dx` = dx1 - dx0 and spatial
    /// rotations `a`, `b`.
    pub fn force_increment(&self, section: &Section, dx: DVec3, a: DVec3, b: DVec3) -> DVec3 {
        let (element, turns) = (self.element(), [a.into(), b.into()]);
        let change = element.force_increment(&section.into(), dx.into(), turns);
        change.into()
    }

    /// The change of the gap for these increments at fixed spatial force.
    pub fn gap_increment(&self, section: &Section, dx: DVec3, a: DVec3, b: DVec3) -> DVec3 {
        let to_directors = self.frame.transpose();
        let (alpha, beta) = (to_directors * a, to_directors * b);
        let tau = DVec3::from(self.relative.tau);
        let mu = 0.5 * (alpha + beta) + 0.5 * (beta - alpha).cross(tau);
        let d_mu = section.compliance * self.nu.cross(mu) - self.w.cross(mu);
        to_directors * dx - section.ds * d_mu
    }

    /// The derivative with respect to a parameter of the section.
    pub fn parameter_derivative(
        &self,
        section: &Section,
        rate: &SectionParameterDerivative,
    ) -> SegmentParameterDerivative {
        let strain = rate.rest_strain + rate.compliance * self.nu;
        let bent = self.u - section.rest_curvature;
        // For fixed nodes the curvature is inversely proportional to ds.
        let bending = -self.u * (rate.ds / section.ds) - rate.rest_curvature;
        let moment = rate.couple_stiffness * bent + section.couple_stiffness * bending;
        let g_mu = rate.ds * self.nu.cross(self.w) + section.ds * self.nu.cross(strain);
        let moment = DVec3::from(self.relative.apply_derivative(moment.into()));
        let half = 0.5 * section.compliance * self.nu + section.rest_strain;
        let half_rate = 0.5 * rate.compliance * self.nu + rate.rest_strain;
        let bending_energy = 0.5 * rate.ds * self.m.dot(bent)
            + section.ds * (0.5 * (rate.couple_stiffness * bent).dot(bent) + self.m.dot(bending));
        SegmentParameterDerivative {
            gradient: self.nodal_derivatives(g_mu, moment),
            gap: -rate.ds * self.w - section.ds * strain,
            energy: bending_energy - self.nu.dot(rate.ds * half + section.ds * half_rate),
        }
    }

    /// The change of the condensed gradient by a change of the gap.
    pub fn gap_gradient(&self, section: &Section, gap: DVec3) -> SegmentGradient {
        let correction = section.condensing * gap;
        let g_mu = self.nu.cross(section.compliance * correction) - self.w.cross(correction);
        let [a, b] = self.nodal_derivatives(g_mu, DVec3::ZERO);
        SegmentGradient {
            x: self.frame * (correction / section.ds),
            a,
            b,
        }
    }

    /// Converts derivatives with respect to the rotation of the midpoint, and to the
    /// difference of the nodal rotations, to those with respect to the nodal rotations.
    fn nodal_derivatives(&self, g_mu: DVec3, moment: DVec3) -> [DVec3; 2] {
        let g_delta = 0.5 * DVec3::from(self.relative.tau).cross(g_mu) + moment;
        [0.5 * g_mu - g_delta, 0.5 * g_mu + g_delta].map(|g| self.frame * g)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// For a compressed segment the excess is that of the neutral wave; for a pulled one it is
    /// zero.
    #[test]
    fn the_excess_is_that_of_a_neutral_wave() {
        let (ds, stiffness): (f64, f64) = (0.1, 2.0);
        let section = Section {
            ds,
            couple_stiffness: DVec3::new(7.0, 3.0, stiffness),
            rest_curvature: DVec3::ZERO,
            rest_strain: DVec3::X,
            compliance: DVec3::ZERO,
            condensing: DVec3::ZERO,
        };
        let straight = NodePair {
            x: [DVec3::ZERO, ds * DVec3::X],
            q: [DQuat::IDENTITY; 2],
        };
        let excess = |force: f64| {
            let segment = Segment::new(&section, &straight, force * DVec3::X);
            segment.excess_stiffness(&section)
        };
        for wave_number in [0.5, 1.0, 2.0] {
            let load = stiffness * wave_number * wave_number;
            let half = 0.5 * wave_number * ds;
            let exact = ds * load * ((half.tan() / half).powi(2) - 1.0);
            let off = excess(-load) / exact - 1.0;
            // The next term of the series is (17/120) (k ds)^2 of the first.
            assert!((off / (half * half) + 17.0 / 30.0).abs() < 0.05, "{off}");
            assert_eq!(excess(load), 0.0);
        }
    }
}
