//! Shooting over intervals: the initial-value problems between the nodes of
//! multiple shooting, their defects and their sensitivities.

use rayon::prelude::*;

use faer::Mat;
use glam::DVec3;

use crate::largest::{larger, largest};
use crate::shooting::dop853::{Integrator, Unbounded};
use crate::shooting::equations::{Equations, difference};
use crate::shooting::propagate::{LinearStep, Perturbations, group};
use crate::shooting::state::{RodState, TANGENT};
use crate::shooting::trajectory::{Nodes, Trajectory};

/// Largest growth of a perturbation over one interval.
pub const GROWTH: f64 = 1e3;

/// Most intervals chosen automatically, summed over rods: of N rods their matrices take
/// 24 N MB (see [`crate::memory`]).
const MOST_PIECES: usize = 4096;

/// Accuracy of the integration that measures growth.
const ROUGH: f64 = 1e-4;

/// Accuracy to which a start is continued beyond its stations.
const START: f64 = 1e-8;

/// Units of perturbations, so that none dominates the
/// others: lengths and angles are not scaled, forces and moments of a rod are in
/// units of the larger of what it carries and what bends it.
#[derive(Clone, Debug)]
pub struct Units {
    force: Vec<f64>,
    moment: Vec<f64>,
}

impl Units {
    /// Units for a leaf near a trajectory.
    pub fn new(equations: &Equations, near: &Trajectory) -> Self {
        let (force, moment) = (0..equations.rods())
            .map(|j| {
                let ((n, m), soft) = (near.largest(j), equations.softest[j]);
                (soft + n, soft + m)
            })
            .unzip();
        Units { force, moment }
    }

    /// The unit of the `k`-th component of a leaf's perturbation.
    pub fn of(&self, k: usize) -> f64 {
        match k % TANGENT {
            0..6 => 1.0,
            6..9 => self.force[k / TANGENT],
            _ => self.moment[k / TANGENT],
        }
    }

    /// The unit of the sum of all forces at the tip.
    pub fn total_force(&self) -> f64 {
        crate::largest::largest(self.force.iter().copied())
    }

    pub fn largest_moment(&self) -> f64 {
        crate::largest::largest(self.moment.iter().copied())
    }

    /// The difference a - b of two flat states.
    pub fn difference(&self, a: &[f64], b: &[f64]) -> Vec<f64> {
        (0..self.force.len())
            .flat_map(|j| {
                let (a, b) = (RodState::read(a, j), RodState::read(b, j));
                [
                    a.r - b.r,
                    difference(a.q, b.q),
                    (a.n - b.n) / self.force[j],
                    (a.m - b.m) / self.moment[j],
                ]
            })
            .flat_map(|v| v.to_array())
            .collect()
    }

    /// Adds `step` times an increment to a flat state.
    pub fn advance(&self, y: &mut [f64], increment: &[f64], step: f64) {
        for j in 0..self.force.len() {
            let mut rod = RodState::read(y, j);
            let part = |k: usize| step * DVec3::from_slice(&increment[TANGENT * j + 3 * k..]);
            rod.r += part(0);
            rod.q = (glam::DQuat::from_scaled_axis(part(1)) * rod.q).normalize();
            rod.n += part(2) * self.force[j];
            rod.m += part(3) * self.moment[j];
            rod.write(y, j);
        }
    }
}

/// Result of the integration over an interval.
pub struct Integrated {
    pub end: Vec<f64>,
    /// The linearised equations along it, if requested.
    steps: Vec<LinearStep>,
    pub count: usize,
    pub evaluations: usize,
}

/// Integrates over all intervals, in parallel.
pub fn integrate(
    equations: &Equations,
    nodes: &Nodes,
    tolerance: f64,
    linearise: bool,
) -> Result<Vec<Integrated>, Unbounded> {
    (0..nodes.states.len())
        .into_par_iter()
        .map(|k| {
            let (begin, end) = (nodes.sigma[k], nodes.sigma[k + 1]);
            let y = nodes.states[k].clone();
            let mut integrator = Integrator::new(equations, begin, y, tolerance);
            let (mut steps, mut count) = (Vec::new(), 0);
            integrator.run(end, |integrator| {
                count += 1;
                if linearise {
                    steps.push(LinearStep::of(equations, integrator));
                }
            })?;
            Ok(Integrated {
                end: integrator.y,
                steps,
                count,
                evaluations: integrator.evaluations,
            })
        })
        .collect()
}

/// Response of a group of rods at the end of an interval to perturbations of one rod,
/// dimensionless: its first rod, and rows of numbers from there on.
type Responses = (usize, Vec<f64>);

/// Pairs of interval and rod that a thread processes between progress reports.
const CHUNK: usize = 4;

