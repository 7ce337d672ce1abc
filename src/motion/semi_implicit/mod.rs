//! The semi-implicit method: the generalized-alpha method of Chung and Hulbert
//! (J. Appl. Mech. 60, 1993) on rotations (Bruls, Cardona, Arnold, Mech. Mach.
//! Theory 48, 2012).
//!
//! It is of second order, stable at any time step for any stiffness, and damps
//! only what the step does not resolve. Every step solves the balance of
//! momentum at its end by Newton's method, with the matrices and the mixed
//! form of the relaxation, which allows rigid rods. Rotations are updated by spatial
//! increments, as everywhere.
//!
//! With d the increment over a step h, v the velocity, a an auxiliary
//! acceleration and w the true one,
//!
//! ```text
//! d = h v0 + h^2 ((1/2 - beta) a0 + beta a1),   v1 = v0 + h ((1 - gamma) a0 + gamma a1)
//! (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) w1 + alpha_f w0
//! ```
//!
//! A motion begins from consistent conditions of a leaf at rest: its forces and accelerations and, where
//! rigid segments are strained, as those of arcs with different chords, positions without such strains.

mod energy;
mod off_axis;
mod start;

use crate::leaf::{DiagonalBlocks, DiscreteLeaf, Loads, NodalMoment, State, System};
use crate::motion::moving_supports::MovingSupports;
use crate::motion::physics::{Inertia, Physics, WindDrag};
use crate::motion::{
    EnergyBalance, Exchange, MotionClock, Snapshot, Stopped, TIME_ROUNDING_FRACTION,
    TimeIntegrator, Velocity, measure, rate_weights,
};
use crate::newton::{DefiniteSolver, SolverCounts};
use crate::numbers::larger;
use crate::rod::{Section, TissueStrip, Wrench};
use crate::rotation;
use glam::{DMat3, DVec3};

/// Settings of the semi-implicit method.
struct SemiImplicitSettings {
    /// Spectral radius rho_inf at infinite frequency: the part of unresolved motion that
    /// remains after a step. Smaller values also damp more of what is resolved.
    spectral_radius: f64,
    /// Shortest step, in units of time.
    shortest_step: f64,
    /// Bounds on the ratio of successive steps.
    least_step_ratio: f64,
    largest_step_ratio: f64,
    /// Newton iterations in a step; a step that needs more is shortened.
    most_iterations: usize,
    /// An iteration of at most this size (radians, lengths) is followed by one with the same matrix, which costs a
    /// fraction of one with its own; and that by another, if it is smaller by this factor.
    kept_matrix_increment: f64,
    kept_matrix_contraction: f64,
    /// Size of the last Newton iteration (radians, lengths), as a part of the permitted local error, of
    /// which its error stays a small part.
    iteration_error: f64,
    /// Upper limit on the size of the last iteration.
    largest_iteration_error: f64,
    /// Size of the last iteration of steps of given length.
    fixed_step_iteration_error: f64,
    /// Size of the last iteration if steps are only counted, as a part of the permitted local error.
    count_only_iteration_error: f64,
    /// An iteration below this that does not decrease is due to rounding.
    iteration_rounding: f64,
    /// Relative accuracy of the conjugate gradients.
    cg_accuracy: f64,
    /// Relative accuracy of the conjugate gradients if steps are only counted, as a part of the
    /// permitted local error: increments are less than one, so that this is noise far below it.
    count_only_cg_accuracy: f64,
    /// Largest rotation of a node in a step, radians.
    largest_rotation: f64,
    /// The stiffness with which the forces of rigid segments and tissue are condensed out is
    /// at least this multiple of the resistance of inertia: iterations then converge
    /// equally fast for all steps.
    condensing_ratio: f64,
}

const SETTINGS: SemiImplicitSettings = SemiImplicitSettings {
    spectral_radius: 0.8,
    shortest_step: 1e-10,
    least_step_ratio: 0.2,
    largest_step_ratio: 2.0,
    most_iterations: 12,
    kept_matrix_increment: 1e-3,
    kept_matrix_contraction: 0.05,
    iteration_error: 1e-3,
    largest_iteration_error: 1e-9,
    fixed_step_iteration_error: 1e-12,
    count_only_iteration_error: 1e-2,
    iteration_rounding: 1e-11,
    cg_accuracy: 1e-10,
    count_only_cg_accuracy: 1e-2,
    largest_rotation: 0.5,
    condensing_ratio: 1e3,
};

/// Advice if energy grows, besides a shorter step.
const ENERGY_GROWTH_ADVICE: &str = "dynamics.start = \"at-rest\"";

