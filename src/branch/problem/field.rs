//! Linear algebra on fields of nodal increments and forces.

use crate::leaf::{Field, Increment, State};
use crate::relax::Stencil;

/// The work of forces on increments.
pub fn dot(forces: &Field, increments: &Field) -> f64 {
    let mut sum = 0.0;
    for (f, d) in forces.iter().flatten().zip(increments.iter().flatten()) {
        sum += (0..6).map(|c| f[c] * d[c]).sum::<f64>();
    }
    sum
}

/// a + factor b.
pub fn plus(a: &Field, factor: f64, b: &Field) -> Field {
    let mut sum = a.clone();
    add(&mut sum, factor, b);
    sum
}

/// a <- a + factor b.
pub fn add(a: &mut Field, factor: f64, b: &Field) {
    for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        for c in 0..6 {
            a[c] += factor * b[c];
        }
    }
}

/// a times a factor.
pub fn times(a: &Field, factor: f64) -> Field {
    let of = |a: &Increment| a.map(|a| factor * a);
    a.iter().map(|rod| rod.iter().map(of).collect()).collect()
}

/// The linear combination of fields with these coefficients.
pub fn combined(parts: &[f64], fields: &[Field]) -> Field {
    let mut sum = times(&fields[0], 0.0);
    for (part, field) in parts.iter().zip(fields) {
        add(&mut sum, *part, field);
    }
    sum
}

pub fn largest(a: &Field) -> f64 {
    crate::largest::largest(a.iter().flatten().flatten().map(|v| v.abs()))
}

/// The increments of the nodes from the `first` on that lead from one state to another on the same
/// grid.
pub fn between(a: &State, b: &State, first: usize) -> Field {
    let mut field = Field::new();
    a.increments_to(b, first, &mut field);
    field
}

pub fn is_finite(a: &Field) -> bool {
    a.iter().flatten().flatten().all(|v| v.is_finite())
}

/// Increments on the grid with all segments halved: cubic interpolation, zero at clamped bases, where
/// the `first` node of the field is the next.
pub fn prolong_field(a: &Field, first: usize) -> Field {
    a.iter().map(|rod| prolong_rod(rod, first)).collect()
}

/// Nodal forces on the grid with all segments halved: the given ones at the nodes of this grid,
/// zero at the new ones.
pub fn at_same_nodes(a: &Field, first: usize) -> Field {
    // A new node precedes every one but a base.
    let all = |rod: &Vec<Increment>| rod.iter().flat_map(|f| [[0.0; 6], *f]).collect::<Vec<_>>();
    let rod = |rod: &Vec<Increment>| all(rod).split_off(1 - first);
    a.iter().map(rod).collect()
}

/// Increments on the grid with every second node.
pub fn every_second(a: &Field, first: usize) -> Field {
    let rod = |rod: &Vec<Increment>| rod.iter().skip(first).step_by(2).copied().collect();
    a.iter().map(rod).collect()
}

fn prolong_rod(rod: &[Increment], first: usize) -> Vec<Increment> {
    let n = rod.len() + first - 1;
    let at = |i: usize| match i < first {
        true => [0.0; 6],
        false => rod[i - first],
    };
    let node = |k: usize| {
        if k.is_multiple_of(2) {
            return at(k / 2);
        }
        // Four neighbouring nodes; at the ends, the nearest four.
        let mut sum = [0.0; 6];
        for (i, weight) in Stencil::<4>::new(0, n + 1, k as f64 / 2.0).terms() {
            let value = at(i);
            for c in 0..6 {
                sum[c] += weight * value[c];
            }
        }
        sum
    };
    (first..=2 * n).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_prolonged_exactly() {
        let f = |s: f64| [s, s * s, s * s * s, 2.0 * s - s * s, 0.0, -s];
        for (n, first) in [(3, 1), (4, 1), (7, 1), (3, 0), (4, 0)] {
            let on = |n: usize| {
                vec![
                    (first..=n)
                        .map(|i| f(i as f64 / n as f64))
                        .collect::<Vec<_>>(),
                ]
            };
            let (coarse, fine) = (on(n), on(2 * n));
            let difference = plus(&prolong_field(&coarse, first), -1.0, &fine);
            assert!(largest(&difference) < 1e-14, "{n}");
            assert_eq!(every_second(&fine, first), coarse);
            assert_eq!(every_second(&at_same_nodes(&coarse, first), first), coarse);
        }
    }
}
