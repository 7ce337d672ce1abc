//! The state of rods at stations along them, which every method returns, and measures of its
//! undulation: the waves of each vein out of the leaf's surface, the twist of its section, and the waves
//! predicted by linear theory.
//!
//! **Waves.** A vein has waves where it bends out of the surface alternately to both
//! sides. Its normal curvature is the component of its curvature along the normal of the
//! leaf, which is perpendicular to its tangent and to the line between the margins at equal
//! fractions of the length (for a single vein, to its own director d2 in place of that
//! line). The plane curve with this curvature is cut at its inflections: a part between two
//! of them is a half-wave, and its height above their chord is its amplitude. So nothing has
//! to be fitted, a vein that only droops is one half-wave, and the numbers depend neither on
//! the position of the leaf nor on the order of its veins. Half-waves lower than
//! [`LEAST_HEIGHT`] lengths, or than four error estimates, do not count: they are joined
//! with their neighbors.
//!
//! These numbers jump where an inflection appears, vanishes, or slides along a straight part. Two others do not:
//! the **height** is half of the distance of the plane curve from the nearest one that bends to one side only, which
//! is its convex or its concave envelope, and **weighted waves** count inflections by the turns between them. Along a
//! sweep of a parameter both are continuous. For two and more equal waves the height is the amplitude.
//!
//! **Chirality.** The twist is the integral of u1 from base to tip, in radians, including
//! the rest twist. It is positive where d2 turns about d1 like a right-handed screw seen
//! from the base.
//!
//! **Linear theory** (section 5.1 of the paper). Under a mean axial force T the
//! lateral displacement obeys, with eqs (12) and (13),
//!
//! ```text
//! A2 Z'''' = f3 + T Z''
//! ```
//!
//! and oscillates with the wavenumber sqrt(-T/A2) if T is compressive, which
//! makes sqrt(-T/A2) L/pi half-waves along the vein.

use crate::numbers::larger;
use crate::rotation::{self, Pose};
use crate::scenario::Scenario;
use glam::{DQuat, DVec2, DVec3};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::f64::consts::PI;
use std::iter;

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

impl NodeState {
    /// The mirror image in the plane z = 0, whose directors d1 and d2 are those of the image, and d3 opposite.
    pub(crate) fn mirrored_in_base_plane(&self) -> NodeState {
        let polar = |a: DVec3| DVec3::new(a.x, a.y, -a.z);
        let axial = |a: DVec3| DVec3::new(-a.x, -a.y, a.z);
        let DQuat { x, y, z, w } = self.rotation;
        NodeState {
            position: polar(self.position),
            rotation: DQuat::from_xyzw(-x, -y, z, w),
            v: polar(self.v),
            u: axial(self.u),
            n: polar(self.n),
            m: axial(self.m),
        }
    }
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
pub(crate) const STATION_TOLERANCE: f64 = 1e-14;

/// Stations that divide the length into `parts` equal parts.
pub fn equally_spaced(parts: usize) -> Vec<f64> {
    (0..=parts).map(|i| i as f64 / parts as f64).collect()
}

/// Interpolation by a polynomial through neighboring nodes.
#[derive(Clone, Debug)]
pub struct InterpolationWeights {
    /// Index of the first of the nodes.
    pub first: usize,
    /// Weights of the nodes from the first on.
    pub weights: Vec<f64>,
}

impl InterpolationWeights {
    /// The interpolated value of what nodes have.
    pub fn weighted_sum(&self, nodes: &[NodeState], of: impl Fn(&NodeState) -> DVec3) -> DVec3 {
        let near = nodes[self.first..].iter().zip(&self.weights);
        near.map(|(node, weight)| *weight * of(node)).sum()
    }

