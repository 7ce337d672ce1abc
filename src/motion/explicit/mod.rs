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
//!
//! Besides segments, coupling and dead loads, the tissue between neighboring rods, loads of single
//! rods, springs of supports and wind act on the nodes. A node that a grip holds along some axes only is
//! returned to its place along these after each drift, without velocity there. Drag depends on the velocities at the time of the positions. Known are
//! those half a step before, and half a step before the last step: drag takes their linear
//! extrapolation, so that the method stays of second order.
//!
//! A kick takes the means of the loads over its length, and their work is this impulse times the
//! mean of the velocities before and after it, whatever the loads are within it. Only
//! the excess over the loads at time 0 is counted, which have a potential.

mod applied_loads;
mod joints;
mod kernel;
mod layout;
mod moment_work;
mod packs;
mod stable_step;
mod supports;
#[cfg(test)]
mod tests;

use crate::leaf::{DiscreteLeaf, Loads, State};
use crate::motion::explicit::applied_loads::{AppliedLoads, KickAir};
use crate::motion::explicit::kernel::{BlockForces, PackForces, PackStep, StepLaw};
use crate::motion::explicit::layout::{AlignedArray, PackLayout, PackPosition, vector_at};
use crate::motion::explicit::moment_work::{LeverWork, StepDeadMoments};
use crate::motion::explicit::packs::{NodeMomentum, Pack, SlidingNode};
pub use crate::motion::explicit::stable_step::StableStep;
use crate::motion::moving_supports::{MovingNode, MovingSupports};
use crate::motion::physics::Physics;
use crate::motion::{
    Collision, EnergyBalance, Exchange, Impact, MotionClock, Snapshot, Stopped,
    TIME_ROUNDING_FRACTION, TimeIntegrator, Velocity, check_resolution, measure, rate_weights,
};
use crate::numbers::largest;
use crate::rod::RESOLVED_TURN;
use crate::simd::widest_arch;
use glam::{BVec3, DQuat, DVec3};
use pulp::Arch;
use rayon::prelude::*;

/// Steps of the explicit method, and when it does what is not done in every one.
struct ExplicitSettings {
    /// Part of the stable time step used: steps longer than the stable one diverge.
    stable_step_fraction: f64,
    /// Steps between normalizations of the quaternions: doubled, their lengths are off by twice as many
    /// rounding errors.
    normalization_interval: usize,
    /// Steps between checks of the bending, which are free.
    bending_check_interval: usize,
    /// Steps between checks of the energy, which cost as much as some steps.
    energy_check_interval: usize,
    /// Number of segments from which rods are distributed to threads. Measured: below
    /// it waking the threads costs more than it saves.
    parallel_segments: usize,
}

const SETTINGS: ExplicitSettings = ExplicitSettings {
    stable_step_fraction: 0.9,
    normalization_interval: 8,
    bending_check_interval: 200,
    energy_check_interval: 2000,
    parallel_segments: 3000,
};

/// Advice if energy grows, besides a shorter step.
const ENERGY_GROWTH_ADVICE: &str = "the semi-implicit method";

/// Number of rods that are not divided further: about two portions for every thread.
fn packs_per_task(rods: usize) -> usize {
    (rods / (2 * rayon::current_num_threads())).max(1)
}

/// A leaf in explicit motion.
pub struct Explicit {
    leaf: DiscreteLeaf,
    physics: Physics,
    arch: Arch,
    layout: PackLayout,
    positions: [AlignedArray; 3],
    /// Positions after the next step.
    next: [AlignedArray; 3],
    packs: Vec<Pack>,
    block: BlockForces,
    /// What acts on the nodes besides segments, coupling and loads, if anything does.
    applied: Option<AppliedLoads>,
    supports: Option<MovingSupports>,
    /// The dead moments of a step.
    moments: StepDeadMoments,
    lever_work: LeverWork,
    /// Nodes that grips hold along some axes and let slide along the others.
    sliding: Vec<SlidingNode>,
    /// Mass of the shared tip, if there is one.
    tip_mass: Option<f64>,
    /// Length of rods whose loads act on it.
    tip_load_length: f64,
    step: f64,
    /// Time of the last step; that of the clock is the time asked for, less than a step later.
    last_step_time: f64,
    clock: MotionClock,
    equal_steps: EqualSteps,
    past: PastSteps,
    balance: EnergyBalance,
    work: VaryingWork,
    parallel: bool,
}

