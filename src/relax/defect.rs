//! The error of an extrapolated leaf from its defect.
//!
//! The equilibrium equations are integrated from neighbouring nodes of the coarsest grid,
//! where the extrapolated leaf is known best, to the middle between them, by a method of
//! order 8. Where its two values of position, rotation, force and moment do not agree the
//! equations are not met; to first order the error is the answer of the leaf to these
//! jumps. The linear equations are those of the second grid: their own error is one of
//! second order, of an error.

use crate::leaf::{Flow, Jump, RodFields, Solved, System, shift};
use crate::relax::fields::nodes;
use crate::relax::run::Level;
use crate::rotation;

/// Segments of the finest grid for which the integration makes a step.
const SEGMENTS_A_STEP: usize = 4;

/// Relative accuracy, in the energy norm, of the answer: of a stiff leaf most of that
/// norm is stretch, and displacements are a small part of it.
const ACCURACY: f64 = 1e-6;

/// The factorised equations of the second grid.
pub type Linear = System;

/// The largest error of a position at the nodes of the coarsest grid of the leaf on
/// `levels`, from coarse to fine, each with twice the segments of the one before, with
/// `columns` extrapolations. `None` where the linear equations cannot be solved.
pub fn error(levels: &[Level], columns: usize, linear: &mut Option<Linear>) -> Option<f64> {
    let [first, second, ..] = levels else {
        return None;
    };
    let system = match linear {
        Some(system) => system,
        None => linear.insert(factorized(second)?),
    };
    let jumps = jumps(levels, columns);
    second.leaf.assemble_jumps(&second.state, &jumps, system);
    let Solved::Yes(_) = system.solve(None, ACCURACY) else {
        return None;
    };
    let stride = second.leaf.segments() / first.leaf.segments();
    let error = |rod: &Vec<_>| {
        let known = rod.iter().skip(stride - 1).step_by(stride);
        known.map(|node| shift(node).length()).fold(0.0, f64::max)
    };
    let errors = system.solution().iter().map(error).collect::<Vec<_>>();
    // Not f64::max alone, which would hide a NaN.
    let error = errors.iter().copied().fold(0.0, f64::max);
    errors
        .iter()
        .all(|error| error.is_finite())
        .then_some(error)
}

fn factorized(level: &Level) -> Option<System> {
    let mut system = System::new(&level.leaf);
    level.leaf.assemble(&level.state, &mut system);
    let regular = match level.leaf.rods() {
        1 => system.factorize_indefinite(),
        _ => system.factorize(0.0),
    };
    regular.then_some(system)
}

/// The jumps in the middles between the nodes of the coarsest grid.
fn jumps(levels: &[Level], columns: usize) -> Vec<Vec<Jump>> {
    let (leaf, sigma) = (&levels[1].leaf, levels[1].leaf.grid.sigma());
    let known = nodes(levels, columns);
    let panels = levels[0].leaf.segments();
    let finest = levels[levels.len() - 1].leaf.segments();
    let steps = (finest / (2 * panels)).div_ceil(SEGMENTS_A_STEP);
    let mut flow = Flow::new(leaf);
    let mut jumps = vec![Vec::with_capacity(panels); leaf.rods()];
    for i in 0..panels {
        let mut from = |node: usize| {
            let begin = |j: usize| known[j][node];
            flow.carry(begin, [sigma[2 * node], sigma[2 * i + 1]], steps)
        };
        let (before, behind) = (from(i), from(i + 1));
        for ((jumps, a), b) in jumps.iter_mut().zip(before).zip(behind) {
            jumps.push(jump(&a, &b));
        }
    }
    jumps
}

fn jump(a: &RodFields, b: &RodFields) -> Jump {
    let turn = rotation::log(a.q * b.q.conjugate());
    [a.x - b.x, turn, a.n - b.n, a.m - b.m]
}
