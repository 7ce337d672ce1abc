//! Rotations as unit quaternions and rotation vectors: exponential, logarithm,
//! geodesic midpoint, and the derivatives that a rod element needs; one by one, or in lanes.
//!
//! Increments are spatial: a rotation q becomes exp(theta) q.

use crate::simd::{Lanes, Vectors};
use glam::{DMat3, DQuat, DVec3};
use pulp::{Scalar, Simd};

/// A point of a centerline, and the rotation of the directors there.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Position of the point.
    pub position: DVec3,
    /// Rotation of the directors: R e_i = d_i.
    pub rotation: DQuat,
}

/// A frame that a constant-velocity joint holds: where its first axis is turned from its natural direction n, the frame
/// has turned from the natural one by the shortest turn that does it.
///
/// With the unit quaternion r = (w, v) of the turn these turns are those with n . v = 0, a great sphere of the unit
/// quaternions, whose geodesics are its own: exp(delta) r stays on it for every increment delta across the unit vector
///
/// a = w n + v x n,
///
/// which lies half-way between n and where n has turned to. So an energy restricted to these turns has the first and
/// second derivatives, along increments across a, that it has without the joint: no curvature of the constraint is
/// added. The moment of the joint is along a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldSpin {
    /// The rotation of the natural frame.
    pub natural: DQuat,
}

impl HeldSpin {
    /// The vector part v and the scalar part w of the turn from the natural frame to `q`, and n.
    fn turn(self, q: DQuat) -> (DVec3, f64, DVec3) {
        let turn = q * self.natural.conjugate();
        (turn.xyz(), turn.w, self.natural * DVec3::X)
    }

    /// The unit vector a about which the joint does not let the frame `q` turn; its sign is that of the quaternion.
    pub fn axis(self, q: DQuat) -> DVec3 {
        let (v, w, n) = self.turn(q);
        (w * n + v.cross(n)).normalize()
    }

    /// The derivative of a by further rotations of the frame about fixed axes.
    pub fn axis_rate(self, q: DQuat) -> DMat3 {
        let (v, w, n) = self.turn(q);
        let [x, y, z] = DVec3::AXES.map(|delta| {
            let (dw, dv) = (-0.5 * v.dot(delta), 0.5 * (w * delta + delta.cross(v)));
            dw * n + dv.cross(n)
        });
        DMat3::from_cols(x, y, z)
    }

    /// The frame that the joint allows with the first axis of `q`. Unchanged where `q` is allowed but for rounding, and
    /// where its first axis is opposite to n: every turn by half a revolution leads there.
    pub fn settled(self, q: DQuat) -> DQuat {
        let (v, w, n) = self.turn(q);
        let along = v.dot(n);
        let twist = w.hypot(along);
        if along.abs() <= SPIN_ROUNDING || twist <= SPIN_ROUNDING {
            return q;
        }
        // The turn is the shortest one after a twist about n.
        let [x, y, z] = (n * along / twist).to_array();
        let twist = DQuat::from_xyzw(x, y, z, w / twist);
        let turn = q * self.natural.conjugate();
        (turn * twist.conjugate() * self.natural).normalize()
    }
}

/// The sine of half a spin that is rounding.
const SPIN_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The angle about a unit `axis` by which a vector turns until its part normal to the axis has the
/// direction of `to`, which is normal to it; zero if it has no such part.
pub fn angle_about(axis: DVec3, from: DVec3, to: DVec3) -> f64 {
    -from.dot(axis.cross(to)).atan2(from.dot(to))
}

/// The quaternion q or -q, which are the same rotation: the one nearer to `other`.
pub fn align_quaternion_sign(q: DQuat, other: DQuat) -> DQuat {
    if q.dot(other) < 0.0 { -q } else { q }
}

/// The rotation interpolated between nodes along a rod, of which these are the quaternions and the weights. Signs are
/// continuous from node to node: neighbours differ by less than half a turn, more distant nodes may not.
pub fn interpolated_rotation(terms: impl Iterator<Item = (DQuat, f64)>) -> DQuat {
    let mut before: Option<DQuat> = None;
    let mut sum = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    for (q, weight) in terms {
        let aligned = before.map_or(q, |before| align_quaternion_sign(q, before));
        before = Some(aligned);
        sum += aligned * weight;
    }
    sum.normalize()
}

/// Quaternions in lanes.
#[derive(Clone, Copy, Debug)]
pub struct Quaternions<S: Simd> {
    pub vector: Vectors<S>,
    pub scalar: Lanes<S>,
}

