//! The explicit method's two loops over the nodes of a rod: internal forces of
//! the midpoint element, and the motion of the nodes.
//!
//! The element is that of [`crate::rod`] with the force not carried as an
//! unknown but following from the strains, n = H (v - v0), which has the same
//! equilibria. With q0, q1 at its ends, s = q0 + q1, and w the vector part of
//! q0^* q1:
//!
//! ```text
//! R = R(s/|s|),   tau = 2 w/|s|^2 = tan(psi/4),   psi = 2 sigma w
//! N = R H/ds (R^T dx - ds v0),   G = dx x N,   M = S A/ds (psi - ds u0)
//! moments on the ends:  G/2 + T,  G/2 - T,   T = R (M - tau x R^T G / 2)
//! ```
//!
//! where S is the derivative of the rotation vector (see
//! [`crate::rotation::Relative`]); it and sigma are polynomials in |tau|^2, so
//! that a segment costs one division and no root.

use pulp::Simd;

use super::lanes::{Lanes, Vectors};

/// Nodes come in groups of so many; arrays are that much longer at both ends.
pub const GROUP: usize = 4;

/// (atan(t)/t - 1/(1 + t^2))/t^2 as a polynomial in t^2: Chebyshev
/// approximation on 0..0.2, largest error 1.5e-16. Up to there, a segment bent
/// by 1.68, a little more than what counts as resolved.
const ARC: [f64; 12] = [
    0.6666666666666665,
    -0.7999999999997793,
    0.8571428570900812,
    -0.8888888839308582,
    0.9090906676221484,
    -0.9230699538858028,
    0.9332050533276417,
    -0.9396083201314949,
    0.9343996372701941,
    -0.8797868281567068,
    0.6861356795488665,
    -0.31248722232027437,
];

/// cos and sin(a)/a as series in a^2, for angles of a step (halved): 1e-15 up
/// to 0.6.
const COS: [f64; 7] = [
    1.0,
    -1.0 / 2.0,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
];
const SINC: [f64; 7] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
];

/// Positions of a rod's nodes, one array per component. Node i stands at
/// GROUP + i; what is before and after is never used, only read.
#[derive(Clone, Debug)]
pub struct Positions {
    pub x: [Vec<f64>; 3],
}

/// What else moves.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Rotations as unit quaternions.
    pub q: [Vec<f64>; 4],
    /// Velocities, half a step behind or ahead.
    pub v: [Vec<f64>; 3],
    /// Angular momenta along the lab axes, likewise.
    pub p: [Vec<f64>; 3],
    /// Force N of the segment from node i to i + 1; zero beyond the last.
    pub n: [Vec<f64>; 3],
    /// Moment on its left and on its right end.
    pub left: [Vec<f64>; 3],
    pub right: [Vec<f64>; 3],
}

/// Strains of the last two steps, for internal damping: R^T dx, then psi.
#[derive(Clone, Debug)]
pub struct Past {
    pub one: [[Vec<f64>; 3]; 2],
    pub two: [[Vec<f64>; 3]; 2],
}

/// What a rod is made of, per segment and per node.
#[derive(Clone, Debug)]
pub struct Material {
    /// H/ds.
    pub stretch: [Vec<f64>; 3],
    /// ds times the rest stretch: the rest strain is v0 = (stretch, 0, 0).
    pub rest_length: Vec<f64>,
    /// A/ds.
    pub bend: [Vec<f64>; 3],
    /// ds u0.
    pub rest_turn: [Vec<f64>; 3],
    /// Mass; that of a held node and of a joint tip is not in here.
    pub mass: Vec<f64>,
    /// 1/mass; zero for a node that is held, and for a joint tip.
    pub per_mass: Vec<f64>,
    /// 1/J of a node about d2 and d3; zero for a node that is held.
    pub per_inertia: Vec<f64>,
    /// 1/J1 - 1/J.
    pub per_spin: Vec<f64>,
    /// Length of rod that loads on the node come from.
    pub weight: Vec<f64>,
    /// Fraction of the length that coupling on the node comes from.
    pub coupled: Vec<f64>,
}

