//! Initial-value problems of a leaf by the method DOP853 with step control, and its trajectory along
//! sigma: flat states at stations, from which a boundary-value solution starts, or which it results in.

use crate::natural::{
    ERROR_WEIGHTS_3, ERROR_WEIGHTS_5, RESULT_WEIGHTS, STAGE_NODES, STAGE_WEIGHTS, STAGES,
};
use crate::numbers::{larger, largest};
use crate::scenario::{RodPlace, Side};
use crate::shape::RodShape;
use crate::shooting::equations::{BoundaryValueProblem, FRACTION_TOLERANCE};
use crate::shooting::rod_state::{JumpDerivatives, RodState, STATE_SIZE};
use crate::shooting::tissue_stresses::TissueState;
use glam::DVec3;

/// What bounds the integration of an initial-value problem.
struct IntegrationLimits {
    /// Largest number of steps. Doubled, a problem that does not end takes twice as long.
    most_steps: usize,
    /// Solutions with a larger dimensionless number count as unbounded.
    largest_state: f64,
    /// Longest step at [`IntegrationLimits::reference_tolerance`], in units of the length over which a
    /// perturbation grows or turns. Where the leaf is straight its own error would allow any step, and
    /// the sensitivities, integrated with the same steps, would be inaccurate: doubled, their error is
    /// 256 times as large. It grows with the power 1/8 of the tolerance, since otherwise solutions at
    /// two tolerances would share their errors.
    longest_step: f64,
    /// Tolerance at which that is the longest step.
    reference_tolerance: f64,
    /// Longest step at any tolerance, in the same units.
    longest_loose_step: f64,
    /// Shortest step as a fraction of the length: shorter ones are rounding.
    shortest_step: f64,
}

const LIMITS: IntegrationLimits = IntegrationLimits {
    most_steps: 20_000,
    largest_state: 1e9,
    longest_step: 0.4,
    reference_tolerance: 1e-13,
    longest_loose_step: 2.25,
    shortest_step: 1e-13,
};

/// The solution of an initial-value problem could not be continued beyond
/// `sigma`: it grows without bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnboundedSolution {
    /// Fraction of the length that it reached.
    pub sigma: f64,
}

/// Integration of an initial-value problem from one sigma to the next.
pub struct InitialValueIntegrator<'e, 'a> {
    equations: &'e BoundaryValueProblem<'a>,
    tolerance: f64,
    pub sigma: f64,
    pub y: Vec<f64>,
    /// Sigma of the last loads on points that were passed.
    last_point_load: f64,
    /// Rods whose loads on points were passed at the beginning of the last step, with the derivatives of the
    /// jumps there.
    pub passed_loads: Vec<(usize, JumpDerivatives)>,
    /// Proposed size of the next step.
    step: f64,
    /// Width of the last step.
    pub last_step: f64,
    /// States at the stages of the last step.
    pub stages: Vec<Vec<f64>>,
    slopes: Vec<Vec<f64>>,
    /// The tissue at the last evaluation of slopes.
    tissue: TissueState,
    next: Vec<f64>,
    steps: usize,
    pub evaluations: usize,
}

impl<'e, 'a> InitialValueIntegrator<'e, 'a> {
    /// Starts at `sigma` with the state `y`; local errors of the dimensionless
    /// state are kept below `tolerance` per step.
    pub fn new(
        equations: &'e BoundaryValueProblem<'a>,
        sigma: f64,
        y: Vec<f64>,
        tolerance: f64,
    ) -> Self {
        let blank = || vec![vec![0.0; y.len()]; STAGES];
        let mut integrator = InitialValueIntegrator {
            equations,
            tolerance,
            sigma,
            last_point_load: f64::NEG_INFINITY,
            passed_loads: Vec::new(),
            step: 0.0,
            last_step: 0.0,
            stages: blank(),
            slopes: blank(),
            tissue: TissueState::default(),
            next: y.clone(),
            y,
            steps: 0,
            evaluations: 1,
        };
        integrator.evaluate_first_slopes();
        integrator.step = 0.1 * tolerance.powf(0.125) / integrator.slope().max(1e-3);
        integrator
    }

    /// Largest slope relative to the magnitude of its unknown.
    fn slope(&self) -> f64 {
        norm(self.equations, &self.y, &self.y, |i| self.slopes[0][i])
    }

