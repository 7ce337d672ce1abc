//! How accurate a motion is: its tips, and the middles of its veins, compared at every output with
//! those of a run on another grid in other steps.
//!
//! Both methods are of second order in space and time. With the length h of segments, and steps in
//! proportion to it, the error of a run is C h^2, and the difference of two runs tells C
//! (Richardson). Differences grow in time, mostly as phases do; but they vanish at the turning
//! points of a vibration, so that the bar at an output is the largest so far. A component whose
//! phase the coarser run has lost altogether is wrong in it by up to twice its amplitude, and no
//! more in the finer run: [`SAFETY`] lets the bar be the difference itself.

use super::Frame;
use crate::largest::{larger, largest};
use crate::shape::weights;
use glam::DVec3;

/// The bar over the error that the order of the methods says.
const SAFETY: f64 = 3.0;

/// Two runs have parted where they differ by more than this part of the largest displacement in
/// the motion: phases differ by so many radians, or one has snapped and the other has not.
const PARTED: f64 = 0.2;

/// As long as displacements since the start differ by more than that part of the largest of them
/// so far, as those of a shared tip do while waves cross the first segments, the order of the
/// methods is not to be seen, and this factor is in its place. (A joined
/// leaf let go needed 8.)
const UNRESOLVED: f64 = 10.0;

/// Runs that differ by less than this part of the longest rod have not parted, however little the
/// leaf moves: they have come to rest, or vibrate with such an amplitude.
const CLOSE: f64 = 1e-3;

/// What rounding leaves of differences, relative to the longest rod.
const ROUNDING: f64 = 1e-12;

/// Number of nodes for cubic interpolation.
const CUBIC: usize = 4;

/// Where the compared points are at all outputs of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Trajectory {
    points: Vec<DVec3>,
    /// Number of points at an output.
    each: usize,
    /// The longest step before every output but the first, in the method's unit; infinite where
    /// all steps have the same length.
    pub longest_steps: Vec<f64>,
}

impl Trajectory {
    pub fn add(&mut self, points: &[DVec3]) {
        self.points.extend_from_slice(points);
        self.each = points.len();
    }

    fn at(&self, output: usize) -> Option<&[DVec3]> {
        self.points.chunks(self.each.max(1)).nth(output)
    }

    /// The largest displacement from the first output.
    fn span(&self) -> f64 {
        let start = self.at(0).unwrap_or(&[]);
        let outputs = self.points.chunks(self.each.max(1));
        outputs.fold(0.0, |most, points| {
            largest_distance(points, start).max(most)
        })
    }

    /// The largest distances so far from another run, at the outputs that both have.
    pub fn distances(&self, other: &Trajectory) -> Vec<f64> {
        let outputs = (0..).map_while(|output| self.at(output).zip(other.at(output)));
        let mut most = 0.0_f64;
        let distances = outputs.map(|(own, other)| {
            most = larger(most, largest_distance(own, other));
            most
        });
        distances.collect()
    }
}

fn largest_distance(own: &[DVec3], other: &[DVec3]) -> f64 {
    largest(own.iter().zip(other).map(|(a, b)| a.distance(*b)))
}

/// The points of a leaf that are compared: the tips, and the middles of all rods, as tips may be
/// held.
pub(super) fn compared_points(frame: &Frame, stations: &[f64], joined: bool) -> Vec<DVec3> {
    let (first, weights) = weights(stations, 0.5, CUBIC);
    let mut points = frame.tips(joined);
    for rod in 0..frame.rods {
        let near = frame.centerline(rod)[first..].iter().zip(&weights);
        points.push(near.map(|(position, weight)| *position * *weight).sum());
    }
    points
}

/// A run compared with others, output after output.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    other: Trajectory,
    /// Segments of the other run.
    pub segments: usize,
    /// The bar over the distance from the other run.
    factor: f64,
    /// Bars on what that distance does not show, where both runs have the same steps.
    of_steps: Option<Vec<f64>>,
    /// The distance from which runs have parted.
    parted: f64,
    rounding: f64,
    /// The points at the first output, and the largest displacement from there so far.
    start: Vec<DVec3>,
    displacement: f64,
    /// The bar at the last output; none from where runs have parted.
    pub bar: Option<f64>,
}

impl Comparison {
    /// Of a run on a grid of so many segments with `other`, one on another grid, for a leaf whose
    /// longest rod has this length.
    pub fn new(segments: usize, other: (usize, Trajectory), length: f64) -> Self {
        let (others, other) = other;
        let [own, its] = [segments, others].map(|count| (count as f64).powi(-2));
        Comparison {
            factor: SAFETY * own / (its - own).abs(),
            segments: others,
            of_steps: None,
            parted: (PARTED * other.span()).max(CLOSE * length),
            rounding: ROUNDING * length,
            start: Vec::new(),
            displacement: 0.0,
            bar: Some(0.0),
            other,
        }
    }

    /// With the distances of the other run from one like it in steps half as long.
    pub fn with_half_steps(mut self, halved: &Trajectory) -> Self {
        let distances = self.other.distances(halved);
        let bar = |distance: f64| match distance <= self.parted {
            true => 4.0 / 3.0 * SAFETY * distance,
            false => f64::INFINITY,
        };
        self.of_steps = Some(distances.into_iter().map(bar).collect());
        self
    }

    /// Compares the points of an output, behind all before it.
    pub fn compare(&mut self, output: usize, points: &[DVec3]) {
        let of_steps = match &self.of_steps {
            None => Some(0.0),
            Some(bars) => bars.get(output).copied().filter(|bar| bar.is_finite()),
        };
        if output == 0 {
            self.start = points.to_vec();
        }
        let displacement = largest_distance(points, &self.start);
        self.displacement = larger(self.displacement, displacement);
        let (others_start, start) = (self.other.at(0), &self.start);
        let there = self.other.at(output).zip(others_start).zip(of_steps);
        let there = there.zip(self.bar);
        self.bar = there.and_then(|(((other, others_start), of_steps), before)| {
            let distance = largest_distance(points, other);
            let moves = points.iter().zip(other).zip(start.iter().zip(others_start));
            let moves = moves.map(|((a, b), (a0, b0))| ((*a - *a0) - (*b - *b0)).length());
            let of_moves = largest(moves);
            let factor = match of_moves <= PARTED * self.displacement {
                true => self.factor,
                false => UNRESOLVED * self.factor,
            };
            let bar = factor * distance + of_steps + self.rounding;
            (distance <= self.parted).then(|| bar.max(before))
        });
    }
}
