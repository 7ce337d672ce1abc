//! Leaves that can turn about the axis of their base without resistance: of round veins that are
//! clamped in line, loaded along this line and held on it, if at all.
//!
//! Where every vein turns about the axis by an angle and every section back about its own
//! tangent, no clamp, load or strain energy changes. A leaf that is bent has a circle of equilibria
//! then, one of whose eigenvalues is exactly zero, and yet there is no bifurcation. A spring that
//! holds one node in the direction in which it would move is a phase condition: as the forces do
//! no work in a turn, the equations with it have the same solutions, it has no force there, and the
//! matrix has one negative eigenvalue for each of those of the leaf, and none for the turn.

use super::discrete::DiscreteLeaf;
use super::state::{Increment, State};
use super::system::System;
use glam::{DMat3, DQuat, DVec3};

/// Stiffness of the spring, A/L^3.
const SPRING: f64 = 100.0;

/// Numbers that differ by less than this part are the same.
const ROUNDING: f64 = 1e-12;

/// A node nearer to the axis than this (lengths) is on it: a straight leaf does not move when it
/// turns.
const ON_AXIS: f64 = 1e-6;

/// The node farthest from the axis, from which a turn is held.
struct Farthest {
    rod: usize,
    node: usize,
    /// The direction in which it moves.
    direction: DVec3,
}

impl DiscreteLeaf {
    /// The axis about which the whole leaf can turn without resistance, whatever its state.
    pub fn turning_axis(&self) -> Option<DVec3> {
        let leaf = &self.leaf;
        let axis = leaf.base(0) * DVec3::X;
        let along = |vector: DVec3| {
            (vector - vector.dot(axis) * axis).length() <= ROUNDING * vector.length()
        };
        let in_line = |j: usize| (leaf.base(j) * DVec3::X).distance(axis) <= ROUNDING;
        if leaf.in_half() || !(0..leaf.rods()).all(in_line) {
            return None;
        }
        let loads = along(self.loads.gravity) && along(self.loads.tip_force);
        let held = leaf.held.as_ref().is_none_or(|held| {
            let clamped = |j: usize| {
                let clamp = held.rotation(j);
                clamp.is_none_or(|clamp| (clamp * DVec3::X).distance(axis) <= ROUNDING)
            };
            held.position.reject_from_normalized(axis).length() <= ROUNDING
                && (0..leaf.rods()).all(clamped)
        });
        // A dead moment has no potential.
        let conservative = self.tip_moment() == DVec3::ZERO;
        (conservative && loads && held && self.is_round(axis)).then_some(axis)
    }

    /// Whether all sections, and the coupling about the axis, have no preferred direction.
    fn is_round(&self, axis: DVec3) -> bool {
        let same = |a: f64, b: f64| a == b || (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
        let sections = self.sections.iter().all(|section| {
            let [k, c, u] = [
                section.couple_stiffness,
                section.compliance,
                section.rest_curvature,
            ];
            same(k.y, k.z) && same(c.y, c.z) && u.y == 0.0 && u.z == 0.0
        });
        let coupling = (0..self.gaps()).all(|g| {
            let k = self.coupling(g);
            // The base is in the e1-e2 plane: k differs from a multiple of the unit matrix along
            // the axis alone.
            let along_axis = same(k.y, k.z) && axis.distance(DVec3::X) <= ROUNDING;
            along_axis || same(k.x, k.y) && same(k.y, k.z)
        });
        sections && coupling
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

    /// Whether the leaf can turn about its axis, and is not straight.
    pub fn turns(&self, state: &State) -> bool {
        self.farthest_from_axis(state).is_some()
    }

    /// Adds the phase condition to an assembled matrix, if the leaf can turn.
    pub fn hold_turn(&self, state: &State, system: &mut System) {
        if let Some(at) = self.farthest_from_axis(state) {
            let d = at.direction;
            let stiffness = SPRING * DMat3::from_cols(d.x * d, d.y * d, d.z * d);
            system.hold(at.rod, at.node, stiffness);
        }
    }

    /// Turns a leaf that can turn without resistance until it leans down (towards -e3), so that
    /// of its circle of equilibria it is always the same one, on all grids.
    pub fn lean_down(&self, state: &mut State) {
        let Some(axis) = self.turning_axis().filter(|_| self.turns(state)) else {
            return;
        };
        let mut lean = DVec3::ZERO;
        for (rod, node) in self.each(1..self.segments() + 1) {
            let x = state.x[state.base(rod) + node];
            lean += self.grid.weight(node) * self.grid.sigma()[node] * x;
        }
        // The base is in the e1-e2 plane: down is normal to the axis.
        let (down, aside) = (-DVec3::Z, axis.cross(-DVec3::Z));
        let angle = -lean.dot(aside).atan2(lean.dot(down));
        let (turn, back) = (DQuat::from_axis_angle(axis, angle), DQuat::from_rotation_x(-angle));
        let [turns, shifts] = self.moves(self.segments());
        for (rod, node) in self.each(1..self.segments() + 1) {
            let k = state.base(rod) + node;
            if shifts || node < self.segments() {
                state.x[k] = turn * state.x[k];
            }
            if turns || node < self.segments() {
                state.q[k] = (turn * state.q[k] * back).normalize();
            }
        }
        state.n.iter_mut().for_each(|force| *force = turn * *force);
    }

    /// The turn at unit rate: increments of all nodes, rod after rod, base to tip. `None` if the
    /// leaf cannot turn or is straight.
    pub fn turn(&self, state: &State) -> Option<Vec<Increment>> {
        let axis = self.turning_axis().filter(|_| self.turns(state))?;
        let node = |(x, q): (&DVec3, &DQuat)| {
            let (spin, velocity) = (axis - *q * DVec3::X, axis.cross(*x));
            [spin.x, spin.y, spin.z, velocity.x, velocity.y, velocity.z]
        };
        Some(state.x.iter().zip(&state.q).map(node).collect())
    }
}
