//! From a free start to held tips: the grips are moved quasi-statically.
//!
//! A leaf with a held tip may have many equilibria, and the one it reaches depends on the
//! loading path. The path here is that of a testing machine: the leaf is gripped where a free
//! start has its tips, and the grips move and rotate uniformly to their final positions, with
//! the leaf at rest at every step.

use crate::leaf::{DiscreteLeaf, Gripped, State, System};
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

/// Moves tips and other nodes from their positions in `state` to those where they are held. Returns
/// the state there, whether the leaf rests in it, and whether its energy was not convex along
/// the path.
pub fn move_grips(
    problem: &Problem,
    leaf: &DiscreteLeaf,
    state: State,
    effort: &mut Effort,
) -> (State, bool, bool) {
    let paths = paths(leaf, &state).unwrap_or_default();
    let grips: Vec<GripPath> = (0..leaf.rods())
        .flat_map(|j| leaf.grips_of(j).map(|held| GripPath::of(*held, &state)))
        .collect();
    let of_tips = paths.iter().map(Path::steps);
    let steps = of_tips.chain(grips.iter().map(GripPath::steps));
    let steps = steps.fold(1.0, f64::max);
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
        carry(leaf, &grips, step as f64 / steps, &mut held.state);
        held.near_rest = settle_held(leaf, &mut system, &mut held, keeps_unstable);
    }
    let (mut state, near_rest, moved) = (held.state, held.near_rest, held.moved);
    effort.spent += leaf.rods() * leaf.segments() * (effort.work.force_evaluations - begun);
    leaf.hold(&mut state);
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

/// The path of a node from where it is to where a grip holds it.
struct GripPath {
    held: Gripped,
    from: DVec3,
    turn: DVec3,
}

impl GripPath {
    fn of(held: Gripped, start: &State) -> Self {
        let k = start.base(held.rod) + held.node;
        let turn = |to: DQuat| rotation::log(to * start.q[k].conjugate());
        GripPath {
            held,
            from: start.x[k],
            turn: held.rotation.map_or(DVec3::ZERO, turn),
        }
    }

    /// The number of steps along the path.
    fn steps(&self) -> f64 {
        let distance = self.from.distance(self.held.position);
        (distance / SHIFT).max(self.turn.length() / TURN).ceil()
    }
}

/// Carries gripped nodes to the fraction `part` of their paths. The nodes between two of them, or
/// one and the end of the vein, are displaced in proportion to their distances.
fn carry(leaf: &DiscreteLeaf, paths: &[GripPath], part: f64, state: &mut State) {
    let (n, sigma) = (leaf.segments(), leaf.grid.sigma());
    for j in 0..leaf.rods() {
        let (base, mut before) = (state.base(j), (0, DVec3::ZERO));
        let fixed_tip = leaf.leaf.held.is_some() || leaf.tips_move_together();
        let of_rod: Vec<&GripPath> = paths.iter().filter(|path| path.held.rod == j).collect();
        for path in &of_rod {
            let node = path.held.node;
            let shift = path.from.lerp(path.held.position, part) - state.x[base + node];
            between(sigma, [before, (node, shift)], |i, shift| {
                state.x[base + i] += shift
            });
            state.x[base + node] += shift;
            if let Some(rotation) = path.held.rotation {
                let left = rotation::exp((part - 1.0) * path.turn);
                state.q[base + node] = (left * rotation).normalize();
            }
            before = (node, shift);
        }
        if !of_rod.is_empty() && before.0 < n {
            let end = if fixed_tip { DVec3::ZERO } else { before.1 };
            between(sigma, [before, (n, end)], |i, shift| {
                state.x[base + i] += shift
            });
            if !fixed_tip {
                state.x[base + n] += end;
            }
        }
    }
}

/// Passes the nodes between two nodes, with their displacements interpolated.
fn between(
    sigma: &[f64],
    [(a, from), (b, to)]: [(usize, DVec3); 2],
    mut each: impl FnMut(usize, DVec3),
) {
    for i in a + 1..b {
        let part = (sigma[i] - sigma[a]) / (sigma[b] - sigma[a]);
        each(i, from.lerp(to, part));
    }
}
