//! The semi-implicit method: the generalised-alpha method of Chung and Hulbert
//! (J. Appl. Mech. 60, 1993) on rotations (Bruls, Cardona, Arnold, Mech. Mach.
//! Theory 48, 2012).
//!
//! It is of second order, stable at any time step for any stiffness, and damps
//! only what the step does not resolve. Every step solves the balance of
//! momentum at its end by Newton's method, with the matrices and the mixed
//! form of the relaxation: rigid rods are allowed. Spatial increments turn
//! the nodes, as everywhere.
//!
//! With d the increment over a step h, v the velocity, a an auxiliary
//! acceleration and w the true one,
//!
//! ```text
//! d = h v0 + h^2 ((1/2 - beta) a0 + beta a1),   v1 = v0 + h ((1 - gamma) a0 + gamma a1)
//! (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) w1 + alpha_f w0
//! ```

use glam::{DMat3, DVec3};

use super::friction::rates;
use super::ledger::{Exchange, Ledger, measure};
use super::method::{Broken, Method, Snapshot, Velocity};
use super::physics::{Inertia, Physics};
use crate::leaf::{DiscreteLeaf, Loads, Solved, SparsePattern, State, System};
use crate::rod::Section;
use crate::rotation;

/// Spectral radius at infinite frequency: what remains in a step of what it
/// cannot resolve. Smaller values damp more of what it can.
const REMAINING: f64 = 0.8;

const ALPHA_M: f64 = (2.0 * REMAINING - 1.0) / (REMAINING + 1.0);
const ALPHA_F: f64 = REMAINING / (REMAINING + 1.0);
const GAMMA: f64 = 0.5 + ALPHA_F - ALPHA_M;
const BETA: f64 = 0.25 * (GAMMA + 0.5) * (GAMMA + 0.5);

/// Newton iterations in a step, and the size of the last (radians, lengths),
/// as a part of the error allowed and at most.
const ITERATIONS: usize = 12;
const LAST_ITERATION: f64 = 1e-3;
const LARGEST_LAST: f64 = 1e-9;

/// Relative accuracy of the conjugate gradients.
const CG_TOLERANCE: f64 = 1e-10;

/// Largest rotation of a node in a step, radians.
const LARGEST_TURN: f64 = 0.5;

/// Shortest step.
const SHORTEST_STEP: f64 = 1e-10;

/// Local error of a step: this times h^2 times the change of acceleration.
const ERROR: f64 = BETA - 1.0 / 6.0;

/// Bounds of the change of the step.
const GROWTH: (f64, f64) = (0.2, 2.0);

/// Steps that lead from where a start violates a rigid rod to where it does not.
const PROJECTIONS: usize = 20;

/// How long time steps are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// All of this length, but those that hit the times asked for.
    Fixed(f64),
    /// So that the local error of positions (lengths) and rotations (radians)
    /// stays below this.
    Error(f64),
}

/// Motion of a node.
#[derive(Clone, Copy, Debug, Default)]
struct Moving {
    /// Velocity: angular, linear.
    v: [DVec3; 2],
    /// Auxiliary acceleration.
    a: [DVec3; 2],
    /// Acceleration.
    w: [DVec3; 2],
}

/// A leaf on the move.
pub struct SemiImplicit<'a> {
    leaf: DiscreteLeaf<'a>,
    physics: Physics,
    inertia: Vec<Inertia>,
    /// The rods' own sections, where internal damping changes them.
    sections: Vec<Section>,
    /// Strains (v, u) of all segments at the last step and the one before, and
    /// the width of the step between.
    past: [Vec<[DVec3; 2]>; 2],
    past_step: f64,
    /// Power of internal friction at the last step.
    rubbing: f64,
    system: System,
    direct: Option<SparsePattern>,
    state: State,
    trial: State,
    next: State,
    moving: Vec<Moving>,
    next_moving: Vec<Moving>,
    steps: Steps,
    step: f64,
    time: f64,
    count: usize,
    /// Factorisations so far.
    pub factorizations: usize,
    ledger: Ledger,
}

