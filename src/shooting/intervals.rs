//! The intervals of multiple shooting: the initial-value problems between its nodes, their defects and
//! sensitivities, and the linear equations of all intervals, condensed to the tip.
//!
//! The base leaves 6 N perturbations free. They are propagated through the
//! intervals and re-orthonormalized before they all grow into the few directions of
//! fastest growth (S. K. Godunov 1961; S. D. Conte, SIAM Rev. 8,
//! 1966). The tip's 6 N conditions determine them; back substitution divides by the growth.
//! The product of all sensitivities is never formed.

#[cfg(test)]
mod tests;

use crate::numbers::{larger, largest};
use crate::shooting::equations::{BoundaryValueProblem, TipConstraint};
use crate::shooting::integrate::{
    InitialValueIntegrator, LeafTrajectory, ResultantSizes, ShootingNodes, UnboundedSolution,
};
use crate::shooting::rod_state::{
    FreeBaseChanges, JumpDerivatives, PERTURBATION_SIZE, RodState, rotation_difference,
};
use crate::shooting::sensitivities::{LinearStep, Perturbations, coupled_rods};
use faer::{Col, ColRef, Mat};
use glam::DVec3;
use rayon::prelude::*;

/// How the length is divided into intervals.
pub struct IntervalChoice {
    /// Largest growth of a perturbation over one interval. Doubled, intervals are fewer by a tenth, and
    /// Newton's method starts from larger defects.
    pub largest_growth: f64,
    /// Most intervals chosen automatically, summed over rods: of N rods their matrices take
    /// 24 N MB (see [`crate::memory`]), in proportion to this.
    most_rod_intervals: usize,
    /// Local error of the integration that measures growth, of which the magnitude is enough.
    growth_tolerance: f64,
    /// Local error of the integration that continues a start beyond its stations.
    start_tolerance: f64,
}

pub const INTERVAL_CHOICE: IntervalChoice = IntervalChoice {
    largest_growth: 1e3,
    most_rod_intervals: 4096,
    growth_tolerance: 1e-4,
    start_tolerance: 1e-8,
};

/// Units of perturbations, so that none dominates the
/// others: lengths and angles are not scaled, forces and moments of a rod are in
/// units of the larger of what it carries and what bends it.
#[derive(Clone, Debug)]
pub struct PerturbationUnits {
    rods: Vec<ResultantSizes>,
}

impl PerturbationUnits {
    /// Units for a leaf near a trajectory.
    pub fn new(equations: &BoundaryValueProblem, near: &LeafTrajectory) -> Self {
        let rods = (0..equations.rods()).map(|j| {
            let largest = near.largest_resultants(j);
            let soft = equations.softest_couple_stiffness[j];
            ResultantSizes {
                force: soft + largest.force,
                moment: soft + largest.moment,
            }
        });
        PerturbationUnits {
            rods: rods.collect(),
        }
    }

    /// The unit of the `k`-th component of a leaf's perturbation.
    pub fn component_unit(&self, k: usize) -> f64 {
        match k % PERTURBATION_SIZE {
            0..6 => 1.0,
            6..9 => self.rods[k / PERTURBATION_SIZE].force,
            _ => self.rods[k / PERTURBATION_SIZE].moment,
        }
    }

    /// The unit of the sum of all forces at the tip.
    pub fn total_force(&self) -> f64 {
        largest(self.rods.iter().map(|rod| rod.force))
    }

    /// The largest unit of a moment.
    pub fn largest_moment(&self) -> f64 {
        largest(self.rods.iter().map(|rod| rod.moment))
    }

    /// The difference a - b of two flat states.
    pub fn difference(&self, a: &[f64], b: &[f64]) -> Vec<f64> {
        (self.rods.iter().enumerate())
            .flat_map(|(j, unit)| {
                let (a, b) = (
                    RodState::from_flat_state(a, j),
                    RodState::from_flat_state(b, j),
                );
                [
                    a.r - b.r,
                    rotation_difference(a.q, b.q),
                    (a.n - b.n) / unit.force,
                    (a.m - b.m) / unit.moment,
                ]
            })
            .flat_map(|v| v.to_array())
            .collect()
    }

    /// Adds `step` times an increment to a flat state.
    pub fn advance(&self, y: &mut [f64], increment: &[f64], step: f64) {
        for (j, unit) in self.rods.iter().enumerate() {
            let mut rod = RodState::from_flat_state(y, j);
            let part =
                |k: usize| step * DVec3::from_slice(&increment[PERTURBATION_SIZE * j + 3 * k..]);
            rod.r += part(0);
            rod.q = (glam::DQuat::from_scaled_axis(part(1)) * rod.q).normalize();
            rod.n += part(2) * unit.force;
            rod.m += part(3) * unit.moment;
            rod.write_flat_state(y, j);
        }
    }
}

