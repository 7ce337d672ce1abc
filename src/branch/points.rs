//! Points of branches and directions along them, with the algebra of their fields: increments of
//! the nodes, or forces on them, by rod, node and component (three of rotation, three of
//! displacement).
//!
//! Fields are carried over to the grid with all segments halved, or with every second node.

use crate::leaf::{Increment, NodalField, State};
use crate::relax::Stencil;

/// A point of a branch on one grid.
#[derive(Clone, Debug)]
pub struct EquilibriumPoint {
    /// The state of the leaf.
    pub state: State,
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// The unit tangent of the branch.
    pub tangent: BranchDirection,
    /// Morse index.
    pub index: usize,
    /// Newton iterations by which it was found.
    pub iterations: usize,
}

impl EquilibriumPoint {
    /// State and parameter, without direction and index.
    pub(super) fn solution(&self) -> ParametrizedState {
        ParametrizedState {
            state: self.state.clone(),
            params: [self.fraction],
        }
    }
}

/// A leaf in equilibrium, or nearly so, with its parameters as fractions of their ranges.
#[derive(Clone, Debug)]
pub struct ParametrizedState<const N: usize = 1> {
    /// The state of the leaf.
    pub state: State,
    /// The parameters, as fractions of their ranges.
    pub params: [f64; N],
}

/// A direction along which the state and the parameters change.
#[derive(Clone, Debug)]
pub struct BranchDirection<const N: usize = 1> {
    /// Increments of the nodes.
    pub increments: NodalField,
    /// Changes of the parameters, as fractions of their ranges.
    pub params: [f64; N],
}

impl<const N: usize> BranchDirection<N> {
    /// The direction with all changes of the opposite sign.
    pub fn reversed(&self) -> Self {
        BranchDirection {
            increments: scale_field(&self.increments, -1.0),
            params: self.params.map(|part| -part),
        }
    }

    /// The parameters after a step of this length from `params` along the direction.
    pub(super) fn parameters_after_step(&self, params: [f64; N], step: f64) -> [f64; N] {
        std::array::from_fn(|i| params[i] + step * self.params[i])
    }
}

/// a + factor b.
pub fn scaled_sum(a: &NodalField, factor: f64, b: &NodalField) -> NodalField {
    let mut sum = a.clone();
    add_scaled(&mut sum, factor, b);
    sum
}

/// a <- a + factor b.
pub fn add_scaled(a: &mut NodalField, factor: f64, b: &NodalField) {
    for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        for c in 0..6 {
            a[c] += factor * b[c];
        }
    }
}

/// a times a factor.
pub fn scale_field(a: &NodalField, factor: f64) -> NodalField {
    let of = |a: &Increment| a.map(|a| factor * a);
    a.iter().map(|rod| rod.iter().map(of).collect()).collect()
}

/// The linear combination of fields with these coefficients.
pub fn combine_fields(parts: &[f64], fields: &[NodalField]) -> NodalField {
    let mut sum = scale_field(&fields[0], 0.0);
    for (part, field) in parts.iter().zip(fields) {
        add_scaled(&mut sum, *part, field);
    }
    sum
}

/// The largest component of any node (radians, lengths).
pub fn largest(a: &NodalField) -> f64 {
    crate::numbers::largest(a.iter().flatten().flatten().map(|v| v.abs()))
}

/// The increments of the nodes from the `first` on that lead from one state to another on the same
/// grid.
pub fn increments_between(a: &State, b: &State, first: usize) -> NodalField {
    let mut field = NodalField::new();
    a.increments_to(b, first, &mut field);
    field
}

/// Whether no component is infinite or not a number.
pub fn is_finite(a: &NodalField) -> bool {
    a.iter().flatten().flatten().all(|v| v.is_finite())
}

/// Increments on the grid with all segments halved: cubic interpolation, zero at clamped bases, where
/// the `first` node of the field is the next.
pub fn prolong_field(a: &NodalField, first: usize) -> NodalField {
    a.iter().map(|rod| prolong_rod(rod, first)).collect()
}

/// Nodal forces on the grid with all segments halved: the given ones at the nodes of this grid,
/// zero at the new ones.
pub fn inject_forces(a: &NodalField, first: usize) -> NodalField {
    // A new node precedes every one but a base.
    let all = |rod: &Vec<Increment>| rod.iter().flat_map(|f| [[0.0; 6], *f]).collect::<Vec<_>>();
    let rod = |rod: &Vec<Increment>| all(rod).split_off(1 - first);
    a.iter().map(rod).collect()
}

/// Increments on the grid with every second node.
pub fn restrict_field(a: &NodalField, first: usize) -> NodalField {
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
        // Four neighboring nodes; at the ends, the nearest four.
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
            let difference = scaled_sum(&prolong_field(&coarse, first), -1.0, &fine);
            assert!(largest(&difference) < 1e-14, "{n}");
            assert_eq!(restrict_field(&fine, first), coarse);
            assert_eq!(
                restrict_field(&inject_forces(&coarse, first), first),
                coarse
            );
        }
    }
}
