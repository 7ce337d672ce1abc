//! The turn of a leaf about the axis of its base without resistance
//! ([`Scenario::turning_axis`](crate::scenario::Scenario::turning_axis)): its phase condition, its
//! mode, and the equilibrium that stands for its circle of equilibria.
//!
//! A bent leaf that can turn has an eigenvalue that is exactly zero, on every grid. A spring that
//! holds one node in the direction in which it would move is a phase condition: as the forces do
//! no work in a turn, the equations with it have the same solutions, it has no force there, and the
//! matrix has one negative eigenvalue for each of those of the leaf, and none for the turn.

use super::discrete::DiscreteLeaf;
use super::state::{Field, State};
use super::system::System;
use crate::rotation::angle_about;
use glam::{DMat3, DQuat, DVec3};

/// Stiffness of the spring, A/L^3.
const SPRING: f64 = 100.0;

/// A node nearer to the axis than this (lengths) is on it: a straight leaf does not move when it
/// turns.
const ON_AXIS: f64 = 1e-6;

/// The node farthest from the axis, at which a turn is held.
struct Farthest {
    rod: usize,
    node: usize,
    /// The direction in which it moves.
    direction: DVec3,
}

impl DiscreteLeaf {
    /// The axis about which the leaf can turn, whatever its state.
    fn turning_axis(&self) -> Option<DVec3> {
        self.leaf.turning.filter(|_| !self.leaf.in_half())
    }

    /// The node that is farthest from the axis, if the leaf can turn and is not straight. A joint
    /// tip, which all rods share, is none.
    fn farthest_from_axis(&self, state: &State) -> Option<Farthest> {
        let axis = self.turning_axis()?;
        let last = self.segments() - usize::from(self.tips_move_together());
        let mut farthest = None;
        let mut most = ON_AXIS;
        for (rod, node) in self.each(1..last + 1) {
            let speed = axis.cross(state.x[state.base(rod) + node]);
            if speed.length() > most {
                most = speed.length();
                farthest = Some(Farthest {
                    rod,
                    node,
                    direction: speed / most,
                });
            }
        }
        farthest
    }

    /// Adds the phase condition to an assembled matrix, if the leaf can turn.
    pub fn hold_turn(&self, state: &State, system: &mut System) {
        if let Some(at) = self.farthest_from_axis(state) {
            let d = at.direction;
            let stiffness = SPRING * DMat3::from_cols(d.x * d, d.y * d, d.z * d);
            system.hold(at.rod, at.node, stiffness);
        }
    }

    /// Turns a leaf that can turn without resistance until its moment at the base bends it down
    /// (towards -e3), so that of its circle of equilibria it is always the same one, on all grids.
    pub fn lean_down(&self, state: &mut State) {
        let Some(axis) = self.turning_axis() else {
            return;
        };
        let moment = |j: usize| {
            let segment = self.segment(state, j, 0, state.n[j * self.segments()]);
            -segment.gradient(self.section(j, 0)).1
        };
        let moment: DVec3 = (0..self.rods()).map(moment).sum();
        // Down is normal to the axis, as the base is in the e1-e2 plane.
        let angle = angle_about(axis, moment, axis.cross(-DVec3::Z));
        let (turn, back) = (
            DQuat::from_axis_angle(axis, angle),
            DQuat::from_rotation_x(-angle),
        );
        let n = self.segments();
        let [turns, shifts] = self.moves(n);
        for (rod, node) in self.each(1..n + 1) {
            let k = state.base(rod) + node;
            if shifts || node < n {
                state.x[k] = turn * state.x[k];
            }
            if turns || node < n {
                state.q[k] = (turn * state.q[k] * back).normalize();
            }
        }
        state.n.iter_mut().for_each(|force| *force = turn * *force);
    }

    /// The turn at unit rate: increments of the nodes 1 to n of all rods. `None` if the leaf cannot
    /// turn or is straight.
    pub fn turn(&self, state: &State) -> Option<Field> {
        self.farthest_from_axis(state)?;
        let axis = self.turning_axis()?;
        let node = |k: usize| {
            let (spin, velocity) = (axis - state.q[k] * DVec3::X, axis.cross(state.x[k]));
            [spin.x, spin.y, spin.z, velocity.x, velocity.y, velocity.z]
        };
        let rod = |j: usize| {
            (1..=self.segments())
                .map(|i| node(state.base(j) + i))
                .collect()
        };
        Some((0..self.rods()).map(rod).collect())
    }
}
