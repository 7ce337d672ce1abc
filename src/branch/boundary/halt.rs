//! How a boundary ended.

use super::search::NotFound;
use crate::branch::equations::Stuck;
use crate::branch::refined::Doubt;

/// How a curve ended, on one of its sides.
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
    /// The second parameter breaks the symmetry to which the branch point is due.
    Unfolded,
    /// Modes that became neutral together no longer do.
    Separated,
    /// No leaf exists there.
    OutOfRange,
    /// The step could not be made however short.
    Stuck,
    /// The next point could not be verified.
    Unverified(Doubt),
}

impl Halt {
    /// Whether the boundary is known as far as requested.
    pub fn complete(self) -> bool {
        matches!(self, Halt::Reached | Halt::Closed | Halt::Met)
    }
}

impl From<NotFound> for Halt {
    fn from(lost: NotFound) -> Self {
        match lost {
            NotFound::Separated => Halt::Separated,
            NotFound::Unfolded => Halt::Unfolded,
            NotFound::Stuck(Stuck::OutOfRange(_)) => Halt::OutOfRange,
            NotFound::Stuck(_) => Halt::Stuck,
        }
    }
}