    /// The interpolated rotation of the directors.
    pub fn rotation(&self, nodes: &[NodeState]) -> DQuat {
        let near = nodes[self.first..].iter().zip(&self.weights);
        rotation::interpolated_rotation(near.map(|(node, weight)| (node.rotation, *weight)))
    }
}

/// Interpolation at `at` by the polynomial through `count` neighboring `nodes`.
pub fn interpolation_weights(nodes: &[f64], at: f64, count: usize) -> InterpolationWeights {
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
    InterpolationWeights {
        first,
        weights: (0..count).map(weight).collect(),
    }
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

/// Smallest height of a half-wave that counts, in lengths of the longest rod.
pub const LEAST_HEIGHT: f64 = 1e-3;

/// Smallest height of a half-wave that counts, in error estimates: it is a difference of three
/// positions.
const HEIGHT_ERROR_MULTIPLE: f64 = 4.0;

/// Sine of the angle between a vein and the line between the margins below which the
/// margins coincide.
const COINCIDENT_MARGINS_SINE: f64 = 1e-6;

/// Smaller turns at a node, in radians, are rounding: not even thousands of them make a
/// half-wave that counts.
const TURN_ROUNDING: f64 = 1e-10;

/// Smaller mean twists, in radians, have no handedness.
const LEAST_TWIST: f64 = 1e-3;

/// The handedness of the mean twist from base to tip; in lower case in `summary.json`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Handedness {
    /// Right-handed: the mean twist is positive.
    Right,
    /// Left-handed: the mean twist is negative.
    Left,
    /// No twist, or as much right-handed as left-handed.
    None,
}

/// The undulation of one vein.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VeinUndulation {
    /// Half-waves along it: alternating extrema.
    pub half_waves: usize,
    /// Largest half of a height from crest to trough, in units of length; 0
    /// without waves.
    pub amplitude: f64,
    /// How far the vein is from one that bends to one side only, in units of length: half of the largest distance
    /// of its profile from the convex or the concave envelope, whichever is nearer. Continuous in the shape, and
    /// for two or more equal waves the amplitude; an S of one wave has 0.68 of it.
    pub height: f64,
    /// Number of waves, continuous in the shape: half of one more than the effective number of inflections,
    /// weighted by the turns that vanish with them. For equal waves their number; 0 without waves.
    pub weighted_waves: f64,
    /// Mean distance along the vein between one crest and the next, in units
    /// of length; `None` without waves.
    pub wavelength: Option<f64>,
    /// Twist of the section from base to tip, in radians.
    pub twist: f64,
    /// Mean axial force T; negative: compression.
    pub tension: f64,
    /// |T| L^2/A2, dimensionless, with the mean A2, times the mean growth of the rest
    /// length.
    pub load_number: f64,
}

impl VeinUndulation {
    /// Number of waves, a multiple of 1/2; a single half-wave does not count.
    pub fn waves(&self) -> f64 {
        match self.half_waves {
            0 | 1 => 0.0,
            count => 0.5 * count as f64,
        }
    }

    /// Waves by linear theory: half of sqrt(|T|/A2) L/pi if T is compressive,
    /// none in tension.
    pub fn predicted_waves(&self) -> f64 {
        match self.tension < 0.0 {
            true => 0.5 * self.load_number.sqrt() / PI,
            false => 0.0,
        }
    }
}

impl Serialize for VeinUndulation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map([
            ("waves", Some(self.waves())),
            ("amplitude", Some(self.amplitude)),
            ("height", Some(self.height)),
            ("weighted_waves", Some(self.weighted_waves)),
            ("wavelength", self.wavelength),
            ("twist", Some(self.twist)),
            ("tension", Some(self.tension)),
            ("load_number", Some(self.load_number)),
            ("predicted_waves", Some(self.predicted_waves())),
        ])
    }
}

/// The undulation of all veins, from one edge of the leaf to the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Undulation {
    /// One entry per vein.
    pub veins: Vec<VeinUndulation>,
}

/// The margin with more waves, or higher ones, in JSON.
struct SerializedMargin<'a>(&'a VeinUndulation);

impl Serialize for SerializedMargin<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let SerializedMargin(vein) = self;
        serializer.collect_map([
            ("waves", Some(vein.waves())),
            ("amplitude", Some(vein.amplitude)),
            ("height", Some(vein.height)),
            ("weighted_waves", Some(vein.weighted_waves)),
            ("wavelength", vein.wavelength),
            ("predicted_waves", Some(vein.predicted_waves())),
        ])
    }
}

impl Serialize for Undulation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Undulation", 4)?;
        object.serialize_field("handedness", &self.hand())?;
        object.serialize_field("twist", &self.twist())?;
        object.serialize_field("margins", &self.margin().map(SerializedMargin))?;
        object.serialize_field("veins", &self.veins)?;
        object.end()
    }
}

/// A centerline with the directors along it, base to tip.
pub type Centerline = Vec<Pose>;

