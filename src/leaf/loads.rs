//! Dead loads of single veins: their weights, loads along them, forces on points, and dead moments.
//!
//! A dead moment keeps its components along the lab axes. Dead moments act on a single rod, at its tip
//! and at points, and have no potential in three dimensions; how they enter Newton's equations is told
//! in `system`.

use crate::leaf::block_tridiagonal::rod_lane;
use crate::leaf::discrete::{DiscreteLeaf, Grid};
use crate::leaf::nodal_loads::{
    FollowerLoad, Lever, NodalMoment, ScheduledFollower, ScheduledForce, ScheduledLoads,
};
use crate::leaf::state::State;
use crate::leaf::system::System;
use crate::leaf::{Leaf, Loads};
use crate::rod::Wrench;
use crate::scenario::{RodPlace, Scenario};
use glam::DVec3;
use std::sync::Arc;

/// A dead moment on the point at the fraction `sigma` of a single rod, along the lab axes.
#[derive(Clone, Copy, Debug)]
pub struct PointMoment {
    pub sigma: f64,
    pub moment: DVec3,
}

/// A dead force on the point at the fraction `sigma` of a rod, along the lab axes.
#[derive(Clone, Copy, Debug)]
pub struct PointForce {
    pub rod: usize,
    pub sigma: f64,
    pub force: DVec3,
    /// Where it acts off the axis, along the directors.
    pub offset: DVec3,
}

impl Loads {
    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.tip_moment != DVec3::ZERO || self.dead_moment_factor != 0.0
    }
}

impl Leaf {
    /// The dead moments on points, also those that are zero, before the factor in the loads.
    pub(super) fn point_dead_moments(&self) -> impl Iterator<Item = PointMoment> {
        let (points, unit) = (self.scenario().points.iter(), self.scale.moment());
        let dead = points.filter(|it| !it.follows);
        dead.map(move |it| PointMoment {
            sigma: it.at,
            moment: DVec3::from_array(it.moment) / unit,
        })
    }

    /// The dead moments that act, on the tip and on points.
    pub fn dead_moments(&self) -> impl Iterator<Item = PointMoment> {
        let loads = &self.loads;
        let on_points = self.point_dead_moments().map(|it| PointMoment {
            moment: loads.dead_moment_factor * it.moment,
            ..it
        });
        let on_tip = PointMoment {
            sigma: 1.0,
            moment: loads.tip_moment,
        };
        let all = std::iter::once(on_tip).chain(on_points);
        all.filter(|it| it.moment != DVec3::ZERO)
    }

    /// The size of the largest dead moment on a point.
    pub fn largest_point_moment(&self) -> f64 {
        let sizes = self.point_dead_moments().map(|it| it.moment.length());
        self.loads.dead_moment_factor * sizes.fold(0.0, f64::max)
    }

    /// Upper bound on the integral of the moment that the rod carries by the dead moments alone, over
    /// its length: a rod with a free tip carries each moment from the base to the point on which it
    /// acts, one that is held elsewhere perhaps also beyond that point.
    pub fn moment_integral_bound(&self) -> f64 {
        let held = self.has_placed_supports();
        let reach = |at: f64| if held { 1.0 } else { at };
        self.dead_moments()
            .map(|it| it.moment.length() * reach(it.sigma))
            .sum()
    }
}

impl DiscreteLeaf {
    /// The dead moments on points at their nodes. A moment within rounding of a clamped base is left
    /// to its clamp.
    pub(super) fn nodal_point_moments(&self) -> Vec<NodalMoment> {
        self.nodal_moments(self.leaf.point_dead_moments()).collect()
    }

    /// Dead moments on points at their nodes, as in [`DiscreteLeaf::nodal_point_moments`].
    fn nodal_moments(
        &self,
        points: impl Iterator<Item = PointMoment>,
    ) -> impl Iterator<Item = NodalMoment> {
        let some = points.filter(|it| it.moment != DVec3::ZERO);
        some.map(|it| NodalMoment {
            node: self.grid.nearest_node(it.sigma),
            moment: it.moment,
        })
        .filter(|it| it.node >= self.first_node())
    }