/// Result of the integration over an interval.
pub struct IntegratedInterval {
    pub end_state: Vec<f64>,
    /// The linearized equations along it, if requested.
    steps: Vec<LinearStep>,
    pub step_count: usize,
    pub evaluations: usize,
}

/// Integrates over all intervals, in parallel.
pub fn integrate(
    equations: &BoundaryValueProblem,
    nodes: &ShootingNodes,
    tolerance: f64,
    linearize: bool,
) -> Result<Vec<IntegratedInterval>, UnboundedSolution> {
    (0..nodes.states.len())
        .into_par_iter()
        .map(|k| {
            let (begin, end) = (nodes.sigma[k], nodes.sigma[k + 1]);
            let y = nodes.states[k].clone();
            let mut integrator = InitialValueIntegrator::new(equations, begin, y, tolerance);
            let (mut steps, mut count) = (Vec::new(), 0);
            integrator.run(end, |integrator| {
                count += 1;
                if linearize {
                    steps.push(LinearStep::from_last_step(equations, integrator));
                }
            })?;
            Ok(IntegratedInterval {
                end_state: integrator.y,
                steps,
                step_count: count,
                evaluations: integrator.evaluations,
            })
        })
        .collect()
}

/// Response of a group of rods at the end of an interval to perturbations of one rod, dimensionless.
pub struct GroupResponse {
    /// The first rod of the group.
    first_rod: usize,
    /// Rows of numbers from this rod on, one for each component of a rod's perturbation.
    rows: Vec<f64>,
}

/// Pairs of interval and rod that a thread processes between progress reports.
const PAIRS_PER_CHUNK: usize = 4;

/// The responses of all rods over all intervals, of which the first begins at this `base`, in parallel. `proceed` is called with the part
/// that is done, and returns whether to continue.
pub fn responses(
    equations: &BoundaryValueProblem,
    integrated: &[IntegratedInterval],
    base: &[f64],
    proceed: &mut dyn FnMut(f64) -> bool,
) -> Option<Vec<GroupResponse>> {
    let rods = equations.rods();
    let all = integrated.len() * rods;
    let together = PAIRS_PER_CHUNK * rayon::current_num_threads();
    let mut found = Vec::with_capacity(all);
    while found.len() < all {
        if !proceed(found.len() as f64 / all as f64) {
            return None;
        }
        let some = found.len()..all.min(found.len() + together);
        let some = some.into_par_iter().map(|task| {
            let (steps, j) = (&integrated[task / rods].steps, task % rods);
            match task < rods {
                true => {
                    let first = equations.first_free_component(j);
                    let rods = coupled_rods(equations, j);
                    let mut all = Perturbations::<6>::unit_perturbations(rods, j, first);
                    if equations.base_turns(j) {
                        let base = RodState::from_flat_state(base, j);
                        all.set_base_changes(j, &equations.free_base_changes(j, &base));
                    }
                    perturbation_responses(equations, steps, all)
                }
                false => {
                    let rods = coupled_rods(equations, j);
                    let all = Perturbations::<PERTURBATION_SIZE>::unit_perturbations(rods, j, 0);
                    perturbation_responses(equations, steps, all)
                }
            }
        });
        found.par_extend(some);
    }
    Some(found)
}

