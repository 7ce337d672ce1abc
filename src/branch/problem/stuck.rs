//! Why a branch ends, or does not begin.

use crate::branch::problem::family::OutOfRange;
use crate::leaf::DirectError;

/// Why no point is found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Stuck {
    /// The parameter has left its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A segment bends by more than the grid resolves.
    #[error("a vein bends by more than a right angle within one segment")]
    Unresolved,
    /// Newton's method does not converge.
    #[error("Newton's method does not lead back to the branch")]
    NotConverged,
    /// The matrix does not fit into memory.
    #[error("the sparse factorisation of the leaf does not fit into memory")]
    TooLarge,
    /// No grid has the Morse index of the leaf.
    #[error(
        "no grid has as many negative eigenvalues as the leaf, which is too close to a bifurcation: start farther from it"
    )]
    BesideBifurcation,
    /// Rounding may change the sign of the softest eigenvalues.
    #[error("rounding on so many segments hides which eigenvalues are negative: fewer tell more")]
    Rounding,
    /// Modes that became neutral together no longer do.
    #[error("modes that become neutral together part")]
    Separated,
    /// The second parameter breaks the symmetry to which the branch point is due.
    #[error("the second number breaks the symmetry by which branches cross")]
    Unfolded,
    /// The limit of the run was reached.
    #[error("the run was stopped")]
    Stopped,
}

impl From<DirectError> for Stuck {
    fn from(error: DirectError) -> Self {
        match error {
            DirectError::Memory => Stuck::TooLarge,
            DirectError::NotFinite => Stuck::NotConverged,
        }
    }
}
