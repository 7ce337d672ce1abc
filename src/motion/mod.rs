//! Motion in time: what the explicit and the semi-implicit method share. This file has their interface
//! and clock, the energies of a moving leaf, whose balance tells whether the motion is reliable, and the
//! weights with which strains give their rate, for internal friction.

mod constraint_projection;
mod explicit;
mod moving_supports;
mod physics;
mod semi_implicit;

use crate::leaf::{DiscreteLeaf, HalfTurn, State};
pub use crate::motion::constraint_projection::project_constraints;
pub use crate::motion::explicit::{Explicit, ExplicitRefusal, StableStep};
pub use crate::motion::physics::{
    AssumedMotion, Inertia, MotionTimes, Physics, SegmentDrag, WindDrag,
};
pub use crate::motion::semi_implicit::{SemiImplicit, StepControl};
use crate::numbers::largest;
use crate::rod::RESOLVED_TURN;
use crate::run::Limit;
use glam::{BVec3, DVec3};

/// Angular and linear velocity of a node, along the lab axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Angular velocity.
    pub angular: DVec3,
    /// Velocity.
    pub linear: DVec3,
}

/// The displacement and the rotation vector of a node in a step, along the lab axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeMotionComponents {
    /// The rotation vector.
    pub rotation: DVec3,
    /// The displacement.
    pub displacement: DVec3,
}

/// The energies of a moving leaf. Dimensionless: in A/L.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Energy {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Elastic energy of the strains.
    pub elastic: f64,
    /// Energy of the coupling between rods.
    pub coupling: f64,
    /// Potential of the loads at their present values.
    pub potential: f64,
    /// Energy dissipated by damping since the start.
    pub dissipated: f64,
    /// Work done since the start by varying loads and rest shapes, by what has no potential, the moment on a
    /// tip and wind, by supports that move, and by masses that land.
    pub work: f64,
}

impl Energy {
    /// The conserved quantity: all energies minus the work.
    pub fn balance(&self) -> f64 {
        self.kinetic + self.elastic + self.coupling + self.potential + self.dissipated - self.work
    }

    /// The energy that has moved, present, dissipated or put in by loads, in a motion that began
    /// with this `potential`.
    pub(crate) fn exchanged_energy(&self, potential: f64) -> f64 {
        let there = self.kinetic + self.elastic + self.coupling + self.dissipated;
        there.max((self.potential - potential - self.work).abs())
    }

    /// Applies a function to all of them.
    pub fn map(self, change: impl Fn(f64) -> f64) -> Self {
        Energy {
            kinetic: change(self.kinetic),
            elastic: change(self.elastic),
            coupling: change(self.coupling),
            potential: change(self.potential),
            dissipated: change(self.dissipated),
            work: change(self.work),
        }
    }
}

/// A leaf at an instant.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time.
    pub time: f64,
    /// Positions, rotations and segment forces.
    pub state: State,
    /// Velocities of all nodes, as in the state.
    pub velocity: Vec<Velocity>,
    /// Energies.
    pub energy: Energy,
}

/// Why a motion ended early. Times are dimensionless as a [`TimeIntegrator`]
/// returns them, and in the scenario's unit in a simulation.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Stopped {
    /// Energy appeared without cause, or a value is not a number.
    #[error(
        "diverged at t = {time:.6e}: the energy grew {}, which is numerical instability; use a shorter step, or {otherwise}",
        match .percent.is_finite() {
            true => format!("by {percent:.0} % of all that moved"),
            false => "without bound".into(),
        }
    )]
    Diverged {
        /// Time.
        time: f64,
        /// Energy gained, in percent of the largest energy that moved.
        percent: f64,
        /// Further advice.
        otherwise: &'static str,
    },
    /// The grid is too coarse.
    #[error(
        "at t = {time:.6e} a segment is bent by {turn:.2} rad, more than it can resolve; use more segments than {segments}"
    )]
    Unresolved {
        /// Time.
        time: f64,
        /// Bending of the segment, radians.
        turn: f64,
        /// Segments per rod.
        segments: usize,
    },
    /// Sections of neighboring veins passed half a turn against each other.
    #[error("at t = {time:.6e} {}; the motion cannot be followed beyond: end it before", half_turn.sentence())]
    HalfTurn {
        /// Time.
        time: f64,
        /// Where.
        half_turn: HalfTurn,
    },
    /// No time step is short enough.
    #[error("at t = {time:.6e} no time step is short enough to go on; {advice}")]
    StepTooShort {
        /// Time.
        time: f64,
        /// Advice.
        advice: &'static str,
    },
    /// The limit of the run was reached, e.g. by Ctrl-C.
    #[error("interrupted at t = {time:.6e}")]
    Interrupted {
        /// Time.
        time: f64,
    },
}

