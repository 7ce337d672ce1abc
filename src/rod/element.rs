//! Elements of several segments in lanes: their strains and energy, and first and second derivatives with
//! respect to the variables of the strains and to the unknowns of the two nodes.

use crate::rod::section::{LaneNodes, LaneSections};
use crate::rotation::{MidpointRotation, RelativeRotation};
use crate::simd::{Lanes, Vectors};
use pulp::Simd;

/// Midpoint elements of several segments, one in each lane, with the variables of
/// [`Segment`](crate::rod::Segment).
#[derive(Clone, Copy)]
pub struct Element<S: Simd> {
    pub(super) frame: [Vectors<S>; 3],
    pub(super) u: Vectors<S>,
    pub(super) m: Vectors<S>,
    pub(super) nu: Vectors<S>,
    pub(super) w: Vectors<S>,
    pub(super) gap: Vectors<S>,
    pub(super) relative: RelativeRotation<S>,
}

impl<S: Simd> Element<S> {
    /// The segments between `nodes` that carry the spatial forces `n`.
    #[inline(always)]
    pub fn new(sections: &LaneSections<S>, nodes: &LaneNodes<S>, n: Vectors<S>) -> Self {
        let MidpointRotation { relative, frame } = MidpointRotation::between(nodes.q);
        let u = relative.psi.scale(sections.per_ds);
        let nu = n.director_components(frame);
        let w = nu * sections.compliance + sections.rest_strain;
        let dx = (nodes.x[1] - nodes.x[0]).director_components(frame);
        Element {
            frame,
            u,
            m: sections.couple_stiffness * (u - sections.rest_curvature),
            nu,
            w,
            gap: w.neg_mul_add(sections.ds, dx),
            relative,
        }
    }

    /// The segments between `nodes` that carry the forces of their strains, whose stiffness is the
    /// condensing one: zero is allowed.
    #[inline(always)]
    pub fn with_strain_forces(sections: &LaneSections<S>, nodes: &LaneNodes<S>) -> Self {
        let MidpointRotation { relative, frame } = MidpointRotation::between(nodes.q);
        let u = relative.psi.scale(sections.per_ds);
        let dx = (nodes.x[1] - nodes.x[0]).director_components(frame);
        let w = dx.scale(sections.per_ds);
        Element {
            frame,
            u,
            m: sections.couple_stiffness * (u - sections.rest_curvature),
            nu: sections.condensing * (w - sections.rest_strain),
            w,
            gap: Vectors::splat(sections.ds.simd, [0.0; 3]),
            relative,
        }
    }

    /// Squared rotation between the two ends.
    #[inline(always)]
    pub fn squared_turn(&self) -> Lanes<S> {
        self.relative.psi.dot(self.relative.psi)
    }

    /// Elastic energy of the strains, ds/2 sum_k (H_k (v_k - v0_k)^2 +
    /// A_k (u_k - u0_k)^2). Infinite for a strained rigid rod.
    #[inline(always)]
    pub fn strain_energy(&self, sections: &LaneSections<S>) -> Lanes<S> {
        let strain = self.w - sections.rest_strain;
        let gamma = self.gap.mul_add(sections.per_ds, strain);
        let stretch = gamma * gamma / sections.compliance;
        let bending = self.m.dot(self.u - sections.rest_curvature);
        let half = Lanes::splat(bending.simd, 0.5);
        half * sections.ds * (stretch.x + stretch.y + stretch.z + bending)
    }

    /// First derivatives of Pi at fixed force.
    #[inline(always)]
    pub fn gradient(&self, sections: &LaneSections<S>) -> FirstDerivatives<S> {
        self.nodal_derivatives(self.nu, self.nu.cross(self.w).scale(sections.ds), self.m)
    }

    /// First derivatives with the force condensed out: the right-hand side for [`Element::hessian`].
    #[inline(always)]
    pub fn condensed(&self, sections: &LaneSections<S>) -> FirstDerivatives<S> {
        let correction = sections.condensing * self.gap;
        let g_mu = self.nu.cross(self.w).scale(sections.ds);
        let g_mu = g_mu - self.law_rate_transposed(sections, correction);
        let nu = correction.mul_add(sections.per_ds, self.nu);
        self.nodal_derivatives(nu, g_mu, self.m)
    }

