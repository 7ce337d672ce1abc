//! The explicit method: leapfrog for positions and angular momenta.
//!
//! Forces at the nodes' positions kick velocities from half a step before to
//! half a step after; with these, positions and rotations fly on freely for
//! one step. A node of a round section is a body with one axis of symmetry,
//! whose free rotation is known in closed form. The method is of second order
//! and symplectic, and keeps momentum and angular momentum to rounding, since
//! the forces of a segment, which follow from an energy that no rigid motion
//! changes, do. External damping enters by its mean over the kick.
//!
//! It is stable up to a time step of 2/omega for the highest frequency omega,
//! which is at most that of a single segment ([`Explicit::stable_step`]), as
//! long as the step stays the same: steps that alternate between one length
//! and half of it are unstable from less than 0.9 of that bound on. So all
//! steps are of one length, and what is asked for at a time between two of
//! them is reached by a shorter step from the one before, off the path, to
//! which the motion returns. It does not depend on the times asked for.

use glam::DVec3;
use pulp::Arch;
use rayon::prelude::*;

use super::fictitious;
use super::friction::rates;
use super::kernel::{Drift, Forces, GROUP, Kick, Neighbour, Positions, Powers};
use super::ledger::{Exchange, Ledger, measure};
use super::method::{Broken, Method, Snapshot, Velocity};
use super::nodes::{self, Rod, groups, vector};
use super::physics::Physics;
use super::stable::StableStep;
use crate::leaf::{DiscreteLeaf, Loads, State};

/// Part of the stable time step that is used.
const SAFETY: f64 = 0.9;

/// Part of a step that is rounding.
const NO_TIME: f64 = 1e-9;

/// Steps between looks at the energy.
const WATCHED: usize = 200;

/// From this many nodes on, rods are shared out among threads. Measured: below
/// it waking the threads costs more than they bring.
const PARALLEL_NODES: usize = 8192;

/// Rods that one thread takes: a loop over them is too short for finer shares.
fn share(rods: usize) -> usize {
    rods.div_ceil(rayon::current_num_threads())
}

/// A leaf on the move.
pub struct Explicit<'a> {
    leaf: DiscreteLeaf<'a>,
    physics: Physics,
    arch: Arch,
    positions: Vec<Positions>,
    rods: Vec<Rod>,
    /// Mass of the joint tip, if there is one.
    tip_mass: Option<f64>,
    /// Time step.
    step: f64,
    /// Time of the last step, and that asked for, less than a step later.
    stepped: f64,
    time: f64,
    steps: usize,
    /// Time and steps when the first of the present length began.
    begin: (f64, usize),
    /// Widths of the last step and of the one before; zero if there was none.
    widths: [f64; 2],
    ledger: Ledger,
    parallel: bool,
}

/// What a kick did: twice the kinetic energy in its middle, and the power of
/// the moment on the tip.
struct Kicked {
    energy: f64,
    moment: f64,
}

/// A stiffness the method cannot handle: that of a rigid rod.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rigid;

impl<'a> Explicit<'a> {
    /// A leaf at rest in `state`. Time steps are nine tenths of what is stable,
    /// or `step` if that is given, stable or not.
    ///
    /// # Errors
    /// If a rod is rigid: its waves are infinitely fast.
    pub fn new(
        leaf: DiscreteLeaf<'a>,
        physics: Physics,
        state: &State,
        step: Option<f64>,
    ) -> Result<Self, Rigid> {
        if leaf.stiffest() == 0.0 {
            return Err(Rigid);
        }
        let rods = leaf.rods();
        let joined = leaf.leaf.joined() && rods > 1;
        let tip_mass = |j| {
            physics
                .inertia(leaf.leaf, &leaf.grid, j, leaf.segments())
                .mass
        };
        let mut explicit = Explicit {
            arch: Arch::new(),
            positions: (0..rods)
                .map(|j| nodes::positions(&leaf, state, j))
                .collect(),
            rods: (0..rods)
                .map(|j| nodes::rod(&leaf, &physics, state, j))
                .collect(),
            tip_mass: joined.then(|| (0..rods).map(tip_mass).sum()),
            step: 0.0,
            stepped: 0.0,
            time: 0.0,
            steps: 0,
            begin: (0.0, 0),
            widths: [0.0; 2],
            ledger: Ledger::default(),
            parallel: rods > 1
                && rods * leaf.segments() >= PARALLEL_NODES
                && rayon::current_num_threads() > 1,
            leaf,
            physics,
        };
        explicit.step = step.unwrap_or_else(|| SAFETY * explicit.stable_step().step);
        explicit.forces(true);
        for rod in &mut explicit.rods {
            // At rest the past was like the present.
            rod.past.two = rod.past.one.clone();
        }
        let start = explicit.snapshot();
        explicit.ledger.begin(&start);
        Ok(explicit)
    }

