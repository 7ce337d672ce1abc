//! Newton's method on the unknowns of multiple shooting, and the neutral directions along which
//! it fails.
//!
//! Steps are damped by the natural monotonicity test: the next simplified correction,
//! with the same linearisation, must be smaller than this one (P. Deuflhard, Newton
//! Methods for Nonlinear Problems, Springer 2004, section 3.3). It compares
//! corrections with corrections, and is therefore independent of the scaling of the
//! equations and of their conditioning.
//!
//! Directions in which the equations are nearly singular, and why there is no convergence.

use crate::memory;
use crate::numbers::largest;
use crate::scenario::{Begin, Turning};
use crate::shape::equally_spaced;
use crate::shooting::equations::{Equations, RodState, TANGENT};
use crate::shooting::integrate::{Nodes, Trajectory};
use crate::shooting::intervals::{
    CondensedEquations, GROWTH, Integrated, Units, choose_intervals, integrate, responses,
    sensitivities,
};
use crate::shooting::{Correction, Log, Neutral, Reason};
use glam::DVec3;

/// A leaf that turned by less than this (radians) keeps its linearisation.
const SAME_LINEARIZATION: f64 = 1e-3;

/// Distance from an axis (lengths) within which a point is on it.
const ON_AXIS: f64 = 1e-6;

/// Changes of a base's force and moment, in their units, below which a leaf does not turn: it is
/// straight.
const NO_TURN: f64 = 1e-6;

const MAX_ITERATIONS: usize = 60;

const LEAST_FACTOR: f64 = 1e-3;

/// Contraction below which a start counts as near its solution.
const NEAR: f64 = 0.3;

/// Largest defect of a solution, in its units. Corrections are no measure of it where
/// the linearised equations are singular.
const LARGEST_DEFECT: f64 = 1e-6;

/// A linearisation is kept while it reduces corrections at least by this factor.
const KEEP: f64 = 0.1;

/// Corrections below this multiple of the integration's tolerance need not decrease
/// further: they are noise of its step control.
const NOISE: f64 = 1e3;

/// Singular values of the tip's conditions below this part of the largest are
/// reported as a bifurcation nearby.
const NEARLY_SINGULAR: f64 = 1e-7;

/// Corrections of a leaf at rest below this that a full step does not reduce are what rounding makes
/// of perturbations that grow: no part of a step and no other linearisation reduces them.
const ROUNDED: f64 = 1e-5;

/// Cost of linearisations, in rods times steps of the integration, beyond which Newton's method that
/// may give up has to converge as it does near a solution: some seconds.
const MOST_LINEARIZED: usize = 300_000;

/// Parts of steps of a fresh linearisation below which it gives up: a leaf at rest is near.
const LEAST_PART: f64 = 0.125;

/// The cost of the tissue of a gap in that of a rod.
const TISSUE: usize = 20;

/// Contraction by a full step near a solution.
const CONVERGING: f64 = 0.25;

/// Unless perturbations grow by more than this over an interval, which
/// alone makes the equations nearly singular.
const LARGEST_GROWTH: f64 = 100.0 * GROWTH;

/// Size of the perturbation along a neutral direction whose effect is computed.
const NUDGE: f64 = 1e-5;

/// Stations at which it is computed.
const STATIONS: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];

/// Corrections do not decrease; the last one, relative.
fn no_progress(correction: f64) -> Reason {
    Reason::NoConvergence {
        correction,
        growth: 0.0,
        fixed: false,
        from_leaf: false,
    }
}

/// The state of a run; its linearisation is kept between calls.
pub struct Newton<'e, 'a, 'p> {
    pub equations: &'e Equations<'a>,
    pub units: Units,
    pub nodes: Nodes,
    /// Whether to solve without damping, only if the start is near the solution.
    pub only_near: bool,
    /// Whether it gives up where it does not converge as it does near a solution.
    pub gives_up: bool,
    /// Steps of the last integration, over all intervals.
    steps: usize,
    /// Cost of all linearisations.
    linearized: usize,
    /// Which of the turns without resistance move something.
    moved: Vec<bool>,
    /// The last linearisation.
    pub condensed: Option<CondensedEquations>,
    /// Growth of perturbations over each interval, at that linearisation.
    pub growth: Vec<f64>,
    /// Largest defect at the last evaluation, in the units.
    pub defect: f64,
    now: Correction,
    log: &'e mut Log<'p>,
}

struct Residuals {
    /// End of each interval minus the beginning of the next.
    defects: Vec<Vec<f64>>,
    conditions: Vec<f64>,
}

