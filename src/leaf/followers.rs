//! Loads without a potential on any vein: forces and moments that turn with the section, and moments
//! per length that are dead.
//!
//! Their nodal loads are those of the trapezoidal rule, as of dead loads. With a spatial rotation t of a
//! node, a force F that turns with it changes by t x F. The matrix of Newton's equations is symmetric in
//! the increments of rotations; the exact derivative of a node's moment balance, in which the segments
//! exert -M, has t x M/2 besides. A moment M that turns with the node, and changes by t x M, thus leaves
//! t x M/2 on the right-hand side of the linear equations, and a dead one -t x M/2.

use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::loads::NODE_COINCIDENCE_TOLERANCE;
use crate::leaf::nodal_loads::FollowerLoad;
use crate::leaf::state::{NodalField, State, add_to_increment, rotation_part};
use crate::leaf::system::System;
use crate::leaf::{Leaf, Loads};
use crate::rod::Wrench;
use crate::scenario::{Key, PointLoad, Profile, RodPlace};
use glam::DVec3;

impl Loads {
    /// Whether loads act that turn with the sections, or moments along veins.
    pub fn has_followers(&self) -> bool {
        self.follower_factor != 0.0
    }
}

/// A load on the point of a rod that turns with the section.
struct PointFollower {
    rod: usize,
    sigma: f64,
    load: FollowerLoad,
}

impl Leaf {
    /// The loads along rod `j` per unit of sigma, at a place.
    pub(super) fn follower_density(&self, j: usize, place: RodPlace) -> FollowerLoad {
        let (s, scale) = (self.scenario(), self.scale);
        let length = s.rods[j].length;
        let value = |loads: &Option<Vec<[Profile; 3]>>| {
            loads.as_ref().map_or(DVec3::ZERO, |all| {
                DVec3::from_array(all[j].each_ref().map(|load| load.at(place)))
            })
        };
        let couple = value(&s.couple) * (length / scale.moment());
        let (moment, dead_moment) = match s.couple_follows {
            true => (couple, DVec3::ZERO),
            false => (DVec3::ZERO, couple),
        };
        FollowerLoad {
            force: value(&s.follower) * (length / scale.force()),
            moment,
            dead_moment,
        }
    }

    /// The loads on points that turn with the section.
    fn point_followers(&self) -> impl Iterator<Item = PointFollower> {
        let points = self.scenario().points.iter().filter(|it| it.follows);
        points.map(move |it| PointFollower {
            rod: it.vein,
            sigma: it.at,
            load: self.load_on_turning_point(it, it.force, it.moment),
        })
    }

    /// The keys of the loads without a potential that act.
    pub fn keys_without_potential(&self) -> Vec<&'static str> {
        let scenario = self.scenario();
        let acts = |load: [f64; 3]| load != [0.0; 3];
        let any_point = |of: fn(&PointLoad) -> bool| scenario.points.iter().any(of);
        let keys = [
            (scenario.follower.is_some(), Key::Follower.path()),
            (scenario.couple.is_some(), Key::Couple.path()),
            (
                any_point(|it| it.follows && it.force != [0.0; 3]),
                Key::PointForce.path(),
            ),
            (
                any_point(|it| it.moment != [0.0; 3]),
                Key::PointMoment.path(),
            ),
            (acts(scenario.tip_moment), Key::TipMoment.path()),
            (self.in_wind(), Key::WindVelocity.path()),
        ];
        let acting = keys.into_iter().filter(|(acts, _)| *acts);
        acting.map(|(_, key)| key).collect()
    }

    /// A force and a moment on a point that turn with the section there.
    pub(super) fn load_on_turning_point(
        &self,
        point: &PointLoad,
        force: [f64; 3],
        moment: [f64; 3],
    ) -> FollowerLoad {
        let force = DVec3::from_array(force) / self.scale.force();
        let moment = DVec3::from_array(moment) / self.scale.moment();
        FollowerLoad {
            force,
            // Of a force that turns with the section the lever does, too.
            moment: match point.is_off_axis() {
                true => moment + self.point_offset(point).cross(force),
                false => moment,
            },
            dead_moment: DVec3::ZERO,
        }
    }

    /// Upper bound on the integral along any rod of the moment by these loads alone, as if all acted on
    /// that rod at their full length as lever.
    pub fn follower_moment_bound(&self) -> f64 {
        if !self.loads.has_followers() {
            return 0.0;
        }
        let length = (0..self.rods()).map(|j| self.length(j)).fold(0.0, f64::max);
        let size = |load: FollowerLoad| {
            length * load.force.length() + load.moment.length() + load.dead_moment.length()
        };
        let edges = [&[0.0], self.kinks(), &[1.0]].concat();
        let along = |j: usize| {
            let panels = edges.windows(2).map(|ends| {
                let here = |sigma: f64| size(self.follower_density(j, sigma.into()));
                (ends[1] - ends[0]) * here(ends[0]).max(here(ends[1]))
            });
            panels.sum::<f64>()
        };
        let points: f64 = self.point_followers().map(|it| size(it.load)).sum();
        self.loads.follower_factor * (points + (0..self.rods()).map(along).sum::<f64>())
    }
}

impl DiscreteLeaf {
    /// The loads without a potential on all nodes, rod after rod, before their factor; empty if there are
    /// none.
    pub(super) fn nodal_followers(&self) -> Vec<FollowerLoad> {
        match self.leaf.scenario().has_followers() {
            true => self.followers_on_nodes(&self.leaf),
            false => Vec::new(),
        }
    }