    /// The longest stable time step of the leaf as it stands.
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

    /// Gives the nodes masses that serve to come to rest, not to move: the
    /// fastest motions of all segments become alike. Time steps may be as long as one then, and the leaf is
    /// stopped.
    pub fn disguise(&mut self) {
        let tip = fictitious::masses(&self.leaf, &mut self.rods);
        self.tip_mass = self.tip_mass.map(|_| tip);
        self.stop();
    }

    /// Takes all velocities away.
    pub fn stop(&mut self) {
        for rod in &mut self.rods {
            for array in rod.motion.v.iter_mut().chain(&mut rod.motion.p) {
                array.fill(0.0);
            }
        }
        self.widths = [0.0; 2];
    }

    /// Lets every velocity decay at this rate from now on.
    pub fn damp(&mut self, rate: f64) {
        self.physics.damping = rate;
    }

    /// One time step of any length; returns twice the kinetic energy at its
    /// beginning.
    pub fn step(&mut self, h: f64) -> f64 {
        let (exchange, energy) = self.go(h);
        self.ledger.add(exchange);
        self.steps += 1;
        self.begin = (self.stepped, self.steps);
        self.time = self.stepped;
        energy
    }

    /// Kicks, and flies on for `h`.
    fn go(&mut self, h: f64) -> (Exchange, f64) {
        let done = self.kick_until(0.5 * h, true);
        self.drift(h);
        self.widths = [h, self.widths[0]];
        self.stepped += h;
        done
    }

    /// By how much time velocities lag behind positions: half a step, but not
    /// at the start.
    fn behind(&self) -> f64 {
        0.5 * self.widths[0]
    }

    /// Kicks velocities, by the forces at the present positions, to where they
    /// are `ahead` of these. Strains become the last step's if they are to be
    /// remembered. Returns twice the kinetic energy in the middle of the kick,
    /// too.
    fn kick_until(&mut self, ahead: f64, remember: bool) -> (Exchange, f64) {
        let length = self.behind() + ahead;
        let [from, to] = [self.stepped - self.behind(), self.stepped + ahead];
        let loads = self.physics.loads(self.stepped);
        let powers = self.forces(remember);
        let Kicked { energy, moment } = self.kick(length, &loads);
        let mut work = length * moment;
        if self.physics.loads_change() {
            work -= self.potential_of(&self.physics.loads(from), &self.physics.loads(to));
        }
        if self.physics.rest_changes() {
            work -= powers.rest * (self.physics.rest(to) - self.physics.rest(from));
        }
        let exchange = Exchange {
            dissipated: length * (self.physics.damping * energy + powers.friction),
            work,
        };
        (exchange, energy)
    }

    /// What is between the potentials of two loads, the leaf standing still.
    fn potential_of(&self, before: &Loads, after: &Loads) -> f64 {
        let last = GROUP + self.leaf.segments();
        let gravity = after.gravity - before.gravity;
        let tip_force = after.tip_force - before.tip_force;
        let mut lower = 0.0;
        for (j, (rod, positions)) in self.rods.iter().zip(&self.positions).enumerate() {
            for at in GROUP..=last {
                lower += rod.material.weight[at] * gravity.dot(vector(&positions.x, at));
            }
            if j == 0 || !self.leaf.leaf.joined() {
                lower += tip_force.dot(vector(&positions.x, last));
            }
        }
        lower
    }

