//! Newton's method on the unknowns of multiple shooting, and the neutral directions along which
//! it fails.
//!
//! Steps are damped by the natural monotonicity test: the next simplified correction,
//! with the same linearization, must be smaller than this one (P. Deuflhard, Newton
//! Methods for Nonlinear Problems, Springer 2004, section 3.3). It compares
//! corrections with corrections, and is therefore independent of the scaling of the
//! equations and of their conditioning. Where it fails the last linearization tells why.

use crate::memory;
use crate::numbers::largest;
use crate::scenario::{BaseRotations, ZeroEnergyRotation};
use crate::shape::equally_spaced;
use crate::shooting::equations::BoundaryValueProblem;
use crate::shooting::integrate::{LeafTrajectory, ShootingNodes, longest_step};
use crate::shooting::intervals::{
    CondensedEquations, INTERVAL_CHOICE, IntegratedInterval, PerturbationUnits, choose_intervals,
    integrate, responses, sensitivities,
};
use crate::shooting::rod_state::{PERTURBATION_SIZE, RodState};
use crate::shooting::{CorrectionProgress, NeutralDirection, ShootingFailureReason, ShootingLog};
use glam::{DQuat, DVec3};
use std::f64::consts::LOG10_E;

/// What controls Newton's method. Corrections are in the units of the unknowns.
struct ShootingNewtonControl {
    /// Most corrections: twice as many prolong only what does not converge.
    most_iterations: usize,
    /// Smallest part of a step that damping tries.
    least_factor: f64,
    /// Smallest part of a step of a fresh linearization that is tried where Newton's method may give
    /// up: a leaf at rest is near.
    least_fresh_factor: f64,
    /// Contraction of corrections below which a start counts as near its solution. Doubled,
    /// continuation takes longer steps and may change the solution.
    near_start_contraction: f64,
    /// Contraction by a full step near a solution.
    converging_contraction: f64,
    /// Contraction up to which a linearization is kept. Doubled, linearizations are fewer and
    /// corrections more.
    reuse_contraction: f64,
    /// Largest defect of a solution. Corrections are no measure of it where the linearized equations
    /// are singular.
    largest_defect: f64,
    /// Corrections below this multiple of the integration's tolerance need not decrease further: they
    /// are noise of its step control.
    noise_factor: f64,
    /// Corrections of a leaf at rest below this that a full step does not reduce are what rounding
    /// makes of perturbations that grow: no part of a step and no other linearization reduces them.
    rounding: f64,
    /// Cost of all linearizations, in rods times steps of the integration, beyond which Newton's
    /// method that may give up has to converge as it does near a solution: some seconds.
    largest_cost: usize,
    /// Estimated cost of a solution of a leaf with tissue beyond which nothing is begun, likewise: about
    /// two seconds.
    largest_estimate: f64,
    /// Linearizations and integrations in this estimate: a solution with two tolerances takes so many.
    estimated_linearizations: usize,
    estimated_integrations: usize,
    /// Size of a correction beyond which no part of it is tried where Newton's method may give up: a leaf at
    /// rest is nearer, and what begins there takes many short steps.
    largest_correction: f64,
    /// Cost of the slopes of a rod with tissue, over that of a linearization without.
    slope_cost: usize,
    /// Cost of a linearization of the tissue of a gap over that of a rod.
    tissue_cost: usize,
    /// Cost of a response through the tissue of a gap to perturbations of a rod, likewise.
    response_cost: usize,
    /// Such a cost where stresses of the tissue are unknowns.
    stress_response_cost: usize,
    /// A leaf that turned by less than this (radians) keeps its linearization.
    relinearization_angle: f64,
    /// Distance from an axis (lengths) within which a point is on it.
    axis_distance: f64,
    /// Changes of a base's force and moment, in their units, below which a turn of the leaf changes
    /// nothing: it is straight.
    turn_load: f64,
}

