//! A quantity in time.

/// A quantity in time: linear between given times, constant before the first
/// and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule<T> {
    /// At least one time, strictly increasing.
    pub at: Vec<f64>,
    /// Values at these times; same length as `at`.
    pub value: Vec<T>,
}

impl<T> Schedule<T> {
    /// The same value at all times.
    pub fn constant(value: T) -> Self {
        Schedule {
            at: vec![0.0],
            value: vec![value],
        }
    }

    /// Whether the value is the same at all times.
    pub fn is_constant(&self) -> bool
    where
        T: PartialEq,
    {
        self.value.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// The time of a value that differs from both beside it, which are less than `width` apart.
    pub fn pulse_within(&self, width: f64) -> Option<f64>
    where
        T: PartialEq,
    {
        let mut inner = 1..self.at.len().saturating_sub(1);
        let pulse = inner.find(|&k| {
            let value = &self.value[k];
            let apart = *value != self.value[k - 1] && *value != self.value[k + 1];
            apart && self.at[k + 1] - self.at[k - 1] < width
        });
        pulse.map(|k| self.at[k])
    }

    /// The linear pieces of an interval: the middle of each, and its part of the interval.
    fn pieces(&self, from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
        let first = self.at.partition_point(|&known| known <= from);
        let last = self.at.partition_point(|&known| known < to).max(first);
        let inner = || self.at[first..last].iter().copied();
        let ends = inner().chain([to]);
        [from]
            .into_iter()
            .chain(inner())
            .zip(ends)
            .map(move |(a, b)| {
                let part = if to > from {
                    (b - a) / (to - from)
                } else {
                    1.0
                };
                (0.5 * (a + b), part)
            })
    }

    /// The values on both sides of `time`, and the fraction of the step between them.
    fn around(&self, time: f64) -> (&T, &T, f64) {
        let last = self.at.len() - 1;
        match self.at.partition_point(|&known| known <= time) {
            0 => (&self.value[0], &self.value[0], 0.0),
            after if after > last => (&self.value[last], &self.value[last], 0.0),
            after => {
                let (from, to) = (self.at[after - 1], self.at[after]);
                let fraction = (time - from) / (to - from);
                (&self.value[after - 1], &self.value[after], fraction)
            }
        }
    }
}

impl Schedule<f64> {
    /// The value at `time`.
    pub fn at(&self, time: f64) -> f64 {
        let (from, to, fraction) = self.around(time);
        between(*from, *to, fraction)
    }

    /// The mean over an interval, exact however short the pulses in it.
    pub fn mean(&self, from: f64, to: f64) -> f64 {
        let pieces = self.pieces(from, to);
        pieces.map(|(middle, part)| part * self.at(middle)).sum()
    }
}

impl Schedule<[f64; 3]> {
    /// The value at `time`.
    pub fn at(&self, time: f64) -> [f64; 3] {
        let (from, to, fraction) = self.around(time);
        std::array::from_fn(|axis| between(from[axis], to[axis], fraction))
    }

    /// The mean over an interval, exact however short the pulses in it.
    pub fn mean(&self, from: f64, to: f64) -> [f64; 3] {
        let pieces = self.pieces(from, to);
        pieces.fold([0.0; 3], |sum, (middle, part)| {
            let value = self.at(middle);
            std::array::from_fn(|axis| sum[axis] + part * value[axis])
        })
    }
}

fn between(from: f64, to: f64, fraction: f64) -> f64 {
    from + fraction * (to - from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule<T: Copy>(at: &[f64], value: &[T]) -> Schedule<T> {
        let (at, value) = (at.to_vec(), value.to_vec());
        Schedule { at, value }
    }

    /// A force that changes from time 0 to 2.
    fn sloping() -> Schedule<[f64; 3]> {
        schedule(&[0.0, 2.0], &[[0.0, 1.0, 0.0], [4.0, 1.0, -2.0]])
    }

    #[test]
    fn linear_between_times_exact_at_them_and_constant_outside() {
        let factor = schedule(&[-1.0, 0.5, 0.7], &[1.0, 4.0, 0.1]);
        let values = [-1e9, -1.0, 0.0, 0.5, 0.7, 1e9].map(|time| factor.at(time));
        assert_eq!(values, [1.0, 1.0, 3.0, 4.0, 0.1, 0.1]);
        assert_eq!(sloping().at(0.5), [1.0, 1.0, -0.5]);
        assert!(!factor.is_constant());
    }

    #[test]
    fn means_see_every_pulse() {
        let pulse = schedule(&[0.5, 0.5 + 1e-6, 0.5 + 4e-6], &[0.0, 3e6, 0.0]);
        assert!((pulse.mean(0.0, 2.0) - 3.0).abs() < 1e-9);
        assert!((pulse.mean(0.0, 0.5 + 1e-6) - 3.0).abs() < 1e-5);
        assert_eq!(pulse.mean(0.6, 0.9), 0.0);
        let slope = sloping();
        assert_eq!(slope.mean(0.25, 0.75), slope.at(0.5));
        assert_eq!(slope.mean(0.5, 0.5), slope.at(0.5));
        assert_eq!(slope.mean(1.0, 3.0), [3.5, 1.0, -1.75]);
    }

    #[test]
    fn equal_values_are_constant_however_many() {
        for still in [schedule(&[0.0, 1.0], &[0.3, 0.3]), Schedule::constant(0.3)] {
            assert!(still.is_constant());
            let times = [f64::NEG_INFINITY, -1.0, 0.0, 0.7, 1e300, f64::INFINITY];
            assert_eq!(times.map(|time| still.at(time)), [0.3; 6]);
        }
    }
}