impl Undulation {
    /// The undulation of a leaf at rest: waves and twist from its `lines`, one per rod with
    /// nodes at the same fractions of the length; forces from its `rods` at the `stations`.
    /// `error` bounds the error of positions, if known.
    pub fn from_centerlines(
        scenario: &Scenario,
        lines: &[Centerline],
        stations: &[f64],
        rods: &[RodShape],
        error: Option<f64>,
    ) -> Self {
        let longest = rods.iter().map(|rod| rod.length).fold(0.0, f64::max);
        let least = (LEAST_HEIGHT * longest).max(HEIGHT_ERROR_MULTIPLE * error.unwrap_or(0.0));
        let veins = (0..lines.len().min(rods.len()))
            .map(|j| {
                let curve = DevelopedCurve::from_vein(lines, j);
                let half_waves = half_waves(&curve, least);
                let height = curve.height();
                let material = &scenario.rods[j];
                // Forces act on the longer arms of a vein that has grown.
                let grown = material.rest_stretch.integral(1.0);
                let tension = mean(stations, rods[j].nodes.iter().map(|node| node.n.x));
                let bending = material.couple_stiffness[1].integral(1.0);
                VeinUndulation {
                    amplitude: amplitude(&half_waves),
                    wavelength: wavelength(&half_waves),
                    half_waves: half_waves.len(),
                    height,
                    weighted_waves: curve.weighted_waves(height / least),
                    twist: twist(&lines[j]),
                    tension,
                    load_number: tension.abs() * grown * material.length.powi(2) / bending,
                }
            })
            .collect();
        Undulation { veins }
    }

    /// The undulation of a leaf at rest whose shape is known only at the stations.
    pub fn at_stations(
        scenario: &Scenario,
        stations: &[f64],
        rods: &[RodShape],
        error: Option<f64>,
    ) -> Self {
        let line = |rod: &RodShape| -> Centerline {
            let pose = |node: &NodeState| Pose {
                position: node.position,
                rotation: node.rotation,
            };
            rod.nodes.iter().map(pose).collect()
        };
        let lines: Vec<Centerline> = rods.iter().map(line).collect();
        Undulation::from_centerlines(scenario, &lines, stations, rods, error)
    }

    /// The first and the last vein, which are the same in a leaf of one vein.
    pub fn margins(&self) -> Option<[&VeinUndulation; 2]> {
        Some([self.veins.first()?, self.veins.last()?])
    }

    /// The margin that has more waves, or higher ones.
    pub fn margin(&self) -> Option<&VeinUndulation> {
        let [first, last] = self.margins()?;
        let more = last.half_waves.cmp(&first.half_waves);
        match more.then(last.amplitude.total_cmp(&first.amplitude)) {
            std::cmp::Ordering::Greater => Some(last),
            _ => Some(first),
        }
    }

    /// How far the margins are from bending to one side only, in units of length: the larger
    /// [`height`](VeinUndulation::height) of both, continuous in the shape.
    pub fn height(&self) -> f64 {
        let heights = self.margins().into_iter().flatten();
        heights.map(|vein| vein.height).fold(0.0, f64::max)
    }

    /// Mean twist of all veins from base to tip, in radians.
    pub fn twist(&self) -> f64 {
        let sum: f64 = self.veins.iter().map(|vein| vein.twist).sum();
        sum / self.veins.len().max(1) as f64
    }

    /// The handedness of the twist.
    pub fn hand(&self) -> Handedness {
        match self.twist() {
            twist if twist > LEAST_TWIST => Handedness::Right,
            twist if twist < -LEAST_TWIST => Handedness::Left,
            _ => Handedness::None,
        }
    }
}

/// Trapezoidal mean over the length.
fn mean(stations: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let mean = |(s, v): (&[f64], &[f64])| 0.5 * (s[1] - s[0]) * (v[0] + v[1]);
    stations.windows(2).zip(values.windows(2)).map(mean).sum()
}

/// The integral of u1: the twists of all segments.
fn twist(line: &Centerline) -> f64 {
    let turn = |ends: &[Pose]| ends[0].rotation.conjugate() * ends[1].rotation;
    line.windows(2)
        .map(|ends| rotation::log(turn(ends)).x)
        .sum()
}

/// A half-wave between two inflections.
#[derive(Clone, Copy, Debug)]
struct HalfWave {
    /// Ends of the half-wave: indices of nodes plus fractions of the segments after them.
    ends: [f64; 2],
    /// Height of its extremum over the chord.
    height: f64,
    /// Arc length up to the extremum.
    arc_length: f64,
}

/// A vein developed into a plane by its normal curvature alone: its bending within the
/// surface is left out.
struct DevelopedCurve {
    /// Turn out of the surface at each inner node, in radians.
    turns: Vec<f64>,
    points: Vec<DVec2>,
    /// Arc length of the polyline up to each node.
    arc_lengths: Vec<f64>,
}

