//! From a free start to tips that are held: the grips are led there.
//!
//! Many shapes may join a base to a tip that is held. Which one a leaf takes
//! depends on how it got there, and it gets there as in a testing machine: it is
//! gripped where a free start has its tips, and the grips move and turn evenly to
//! where they are to be, slowly enough for the leaf to rest at every step.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{Definite, Stop};
use crate::relax::methods::semi_implicit::Relaxation;
use crate::relax::run::Run;
use crate::relax::saddle;
use crate::rotation;
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// The grips move by no more than this in a step (lengths), nor turn by more
/// (radians).
const SHIFT: f64 = 0.1;
const TURN: f64 = 0.4;

/// Accuracy to which the leaf is settled on the way.
const ACCURACY: f64 = 1e-2;

/// Saddles that are left in a step.
const PUSHES: i32 = 3;

/// What leading the grips led to.
pub struct Led {
    pub state: State,
    /// Whether the leaf rests there.
    pub at_rest: bool,
    /// Whether its energy was not convex on the way.
    pub moved: bool,
}

impl Run<'_, '_> {
    /// Leads the tips from where `state` has them to where they are held.
    pub fn lead_grips(&mut self, leaf: &DiscreteLeaf, state: State) -> Led {
        let mut led = Led {
            state,
            at_rest: false,
            moved: false,
        };
        let Some(paths) = paths(leaf, &led.state) else {
            return led;
        };
        let steps = paths.iter().map(Path::steps).fold(1.0, f64::max);
        let mut system = System::new(leaf);
        for step in 1..=steps as usize {
            if self.late() {
                break;
            }
            for (j, path) in paths.iter().enumerate() {
                path.lead(leaf, j, step as f64 / steps, &mut led.state);
            }
            led.at_rest = self.follow_grips(leaf, &mut system, &mut led);
        }
        leaf.hold_tips(&mut led.state);
        led
    }

    /// Lets the leaf come to rest roughly, with its tips where they are.
    fn follow_grips(&mut self, leaf: &DiscreteLeaf, system: &mut System, led: &mut Led) -> bool {
        for pushes in 0..PUSHES {
            let mut relaxation = Relaxation {
                state: led.state.clone(),
                accuracy: ACCURACY,
                work: &mut self.work,
                progress: &mut |_, _| {},
                near_rest: led.at_rest,
                cg_tolerance: ACCURACY,
                pushes,
                solver: Definite::default(),
                most_evaluations: usize::MAX,
                limit: &self.options.limit,
                convex_only: false,
                moved: false,
                by_steps: false,
                moved_softened: false,
                part: 0.0,
            };
            let before = relaxation.work.force_evaluations;
            let rest = relaxation.settle(leaf, system);
            led.state = relaxation.state;
            led.moved |= relaxation.moved;
            let spent = relaxation.work.force_evaluations - before;
            self.spent += leaf.rods() * leaf.segments() * spent;
            if rest != Err(Stop::Saddle) || self.keeps_unstable() {
                return rest.is_ok();
            }
            saddle::push_off(leaf, &mut led.state, system, &mut self.work);
        }
        false
    }
}

/// The way of the tip of a rod from a free start to its holder.
struct Path {
    from: DVec3,
    to: DVec3,
    /// Of a clamp: the angle of d1 about e3, the twist about d1, and what of the
    /// start's rotation is neither, which is undone on the way.
    clamp: Option<([f64; 2], f64, DVec3)>,
}

/// The ways of all tips; `None` if they are free.
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

/// The angle of d1 about e3 at the last of these nodes, of which it is followed
/// from the first: more than a turn counts.
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
    /// In how many steps it is taken.
    fn steps(&self) -> f64 {
        let turn = self.clamp.map_or(0.0, |([from, to], twist, other)| {
            (to - from).abs() + twist.abs() + other.length()
        });
        (self.from.distance(self.to) / SHIFT)
            .max(turn / TURN)
            .ceil()
    }

    /// Moves the tip of rod `j` to a part of the way, and every node with it by its
    /// part of the length.
    fn lead(&self, leaf: &DiscreteLeaf, j: usize, part: f64, state: &mut State) {
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
