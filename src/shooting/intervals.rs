//! Shooting over intervals: the initial-value problems between the nodes of
//! multiple shooting, their defects and their sensitivities.
//!
//! The linear equations of multiple shooting, condensed to the tip.
//!
//! The base leaves 6 N perturbations free. They are propagated through the
//! intervals and re-orthonormalised before they all grow into the few directions of
//! fastest growth (S. K. Godunov 1961; S. D. Conte, SIAM Rev. 8,
//! 1966). The tip's 6 N conditions determine them; back substitution divides by the growth.
//! The product of all sensitivities is never formed.

#[cfg(test)]
mod tests;

use crate::numbers::{larger, largest};
use crate::shooting::equations::{Equations, RodState, TANGENT, Tip, difference};
use crate::shooting::integrate::{Integrator, Nodes, Trajectory, Unbounded};
use crate::shooting::sensitivities::{LinearStep, Perturbations, group};
use faer::{Col, ColRef, Mat};
use glam::DVec3;
use rayon::prelude::*;

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
        crate::numbers::largest(self.force.iter().copied())
    }

    pub fn largest_moment(&self) -> f64 {
        crate::numbers::largest(self.moment.iter().copied())
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

/// Directions of the tip's conditions with singular values below this part
/// of the largest count as undetermined.
const SINGULAR: f64 = 1e-10;

/// Cosine from which on that direction is the turn of a leaf without resistance.
const ALONG_TURN: f64 = 0.9;

/// The condensed equations, factorised.
pub struct CondensedEquations {
    maps: Vec<Mat<f64>>,
    /// Orthonormal bases of the free perturbations at the inner nodes.
    bases: Vec<Mat<f64>>,
    /// Their growth: upper triangular.
    growths: Vec<Mat<f64>>,
    /// Singular value decomposition of the tip's conditions in the last basis.
    left: Mat<f64>,
    singular_values: Vec<f64>,
    right: Mat<f64>,
    /// How many directions the conditions determine: all, or all but the turns of veins that can
    /// turn without resistance.
    determined: usize,
    tip: Tip,
    /// The first of the components that are free at the base.
    free_at_base: usize,
    units: Units,
}

impl CondensedEquations {
    /// Propagates the sensitivities to the tip. `None` if they are not finite. The `turns` of
    /// veins that can turn without resistance, at the base, are left undetermined where they are
    /// what the conditions determine least.
    pub fn new(
        equations: &Equations,
        units: &Units,
        maps: Vec<Mat<f64>>,
        turns: &[Vec<f64>],
    ) -> Option<Self> {
        let (mut bases, mut growths) = (Vec::new(), Vec::new());
        let mut reached = maps[0].clone();
        for map in &maps[1..] {
            let qr = reached.qr();
            let basis = qr.compute_thin_Q();
            reached = map * &basis;
            bases.push(basis);
            growths.push(qr.thin_R().to_owned());
        }
        let tip = equations.tip();
        let columns: Vec<Vec<f64>> = (reached.col_iter())
            .map(|column| at_tip(tip, units, column))
            .collect();
        let conditions = Mat::from_fn(columns.len(), columns.len(), |i, c| columns[c][i]);
        if !conditions.is_all_finite() {
            return None;
        }
        let svd = conditions.svd().ok()?;
        let determined = svd.S().column_vector().nrows();
        let mut march = CondensedEquations {
            maps,
            bases,
            growths,
            left: svd.U().to_owned(),
            singular_values: svd.S().column_vector().iter().copied().collect(),
            right: svd.V().to_owned(),
            determined,
            tip,
            free_at_base: equations.free_at_base(),
            units: units.clone(),
        };
        let least = orthonormal((0..turns.len()).map(|k| march.direction(k).swap_remove(0)));
        let along = |turn: &&Vec<f64>| {
            let parts = least.iter().map(|direction| dot(direction, turn).powi(2));
            (parts.sum::<f64>() / dot(turn, turn)).sqrt() > ALONG_TURN
        };
        march.determined -= turns.iter().filter(along).count();
        Some(march)
    }

    /// The tip conditions of a state, in the same units.
    pub fn scaled(&self, conditions: &[f64]) -> Vec<f64> {
        let total_force = self.units.total_force();
        (conditions.iter().enumerate())
            .map(|(i, value)| match (self.tip, i / 6, i % 6) {
                (Tip::Joint, 0, 0..3) => value / total_force,
                (Tip::Joint | Tip::Pinned, _, 0..3) | (Tip::Clamped, ..) => *value,
                (_, j, k) => value / self.units.of(TANGENT * j + 6 + k),
            })
            .collect()
    }

    /// Smallest singular value of the tip's conditions over the largest.
    pub fn condition(&self) -> f64 {
        match &self.singular_values[..self.determined] {
            [largest, .., smallest] => smallest / largest,
            _ => 1.0,
        }
    }

    /// The increments at the beginnings of all intervals that close `defects`
    /// (end of an interval minus beginning of the next, K - 1 of them) and satisfy
    /// the tip's `conditions`. Undetermined directions are left unchanged.
    pub fn solve(&self, defects: &[Vec<f64>], conditions: &[f64]) -> Vec<Vec<f64>> {
        let (mut offsets, mut shifts) = (Vec::new(), Vec::new());
        let mut carried: Option<Col<f64>> = None;
        for (k, basis) in self.bases.iter().enumerate() {
            let mut b = Col::from_fn(defects[k].len(), |i| defects[k][i]);
            if let Some(carried) = &carried {
                b += carried;
            }
            let within = basis.transpose() * &b;
            b -= basis * &within;
            carried = Some(&self.maps[k + 1] * &b);
            offsets.push(b);
            shifts.push(within);
        }
        let mut missed = Col::from_fn(conditions.len(), |i| -conditions[i]);
        if let Some(carried) = &carried {
            for (sum, value) in
                missed
                    .iter_mut()
                    .zip(at_tip(self.tip, &self.units, carried.as_ref()))
            {
                *sum -= value;
            }
        }
        let mut amounts = self.left.transpose() * &missed;
        let values = self.singular_values.iter().enumerate();
        for (amount, (k, value)) in amounts.iter_mut().zip(values) {
            let singular = *value <= SINGULAR * self.singular_values[0];
            let undetermined = singular || k >= self.determined;
            *amount = if undetermined { 0.0 } else { *amount / value };
        }
        self.back(&self.right * &amounts, &offsets, &shifts)
    }

    /// The direction that the tip's conditions determine least, at the beginnings of all
    /// intervals; not the turns of veins that can turn without resistance.
    pub fn null(&self) -> Vec<Vec<f64>> {
        self.direction(0)
    }

    /// Of the directions that are determined, one of those that are least.
    fn direction(&self, from_least: usize) -> Vec<Vec<f64>> {
        let none = |matrix: &Mat<f64>| Col::zeros(matrix.nrows());
        let offsets: Vec<Col<f64>> = self.bases.iter().map(none).collect();
        let shifts: Vec<Col<f64>> = self.growths.iter().map(none).collect();
        let last = self.right.col(self.determined - 1 - from_least).to_owned();
        self.back(last, &offsets, &shifts)
    }

    /// Back substitution from the free coefficients at the last node to the base.
    fn back(&self, last: Col<f64>, offsets: &[Col<f64>], shifts: &[Col<f64>]) -> Vec<Vec<f64>> {
        let mut increments = Vec::new();
        let mut free = last;
        for k in (0..self.bases.len()).rev() {
            let increment = &self.bases[k] * &free + &offsets[k];
            increments.push(increment.iter().copied().collect());
            free -= &shifts[k];
            back_substitute(&self.growths[k], &mut free);
        }
        // At the base six components are free.
        let first = self.free_at_base;
        let rods = free.nrows() / 6;
        let base = (0..rods).flat_map(|j| {
            let free = &free;
            (0..TANGENT).map(move |k| match k.checked_sub(first) {
                Some(k) if k < 6 => free[6 * j + k],
                _ => 0.0,
            })
        });
        increments.push(base.collect());
        increments.reverse();
        increments
    }
}

/// Linearised tip conditions of a perturbation at the tip.
fn at_tip(tip: Tip, units: &Units, perturbation: ColRef<f64>) -> Vec<f64> {
    let rods = perturbation.nrows() / TANGENT;
    let get = |j: usize, k: usize| perturbation[TANGENT * j + k];
    (0..rods)
        .flat_map(|j| (0..6).map(move |k| (j, k)))
        .map(|(j, k)| match (tip, k) {
            (Tip::Joint, 0..3) if j == 0 => {
                let force = |j: usize| get(j, 6 + k) * units.of(TANGENT * j + 6);
                (0..rods).map(force).sum::<f64>() / units.total_force()
            }
            (Tip::Joint, 0..3) => get(j, k) - get(0, k),
            (Tip::Pinned, 0..3) | (Tip::Clamped, _) => get(j, k),
            _ => get(j, 6 + k),
        })
        .collect()
}

/// x <- R^-1 x with R upper triangular.
fn back_substitute(r: &Mat<f64>, x: &mut Col<f64>) {
    for i in (0..x.nrows()).rev() {
        let mut sum = x[i];
        for c in i + 1..x.nrows() {
            sum -= r[(i, c)] * x[c];
        }
        x[i] = sum / r[(i, i)];
    }
}

/// An orthonormal basis of what these directions span.
fn orthonormal(directions: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut direction in directions {
        for other in &basis {
            let part = dot(other, &direction);
            let pairs = direction.iter_mut().zip(other);
            pairs.for_each(|(value, other)| *value -= part * other);
        }
        let length = dot(&direction, &direction).sqrt();
        direction.iter_mut().for_each(|value| *value /= length);
        basis.push(direction);
    }
    basis
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
