//! Nodes that are held: bases, tips by their holder, and others by grips along their veins.

use super::dimensionless::Gripped;
use super::discrete::DiscreteLeaf;
use super::state::State;
use crate::scenario::{Grip, Hold};
use glam::DVec3;
use std::ops::Range;

impl DiscreteLeaf {
    /// The nodes that grips hold, where they are in the `natural` leaf and moved by their
    /// displacements.
    pub(super) fn gripped(&self, natural: &State) -> Vec<Gripped> {
        let length = self.leaf.scale.length;
        let each = self.leaf.scenario().grips.iter().enumerate();
        let nodes = each.flat_map(|(number, grip)| {
            let Grip { vein, at, .. } = *grip;
            let [from, to] = at.map(|sigma| self.grid.nearest(sigma));
            let moved = DVec3::from_array(grip.displacement) / length;
            (from..=to).map(move |node| {
                let k = natural.base(vein) + node;
                Gripped {
                    grip: number,
                    rod: vein,
                    node,
                    position: natural.x[k] + moved,
                    rotation: (grip.held == Hold::Clamped).then_some(natural.q[k]),
                }
            })
        });
        nodes.collect()
    }

    /// Whether grips hold nodes.
    pub fn has_grips(&self) -> bool {
        !self.grips.is_empty()
    }

    /// The nodes of rod `j` that grips hold.
    pub fn grips_of(&self, j: usize) -> impl Iterator<Item = &Gripped> {
        self.grips.iter().filter(move |held| held.rod == j)
    }

    /// The nodes of rod `j` with equations that hinges or grips hold, and the components that are.
    pub(super) fn held_inside(&self, j: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
        let hinge = (0..1)
            .filter(|_| self.leaf.hinged())
            .map(|base| (base, 3..6));
        let grips = self.grips_of(j).map(|held| {
            let first = if held.rotation.is_some() { 0 } else { 3 };
            (held.node, first..6)
        });
        hinge.chain(grips)
    }

    /// Whether node `i` of rod `j` is held at its base or by a grip: its rotation, and its position.
    pub(super) fn is_gripped(&self, j: usize, i: usize) -> [bool; 2] {
        if i == 0 {
            return [!self.leaf.hinged(), true];
        }
        let here = |it: &&Gripped| (it.rod, it.node) == (j, i);
        match self.grips.iter().find(here) {
            Some(held) => [held.rotation.is_some(), true],
            None => [false; 2],
        }
    }

    /// Whether node `i` of rod `j` may rotate, and be displaced.
    pub fn moves(&self, j: usize, i: usize) -> [bool; 2] {
        match &self.leaf.held {
            Some(held) if i == self.segments() => [held.clamps.is_none(), false],
            _ if i > 0 && self.grips.is_empty() => [true; 2],
            _ => self.is_gripped(j, i).map(|held| !held),
        }
    }

    /// Puts tips and nodes where they are held.
    pub fn hold(&self, state: &mut State) {
        self.leaf.hold_tips(state);
        for held in &self.grips {
            let k = state.base(held.rod) + held.node;
            state.x[k] = held.position;
            if let Some(rotation) = held.rotation {
                state.q[k] = rotation;
            }
        }
    }

    /// Force on every grip, and the moment about its middle if it is clamped.
    pub fn grip_reactions(&self, state: &State) -> Vec<[DVec3; 2]> {
        let grips = &self.leaf.scenario().grips;
        let middle = |number: usize| {
            let held = self.grips.iter().filter(|it| it.grip == number);
            let (sum, count) = held.fold((DVec3::ZERO, 0.0), |(sum, count), it| {
                (sum + it.position, count + 1.0)
            });
            sum / count
        };
        let middles: Vec<DVec3> = (0..grips.len()).map(middle).collect();
        let mut reactions = vec![[DVec3::ZERO; 2]; grips.len()];
        for held in &self.grips {
            let [moment, force] = self.unbalanced(state, held.rod, held.node);
            let [force_on, moment_on] = &mut reactions[held.grip];
            *force_on += force;
            if held.rotation.is_some() {
                *moment_on += moment + (held.position - middles[held.grip]).cross(force);
            }
        }
        reactions
    }

    /// The forces on all holders: on that of held tips, if they are, and on every grip.
    pub fn forces_on_holders(&self, state: &State) -> Vec<DVec3> {
        let tips = self.leaf.held.as_ref().map(|_| self.reaction(state).0);
        let grips = match self.has_grips() {
            true => self.grip_reactions(state),
            false => Vec::new(),
        };
        let grips = grips.into_iter().map(|[force, _]| force);
        tips.into_iter().chain(grips).collect()
    }

    /// Moment and force on a node by its segments, loads and neighbours.
    pub(super) fn unbalanced(&self, state: &State, j: usize, i: usize) -> [DVec3; 2] {
        let n = self.segments();
        let gradient = |i: usize| {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            segment.gradient(self.section(j, i))
        };
        let load = self.load(state, j, i);
        let (mut moment, mut force) = (load.moment + self.moment_on(i), load.force);
        if i > 0 {
            let (g_x, _, g_b) = gradient(i - 1);
            (moment, force) = (moment - g_b, force - g_x);
        }
        if i < n {
            let (g_x, g_a, _) = gradient(i);
            (moment, force) = (moment - g_a, force + g_x);
        }
        [moment, force]
    }
}
