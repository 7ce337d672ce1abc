//! The moments and forces on nodes besides those of segments, coupling and dead loads: of tissue, loads of single veins,
//! springs of supports, what turns with the sections, and wind.

use crate::leaf::{DiscreteLeaf, HalfTurn, State};
use crate::motion::explicit::layout::{AlignedArray, PackLayout, PackPosition, vector_at};
use crate::motion::explicit::packs::{NodeSpin, Pack};
use crate::motion::physics::{Physics, WindDrag};
use crate::rod::Wrench;
use glam::DVec3;

/// The air in a kick.
#[derive(Clone, Copy, Debug)]
pub struct KickAir {
    /// Mean velocity over the kick.
    pub velocity: DVec3,
    /// The velocities of nodes at the time of the positions are the last ones plus this times their
    /// last change.
    pub extrapolation: f64,
}

/// The moments and forces on the nodes besides those of segments, coupling and dead loads.
pub struct AppliedLoads {
    pub state: State,
    /// How sections at the tissue's strips are aligned at the start.
    alignments: Vec<bool>,
    /// Moments and forces, node by node.
    nodes: Vec<Wrench>,
    /// Moments and forces, laid out as positions.
    loads: [[AlignedArray; 3]; 2],
    nodes_in_wind: Option<NodesInWind>,
    /// Loads that turn with the sections, and moments along veins, node by node; empty without any.
    followers: Vec<FollowerOnNode>,
}

/// A load that turns with the section of a node, and the motion of the node before the last kick.
#[derive(Clone, Copy, Default)]
struct FollowerOnNode {
    load: Wrench,
    velocity: DVec3,
    spin: NodeSpin,
}

struct NodesInWind {
    wind: WindDrag,
    forces: Vec<DVec3>,
    /// Velocities before the last kick, and before the one before it.
    velocity: Vec<DVec3>,
    earlier_velocity: Vec<DVec3>,
}

impl AppliedLoads {
    /// The moments and forces on a leaf that moves from `start`; `None` if there are none.
    pub fn new(
        leaf: &DiscreteLeaf,
        physics: &Physics,
        start: &State,
        layout: PackLayout,
    ) -> Option<Self> {
        let wind = WindDrag::new(leaf, physics);
        let dead = leaf.loads.rod_load_factor != 0.0;
        let moved = leaf.leaf.scenario().support_motion.is_some();
        let none = !leaf.has_tissue() && !dead && !leaf.has_springs() && !moved;
        let follows = leaf.has_followers() || leaf.leaf.scenario().has_followers_in_time();
        if none && wind.is_none() && !follows {
            return None;
        }
        let array = || AlignedArray::zeros(layout.leaf_array_length());
        let vectors = || std::array::from_fn(|_| array());
        let state = leaf.stress_free_state();
        let at_rest = || vec![DVec3::ZERO; state.x.len()];
        Some(AppliedLoads {
            nodes: vec![Wrench::default(); state.x.len()],
            alignments: leaf.strip_alignments(start),
            loads: [vectors(), vectors()],
            nodes_in_wind: wind.map(|wind| NodesInWind {
                wind,
                forces: at_rest(),
                velocity: at_rest(),
                earlier_velocity: at_rest(),
            }),
            followers: vec![FollowerOnNode::default(); if follows { state.x.len() } else { 0 }],
            state,
        })
    }

    /// Moments and forces, laid out as positions.
    pub fn loads(&self) -> &[[AlignedArray; 3]; 2] {
        &self.loads
    }

    /// The sum of the forces on all tips.
    pub fn tip_force_sum(&self, layout: PackLayout) -> DVec3 {
        let tips = (0..layout.rods)
            .map(|j| vector_at(&self.loads[1], layout.node_index(j, layout.segments)));
        tips.sum()
    }

