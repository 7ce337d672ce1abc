//! The error of an extrapolated leaf from its defect.
//!
//! The equilibrium equations are integrated from the nodes of the coarsest grid, where the
//! extrapolated leaf is known best, to the middles between them, by a method of order 8.
//! Where the two values of position, rotation, force or moment do not agree the equations
//! are not met; to first order the error is the answer of the leaf to these jumps. The
//! linear equations are those of a coarse grid: their own error is one of second order, of
//! an error.

use crate::leaf::{DiscreteLeaf, Flow, Jump, RodFields, Solved, System, shift};
use crate::relax::fields::nodes;
use crate::relax::level::Level;
use crate::rotation;
use glam::DVec3;

/// The linear equations are those of so many grids before the finest, but not of the
/// coarsest.
const COARSER: usize = 2;

/// Segments of the finest grid for which the integration makes a step, and the most
/// steps from a node to the middle.
const SEGMENTS_A_STEP: usize = 2;
const MOST_STEPS: usize = 16;

/// Relative accuracy, in the energy norm, of the answer: of a stiff leaf most of that
/// norm is stretch, and displacements are a small part of it.
const ACCURACY: f64 = 1e-6;

/// The factorised equations of one of the grids.
pub struct Linear {
    grid: usize,
    system: System,
}

/// The largest error of a position at the nodes of the coarsest grid of the leaf on
/// `levels`, from coarse to fine, each with twice the segments of the one before, with
/// `columns` extrapolations. `None` where the linear equations cannot be solved.
pub fn error(levels: &[Level], columns: usize, linear: &mut Option<Linear>) -> Option<f64> {
    let grid = (levels.len().checked_sub(2)? + 1)
        .saturating_sub(COARSER)
        .max(1);
    if linear.as_ref().is_none_or(|linear| linear.grid != grid) {
        let system = factorized(&levels[grid])?;
        *linear = Some(Linear { grid, system });
    }
    let (Level { leaf, state }, system) = (&levels[grid], &mut linear.as_mut()?.system);
    leaf.assemble_jumps(state, &jumps(levels, columns), system);
    let Solved::Yes(_) = system.solve(None, ACCURACY) else {
        return None;
    };
    let stride = leaf.segments() / levels[0].leaf.segments();
    let solution = system.solution();
    let known = solution
        .iter()
        .flat_map(|rod| rod.iter().skip(stride - 1).step_by(stride));
    // Not f64::max, which would hide a NaN.
    known
        .map(|node| shift(node).length())
        .try_fold(0.0, |largest: f64, error| {
            error.is_finite().then_some(largest.max(error))
        })
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
    let (first, finest) = (&levels[0].leaf, &levels[levels.len() - 1].leaf);
    let (mut known, grid) = (nodes(levels, columns), &first.grid);
    let tips = known.iter_mut().filter_map(|rod| rod.last_mut()).collect();
    balance(first, tips);
    let half = finest.segments() / first.segments() / 2;
    let steps = (half / SEGMENTS_A_STEP).clamp(1, MOST_STEPS);
    let mut flow = Flow::new(first);
    let mut jumps = vec![Vec::with_capacity(first.segments()); first.rods()];
    for i in 0..first.segments() {
        let mut to_middle =
            |k: usize| flow.carry(|j| known[j][k], [grid.sigma()[k], grid.middle(i)], steps);
        let (before, behind) = (to_middle(i), to_middle(i + 1));
        for ((jumps, before), behind) in jumps.iter_mut().zip(&before).zip(&behind) {
            jumps.push(jump(before, behind));
        }
    }
    jumps
}

/// Makes forces and moments at the tips meet their conditions, which unfinished
/// iterations leave open: the equations of the discrete leaf have no other.
fn balance(leaf: &DiscreteLeaf, mut tips: Vec<&mut RodFields>) {
    let held = leaf.leaf.held.as_ref();
    let clamped = held.is_some_and(|held| held.clamps.is_some());
    let share = 1.0 / tips.len() as f64;
    let mut missing: DVec3 = (tips.iter().enumerate())
        .map(|(j, tip)| share * (leaf.tip_force(j) - tip.n))
        .sum();
    if leaf.leaf.in_half() {
        // The image balances what is across the plane.
        missing.y = 0.0;
    }
    for (j, tip) in tips.iter_mut().enumerate() {
        match held {
            Some(_) => {}
            None if leaf.leaf.joined() => tip.n += missing,
            None => tip.n = leaf.tip_force(j),
        }
        if !clamped {
            tip.m = leaf.tip_moment();
        }
    }
}

fn jump(a: &RodFields, b: &RodFields) -> Jump {
    let turn = rotation::log(a.q * b.q.conjugate());
    [a.x - b.x, turn, a.n - b.n, a.m - b.m]
}