/// Advice if steps become too short.
const SHORT_STEP_ADVICE: &str = "use more segments a rod, or slower changes of the loads";

/// Advice if no first step is short enough.
const SHORT_FIRST_STEP_ADVICE: &str = "the arcs it is released from strain rods that are rigid, or nearly so: \
    use dynamics.start = \"at-rest\", or a lower stiffness";

#[derive(Clone, Copy, Debug)]
/// Weights of the generalized-alpha method.
struct GeneralizedAlphaWeights {
    alpha_m: f64,
    alpha_f: f64,
    gamma: f64,
    beta: f64,
}

impl GeneralizedAlphaWeights {
    /// The weights with which the spectral radius at infinite frequency is `rho_inf`.
    fn from_spectral_radius(rho_inf: f64) -> Self {
        let alpha_m = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0);
        let alpha_f = rho_inf / (rho_inf + 1.0);
        let gamma = 0.5 + alpha_f - alpha_m;
        GeneralizedAlphaWeights {
            alpha_m,
            alpha_f,
            gamma,
            beta: 0.25 * (gamma + 0.5) * (gamma + 0.5),
        }
    }
}

/// Control of the time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepControl {
    /// All steps of this length, except those that end at the times asked for.
    Fixed(f64),
    /// Steps with which the local error of positions (lengths) and rotations (radians)
    /// stays below this.
    LocalError(f64),
    /// As with [`StepControl::LocalError`], if only the number of steps matters: equations are solved with
    /// just the accuracy that the local error is estimated with, and no energy balance is kept.
    CountOnly(f64),
}

impl StepControl {
    /// The permitted local error, if it determines the step.
    fn error(self) -> Option<f64> {
        match self {
            StepControl::Fixed(_) => None,
            StepControl::LocalError(error) | StepControl::CountOnly(error) => Some(error),
        }
    }

    /// The first step that is tried.
    fn first_step(self) -> f64 {
        match self {
            StepControl::Fixed(h) => h,
            StepControl::LocalError(error) | StepControl::CountOnly(error) => 0.1 * error.cbrt(),
        }
    }
}

/// Motion of a node: velocity v, auxiliary acceleration a and acceleration w of the method, each an angular
/// and a linear vector.
#[derive(Clone, Copy, Debug, Default)]
struct NodeMotion {
    v: [DVec3; 2],
    a: [DVec3; 2],
    w: [DVec3; 2],
}

impl NodeMotion {
    /// An acceleration without velocity.
    fn at_rest(w: [DVec3; 2]) -> Self {
        let v = [DVec3::ZERO; 2];
        NodeMotion { v, a: w, w }
    }
}

/// A leaf in semi-implicit motion.
pub struct SemiImplicit {
    leaf: DiscreteLeaf,
    physics: Physics,
    inertia: Vec<Inertia>,
    wind: Option<WindDrag>,
    supports: Option<MovingSupports>,
    /// The rods' own sections, if internal damping changes them, and the leaf's own strips of tissue.
    sections: Vec<Section>,
    strips: Vec<TissueStrip>,
    /// Strains (v, u) of all segments at the last step and the one before.
    strain_history: [Vec<[DVec3; 2]>; 2],
    /// Length of the last step; zero if there was none.
    past_step: f64,
    /// Rates of the strains (v, u) of all segments at the last step.
    strain_rates: Vec<[DVec3; 2]>,
    system: System,
    solver: DefiniteSolver,
    state: State,
    trial: State,
    next: State,
    node_motions: Vec<NodeMotion>,
    next_node_motions: Vec<NodeMotion>,
    weights: GeneralizedAlphaWeights,
    control: StepControl,
    step: f64,
    /// A bound on the steps, the longest step since [`TimeIntegrator::take_longest_step`], and the sum of local
    /// errors since [`TimeIntegrator::take_local_errors`].
    step_bound: f64,
    longest_taken: f64,
    local_errors: f64,
    clock: MotionClock,
    /// Number of factorizations.
    pub factorizations: usize,
    balance: EnergyBalance,
    /// Loads by which the accelerations were corrected for the step being attempted.
    corrected_loads: Loads,
    /// As `corrected_loads`, of the factors of loads of single veins: the corrections, and their present changes.
    corrected_factors: Vec<f64>,
    factor_changes: Vec<f64>,
    /// How sections at the tissue's strips are aligned at the start.
    alignments: Vec<bool>,
}