impl DevelopedCurve {
    /// The curve of vein `j`.
    fn from_vein(lines: &[Centerline], j: usize) -> Self {
        let line = &lines[j];
        let steps: Vec<DVec3> = (line.windows(2))
            .map(|ends| ends[1].position - ends[0].position)
            .collect();
        let (mut turns, mut last) = (Vec::new(), None);
        for (i, pair) in steps.windows(2).enumerate() {
            let [from, to] = [pair[0], pair[1]].map(DVec3::normalize_or_zero);
            let tangent = (from + to).normalize_or_zero();
            let [first, last_vein] = [0, lines.len() - 1].map(|j| lines[j][i + 1].position);
            let across = last_vein - first;
            let mut normal = tangent.cross(across.normalize_or_zero());
            // Where the margins meet, the section defines the surface.
            if normal.length() < COINCIDENT_MARGINS_SINE {
                normal = tangent.cross(line[i + 1].rotation * DVec3::Y);
            }
            normal = normal.normalize_or_zero();
            // Where the margins cross they change sides, but the normal must not.
            if last.is_some_and(|last: DVec3| last.dot(normal) < 0.0) {
                normal = -normal;
            }
            last = Some(normal);
            turns.push((to - from).dot(normal).clamp(-1.0, 1.0).asin());
        }
        let (mut points, mut along, mut angle) = (vec![DVec2::ZERO], vec![0.0], 0.0);
        for (i, step) in steps.iter().enumerate() {
            let (length, k) = (step.length(), points.len() - 1);
            points.push(points[k] + length * DVec2::from_angle(angle));
            along.push(along[k] + length);
            angle += turns.get(i).copied().unwrap_or(0.0);
        }
        DevelopedCurve {
            turns,
            points,
            arc_lengths: along,
        }
    }

    /// The point a fraction of a segment beyond a node.
    fn point(&self, at: f64) -> DVec2 {
        let i = (at as usize).min(self.points.len() - 2);
        self.points[i].lerp(self.points[i + 1], at - i as f64)
    }

    /// Where the normal curvature changes sign: between the last node with one sign and
    /// the first with the other.
    fn inflections(&self) -> Vec<f64> {
        let mut found = Vec::new();
        let mut last: Option<(usize, f64)> = None;
        let turns = self.turns.iter().enumerate();
        for (i, &turn) in turns.filter(|(_, turn)| turn.abs() > TURN_ROUNDING) {
            if let Some((k, before)) = last.filter(|(_, before)| before * turn < 0.0) {
                let part = before / (before - turn);
                found.push((k + 1) as f64 + part * (i - k) as f64);
            }
            last = Some((i, turn));
        }
        found
    }

    /// Half of the distance from the nearest profile that bends to one side only: over the arc length stands the
    /// integral of the angle, so that a rotation adds a straight line, which changes no distance.
    fn height(&self) -> f64 {
        let mut at = DVec2::ZERO;
        let mut profile = vec![at];
        let lengths = self.arc_lengths.windows(2).map(|ends| ends[1] - ends[0]);
        for (length, angle) in lengths.zip(segment_angles(&self.turns)) {
            // Nodes that coincide are one.
            if length > 0.0 {
                at += length * DVec2::new(1.0, angle);
                profile.push(at);
            }
        }
        let mirrored: Vec<DVec2> = profile.iter().map(|it| DVec2::new(it.x, -it.y)).collect();
        0.5 * distance_from_convex(&profile).min(distance_from_convex(&mirrored))
    }

    /// The number of waves, weighted. Below the least height, of which `height` is a multiple, it vanishes in
    /// proportion.
    fn weighted_waves(&self, height: f64) -> f64 {
        let turns = inflection_turns(&segment_angles(&self.turns));
        let sum: f64 = turns.iter().sum();
        let squares: f64 = turns.iter().map(|turn| turn * turn).sum();
        match squares > 0.0 {
            true => 0.5 * (1.0 + sum * sum / squares) * height.min(1.0),
            false => 0.0,
        }
    }

    fn half_wave(&self, ends: [f64; 2]) -> HalfWave {
        let [from, to] = ends.map(|end| self.point(end));
        let chord = (to - from).normalize_or_zero();
        let first = ends[0].ceil() as usize;
        let (mut height, mut place) = (0.0, self.arc_lengths[first]);
        for i in first..=ends[1].floor() as usize {
            let off = chord.perp_dot(self.points[i] - from).abs();
            if off > height {
                (height, place) = (off, self.arc_lengths[i]);
            }
        }
        HalfWave {
            ends,
            height,
            arc_length: place,
        }
    }
}

