//! Loads that veins have of their own: weights, loads along them, and on points.

use glam::DVec3;

use crate::shooting::equations::{Equations, SAME_PLACE};
use crate::shooting::state::{RodState, STATE};

impl Equations<'_> {
    /// Load of rod `j` alone, per length: its weight besides the common one, and what is
    /// distributed along it.
    pub(in crate::shooting) fn own_load(&self, j: usize, sigma: f64) -> DVec3 {
        if !self.own_loads {
            return DVec3::ZERO;
        }
        let s = self.scenario;
        let weight = DVec3::from_array(s.weight(j).at(sigma)) - DVec3::from_array(s.gravity);
        let along = s.distributed.as_ref().map_or(DVec3::ZERO, |loads| {
            DVec3::from_array(loads[j].each_ref().map(|load| load.at(sigma)))
        });
        (weight + along) * (self.length / self.force)
    }

    /// Passes the loads on points at `sigma`, by which forces and moments jump, on the way to the tip; false if
    /// there are none.
    pub fn pass_points(&self, sigma: f64, y: &mut [f64]) -> bool {
        let mut any = false;
        for (j, [force, moment]) in self.on_points(sigma) {
            let mut rod = RodState::read(y, j);
            rod.n -= force;
            rod.m -= moment;
            y[STATE * self.rods()] -= force.dot(rod.r);
            rod.write(y, j);
            any = true;
        }
        any
    }

    /// Rods, forces and moments of the loads on points at `sigma`.
    pub(in crate::shooting) fn on_points(
        &self,
        sigma: f64,
    ) -> impl Iterator<Item = (usize, [DVec3; 2])> {
        let points = self
            .scenario
            .points
            .iter()
            .filter(move |point| (point.at - sigma).abs() < SAME_PLACE);
        let unit = self.part / self.force;
        let units = [unit, unit / self.length];
        points.map(move |point| {
            let [force, moment] = [self.scenario.force_on(point), point.moment];
            let loads = [0, 1].map(|k| units[k] * DVec3::from_array([force, moment][k]));
            (point.vein, loads)
        })
    }

    /// The force and the moment on the tip of rod `j` by loads on points.
    pub(in crate::shooting) fn on_tip(&self, j: usize) -> [DVec3; 2] {
        let here = self.on_points(1.0).filter(|(rod, _)| *rod == j);
        here.fold([DVec3::ZERO; 2], |sum, (_, [force, moment])| {
            [sum[0] + force, sum[1] + moment]
        })
    }
}
