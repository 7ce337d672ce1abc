//! Outputs of a motion, and how far two runs on different grids are apart: the bar on the tips.

use crate::leaf::Leaf;
use crate::motion::{Energy, Physics, Snapshot, Velocity};
use crate::numbers::{larger, largest};
use crate::shape::{InterpolationWeights, interpolation_weights};
use crate::simulate::remark::Imbalance;
use glam::{DQuat, DVec3};

/// Data recorded at every output, in the units of the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputSample {
    /// Time.
    pub time: f64,
    /// Number of time steps so far.
    pub steps: usize,
    /// Energies.
    pub energy: Energy,
    /// The shared tip, or the mean of free ones.
    pub tip: DVec3,
    /// A bound on the error of the tips and of the middles of all rods at all outputs so far,
    /// where it is known.
    pub error: Option<f64>,
}

impl OutputSample {
    /// The data of a frame. Negative zeros become zeros, as in the files,
    /// so that data read back are the same.
    pub fn from_frame(frame: &Frame, joined: bool) -> Self {
        let tips = frame.tips(joined);
        OutputSample {
            time: frame.time + 0.0,
            steps: frame.steps,
            energy: frame.energy.map(|e| e + 0.0),
            tip: tips.iter().sum::<DVec3>() / tips.len() as f64 + DVec3::ZERO,
            error: frame.error,
        }
    }
}

impl Imbalance {
    /// The imbalance of the outputs of a motion, if it is more than a few per cent.
    pub(super) fn from_samples(moments: &[OutputSample], rounding: f64) -> Option<Self> {
        let start = moments.first()?.energy;
        let (mut moved, mut off) = (rounding, 0.0_f64);
        for OutputSample { energy: e, .. } in moments {
            moved = moved.max(e.exchanged_energy(start.potential));
            off = off.max((e.balance() - start.balance()).abs());
        }
        (off > LARGEST_IMBALANCE * moved).then(|| Imbalance(off / moved))
    }
}

/// Largest deviation of the energy balance, as a part of the largest energy that moved,
/// without a remark.
pub(super) const LARGEST_IMBALANCE: f64 = 0.05;

/// Energy, in units of A/L, that may be due to rounding.
pub(super) const ROUNDING: f64 = 1e-9;

/// The shape of a leaf at an instant, for pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeSnapshot {
    /// Index of its moment.
    pub moment: usize,
    /// Positions of the nodes of every rod, base to tip.
    pub curves: Vec<Vec<DVec3>>,
}

/// Number of nodes for cubic interpolation.
pub(super) const CUBIC_NODES: usize = 4;

/// A leaf at an instant, in the units of its scenario. Nodes are numbered rod
/// by rod, base to tip.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time.
    pub time: f64,
    /// Number of time steps so far.
    pub steps: usize,
    /// Number of rods.
    pub rods: usize,
    /// Positions of all nodes.
    pub positions: Vec<DVec3>,
    /// Rotations of all nodes.
    pub rotations: Vec<DQuat>,
    /// Velocities of all nodes, along the lab axes.
    pub velocities: Vec<Velocity>,
    /// Energies.
    pub energy: Energy,
    /// As of a [`OutputSample`].
    pub error: Option<f64>,
}

impl Frame {
    pub(super) fn new(leaf: &Leaf, physics: &Physics, snapshot: &Snapshot, steps: usize) -> Self {
        let (length, time, energy) = (leaf.scale.length, physics.time_unit, leaf.scale.moment());
        let velocity = |v: &Velocity| Velocity {
            angular: v.angular / time,
            linear: v.linear * (length / time),
        };
        Frame {
            time: snapshot.time * time,
            steps,
            rods: leaf.rods(),
            positions: snapshot.state.x.iter().map(|x| *x * length).collect(),
            rotations: snapshot.state.q.clone(),
            velocities: snapshot.velocity.iter().map(velocity).collect(),
            energy: snapshot.energy.map(|e| e * energy),
            error: None,
        }
    }

