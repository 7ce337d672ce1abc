//! The result of a trace.

use crate::branch::{BranchEnd, BranchingKind, CorrectorFailure, VerificationFailure};
use crate::leaf::BucklingMode;
use crate::numbers::largest;
use crate::relax::{AssumedMotion, DominantMotion, MotionInstability};
use crate::run::join_remarks;
use crate::scenario::{PlausibilityWarning, Scenario, Units, plausibility_warnings};
use crate::shape::{Undulation, serialize_tips};
use crate::study::remark::{BranchRemark, TraceRemark};
use crate::study::trace::serialize_axis;
use crate::study::vary::{AXIS_NAMES, ParameterSweep};
use crate::study::{ParameterKeys, UnknownWord};
use glam::DVec3;
use serde::ser::{Serialize, SerializeMap, SerializeStruct, Serializer};
use std::fmt::{Display, Formatter};
use std::str::FromStr;

/// An equilibrium followed through a number of its scenario. As JSON it is `trace.json`.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Trace {
    /// Name of the scenario.
    pub scenario: String,
    /// The number that varied.
    #[serde(rename = "vary")]
    pub keys: ParameterKeys,
    /// Its values at the ends of the range.
    pub range: [f64; 2],
    /// Whether its logarithm is spaced evenly.
    #[serde(skip)]
    pub log: bool,
    /// What the figure shows, one panel each; if empty, the coordinate of the tip that varies most.
    #[serde(skip)]
    pub show: Vec<TraceShow>,
    /// Names of the units, if the scenario gives any.
    #[serde(skip)]
    pub units: Units,
    /// Number of rods.
    pub rods: usize,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// Whether the tips are held.
    #[serde(skip)]
    pub held: bool,
    /// Number of grips along veins.
    #[serde(skip)]
    pub grips: usize,
    /// Segments per rod of the finest grid on which branches were followed.
    pub segments: usize,
    /// Required accuracy of the tips, relative to the longest rod.
    pub tolerance: f64,
    /// Whether branches that cross were followed as well.
    #[serde(skip)]
    pub switch: bool,
    /// What was to end branches before the end of the range.
    #[serde(skip)]
    pub until: Option<TraceUntil>,
    /// Whether there are branches, and all are known as far as requested.
    pub complete: bool,
    /// Why there is no branch, or fewer than there are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<TraceRemark>,
    /// What is assumed of masses and damping, where loads have no potential.
    #[serde(
        skip_serializing_if = "Option::is_none",
        serialize_with = "serialize_assumed"
    )]
    pub assumed: Option<AssumedMotion>,
    /// What in the scenario is probably not what was intended.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<PlausibilityWarning>,
    /// The branches: first that of the first equilibrium.
    pub branches: Vec<TraceBranch>,
    /// Force against displacement, if what varied is a tip force or the position of held tips.
    pub law: Option<ForceDisplacementLine>,
    /// Number of matrices factorized by the continuation.
    pub factorizations: usize,
    /// Total time, in seconds.
    pub wall_seconds: f64,
}

impl Trace {
    /// The trace of this leaf through a number, before its first point.
    pub(super) fn before_first_point(
        scenario: &Scenario,
        vary: &ParameterSweep,
        tolerance: f64,
    ) -> Self {
        Trace {
            scenario: scenario.name.clone(),
            keys: vary.keys.clone(),
            range: vary.ends(),
            log: vary.log,
            show: Vec::new(),
            units: scenario.units.clone(),
            rods: scenario.rods.len(),
            held: scenario.held_tip.is_some(),
            grips: scenario.grips.len(),
            joined: scenario.joined,
            segments: 0,
            tolerance,
            switch: false,
            until: None,
            complete: false,
            remark: None,
            assumed: None,
            doubts: plausibility_warnings(scenario),
            branches: Vec::new(),
            law: None,
            factorizations: 0,
            wall_seconds: 0.0,
        }
    }
}

/// One branch.
#[derive(Clone, Debug)]
pub struct TraceBranch {
    /// Indices of the branch and of its point at which this one was entered; none for
    /// the first.
    pub from: Option<[usize; 2]>,
    /// Its points in order, critical ones among them.
    pub points: Vec<TracePoint>,
    /// How it ended.
    pub end: BranchEnd,
    /// Why it is incomplete, and which branches that cross it are missing.
    pub remarks: Vec<BranchRemark>,
}