impl<'a> SemiImplicit<'a> {
    /// A leaf at rest in `state`.
    pub fn new(leaf: DiscreteLeaf<'a>, physics: Physics, state: &State, steps: Steps) -> Self {
        let n = leaf.segments();
        let nodes = (0..leaf.rods()).flat_map(|j| (0..=n).map(move |i| (j, i)));
        let inertia = nodes
            .map(|(j, i)| physics.inertia(leaf.leaf, &leaf.grid, j, i))
            .collect();
        let system = System::new(&leaf);
        let mut motion = SemiImplicit {
            inertia,
            sections: leaf.sections.clone(),
            past: [Vec::new(), Vec::new()],
            past_step: 0.0,
            rubbing: 0.0,
            system,
            direct: None,
            state: state.clone(),
            trial: state.clone(),
            next: state.clone(),
            moving: vec![Moving::default(); state.x.len()],
            next_moving: vec![Moving::default(); state.x.len()],
            step: match steps {
                Steps::Fixed(h) => h,
                Steps::Error(error) => 0.1 * error.cbrt(),
            },
            steps,
            time: 0.0,
            count: 0,
            factorizations: 0,
            ledger: Ledger::default(),
            leaf,
            physics,
        };
        motion.dress(0.0, 0.0);
        motion.carry();
        motion.accelerate();
        motion.past = [motion.strains(), motion.strains()];
        let start = motion.snapshot();
        motion.ledger.begin(&start);
        motion
    }

    /// Lets every segment carry the force its strain tells. Where a rigid one
    /// is strained, the leaf is first moved as little as its masses allow.
    fn carry(&mut self) {
        if self.leaf.stiffest() > 0.0 {
            let n = self.leaf.segments();
            for j in 0..self.leaf.rods() {
                for i in 0..n {
                    let section = *self.leaf.section(j, i);
                    let segment = self.leaf.segment(&self.state, j, i, DVec3::ZERO);
                    let strain = segment.v(&section) - section.rest_strain;
                    self.state.n[j * n + i] = segment.frame * (strain / section.compliance);
                }
            }
            return;
        }
        let heavy = 1.0 / (SHORTEST_STEP * SHORTEST_STEP).sqrt();
        for _ in 0..PROJECTIONS {
            self.leaf.assemble(&self.state, &mut self.system);
            let nothing = |_: usize, _: &DMat3| (DVec3::ZERO, DVec3::ZERO);
            add_inertia(&mut self.system, &self.state, &self.inertia, heavy, nothing);
            if !self.solve() {
                return;
            }
            self.leaf
                .advance(&self.state, &self.system, 1.0, &mut self.next);
            std::mem::swap(&mut self.state, &mut self.next);
            let (turn, shift) = self.system.largest();
            if turn.max(shift) < 1e-14 {
                return;
            }
        }
    }

    /// Accelerations of a leaf at rest.
    fn accelerate(&mut self) {
        self.leaf.assemble(&self.state, &mut self.system);
        let n = self.leaf.segments();
        let joined = self.leaf.leaf.joined() && self.leaf.rods() > 1;
        let (mut tip_force, mut tip_mass) = (DVec3::ZERO, 0.0);
        for j in 0..self.leaf.rods() {
            for i in 1..=n {
                let k = self.state.base(j) + i;
                let (moment, force) = self.system.unbalanced(j, i);
                let inertia = self.inertia[k];
                let tensor = tensor(&inertia, &self.state, k);
                let w = [tensor.inverse() * moment, force / inertia.mass];
                if i == n {
                    tip_force += force;
                    tip_mass += inertia.mass;
                }
                self.moving[k] = Moving {
                    w,
                    a: w,
                    ..Moving::default()
                };
            }
        }
        if joined {
            for j in 0..self.leaf.rods() {
                let k = self.state.base(j) + n;
                self.moving[k].w[1] = tip_force / tip_mass;
                self.moving[k].a[1] = tip_force / tip_mass;
            }
        }
    }

