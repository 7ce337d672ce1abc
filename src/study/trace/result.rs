//! The result of a trace.

use crate::branch::{BranchEnd, CorrectorFailure, VerificationFailure};
use crate::run::join_remarks;
use crate::scenario::{PlausibilityWarning, Units};
use crate::shape::{Undulation, serialize_tips};
use crate::study::ParameterKeys;
use crate::study::remark::{BranchRemark, TraceRemark};
use crate::study::trace::{ForceDisplacementLine, TraceShow, TraceUntil};
use glam::DVec3;
use serde::ser::{Serialize, SerializeStruct, Serializer};

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
#[derive(Clone, Debug, serde::Serialize)]
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
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// The reaction at held tips.
    #[serde(rename = "tip_reaction", skip_serializing_if = "Option::is_none")]
    pub reaction: Option<DVec3>,
    /// The forces on the grips.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub grip_reactions: Vec<DVec3>,
    /// Bound on the error of the tips, or, if they are held, of the midpoints of the rods, and
    /// of both with grips: within the tolerance.
    pub error: Option<f64>,
    /// Potential energy.
    pub energy: f64,
    /// Morse index; at a critical point the one after it.
    #[serde(flatten, serialize_with = "serialize_index")]
    pub index: usize,
    /// Waves and twist of the veins.
    #[serde(skip)]
    pub undulation: Undulation,
    /// Fractions of the length of the nodes of the finest grid.
    #[serde(skip)]
    pub stations: Vec<f64>,
    /// Centerlines on the finest grid, one per rod.
    #[serde(skip)]
    pub curves: Vec<Vec<DVec3>>,
}

impl TracePoint {
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
}

impl PointKind {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            PointKind::Regular => "regular",
            PointKind::Fold => "fold",
            PointKind::Branching(_) => "branch-point",
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

fn serialize_index<S: Serializer>(index: &usize, serializer: S) -> Result<S::Ok, S::Error> {
    let mut keys = serializer.serialize_struct("Index", 2)?;
    keys.serialize_field("negative_eigenvalues", index)?;
    keys.serialize_field("stable", &(*index == 0))?;
    keys.end()
}
