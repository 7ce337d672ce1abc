//! Patterns of the matrices of a family's leaves.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use super::equations::Stuck;
use crate::leaf::{SparsePattern, System};

/// Patterns that are kept: of five grids, with a border and without.
const KEPT: usize = 10;

/// The last few that were needed. All leaves of a family have the same pattern on grids of
/// as many segments, and to order it takes as long as to factorise a matrix.
#[derive(Default)]
pub struct Patterns(Mutex<VecDeque<(Shape, Arc<SparsePattern>)>>);

/// What of a system tells its pattern: segments, whether rods are coupled, and rows of the
/// border.
type Shape = (usize, bool, usize);

impl Patterns {
    /// That of a system with so many rows at its border.
    pub fn of(&self, system: &System, border: usize) -> Result<Arc<SparsePattern>, Stuck> {
        let shape = (system.segments(), system.coupled(), border);
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|(other, _)| *other == shape);
        let found = match known.and_then(|index| kept.remove(index)) {
            Some(found) => found,
            None => {
                let pattern = SparsePattern::bordered(system, border);
                (shape, Arc::new(pattern.map_err(|_| Stuck::TooLarge)?))
            }
        };
        let pattern = found.1.clone();
        kept.truncate(KEPT - 1);
        kept.push_front(found);
        Ok(pattern)
    }
}
