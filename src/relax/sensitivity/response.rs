//! How a settled leaf answers forces, and changes of itself.

use crate::leaf::{
    DiscreteLeaf, Field, Forces, LeafRate, Response, Solved, SparseFactor, SparsePattern, State,
    System,
};
use crate::relax::run::Level;
use crate::rotation;
use glam::DVec3;

/// Relative accuracy of the conjugate gradients, as a part of the tolerance, and the
/// best there is.
const SOLUTION: f64 = 3e-3;
const BEST_SOLUTION: f64 = 1e-11;

/// Corrections where the forces of a stiff rod are condensed out with less than its
/// stiffness; each gains many digits.
const CORRECTIONS: usize = 3;
const CORRECTED: f64 = 1e-10;

/// The answers of a settled leaf (all rods, in space) to forces. `None` where its
/// matrix is singular.
pub(crate) fn responses(level: &Level, loads: &[Forces], tolerance: f64) -> Option<Vec<Response>> {
    let (leaf, state) = (&level.leaf, &level.state);
    let accuracy = (SOLUTION * tolerance).clamp(BEST_SOLUTION, 1e-4);
    let mut system = System::new(leaf);
    leaf.assemble(state, &mut system);
    let factorized = match leaf.tip_moment() == DVec3::ZERO {
        true => system.factorize(0.0),
        false => system.factorize_indefinite(),
    };
    if factorized {
        let rods = |system: &mut System, rhs: &Field| {
            system.set_rhs(rhs);
            match system.solve(None, accuracy) {
                Solved::Yes(_) => Some(system.solution()),
                _ => None,
            }
        };
        let found: Option<Vec<_>> = (loads.iter())
            .map(|load| answer(leaf, state, load, &mut |rhs| rods(&mut system, rhs)))
            .collect();
        if found.is_some() {
            return found;
        }
        leaf.assemble(state, &mut system);
    }
    let pattern = SparsePattern::new(&system).ok()?;
    let mut factor: SparseFactor = pattern.factorize(&system, 0.0).ok()?;
    let mut direct = |rhs: &Field| Some(factor.solve_bordered(rhs, &[]).increments);
    (loads.iter())
        .map(|load| answer(leaf, state, load, &mut direct))
        .collect()
}

fn answer(
    leaf: &DiscreteLeaf,
    state: &State,
    load: &Forces,
    solve: &mut dyn FnMut(&Field) -> Option<Field>,
) -> Option<Response> {
    let mut gaps = load.gaps.clone();
    let mut rhs = load.nodes.clone();
    let mut response = Response {
        nodes: vec![vec![[0.0; 6]; leaf.segments()]; leaf.rods()],
        carried: vec![DVec3::ZERO; gaps.len()],
    };
    let mut first = f64::INFINITY;
    for correction in 0..CORRECTIONS {
        leaf.condense_gaps(state, &gaps, &mut rhs);
        let increments = solve(&rhs)?;
        leaf.carried(state, &increments, &mut gaps, &mut response.carried);
        let mut largest = 0.0_f64;
        let sums = response.nodes.iter_mut().flatten().flatten();
        for (sum, increment) in sums.zip(increments.iter().flatten().flatten()) {
            largest = largest.max(increment.abs());
            *sum += increment;
        }
        if correction == 0 {
            first = largest;
        }
        let settled = gaps.iter().all(|gap| *gap == DVec3::ZERO);
        if !largest.is_finite() || settled || largest < CORRECTED * first {
            break;
        }
        rhs.iter_mut().flatten().for_each(|force| *force = [0.0; 6]);
    }
    // A tip that is held goes where its holder goes.
    for (rod, tip) in response.nodes.iter_mut().zip(&load.tips) {
        let last = rod.last_mut().into_iter().flatten();
        last.zip(tip).for_each(|(sum, value)| *sum += value);
    }
    let mut numbers = response.nodes.iter().flatten().flatten();
    let finite = numbers.all(|value| value.is_finite());
    finite.then_some(response)
}

/// The state, moved along a response.
pub(crate) fn moved(level: &Level, rate: &LeafRate, response: &Response, step: f64) -> State {
    let (leaf, mut state) = (&level.leaf, level.state.clone());
    for (j, rod) in response.nodes.iter().enumerate() {
        let base = state.base(j);
        let turned = rotation::exp(step * rate.base_turn(j) * DVec3::Z);
        state.q[base] = (turned * state.q[base]).normalize();
        for (i, increment) in rod.iter().enumerate() {
            state.advance(base + i + 1, increment, step);
        }
    }
    let forces = state.n.iter_mut().zip(&response.carried);
    forces.for_each(|(force, change)| *force += step * change);
    debug_assert_eq!(state.segments(), leaf.segments());
    state
}