    /// Factorises and solves; false if the matrix is not positive definite.
    fn solve(&mut self) -> bool {
        self.factorizations += 1;
        if self.direct.is_none() {
            if !self.system.factorize(0.0) {
                return false;
            }
            match self.system.solve(None, CG_TOLERANCE) {
                Solved::Yes(_) => return true,
                Solved::Indefinite(_) => return false,
                Solved::TooSlow(_) => self.direct = SparsePattern::new(&self.system).ok(),
            }
        }
        let Some(Ok(mut factor)) = (self.direct.as_ref()).map(|p| p.factorize(&self.system, 0.0))
        else {
            return false;
        };
        let positive = factor.negative() == 0;
        if positive {
            factor.solve(&mut self.system, None);
        }
        positive
    }

    /// Motion at the end of a step of h that leads from the state to the trial.
    fn arrive(&mut self, h: f64) {
        let nodes = self.leaf.segments() + 1;
        for k in 0..self.state.x.len() {
            // Bases are held; rounding must not move them.
            if k.is_multiple_of(nodes) {
                continue;
            }
            let m = self.moving[k];
            let turn = self.trial.q[k] * self.state.q[k].conjugate();
            let d = [rotation::log(turn), self.trial.x[k] - self.state.x[k]];
            let next = &mut self.next_moving[k];
            for c in 0..2 {
                let a1 = (d[c] - h * m.v[c] - h * h * (0.5 - BETA) * m.a[c]) / (BETA * h * h);
                next.a[c] = a1;
                next.v[c] = m.v[c] + h * ((1.0 - GAMMA) * m.a[c] + GAMMA * a1);
                next.w[c] =
                    ((1.0 - ALPHA_M) * a1 + ALPHA_M * m.a[c] - ALPHA_F * m.w[c]) / (1.0 - ALPHA_F);
            }
        }
    }

