//! Loads that veins have of their own, besides those that all share: their weights, loads along
//! them, and loads on points. They are dead.

use super::dimensionless::Leaf;
use super::discrete::DiscreteLeaf;
use super::state::State;
use super::system::System;
use glam::DVec3;

/// Fractions of the length closer to each other than this are those of one node.
pub(super) const SAME_NODE: f64 = 1e-11;

impl Leaf {
    /// Own load on rod `j` at `sigma`, per unit of sigma, without those on points.
    pub fn own_load(&self, j: usize, sigma: f64) -> DVec3 {
        let s = self.scenario();
        let weight = DVec3::from_array(s.weight(j).at(sigma)) - DVec3::from_array(s.gravity);
        let along = s.distributed.as_ref().map_or(DVec3::ZERO, |loads| {
            DVec3::from_array(loads[j].each_ref().map(|load| load.at(sigma)))
        });
        (weight + along) * (self.share(j) * s.rods[j].length / self.scale.force())
    }

    /// Rod, sigma and force of every load on a point.
    pub fn point_loads(&self) -> impl Iterator<Item = (usize, f64, DVec3)> {
        let (s, unit) = (self.scenario(), self.scale.force());
        let points = s.points.iter();
        points.map(move |it| (it.vein, it.at, DVec3::from_array(s.force_on(it)) / unit))
    }
}

impl DiscreteLeaf {
    /// The veins' own loads on all nodes, rod after rod; empty if there are none.
    pub(super) fn own_loads_of(&self, leaf: &Leaf) -> Vec<DVec3> {
        if leaf.loads.own == 0.0 {
            return Vec::new();
        }
        let (n, sigma) = (self.segments(), self.grid.sigma());
        let node = |(j, i)| self.grid.weight(i) * leaf.own_load(j, sigma[i]);
        let mut loads: Vec<DVec3> = self.each(0..n + 1).map(node).collect();
        for (j, at, force) in leaf.point_loads() {
            loads[j * (n + 1) + self.grid.nearest(at)] += force;
        }
        loads
    }

    /// Part of the veins' own loads that acts.
    pub(super) fn own_part(&self) -> f64 {
        self.load_factor * self.loads.own
    }

    /// Own load on node `i` of rod `j`.
    pub fn own_load(&self, j: usize, i: usize) -> DVec3 {
        let load = self.own_loads.get(j * (self.segments() + 1) + i);
        load.map_or(DVec3::ZERO, |load| self.own_part() * *load)
    }

    /// The forces on points of rod `j` at `sigma`, by which its force jumps there.
    pub fn force_on_points(&self, j: usize, sigma: f64) -> DVec3 {
        if self.leaf.scenario().points.is_empty() {
            return DVec3::ZERO;
        }
        let points = self.leaf.point_loads();
        let here = points.filter(|(rod, at, _)| *rod == j && (at - sigma).abs() < SAME_NODE);
        self.own_part() * here.map(|(_, _, force)| force).sum::<DVec3>()
    }

    /// Adds dead forces on all nodes to the veins' own loads.
    pub fn load_nodes(&mut self, forces: &[DVec3]) {
        self.own_loads.resize(forces.len(), DVec3::ZERO);
        for (own, force) in self.own_loads.iter_mut().zip(forces) {
            *own += *force;
        }
        self.loads.own = 1.0;
    }

    /// Adds the veins' own loads to the moments and forces on all nodes.
    pub fn add_own_forces(&self, nodes: &mut [[DVec3; 2]]) {
        for (node, own) in nodes.iter_mut().zip(&self.own_loads) {
            node[1] += self.own_part() * *own;
        }
    }

    /// Adds the veins' own loads to the right-hand side of an assembled system; returns their
    /// potential energy, without the bases'.
    pub(super) fn add_own_loads(&self, state: &State, system: &mut System) -> f64 {
        if self.own_loads.is_empty() {
            return 0.0;
        }
        let mut energy = 0.0;
        for (j, i) in self.each(1..self.segments() + 1) {
            let force = self.own_load(j, i);
            energy -= force.dot(state.x[state.base(j) + i]);
            system.add_load(j, i, [DVec3::ZERO, force]);
        }
        energy
    }
}