    /// The loads of single veins whose factors vary in time, if there are any.
    pub(super) fn find_scheduled_loads(&self) -> Option<Box<ScheduledLoads>> {
        let scenario = self.leaf.scenario();
        let factors = scenario.load_factors().count();
        let count = factors + scenario.landings().count();
        if count == 0 {
            return None;
        }
        let (n, scale) = (self.segments(), self.leaf.scale);
        let of = |change: &dyn Fn(&mut Scenario)| {
            let mut own = scenario.clone();
            change(&mut own);
            Leaf {
                scenario: Arc::new(own),
                ..self.leaf.clone()
            }
        };
        let is_factored = scenario.factored.is_some();
        let constant = of(&|own: &mut Scenario| {
            if is_factored {
                let none = own.unloaded();
                own.own_gravity = none.own_gravity;
                (own.gravity, own.g, own.distributed) = (none.gravity, none.g, none.distributed);
                (own.follower, own.couple) = (None, None);
            }
            let varying = own.points.iter_mut().filter(|it| it.in_time.is_some());
            varying.for_each(|it| (it.force, it.moment) = ([0.0; 3], [0.0; 3]));
        });
        let constant_points = constant.point_dead_moments();
        let mut scheduled = ScheduledLoads {
            factors: vec![0.0; count],
            constant_forces: self.nodal_own_loads(&constant),
            constant_moments: self.nodal_moments(constant_points).collect(),
            constant_levers: self.nodal_levers(&constant),
            constant_followers: match scenario.has_followers_in_time() {
                true => self.followers_on_nodes(&constant),
                false => Vec::new(),
            },
            ..ScheduledLoads::default()
        };
        if let Some(loads) = &scenario.factored {
            let whole = of(&|own: &mut Scenario| {
                own.gravity = loads.gravity;
                own.own_gravity.clone_from(&loads.own_gravity);
                own.g = loads.g;
                own.distributed.clone_from(&loads.distributed);
                own.follower.clone_from(&loads.follower);
                own.couple.clone_from(&loads.couple);
                let points = own.points.iter_mut();
                points.for_each(|it| (it.force, it.moment) = ([0.0; 3], [0.0; 3]));
            });
            let forces = self.nodal_own_loads(&whole).into_iter();
            let nodes = self.rod_index_pairs(0..n + 1).zip(forces);
            let forces = nodes.filter(|(_, force)| *force != DVec3::ZERO);
            scheduled.forces = forces
                .map(|((rod, node), force)| ScheduledForce {
                    factor: 0,
                    rod,
                    node,
                    force,
                })
                .collect();
            let levers = self.nodal_levers(&whole).into_iter();
            scheduled.levers = levers.map(|lever| (0, lever)).collect();
            if loads.follower.is_some() || loads.couple.is_some() {
                let followers = self.followers_on_nodes(&whole);
                let nodes = self.rod_index_pairs(0..n + 1).zip(followers);
                let acting = nodes.filter(|(_, load)| *load != FollowerLoad::default());
                scheduled.followers = acting
                    .map(|((rod, node), load)| ScheduledFollower {
                        factor: 0,
                        rod,
                        node,
                        load,
                    })
                    .collect();
            }
        }
        let points = scenario.points.iter();
        let varying = points.filter_map(|it| Some((it, it.in_time.as_ref()?)));
        for (factor, (point, load)) in (usize::from(is_factored)..).zip(varying) {
            if point.follows {
                scheduled.followers.push(ScheduledFollower {
                    factor,
                    rod: point.vein,
                    node: self.grid.nearest_node(point.at),
                    load: (self.leaf).load_on_turning_point(point, load.force, load.moment),
                });
                continue;
            }
            let force = DVec3::from_array(load.force) / scale.force();
            scheduled.push_force(factor, self.node_lever(point, force));
            let moment = PointMoment {
                sigma: point.at,
                moment: DVec3::from_array(load.moment) / scale.moment(),
            };
            let moments = self.nodal_moments(std::iter::once(moment));
            scheduled.moments.extend(moments.map(|it| (factor, it)));
        }
        let g = scenario.factored.as_ref().map_or(scenario.g, |it| it.g);
        for (factor, (number, landing)) in (factors..).zip(scenario.landings()) {
            let point = &scenario.points[number];
            let weight = landing.mass * DVec3::from_array(g) / scale.force();
            scheduled.push_force(factor, self.node_lever(point, weight));
        }
        Some(Box::new(scheduled))
    }

    /// Sets the factors of the loads that vary in time, and with them the loads of single veins.
    pub fn set_scheduled_factors(&mut self, factor: impl Fn(usize) -> f64) {
        let Some(scheduled) = &mut self.scheduled_loads else {
            return;
        };
        let count = self.grid.segments() + 1;
        for (number, own) in scheduled.factors.iter_mut().enumerate() {
            *own = factor(number);
        }
        self.own_loads.clone_from(&scheduled.constant_forces);
        for it in &scheduled.forces {
            self.own_loads[it.rod * count + it.node] += scheduled.factors[it.factor] * it.force;
        }
        self.levers.clone_from(&scheduled.constant_levers);
        let levers = scheduled.levers.iter();
        self.levers.extend(levers.map(|(number, it)| Lever {
            force: scheduled.factors[*number] * it.force,
            ..*it
        }));
        self.point_moments.clone_from(&scheduled.constant_moments);
        let moments = scheduled.moments.iter();
        self.point_moments
            .extend(moments.map(|(number, it)| NodalMoment {
                moment: scheduled.factors[*number] * it.moment,
                ..*it
            }));
        if !scheduled.followers.is_empty() {
            self.followers.clone_from(&scheduled.constant_followers);
            for it in scheduled.present_followers() {
                let on_node = &mut self.followers[it.rod * count + it.node];
                *on_node = *on_node + it.load;
            }
        }
    }

