//! Forces that follow a leaf and have no potential, in Newton's method: their derivative makes the
//! matrix unsymmetric.
//!
//! With the symmetric matrix K without them and the derivative W of them, (1 - K^-1 W) d = K^-1 r
//! is solved by GMRES (Y. Saad and M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986). K is
//! factorised once for every iteration of Newton's method; as K^-1 W is smooth, few directions are
//! enough.

use crate::leaf::{DirectSolver, Field, State, System};
use crate::newton::Stop;

/// Relative accuracy of the solution, and the largest number of directions.
const ACCURACY: f64 = 1e-10;
const DIRECTIONS: usize = 100;

/// Forces on the nodes of a leaf that are not the derivatives of an energy.
pub trait Following {
    /// Adds them to the right-hand side of an assembled system.
    fn add_forces(&self, state: &State, system: &mut System);

    /// Adds their derivative along increments of the nodes to forces.
    fn add_change(&self, state: &State, increments: &Field, forces: &mut Field);
}

/// Solves for the increments under the assembled right-hand side; they are stored in `system`.
pub fn solve(
    system: &mut System,
    pattern: &DirectSolver,
    shift: f64,
    (following, state): (&dyn Following, &State),
) -> Result<(), Stop> {
    let mut factors = pattern.factorize(system, shift)?;
    let rhs = system.rhs();
    let zero: Field = rhs.iter().map(|rod| vec![[0.0; 6]; rod.len()]).collect();
    let mut solved = |forces: &Field| factors.solve_bordered(forces, &[]).increments;
    let start = solved(&rhs);
    let length = norm(&start);
    let mut solution = zero.clone();
    if length == 0.0 {
        system.set_solution(&solution);
        return Ok(());
    }
    // Orthonormal directions, and the triangular factor of what the matrix makes of them.
    let mut directions = vec![scaled(&start, 1.0 / length)];
    let (mut triangle, mut turns): (Vec<Vec<f64>>, Vec<[f64; 2]>) = (Vec::new(), Vec::new());
    let mut remaining = vec![length];
    while remaining[turns.len()].abs() > ACCURACY * length {
        let k = turns.len();
        if k == DIRECTIONS || !remaining[k].is_finite() {
            return Err(Stop::Stuck);
        }
        let mut change = zero.clone();
        following.add_change(state, &directions[k], &mut change);
        let mut next = directions[k].clone();
        add(&mut next, -1.0, &solved(&change));
        let mut column = Vec::with_capacity(k + 2);
        for direction in &directions {
            let part = product(direction, &next);
            add(&mut next, -part, direction);
            column.push(part);
        }
        let left = norm(&next);
        for (i, [cos, sin]) in turns.iter().enumerate() {
            let [a, b] = [column[i], column[i + 1]];
            (column[i], column[i + 1]) = (cos * a + sin * b, cos * b - sin * a);
        }
        let hypotenuse = column[k].hypot(left);
        let [cos, sin] = [column[k] / hypotenuse, left / hypotenuse];
        column[k] = hypotenuse;
        remaining.push(-sin * remaining[k]);
        remaining[k] *= cos;
        turns.push([cos, sin]);
        triangle.push(column);
        directions.push(scaled(&next, 1.0 / left.max(f64::MIN_POSITIVE)));
    }
    for k in (0..turns.len()).rev() {
        let part = remaining[k] / triangle[k][k];
        for i in 0..k {
            remaining[i] -= part * triangle[k][i];
        }
        add(&mut solution, part, &directions[k]);
    }
    system.set_solution(&solution);
    Ok(())
}

fn product(a: &Field, b: &Field) -> f64 {
    let pairs = a
        .iter()
        .flatten()
        .flatten()
        .zip(b.iter().flatten().flatten());
    pairs.map(|(a, b)| a * b).sum()
}

fn norm(a: &Field) -> f64 {
    product(a, a).sqrt()
}

fn add(sum: &mut Field, factor: f64, other: &Field) {
    let pairs = sum.iter_mut().flatten().flatten();
    for (sum, other) in pairs.zip(other.iter().flatten().flatten()) {
        *sum += factor * other;
    }
}

fn scaled(field: &Field, factor: f64) -> Field {
    let mut all = field.clone();
    all.iter_mut()
        .flatten()
        .flatten()
        .for_each(|x| *x *= factor);
    all
}
