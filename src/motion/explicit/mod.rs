//! The explicit method: leapfrog for positions and angular momenta.
//!
//! Forces at the nodes' positions advance velocities from half a step before to
//! half a step after (kick); with these, positions and rotations advance without forces for
//! one step (drift). A node of a round section is a body with one axis of symmetry,
//! whose free rotation is known in closed form. The method is of second order
//! and symplectic, and conserves momentum and angular momentum to rounding, since
//! the forces of a segment derive from an energy that is invariant under rigid
//! motions. External damping, and loads and rest curvatures that vary in time, enter by their
//! mean over the kick: the impulse of a load is exact, however short it is.
//!
//! It is stable up to a time step of 2/omega for the highest frequency omega,
//! which is at most that of a single segment ([`Explicit::stable_step`]), as
//! long as the step is constant: steps that alternate between one length
//! and half of it are unstable from less than 0.9 of that bound on. Therefore all
//! steps have the same length, and a time between two of
//! them is reached by a shorter step from the earlier one, off the path, to
//! which the motion returns. The path does not depend on the times asked for.

mod advance;
mod applied;
mod fictitious;
mod kernel;
mod moments;
mod packs;
mod stable;
#[cfg(test)]
mod tests;
mod work;

pub use stable::StableStep;

use self::applied::Applied;
use super::energy_balance::{EnergyBalance, Exchange};
use super::friction::rates;
use super::method::TimeIntegrator;
use super::physics::Physics;
use crate::lanes::widest_arch;
use crate::largest::largest;
use crate::leaf::{DiscreteLeaf, Loads, State};
use crate::limit::Limit;
use crate::rod::RESOLVED_TURN;
use glam::{DQuat, DVec3};
use kernel::{Array, Block, Law, Layout, Step};
use moments::Moments;
use packs::{Pack, vector};
use pulp::Arch;
use rayon::prelude::*;
use work::VaryingWork;

/// Part of the stable time step used.
const SAFETY: f64 = 0.9;

/// Steps between normalisations of the quaternions.
const NORMALISED: usize = 8;

/// Number of segments from which rods are distributed to threads. Measured: below
/// it waking the threads costs more than it saves.
const PARALLEL_SEGMENTS: usize = 3000;

/// Number of rods that are not divided further: about two portions for every thread.
fn packs_per_task(rods: usize) -> usize {
    (rods / (2 * rayon::current_num_threads())).max(1)
}

/// A leaf in explicit motion.
pub struct Explicit {
    leaf: DiscreteLeaf,
    physics: Physics,
    arch: Arch,
    layout: Layout,
    positions: [Array; 3],
    /// Positions after the next step.
    next: [Array; 3],
    packs: Vec<Pack>,
    block: Block,
    /// What acts on the nodes besides segments, coupling and loads, if anything does.
    applied: Option<Applied>,
    /// The dead moments of a step.
    moments: Moments,
    /// Mass of the shared tip, if there is one.
    tip_mass: Option<f64>,
    /// Length of rods whose loads act on it.
    tip_weight: f64,
    step: f64,
    /// Time of the last step, and the time asked for, less than a step later.
    stepped: f64,
    time: f64,
    steps: usize,
    /// Time and number of steps at the beginning of steps of the present length.
    begin: (f64, usize),
    /// Widths of the last step and of the one before; zero if there was none.
    widths: [f64; 2],
    balance: EnergyBalance,
    work: VaryingWork,
    parallel: bool,
    limit: Limit,
}

/// A rigid rod, whose stiffness the method cannot handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rigid;

impl Explicit {
    /// A leaf at rest in `state`. Time steps are nine tenths of the stable one,
    /// or `step` if that is given, stable or not.
    ///
    /// # Errors
    /// If a rod is rigid: its waves are infinitely fast.
    pub fn new(
        leaf: DiscreteLeaf,
        physics: Physics,
        state: &State,
        step: Option<f64>,
    ) -> Result<Self, Rigid> {
        if leaf.least_compliance() == 0.0 {
            return Err(Rigid);
        }
        let (count, joined, last) = (leaf.rods(), leaf.tips_move_together(), leaf.segments());
        let tip_mass = |j| physics.inertia(&leaf, j, last).mass;
        let tip_weight = |j| leaf.grid.weight(last) * leaf.leaf.length(j);
        let layout = packs::layout(&leaf);
        let positions = packs::positions(&leaf, state, layout);
        let mut explicit = Explicit {
            arch: widest_arch(),
            packs: packs::at_rest(&leaf, &physics, state, layout),
            next: positions.clone(),
            positions,
            layout,
            applied: Applied::new(&leaf, &physics, state, layout),
            moments: Moments::default(),
            block: Block::new(),
            tip_mass: joined.then(|| (0..count).map(tip_mass).sum()),
            tip_weight: (0..count).map(tip_weight).sum(),
            step: 0.0,
            stepped: 0.0,
            time: 0.0,
            steps: 0,
            begin: (0.0, 0),
            widths: [0.0; 2],
            balance: EnergyBalance::default(),
            work: VaryingWork::new(&leaf, &physics),
            parallel: layout.packs() > 1
                && count * leaf.segments() >= PARALLEL_SEGMENTS
                && rayon::current_num_threads() > 1,
            limit: Limit::default(),
            leaf,
            physics,
        };
        explicit.step = step.unwrap_or_else(|| SAFETY * explicit.stable_step().step);
        let start = explicit.snapshot();
        explicit.balance.begin(&start);
        Ok(explicit)
    }