    /// The first-order change of the condensed gradient if the compliance of the components in
    /// `dropped` (ones and zeros) is removed.
    #[inline(always)]
    pub fn stiffening_gradient(
        &self,
        sections: &LaneSections<S>,
        dropped: Vectors<S>,
    ) -> FirstDerivatives<S> {
        let gap = (dropped * sections.compliance * self.nu).scale(sections.ds);
        let correction = sections.condensing * gap;
        let g_mu = -self.nu.cross(gap) - self.law_rate_transposed(sections, correction);
        let none = Vectors::splat(sections.ds.simd, [0.0; 3]);
        self.nodal_derivatives(correction.scale(sections.per_ds), g_mu, none)
    }

    /// Converts derivatives with respect to R^T dx and to the rotation mu of the midpoint to
    /// nodal derivatives, adding the bending moment `m`.
    #[inline(always)]
    pub(super) fn nodal_derivatives(
        &self,
        nu: Vectors<S>,
        g_mu: Vectors<S>,
        m: Vectors<S>,
    ) -> FirstDerivatives<S> {
        let g_mu = g_mu.scale(Lanes::splat(nu.x.simd, 0.5));
        let g_delta = self.relative.tau.cross(g_mu) + self.relative.apply_derivative(m);
        FirstDerivatives {
            x: nu.from_director_components(self.frame),
            a: (g_mu - g_delta).from_director_components(self.frame),
            b: (g_mu + g_delta).from_director_components(self.frame),
        }
    }

    /// D^T a, with d(R w) = R D mu at constant spatial force, D being
    /// diag(c) \[nu\] - \[w\].
    #[inline(always)]
    fn law_rate_transposed(&self, sections: &LaneSections<S>, a: Vectors<S>) -> Vectors<S> {
        self.w.cross(a) - self.nu.cross(sections.compliance * a)
    }

    /// The [`MidpointHessian`]; its derivatives with respect to the rotation of the midpoint are
    /// ds (D^T diag(k) D + w.nu - (w nu^T + nu w^T)/2 + \[nu\] diag(c) \[nu\]).
    #[inline(always)]
    fn midpoint_hessian(&self, sections: &LaneSections<S>) -> MidpointHessian<S> {
        let (nu, w, c, k) = (self.nu, self.w, sections.compliance, sections.condensing);
        let zero = Lanes::splat(k.x.simd, 0.0);
        let half = Lanes::splat(k.x.simd, 0.5);
        let (d01, d02) = (nu.z.neg_mul_add(c.x, w.z), nu.y.mul_add(c.x, -w.y));
        let (d10, d12) = (nu.z.mul_add(c.y, -w.z), nu.x.neg_mul_add(c.y, w.x));
        let (d20, d21) = (nu.y.neg_mul_add(c.z, w.y), nu.x.mul_add(c.z, -w.x));
        let (k01, k02, k10) = (k.x * d01, k.x * d02, k.y * d10);
        let (k12, k20, k21) = (k.y * d12, k.z * d20, k.z * d21);
        let (w_nu, squares) = (w.dot(nu), nu * nu);
        let xx = d10.mul_add(k10, d20 * k20) - w.x * nu.x;
        let yy = d01.mul_add(k01, d21 * k21) - w.y * nu.y;
        let zz = d02.mul_add(k02, d12 * k12) - w.z * nu.z;
        let xx = w_nu + xx - c.y.mul_add(squares.z, c.z * squares.y);
        let yy = w_nu + yy - c.x.mul_add(squares.z, c.z * squares.x);
        let zz = w_nu + zz - c.x.mul_add(squares.y, c.y * squares.x);
        let xy = c.z.mul_add(nu.x * nu.y, d20 * k21) - half * w.x.mul_add(nu.y, w.y * nu.x);
        let xz = c.y.mul_add(nu.x * nu.z, d10 * k12) - half * w.x.mul_add(nu.z, w.z * nu.x);
        let yz = c.x.mul_add(nu.y * nu.z, d01 * k02) - half * w.y.mul_add(nu.z, w.z * nu.y);
        MidpointHessian {
            law: [
                Vectors::new(zero, k10, k20),
                Vectors::new(k01, zero, k21),
                Vectors::new(k02, k12, zero),
            ],
            rotations: [
                Vectors::new(xx, xy, xz).scale(sections.ds),
                Vectors::new(xy, yy, yz).scale(sections.ds),
                Vectors::new(xz, yz, zz).scale(sections.ds),
            ],
        }
    }