impl SemiImplicit {
    /// A leaf at rest in `state`.
    pub fn new(leaf: DiscreteLeaf, physics: Physics, state: &State, control: StepControl) -> Self {
        let nodes = leaf.rod_index_pairs(0..=leaf.segments());
        let mut motion = SemiImplicit {
            inertia: nodes.map(|(j, i)| physics.inertia(&leaf, j, i)).collect(),
            wind: WindDrag::new(&leaf, &physics),
            supports: MovingSupports::new(&leaf, &physics),
            sections: leaf.sections.clone(),
            strips: leaf.tissue_data().to_vec(),
            strain_history: [Vec::new(), Vec::new()],
            past_step: 0.0,
            strain_rates: Vec::new(),
            system: System::new(&leaf),
            solver: DefiniteSolver::default(),
            state: state.clone(),
            trial: state.clone(),
            next: state.clone(),
            node_motions: vec![NodeMotion::default(); state.x.len()],
            next_node_motions: vec![NodeMotion::default(); state.x.len()],
            step: control.first_step(),
            step_bound: f64::INFINITY,
            longest_taken: 0.0,
            local_errors: 0.0,
            weights: GeneralizedAlphaWeights::from_spectral_radius(SETTINGS.spectral_radius),
            control,
            clock: MotionClock::default(),
            factorizations: 0,
            balance: EnergyBalance::default(),
            corrected_loads: Loads::default(),
            corrected_factors: physics.load_factors(0.0).map(|_| 0.0).collect(),
            factor_changes: physics.load_factors(0.0).map(|_| 0.0).collect(),
            alignments: leaf.strip_alignments(state),
            leaf,
            physics,
        };
        motion.initialize();
        motion.strain_history = [motion.strains(), motion.strains()];
        motion.strain_rates = vec![[DVec3::ZERO; 2]; motion.strain_history[0].len()];
        motion.start_supports();
        let start = motion.snapshot();
        motion.balance.begin(&start);
        motion
    }

    /// Lets a mass land if it is time, or else attempts a step that goes neither beyond `until` nor
    /// beyond a knot, as within a step loads are linear in time: no pulse is stepped over.
    ///
    /// # Errors
    /// As of [`SemiImplicit::step_towards`].
    pub fn proceed_towards(&mut self, until: f64) -> Result<(), Stopped> {
        let (now, landing) = (self.clock.time, self.physics.next_landing_time());
        if self.jump_with_supports() {
            return Ok(());
        }
        if landing <= now {
            self.land_next_mass();
            return Ok(());
        }
        let knot = self.physics.next_knot(now);
        self.step_towards(until.min(knot).min(landing))
    }

    /// Attempts a step that does not go beyond `until`.
    ///
    /// # Errors
    /// If it would be too short, or sections passed half a turn against each other.
    pub fn step_towards(&mut self, until: f64) -> Result<(), Stopped> {
        let left = until - self.clock.time;
        if left < TIME_ROUNDING_FRACTION * self.step {
            self.clock.time = until;
            return Ok(());
        }
        let step = self.step.min(self.step_bound);
        let count = (left / step * (1.0 - 1e-12)).ceil().max(1.0);
        // The last two steps divide the remaining time equally.
        let last = count == 1.0;
        let h = match self.control {
            StepControl::Fixed(_) => left / count,
            _ if count <= 2.0 => left / count,
            _ => step,
        };
        let error = self.attempt(h);
        if let (Some(allowed), Some(error)) = (self.control.error(), error) {
            let factor = 0.9 * (allowed / error.max(1e-300)).cbrt();
            let next = h * factor.clamp(SETTINGS.least_step_ratio, SETTINGS.largest_step_ratio);
            if error > allowed {
                self.step = next;
                return Ok(());
            }
            // A step cut short by `until` does not limit the next.
            self.step = if last { next.max(self.step) } else { next };
        }
        match error {
            Some(error) => {
                self.local_errors += error;
                self.accept(h);
            }
            None => self.step = 0.25 * h,
        }
        if let (StepControl::Fixed(longest), Some(_)) = (self.control, error) {
            self.step = longest.min(SETTINGS.largest_step_ratio * self.step);
        }
        let time = self.clock.time;
        // Beyond the jump of the law no step may converge.
        let half_turn = match self.step < SETTINGS.shortest_step {
            true => self.leaf.half_turn_near(&self.state),
            false => (self.leaf).half_turn_since(&self.alignments, &self.state),
        };
        if let Some(half_turn) = half_turn {
            return Err(Stopped::HalfTurn { time, half_turn });
        }
        if self.step < SETTINGS.shortest_step {
            let started = time > 0.0;
            let advice = if started {
                SHORT_STEP_ADVICE
            } else {
                SHORT_FIRST_STEP_ADVICE
            };
            return Err(Stopped::StepTooShort { time, advice });
        }
        if error.is_some() && last {
            self.clock.time = until;
        }
        Ok(())
    }
}

