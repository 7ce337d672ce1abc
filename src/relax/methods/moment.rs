//! A single rod under a dead moment at its tip.
//!
//! A moment fixed in space has no potential in three dimensions, so that
//! neither energy nor signs of pivots can guide a relaxation. The rod is loaded
//! quasi-statically instead: all loads grow together from zero, in steps of
//! about one radian of tip rotation, each followed by Newton's method with the
//! exact, unsymmetric tangent.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{Equations, Newton, Stop};

/// Rotation of the tip (radians) that one load step may bring about by bending.
const TURN_PER_STEP: f64 = 1.0;

/// Newton iterations of a load step before it is halved.
const MAX_ITERATIONS: usize = 15;

/// Accuracy of all load steps but the last.
const STEP_ACCURACY: f64 = 1e-3;

/// Smallest load step, as a part of the load.
const SMALLEST_STEP: f64 = 1e-6;

/// Loads the rod from its rest shape, or corrects a state `near_rest`.
pub fn settle(
    leaf: &mut DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    near_rest: bool,
    how: Newton,
) -> Result<f64, Stop> {
    let mut newton = |leaf: &DiscreteLeaf, state: &mut State, accuracy| {
        let newton = Newton {
            accuracy,
            iterations: MAX_ITERATIONS,
            work: how.work,
            progress: how.progress,
        };
        newton.solve(leaf, state, system, Equations::Unsymmetric)
    };
    if near_rest {
        return newton(leaf, state, how.accuracy);
    }
    let stiffness = (leaf.sections.iter()).map(|s| s.couple_stiffness.min_element());
    let softest = stiffness.fold(f64::INFINITY, f64::min);
    let turn = leaf.leaf.loads.tip_moment.length() * leaf.leaf.length(0) / softest;
    let mut step = 1.0 / (turn / TURN_PER_STEP).ceil().max(1.0);
    let (mut reached, mut before) = (0.0, state.clone());
    while reached < 1.0 {
        leaf.load_factor = (reached + step).min(1.0);
        let wanted = match leaf.load_factor < 1.0 {
            true => STEP_ACCURACY,
            false => how.accuracy,
        };
        match newton(leaf, state, wanted) {
            Ok(remaining) if leaf.load_factor == 1.0 => return Ok(remaining),
            Ok(_) => {
                reached = leaf.load_factor;
                before.clone_from(state);
            }
            Err(stop) if stop == Stop::Unresolved || step < SMALLEST_STEP => return Err(stop),
            Err(_) => {
                step /= 2.0;
                state.clone_from(&before);
            }
        }
    }
    Err(Stop::StepLimit)
}
