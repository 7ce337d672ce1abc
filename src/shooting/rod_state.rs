//! One rod at one sigma, as the boundary-value problem has it: its state among the numbers of all rods, its
//! perturbation, and the derivatives of its slopes.

use crate::rod::Wrench;
pub use crate::rotation::cross_matrix;
use crate::rotation::{Pose, outer};
use glam::{DMat3, DQuat, DVec3};
use std::ops::AddAssign;

/// Numbers that describe one rod at one sigma: r, q (x, y, z, w), n, m.
pub const STATE_SIZE: usize = 13;

/// Numbers that describe the perturbation of one rod at one sigma: displacement, spatial rotation,
/// and the changes of n and m.
pub const PERTURBATION_SIZE: usize = 12;

/// One rod at one sigma.
#[derive(Clone, Copy, Debug)]
pub struct RodState {
    /// Position of the centerline.
    pub r: DVec3,
    /// Rotation of the directors.
    pub q: DQuat,
    /// Force along the lab axes.
    pub n: DVec3,
    /// Moment along the lab axes.
    pub m: DVec3,
}

impl RodState {
    /// The numbers of rod `j` in a flat state; q of any length but zero.
    #[inline]
    pub fn from_flat_state(y: &[f64], j: usize) -> Self {
        let y = &y[STATE_SIZE * j..STATE_SIZE * (j + 1)];
        RodState {
            r: DVec3::from_slice(y),
            q: DQuat::from_slice(&y[3..]).normalize(),
            n: DVec3::from_slice(&y[7..]),
            m: DVec3::from_slice(&y[10..]),
        }
    }

    /// Position and directors.
    #[inline]
    pub fn pose(&self) -> Pose {
        Pose {
            position: self.r,
            rotation: self.q,
        }
    }

    /// Writes the numbers of rod `j` into a flat state.
    #[inline]
    pub fn write_flat_state(&self, y: &mut [f64], j: usize) {
        let y = &mut y[STATE_SIZE * j..STATE_SIZE * (j + 1)];
        self.r.write_to_slice(y);
        self.q.write_to_slice(&mut y[3..]);
        self.n.write_to_slice(&mut y[7..]);
        self.m.write_to_slice(&mut y[10..]);
    }
}

/// Derivatives of one rod's slopes with respect to its own state, in blocks of three.
#[derive(Clone, Copy, Debug, Default)]
pub struct SlopeDerivatives {
    /// Derivative of r' with respect to the rotation.
    pub r_theta: DMat3,
    /// Derivative of r' with respect to n.
    pub r_n: DMat3,
    /// Derivative of the rotation rate with respect to the rotation.
    pub theta_theta: DMat3,
    /// Derivative of the rotation rate with respect to m.
    pub theta_m: DMat3,
    /// Derivative of n' with respect to r, by a foundation, along the lab axes.
    pub n_r: DVec3,
    /// Derivative of m' with respect to the rotation.
    pub m_theta: DMat3,
    /// Derivative of m' with respect to n.
    pub m_n: DMat3,
    /// Derivatives by loads without a potential, if there are such.
    pub by_loads: Option<LoadDerivatives>,
}

/// Derivatives of the jumps of n and m where a load on a point is passed, with respect to the rotation of its
/// section.
#[derive(Clone, Copy, Debug)]
pub struct JumpDerivatives {
    /// Derivative of n.
    pub n_theta: DMat3,
    /// Derivative of m.
    pub m_theta: DMat3,
}

impl JumpDerivatives {
    /// Of loads that do not depend on the rotation.
    pub const ZERO: JumpDerivatives = JumpDerivatives {
        n_theta: DMat3::ZERO,
        m_theta: DMat3::ZERO,
    };

    /// Of a load that turns with the section: the jumps are minus its force and its moment.
    pub fn of_follower(load: &Wrench) -> Self {
        JumpDerivatives {
            n_theta: cross_matrix(load.force),
            m_theta: cross_matrix(load.moment),
        }
    }

    /// Of a dead force on an arm that turns with the section: its moment is `arm` x `force`.
    pub fn of_lever(arm: DVec3, force: DVec3) -> Self {
        let along = DMat3::from_diagonal(DVec3::splat(arm.dot(force)));
        JumpDerivatives {
            n_theta: DMat3::ZERO,
            m_theta: along - outer(arm, force),
        }
    }
}

impl AddAssign for JumpDerivatives {
    fn add_assign(&mut self, other: JumpDerivatives) {
        self.n_theta += other.n_theta;
        self.m_theta += other.m_theta;
    }
}

/// The changes of rotation and moment at a base that turns with three numbers that are free there.
#[derive(Clone, Copy, Debug)]
pub struct FreeBaseChanges {
    pub rotation: DMat3,
    pub moment: DMat3,
}

/// Derivatives of n' and m' by loads without a potential.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadDerivatives {
    /// Derivative of n' with respect to the rotation.
    pub n_theta: DMat3,
    /// Derivative of n' with respect to n.
    pub n_n: DMat3,
    /// Derivative of m' with respect to the rotation.
    pub m_theta: DMat3,
}

/// The rotation vector from `b` to `a`, to first order.
pub fn rotation_difference(a: DQuat, b: DQuat) -> DVec3 {
    let turn = a * b.conjugate();
    let sign = if turn.w < 0.0 { -2.0 } else { 2.0 };
    sign * DVec3::new(turn.x, turn.y, turn.z)
}