    /// Bound on the step due to the growth of perturbations.
    fn longest_step(&self) -> f64 {
        let force = |j| RodState::from_flat_state(&self.y, j).n.length();
        let rate = (0..self.equations.rods())
            .map(|j| self.equations.perturbation_rate(j, force(j)))
            .fold(1.0, f64::max);
        longest_step(self.tolerance) / rate
    }

    /// Integrates to `end`; `after_step` is called after each step.
    pub fn run(
        &mut self,
        end: f64,
        mut after_step: impl FnMut(&Self),
    ) -> Result<(), UnboundedSolution> {
        while self.sigma < end {
            self.step(end)?;
            after_step(self);
        }
        Ok(())
    }

    /// One step towards `until`, never beyond it or a kink.
    pub fn step(&mut self, until: f64) -> Result<(), UnboundedSolution> {
        let failed = UnboundedSolution { sigma: self.sigma };
        // States are those just before a load on a point, which the first step beyond it passes; a
        // second stop within rounding of it does not.
        let beyond = self.sigma - self.last_point_load > FRACTION_TOLERANCE;
        self.passed_loads.clear();
        if beyond {
            self.passed_loads = self.equations.jump_derivatives_at(self.sigma, &self.y);
        }
        if beyond && self.equations.apply_point_loads(self.sigma, &mut self.y) {
            self.last_point_load = self.sigma;
            self.evaluate_first_slopes();
        }
        let until = self.equations.step_end(self.sigma, until);
        loop {
            self.steps += 1;
            let left = until - self.sigma;
            // A remainder too small for a step of its own is added to this one.
            let step = self.step.min(self.longest_step());
            let last = step > 0.99 * left;
            let h = if last { left } else { step };
            // Two stops may differ by a rounding error: that is not a failure of step control.
            if self.steps > LIMITS.most_steps || (!last && h < LIMITS.shortest_step) {
                return Err(failed);
            }
            self.attempt(h);
            let error = self.error(h);
            let mut state = self.next[..self.next.len() - 1].iter();
            if !state.all(|value| value.abs() < LIMITS.largest_state) || !error.is_finite() {
                self.step = 0.1 * h;
                continue;
            }
            let factor = 0.9 * error.max(1e-16).powf(-0.125);
            if error > 1.0 {
                self.step = h * factor.clamp(0.1, 0.9);
                continue;
            }
            let proposed = h * factor.clamp(0.2, 5.0);
            // A step cut short by `until` does not limit the next.
            self.step = proposed.max(if last { self.step } else { 0.0 });
            self.last_step = h;
            self.sigma = if last { until } else { self.sigma + h };
            self.accept();
            return Ok(());
        }
    }

    /// All stages and the result of a step, not yet accepted.
    fn attempt(&mut self, h: f64) {
        self.stages[0].copy_from_slice(&self.y);
        for i in 1..STAGES {
            let (before, after) = self.slopes.split_at_mut(i);
            weighted_slope_sum(&self.y, h, STAGE_WEIGHTS[i], before, &mut self.stages[i]);
            let ends = [self.sigma, self.sigma + h];
            let place = RodPlace::within(self.sigma + STAGE_NODES[i] * h, ends);
            let stage = &self.stages[i];
            self.equations
                .write_slopes(place, stage, &mut self.tissue, &mut after[0]);
        }
        self.evaluations += STAGES - 1;
        weighted_slope_sum(&self.y, h, &RESULT_WEIGHTS, &self.slopes, &mut self.next);
    }

    /// Error of the attempted step relative to the tolerance.
    fn error(&self, h: f64) -> f64 {
        let weighted = |weights: &[f64; STAGES]| {
            norm(self.equations, &self.y, &self.next, |i| {
                let terms = weights.iter().zip(&self.slopes);
                h * terms.map(|(w, slopes)| w * slopes[i]).sum::<f64>()
            })
        };
        let (fifth, third) = (weighted(&ERROR_WEIGHTS_5), weighted(&ERROR_WEIGHTS_3));
        if fifth == 0.0 {
            return 0.0;
        }
        fifth * fifth / (fifth * fifth + 0.01 * third * third).sqrt() / self.tolerance
    }