    /// The longest stable time step of the leaf in its present state.
    pub fn stable_step(&self) -> StableStep {
        let mut leaf = self.leaf.clone();
        if self.physics.rest_differs() {
            leaf.set_rest(self.physics.rest(self.stepped));
        }
        StableStep::of(&leaf, &self.physics, &self.state())
    }

    /// The length of time steps.
    pub fn longest_step(&self) -> f64 {
        self.step
    }

    /// Replaces the masses of the nodes by fictitious ones, for relaxation only: the
    /// fastest motions of all segments have equal frequencies. Time steps may then be as long
    /// as one, and the leaf is stopped.
    pub fn use_fictitious_masses(&mut self) {
        let tip = fictitious::masses(&self.leaf, &self.physics, self.layout, &mut self.packs);
        self.tip_mass = self.tip_mass.map(|_| tip);
        self.stop();
    }

    /// Sets all velocities to zero.
    pub fn stop(&mut self) {
        for pack in &mut self.packs {
            for array in pack.motion.v.iter_mut().chain(&mut pack.motion.p) {
                array.fill(0.0);
            }
        }
        self.widths = [0.0; 2];
    }

    /// Sets the decay rate of all velocities from now on.
    pub fn set_damping(&mut self, rate: f64) {
        self.physics.damping = rate;
    }

    /// One time step of any length; returns twice the kinetic energy at its
    /// beginning.
    pub fn step(&mut self, h: f64) -> f64 {
        let (exchange, energy) = self.kick_and_drift(h);
        self.balance.add(exchange);
        self.steps += 1;
        self.begin = (self.stepped, self.steps);
        self.time = self.stepped;
        energy
    }

    fn rotation(&self, j: usize, i: usize) -> DQuat {
        let (p, at) = self.layout.place(j, i);
        self.packs[p].rotation(at)
    }

    /// Velocity and angular momentum of a node.
    fn moving(&self, j: usize, i: usize) -> (DVec3, DVec3) {
        let (p, at) = self.layout.place(j, i);
        self.packs[p].moving(at)
    }

    /// The largest rotation between the ends of a segment, up to
    /// 2 pi, since signs of quaternions are aligned.
    fn largest_turn(&self) -> f64 {
        let deltas = (0..self.layout.rods).flat_map(|j| {
            let (p, base) = self.layout.place(j, 0);
            let pack = &self.packs[p];
            (base..base + self.layout.segments)
                .map(|at| (pack.quaternion(at + 1) - pack.quaternion(at)).length_squared())
        });
        4.0 * (0.5 * largest(deltas).sqrt()).min(1.0).asin()
    }

    /// Whether numbers are finite and bending is resolved.
    fn trusted(&self) -> bool {
        let finite = |pack: &Pack| pack.totals.twice_kinetic.is_finite();
        self.largest_turn() <= RESOLVED_TURN && self.packs.iter().all(finite)
    }

    fn kick_and_drift(&mut self, h: f64) -> (Exchange, f64) {
        let exchange = self.kick(0.5 * h, h, true);
        self.widths = [h, self.widths[0]];
        self.stepped += h;
        exchange
    }

    /// Time by which velocities lag behind positions: half a step, but zero at the start.
    fn lag(&self) -> f64 {
        0.5 * self.widths[0]
    }

