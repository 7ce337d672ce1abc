//! The turns of veins about the axis of their base without resistance
//! ([`Scenario::turnings`](crate::scenario::Scenario::turnings)): their phase conditions, their
//! modes, and the equilibrium that stands for a circle of equilibria.
//!
//! Bent veins that can turn have an eigenvalue that is exactly zero, on every grid. A spring that
//! holds one node in the direction in which it would move is a phase condition: as the forces do
//! no work in a turn, the equations with it have the same solutions, it has no force there, and the
//! matrix has one negative eigenvalue for each of those of the leaf, and none for the turn.

use super::discrete::DiscreteLeaf;
use super::state::{Field, State};
use super::system::System;
use crate::rotation::angle_about;
use crate::scenario::Turning;
use glam::{DMat3, DQuat, DVec3};

/// Stiffness of the spring, A/L^3.
const SPRING: f64 = 100.0;

/// A node nearer to the axis than this (lengths) is on it: straight veins do not move when they
/// turn.
const ON_AXIS: f64 = 1e-6;

/// The node farthest from the axis, at which a turn is held.
struct Farthest {
    rod: usize,
    node: usize,
    /// The direction in which it moves.
    direction: DVec3,
}

impl DiscreteLeaf {
    /// The veins that can turn, whatever their state: in half of a mirror-symmetric leaf those
    /// whose images turn the other way.
    fn turnings(&self) -> impl Iterator<Item = &Turning> {
        let moves = |j: usize| j < self.rods() && !self.leaf.in_plane(j);
        let half = self.leaf.in_half();
        (self.leaf.turnings.iter()).filter(move |it| !half || it.rods.clone().all(moves))
    }

    /// The node that is farthest from the axis, if the veins are not straight. A joint tip, which
    /// all rods share, is none.
    fn farthest_from_axis(&self, turning: &Turning, state: &State) -> Option<Farthest> {
        let last = self.segments() - usize::from(self.tips_move_together());
        let mut farthest = None;
        let mut most = ON_AXIS;
        for (rod, node) in nodes(turning, last) {
            let speed = turning.axis.cross(state.x[state.base(rod) + node]);
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

    /// Adds the phase conditions of veins that can turn to an assembled matrix.
    pub fn hold_turn(&self, state: &State, system: &mut System) {
        for turning in self.turnings() {
            if let Some(at) = self.farthest_from_axis(turning, state) {
                let d = at.direction;
                let stiffness = SPRING * DMat3::from_cols(d.x * d, d.y * d, d.z * d);
                system.hold(at.rod, at.node, stiffness);
            }
        }
    }

    /// Turns veins that can turn without resistance until their moment at the base bends them down
    /// (towards -e3), so that of a circle of equilibria it is always the same one, on all grids.
    pub fn lean_down(&self, state: &mut State) {
        let n = self.segments();
        let [turns, shifts] = self.moves(0, n);
        for Turning { rods, axis } in self.turnings() {
            let moment = |j: usize| {
                let segment = self.segment(state, j, 0, state.n[j * n]);
                -segment.gradient(self.section(j, 0)).1
            };
            let moment: DVec3 = rods.clone().map(moment).sum();
            // Down, or for a vertical axis e1, normal to the axis.
            let down = match axis.z.abs() > 0.99 {
                true => DVec3::X,
                false => -DVec3::Z,
            };
            let angle = angle_about(*axis, moment, axis.cross(down));
            let (turn, back) = (
                DQuat::from_axis_angle(*axis, angle),
                DQuat::from_rotation_x(-angle),
            );
            for j in rods.clone() {
                for node in 1..=n {
                    let k = state.base(j) + node;
                    if shifts || node < n {
                        state.x[k] = turn * state.x[k];
                    }
                    if turns || node < n {
                        state.q[k] = (turn * state.q[k] * back).normalize();
                    }
                }
                let forces = &mut state.n[j * n..(j + 1) * n];
                forces.iter_mut().for_each(|force| *force = turn * *force);
            }
        }
    }

    /// The turns at unit rate of bent veins that can: increments of the nodes 1 to n of all rods.
    pub fn turns(&self, state: &State) -> Vec<Field> {
        let bent = |turning: &&Turning| self.farthest_from_axis(turning, state).is_some();
        let turn = |Turning { rods, axis }: &Turning| {
            let mut field = vec![vec![[0.0; 6]; self.segments()]; self.rods()];
            for j in rods.clone() {
                for (node, increments) in field[j].iter_mut().enumerate() {
                    let k = state.base(j) + node + 1;
                    let (spin, velocity) = (*axis - state.q[k] * DVec3::X, axis.cross(state.x[k]));
                    *increments = [spin.x, spin.y, spin.z, velocity.x, velocity.y, velocity.z];
                }
            }
            field
        };
        self.turnings().filter(bent).map(turn).collect()
    }
}

/// Rods and nodes of veins, to the node `last`.
fn nodes(turning: &Turning, last: usize) -> impl Iterator<Item = (usize, usize)> {
    (turning.rods.clone()).flat_map(move |rod| (1..=last).map(move |node| (rod, node)))
}