impl TimeIntegrator for SemiImplicit {
    fn clock(&self) -> &MotionClock {
        &self.clock
    }

    fn clock_mut(&mut self) -> &mut MotionClock {
        &mut self.clock
    }

    fn limit_steps(&mut self, longest: f64) {
        self.step_bound = longest;
    }

    fn take_longest_step(&mut self) -> f64 {
        std::mem::take(&mut self.longest_taken)
    }

    fn set_local_error(&mut self, error: f64) {
        self.control = StepControl::LocalError(error);
        self.step = self.control.first_step();
    }

    fn take_local_errors(&mut self) -> f64 {
        std::mem::take(&mut self.local_errors)
    }

    fn advance(&mut self, until: f64) -> Result<Snapshot, Stopped> {
        while self.clock.time < until || self.physics.next_landing_time() <= self.clock.time {
            self.clock.check_limit()?;
            self.proceed_towards(until)?;
        }
        let now = self.snapshot();
        (self.balance).check_reliability(
            &self.leaf,
            &self.physics,
            &now,
            self.step,
            ENERGY_GROWTH_ADVICE,
        )?;
        Ok(now)
    }

    fn snapshot(&mut self) -> Snapshot {
        let velocity = self.node_motions.iter().map(|m| {
            let [angular, linear] = m.v;
            Velocity { angular, linear }
        });
        let (time, state, velocity) = (
            self.clock.time,
            self.state.clone(),
            velocity.collect::<Vec<_>>(),
        );
        self.leaf.sections.clone_from(&self.sections);
        let energy = measure(&mut self.leaf, &self.physics, time, &state, &velocity);
        Snapshot {
            time,
            energy: self.balance.present_energy(energy, Exchange::default()),
            state,
            velocity,
        }
    }
}

impl SemiImplicit {
    /// Solves with the matrix of the iteration before in place of that of the trial, or factorizes and solves; false if
    /// the matrix is not positive definite.
    fn solve(&mut self, keeps_matrix: bool) -> bool {
        let accuracy = match self.control {
            StepControl::CountOnly(error) => SETTINGS.count_only_cg_accuracy * error,
            _ => SETTINGS.cg_accuracy,
        };
        if keeps_matrix {
            return (self.solver).solve_with_last_matrix(&mut self.system, accuracy);
        }
        self.factorizations += 1;
        let mut uncounted = SolverCounts::default();
        self.solver
            .solve(&mut self.system, 0.0, None, accuracy, &mut uncounted)
            .is_ok()
    }

    /// Adds the solved increments to the trial.
    fn advance_trial(&mut self) {
        let (leaf, next) = (&self.leaf, &mut self.next);
        leaf.advance(&self.trial, &self.system, 1.0, next);
        std::mem::swap(&mut self.trial, next);
    }

    /// Rotation and displacement of a node from the state to the trial; exactly zero for a held
    /// base or tip.
    fn increment(&self, k: usize) -> [DVec3; 2] {
        let nodes = self.leaf.segments() + 1;
        let free = self.leaf.node_freedom(k / nodes, k % nodes);
        let turn = || rotation::log(self.trial.q[k] * self.state.q[k].conjugate());
        let shift = || self.trial.x[k] - self.state.x[k];
        [
            if free.rotation { turn() } else { DVec3::ZERO },
            free.of_displacement(shift()),
        ]
    }

    /// Motion at the end of a step of h that leads from the state to the trial.
    fn update_motion(&mut self, h: f64) {
        let nodes = self.leaf.segments() + 1;
        let w = self.weights;
        let (of_increment, of_mean) = (1.0 / (w.beta * h * h), 1.0 / (1.0 - w.alpha_f));
        let of_before = (0.5 - w.beta) / w.beta;
        let first = self.leaf.first_node();
        for k in (0..self.state.x.len()).filter(|k| k % nodes >= first) {
            let (m, d) = (self.node_motions[k], self.increment(k));
            let next = &mut self.next_node_motions[k];
            for c in 0..2 {
                let a1 = of_increment * (d[c] - h * m.v[c]) - of_before * m.a[c];
                let mean = (1.0 - w.alpha_m) * a1 + w.alpha_m * m.a[c];
                next.a[c] = a1;
                next.v[c] = m.v[c] + h * ((1.0 - w.gamma) * m.a[c] + w.gamma * a1);
                next.w[c] = of_mean * (mean - w.alpha_f * m.w[c]);
            }
        }
        self.hold_spins(true);
        set_support_motions(&self.supports, &mut self.next_node_motions);
    }