/// Steps before the present time.
#[derive(Clone, Copy, Debug, Default)]
struct PastSteps {
    /// Widths of the last step and of the one before; zero if there was none since the start, or since
    /// velocities jumped.
    widths: [f64; 2],
    /// Times between the present strains and those stored last, and between these and the ones before.
    strain_widths: [f64; 2],
    /// Whether velocities jumped at the present time.
    jumped: bool,
}

impl PastSteps {
    /// Time by which velocities lag behind positions: half a step, but zero at the start.
    fn velocity_lag(&self) -> f64 {
        0.5 * self.widths[0]
    }
}

/// Where steps of the present length began.
#[derive(Clone, Copy, Debug, Default)]
struct EqualSteps {
    time: f64,
    /// Number of steps before that time.
    steps: usize,
}

/// What a kick did to the energies.
struct KickEnergy {
    exchange: Exchange,
    /// Twice the kinetic energy in the middle of the kick.
    twice_kinetic: f64,
}

/// What the method cannot move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExplicitRefusal {
    /// A rigid rod: its waves are infinitely fast.
    RigidRod,
    /// A mass off the axis, with which the rotation of a node does not go on freely between kicks.
    MassOffAxis,
}

impl ExplicitRefusal {
    /// What the method cannot move of a leaf, if there is something.
    pub fn of_leaf(leaf: &DiscreteLeaf, physics: &Physics) -> Option<Self> {
        if leaf.least_compliance() == 0.0 {
            return Some(ExplicitRefusal::RigidRod);
        }
        (physics.has_masses_off_axis()).then_some(ExplicitRefusal::MassOffAxis)
    }
}

impl Explicit {
    /// A leaf at rest in `state`. Rigid tissue is made stiff. Time steps are nine tenths of the stable one,
    /// or `step` if that is given, stable or not.
    ///
    /// # Errors
    /// If a rod is rigid, or a mass is off the axis.
    pub fn new(
        leaf: DiscreteLeaf,
        physics: Physics,
        state: &State,
        step: Option<f64>,
    ) -> Result<Self, ExplicitRefusal> {
        if let Some(refusal) = ExplicitRefusal::of_leaf(&leaf, &physics) {
            return Err(refusal);
        }
        let leaf = leaf.with_elastic_tissue();
        let (count, joined, last) = (leaf.rods(), leaf.tips_move_together(), leaf.segments());
        let tip_mass = |j| physics.inertia(&leaf, j, last).mass;
        let tip_weight = |j| leaf.grid.node_weight(last) * leaf.leaf.length(j);
        let layout = packs::layout(&leaf);
        let positions = packs::positions(&leaf, state, layout);
        let supports = MovingSupports::new(&leaf, &physics);
        let mut explicit = Explicit {
            arch: widest_arch(),
            packs: packs::packs_at_rest(&leaf, &physics, state, layout),
            next: positions.clone(),
            positions,
            layout,
            applied: AppliedLoads::new(&leaf, &physics, state, layout),
            moments: StepDeadMoments::default(),
            lever_work: LeverWork::default(),
            block: BlockForces::new(),
            sliding: packs::sliding_nodes(&leaf, state, layout, &supports),
            supports,
            tip_mass: joined.then(|| (0..count).map(tip_mass).sum()),
            tip_load_length: (0..count).map(tip_weight).sum(),
            step: 0.0,
            last_step_time: 0.0,
            clock: MotionClock::default(),
            equal_steps: EqualSteps::default(),
            past: PastSteps::default(),
            balance: EnergyBalance::default(),
            work: VaryingWork::new(&leaf, &physics),
            parallel: layout.packs() > 1
                && count * leaf.segments() >= SETTINGS.parallel_segments
                && rayon::current_num_threads() > 1,
            leaf,
            physics,
        };
        explicit.physics.apply_loads(&mut explicit.leaf, 0.0);
        explicit.start_supports();
        explicit.step =
            step.unwrap_or_else(|| SETTINGS.stable_step_fraction * explicit.stable_step().step);
        let start = explicit.snapshot();
        explicit.balance.begin(&start);
        Ok(explicit)
    }

