//! Formats numbers for people.

/// Formats an upper bound with two digits, rounded up so that it stays a bound, as in
/// `3.1×10⁻⁹`.
pub fn power_of_ten(bound: f64) -> String {
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

/// A positive number with two digits, as in `0.87`, `2100` and `2.8×10⁷`.
pub fn two_digits(number: f64) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_rounded_up() {
        let bounds = [3.01e-9, 9.99e-12, 2.0, 3e-9, f64::INFINITY, 0.0].map(power_of_ten);
        let wanted = ["3.1×10⁻⁹", "1.0×10⁻¹¹", "2.0×10⁰", "3.0×10⁻⁹", "∞", "0"];
        assert_eq!(bounds, wanted);
    }

    #[test]
    fn two_digits_are_rounded_to_the_nearest() {
        let numbers = [0.8749, 2149.0, 28_400_000.0, 0.099_9, 9999.0, 3e-7, -12.0].map(two_digits);
        let wanted = ["0.87", "2100", "2.8×10⁷", "0.1", "10000", "3.0×10⁻⁷", "-12"];
        assert_eq!(numbers, wanted);
        assert_eq!(two_digits(f64::INFINITY), "inf");
    }
}
