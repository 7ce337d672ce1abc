//! Dead moments on a single rod, fixed along the lab axes: on its tip, and on points along it. They
//! have no potential in three dimensions.

use super::dimensionless::{Leaf, Loads};
use super::discrete::DiscreteLeaf;
use super::own_loads::SAME_NODE;
use super::system::System;
use crate::leaf::chain::group_and_lane;
use glam::DVec3;

impl Loads {
    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.tip_moment != DVec3::ZERO || self.moments != 0.0
    }
}

impl Leaf {
    /// Sigma and size of every dead moment on a point.
    pub(super) fn moments_on_points(&self) -> impl Iterator<Item = (f64, DVec3)> {
        let (points, unit) = (self.scenario().points.iter(), self.scale.moment());
        points.map(move |it| (it.at, DVec3::from_array(it.moment) / unit))
    }

    /// Sigma and size of every dead moment.
    pub fn moments(&self) -> impl Iterator<Item = (f64, DVec3)> {
        let (loads, points) = (&self.loads, self.moments_on_points());
        let on_points = points.map(|(at, moment)| (at, loads.moments * moment));
        let all = std::iter::once((1.0, loads.tip_moment)).chain(on_points);
        all.filter(|(_, moment)| *moment != DVec3::ZERO)
    }

    /// The size of the largest dead moment on a point.
    pub fn largest_on_points(&self) -> f64 {
        let sizes = self.moments_on_points().map(|(_, moment)| moment.length());
        self.loads.moments * sizes.fold(0.0, f64::max)
    }

    /// Upper bound on the integral of the moment that the rod carries by the dead moments alone, over
    /// its length: a free rod carries each up to its place, one that is held elsewhere perhaps
    /// beyond it.
    pub fn integral_of_moments(&self) -> f64 {
        let held = self.is_held();
        let reach = |at: f64| if held { 1.0 } else { at };
        self.moments()
            .map(|(at, moment)| moment.length() * reach(at))
            .sum()
    }
}

impl DiscreteLeaf {
    /// Nodes and sizes of the dead moments on points; empty if there are none. What acts within
    /// rounding of a clamped base is left to its clamp.
    pub(super) fn moments_on_nodes(&self) -> Vec<(usize, DVec3)> {
        let points = self.leaf.moments_on_points();
        let some = points.filter(|(_, moment)| *moment != DVec3::ZERO);
        some.map(|(at, moment)| (self.grid.nearest(at), moment))
            .filter(|(node, _)| *node >= self.first_node())
            .collect()
    }

    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.moments().next().is_some()
    }

    /// The same leaf without dead moments.
    pub fn without_moments(&self) -> Self {
        let mut without = self.clone();
        without.loads.tip_moment = DVec3::ZERO;
        without.loads.moments = 0.0;
        without
    }

    /// Node and size of every dead moment that acts.
    pub fn moments(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let part = self.load_factor;
        self.moments_of(self.loads)
            .map(move |(node, moment)| (node, part * moment))
            .filter(|(_, moment)| *moment != DVec3::ZERO)
    }

    /// The same under other loads.
    pub fn moments_of(&self, loads: Loads) -> impl Iterator<Item = (usize, DVec3)> {
        let tip = (self.segments(), loads.tip_moment);
        let on_points = self.point_moments.iter();
        let on_points = on_points.map(move |&(node, moment)| (node, loads.moments * moment));
        // Joined tips pass on no moment.
        let single = self.rods() == 1;
        let tip = Some(tip).filter(|(_, moment)| single && *moment != DVec3::ZERO);
        tip.into_iter().chain(on_points)
    }

    /// The sum of the dead moments on node `i` of the rod.
    pub(super) fn moment_on(&self, i: usize) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here = self.moments().filter(|(node, _)| *node == i);
        here.map(|(_, moment)| moment).sum()
    }

    /// The sum of the dead moments at `sigma`, by which the moment of the rod jumps there.
    pub fn moment_at(&self, sigma: f64) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here = |node: usize| (self.grid.sigma()[node] - sigma).abs() < SAME_NODE;
        let moments = self.moments().filter(|(node, _)| here(*node));
        moments.map(|(_, moment)| moment).sum()
    }

    /// The sum of the dead moments beyond segment `i`: what it carries of them if the tip is free.
    pub fn moment_beyond(&self, i: usize) -> DVec3 {
        let beyond = self.moments().filter(|(node, _)| *node > i);
        beyond.map(|(_, moment)| moment).sum()
    }

    /// Adds the dead moments to the right-hand side of an assembled system, which keeps them for
    /// its solution.
    pub(super) fn add_moments(&self, system: &mut System) {
        let first = self.first_node();
        system
            .moments
            .set(self.moments().map(|(node, moment)| (node - first, moment)));
        let (group, lane) = group_and_lane(0);
        for (i, moment) in system.moments.on_nodes() {
            let rhs = &mut system.groups[group].rhs[i];
            for c in 0..3 {
                rhs[c].0[lane] += moment[c];
            }
        }
    }
}