    /// The longest stable time step of the leaf in its present state.
    pub fn stable_step(&self) -> StableStep {
        let mut leaf = self.leaf.clone();
        if self.physics.rest_curvature_differs() {
            leaf.scale_rest_curvatures(self.physics.rest_curvature_factor(self.last_step_time));
        }
        StableStep::for_leaf(&leaf, &self.physics, &self.state())
    }

    /// The length of time steps.
    pub fn longest_step(&self) -> f64 {
        self.step
    }

    /// Replaces the masses of the nodes by fictitious ones, for relaxation only: the
    /// fastest motions of all segments have equal frequencies. Time steps may then be as long
    /// as one, and the leaf is stopped.
    pub fn use_fictitious_masses(&mut self) {
        let tip = stable_step::set_fictitious_masses(
            &self.leaf,
            &self.physics,
            self.layout,
            &mut self.packs,
        );
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
        self.past = PastSteps::default();
    }

    /// Sets the decay rate of all velocities from now on.
    pub fn set_damping(&mut self, rate: f64) {
        self.physics.damping = rate;
    }

    /// One time step of any length; returns twice the kinetic energy at its
    /// beginning.
    pub fn step(&mut self, h: f64) -> f64 {
        let energy = self.kick_and_drift(h);
        self.balance.add(energy.exchange);
        self.clock.steps += 1;
        self.equal_steps = EqualSteps {
            time: self.last_step_time,
            steps: self.clock.steps,
        };
        self.clock.time = self.last_step_time;
        energy.twice_kinetic
    }

    fn rotation(&self, j: usize, i: usize) -> DQuat {
        let PackPosition { pack, entry } = self.layout.pack_position(j, i);
        self.packs[pack].rotation(entry)
    }

    /// Velocity and angular momentum of a node.
    fn momentum(&self, j: usize, i: usize) -> NodeMomentum {
        let PackPosition { pack, entry } = self.layout.pack_position(j, i);
        self.packs[pack].momentum(entry)
    }

    /// The largest rotation between the ends of a segment, up to
    /// 2 pi, since signs of quaternions are aligned.
    fn largest_turn(&self) -> f64 {
        let deltas = (0..self.layout.rods).flat_map(|j| {
            let PackPosition { pack, entry: base } = self.layout.pack_position(j, 0);
            let pack = &self.packs[pack];
            (base..base + self.layout.segments)
                .map(|at| (pack.quaternion(at + 1) - pack.quaternion(at)).length_squared())
        });
        4.0 * (0.5 * largest(deltas).sqrt()).min(1.0).asin()
    }

    /// Whether numbers are finite and bending is resolved.
    fn is_reliable(&self) -> bool {
        let finite = |pack: &Pack| pack.totals.twice_kinetic.is_finite();
        self.largest_turn() <= RESOLVED_TURN && self.packs.iter().all(finite)
    }

    fn kick_and_drift(&mut self, h: f64) -> KickEnergy {
        let energy = self.kick(0.5 * h, h, true);
        self.past = PastSteps {
            widths: [h, self.past.widths[0]],
            strain_widths: [h, self.past.strain_widths[0]],
            jumped: false,
        };
        self.last_step_time += h;
        energy
    }

