//! What counts as the same equilibrium: on two grids, after a prediction, on the two sides of a saddle.
//!
//! Distances are largest displacements in lengths of the leaf, energies in units of A/L. Equilibria of
//! one leaf are typically some tenths of a length apart, errors of coarse grids some hundredths. A
//! limit twice as large takes more neighbouring equilibria for one; half of it asks for finer grids
//! where these still differ.

use crate::leaf::{Leaf, State, half_state, whole_state};
use crate::relax::accuracy::richardson::distance;
use crate::relax::accuracy::transfer::{GridLevel, positions};

/// Whether two grids, whose segments are in a ratio of small numbers, led to the same equilibrium: no
/// nodes that both have are far apart.
pub fn is_same_on_two_grids(one: &GridLevel, other: &GridLevel) -> bool {
    let [a, b] = [one, other].map(|level| level.leaf.segments());
    let shared = greatest_common_divisor(a, b);
    distance(&positions(one, a / shared), &positions(other, b / shared)) < 0.05
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    match b {
        0 => a,
        _ => greatest_common_divisor(b, a % b),
    }
}

/// Whether an equilibrium that Newton's method found is that of its initial guess, which is the same
/// equilibrium known on another grid, or from elsewhere.
pub fn is_near_guess(guess: &State, found: &State) -> bool {
    guess.largest_displacement_to(found) < NEAR_GUESS
}

const NEAR_GUESS: f64 = 0.02;

/// Whether two equilibria that are known to be so far apart, with this sum of their errors, are one.
pub fn is_given_within_errors(distance: f64, error: f64) -> bool {
    distance <= NEAR_GUESS.min(10.0 * error)
}

/// Whether an equilibrium is the continuation of the one `before`: near the `predicted` one, as a part
/// of the way there.
pub fn is_near_prediction(before: &State, predicted: &State, found: &State) -> bool {
    let way = before.largest_displacement_to(predicted);
    found.largest_displacement_to(predicted) <= 0.5 * way + 0.02
}

/// Whether states on one grid are the same equilibrium, of a leaf beside a fold, which lies elsewhere on
/// each grid: that moves the equilibrium far.
pub fn is_same_beside_fold(one: &State, other: &State) -> bool {
    one.largest_displacement_to(other) < 0.1
}

/// Whether a saddle is the one that was noticed, before Newton's method had converged.
pub fn is_noticed_saddle(noticed: &State, saddle: &State) -> bool {
    noticed.largest_displacement_to(saddle) < 0.1
}

/// Whether two states in which the forces on a leaf in wind are balanced are one, to rounding: by
/// displacements and rotations (radians).
pub fn is_same_balance(one: &State, other: &State) -> bool {
    one.distance(other) < 1e-8
}

/// Whether two equilibria on one grid have the same energy: they are members of a circle of equilibria,
/// as of a buckled round column, or mirror images.
pub fn is_same_energy(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-5 * one.abs().max(1.0)
}

/// Whether the energies of the two sides of a saddle are equal, as those of mirror images are; either
/// was reached on a coarse grid by an iteration that ended early.
pub fn are_equally_low(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-3 * one.abs().max(other.abs()).max(1.0)
}

/// Whether the states to which a leaf turned from a saddle are two: by displacements (lengths) and
/// rotations (radians).
pub fn are_different_sides(one: &State, other: &State) -> bool {
    one.distance(other) > 0.05
}

/// Whether a state of a leaf with this `half` is its own mirror image, up to rounding and unfinished
/// iterations.
pub fn is_own_mirror_image(half: &Leaf, state: &State) -> bool {
    whole_state(half, &half_state(half, state)).largest_displacement_to(state) < 1e-3
}