impl<'e, 'a, 'p> Newton<'e, 'a, 'p> {
    /// Sets up the unknowns from a trajectory, over so many intervals; `None`:
    /// as many as the growth of perturbations needs, if that is possible and
    /// memory allows it.
    pub fn from_trajectory(
        equations: &'e Equations<'a>,
        near: &Trajectory,
        intervals: Option<usize>,
        log: &'e mut Log<'p>,
    ) -> Result<Self, Reason> {
        let mut nodes = match intervals {
            Some(count) => {
                let sigma = equally_spaced(count);
                let states = sigma[..count].iter().map(|&sigma| near.at(sigma)).collect();
                Nodes { sigma, states }
            }
            None => choose_intervals(equations, near)?,
        };
        memory::shooting(equations.rods(), nodes.states.len())?;
        let first = &mut nodes.states[0];
        for j in 0..equations.rods() {
            let rod = RodState::read(first, j);
            equations.held_base(j, &rod).write(first, j);
        }
        Ok(Newton {
            equations,
            units: Units::new(equations, near),
            nodes,
            only_near: false,
            gives_up: false,
            steps: 0,
            linearized: 0,
            moved: (equations.turnings().iter())
                .map(|turning| turns_something(equations, near, turning))
                .collect(),
            condensed: None,
            growth: Vec::new(),
            defect: f64::INFINITY,
            now: Correction {
                way: log.part,
                iteration: 0,
                linearized: 0.0,
                size: f64::INFINITY,
                wanted: 0.0,
            },
            log,
        })
    }

    /// Solves to the accuracy of an integration with `tolerance`.
    pub fn solve(&mut self, tolerance: f64) -> Result<(), Reason> {
        self.iterate(tolerance)
            .map_err(|reason| self.explained(reason))?;
        self.lean_down();
        Ok(())
    }