    /// Removes from the motions of bases, in the trial or in the state, what hinges that hold the spin do not allow: by
    /// the differences in time it is not zero, but of higher order in the step.
    fn hold_spins(&mut self, trial: bool) {
        let (state, motions) = match trial {
            true => (&self.trial, &mut self.next_node_motions),
            false => (&self.state, &mut self.node_motions),
        };
        for held in self.leaf.spin_axes(state).iter() {
            let motion = &mut motions[state.base(held.rod)];
            for rate in [&mut motion.v, &mut motion.a, &mut motion.w] {
                rate[0] = held.across(rate[0]);
            }
        }
    }

    /// Attempts a step of h; returns its local error, or `None` if it was too long.
    fn attempt(&mut self, h: f64) -> Option<f64> {
        let damping = self.physics.damping;
        let w = self.weights;
        let of_acceleration = (1.0 - w.alpha_m) / ((1.0 - w.alpha_f) * w.beta * h * h);
        let per_mass = of_acceleration + damping * w.gamma / (w.beta * h);
        self.apply_loads_and_damping(self.clock.time + h, h, per_mass);
        self.correct_load_lag(h);
        self.predict(h);
        self.move_supports(self.clock.time + h);
        let last = match self.control {
            StepControl::Fixed(_) => SETTINGS.fixed_step_iteration_error,
            StepControl::CountOnly(error) => SETTINGS.count_only_iteration_error * error,
            StepControl::LocalError(allowed) => {
                (SETTINGS.iteration_error * allowed).min(SETTINGS.largest_iteration_error)
            }
        };
        let mut before = f64::INFINITY;
        let mut keeps_matrix = false;
        for _ in 0..SETTINGS.most_iterations {
            self.update_motion(h);
            match keeps_matrix {
                true => self.leaf.assemble_forces(&self.trial, &mut self.system),
                false => self.leaf.assemble(&self.trial, &mut self.system),
            };
            let rate = w.gamma / (w.beta * h);
            self.add_follower_forces(self.clock.time + h, (!keeps_matrix).then_some(rate));
            let (moving, inertia) = (&self.next_node_motions, &self.inertia);
            let supports = &self.supports;
            let (leaf, trial, nodes) = (&self.leaf, &self.trial, self.leaf.segments() + 1);
            let inertial = |k: usize, tensor: &DMat3| {
                let m = &moving[k];
                let momentum = *tensor * m.v[0];
                let moment = *tensor * m.w[0] + m.v[0].cross(momentum) + damping * momentum;
                let mut load = Wrench {
                    moment: -moment,
                    force: -inertia[k].mass * (m.w[1] + damping * m.v[1]),
                };
                if inertia[k].is_off_axis() {
                    let s = inertia[k].first_moment(trial.q[k]);
                    load.moment -= s.cross(m.w[1] + damping * m.v[1]);
                    load.force -=
                        m.w[0].cross(s) + m.v[0].cross(m.v[0].cross(s)) + damping * m.v[0].cross(s);
                    load = leaf.node_freedom(k / nodes, k % nodes).of_wrench(load);
                }
                free_wrench(supports, k, load)
            };
            add_inertia(
                &self.leaf,
                &mut self.system,
                trial,
                inertia,
                (!keeps_matrix).then_some(per_mass),
                inertial,
            );
            if !self.solve(keeps_matrix) {
                return None;
            }
            let size = self.system.largest_increment().larger();
            if !size.is_finite() || size > before.max(SETTINGS.largest_rotation) {
                return None;
            }
            self.advance_trial();
            let remaining = match self.control {
                // Two iterations show how fast they converge: the size of the next one.
                StepControl::CountOnly(_) if before.is_finite() => size * size / before,
                _ => size,
            };
            if remaining <= last || (size < SETTINGS.iteration_rounding && size > 0.3 * before) {
                self.update_motion(h);
                return Some(self.local_error(h));
            }
            // The change of the matrix is that of the leaf since it was factorized.
            keeps_matrix = size <= SETTINGS.kept_matrix_increment
                && (!keeps_matrix || size <= SETTINGS.kept_matrix_contraction * before)
                && !self.leaf.holds_spins();
            before = size;
        }
        None
    }

    fn local_error(&self, h: f64) -> f64 {
        let mut error: f64 = 0.0;
        for (next, now) in self.next_node_motions.iter().zip(&self.node_motions) {
            for c in 0..2 {
                error = larger(error, (next.a[c] - now.a[c]).length());
            }
        }
        // Local error: this times h^2 times the change of acceleration.
        error * (self.weights.beta - 1.0 / 6.0).abs() * h * h
    }

