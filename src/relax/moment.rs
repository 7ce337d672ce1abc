//! A single rod under a dead moment at its tip.
//!
//! A moment fixed in space has no potential in three dimensions, so that
//! neither energy nor signs of pivots can guide a relaxation. The rod is loaded
//! quasi-statically instead: all loads grow together from zero, in steps of
//! about one radian of tip rotation, each followed by Newton's method with the
//! exact, unsymmetric tangent.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::relax::equilibrium::Work;
use crate::relax::semi_implicit::{Settled, at_rest};
use crate::rod::RESOLVED_TURN;

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
    accuracy: f64,
    near_rest: bool,
    work: &mut Work,
    progress: &mut dyn FnMut(usize, f64),
) -> Settled {
    if near_rest {
        return newton(leaf, state, system, accuracy, work, progress);
    }
    let softest = leaf
        .sections
        .iter()
        .map(|s| s.couple_stiffness.min_element())
        .fold(f64::INFINITY, f64::min);
    let turn = leaf.leaf.tip_moment.length() * leaf.leaf.length(0) / softest;
    let mut step = 1.0 / (turn / TURN_PER_STEP).ceil().max(1.0);
    let (mut reached, mut before) = (0.0, state.clone());
    while reached < 1.0 {
        leaf.load_factor = (reached + step).min(1.0);
        let wanted = if leaf.load_factor < 1.0 {
            STEP_ACCURACY
        } else {
            accuracy
        };
        match newton(leaf, state, system, wanted, work, progress) {
            Settled::Rest(remaining) => {
                if leaf.load_factor == 1.0 {
                    return Settled::Rest(remaining);
                }
                reached = leaf.load_factor;
                before.clone_from(state);
            }
            Settled::Unresolved => return Settled::Unresolved,
            failed if step < SMALLEST_STEP => return failed,
            _ => {
                step /= 2.0;
                state.clone_from(&before);
            }
        }
    }
    Settled::StepLimit
}

fn newton(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    accuracy: f64,
    work: &mut Work,
    progress: &mut dyn FnMut(usize, f64),
) -> Settled {
    let mut next = state.clone();
    let mut previous = f64::INFINITY;
    for step in 0..MAX_ITERATIONS {
        let turn = leaf.assemble(state, system).turn;
        work.force_evaluations += 1;
        if turn > RESOLVED_TURN {
            return Settled::Unresolved;
        }
        work.factorizations += 1;
        if !system.factorize_indefinite() {
            return Settled::Stuck;
        }
        // One rod has no coupling: this is a direct solution.
        system.solve(None, 0.0);
        let (turn, shift) = system.largest();
        let size = turn.max(shift);
        if !size.is_finite() {
            return Settled::Stuck;
        }
        leaf.advance(state, system, 1.0, &mut next);
        std::mem::swap(state, &mut next);
        work.steps += 1;
        progress(step, size);
        if let Some(rest) = at_rest(size, previous, 0.0, accuracy) {
            return rest;
        }
        previous = size;
    }
    Settled::Stuck
}