    /// Sets the moments and forces to those of the present positions and rotations.
    pub fn update(
        &mut self,
        leaf: &DiscreteLeaf,
        layout: PackLayout,
        positions: &[AlignedArray; 3],
        packs: &[Pack],
        air: KickAir,
    ) {
        for (j, i) in leaf.rod_index_pairs(0..=layout.segments) {
            let PackPosition { pack, entry } = layout.pack_position(j, i);
            let k = self.state.base(j) + i;
            self.state.x[k] = vector_at(positions, layout.node_index(j, i));
            self.state.q[k] = packs[pack].rotation(entry);
            if let Some(blown) = &mut self.nodes_in_wind {
                blown.earlier_velocity[k] = blown.velocity[k];
                blown.velocity[k] = packs[pack].momentum(entry).velocity;
            }
        }
        self.nodes.fill(Wrench::default());
        leaf.add_tissue_loads(&self.state, &mut self.nodes);
        leaf.add_own_forces(&mut self.nodes);
        leaf.add_lever_moments(&self.state, &mut self.nodes);
        leaf.add_spring_loads(&self.state, &mut self.nodes);
        if let Some(blown) = &mut self.nodes_in_wind {
            let (now, earlier) = (&blown.velocity, &blown.earlier_velocity);
            let velocity = |k: usize| now[k] + air.extrapolation * (now[k] - earlier[k]);
            (blown.wind).set_forces(&self.state, air.velocity, velocity, &mut blown.forces);
            for (node, force) in self.nodes.iter_mut().zip(&blown.forces) {
                node.force += *force;
            }
        }
        if !self.followers.is_empty() {
            for (j, i) in leaf.rod_index_pairs(0..=layout.segments) {
                let PackPosition { pack, entry } = layout.pack_position(j, i);
                let k = self.state.base(j) + i;
                let momentum = packs[pack].momentum(entry);
                let load = leaf.follower_wrench(&self.state, j, i);
                self.nodes[k].moment += load.moment;
                self.nodes[k].force += load.force;
                self.followers[k] = FollowerOnNode {
                    load,
                    velocity: momentum.velocity,
                    spin: NodeSpin {
                        rotation: packs[pack].rotation(entry),
                        angular_momentum: momentum.angular,
                    },
                };
            }
        }
        for (j, i) in leaf.rod_index_pairs(0..=layout.segments) {
            let (at, node) = (layout.node_index(j, i), self.nodes[self.state.base(j) + i]);
            for (arrays, load) in self.loads.iter_mut().zip([node.moment, node.force]) {
                for (c, array) in arrays.iter_mut().enumerate() {
                    array[at] = load[c];
                }
            }
        }
    }

    /// Where sections had passed half a turn against each other when loads were last set.
    pub fn half_turn(&self, leaf: &DiscreteLeaf) -> Option<HalfTurn> {
        leaf.half_turn_since(&self.alignments, &self.state)
    }

    /// Power of the wind, by the part of its force on a node that supports leave, at the mean of the velocities
    /// before the last kick and of these.
    pub fn power_of_wind(
        &self,
        velocity: impl Fn(usize, usize) -> DVec3,
        free_part: impl Fn(usize, DVec3) -> DVec3,
    ) -> f64 {
        let Some(blown) = &self.nodes_in_wind else {
            return 0.0;
        };
        let nodes = self.state.segments() + 1;
        let forces = blown.forces.iter().zip(&blown.velocity).enumerate();
        let power = forces.map(|(k, (force, before))| {
            free_part(k, *force).dot(0.5 * (*before + velocity(k / nodes, k % nodes)))
        });
        power.sum()
    }

    /// Power of the loads that turn with the sections at the mean of the motions before the last kick and of
    /// the present ones.
    pub fn power_of_followers(&self, layout: PackLayout, packs: &[Pack]) -> f64 {
        let nodes = self.state.segments() + 1;
        let power = self.followers.iter().enumerate().map(|(k, before)| {
            let PackPosition { pack, entry } = layout.pack_position(k / nodes, k % nodes);
            let (pack, now) = (&packs[pack], packs[pack].momentum(entry));
            let momentum = 0.5 * (before.spin.angular_momentum + now.angular);
            let spin = pack.angular_velocity(entry, before.spin.rotation, momentum);
            let velocity = 0.5 * (before.velocity + now.velocity);
            before.load.moment.dot(spin) + before.load.force.dot(velocity)
        });
        power.sum()
    }

    /// The velocities that further motion depends on.
    pub fn past_velocities(&self) -> Vec<DVec3> {
        (self.nodes_in_wind.as_ref()).map_or(Vec::new(), |blown| blown.velocity.clone())
    }

    /// Replaces the velocities that further motion depends on.
    pub fn set_past_velocities(&mut self, past: Vec<DVec3>) {
        if let Some(blown) = &mut self.nodes_in_wind {
            blown.velocity = past;
        }
    }
}
