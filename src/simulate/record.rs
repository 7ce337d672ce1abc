//! A leaf at an instant, the record of a simulation that has ended, and which outputs are chosen for a few
//! pictures or a film.

use crate::motion::{Energy, StableStep};
use crate::numbers::{larger, largest};
use crate::scenario;
use crate::scenario::MotionStart;
use crate::shape::serialize_tips;
use crate::simulate::comparison::{OutputSample, ROUNDING, ShapeSnapshot};
use crate::simulate::remark::{Imbalance, MotionDoubt, MotionRemark};
use crate::simulate::request::Scheme;
use crate::simulate::{SchemeChoice, Simulation, Stopped};
use glam::DVec3;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// A simulation that has ended: its outcome and its outputs. In the units of
/// the scenario. As JSON it is `motion.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    /// Name of the scenario.
    pub scenario: String,
    /// The method.
    #[serde(rename = "method")]
    pub scheme: Scheme,
    /// Why it ended early, if it did.
    #[serde(flatten, serialize_with = "serialize_outcome")]
    pub stopped: Option<Stopped>,
    /// How far the energy balance of a completed motion is off, if it is by more than a few
    /// per cent.
    #[serde(rename = "remark", skip_serializing_if = "Option::is_none")]
    pub imbalance: Option<Imbalance>,
    /// What makes it doubtful.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<MotionDoubt>,
    /// Why it has this method.
    pub choice: SchemeChoice,
    /// What the motion starts from; `None`: a shape that was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<MotionStart>,
    /// Number of rods.
    pub rods: usize,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// The longest rod.
    #[serde(skip)]
    pub length: f64,
    /// Segments a rod.
    pub segments: usize,
    /// Permitted local error of a step of the semi-implicit method.
    pub tolerance: f64,
    /// External damping per length, if the scenario gives none: critical for the lowest mode of a clamped vein.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed_damping: Option<f64>,
    /// The requested duration.
    pub duration: f64,
    /// The time of the last output.
    pub time: f64,
    /// A bound on the error of the tips and of the middles of all rods at all outputs, from a
    /// comparison with another run; `None` if that cannot tell it up to the end.
    pub error_estimate: Option<f64>,
    /// The time of the last output whose error is known.
    pub error_known_until: Option<f64>,
    /// The error that was aimed at, if one was.
    pub error_aim: Option<f64>,
    /// Segments of the run that this one was compared with.
    #[serde(skip)]
    pub compared_segments: Option<usize>,
    /// The longest time step, unless the error determined it.
    pub time_step: Option<f64>,
    /// The longest stable time step of the explicit method.
    pub stable_step: Option<StableStep>,
    /// Number of time steps.
    pub steps: usize,
    /// The masses that have landed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub landings: Vec<LandingRecord>,
    /// All outputs; the first at time 0.
    #[serde(flatten, serialize_with = "serialize_moments")]
    pub moments: Vec<OutputSample>,
    /// The shared tip at the last output, or the tips of all rods.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// The speed of the fastest tip at the last output.
    pub tip_speed: f64,
    /// Fractions of the length at which these shapes have nodes.
    #[serde(skip)]
    pub stations: Vec<f64>,
    /// Shapes at some of the outputs, the last among them.
    #[serde(skip)]
    pub stills: Vec<ShapeSnapshot>,
    /// Shapes at many outputs, for films, if requested.
    #[serde(skip)]
    pub film: Vec<ShapeSnapshot>,
    /// Wall-clock time of the motion alone.
    pub wall_seconds: f64,
}

/// A mass that has landed on a point, in the units of the scenario.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LandingRecord {
    /// The point, from 1.
    pub point: usize,
    /// The vein, from 1.
    pub vein: usize,
    /// The fraction of its length.
    pub at: f64,
    /// When the mass landed.
    pub time: f64,
    /// The kinetic energy that the mass brought.
    pub kinetic_energy: f64,
    /// The energy that was lost, which is part of the dissipated energy: that of the mass and the node on which it
    /// landed less that of both with one velocity. It vanishes with the length of the segments.
    pub lost_energy: f64,
}

