//! States of leaves that vary: the forces on them, the derivatives of these, and the states
//! to which increments lead.

use crate::branch::problem::family::clamp;
use crate::branch::problem::field::{plus, times};
use crate::leaf::{DiscreteLeaf, Field, State, System};
use glam::DVec3;

/// Step of central differences of forces, as a part of the parameter's range: truncation
/// error and rounding error are both about 1e-10.
const DIFFERENCE: f64 = 1e-5;

/// A value after and before the present one of a parameter, for a central difference; `value`
/// takes the distance from it. At an end of the range, where there may be no leaf beyond, the
/// present one takes the place of that.
pub fn both_sides<T, E>(mut value: impl FnMut(f64) -> Result<T, E>) -> Result<[T; 2], E> {
    let sides = [DIFFERENCE, -DIFFERENCE];
    let [after, before] = sides.map(|step| value(step).or_else(|_| value(0.0)));
    Ok([after?, before?])
}

/// Derivative of the forces with respect to a parameter, by central differences; `forces` takes
/// the distance from the present value of the parameter.
pub fn rate<E>(mut forces: impl FnMut(f64) -> Result<Field, E>) -> Result<Field, E> {
    let at = |step: f64| Ok((step, forces(step)?));
    let [(after, forces_after), (before, forces_before)] = both_sides(at)?;
    let rate = plus(&forces_after, -1.0, &forces_before);
    Ok(times(&rate, 1.0 / (after - before)))
}

/// The largest stiffness in stretch and shear with which segment forces are condensed out.
pub fn stiffest_condensed(leaf: &DiscreteLeaf) -> f64 {
    let stiffnesses = leaf.sections.iter().map(|it| it.condensing.max_element());
    stiffnesses.fold(0.0, f64::max)
}

/// Rounding error of an eigenvalue of the matrix of a leaf of this largest stiffness.
pub fn eigenvalue_rounding(stiffest: f64, segments: usize) -> f64 {
    f64::EPSILON * stiffest * (segments as f64).powi(2)
}

/// The unbalanced forces on a leaf in a state whose clamped nodes are put where it clamps them.
pub fn forces_on(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> Field {
    let mut moved = state.clone();
    clamp(leaf, &mut moved);
    leaf.assemble_forces(&moved, system);
    system.rhs()
}

/// A state after `step` times these increments. Clamped nodes are moved first: the forces of the
/// segments at a clamp depend on all of its displacement, however short the step. The segments
/// change by `law_forces` in addition (none if empty).
pub fn advanced(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    (increments, law_forces): (&Field, &[DVec3]),
    step: f64,
) -> State {
    let mut clamped = state.clone();
    clamp(leaf, &mut clamped);
    let mut next = clamped.clone();
    if clamped.x == state.x && clamped.q == state.q {
        // The rounding error in the lengths of nearly rigid segments is scaled down
        // with the step.
        system.set_completed(increments, law_forces);
        leaf.advance(state, system, step, &mut next);
        return next;
    }
    let mut increments = times(increments, step);
    let law_forces: Vec<DVec3> = law_forces.iter().map(|force| step * *force).collect();
    for (j, i) in leaf.each(leaf.moving_nodes()) {
        let [turns, shifts] = leaf.moves(j, i);
        let increment = &mut increments[j][i - leaf.first_node()];
        if !shifts {
            increment[3..].fill(0.0);
        }
        if !turns {
            increment[..3].fill(0.0);
        }
    }
    system.set_completed(&increments, &law_forces);
    leaf.advance(&clamped, system, 1.0, &mut next);
    next
}