    /// Accepts the step and normalizes the quaternions.
    fn accept(&mut self) {
        std::mem::swap(&mut self.y, &mut self.next);
        for j in 0..self.equations.rods() {
            RodState::from_flat_state(&self.y, j).write_flat_state(&mut self.y, j);
        }
        self.evaluate_first_slopes();
        self.evaluations += 1;
    }

    /// The slopes of the present state, from which the next step begins.
    fn evaluate_first_slopes(&mut self) {
        let (place, slopes) = (RodPlace::new(self.sigma, Side::Tip), &mut self.slopes[0]);
        self.equations
            .write_slopes(place, &self.y, &mut self.tissue, slopes);
    }
}

/// Longest step for a tolerance, in units of the length over which a perturbation grows or turns.
pub fn longest_step(tolerance: f64) -> f64 {
    let looser = tolerance / LIMITS.reference_tolerance;
    let longest = LIMITS.longest_step * looser.powf(0.125);
    longest.min(LIMITS.longest_loose_step)
}

/// y + h sum of weights times slopes.
pub fn weighted_slope_sum(
    y: &[f64],
    h: f64,
    weights: &[f64],
    slopes: &[Vec<f64>],
    result: &mut [f64],
) {
    result.copy_from_slice(y);
    for (weight, slopes) in weights.iter().zip(slopes) {
        if *weight != 0.0 {
            for (sum, slope) in result.iter_mut().zip(slopes) {
                *sum += h * weight * slope;
            }
        }
    }
}

/// Root mean square of a rod's numbers, the maximum over all rods. Positions and
/// rotations are not scaled; moments are in units of what bends the softest
/// direction by one radian, unless they are larger; forces likewise.
fn norm(
    equations: &BoundaryValueProblem,
    y: &[f64],
    next: &[f64],
    value: impl Fn(usize) -> f64,
) -> f64 {
    let mut largest: f64 = 0.0;
    for j in 0..equations.rods() {
        let (a, b) = (
            RodState::from_flat_state(y, j),
            RodState::from_flat_state(next, j),
        );
        let soft = equations.softest_couple_stiffness[j];
        let unit = |a: DVec3, b: DVec3| soft + a.length().max(b.length());
        let (force, moment) = (unit(a.n, b.n), unit(a.m, b.m));
        let sum: f64 = (0..STATE_SIZE)
            .map(|i| {
                let scale = match i {
                    0..7 => 1.0,
                    7..10 => force,
                    _ => moment,
                };
                (value(STATE_SIZE * j + i) / scale).powi(2)
            })
            .sum();
        largest = larger(largest, (sum / STATE_SIZE as f64).sqrt());
    }
    largest
}

/// Ends of the intervals: 0 = sigma_0 < ... < sigma_K = 1, and the
/// states at the K beginnings.
#[derive(Clone, Debug)]
pub struct ShootingNodes {
    /// K + 1 fractions of the length.
    pub sigma: Vec<f64>,
    /// Flat states at the K beginnings of intervals.
    pub states: Vec<Vec<f64>>,
}

/// Sizes of the force and of the moment in a rod, dimensionless.
#[derive(Clone, Copy, Debug)]
pub struct ResultantSizes {
    pub force: f64,
    pub moment: f64,
}

/// Flat states at some sigmas, with cubic Hermite interpolation between them.
#[derive(Clone, Debug)]
pub struct LeafTrajectory {
    sigma: Vec<f64>,
    states: Vec<Vec<f64>>,
    slopes: Vec<StationSlopes>,
}

/// Slopes of the state on both sides of a station, which differ where a profile jumps.
#[derive(Clone, Debug)]
struct StationSlopes {
    before: Vec<f64>,
    /// `None` where no profile has a kink: they are the same.
    beyond: Option<Vec<f64>>,
}

impl StationSlopes {
    fn beyond(&self) -> &[f64] {
        self.beyond.as_deref().unwrap_or(&self.before)
    }
}

