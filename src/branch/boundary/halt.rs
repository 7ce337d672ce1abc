//! How a boundary ended.

use super::search::Lost;
use crate::branch::equations::Stuck;
use crate::branch::refined::Doubt;

/// That is, on one of its sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Halt {
    /// At an end of one of the ranges.
    Reached,
    /// Where it began.
    Closed,
    /// On a curve that was followed before.
    Met,
    /// After as many points as were allowed.
    MostPoints,
    /// The second number breaks the symmetry by which branches cross.
    Unfolded,
    /// Modes that become neutral together do so no longer.
    Parted,
    /// No leaf is there.
    OutOfRange,
    /// No step however short could be made.
    Stuck,
    /// What comes next could not be verified.
    Unverified(Doubt),
}

impl Halt {
    /// Whether the boundary is known as far as was asked.
    pub fn complete(self) -> bool {
        matches!(self, Halt::Reached | Halt::Closed | Halt::Met)
    }
}

impl From<Lost> for Halt {
    fn from(lost: Lost) -> Self {
        match lost {
            Lost::Parted => Halt::Parted,
            Lost::Unfolded => Halt::Unfolded,
            Lost::Stuck(Stuck::OutOfRange(_)) => Halt::OutOfRange,
            Lost::Stuck(_) => Halt::Stuck,
        }
    }
}
