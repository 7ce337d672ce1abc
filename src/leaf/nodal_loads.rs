//! Loads on single nodes: dead moments, dead forces off the axis, loads whose factors vary in time, and loads that turn
//! with the section.

use crate::rod::Wrench;
use crate::rotation::outer;
use glam::{DMat3, DQuat, DVec3};
use std::ops::{Add, Mul};

/// A dead moment on a node of a single rod, along the lab axes.
#[derive(Clone, Copy, Debug)]
pub struct NodalMoment {
    pub node: usize,
    pub moment: DVec3,
}

/// A dead force on a node of a rod, along the lab axes, by a load whose factor varies in time.
#[derive(Clone, Copy, Debug)]
pub struct ScheduledForce {
    /// Number of the factor: those of [`Scenario::load_factors`](crate::scenario::Scenario::load_factors), then one
    /// for each of [`Scenario::landings`](crate::scenario::Scenario::landings).
    pub factor: usize,
    pub rod: usize,
    pub node: usize,
    /// The force at a factor of one.
    pub force: DVec3,
}

/// A load without a potential on a node of a rod whose factor varies in time.
#[derive(Clone, Copy, Debug)]
pub struct ScheduledFollower {
    /// Number of the factor, as of [`ScheduledForce`].
    pub factor: usize,
    pub rod: usize,
    pub node: usize,
    /// The load at a factor of one.
    pub load: FollowerLoad,
}

/// A dead force off the axis, on the section of a node. The force on the node itself is among the loads of
/// single veins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lever {
    pub rod: usize,
    pub node: usize,
    /// Along the directors of the section.
    pub offset: DVec3,
    /// Along the lab axes.
    pub force: DVec3,
}

impl Lever {
    /// The moment on a section with the rotation `q`.
    pub fn moment(&self, q: DQuat) -> DVec3 {
        (q * self.offset).cross(self.force)
    }

    /// The energy of the lever.
    pub fn energy(&self, q: DQuat) -> f64 {
        -self.force.dot(q * self.offset)
    }

    /// The second derivatives of the energy by the rotation of the section.
    pub fn rotation_stiffness(&self, q: DQuat) -> DMat3 {
        let arm = q * self.offset;
        let mixed = outer(arm, self.force) + outer(self.force, arm);
        DMat3::from_diagonal(DVec3::splat(arm.dot(self.force))) - 0.5 * mixed
    }
}

/// Loads of single veins whose factors vary in time: first those with a factor of their own, then the weights of
/// masses that land.
#[derive(Clone, Debug, Default)]
pub struct ScheduledLoads {
    /// The present factors.
    pub factors: Vec<f64>,
    /// The forces, at factors of one.
    pub forces: Vec<ScheduledForce>,
    /// Dead moments on points, at factors of one, each with the number of its factor.
    pub moments: Vec<(usize, NodalMoment)>,
    /// The forces that act off the axis, also in `forces`, at factors of one, each with the number of its factor.
    pub levers: Vec<(usize, Lever)>,
    /// Loads that turn with the sections, and moments along veins, at factors of one.
    pub followers: Vec<ScheduledFollower>,
    /// Forces on all nodes, and dead moments on points, whose factors do not vary.
    pub constant_forces: Vec<DVec3>,
    pub constant_moments: Vec<NodalMoment>,
    /// The constant forces that act off the axis, also in `constant_forces`.
    pub constant_levers: Vec<Lever>,
    /// The loads without a potential on all nodes whose factors do not vary; empty unless some vary.
    pub constant_followers: Vec<FollowerLoad>,
}

impl ScheduledLoads {
    /// Adds a force that acts on the axis or off it.
    pub fn push_force(&mut self, factor: usize, lever: Lever) {
        self.forces.push(ScheduledForce {
            factor,
            rod: lever.rod,
            node: lever.node,
            force: lever.force,
        });
        if lever.offset != DVec3::ZERO {
            self.levers.push((factor, lever));
        }
    }

    /// The loads without a potential with their present factors.
    pub fn present_followers(&self) -> impl Iterator<Item = ScheduledFollower> {
        self.followers.iter().map(|it| ScheduledFollower {
            load: it.load * self.factors[it.factor],
            ..*it
        })
    }

    /// The forces with their present factors.
    pub fn present_forces(&self) -> impl Iterator<Item = ScheduledForce> {
        self.forces.iter().map(|it| ScheduledForce {
            force: self.factors[it.factor] * it.force,
            ..*it
        })
    }
}

/// Loads without a potential on a node, or their density along a rod.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowerLoad {
    /// Force along the directors.
    pub force: DVec3,
    /// Moment along the directors.
    pub moment: DVec3,
    /// Dead moment, along the lab axes.
    pub dead_moment: DVec3,
}

impl Add for FollowerLoad {
    type Output = FollowerLoad;

    fn add(self, other: FollowerLoad) -> FollowerLoad {
        FollowerLoad {
            force: self.force + other.force,
            moment: self.moment + other.moment,
            dead_moment: self.dead_moment + other.dead_moment,
        }
    }
}

impl Mul<f64> for FollowerLoad {
    type Output = FollowerLoad;

    fn mul(self, factor: f64) -> FollowerLoad {
        FollowerLoad {
            force: self.force * factor,
            moment: self.moment * factor,
            dead_moment: self.dead_moment * factor,
        }
    }
}

impl FollowerLoad {
    /// Moment and force on a section with this rotation.
    pub fn wrench(self, q: DQuat) -> Wrench {
        Wrench {
            moment: q * self.moment + self.dead_moment,
            force: q * self.force,
        }
    }

    /// What a small rotation of the section adds to the right-hand side of the linear equations of its
    /// node.
    pub fn derivative(self, q: DQuat, turn: DVec3) -> Wrench {
        let half = 0.5 * (q * self.moment - self.dead_moment);
        Wrench {
            moment: turn.cross(half),
            force: turn.cross(q * self.force),
        }
    }
}
