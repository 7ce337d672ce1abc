//! Patterns of the matrices of a family's leaves.

use std::sync::{Arc, Mutex, PoisonError};

use super::recent::Recent;
use crate::leaf::{SparsePattern, System};

/// Patterns that are kept: of five grids, with a border and without.
const KEPT: usize = 10;

/// The last few that were needed. All leaves of a family have the same pattern on grids of
/// as many segments, and to order it takes as long as to factorise a matrix.
#[derive(Default)]
pub struct Patterns(Mutex<Recent<Shape, Arc<SparsePattern>, KEPT>>);

/// What of a system tells its pattern: segments, whether rods are coupled, and rows of the
/// border.
type Shape = (usize, bool, usize);

impl Patterns {
    /// That of a system with so many rows at its border; `None` where memory is short.
    pub fn of(&self, system: &System, border: usize) -> Option<Arc<SparsePattern>> {
        let shape = (system.segments(), system.coupled(), border);
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || SparsePattern::bordered(system, border).map(Arc::new);
        kept.at(shape, made).ok().cloned()
    }
}
