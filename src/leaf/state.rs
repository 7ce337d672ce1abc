//! Positions, rotations and segment forces of all nodes of a leaf.
//!
//! The turns of veins without resistance
//! ([`Scenario::turnings`](crate::scenario::Scenario::turnings)): their phase conditions, their
//! modes, and the equilibrium that stands for a circle of equilibria.
//!
//! Veins that can turn have an eigenvalue that is exactly zero, on every grid, unless they are straight
//! and clamped. A spring that holds one node in the direction in which it would move is a phase condition: as the forces do
//! no work in a turn, the equations with it have the same solutions, it has no force there, and the
//! matrix has one negative eigenvalue for each of those of the leaf, and none for the turn.

use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::system::System;
use crate::numbers::{larger, largest};
use crate::rod::NodePair;
use crate::rotation;
use crate::rotation::outer;
use crate::scenario::{BaseRotations, ZeroEnergyRotation};
use glam::{DQuat, DVec3};
use std::borrow::Cow;

/// The state of a discretised leaf with N rods of n segments, rod after rod,
/// base to tip. Of a joined leaf all last positions are equal.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Nodal positions, N (n + 1).
    pub x: Vec<DVec3>,
    /// Nodal rotations as unit quaternions, N (n + 1).
    pub q: Vec<DQuat>,
    /// Spatial force of each segment, N n.
    pub n: Vec<DVec3>,
    /// Spatial force of the tissue per unit of sigma at each node, gap after gap, (N - 1) (n + 1);
    /// empty: that of its strains.
    pub tissue: Vec<DVec3>,
    segments: usize,
}

/// Distance of tips, in lengths, that is rounding.
const TIP_COINCIDENCE_TOLERANCE: f64 = 1e-9;

/// Increments of one node in the order of elimination: spatial rotation, then
/// displacement.
pub type Increment = [f64; 6];

/// Increments, or the forces that are dual to them, of all nodes of a leaf with equations: rods,
/// then nodes from [`first_node`](crate::leaf::DiscreteLeaf::first_node) on. With a joint tip the last displacement is the same in every rod,
/// and the last force is each rod's share.
pub type NodalField = Vec<Vec<Increment>>;

/// The rotation part of an increment.
#[inline]
pub fn rotation_part(increment: &Increment) -> DVec3 {
    DVec3::new(increment[0], increment[1], increment[2])
}

/// The displacement part of an increment.
#[inline]
pub fn displacement_part(increment: &Increment) -> DVec3 {
    DVec3::new(increment[3], increment[4], increment[5])
}

/// Adds a rotation and a displacement to an increment, or a moment and a force.
pub fn add_to_increment(increment: &mut Increment, turn: DVec3, shift: DVec3) {
    for c in 0..3 {
        increment[c] += turn[c];
        increment[3 + c] += shift[c];
    }
}

impl State {
    /// From nodal positions and rotations, without forces.
    pub fn new(segments: usize, x: Vec<DVec3>, q: Vec<DQuat>) -> Self {
        let rods = x.len() / (segments + 1);
        State {
            x,
            q,
            n: vec![DVec3::ZERO; rods * segments],
            tissue: Vec::new(),
            segments,
        }
    }

    /// Segments per rod.
    pub fn segments(&self) -> usize {
        self.segments
    }

    /// Number of rods.
    pub fn rods(&self) -> usize {
        self.x.len() / (self.segments + 1)
    }

    /// Index of the first node of rod `j`.
    #[inline]
    pub fn base(&self, j: usize) -> usize {
        j * (self.segments + 1)
    }

    /// Whether the tips of all rods are one point, but for rounding.
    pub fn tips_meet(&self) -> bool {
        let apart = |j: usize| self.tip(j).distance(self.tip(0));
        (1..self.rods()).all(|j| apart(j) <= TIP_COINCIDENCE_TOLERANCE)
    }

    /// Moves the tips of all rods to their mean.
    pub fn join_tips(&mut self) {
        let (rods, first) = (self.rods(), self.tip(0));
        let apart: DVec3 = (0..rods).map(|j| self.tip(j) - first).sum();
        let mean = first + apart / rods as f64;
        for j in 0..rods {
            let tip = self.base(j) + self.segments;
            self.x[tip] = mean;
        }
    }

    /// The nodes of segment `i` of rod `j`.
    pub fn ends(&self, j: usize, i: usize) -> NodePair {
        let k = self.base(j) + i;
        NodePair {
            x: [self.x[k], self.x[k + 1]],
            q: [self.q[k], self.q[k + 1]],
        }
    }