    /// Internal forces at the present positions.
    fn forces(&mut self, remember: bool) -> Powers {
        let (arch, groups) = (self.arch, groups(self.leaf.segments()));
        let rest = self.physics.rest(self.stepped);
        let (retardation, changes) = (self.physics.retardation, self.physics.rest_changes());
        let rates = rates(self.widths[0], self.widths[1]);
        let force = |(rod, positions): (&mut Rod, &Positions)| {
            let Rod {
                motion,
                material,
                past,
                powers,
                ..
            } = rod;
            macro_rules! forces {
                ($damped:literal, $changes:literal) => {
                    arch.dispatch(Forces::<$damped, $changes> {
                        groups,
                        positions,
                        motion,
                        material,
                        rest,
                        past,
                        retardation,
                        rates,
                        remember,
                    })
                };
            }
            *powers = match (retardation > 0.0, changes) {
                (true, true) => forces!(true, true),
                (true, false) => forces!(true, false),
                (false, true) => forces!(false, true),
                (false, false) => forces!(false, false),
            };
        };
        match self.parallel {
            true => (self.rods.par_iter_mut().zip(&self.positions))
                .with_min_len(share(self.positions.len()))
                .for_each(force),
            false => self.rods.iter_mut().zip(&self.positions).for_each(force),
        }
        let mut sum = Powers::default();
        for rod in &self.rods {
            sum.friction += retardation * rod.powers.friction;
            sum.rest += rod.powers.rest;
        }
        sum
    }

    /// Kicks all velocities.
    fn kick(&mut self, length: f64, loads: &Loads) -> Kicked {
        let (arch, segments) = (self.arch, self.leaf.segments());
        let (groups, last) = (groups(segments), GROUP + segments);
        let before = self.rods[0].moving(last);
        let decay = 0.5 * self.physics.damping * length;
        let (keep, kick) = ((1.0 - decay) / (1.0 + decay), length / (1.0 + decay));
        let (all, leaf) = (&self.positions, &self.leaf);
        let tip_mass = self.tip_mass;
        // A free tip feels its force in its own rod, a joint one below.
        let own_force = if tip_mass.is_some() {
            DVec3::ZERO
        } else {
            loads.tip_force
        };
        let one = |(j, rod): (usize, &mut Rod)| {
            let beside = |other: usize, gap: usize| {
                (other < all.len()).then(|| Neighbour {
                    positions: &all[other],
                    stiffness: leaf.leaf.coupling(gap).to_array(),
                })
            };
            for c in 0..3 {
                rod.motion.n[c][last] += own_force[c];
                rod.motion.left[c][last] += loads.tip_moment[c];
            }
            rod.twice_kinetic = arch.dispatch(Kick {
                groups,
                positions: &all[j],
                neighbours: [
                    beside(j.wrapping_sub(1), j.wrapping_sub(1)),
                    beside(j + 1, j),
                ],
                motion: &mut rod.motion,
                material: &rod.material,
                gravity: loads.gravity.to_array(),
                keep,
                kick,
            });
            for c in 0..3 {
                rod.motion.n[c][last] = 0.0;
                rod.motion.left[c][last] = 0.0;
            }
        };
        match self.parallel {
            true => (self.rods.par_iter_mut().enumerate())
                .with_min_len(share(all.len()))
                .for_each(one),
            false => self.rods.iter_mut().enumerate().for_each(one),
        }
        let mut energy: f64 = self.rods.iter().map(|rod| rod.twice_kinetic).sum();
        if let Some(mass) = tip_mass {
            let mut force = loads.tip_force;
            for rod in &self.rods {
                force += rod.material.weight[last] * loads.gravity;
                force -= vector(&rod.motion.n, last - 1);
            }
            let after = keep * before.0 + force * (kick / mass);
            energy += mass * (0.5 * (before.0 + after)).length_squared();
            for rod in &mut self.rods {
                for c in 0..3 {
                    rod.motion.v[c][last] = after[c];
                }
            }
        }
        let mut moment = 0.0;
        if loads.tip_moment != DVec3::ZERO {
            let momentum = 0.5 * (before.1 + self.rods[0].moving(last).1);
            moment = loads.tip_moment.dot(self.rods[0].spin(last, momentum));
        }
        Kicked { energy, moment }
    }

    /// Free flight.
    fn drift(&mut self, step: f64) {
        let (arch, segments) = (self.arch, self.leaf.segments());
        let fly = |(rod, positions): (&mut Rod, &mut Positions)| {
            arch.dispatch(Drift {
                groups: groups(segments),
                positions,
                motion: &mut rod.motion,
                material: &rod.material,
                step,
            });
            rod.close(segments);
        };
        match self.parallel {
            true => {
                let share = share(self.rods.len());
                (self.rods.par_iter_mut().zip(&mut self.positions))
                    .with_min_len(share)
                    .for_each(fly)
            }
            false => self.rods.iter_mut().zip(&mut self.positions).for_each(fly),
        }
    }

