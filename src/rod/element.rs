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
//! the rest strain v0 being (stretch, 0, 0), e1 where nothing has grown, but
//! where internal friction acts.
//!
//! Stationary in n this is the paper's law; the implicit midpoint rule on eqs
//! (1) and (2) and the minimum of a discrete energy coincide. The force is
//! condensed out segment by segment, so that the nodes see a 12 x 12 matrix,
//! and Newton's method converges as fast for any stiffness in stretch and shear:
//! a rigid rod is c = 0.

use crate::rotation::{self, Relative, cross_matrix, outer};
use glam::{DMat3, DQuat, DVec3};

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

/// The two nodes of a segment.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    /// Positions of the nodes.
    pub x: [DVec3; 2],
    /// Rotations of the nodes.
    pub q: [DQuat; 2],
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
    /// The strain that goes with that force, v0 + c nu.
    pub w: DVec3,
    /// R^T (x1 - x0) - ds w: by how much the constitutive law is not yet met.
    pub gap: DVec3,
    relative: Relative,
}

/// Second derivatives with respect to (x1 - x0) and the spatial rotation
/// increments a, b of the two nodes, the force being condensed out.
#[derive(Clone, Copy, Debug)]
pub struct Blocks {
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
    /// Sets the stiffness that condenses the force out to at most `largest`.
    /// Beyond it the matrix is that of a softer rod while the residual stays
    /// exact: a proximal step in the force, which changes no solution, costs
    /// a contraction of the order of 1/`largest` an iteration, and keeps the
    /// pivots within what double precision holds.
    pub fn condense(mut self, largest: f64) -> Self {
        self.condensing = self.compliance.recip().min(DVec3::splat(largest));
        self
    }

    /// Elastic energy of the strains, ds/2 sum_k (H_k (v_k - v0_k)^2 +
    /// A_k (u_k - u0_k)^2). Infinite for a strained rigid rod.
    #[inline]
    pub fn strain_energy(&self, segment: &Segment) -> f64 {
        let gamma = segment.v(self) - self.rest_strain;
        0.5 * self.ds * (gamma * gamma / self.compliance).element_sum()
            + self.bending_energy(segment)
    }

    /// ds/2 sum_k A_k (u_k - u0_k)^2.
    #[inline]
    pub fn bending_energy(&self, segment: &Segment) -> f64 {
        0.5 * self.ds * segment.m.dot(segment.u - self.rest_curvature)
    }

    /// Elastic energy by the force carried, which equals the strain energy where
    /// the constitutive law is met: bending plus ds/2 sum_k c_k nu_k^2.
    #[inline]
    pub fn elastic_energy(&self, segment: &Segment) -> f64 {
        self.bending_energy(segment)
            + 0.5 * self.ds * (self.compliance * segment.nu * segment.nu).element_sum()
    }
}

impl Segment {
    /// The segment between `ends` that carries the spatial force `n`.
    #[inline]
    pub fn new(section: &Section, ends: &Ends, n: DVec3) -> Self {
        let relative = Relative::of(ends.q[0].conjugate() * ends.q[1]);
        let frame = DMat3::from_quat(rotation::midpoint(ends.q[0], ends.q[1]));
        let to_directors = frame.transpose();
        let u = relative.psi / section.ds;
        let nu = to_directors * n;
        let w = section.rest_strain + section.compliance * nu;
        Segment {
            frame,
            u,
            m: section.couple_stiffness * (u - section.rest_curvature),
            nu,
            w,
            gap: to_directors * (ends.x[1] - ends.x[0]) - section.ds * w,
            relative,
        }
    }

    /// Strain v = R^T (x1 - x0)/ds.
    pub fn v(&self, section: &Section) -> DVec3 {
        self.gap / section.ds + self.w
    }

    /// Rotation between the two ends, in radians.
    #[inline]
    pub fn turn(&self) -> f64 {
        self.relative.psi.length()
    }

    /// First derivatives of Pi, the force held: with respect to x1 (that to x0
    /// is its negative) and to the rotations of the two nodes.
    #[inline]
    pub fn gradient(&self, section: &Section) -> (DVec3, DVec3, DVec3) {
        self.pull_back(self.nu, section.ds * self.nu.cross(self.w))
    }

    /// As [`Segment::gradient`], with the force condensed out: the right-hand
    /// side that belongs to [`Segment::hessian`].
    #[inline]
    pub fn condensed_gradient(&self, section: &Section) -> (DVec3, DVec3, DVec3) {
        let correction = section.condensing * self.gap;
        let g_mu =
            section.ds * self.nu.cross(self.w) - self.law_rate(section).transpose() * correction;
        self.pull_back(self.nu + correction / section.ds, g_mu)
    }

