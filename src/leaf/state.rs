//! Positions, rotations and segment forces of all nodes of a leaf, and increments of these.

use crate::numbers::{larger, largest};
use crate::rod::NodePair;
use crate::rotation::{self, HeldSpin};
use glam::{DQuat, DVec3};
use std::ops::{BitAnd, BitOr};

/// The state of a discretized leaf with N rods of n segments, rod after rod,
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
    /// empty if the tissue carries the force of its strains.
    pub tissue: Vec<DVec3>,
    segments: usize,
}

/// Largest distance of joint tips by rounding, in lengths of the leaf.
const TIP_COINCIDENCE_TOLERANCE: f64 = 1e-9;

/// Increments of one node in the order of elimination: spatial rotation, then
/// displacement.
pub type Increment = [f64; 6];

/// An [`Increment`], or a rate of one, as vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeIncrement {
    /// Spatial rotation vector.
    pub rotation: DVec3,
    pub displacement: DVec3,
}

impl NodeIncrement {
    /// The increment, component by component.
    pub fn to_array(self) -> Increment {
        let [a, b] = [self.rotation.to_array(), self.displacement.to_array()];
        [a[0], a[1], a[2], b[0], b[1], b[2]]
    }
}

/// Increments, or the forces that are dual to them, of all nodes of a leaf with equations: rods,
/// then nodes from [`first_node`](crate::leaf::DiscreteLeaf::first_node) on. With a joint tip the
/// last displacement is the same in every rod, and the last force is each rod's share.
pub type NodalField = Vec<Vec<Increment>>;

/// The work of forces (and torques) on increments of the nodes, both by rod, node and component.
pub fn dot(forces: &NodalField, increments: &NodalField) -> f64 {
    let mut sum = 0.0;
    for (f, d) in forces.iter().flatten().zip(increments.iter().flatten()) {
        sum += (0..6).map(|c| f[c] * d[c]).sum::<f64>();
    }
    sum
}

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
    /// A state of these nodal positions and rotations, without forces.
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
                let change = NodeIncrement {
                    rotation: rotation::log(other.q[k] * self.q[k].conjugate()),
                    displacement: other.x[k] - self.x[k],
                };
                *increment = change.to_array();
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

/// A base whose spin is held.
#[derive(Clone, Copy, Debug)]
pub struct BaseJoint {
    pub rod: usize,
    pub spin: HeldSpin,
}

/// The unit vector about which a hinge does not let the base of a rod turn, as it holds its spin.
#[derive(Clone, Copy, Debug)]
pub struct SpinAxis {
    pub rod: usize,
    pub axis: DVec3,
}

impl SpinAxis {
    /// What of a vector is across the axis.
    pub fn across(self, vector: DVec3) -> DVec3 {
        vector - vector.dot(self.axis) * self.axis
    }
}

/// The axes of all bases whose spin is held, in a state.
#[derive(Clone, Debug, Default)]
pub struct SpinAxes(pub(super) Vec<SpinAxis>);

impl SpinAxes {
    /// The axes.
    pub fn iter(&self) -> impl Iterator<Item = SpinAxis> {
        self.0.iter().copied()
    }

    /// What of a moment on the base of rod `j`, or of its rotation, is across its axis; all of it without one.
    pub fn across(&self, j: usize, vector: DVec3) -> DVec3 {
        let own = self.0.iter().find(|held| held.rod == j);
        own.map_or(vector, |held| held.across(vector))
    }
}

/// A set of the components of a node's increment: rotations, then displacements, along the lab axes. Bit `c`
/// stands for component `c`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ComponentSet(u8);

impl ComponentSet {
    pub const NONE: ComponentSet = ComponentSet(0);
    pub const ROTATION: ComponentSet = ComponentSet(0b000111);
    pub const DISPLACEMENT: ComponentSet = ComponentSet(0b111000);
    /// Zero for a node in the mirror plane: rotations about x and z, the displacement along y.
    pub const ACROSS_MIRROR: ComponentSet = ComponentSet(0b010101);

    /// The displacement along a lab axis.
    pub fn displacement_along(axis: usize) -> Self {
        ComponentSet(1 << (3 + axis))
    }

    /// The components of the set.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..6).filter(move |c| self.0 >> c & 1 == 1)
    }
}

impl BitOr for ComponentSet {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        ComponentSet(self.0 | other.0)
    }
}

impl BitAnd for ComponentSet {
    type Output = Self;

    fn bitand(self, other: Self) -> Self {
        ComponentSet(self.0 & other.0)
    }
}
