//! A leaf along sigma: the start or the result of a boundary-value
//! solution.

use glam::DVec3;

use crate::largest::{larger, largest};
use crate::shape::{NodeState, RodShape};
use crate::shooting::dop853::{Integrator, Unbounded};
use crate::shooting::equations::Equations;
use crate::shooting::state::RodState;

/// Ends of the intervals: 0 = sigma_0 < ... < sigma_K = 1, and the
/// states at the K beginnings.
#[derive(Clone, Debug)]
pub struct Nodes {
    /// K + 1 fractions of the length.
    pub sigma: Vec<f64>,
    /// K flat states.
    pub states: Vec<Vec<f64>>,
}

/// Flat states at some sigmas, with cubic Hermite interpolation between them.
#[derive(Clone, Debug)]
pub struct Trajectory {
    sigma: Vec<f64>,
    states: Vec<Vec<f64>>,
    slopes: Vec<Vec<f64>>,
}

impl Trajectory {
    /// From states of the equations in their present form.
    pub fn new(equations: &Equations, sigma: Vec<f64>, mut states: Vec<Vec<f64>>) -> Self {
        for i in 1..states.len() {
            let (before, after) = states.split_at_mut(i);
            for j in 0..equations.rods() {
                let a = RodState::read(&before[i - 1], j);
                let mut b = RodState::read(&after[0], j);
                // The sign of a quaternion is chosen by continuity.
                if a.q.dot(b.q) < 0.0 {
                    b.q = -b.q;
                    b.write(&mut after[0], j);
                }
            }
        }
        let slopes = (sigma.iter().zip(&states))
            .map(|(&sigma, y)| {
                let mut slopes = vec![0.0; y.len()];
                equations.slopes(sigma, y, &mut slopes);
                slopes
            })
            .collect();
        Trajectory {
            sigma,
            states,
            slopes,
        }
    }

    /// From the shape of a leaf in the units of the scenario.
    pub fn of_leaf(equations: &Equations, stations: &[f64], rods: &[RodShape]) -> Self {
        let states = (0..stations.len())
            .map(|i| {
                let mut y = vec![0.0; equations.size()];
                for (j, rod) in rods.iter().enumerate() {
                    let node = &rod.nodes[i];
                    RodState {
                        r: node.position / equations.length,
                        q: node.rotation,
                        n: node.rotation * node.n / equations.force,
                        m: node.rotation * node.m / (equations.force * equations.length),
                    }
                    .write(&mut y, j);
                }
                y
            })
            .collect();
        Trajectory::new(equations, stations.to_vec(), states)
    }

    /// The leaf without stress: rods in their rest shapes.
    pub fn unstressed(equations: &Equations, tolerance: f64) -> Result<Self, Unbounded> {
        let mut integrator = Integrator::new(equations, 0.0, equations.clamped(), tolerance);
        let (mut sigma, mut states) = (vec![0.0], vec![integrator.y.clone()]);
        integrator.run(1.0, |integrator| {
            sigma.push(integrator.sigma);
            states.push(integrator.y.clone());
        })?;
        Ok(Trajectory::new(equations, sigma, states))
    }

    /// The solution at the stations, integrated from the nodes before them.
    pub fn sampled(
        equations: &Equations,
        nodes: &Nodes,
        stations: &[f64],
        tolerance: f64,
    ) -> Result<Self, Unbounded> {
        let mut states: Vec<Vec<f64>> = Vec::new();
        let mut energy = 0.0;
        let slot = equations.size() - 1;
        let mut wanted = stations.iter().copied().peekable();
        for (k, begin) in nodes.states.iter().enumerate() {
            let (from, to) = (nodes.sigma[k], nodes.sigma[k + 1]);
            let mut y = begin.clone();
            y[slot] = energy;
            let mut integrator = Integrator::new(equations, from, y, tolerance);
            let last = k + 1 == nodes.states.len();
            while let Some(station) = wanted.next_if(|s| *s < to || last) {
                integrator.run(station.clamp(from, to), |_| ())?;
                states.push(integrator.y.clone());
            }
            integrator.run(to, |_| ())?;
            energy = integrator.y[slot];
        }
        Ok(Trajectory::new(equations, stations.to_vec(), states))
    }

