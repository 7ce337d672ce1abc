//! Numbers as such: their text for people, the largest of several sizes, sorted lists, and the rule
//! of quadrature.
//!
//! `f64::max` ignores what is not a number: an error, a correction or a residual that cannot be
//! computed would count as zero. In [`larger`] and [`largest`] it counts as infinite, so that it is
//! neither within a tolerance nor finite.

/// Formats an upper bound with two digits, rounded up so that it stays a bound, as in
/// `3.1×10⁻⁹`.
pub fn format_error_bound(bound: f64) -> String {
    if !bound.is_finite() {
        return "∞".into();
    }
    if bound < f64::MIN_POSITIVE {
        return "0".into();
    }
    let mut exponent = bound.log10().floor() as i32;
    // Tolerates rounding: 3.0000000000000004 must not yield 3.1.
    let mut tenths = (bound / 10f64.powi(exponent) * 10.0 * (1.0 - 1e-12)).ceil();
    if tenths >= 100.0 {
        tenths /= 10.0;
        exponent += 1;
    }
    let mantissa = tenths / 10.0;
    format!("{mantissa:.1}×10{}", superscript(exponent))
}

/// A number with two digits, as in `0.87`, `2100` and `2.8×10⁷`; 0 as it is.
pub fn format_two_digits(number: f64) -> String {
    if number == 0.0 {
        return "0".into();
    }
    let rounded = format!("{number:.1e}");
    match rounded.split_once('e') {
        Some((digits, power)) if !(1e-3..1e4).contains(&number.abs()) => match power.parse() {
            Ok(power) => format!("{digits}×10{}", superscript(power)),
            Err(_) => rounded,
        },
        _ => rounded.parse::<f64>().unwrap_or(number).to_string(),
    }
}

/// An exponent as a superscript, as in `⁻⁹`.
pub fn superscript(exponent: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    exponent.to_string().chars().map(raised).collect()
}

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

/// Numbers in ascending order, each once.
pub(crate) fn sorted_distinct(numbers: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut numbers: Vec<f64> = numbers.into_iter().collect();
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    numbers
}

/// A point of a rule of quadrature on (0, 1).
pub(crate) struct QuadraturePoint {
    pub at: f64,
    pub weight: f64,
}

/// The Gauss-Legendre rule of five points, exact for polynomials up to degree 9.
pub(crate) const GAUSS_LEGENDRE_RULE: [QuadraturePoint; 5] = {
    const fn point(at: f64, weight: f64) -> QuadraturePoint {
        QuadraturePoint { at, weight }
    }
    [
        point(0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
        point(0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
        point(0.5, 0.284_444_444_444_444_44),
        point(0.769_234_655_052_841_6, 0.239_314_335_249_683_23),
        point(0.953_089_922_969_332, 0.118_463_442_528_094_54),
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_rounded_up() {
        let bounds = [3.01e-9, 9.99e-12, 2.0, 3e-9, f64::INFINITY, 0.0].map(format_error_bound);
        let wanted = ["3.1×10⁻⁹", "1.0×10⁻¹¹", "2.0×10⁰", "3.0×10⁻⁹", "∞", "0"];
        assert_eq!(bounds, wanted);
    }

    #[test]
    fn two_digits_are_rounded_to_the_nearest() {
        let numbers =
            [0.8749, 2149.0, 28_400_000.0, 0.099_9, 9999.0, 3e-7, -12.0].map(format_two_digits);
        let wanted = ["0.87", "2100", "2.8×10⁷", "0.1", "10000", "3.0×10⁻⁷", "-12"];
        assert_eq!(numbers, wanted);
        assert_eq!(format_two_digits(f64::INFINITY), "inf");
        assert_eq!(format_two_digits(0.0), "0");
    }
}

#[cfg(test)]
mod largest_tests {
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