/// A point of a branch, in the scenario's units.
#[derive(Clone, Debug)]
pub struct TracePoint {
    /// Its number on the branch, from 1.
    pub point: usize,
    /// Its kind.
    pub kind: PointKind,
    /// The number that varies.
    pub value: f64,
    /// Bound on its error, if it is computed and not prescribed.
    pub value_error: Option<f64>,
    /// The shared tip alone, or every tip.
    pub tips: Vec<DVec3>,
    /// The reaction at held tips.
    pub reaction: Option<DVec3>,
    /// The forces on the grips.
    pub grip_reactions: Vec<DVec3>,
    /// Bound on the error of the tips, or, if they are held, of the midpoints of the rods, and
    /// of both with grips: within the tolerance.
    pub error: Option<f64>,
    /// Potential energy; NaN in wind.
    pub energy: f64,
    /// Morse index, or, where loads have no potential, the number of roots of the linearised motion with
    /// growth, both of a conjugate pair; at a critical point the one after it.
    pub index: usize,
    /// The axis, 0 to 2, along which the leaf moves most in the mode that is neutral here: at critical
    /// points of leaves with a potential.
    pub critical_mode_axis: Option<usize>,
    /// What the veins do in that mode.
    pub critical_mode: Option<BucklingMode>,
    /// On which side the branches lie that cross where stability is lost or gained.
    pub branching: Option<BranchingKind>,
    /// Its small motions, where loads have no potential.
    pub motion: Option<PointMotion>,
    /// Waves and twist of the veins.
    pub undulation: Undulation,
    /// Fractions of the length of the nodes of the finest grid.
    pub stations: Vec<f64>,
    /// Centerlines on the finest grid, one per rod.
    pub curves: Vec<Vec<DVec3>>,
}

/// The small motions about a point of a branch without a potential.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMotion {
    /// Roots with growth, both of a conjugate pair; at a critical point those after it. `None` where it is
    /// not certain which grow: then the index is that of the point before.
    pub unstable_roots: Option<usize>,
    /// The motion that grows fastest or decays slowest; at a critical point the one whose growth begins or
    /// ends. `None` if roots are not found.
    pub dominant: Option<DominantMotion>,
}

impl TracePoint {
    /// Whether it is stable, if that is certain.
    pub fn stable(&self) -> Option<bool> {
        match self.motion {
            Some(motion) => motion.unstable_roots.map(|roots| roots == 0),
            None => Some(self.index == 0),
        }
    }

    /// The force on the tip along an axis, if that varies or the tip is held.
    pub fn force_on_tip(&self, axis: usize) -> f64 {
        self.reaction.map_or(self.value, |reaction| -reaction[axis])
    }

    /// What the figure shows of it; NaN if the leaf has no such thing.
    pub fn figure_value(&self, what: TraceShow) -> f64 {
        let component =
            |vector: Option<&DVec3>, axis: usize| vector.map_or(f64::NAN, |it| it[axis]);
        match what {
            TraceShow::Tip(axis) => component(self.tips.first(), axis),
            TraceShow::Reaction(axis) => component(self.reaction.as_ref(), axis),
            TraceShow::Grip { grip, axis } => component(self.grip_reactions.get(grip), axis),
            TraceShow::Energy => self.energy,
            TraceShow::Twist => self.undulation.twist(),
        }
    }
}

/// Kind of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// A regular point.
    Regular,
    /// The branch turns back here.
    Fold,
    /// Other branches cross here, in so many independent directions.
    Branching(usize),
    /// Oscillations begin to grow here, or no longer do.
    Flutter,
    /// A motion without oscillations begins to grow here, or no longer does.
    Divergence,
}

impl PointKind {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            PointKind::Regular => "regular",
            PointKind::Fold => "fold",
            PointKind::Branching(_) => "branch-point",
            PointKind::Flutter => MotionInstability::Flutter.word(),
            PointKind::Divergence => MotionInstability::Divergence.word(),
        }
    }
}

