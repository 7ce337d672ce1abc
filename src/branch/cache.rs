//! A small cache of values that are expensive to compute, and that of sparsity patterns.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::leaf::{DirectSolver, System};

/// At most `MOST` values by key, the most recently used first.
pub struct LruCache<K, V, const MOST: usize>(VecDeque<(K, V)>);

impl<K, V, const MOST: usize> Default for LruCache<K, V, MOST> {
    fn default() -> Self {
        LruCache(VecDeque::new())
    }
}

impl<K: Copy + PartialEq, V, const MOST: usize> LruCache<K, V, MOST> {
    /// The value of a key, computed by `make` if it is not cached.
    pub fn at<E>(&mut self, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<&V, E> {
        let known = self.0.iter().position(|(other, _)| *other == key);
        let found = match known.and_then(|index| self.0.remove(index)) {
            Some((_, value)) => value,
            None => make()?,
        };
        self.0.truncate(MOST - 1);
        self.0.push_front((key, found));
        Ok(&self.0[0].1)
    }

    /// Values derived from these, under the same keys.
    pub fn map(&self, other: impl Fn(&V) -> V) -> Self {
        let values = self.0.iter();
        LruCache(values.map(|(key, value)| (*key, other(value))).collect())
    }
}

/// Number of cached patterns: five grids, bordered and unbordered.
const CACHED: usize = 10;

/// Cache of sparsity patterns. All leaves of a family have the same pattern on grids with
/// equally many segments, and ordering it takes as long as factorising a matrix.
#[derive(Default)]
pub struct Patterns(Mutex<LruCache<Shape, Arc<DirectSolver>, CACHED>>);

/// What determines the pattern of a system: its segments, whether its rods are coupled, and
/// the number of border rows.
type Shape = (usize, bool, usize);

impl Patterns {
    /// The pattern of a system with `border` border rows; `None` if memory is short.
    pub fn of(&self, system: &System, border: usize) -> Option<Arc<DirectSolver>> {
        let shape = (system.segments(), system.coupled(), border);
        let mut cache = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || DirectSolver::bordered(system, border).map(Arc::new);
        cache.at(shape, made).ok().cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_needed_last_is_not_made_again() {
        let mut lru_cache = LruCache::<i32, i32, 2>::default();
        let mut made = Vec::new();
        for key in [1, 2, 1, 3, 1, 2] {
            let value = lru_cache.at(key, || {
                made.push(key);
                Ok::<_, ()>(10 * key)
            });
            assert_eq!(value, Ok(&(10 * key)));
        }
        assert_eq!(made, [1, 2, 3, 2]);
        assert_eq!(lru_cache.at(4, || Err("none")), Err("none"));
    }
}