    /// What the condensed gradient gains, to first order, if the compliance of
    /// the components in `dropped` (ones and zeros) is taken away.
    pub fn stiffening_gradient(&self, section: &Section, dropped: DVec3) -> (DVec3, DVec3, DVec3) {
        let gap = section.ds * dropped * section.compliance * self.nu;
        let correction = section.condensing * gap;
        let g_mu = -self.nu.cross(gap) - self.law_rate(section).transpose() * correction;
        let g_delta = 0.5 * self.relative.tau.cross(g_mu);
        (
            self.frame * (correction / section.ds),
            self.frame * (0.5 * g_mu - g_delta),
            self.frame * (0.5 * g_mu + g_delta),
        )
    }

    /// From the derivatives with respect to R^T dx and to the turn mu of the
    /// midpoint to nodal derivatives, adding the bending moment.
    #[inline]
    fn pull_back(&self, nu: DVec3, g_mu: DVec3) -> (DVec3, DVec3, DVec3) {
        let g_delta = 0.5 * self.relative.tau.cross(g_mu) + self.relative.derivative(self.m);
        (
            self.frame * nu,
            self.frame * (0.5 * g_mu - g_delta),
            self.frame * (0.5 * g_mu + g_delta),
        )
    }

    /// D with d(R w) = R D mu at constant spatial force.
    #[inline]
    fn law_rate(&self, section: &Section) -> DMat3 {
        DMat3::from_diagonal(section.compliance) * cross_matrix(self.nu) - cross_matrix(self.w)
    }

    /// Second derivatives, the force condensed out. Derived in the midpoint
    /// frame in terms of eta = (a + b)/2 and delta = b - a (see
    /// [`Relative`] for the expansions), then turned to the lab frame.
    #[inline]
    pub fn hessian(&self, section: &Section) -> Blocks {
        let ds = section.ds;
        let (nu, w) = (self.nu, self.w);
        let stiffness = section.condensing;
        let d = self.law_rate(section);
        let stiff_d = DMat3::from_diagonal(stiffness) * d;
        let cross_nu = cross_matrix(nu);

        // Turning of the midpoint.
        let w_nu = outer(w, nu);
        let geometric = DMat3::from_diagonal(DVec3::splat(w.dot(nu)))
            - 0.5 * (w_nu + w_nu.transpose())
            + cross_nu * DMat3::from_diagonal(section.compliance) * cross_nu;
        let p = ds * (d.transpose() * stiff_d + geometric);

        let g = ds * nu.cross(w);
        let tau = self.relative.tau;
        let cross_tau = cross_matrix(tau);
        let p_tau = p * cross_tau;
        let tau_y = outer(tau, tau.cross(g));
        let eta_delta = -0.5 * p_tau
            + 0.25 * (cross_tau * cross_matrix(g))
            + 0.5 * cross_matrix(self.relative.derivative(self.m));
        let delta_delta = -0.25 * (cross_tau * p_tau)
            + 0.125 * (tau_y + tau_y.transpose())
            + self.relative.congruence(section.couple_stiffness / ds)
            + self.relative.hessian(self.m);
        let half_xi_eta = -0.5 * stiff_d;
        let xi_delta = 0.5 * (stiff_d * cross_tau);

        // From eta, delta to the two nodes, from directors to the lab.
        let frame = self.frame;
        let to_directors = frame.transpose();
        let lab = |k: DMat3| frame * k * to_directors;
        let (quarter, transposed) = (0.25 * p, eta_delta.transpose());
        let mixed = 0.5 * (eta_delta + transposed);
        Blocks {
            xx: lab(DMat3::from_diagonal(stiffness / ds)),
            xa: lab(half_xi_eta - xi_delta),
            xb: lab(half_xi_eta + xi_delta),
            aa: lab(quarter - mixed + delta_delta),
            ab: lab(quarter + 0.5 * (eta_delta - transposed) - delta_delta),
            bb: lab(quarter + mixed + delta_delta),
        }
    }

    /// The change of the spatial force that goes with the nodal increments
    /// `dx` = dx1 - dx0 and spatial rotations `a`, `b`.
    #[inline]
    pub fn force_increment(&self, section: &Section, dx: DVec3, a: DVec3, b: DVec3) -> DVec3 {
        let to_directors = self.frame.transpose();
        let (alpha, beta) = (to_directors * a, to_directors * b);
        let mu = 0.5 * (alpha + beta) + 0.5 * (beta - alpha).cross(self.relative.tau);
        let d_mu = section.compliance * self.nu.cross(mu) - self.w.cross(mu);
        let gap = to_directors * dx - section.ds * d_mu + self.gap;
        self.frame * (section.condensing * gap / section.ds)
    }
}
