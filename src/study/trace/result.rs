//! What a trace found.

use glam::DVec3;

use super::law::Law;
use crate::scenario::Units;
use crate::study::Keys;
use crate::undulation::Undulation;

/// An equilibrium followed through a number of its scenario.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Name of the scenario.
    pub scenario: String,
    /// The number that varied.
    pub keys: Keys,
    /// Its values at the ends of the range.
    pub range: [f64; 2],
    /// Names of the units, if the scenario gives any.
    pub units: Units,
    /// Number of rods.
    pub rods: usize,
    /// Whether the tips share one point.
    pub joined: bool,
    /// Wanted accuracy of the tips, relative to the longest rod.
    pub tolerance: f64,
    /// Segments a rod of the grid on which branches were followed.
    pub segments: usize,
    /// The branches: first that of the first equilibrium.
    pub branches: Vec<TraceBranch>,
    /// Force against displacement, if it is a tip force that varied.
    pub law: Option<Law>,
    /// Why there is no branch, or fewer than there are.
    pub remark: Option<String>,
    /// Matrices factorised while following.
    pub factorizations: usize,
    /// Time of all, in seconds.
    pub wall_seconds: f64,
}

/// One branch.
#[derive(Clone, Debug)]
pub struct TraceBranch {
    /// Branch and point from which it was entered; none of the first.
    pub from: Option<[usize; 2]>,
    /// Its points in order, critical ones among them.
    pub points: Vec<TracePoint>,
    /// How it ended.
    pub end: TraceEnd,
    /// Why, in a sentence, if that is not plain.
    pub remark: Option<String>,
}

/// A point of a branch, in the scenario's units.
#[derive(Clone, Debug)]
pub struct TracePoint {
    /// What it is.
    pub kind: PointKind,
    /// The number that varies.
    pub value: f64,
    /// Bound on its error, where it is found and not chosen.
    pub value_error: Option<f64>,
    /// The joint tip alone, or every tip.
    pub tips: Vec<DVec3>,
    /// Bound on the error of the tips.
    pub error: Option<f64>,
    /// Potential energy.
    pub energy: f64,
    /// Morse index; at a critical point that behind it.
    pub index: usize,
    /// Waves and twist of the veins.
    pub undulation: Undulation,
    /// Centerlines on the finest grid, one per rod.
    pub curves: Vec<Vec<DVec3>>,
}

/// What a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// One of many.
    Regular,
    /// The branch turns round here.
    Fold,
    /// Other branches cross here; in so many independent directions.
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

/// How a branch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceEnd {
    /// At the end of the range.
    Reached,
    /// Back at its start.
    Returned,
    /// Where the branch began.
    Closed,
    /// After as many points as were allowed.
    MostPoints,
    /// The number cannot have the next value.
    OutOfRange,
    /// A segment bends by more than the grid resolves.
    Unresolved,
    /// No step could be made.
    Stuck,
}

impl TraceEnd {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            TraceEnd::Reached => "reached",
            TraceEnd::Returned => "returned",
            TraceEnd::Closed => "closed",
            TraceEnd::MostPoints => "most-points",
            TraceEnd::OutOfRange => "out-of-range",
            TraceEnd::Unresolved => "unresolved",
            TraceEnd::Stuck => "stuck",
        }
    }

    /// Whether the branch is known as far as was asked.
    pub fn complete(self) -> bool {
        matches!(
            self,
            TraceEnd::Reached | TraceEnd::Returned | TraceEnd::Closed
        )
    }
}

impl TraceBranch {
    /// Its critical points, with their numbers.
    pub fn critical(&self) -> impl Iterator<Item = (usize, &TracePoint)> {
        let points = self.points.iter().enumerate();
        points.filter(|(_, point)| point.kind != PointKind::Regular)
    }
}

impl Trace {
    /// Whether all branches are known as far as was asked.
    pub fn complete(&self) -> bool {
        let mut branches = self.branches.iter();
        !self.branches.is_empty() && branches.all(|branch| branch.end.complete())
    }
}