impl Record {
    /// The record of a simulation with these outputs so far.
    pub fn new(
        simulation: &Simulation,
        stopped: Option<Stopped>,
        moments: Vec<OutputSample>,
        stills: Vec<ShapeSnapshot>,
    ) -> Self {
        let scenario = simulation.leaf().scenario();
        let last = stills.last().map_or(&[][..], |still| &still.curves);
        let tips = last.iter().filter_map(|curve| curve.last().copied());
        Record {
            scenario: scenario.name.clone(),
            scheme: simulation.scheme(),
            stopped,
            imbalance: match stopped {
                None => Imbalance::from_samples(&moments, ROUNDING * scenario.scale().moment()),
                Some(_) => None,
            },
            doubts: simulation.doubts().to_vec(),
            choice: simulation.choice(),
            start: simulation.start(),
            rods: scenario.rods.len(),
            joined: scenario.joined,
            length: scenario::longest(&scenario.rods),
            segments: simulation.segments(),
            tolerance: simulation.tolerance(),
            assumed_damping: (scenario.dynamics.assumes_damping)
                .then_some(scenario.dynamics.external_damping),
            duration: scenario.dynamics.duration,
            time: moments.last().map_or(0.0, |moment| moment.time),
            error_estimate: moments.last().and_then(|moment| moment.error),
            error_known_until: simulation.known_until(),
            error_aim: simulation.aim(),
            compared_segments: simulation.compared_segments(),
            time_step: simulation.longest_step(),
            stable_step: simulation.stable_step(),
            steps: simulation.steps(),
            landings: simulation.landings(),
            moments,
            tips: match scenario.joined {
                true => tips.take(1).collect(),
                false => tips.collect(),
            },
            tip_speed: simulation.tip_speed() + 0.0,
            stations: simulation.stations().to_vec(),
            stills,
            film: Vec::new(),
            wall_seconds: simulation.wall_time().as_secs_f64(),
        }
    }

    /// The outcome in one word: `completed`, or [`Stopped::word`].
    pub fn outcome(&self) -> &'static str {
        outcome(&self.stopped)
    }

    /// The largest distance of the tip, or of the mean of free ones, from where it is at the last output, within
    /// the last tenth of the time that was followed.
    pub fn late_tip_motion(&self) -> f64 {
        let Some(last) = self.moments.last() else {
            return 0.0;
        };
        let from = (1.0 - LATE_PART) * last.time;
        let late = self.moments.iter().filter(|moment| moment.time >= from);
        largest(late.map(|moment| moment.tip.distance(last.tip)))
    }

    /// Whether the leaf still moves at the end: within a tenth of the time by more than the error of its tips, or,
    /// where that is not known, than a thousandth of its length.
    pub fn moves_at_end(&self) -> bool {
        let negligible = self.error_estimate.unwrap_or(0.0);
        let negligible = larger(negligible, NEGLIGIBLE_TIP_MOTION * self.length);
        larger(
            self.late_tip_motion(),
            LATE_PART * self.time * self.tip_speed,
        ) > negligible
    }

    /// Why the motion ended early, or what makes it doubtful.
    pub fn remark(&self) -> Option<MotionRemark> {
        let imbalance = self.imbalance.map(MotionRemark::Imbalance);
        self.stopped.map(MotionRemark::Stopped).or(imbalance)
    }
}

/// The part of a motion at its end from which it is told whether the leaf still moves.
const LATE_PART: f64 = 0.1;

fn outcome(stopped: &Option<Stopped>) -> &'static str {
    stopped.map_or("completed", Stopped::word)
}

/// The word, and a sentence about an early end.
fn serialize_outcome<S: Serializer>(
    stopped: &Option<Stopped>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut keys = serializer.serialize_map(None)?;
    keys.serialize_entry("outcome", outcome(stopped))?;
    if let Some(stopped) = stopped {
        keys.serialize_entry("remark", &stopped.to_string())?;
    }
    keys.end()
}

/// The number of outputs, all energies at the last one, and the conserved quantity at the first and the
/// last.
fn serialize_moments<S: Serializer>(
    moments: &[OutputSample],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Energies {
        #[serde(flatten)]
        end: Energy,
        balance_start: f64,
        balance_end: f64,
    }
    let ends = moments.first().zip(moments.last());
    let energies = ends.map(|(first, last)| Energies {
        end: last.energy,
        balance_start: first.energy.balance(),
        balance_end: last.energy.balance(),
    });
    let mut keys = serializer.serialize_map(None)?;
    keys.serialize_entry("frames", &moments.len())?;
    keys.serialize_entry("energy", &energies)?;
    keys.end()
}

/// A tip that moves by less than this part of the longest rod counts as hardly moving.
const NEGLIGIBLE_TIP_MOTION: f64 = 1e-3;

/// Number of moments from which those shown are selected.
const MAX_SNAPSHOT_CANDIDATES: usize = 400;

/// The indices of `count` moments that show a motion, or of all if there are
/// no more: the first, the last, and others with the tip far from that of
/// the previous one, such as the turning points of a swing. If the tip hardly
/// moves (`length`: the longest rod), they are at equal intervals.
pub fn snapshot_indices(moments: &[OutputSample], count: usize, length: f64) -> Vec<usize> {
    if moments.len() <= count {
        return (0..moments.len()).collect();
    }
    let pairs = moments.windows(2);
    let distance: f64 = pairs.map(|pair| pair[0].tip.distance(pair[1].tip)).sum();
    if distance.is_finite() && distance > NEGLIGIBLE_TIP_MOTION * length {
        return distant_tip_indices(moments, count);
    }
    let (last, gaps) = (moments.len() - 1, count - 1);
    let nearest = |k: usize| (2 * k * last + gaps) / (2 * gaps);
    (0..count).map(nearest).collect()
}