impl LeafTrajectory {
    /// The trajectory through states of the equations in their present form.
    pub fn new(
        equations: &BoundaryValueProblem,
        sigma: Vec<f64>,
        mut states: Vec<Vec<f64>>,
    ) -> Self {
        for i in 1..states.len() {
            let (before, after) = states.split_at_mut(i);
            for j in 0..equations.rods() {
                let a = RodState::from_flat_state(&before[i - 1], j);
                let mut b = RodState::from_flat_state(&after[0], j);
                // The sign of a quaternion is chosen by continuity.
                if a.q.dot(b.q) < 0.0 {
                    b.q = -b.q;
                    b.write_flat_state(&mut after[0], j);
                }
            }
        }
        let mut tissue = TissueState::default();
        let slopes = (sigma.iter().zip(&states))
            .map(|(&sigma, y)| {
                let mut on_side = |side: Side| {
                    let mut slopes = vec![0.0; y.len()];
                    let place = RodPlace::new(sigma, side);
                    equations.write_slopes(place, y, &mut tissue, &mut slopes);
                    slopes
                };
                StationSlopes {
                    before: on_side(Side::Base),
                    beyond: equations.has_kink_at(sigma).then(|| on_side(Side::Tip)),
                }
            })
            .collect();
        LeafTrajectory {
            sigma,
            states,
            slopes,
        }
    }

    /// The trajectory of a leaf whose shape is given in the units of the scenario.
    pub fn from_leaf_shape(
        equations: &BoundaryValueProblem,
        stations: &[f64],
        rods: &[RodShape],
    ) -> Self {
        let states = (0..stations.len())
            .map(|i| {
                let mut y = vec![0.0; equations.state_size()];
                for (j, rod) in rods.iter().enumerate() {
                    let node = &rod.nodes[i];
                    RodState {
                        r: node.position / equations.length_unit,
                        q: node.rotation,
                        n: node.rotation * node.n / equations.force_unit,
                        m: node.rotation * node.m / (equations.force_unit * equations.length_unit),
                    }
                    .write_flat_state(&mut y, j);
                }
                y
            })
            .collect();
        LeafTrajectory::new(equations, stations.to_vec(), states)
    }

    /// The leaf without stress: rods in their rest shapes.
    pub fn unstressed_leaf(
        equations: &BoundaryValueProblem,
        tolerance: f64,
    ) -> Result<Self, UnboundedSolution> {
        let mut integrator = InitialValueIntegrator::new(
            equations,
            0.0,
            equations.unstressed_base_state(),
            tolerance,
        );
        let (mut sigma, mut states) = (vec![0.0], vec![integrator.y.clone()]);
        integrator.run(1.0, |integrator| {
            sigma.push(integrator.sigma);
            states.push(integrator.y.clone());
        })?;
        Ok(LeafTrajectory::new(equations, sigma, states))
    }

    /// The solution at the stations, integrated from the nodes before them.
    pub fn sample_solution(
        equations: &BoundaryValueProblem,
        nodes: &ShootingNodes,
        stations: &[f64],
        tolerance: f64,
    ) -> Result<Self, UnboundedSolution> {
        let mut states: Vec<Vec<f64>> = Vec::new();
        let mut energy = 0.0;
        let slot = equations.state_size() - 1;
        let mut wanted = stations.iter().copied().peekable();
        for (k, begin) in nodes.states.iter().enumerate() {
            let (from, to) = (nodes.sigma[k], nodes.sigma[k + 1]);
            let mut y = begin.clone();
            y[slot] = energy;
            let mut integrator = InitialValueIntegrator::new(equations, from, y, tolerance);
            let last = k + 1 == nodes.states.len();
            while let Some(station) = wanted.next_if(|s| *s < to || last) {
                integrator.run(station.clamp(from, to), |_| ())?;
                states.push(integrator.y.clone());
            }
            integrator.run(to, |_| ())?;
            energy = integrator.y[slot];
        }
        Ok(LeafTrajectory::new(equations, stations.to_vec(), states))
    }

    /// Straight, untwisted rods without stress.
    pub fn straight(equations: &BoundaryValueProblem) -> Self {
        let at = |sigma: f64| {
            let mut y = vec![0.0; equations.state_size()];
            for j in 0..equations.rods() {
                let mut rod = equations.base(j, DVec3::ZERO, DVec3::ZERO);
                rod.r = rod.q * DVec3::X * equations.grown(j, sigma);
                rod.write_flat_state(&mut y, j);
            }
            y
        };
        LeafTrajectory::new(equations, vec![0.0, 1.0], vec![at(0.0), at(1.0)])
    }

