//! The stability margin of a stable leaf.

use crate::relax::saddle::Saddle;
use crate::shape::serialize_tips;
use glam::DVec3;
use serde::{Serialize, Serializer};
use std::fmt;

/// How far a stable leaf is from losing its stability: the critical forces at its tip, and the
/// energy barrier to another equilibrium. As JSON it is `margin` in `summary.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Margin {
    /// Weight of the leaf: a force.
    pub weight: f64,
    /// Whether forces act at every tip, as the tips are not joined.
    #[serde(skip)]
    pub every_tip: bool,
    /// The largest push that was tried.
    pub largest_push: Option<f64>,
    /// Pushes at the tip, along the axes and against them, the least first; none for a held
    /// tip.
    pub pushes: Vec<Push>,
    /// The lowest energy barrier to another equilibrium, of those found.
    pub barrier: Option<Barrier>,
    /// Number of starting points of the search for saddles.
    pub climbs: usize,
    /// Why a part of it is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// Time of all that is not the solve itself, in seconds.
    pub wall_seconds: f64,
}

impl Margin {
    /// No margin, with the reason.
    pub fn none(remark: &str) -> Self {
        Margin {
            remark: Some(remark.into()),
            ..Margin::default()
        }
    }
}

/// A direction along a lab axis, or against it. As text: `-z`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

    /// The opposite direction.
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

/// The effect of a dead force at the tip that grows from zero in one direction.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Push {
    /// The direction.
    #[serde(rename = "axis")]
    pub direction: Direction,
    /// What ends the stability.
    pub kind: Loss,
    /// The force at which stability is lost.
    pub force: Option<f64>,
    /// Bound on its error.
    pub error: Option<f64>,
    /// The same in weights of the leaf, if it has any.
    pub per_weight: Option<f64>,
    /// If no loss was found, the force up to which the leaf is stable.
    pub more_than: Option<f64>,
    /// What the leaf does when stability is lost.
    pub then: Option<Fate>,
    /// The equilibrium it reaches under this force, if it snaps at a fold.
    pub neighbour: Option<Neighbour>,
    /// Positions of the tips then.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Whether this was obtained as the mirror image of the opposite push.
    pub mirrored: bool,
    /// Why it is not known, if that is so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// How stability is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// The equilibrium meets an unstable one, and both end.
    Fold,
    /// Other branches cross.
    BranchPoint,
    /// Stability is not lost up to the largest push that was tried.
    NoneUpTo,
    /// Unknown beyond some push.
    #[default]
    Unknown,
}

/// The behaviour of a leaf that has lost its stability.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// It jumps to another equilibrium.
    Snaps,
    /// It bends aside continuously as the force grows, to a stable shape close to the unstable
    /// one.
    BendsAside,
}

/// The energy barrier between a stable leaf and another equilibrium: a saddle of index one
/// from which the leaf falls to one of them on either side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Barrier {
    /// Its energy above the leaf's.
    pub energy: f64,
    /// Bound on the error, if it is known on more than one grid.
    pub error: Option<f64>,
    /// Height by which the whole leaf would have to be lifted for that energy: energy over weight.
    pub height: Option<f64>,
    /// That height over the longest rod's length.
    pub relative: Option<f64>,
    /// The saddle.
    pub saddle: Saddle,
    /// The equilibrium on its other side.
    pub neighbour: Neighbour,
}

/// The equilibrium beyond a barrier, or beyond a fold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Neighbour {
    /// Its energy.
    pub energy: f64,
    /// Position of the joint tip, or of the first rod's.
    pub tip: DVec3,
}
