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
//! which is at most that of a single segment ([`Explicit::stable_step`]).

use glam::DVec3;
use pulp::Arch;
use rayon::prelude::*;

use super::fictitious;
use super::kernel::{Drift, Forces, GROUP, Kick, Neighbour, Positions};
use super::ledger::{Ledger, measure};
use super::method::{Broken, Method, Snapshot, Velocity};
use super::nodes::{self, Rod, groups, vector};
use super::physics::Physics;
use crate::leaf::{DiscreteLeaf, Loads, State};

/// Part of the stable time step that is used.
const SAFETY: f64 = 0.9;

/// Steps between looks at the energy.
const WATCHED: usize = 200;

/// From this many nodes on, rods are shared out among threads. Measured: below
/// it waking the threads costs more than they bring.
const PARALLEL_NODES: usize = 1500;

/// A leaf on the move.
pub struct Explicit<'a> {
    leaf: DiscreteLeaf<'a>,
    physics: Physics,
    arch: Arch,
    positions: Vec<Positions>,
    rods: Vec<Rod>,
    /// Mass of the joint tip, if there is one.
    tip_mass: Option<f64>,
    /// Longest time step.
    longest: f64,
    time: f64,
    steps: usize,
    /// By how much time velocities lag behind positions.
    behind: f64,
    ledger: Ledger,
    parallel: bool,
}

/// A stiffness the method cannot handle: that of a rigid rod.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rigid;

/// The longest stable time step, and what limits it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableStep {
    /// The step.
    pub step: f64,
    /// The fastest motion.
    pub limit: &'static str,
}

