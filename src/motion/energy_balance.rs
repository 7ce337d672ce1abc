//! The energy of a moving leaf, and whether the motion is reliable.

use super::method::{Energy, Snapshot, Stopped, Velocity};
use super::physics::Physics;
use crate::largest::largest;
use crate::leaf::{DiscreteLeaf, State};
use crate::rod::RESOLVED_TURN;
use glam::DVec3;

/// Largest energy that may appear without cause, as a part of the largest energy that moved.
/// Unbounded growth soon exceeds any such limit.
const LARGEST_IMBALANCE: f64 = 0.5;

/// Energy, in units of A/L, that may be due to rounding.
const ROUNDING: f64 = 1e-12;

/// Energies at an instant, without what was dissipated and put in before. Sets the loads and
/// the rest shape of `leaf` to those of that time.
pub fn measure(
    leaf: &mut DiscreteLeaf,
    physics: &Physics,
    time: f64,
    state: &State,
    velocity: &[Velocity],
) -> Energy {
    leaf.loads = physics.loads(time);
    if physics.rest_differs() {
        leaf.set_rest(physics.rest(time));
    }
    let n = leaf.segments();
    let mut energy = Energy::default();
    for (j, i) in leaf.each(0..=n) {
        let (k, inertia) = (state.base(j) + i, physics.inertia(leaf, j, i));
        let Velocity { angular, linear } = velocity[k];
        let spin = angular.dot(state.q[k] * DVec3::X);
        let turning = angular.length_squared() + inertia.excess * spin * spin;
        energy.kinetic += 0.5 * inertia.mass * linear.length_squared();
        energy.kinetic += 0.5 * inertia.transverse * turning;
        let potential = leaf.load(state, j, i).energy;
        let stretch = leaf.coupling_energy(state, j, i);
        energy.coupling += stretch;
        energy.potential += potential - stretch;
        if i < n {
            // From the strains: the force may include friction.
            let strained = leaf.strained_segment(state, j, i);
            energy.elastic += leaf.section(j, i).elastic_energy(&strained);
        }
    }
    energy
}

/// The energy that the loads, if they were applied at once, would give a leaf at
/// rest in a step of `h`: for loads that change faster than steps resolve, the energy is not
/// known more accurately than this.
fn unresolved_energy(leaf: &DiscreteLeaf, physics: &Physics, time: f64, h: f64) -> f64 {
    let loads = physics.loads(time);
    let n = leaf.segments();
    let mut energy = 0.0;
    for (j, i) in leaf.each(0..=n) {
        let inertia = physics.inertia(leaf, j, i);
        let weight = leaf.grid.weight(i) * leaf.leaf.length(j);
        energy += (weight * loads.gravity).length_squared() / inertia.mass;
        if i == n {
            energy += loads.tip_force.length_squared() / inertia.mass;
        }
    }
    for (node, moment) in leaf.moments_of(loads) {
        energy += moment.length_squared() / physics.inertia(leaf, 0, node).transverse;
    }
    0.5 * h * h * energy
}

/// Fails if the grid cannot resolve a segment bent by `turn`.
pub fn resolved(leaf: &DiscreteLeaf, time: f64, turn: f64) -> Result<(), Stopped> {
    match turn <= RESOLVED_TURN {
        true => Ok(()),
        false => Err(Stopped::Unresolved {
            time,
            turn,
            segments: leaf.segments(),
        }),
    }
}

/// Energy dissipated and put in.
#[derive(Clone, Copy, Debug, Default)]
pub struct Exchange {
    pub dissipated: f64,
    pub work: f64,
}

impl std::ops::AddAssign for Exchange {
    fn add_assign(&mut self, other: Exchange) {
        self.dissipated += other.dissipated;
        self.work += other.work;
    }
}

/// The energy exchanged, and the initial balance.
#[derive(Clone, Debug, Default)]
pub struct EnergyBalance {
    exchanged: Exchange,
    balance: f64,
    potential: f64,
    /// The largest energy that moved so far.
    largest: f64,
}

impl EnergyBalance {
    pub fn begin(&mut self, start: &Snapshot) {
        self.balance = start.energy.balance();
        self.potential = start.energy.potential;
        self.largest = start.energy.moved(self.potential);
    }

    pub fn add(&mut self, exchange: Exchange) {
        self.exchanged += exchange;
    }

    /// The present energy, with what was exchanged so far and `since`.
    pub fn complete(&self, energy: Energy, since: Exchange) -> Energy {
        Energy {
            dissipated: self.exchanged.dissipated + since.dissipated,
            work: self.exchanged.work + since.work,
            ..energy
        }
    }

    /// Checks that the motion of the leaf, in steps of `h`, is reliable; if it is not,
    /// `otherwise` is advice besides a shorter step.
    pub fn judge(
        &mut self,
        leaf: &DiscreteLeaf,
        physics: &Physics,
        now: &Snapshot,
        h: f64,
        otherwise: &'static str,
    ) -> Result<(), Stopped> {
        let time = now.time;
        self.largest = self.largest.max(now.energy.moved(self.potential));
        // The method's own damping may reduce energy, but nothing may increase it.
        let gain = now.energy.balance() - self.balance;
        let unresolved = unresolved_energy(leaf, physics, time, h);
        let imbalance = gain / (self.largest + unresolved + ROUNDING);
        if !imbalance.is_finite() || imbalance > LARGEST_IMBALANCE {
            return Err(Stopped::Diverged {
                time,
                percent: 100.0 * imbalance,
                otherwise,
            });
        }
        let turn = |(j, i)| leaf.segment(&now.state, j, i, DVec3::ZERO).turn();
        let turns = leaf.each(0..leaf.segments()).map(turn);
        resolved(leaf, time, largest(turns))
    }
}
