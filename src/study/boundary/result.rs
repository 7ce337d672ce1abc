//! The result of a boundary.

use glam::DVec3;
use serde::ser::Serializer;

use crate::branch::boundary::Special;
use crate::branch::{End, Kind, value_between};
use crate::shape::serialize_tips;
use crate::study::Keys;

/// The boundary of stability in the plane of two parameters of a scenario: the curves on
/// which the Morse index of a leaf changes. As JSON it is `boundary.json`.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Boundary {
    /// Name of the scenario.
    pub scenario: String,
    /// The parameters.
    #[serde(rename = "vary")]
    pub keys: [Keys; 2],
    /// Their values at the ends of their ranges.
    pub ranges: [[f64; 2]; 2],
    /// Whether their logarithms are spaced evenly.
    #[serde(skip)]
    pub log: [bool; 2],
    /// The second parameter at the first trace, at whose critical points curves begin; others
    /// begin at those of the map's rows.
    pub start: f64,
    /// Number of rods.
    pub rods: usize,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// Required accuracy of the tips, relative to the longest rod.
    pub tolerance: f64,
    /// Whether there are curves, and all are known as far as requested.
    pub complete: bool,
    /// Why there is no curve, or fewer than there may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// What in the scenario is probably not what was intended.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<String>,
    /// The curves.
    pub curves: Vec<BoundaryCurve>,
    /// The map under them, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<BoundaryMap>,
    /// Matrices factorised to follow and verify the curves, without those of softened leaves,
    /// and to follow the first trace and the paths between the cells of the map.
    pub factorizations: usize,
    /// Total time, in seconds.
    pub wall_seconds: f64,
}

/// One curve.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundaryCurve {
    /// What happens to a branch along the first parameter: a fold, or a crossing.
    #[serde(serialize_with = "serialize_kind")]
    pub kind: Kind,
    /// How many modes become neutral.
    pub multiplicity: usize,
    /// How it ended: before its first point, and after its last.
    pub ends: [End; 2],
    /// Its points, ordered so that the second parameter increases from the first point or, where
    /// that is also the last, has increased.
    pub points: Vec<BoundaryPoint>,
    /// Leaves on either side, for pictures: of a few curves, those that bound stable leaves if
    /// there are any.
    #[serde(skip)]
    pub beside: Vec<LeafBeside>,
}

/// A leaf next to a curve, in the scenario's units, without an error estimate.
#[derive(Clone, Debug)]
pub struct LeafBeside {
    /// Both parameters.
    pub values: [f64; 2],
    /// Morse index.
    pub index: usize,
    /// The shared tip alone, or every tip.
    pub tips: Vec<DVec3>,
    /// Centerlines, one per rod.
    pub curves: Vec<Vec<DVec3>>,
    /// If the stable leaf of the other side relaxes to it, the initial centerlines of that fall: of
    /// the equilibrium at the same parameters or, at a fold, on the curve.
    pub fallen_from: Option<Vec<Vec<DVec3>>>,
}

/// A point of a curve, in the scenario's units.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundaryPoint {
    /// Its number on the curve, from 1.
    pub point: usize,
    /// `fold`, `branch-point`, `cusp` or `crossing`.
    pub kind: &'static str,
    /// Both parameters.
    pub values: [f64; 2],
    /// Bounds on their errors; zero for a given one.
    pub errors: [f64; 2],
    /// The shared tip alone, or every tip.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Bound on the error of the tips.
    pub error: f64,
    /// Morse index before the point and after it, along the first parameter; at a fold,
    /// the lower and the higher one of the two branches that meet there.
    pub index_before: usize,
    /// See above.
    pub index_behind: usize,
    /// Fractions of the length of the nodes of the finest grid.
    #[serde(skip)]
    pub stations: Vec<f64>,
    /// Centerlines on the finest grid, one per rod.
    #[serde(skip)]
    pub curves: Vec<Vec<DVec3>>,
}

/// Cells of the plane of two parameters, of equal size on the scales of the axes.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundaryMap {
    /// Values of the first parameter at the centres of the cells.
    pub first: Vec<f64>,
    /// Those of the second.
    pub second: Vec<f64>,
    /// Morse index of equilibria continued from cell to cell, beginning with that at
    /// the start of the first parameter's range; row by row of the second; none where branches
    /// turn back before, or could not be followed.
    pub index: Vec<Vec<Option<usize>>>,
    /// Cells for which the curves imply another index: column and row, from 1.
    pub disagreeing: Vec<[usize; 2]>,
}

impl Boundary {
    /// Edges of equal cells along one of the two parameters, from one end of its range to the
    /// other: one more than there are cells.
    pub fn edges(&self, which: usize, cells: usize) -> Vec<f64> {
        let part = |k: usize| k as f64 / cells as f64;
        (0..=cells)
            .map(|k| value_between(self.ranges[which], self.log[which], part(k)))
            .collect()
    }
}

impl BoundaryMap {
    /// Number of cells with an index.
    pub fn known(&self) -> usize {
        self.index.iter().flatten().flatten().count()
    }
}

/// The word for the kind of a point.
pub(super) fn word(kind: Kind, special: Option<Special>) -> &'static str {
    match (special, kind) {
        (Some(Special::Cusp), _) => "cusp",
        (Some(Special::Crossing), _) => "crossing",
        (None, Kind::Fold) => "fold",
        (None, Kind::Branching) => "branch-point",
    }
}

fn serialize_kind<S: Serializer>(kind: &Kind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(word(*kind, None))
}