/// Taylor's series of cos and of sin y/y in y^2.
const COS: [f64; 9] = [
    1.0,
    -1.0 / 2.0,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

const SINC: [f64; 9] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 355_687_428_096_000.0,
];

/// Squared half angle up to which these series are accurate to rounding: a rotation by 1.09.
const SERIES_LIMIT: f64 = 0.3;

/// (sigma - 1)/delta as a polynomial in delta, sigma being y/sin y of a half angle
/// y, and delta = 2 (1 - cos y), the squared distance of two unit quaternions:
/// interpolated at Chebyshev's nodes on 0..2/3, largest error of sigma 1.7e-16.
pub const HALF_ANGLE_POLYNOMIAL: [f64; 11] = [
    0.16666666666666688,
    0.03333333333325741,
    0.007142857147397268,
    0.0015873014817296078,
    0.00036075161528440684,
    8.324142592010429e-05,
    1.9462028784123005e-05,
    4.469961631947446e-06,
    1.2554386436622931e-06,
    7.904972852467008e-08,
    1.5773720034975787e-07,
];

/// Largest delta for this polynomial: a rotation by 1.68, a little more than what counts as resolved.
const POLYNOMIAL_LIMIT: f64 = 2.0 / 3.0;

/// The unit quaternion of the rotation vector `theta` (angle times axis).
#[inline]
pub fn exp(theta: DVec3) -> DQuat {
    to_quaternion(exp_each(theta.into()))
}

/// Unit quaternions of several rotation vectors.
#[inline(always)]
pub fn exp_each<S: Simd>(theta: Vectors<S>) -> Quaternions<S> {
    let simd = theta.x.simd;
    let quarter = Lanes::splat(simd, 0.25);
    let squared = theta.dot(theta) * quarter;
    let (mut sinc, mut cos) = (squared.polynomial(&SINC), squared.polynomial(&COS));
    if squared.largest() > SERIES_LIMIT {
        let half = squared.sqrt();
        // Series where they are accurate: no quotient that tends to 0/0.
        let large = squared - Lanes::splat(simd, SERIES_LIMIT);
        sinc = (half.each(f64::sin) * half.recip()).select_where_positive(large, sinc);
        cos = half.each(f64::cos).select_where_positive(large, cos);
    }
    Quaternions {
        vector: theta.scale(sinc * Lanes::splat(simd, 0.5)),
        scalar: cos,
    }
}

/// Products a b of unit quaternions, renormalized to first order in the rounding error.
#[inline(always)]
pub fn multiply_each<S: Simd>(left: Quaternions<S>, right: Quaternions<S>) -> Quaternions<S> {
    let (a, aw) = (left.vector, left.scalar);
    let (b, bw) = (right.vector, right.scalar);
    let simd = aw.simd;
    let (v, w) = (a.mul_add(bw, b.scale(aw)) + a.cross(b), aw * bw - a.dot(b));
    let length = w.mul_add(w, v.dot(v));
    let (half, three_halves) = (Lanes::splat(simd, 0.5), Lanes::splat(simd, 1.5));
    let scale = length.neg_mul_add(half, three_halves);
    Quaternions {
        vector: v.scale(scale),
        scalar: w * scale,
    }
}

/// A quaternion as that of a single lane.
#[inline(always)]
pub fn from_quaternion(q: DQuat) -> Quaternions<Scalar> {
    Quaternions {
        vector: DVec3::new(q.x, q.y, q.z).into(),
        scalar: q.w.into(),
    }
}

/// The quaternion of a single lane.
#[inline(always)]
fn to_quaternion(q: Quaternions<Scalar>) -> DQuat {
    let v = DVec3::from(q.vector);
    DQuat::from_xyzw(v.x, v.y, v.z, q.scalar.into())
}

/// The rotation vector of the unit quaternion `q`, of length at most pi.
pub fn log(q: DQuat) -> DVec3 {
    let q = from_quaternion(if q.w < 0.0 { -q } else { q });
    let (w, cos) = (q.vector, q.scalar);
    let off = cos - Lanes::from(1.0);
    let [sigma, ..] = half_angle_series(off.mul_add(off, w.dot(w)));
    w.scale(sigma + sigma).into()
}

/// Squared rotation angle below which [`log_rate`] uses a series.
const SMALL_SQUARED_ANGLE: f64 = 1e-4;

