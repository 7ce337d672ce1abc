//! The linear equations of multiple shooting, condensed to the tip.
//!
//! The base leaves 6 N perturbations free. They are marched through the
//! intervals and, before they can all grow into the few directions that grow
//! fastest, made orthonormal again (S. K. Godunov 1961; S. D. Conte, SIAM Rev. 8,
//! 1966). The tip's 6 N conditions decide; the way back divides by the growth.
//! A product of all sensitivities is never formed.

use faer::{Col, ColRef, Mat};

use super::equations::{Equations, TANGENT};
use super::intervals::Units;

/// Directions of the tip's conditions whose singular value is below this part
/// of the largest are taken as undetermined.
pub const SINGULAR: f64 = 1e-10;

/// The condensed equations, factorised.
pub struct March {
    /// Sensitivities of the intervals.
    maps: Vec<Mat<f64>>,
    /// Orthonormal bases of what the base leaves free, at the inner nodes.
    bases: Vec<Mat<f64>>,
    /// Their growth: upper triangular.
    growths: Vec<Mat<f64>>,
    /// Singular value decomposition of the tip's conditions by the last basis.
    left: Mat<f64>,
    singular_values: Vec<f64>,
    right: Mat<f64>,
    joined: bool,
    total_force: f64,
    units: Units,
}

impl March {
    /// Marches the sensitivities to the tip. `None` if they are not finite.
    pub fn new(equations: &Equations, units: &Units, maps: Vec<Mat<f64>>) -> Option<Self> {
        let (mut bases, mut growths): (Vec<Mat<f64>>, Vec<Mat<f64>>) = (Vec::new(), Vec::new());
        let mut reached = maps[0].clone();
        for map in &maps[1..] {
            let qr = reached.qr();
            bases.push(qr.compute_thin_Q());
            growths.push(qr.thin_R().to_owned());
            reached = map * bases.last().expect("one was just made");
        }
        let mut march = March {
            maps,
            bases,
            growths,
            left: Mat::new(),
            singular_values: Vec::new(),
            right: Mat::new(),
            joined: equations.joined(),
            total_force: units.total_force(),
            units: units.clone(),
        };
        let rows: Vec<Vec<f64>> = (0..reached.ncols())
            .map(|c| march.tip(reached.col(c)))
            .collect();
        let tip = Mat::from_fn(reached.ncols(), reached.ncols(), |i, c| rows[c][i]);
        if !tip.is_all_finite() {
            return None;
        }
        let svd = tip.svd().ok()?;
        march.left = svd.U().to_owned();
        march.right = svd.V().to_owned();
        march.singular_values = svd.S().column_vector().iter().copied().collect();
        Some(march)
    }

    /// Linearised tip conditions of a perturbation there.
    fn tip(&self, at_tip: ColRef<f64>) -> Vec<f64> {
        let rods = at_tip.nrows() / TANGENT;
        let get = |j: usize, k: usize| at_tip[TANGENT * j + k];
        (0..rods)
            .flat_map(|j| (0..6).map(move |k| (j, k)))
            .map(|(j, k)| match k {
                0..3 if self.joined && j == 0 => {
                    let force = |j: usize| get(j, 6 + k) * self.units.of(TANGENT * j + 6);
                    (0..rods).map(force).sum::<f64>() / self.total_force
                }
                0..3 if self.joined => get(j, k) - get(0, k),
                _ => get(j, 6 + k),
            })
            .collect()
    }

    /// The tip conditions of a state, in the same units.
    pub fn scaled(&self, conditions: &[f64]) -> Vec<f64> {
        conditions
            .iter()
            .enumerate()
            .map(|(i, value)| match (i / 6, i % 6) {
                (0, 0..3) if self.joined => value / self.total_force,
                (_, 0..3) if self.joined => *value,
                (j, k) => value / self.units.of(TANGENT * j + 6 + k),
            })
            .collect()
    }

    /// Smallest singular value of the tip's conditions over the largest.
    pub fn condition(&self) -> f64 {
        match self.singular_values.as_slice() {
            [largest, .., smallest] => smallest / largest,
            _ => 1.0,
        }
    }

    /// The increments at the beginnings of all intervals that close `defects`
    /// (end of an interval minus beginning of the next, K - 1 of them) and make
    /// the tip's `conditions` vanish. Undetermined directions are left alone.
    pub fn solve(&self, defects: &[Vec<f64>], conditions: &[f64]) -> Vec<Vec<f64>> {
        let mut offsets: Vec<Col<f64>> = Vec::new();
        let mut shifts: Vec<Col<f64>> = Vec::new();
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
            for (sum, value) in missed.iter_mut().zip(self.tip(carried.as_ref())) {
                *sum -= value;
            }
        }
        let mut amounts = self.left.transpose() * &missed;
        for (amount, value) in amounts.iter_mut().zip(&self.singular_values) {
            let undetermined = *value <= SINGULAR * self.singular_values[0];
            *amount = if undetermined { 0.0 } else { *amount / value };
        }
        self.back(&self.right * &amounts, &offsets, &shifts)
    }

    /// The direction the tip's conditions determine least, at the beginnings
    /// of all intervals.
    pub fn null(&self) -> Vec<Vec<f64>> {
        let none = |matrix: &Mat<f64>| Col::zeros(matrix.nrows());
        let offsets: Vec<Col<f64>> = self.bases.iter().map(none).collect();
        let shifts: Vec<Col<f64>> = self.growths.iter().map(none).collect();
        let last = self.right.col(self.right.ncols() - 1).to_owned();
        self.back(last, &offsets, &shifts)
    }

    /// From what is free at the last node back to the base.
    fn back(&self, last: Col<f64>, offsets: &[Col<f64>], shifts: &[Col<f64>]) -> Vec<Vec<f64>> {
        let mut increments = Vec::new();
        let mut free = last;
        for k in (0..self.bases.len()).rev() {
            let increment = &self.bases[k] * &free + &offsets[k];
            increments.push(increment.iter().copied().collect());
            free -= &shifts[k];
            back_substitute(&self.growths[k], &mut free);
        }
        // At the clamp only forces and moments are free.
        let rods = free.nrows() / 6;
        let base = (0..rods).flat_map(|j| {
            let free = &free;
            (0..TANGENT).map(move |k| if k < 6 { 0.0 } else { free[6 * j + k - 6] })
        });
        increments.push(base.collect());
        increments.reverse();
        increments
    }
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
