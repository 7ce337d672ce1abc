//! A quantity along a rod.

/// A quantity along a rod: constant, or linear between knots given at
/// fractions sigma = s/L of the rod's length.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// The same value everywhere; may be infinite where the quantity allows it.
    Constant(f64),
    /// At least two knots: `at` rises strictly from 0 to 1; same length as `value`.
    Linear {
        /// Fractions of the length.
        at: Vec<f64>,
        /// Values at the knots, all finite.
        value: Vec<f64>,
    },
}

impl Profile {
    /// The value at the fraction `sigma` in [0, 1].
    pub fn at(&self, sigma: f64) -> f64 {
        match self {
            Profile::Constant(value) => *value,
            Profile::Linear { at, value } => {
                let right = at
                    .partition_point(|&knot| knot < sigma)
                    .clamp(1, at.len() - 1);
                let t = (sigma - at[right - 1]) / (at[right] - at[right - 1]);
                if t >= 1.0 {
                    // Next to a large value the sum below would lose a small one.
                    return value[right];
                }
                value[right - 1] + t.max(0.0) * (value[right] - value[right - 1])
            }
        }
    }

    /// The integral over fractions from 0 to `sigma` in [0, 1].
    pub fn integral(&self, sigma: f64) -> f64 {
        match self {
            Profile::Constant(value) => value * sigma,
            Profile::Linear { at, .. } => {
                let inside = at.iter().copied().filter(|&knot| knot < sigma);
                let mut knots: Vec<f64> = inside.collect();
                knots.push(sigma);
                knots
                    .windows(2)
                    .map(|w| (w[1] - w[0]) * self.at(0.5 * (w[0] + w[1])))
                    .sum()
            }
        }
    }

    /// Fractions strictly inside (0, 1) where the slope may jump.
    pub fn kinks(&self) -> &[f64] {
        match self {
            Profile::Constant(_) => &[],
            Profile::Linear { at, .. } => &at[1..at.len() - 1],
        }
    }

    /// The largest absolute value along the rod.
    pub fn max_abs(&self) -> f64 {
        self.values().iter().fold(0.0, |m, v| m.max(v.abs()))
    }

    /// The smallest value along the rod.
    pub fn min(&self) -> f64 {
        self.values().iter().fold(f64::INFINITY, |m, v| m.min(*v))
    }

    /// The same profile times a factor.
    pub fn scaled(&self, factor: f64) -> Profile {
        match self {
            Profile::Constant(value) => Profile::Constant(factor * value),
            Profile::Linear { at, value } => Profile::Linear {
                at: at.clone(),
                value: value.iter().map(|v| factor * v).collect(),
            },
        }
    }

    fn values(&self) -> &[f64] {
        match self {
            Profile::Constant(value) => std::slice::from_ref(value),
            Profile::Linear { value, .. } => value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tent() -> Profile {
        Profile::Linear {
            at: vec![0.0, 0.25, 1.0],
            value: vec![1.0, 3.0, -6.0],
        }
    }

    #[test]
    fn a_constant_is_the_same_everywhere() {
        let rigid = Profile::Constant(f64::INFINITY);
        assert_eq!(rigid.at(0.0), f64::INFINITY);
        assert_eq!(rigid.at(1.0), f64::INFINITY);
        assert!(rigid.kinks().is_empty());
        assert_eq!(Profile::Constant(-2.0).integral(0.25), -0.5);
        assert_eq!(Profile::Constant(-2.0).max_abs(), 2.0);
        assert_eq!(Profile::Constant(-2.0).min(), -2.0);
    }

    #[test]
    fn linear_between_knots_and_exact_at_them() {
        let tent = tent();
        let values = [
            (0.0, 1.0),
            (0.125, 2.0),
            (0.25, 3.0),
            (0.5, 0.0),
            (1.0, -6.0),
        ];
        for (sigma, value) in values {
            assert_eq!(tent.at(sigma), value, "at {sigma}");
        }
        for (sigma, integral) in [(0.0, 0.0), (0.125, 0.1875), (0.25, 0.5), (1.0, -0.625)] {
            assert_eq!(tent.integral(sigma), integral, "to {sigma}");
        }
        assert_eq!(tent.kinks(), [0.25]);
        assert_eq!(tent.max_abs(), 6.0);
        assert_eq!(tent.min(), -6.0);
    }

    #[test]
    fn a_small_value_at_a_knot_is_not_lost() {
        let steep = Profile::Linear {
            at: vec![0.0, 0.5, 1.0],
            value: vec![1e9, 1e-9, 1e9],
        };
        assert_eq!(steep.at(0.5), 1e-9);
    }

    #[test]
    fn beyond_the_ends_the_end_values_hold() {
        // A fraction may come out a rounding error outside [0, 1].
        assert_eq!(tent().at(-1e-17), 1.0);
        assert_eq!(tent().at(1.0 + 1e-15), -6.0);
    }
}