/// The derivative of the rotation vector theta of a rotation, [`log`], by further rotations about fixed axes:
/// 1 - \[theta\]/2 + k \[theta\]^2 with k = (1 - theta/2 cot(theta/2))/theta^2. Its symmetric part is that
/// without \[theta\]/2, and theta is its eigenvector.
pub fn log_rate(theta: DVec3) -> DMat3 {
    let square = theta.length_squared();
    let k = match square < SMALL_SQUARED_ANGLE {
        true => 1.0 / 12.0 + square / 720.0,
        false => {
            let half = 0.5 * square.sqrt();
            (1.0 - half / half.tan()) / square
        }
    };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let [x, y, z] =
        axes.map(|axis| axis - 0.5 * theta.cross(axis) + k * theta.cross(theta.cross(axis)));
    DMat3::from_cols(x, y, z)
}

/// The matrix a b^T.
#[inline]
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The matrix \[a\] with \[a\] b = a x b.
pub fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z))
}

/// The directors of quaternions s of any length, `scale` being 2/|s|^2.
#[inline(always)]
pub fn directors<S: Simd>(quaternions: Quaternions<S>, scale: Lanes<S>) -> [Vectors<S>; 3] {
    let (s, sw) = (quaternions.vector, quaternions.scalar);
    let one = Lanes::splat(scale.simd, 1.0);
    let r = s.scale(scale);
    let (xy, xz, yz) = (s.x * r.y, s.x * r.z, s.y * r.z);
    let (not_x, not_z) = (s.x.neg_mul_add(r.x, one), s.z.neg_mul_add(r.z, one));
    [
        Vectors::new(
            s.y.neg_mul_add(r.y, not_z),
            sw.mul_add(r.z, xy),
            sw.neg_mul_add(r.y, xz),
        ),
        Vectors::new(
            sw.neg_mul_add(r.z, xy),
            s.x.neg_mul_add(r.x, not_z),
            sw.mul_add(r.x, yz),
        ),
        Vectors::new(
            sw.mul_add(r.y, xz),
            sw.neg_mul_add(r.x, yz),
            s.y.neg_mul_add(r.y, not_x),
        ),
    ]
}

/// sigma = y/sin y of half angles y up to a right one, b = (sigma - 1)/delta and
/// c = (b - 1/6)/delta from delta = 2 (1 - cos y).
#[inline(always)]
pub fn half_angle_series<S: Simd>(delta: Lanes<S>) -> [Lanes<S>; 3] {
    let simd = delta.simd;
    let (one, sixth) = (Lanes::splat(simd, 1.0), Lanes::splat(simd, 1.0 / 6.0));
    let [_, after @ ..] = HALF_ANGLE_POLYNOMIAL;
    let mut c = delta.polynomial(&after);
    if delta.largest() > POLYNOMIAL_LIMIT {
        let far = delta.each(|delta| {
            let (cos, sin) = (1.0 - 0.5 * delta, (delta - 0.25 * delta * delta).sqrt());
            ((sin.atan2(cos) / sin - 1.0) / delta - 1.0 / 6.0) / delta
        });
        c = far.select_where_positive(delta - Lanes::splat(simd, POLYNOMIAL_LIMIT), c);
    }
    let b = c.mul_add(delta, sixth);
    [b.mul_add(delta, one), b, c]
}

/// The rotation p = q0^* q1 between the two ends of a segment, as rotation vector psi, with
/// the coefficients of its first and second derivatives.
///
/// Let h = p^(1/2), and let the ends rotate by alpha and beta (seen from the midpoint frame q0
/// h), so that p becomes h exp(-alpha) exp(beta) h. With delta = beta - alpha, y the half
/// angle |psi|/2 and w = sin y psi/|psi|,
///
/// psi' = psi + S delta - S (alpha x beta)/2
///        + c1 w |delta|^2 + (c2 delta + c3 w (w . delta)) (w . delta)  + O(3),
///
/// where S = sigma 1 + k w w^T is symmetric (it is the derivative of the logarithm, taken
/// half-way). The midpoint frame itself rotates by
///
/// mu = eta + (delta x tau)/2
///      + ((delta . tau)(eta + (delta x tau)/2) - (eta . delta) tau)/4 + O(3)
///
/// with eta = (alpha + beta)/2 and tau = tan(|psi|/4) psi/|psi|. With b and c of
/// [`half_angle_series`] and g = 2/(1 + cos y) nothing is a quotient of small numbers:
///
/// k = -b g,  2 c1 = -(1/2 + b) g/2,  c2 = (sigma/2 - b) g/2,  c3 = -(b - 3 c) g^2/4.
#[derive(Clone, Copy, Debug)]
pub struct RelativeRotation<S: Simd> {
    /// Rotation vector; the same in the frames of both ends and of the middle.
    pub psi: Vectors<S>,
    /// tan(|psi|/4) along the axis.
    pub tau: Vectors<S>,
    /// sin(|psi|/2) along the axis.
    pub w: Vectors<S>,
    /// (psi/2)/sin(psi/2).
    pub sigma: Lanes<S>,
    /// The coefficient k of S.
    pub k: Lanes<S>,
    /// 2 c1, c2, c3.
    pub second_coefficients: [Lanes<S>; 3],
}