    /// Advances velocities, by the forces at the present positions, to the time
    /// `ahead` of these, and positions by the time `drift`.
    /// Strains are stored as those of the last step if `remember`.
    fn kick(&mut self, ahead: f64, drift: f64, remember: bool) -> KickEnergy {
        let length = self.past.velocity_lag() + ahead;
        let [from, to] = [
            self.last_step_time - self.past.velocity_lag(),
            self.last_step_time + ahead,
        ];
        self.physics.apply_mean_loads(&mut self.leaf, [from, to]);
        let loads = self.leaf.loads;
        let rest = self.physics.mean_rest_curvature_factor([from, to]);
        let before_kick = self.excess_load_power(&loads);
        let mut work = 0.0;
        let last = self.leaf.segments();
        let before = self.momentum(0, last).velocity;
        (self.moments).begin_step(
            self.leaf.dead_moments_under(loads),
            self.layout,
            &self.packs,
        );
        self.lever_work.begin_step(
            self.physics.scheduled_lever_excess(&self.leaf),
            self.layout,
            &self.packs,
        );
        if let Some(applied) = &mut self.applied {
            let [last, before] = self.past.widths;
            let air = KickAir {
                velocity: self.physics.mean_air([from, to]),
                extrapolation: if last > 0.0 {
                    last / (last + before)
                } else {
                    0.0
                },
            };
            applied.update(&self.leaf, self.layout, &self.positions, &self.packs, air);
        }
        self.set_support_loads();
        let decay = 0.5 * self.physics.damping * length;
        let (keep, kick) = ((1.0 - decay) / (1.0 + decay), length / (1.0 + decay));
        self.packs.iter_mut().for_each(Pack::begin_joint_step);
        self.move_packs(&loads, self.law(rest, remember), keep, kick, drift);
        work += self.drive_supports(drift);
        let joints: f64 = (self.packs.iter_mut())
            .map(|pack| pack.turn_joints(drift))
            .sum();
        let (mut energy, mut friction, mut bent) = (0.0, 0.0, 0.0);
        for pack in &self.packs {
            energy += pack.totals.twice_kinetic;
            friction += self.physics.retardation * pack.totals.friction;
            bent += pack.totals.rest_factor_derivative;
        }
        if let Some(mass) = self.tip_mass {
            let mut force = loads.tip_force + self.tip_load_length * loads.gravity;
            for pack in &self.packs {
                force -= DVec3::from(pack.totals.last_force);
            }
            if let Some(applied) = &self.applied {
                force += applied.tip_force_sum(self.layout);
            }
            let after = keep * before + force * (kick / mass);
            energy += mass * (0.5 * (before + after)).length_squared();
            let tip = vector_at(&self.next, self.layout.node_index(0, last)) + drift * after;
            for (p, pack) in self.packs.iter_mut().enumerate() {
                for (k, j) in self.layout.pack_rods(p).enumerate() {
                    let at = [
                        k * self.layout.stride + last,
                        self.layout.node_index(j, last),
                    ];
                    for c in 0..3 {
                        pack.motion.v[c][at[0]] = after[c];
                        self.positions[c][at[1]] = tip[c];
                    }
                }
            }
        }
        energy += joints - self.return_sliding_nodes();
        work += 0.5 * length * (before_kick + self.excess_load_power(&loads));
        if let Some(applied) = &self.applied {
            work += length * applied.power_of_followers(self.layout, &self.packs);
            let free = |k: usize, force: DVec3| MovingSupports::free_part(&self.supports, k, force);
            work += length * applied.power_of_wind(|j, i| self.momentum(j, i).velocity, free);
        }
        work += length * self.moments.power(self.layout, &self.packs);
        work += length * self.lever_work.power(&self.packs);
        if self.physics.rest_curvature_varies() {
            work += self.work.rest_curvature_work(rest, bent, length, self.past);
        }
        KickEnergy {
            exchange: Exchange {
                dissipated: length * (self.physics.damping * energy + friction),
                work,
            },
            twice_kinetic: energy,
        }
    }