impl Stopped {
    /// The word used in `motion.json`.
    pub fn word(self) -> &'static str {
        match self {
            Stopped::Diverged { .. } => "diverged",
            Stopped::Unresolved { .. } => "unresolved",
            Stopped::HalfTurn { .. } => "half-turn",
            Stopped::StepTooShort { .. } => "step-too-short",
            Stopped::Interrupted { .. } => "interrupted",
        }
    }

    /// This reason with its time in another unit, of which the present unit is `unit`.
    pub fn in_unit(mut self, unit: f64) -> Self {
        match &mut self {
            Stopped::Diverged { time, .. }
            | Stopped::Unresolved { time, .. }
            | Stopped::HalfTurn { time, .. }
            | Stopped::StepTooShort { time, .. }
            | Stopped::Interrupted { time } => *time *= unit,
        }
        self
    }
}

/// A mass that has landed. Dimensionless.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Number of the point on which it landed.
    pub point: usize,
    /// When it landed.
    pub time: f64,
    /// The kinetic energy of the mass before it landed.
    pub kinetic_energy: f64,
    /// The energy that was lost: of the mass and of the point, with one velocity afterwards.
    pub lost_energy: f64,
}

/// Differences of time below this part of a step are rounding.
const TIME_ROUNDING_FRACTION: f64 = 1e-9;

/// How far a motion is, and when it ends early.
#[derive(Clone, Debug, Default)]
pub struct MotionClock {
    /// Present time.
    time: f64,
    /// Number of time steps.
    steps: usize,
    limit: Limit,
    /// The masses that have landed so far.
    impacts: Vec<Impact>,
}

impl MotionClock {
    /// Fails if the limit of the run is reached.
    fn check_limit(&self) -> Result<(), Stopped> {
        match self.limit.reached() {
            true => Err(Stopped::Interrupted { time: self.time }),
            false => Ok(()),
        }
    }
}

/// A method that integrates the motion of a leaf. Dimensionless throughout.
pub trait TimeIntegrator {
    /// The clock of the motion.
    fn clock(&self) -> &MotionClock;

    /// The clock of the motion, to be set.
    fn clock_mut(&mut self) -> &mut MotionClock;

    /// Present time.
    fn time(&self) -> f64 {
        self.clock().time
    }

    /// Number of time steps.
    fn steps(&self) -> usize {
        self.clock().steps
    }

    /// The masses that have landed so far.
    fn impacts(&self) -> &[Impact] {
        &self.clock().impacts
    }

    /// Bounds the steps from now on, of a method whose error determines them: the steps of a
    /// finer run that is compared with a coarser one are shorter everywhere, also where the times
    /// asked for limit both.
    fn limit_steps(&mut self, _longest: f64) {}

    /// The longest step since this was asked last, of a method whose error determines its steps.
    fn take_longest_step(&mut self) -> f64 {
        f64::INFINITY
    }

    /// The sum of the local errors (lengths, radians) of the steps since this was asked last, of a method whose
    /// error determines its steps.
    fn take_local_errors(&mut self) -> f64 {
        f64::INFINITY
    }

    /// Sets the permitted local error of a step, before the first, of a method whose error determines its steps.
    fn set_local_error(&mut self, _error: f64) {}

    /// Ends the motion at the first step behind a limit.
    fn set_limit(&mut self, limit: Limit) {
        self.clock_mut().limit = limit;
    }

    /// Advances to exactly `until`; returns the state there, in which the motion is reliable.
    fn advance(&mut self, until: f64) -> Result<Snapshot, Stopped>;

    /// The present state, with positions and velocities at the same instant.
    fn snapshot(&mut self) -> Snapshot;
}

