//! States of leaves that vary: forces on them, how these change, and where increments
//! lead them.

use super::family::clamp;
use super::field::{plus, times};
use crate::leaf::{DiscreteLeaf, Field, State, System};

/// Part of the parameter's range over which forces are differenced: the error
/// is a ten-thousand-millionth, and what rounding makes of it no larger.
pub const DIFFERENCE: f64 = 1e-5;

/// The change of forces with a number of which `forces` are given at some distance
/// from where it is.
pub fn rate<E>(mut forces: impl FnMut(f64) -> Result<Field, E>) -> Result<Field, E> {
    let [after, before] = [DIFFERENCE, -DIFFERENCE].map(|step| {
        // At an end of the range there may be nothing beyond.
        let mut at = |step: f64| Ok((step, forces(step)?));
        at(step).or_else(|_: E| at(0.0))
    });
    let ((after, forces_after), (before, forces_before)) = (after?, before?);
    let rate = plus(&forces_after, -1.0, &forces_before);
    Ok(times(&rate, 1.0 / (after - before)))
}

/// The unbalanced forces of a leaf in a state, but for its clamps, which are its own.
pub fn forces_on(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> Field {
    let mut moved = state.clone();
    clamp(leaf, &mut moved);
    leaf.assemble_forces(&moved, system);
    system.rhs()
}

/// A state after `step` times these increments. What the leaf clamps goes there first:
/// the forces of the segments at a clamp feel all of its motion, however long the step.
pub fn advanced(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    increments: &Field,
    step: f64,
) -> State {
    let mut clamped = state.clone();
    clamp(leaf, &mut clamped);
    let mut next = clamped.clone();
    if clamped.x == state.x && clamped.q == state.q {
        // Rounding of what nearly rigid segments have for their lengths counts as little
        // as the step is long.
        system.set_solution(increments);
        leaf.advance(state, system, step, &mut next);
        return next;
    }
    let mut increments = times(increments, step);
    if let Some(held) = &leaf.leaf.held {
        let tips = increments.iter_mut().filter_map(|rod| rod.last_mut());
        for (j, tip) in tips.enumerate() {
            tip[3..].fill(0.0);
            if held.rotation(j).is_some() {
                tip[..3].fill(0.0);
            }
        }
    }
    system.set_solution(&increments);
    leaf.advance(&clamped, system, 1.0, &mut next);
    next
}
