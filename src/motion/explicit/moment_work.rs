//! The work of moments on nodes in a step: of dead ones on a single rod, and of forces off the axes that vary in
//! time.

use crate::leaf::{Lever, NodalMoment};
use crate::motion::explicit::layout::{PackLayout, PackPosition};
use crate::motion::explicit::packs::{NodeSpin, Pack};
use glam::DVec3;

/// The moments of forces off the axes in a step, of what exceeds those at time 0.
#[derive(Default)]
pub struct LeverWork {
    moments: Vec<LeverMoment>,
}

/// A moment on a node, and the motion of the node before the step.
struct LeverMoment {
    place: PackPosition,
    moment: DVec3,
    before: NodeSpin,
}

impl LeverWork {
    /// Takes over the levers of a step that begins.
    pub fn begin_step(
        &mut self,
        levers: impl Iterator<Item = Lever>,
        layout: PackLayout,
        packs: &[Pack],
    ) {
        self.moments.clear();
        self.moments.extend(levers.map(|lever| {
            let place = layout.pack_position(lever.rod, lever.node);
            let pack = &packs[place.pack];
            let before = NodeSpin {
                rotation: pack.rotation(place.entry),
                angular_momentum: pack.momentum(place.entry).angular,
            };
            LeverMoment {
                place,
                moment: lever.moment(before.rotation),
                before,
            }
        }));
    }

    /// Power of the moments at the mean of the angular momenta before the step and of the present ones.
    pub fn power(&self, packs: &[Pack]) -> f64 {
        let power = self.moments.iter().map(|it| {
            let (pack, entry) = (&packs[it.place.pack], it.place.entry);
            let momentum = 0.5 * (it.before.angular_momentum + pack.momentum(entry).angular);
            let spin = pack.angular_velocity(entry, it.before.rotation, momentum);
            it.moment.dot(spin)
        });
        power.sum()
    }
}

/// The dead moments on a single rod in a step.
#[derive(Default)]
pub struct StepDeadMoments {
    pub nodal_moments: Vec<NodalMoment>,
    /// Motions of these nodes before the step.
    spins_before: Vec<NodeSpin>,
}

impl StepDeadMoments {
    /// Takes over the moments of a step that begins.
    pub fn begin_step(
        &mut self,
        moments: impl Iterator<Item = NodalMoment>,
        layout: PackLayout,
        packs: &[Pack],
    ) {
        self.nodal_moments.clear();
        self.nodal_moments.extend(moments);
        let spins = self.nodal_moments.iter().map(|it| {
            let PackPosition { pack, entry } = layout.pack_position(0, it.node);
            NodeSpin {
                rotation: packs[pack].rotation(entry),
                angular_momentum: packs[pack].momentum(entry).angular,
            }
        });
        self.spins_before.clear();
        self.spins_before.extend(spins);
    }

    /// Power of the moments at the mean of the angular momenta before the step and of the present ones.
    pub fn power(&self, layout: PackLayout, packs: &[Pack]) -> f64 {
        let nodes = self.nodal_moments.iter().zip(&self.spins_before);
        let power = nodes.map(|(NodalMoment { node, moment }, before)| {
            let PackPosition { pack, entry } = layout.pack_position(0, *node);
            let pack = &packs[pack];
            let momentum = 0.5 * (before.angular_momentum + pack.momentum(entry).angular);
            moment.dot(pack.angular_velocity(entry, before.rotation, momentum))
        });
        power.sum()
    }
}