/// When the energy of a motion counts as growing without cause.
struct EnergyGrowthLimits {
    /// Largest energy that may appear, as a part of the largest energy that moved. Unbounded growth
    /// soon exceeds any such limit: doubled, it is found a few steps later.
    imbalance: f64,
    /// Energy, in units of A/L, that may be due to rounding.
    rounding: f64,
}

const ENERGY_GROWTH: EnergyGrowthLimits = EnergyGrowthLimits {
    imbalance: 0.5,
    rounding: 1e-12,
};

/// Energies at an instant, without what was dissipated and put in before. Sets the loads and
/// the rest shape of `leaf` to those of that time.
pub fn measure(
    leaf: &mut DiscreteLeaf,
    physics: &Physics,
    time: f64,
    state: &State,
    velocity: &[Velocity],
) -> Energy {
    physics.apply_loads(leaf, time);
    if physics.rest_curvature_differs() {
        leaf.scale_rest_curvatures(physics.rest_curvature_factor(time));
    }
    let n = leaf.segments();
    let mut energy = Energy::default();
    for (j, i) in leaf.rod_index_pairs(0..=n) {
        let (k, inertia) = (state.base(j) + i, physics.inertia(leaf, j, i));
        let Velocity { angular, linear } = velocity[k];
        energy.kinetic += inertia.kinetic_energy(state.q[k], [angular, linear]);
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
    for (j, i) in leaf.rod_index_pairs(0..=n) {
        let inertia = physics.inertia(leaf, j, i);
        let weight = leaf.grid.node_weight(i) * leaf.leaf.length(j);
        energy += (weight * loads.gravity).length_squared() / inertia.mass;
        if i == n {
            energy += loads.tip_force.length_squared() / inertia.mass;
        }
    }
    for it in leaf
        .scheduled_loads
        .iter()
        .flat_map(|it| it.present_forces())
    {
        energy += it.force.length_squared() / physics.inertia(leaf, it.rod, it.node).mass;
    }
    for it in leaf
        .scheduled_loads
        .iter()
        .flat_map(|it| it.present_followers())
    {
        let inertia = physics.inertia(leaf, it.rod, it.node);
        let moment = it.load.moment + it.load.dead_moment;
        energy += it.load.force.length_squared() / inertia.mass;
        energy += moment.length_squared() / inertia.principal.min_element();
    }
    for it in leaf.dead_moments_under(loads) {
        let inertia = physics.inertia(leaf, 0, it.node);
        energy += it.moment.length_squared() / inertia.principal.min_element();
    }
    0.5 * h * h * energy
}

/// Fails if the grid cannot resolve a segment bent by `turn`.
pub fn check_resolution(leaf: &DiscreteLeaf, time: f64, turn: f64) -> Result<(), Stopped> {
    match turn <= RESOLVED_TURN {
        true => Ok(()),
        false => Err(Stopped::Unresolved {
            time,
            turn,
            segments: leaf.segments(),
        }),
    }
}

/// Energy that a motion exchanged with what is around it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Exchange {
    /// Energy dissipated.
    pub dissipated: f64,
    /// Energy put in.
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
    /// Balance and potential at the start.
    balance: f64,
    potential: f64,
    /// The largest energy that moved so far.
    largest_exchanged_energy: f64,
}

impl EnergyBalance {
    /// Begins with the energies of `start`.
    pub fn begin(&mut self, start: &Snapshot) {
        self.balance = start.energy.balance();
        self.potential = start.energy.potential;
        self.largest_exchanged_energy = start.energy.exchanged_energy(self.potential);
    }

    /// Adds what a step exchanged.
    pub fn add(&mut self, exchange: Exchange) {
        self.exchanged += exchange;
    }

    /// The present energy, with what was exchanged so far and `since`.
    pub fn present_energy(&self, energy: Energy, since: Exchange) -> Energy {
        Energy {
            dissipated: self.exchanged.dissipated + since.dissipated,
            work: self.exchanged.work + since.work,
            ..energy
        }
    }