    /// The sum of the dead moments on points that are left to the clamp of the base.
    pub fn dead_moment_on_clamp(&self) -> DVec3 {
        if self.loads.dead_moment_factor == 0.0 {
            return DVec3::ZERO;
        }
        let points = self.leaf.point_dead_moments();
        let clamped = points.filter(|it| self.grid.nearest_node(it.sigma) < self.first_node());
        let sum: DVec3 = clamped.map(|it| it.moment).sum();
        self.load_factor * self.loads.dead_moment_factor * sum
    }

    /// Whether dead moments act.
    pub fn has_moments(&self) -> bool {
        self.dead_moments().next().is_some()
    }

    /// This leaf without dead moments and loads that turn with the sections: all loads but wind have a
    /// potential.
    pub fn with_load_potential(&self) -> Self {
        let mut without = self.clone();
        without.loads.follower_factor = 0.0;
        without.loads.tip_moment = DVec3::ZERO;
        without.loads.dead_moment_factor = 0.0;
        without
    }

    /// The dead moments that act.
    pub fn dead_moments(&self) -> impl Iterator<Item = NodalMoment> {
        let factor = self.load_factor;
        self.dead_moments_under(self.loads)
            .map(move |it| NodalMoment {
                moment: factor * it.moment,
                ..it
            })
            .filter(|it| it.moment != DVec3::ZERO)
    }

    /// The dead moments under other loads, before the leaf's load factor.
    pub fn dead_moments_under(&self, loads: Loads) -> impl Iterator<Item = NodalMoment> {
        let on_tip = NodalMoment {
            node: self.segments(),
            moment: loads.tip_moment,
        };
        let on_points = self.point_moments.iter().map(move |it| NodalMoment {
            node: it.node,
            moment: loads.dead_moment_factor * it.moment,
        });
        // Joined tips pass on no moment.
        let single = self.rods() == 1;
        let on_tip = Some(on_tip).filter(|it| single && it.moment != DVec3::ZERO);
        on_tip.into_iter().chain(on_points)
    }

    /// The sum of the dead moments on node `i` of the rod.
    pub(super) fn node_dead_moment(&self, i: usize) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here = self.dead_moments().filter(|it| it.node == i);
        here.map(|it| it.moment).sum()
    }

    /// The sum of the dead moments at `sigma`, by which the moment of the rod jumps there.
    pub fn dead_moment_at(&self, sigma: f64) -> DVec3 {
        if !self.loads.has_moments() {
            return DVec3::ZERO;
        }
        let here =
            |node: usize| (self.grid.sigma()[node] - sigma).abs() < NODE_COINCIDENCE_TOLERANCE;
        let moments = self.dead_moments().filter(|it| here(it.node));
        moments.map(|it| it.moment).sum()
    }

    /// The sum of the dead moments beyond segment `i`: what it carries of them if the tip is free.
    pub fn dead_moment_beyond(&self, i: usize) -> DVec3 {
        let beyond = self.dead_moments().filter(|it| it.node > i);
        beyond.map(|it| it.moment).sum()
    }

    /// Adds the dead moments to the right-hand side of an assembled system, which keeps them for
    /// its solution.
    pub(super) fn add_moments(&self, system: &mut System) {
        let first = self.first_node();
        let numbered = |it: NodalMoment| NodalMoment {
            node: it.node - first,
            ..it
        };
        system
            .moments
            .replace_moments(self.dead_moments().map(numbered));
        let only = rod_lane(0);
        for NodalMoment { node, moment } in system.moments.nodal_moments() {
            let rhs = &mut system.groups[only.group].rhs[node];
            for c in 0..3 {
                rhs[c].0[only.lane] += moment[c];
            }
        }
    }
}

/// Largest distance, in fractions of the length, of a load from the node on which it acts.
pub(super) const NODE_COINCIDENCE_TOLERANCE: f64 = 1e-11;

impl Leaf {
    /// Load of rod `j` alone at a place, its weight and load along it, per unit of sigma; without
    /// forces on points.
    pub fn own_load_density(&self, j: usize, place: impl Into<RodPlace>) -> DVec3 {
        let (s, place) = (self.scenario(), place.into());
        let weight = DVec3::from_array(s.weight(j).at(place)) - DVec3::from_array(s.gravity);
        let along = s.distributed.as_ref().map_or(DVec3::ZERO, |loads| {
            DVec3::from_array(loads[j].each_ref().map(|load| load.at(place)))
        });
        (weight + along) * (self.share(j) * s.rods[j].length / self.scale.force())
    }

