use crate::scenario::Scenario;
use crate::shooting::integrate::LeafTrajectory;
use crate::shooting::intervals::*;
use faer::prelude::Solve;

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
    let equations = BoundaryValueProblem::new(&scenario);
    let units = PerturbationUnits::new(&equations, &LeafTrajectory::straight(&equations));
    let base = equations.unstressed_base_state();
    CondensedEquations::new(&equations, &units, &base, maps, &[], Vec::new())
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
fn tip_rows(joined: bool, units: &PerturbationUnits) -> Mat<f64> {
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
                rows[(row, 12 * rod + 6 + k)] =
                    units.component_unit(12 * rod + 6) / units.total_force();
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
        let equations = BoundaryValueProblem::new(&scenario);
        let condensed = condensed(joined, maps(1, 1.0)).unwrap();
        let mut noise = noise();
        let step: Vec<f64> = (0..36).map(|_| 0.1 * noise()).collect();
        let mut y = equations.unstressed_base_state();
        condensed.units.advance(&mut y, &step, 1.0);
        let found = condensed.scaled_tip_conditions(&equations.tip_conditions(&y));
        let step = Col::from_fn(36, |i| step[i]);
        let wanted = tip_rows(joined, &condensed.units) * &step;
        let linear = linearized_tip_conditions(
            equations.tip_constraint(),
            &condensed.units,
            &[],
            step.as_ref(),
        );
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
    let condition = condensed.singular_value_ratio();
    assert!(condition < 1e-13, "{condition:.1e}");

    let null = condensed.least_determined_direction();
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