    /// Advances velocities, by the forces at the present positions, to the time
    /// `ahead` of these, and positions by the time `drift`.
    /// Strains are stored as those of the last step if `remember`. Also returns
    /// twice the kinetic energy in the middle of the kick.
    fn kick(&mut self, ahead: f64, drift: f64, remember: bool) -> (Exchange, f64) {
        let length = self.lag() + ahead;
        let [from, to] = [self.stepped - self.lag(), self.stepped + ahead];
        let loads = self.physics.mean_loads([from, to]);
        let rest = self.physics.mean_rest([from, to]);
        let before_kick = self.power(&loads);
        let mut work = 0.0;
        let last = self.leaf.segments();
        let before = self.moving(0, last).0;
        (self.moments).begin(self.leaf.moments_of(loads), self.layout, &self.packs);
        if let Some(applied) = &mut self.applied {
            let [last, before] = self.widths;
            let ahead = if last > 0.0 {
                last / (last + before)
            } else {
                0.0
            };
            let air = (self.physics.mean_air([from, to]), ahead);
            applied.update(&self.leaf, (self.layout, &self.positions), &self.packs, air);
        }
        let decay = 0.5 * self.physics.damping * length;
        let (keep, kick) = ((1.0 - decay) / (1.0 + decay), length / (1.0 + decay));
        self.step_packs(&loads, self.law(rest, remember), keep, kick, drift);
        let (mut energy, mut friction, mut bent) = (0.0, 0.0, 0.0);
        for pack in &self.packs {
            energy += pack.totals.twice_kinetic;
            friction += self.physics.retardation * pack.totals.friction;
            bent += pack.totals.rest;
        }
        if let Some(mass) = self.tip_mass {
            let mut force = loads.tip_force + self.tip_weight * loads.gravity;
            for pack in &self.packs {
                force -= DVec3::from(pack.totals.last_force);
            }
            if let Some(applied) = &self.applied {
                force += applied.on_tips(self.layout);
            }
            let after = keep * before + force * (kick / mass);
            energy += mass * (0.5 * (before + after)).length_squared();
            let tip = vector(&self.next, self.layout.at(0, last)) + drift * after;
            for (p, pack) in self.packs.iter_mut().enumerate() {
                for (k, j) in self.layout.rods_of(p).enumerate() {
                    let at = [k * self.layout.stride + last, self.layout.at(j, last)];
                    for c in 0..3 {
                        pack.motion.v[c][at[0]] = after[c];
                        self.positions[c][at[1]] = tip[c];
                    }
                }
            }
        }
        work += 0.5 * length * (before_kick + self.power(&loads));
        if let Some(applied) = &self.applied {
            work += length * applied.power_of_wind(|j, i| self.moving(j, i).0);
        }
        work += length * self.moments.power(self.layout, &self.packs);
        if self.physics.rest_changes() {
            work += self.work.of_rest(rest, bent, length, self.widths[0]);
        }
        let exchange = Exchange {
            dissipated: length * (self.physics.damping * energy + friction),
            work,
        };
        (exchange, energy)
    }

    fn law(&self, rest: f64, remember: bool) -> Law {
        let changes = self.physics.rest_changes();
        Law {
            damped: self.physics.retardation > 0.0,
            changes,
            rest: if changes { rest } else { 1.0 },
            retardation: self.physics.retardation,
            rates: rates(self.widths[0], self.widths[1]),
            remember,
        }
    }

    /// Moves all nodes except a shared tip; the previous positions are left in `next`.
    fn step_packs(&mut self, loads: &Loads, law: Law, keep: f64, kick: f64, drift: f64) {
        let (arch, layout) = (self.arch, self.layout);
        let mut loads = *loads;
        if self.tip_mass.is_some() {
            // The force on a free tip acts in its own rod, that on a shared one elsewhere.
            loads.tip_force = DVec3::ZERO;
        }
        let normalise = self.steps.is_multiple_of(NORMALISED);
        let (positions, leaf, moments) = (&self.positions, &self.leaf, self.moments.all());
        let applied = self.applied.as_ref().map(Applied::loads);
        let coupled = leaf.coupled();
        let one = |block: &mut Block, p: usize, pack: &mut Pack, next: [&mut [f64]; 3]| {
            // Those beyond the first and the last rod have no weight. The others of a pack are
            // alike.
            let coupling = |gap: usize| leaf.coupling(gap.min(layout.rods - 2)).to_array();
            let rods = layout.rods_of(p);
            let step = Step {
                layout,
                pack: p,
                positions,
                next,
                coupling: coupled.then(|| [rods.start.saturating_sub(1), rods.start].map(coupling)),
                applied,
                motion: &mut pack.motion,
                material: &pack.material,
                past: &mut pack.past,
                law,
                loads,
                moments,
                keep,
                kick,
                drift,
                normalise,
                block,
            };
            pack.totals = arch.dispatch(step);
        };
        let [x, y, z] = self
            .next
            .each_mut()
            .map(|array| &mut array[layout.front()..]);
        let length = layout.entries();
        if self.parallel {
            let next = (x.par_chunks_mut(length).zip(y.par_chunks_mut(length)))
                .zip(z.par_chunks_mut(length));
            (self.packs.par_iter_mut().zip(next).enumerate())
                .with_min_len(packs_per_task(layout.packs()))
                .for_each_init(Block::new, |block, (p, (pack, ((x, y), z)))| {
                    one(block, p, pack, [x, y, z]);
                });
        } else {
            let next = (x.chunks_mut(length).zip(y.chunks_mut(length))).zip(z.chunks_mut(length));
            for (p, (pack, ((x, y), z))) in self.packs.iter_mut().zip(next).enumerate() {
                one(&mut self.block, p, pack, [x, y, z]);
            }
        }
        std::mem::swap(&mut self.positions, &mut self.next);
    }
}
