//! Masses off the axes: where they are, the rotation and the displacement of a node accelerate together.
//!
//! With the spatial inertia J about the node, the mass m and the sum s of masses times their distances, an angular
//! acceleration b and an acceleration a of the node take
//!
//! J b + s x a = M,   m a + b x s = F.
//!
//! The bodies of a joint tip share a, and F is the sum of their forces. Of every body b = J^-1 (M - s x a), so that
//!
//! sum (m + S J^-1 S) a = sum (F + S J^-1 M)   with S a = s x a.

use crate::leaf::{Loads, NodalMoment, NodeFreedom};
use crate::motion::Exchange;
use crate::motion::moving_supports::MovingSupports;
use crate::motion::physics::{Inertia, LandingMass};
use crate::motion::semi_implicit::{NodeMotion, SemiImplicit};
use crate::rod::Wrench;
use crate::rotation::cross_matrix;
use glam::{DMat3, DQuat, DVec3};

/// A node with its masses, and what acts on it.
#[derive(Clone, Copy, Debug)]
struct NodeBody {
    inertia: Inertia,
    rotation: DQuat,
    free: NodeFreedom,
    /// Moment and force, or their impulses.
    load: Wrench,
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
fn body_accelerations(bodies: &[NodeBody]) -> Vec<[DVec3; 2]> {
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

impl SemiImplicit {
    /// Whether a node, or another one that shares its place at a joint tip, has masses off its axis.
    pub(super) fn is_off_axis_body(&self, k: usize) -> bool {
        let (n, mut rods) = (self.leaf.segments(), 0..self.leaf.rods());
        match self.leaf.tips_move_together() && k % (n + 1) == n {
            true => rods.any(|j| self.inertia[self.state.base(j) + n].is_off_axis()),
            false => self.inertia[k].is_off_axis(),
        }
    }

    /// The nodes that share the place of a node: all tips if they are one.
    fn nodes_at_place(&self, k: usize) -> Vec<usize> {
        let (n, rods) = (self.leaf.segments(), self.leaf.rods());
        match self.leaf.tips_move_together() && k % (n + 1) == n {
            true => (0..rods).map(|j| self.state.base(j) + n).collect(),
            false => vec![k],
        }
    }

    /// The nodes with equations that share a place, for every place with masses off the axis.
    fn off_axis_places(&self) -> Vec<Vec<usize>> {
        let mut places = Vec::new();
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let k = self.state.base(j) + i;
            if self.is_off_axis_body(k) {
                let place = self.nodes_at_place(k);
                if place[0] == k {
                    places.push(place);
                }
            }
        }
        places
    }

    /// The bodies at a place, under these loads.
    fn bodies(&self, place: &[usize], load: impl Fn(usize) -> Wrench) -> Vec<NodeBody> {
        let nodes = self.leaf.segments() + 1;
        let body = |&k: &usize| {
            let mut free = self.leaf.node_freedom(k / nodes, k % nodes);
            free.rotation &= !MovingSupports::holds_rotation(&self.supports, k);
            NodeBody {
                inertia: self.inertia[k],
                rotation: self.state.q[k],
                free,
                load: load(k),
            }
        };
        place.iter().map(body).collect()
    }

    /// Sets the accelerations of nodes with masses off their axes under the forces of the assembled system.
    pub(super) fn set_off_axis_accelerations(&mut self) {
        let (damping, nodes) = (self.physics.damping, self.leaf.segments() + 1);
        for place in self.off_axis_places() {
            let load = |k: usize| {
                let on_node = self.system.unbalanced_node_load(k / nodes, k % nodes);
                let (q, v) = (self.state.q[k], self.node_motions[k].v);
                let [angular, linear] = self.inertia[k].momentum(q, v);
                let centrifugal = self.inertia[k].centrifugal_wrench(q, v[0]);
                Wrench {
                    moment: on_node.moment - centrifugal.moment - damping * angular,
                    force: on_node.force - centrifugal.force - damping * linear,
                }
            };
            let accelerations = body_accelerations(&self.bodies(&place, load));
            for (k, w) in place.into_iter().zip(accelerations) {
                let v = self.node_motions[k].v;
                self.node_motions[k] = NodeMotion { v, a: w, w };
            }
        }
    }

    /// Adds the accelerations of nodes with masses off their axes under changes of the loads that all rods share, and
    /// of loads of single veins.
    pub(super) fn add_off_axis_accelerations(&mut self, loads: Loads) {
        let n = self.leaf.segments();
        let moments: Vec<NodalMoment> = self.leaf.dead_moments_under(loads).collect();
        for place in self.off_axis_places() {
            let load = |k: usize| {
                let (j, i) = (k / (n + 1), k % (n + 1));
                let weight = self.leaf.grid.node_weight(i) * self.leaf.leaf.length(j);
                let mut load = self.scheduled_change(j, i);
                load.force += weight * self.leaf.leaf.share(j) * loads.gravity;
                if i == n && k == place[0] {
                    load.force += loads.tip_force;
                }
                let here = moments.iter().filter(|it| (0, it.node) == (j, i));
                load.moment += here.map(|it| it.moment).sum::<DVec3>();
                load
            };
            let accelerations = body_accelerations(&self.bodies(&place, load));
            for (k, [angular, linear]) in place.into_iter().zip(accelerations) {
                self.node_motions[k].a[0] += angular;
                self.node_motions[k].a[1] += linear;
            }
        }
    }

    /// The present changes of the loads of single veins on a node.
    fn scheduled_change(&self, j: usize, i: usize) -> Wrench {
        let mut change = Wrench::default();
        let Some(scheduled) = &self.leaf.scheduled_loads else {
            return change;
        };
        let q = self.state.q[self.state.base(j) + i];
        for it in scheduled
            .forces
            .iter()
            .filter(|it| (it.rod, it.node) == (j, i))
        {
            change.force += self.factor_changes[it.factor] * it.force;
        }
        let levers = scheduled.levers.iter();
        for (factor, lever) in levers.filter(|(_, it)| (it.rod, it.node) == (j, i)) {
            change.moment += self.factor_changes[*factor] * lever.moment(q);
        }
        for (factor, it) in scheduled
            .moments
            .iter()
            .filter(|(_, it)| (0, it.node) == (j, i))
        {
            change.moment += self.factor_changes[*factor] * it.moment;
        }
        let followers = scheduled.followers.iter();
        for it in followers.filter(|it| (it.rod, it.node) == (j, i)) {
            let turned = (it.load * self.factor_changes[it.factor]).wrench(q);
            change.moment += turned.moment;
            change.force += turned.force;
        }
        change
    }

    /// Lets a mass land on node `own`, off its axis or beside a mass that is: the velocities of the place jump by its
    /// impulse. The inertia of the node includes the mass already.
    pub(super) fn land_off_axis(&mut self, own: usize, landing: &LandingMass) -> Exchange {
        let place = self.nodes_at_place(own);
        let arm = self.state.q[own] * landing.offset;
        let [spin, velocity] = self.node_motions[own].v;
        let apart = landing.velocity - velocity - spin.cross(arm);
        let impulse = landing.mass * apart;
        let own_load = Wrench {
            moment: arm.cross(impulse),
            force: impulse,
        };
        let load = |k: usize| match k == own {
            true => own_load,
            false => Wrench::default(),
        };
        let bodies = self.bodies(&place, load);
        let jumps = body_accelerations(&bodies);
        let mut exchange = Exchange {
            dissipated: 0.5 * landing.mass * apart.length_squared(),
            work: 0.5 * landing.mass * landing.velocity.length_squared(),
        };
        let mut holder = Wrench::default();
        for ((&k, body), jump) in place.iter().zip(&bodies).zip(&jumps) {
            let [angular, linear] = body.inertia.momentum(body.rotation, *jump);
            exchange.dissipated -=
                0.5 * (jump[0].dot(body.load.moment) + jump[1].dot(body.load.force));
            holder.force += linear - body.load.force;
            if !body.free.rotation {
                exchange.work += self.node_motions[k].v[0].dot(angular - body.load.moment);
            }
        }
        let free = bodies[0].free;
        exchange.work += velocity.dot(holder.force - free.of_displacement(holder.force));
        for (k, [angular, linear]) in place.into_iter().zip(jumps) {
            self.node_motions[k].v[0] += angular;
            self.node_motions[k].v[1] += linear;
        }
        exchange
    }
}
