//! Forces that follow a leaf and have no potential, in Newton's method: their derivative makes the
//! matrix unsymmetric.
//!
//! With the symmetric matrix K without them and the derivative W of them, (1 - K^-1 W) d = K^-1 r
//! is solved by GMRES ([`minimal_residual`]). K is
//! factorised once for every iteration of Newton's method; as K^-1 W is smooth, few directions are
//! enough.

use crate::krylov::{KrylovLimits, minimal_residual};
use crate::leaf::{Factors, Field, Increment, State, System};

/// Accuracy of the solution. No direction is left out: none is undetermined.
const LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-10,
    most: 100,
    singular: 0.0,
    stagnating: None,
};

/// Forces on the nodes of a leaf that are not the derivatives of an energy.
pub trait Following {
    /// Adds them to the right-hand side of an assembled system.
    fn add_forces(&self, state: &State, system: &mut System);

    /// Adds their derivative along increments of the nodes to forces.
    fn add_change(&self, state: &State, increments: &Field, forces: &mut Field);
}

/// Solves for the increments under these forces with the factors of K; `None` if too many
/// directions would be needed.
pub fn solve(
    factors: &mut Factors,
    forces: &Field,
    (following, state): (&dyn Following, &State),
) -> Option<Field> {
    let mut solved = |forces: &Field| factors.solve_bordered(forces, &[]).increments;
    let start = solved(forces);
    let (nodes, first) = (start[0].len(), flattened(&start));
    let zero: Field = vec![vec![[0.0; 6]; nodes]; start.len()];
    let product = &mut |direction: &[f64]| {
        let mut change = zero.clone();
        following.add_change(state, &unflattened(direction, nodes), &mut change);
        let image = flattened(&solved(&change));
        Some(direction.iter().zip(image).map(|(v, w)| v - w).collect())
    };
    let found = minimal_residual(&first, LIMITS, product)?;
    let solved = found.residual <= LIMITS.accuracy;
    solved.then(|| found.sum().map_or(zero, |sum| unflattened(&sum, nodes)))
}

/// The increments of all nodes, one number after the other.
fn flattened(field: &Field) -> Vec<f64> {
    field.iter().flatten().flatten().copied().collect()
}

/// The increments again, of rods of so many nodes.
fn unflattened(numbers: &[f64], nodes: usize) -> Field {
    let increments: Vec<Increment> = (numbers.chunks_exact(6))
        .map(|six| std::array::from_fn(|c| six[c]))
        .collect();
    increments
        .chunks(nodes)
        .map(<[Increment]>::to_vec)
        .collect()
}