    /// The [`MidpointHessian`] of segments of which the law is condensed out exactly, k = 1/c, in which
    /// c drops out, so that k may be zero, but for the components in `open` (ones and zeros), which are
    /// rigid, c = 0. With the others in L,
    ///
    /// diag(k) D = L \[nu\] - diag(k) \[w\],
    /// -\[w\] diag(k) \[w\] + \[nu\] L \[w\] + \[w\] L \[nu\] + w.nu - (w nu^T + nu w^T)/2.
    #[inline(always)]
    fn strained_midpoint_hessian(
        &self,
        sections: &LaneSections<S>,
        open: Vectors<S>,
    ) -> MidpointHessian<S> {
        let (nu, w, k) = (self.nu, self.w, sections.condensing);
        let zero = Lanes::splat(k.x.simd, 0.0);
        let half = Lanes::splat(k.x.simd, 0.5);
        let law = Vectors::splat(k.x.simd, [1.0; 3]) - open;
        let (k01, k02) = (
            k.x.mul_add(w.z, -law.x * nu.z),
            k.x.neg_mul_add(w.y, law.x * nu.y),
        );
        let (k10, k12) = (
            k.y.neg_mul_add(w.z, law.y * nu.z),
            k.y.mul_add(w.x, -law.y * nu.x),
        );
        let (k20, k21) = (
            k.z.mul_add(w.y, -law.z * nu.y),
            k.z.neg_mul_add(w.x, law.z * nu.x),
        );
        let (products, squares) = (w * nu, w * w);
        // Of an open component the terms L = 1 are taken back.
        let xx = k.y.mul_add(squares.z, k.z * squares.y) - products.y - products.z
            + (open.y * products.z + open.z * products.y) * Lanes::splat(k.x.simd, 2.0);
        let yy = k.x.mul_add(squares.z, k.z * squares.x) - products.x - products.z
            + (open.x * products.z + open.z * products.x) * Lanes::splat(k.x.simd, 2.0);
        let zz = k.x.mul_add(squares.y, k.y * squares.x) - products.x - products.y
            + (open.x * products.y + open.y * products.x) * Lanes::splat(k.x.simd, 2.0);
        let mean = |a: Lanes<S>, b: Lanes<S>, c: Lanes<S>, d: Lanes<S>| half * a.mul_add(b, c * d);
        let both = |a: Lanes<S>, b: Lanes<S>, c: Lanes<S>, d: Lanes<S>| a.mul_add(b, c * d);
        let xy = mean(w.x, nu.y, w.y, nu.x) - k.z * w.x * w.y - open.z * both(w.x, nu.y, w.y, nu.x);
        let xz = mean(w.x, nu.z, w.z, nu.x) - k.y * w.x * w.z - open.y * both(w.x, nu.z, w.z, nu.x);
        let yz = mean(w.y, nu.z, w.z, nu.y) - k.x * w.y * w.z - open.x * both(w.y, nu.z, w.z, nu.y);
        MidpointHessian {
            law: [
                Vectors::new(zero, k10, k20),
                Vectors::new(k01, zero, k21),
                Vectors::new(k02, k12, zero),
            ],
            rotations: [
                Vectors::new(xx, xy, xz).scale(sections.ds),
                Vectors::new(xy, yy, yz).scale(sections.ds),
                Vectors::new(xz, yz, zz).scale(sections.ds),
            ],
        }
    }

    /// F K F^T from the columns of K, F having the directors as columns.
    #[inline(always)]
    fn in_lab(&self, [a, b, c]: Rows<S>) -> Rows<S> {
        let frame = self.frame;
        let [a, b, c] = transposed([
            a.from_director_components(frame),
            b.from_director_components(frame),
            c.from_director_components(frame),
        ]);
        [
            a.from_director_components(frame),
            b.from_director_components(frame),
            c.from_director_components(frame),
        ]
    }

    /// F K F^T for a diagonal matrix K.
    #[inline(always)]
    fn diagonal_to_lab(&self, k: Vectors<S>) -> Rows<S> {
        let [d1, d2, d3] = self.frame;
        let [a, b, c] = transposed([d1.scale(k.x), d2.scale(k.y), d3.scale(k.z)]);
        [
            a.from_director_components(self.frame),
            b.from_director_components(self.frame),
            c.from_director_components(self.frame),
        ]
    }

    /// Second derivatives, the force condensed out, in terms of
    /// eta = (a + b)/2 and delta = b - a (see [`RelativeRotation`] for the expansions),
    /// then of the two nodes.
    #[inline(always)]
    pub fn second(&self, sections: &LaneSections<S>) -> SecondDerivatives<S> {
        self.second_derivatives_from_midpoint(sections, self.midpoint_hessian(sections))
    }