    /// Straight, untwisted rods without stress.
    pub fn straight(equations: &Equations) -> Self {
        let at = |sigma: f64| {
            let mut y = vec![0.0; equations.size()];
            for j in 0..equations.rods() {
                let mut rod = equations.base(j, DVec3::ZERO, DVec3::ZERO);
                rod.r = rod.q * DVec3::X * equations.grown(j, sigma);
                rod.write(&mut y, j);
            }
            y
        };
        Trajectory::new(equations, vec![0.0, 1.0], vec![at(0.0), at(1.0)])
    }

    /// The state at the tip.
    pub fn tip(&self) -> &[f64] {
        &self.states[self.states.len() - 1]
    }

    /// The last of its stations that is not beyond `sigma`.
    pub fn last_station(&self, sigma: f64) -> Option<f64> {
        self.sigma.iter().copied().rfind(|s| *s <= sigma)
    }

    pub fn at(&self, sigma: f64) -> Vec<f64> {
        let last = self.sigma.len() - 1;
        let i = self.sigma.partition_point(|&s| s <= sigma).clamp(1, last);
        let h = self.sigma[i] - self.sigma[i - 1];
        let t = (sigma - self.sigma[i - 1]) / h;
        let (a, b) = (&self.states[i - 1], &self.states[i]);
        let (da, db) = (&self.slopes[i - 1], &self.slopes[i]);
        let rise = t * t * (3.0 - 2.0 * t);
        let (left, right) = (h * t * (1.0 - t) * (1.0 - t), h * t * t * (t - 1.0));
        (0..a.len())
            .map(|k| a[k] + rise * (b[k] - a[k]) + left * da[k] + right * db[k])
            .collect()
    }

    /// Extrapolates this trajectory by `step` times its difference from an earlier one.
    pub fn beyond(&self, equations: &Equations, earlier: &Trajectory, step: f64) -> Self {
        let states = (self.sigma.iter().zip(&self.states))
            .map(|(&sigma, now)| {
                let pairs = now.iter().zip(earlier.at(sigma));
                let moved = pairs.map(|(now, before)| now + step * (now - before));
                moved.collect()
            })
            .collect();
        Trajectory::new(equations, self.sigma.clone(), states)
    }

    /// Largest force and moment of rod `j`.
    pub fn largest(&self, j: usize) -> (f64, f64) {
        self.states.iter().fold((0.0, 0.0), |(n, m), y| {
            let rod = RodState::read(y, j);
            (larger(n, rod.n.length()), larger(m, rod.m.length()))
        })
    }

    /// Largest angle by which the directors of a rod turn along it.
    pub fn turn(&self, equations: &Equations) -> f64 {
        let turn = |j: usize| {
            let q = |y: &[f64]| RodState::read(y, j).q;
            let turns = self.states.windows(2);
            turns.map(|y| q(&y[0]).angle_between(q(&y[1]))).sum::<f64>()
        };
        largest((0..equations.rods()).map(turn))
    }

    /// The shape in the units of the scenario, at its stations.
    pub fn shape(&self, equations: &Equations) -> Vec<RodShape> {
        (0..equations.rods())
            .map(|j| RodShape {
                length: equations.lengths[j] * equations.length,
                nodes: (self.sigma.iter().zip(&self.states))
                    .map(|(&sigma, y)| node(equations, j, sigma, y))
                    .collect(),
            })
            .collect()
    }
}

fn node(equations: &Equations, j: usize, sigma: f64, y: &[f64]) -> NodeState {
    let rod = RodState::read(y, j);
    let directors = rod.q.conjugate();
    let (n, m) = (directors * rod.n, directors * rod.m);
    let (v, u) = equations.strains(j, sigma, n, m);
    NodeState {
        position: rod.r * equations.length,
        rotation: rod.q,
        v,
        u: u / equations.length,
        n: n * equations.force,
        m: m * (equations.force * equations.length),
    }
}