    /// The forces on points.
    pub fn point_forces(&self) -> impl Iterator<Item = PointForce> {
        let (s, unit) = (self.scenario(), self.scale.force());
        s.points.iter().map(move |it| PointForce {
            rod: it.vein,
            sigma: it.at,
            force: DVec3::from_array(s.force_on(it)) / unit,
            offset: self.point_offset(it),
        })
    }
}

impl Grid {
    /// Load of rod `j` of a leaf alone, without forces on points, on the halves of both segments at node
    /// `i`.
    pub(super) fn own_load_around_node(&self, leaf: &Leaf, j: usize, i: usize) -> DVec3 {
        self.node_integral(i, |place| leaf.own_load_density(j, place))
    }
}

impl DiscreteLeaf {
    /// By how much the load of rod `j` alone on the half segment before its node `i` exceeds the part that
    /// the width of this half is of the node's: zero unless the load jumps there.
    pub fn own_load_jump_before(&self, j: usize, i: usize) -> DVec3 {
        if self.own_loads.is_empty() || i == 0 || i == self.segments() {
            return DVec3::ZERO;
        }
        let sides = RodPlace::both_sides(self.grid.sigma()[i]);
        let [base, tip] = sides.map(|place| self.leaf.own_load_density(j, place));
        if base == tip {
            return DVec3::ZERO;
        }
        let half = 0.5 * self.grid.segment_width(i - 1);
        let part = half / self.grid.node_weight(i);
        let all = self.grid.own_load_around_node(&self.leaf, j, i);
        self.rod_load_factor() * (half * base - part * all)
    }

    /// Loads of single veins on all nodes, rod after rod; empty if there are none.
    pub(super) fn nodal_own_loads(&self, leaf: &Leaf) -> Vec<DVec3> {
        if leaf.loads.rod_load_factor == 0.0 {
            return Vec::new();
        }
        let n = self.segments();
        let node = |(j, i)| self.grid.own_load_around_node(leaf, j, i);
        let mut loads: Vec<DVec3> = self.rod_index_pairs(0..n + 1).map(node).collect();
        for PointForce {
            rod, sigma, force, ..
        } in leaf.point_forces()
        {
            loads[rod * (n + 1) + self.grid.nearest_node(sigma)] += force;
        }
        loads
    }

    /// Factor of the loads of single veins.
    pub(super) fn rod_load_factor(&self) -> f64 {
        self.load_factor * self.loads.rod_load_factor
    }

    /// Load of rod `j` alone on its node `i`.
    pub fn own_load_on_node(&self, j: usize, i: usize) -> DVec3 {
        let load = self.own_loads.get(j * (self.segments() + 1) + i);
        load.map_or(DVec3::ZERO, |load| self.rod_load_factor() * *load)
    }

    /// The forces on points of rod `j` at `sigma`, by which its force jumps there.
    pub fn point_force_at(&self, j: usize, sigma: f64) -> DVec3 {
        if self.leaf.scenario().points.is_empty() {
            return DVec3::ZERO;
        }
        let points = self.leaf.point_forces();
        let here = points
            .filter(|it| it.rod == j && (it.sigma - sigma).abs() < NODE_COINCIDENCE_TOLERANCE);
        self.rod_load_factor() * here.map(|it| it.force).sum::<DVec3>()
    }

    /// Adds dead forces on all nodes to the loads of single veins.
    pub fn add_nodal_loads(&mut self, forces: &[DVec3]) {
        self.own_loads.resize(forces.len(), DVec3::ZERO);
        for (own, force) in self.own_loads.iter_mut().zip(forces) {
            *own += *force;
        }
        self.loads.rod_load_factor = 1.0;
    }

    /// Adds the loads of single veins to the moments and forces on all nodes.
    pub fn add_own_forces(&self, nodes: &mut [Wrench]) {
        for (node, own) in nodes.iter_mut().zip(&self.own_loads) {
            node.force += self.rod_load_factor() * *own;
        }
    }

    /// Adds the loads of single veins to the right-hand side of an assembled system; returns their
    /// potential energy, without that of loads on bases.
    pub(super) fn add_own_loads(&self, state: &State, system: &mut System) -> f64 {
        if self.own_loads.is_empty() {
            return 0.0;
        }
        let mut energy = 0.0;
        for (j, i) in self.rod_index_pairs(1..self.segments() + 1) {
            let force = self.own_load_on_node(j, i);
            energy -= force.dot(state.x[state.base(j) + i]);
            system.add_load(j, i, Wrench::from_force(force));
        }
        energy
    }
}