    fn judge(&mut self) -> Result<(), Broken> {
        let now = self.snapshot();
        (self.ledger).judge(&self.leaf, &self.physics, &now, self.step)
    }

    /// Positions, rotations and segment forces now.
    pub fn now(&mut self) -> State {
        self.forces(false);
        self.state()
    }

    /// The same, but the forces as they were computed last.
    fn state(&self) -> State {
        let n = self.leaf.segments();
        let nodes =
            || (0..self.rods.len()).flat_map(|j| (GROUP..=GROUP + n).map(move |at| (j, at)));
        let mut state = State::new(
            n,
            nodes()
                .map(|(j, at)| vector(&self.positions[j].x, at))
                .collect(),
            nodes().map(|(j, at)| self.rods[j].rotation(at)).collect(),
        );
        state.n = (self.rods.iter())
            .flat_map(|rod| (GROUP..GROUP + n).map(|at| vector(&rod.motion.n, at)))
            .collect();
        state
    }
}

impl Method for Explicit<'_> {
    fn name(&self) -> &'static str {
        "explicit"
    }

    fn time(&self) -> f64 {
        self.time
    }

    fn steps(&self) -> usize {
        self.steps
    }

    fn advance(&mut self, until: f64) -> Result<(), Broken> {
        let h = self.step;
        loop {
            // Times are not summed up, and neither is rounding.
            let next = self.begin.0 + h * (self.steps + 1 - self.begin.1) as f64;
            if next > until + NO_TIME * h {
                break;
            }
            let (exchange, _) = self.go(h);
            self.ledger.add(exchange);
            self.steps += 1;
            (self.stepped, self.time) = (next, next);
            if self.steps.is_multiple_of(WATCHED) {
                self.judge()?;
            }
        }
        self.time = until.max(self.time);
        self.judge()
    }

    fn snapshot(&mut self) -> Snapshot {
        let path: Vec<_> = (self.rods.iter().zip(&self.positions))
            .map(|(rod, x)| (x.clone(), rod.motion.clone(), rod.past.clone()))
            .collect();
        let (time, widths) = (self.stepped, self.widths);
        let mut exchange = Exchange::default();
        let left = self.time - self.stepped;
        if left > NO_TIME * self.step {
            exchange += self.go(left).0;
        }
        self.stepped = self.time;
        exchange += self.kick_until(0.0, false).0;
        let state = self.state();
        let n = self.leaf.segments();
        let velocity: Vec<Velocity> = (self.rods.iter())
            .flat_map(|rod| rod.velocities(n))
            .collect();
        for ((rod, x), path) in self.rods.iter_mut().zip(&mut self.positions).zip(path) {
            (*x, rod.motion, rod.past) = path;
        }
        (self.stepped, self.widths) = (time, widths);
        let energy = measure(&mut self.leaf, &self.physics, self.time, &state, &velocity);
        Snapshot {
            time: self.time,
            energy: self.ledger.complete(energy, exchange),
            state,
            velocity,
        }
    }

    fn save(&self) -> Vec<f64> {
        let mut numbers = vec![
            self.stepped,
            self.time,
            self.steps as f64,
            self.begin.0,
            self.begin.1 as f64,
            self.widths[0],
            self.widths[1],
        ];
        numbers.extend(self.ledger.save());
        for (rod, positions) in self.rods.iter().zip(&self.positions) {
            let moving = positions.x.iter().chain(rod.moving_arrays());
            numbers.extend(moving.flatten());
        }
        numbers
    }

    fn restore(&mut self, numbers: &[f64]) -> bool {
        if numbers.len() != self.save().len() {
            return false;
        }
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next().unwrap_or_default();
        self.stepped = next();
        self.time = next();
        self.steps = next() as usize;
        self.begin = (next(), next() as usize);
        self.widths = [next(), next()];
        self.ledger.restore(&mut next);
        for (rod, positions) in self.rods.iter_mut().zip(&mut self.positions) {
            let moving = positions.x.iter_mut().chain(rod.moving_arrays_mut());
            for value in moving.flatten() {
                *value = next();
            }
        }
        true
    }
}