impl<'a> Explicit<'a> {
    /// A leaf at rest in `state`. Time steps are as long as is stable, or
    /// `longest` if that is given, stable or not.
    ///
    /// # Errors
    /// If a rod is rigid: its waves are infinitely fast.
    pub fn new(
        leaf: DiscreteLeaf<'a>,
        physics: Physics,
        state: &State,
        longest: Option<f64>,
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
            longest: 0.0,
            time: 0.0,
            steps: 0,
            behind: 0.0,
            ledger: Ledger::default(),
            parallel: rods > 1
                && rods * leaf.segments() >= PARALLEL_NODES
                && rayon::current_num_threads() > 1,
            leaf,
            physics,
        };
        explicit.longest = longest.unwrap_or_else(|| SAFETY * explicit.stable_step().step);
        explicit.forces(1.0, true);
        for rod in &mut explicit.rods {
            // At rest the past was like the present.
            rod.past.two = rod.past.one.clone();
        }
        let start = explicit.snapshot();
        explicit.ledger.begin(&start);
        Ok(explicit)
    }

    /// The longest stable time step: 2/omega, shortened by internal damping,
    /// with the highest frequency any single segment would have, which bounds
    /// those of the leaf (T. J. R. Hughes, The Finite Element Method, 1987,
    /// section 9.2), and what coupling adds to it.
    pub fn stable_step(&self) -> StableStep {
        let (mut largest, mut limit) = (0.0, "");
        let grid = &self.leaf.grid;
        for (j, rod) in self.rods.iter().enumerate() {
            let m = &rod.material;
            let inertia = |i: usize| self.physics.inertia(self.leaf.leaf, grid, j, i);
            for i in 0..self.leaf.segments() {
                // A node shares its mass between the segments beside it.
                let share = |node: usize| grid.width(i) / (2.0 * grid.weight(node));
                let (a, b) = (share(i), share(i + 1));
                let (left, right) = (inertia(i), inertia(i + 1));
                let per_mass = 1.0 / (a * left.mass) + 1.0 / (b * right.mass);
                let per_inertia = 1.0 / (a * left.transverse) + 1.0 / (b * right.transverse);
                let per_polar = 1.0 / (a * left.polar()) + 1.0 / (b * right.polar());
                let at = GROUP + i;
                let ds = m.rest_length[at];
                let shear = m.stretch[1][at].max(m.stretch[2][at]);
                let turning = shear * 0.25 * ds * ds * per_inertia;
                let bend = m.bend[1][at].max(m.bend[2][at]);
                for (squared, what) in [
                    (m.stretch[0][at] * per_mass, "waves of stretch"),
                    (m.bend[0][at] * per_polar, "waves of twist"),
                    (bend * per_inertia, "waves of bending"),
                    (shear * per_mass + turning, "shear with rotation"),
                ] {
                    if squared > largest {
                        (largest, limit) = (squared, what);
                    }
                }
            }
        }
        let coupling = self.coupling_bound();
        if coupling > largest {
            limit = "coupling";
        }
        let (eta, squared) = (self.physics.retardation, largest + coupling);
        if eta * eta * squared > 1.0 {
            limit = "internal damping";
        }
        StableStep {
            step: 2.0 * ((eta * eta + 1.0 / squared).sqrt() - eta),
            limit,
        }
    }

    /// What coupling adds to the squared frequency, at most.
    fn coupling_bound(&self) -> f64 {
        let gaps: Vec<f64> = (1..self.leaf.rods())
            .map(|g| self.leaf.leaf.coupling(g - 1).max_element())
            .collect();
        let mut largest: f64 = 0.0;
        for (j, rod) in self.rods.iter().enumerate() {
            let m = &rod.material;
            let beside = [j.wrapping_sub(1), j];
            let sum: f64 = beside.iter().filter_map(|&g| gaps.get(g)).sum();
            for at in GROUP..=GROUP + self.leaf.segments() {
                largest = largest.max(2.0 * sum * m.coupled[at] * m.per_mass[at]);
            }
        }
        largest
    }

    /// The longest time step that is made.
    pub fn longest_step(&self) -> f64 {
        self.longest
    }

    /// Gives the nodes masses that serve to come to rest, not to move: see
    /// [`fictitious`]. Time steps may be as long as one then, and the leaf is
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
        self.behind = 0.0;
    }

    /// Lets every velocity decay at this rate from now on.
    pub fn damp(&mut self, rate: f64) {
        self.physics.damping = rate;
    }

    /// One time step; returns twice the kinetic energy at its beginning.
    pub fn step(&mut self, h: f64) -> f64 {
        let loads = self.physics.loads(self.time);
        let power = self.forces(1.0 / h, true);
        let length = self.behind + 0.5 * h;
        let before = self.tip_spin();
        let moving = self.kick(length, &loads);
        // A dead moment has no potential: its work is all that tells of it.
        let spin = 0.5 * (before + self.tip_spin());
        self.ledger.work += length * loads.tip_moment.dot(spin);
        self.ledger.dissipated += length * self.physics.damping * moving + h * power;
        self.drift(h);
        self.behind = 0.5 * h;
        self.time += h;
        self.steps += 1;
        self.account(&loads);
        moving
    }

    /// Angular velocity of the first rod's tip.
    fn tip_spin(&self) -> DVec3 {
        let last = GROUP + self.leaf.segments();
        self.rods[0].spin(last, vector(&self.rods[0].motion.p, last))
    }

    /// Work of what changed during the last step.
    fn account(&mut self, before: &Loads) {
        if self.physics.loads_change() {
            let after = self.physics.loads(self.time);
            let change = |load: DVec3, x: DVec3| -load.dot(x);
            let mut work = 0.0;
            for (j, (rod, positions)) in self.rods.iter().zip(&self.positions).enumerate() {
                for at in GROUP..=GROUP + self.leaf.segments() {
                    let weight = rod.material.weight[at];
                    let x = vector(&positions.x, at);
                    work += weight * change(after.gravity - before.gravity, x);
                }
                if j == 0 || !self.leaf.leaf.joined() {
                    let x = vector(&positions.x, GROUP + self.leaf.segments());
                    work += change(after.tip_force - before.tip_force, x);
                }
            }
            self.ledger.work += work;
        }
    }

    /// Internal forces at the present positions; returns the power of internal
    /// friction. Does `remember` strains as the last step's.
    fn forces(&mut self, per_step: f64, remember: bool) -> f64 {
        let (arch, groups) = (self.arch, groups(self.leaf.segments()));
        let rest = self.physics.rest(self.time);
        let retardation = self.physics.retardation;
        let force = |(rod, positions): (&mut Rod, &Positions)| {
            let Rod {
                motion,
                material,
                past,
                sum,
            } = rod;
            macro_rules! forces {
                ($damped:literal) => {
                    arch.dispatch(Forces::<$damped> {
                        groups,
                        positions,
                        motion,
                        material,
                        rest,
                        past,
                        retardation,
                        per_step,
                        remember,
                    })
                };
            }
            *sum = match retardation > 0.0 {
                true => retardation * forces!(true),
                false => forces!(false),
            };
        };
        match self.parallel {
            true => (self.rods.par_iter_mut().zip(&self.positions)).for_each(force),
            false => self.rods.iter_mut().zip(&self.positions).for_each(force),
        }
        self.rods.iter().map(|rod| rod.sum).sum()
    }

    /// Kicks all velocities; returns twice the kinetic energy in the middle.
    fn kick(&mut self, length: f64, loads: &Loads) -> f64 {
        let (arch, segments) = (self.arch, self.leaf.segments());
        let (groups, last) = (groups(segments), GROUP + segments);
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
            rod.sum = arch.dispatch(Kick {
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
            true => self.rods.par_iter_mut().enumerate().for_each(one),
            false => self.rods.iter_mut().enumerate().for_each(one),
        }
        let mut energy: f64 = self.rods.iter().map(|rod| rod.sum).sum();
        if let Some(mass) = tip_mass {
            let mut force = loads.tip_force;
            for rod in &self.rods {
                force += rod.material.weight[last] * loads.gravity;
                force -= vector(&rod.motion.n, last - 1);
            }
            // Without mass of its own the tip's velocity has only decayed.
            let kept = vector(&self.rods[0].motion.v, last);
            let after = kept + force * (kick / mass);
            let before = kept / keep;
            energy += mass * (0.5 * (before + after)).length_squared();
            for rod in &mut self.rods {
                for c in 0..3 {
                    rod.motion.v[c][last] = after[c];
                }
            }
        }
        energy
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
            true => (self.rods.par_iter_mut().zip(&mut self.positions)).for_each(fly),
            false => self.rods.iter_mut().zip(&mut self.positions).for_each(fly),
        }
    }

    /// Positions, rotations and segment forces now.
    pub fn now(&mut self) -> State {
        self.forces(1.0 / self.longest, false);
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
        let count = ((until - self.time) / self.longest).ceil().max(1.0);
        let (begin, h) = (self.time, (until - self.time) / count);
        let count = count as usize;
        for i in 0..count {
            self.step(h);
            self.time = begin + h * (i + 1) as f64;
            if self.steps.is_multiple_of(WATCHED) {
                let now = self.snapshot();
                self.ledger.judge(&self.leaf, &now)?;
            }
        }
        self.time = until;
        let now = self.snapshot();
        self.ledger.judge(&self.leaf, &now)
    }

    fn snapshot(&mut self) -> Snapshot {
        let rods = self.rods.clone();
        let loads = self.physics.loads(self.time);
        self.forces(1.0 / self.longest, false);
        self.kick(self.behind, &loads);
        let state = self.state();
        let n = self.leaf.segments();
        let velocity: Vec<Velocity> = (self.rods.iter())
            .flat_map(|rod| rod.velocities(n))
            .collect();
        self.rods = rods;
        let energy = measure(&mut self.leaf, &self.physics, self.time, &state, &velocity);
        Snapshot {
            time: self.time,
            energy: self.ledger.complete(energy),
            state,
            velocity,
        }
    }

    fn save(&self) -> Vec<f64> {
        let mut numbers = vec![self.time, self.steps as f64, self.behind];
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
        self.time = next();
        self.steps = next() as usize;
        self.behind = next();
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
