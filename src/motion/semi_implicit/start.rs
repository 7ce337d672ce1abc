//! Where a motion starts, or starts anew because velocities jumped: as a mass lands, or as the supports of rigid rods
//! are struck.
//!
//! Forces and accelerations are those of the positions and velocities. Of rigid segments and tissue they do not follow from
//! strains, but from a short step, and velocities are the nearest ones with which these keep their lengths: impulses in
//! them act in no time.

use crate::leaf::{DiscreteLeaf, State};
use crate::motion::constraint_projection::project_constraints;
use crate::motion::moving_supports::MovingNode;
use crate::motion::physics::Inertia;
use crate::motion::semi_implicit::{
    NodeMotion, SemiImplicit, add_inertia, free_wrench, set_support_motions,
};
use crate::motion::{Collision, Exchange, Impact};
use crate::rod::Wrench;
use crate::rotation;
use glam::{DMat3, DQuat, DVec3};

/// A first step from rest, of implicit Euler, so short that the leaf hardly moves. It determines the
/// forces in rigid segments and tissue, which do not follow from strains.
struct FirstStepSettings {
    /// Inverse square of the length of the step.
    inverse_square: f64,
    /// Newton iterations, and the size of the last (radians, lengths).
    most_iterations: usize,
    iteration_error: f64,
    /// Strain of a rigid segment, as a length, that may be due to rounding.
    strain_rounding: f64,
    /// Strain of a rigid segment, as a length, above which positions are not consistent.
    inconsistent_strain: f64,
}

const FIRST_STEP: FirstStepSettings = FirstStepSettings {
    inverse_square: 1e6,
    most_iterations: 30,
    iteration_error: 1e-15,
    strain_rounding: 1e-12,
    inconsistent_strain: 1e-8,
};

/// A time so short that loads change no velocity in it: an impulse in rigid segments acts in it.
const IMPULSE_TIME: f64 = 1e-6;

impl SemiImplicit {
    /// Initializes the forces of the segments and the accelerations of the nodes.
    pub(super) fn initialize(&mut self) {
        self.apply_loads_and_damping(0.0, 0.0, FIRST_STEP.inverse_square);
        let violation = self.leaf.strain_forces(&mut self.state);
        let closed = self.leaf.open_tissue_gap(&self.state) < FIRST_STEP.inconsistent_strain;
        if self.leaf.least_compliance() > 0.0 && !(self.leaf.has_rigid_tissue() && closed) {
            return self.set_accelerations();
        }
        if violation > FIRST_STEP.strain_rounding {
            let strained = self.state.clone();
            if self.first_step() {
                std::mem::swap(&mut self.state, &mut self.trial);
            }
            let forces = self.state.n.clone();
            if self.leaf.strain_forces(&mut self.state) < FIRST_STEP.inconsistent_strain {
                self.state.n = forces;
            } else {
                self.state = strained;
                self.make_consistent();
                self.leaf.strain_forces(&mut self.state);
            }
        }
        match self.first_step() {
            true => {
                self.take_forces_of_trial();
                for k in 0..self.state.x.len() {
                    let w = self.increment(k).map(|d| FIRST_STEP.inverse_square * d);
                    self.node_motions[k] = NodeMotion::at_rest(w);
                }
            }
            false => self.set_accelerations(),
        }
    }

    /// Moves the nodes slightly to a state with unstrained rigid segments, if there is one.
    fn make_consistent(&mut self) {
        let mut leaf = self.leaf.clone();
        leaf.sections.clone_from(&self.sections);
        if let Some(state) = project_constraints(&leaf, &self.state) {
            self.state = state;
        }
    }

    /// Takes the forces in segments and tissue from the trial: those in rigid ones do not follow from strains.
    fn take_forces_of_trial(&mut self) {
        std::mem::swap(&mut self.state.n, &mut self.trial.n);
        std::mem::swap(&mut self.state.tissue, &mut self.trial.tissue);
    }

    /// A first step, into the trial; false if it failed.
    fn first_step(&mut self) -> bool {
        self.short_step(FIRST_STEP.inverse_square, 0.0)
    }

