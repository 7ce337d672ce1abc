//! The error of an extrapolated leaf from its defect.
//!
//! The equilibrium equations are integrated from the nodes of the coarsest grid, where the
//! extrapolated leaf is known best, to the middles between them, by a method of order 8.
//! Where the two values of position, rotation, force or moment do not agree the equations
//! are not met; to first order the error is the answer of the leaf to these jumps. The
//! linear equations are those of a coarse grid: their own error is one of second order, of
//! an error.

use crate::leaf::{DiscreteLeaf, Flow, Jump, RodFields, Solved, System, shift};
use crate::newton::Work;
use crate::relax::level::Level;
use crate::relax::nodes::nodes;
use crate::rotation;
use glam::DVec3;

/// The linear equations are those of so many grids before the finest, but not of the
/// coarsest.
const COARSER: usize = 2;

/// Relative accuracy, in the energy norm, of the answer: of a stiff leaf most of that
/// norm is stretch, and displacements are a small part of it.
const ACCURACY: f64 = 1e-6;

/// The factorised equations of one of the grids.
pub struct Linear {
    grid: usize,
    system: System,
}

/// What the equilibrium equations tell of a leaf on several grids.
pub struct Told {
    /// The largest error of a position at the nodes of the coarsest grid.
    pub error: f64,
    /// The largest in the middles between them, on either side.
    pub between: f64,
    /// The leaf at the nodes of the finest grid, rod after rod, dimensionless.
    pub rods: Vec<Vec<RodFields>>,
}

/// What they tell of the leaf on `levels`, from coarse to fine, each with twice the
/// segments of the one before, with `columns` extrapolations. `None` where the linear
/// equations cannot be solved, which are factorised if they are not those at hand.
pub fn told(
    levels: &[Level],
    columns: usize,
    linear: &mut Option<Linear>,
    work: &mut Work,
) -> Option<Told> {
    let grid = levels
        .len()
        .checked_sub(2)?
        .saturating_sub(COARSER - 1)
        .max(1);
    if linear.as_ref().is_none_or(|linear| linear.grid != grid) {
        let system = factorized(&levels[grid], work)?;
        *linear = Some(Linear { grid, system });
    }
    let (Level { leaf, state }, system) = (&levels[grid], &mut linear.as_mut()?.system);
    let (rods, jumps) = carried(levels, columns);
    leaf.assemble_jumps(state, &jumps, system);
    let Solved::Yes(_) = system.solve(None, ACCURACY) else {
        return None;
    };
    let half = leaf.segments() / levels[0].leaf.segments() / 2;
    let solution = system.solution();
    let (mut error, mut between) = (0.0_f64, 0.0_f64);
    for (rod, jumps) in solution.iter().zip(&jumps) {
        let nodes = rod.iter().skip(half - 1).step_by(half).map(shift);
        for (k, wrong) in nodes.enumerate() {
            match k.is_multiple_of(2) {
                true => {
                    between = larger(
                        between,
                        larger(wrong.length(), (wrong + jumps[k / 2][0]).length()),
                    )
                }
                false => error = larger(error, wrong.length()),
            }
        }
    }
    (error + between).is_finite().then_some(Told {
        error,
        between,
        rods,
    })
}

/// The larger of two, or what is not a number.
fn larger(a: f64, b: f64) -> f64 {
    if b <= a { a } else { b }
}

/// Those at rest: where rods are rigid the last step of Newton's method began with other
/// forces.
fn factorized(level: &Level, work: &mut Work) -> Option<System> {
    let mut system = System::new(&level.leaf);
    work.force_evaluations += 1;
    work.factorizations += 1;
    level.leaf.assemble(&level.state, &mut system);
    let regular = match level.leaf.rods() {
        1 => system.factorize_indefinite(),
        _ => system.factorize(0.0),
    };
    regular.then_some(system)
}

/// The leaf at the nodes of the coarsest grid and, carried from there to the middles between
/// by a step for every segment of the finest, at its nodes; in the middles the mean, and the
/// jumps.
fn carried(levels: &[Level], columns: usize) -> (Vec<Vec<RodFields>>, Vec<Vec<Jump>>) {
    let (first, finest) = (&levels[0].leaf, &levels[levels.len() - 1].leaf);
    let (mut known, grid) = (nodes(levels, columns), &first.grid);
    let tips = known.iter_mut().filter_map(|rod| rod.last_mut()).collect();
    balance(first, tips);
    let steps = finest.segments() / first.segments() / 2;
    let mut flow = Flow::new(first);
    let mut rods = vec![Vec::with_capacity(finest.segments() + 1); first.rods()];
    let mut jumps = vec![Vec::with_capacity(first.segments()); first.rods()];
    let room = || vec![Vec::with_capacity(steps); first.rods()];
    let (mut before, mut behind) = (room(), room());
    for i in 0..first.segments() {
        for (k, after) in [(i, &mut before), (i + 1, &mut behind)] {
            let way = [grid.sigma()[k], grid.middle(i)];
            flow.carry(|j| known[j][k], way, steps, after);
        }
        for (j, (rod, jumps)) in rods.iter_mut().zip(&mut jumps).enumerate() {
            let [(a, before), (b, behind)] = [&before[j], &behind[j]].map(|after| {
                let (middle, before) = after.split_last().expect("a step at least");
                (middle, before)
            });
            jumps.push(jump(a, b));
            rod.push(known[j][i]);
            rod.extend(before);
            rod.push(mean(a, b));
            rod.extend(behind.iter().rev());
        }
    }
    for (rod, known) in rods.iter_mut().zip(&known) {
        rod.extend(known.last());
    }
    (rods, jumps)
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

fn mean(a: &RodFields, b: &RodFields) -> RodFields {
    RodFields {
        x: 0.5 * (a.x + b.x),
        q: a.q.lerp(b.q, 0.5),
        n: 0.5 * (a.n + b.n),
        m: 0.5 * (a.m + b.m),
    }
}
