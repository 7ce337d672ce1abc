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
mod tests {
    use faer::prelude::Solve;

    use super::*;
    use crate::scenario::Scenario;
    use crate::shooting::trajectory::Trajectory;

    fn scenario(joined: bool) -> Scenario {
        let text = format!(
            r#"
            name = "three"
            leaf = {{ rods = 3, length = 1.0, fan = [-0.5, 0.1, 0.4], joined = {joined} }}
            stiffness = {{ torsion = [0.8, 3.0, 0.1], bending_2 = 1.0, bending_3 = 1.5, axial = inf, shear_2 = inf, shear_3 = inf }}
            "#
        );
        Scenario::from_toml(&text).unwrap()
    }

    fn condensed(joined: bool, maps: Vec<Mat<f64>>) -> Option<CondensedEquations> {
        let scenario = scenario(joined);
        let equations = Equations::new(&scenario);
        let units = Units::new(&equations, &Trajectory::straight(&equations));
        CondensedEquations::new(&equations, &units, maps, &[])
    }

    /// Pseudo-random numbers in -1..1.
    fn noise() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6364136223846793005);
            state = state.wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    /// Sensitivities over intervals: half of the directions grow, half decay.
    fn maps(intervals: usize, growth: f64) -> Vec<Mat<f64>> {
        let mut noise = noise();
        let mut entry = |c: usize| 0.3 * noise() * growth.powf((c as f64 - 17.5) / 17.5);
        let columns = |k: usize| if k == 0 { 18 } else { 36 };
        let map = |k| Mat::from_fn(36, columns(k), |_, c| entry(c));
        (0..intervals).map(map).collect()
    }

    /// Rows of the tip's conditions, according to the documentation of the module.
    fn tip_rows(joined: bool, units: &Units) -> Mat<f64> {
        let mut rows = Mat::zeros(18, 36);
        for (j, k) in (0..3).flat_map(|j| (0..3).map(move |k| (j, k))) {
            let row = 6 * j + k;
            rows[(row + 3, 12 * j + 9 + k)] = 1.0;
            if !joined {
                rows[(row, 12 * j + 6 + k)] = 1.0;
            } else if j > 0 {
                rows[(row, 12 * j + k)] = 1.0;
                rows[(row, k)] = -1.0;
            } else {
                for rod in 0..3 {
                    rows[(row, 12 * rod + 6 + k)] = units.of(12 * rod + 6) / units.total_force();
                }
            }
        }
        rows
    }

    /// The whole system at once: continuity between intervals, and the tip's
    /// conditions.
    fn dense(maps: &[Mat<f64>], tip: &Mat<f64>, misses: &[f64]) -> Col<f64> {
        let mut matrix = Mat::zeros(misses.len(), misses.len());
        for (k, map) in maps.iter().enumerate() {
            let row = 36 * k;
            let mut block = map.clone();
            if k + 1 == maps.len() {
                block = tip * block;
            } else {
                (0..36).for_each(|i| matrix[(row + i, row + 18 + i)] = -1.0);
            }
            let (rows, columns) = block.shape();
            let place = matrix.submatrix_mut(row, row.saturating_sub(18), rows, columns);
            { place }.copy_from(&block);
        }
        let right = Col::from_fn(misses.len(), |i| -misses[i]);
        matrix.full_piv_lu().solve(&right)
    }

    #[test]
    fn the_condensed_solution_is_that_of_the_whole_system() {
        let cases = [(1, 1.0), (2, 1.0), (5, 1e2), (12, 1e3), (12, 1e5)];
        for (i, (intervals, growth)) in [cases, cases].concat().into_iter().enumerate() {
            let (joined, maps, mut noise) = (i < 5, maps(intervals, growth), noise());
            let misses: Vec<f64> = (0..36 * intervals - 18).map(|_| noise()).collect();
            let (defects, conditions) = misses.split_at(36 * (intervals - 1));
            let defects: Vec<Vec<f64>> = defects.chunks(36).map(<[f64]>::to_vec).collect();
            let condensed = condensed(joined, maps.clone()).unwrap();
            let found = condensed.solve(&defects, conditions);
            let wanted = dense(&maps, &tip_rows(joined, &condensed.units), &misses);
            let mut wanted = wanted.iter().copied();
            let what = format!("joined {joined}, {intervals} intervals, {growth:e}");
            for (k, found) in found.iter().enumerate() {
                let clamped = |i: usize| k == 0 && i % 12 < 6;
                let mut next = |i| match clamped(i) {
                    true => 0.0,
                    false => wanted.next().unwrap(),
                };
                let wanted: Vec<f64> = (0..36).map(&mut next).collect();
                let largest = wanted.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                for (found, wanted) in found.iter().zip(&wanted) {
                    // Both solutions round, by more where the maps grow more.
                    let off = (found - wanted).abs() / largest;
                    assert!(off < 1e-13 * growth, "{what}: {found}, {wanted}");
                }
            }
        }
    }

    /// Conditions of a state are scaled as those of perturbations are.
    #[test]
    fn conditions_are_in_the_units_of_the_unknowns() {
        for joined in [true, false] {
            let scenario = scenario(joined);
            let equations = Equations::new(&scenario);
            let condensed = condensed(joined, maps(1, 1.0)).unwrap();
            let mut noise = noise();
            let step: Vec<f64> = (0..36).map(|_| 0.1 * noise()).collect();
            let mut y = equations.clamped();
            condensed.units.advance(&mut y, &step, 1.0);
            let found = condensed.scaled(&equations.tip_conditions(&y));
            let step = Col::from_fn(36, |i| step[i]);
            let wanted = tip_rows(joined, &condensed.units) * &step;
            let linear = at_tip(equations.tip(), &condensed.units, step.as_ref());
            for (i, found) in found.iter().enumerate() {
                assert!((found - wanted[i]).abs() < 1e-14, "condition {i}");
                assert!((linear[i] - wanted[i]).abs() < 1e-14);
            }
        }
    }

    /// A direction that the last interval maps to zero at the tip is neutral.
    /// It is found, and left unchanged by the solution.
    #[test]
    fn what_the_tip_does_not_feel_is_found_and_left_alone() {
        let mut maps = maps(3, 10.0);
        let begin = Col::from_fn(18, |i| (i as f64).cos());
        let middle = &maps[0] * &begin;
        let last = &maps[1] * &middle;
        let lost = &maps[2] * &last;
        maps[2] -= (1.0 / last.squared_norm_l2()) * &lost * last.transpose();
        let condensed = condensed(true, maps).unwrap();
        let condition = condensed.condition();
        assert!(condition < 1e-13, "{condition:.1e}");

        let null = condensed.null();
        let factor = null[0][6] / begin[0];
        for (i, value) in begin.iter().enumerate() {
            let found = null[0][12 * (i / 6) + 6 + i % 6];
            assert!((found - factor * value).abs() < 1e-12, "{i}: {found}");
        }
        for (found, wanted) in [(&null[1], &middle), (&null[2], &last)] {
            for (found, wanted) in found.iter().zip(wanted.iter()) {
                assert!((found - factor * wanted).abs() < 1e-12);
            }
        }

        let quiet = vec![vec![0.0; 36]; 2];
        let step = condensed.solve(&quiet, &[1e-3; 18]);
        assert!(step.iter().flatten().all(|v| v.abs() < 1.0));
        let along: f64 = step[2].iter().zip(last.iter()).map(|(a, b)| a * b).sum();
        assert!(along.abs() < 1e-12, "{along:.1e}");
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        let mut maps = maps(2, 1.0);
        maps[1][(0, 0)] = f64::NAN;
        assert!(condensed(true, maps).is_none());
    }
}