/// The sensitivities of the ends of all intervals to their beginnings, in the
/// given units: square, except in the first interval, which begins at the base,
/// where only [six components](BoundaryValueProblem::first_free_component) are perturbed.
pub fn sensitivities(
    equations: &BoundaryValueProblem,
    units: &PerturbationUnits,
    responses: &[GroupResponse],
    growth: &mut Vec<f64>,
) -> Vec<Mat<f64>> {
    let rods = equations.rods();
    (responses.chunks(rods).enumerate())
        .map(|(k, columns)| {
            let kinds = if k == 0 { 6 } else { PERTURBATION_SIZE };
            let first_kind = |j: usize| match k {
                0 => equations.first_free_component(j),
                _ => 0,
            };
            let mut matrix = Mat::zeros(PERTURBATION_SIZE * rods, kinds * rods);
            let mut largest: f64 = 1.0;
            for (j, response) in columns.iter().enumerate() {
                for (i, row) in response.rows.chunks(kinds).enumerate() {
                    let row_index = PERTURBATION_SIZE * response.first_rod + i;
                    for (k, value) in row.iter().enumerate() {
                        let from = PERTURBATION_SIZE * j + first_kind(j) + k;
                        matrix[(row_index, kinds * j + k)] =
                            value * units.component_unit(from) / units.component_unit(row_index);
                        if from % PERTURBATION_SIZE / 3 == row_index % PERTURBATION_SIZE / 3 {
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
fn perturbation_responses<const W: usize>(
    equations: &BoundaryValueProblem,
    steps: &[LinearStep],
    mut perturbations: Perturbations<W>,
) -> GroupResponse {
    for step in steps {
        perturbations.propagate(equations, step);
    }
    GroupResponse {
        first_rod: perturbations.rods.start,
        rows: perturbations.entries,
    }
}

/// Chooses intervals over which no perturbation grows by more than
/// [`IntervalChoice::largest_growth`].
///
/// Growth is measured separately for positions, rotations, forces and moments, which makes it
/// independent of units, for every rod with its neighbors held; with tissue whose stresses are unknowns
/// for the whole leaf.
/// Fails if too many intervals would be needed.
pub fn choose_intervals(
    equations: &BoundaryValueProblem,
    near: &LeafTrajectory,
) -> Result<ShootingNodes, UnboundedSolution> {
    let mut sigma = vec![0.0];
    'intervals: loop {
        let begin = sigma[sigma.len() - 1];
        if sigma.len() * equations.rods()
            > (INTERVAL_CHOICE.most_rod_intervals).max(equations.rods())
        {
            return Err(UnboundedSolution { sigma: begin });
        }
        let mut integrator = InitialValueIntegrator::new(
            equations,
            begin,
            near.interpolate_state(begin),
            INTERVAL_CHOICE.growth_tolerance,
        );
        let mut rods: Vec<Perturbations<PERTURBATION_SIZE>> = (0..equations.rods())
            .map(|j| {
                let rods = match equations.has_tissue_stresses() {
                    true => coupled_rods(equations, j),
                    false => j..j + 1,
                };
                Perturbations::unit_perturbations(rods, j, 0)
            })
            .collect();
        while integrator.sigma < 1.0 {
            let before = integrator.sigma;
            let failed = integrator.step(1.0).is_err();
            let grown = failed || {
                let step = LinearStep::from_last_step(equations, &integrator);
                rods.iter_mut().any(|rod| {
                    rod.propagate(equations, &step);
                    largest_growth(rod.rows()) > INTERVAL_CHOICE.largest_growth
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
    Ok(ShootingNodes { sigma, states })
}

/// States at the beginnings of intervals. Interpolation far from
/// stations may lead Newton's method to another solution.
fn begin(equations: &BoundaryValueProblem, near: &LeafTrajectory, sigma: &[f64]) -> Vec<Vec<f64>> {
    let known = |sigma: f64| near.last_station(sigma) == Some(sigma);
    let at = |k: usize| {
        let here = sigma[k];
        if k == 0 || known(here) || !known(sigma[k - 1]) {
            return near.interpolate_state(here);
        }
        let before = sigma[k - 1];
        let mut integrator = InitialValueIntegrator::new(
            equations,
            before,
            near.interpolate_state(before),
            INTERVAL_CHOICE.start_tolerance,
        );
        match integrator.run(here, |_| ()) {
            Ok(()) => integrator.y,
            Err(_) => near.interpolate_state(here),
        }
    };
    (0..sigma.len() - 1).map(at).collect()
}

/// Largest sensitivity within one kind of quantity.
fn largest_growth(rows: &[[f64; PERTURBATION_SIZE]]) -> f64 {
    let own =
        (0..rows.len()).flat_map(|i| (0..3).map(move |c| (i, i % PERTURBATION_SIZE / 3 * 3 + c)));
    largest(own.map(|(i, c)| rows[i][c].abs()))
}

/// Directions of the tip's conditions with singular values below this part
/// of the largest count as undetermined.
const UNDETERMINED_SINGULAR_RATIO: f64 = 1e-10;

/// Cosine of the angle between the least determined directions and a turn of veins without resistance
/// above which they are this turn.
const ZERO_ENERGY_COSINE: f64 = 0.9;

/// What is free at the base of a rod.
struct FreeAtBase {
    /// The first of the components of its perturbation that are free.
    first: usize,
    /// If a hinge holds its spin, its changes with the first three numbers, in the units. Otherwise these are the
    /// components, and the moment of a spring follows from the rotation.
    changes: Option<FreeBaseChanges>,
}

impl FreeAtBase {
    /// The perturbation of the base by six numbers that are free there.
    fn perturbation(&self, free: [f64; 6]) -> [f64; PERTURBATION_SIZE] {
        let mut all = [0.0; PERTURBATION_SIZE];
        let kept = PERTURBATION_SIZE.min(self.first + 6);
        all[self.first..kept].copy_from_slice(&free[..kept - self.first]);
        if let Some(changes) = &self.changes {
            let turn = DVec3::new(free[0], free[1], free[2]);
            all[3..6].copy_from_slice(&(changes.rotation * turn).to_array());
            all[9..].copy_from_slice(&(changes.moment * turn).to_array());
        }
        all
    }
}

/// The condensed equations, factorized.
pub struct CondensedEquations {
    maps: Vec<Mat<f64>>,
    /// Orthonormal bases of the free perturbations at the inner nodes.
    bases: Vec<Mat<f64>>,
    /// The growth of these bases over an interval: upper triangular.
    growths: Vec<Mat<f64>>,
    /// Singular value decomposition of the tip's conditions in the last basis.
    left: Mat<f64>,
    singular_values: Vec<f64>,
    right: Mat<f64>,
    /// How many directions the conditions determine: all but the turns of veins that can
    /// turn without resistance, and the forces between joint tips that rigid tissue carries as well.
    determined: usize,
    tip: TipConstraint,
    /// What is free at the base of every rod.
    free_at_base: Vec<FreeAtBase>,
    units: PerturbationUnits,
    /// Derivatives of what loads on points at the tips add to n and m there; empty if these do not depend on
    /// rotations.
    tip_jumps: Vec<JumpDerivatives>,
}

impl CondensedEquations {
    /// Propagates the sensitivities to the tip. `None` if they are not finite. The `turns` of
    /// veins that can turn without resistance, at the base, are left undetermined where they are
    /// what the conditions determine least. `tip_jumps` are the derivatives of the loads on points at the tips;
    /// `base` is the state at the bases.
    pub fn new(
        equations: &BoundaryValueProblem,
        units: &PerturbationUnits,
        base: &[f64],
        maps: Vec<Mat<f64>>,
        turns: &[Vec<f64>],
        tip_jumps: Vec<JumpDerivatives>,
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
        let tip = equations.tip_constraint();
        let columns: Vec<Vec<f64>> = (reached.col_iter())
            .map(|column| linearized_tip_conditions(tip, units, &tip_jumps, column))
            .collect();
        let conditions = Mat::from_fn(columns.len(), columns.len(), |i, c| columns[c][i]);
        if !conditions.is_all_finite() {
            return None;
        }
        let svd = conditions.svd().ok()?;
        let all = svd.S().column_vector().nrows();
        let determined = all - equations.redundant_tip_conditions();
        let of_base = |j: usize| FreeAtBase {
            first: equations.first_free_component(j),
            changes: equations.holds_base_spin(j).then(|| {
                let changes = equations.free_base_changes(j, &RodState::from_flat_state(base, j));
                let unit = units.component_unit(PERTURBATION_SIZE * j + 9);
                FreeBaseChanges {
                    moment: changes.moment * unit.recip(),
                    ..changes
                }
            }),
        };
        let mut march = CondensedEquations {
            maps,
            bases,
            growths,
            left: svd.U().to_owned(),
            singular_values: svd.S().column_vector().iter().copied().collect(),
            right: svd.V().to_owned(),
            determined,
            tip,
            free_at_base: (0..equations.rods()).map(of_base).collect(),
            units: units.clone(),
            tip_jumps,
        };
        let least = orthonormal_basis(
            (0..turns.len()).map(|k| march.weakly_determined_direction(k).swap_remove(0)),
        );
        let along = |turn: &&Vec<f64>| {
            let parts = least.iter().map(|direction| dot(direction, turn).powi(2));
            (parts.sum::<f64>() / dot(turn, turn)).sqrt() > ZERO_ENERGY_COSINE
        };
        march.determined -= turns.iter().filter(along).count();
        Some(march)
    }

    /// The tip conditions of a state, in the same units.
    pub fn scaled_tip_conditions(&self, conditions: &[f64]) -> Vec<f64> {
        let total_force = self.units.total_force();
        (conditions.iter().enumerate())
            .map(|(i, value)| match (self.tip, i / 6, i % 6) {
                (TipConstraint::Joint, 0, 0..3) => value / total_force,
                (TipConstraint::Joint | TipConstraint::Pinned, _, 0..3)
                | (TipConstraint::Clamped, ..) => *value,
                (_, j, k) => value / self.units.component_unit(PERTURBATION_SIZE * j + 6 + k),
            })
            .collect()
    }

    /// Smallest singular value of the tip's conditions over the largest.
    pub fn singular_value_ratio(&self) -> f64 {
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
            for (sum, value) in missed.iter_mut().zip(linearized_tip_conditions(
                self.tip,
                &self.units,
                &self.tip_jumps,
                carried.as_ref(),
            )) {
                *sum -= value;
            }
        }
        let mut amounts = self.left.transpose() * &missed;
        let values = self.singular_values.iter().enumerate();
        for (amount, (k, value)) in amounts.iter_mut().zip(values) {
            let singular = *value <= UNDETERMINED_SINGULAR_RATIO * self.singular_values[0];
            let undetermined = singular || k >= self.determined;
            *amount = if undetermined { 0.0 } else { *amount / value };
        }
        self.substitute_to_base(&self.right * &amounts, &offsets, &shifts)
    }

    /// The direction that the tip's conditions determine least, at the beginnings of all
    /// intervals; not the turns of veins that can turn without resistance.
    pub fn least_determined_direction(&self) -> Vec<Vec<f64>> {
        self.weakly_determined_direction(0)
    }

    /// The direction that the conditions determine least but for `from_least` others.
    fn weakly_determined_direction(&self, from_least: usize) -> Vec<Vec<f64>> {
        let none = |matrix: &Mat<f64>| Col::zeros(matrix.nrows());
        let offsets: Vec<Col<f64>> = self.bases.iter().map(none).collect();
        let shifts: Vec<Col<f64>> = self.growths.iter().map(none).collect();
        let last = self.right.col(self.determined - 1 - from_least).to_owned();
        self.substitute_to_base(last, &offsets, &shifts)
    }

    /// Back substitution from the free coefficients at the last node to the base.
    fn substitute_to_base(
        &self,
        last: Col<f64>,
        offsets: &[Col<f64>],
        shifts: &[Col<f64>],
    ) -> Vec<Vec<f64>> {
        let mut increments = Vec::new();
        let mut free = last;
        for k in (0..self.bases.len()).rev() {
            let increment = &self.bases[k] * &free + &offsets[k];
            increments.push(increment.iter().copied().collect());
            free -= &shifts[k];
            back_substitute(&self.growths[k], &mut free);
        }
        // At the base six numbers are free.
        let bases = self.free_at_base.iter().enumerate();
        let base = bases.flat_map(|(j, of_base)| {
            of_base.perturbation(std::array::from_fn(|k| free[6 * j + k]))
        });
        increments.push(base.collect());
        increments.reverse();
        increments
    }
}

/// Linearized tip conditions of a perturbation at the tip, where loads depend on the rotation of the section.
fn linearized_tip_conditions(
    tip: TipConstraint,
    units: &PerturbationUnits,
    jumps: &[JumpDerivatives],
    perturbation: ColRef<f64>,
) -> Vec<f64> {
    let rods = perturbation.nrows() / PERTURBATION_SIZE;
    let own = |j: usize, k: usize| perturbation[PERTURBATION_SIZE * j + k];
    // Force and moment but for the changes of these loads.
    let get = |j: usize, k: usize| match jumps.get(j).filter(|_| k >= 6) {
        None => own(j, k),
        Some(jump) => {
            let turn = DVec3::from_array([3, 4, 5].map(|k| own(j, k)));
            let change = match k < 9 {
                true => (jump.n_theta * turn)[k - 6],
                false => (jump.m_theta * turn)[k - 9],
            };
            let [rotation, resultant] =
                [3, k].map(|k| units.component_unit(PERTURBATION_SIZE * j + k));
            own(j, k) + change * (rotation / resultant)
        }
    };
    (0..rods)
        .flat_map(|j| (0..6).map(move |k| (j, k)))
        .map(|(j, k)| match (tip, k) {
            (TipConstraint::Joint, 0..3) if j == 0 => {
                let force =
                    |j: usize| get(j, 6 + k) * units.component_unit(PERTURBATION_SIZE * j + 6);
                (0..rods).map(force).sum::<f64>() / units.total_force()
            }
            (TipConstraint::Joint, 0..3) => get(j, k) - get(0, k),
            (TipConstraint::Pinned, 0..3) | (TipConstraint::Clamped, _) => get(j, k),
            _ => get(j, 6 + k),
        })
        .collect()
}

/// Solves in place: x <- R^-1 x with R upper triangular.
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
fn orthonormal_basis(directions: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
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
