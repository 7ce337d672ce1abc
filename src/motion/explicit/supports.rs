//! Supports that move, in explicit steps: their nodes are put where they are at the end of each step, and the work of the
//! holders is that of the forces at each time over the halves of the steps before and after it. Nodes that slide move with
//! the others of their kind, along axes in which they are free.

use crate::leaf::{DiscreteLeaf, State};
use crate::motion::NodeMotionComponents;
use crate::motion::explicit::Explicit;
use crate::motion::explicit::kernel::WatchedNode;
use crate::motion::explicit::layout::PackPosition;
use crate::motion::moving_supports::MovingNode;
use crate::rod::Wrench;
use glam::DVec3;

/// The moment and the force on a node whose support moves, besides those of its segments. Moments that turn with the
/// section are left out where the support holds the rotation: the work of such loads is taken with the angular momentum
/// of their node, which is zero there, so that both sides leave it out.
fn support_load(leaf: &DiscreteLeaf, state: &State, it: &MovingNode) -> Wrench {
    let load = leaf.load(state, it.rod, it.node);
    let follower = leaf.follower_wrench(state, it.rod, it.node);
    let moment = match (it.holds_rotation, it.node) {
        (true, _) => load.moment,
        (false, 0) => -leaf.spring_load(state, it.rod, 0).moment,
        (false, _) => DVec3::ZERO,
    };
    Wrench {
        moment,
        force: load.force + follower.force,
    }
}

impl Explicit {
    /// Watches the nodes whose supports move, and sets their velocities at the start.
    pub(super) fn start_supports(&mut self) {
        let Some(supports) = &mut self.supports else {
            return;
        };
        for it in &mut supports.nodes {
            let PackPosition { pack, entry } = self.layout.pack_position(it.rod, it.node);
            it.watched = self.packs[pack].watched.len();
            self.packs[pack].watched.push(WatchedNode {
                entry,
                force: [0.0; 3],
                moment: [0.0; 3],
            });
        }
        supports.move_to(0.0, &mut self.leaf);
        let inertia = |it: &MovingNode| self.physics.inertia(&self.leaf, it.rod, it.node);
        supports.kinetic_energy = supports.kinetic_energy(inertia);
    }

    /// Sets the loads of the leaf on supports that move to those at the present positions, besides those of segments.
    pub(super) fn set_support_loads(&mut self) {
        let (Some(supports), Some(applied)) = (&mut self.supports, &self.applied) else {
            return;
        };
        for it in &mut supports.nodes {
            it.load = support_load(&self.leaf, &applied.state, it);
            it.spring_force = it.force_of_springs(&self.leaf, applied.state.x[it.index]);
        }
    }

    /// Moves supports on by the time `drift`, and returns the work that they did: half of it in the step before,
    /// half in this one.
    pub(super) fn drive_supports(&mut self, drift: f64) -> f64 {
        let Some(supports) = &mut self.supports else {
            return 0.0;
        };
        supports.move_to(self.last_step_time + drift, &mut self.leaf);
        let mut work = 0.0;
        for it in &mut supports.nodes {
            let PackPosition { pack, entry } = self.layout.pack_position(it.rod, it.node);
            let pack = &mut self.packs[pack];
            let own = pack.watched[it.watched];
            let step = it.step();
            let last = match self.past.velocity_lag() > 0.0 {
                true => it.last_step,
                false => NodeMotionComponents::default(),
            };
            let force = it.force_on_support(it.load.force + DVec3::from(own.force));
            let mut moment = it.load.moment;
            if it.holds_rotation {
                moment += DVec3::from(own.moment);
            }
            work -= 0.5 * force.dot(last.displacement + step.displacement);
            work -= 0.5 * moment.dot(last.rotation + step.rotation);
            let at = self.layout.node_index(it.rod, it.node);
            it.step_velocity = it.mean_step_velocity(drift);
            for c in (0..3).filter(|_| !it.slides()) {
                self.positions[c][at] = it.now.position[c];
                pack.motion.v[c][entry] = it.step_velocity[c];
            }
            if it.holds_rotation {
                let before = pack.quaternion(entry);
                let q = it.now.rotation;
                let aligned = if before.dot(q) < 0.0 { -q } else { q };
                for (array, value) in pack.motion.q.iter_mut().zip(aligned.to_array()) {
                    array[entry] = value;
                }
            }
        }
        if drift > 0.0 {
            supports.accept();
        }
        work
    }
}
