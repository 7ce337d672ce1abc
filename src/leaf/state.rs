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

use crate::numbers::{larger, largest};
use crate::rod::NodePair;
use crate::rotation;
use glam::{DQuat, DVec3};

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