    /// Position of the tip of rod `j`.
    pub fn tip(&self, j: usize) -> DVec3 {
        self.x[self.base(j) + self.segments]
    }

    /// Positions of the tips of all rods.
    pub fn tips(&self) -> impl Iterator<Item = DVec3> {
        (0..self.rods()).map(|j| self.tip(j))
    }

    /// The largest displacement between this state and another at the nodes common to both
    /// grids, of which one is a repeated halving of the other (or the same).
    pub fn largest_displacement_to(&self, other: &State) -> f64 {
        let n = self.segments.min(other.segments);
        let distance = |j: usize, i: usize| {
            let [a, b] = [self, other].map(|it| it.x[it.base(j) + i * (it.segments / n)]);
            a.distance(b)
        };
        let nodes = (0..self.rods()).flat_map(|j| (0..=n).map(move |i| (j, i)));
        largest(nodes.map(|(j, i)| distance(j, i)))
    }

    /// The largest displacement or rotation of a node between this state and another on the same
    /// grid.
    pub fn distance(&self, other: &State) -> f64 {
        let turns = self.q.iter().zip(&other.q);
        let turns = turns.map(|(a, b)| rotation::log(*b * a.conjugate()).length());
        turns.fold(self.largest_displacement_to(other), larger)
    }

    /// The largest change of a segment's force between this state and another on the
    /// same grid.
    pub fn force_change(&self, other: &State) -> f64 {
        let changes = self.n.iter().zip(&other.n).map(|(a, b)| a.distance(*b));
        largest(changes)
    }

    /// Writes the increments of all nodes from the `first` on that lead to another state on the same
    /// grid.
    pub fn increments_to(&self, other: &State, first: usize, field: &mut NodalField) {
        let nodes = self.segments + 1 - first;
        field.resize_with(self.rods(), || vec![[0.0; 6]; nodes]);
        for (j, rod) in field.iter_mut().enumerate() {
            for (i, increment) in rod.iter_mut().enumerate() {
                let k = self.base(j) + i + first;
                let turn = rotation::log(other.q[k] * self.q[k].conjugate());
                let shift = other.x[k] - self.x[k];
                *increment = [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z];
            }
        }
    }

    /// Rotates and displaces node `k` by `step` times the increment.
    #[inline]
    pub fn advance_node(&mut self, k: usize, increment: &Increment, step: f64) {
        self.q[k] = (rotation::exp(step * rotation_part(increment)) * self.q[k]).normalize();
        self.x[k] += step * displacement_part(increment);
    }
}

/// Stiffness of the spring, A/L^3, or A/L against a rotation.
const PHASE_SPRING_STIFFNESS: f64 = 100.0;

/// A node that turns slower than this (lengths per radian) is on the axis: straight veins do not move
/// when they turn.
const AXIS_SPEED_TOLERANCE: f64 = 1e-6;

/// The node at which a turn is held.
struct PhaseConditionNode {
    rod: usize,
    node: usize,
    /// The direction in which it rotates, or else that in which it is displaced.
    direction: [DVec3; 2],
}

impl DiscreteLeaf {
    /// The veins that can turn, whatever their state: in half of a mirror-symmetric leaf those
    /// whose images turn the other way.
    fn zero_energy_rotations(&self) -> impl Iterator<Item = &ZeroEnergyRotation> {
        let moves = |j: usize| j < self.rods() && !self.leaf.is_halved_midrib(j);
        let half = self.leaf.is_mirror_half();
        (self.leaf.turnings.iter()).filter(move |it| !half || it.rods.clone().all(moves))
    }

    /// The rotation and the displacement of a node by a turn at unit rate.
    fn zero_energy_increment(
        &self,
        turning: &ZeroEnergyRotation,
        state: &State,
        k: usize,
    ) -> [DVec3; 2] {
        turning.node_velocity(state.x[k], state.q[k], self.leaf.scale.length)
    }

