//! How far a stable leaf is from losing its stability.

use crate::relax::saddle::Saddle;
use crate::scenario::Units;
use crate::shape::serialize_tips;
use glam::DVec3;
use serde::{Serialize, Serializer};
use std::fmt;

/// How far a stable leaf is from losing its stability: under a force at its tip, and by
/// the energy of the pass to another equilibrium. As JSON it is `margin` in
/// `summary.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Margin {
    /// Names of the units, if the scenario gives any.
    #[serde(skip)]
    pub units: Units,
    /// Weight of the leaf: a force.
    pub weight: f64,
    /// Whether forces act at every tip, as the tips are not joined.
    #[serde(skip)]
    pub every_tip: bool,
    /// The largest push that was tried.
    pub largest_push: Option<f64>,
    /// Pushes at the tip, along the axes and against them, the least first; none of a
    /// tip that is held.
    pub pushes: Vec<Push>,
    /// The lowest pass to another equilibrium, of those found.
    pub barrier: Option<Barrier>,
    /// From so many places a pass was looked for.
    pub climbs: usize,
    /// Why something of it is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// Time of all that is not the solve itself, in seconds.
    pub wall_seconds: f64,
}

impl Margin {
    /// Of a leaf that has none, and why.
    pub fn none(remark: &str) -> Self {
        Margin {
            remark: Some(remark.into()),
            ..Margin::default()
        }
    }
}

/// A direction along a lab axis, or against it. As text: `-z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Direction {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Whether against it.
    pub negative: bool,
}

impl Direction {
    /// All six.
    pub fn all() -> impl Iterator<Item = Direction> {
        (0..3).flat_map(|axis| [false, true].map(|negative| Direction { axis, negative }))
    }

    /// Its sign.
    pub fn sign(self) -> f64 {
        if self.negative { -1.0 } else { 1.0 }
    }

    /// The other way.
    pub fn opposite(self) -> Direction {
        Direction {
            negative: !self.negative,
            ..self
        }
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let sign = if self.negative { '-' } else { '+' };
        write!(f, "{sign}{}", ['x', 'y', 'z'][self.axis])
    }
}

impl Serialize for Direction {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// What a dead force at the tip does that grows from zero in one direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Push {
    /// The direction.
    #[serde(rename = "axis")]
    pub direction: Direction,
    /// What ends the stability.
    pub kind: Loss,
    /// The force at which that is.
    pub force: Option<f64>,
    /// Bound on its error.
    pub error: Option<f64>,
    /// The same in weights of the leaf, if it has any.
    pub per_weight: Option<f64>,
    /// The leaf is stable up to this force, where none was met.
    pub more_than: Option<f64>,
    /// What the leaf does there.
    pub then: Option<Fate>,
    /// Where it comes to rest under this force, if it snaps at a fold.
    pub neighbour: Option<Neighbour>,
    /// Where the tips are then.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Whether this is the mirror image of the push the other way, and known by that.
    pub mirrored: bool,
    /// Why it is not known, if it is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// How stability is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// The equilibrium meets an unstable one, and both end.
    Fold,
    /// Other branches cross.
    BranchPoint,
    /// It is not lost up to the largest push that was tried.
    NoneUpTo,
    /// It is not known beyond some push.
    Unknown,
}

/// What a leaf does that has lost its stability.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// It jumps to another equilibrium.
    Snaps,
    /// It bends aside as the force grows on, to a stable shape beside the unstable one.
    BendsAside,
}

/// The pass from a stable leaf to another equilibrium: an equilibrium of index one
/// that the leaf leaves to the one on one side and to the other on the other.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Barrier {
    /// Its energy above the leaf's.
    pub energy: f64,
    /// Bound on the error, if it is known on more than one grid.
    pub error: Option<f64>,
    /// By how much the whole leaf would have to be lifted for that: energy over weight.
    pub height: Option<f64>,
    /// That height over the longest rod's length.
    pub relative: Option<f64>,
    /// The equilibrium on the pass.
    pub saddle: Saddle,
    /// Where the leaf comes to rest behind it.
    pub neighbour: Neighbour,
}

/// The equilibrium behind a pass, or behind a fold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Neighbour {
    /// Its energy.
    pub energy: f64,
    /// Position of the joint tip, or of the first rod's.
    pub tip: DVec3,
}
