//! Nodes as rigid bodies with masses off their axes.
//!
//! With the spatial inertia J about the node, the mass m and the sum s of masses times their distances, an angular
//! acceleration b and an acceleration a of the node take
//!
//! J b + s x a = M,   m a + b x s = F.
//!
//! The bodies of a joint tip share a, and F is the sum of their forces. Of every body b = J^-1 (M - s x a), so that
//!
//! sum (m + S J^-1 S) a = sum (F + S J^-1 M)   with S a = s x a.

use crate::leaf::NodeFreedom;
use crate::motion::physics::Inertia;
use crate::rod::Wrench;
use crate::rotation::cross_matrix;
use glam::{DMat3, DQuat, DVec3};

/// A node with its masses, and what acts on it.
#[derive(Clone, Copy, Debug)]
pub struct NodeBody {
    pub inertia: Inertia,
    pub rotation: DQuat,
    pub free: NodeFreedom,
    /// Moment and force, or their impulses.
    pub load: Wrench,
}

impl NodeBody {
    fn inverse_tensor(&self) -> DMat3 {
        match self.free.rotation {
            true => self.inertia.tensor(self.rotation).inverse(),
            false => DMat3::ZERO,
        }
    }

    fn first_moment(&self) -> DVec3 {
        self.inertia.first_moment(self.rotation)
    }
}

/// The accelerations (angular, linear) of bodies at one place, those of all rods at a joint tip or a single one; or
/// the jumps of their velocities by impulses. Held components have none.
pub fn body_accelerations(bodies: &[NodeBody]) -> Vec<[DVec3; 2]> {
    let (mut mass, mut force, mut axes) = (DMat3::ZERO, DVec3::ZERO, DVec3::ONE);
    for body in bodies {
        let arm = cross_matrix(body.first_moment());
        let inverse = body.inverse_tensor();
        mass += DMat3::from_diagonal(DVec3::splat(body.inertia.mass)) + arm * inverse * arm;
        force += body.load.force + arm * (inverse * body.load.moment);
        axes = body.free.of_displacement(axes);
    }
    let free = DMat3::from_diagonal(axes);
    let held = DMat3::from_diagonal(DVec3::ONE - axes);
    let linear = (free * mass * free + held).inverse() * (axes * force);
    let acceleration = |body: &NodeBody| {
        let moment = body.load.moment - body.first_moment().cross(linear);
        [body.inverse_tensor() * moment, linear]
    };
    bodies.iter().map(acceleration).collect()
}