    fn iterate(&mut self, tolerance: f64) -> Result<(), Reason> {
        self.now.wanted = tolerance;
        let mut factor: f64 = 1.0;
        let mut fresh = self.condensed.is_none();
        let mut residuals = match fresh {
            false => self.residuals_at(&self.nodes.clone(), tolerance)?,
            true => self.linearize(tolerance)?,
        };
        let mut size = f64::INFINITY;
        'iterations: for iteration in 0..MAX_ITERATIONS {
            self.now.iteration = iteration;
            let step = self.correction(&residuals);
            size = size_of(&step);
            if !size.is_finite() {
                break;
            }
            self.now.size = size;
            self.report(1.0);
            factor = if fresh { (2.0 * factor).min(1.0) } else { 1.0 };
            let (trial, next, ratio) = loop {
                let trial = self.moved(&step, factor);
                let tried = self.residuals_at(&trial, tolerance);
                if let Err(Reason::OutOfTime) = tried {
                    return Err(Reason::OutOfTime);
                }
                if let Ok(next) = tried {
                    let remaining = size_of(&self.correction(&next));
                    if remaining <= (1.0 - 0.25 * factor) * size || remaining <= tolerance {
                        break (trial, next, remaining / size);
                    }
                    // Below the noise of the integrator corrections do not decrease.
                    if size <= NOISE * tolerance && remaining <= NOISE * tolerance {
                        break (trial, next, 0.0);
                    }
                }
                let far = || size <= ROUNDED || 0.5 * factor < LEAST_PART;
                if self.costs_too_much() || self.gives_up && fresh && far() {
                    break 'iterations;
                }
                if !fresh {
                    residuals = self.linearize(tolerance)?;
                    fresh = true;
                    continue 'iterations;
                }
                factor *= 0.5;
                if factor < LEAST_FACTOR || self.only_near {
                    break 'iterations;
                }
            };
            self.log.work.iterations += 1;
            self.nodes = trial;
            self.defect = next.largest(self.condensed.as_ref());
            let remaining = ratio * size;
            if factor == 1.0 && (remaining <= tolerance || size <= NOISE * tolerance) {
                let last = self.correction(&next);
                if size_of(&last) <= NOISE * tolerance {
                    self.nodes = self.moved(&last, 1.0);
                }
                return match self.defect <= LARGEST_DEFECT.max(NOISE * tolerance) {
                    true => Ok(()),
                    false => Err(no_progress(size)),
                };
            }
            if self.only_near && ratio > NEAR {
                break;
            }
            let converges = factor == 1.0 && ratio <= CONVERGING;
            if self.costs_too_much() && !converges {
                break;
            }
            let keep = factor == 1.0 && ratio <= KEEP;
            residuals = if keep {
                next
            } else {
                self.linearize(tolerance)?
            };
            fresh = !keep;
        }
        Err(no_progress(size))
    }

    /// Whether another linearisation would cost too much for what may give up.
    fn costs_too_much(&self) -> bool {
        self.gives_up && self.linearized + self.cost() > MOST_LINEARIZED
    }

    /// The cost of a linearisation along the last integration.
    fn cost(&self) -> usize {
        let rods = self.equations.rods();
        let gaps = if self.equations.is_tied() {
            rods - 1
        } else {
            0
        };
        self.steps * (rods + TISSUE * gaps)
    }

    fn linearize(&mut self, tolerance: f64) -> Result<Residuals, Reason> {
        let integrated = self.integrate(&self.nodes.clone(), tolerance, true)?;
        let residuals = self.residuals(&self.nodes, &integrated);
        self.growth.clear();
        let responses = responses(self.equations, &integrated, &mut |part| {
            self.report(part);
            !self.equations.limit.reached()
        });
        let Some(responses) = responses else {
            return Err(Reason::OutOfTime);
        };
        let maps = sensitivities(self.equations, &self.units, &responses, &mut self.growth);
        self.log.work.linearizations += 1;
        self.linearized += self.cost();
        self.condensed = CondensedEquations::new(self.equations, &self.units, maps, &self.turns());
        match self.condensed {
            Some(_) => Ok(residuals),
            None => Err(no_progress(f64::INFINITY)),
        }
    }

    /// The changes at the base as veins turn that can without resistance, in the units; none of those
    /// that move nothing.
    fn turns(&self) -> Vec<Vec<f64>> {
        let base = &self.nodes.states[0];
        let turn = |turning: &Turning| {
            let (rods, axis) = (&turning.rods, turning.axis);
            let mut turn = vec![0.0; TANGENT * self.equations.rods()];
            for j in rods.clone() {
                let rod = RodState::read(base, j);
                let unit = |k: usize| self.units.of(TANGENT * j + k);
                let (force, moment) = (axis.cross(rod.n) / unit(6), axis.cross(rod.m) / unit(9));
                let [spin, _] = turning.rates(rod.r, rod.q, self.equations.length);
                let own = &mut turn[TANGENT * j..TANGENT * (j + 1)];
                // A clamp does not turn.
                if self.equations.free_at_base() == 3 {
                    own[3..6].copy_from_slice(&spin.to_array());
                }
                own[6..9].copy_from_slice(&force.to_array());
                own[9..].copy_from_slice(&moment.to_array());
            }
            turn
        };
        let carries = |turn: &Vec<f64>| turn.iter().any(|value| value.abs() > NO_TURN);
        let turns = self.turnings().map(turn);
        turns.filter(carries).collect()
    }

    /// The turns of the leaf without resistance: on hinges those that moved something in the start.
    fn turnings(&self) -> impl Iterator<Item = &Turning> {
        let turnings = self.equations.turnings().iter().enumerate();
        let moved = turnings.filter(|(k, _)| self.moved[*k]);
        moved.map(|(_, turning)| turning)
    }

    /// Turns veins that can turn without resistance as those of a relaxed leaf are turned.
    fn lean_down(&mut self) {
        let turnings: Vec<Turning> = self.turnings().cloned().collect();
        for turning in turnings {
            let rods = &turning.rods;
            let bases = |j: usize| RodState::read(&self.nodes.states[0], j);
            let natural = self.equations.clamped();
            let begin = |j: usize| Begin {
                natural: RodState::read(&natural, j).q,
                now: bases(j).q,
            };
            let begins: Vec<Begin> = rods.clone().map(begin).collect();
            let clamped = self.equations.free_at_base() == 6;
            let moments = clamped.then(|| rods.clone().map(|j| bases(j).m).sum());
            let angle = turning.angle_to_lean(&begins, moments);
            let [turn, back] = turning.rotations(angle);
            let point = turning.point / self.equations.length;
            for (k, state) in self.nodes.states.iter_mut().enumerate() {
                for j in rods.clone() {
                    let rod = RodState::read(state, j);
                    let turned = RodState {
                        r: point + turn * (rod.r - point),
                        q: turn * rod.q * back,
                        n: turn * rod.n,
                        m: turn * rod.m,
                    };
                    let turned = match k {
                        0 => self.equations.held_base(j, &turned),
                        _ => turned,
                    };
                    turned.write(state, j);
                }
            }
            if angle.abs() > SAME_LINEARIZATION {
                self.condensed = None;
            }
        }
    }

    /// Reports progress, with this part of the linearisation done.
    fn report(&mut self, linearized: f64) {
        self.now.linearized = linearized;
        (self.log.progress)(&self.now);
    }

    fn residuals_at(&mut self, nodes: &Nodes, tolerance: f64) -> Result<Residuals, Reason> {
        let integrated = self.integrate(nodes, tolerance, false)?;
        Ok(self.residuals(nodes, &integrated))
    }

    fn integrate(
        &mut self,
        nodes: &Nodes,
        tolerance: f64,
        linear: bool,
    ) -> Result<Vec<Integrated>, Reason> {
        if self.equations.limit.reached() {
            return Err(Reason::OutOfTime);
        }
        let integrated = integrate(self.equations, nodes, tolerance, linear)?;
        self.steps = integrated.iter().map(|interval| interval.count).sum();
        self.log.work.steps += self.steps;
        for interval in &integrated {
            self.log.work.slopes += interval.evaluations;
        }
        Ok(integrated)
    }

    fn residuals(&self, nodes: &Nodes, integrated: &[Integrated]) -> Residuals {
        let (last, inner) = integrated.split_last().expect("there is an interval");
        Residuals {
            defects: (inner.iter().zip(&nodes.states[1..]))
                .map(|(interval, begin)| self.units.difference(&interval.end, begin))
                .collect(),
            conditions: self.equations.tip_conditions(&last.end),
        }
    }

    fn correction(&self, residuals: &Residuals) -> Vec<Vec<f64>> {
        let condensed = self.condensed.as_ref().expect("linearised before");
        condensed.solve(&residuals.defects, &condensed.scaled(&residuals.conditions))
    }

    /// The unknowns plus `factor` times a step.
    fn moved(&self, step: &[Vec<f64>], factor: f64) -> Nodes {
        let mut nodes = self.nodes.clone();
        for (y, increment) in nodes.states.iter_mut().zip(step) {
            self.units.advance(y, increment, factor);
        }
        nodes
    }
}