/// The turn from one node to the next, added up: the angle of every segment to the first, in radians.
fn segment_angles(turns: &[f64]) -> Vec<f64> {
    let sums = turns.iter().scan(0.0, |angle, turn| {
        *angle += turn;
        Some(*angle)
    });
    iter::once(0.0).chain(sums).collect()
}

/// Points of a profile on its convex envelope from below (G. Andrew, Inf. Process. Lett. 9, 1979, 216).
fn convex_envelope(profile: &[DVec2]) -> Vec<DVec2> {
    let mut envelope: Vec<DVec2> = Vec::new();
    for &point in profile {
        while let [.., before, last] = envelope[..] {
            if (last - before).perp_dot(point - last) > 0.0 {
                break;
            }
            envelope.pop();
        }
        envelope.push(point);
    }
    envelope
}

/// The largest distance of a profile over its convex envelope, along its second coordinate.
fn distance_from_convex(profile: &[DVec2]) -> f64 {
    let envelope = convex_envelope(profile);
    let mut piece = 0;
    let mut largest: f64 = 0.0;
    for point in profile {
        while piece + 2 < envelope.len() && envelope[piece + 1].x <= point.x {
            piece += 1;
        }
        if let [from, to, ..] = envelope[piece..] {
            let slope = (to.y - from.y) / (to.x - from.x);
            largest = largest.max(point.y - from.y - slope * (point.x - from.x));
        }
    }
    largest
}

/// The turns that vanish with each inflection, radians, where the smallest turn between two inflections, or between
/// one and an end, is removed first: their persistence (H. Edelsbrunner, D. Letscher and A. Zomorodian, Discrete
/// Comput. Geom. 28, 2002, 511), which is continuous in the angles.
fn inflection_turns(angles: &[f64]) -> Vec<f64> {
    // Turns to one side, one after the other.
    let mut bends: Vec<f64> = Vec::new();
    for pair in angles.windows(2) {
        let turn = pair[1] - pair[0];
        match bends.last_mut() {
            Some(bend) if *bend * turn >= 0.0 => *bend += turn,
            _ => bends.push(turn),
        }
    }
    let mut vanished = Vec::with_capacity(bends.len());
    while bends.len() > 1 {
        let smallest = (0..bends.len()).min_by(|&a, &b| bends[a].abs().total_cmp(&bends[b].abs()));
        let Some(k) = smallest else { break };
        let turn = bends[k].abs();
        if k == 0 || k + 1 == bends.len() {
            vanished.push(turn);
            bends.remove(k);
        } else {
            // Both its inflections vanish, and what is beside it becomes one bend.
            vanished.extend([turn; 2]);
            let joined = bends[k - 1] + bends[k] + bends[k + 1];
            bends.splice(k - 1..=k + 1, [joined]);
        }
    }
    vanished
}

/// The half-waves of a curve with at least this height.
fn half_waves(curve: &DevelopedCurve, least: f64) -> Vec<HalfWave> {
    if curve.points.len() < 4 {
        return Vec::new();
    }
    let mut ends = vec![0.0];
    ends.extend(curve.inflections());
    ends.push((curve.points.len() - 1) as f64);
    let mut waves: Vec<HalfWave> = (ends.windows(2))
        .map(|pair| curve.half_wave([pair[0], pair[1]]))
        .collect();
    // The lowest is removed first; its neighbors bend to the same side and are joined.
    while let Some(low) = (0..waves.len())
        .filter(|&i| waves[i].height < least)
        .min_by(|&a, &b| waves[a].height.total_cmp(&waves[b].height))
    {
        if waves.len() == 1 {
            return Vec::new();
        }
        let (first, last) = (low.saturating_sub(1), (low + 1).min(waves.len() - 1));
        let joined = curve.half_wave([waves[first].ends[0], waves[last].ends[1]]);
        waves.splice(first..=last, [joined]);
    }
    waves
}

fn amplitude(waves: &[HalfWave]) -> f64 {
    let halves = waves
        .windows(2)
        .map(|pair| 0.5 * (pair[0].height + pair[1].height));
    halves.fold(0.0, f64::max)
}

fn wavelength(waves: &[HalfWave]) -> Option<f64> {
    match waves {
        [] | [_] => None,
        [first, .., last] => {
            Some(2.0 * (last.arc_length - first.arc_length) / (waves.len() - 1) as f64)
        }
    }
}

crate::renamed! {
    Hand => Handedness,
    Vein => VeinUndulation,
}