const CONTROL: ShootingNewtonControl = ShootingNewtonControl {
    most_iterations: 60,
    least_factor: 1e-3,
    least_fresh_factor: 0.125,
    near_start_contraction: 0.3,
    converging_contraction: 0.25,
    reuse_contraction: 0.1,
    largest_defect: 1e-6,
    noise_factor: 1e3,
    rounding: 1e-5,
    largest_cost: 300_000,
    largest_estimate: 150_000.0,
    estimated_linearizations: 3,
    estimated_integrations: 8,
    largest_correction: 100.0,
    slope_cost: 7,
    tissue_cost: 12,
    response_cost: 6,
    stress_response_cost: 16,
    relinearization_angle: 1e-3,
    axis_distance: 1e-6,
    turn_load: 1e-6,
};

/// When equations count as nearly singular, and how their neutral direction is measured.
struct NeutralCriterion {
    /// Smallest singular value of the tip's conditions, as a part of the largest, below which a
    /// bifurcation is reported nearby.
    singular_ratio: f64,
    /// Growth over an interval above which nothing is reported: it alone makes the equations nearly
    /// singular.
    largest_growth: f64,
    /// Size of the perturbation along the neutral direction whose effect is computed; the integration
    /// has its square as tolerance.
    perturbation: f64,
    /// Fractions of the length at which it is computed for a failure.
    stations: [f64; 9],
}

const NEUTRAL: NeutralCriterion = NeutralCriterion {
    singular_ratio: 1e-7,
    largest_growth: 100.0 * INTERVAL_CHOICE.largest_growth,
    perturbation: 1e-5,
    stations: [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0],
};

/// The reason that corrections do not decrease, of which the last is `correction`.
fn no_convergence_reason(correction: f64) -> ShootingFailureReason {
    ShootingFailureReason::NoConvergence {
        correction,
        growth: 0.0,
        fixed: false,
        from_leaf: false,
    }
}

/// A run of Newton's method; its linearization is kept between calls.
pub struct ShootingNewton<'e, 'a, 'p> {
    pub equations: &'e BoundaryValueProblem<'a>,
    pub units: PerturbationUnits,
    pub nodes: ShootingNodes,
    /// Whether to solve without damping, only if the start is near the solution.
    pub requires_near_start: bool,
    /// Whether the run gives up where Newton's method does not converge as it does near a solution.
    pub gives_up: bool,
    /// Steps of the last integration, over all intervals.
    steps: usize,
    /// Cost of all linearizations and, with tissue, integrations, in rods times steps.
    cost_sum: usize,
    /// Which of the turns without resistance move something.
    effective_rotations: Vec<bool>,
    /// The last linearization, condensed to the tip; none before the first.
    pub condensed: Option<CondensedEquations>,
    /// Growth of perturbations over each interval, at that linearization.
    pub growth: Vec<f64>,
    /// Largest defect at the last evaluation, in the units.
    pub defect: f64,
    progress: CorrectionProgress,
    log: &'e mut ShootingLog<'p>,
}

/// What a solution makes zero.
struct Residuals {
    /// End of each interval minus the beginning of the next.
    defects: Vec<Vec<f64>>,
    /// Residuals of the conditions at the tip.
    conditions: Vec<f64>,
}

impl<'e, 'a, 'p> ShootingNewton<'e, 'a, 'p> {
    /// Sets up the unknowns from a trajectory, over so many intervals; `None`:
    /// as many as the growth of perturbations needs, if that is possible and
    /// memory allows it.
    pub fn from_trajectory(
        equations: &'e BoundaryValueProblem<'a>,
        near: &LeafTrajectory,
        intervals: Option<usize>,
        log: &'e mut ShootingLog<'p>,
    ) -> Result<Self, ShootingFailureReason> {
        let mut nodes = match intervals {
            Some(count) => {
                let sigma = equally_spaced(count);
                let states = sigma[..count]
                    .iter()
                    .map(|&sigma| near.interpolate_state(sigma))
                    .collect();
                ShootingNodes { sigma, states }
            }
            None => choose_intervals(equations, near)?,
        };
        memory::check_shooting_memory(equations.rods(), nodes.states.len())?;
        let first = &mut nodes.states[0];
        equations.constrain_bases(first);
        Ok(ShootingNewton {
            equations,
            units: PerturbationUnits::new(equations, near),
            nodes,
            requires_near_start: false,
            gives_up: false,
            steps: 0,
            cost_sum: 0,
            effective_rotations: (equations.turnings().iter())
                .map(|turning| rotation_moves_leaf(equations, near, turning))
                .collect(),
            condensed: None,
            growth: Vec::new(),
            defect: f64::INFINITY,
            progress: CorrectionProgress {
                lambda: log.lambda,
                iteration: 0,
                linearized: 0.0,
                size: f64::INFINITY,
                convergence_size: 0.0,
            },
            log,
        })
    }

