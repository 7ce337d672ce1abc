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
                value[right - 1] + t.clamp(0.0, 1.0) * (value[right] - value[right - 1])
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

    fn values(&self) -> &[f64] {
        match self {
            Profile::Constant(value) => std::slice::from_ref(value),
            Profile::Linear { value, .. } => value,
        }
    }
}
