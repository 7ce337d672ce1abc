//! Loads on the nodes of several rods: dead loads, and the coupling with their neighbours.
//!
//! Dead moments on a single rod, fixed along the lab axes: on its tip, and on points along it. They
//! have no potential in three dimensions.
//!
//! Dead moments in Newton's equations of a single rod.
//!
//! A dead moment M is not conservative in three dimensions: the derivative of its node's moment
//! balance in spatial increments gains -\[M\]/2, which is skew. All of them together have a small
//! rank, and are included by the Sherman-Morrison-Woodbury formula: with the rotations C of their
//! nodes by unit moments on these and the skew S, the moments x that (1 + S C) x = S t of the
//! rotations t without them are taken off.

use crate::leaf::block_tridiagonal::group_and_lane;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::State;
use crate::leaf::system::System;
use crate::leaf::{Leaf, Loads};
use glam::DVec3;

impl Loads {
    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.tip_moment != DVec3::ZERO || self.dead_moment_factor != 0.0
    }
}

impl Leaf {
    /// Sigma and size of every dead moment on a point.
    pub(super) fn point_dead_moments(&self) -> impl Iterator<Item = (f64, DVec3)> {
        let (points, unit) = (self.scenario().points.iter(), self.scale.moment());
        points.map(move |it| (it.at, DVec3::from_array(it.moment) / unit))
    }

    /// Sigma and size of every dead moment.
    pub fn dead_moments(&self) -> impl Iterator<Item = (f64, DVec3)> {
        let (loads, points) = (&self.loads, self.point_dead_moments());
        let on_points = points.map(|(at, moment)| (at, loads.dead_moment_factor * moment));
        let all = std::iter::once((1.0, loads.tip_moment)).chain(on_points);
        all.filter(|(_, moment)| *moment != DVec3::ZERO)
    }

    /// The size of the largest dead moment on a point.
    pub fn largest_point_moment(&self) -> f64 {
        let sizes = self.point_dead_moments().map(|(_, moment)| moment.length());
        self.loads.dead_moment_factor * sizes.fold(0.0, f64::max)
    }

    /// Upper bound on the integral of the moment that the rod carries by the dead moments alone, over
    /// its length: a free rod carries each up to its place, one that is held elsewhere perhaps
    /// beyond it.
    pub fn moment_integral_bound(&self) -> f64 {
        let held = self.has_placed_supports();
        let reach = |at: f64| if held { 1.0 } else { at };
        self.dead_moments()
            .map(|(at, moment)| moment.length() * reach(at))
            .sum()
    }
}

impl DiscreteLeaf {
    /// Nodes and sizes of the dead moments on points; empty if there are none. What acts within
    /// rounding of a clamped base is left to its clamp.
    pub(super) fn nodal_point_moments(&self) -> Vec<(usize, DVec3)> {
        let points = self.leaf.point_dead_moments();
        let some = points.filter(|(_, moment)| *moment != DVec3::ZERO);
        some.map(|(at, moment)| (self.grid.nearest(at), moment))
            .filter(|(node, _)| *node >= self.first_node())
            .collect()
    }

    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.dead_moments().next().is_some()
    }

    /// The same leaf without dead moments.
    pub fn without_moments(&self) -> Self {
        let mut without = self.clone();
        without.loads.tip_moment = DVec3::ZERO;
        without.loads.dead_moment_factor = 0.0;
        without
    }

    /// Node and size of every dead moment that acts.
    pub fn dead_moments(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let part = self.load_factor;
        self.dead_moments_under(self.loads)
            .map(move |(node, moment)| (node, part * moment))
            .filter(|(_, moment)| *moment != DVec3::ZERO)
    }

    /// The same under other loads.
    pub fn dead_moments_under(&self, loads: Loads) -> impl Iterator<Item = (usize, DVec3)> {
        let tip = (self.segments(), loads.tip_moment);
        let on_points = self.point_moments.iter();
        let on_points =
            on_points.map(move |&(node, moment)| (node, loads.dead_moment_factor * moment));
        // Joined tips pass on no moment.
        let single = self.rods() == 1;
        let tip = Some(tip).filter(|(_, moment)| single && *moment != DVec3::ZERO);
        tip.into_iter().chain(on_points)
    }

    /// The sum of the dead moments on node `i` of the rod.
    pub(super) fn node_dead_moment(&self, i: usize) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here = self.dead_moments().filter(|(node, _)| *node == i);
        here.map(|(_, moment)| moment).sum()
    }

    /// The sum of the dead moments at `sigma`, by which the moment of the rod jumps there.
    pub fn dead_moment_at(&self, sigma: f64) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here =
            |node: usize| (self.grid.sigma()[node] - sigma).abs() < NODE_COINCIDENCE_TOLERANCE;
        let moments = self.dead_moments().filter(|(node, _)| here(*node));
        moments.map(|(_, moment)| moment).sum()
    }

    /// The sum of the dead moments beyond segment `i`: what it carries of them if the tip is free.
    pub fn dead_moment_beyond(&self, i: usize) -> DVec3 {
        let beyond = self.dead_moments().filter(|(node, _)| *node > i);
        beyond.map(|(_, moment)| moment).sum()
    }

    /// Adds the dead moments to the right-hand side of an assembled system, which keeps them for
    /// its solution.
    pub(super) fn add_moments(&self, system: &mut System) {
        let first = self.first_node();
        system.moments.replace_moments(
            self.dead_moments()
                .map(|(node, moment)| (node - first, moment)),
        );
        let (group, lane) = group_and_lane(0);
        for (i, moment) in system.moments.nodal_moments() {
            let rhs = &mut system.groups[group].rhs[i];
            for c in 0..3 {
                rhs[c].0[lane] += moment[c];
            }
        }
    }
}