    /// Solves to the accuracy of an integration with `tolerance`.
    pub fn solve(&mut self, tolerance: f64) -> Result<(), ShootingFailureReason> {
        self.iterate(tolerance)
            .map_err(|reason| self.diagnose_failure(reason))?;
        self.rotate_to_representative();
        Ok(())
    }

    fn iterate(&mut self, tolerance: f64) -> Result<(), ShootingFailureReason> {
        self.progress.convergence_size = tolerance;
        let mut factor: f64 = 1.0;
        let mut fresh = self.condensed.is_none();
        let mut residuals = match fresh {
            false => self.residuals_at(&self.nodes.clone(), tolerance)?,
            true => self.linearize(tolerance)?,
        };
        let mut size = f64::INFINITY;
        'iterations: for iteration in 0..CONTROL.most_iterations {
            self.progress.iteration = iteration;
            let step = self.correction(&residuals);
            size = largest_component(&step);
            let near = !self.gives_up || size <= CONTROL.largest_correction;
            if !size.is_finite() || !near {
                break;
            }
            self.progress.size = size;
            self.report(1.0);
            factor = if fresh { (2.0 * factor).min(1.0) } else { 1.0 };
            let (trial, next, ratio) = loop {
                let trial = self.advanced_nodes(&step, factor);
                let tried = self.residuals_at(&trial, tolerance);
                if let Err(ShootingFailureReason::OutOfTime) = tried {
                    return Err(ShootingFailureReason::OutOfTime);
                }
                if let Ok(next) = tried {
                    let remaining = largest_component(&self.correction(&next));
                    if remaining <= (1.0 - 0.25 * factor) * size || remaining <= tolerance {
                        break (trial, next, remaining / size);
                    }
                    // Below the noise of the integrator corrections do not decrease.
                    if size <= CONTROL.noise_factor * tolerance
                        && remaining <= CONTROL.noise_factor * tolerance
                    {
                        break (trial, next, 0.0);
                    }
                }
                let far = || size <= CONTROL.rounding || 0.5 * factor < CONTROL.least_fresh_factor;
                if self.costs_too_much() || self.gives_up && fresh && far() {
                    break 'iterations;
                }
                if !fresh {
                    residuals = self.linearize(tolerance)?;
                    fresh = true;
                    continue 'iterations;
                }
                factor *= 0.5;
                if factor < CONTROL.least_factor || self.requires_near_start {
                    break 'iterations;
                }
            };
            self.log.work.iterations += 1;
            self.nodes = trial;
            self.defect = next.largest(self.condensed.as_ref());
            let remaining = ratio * size;
            if factor == 1.0 && (remaining <= tolerance || size <= CONTROL.noise_factor * tolerance)
            {
                let last = self.correction(&next);
                if largest_component(&last) <= CONTROL.noise_factor * tolerance {
                    self.nodes = self.advanced_nodes(&last, 1.0);
                }
                return match self.defect
                    <= CONTROL.largest_defect.max(CONTROL.noise_factor * tolerance)
                {
                    true => Ok(()),
                    false => Err(no_convergence_reason(size)),
                };
            }
            if self.requires_near_start && ratio > CONTROL.near_start_contraction {
                break;
            }
            let converges = factor == 1.0 && ratio <= CONTROL.converging_contraction;
            if self.costs_too_much() && !converges {
                break;
            }
            let keep = factor == 1.0 && ratio <= CONTROL.reuse_contraction;
            residuals = if keep {
                next
            } else {
                self.linearize(tolerance)?
            };
            fresh = !keep;
        }
        Err(no_convergence_reason(size))
    }

    /// Whether another linearization would cost too much for what may give up.
    fn costs_too_much(&self) -> bool {
        self.gives_up && self.cost_sum + self.linearization_cost() > CONTROL.largest_cost
    }

    /// The cost of a linearization along the last integration.
    fn linearization_cost(&self) -> usize {
        self.steps * step_cost(self.equations)
    }

    fn linearize(&mut self, tolerance: f64) -> Result<Residuals, ShootingFailureReason> {
        let integrated = self.integrate(&self.nodes.clone(), tolerance, true)?;
        let residuals = self.residuals(&self.nodes, &integrated);
        self.growth.clear();
        let base = self.nodes.states[0].clone();
        let responses = responses(self.equations, &integrated, &base, &mut |part| {
            self.report(part);
            !self.equations.limit.reached()
        });
        let Some(responses) = responses else {
            return Err(ShootingFailureReason::OutOfTime);
        };
        let maps = sensitivities(self.equations, &self.units, &responses, &mut self.growth);
        self.log.work.linearizations += 1;
        self.cost_sum += self.linearization_cost();
        let last = integrated.last().expect("there is an interval");
        self.condensed = CondensedEquations::new(
            self.equations,
            &self.units,
            &base,
            maps,
            &self.zero_energy_changes(),
            self.equations.tip_jump_derivatives(&last.end_state),
        );
        match self.condensed {
            Some(_) => Ok(residuals),
            None => Err(no_convergence_reason(f64::INFINITY)),
        }
    }

    /// The changes at the base as veins turn that can without resistance, in the units; none of those
    /// that move nothing.
    fn zero_energy_changes(&self) -> Vec<Vec<f64>> {
        let base = &self.nodes.states[0];
        let turn = |turning: &ZeroEnergyRotation| {
            let (rods, axis) = (&turning.rods, turning.axis);
            let mut turn = vec![0.0; PERTURBATION_SIZE * self.equations.rods()];
            for j in rods.clone() {
                let rod = RodState::from_flat_state(base, j);
                let unit = |k: usize| self.units.component_unit(PERTURBATION_SIZE * j + k);
                let (force, moment) = (axis.cross(rod.n) / unit(6), axis.cross(rod.m) / unit(9));
                let [spin, _] =
                    turning.node_velocity(rod.pose(), j, rod.q, self.equations.length_unit);
                let own = &mut turn[PERTURBATION_SIZE * j..PERTURBATION_SIZE * (j + 1)];
                // A clamp does not turn.
                if self.equations.base_turns(j) {
                    own[3..6].copy_from_slice(&spin.to_array());
                }
                own[6..9].copy_from_slice(&force.to_array());
                own[9..].copy_from_slice(&moment.to_array());
            }
            turn
        };
        let carries = |turn: &Vec<f64>| turn.iter().any(|value| value.abs() > CONTROL.turn_load);
        let turns = self.turnings().map(turn);
        turns.filter(carries).collect()
    }

    /// The turns of the leaf without resistance: on hinges those that moved something in the start.
    fn turnings(&self) -> impl Iterator<Item = &ZeroEnergyRotation> {
        let turnings = self.equations.turnings().iter().enumerate();
        let moved = turnings.filter(|(k, _)| self.effective_rotations[*k]);
        moved.map(|(_, turning)| turning)
    }

    /// Turns veins that can turn without resistance as those of a relaxed leaf are turned.
    fn rotate_to_representative(&mut self) {
        let turnings: Vec<ZeroEnergyRotation> = self.turnings().cloned().collect();
        for turning in turnings {
            let rods = &turning.rods;
            let bases = |j: usize| RodState::from_flat_state(&self.nodes.states[0], j);
            let natural = self.equations.unstressed_base_state();
            let begin = |j: usize| BaseRotations {
                stress_free: RodState::from_flat_state(&natural, j).q,
                now: bases(j).q,
            };
            let begins: Vec<BaseRotations> = rods.clone().map(begin).collect();
            let directed = (rods.clone()).filter(|j| !self.equations.base_turns_freely(*j));
            let moments = directed.map(|j| bases(j).m).reduce(|sum, own| sum + own);
            let angle = turning.angle_to_representative(&begins, moments);
            let turns: Vec<[DQuat; 2]> = (rods.clone())
                .map(|j| turning.rotations(angle, j, bases(j).q))
                .collect();
            let point = turning.point / self.equations.length_unit;
            for (k, state) in self.nodes.states.iter_mut().enumerate() {
                for (j, [turn, back]) in rods.clone().zip(&turns) {
                    let rod = RodState::from_flat_state(state, j);
                    let turned = RodState {
                        r: point + *turn * (rod.r - point),
                        q: *turn * rod.q * *back,
                        n: *turn * rod.n,
                        m: *turn * rod.m,
                    };
                    let turned = match k {
                        0 => self.equations.constrained_base(j, &turned),
                        _ => turned,
                    };
                    turned.write_flat_state(state, j);
                }
            }
            if angle.abs() > CONTROL.relinearization_angle {
                self.condensed = None;
            }
        }
    }

    /// Reports progress, with this part of the linearization done.
    fn report(&mut self, linearized: f64) {
        self.progress.linearized = linearized;
        (self.log.progress)(&self.progress);
    }

    fn residuals_at(
        &mut self,
        nodes: &ShootingNodes,
        tolerance: f64,
    ) -> Result<Residuals, ShootingFailureReason> {
        let integrated = self.integrate(nodes, tolerance, false)?;
        Ok(self.residuals(nodes, &integrated))
    }

    fn integrate(
        &mut self,
        nodes: &ShootingNodes,
        tolerance: f64,
        linear: bool,
    ) -> Result<Vec<IntegratedInterval>, ShootingFailureReason> {
        if self.equations.limit.reached() {
            return Err(ShootingFailureReason::OutOfTime);
        }
        let integrated = integrate(self.equations, nodes, tolerance, linear)?;
        self.steps = integrated.iter().map(|interval| interval.step_count).sum();
        self.log.work.steps += self.steps;
        self.cost_sum += self.steps * slope_cost(self.equations);
        for interval in &integrated {
            self.log.work.slopes += interval.evaluations;
        }
        Ok(integrated)
    }

    fn residuals(&self, nodes: &ShootingNodes, integrated: &[IntegratedInterval]) -> Residuals {
        let (last, inner) = integrated.split_last().expect("there is an interval");
        Residuals {
            defects: (inner.iter().zip(&nodes.states[1..]))
                .map(|(interval, begin)| self.units.difference(&interval.end_state, begin))
                .collect(),
            conditions: self.equations.tip_conditions(&last.end_state),
        }
    }

    fn correction(&self, residuals: &Residuals) -> Vec<Vec<f64>> {
        let condensed = self.condensed.as_ref().expect("linearized before");
        condensed.solve(
            &residuals.defects,
            &condensed.scaled_tip_conditions(&residuals.conditions),
        )
    }

    /// The unknowns plus `factor` times a step.
    fn advanced_nodes(&self, step: &[Vec<f64>], factor: f64) -> ShootingNodes {
        let mut nodes = self.nodes.clone();
        for (y, increment) in nodes.states.iter_mut().zip(step) {
            self.units.advance(y, increment, factor);
        }
        self.equations.constrain_bases(&mut nodes.states[0]);
        nodes
    }
}