/// Internal forces of all segments. If `DAMPED`, with internal friction; if
/// `CHANGES`, with what a change of the rest curvature does.
pub struct Forces<'a, const DAMPED: bool, const CHANGES: bool> {
    pub groups: usize,
    pub positions: &'a Positions,
    pub motion: &'a mut Motion,
    pub material: &'a Material,
    /// Factor of the rest curvature.
    pub rest: f64,
    pub past: &'a mut Past,
    /// Retardation time.
    pub retardation: f64,
    /// Weights of the present and the past strains in their rate.
    pub rates: [f64; 3],
    /// Whether the present becomes the past.
    pub remember: bool,
}

/// What the internal forces of a rod sum up to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Powers {
    /// Power of internal friction, over the retardation time.
    pub friction: f64,
    /// Elastic energy taken by a rise of the factor of the rest curvature,
    /// over that rise.
    pub rest: f64,
}

/// The rate of a strain, from the last two.
#[inline(always)]
fn rate<S: Simd>(
    simd: S,
    (one, two): (&mut [Vec<f64>; 3], &mut [Vec<f64>; 3]),
    (now, at): (Vectors<S>, usize),
    rates: [Lanes<S>; 3],
    remember: bool,
) -> Vectors<S> {
    let last = Vectors::load(simd, one, at);
    let before = Vectors::load(simd, two, at);
    if remember {
        last.store(two, at);
        now.store(one, at);
    }
    before.times(rates[2], last.times(rates[1], now.scale(rates[0])))
}

/// Vector and scalar parts of unit quaternions.
#[inline(always)]
fn quaternion<S: Simd>(simd: S, q: &[Vec<f64>; 4], at: usize) -> (Vectors<S>, Lanes<S>) {
    let vector = Vectors::new(
        Lanes::load(simd, &q[0], at),
        Lanes::load(simd, &q[1], at),
        Lanes::load(simd, &q[2], at),
    );
    (vector, Lanes::load(simd, &q[3], at))
}