/// Fractions of the length closer to each other than this are those of one node.
pub(crate) const NODE_COINCIDENCE_TOLERANCE: f64 = 1e-11;

impl Leaf {
    /// Own load on rod `j` at `sigma`, per unit of sigma, without those on points.
    pub fn own_load_density(&self, j: usize, sigma: f64) -> DVec3 {
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
    pub(crate) fn nodal_own_loads(&self, leaf: &Leaf) -> Vec<DVec3> {
        if leaf.loads.rod_load_factor == 0.0 {
            return Vec::new();
        }
        let (n, sigma) = (self.segments(), self.grid.sigma());
        let node = |(j, i)| self.grid.node_weight(i) * leaf.own_load_density(j, sigma[i]);
        let mut loads: Vec<DVec3> = self.rod_index_pairs(0..n + 1).map(node).collect();
        for (j, at, force) in leaf.point_loads() {
            loads[j * (n + 1) + self.grid.nearest(at)] += force;
        }
        loads
    }

    /// Part of the veins' own loads that acts.
    pub(crate) fn rod_load_factor(&self) -> f64 {
        self.load_factor * self.loads.rod_load_factor
    }

    /// Own load on node `i` of rod `j`.
    pub fn own_load_on_node(&self, j: usize, i: usize) -> DVec3 {
        let load = self.own_loads.get(j * (self.segments() + 1) + i);
        load.map_or(DVec3::ZERO, |load| self.rod_load_factor() * *load)
    }

    /// The forces on points of rod `j` at `sigma`, by which its force jumps there.
    pub fn point_force_at(&self, j: usize, sigma: f64) -> DVec3 {
        if self.leaf.scenario().points.is_empty() {
            return DVec3::ZERO;
        }
        let points = self.leaf.point_loads();
        let here = points
            .filter(|(rod, at, _)| *rod == j && (at - sigma).abs() < NODE_COINCIDENCE_TOLERANCE);
        self.rod_load_factor() * here.map(|(_, _, force)| force).sum::<DVec3>()
    }

    /// Adds dead forces on all nodes to the veins' own loads.
    pub fn add_nodal_loads(&mut self, forces: &[DVec3]) {
        self.own_loads.resize(forces.len(), DVec3::ZERO);
        for (own, force) in self.own_loads.iter_mut().zip(forces) {
            *own += *force;
        }
        self.loads.rod_load_factor = 1.0;
    }

    /// Adds the veins' own loads to the moments and forces on all nodes.
    pub fn add_own_forces(&self, nodes: &mut [[DVec3; 2]]) {
        for (node, own) in nodes.iter_mut().zip(&self.own_loads) {
            node[1] += self.rod_load_factor() * *own;
        }
    }

    /// Adds the veins' own loads to the right-hand side of an assembled system; returns their
    /// potential energy, without the bases'.
    pub(crate) fn add_own_loads(&self, state: &State, system: &mut System) -> f64 {
        if self.own_loads.is_empty() {
            return 0.0;
        }
        let mut energy = 0.0;
        for (j, i) in self.rod_index_pairs(1..self.segments() + 1) {
            let force = self.own_load_on_node(j, i);
            energy -= force.dot(state.x[state.base(j) + i]);
            system.add_load(j, i, [DVec3::ZERO, force]);
        }
        energy
    }
}