    /// Puts nodes that slide back to where they are held along the other axes after a drift, with the velocity of
    /// their support; returns twice the kinetic energy that those components had in the middle of the kick, at the
    /// mean of their velocities before and after it.
    fn return_sliding_nodes(&mut self) -> f64 {
        let mut energy = 0.0;
        for sliding in &mut self.sliding {
            let PackPosition { pack, entry } = sliding.place;
            let mass = self.packs[pack].mass(entry);
            let moving = sliding.support.zip(self.supports.as_ref());
            let (position, held) = match moving.map(|(number, supports)| &supports.nodes[number]) {
                Some(it) => (it.now.position, it.step_velocity),
                None => (sliding.position, DVec3::ZERO),
            };
            for axis in (0..3).filter(|axis| sliding.held_axes.test(*axis)) {
                let velocity = &mut self.packs[pack].motion.v[axis][entry];
                energy += mass * (0.5 * (sliding.velocity[axis] + *velocity)).powi(2);
                *velocity = held[axis];
                self.positions[axis][sliding.node] = position[axis];
            }
            sliding.velocity = held;
        }
        energy
    }

    fn law(&self, rest: f64, remember: bool) -> StepLaw {
        let changes = self.physics.rest_curvature_varies();
        StepLaw {
            damped: self.physics.retardation > 0.0,
            rest_varies: changes,
            rest_curvature_factor: if changes { rest } else { 1.0 },
            retardation: self.physics.retardation,
            strain_rate_weights: {
                let [last, before] = self.past.strain_widths;
                rate_weights(last, before)
            },
            stores_strains: remember,
        }
    }