impl<const DAMPED: bool, const CHANGES: bool> pulp::WithSimd for Forces<'_, DAMPED, CHANGES> {
    type Output = Powers;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Powers {
        let Forces {
            groups,
            positions,
            motion,
            material,
            rest,
            past,
            retardation,
            rates,
            remember,
        } = self;
        let rates = [
            Lanes::splat(simd, rates[0]),
            Lanes::splat(simd, rates[1]),
            Lanes::splat(simd, rates[2]),
        ];
        let retardation = Lanes::splat(simd, retardation);
        let mut power = Lanes::splat(simd, 0.0);
        let mut lost = Lanes::splat(simd, 0.0);
        let Past {
            one: past_one,
            two: past_two,
        } = past;
        let ([one_v, one_psi], [two_v, two_psi]) = (past_one, past_two);
        let one = Lanes::splat(simd, 1.0);
        let two = Lanes::splat(simd, 2.0);
        let half = Lanes::splat(simd, 0.5);
        let rest = Lanes::splat(simd, rest);
        let mut at = GROUP;
        while at < GROUP * (groups + 1) {
            let (a, aw) = quaternion(simd, &motion.q, at);
            let (b, bw) = quaternion(simd, &motion.q, at + 1);
            // Midpoint frame: the rotation matrix of s without its length.
            let (s, sw) = (a + b, aw + bw);
            let squared = s.dot(s) + sw * sw;
            let inverse = squared.recip();
            let twice = inverse + inverse;
            let t = s.scale(twice);
            let (xx, yy, zz) = (s.x * t.x, s.y * t.y, s.z * t.z);
            let (xy, xz, yz) = (s.x * t.y, s.x * t.z, s.y * t.z);
            let (wx, wy, wz) = (sw * t.x, sw * t.y, sw * t.z);
            let d1 = Vectors::new(one - (yy + zz), xy + wz, xz - wy);
            let d2 = Vectors::new(xy - wz, one - (xx + zz), yz + wx);
            let d3 = Vectors::new(xz + wy, yz - wx, one - (xx + yy));
            // Strains and force.
            let dx =
                Vectors::load(simd, &positions.x, at + 1) - Vectors::load(simd, &positions.x, at);
            let length = Lanes::load(simd, &material.rest_length, at);
            let v = Vectors::new(d1.dot(dx), d2.dot(dx), d3.dot(dx));
            let mut strain = Vectors::new(v.x - length, v.y, v.z);
            let stiffness = Vectors::load(simd, &material.stretch, at);
            if DAMPED {
                let rate = rate(simd, (one_v, two_v), (v, at), rates, remember);
                strain = rate.times(retardation, strain);
                power = power + rate.dot(rate.each(stiffness));
            }
            let n = strain.each(stiffness);
            let force = d3.scale(n.z);
            let force = d2.times(n.y, force);
            let force = d1.times(n.x, force);
            // Relative rotation: vector part of conjugate(q0) q1.
            let w = b.scale(aw) - a.cross(b);
            let w = w - a.scale(bw);
            let tau = w.scale(twice);
            let z = tau.dot(tau);
            let arc = z.polynomial(&ARC);
            let one_z = z + one;
            // 4/|s|^2 (K) with K = 1/(1 + z) + z arc, and 1 + z = 4/|s|^2.
            let sigma = (arc * z).times(one_z, one);
            let psi = w.scale(two * sigma);
            let rest_turn = Vectors::load(simd, &material.rest_turn, at);
            let mut turn = psi - rest_turn.scale(rest);
            let stiffness = Vectors::load(simd, &material.bend, at);
            if CHANGES {
                lost = lost + rest_turn.dot(turn.each(stiffness));
            }
            if DAMPED {
                let rate = rate(simd, (one_psi, two_psi), (psi, at), rates, remember);
                turn = rate.times(retardation, turn);
                power = power + rate.dot(rate.each(stiffness));
            }
            let m = turn.each(stiffness);
            let c = arc * one_z * one_z * one_z * Lanes::splat(simd, -0.25);
            let moment = w.times(c * w.dot(m), m.scale(sigma));
            // Moments on the ends.
            let g = dx.cross(force).scale(half);
            let g_mid = Vectors::new(d1.dot(g), d2.dot(g), d3.dot(g));
            let moment = moment - tau.cross(g_mid);
            let twist = d3.scale(moment.z);
            let twist = d2.times(moment.y, twist);
            let twist = d1.times(moment.x, twist);
            force.store(&mut motion.n, at);
            (g + twist).store(&mut motion.left, at);
            (g - twist).store(&mut motion.right, at);
            at += S::F64_LANES;
        }
        Powers {
            friction: power.sum(),
            rest: lost.sum(),
        }
    }
}

/// Coupling with a neighbour.
pub struct Neighbour<'a> {
    pub positions: &'a Positions,
    /// Force per displacement and unit of sigma.
    pub stiffness: [f64; 3],
}

/// A kick by all forces, of length `kick`, velocities before it times `keep`.
/// Returns twice the kinetic energy in the middle of the kick.
pub struct Kick<'a> {
    pub groups: usize,
    pub positions: &'a Positions,
    pub neighbours: [Option<Neighbour<'a>>; 2],
    pub motion: &'a mut Motion,
    pub material: &'a Material,
    pub gravity: [f64; 3],
    pub keep: f64,
    pub kick: f64,
}