impl Serialize for PointKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl BranchEnd {
    /// The word in files.
    pub fn word(&self) -> &'static str {
        match self {
            BranchEnd::RangeEndReached => "reached",
            BranchEnd::RangeStartReached => "returned",
            BranchEnd::LoopClosed => "closed",
            BranchEnd::KnownBoundaryMet => "met",
            BranchEnd::PointLimitReached | BranchEnd::StopCriterionMet => "most-points",
            BranchEnd::StabilityLost => "unstable",
            BranchEnd::RunLimitReached | BranchEnd::StepFailed(CorrectorFailure::Stopped) => {
                "stopped"
            }
            BranchEnd::StepFailed(CorrectorFailure::OutOfRange(_)) => "out-of-range",
            BranchEnd::StepFailed(CorrectorFailure::Unresolved) => "unresolved",
            BranchEnd::StepFailed(CorrectorFailure::Unfolded) => "unfolds",
            BranchEnd::StepFailed(CorrectorFailure::Separated) => "parts",
            BranchEnd::StepFailed(CorrectorFailure::TurnsBack) => "turns-back",
            BranchEnd::StepFailed(_) => "stuck",
            BranchEnd::PointUnverified(_) => "unverified",
        }
    }

    /// Whether the branch is known as far as requested.
    pub fn is_complete(&self) -> bool {
        matches!(
            self,
            BranchEnd::RangeEndReached
                | BranchEnd::RangeStartReached
                | BranchEnd::LoopClosed
                | BranchEnd::KnownBoundaryMet
                | BranchEnd::StabilityLost
        )
    }

    /// Why an incomplete branch stopped, and what may help.
    pub(super) fn failure_remark(&self) -> Option<BranchRemark> {
        match self {
            // Of a stopped run the trace says so.
            BranchEnd::RangeEndReached
            | BranchEnd::RangeStartReached
            | BranchEnd::LoopClosed
            | BranchEnd::KnownBoundaryMet
            | BranchEnd::StabilityLost
            | BranchEnd::RunLimitReached => None,
            BranchEnd::PointLimitReached | BranchEnd::StopCriterionMet => {
                Some(BranchRemark::MorePoints)
            }
            BranchEnd::StepFailed(stuck) => Some(BranchRemark::StepFailed(stuck.clone())),
            BranchEnd::PointUnverified(VerificationFailure::Inaccurate) => {
                Some(BranchRemark::ToleranceNotReached)
            }
            BranchEnd::PointUnverified(doubt) => Some(BranchRemark::PointUnverified(*doubt)),
        }
    }
}

impl Serialize for BranchEnd {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl TraceBranch {
    /// How often its Morse index grows along it: at a critical point, or between two points.
    pub fn index_increase_count(&self) -> usize {
        let pairs = self.points.windows(2);
        pairs.filter(|pair| pair[1].index > pair[0].index).count()
    }

    /// Renamed to [`TraceBranch::index_increase_count`].
    #[deprecated(note = "renamed: its documentation has the new name")]
    pub fn destabilizations(&self) -> usize {
        self.index_increase_count()
    }

    /// Its remarks in one sentence, if there are any.
    pub fn remark(&self) -> Option<String> {
        join_remarks(&self.remarks)
    }

    /// The point at which a stable branch first loses its stability, with its index; none of a branch that is not
    /// stable before, and where stability is lost between two points.
    pub fn stability_loss(&self) -> Option<(usize, &TracePoint)> {
        let pairs = self.points.windows(2).enumerate();
        let mut losses = pairs.filter(|(_, pair)| pair[0].index == 0 && pair[1].index > 0);
        let (before, pair) = losses.next()?;
        (pair[1].kind != PointKind::Regular).then_some((before + 1, &pair[1]))
    }