    /// The loads without a potential of a leaf on all nodes of this grid, rod after rod.
    pub(super) fn followers_on_nodes(&self, leaf: &Leaf) -> Vec<FollowerLoad> {
        let n = self.segments();
        let node = |(j, i)| {
            let density = |place| leaf.follower_density(j, place);
            self.grid.node_integral(i, density)
        };
        let mut loads: Vec<FollowerLoad> = self.rod_index_pairs(0..n + 1).map(node).collect();
        for PointFollower { rod, sigma, load } in leaf.point_followers() {
            let node = &mut loads[rod * (n + 1) + self.grid.nearest_node(sigma)];
            *node = *node + load;
        }
        loads
    }

    /// Whether loads act that turn with the sections, or moments along veins, if only at other times.
    pub fn has_followers(&self) -> bool {
        let vary = || {
            let scheduled = self.scheduled_loads.as_ref();
            scheduled.is_some_and(|it| !it.followers.is_empty())
        };
        self.follower_factor() != 0.0 && (!self.followers.is_empty() || vary())
    }

    fn follower_factor(&self) -> f64 {
        self.load_factor * self.loads.follower_factor
    }

    /// The load without a potential on node `i` of rod `j`.
    pub(super) fn node_follower(&self, j: usize, i: usize) -> FollowerLoad {
        match self.followers.get(j * (self.segments() + 1) + i) {
            Some(load) => *load * self.follower_factor(),
            None => FollowerLoad::default(),
        }
    }

    /// Moment and force of that load on node `i` of rod `j` in a state.
    pub fn follower_wrench(&self, state: &State, j: usize, i: usize) -> Wrench {
        match self.followers.is_empty() {
            true => Wrench::default(),
            false => self.node_follower(j, i).wrench(state.q[state.base(j) + i]),
        }
    }

    /// The moments of these loads and the dead moments on node `i` of rod `j` in a state.
    pub(super) fn node_moment(&self, state: &State, j: usize, i: usize) -> DVec3 {
        self.node_dead_moment(i) + self.follower_wrench(state, j, i).moment
    }

    /// By how much the load without a potential on the half segment before node `i` of rod `j`, and on
    /// points there, exceeds what the width of this half is of the load on the node. With the same part
    /// of it, it is what acts on that half.
    pub fn follower_jump_before(&self, state: &State, j: usize, i: usize) -> Wrench {
        let none = Wrench::default();
        if self.followers.is_empty() || i == 0 {
            return none;
        }
        let [here, _] = RodPlace::both_sides(self.grid.sigma()[i]);
        let half = 0.5 * self.grid.segment_width(i - 1);
        let part = half / self.grid.node_weight(i);
        let before = self.leaf.follower_density(j, here) * (half * self.follower_factor());
        let excess = before + self.node_follower(j, i) * -part;
        excess.wrench(state.q[state.base(j) + i])
    }
}

impl DiscreteLeaf {
    /// The part of a load on node `i` of rod `j` that meets no support in a state.
    fn unsupported_load(&self, state: &State, j: usize, i: usize, load: Wrench) -> Wrench {
        let free = self.node_freedom(j, i).of_wrench(load);
        Wrench {
            moment: self.across_joint(state, j, i, free.moment),
            ..free
        }
    }

    /// Adds the loads without a potential, but for dead moments on a single rod and wind, to the right-hand
    /// side of an assembled system.
    pub fn add_followers(&self, state: &State, system: &mut System) {
        if !self.has_followers() {
            return;
        }
        for (j, i) in self.rod_index_pairs(self.moving_nodes()) {
            let load = self.follower_wrench(state, j, i);
            system.add_load(j, i, self.unsupported_load(state, j, i, load));
        }
    }

    /// Adds the derivative of all loads without a potential but wind, along increments of the nodes, to
    /// forces.
    pub fn add_follower_derivative(
        &self,
        state: &State,
        increments: &NodalField,
        forces: &mut NodalField,
    ) {
        let first = self.first_node();
        for (j, i) in self.rod_index_pairs(self.moving_nodes()) {
            let mut load = self.node_follower(j, i);
            if self.rods() == 1 {
                load.dead_moment += self.node_dead_moment(i);
            }
            if load == FollowerLoad::default() {
                continue;
            }
            let turn = rotation_part(&increments[j][i - first]);
            let change = load.derivative(state.q[state.base(j) + i], turn);
            let change = self.unsupported_load(state, j, i, change);
            add_to_increment(&mut forces[j][i - first], change.moment, change.force);
        }
    }

    /// The load without a potential on points of rod `j` at `sigma`, by which its force and moment jump
    /// there.
    pub(super) fn point_follower_at(&self, j: usize, sigma: f64) -> FollowerLoad {
        if !self.has_followers() {
            return FollowerLoad::default();
        }
        let points = self.leaf.point_followers();
        let here = points
            .filter(|it| it.rod == j && (it.sigma - sigma).abs() < NODE_COINCIDENCE_TOLERANCE);
        let sum = here.fold(FollowerLoad::default(), |sum, it| sum + it.load);
        sum * self.follower_factor()
    }

    /// The load without a potential along rod `j` at a place, per unit of sigma.
    pub(super) fn follower_along(&self, j: usize, place: RodPlace) -> FollowerLoad {
        match self.has_followers() {
            true => self.leaf.follower_density(j, place) * self.follower_factor(),
            false => FollowerLoad::default(),
        }
    }
}
