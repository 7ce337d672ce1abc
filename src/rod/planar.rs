//! The midpoint element of segments that stay in the plane z = 0.
//!
//! Rotations about one axis commute: they are angles theta, whose geodesic
//! midpoint is their mean. With psi = theta1 - theta0, d1 the direction of
//! the mean angle and R its rotation,
//!
//! Pi = nu . (R^T (x1 - x0) - ds v0) - ds/2 sum_k c_k nu_k^2
//!      + A_3/(2 ds) (psi - ds u0)^2,
//!
//! the planar case of [`Segment`](super::Segment). Except for the bending, the rotations of
//! the nodes enter by their mean only.

use super::element::{Element, Hessian, Nodes};
use super::section::Sections;
use crate::lanes::{Lanes, Vectors};
use crate::rotation;
use pulp::Simd;

/// A vector in the plane for each of several segments.
type Pair<S> = [Lanes<S>; 2];

/// Several segments in the plane.
#[derive(Clone, Copy)]
pub struct PlanarElement<S: Simd> {
    /// Midpoint director d1.
    d1: Pair<S>,
    /// Angle psi between the two ends.
    psi: Lanes<S>,
    /// Stress couple about d3.
    m: Lanes<S>,
    /// Director components of the force the segment carries.
    nu: Pair<S>,
    /// The strain for that force, v0 + c nu.
    w: Pair<S>,
    /// R^T (x1 - x0) - ds w.
    gap: Pair<S>,
    /// D with d(R w) = R D dtheta at constant spatial force, theta the mean angle.
    law_rate: Pair<S>,
}

#[inline(always)]
fn dot<S: Simd>(a: Pair<S>, b: Pair<S>) -> Lanes<S> {
    a[0].times(b[0], a[1] * b[1])
}

/// a_1 b_2 - a_2 b_1.
#[inline(always)]
fn perp_dot<S: Simd>(a: Pair<S>, b: Pair<S>) -> Lanes<S> {
    a[1].times_from(b[0], a[0] * b[1])
}

impl<S: Simd> PlanarElement<S> {
    /// R v.
    #[inline(always)]
    fn in_lab(&self, v: Pair<S>) -> Pair<S> {
        let [x, y] = self.d1;
        [y.times_from(v[1], x * v[0]), y.times(v[0], x * v[1])]
    }

    /// First derivatives from those with respect to R^T dx and the two angles.
    #[inline(always)]
    fn pull_back(&self, nu: Pair<S>, turns: Pair<S>) -> [[Lanes<S>; 3]; 2] {
        let [x, y] = self.in_lab(nu);
        [[turns[0], -x, -y], [turns[1], x, y]]
    }
}

impl<S: Simd> Element<S, 3> for PlanarElement<S> {
    #[inline(always)]
    fn new(sections: &Sections<S>, nodes: &Nodes<S>, n: Vectors<S>) -> Self {
        let simd = sections.ds.simd;
        let one = Lanes::splat(simd, 1.0);
        let [a, b] = [nodes.q[0], nodes.q[1]];
        let (a, b) = ([a.1, a.0.z], [b.1, b.0.z]);
        let cos = dot(a, b) + Lanes::splat(simd, f64::MIN_POSITIVE);
        let sign = one.where_positive(cos, -one);
        let b = [b[0] * sign, b[1] * sign];
        let d = [b[0] - a[0], b[1] - a[1]];
        let delta = dot(d, d);
        let [sigma, ..] = rotation::series(delta);
        let psi = (sigma + sigma) * perp_dot(a, b);
        // Half angles add, and twice their mean is the mean angle.
        let s = [a[0] + b[0], a[1] + b[1]];
        let inverse = (Lanes::splat(simd, 4.0) - delta).recip();
        let d1 = [
            s[1].times_from(s[1], s[0] * s[0]) * inverse,
            (s[0] + s[0]) * s[1] * inverse,
        ];
        let onto = |v: Pair<S>| [dot(d1, v), perp_dot(d1, v)];
        let (c, rest) = (sections.compliance, sections.rest_strain);
        let nu = onto([n.x, n.y]);
        let w = [c.x.times(nu[0], rest.x), c.y.times(nu[1], rest.y)];
        let dx = nodes.x[1] - nodes.x[0];
        let dx = onto([dx.x, dx.y]);
        let u = psi * sections.per_ds;
        PlanarElement {
            d1,
            psi,
            m: sections.couple_stiffness.z * (u - sections.rest_curvature.z),
            nu,
            w,
            gap: [
                w[0].times_from(sections.ds, dx[0]),
                w[1].times_from(sections.ds, dx[1]),
            ],
            law_rate: [c.x.times(nu[1], -w[1]), c.y.times_from(nu[0], w[0])],
        }
    }