/// The cost of the linearization of a step over that for a single rod.
fn step_cost(equations: &BoundaryValueProblem) -> usize {
    let rods = equations.rods();
    if !equations.has_tissue() {
        return rods;
    }
    let response = match equations.has_tissue_stresses() {
        true => CONTROL.stress_response_cost,
        false => CONTROL.response_cost,
    };
    rods + (rods - 1) * (CONTROL.tissue_cost + response * rods)
}

/// The cost of the slopes of a step, likewise; not counted without tissue.
fn slope_cost(equations: &BoundaryValueProblem) -> usize {
    match equations.has_tissue() {
        true => CONTROL.slope_cost * equations.rods(),
        false => 0,
    }
}

/// Refuses a leaf with tissue of which a solution would cost too much, before any work: an integration with
/// this tolerance takes at least the steps that the growth of perturbations asks for.
pub fn check_work(
    equations: &BoundaryValueProblem,
    near: &LeafTrajectory,
    tolerance: f64,
) -> Result<(), ShootingFailureReason> {
    let rate = |j: usize| equations.perturbation_rate(j, near.largest_resultants(j).force);
    let rate = largest((0..equations.rods()).map(rate));
    let steps = rate / longest_step(tolerance);
    let cost = CONTROL.estimated_linearizations * step_cost(equations)
        + CONTROL.estimated_integrations * slope_cost(equations);
    if equations.has_tissue() && steps * cost as f64 > CONTROL.largest_estimate {
        let growth = rate * LOG10_E;
        return Err(ShootingFailureReason::TooMuchWork { growth });
    }
    Ok(())
}