    /// Its critical points, with their indices.
    pub fn critical_points(&self) -> impl Iterator<Item = (usize, &TracePoint)> {
        let points = self.points.iter().enumerate();
        points.filter(|(_, point)| point.kind != PointKind::Regular)
    }
}

/// A branch as JSON: with its first, last and critical points, and the number of all.
impl Serialize for TraceBranch {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let critical: Vec<&TracePoint> = self.critical_points().map(|(_, point)| point).collect();
        let mut object = serializer.serialize_struct("TraceBranch", 7)?;
        object.serialize_field("from", &self.from.map(|from| from.map(|index| index + 1)))?;
        object.serialize_field("points", &self.points.len())?;
        object.serialize_field("end", &self.end)?;
        match self.remark() {
            Some(remark) => object.serialize_field("remark", &remark)?,
            None => object.skip_field("remark")?,
        }
        object.serialize_field("first", &self.points.first())?;
        object.serialize_field("last", &self.points.last())?;
        object.serialize_field("critical", &critical)?;
        object.end()
    }
}

/// A point as JSON.
impl Serialize for TracePoint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SerializedPoint {
            point: self.point,
            kind: self.kind,
            value: self.value,
            value_error: self.value_error,
            tips: &self.tips,
            reaction: self.reaction,
            grip_reactions: &self.grip_reactions,
            error: self.error,
            energy: self.energy,
            branching: self.branching,
            stability: PointStability(self),
        }
        .serialize(serializer)
    }
}

#[derive(serde::Serialize)]
struct SerializedPoint<'p> {
    point: usize,
    kind: PointKind,
    value: f64,
    value_error: Option<f64>,
    #[serde(flatten, serialize_with = "serialize_tips")]
    tips: &'p [DVec3],
    #[serde(rename = "tip_reaction", skip_serializing_if = "Option::is_none")]
    reaction: Option<DVec3>,
    #[serde(skip_serializing_if = "<[DVec3]>::is_empty")]
    grip_reactions: &'p [DVec3],
    error: Option<f64>,
    energy: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    branching: Option<BranchingKind>,
    #[serde(flatten)]
    stability: PointStability<'p>,
}

/// The index of a point, or its motion.
struct PointStability<'p>(&'p TracePoint);

impl Serialize for PointStability<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let PointStability(point) = self;
        let mut keys = serializer.serialize_map(None)?;
        let index = point.motion.is_none().then_some(point.index);
        keys.serialize_entry("negative_eigenvalues", &index)?;
        keys.serialize_entry("stable", &point.stable())?;
        if let Some(motion) = point.motion {
            let dominant = motion.dominant;
            keys.serialize_entry("unstable_roots", &motion.unstable_roots)?;
            keys.serialize_entry("growth_rate", &dominant.map(|it| it.growth_rate))?;
            keys.serialize_entry("frequency", &dominant.map(|it| it.frequency))?;
            keys.serialize_entry("motion_error", &dominant.and_then(|it| it.error))?;
        }
        keys.end()
    }
}

/// What is assumed, as a list of words.
fn serialize_assumed<S: Serializer>(
    assumed: &Option<AssumedMotion>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(assumed.iter().flat_map(|it| it.words()))
}

/// The straight line fitted to the forces on a tip as a function of its displacements
/// along them: Hooke's law, and how well it holds.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ForceDisplacementLine {
    /// Axis of the force: 0, 1, 2 for x, y, z.
    #[serde(serialize_with = "serialize_axis")]
    pub axis: usize,
    /// Stiffness: slope of the least-squares line, force per length.
    pub slope: f64,
    /// Coefficient of determination of that line: 1 for an exact one.
    pub r_squared: f64,
    /// The largest deviation from the line, as a part of the range of the forces.
    pub deviation: f64,
    /// Distance of base and tip at the start of the range.
    pub length: f64,
}