/// The relative rotation of two ends, with the directors of their geodesic midpoint.
pub struct MidpointRotation<S: Simd> {
    pub relative: RelativeRotation<S>,
    /// Directors of the midpoint.
    pub frame: [Vectors<S>; 3],
}

/// A symmetric matrix as a sum of a diagonal matrix, a multiple of the identity, and half of a dyad
/// v w^T + w v^T, w being that of a [`RelativeRotation`].
pub struct DerivativeMatrix<S: Simd> {
    pub diagonal: Vectors<S>,
    pub multiple: Lanes<S>,
    /// The vector v of the dyad.
    pub dyad: Vectors<S>,
}

impl<S: Simd> MidpointRotation<S> {
    /// The rotation between two rotations given as unit quaternions of any sign.
    #[inline(always)]
    pub fn between([left, right]: [Quaternions<S>; 2]) -> Self {
        let (a, aw) = (left.vector, left.scalar);
        let (b, bw) = (right.vector, right.scalar);
        let simd = aw.simd;
        let (one, half) = (Lanes::splat(simd, 1.0), Lanes::splat(simd, 0.5));
        let cos = aw.mul_add(bw, a.dot(b));
        let sign = one.select_where_positive(cos + Lanes::splat(simd, f64::MIN_POSITIVE), -one);
        let (b, bw) = (b.scale(sign), bw * sign);
        let (d, dw) = (b - a, bw - aw);
        let delta = dw.mul_add(dw, d.dot(d));
        let [sigma, series_b, series_c] = half_angle_series(delta);
        // 1/|s|^2 of the sum s of both.
        let inverse = (Lanes::splat(simd, 4.0) - delta).recip();
        let (twice, g) = (inverse + inverse, inverse * Lanes::splat(simd, 4.0));
        let w = a.neg_mul_add(bw, b.scale(aw)) - a.cross(b);
        let half_g = g * half;
        let three = Lanes::splat(simd, 3.0);
        let relative = RelativeRotation {
            psi: w.scale(sigma + sigma),
            tau: w.scale(twice),
            w,
            sigma,
            k: -(series_b * g),
            second_coefficients: [
                -((half + series_b) * half_g),
                sigma.mul_add(half, -series_b) * half_g,
                series_c.mul_add(three, -series_b) * half_g * half_g,
            ],
        };
        let sum = Quaternions {
            vector: a + b,
            scalar: aw + bw,
        };
        MidpointRotation {
            relative,
            frame: directors(sum, twice),
        }
    }
}

impl<S: Simd> RelativeRotation<S> {
    /// S a, S being the derivative of the rotation vector.
    #[inline(always)]
    pub fn apply_derivative(&self, a: Vectors<S>) -> Vectors<S> {
        self.w.mul_add(self.k * self.w.dot(a), a.scale(self.sigma))
    }

    /// S diag(a) S plus the second derivatives of m . psi' with respect to delta (without the
    /// bilinear part in alpha and beta), with the diagonal matrix sigma^2 diag(a).
    #[inline(always)]
    pub fn second_derivatives(&self, a: Vectors<S>, m: Vectors<S>) -> DerivativeMatrix<S> {
        let (w, k, [twice_c1, c2, c3]) = (self.w, self.k, self.second_coefficients);
        let half = Lanes::splat(k.simd, 0.5);
        let (aw, along) = (a * w, w.dot(m));
        let v = aw.scale(self.sigma * k);
        let v = w.mul_add((half * k * k).mul_add(w.dot(aw), c3 * along), v);
        let v = m.mul_add(c2, v);
        DerivativeMatrix {
            diagonal: a.scale(self.sigma * self.sigma),
            multiple: twice_c1 * along,
            dyad: v,
        }
    }
}

