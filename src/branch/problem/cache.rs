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
    /// The value of a key, computed by `make` if it is not cached; this takes the value that was
    /// used last.
    pub fn at<E>(
        &mut self,
        key: K,
        make: impl FnOnce(Option<&V>) -> Result<V, E>,
    ) -> Result<&V, E> {
        let known = self.0.iter().position(|(other, _)| *other == key);
        let found = match known.and_then(|index| self.0.remove(index)) {
            Some((_, value)) => value,
            None => make(self.0.front().map(|(_, value)| value))?,
        };
        self.0.truncate(MOST - 1);
        self.0.push_front((key, found));
        Ok(&self.0[0].1)
    }

    /// Values derived from these, under the same keys; `other` takes the one made before, too.
    pub fn map(&self, other: impl Fn(Option<&V>, &V) -> V) -> Self {
        let mut mapped = VecDeque::with_capacity(self.0.len());
        for (key, value) in &self.0 {
            let made = other(mapped.back().map(|(_, before)| before), value);
            mapped.push_back((*key, made));
        }
        LruCache(mapped)
    }
}

/// Number of cached patterns: five grids, bordered and unbordered.
const CACHED_SYSTEMS: usize = 10;

/// Cache of sparsity patterns. All leaves of a family have the same pattern on grids with
/// equally many segments, and ordering it takes as long as factorising a matrix.
#[derive(Default)]
pub struct Patterns(Mutex<LruCache<Shape, Arc<DirectSolver>, CACHED_SYSTEMS>>);

/// What determines the pattern of a system: its segments, whether its rods are coupled, and
/// the number of border rows.
type Shape = (usize, bool, usize);

impl Patterns {
    /// The pattern of a system with `border` border rows; `None` if memory is short.
    pub fn of(&self, system: &System, border: usize) -> Option<Arc<DirectSolver>> {
        let shape = (system.segments(), system.coupled(), border);
        let mut cache = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let made = |_: Option<&_>| DirectSolver::bordered(system, border).map(Arc::new);
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
            let value = lru_cache.at(key, |_| {
                made.push(key);
                Ok::<_, ()>(10 * key)
            });
            assert_eq!(value, Ok(&(10 * key)));
        }
        assert_eq!(made, [1, 2, 3, 2]);
        assert_eq!(lru_cache.at(4, |_| Err("none")), Err("none"));
    }
}