    /// One step of h; returns its local error, or `None` if it was too long.
    fn attempt(&mut self, h: f64, allowed: f64) -> Option<f64> {
        self.dress(self.time + h, h);
        self.predict(h);
        let damping = self.physics.damping;
        let heavy =
            (1.0 - ALPHA_M) / ((1.0 - ALPHA_F) * BETA * h * h) + damping * GAMMA / (BETA * h);
        let last = (LAST_ITERATION * allowed).min(LARGEST_LAST);
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.arrive(h);
            self.leaf.assemble(&self.trial, &mut self.system);
            let (moving, inertia) = (&self.next_moving, &self.inertia);
            let inertial = |k: usize, tensor: &DMat3| {
                let m = &moving[k];
                let momentum = *tensor * m.v[0];
                let moment = *tensor * m.w[0] + m.v[0].cross(momentum) + damping * momentum;
                (-moment, -inertia[k].mass * (m.w[1] + damping * m.v[1]))
            };
            add_inertia(&mut self.system, &self.trial, inertia, heavy, inertial);
            if !self.solve() {
                return None;
            }
            let (turn, shift) = self.system.largest();
            let size = turn.max(shift);
            if !size.is_finite() || size > before.max(LARGEST_TURN) {
                return None;
            }
            self.leaf
                .advance(&self.trial, &self.system, 1.0, &mut self.next);
            std::mem::swap(&mut self.trial, &mut self.next);
            if size <= last || (size < 1e-11 && size > 0.3 * before) {
                self.arrive(h);
                return Some(self.local_error(h));
            }
            before = size;
        }
        None
    }

    /// Local error of a step, and whether it turned too far.
    fn local_error(&self, h: f64) -> f64 {
        let mut error: f64 = 0.0;
        for (next, now) in self.next_moving.iter().zip(&self.moving) {
            for c in 0..2 {
                error = error.max((next.a[c] - now.a[c]).length());
            }
        }
        error * ERROR.abs() * h * h
    }

    /// Where the leaf would be at the end of a step if its acceleration did
    /// not change.
    fn predict(&mut self, h: f64) {
        self.trial.clone_from(&self.state);
        for (k, m) in self.moving.iter().enumerate() {
            let d = |c: usize| h * m.v[c] + 0.5 * h * h * m.a[c];
            // Far from the present the present is the better guess.
            let turn = d(0);
            if turn.length() < LARGEST_TURN {
                self.trial.q[k] = (rotation::exp(turn) * self.trial.q[k]).normalize();
                self.trial.x[k] += d(1);
            }
        }
    }

    /// Gives the leaf its loads and rest shapes at a time, and to its sections
    /// the internal friction of a step of `h` that ends then: with the strain
    /// rate c0 v + c1 v1 + c2 v2 from this and the last two strains, a rod is
    /// stiffer by 1 + eta c0 and rests elsewhere.
    fn dress(&mut self, time: f64, h: f64) {
        self.leaf.loads = self.physics.loads(time);
        let (rest, eta) = (self.physics.rest(time), self.physics.retardation);
        if rest == 1.0 && eta == 0.0 && !self.physics.rest_changes() {
            return;
        }
        let [c0, c1, c2] = rates(h, self.past_step).map(|c| eta * c);
        for (i, (section, own)) in self
            .leaf
            .sections
            .iter_mut()
            .zip(&self.sections)
            .enumerate()
        {
            *section = *own;
            section.rest_curvature *= rest;
            if c0 > 0.0 {
                let stiffer = 1.0 + c0;
                let before = |kind: usize| c1 * self.past[0][i][kind] + c2 * self.past[1][i][kind];
                section.rest_strain = (section.rest_strain - before(0)) / stiffer;
                section.rest_curvature = (section.rest_curvature - before(1)) / stiffer;
                section.compliance /= stiffer;
                section.condensing *= stiffer;
                section.couple_stiffness *= stiffer;
            }
        }
    }

    /// Strains (v, u) of all segments.
    fn strains(&self) -> Vec<[DVec3; 2]> {
        let n = self.leaf.segments();
        (0..self.leaf.rods())
            .flat_map(|j| (0..n).map(move |i| (j, i)))
            .map(|(j, i)| {
                let segment = self
                    .leaf
                    .segment(&self.state, j, i, self.state.n[j * n + i]);
                [segment.v(self.leaf.section(j, i)), segment.u]
            })
            .collect()
    }

    /// Makes the attempted step of `h`, and accounts for it.
    fn accept(&mut self, h: f64) {
        std::mem::swap(&mut self.state, &mut self.trial);
        std::mem::swap(&mut self.moving, &mut self.next_moving);
        let mut exchange = Exchange {
            dissipated: self.physics.damping * self.dragged(),
            work: self.changed(h),
        };
        if self.physics.retardation > 0.0 {
            let rubbing = self.rub(h);
            exchange.dissipated += 0.5 * h * (self.rubbing + rubbing);
            self.rubbing = rubbing;
            let now = self.strains();
            let last = std::mem::replace(&mut self.past[0], now);
            self.past[1] = last;
            self.past_step = h;
        }
        self.ledger.add(exchange);
        self.time += h;
        self.count += 1;
    }

    /// Work of what changed in the accepted step of `h`: as much as it would
    /// be on the mean of the states before (the trial) and after.
    fn changed(&mut self, h: f64) -> f64 {
        let (from, to) = (self.time, self.time + h);
        let mut work = 0.0;
        if self.physics.loads_change() {
            let mut potential = |loads: Loads| {
                self.leaf.loads = loads;
                self.leaf.potential(&self.trial) + self.leaf.potential(&self.state)
            };
            let before = potential(self.physics.loads(from));
            work += 0.5 * (potential(self.physics.loads(to)) - before);
        }
        if self.physics.rest_changes() {
            let bending =
                |rest: f64| self.bending(&self.trial, rest) + self.bending(&self.state, rest);
            work += 0.5 * (bending(self.physics.rest(to)) - bending(self.physics.rest(from)));
        }
        let moments = [from, to].map(|time| self.physics.loads(time).tip_moment);
        if self.leaf.rods() == 1 && moments != [DVec3::ZERO; 2] {
            let tip = self.state.x.len() - 1;
            let turn = rotation::log(self.state.q[tip] * self.trial.q[tip].conjugate());
            work += 0.5 * (moments[0] + moments[1]).dot(turn);
        }
        work
    }

    /// Energy of bending in a state with the rest curvatures times `rest`.
    fn bending(&self, state: &State, rest: f64) -> f64 {
        let n = self.leaf.segments();
        let nodes = (0..self.leaf.rods()).flat_map(|j| (0..n).map(move |i| (j, i)));
        nodes
            .zip(&self.sections)
            .map(|((j, i), own)| {
                let u = self.leaf.segment(state, j, i, DVec3::ZERO).u;
                let bent = u - rest * own.rest_curvature;
                0.5 * own.ds * bent.dot(own.couple_stiffness * bent)
            })
            .sum()
    }

    /// Power of internal friction at the end of a step of `h`.
    fn rub(&self, h: f64) -> f64 {
        let [c0, c1, c2] = rates(h, self.past_step);
        let mut power = 0.0;
        for (i, now) in self.strains().iter().enumerate() {
            let section = &self.sections[i];
            let rate = |kind: usize| {
                c0 * now[kind] + c1 * self.past[0][i][kind] + c2 * self.past[1][i][kind]
            };
            let (v, u) = (rate(0), rate(1));
            for c in 0..3 {
                if section.compliance[c] > 0.0 {
                    power += section.ds * v[c] * v[c] / section.compliance[c];
                }
                power += section.ds * u[c] * u[c] * section.couple_stiffness[c];
            }
        }
        self.physics.retardation * power
    }

    /// The mean momentum of the accepted step times the way it led: work of
    /// external damping, over its rate. Of what the step does not resolve,
    /// which alternates, nothing is left in it.
    fn dragged(&self) -> f64 {
        let mut sum = 0.0;
        for (k, inertia) in self.inertia.iter().enumerate() {
            let (before, after) = (&self.next_moving[k], &self.moving[k]);
            let mean = |c: usize| 0.5 * (before.v[c] + after.v[c]);
            let turn = rotation::log(self.state.q[k] * self.trial.q[k].conjugate());
            let shift = self.state.x[k] - self.trial.x[k];
            sum += turn.dot(tensor(inertia, &self.state, k) * mean(0));
            sum += inertia.mass * shift.dot(mean(1));
        }
        sum
    }
}

