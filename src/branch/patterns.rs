//! Sparsity patterns of the matrices of a family of leaves.

use std::sync::{Arc, Mutex, PoisonError};

use super::lru_cache::LruCache;
use crate::leaf::{SparsePattern, System};

/// Number of cached patterns: five grids, bordered and unbordered.
const CACHED: usize = 10;

/// Cache of sparsity patterns. All leaves of a family have the same pattern on grids with
/// equally many segments, and ordering it takes as long as factorising a matrix.
#[derive(Default)]
pub struct Patterns(Mutex<LruCache<Shape, Arc<SparsePattern>, CACHED>>);

/// What determines the pattern of a system: its segments, whether its rods are coupled, and
/// the number of border rows.
type Shape = (usize, bool, usize);

impl Patterns {
    /// The pattern of a system with `border` border rows; `None` if memory is short.
    pub fn of(&self, system: &System, border: usize) -> Option<Arc<SparsePattern>> {
        let shape = (system.segments(), system.coupled(), border);
        let mut cache = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || SparsePattern::bordered(system, border).map(Arc::new);
        cache.at(shape, made).ok().cloned()
    }
}
