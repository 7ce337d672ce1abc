//! Rotations as unit quaternions and rotation vectors: exponential, logarithm,
//! geodesic midpoint, and the derivatives that a rod element needs.
//!
//! Increments are spatial: a rotation q becomes exp(theta) q.

use glam::{DMat3, DQuat, DVec3};

/// Below this half angle, series replace quotients that tend to 0/0. At 0.1
/// both branches are good to 1e-10 in the second derivatives, where they are
/// least accurate, and to rounding in everything else.
const SMALL_HALF_ANGLE: f64 = 0.1;

/// The unit quaternion of the rotation vector `theta` (angle times axis).
#[inline]
pub fn exp(theta: DVec3) -> DQuat {
    let half_squared = 0.25 * theta.length_squared();
    let (sinc, cos) = if half_squared < 1e-4 {
        (
            1.0 - half_squared / 6.0 * (1.0 - half_squared / 20.0 * (1.0 - half_squared / 42.0)),
            1.0 - half_squared / 2.0
                * (1.0
                    - half_squared / 12.0
                        * (1.0 - half_squared / 30.0 * (1.0 - half_squared / 56.0))),
        )
    } else {
        let half = half_squared.sqrt();
        (half.sin() / half, half.cos())
    };
    let v = 0.5 * sinc * theta;
    DQuat::from_xyzw(v.x, v.y, v.z, cos)
}

/// The rotation vector of the unit quaternion `q`, of length at most pi.
pub fn log(q: DQuat) -> DVec3 {
    Relative::of(q).psi
}

/// The matrix \[a\] with \[a\] b = a x b.
#[inline]
pub fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(0.0, a.z, -a.y),
        DVec3::new(-a.z, 0.0, a.x),
        DVec3::new(a.y, -a.x, 0.0),
    )
}

/// The matrix a b^T.
#[inline]
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The rotation p = q0^* q1 between the two ends of a segment, as rotation
/// vector psi, with what its first and second derivatives are made of.
///
/// Let h = p^(1/2), and let the ends turn by alpha and beta (seen from the
/// midpoint frame q0 h), so that p becomes h exp(-alpha) exp(beta) h. With
/// delta = beta - alpha and y = psi/2,
///
/// psi' = psi + S delta - S (alpha x beta)/2
///        + c1 y |delta|^2 + (c2 delta + c3 y (y . delta)) (y . delta)  + O(3),
///
/// where S = s 1 + sigma y y^T is symmetric (it is the derivative of the
/// logarithm, taken half-way). The midpoint frame itself turns by
///
/// mu = eta + (delta x tau)/2
///      + ((delta . tau)(eta + (delta x tau)/2) - (eta . delta) tau)/4 + O(3)
///
/// with eta = (alpha + beta)/2 and tau = tan(|psi|/4) psi/|psi|.
#[derive(Clone, Copy, Debug)]
pub struct Relative {
    /// Rotation vector; the same in the frames of both ends and of the middle.
    pub psi: DVec3,
    /// tan(|psi|/4) along the axis.
    pub tau: DVec3,
    /// s = y / sin y.
    pub s: f64,
    /// sigma = (1 - s) / y^2.
    pub sigma: f64,
    half_squared: f64,
    cos: f64,
}

impl Relative {
    /// From the relative rotation `p`, a unit quaternion; its sign does not matter.
    #[inline]
    pub fn of(p: DQuat) -> Self {
        let sign = if p.w < 0.0 { -1.0 } else { 1.0 };
        let cos = sign * p.w;
        let v = sign * DVec3::new(p.x, p.y, p.z);
        let sin_squared = v.length_squared();
        let s = half_over_sin(sin_squared, cos);
        let half_squared = s * s * sin_squared;
        let sigma = if half_squared < SMALL_HALF_ANGLE * SMALL_HALF_ANGLE {
            let y = half_squared;
            -1.0 / 6.0 - y * (7.0 / 360.0 + y * (31.0 / 15120.0 + y * (127.0 / 604_800.0)))
        } else {
            (1.0 - s) / half_squared
        };
        Relative {
            psi: 2.0 * s * v,
            tau: v / (1.0 + cos),
            s,
            sigma,
            half_squared,
            cos,
        }
    }

    /// S a.
    #[inline]
    pub fn derivative(&self, a: DVec3) -> DVec3 {
        let y = 0.5 * self.psi;
        self.s * a + (self.sigma * y.dot(a)) * y
    }

    /// S diag(a) S.
    #[inline]
    pub fn congruence(&self, a: DVec3) -> DMat3 {
        let y = 0.5 * self.psi;
        let ay = a * y;
        let b = self.s * self.sigma * ay + (0.5 * self.sigma * self.sigma * y.dot(ay)) * y;
        let half = outer(b, y);
        DMat3::from_diagonal(self.s * self.s * a) + half + half.transpose()
    }

    /// The Hessian with respect to delta of m . psi' (without the bilinear
    /// part in alpha and beta).
    #[inline]
    pub fn hessian(&self, m: DVec3) -> DMat3 {
        let (s, cos, y2) = (self.s, self.cos, self.half_squared);
        let (c1, c2, c3) = if y2 < SMALL_HALF_ANGLE * SMALL_HALF_ANGLE {
            (
                0.25 * s * (-2.0 / 3.0 + y2 * (1.0 / 45.0 - y2 * (13.0 / 3780.0 + y2 / 5400.0))),
                0.5 * s * (1.0 / 3.0 + y2 * (1.0 / 45.0 + y2 * (2.0 / 945.0 + y2 / 4725.0))),
                -0.25 * s * (1.0 / 15.0 + y2 * (1.0 / 1260.0 + y2 / 4200.0)),
            )
        } else {
            let c1 = s * (cos - s) / (4.0 * y2);
            let c2 = s * (1.0 - s * cos) / (2.0 * y2);
            (c1, c2, -(c1 + c2) / y2)
        };
        let y = 0.5 * self.psi;
        let my = m.dot(y);
        let half = outer(c2 * m + (c3 * my) * y, y);
        DMat3::from_diagonal(DVec3::splat(2.0 * c1 * my)) + half + half.transpose()
    }
}

/// y / sin y of a half angle y up to a right one, from sin^2 y and cos y.
#[inline]
pub fn half_over_sin(sin_squared: f64, cos: f64) -> f64 {
    // asin(z)/z by its series where that is exact and cheap.
    if sin_squared < 0.01 {
        let z = sin_squared;
        1.0 + z
            * (1.0 / 6.0
                + z * (3.0 / 40.0
                    + z * (15.0 / 336.0
                        + z * (105.0 / 3456.0
                            + z * (945.0 / 42240.0
                                + z * (10395.0 / 599_040.0 + z * (135_135.0 / 9_676_800.0)))))))
    } else {
        let sin = sin_squared.sqrt();
        sin.atan2(cos) / sin
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
        let m = DVec3::new(0.3, -1.2, 0.7);
        let at = |half: f64| Relative::of(exp(2.0 * half * AXIS));
        let (a, b) = (at(SMALL_HALF_ANGLE - 1e-12), at(SMALL_HALF_ANGLE + 1e-12));
        assert!((a.sigma - b.sigma).abs() < 1e-12);
        assert!((a.hessian(m) - b.hessian(m)).abs_diff_eq(DMat3::ZERO, 1e-10));
    }
}