impl Residuals {
    fn largest(&self, condensed: Option<&CondensedEquations>) -> f64 {
        let tip = condensed.map(|condensed| condensed.scaled(&self.conditions));
        let defects = self.defects.iter().chain(&tip).flatten();
        largest(defects.map(|value| value.abs()))
    }
}

/// Whether a turn moves something of the leaf at the start; for clamped veins their forces tell it.
fn turns_something(equations: &Equations, near: &Trajectory, turning: &Turning) -> bool {
    let stations = STATIONS.iter().map(|sigma| near.at(*sigma));
    let states: Vec<Vec<f64>> = stations.collect();
    let of_rod = |j: usize| states.iter().map(move |y| RodState::read(y, j).r);
    let points: Vec<DVec3> = turning.rods.clone().flat_map(of_rod).collect();
    let point = turning.point / equations.length;
    turning.own < 0.0 || turning.moves(&points, point, ON_AXIS)
}

/// The largest component of an increment.
fn size_of(step: &[Vec<f64>]) -> f64 {
    largest(step.iter().flatten().map(|value| value.abs()))
}

impl Newton<'_, '_, '_> {
    /// Smallest singular value of the condensed equations over the largest.
    pub fn condition(&self) -> f64 {
        self.condensed
            .as_ref()
            .map_or(1.0, |condensed| condensed.condition())
    }

    /// Why there is no convergence, as far as the last linearisation shows it.
    pub(super) fn explained(&self, reason: Reason) -> Reason {
        let Reason::NoConvergence {
            correction,
            fixed,
            from_leaf,
            ..
        } = reason
        else {
            return reason;
        };
        match self.neutral(&STATIONS) {
            Some(neutral) => Reason::Singular(neutral),
            None if self.gives_up => Reason::Rounding {
                correction,
                growth: self.growth.iter().map(|growth| growth.log10()).sum(),
            },
            None => {
                let growths = self.growth.iter().map(|growth| growth.log10());
                let growth = largest(growths);
                Reason::NoConvergence {
                    correction,
                    growth,
                    fixed,
                    from_leaf,
                }
            }
        }
    }

    /// The neutral direction, if the equations are nearly singular: the effect on the rods of a
    /// small perturbation along it.
    pub fn neutral(&self, stations: &[f64]) -> Option<Neutral> {
        let trusted = self.growth.iter().all(|growth| *growth < LARGEST_GROWTH);
        let condensed = self.condensed.as_ref()?;
        if !trusted || condensed.condition() > NEARLY_SINGULAR {
            return None;
        }
        let direction = condensed.null();
        let nudged = self.moved(&direction, NUDGE / size_of(&direction));
        let sampled =
            |nodes: &Nodes| Trajectory::sampled(self.equations, nodes, stations, NUDGE * NUDGE);
        let (at, perturbed) = (sampled(&self.nodes).ok()?, sampled(&nudged).ok()?);
        let (at, perturbed) = (at.shape(self.equations), perturbed.shape(self.equations));
        let mut displacement: Vec<Vec<DVec3>> = (at.iter().zip(&perturbed))
            .map(|(at, perturbed)| {
                let nodes = at.nodes.iter().zip(&perturbed.nodes);
                nodes.map(|(a, b)| b.position - a.position).collect()
            })
            .collect();
        let lengths = displacement.iter().flatten().map(|d| d.length());
        let most = largest(lengths);
        for displacement in displacement.iter_mut().flatten() {
            *displacement /= most;
        }
        Some(Neutral {
            ratio: self.condition(),
            displacement,
        })
    }
}
