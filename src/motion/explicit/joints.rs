//! Bases on hinges that hold their spin, in explicit steps.
//!
//! With the unit vector a of the hinge (see [`HeldSpin`]), P = 1 - a a^T and the tensor of inertia J, the moment of the
//! hinge takes what is along a of every change of the angular momentum p, and the angular velocity is
//!
//! w = (P J P + a a^T)^-1 P p.
//!
//! Between kicks J w' + w x J w = lambda a. As w . a = 0 all the time, and a turns with w x a/2 but for what is along w x a,
//! w' is across a as well:
//!
//! w' = (P J P + a a^T)^-1 P (J w x w).
//!
//! Over a step this is integrated by the method of Runge and Kutta of fourth order, which adds to the error of kicks, of
//! second order, less than one that is told.

use crate::motion::physics::Inertia;
use crate::rotation::{HeldSpin, outer};
use glam::{DMat3, DQuat, DVec3};

/// A base on a hinge that holds its spin.
#[derive(Clone, Debug)]
pub struct JointedBase {
    /// Index in the arrays of its pack.
    pub entry: usize,
    pub joint: HeldSpin,
    pub inertia: Inertia,
    /// The angular momentum before the kick of a step.
    pub before: DVec3,
}

/// A frame and its angular velocity, or their rates.
#[derive(Clone, Copy)]
struct FrameMotion {
    rotation: DQuat,
    angular: DVec3,
}

impl FrameMotion {
    fn after(self, rate: FrameMotion, h: f64) -> Self {
        FrameMotion {
            rotation: self.rotation + rate.rotation * h,
            angular: self.angular + h * rate.angular,
        }
    }
}

impl JointedBase {
    /// The tensor of inertia, and the vector across a that the restricted one takes to `moment`.
    fn solve(&self, q: DQuat, moment: impl Fn(DMat3) -> DVec3) -> DVec3 {
        let (tensor, axis) = (self.inertia.tensor(q), self.joint.axis(q));
        let along = outer(axis, axis);
        let across = DMat3::IDENTITY - along;
        across * ((across * tensor * across + along).inverse() * (across * moment(tensor)))
    }

    /// The angular velocity with the angular momentum `p`.
    pub fn angular_velocity(&self, q: DQuat, p: DVec3) -> DVec3 {
        self.solve(q, |_| p)
    }

    fn rate(&self, now: FrameMotion) -> FrameMotion {
        let (q, w) = (now.rotation, now.angular);
        FrameMotion {
            rotation: DQuat::from_xyzw(w.x, w.y, w.z, 0.0) * q * 0.5,
            angular: self.solve(q.normalize(), |tensor| (tensor * w).cross(w)),
        }
    }

    /// The rotation and the angular momentum after a time in which the base turns freely.
    pub fn turned(&self, q: DQuat, p: DVec3, h: f64) -> (DQuat, DVec3) {
        let start = FrameMotion {
            rotation: q.normalize(),
            angular: self.angular_velocity(q.normalize(), p),
        };
        let first = self.rate(start);
        let second = self.rate(start.after(first, 0.5 * h));
        let third = self.rate(start.after(second, 0.5 * h));
        let fourth = self.rate(start.after(third, h));
        let end = start
            .after(first, h / 6.0)
            .after(second, h / 3.0)
            .after(third, h / 3.0)
            .after(fourth, h / 6.0);
        let q = self.joint.settled(end.rotation.normalize());
        let axis = self.joint.axis(q);
        let angular = end.angular - end.angular.dot(axis) * axis;
        (q, self.inertia.tensor(q) * angular)
    }
}
