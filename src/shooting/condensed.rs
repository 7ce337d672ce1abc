//! The linear equations of multiple shooting, condensed to the tip.
//!
//! The base leaves 6 N perturbations free. They are propagated through the
//! intervals and re-orthonormalised before they all grow into the few directions of
//! fastest growth (S. K. Godunov 1961; S. D. Conte, SIAM Rev. 8,
//! 1966). The tip's 6 N conditions determine them; back substitution divides by the growth.
//! The product of all sensitivities is never formed.

use faer::{Col, ColRef, Mat};

use crate::shooting::equations::{Equations, Tip};
use crate::shooting::intervals::Units;
use crate::shooting::state::TANGENT;

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

#[cfg(test)]
mod tests;