    /// Moves all nodes except a shared tip; the previous positions are left in `next`.
    fn move_packs(&mut self, loads: &Loads, law: StepLaw, keep: f64, kick: f64, drift: f64) {
        let (arch, layout) = (self.arch, self.layout);
        let mut loads = *loads;
        if self.tip_mass.is_some() {
            // The force on a free tip acts in its own rod, that on a shared one elsewhere.
            loads.tip_force = DVec3::ZERO;
        }
        let normalize = self
            .clock
            .steps
            .is_multiple_of(SETTINGS.normalization_interval);
        let (positions, leaf, moments) =
            (&self.positions, &self.leaf, &self.moments.nodal_moments[..]);
        let applied = self.applied.as_ref().map(AppliedLoads::loads);
        let coupled = leaf.coupled();
        let one = |block: &mut BlockForces, p: usize, pack: &mut Pack, next: [&mut [f64]; 3]| {
            // Gaps beyond the first and the last rod have no weight. The others of a pack are
            // coupled alike.
            let coupling = |gap: usize| leaf.coupling(gap.min(layout.rods - 2)).to_array();
            let rods = layout.pack_rods(p);
            let step = PackStep {
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
                watched: &mut pack.watched,
                velocity_factor: keep,
                kick,
                drift,
                normalize,
                block,
            };
            pack.totals = arch.dispatch(step);
        };
        let [x, y, z] = self
            .next
            .each_mut()
            .map(|array| &mut array[layout.front_padding()..]);
        let length = layout.pack_entries();
        if self.parallel {
            let next = (x.par_chunks_mut(length).zip(y.par_chunks_mut(length)))
                .zip(z.par_chunks_mut(length));
            (self.packs.par_iter_mut().zip(next).enumerate())
                .with_min_len(packs_per_task(layout.packs()))
                .for_each_init(BlockForces::new, |block, (p, (pack, ((x, y), z)))| {
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

impl Explicit {
    /// Positions, rotations and segment forces.
    pub fn present_state(&mut self) -> State {
        let rest = self.physics.rest_curvature_factor(self.last_step_time);
        let (law, layout) = (self.law(rest, false), self.layout);
        let mut forces = Vec::with_capacity(layout.rods * layout.segments);
        for (p, pack) in self.packs.iter_mut().enumerate() {
            self.arch.dispatch(PackForces {
                layout,
                pack: p,
                positions: &self.positions,
                motion: &pack.motion,
                material: &pack.material,
                past: &mut pack.past,
                law,
                forces: &mut forces,
            });
        }
        let mut state = self.state();
        state.n = forces.into_iter().map(DVec3::from).collect();
        state
    }

    fn state(&self) -> State {
        let n = self.leaf.segments();
        let nodes = || self.leaf.rod_index_pairs(0..=n);
        let x = nodes().map(|(j, i)| vector_at(&self.positions, self.layout.node_index(j, i)));
        let q = nodes().map(|(j, i)| self.rotation(j, i));
        State::new(n, x.collect(), q.collect())
    }

    /// The present state, if the motion is reliable in it.
    fn reliable_snapshot(&mut self) -> Result<Snapshot, Stopped> {
        let now = self.snapshot();
        (self.balance).check_reliability(
            &self.leaf,
            &self.physics,
            &now,
            self.step,
            ENERGY_GROWTH_ADVICE,
        )?;
        // In the balance rotations are at most pi, as in space.
        check_resolution(&self.leaf, self.clock.time, self.largest_turn())?;
        Ok(now)
    }
}

impl TimeIntegrator for Explicit {
    fn clock(&self) -> &MotionClock {
        &self.clock
    }

    fn clock_mut(&mut self) -> &mut MotionClock {
        &mut self.clock
    }

    fn advance(&mut self, until: f64) -> Result<Snapshot, Stopped> {
        let h = self.step;
        loop {
            // Times are multiples of the step, so that rounding does not accumulate.
            let EqualSteps { time, steps } = self.equal_steps;
            let next = time + h * (self.clock.steps + 1 - steps) as f64;
            let landing = self.physics.next_landing_time();
            if landing <= until && next > landing + TIME_ROUNDING_FRACTION * h {
                self.land_next_mass();
                continue;
            }
            if next > until + TIME_ROUNDING_FRACTION * h {
                break;
            }
            self.clock.check_limit()?;
            let energy = self.kick_and_drift(h);
            self.balance.add(energy.exchange);
            self.clock.steps += 1;
            (self.last_step_time, self.clock.time) = (next, next);
            let applied = self.applied.as_ref();
            if let Some(half_turn) = applied.and_then(|it| it.half_turn(&self.leaf)) {
                let time = self.clock.time;
                return Err(Stopped::HalfTurn { time, half_turn });
            }
            let steps = self.clock.steps;
            let suspect =
                steps.is_multiple_of(SETTINGS.bending_check_interval) && !self.is_reliable();
            if suspect || steps.is_multiple_of(SETTINGS.energy_check_interval) {
                self.reliable_snapshot()?;
            }
        }
        self.clock.time = until.max(self.clock.time);
        self.reliable_snapshot()
    }

    fn snapshot(&mut self) -> Snapshot {
        let packs = self.packs.iter();
        let moving: Vec<_> = packs.map(|p| (p.motion.clone(), p.past.clone())).collect();
        let past = self.applied.as_ref().map(AppliedLoads::past_velocities);
        let path = (self.positions.clone(), moving);
        let (time, steps, work) = (self.last_step_time, self.past, self.work);
        let (supports, sliding) = (self.supports.clone(), self.sliding.clone());
        let mut exchange = Exchange::default();
        let left = self.clock.time - self.last_step_time;
        if left > TIME_ROUNDING_FRACTION * self.step {
            exchange += self.kick_and_drift(left).exchange;
        }
        self.last_step_time = self.clock.time;
        exchange += self.kick(0.0, 0.0, false).exchange;
        exchange.work += self.excess_potential();
        let state = self.present_state();
        let nodes = self.leaf.rod_index_pairs(0..=self.leaf.segments());
        let places = nodes.map(|(j, i)| self.layout.pack_position(j, i));
        let mut velocity: Vec<Velocity> = places
            .map(|place| self.packs[place.pack].velocity(place.entry))
            .collect();
        if let Some(supports) = &self.supports {
            for it in &supports.nodes {
                let linear = &mut velocity[it.index].linear;
                *linear = DVec3::select(it.held_axes, it.velocity.linear, *linear);
                if it.holds_rotation {
                    velocity[it.index].angular = it.velocity.angular;
                }
            }
            let inertia = |it: &MovingNode| self.physics.inertia(&self.leaf, it.rod, it.node);
            exchange.work += supports.kinetic_energy(inertia) - supports.kinetic_energy;
        }
        self.positions = path.0;
        for (pack, moving) in self.packs.iter_mut().zip(path.1) {
            (pack.motion, pack.past) = moving;
        }
        if let (Some(applied), Some(past)) = (&mut self.applied, past) {
            applied.set_past_velocities(past);
        }
        (self.last_step_time, self.past, self.work) = (time, steps, work);
        let energy = measure(
            &mut self.leaf,
            &self.physics,
            self.clock.time,
            &state,
            &velocity,
        );
        (self.supports, self.sliding) = (supports, sliding);
        if let Some(supports) = &mut self.supports {
            supports.move_to(self.last_step_time, &mut self.leaf);
        }
        Snapshot {
            time: self.clock.time,
            energy: self.balance.present_energy(energy, exchange),
            state,
            velocity,
        }
    }
}

impl Explicit {
    /// Goes to the time at which the next mass lands, by a step of its own, and lets it land on its node: the
    /// velocities jump, and steps begin anew.
    fn land_next_mass(&mut self) {
        let Some(landing) = self.physics.next_landing() else {
            return;
        };
        let (h, left) = (self.step, landing.time - self.last_step_time);
        if left > TIME_ROUNDING_FRACTION * h {
            let energy = self.kick_and_drift(left);
            self.balance.add(energy.exchange);
            self.clock.steps += 1;
        }
        self.last_step_time = landing.time;
        let mut exchange = self.kick(0.0, 0.0, false).exchange;
        if self.physics.rest_curvature_varies() {
            exchange.work += std::mem::take(&mut self.work.half_impulse) * self.work.rate;
        }
        let (j, i) = (landing.vein, self.leaf.grid.nearest_node(landing.sigma));
        let joint = self.tip_mass.filter(|_| i == self.layout.segments);
        let PackPosition { pack, entry } = self.layout.pack_position(j, i);
        let collision = Collision {
            mass: landing.mass,
            velocity: landing.velocity,
            node_mass: joint.unwrap_or_else(|| self.physics.inertia(&self.leaf, j, i).mass),
            node_velocity: self.momentum(j, i).velocity,
            free: match joint {
                Some(_) => BVec3::TRUE,
                None if self.packs[pack].moves_freely(entry) => {
                    self.leaf.node_freedom(j, i).displacement
                }
                None => BVec3::FALSE,
            },
        };
        self.physics.land_next_mass();
        match joint {
            Some(mass) => self.tip_mass = Some(mass + landing.mass),
            None => self.packs[pack].add_mass(entry, landing.mass),
        }
        let velocity = collision.common_velocity();
        let rods = if joint.is_some() {
            0..self.layout.rods
        } else {
            j..j + 1
        };
        for j in rods {
            let PackPosition { pack, entry } = self.layout.pack_position(j, i);
            for c in 0..3 {
                self.packs[pack].motion.v[c][entry] = velocity[c];
            }
        }
        if let Some(supports) = &mut self.supports {
            supports.add_mass(j * (self.layout.segments + 1) + i, landing.mass);
        }
        let lost = collision.exchange();
        exchange += lost;
        self.balance.add(exchange);
        self.clock.impacts.push(Impact {
            point: landing.point,
            time: landing.time,
            kinetic_energy: landing.kinetic_energy(),
            lost_energy: lost.dissipated,
        });
        self.past = PastSteps {
            jumped: true,
            ..PastSteps::default()
        };
        if self.physics.retardation > 0.0 {
            // Stores the strains before, had the leaf always moved as it does now.
            let rest = self.physics.rest_curvature_factor(landing.time);
            let loads = self.leaf.loads;
            self.move_packs(&loads, self.law(rest, false), 1.0, 0.0, -h);
            self.move_packs(&loads, self.law(rest, true), 1.0, 0.0, h);
            self.past.strain_widths = [h, 0.0];
        }
        (self.clock.time, self.equal_steps) = (
            landing.time,
            EqualSteps {
                time: landing.time,
                steps: self.clock.steps,
            },
        );
    }
}

/// What the work of varying loads and rest curvatures depends on.
#[derive(Clone, Copy, Debug)]
struct VaryingWork {
    /// Loads and factor of the rest curvatures at time 0.
    loads: Loads,
    rest_curvature_factor: f64,
    /// Twice the energy of bending from the rest curvatures to none.
    twice_straightening_energy: f64,
    /// Half the impulse of the factor's excess at the last kick, and the sum of the
    /// rest curvatures times the moments without them.
    half_impulse: f64,
    rest_moment_sum: f64,
    /// Rate of that sum before the last kick.
    rate: f64,
}

impl VaryingWork {
    fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Self {
        let straightening = leaf.sections.iter().map(|section| {
            let rest = section.rest_curvature;
            section.ds * rest.dot(section.couple_stiffness * rest)
        });
        VaryingWork {
            loads: physics.loads(0.0),
            rest_curvature_factor: physics.rest_curvature_factor(0.0),
            twice_straightening_energy: straightening.sum(),
            half_impulse: 0.0,
            rest_moment_sum: 0.0,
            rate: 0.0,
        }
    }

    /// Work since the last kick, `width` ago, by the mean factors of the rest curvatures in that
    /// kick and, over `length`, in this one; `bent` is the sum of the rest curvatures
    /// times the present moments.
    fn rest_curvature_work(&mut self, mean: f64, bent: f64, length: f64, past: PastSteps) -> f64 {
        let (turned, width) = (
            bent + mean * self.twice_straightening_energy,
            past.widths[0],
        );
        // After a jump of the velocities only the rate after it counts.
        let part = if past.jumped { 1.0 } else { 0.5 };
        let half_impulse = part * length * (mean - self.rest_curvature_factor);
        self.rate = match width > 0.0 {
            true => (turned - self.rest_moment_sum) / width,
            false => 0.0,
        };
        let work = (self.half_impulse + half_impulse) * self.rate;
        (self.half_impulse, self.rest_moment_sum) = (half_impulse, turned);
        work
    }
}

impl Explicit {
    /// Power of the excess of `loads` over those at time 0, at the present velocities.
    fn excess_load_power(&self, loads: &Loads) -> f64 {
        match self.physics.loads_vary() {
            true => self.excess_load_sum(loads, |j, i| self.momentum(j, i).velocity),
            false => 0.0,
        }
    }

    /// Present potential of the excess of loads and rest curvatures over those at time 0: it
    /// is in the energies, but does not come from the motion.
    fn excess_potential(&mut self) -> f64 {
        let mut work = 0.0;
        if self.physics.loads_vary() {
            (self.physics).apply_loads(&mut self.leaf, self.clock.time);
            let loads = self.leaf.loads;
            work -= self.excess_load_sum(&loads, |j, i| {
                vector_at(&self.positions, self.layout.node_index(j, i))
            });
            let levers = self.physics.scheduled_lever_excess(&self.leaf);
            let energy = levers.map(|it| it.energy(self.rotation(it.rod, it.node)));
            work += energy.sum::<f64>();
        }
        if self.physics.rest_curvature_varies() {
            let VaryingWork {
                rest_curvature_factor: first,
                twice_straightening_energy: straightening,
                half_impulse,
                rest_moment_sum: turned,
                rate,
                ..
            } = self.work;
            let rest = self.physics.rest_curvature_factor(self.clock.time);
            // The rate after the last kick is nearly that before it.
            work += half_impulse * rate;
            work += (first - rest) * turned;
            work += 0.5 * (rest * rest - first * first) * straightening;
        }
        work
    }

    /// Sum of the excess of `loads` over those at time 0, times vectors of the nodes.
    fn excess_load_sum(&self, loads: &Loads, vectors: impl Fn(usize, usize) -> DVec3) -> f64 {
        let excess = *loads - self.work.loads;
        let mut sum = 0.0;
        for j in 0..self.layout.rods {
            for i in 0..=self.layout.segments {
                let PackPosition { pack, entry } = self.layout.pack_position(j, i);
                sum += self.packs[pack].load_length(entry) * excess.gravity.dot(vectors(j, i));
            }
            if j == 0 || !self.leaf.leaf.joined() {
                sum += excess.tip_force.dot(vectors(j, self.layout.segments));
            }
        }
        sum + self.physics.scheduled_excess(&self.leaf, vectors)
    }
}