/// The first, the last, and others between, such that the sum of the square roots of the
/// distances between successive tips is largest: turning points, and equal distances between
/// them, as the root is concave. By dynamic programming.
fn distant_tip_indices(moments: &[OutputSample], count: usize) -> Vec<usize> {
    let last = moments.len() - 1;
    let most = moments.len().min(MAX_SNAPSHOT_CANDIDATES.max(count));
    let candidates: Vec<usize> = (0..most).map(|k| k * last / (most - 1)).collect();
    let n = candidates.len();
    let gain = |i: usize, j: usize| {
        let [from, to] = [i, j].map(|k| moments[candidates[k]].tip);
        from.distance(to).sqrt()
    };
    // The best sum with k more chosen after the first, the last of them j, and its predecessor.
    let mut best = vec![f64::NEG_INFINITY; n];
    best[0] = 0.0;
    let mut whence = vec![vec![0; n]; count];
    for k in 1..count {
        let mut next = vec![f64::NEG_INFINITY; n];
        for j in k..n {
            for i in k - 1..j {
                let sum = best[i] + gain(i, j);
                if sum > next[j] {
                    (next[j], whence[k][j]) = (sum, i);
                }
            }
        }
        best = next;
    }
    let mut chosen = vec![n - 1];
    for k in (1..count).rev() {
        let before = whence[k][chosen[chosen.len() - 1]];
        chosen.push(before);
    }
    chosen.reverse();
    chosen.into_iter().map(|k| candidates[k]).collect()
}

/// Largest number of shapes of a film, and of nodes of all of them.
const MAX_FILM_SHAPES: usize = 401;

const FILM_NODES: usize = 4_000_000;

/// Which of so many outputs, each with so many nodes, a film shows: at equal intervals, including
/// the last.
pub fn film_indices(outputs: usize, nodes: usize) -> Vec<usize> {
    let most = MAX_FILM_SHAPES.min(FILM_NODES / nodes.max(1)).max(2);
    let stride = outputs.saturating_sub(1).div_ceil(most - 1).max(1);
    let last = outputs.checked_sub(1);
    let evenly = (0..outputs).step_by(stride);
    let mut chosen: Vec<usize> = evenly.filter(|output| Some(*output) != last).collect();
    chosen.extend(last);
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Energy;
    use glam::DVec3;

    fn moments(count: usize, tip: impl Fn(f64) -> f64) -> Vec<OutputSample> {
        let moment = |i| OutputSample {
            time: i as f64,
            steps: i,
            energy: Energy::default(),
            tip: DVec3::X * tip(i as f64),
            error: None,
        };
        (0..count).map(moment).collect()
    }

    #[test]
    fn a_film_is_even_and_ends_with_the_last_output() {
        assert!(film_indices(0, 10).is_empty());
        assert_eq!(film_indices(1, 10), [0]);
        assert_eq!(film_indices(400, 10).len(), 400);
        assert_eq!(film_indices(401, 10).len(), 401);
        assert_eq!(film_indices(402, 10).len(), 202);
        let long = film_indices(10_002, 10);
        assert!(long.len() <= 401 && *long.last().unwrap() == 10_001);
        assert_eq!(film_indices(50, 4_000_000), [0, 49]);
    }

    #[test]
    fn a_fast_start_is_shown() {
        let chosen = snapshot_indices(&moments(101, |t| (-t / 5.0).exp()), 8, 1.0);
        assert_eq!((chosen[0], chosen[7]), (0, 100));
        assert!(chosen[6] < 15, "{chosen:?}");
    }

    #[test]
    fn a_swing_is_shown_at_its_turning_points() {
        // Turns every 5 outputs, and decays.
        let swing = |t: f64| (0.1 * std::f64::consts::TAU * t).cos() * (-t / 40.0).exp();
        let chosen = snapshot_indices(&moments(1001, swing), 8, 1.0);
        assert_eq!((chosen[0], chosen[7]), (0, 1000));
        let tips: Vec<f64> = chosen.iter().map(|&k| swing(k as f64)).collect();
        for pair in tips[..7].windows(2) {
            assert!(pair[0] * pair[1] < 0.0, "{chosen:?}: {tips:?}");
        }
    }

    #[test]
    fn what_hardly_moves_is_shown_at_equal_times() {
        for still in [|_: f64| 0.3, |t: f64| 1e-9 * t, |_: f64| f64::NAN] {
            let chosen = snapshot_indices(&moments(71, still), 8, 1.0);
            assert_eq!(chosen, [0, 10, 20, 30, 40, 50, 60, 70]);
        }
    }

    #[test]
    fn none_is_shown_twice() {
        let jump = |at: f64| move |t: f64| if t < at { 0.0 } else { 1.0 };
        for at in [0.5, 7.5, 11.5] {
            let chosen = snapshot_indices(&moments(13, jump(at)), 8, 1.0);
            assert_eq!((chosen[0], chosen[7]), (0, 12), "{chosen:?}");
            assert!(chosen.windows(2).all(|w| w[0] < w[1]), "{chosen:?}");
        }
    }

    #[test]
    fn few_are_all_shown() {
        assert_eq!(snapshot_indices(&moments(3, |t| t), 8, 1.0), [0, 1, 2]);
    }
}