    /// Predicts the trial with constant accelerations.
    fn predict(&mut self, h: f64) {
        self.trial.clone_from(&self.state);
        for (k, m) in self.node_motions.iter().enumerate() {
            let d = |c: usize| h * m.v[c] + 0.5 * h * h * m.a[c];
            // If the prediction is far away, the present state is better.
            let turn = d(0);
            if turn.length() < SETTINGS.largest_rotation {
                self.trial.q[k] = (rotation::exp(turn) * self.trial.q[k]).normalize();
                self.trial.x[k] += d(1);
            }
        }
    }

    /// Corrects the auxiliary accelerations for an attempted step of `h`. Under a load that is
    /// linear in time that of a free body is the acceleration alpha_f - alpha_m steps ago, and
    /// then the method has the exact impulse of the load. Where the load changes its slope, or
    /// steps change their length, the lag is another one: without a correction a pulse of few
    /// steps would have another impulse, and go on acting in the longer steps after it.
    fn correct_load_lag(&mut self, h: f64) {
        if !self.physics.loads_vary() {
            return;
        }
        let (now, w) = (self.clock.time, self.weights);
        let times = [now - self.past_step, now, now + h];
        let [before, now, after] = times.map(|t| self.physics.loads(t));
        let lag = ((after - now) - (now - before)) * (w.alpha_m - w.alpha_f);
        let change = lag - self.corrected_loads;
        self.corrected_loads = lag;
        let [before, now, after] = times.map(|t| self.physics.load_factors(t));
        let corrections = self
            .corrected_factors
            .iter_mut()
            .zip(&mut self.factor_changes);
        for (((before, now), after), (corrected, change)) in
            before.zip(now).zip(after).zip(corrections)
        {
            let lag = ((after - now) - (now - before)) * (w.alpha_m - w.alpha_f);
            *change = lag - *corrected;
            *corrected = lag;
        }
        if change != Loads::default() {
            self.add_load_accelerations(change);
        }
        let scheduled = self.factor_changes.iter().any(|change| *change != 0.0);
        if scheduled {
            self.add_scheduled_accelerations();
        }
        if scheduled || change != Loads::default() {
            self.add_off_axis_accelerations(change);
            self.hold_spins(false);
        }
    }

    /// Adds the accelerations of free nodes under the changes of the loads of single veins that vary.
    fn add_scheduled_accelerations(&mut self) {
        let Some(scheduled) = &self.leaf.scheduled_loads else {
            return;
        };
        let (n, rods) = (self.leaf.segments(), self.leaf.rods());
        let together = self.leaf.tips_move_together();
        let (q, factors) = (&self.state.q, &self.factor_changes);
        let rotation = |rod: usize, node: usize| q[rod * (n + 1) + node];
        let of_moment = |moment: DVec3| Wrench {
            moment,
            ..Wrench::default()
        };
        let forces = scheduled.forces.iter().map(|it| {
            let change = Wrench::from_force(factors[it.factor] * it.force);
            (it.rod, it.node, change)
        });
        let levers = scheduled.levers.iter().map(|(number, lever)| {
            let moment = lever.moment(rotation(lever.rod, lever.node));
            (lever.rod, lever.node, of_moment(factors[*number] * moment))
        });
        let moments = scheduled
            .moments
            .iter()
            .map(|(number, it)| (0, it.node, of_moment(factors[*number] * it.moment)));
        let followers = scheduled.followers.iter().map(|it| {
            let turned = (it.load * factors[it.factor]).wrench(rotation(it.rod, it.node));
            (it.rod, it.node, turned)
        });
        for (rod, node, change) in forces.chain(levers).chain(moments).chain(followers) {
            let k = self.state.base(rod) + node;
            if self.is_off_axis_body(k) {
                continue;
            }
            if change.moment != DVec3::ZERO && self.leaf.node_freedom(rod, node).rotation {
                let tensor = self.inertia[k].tensor(self.state.q[k]);
                self.node_motions[k].a[0] += tensor.inverse() * change.moment;
            }
            if change.force == DVec3::ZERO {
                continue;
            }
            // A joint tip moves as a whole.
            let sharing = match together && node == n {
                true => 0..rods,
                false => rod..rod + 1,
            };
            let mass: f64 = { sharing.clone() }
                .map(|j| self.inertia[self.state.base(j) + node].mass)
                .sum();
            for j in sharing {
                let free = self.leaf.node_freedom(j, node);
                let linear = free.of_displacement(change.force / mass);
                self.node_motions[self.state.base(j) + node].a[1] += linear;
            }
        }
    }