    /// The state at the tip.
    pub fn tip(&self) -> &[f64] {
        &self.states[self.states.len() - 1]
    }

    /// The last station that is not beyond `sigma`.
    pub fn last_station(&self, sigma: f64) -> Option<f64> {
        self.sigma.iter().copied().rfind(|s| *s <= sigma)
    }

    /// The flat state at `sigma`, between stations by cubic interpolation.
    pub fn interpolate_state(&self, sigma: f64) -> Vec<f64> {
        let last = self.sigma.len() - 1;
        let i = self.sigma.partition_point(|&s| s <= sigma).clamp(1, last);
        let h = self.sigma[i] - self.sigma[i - 1];
        let t = (sigma - self.sigma[i - 1]) / h;
        let (a, b) = (&self.states[i - 1], &self.states[i]);
        let (da, db) = (self.slopes[i - 1].beyond(), &self.slopes[i].before);
        let rise = t * t * (3.0 - 2.0 * t);
        let (left, right) = (h * t * (1.0 - t) * (1.0 - t), h * t * t * (t - 1.0));
        (0..a.len())
            .map(|k| a[k] + rise * (b[k] - a[k]) + left * da[k] + right * db[k])
            .collect()
    }

    /// Extrapolates this trajectory by `step` times its difference from an earlier one.
    pub fn extrapolate(
        &self,
        equations: &BoundaryValueProblem,
        earlier: &LeafTrajectory,
        step: f64,
    ) -> Self {
        let states = (self.sigma.iter().zip(&self.states))
            .map(|(&sigma, now)| {
                let pairs = now.iter().zip(earlier.interpolate_state(sigma));
                let moved = pairs.map(|(now, before)| now + step * (now - before));
                moved.collect()
            })
            .collect();
        LeafTrajectory::new(equations, self.sigma.clone(), states)
    }

    /// The largest force and moment that rod `j` carries.
    pub fn largest_resultants(&self, j: usize) -> ResultantSizes {
        let start = ResultantSizes {
            force: 0.0,
            moment: 0.0,
        };
        self.states.iter().fold(start, |largest, y| {
            let rod = RodState::from_flat_state(y, j);
            ResultantSizes {
                force: larger(largest.force, rod.n.length()),
                moment: larger(largest.moment, rod.m.length()),
            }
        })
    }

    /// Largest angle by which the directors of a rod turn along it.
    pub fn largest_turn(&self, equations: &BoundaryValueProblem) -> f64 {
        let turn = |j: usize| {
            let q = |y: &[f64]| RodState::from_flat_state(y, j).q;
            let turns = self.states.windows(2);
            turns.map(|y| q(&y[0]).angle_between(q(&y[1]))).sum::<f64>()
        };
        largest((0..equations.rods()).map(turn))
    }

    /// The shape in the units of the scenario, at the trajectory's stations.
    pub fn shape(&self, equations: &BoundaryValueProblem) -> Vec<RodShape> {
        let rod = |j: usize| RodShape {
            length: equations.lengths[j] * equations.length_unit,
            nodes: Vec::with_capacity(self.sigma.len()),
        };
        let mut rods: Vec<RodShape> = (0..equations.rods()).map(rod).collect();
        for (&sigma, y) in self.sigma.iter().zip(&self.states) {
            let nodes = equations.node_states(sigma, y);
            for (rod, node) in rods.iter_mut().zip(nodes) {
                rod.nodes.push(node);
            }
        }
        rods
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scenario::Scenario;

    fn pair() -> Scenario {
        let text = r#"
            name = "pair"
            leaf = { rods = 2, length = [1.0, 1.2], fan = [-0.5, 0.4] }
            stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.5, axial = 20.0, shear_2 = inf, shear_3 = 30.0 }
            rest = { twist = 0.5, bend_2 = [1.0, -0.5], bend_3 = { at = [0.0, 1.0], value = [0.0, 2.0] } }
            coupling = { x = 1.0, y = 3.0, z = 2.0 }
            load = { gravity = [0.2, -0.3, -2.0] }
        "#;
        Scenario::from_toml(text).unwrap()
    }

