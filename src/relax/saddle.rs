//! Saddles: counting their negative eigenvalues, finding them, leaving them.

use crate::leaf::{DiscreteLeaf, Solved, SparsePattern, State, System};
use crate::relax::equilibrium::Work;
use crate::relax::semi_implicit::{Settled, at_rest};
use crate::rod::RESOLVED_TURN;

/// Size of the push off a saddle: largest rotation (radians) or displacement
/// (lengths) along the unstable mode.
const PUSH: f64 = 0.03;

/// Steps of inverse iteration; the mode need not be accurate, only unstable.
const MODE_ITERATIONS: usize = 6;

/// Newton iterations towards a saddle.
pub const MAX_ITERATIONS: usize = 200;

/// Largest rotation or displacement in one of them.
const MAX_STEP: f64 = 0.5;

/// Morse index of a state at rest: the number of negative eigenvalues of the
/// Hessian of its energy (the symmetric part of it, under a dead moment).
/// Eigenvalues (over the masses) between -`shift` and zero do not count. `None` if the factorisation does not fit into memory.
pub fn index(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    shift: f64,
    work: &mut Work,
) -> Option<usize> {
    leaf.assemble(state, system);
    work.force_evaluations += 1;
    // One linear-time factorisation proves most leaves stable.
    work.factorizations += 1;
    if system.stable_without_coupling(shift) {
        return Some(0);
    }
    leaf.assemble(state, system);
    work.force_evaluations += 1;
    work.factorizations += 1;
    let pattern = SparsePattern::new(system).ok()?;
    Some(pattern.factorize(system, shift).ok()?.negative())
}

/// Newton's method whatever the signs of the pivots, with steps of bounded
/// size: it goes to the next equilibrium, stable or not, as the solver of a
/// boundary-value problem would.
pub fn newton(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    accuracy: f64,
    iterations: usize,
    work: &mut Work,
    progress: &mut dyn FnMut(usize, f64),
) -> Settled {
    let mut next = state.clone();
    let mut pattern = None;
    let mut previous = f64::INFINITY;
    for step in 0..iterations {
        let turn = leaf.assemble(state, system).turn;
        work.force_evaluations += 1;
        if turn > RESOLVED_TURN {
            return Settled::Unresolved;
        }
        if pattern.is_none() {
            pattern = SparsePattern::new(system).ok();
        }
        let Some(Ok(mut factor)) = pattern
            .as_ref()
            .map(|p| p.factorize(system, leaf.neutral_shift()))
        else {
            return Settled::Stuck;
        };
        factor.solve(system, None);
        work.factorizations += 1;
        let (turn, shift) = system.largest();
        let size = turn.max(shift);
        if !size.is_finite() {
            return Settled::Stuck;
        }
        leaf.advance(state, system, (MAX_STEP / size).min(1.0), &mut next);
        std::mem::swap(state, &mut next);
        work.steps += 1;
        progress(step, size);
        if size < NEUTRAL_STEP && leaf.residual(state) < BALANCED {
            return Settled::Rest(size.min(accuracy));
        }
        if size < MAX_STEP
            && let Some(rest) = at_rest(size, previous, 0.0, accuracy)
        {
            return rest;
        }
        previous = size;
    }
    Settled::StepLimit
}

/// Newton iterations that make a saddle exact.
const POLISH_ITERATIONS: usize = 20;

/// Steps below this (radians, lengths) may be nothing but rounding that drives
/// a neutral mode, if no force or moment above the second number (A/L^2, A/L)
/// is unbalanced.
const NEUTRAL_STEP: f64 = 1e-5;
const BALANCED: f64 = 1e-9;

/// Accuracy of a polished state: rounding.
const POLISH_ACCURACY: f64 = 1e-13;

/// How far a saddle may be from where it was noticed, in lengths.
const POLISH_DISTANCE: f64 = 0.1;

/// Makes a state near a saddle exact and counts its Morse index, a neutral mode not counting as negative. `None`, with the state unchanged, if Newton's method leads elsewhere.
pub fn polish(
    leaf: &DiscreteLeaf,
    state: &mut State,
    system: &mut System,
    work: &mut Work,
) -> Option<Option<usize>> {
    let mut exact = state.clone();
    let settled = newton(
        leaf,
        &mut exact,
        system,
        POLISH_ACCURACY,
        POLISH_ITERATIONS,
        work,
        &mut |_, _| {},
    );
    let moved = state.shift_to(&exact);
    match settled {
        Settled::Rest(_) if moved < POLISH_DISTANCE => {
            *state = exact;
            let index = index(leaf, state, system, leaf.neutral_shift(), work);
            Some(index)
        }
        _ => None,
    }
}

/// Pushes a state at a saddle along its most unstable mode, by inverse
/// iteration with the smallest shift that makes the matrix positive definite.
pub fn push_off(leaf: &DiscreteLeaf, state: &mut State, system: &mut System, work: &mut Work) {
    leaf.assemble(state, system);
    work.force_evaluations += 1;
    system.seed_mode();
    let mut shift = 1e-4;
    loop {
        work.factorizations += 1;
        if system.factorize(shift) && matches!(system.solve(None, 1e-3), Solved::Yes(_)) {
            break;
        }
        shift *= 2.0;
        if !shift.is_finite() {
            return;
        }
    }
    for _ in 0..MODE_ITERATIONS {
        system.iterate_mode();
        if !matches!(system.solve(None, 1e-3), Solved::Yes(_)) {
            break;
        }
    }
    let (turn, displacement) = system.largest();
    let mut pushed = state.clone();
    leaf.advance(state, system, PUSH / turn.max(displacement), &mut pushed);
    *state = pushed;
}