    #[inline(always)]
    fn squared_turn(&self) -> Lanes<S> {
        self.psi * self.psi
    }

    #[inline(always)]
    fn strain_energy(&self, sections: &Sections<S>) -> Lanes<S> {
        let (c, rest) = (sections.compliance, sections.rest_strain);
        let gamma = [
            self.gap[0].times(sections.per_ds, self.w[0] - rest.x),
            self.gap[1].times(sections.per_ds, self.w[1] - rest.y),
        ];
        let stretch = gamma[0] * gamma[0] / c.x + gamma[1] * gamma[1] / c.y;
        let bending = self.psi * sections.per_ds - sections.rest_curvature.z;
        let half = Lanes::splat(bending.simd, 0.5);
        half * sections.ds * self.m.times(bending, stretch)
    }

    #[inline(always)]
    fn condensed_gradient(&self, sections: &Sections<S>) -> [[Lanes<S>; 3]; 2] {
        let k = sections.condensing;
        let correction = [k.x * self.gap[0], k.y * self.gap[1]];
        let mean = sections.ds * perp_dot(self.nu, self.w) - dot(self.law_rate, correction);
        let mean = mean * Lanes::splat(mean.simd, 0.5);
        let nu = [
            correction[0].times(sections.per_ds, self.nu[0]),
            correction[1].times(sections.per_ds, self.nu[1]),
        ];
        self.pull_back(nu, [mean - self.m, mean + self.m])
    }

    #[inline(always)]
    fn stiffening_gradient(
        &self,
        sections: &Sections<S>,
        dropped: Vectors<S>,
    ) -> [[Lanes<S>; 3]; 2] {
        let gap = (dropped * sections.compliance).scale(sections.ds);
        let gap = [gap.x * self.nu[0], gap.y * self.nu[1]];
        let k = sections.condensing;
        let correction = [k.x * gap[0], k.y * gap[1]];
        let mean = -perp_dot(self.nu, gap) - dot(self.law_rate, correction);
        let mean = mean * Lanes::splat(mean.simd, 0.5);
        let nu = [
            correction[0] * sections.per_ds,
            correction[1] * sections.per_ds,
        ];
        self.pull_back(nu, [mean, mean])
    }

    #[inline(always)]
    fn hessian(&self, sections: &Sections<S>) -> Hessian<S, 3> {
        let (c, k, [x, y]) = (sections.compliance, sections.condensing, self.d1);
        let number = |value: f64| Lanes::splat(c.x.simd, value);
        let nu = self.nu;
        let geometric = dot(self.w, nu) - c.x.times(nu[1] * nu[1], c.y * nu[0] * nu[0]);
        let stiff_rate = [k.x * self.law_rate[0], k.y * self.law_rate[1]];
        let mean = sections.ds * (dot(self.law_rate, stiff_rate) + geometric);
        let mean = mean * number(0.25);
        let bending = sections.couple_stiffness.z * sections.per_ds;
        let half = number(-0.5);
        let [tx, ty] = self.in_lab([stiff_rate[0] * half, stiff_rate[1] * half]);
        let (k1, k2) = (k.x * sections.per_ds, k.y * sections.per_ds);
        let (xx, xy) = (x.times(x * k1, y * y * k2), x * y * (k1 - k2));
        let yy = y.times(y * k1, x * x * k2);
        let (same, across) = (mean + bending, mean - bending);
        Hessian {
            own: [
                [[same, -tx, -ty], [-tx, xx, xy], [-ty, xy, yy]],
                [[same, tx, ty], [tx, xx, xy], [ty, xy, yy]],
            ],
            across: [[across, tx, ty], [-tx, -xx, -xy], [-ty, -xy, -yy]],
        }
    }

    #[inline(always)]
    fn force_increment(
        &self,
        sections: &Sections<S>,
        dx: Vectors<S>,
        turns: [Vectors<S>; 2],
    ) -> Vectors<S> {
        let number = |value: f64| Lanes::splat(dx.x.simd, value);
        let turn = (turns[0].z + turns[1].z) * number(0.5) * sections.ds;
        let (dx, k) = ([dx.x, dx.y], sections.condensing);
        let gap = [
            turn.times_from(self.law_rate[0], dot(self.d1, dx) + self.gap[0]),
            turn.times_from(self.law_rate[1], perp_dot(self.d1, dx) + self.gap[1]),
        ];
        let nu = [
            k.x * gap[0] * sections.per_ds,
            k.y * gap[1] * sections.per_ds,
        ];
        let [x, y] = self.in_lab(nu);
        Vectors::new(x, y, number(0.0))
    }
}
