//! The last few of what takes long to make.

use std::collections::VecDeque;

/// Values by their keys, at most so many: those that were needed last.
pub struct Recent<K, V, const MOST: usize>(VecDeque<(K, V)>);

impl<K, V, const MOST: usize> Default for Recent<K, V, MOST> {
    fn default() -> Self {
        Recent(VecDeque::new())
    }
}

impl<K: Copy + PartialEq, V, const MOST: usize> Recent<K, V, MOST> {
    /// The value of a key, made if it is not among them.
    ///
    /// # Errors
    /// Those of making it.
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

    /// Others with the same keys.
    pub fn map(&self, other: impl Fn(&V) -> V) -> Self {
        let values = self.0.iter();
        Recent(values.map(|(key, value)| (*key, other(value))).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_needed_last_is_not_made_again() {
        let mut recent = Recent::<i32, i32, 2>::default();
        let mut made = Vec::new();
        for key in [1, 2, 1, 3, 1, 2] {
            let value = recent.at(key, || {
                made.push(key);
                Ok::<_, ()>(10 * key)
            });
            assert_eq!(value, Ok(&(10 * key)));
        }
        assert_eq!(made, [1, 2, 3, 2]);
        assert_eq!(recent.at(4, || Err("none")), Err("none"));
    }
}
