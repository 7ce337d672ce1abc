//! The largest of several sizes, by which solvers decide.
//!
//! `f64::max` ignores what is not a number: an error, a correction or a residual that cannot be
//! computed would count as zero. Here it counts as infinite, so that it is neither within a
//! tolerance nor finite.

/// The larger of two sizes; infinite if one of them is not a number.
pub fn larger(a: f64, b: f64) -> f64 {
    match a.is_nan() || b.is_nan() {
        true => f64::INFINITY,
        false => a.max(b),
    }
}

/// The largest of all sizes, zero if there are none; infinite if one of them is not a number.
pub fn largest(sizes: impl IntoIterator<Item = f64>) -> f64 {
    sizes.into_iter().fold(0.0, larger)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_number_is_the_largest() {
        assert_eq!(largest([1.0, 3.0, 2.0]), 3.0);
        assert_eq!(largest([]), 0.0);
        for at in 0..3 {
            let mut sizes = [1.0, 3.0, 2.0];
            sizes[at] = f64::NAN;
            assert_eq!(largest(sizes), f64::INFINITY, "{at}");
        }
    }
}