impl Residuals {
    fn largest(&self, condensed: Option<&CondensedEquations>) -> f64 {
        let tip = condensed.map(|condensed| condensed.scaled_tip_conditions(&self.conditions));
        let defects = self.defects.iter().chain(&tip).flatten();
        largest(defects.map(|value| value.abs()))
    }
}

/// Whether a turn moves something of the leaf at the start; for clamped veins their forces tell it.
fn rotation_moves_leaf(
    equations: &BoundaryValueProblem,
    near: &LeafTrajectory,
    turning: &ZeroEnergyRotation,
) -> bool {
    let stations = NEUTRAL
        .stations
        .iter()
        .map(|sigma| near.interpolate_state(*sigma));
    let states: Vec<Vec<f64>> = stations.collect();
    let of_rod = |j: usize| {
        states
            .iter()
            .map(move |y| RodState::from_flat_state(y, j).r)
    };
    let points: Vec<DVec3> = turning.rods.clone().flat_map(of_rod).collect();
    let point = turning.point / equations.length_unit;
    turning.section_rate < 0.0 || turning.moves_something(&points, point, CONTROL.axis_distance)
}

/// The largest component of an increment.
fn largest_component(step: &[Vec<f64>]) -> f64 {
    largest(step.iter().flatten().map(|value| value.abs()))
}

