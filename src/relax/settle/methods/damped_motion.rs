//! The damped motion of the semi-implicit method: its velocities, and the choice of the next
//! time step by the energy.

use crate::leaf::{DiscreteLeaf, Increment, System};

/// Damping c: critical for the lowest bending mode of a single rod, whose
/// frequency is 3.516 (canonical value beta_1^2 of the clamped-free beam).
const DAMPING: f64 = 2.0 * 3.516;

/// First finite time step, after a Newton step has failed: a thirtieth of that mode's period.
const FIRST_STEP: f64 = 0.06;

/// Shortest time step; a leaf that needs a shorter one is not settling.
const SHORTEST_STEP: f64 = 1e-7;

/// Beyond this time step inertia is negligible: the step becomes Newton's.
const LONGEST_STEP: f64 = 1e3;

/// Largest growth factor of the time step.
const MAX_GROWTH: f64 = 4.0;

/// Smallest part of a Newton step near rest that is tried if the whole step raises the energy.
const SMALLEST_PART: f64 = 1e-3;

/// Relative growth of the energy that is attributed to rounding.
const ENERGY_SLACK: f64 = 1e-9;

/// Velocities, and the time step; an infinite time step is Newton's method.
pub(in crate::relax::settle::methods) struct Motion {
    dt: f64,
    /// Growth factor of the time step after an accepted step.
    growth: f64,
    pub(in crate::relax::settle::methods) velocity: Vec<Vec<Increment>>,
    next_velocity: Vec<Vec<Increment>>,
    /// Size of the last step if it was one of Newton's method.
    pub(in crate::relax::settle::methods) newton: f64,
    /// The part of Newton's step that the energy allows near rest: close to a bifurcation the
    /// whole step may leave a curved valley.
    newton_part: f64,
    /// Whether it was at a possible saddle, or at rest, before the next step of Newton's method.
    pub(in crate::relax::settle::methods) resting: bool,
}

impl Motion {
    /// At rest, with the longest step.
    pub(in crate::relax::settle::methods) fn new(leaf: &DiscreteLeaf) -> Self {
        let velocity = vec![vec![[0.0; 6]; leaf.moving_nodes().len()]; leaf.rods()];
        Motion {
            dt: f64::INFINITY,
            growth: MAX_GROWTH,
            next_velocity: velocity.clone(),
            velocity,
            newton: f64::INFINITY,
            newton_part: 1.0,
            resting: false,
        }
    }

    pub(in crate::relax::settle::methods) fn is_newton(&self) -> bool {
        self.dt.is_infinite()
    }

    /// Factors (1/dt + c)/dt on the mass in the matrix of the next step, and 1/dt on the momenta;
    /// `None` if it is Newton's.
    pub(in crate::relax::settle::methods) fn inertia(&self) -> Option<[f64; 2]> {
        let dt = self.dt;
        (!self.is_newton()).then_some([(1.0 / dt + DAMPING) / dt, 1.0 / dt])
    }

    /// The longest part of the next step that may be taken.
    pub(in crate::relax::settle::methods) fn longest_part(&self) -> f64 {
        if self.is_newton() {
            self.newton_part
        } else {
            1.0
        }
    }

    /// Shortens a step that raises the energy: near rest a part of Newton's step is taken,
    /// otherwise a shorter time step. False if there is none.
    pub(in crate::relax::settle::methods) fn shorten(&mut self) -> bool {
        let near_rest = self.is_newton() && (self.resting || self.newton_part < 1.0);
        if near_rest && self.newton_part > SMALLEST_PART {
            self.newton_part /= 2.0;
            return true;
        }
        self.shorten_in_time()
    }

    /// Shortens the time step; false if it falls below [`SHORTEST_STEP`].
    pub(in crate::relax::settle::methods) fn shorten_in_time(&mut self) -> bool {
        self.dt = match self.dt.is_finite() {
            true => self.dt / 4.0,
            false => FIRST_STEP,
        };
        self.growth = 1.0;
        self.dt >= SHORTEST_STEP
    }

    /// Whether the total energy does not grow in a step, of which the fraction `part` is
    /// taken, with these potential energies before and after it.
    pub(in crate::relax::settle::methods) fn energy_does_not_grow(
        &mut self,
        system: &System,
        part: f64,
        potential: [f64; 2],
    ) -> bool {
        let [mut energy, mut next_energy] = potential;
        if !self.is_newton() {
            energy += system.kinetic_energy(&self.velocity);
            system.velocity(part, self.dt, &mut self.next_velocity);
            next_energy += system.kinetic_energy(&self.next_velocity);
        }
        let slack = ENERGY_SLACK * (1.0 + energy.abs());
        next_energy.is_finite() && next_energy <= energy + slack
    }

    /// Updates velocity and time step after an accepted step. At a possible saddle the next
    /// step is Newton's, without inertia or damping: it leaves the saddle, or shows that the
    /// leaf is at rest.
    pub(in crate::relax::settle::methods) fn accept(&mut self, at_saddle: bool, part: f64) {
        std::mem::swap(&mut self.velocity, &mut self.next_velocity);
        self.resting |= at_saddle;
        if at_saddle {
            self.dt = f64::INFINITY;
        } else if part == 1.0 {
            // The factor doubles up to the largest.
            self.dt *= self.growth;
            self.growth = (2.0 * self.growth).min(MAX_GROWTH);
            if self.dt > LONGEST_STEP {
                self.dt = f64::INFINITY;
            }
        }
    }

    /// After an accepted step of Newton's method.
    pub(in crate::relax::settle::methods) fn accept_newton(&mut self) {
        self.resting = false;
        self.newton_part = (2.0 * self.newton_part).min(1.0);
    }
}