    /// Adds the accelerations of free nodes under these loads.
    fn add_load_accelerations(&mut self, loads: Loads) {
        let n = self.leaf.segments();
        let force = |j: usize, i: usize| {
            let weight = self.leaf.grid.node_weight(i) * self.leaf.leaf.length(j);
            weight * self.leaf.leaf.share(j) * loads.gravity
        };
        let rods = 0..self.leaf.rods();
        // The shared tip, if there is one.
        let mut tip = (loads.tip_force, 0.0);
        for j in rods {
            tip.0 += force(j, n);
            tip.1 += self.inertia[self.state.base(j) + n].mass;
        }
        let together = self.leaf.tips_move_together();
        for (j, i) in self.leaf.rod_index_pairs(1..=n) {
            let k = self.state.base(j) + i;
            if self.is_off_axis_body(k) {
                continue;
            }
            let free = self.leaf.node_freedom(j, i);
            let mass = self.inertia[k].mass;
            let linear = match i == n {
                true if together => tip.0 / tip.1,
                true => (force(j, i) + loads.tip_force) / mass,
                false => force(j, i) / mass,
            };
            self.node_motions[k].a[1] += free.of_displacement(linear);
        }
        for NodalMoment { node, moment } in self.leaf.dead_moments_under(loads) {
            if self.leaf.node_freedom(0, node).rotation && !self.is_off_axis_body(node) {
                let tensor = self.inertia[node].tensor(self.state.q[node]);
                self.node_motions[node].a[0] += tensor.inverse() * moment;
            }
        }
    }

    /// Sets the leaf's loads and rest shapes at a time, and in its sections the
    /// internal friction of a step of `h` that ends then: with the strain
    /// rate c0 v + c1 v1 + c2 v2 from this and the last two strains, a rod is
    /// stiffer by 1 + eta c0 and has another rest shape. Inertia enters the matrix as
    /// `per_mass` times the masses.
    fn apply_loads_and_damping(&mut self, time: f64, h: f64, per_mass: f64) {
        self.physics.apply_loads(&mut self.leaf, time);
        let (rest, eta) = (
            self.physics.rest_curvature_factor(time),
            self.physics.retardation,
        );
        let [c0, c1, c2] = rate_weights(h, self.past_step).map(|c| eta * c);
        let n = self.leaf.segments();
        let both = self.leaf.sections.iter_mut().zip(&self.sections);
        for (i, (section, own)) in both.enumerate() {
            *section = *own;
            section.rest_curvature *= rest;
            let stiffer = 1.0 + c0;
            if c0 > 0.0 {
                let before = |kind: usize| {
                    c1 * self.strain_history[0][i][kind] + c2 * self.strain_history[1][i][kind]
                };
                section.rest_strain = (section.rest_strain - before(0)) / stiffer;
                section.rest_curvature = (section.rest_curvature - before(1)) / stiffer;
                section.compliance /= stiffer;
                section.couple_stiffness *= stiffer;
            }
            let node = i / n * (n + 1) + i % n;
            let mass = 0.5 * (self.inertia[node].mass + self.inertia[node + 1].mass);
            let inertial = DVec3::splat(SETTINGS.condensing_ratio * per_mass * mass * section.ds);
            let condensing = (stiffer * own.condensing).max(inertial);
            section.condensing = condensing.min(section.compliance.recip());
        }
        let inertial = |node: usize| SETTINGS.condensing_ratio * per_mass * self.inertia[node].mass;
        (self.leaf).condense_rigid_tissue(&self.strips, inertial);
    }
}

/// Sets the motions of nodes to those of the supports that move them.
fn set_support_motions(supports: &Option<MovingSupports>, motions: &mut [NodeMotion]) {
    for it in supports.iter().flat_map(|supports| &supports.nodes) {
        let motion = &mut motions[it.index];
        if it.holds_rotation {
            motion.v[0] = it.velocity.angular;
            (motion.a[0], motion.w[0]) = (DVec3::ZERO, DVec3::ZERO);
        }
        motion.v[1] = DVec3::select(it.held_axes, it.velocity.linear, motion.v[1]);
        for rate in [&mut motion.a[1], &mut motion.w[1]] {
            *rate = DVec3::select(it.held_axes, DVec3::ZERO, *rate);
        }
    }
}

/// The moment and the force on node `k` without those that a support that moves takes.
fn free_wrench(supports: &Option<MovingSupports>, k: usize, on_node: Wrench) -> Wrench {
    Wrench {
        moment: match MovingSupports::holds_rotation(supports, k) {
            true => DVec3::ZERO,
            false => on_node.moment,
        },
        force: MovingSupports::free_part(supports, k, on_node.force),
    }
}