    /// A step into the trial in which inertia, `per_mass` times the masses, resists increments that differ from those
    /// of the present velocities in the time `h`; false if it failed.
    fn short_step(&mut self, per_mass: f64, h: f64) -> bool {
        self.trial.clone_from(&self.state);
        if h > 0.0 {
            self.move_supports(self.clock.time + h);
        }
        for _ in 0..FIRST_STEP.most_iterations {
            self.leaf.assemble(&self.trial, &mut self.system);
            self.add_follower_forces(self.clock.time, Some(0.0));
            let excess = |k: usize| {
                let ([turn, shift], v) = (self.increment(k), self.node_motions[k].v);
                [turn - h * v[0], shift - h * v[1]]
            };
            let increments: Vec<_> = (0..self.state.x.len()).map(excess).collect();
            let (inertia, supports) = (&self.inertia, &self.supports);
            let (leaf, trial, nodes) = (&self.leaf, &self.trial, self.leaf.segments() + 1);
            let inertial = |k: usize, tensor: &DMat3| {
                let [turn, shift] = increments[k];
                let moment = -per_mass * (*tensor * turn);
                let force = -per_mass * inertia[k].mass * shift;
                let mut load = Wrench { moment, force };
                if inertia[k].is_off_axis() {
                    let s = inertia[k].first_moment(trial.q[k]);
                    load.moment -= per_mass * s.cross(shift);
                    load.force -= per_mass * turn.cross(s);
                    load = leaf.node_freedom(k / nodes, k % nodes).of_wrench(load);
                }
                free_wrench(supports, k, load)
            };
            add_inertia(
                &self.leaf,
                &mut self.system,
                trial,
                inertia,
                Some(per_mass),
                inertial,
            );
            if !self.solve(false) {
                return false;
            }
            self.advance_trial();
            if self.system.largest_increment().larger() < FIRST_STEP.iteration_error {
                break;
            }
        }
        self.trial.x.iter().all(|x| x.is_finite())
    }

    fn set_accelerations(&mut self) {
        self.leaf.assemble(&self.state, &mut self.system);
        self.trial.clone_from(&self.state);
        self.next_node_motions.clone_from(&self.node_motions);
        self.add_follower_forces(self.clock.time, Some(0.0));
        let damping = self.physics.damping;
        let n = self.leaf.segments();
        let joined = self.leaf.tips_move_together();
        let (mut tip_force, mut tip_mass) = (DVec3::ZERO, 0.0);
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let k = self.state.base(j) + i;
            let Wrench { moment, force } = self.system.unbalanced_node_load(j, i);
            let Inertia { mass, .. } = self.inertia[k];
            let tensor = self.inertia[k].tensor(self.state.q[k]);
            if i == n {
                tip_force += force;
                tip_mass += mass;
            }
            let v = self.node_motions[k].v;
            let momentum = tensor * v[0];
            let moment = moment - v[0].cross(momentum) - damping * momentum;
            let angular = match i == 0 && self.leaf.holds_spins() {
                true => self.leaf.joint_acceleration(&self.state, j, tensor, moment),
                false => tensor.inverse() * moment,
            };
            let w = [angular, force / mass - damping * v[1]];
            self.node_motions[k] = NodeMotion { v, a: w, w };
        }
        if joined {
            for j in 0..self.leaf.rods() {
                let motion = &mut self.node_motions[self.state.base(j) + n];
                motion.w[1] = tip_force / tip_mass - damping * motion.v[1];
                motion.a[1] = motion.w[1];
            }
        }
        self.set_off_axis_accelerations();
        set_support_motions(&self.supports, &mut self.node_motions);
    }
}