    /// Second derivatives as [`Element::second`], of segments that carry the forces of their strains,
    /// or in the components in `open` (ones and zeros) those of a rigid law.
    #[inline(always)]
    pub fn second_strained(
        &self,
        sections: &LaneSections<S>,
        open: Vectors<S>,
    ) -> SecondDerivatives<S> {
        let midpoint = self.strained_midpoint_hessian(sections, open);
        self.second_derivatives_from_midpoint(sections, midpoint)
    }

    /// The second derivatives from those with respect to the rotation of the midpoint.
    #[inline(always)]
    fn second_derivatives_from_midpoint(
        &self,
        sections: &LaneSections<S>,
        midpoint: MidpointHessian<S>,
    ) -> SecondDerivatives<S> {
        let simd = sections.ds.simd;
        let number = |value: f64| Lanes::splat(simd, value);
        let (half, quarter, eighth) = (number(0.5), number(0.25), number(0.125));
        let (stiff, p) = (self.in_lab(midpoint.law), self.in_lab(midpoint.rotations));
        let xx = self.diagonal_to_lab(sections.condensing.scale(sections.per_ds));
        let lab = |v: Vectors<S>| v.from_director_components(self.frame);
        let tau = lab(self.relative.tau);
        let g = lab(self.nu.cross(self.w).scale(sections.ds));
        let moment = lab(self.relative.apply_derivative(self.m)).scale(half);
        let y = tau.cross(g).scale(eighth);
        let bending = sections.couple_stiffness.scale(sections.per_ds);
        let matrix = self.relative.second_derivatives(bending, self.m);
        let diagonal = self.diagonal_to_lab(matrix.diagonal);
        let (v, w) = (lab(matrix.dyad), lab(self.relative.w));

        // P [tau], and [tau] P [tau].
        let q = [p[0].cross(tau), p[1].cross(tau), p[2].cross(tau)];
        let q_tau = [
            q[1].neg_mul_add(tau.z, q[2].scale(tau.y)),
            q[2].neg_mul_add(tau.x, q[0].scale(tau.z)),
            q[0].neg_mul_add(tau.y, q[1].scale(tau.x)),
        ];
        let none = Vectors::splat(simd, [0.0; 3]);
        let unit = |r: usize, value: Lanes<S>| {
            let mut row = none;
            *[&mut row.x, &mut row.y, &mut row.z][r] = value;
            row
        };
        let across = [
            Vectors::new(none.x, -moment.z, moment.y),
            Vectors::new(moment.z, none.x, -moment.x),
            Vectors::new(-moment.y, moment.x, none.x),
        ];
        let tau_g = tau.dot(g) * quarter;
        let (g, v_rows) = (g.scale(quarter).array(), v.array());
        let (tau_rows, w_rows, y_rows) = (tau.array(), w.array(), y.array());
        let [mut eta_delta, mut xa, mut xb, mut aa, mut ab, mut bb] = [[none; 3]; 6];
        for r in 0..3 {
            let row = q[r].neg_mul_add(half, across[r]);
            eta_delta[r] = tau.mul_add(g[r], row) - unit(r, tau_g);
        }
        let delta_eta = transposed(eta_delta);
        for r in 0..3 {
            let row = q_tau[r].neg_mul_add(quarter, diagonal[r] + unit(r, matrix.multiple));
            let row = tau.mul_add(y_rows[r], y.mul_add(tau_rows[r], row));
            let delta_delta = w.mul_add(v_rows[r], v.mul_add(w_rows[r], row));
            let eta_eta = p[r].scale(quarter);
            let symmetric = (eta_delta[r] + delta_eta[r]).scale(half);
            let skew = (eta_delta[r] - delta_eta[r]).scale(half);
            aa[r] = eta_eta - symmetric + delta_delta;
            bb[r] = eta_eta + symmetric + delta_delta;
            ab[r] = eta_eta + skew - delta_delta;
            let (eta, delta) = (stiff[r].scale(half), stiff[r].cross(tau).scale(half));
            xa[r] = -(eta + delta);
            xb[r] = delta - eta;
        }
        SecondDerivatives {
            xx,
            xa,
            xb,
            aa,
            ab,
            bb,
        }
    }

    /// Second derivatives by nodes.
    #[inline(always)]
    pub fn hessian(&self, sections: &LaneSections<S>) -> NodalHessian<S> {
        self.second(sections).nodal_hessian()
    }