/// Adds mass times `heavy` to the matrix, and a moment and a force to the
/// right-hand side, at all nodes but the bases.
fn add_inertia(
    system: &mut System,
    state: &State,
    inertia: &[Inertia],
    heavy: f64,
    load: impl Fn(usize, &DMat3) -> (DVec3, DVec3),
) {
    let n = state.segments();
    for j in 0..state.rods() {
        for i in 1..=n {
            let k = state.base(j) + i;
            let tensor = tensor(&inertia[k], state, k);
            let matrix = (tensor * heavy, inertia[k].mass * heavy);
            system.add(j, i, matrix, load(k, &tensor));
        }
    }
}

/// Tensor of inertia of a node.
fn tensor(inertia: &Inertia, state: &State, k: usize) -> DMat3 {
    let d1 = state.q[k] * DVec3::X;
    let excess = inertia.excess * inertia.transverse;
    DMat3::from_diagonal(DVec3::splat(inertia.transverse)) + rotation::outer(d1, d1) * excess
}

impl Method for SemiImplicit<'_> {
    fn name(&self) -> &'static str {
        "semi-implicit"
    }

    fn time(&self) -> f64 {
        self.time
    }

    fn steps(&self) -> usize {
        self.count
    }

    fn advance(&mut self, until: f64) -> Result<(), Broken> {
        while self.time < until {
            let left = until - self.time;
            let count = (left / self.step * (1.0 - 1e-12)).ceil().max(1.0);
            // The last two steps share what is left.
            let last = count == 1.0;
            let h = match self.steps {
                Steps::Fixed(_) => left / count,
                Steps::Error(_) if count <= 2.0 => left / count,
                Steps::Error(_) => self.step,
            };
            let allowed = match self.steps {
                Steps::Fixed(_) => LARGEST_LAST,
                Steps::Error(error) => error,
            };
            let error = self.attempt(h, allowed);
            if let (Steps::Error(allowed), Some(error)) = (self.steps, error) {
                let factor = 0.9 * (allowed / error.max(1e-300)).cbrt();
                let next = h * factor.clamp(GROWTH.0, GROWTH.1);
                if error > allowed {
                    self.step = next;
                    continue;
                }
                // A step cut short by `until` says little about the next.
                self.step = if last { next.max(self.step) } else { next };
            }
            match error {
                Some(_) => self.accept(h),
                None => self.step = 0.25 * h,
            }
            if self.step < SHORTEST_STEP {
                return Err(Broken::StepTooShort { time: self.time });
            }
            if error.is_some() && last {
                self.time = until;
            }
        }
        let now = self.snapshot();
        (self.ledger).judge(&self.leaf, &self.physics, &now, self.step)
    }

    fn snapshot(&mut self) -> Snapshot {
        let velocity: Vec<Velocity> = (self.moving.iter())
            .map(|m| Velocity {
                angular: m.v[0],
                linear: m.v[1],
            })
            .collect();
        self.leaf.sections.clone_from(&self.sections);
        let energy = measure(
            &mut self.leaf,
            &self.physics,
            self.time,
            &self.state,
            &velocity,
        );
        Snapshot {
            time: self.time,
            energy: self.ledger.complete(energy, Exchange::default()),
            state: self.state.clone(),
            velocity,
        }
    }

    fn save(&self) -> Vec<f64> {
        let mut numbers = vec![
            self.time,
            self.count as f64,
            self.step,
            self.past_step,
            self.rubbing,
            f64::from(u8::from(self.direct.is_some())),
        ];
        numbers.extend(self.ledger.save());
        numbers.extend(self.state.x.iter().flat_map(|x| x.to_array()));
        numbers.extend(self.state.q.iter().flat_map(|q| q.to_array()));
        numbers.extend(self.state.n.iter().flat_map(|n| n.to_array()));
        for m in &self.moving {
            numbers.extend([m.v, m.a, m.w].iter().flatten().flat_map(|v| v.to_array()));
        }
        let past = self.past.iter().flatten().flatten();
        numbers.extend(past.flat_map(|v| v.to_array()));
        numbers
    }

    fn restore(&mut self, numbers: &[f64]) -> bool {
        if numbers.len() != self.save().len() {
            return false;
        }
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next().unwrap_or_default();
        self.time = next();
        self.count = next() as usize;
        self.step = next();
        self.past_step = next();
        self.rubbing = next();
        let direct = next() == 1.0;
        self.ledger.restore(&mut next);
        let vector = |next: &mut dyn FnMut() -> f64| DVec3::new(next(), next(), next());
        for x in &mut self.state.x {
            *x = vector(&mut next);
        }
        for q in &mut self.state.q {
            *q = glam::DQuat::from_xyzw(next(), next(), next(), next());
        }
        for n in &mut self.state.n {
            *n = vector(&mut next);
        }
        for m in &mut self.moving {
            for v in [&mut m.v, &mut m.a, &mut m.w].into_iter().flatten() {
                *v = vector(&mut next);
            }
        }
        for v in self.past.iter_mut().flatten().flatten() {
            *v = vector(&mut next);
        }
        // The solver in use decides the last digits, too.
        self.leaf.assemble(&self.state, &mut self.system);
        self.direct = match direct {
            true => SparsePattern::new(&self.system).ok(),
            false => None,
        };
        true
    }
}