    /// Checks that the motion of the leaf, in steps of `h`, is reliable; if it is not,
    /// `otherwise` is advice besides a shorter step.
    pub fn check_reliability(
        &mut self,
        leaf: &DiscreteLeaf,
        physics: &Physics,
        now: &Snapshot,
        h: f64,
        otherwise: &'static str,
    ) -> Result<(), Stopped> {
        let time = now.time;
        self.largest_exchanged_energy = self
            .largest_exchanged_energy
            .max(now.energy.exchanged_energy(self.potential));
        // The method's own damping may reduce energy, but nothing may increase it.
        let gain = now.energy.balance() - self.balance;
        let unresolved = unresolved_energy(leaf, physics, time, h);
        let imbalance =
            gain / (self.largest_exchanged_energy + unresolved + ENERGY_GROWTH.rounding);
        if !imbalance.is_finite() || imbalance > ENERGY_GROWTH.imbalance {
            return Err(Stopped::Diverged {
                time,
                percent: 100.0 * imbalance,
                otherwise,
            });
        }
        let turn = |(j, i)| leaf.segment(&now.state, j, i, DVec3::ZERO).end_rotation();
        let turns = leaf.rod_index_pairs(0..leaf.segments()).map(turn);
        check_resolution(leaf, time, largest(turns))
    }
}

/// A mass that meets a node which is free, or held.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Collision {
    /// The landing mass and its velocity.
    pub mass: f64,
    pub velocity: DVec3,
    /// The mass and the velocity of the node: of all tips together, if they are one.
    pub node_mass: f64,
    pub node_velocity: DVec3,
    /// The lab axes along which the node moves freely.
    pub free: BVec3,
}

impl Collision {
    /// The velocity of both afterwards: their momentum is kept, unless a holder takes it.
    pub fn common_velocity(&self) -> DVec3 {
        let momentum = self.node_mass * self.node_velocity + self.mass * self.velocity;
        let common = momentum / (self.node_mass + self.mass);
        DVec3::select(self.free, common, self.node_velocity)
    }

    /// The energy that is put in by the mass and by the impulse of a holder, and that which is lost.
    pub fn exchange(&self) -> Exchange {
        let apart = self.velocity - self.node_velocity;
        let joined_mass = self.mass * self.node_mass / (self.mass + self.node_mass);
        let lost = DVec3::select(
            self.free,
            DVec3::splat(joined_mass),
            DVec3::splat(self.mass),
        );
        let held = DVec3::select(self.free, DVec3::ZERO, DVec3::splat(self.mass));
        Exchange {
            dissipated: 0.5 * (lost * apart).dot(apart),
            work: 0.5 * self.mass * self.velocity.length_squared()
                - (held * apart).dot(self.node_velocity),
        }
    }
}

/// A step shorter than this part of the next one makes the rate inaccurate.
const MIN_STEP_RATIO: f64 = 0.25;

/// Weights of a value and the two before it for its present rate of change, the
/// last step being `last` long and the one before `before`: the backward
/// difference of second order; of first order if that step was too short
/// or missing (zero); all zero if there was no step.
pub fn rate_weights(last: f64, before: f64) -> [f64; 3] {
    if last == 0.0 {
        return [0.0; 3];
    }
    if before < MIN_STEP_RATIO * last {
        return [1.0 / last, -1.0 / last, 0.0];
    }
    let r = last / before;
    [(1.0 + 2.0 * r) / (1.0 + r), -(1.0 + r), r * r / (1.0 + r)].map(|weight| weight / last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parabolas_are_differentiated_exactly() {
        let value = |t: f64| 0.3 - 1.7 * t + 2.9 * t * t;
        let rate = |t: f64| -1.7 + 5.8 * t;
        for (last, before) in [(0.1, 0.1), (0.1, 0.3), (0.3, 0.1), (1e-3, 1.0)] {
            let t = 0.7;
            let values = [value(t), value(t - last), value(t - last - before)];
            let weights = rate_weights(last, before);
            let found: f64 = values.iter().zip(weights).map(|(v, w)| v * w).sum();
            assert!((found - rate(t)).abs() < 1e-11, "{last}, {before}: {found}");
        }
    }

    #[test]
    fn straight_lines_where_less_is_known() {
        for before in [0.0, 1e-9, 0.024] {
            assert_eq!(rate_weights(0.1, before), [10.0, -10.0, 0.0]);
        }
        assert_eq!(rate_weights(0.0, 0.0), [0.0; 3]);
    }
}
