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
}

impl Schedule<[f64; 3]> {
    /// The value at `time`.
    pub fn at(&self, time: f64) -> [f64; 3] {
        let (from, to, fraction) = self.around(time);
        std::array::from_fn(|axis| between(from[axis], to[axis], fraction))
    }
}

fn between(from: f64, to: f64, fraction: f64) -> f64 {
    from + fraction * (to - from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_between_times_exact_at_them_and_constant_outside() {
        let factor = Schedule {
            at: vec![-1.0, 0.5, 0.7],
            value: vec![1.0, 4.0, 0.1],
        };
        let values = [-1e9, -1.0, 0.0, 0.5, 0.7, 1e9].map(|time| factor.at(time));
        assert_eq!(values, [1.0, 1.0, 3.0, 4.0, 0.1, 0.1]);
        let force = Schedule {
            at: vec![0.0, 2.0],
            value: vec![[0.0, 1.0, 0.0], [4.0, 1.0, -2.0]],
        };
        assert_eq!(force.at(0.5), [1.0, 1.0, -0.5]);
        assert!(!factor.is_constant());
    }

    #[test]
    fn equal_values_are_constant_however_many() {
        let still = Schedule {
            at: vec![0.0, 1.0],
            value: vec![0.3, 0.3],
        };
        for still in [still, Schedule::constant(0.3)] {
            assert!(still.is_constant());
            let times = [f64::NEG_INFINITY, -1.0, 0.0, 0.7, 1e300, f64::INFINITY];
            assert_eq!(times.map(|time| still.at(time)), [0.3; 6]);
        }
    }
}