/// Adds mass times `per_mass` to the matrix, unless that is kept, and a moment and a force to the
/// right-hand side, at all nodes with equations.
fn add_inertia(
    leaf: &DiscreteLeaf,
    system: &mut System,
    state: &State,
    inertia: &[Inertia],
    per_mass: Option<f64>,
    load: impl Fn(usize, &DMat3) -> Wrench,
) {
    let n = state.segments();
    for j in 0..state.rods() {
        for i in system.first_node()..=n {
            let k = state.base(j) + i;
            let tensor = inertia[k].tensor(state.q[k]);
            let Some(per_mass) = per_mass else {
                system.add_load(j, i, load(k, &tensor));
                continue;
            };
            let free_tensor = match i == 0 && leaf.holds_spins() {
                true => leaf.tensor_across_joint(state, j, tensor),
                false => tensor,
            };
            let stiffness = DiagonalBlocks {
                rotary: free_tensor * per_mass,
                translational: inertia[k].mass * per_mass,
            };
            system.add_to_node(j, i, stiffness, load(k, &tensor));
            if let Some(coupling) = inertia[k].coupling(state.q[k], || leaf.node_freedom(j, i)) {
                system.add_rotation_displacement_coupling(j, i, per_mass * coupling);
            }
        }
    }
    system.clear_held_spins();
}

impl SemiImplicit {
    /// Strains (v, u) of all segments.
    fn strains(&self) -> Vec<[DVec3; 2]> {
        let (leaf, state, n) = (&self.leaf, &self.state, self.leaf.segments());
        let strains = |(j, i)| {
            let segment = leaf.segment(state, j, i, state.n[j * n + i]);
            [segment.v(leaf.section(j, i)), segment.u]
        };
        leaf.rod_index_pairs(0..n).map(strains).collect()
    }

    /// Accepts the attempted step of `h` and updates the energy balance, unless steps are only
    /// counted.
    fn accept(&mut self, h: f64) {
        std::mem::swap(&mut self.state, &mut self.trial);
        std::mem::swap(&mut self.node_motions, &mut self.next_node_motions);
        let strains = (self.physics.retardation > 0.0).then(|| self.strains());
        if !matches!(self.control, StepControl::CountOnly(_)) {
            let exchange = self.step_energy_exchange(h, strains.as_deref());
            self.balance.add(exchange);
        }
        if let Some(supports) = &mut self.supports {
            supports.accept();
        }
        if let Some(strains) = strains {
            self.strain_history.swap(0, 1);
            self.strain_history[0] = strains;
        }
        self.corrected_loads = Loads::default();
        self.corrected_factors.fill(0.0);
        self.past_step = h;
        self.longest_taken = self.longest_taken.max(h);
        self.clock.time += h;
        self.clock.steps += 1;
    }
}

impl SemiImplicit {
    /// Adds the loads that turn with the sections, and the drag on the trial, which has the velocities at
    /// the end of the step, in the air of a time to the equations; the derivative of a velocity by the
    /// displacement is `rate`, none if the matrix is kept. The derivatives by the directions of the sections are left out: they make
    /// the matrix unsymmetric, and are small beside that of inertia in steps that resolve the motion.
    fn add_follower_forces(&mut self, time: f64, rate: Option<f64>) {
        self.leaf.add_followers(&self.trial, &mut self.system);
        let Some(wind) = &self.wind else { return };
        let (leaf, system, moving) = (&self.leaf, &mut self.system, &self.next_node_motions);
        let free_axes = |j: usize, i: usize| {
            let ones = leaf.node_freedom(j, i).of_displacement(DVec3::ONE);
            DMat3::from_diagonal(ones)
        };
        let air = self.physics.air(time);
        for ((j, i), drag) in wind.drags(&self.trial, air, |k| moving[k].v[1]) {
            let half = 0.5 * drag.force();
            let stiffness = rate.map(|rate| 0.25 * rate * drag.velocity_derivative());
            let free = [free_axes(j, i), free_axes(j, i + 1)];
            for (node, free) in [i, i + 1].into_iter().zip(free) {
                if free != DMat3::ZERO {
                    system.add_load(j, node, Wrench::from_force(free * half));
                    if let Some(stiffness) = stiffness {
                        system.add_displacement_spring(j, node, free * stiffness * free);
                    }
                }
            }
            if let Some(stiffness) = stiffness
                && !free.contains(&DMat3::ZERO)
            {
                system.add_adjacent_node_spring(j, i, free[0] * stiffness * free[1]);
            }
        }
    }
}
