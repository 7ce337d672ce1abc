//! Moments and forces on the nodes besides those of segments, coupling and dead loads: of the
//! tissue between neighbouring rods, of loads of single rods, and of wind.
//!
//! Drag depends on the velocities at the time of the positions. Known are those half a step before,
//! and half a step before the last step: it takes their linear extrapolation, so that the method
//! stays of second order.

use super::kernel::{Array, Layout};
use super::packs::{Pack, vector};
use crate::leaf::{DiscreteLeaf, HalfTurn, State};
use crate::motion::physics::Physics;
use crate::motion::wind::Wind;
use glam::DVec3;

/// The moments and forces at an instant.
pub struct Applied {
    state: State,
    /// Those of the tissue's strips at the start.
    alignments: Vec<bool>,
    nodes: Vec<[DVec3; 2]>,
    /// Moments and forces, laid out as positions.
    loads: [[Array; 3]; 2],
    blown: Option<Blown>,
}

/// Nodes in wind.
struct Blown {
    wind: Wind,
    forces: Vec<DVec3>,
    /// Velocities before the last kick, and before the one before it.
    velocity: Vec<DVec3>,
    earlier: Vec<DVec3>,
}

impl Applied {
    /// Of a leaf that moves from the state `start`; `None` if nothing acts on the nodes besides.
    pub fn new(
        leaf: &DiscreteLeaf,
        physics: &Physics,
        start: &State,
        layout: Layout,
    ) -> Option<Self> {
        let wind = Wind::new(leaf, physics);
        if !leaf.tied() && leaf.loads.own == 0.0 && wind.is_none() {
            return None;
        }
        let array = || Array::zeros(layout.lengths()[0]);
        let vectors = || std::array::from_fn(|_| array());
        let state = leaf.natural();
        let at_rest = || vec![DVec3::ZERO; state.x.len()];
        Some(Applied {
            nodes: vec![[DVec3::ZERO; 2]; state.x.len()],
            alignments: leaf.alignments(start),
            loads: [vectors(), vectors()],
            blown: wind.map(|wind| Blown {
                wind,
                forces: at_rest(),
                velocity: at_rest(),
                earlier: at_rest(),
            }),
            state,
        })
    }

    /// Moments and forces, laid out as positions.
    pub fn loads(&self) -> &[[Array; 3]; 2] {
        &self.loads
    }

    /// The sum of the forces on all tips.
    pub fn on_tips(&self, layout: Layout) -> DVec3 {
        let tips = (0..layout.rods).map(|j| vector(&self.loads[1], layout.at(j, layout.segments)));
        tips.sum()
    }

    /// Sets the moments and forces to those of the present positions and rotations, in air of a
    /// velocity; velocities are extrapolated by `ahead` times their last change.
    pub fn update(
        &mut self,
        leaf: &DiscreteLeaf,
        (layout, positions): (Layout, &[Array; 3]),
        packs: &[Pack],
        (air, ahead): (DVec3, f64),
    ) {
        for (j, i) in leaf.each(0..=layout.segments) {
            let ((p, at), k) = (layout.place(j, i), self.state.base(j) + i);
            self.state.x[k] = vector(positions, layout.at(j, i));
            self.state.q[k] = packs[p].rotation(at);
            if let Some(blown) = &mut self.blown {
                blown.earlier[k] = blown.velocity[k];
                blown.velocity[k] = packs[p].moving(at).0;
            }
        }
        self.nodes.fill([DVec3::ZERO; 2]);
        leaf.add_tissue_loads(&self.state, &mut self.nodes);
        leaf.add_own_forces(&mut self.nodes);
        if let Some(blown) = &mut self.blown {
            let (now, earlier) = (&blown.velocity, &blown.earlier);
            let velocity = |k: usize| now[k] + ahead * (now[k] - earlier[k]);
            (blown.wind).set_forces(&self.state, air, velocity, &mut blown.forces);
            for (node, force) in self.nodes.iter_mut().zip(&blown.forces) {
                node[1] += *force;
            }
        }
        for (j, i) in leaf.each(0..=layout.segments) {
            let (at, node) = (layout.at(j, i), self.nodes[self.state.base(j) + i]);
            for (arrays, load) in self.loads.iter_mut().zip(node) {
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

    /// Power of the wind at the mean of the velocities before the last kick and of these.
    pub fn power_of_wind(&self, velocity: impl Fn(usize, usize) -> DVec3) -> f64 {
        let Some(blown) = &self.blown else { return 0.0 };
        let nodes = self.state.segments() + 1;
        let forces = blown.forces.iter().zip(&blown.velocity).enumerate();
        let power = forces.map(|(k, (force, before))| {
            force.dot(0.5 * (*before + velocity(k / nodes, k % nodes)))
        });
        power.sum()
    }

    /// The velocities that further motion depends on.
    pub fn past(&self) -> Vec<DVec3> {
        (self.blown.as_ref()).map_or(Vec::new(), |blown| blown.velocity.clone())
    }

    /// Replaces these velocities.
    pub fn set_past(&mut self, past: Vec<DVec3>) {
        if let Some(blown) = &mut self.blown {
            blown.velocity = past;
        }
    }
}