    /// The change of the spatial force for the nodal increments `dx` = dx1 - dx0 and the
    /// spatial rotations `turns` of both nodes.
    #[inline(always)]
    pub fn force_increment(
        &self,
        sections: &LaneSections<S>,
        dx: Vectors<S>,
        turns: [Vectors<S>; 2],
    ) -> Vectors<S> {
        let half = Lanes::splat(dx.x.simd, 0.5);
        let [alpha, beta] = [
            turns[0].director_components(self.frame),
            turns[1].director_components(self.frame),
        ];
        let mu = (alpha + beta + (beta - alpha).cross(self.relative.tau)).scale(half);
        let d_mu = sections.compliance * self.nu.cross(mu) - self.w.cross(mu);
        let gap = d_mu.neg_mul_add(sections.ds, dx.director_components(self.frame) + self.gap);
        let change = sections.condensing * gap.scale(sections.per_ds);
        change.from_director_components(self.frame)
    }
}

/// A matrix, rows first.
type Rows<S> = [Vectors<S>; 3];

/// Second derivatives in the frame of the midpoint, the force condensed out.
struct MidpointHessian<S: Simd> {
    /// Columns of diag(k) D: D is the rate of R w with the rotation, k the condensing stiffness.
    law: Rows<S>,
    /// Derivatives with respect to the rotation of the midpoint.
    rotations: Rows<S>,
}

/// First derivatives with respect to (x1 - x0) and the spatial rotation increments a, b of the two
/// nodes.
#[derive(Clone, Copy)]
pub struct FirstDerivatives<S: Simd> {
    pub x: Vectors<S>,
    pub a: Vectors<S>,
    pub b: Vectors<S>,
}

/// Second derivatives with respect to (x1 - x0) and the spatial rotation
/// increments a, b of the two nodes.
pub struct SecondDerivatives<S: Simd> {
    pub xx: Rows<S>,
    pub xa: Rows<S>,
    pub xb: Rows<S>,
    pub aa: Rows<S>,
    pub ab: Rows<S>,
    pub bb: Rows<S>,
}

impl<S: Simd> SecondDerivatives<S> {
    /// These second derivatives by nodes.
    #[inline(always)]
    pub fn nodal_hessian(self) -> NodalHessian<S> {
        let SecondDerivatives {
            xx,
            xa,
            xb,
            aa,
            ab,
            bb,
        } = self;
        let none = [[xx[0].x; UNKNOWNS]; UNKNOWNS];
        let (mut left, mut right, mut across) = (none, none, none);
        let (ax, bx) = (transposed(xa), transposed(xb));
        for r in 0..3 {
            let (xx, xb, aa, ab) = (xx[r].array(), xb[r].array(), aa[r].array(), ab[r].array());
            let (ax, bx, bb) = (ax[r].array(), bx[r].array(), bb[r].array());
            for c in 0..3 {
                left[r][c] = aa[c];
                left[r][3 + c] = -ax[c];
                left[3 + r][3 + c] = xx[c];
                right[r][c] = bb[c];
                right[r][3 + c] = bx[c];
                right[3 + r][3 + c] = xx[c];
                across[r][c] = ab[c];
                across[r][3 + c] = ax[c];
                across[3 + r][c] = -xb[c];
                across[3 + r][3 + c] = -xx[c];
            }
        }
        NodalHessian {
            diagonal_blocks: [left, right],
            off_diagonal_block: across,
        }
    }
}

/// Second derivatives with respect to the unknowns of the two nodes, the force condensed out.
pub struct NodalHessian<S: Simd> {
    /// The nodes' own blocks, upper triangles.
    pub diagonal_blocks: [LaneBlock<S>; 2],
    /// The block between the first and the second.
    pub off_diagonal_block: LaneBlock<S>,
}

/// A block of a matrix of nodal unknowns, rows first.
pub type LaneBlock<S> = [[Lanes<S>; UNKNOWNS]; UNKNOWNS];

/// Unknowns of a node: rotation, then displacement.
pub const UNKNOWNS: usize = 6;

/// The transposed matrix.
#[inline(always)]
fn transposed<S: Simd>([a, b, c]: Rows<S>) -> Rows<S> {
    [
        Vectors::new(a.x, b.x, c.x),
        Vectors::new(a.y, b.y, c.y),
        Vectors::new(a.z, b.z, c.z),
    ]
}

/// First derivatives with respect to the unknowns of the two nodes.
#[inline(always)]
pub fn nodal_gradient<S: Simd>(first: FirstDerivatives<S>) -> [[Lanes<S>; UNKNOWNS]; 2] {
    let FirstDerivatives { x, a, b } = first;
    [
        [a.x, a.y, a.z, -x.x, -x.y, -x.z],
        [b.x, b.y, b.z, x.x, x.y, x.z],
    ]
}
