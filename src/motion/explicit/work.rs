//! Work of loads and rest curvatures that vary in time.
//!
//! A kick takes the means of the loads over its length, and their work is this impulse times the
//! mean of the velocities before and after it, whatever the loads are within it. Only
//! the excess over the loads at time 0 is counted, which have a potential.

use super::Explicit;
use super::packs::vector;
use crate::leaf::{DiscreteLeaf, Loads};
use crate::motion::physics::Physics;
use glam::DVec3;

/// What the work of varying loads and rest curvatures depends on.
#[derive(Clone, Copy, Debug)]
pub(super) struct VaryingWork {
    /// Loads and factor of the rest curvatures at time 0.
    loads: Loads,
    rest: f64,
    /// Twice the energy of bending from the rest curvatures to none.
    straightening: f64,
    /// At the last kick: half the impulse of the factor's excess, and the sum of the
    /// rest curvatures times the moments without them.
    half_impulse: f64,
    turned: f64,
    /// Rate of that sum before the last kick.
    rate: f64,
}

impl VaryingWork {
    pub(super) fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Self {
        let straightening = leaf.sections.iter().map(|section| {
            let rest = section.rest_curvature;
            section.ds * rest.dot(section.couple_stiffness * rest)
        });
        VaryingWork {
            loads: physics.loads(0.0),
            rest: physics.rest(0.0),
            straightening: straightening.sum(),
            half_impulse: 0.0,
            turned: 0.0,
            rate: 0.0,
        }
    }

    /// Work since the last kick, `width` ago, by the mean factors of the rest curvatures in that
    /// kick and, over `length`, in this one; `bent` is the sum of the rest curvatures
    /// times the present moments.
    pub(super) fn of_rest(&mut self, mean: f64, bent: f64, length: f64, width: f64) -> f64 {
        let turned = bent + mean * self.straightening;
        let half_impulse = 0.5 * length * (mean - self.rest);
        self.rate = match width > 0.0 {
            true => (turned - self.turned) / width,
            false => 0.0,
        };
        let work = (self.half_impulse + half_impulse) * self.rate;
        (self.half_impulse, self.turned) = (half_impulse, turned);
        work
    }
}

impl Explicit {
    /// Power of the excess of `loads` over those at time 0, at the present velocities.
    pub(super) fn power(&self, loads: &Loads) -> f64 {
        match self.physics.loads_change() {
            true => self.excess(loads, |j, i| self.moving(j, i).0),
            false => 0.0,
        }
    }

    /// Present potential of the excess of loads and rest curvatures over those at time 0: it
    /// is in the energies, but does not come from the motion.
    pub(super) fn work_now(&self) -> f64 {
        let mut work = 0.0;
        if self.physics.loads_change() {
            let loads = self.physics.loads(self.time);
            work -= self.excess(&loads, |j, i| vector(&self.positions, self.layout.at(j, i)));
        }
        if self.physics.rest_changes() {
            let VaryingWork {
                rest: first,
                straightening,
                half_impulse,
                turned,
                rate,
                ..
            } = self.work;
            let rest = self.physics.rest(self.time);
            // The rate after the last kick is nearly that before it.
            work += half_impulse * rate;
            work += (first - rest) * turned;
            work += 0.5 * (rest * rest - first * first) * straightening;
        }
        work
    }

    /// Sum of the excess of `loads` over those at time 0, times vectors of the nodes.
    fn excess(&self, loads: &Loads, vectors: impl Fn(usize, usize) -> DVec3) -> f64 {
        let excess = *loads - self.work.loads;
        let mut sum = 0.0;
        for j in 0..self.layout.rods {
            for i in 0..=self.layout.segments {
                let (p, at) = self.layout.place(j, i);
                sum += self.packs[p].weight(at) * excess.gravity.dot(vectors(j, i));
            }
            if j == 0 || !self.leaf.leaf.joined() {
                sum += excess.tip_force.dot(vectors(j, self.layout.segments));
            }
        }
        sum
    }
}