impl ShootingNewton<'_, '_, '_> {
    /// Smallest singular value of the condensed equations over the largest.
    pub fn singular_value_ratio(&self) -> f64 {
        self.condensed
            .as_ref()
            .map_or(1.0, |condensed| condensed.singular_value_ratio())
    }

    /// Why there is no convergence, as far as the last linearization shows it.
    fn diagnose_failure(&self, reason: ShootingFailureReason) -> ShootingFailureReason {
        let ShootingFailureReason::NoConvergence {
            correction,
            fixed,
            from_leaf,
            ..
        } = reason
        else {
            return reason;
        };
        match self.neutral(&NEUTRAL.stations) {
            Some(neutral) => ShootingFailureReason::Singular(neutral),
            None if self.gives_up => ShootingFailureReason::Rounding {
                correction,
                growth: self.growth.iter().map(|growth| growth.log10()).sum(),
            },
            None => {
                let growths = self.growth.iter().map(|growth| growth.log10());
                let growth = largest(growths);
                ShootingFailureReason::NoConvergence {
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
    pub fn neutral(&self, stations: &[f64]) -> Option<NeutralDirection> {
        let trusted = self
            .growth
            .iter()
            .all(|growth| *growth < NEUTRAL.largest_growth);
        let condensed = self.condensed.as_ref()?;
        if !trusted || condensed.singular_value_ratio() > NEUTRAL.singular_ratio {
            return None;
        }
        let direction = condensed.least_determined_direction();
        let nudged = self.advanced_nodes(
            &direction,
            NEUTRAL.perturbation / largest_component(&direction),
        );
        let sampled = |nodes: &ShootingNodes| {
            LeafTrajectory::sample_solution(
                self.equations,
                nodes,
                stations,
                NEUTRAL.perturbation * NEUTRAL.perturbation,
            )
        };
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
        Some(NeutralDirection {
            ratio: self.singular_value_ratio(),
            displacement,
        })
    }
}