impl SemiImplicit {
    /// Lets the next mass land on its node: the velocities jump, and the accelerations with them.
    pub(super) fn land_next_mass(&mut self) {
        let Some(landing) = self.physics.next_landing() else {
            return;
        };
        let (j, i) = (landing.vein, self.leaf.grid.nearest_node(landing.sigma));
        let together = self.leaf.tips_move_together() && i == self.leaf.segments();
        let rods = if together {
            0..self.leaf.rods()
        } else {
            j..j + 1
        };
        let nodes: Vec<usize> = rods.map(|j| self.state.base(j) + i).collect();
        let (own, time) = (self.state.base(j) + i, self.clock.time);
        let collision = Collision {
            mass: landing.mass,
            velocity: landing.velocity,
            node_mass: nodes.iter().map(|&k| self.inertia[k].mass).sum(),
            node_velocity: self.node_motions[own].v[1],
            free: self.leaf.node_freedom(j, i).displacement,
        };
        self.physics.apply_loads(&mut self.leaf, time);
        let potential = self.leaf.potential(&self.state);
        self.physics.land_next_mass();
        self.inertia[own] = self.physics.inertia(&self.leaf, j, i);
        let mut exchange = match self.is_off_axis_body(own) {
            true => self.land_off_axis(own, &landing),
            false => {
                for &k in &nodes {
                    self.node_motions[k].v[1] = collision.common_velocity();
                }
                collision.exchange()
            }
        };
        if let Some(supports) = &mut self.supports {
            supports.add_mass(own, landing.mass);
        }
        if self.leaf.least_compliance() == 0.0 || self.leaf.has_rigid_tissue() {
            let before = self.kinetic_energy();
            self.project_velocities();
            exchange.dissipated += before - self.kinetic_energy();
        }
        self.restart();
        self.physics.apply_loads(&mut self.leaf, time);
        let weighed = self.leaf.potential(&self.state) - potential;
        self.clock.impacts.push(Impact {
            point: landing.point,
            time,
            kinetic_energy: landing.kinetic_energy(),
            lost_energy: exchange.dissipated,
        });
        exchange.work += weighed;
        self.balance.add(exchange);
    }

    fn kinetic_energy(&self) -> f64 {
        let nodes = self
            .inertia
            .iter()
            .zip(&self.node_motions)
            .zip(&self.state.q);
        let energy = |((inertia, motion), q): ((&Inertia, &NodeMotion), &DQuat)| {
            inertia.kinetic_energy(*q, motion.v)
        };
        nodes.map(energy).sum()
    }

    /// Replaces the velocities by the nearest ones, by their kinetic energy, with which rigid segments and tissue are
    /// not strained: those to which impulses in them lead.
    fn project_velocities(&mut self) {
        let h = IMPULSE_TIME;
        let per_mass = (h * h).recip();
        self.apply_loads_and_damping(self.clock.time, 0.0, per_mass);
        let carried = self.state.clone();
        if self.short_step(per_mass, h) {
            for k in 0..self.state.x.len() {
                let moved = self.increment(k).map(|d| d / h);
                self.node_motions[k].v = moved;
            }
        }
        self.state = carried;
        self.move_supports(self.clock.time);
        set_support_motions(&self.supports, &mut self.node_motions);
    }

    /// Starts anew from the present positions and velocities, after these have jumped.
    fn restart(&mut self) {
        self.past_step = 0.0;
        let retarded = self.physics.retardation > 0.0;
        if retarded {
            // The strains before, had the leaf always moved as it does now.
            let before = self.step.min(self.step_bound);
            let mut shifted = self.state.clone();
            for (k, motion) in self.node_motions.iter().enumerate() {
                let [turn, shift] = motion.v.map(|v| -before * v);
                shifted.q[k] = (rotation::exp(turn) * shifted.q[k]).normalize();
                shifted.x[k] += shift;
            }
            std::mem::swap(&mut self.state, &mut shifted);
            let strains = self.strains();
            std::mem::swap(&mut self.state, &mut shifted);
            self.strain_history = [strains.clone(), strains];
            self.apply_loads_and_damping(self.clock.time, before, FIRST_STEP.inverse_square);
            self.past_step = before;
        } else {
            self.apply_loads_and_damping(self.clock.time, 0.0, FIRST_STEP.inverse_square);
        }
        if self.leaf.least_compliance() > 0.0 && !self.leaf.has_rigid_tissue() {
            self.leaf.strain_forces(&mut self.state);
            self.set_accelerations();
        } else {
            let h = (2.0 / FIRST_STEP.inverse_square).sqrt();
            if self.short_step(FIRST_STEP.inverse_square, h) {
                self.take_forces_of_trial();
                for k in 0..self.state.x.len() {
                    let (d, v) = (self.increment(k), self.node_motions[k].v);
                    let w = [0, 1].map(|c| FIRST_STEP.inverse_square * (d[c] - h * v[c]));
                    self.node_motions[k] = NodeMotion { v, a: w, w };
                }
            }
            self.move_supports(self.clock.time);
            set_support_motions(&self.supports, &mut self.node_motions);
        }
        if retarded {
            let strains = self.strains();
            let rates = strains.iter().zip(&self.strain_history[1]);
            self.strain_rates = rates
                .map(|(now, last)| [0, 1].map(|kind| (now[kind] - last[kind]) / self.past_step))
                .collect();
            self.strain_history[0] = strains;
        }
    }
}

