//! Conditions at the bases, which clamps or hinges hold.

use glam::DVec3;

use crate::shooting::equations::Equations;
use crate::shooting::state::RodState;

impl Equations<'_> {
    /// The first of the six components of a rod's perturbation that are free at its base: of the force
    /// and the moment at a clamp, of the rotation and the force at a hinge.
    pub fn free_at_base(&self) -> usize {
        match self.hinged {
            true => 3,
            false => 6,
        }
    }

    /// The state at the base nearest to a given one: a hinge carries no moment.
    pub fn held_base(&self, j: usize, rod: &RodState) -> RodState {
        let clamped = self.base(j, rod.n, rod.m);
        match self.hinged {
            true => RodState {
                q: rod.q,
                m: DVec3::ZERO,
                ..clamped
            },
            false => clamped,
        }
    }

    /// The state at the base for given forces and moments: conditions (a) and (c).
    pub fn base(&self, j: usize, n: DVec3, m: DVec3) -> RodState {
        let (position, q) = self.scenario.base(j);
        RodState {
            r: position / self.length,
            q,
            n,
            m,
        }
    }

    /// A flat state at the base without stress.
    pub fn clamped(&self) -> Vec<f64> {
        let mut y = vec![0.0; self.size()];
        for j in 0..self.rods() {
            self.base(j, DVec3::ZERO, DVec3::ZERO).write(&mut y, j);
        }
        y
    }
}