/// The responses of all rods over all intervals, in parallel. `proceed` is called with the part
/// that is done, and returns whether to continue.
pub fn responses(
    equations: &Equations,
    integrated: &[Integrated],
    proceed: &mut dyn FnMut(f64) -> bool,
) -> Option<Vec<Responses>> {
    let rods = equations.rods();
    let all = integrated.len() * rods;
    let together = CHUNK * rayon::current_num_threads();
    let mut found = Vec::with_capacity(all);
    while found.len() < all {
        if !proceed(found.len() as f64 / all as f64) {
            return None;
        }
        let some = found.len()..all.min(found.len() + together);
        let some = some.into_par_iter().map(|task| {
            let (steps, j) = (&integrated[task / rods].steps, task % rods);
            match task < rods {
                true => responses_of::<6>(equations, steps, (j, equations.free_at_base())),
                false => responses_of::<TANGENT>(equations, steps, (j, 0)),
            }
        });
        found.par_extend(some);
    }
    Some(found)
}

/// The sensitivities of the ends of all intervals to their beginnings, in the
/// given units: square, except in the first interval, which begins at the base,
/// where only [six components](Equations::free_at_base) are perturbed.
pub fn sensitivities(
    equations: &Equations,
    units: &Units,
    responses: &[Responses],
    growth: &mut Vec<f64>,
) -> Vec<Mat<f64>> {
    let rods = equations.rods();
    (responses.chunks(rods).enumerate())
        .map(|(k, columns)| {
            let (kinds, first_kind) = match k {
                0 => (6, equations.free_at_base()),
                _ => (TANGENT, 0),
            };
            let mut matrix = Mat::zeros(TANGENT * rods, kinds * rods);
            let mut largest: f64 = 1.0;
            for (j, (first, rows)) in columns.iter().enumerate() {
                for (i, row) in rows.chunks(kinds).enumerate() {
                    let row_index = TANGENT * first + i;
                    for (k, value) in row.iter().enumerate() {
                        let from = TANGENT * j + first_kind + k;
                        matrix[(row_index, kinds * j + k)] =
                            value * units.of(from) / units.of(row_index);
                        if from % TANGENT / 3 == row_index % TANGENT / 3 {
                            largest = larger(largest, value.abs());
                        }
                    }
                }
            }
            growth.push(largest);
            matrix
        })
        .collect()
}

/// Responses to the perturbations of rod `j`, of its components from the `first` on.
fn responses_of<const W: usize>(
    equations: &Equations,
    steps: &[LinearStep],
    (j, first): (usize, usize),
) -> Responses {
    let mut perturbations = Perturbations::<W>::unit(group(equations, j), j, first);
    for step in steps {
        perturbations.advance(equations, step);
    }
    (perturbations.rods.start, perturbations.all)
}

/// Chooses intervals over which no perturbation grows by more than [`GROWTH`].
///
/// Growth is measured separately for positions, rotations, forces and moments, which makes it
/// independent of units, for every rod with its neighbours held.
/// Fails if too many intervals would be needed.
pub fn choose_intervals(equations: &Equations, near: &Trajectory) -> Result<Nodes, Unbounded> {
    let mut sigma = vec![0.0];
    'intervals: loop {
        let begin = sigma[sigma.len() - 1];
        if sigma.len() * equations.rods() > MOST_PIECES.max(equations.rods()) {
            return Err(Unbounded { sigma: begin });
        }
        let mut integrator = Integrator::new(equations, begin, near.at(begin), ROUGH);
        let mut rods: Vec<Perturbations<TANGENT>> = (0..equations.rods())
            .map(|j| Perturbations::unit(j..j + 1, j, 0))
            .collect();
        while integrator.sigma < 1.0 {
            let before = integrator.sigma;
            let failed = integrator.step(1.0).is_err();
            let grown = failed || {
                let step = LinearStep::of(equations, &integrator);
                rods.iter_mut().any(|rod| {
                    rod.advance(equations, &step);
                    own_growth(rod.rows()) > GROWTH
                })
            };
            if grown {
                let enough = before > begin;
                let end = if enough { before } else { integrator.sigma };
                if end <= begin || end >= 1.0 {
                    break 'intervals;
                }
                // At a station the start is known; elsewhere it is interpolated.
                let known = near.last_station(end).filter(|s| *s > begin);
                sigma.push(known.unwrap_or(end));
                continue 'intervals;
            }
        }
        break;
    }
    sigma.push(1.0);
    let states = begin(equations, near, &sigma);
    Ok(Nodes { sigma, states })
}

/// States at the beginnings of intervals. Interpolation far from
/// stations may lead Newton's method to another solution.
fn begin(equations: &Equations, near: &Trajectory, sigma: &[f64]) -> Vec<Vec<f64>> {
    let known = |sigma: f64| near.last_station(sigma) == Some(sigma);
    let at = |k: usize| {
        let here = sigma[k];
        if k == 0 || known(here) || !known(sigma[k - 1]) {
            return near.at(here);
        }
        let before = sigma[k - 1];
        let mut integrator = Integrator::new(equations, before, near.at(before), START);
        match integrator.run(here, |_| ()) {
            Ok(()) => integrator.y,
            Err(_) => near.at(here),
        }
    };
    (0..sigma.len() - 1).map(at).collect()
}

/// Largest sensitivity within one kind of quantity.
fn own_growth(rows: &[[f64; TANGENT]]) -> f64 {
    let own = (0..TANGENT).flat_map(|i| (0..3).map(move |c| (i, i / 3 * 3 + c)));
    largest(own.map(|(i, c)| rows[i][c].abs()))
}