impl SemiImplicit {
    /// Moves the supports of the trial to where they are at a time.
    pub(super) fn move_supports(&mut self, time: f64) {
        if let Some(supports) = &mut self.supports {
            supports.move_to(time, &mut self.leaf);
            supports.place(&mut self.trial);
        }
    }

    /// Sets the velocities and the loads of supports that move at the start.
    pub(super) fn start_supports(&mut self) {
        if self.supports.is_none() {
            return;
        }
        self.move_supports(0.0);
        set_support_motions(&self.supports, &mut self.node_motions);
        self.jump_with_supports();
        if let Some(supports) = &mut self.supports {
            let inertia = &self.inertia;
            supports.kinetic_energy = supports.kinetic_energy(|it| inertia[it.index]);
            for it in &mut supports.nodes {
                it.load = load_on_support(&self.leaf, &self.state, it);
            }
        }
    }

    /// Lets the velocities of rigid rods jump if it is time, as those of their supports do; returns whether they did.
    pub(super) fn jump_with_supports(&mut self) -> bool {
        let now = self.clock.time;
        let rigid = self.leaf.least_compliance() == 0.0 || self.leaf.has_rigid_tissue();
        let Some(supports) = &mut self.supports else {
            return false;
        };
        let mut jumps = false;
        while supports.jumps.last().is_some_and(|time| *time <= now) {
            supports.jumps.pop();
            jumps = true;
        }
        if !jumps || !rigid {
            return false;
        }
        let before = self.kinetic_energy();
        self.move_supports(now);
        set_support_motions(&self.supports, &mut self.node_motions);
        self.project_velocities();
        self.restart();
        let work = self.kinetic_energy() - before;
        if let Some(supports) = &mut self.supports {
            let inertia = &self.inertia;
            supports.kinetic_energy = supports.kinetic_energy(|it| inertia[it.index]);
        }
        self.balance.add(Exchange {
            dissipated: 0.0,
            work,
        });
        true
    }

    /// Work of the supports that move in the accepted step.
    pub(super) fn work_of_supports(&mut self) -> f64 {
        let Some(supports) = &mut self.supports else {
            return 0.0;
        };
        let inertia = &self.inertia;
        let kinetic = supports.kinetic_energy(|it| inertia[it.index]);
        let mut work = kinetic - std::mem::replace(&mut supports.kinetic_energy, kinetic);
        for it in &mut supports.nodes {
            let load = load_on_support(&self.leaf, &self.state, it);
            let step = it.step();
            work -= 0.5 * (load.force + it.load.force).dot(step.displacement);
            work -= 0.5 * (load.moment + it.load.moment).dot(step.rotation);
            it.load = load;
        }
        work
    }
}

/// What the leaf exerts on a support that moves.
fn load_on_support(leaf: &DiscreteLeaf, state: &State, it: &mut MovingNode) -> Wrench {
    let load = leaf.support_load(state, it.rod, it.node);
    it.spring_force = it.force_of_springs(leaf, state.x[it.index]);
    Wrench {
        force: it.force_on_support(load.force),
        ..load
    }
}
