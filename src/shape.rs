//! The state of rods at stations along them, which every method returns.

use crate::largest::larger;
use glam::{DQuat, DVec3};
use serde::{Serialize, Serializer};

/// The state of one rod at one station. Strains and stress resultants are
/// components along the directors (d1, d2, d3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeState {
    /// Centerline r.
    pub position: DVec3,
    /// Directors as a unit quaternion, w >= 0 at the base: R e_i = d_i.
    pub rotation: DQuat,
    /// Stretch and shears v = R^T r'.
    pub v: DVec3,
    /// Twist and bends u.
    pub u: DVec3,
    /// Stress resultant n (axial force, shear forces).
    pub n: DVec3,
    /// Stress couple m (twisting moment, bending moments).
    pub m: DVec3,
}

/// The shape of one rod.
#[derive(Clone, Debug, PartialEq)]
pub struct RodShape {
    /// Reference length.
    pub length: f64,
    /// One state per station.
    pub nodes: Vec<NodeState>,
}

/// Largest differences between two shapes at common stations, in the units of
/// the scenario (rotations in radians).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Difference {
    /// Distance of positions.
    pub position: f64,
    /// Angle between the directors.
    pub rotation: f64,
    /// Difference of n, along the directors.
    pub force: f64,
    /// Difference of m, along the directors.
    pub moment: f64,
}

impl Difference {
    /// The differences of two shapes at the same stations.
    pub fn between(a: &[RodShape], b: &[RodShape]) -> Self {
        let rods = a.iter().zip(b);
        rods.flat_map(|(a, b)| a.nodes.iter().zip(&b.nodes))
            .map(|(a, b)| Difference::of(a, b))
            .fold(Difference::default(), Difference::max)
    }

    /// The differences of two states.
    pub fn of(a: &NodeState, b: &NodeState) -> Self {
        let turn = a.rotation * b.rotation.conjugate();
        let half = DVec3::new(turn.x, turn.y, turn.z).length();
        Difference {
            position: (a.position - b.position).length(),
            rotation: 2.0 * half.atan2(turn.w.abs()),
            force: (a.n - b.n).length(),
            moment: (a.m - b.m).length(),
        }
    }

    /// The larger of each component; NaN counts as infinite.
    pub fn max(self, other: Difference) -> Self {
        Difference {
            position: larger(self.position, other.position),
            rotation: larger(self.rotation, other.rotation),
            force: larger(self.force, other.force),
            moment: larger(self.moment, other.moment),
        }
    }
}

/// Stations (fractions of a vein's length) that are closer than this are one.
pub(crate) const SAME_STATION: f64 = 1e-14;

/// Stations that divide the length into `parts` equal parts.
pub fn equally_spaced(parts: usize) -> Vec<f64> {
    (0..=parts).map(|i| i as f64 / parts as f64).collect()
}

/// Interpolation at `at` by the polynomial through `count` neighbouring `nodes`: the index
/// of the first of them, and their weights.
pub fn weights(nodes: &[f64], at: f64, count: usize) -> (usize, Vec<f64>) {
    let count = count.min(nodes.len());
    let right = nodes.partition_point(|node| *node < at);
    let first = right
        .saturating_sub(count.div_ceil(2))
        .min(nodes.len() - count);
    let near = &nodes[first..first + count];
    let weight = |i: usize| -> f64 {
        let others = (0..count).filter(|&j| j != i);
        others
            .map(|j| (at - near[j]) / (near[i] - near[j]))
            .product()
    };
    (first, (0..count).map(weight).collect())
}

/// Serializes tips as the key `tip`, which is null if there are several; these follow as
/// the key `tips`.
pub fn serialize_tips<S: Serializer>(tips: &[DVec3], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Keys<'a> {
        tip: Option<&'a DVec3>,
        #[serde(skip_serializing_if = "Option::is_none")]
        tips: Option<&'a [DVec3]>,
    }
    let (tip, tips) = match tips {
        [] => (None, None),
        [only] => (Some(only), None),
        several => (None, Some(several)),
    };
    Keys { tip, tips }.serialize(serializer)
}

/// Serializes the positions at all stations, a list per rod.
pub fn serialize_positions<S: Serializer>(
    rods: &[RodShape],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let positions =
        |rod: &RodShape| -> Vec<DVec3> { rod.nodes.iter().map(|node| node.position).collect() };
    serializer.collect_seq(rods.iter().map(positions))
}
