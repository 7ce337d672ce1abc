//! From a free start to held tips: the grips are moved quasi-statically.
//!
//! A leaf with a held tip may have many equilibria, and the one it reaches depends on the
//! loading path. The path here is that of a testing machine: the leaf is gripped where a free
//! start has its tips, and the grips move and rotate uniformly to their final positions, with
//! the leaf at rest at every step.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{Definite, Stop};
use crate::relax::request::problem::Problem;
use crate::relax::saddle;
use crate::relax::settle::effort::Effort;
use crate::relax::settle::methods::Relaxation;
use crate::rotation;
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// Largest displacement (lengths) and rotation (radians) of the grips in a step.
const SHIFT: f64 = 0.1;
const TURN: f64 = 0.4;

/// Accuracy of the equilibria along the path.
const ACCURACY: f64 = 1e-2;

/// Saddles that are left in a step.
const PUSHES: i32 = 3;

/// Moves the tips from their positions in `state` to those where they are held. Returns the
/// state there, whether the leaf rests in it, and whether its energy was not convex along
/// the path.
pub fn move_grips(
    problem: &Problem,
    leaf: &DiscreteLeaf,
    state: State,
    effort: &mut Effort,
) -> (State, bool, bool) {
    let Some(paths) = paths(leaf, &state) else {
        return (state, false, false);
    };
    let steps = paths.iter().map(Path::steps).fold(1.0, f64::max);
    let keeps_unstable = problem.keeps_unstable();
    let (limit, begun) = (&problem.options.limit, effort.work.force_evaluations);
    let mut system = System::new(leaf);
    let ignored: &mut dyn FnMut(usize, f64) = &mut |_, _| {};
    let mut held = Relaxation::new(state, ACCURACY, (&mut effort.work, ignored), limit);
    for step in 1..=steps as usize {
        if limit.reached() {
            break;
        }
        for (j, path) in paths.iter().enumerate() {
            path.move_tip(leaf, j, step as f64 / steps, &mut held.state);
        }
        held.near_rest = settle_held(leaf, &mut system, &mut held, keeps_unstable);
    }
    let (mut state, near_rest, moved) = (held.state, held.near_rest, held.moved);
    effort.spent += leaf.rods() * leaf.segments() * (effort.work.force_evaluations - begun);
    leaf.leaf.hold_tips(&mut state);
    (state, near_rest, moved)
}

/// Brings the leaf roughly to rest with its tips fixed, if possible.
fn settle_held(
    leaf: &DiscreteLeaf,
    system: &mut System,
    held: &mut Relaxation,
    keeps_unstable: bool,
) -> bool {
    for pushes in 0..PUSHES {
        (held.pushes, held.solver) = (pushes, Definite::default());
        let rest = held.settle(leaf, system);
        if rest != Err(Stop::Saddle) || keeps_unstable {
            return rest.is_ok();
        }
        saddle::push_off(leaf, &mut held.state, system, DVec3::ZERO, held.work);
    }
    false
}

/// The path of the tip of a rod from a free start to its holder.
struct Path {
    from: DVec3,
    to: DVec3,
    /// Of a clamp: the angle of d1 about e3 at both ends, the final twist about d1, and the
    /// rest of the start's rotation, which is removed along the path.
    clamp: Option<([f64; 2], f64, DVec3)>,
}

/// The paths of all tips; `None` if they are free.
fn paths(leaf: &DiscreteLeaf, start: &State) -> Option<Vec<Path>> {
    let held = leaf.leaf.held.as_ref()?;
    let path = |j: usize| Path {
        from: start.tip(j),
        to: held.position,
        clamp: held.clamps.as_ref().map(|clamps| {
            let rod = &start.q[start.base(j)..=start.base(j) + leaf.segments()];
            let tip = rod[leaf.segments()];
            let heading = heading(rod);
            let other = DQuat::from_rotation_z(heading).conjugate() * tip;
            (
                [heading, clamps[j].angle],
                clamps[j].twist,
                rotation::log(other),
            )
        }),
    };
    Some((0..leaf.rods()).map(path).collect())
}

/// The angle of d1 about e3 at the last of these nodes, continued from the first: full turns
/// count.
fn heading(rod: &[DQuat]) -> f64 {
    let angle = |q: &DQuat| {
        let d1 = *q * DVec3::X;
        d1.y.atan2(d1.x)
    };
    let turns = rod.windows(2).map(|ends| {
        let turn = angle(&ends[1]) - angle(&ends[0]);
        (turn + PI).rem_euclid(TAU) - PI
    });
    angle(&rod[0]) + turns.sum::<f64>()
}

impl Path {
    /// The number of steps along the path.
    fn steps(&self) -> f64 {
        let turn = self.clamp.map_or(0.0, |([from, to], twist, other)| {
            (to - from).abs() + twist.abs() + other.length()
        });
        (self.from.distance(self.to) / SHIFT)
            .max(turn / TURN)
            .ceil()
    }

    /// Moves the tip of rod `j` to the fraction `part` of the path, and every node with it in
    /// proportion to its distance from the base.
    fn move_tip(&self, leaf: &DiscreteLeaf, j: usize, part: f64, state: &mut State) {
        let base = state.base(j);
        let tip = base + leaf.segments();
        let shift = self.from.lerp(self.to, part) - state.x[tip];
        let turn = self.clamp.map(|([from, to], twist, other)| {
            let heading = DQuat::from_rotation_z(from + part * (to - from));
            let rotation = heading
                * DQuat::from_rotation_x(part * twist)
                * rotation::exp((1.0 - part) * other);
            rotation::log(rotation * state.q[tip].conjugate())
        });
        for (i, &sigma) in leaf.grid.sigma().iter().enumerate().skip(1) {
            state.x[base + i] += sigma * shift;
            if let Some(turn) = turn {
                state.q[base + i] = (rotation::exp(sigma * turn) * state.q[base + i]).normalize();
            }
        }
    }
}