    /// The leaf with nodes at the fractions `to` of the length, by cubic interpolation between
    /// those at the fractions `from`.
    pub fn interpolated_to_stations(&self, from: &[f64], to: &[f64]) -> Frame {
        let weights: Vec<_> = to
            .iter()
            .map(|&at| interpolation_weights(from, at, CUBIC_NODES))
            .collect();
        let mut there = Frame {
            positions: Vec::new(),
            rotations: Vec::new(),
            velocities: Vec::new(),
            ..self.clone()
        };
        for base in (0..self.rods).map(|rod| rod * from.len()) {
            for InterpolationWeights { first, weights } in &weights {
                let near = || (base + first..).zip(weights.iter().copied());
                let sum = |of: &dyn Fn(usize) -> DVec3| near().map(|(i, w)| w * of(i)).sum();
                // Quaternions of equal rotations may differ in sign: align them.
                let side = self.rotations[base + first];
                let rotation = near().fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, (i, w)| {
                    let q = self.rotations[i];
                    sum + q * w.copysign(w * q.dot(side))
                });
                there.positions.push(sum(&|i| self.positions[i]));
                there.rotations.push(rotation.normalize());
                there.velocities.push(Velocity {
                    linear: sum(&|i| self.velocities[i].linear),
                    angular: sum(&|i| self.velocities[i].angular),
                });
            }
        }
        there
    }

    /// Nodes of a rod: positions from base to tip.
    pub fn centerline(&self, rod: usize) -> &[DVec3] {
        let nodes = self.positions.len() / self.rods;
        &self.positions[rod * nodes..(rod + 1) * nodes]
    }

    /// The centerlines of all rods.
    pub fn curves(&self) -> Vec<Vec<DVec3>> {
        (0..self.rods)
            .map(|rod| self.centerline(rod).to_vec())
            .collect()
    }

    /// The speed of the fastest tip.
    pub fn tip_speed(&self) -> f64 {
        let rods = self.velocities.chunks(self.velocities.len() / self.rods);
        let tips = rods.filter_map(|rod| rod.last());
        largest(tips.map(|tip| tip.linear.length()))
    }

    /// The shared tip alone, or one tip per rod.
    pub fn tips(&self, joined: bool) -> Vec<DVec3> {
        let ends = self.positions.chunks(self.positions.len() / self.rods);
        let tips = ends.map(|rod| rod[rod.len() - 1]);
        tips.take(if joined { 1 } else { self.rods }).collect()
    }
}

/// How the error of a run follows from its difference from another.
pub(super) struct RunComparison {
    /// The bar over the error that the order of the methods says: the difference itself where a
    /// phase is lost.
    pub safety: f64,
    /// Two runs have parted where they differ by more than this part of the largest displacement in
    /// the motion: phases differ by so many radians, or one has snapped and the other has not.
    pub parted: f64,
    /// As long as displacements since the start differ by more than that part of the largest of
    /// them so far, as those of a shared tip do while waves cross the first segments, the order of
    /// the methods is not to be seen, and this factor is in its place. (A joined leaf let go needed
    /// 8.)
    unresolved_safety: f64,
    /// Unless they differ by less than this part of the distance of the runs: that is then the distance of their starts,
    /// as of a leaf that stays at rest.
    static_part: f64,
    /// Runs that differ by less than this part of the longest rod have not parted, however little
    /// the leaf moves: they have come to rest, or vibrate with such an amplitude.
    negligible: f64,
    /// What rounding leaves of differences, relative to the longest rod.
    rounding: f64,
}

pub(super) const COMPARISON: RunComparison = RunComparison {
    safety: 3.0,
    parted: 0.2,
    unresolved_safety: 10.0,
    static_part: 1e-3,
    negligible: 1e-3,
    rounding: 1e-12,
};

/// Where the compared points are at all outputs of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Trajectory {
    points: Vec<DVec3>,
    /// Number of points at an output.
    points_per_output: usize,
    /// The steps before every output but the first.
    pub steps: Vec<OutputSteps>,
}

/// The steps of a run between two outputs.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutputSteps {
    /// The longest, in the method's unit; infinite where all steps have the same length.
    pub longest: f64,
    /// The sum of their local errors (lengths, radians); infinite where none are known.
    pub local_errors: f64,
}

impl Trajectory {
    pub fn add(&mut self, points: &[DVec3]) {
        self.points.extend_from_slice(points);
        self.points_per_output = points.len();
    }

    fn output_points(&self, output: usize) -> Option<&[DVec3]> {
        self.points
            .chunks(self.points_per_output.max(1))
            .nth(output)
    }

    /// The largest displacement from the first output.
    pub fn largest_displacement(&self) -> f64 {
        let start = self.output_points(0).unwrap_or(&[]);
        let outputs = self.points.chunks(self.points_per_output.max(1));
        outputs.fold(0.0, |most, points| {
            largest_distance(points, start).max(most)
        })
    }

    /// The largest distances so far from another run, at the outputs that both have.
    pub fn distances(&self, other: &Trajectory) -> Vec<f64> {
        let outputs =
            (0..).map_while(|output| self.output_points(output).zip(other.output_points(output)));
        let mut most = 0.0_f64;
        let distances = outputs.map(|(own, other)| {
            most = larger(most, largest_distance(own, other));
            most
        });
        distances.collect()
    }
}