impl pulp::WithSimd for Kick<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Kick {
            groups,
            positions,
            neighbours,
            motion,
            material,
            gravity,
            keep,
            kick,
        } = self;
        let gravity = Vectors::splat(simd, gravity);
        let mut energy = Lanes::splat(simd, 0.0);
        let (keep, kick) = (Lanes::splat(simd, keep), Lanes::splat(simd, kick));
        let mut at = GROUP;
        while at < GROUP * (groups + 1) {
            let weight = Lanes::load(simd, &material.weight, at);
            let mut force =
                Vectors::load(simd, &motion.n, at) - Vectors::load(simd, &motion.n, at - 1);
            force = gravity.times(weight, force);
            for neighbour in neighbours.iter().flatten() {
                let stiffness = Vectors::splat(simd, neighbour.stiffness);
                let gap = Vectors::load(simd, &neighbour.positions.x, at)
                    - Vectors::load(simd, &positions.x, at);
                let share = Lanes::load(simd, &material.coupled, at);
                force = gap.each(stiffness).times(share, force);
            }
            let moment =
                Vectors::load(simd, &motion.left, at) + Vectors::load(simd, &motion.right, at - 1);
            let per_mass = Lanes::load(simd, &material.per_mass, at);
            let before = Vectors::load(simd, &motion.v, at);
            let after = force.times(kick * per_mass, before.scale(keep));
            after.store(&mut motion.v, at);
            let v = before + after;
            let before = Vectors::load(simd, &motion.p, at);
            let after = moment.times(kick, before.scale(keep));
            after.store(&mut motion.p, at);
            let p = before + after;
            let (q, w) = quaternion(simd, &motion.q, at);
            let spin = own_axis(simd, q, w).dot(p);
            energy = v
                .dot(v)
                .times(Lanes::load(simd, &material.mass, at), energy);
            energy = p
                .dot(p)
                .times(Lanes::load(simd, &material.per_inertia, at), energy);
            energy = (spin * spin).times(Lanes::load(simd, &material.per_spin, at), energy);
            at += S::F64_LANES;
        }
        // Velocities were sums of two.
        0.25 * energy.sum()
    }
}

/// The director d1.
#[inline(always)]
fn own_axis<S: Simd>(simd: S, q: Vectors<S>, w: Lanes<S>) -> Vectors<S> {
    let (one, two) = (Lanes::splat(simd, 1.0), Lanes::splat(simd, 2.0));
    Vectors::new(
        one - two * (q.y * q.y + q.z * q.z),
        two * (q.x * q.y + w * q.z),
        two * (q.x * q.z - w * q.y),
    )
}

/// Free flight for the time `step`: positions move on, and every node turns
/// as a body free of moments with one axis of symmetry does: about its angular
/// momentum, and about its own axis.
pub struct Drift<'a> {
    pub groups: usize,
    pub positions: &'a mut Positions,
    pub motion: &'a mut Motion,
    pub material: &'a Material,
    pub step: f64,
}

impl pulp::WithSimd for Drift<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Drift {
            groups,
            positions,
            motion,
            material,
            step,
        } = self;
        let step = Lanes::splat(simd, step);
        let half_step = Lanes::splat(simd, 0.5) * step;
        let (three_halves, half) = (Lanes::splat(simd, 1.5), Lanes::splat(simd, 0.5));
        let mut at = GROUP;
        while at < GROUP * (groups + 1) {
            let v = Vectors::load(simd, &motion.v, at);
            v.times(step, Vectors::load(simd, &positions.x, at))
                .store(&mut positions.x, at);
            let (q, w) = quaternion(simd, &motion.q, at);
            let p = Vectors::load(simd, &motion.p, at);
            // Half angle about the angular momentum.
            let a = p.scale(half_step * Lanes::load(simd, &material.per_inertia, at));
            let squared = a.dot(a);
            let (c, s) = (squared.polynomial(&COS), squared.polynomial(&SINC));
            let a = a.scale(s);
            // q <- (a, c) q
            let turned = q.scale(c) + a.cross(q);
            let turned = a.times(w, turned);
            let turned_w = c * w - a.dot(q);
            // Half angle about the body's own axis d1 of the old rotation.
            let b =
                own_axis(simd, q, w).dot(p) * half_step * Lanes::load(simd, &material.per_spin, at);
            let squared = b * b;
            let (c, s) = (squared.polynomial(&COS), b * squared.polynomial(&SINC));
            // q <- q (s, 0, 0, c)
            let x = turned.x.times(c, turned_w * s);
            let y = turned.y.times(c, turned.z * s);
            let z = turned.y.times_from(s, turned.z * c);
            let w = turned.x.times_from(s, turned_w * c);
            // Back to unit length, from very near to it.
            let squared = x * x + y * y + (z * z + w * w);
            let scale = half.times_from(squared, three_halves);
            (x * scale).store(&mut motion.q[0], at);
            (y * scale).store(&mut motion.q[1], at);
            (z * scale).store(&mut motion.q[2], at);
            (w * scale).store(&mut motion.q[3], at);
            at += S::F64_LANES;
        }
    }
}
