//! Held tips: the effect of moving their holder, and the change of the force on it.

use crate::leaf::derivative::{Forces, LeafRate, Response, at_constant_force, change};
use crate::leaf::dimensionless::Leaf;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{State, add};
use crate::rod::Segment;
use crate::scenario::{Clamp, Scenario};
use glam::{DQuat, DVec3};

/// The rate of change of the holder's position and orientation, in the leaf's units.
pub(in crate::leaf::derivative) struct HeldRate {
    shift: DVec3,
    /// Rotations of the clamps, one per rod; empty for a pinned tip.
    turns: Vec<DVec3>,
}

impl HeldRate {
    /// `None` if the tips are free, or their holder does not move.
    pub fn new(leaf: &Leaf, terms: &[(f64, Scenario)]) -> Option<Self> {
        let held = leaf.held.as_ref()?;
        let of = |value: &dyn Fn(&Scenario) -> f64| change(terms, value);
        let axis =
            |axis: usize| of(&|s| s.held_tip.as_ref().map_or(0.0, |held| held.position[axis]));
        let shift = DVec3::from_array([0, 1, 2].map(axis)) / leaf.scale.length;
        let clamp = |s: &Scenario, j: usize| Some(s.held_tip.as_ref()?.clamps.as_ref()?[j]);
        // The angle about e3, then the twist about the resulting d1, as in the clamp's definition.
        let turn = |(j, own): (usize, &Clamp)| {
            let d1 = DQuat::from_rotation_z(own.angle) * DVec3::X;
            let angle = of(&|s| clamp(s, j).map_or(0.0, |clamp| clamp.angle));
            let twist = of(&|s| clamp(s, j).map_or(0.0, |clamp| clamp.twist));
            angle * DVec3::Z + twist * d1
        };
        let clamps = held.clamps.iter().flatten().enumerate();
        let turns: Vec<DVec3> = clamps.map(turn).collect();
        let moves = shift != DVec3::ZERO || turns.iter().any(|turn| *turn != DVec3::ZERO);
        moves.then_some(HeldRate { shift, turns })
    }
}

impl DiscreteLeaf {
    /// Adds the effect of holders that move and rotate.
    pub(in crate::leaf::derivative) fn add_tip_motion(
        &self,
        state: &State,
        segments: &[Segment],
        rate: &HeldRate,
        forces: &mut Forces,
    ) {
        let n = self.segments();
        let moved = rate.shift;
        for j in 0..self.rods() {
            let turned = rate.turns.get(j).copied().unwrap_or(DVec3::ZERO);
            let section = self.section(j, n - 1);
            let segment = &segments[j * n + n - 1];
            let k = at_constant_force(segment, section);
            let nodes = forces.on_nodes(j, n);
            if n > 1 {
                let moment = k.ab * turned + k.xa.transpose() * moved;
                add(&mut nodes[n - 2], -moment, k.xx * moved + k.xb * turned);
            }
            // A tip that is only pinned rotates freely.
            let moment = k.bb * turned + k.xb.transpose() * moved;
            add(&mut nodes[n - 1], -moment, DVec3::ZERO);
            forces.on_gaps(j, n)[n - 1] +=
                segment.gap_increment(section, moved, DVec3::ZERO, turned);
            let (g_x, _, g_b) = segment.gradient(section);
            let load = self.load(state, j, n);
            forces.energy += (g_x - load.force).dot(moved) + (g_b - load.moment).dot(turned);
            let [a, b] = [turned.to_array(), moved.to_array()];
            forces.tips.push([a[0], a[1], a[2], b[0], b[1], b[2]]);
        }
    }

    /// The change of the force on the holder of the tip, as in [`DiscreteLeaf::reaction`]: of
    /// the loads on the tip, and of the forces in the last segments.
    pub fn reaction_rate(&self, rate: &LeafRate, response: &Response) -> DVec3 {
        let n = self.segments();
        let weight = self.load_factor * self.grid.weight(n);
        let mut force = self.load_factor * rate.tip_force;
        for (j, rod) in rate.rods.iter().enumerate() {
            let gravity = self.loads.gravity * rod.length + rate.gravity * self.leaf.length(j);
            force += weight * gravity - response.carried[j * n + n - 1];
            force += self.load_factor * self.own_load_rate(rate, j, n);
        }
        force
    }
}