    /// A state at the clamp that is far from equilibrium.
    fn clamped(equations: &BoundaryValueProblem, strength: f64) -> Vec<f64> {
        let mut y = vec![0.0; equations.state_size()];
        for (j, side) in [1.0, -0.7].into_iter().enumerate() {
            let (n, m) = (DVec3::new(2.0, side, -1.0), DVec3::new(0.5, -side, 2.0));
            let base = equations.base(j, strength * n, strength * m);
            base.write_flat_state(&mut y, j);
        }
        y
    }

    fn apart(a: &[f64], b: &[f64]) -> f64 {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// The result of so many equal steps.
    fn integrate_equal_steps(
        equations: &BoundaryValueProblem,
        strength: f64,
        count: usize,
    ) -> Vec<f64> {
        let begin = clamped(equations, strength);
        let mut integrator = InitialValueIntegrator::new(equations, 0.0, begin, 1e-10);
        for k in 1..=count {
            integrator.attempt(1.0 / count as f64);
            integrator.sigma = k as f64 / count as f64;
            integrator.accept();
        }
        integrator.y
    }

    fn to(equations: &BoundaryValueProblem, end: f64, tolerance: f64) -> (Vec<f64>, usize) {
        let mut integrator =
            InitialValueIntegrator::new(equations, 0.0, clamped(equations, 1.0), tolerance);
        integrator.run(end, |_| ()).unwrap();
        assert_eq!(integrator.sigma, end);
        (integrator.y, integrator.evaluations)
    }

    #[test]
    fn fixed_steps_converge_with_order_8() {
        let scenario = pair();
        let equations = BoundaryValueProblem::new(&scenario);
        let exact = integrate_equal_steps(&equations, 3.0, 512);
        let errors = [8, 12, 18, 27]
            .map(|count| apart(&integrate_equal_steps(&equations, 3.0, count), &exact));
        assert!(errors[0] < 1e-3 && errors[3] > 1e-12, "{errors:?}");
        let order = (errors[0] / errors[3]).ln() / (27.0_f64 / 8.0).ln();
        assert!((order - 8.0).abs() < 0.5, "{errors:?}: order {order}");
    }

    /// Step control keeps the error near the tolerance, with work that grows no
    /// faster than its power -1/8, and quaternions stay at unit length.
    #[test]
    fn the_error_follows_the_tolerance() {
        let scenario = pair();
        let equations = BoundaryValueProblem::new(&scenario);
        let exact = integrate_equal_steps(&equations, 1.0, 512);
        let mut work = Vec::new();
        for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
            let (end, evaluations) = to(&equations, 1.0, tolerance);
            let error = apart(&end, &exact);
            assert!(error < 30.0 * tolerance, "{tolerance:e}: {error:.1e}");
            for q in [3, STATE_SIZE + 3].map(|at| &end[at..at + 4]) {
                let squares: f64 = q.iter().map(|c| c * c).sum();
                assert!((squares - 1.0).abs() < 1e-15, "{squares}");
            }
            work.push(evaluations as f64);
        }
        let growth = (work[4] / work[0]).log10() / 8.0;
        assert!((0.07..0.14).contains(&growth), "{work:?}");
    }

    /// A stop at the distance of a rounding error is reached by a step as small.
    #[test]
    fn stops_may_lie_a_rounding_error_apart() {
        let scenario = pair();
        let equations = BoundaryValueProblem::new(&scenario);
        let mut integrator =
            InitialValueIntegrator::new(&equations, 0.0, clamped(&equations, 1.0), 1e-10);
        for stop in [0.3, 0.1 + 0.2, 0.3 + 1e-15, 1.0] {
            integrator.run(stop, |_| ()).unwrap();
            assert_eq!(integrator.sigma, stop);
        }
        let straight = to(&equations, 1.0, 1e-10).0;
        assert!(apart(&integrator.y, &straight) < 1e-8);
    }

    /// Strongly coupled rods that begin to separate.
    #[test]
    fn what_grows_out_of_bounds_is_given_up() {
        let mut scenario = pair();
        scenario.coupling = vec![[1e9; 3]];
        let equations = BoundaryValueProblem::new(&scenario);
        let mut integrator =
            InitialValueIntegrator::new(&equations, 0.0, clamped(&equations, 1.0), 1e-8);
        let failed = integrator.run(1.0, |_| ()).expect_err("it was to grow");
        assert!(failed.sigma > 0.0 && failed.sigma < 0.5, "{failed:?}");
    }
}
