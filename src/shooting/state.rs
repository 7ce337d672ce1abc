//! The numbers that describe a leaf at one sigma.

use glam::{DMat3, DQuat, DVec3};

/// Numbers that describe one rod at one sigma: r, q (x, y, z, w), n, m.
pub const STATE: usize = 13;

/// Numbers that describe its perturbation: displacement, spatial rotation,
/// and the changes of n and m.
pub const TANGENT: usize = 12;

/// One rod at one sigma.
#[derive(Clone, Copy, Debug)]
pub struct RodState {
    /// Centerline.
    pub r: DVec3,
    /// Directors.
    pub q: DQuat,
    /// Force along the lab axes.
    pub n: DVec3,
    /// Moment along the lab axes.
    pub m: DVec3,
}

impl RodState {
    /// The numbers of rod `j` in a flat state; q of any length but zero.
    #[inline]
    pub fn read(y: &[f64], j: usize) -> Self {
        let y = &y[STATE * j..STATE * (j + 1)];
        RodState {
            r: DVec3::from_slice(y),
            q: DQuat::from_slice(&y[3..]).normalize(),
            n: DVec3::from_slice(&y[7..]),
            m: DVec3::from_slice(&y[10..]),
        }
    }

    #[inline]
    pub fn write(&self, y: &mut [f64], j: usize) {
        let y = &mut y[STATE * j..STATE * (j + 1)];
        self.r.write_to_slice(y);
        self.q.write_to_slice(&mut y[3..]);
        self.n.write_to_slice(&mut y[7..]);
        self.m.write_to_slice(&mut y[10..]);
    }
}

/// Derivatives of one rod's slopes with respect to its own state, in blocks of three.
#[derive(Clone, Copy, Debug, Default)]
pub struct Derivatives {
    /// Of r' with respect to the rotation.
    pub r_theta: DMat3,
    /// Of r' with respect to n.
    pub r_n: DMat3,
    /// Of the rotation rate with respect to the rotation.
    pub theta_theta: DMat3,
    /// Of the rotation rate with respect to m.
    pub theta_m: DMat3,
    /// Of m' with respect to the rotation.
    pub m_theta: DMat3,
    /// Of m' with respect to n.
    pub m_n: DMat3,
}