/// The geodesic midpoint of two rotations given as unit quaternions of any sign.
#[inline]
pub fn midpoint(q0: DQuat, q1: DQuat) -> DQuat {
    let q1 = if q0.dot(q1) < 0.0 { -q1 } else { q1 };
    (q0 + q1).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const AXIS: DVec3 = DVec3::new(0.48, -0.6, 0.64);

    /// Between six nodes that turn by 0.8 each, the last by more than half a turn against the first, whatever the signs of
    /// their quaternions.
    #[test]
    fn rotations_of_wound_nodes_are_interpolated() {
        let at = |sigma: f64| exp(0.8 * sigma * AXIS);
        let weight = |i: usize, sigma: f64| -> f64 {
            let others = (0..6).filter(|&j| j != i);
            others
                .map(|j| (sigma - j as f64) / (i as f64 - j as f64))
                .product()
        };
        for sigma in [0.3, 1.7, 2.5, 4.9] {
            let signed = |i: usize| {
                if i % 3 == 1 {
                    -at(i as f64)
                } else {
                    at(i as f64)
                }
            };
            let found = interpolated_rotation((0..6).map(|i| (signed(i), weight(i, sigma))));
            let off = log(found * at(sigma).conjugate()).length();
            assert!(off < 1e-3, "{sigma}: {off:e}");
        }
    }

    /// Of small angles and large ones, against differences.
    #[test]
    fn the_rate_of_a_rotation_vector() {
        for size in [1e-3, 0.5, 2.5] {
            let theta = size * DVec3::new(0.6, -0.48, 0.64);
            let rate = log_rate(theta);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let turned = |h: f64| log(exp(h * axis) * exp(theta));
                let slope = (turned(1e-5) - turned(-1e-5)) / 2e-5;
                assert!(slope.distance(rate * axis) < 1e-9, "{size} {axis}");
            }
        }
    }

    /// Increments across the axis of a joint lead along what it allows, however far; the frame there is the natural one
    /// after the shortest turn of its first axis, whose direction mirrors n in the axis.
    #[test]
    fn a_held_spin_is_that_of_the_shortest_turn() {
        let natural = exp(DVec3::new(0.3, -0.8, 0.5));
        let joint = HeldSpin { natural };
        let mut q = natural;
        for step in 0..40 {
            let axis = joint.axis(q);
            let k = step as f64;
            let by = DVec3::new(k.sin(), (1.7 * k).cos(), (0.3 * k).sin());
            q = (exp(0.5 * (by - by.dot(axis) * axis)) * q).normalize();
            let [n, d1] = [natural, q].map(|q| q * DVec3::X);
            let shortest = DQuat::from_rotation_arc(n, d1) * natural;
            assert!(shortest.angle_between(q) < 1e-7);
            assert!(joint.settled(q).angle_between(q) < 1e-7);
            let axis = joint.axis(q);
            assert!((2.0 * n.dot(axis) * axis - n).distance(d1) < 1e-14);
            // Spun frames come back.
            let spun = (q * DQuat::from_rotation_x(0.9)).normalize();
            assert!(joint.settled(spun).angle_between(q) < 1e-7);
            let rate = joint.axis_rate(q);
            for about in DVec3::AXES {
                let turned = |h: f64| joint.axis(exp(h * about) * q);
                let slope = (turned(1e-5) - turned(-1e-5)) / 2e-5;
                let across = |v: DVec3| v - v.dot(axis) * axis;
                assert!(across(slope).distance(across(rate * about)) < 1e-9);
                // Along what the joint allows the axis turns with half the rate.
                let allowed = across(about);
                let half = 0.5 * allowed.cross(axis);
                assert!(across(rate * allowed - half).length() < 1e-13);
            }
        }
    }

    #[test]
    fn log_undoes_exp_up_to_half_a_turn() {
        for angle in [
            0.0,
            1e-9,
            1e-3,
            0.019_999,
            0.020_001,
            0.19,
            0.21,
            1.0,
            1.09,
            1.1,
            1.68,
            1.69,
            3.0,
            PI - 1e-9,
        ] {
            let (theta, q) = (angle * AXIS, exp(angle * AXIS));
            assert!((q.length() - 1.0).abs() < 4e-16);
            assert!((q.w - (angle / 2.0).cos()).abs() < 4e-16);
            for q in [q, -q] {
                let off = (log(q) - theta).length();
                assert!(off < 4e-15 * (1.0 + angle), "at {angle}");
            }
        }
    }

    #[test]
    fn series_and_closed_form_meet() {
        let at = |delta: f64| half_angle_series(delta.into()).map(f64::from);
        let (near, far) = (at(POLYNOMIAL_LIMIT), at(POLYNOMIAL_LIMIT * (1.0 + 1e-15)));
        for (near, far) in near.into_iter().zip(far) {
            assert!((near - far).abs() < 3e-15, "{near} {far}");
        }
    }
}