impl ForceDisplacementLine {
    /// `None` with fewer than three points, if the tip moves by no more than rounding, or if the
    /// forces are not linear.
    pub(super) fn fit(axis: usize, points: &[LoadedTip]) -> Option<ForceDisplacementLine> {
        let tip = points.first()?.tip;
        let points: Vec<(f64, f64)> = (points.iter())
            .map(|point| (point.tip[axis] - tip[axis], point.force))
            .collect();
        let count = points.len() as f64;
        if points.len() < 3 {
            return None;
        }
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let xx = mean(&|p| (p.0 - x) * (p.0 - x));
        let xy = mean(&|p| (p.0 - x) * (p.1 - y));
        let yy = mean(&|p| (p.1 - y) * (p.1 - y));
        let length = tip.length();
        if xx.sqrt() <= DISPLACEMENT_ROUNDING * length {
            return None;
        }
        let slope = xy / xx;
        let off = |p: &(f64, f64)| (p.1 - y - slope * (p.0 - x)).abs();
        let forces = points.iter().map(|p| p.1);
        let range =
            forces.clone().fold(f64::NEG_INFINITY, f64::max) - forces.fold(f64::INFINITY, f64::min);
        Some(ForceDisplacementLine {
            axis,
            slope,
            r_squared: xy * xy / (xx * yy),
            deviation: largest(points.iter().map(off)) / range,
            length,
        })
        .filter(|law| law.slope.is_finite() && law.deviation <= LINEARITY_TOLERANCE)
    }
}

/// What the figure of a trace shows against the number that varies. Axes are 0, 1, 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceShow {
    /// A coordinate of the tip; of the first one if they are free.
    Tip(usize),
    /// A component of the reaction at held tips.
    Reaction(usize),
    /// A component of the force on a grip.
    Grip {
        /// The grip, counted from 0.
        grip: usize,
        /// The axis.
        axis: usize,
    },
    /// The potential energy.
    Energy,
    /// The mean twist of the veins, in radians.
    Twist,
}

impl Display for TraceShow {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        match self {
            TraceShow::Tip(axis) => f.write_str(AXIS_NAMES[*axis]),
            TraceShow::Reaction(axis) => write!(f, "reaction_{}", AXIS_NAMES[*axis]),
            TraceShow::Grip { grip, axis } => write!(f, "grip_{}_{}", grip + 1, AXIS_NAMES[*axis]),
            TraceShow::Energy => f.write_str("energy"),
            TraceShow::Twist => f.write_str("twist"),
        }
    }
}

impl FromStr for TraceShow {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let axis = |word: &str| AXIS_NAMES.iter().position(|axis| *axis == word);
        let parts: Vec<&str> = text.split('_').collect();
        let found = match parts.as_slice() {
            ["energy"] => Some(TraceShow::Energy),
            ["twist"] => Some(TraceShow::Twist),
            [word] => axis(word).map(TraceShow::Tip),
            ["reaction", word] => axis(word).map(TraceShow::Reaction),
            ["grip", number, word] => {
                let number = number.parse::<usize>().ok();
                let grip = number.and_then(|number| number.checked_sub(1));
                grip.zip(axis(word))
                    .map(|(grip, axis)| TraceShow::Grip { grip, axis })
            }
            _ => None,
        };
        found.ok_or_else(|| UnknownWord {
            found: text.into(),
            allowed: vec![
                "x",
                "y",
                "z",
                "reaction_x",
                "reaction_y",
                "reaction_z",
                "grip_1_x, ...",
                "energy",
                "twist",
            ],
        })
    }
}

/// What ends a branch before the end of the range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceUntil {
    /// The loss of its stability; a branch that is unstable from its beginning ends where it
    /// becomes unstable in one more direction: where its Morse index grows.
    Unstable,
}

impl TraceUntil {
    /// The word on the command line and in Python.
    pub fn word(self) -> &'static str {
        match self {
            TraceUntil::Unstable => "unstable",
        }
    }
}

impl FromStr for TraceUntil {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let allowed = [TraceUntil::Unstable];
        let found = allowed.into_iter().find(|it| it.word() == text);
        found.ok_or_else(|| UnknownWord {
            found: text.into(),
            allowed: allowed.map(TraceUntil::word).into(),
        })
    }
}

/// Smaller displacements, in lengths, are due to rounding.
pub(super) const DISPLACEMENT_ROUNDING: f64 = 1e-11;

/// The largest deviation of forces from a straight line, as a part of their range, for which that
/// is their law: what a testing machine of class 1 measures differs as much (ISO 7500-1).
pub(super) const LINEARITY_TOLERANCE: f64 = 0.01;

/// A tip under a force along an axis.
pub(super) struct LoadedTip {
    pub(super) force: f64,
    pub(super) tip: DVec3,
}