    /// The node to hold: the one that is displaced most or, where sections spin, the base. A joint tip,
    /// which all rods share, is none.
    fn phase_condition_node(
        &self,
        turning: &ZeroEnergyRotation,
        state: &State,
    ) -> Option<PhaseConditionNode> {
        if turning.axis == DVec3::ZERO {
            let rod = turning.rods.start;
            let points = &state.x[state.base(rod)..][..=self.segments()];
            let [spin, _] = self.zero_energy_increment(turning, state, state.base(rod));
            let moves = turning.moves_something(points, DVec3::ZERO, AXIS_SPEED_TOLERANCE);
            return moves.then_some(PhaseConditionNode {
                rod,
                node: 0,
                direction: [spin, DVec3::ZERO],
            });
        }
        let last = self.segments() - usize::from(self.tips_move_together());
        let mut farthest = None;
        let mut most = AXIS_SPEED_TOLERANCE;
        for (rod, node) in rotating_nodes(turning, last) {
            let [_, speed] = self.zero_energy_increment(turning, state, state.base(rod) + node);
            if speed.length() > most {
                most = speed.length();
                farthest = Some(PhaseConditionNode {
                    rod,
                    node,
                    direction: [DVec3::ZERO, speed / most],
                });
            }
        }
        farthest
    }

    /// Adds the phase conditions of veins that can turn to an assembled matrix.
    pub fn add_phase_conditions(&self, state: &State, system: &mut System) {
        for turning in self.zero_energy_rotations() {
            if let Some(at) = self.phase_condition_node(turning, state) {
                let [turn, shift] = at.direction.map(|d| PHASE_SPRING_STIFFNESS * outer(d, d));
                system.add_displacement_spring(at.rod, at.node, shift);
                system.add_rotation_spring(at.rod, at.node, turn);
            }
        }
    }

    /// Turns veins that can turn without resistance, so that of a circle of equilibria it is always
    /// the same one, on all grids: clamped ones until their moment at the base bends them down
    /// (towards -e3); on hinges as near as possible to where they begin in the natural leaf, or down;
    /// and a vein that spins without a twist from there.
    pub fn rotate_to_representative(&self, state: &mut State) {
        for turning in self.zero_energy_rotations() {
            if turning.axis == DVec3::ZERO && self.phase_condition_node(turning, state).is_none() {
                continue;
            }
            let rods = &turning.rods;
            let moment = |j: usize| {
                let n = state.n[j * self.segments()];
                let segment = self.segment(state, j, 0, n);
                -segment.gradient(self.section(j, 0)).1
            };
            let begin = |j: usize| BaseRotations {
                stress_free: self.leaf.base(j).1,
                now: state.q[state.base(j)],
            };
            let begins: Vec<BaseRotations> = rods.clone().map(begin).collect();
            let moments = (!self.leaf.hinged()).then(|| rods.clone().map(moment).sum());
            let angle = turning.angle_to_representative(&begins, moments);
            let [turn, back] = turning.rotations(angle);
            let point = turning.point / self.leaf.scale.length;
            let n = self.segments();
            for j in rods.clone() {
                for node in self.moving_nodes() {
                    let k = state.base(j) + node;
                    let [turns, shifts] = self.allows_rotation_and_displacement(j, node);
                    if shifts || node < n {
                        state.x[k] = point + turn * (state.x[k] - point);
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

    /// The equilibrium that stands for the circle of a state: see [`DiscreteLeaf::rotate_to_representative`].
    pub fn circle_representative<'s>(&self, state: &'s State) -> Cow<'s, State> {
        let mut state = Cow::Borrowed(state);
        if self.zero_energy_rotations().next().is_some() {
            self.rotate_to_representative(state.to_mut());
        }
        state
    }

    /// The turns at unit rate of veins that can: increments of the nodes of all rods.
    pub fn zero_energy_fields(&self, state: &State) -> Vec<NodalField> {
        let moves =
            |turning: &&ZeroEnergyRotation| self.phase_condition_node(turning, state).is_some();
        let turn = |turning: &ZeroEnergyRotation| {
            let mut field = vec![vec![[0.0; 6]; self.moving_nodes().len()]; self.rods()];
            for j in turning.rods.clone() {
                for (node, increments) in field[j].iter_mut().enumerate() {
                    let k = state.base(j) + node + self.first_node();
                    let [spin, velocity] = self.zero_energy_increment(turning, state, k);
                    *increments = [spin.x, spin.y, spin.z, velocity.x, velocity.y, velocity.z];
                }
            }
            field
        };
        self.zero_energy_rotations()
            .filter(moves)
            .map(turn)
            .collect()
    }
}

/// Rods and nodes of veins, to the node `last`.
fn rotating_nodes(
    turning: &ZeroEnergyRotation,
    last: usize,
) -> impl Iterator<Item = (usize, usize)> {
    (turning.rods.clone()).flat_map(move |rod| (1..=last).map(move |node| (rod, node)))
}