pub(super) fn largest_distance(own: &[DVec3], other: &[DVec3]) -> f64 {
    largest(own.iter().zip(other).map(|(a, b)| a.distance(*b)))
}

/// The points of a leaf that are compared: the tips, and the middles of all rods, as tips may be
/// held.
pub(crate) fn compared_points(frame: &Frame, stations: &[f64], joined: bool) -> Vec<DVec3> {
    let InterpolationWeights { first, weights } = interpolation_weights(stations, 0.5, CUBIC_NODES);
    let mut points = frame.tips(joined);
    for rod in 0..frame.rods {
        let near = frame.centerline(rod)[first..].iter().zip(&weights);
        points.push(near.map(|(position, weight)| *position * *weight).sum());
    }
    points
}

/// Where the compared points are in a run on a grid of so many segments.
#[derive(Clone, Debug)]
pub(super) struct RunTrajectory {
    pub segments: usize,
    pub trajectory: Trajectory,
}

/// A run compared with others, output after output.
#[derive(Clone, Debug)]
pub(super) struct MotionComparison {
    other: Trajectory,
    /// Segments of the other run.
    pub segments: usize,
    /// The bar over the distance from the other run.
    factor: f64,
    /// Bars on what that distance does not show, where steps are not half as long as those of the other run.
    of_steps: Option<Vec<f64>>,
    /// The distance from which runs have parted.
    parting_distance: f64,
    rounding: f64,
    /// The points at the first output, and the largest displacement from there so far.
    start: Vec<DVec3>,
    displacement: f64,
    /// The bar at the last output; none from where runs have parted.
    pub error_bar: Option<f64>,
}

impl MotionComparison {
    /// Compares a run on a grid of so many segments with `other`, one on another grid, for a leaf whose
    /// longest rod has this length.
    pub fn new(segments: usize, other: RunTrajectory, length: f64) -> Self {
        let RunTrajectory {
            segments: others,
            trajectory: other,
        } = other;
        let [own, its] = [segments, others].map(|count| (count as f64).powi(-2));
        MotionComparison {
            factor: COMPARISON.safety * own / (its - own).abs(),
            segments: others,
            of_steps: None,
            parting_distance: (COMPARISON.parted * other.largest_displacement())
                .max(COMPARISON.negligible * length),
            rounding: COMPARISON.rounding * length,
            start: Vec::new(),
            displacement: 0.0,
            error_bar: Some(0.0),
            other,
        }
    }

    /// Adds the distances of the other run from one like it in steps half as long.
    pub fn with_half_steps(mut self, halved: &Trajectory) -> Self {
        let distances = self.other.distances(halved);
        let bar = |distance: f64| match distance <= self.parting_distance {
            true => 4.0 / 3.0 * COMPARISON.safety * distance,
            false => f64::INFINITY,
        };
        self.of_steps = Some(distances.into_iter().map(bar).collect());
        self
    }

    /// Adds bars on the error of the steps, which the other run does not tell.
    pub fn with_step_bars(mut self, bars: Vec<f64>) -> Self {
        self.of_steps = Some(bars);
        self
    }

    /// Compares the points of an output, behind all before it.
    pub fn compare_output(&mut self, output: usize, points: &[DVec3]) {
        let of_steps = match &self.of_steps {
            None => Some(0.0),
            Some(bars) => bars.get(output).copied().filter(|bar| bar.is_finite()),
        };
        if output == 0 {
            self.start = points.to_vec();
        }
        let displacement = largest_distance(points, &self.start);
        self.displacement = larger(self.displacement, displacement);
        let (others_start, start) = (self.other.output_points(0), &self.start);
        let there = self
            .other
            .output_points(output)
            .zip(others_start)
            .zip(of_steps);
        let there = there.zip(self.error_bar);
        self.error_bar = there.and_then(|(((other, others_start), of_steps), before)| {
            let distance = largest_distance(points, other);
            let moves = points.iter().zip(other).zip(start.iter().zip(others_start));
            let moves = moves.map(|((a, b), (a0, b0))| ((*a - *a0) - (*b - *b0)).length());
            let of_moves = largest(moves);
            let least = COMPARISON.static_part * distance;
            let factor = match of_moves <= least.max(COMPARISON.parted * self.displacement) {
                true => self.factor,
                false => COMPARISON.unresolved_safety * self.factor,
            };
            let bar = factor * distance + of_steps + self.rounding;
            (distance <= self.parting_distance).then(|| bar.max(before))
        });
    }
}
