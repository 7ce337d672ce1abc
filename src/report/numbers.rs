//! Formats numbers for people, together with [`crate::numbers`]; nothing else does.

pub use crate::numbers::{power_of_ten, superscript};
use crate::relax::Equilibrium;

/// Digits shown after the first for a result without an error estimate.
const DIGITS: i32 = 9;

/// The number of veins, and whether their tips are joined.
pub fn veins(equilibrium: &Equilibrium) -> String {
    veins_of(equilibrium.shape.rods.len(), equilibrium.shape.joined)
}

/// The same for any leaf.
pub fn veins_of(count: usize, joined: bool) -> String {
    let tips = match joined {
        _ if count == 1 => "",
        true => " joined at the tip",
        false => " with free tips",
    };
    number_of_veins(count) + tips
}

/// As in `5 veins`.
pub fn number_of_veins(count: usize) -> String {
    counted(count, "vein", "veins")
}

/// A number of things, as `one` or `many` of them are called.
pub fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The number of negative eigenvalues in brackets, if known.
pub fn eigenvalues(count: Option<usize>) -> String {
    let count = count.map(|it| counted(it, "negative eigenvalue", "negative eigenvalues"));
    count.map_or(String::new(), |count| format!(" ({count})"))
}

/// The grids of a relaxation.
pub fn grids(equilibrium: &Equilibrium) -> String {
    let grids = equilibrium.accuracy.segments.iter();
    let grids: Vec<String> = grids.map(usize::to_string).collect();
    match grids.as_slice() {
        [only] => format!("a grid of {only} segments a vein"),
        _ => format!("grids of {} segments a vein", grids.join(", ")),
    }
}

/// An upper bound; zero means up to rounding.
pub fn bound(bound: f64) -> String {
    match bound {
        0.0 => "rounding".into(),
        bound => power_of_ten(bound),
    }
}

/// A time in milliseconds or seconds.
pub fn seconds(time: f64) -> String {
    match time {
        time if time < 1.0 => format!("{:.2} ms", 1e3 * time),
        time => format!("{time:.2} s"),
    }
}

/// The number of decimals of a position that its error leaves, and one more.
pub fn decimals(equilibrium: &Equilibrium) -> usize {
    let relative = 10f64.powi(-DIGITS) * equilibrium.shape.longest();
    let error = equilibrium.accuracy.error_estimate;
    let error = error.unwrap_or(relative).max(1e-16);
    (1.0 - error.log10().ceil()).clamp(0.0, 15.0) as usize
}

/// A position with `decimals` decimals.
pub fn point(point: [f64; 3], decimals: usize) -> String {
    let unit = 0.5 * 10f64.powi(-(decimals as i32));
    // Avoids -0.000.
    let positive_zero = |value: f64| if value.abs() < unit { 0.0 } else { value };
    let [x, y, z] = point.map(|value| format!("{:.decimals$}", positive_zero(value)));
    format!("({x}, {y}, {z})")
}

/// A number with ten significant digits.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..DIGITS).contains(&exponent) {
        return format!("{value:.*e}", DIGITS as usize);
    }
    format!("{value:.*}", (DIGITS - exponent) as usize)
}

/// A number with at most five digits.
pub fn brief(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (1e-3..1e5).contains(&size) => {
            let decimals = (4 - size.log10().floor() as i32).max(0) as usize;
            without_trailing_zeros(&format!("{value:.decimals$}")).into()
        }
        _ => match format!("{value:.4e}").split_once('e') {
            Some((digits, power)) => format!("{}e{power}", without_trailing_zeros(digits)),
            None => value.to_string(),
        },
    }
}

/// A number with at most four digits, for figures.
pub fn short(value: f64) -> String {
    let minus = minus(value);
    let size = value.abs();
    if size.is_nan() || size.is_infinite() {
        return "∞".into();
    }
    if size < f64::MIN_POSITIVE {
        return "0".into();
    }
    let exponent = size.log10().floor() as i32;
    if !(-3..6).contains(&exponent) {
        let mantissa = size / 10f64.powi(exponent);
        return format!("{minus}{mantissa:.2}×10{}", superscript(exponent));
    }
    let decimals = (3 - exponent).max(0) as usize;
    let digits = format!("{size:.decimals$}");
    format!("{minus}{}", without_trailing_zeros(&digits))
}

/// A number with `decimals` decimals, for axes.
pub fn fixed(value: f64, decimals: usize) -> String {
    format!("{}{:.decimals$}", minus(value), value.abs())
}

/// The minus sign (U+2212) of negative values.
fn minus(value: f64) -> &'static str {
    if value < 0.0 { "\u{2212}" } else { "" }
}

/// A power of ten of this sign, as in `10⁻³`.
pub fn decade(sign: f64, power: i32) -> String {
    format!("{}10{}", minus(sign), superscript(power))
}

/// A digit times a power of ten, as a plain number where that is short.
pub fn digit_of_decade(digit: f64, power: i32) -> String {
    let (minus, digit) = (minus(digit), digit.abs());
    match power {
        -3..=3 => format!("{minus}{}", digit * 10f64.powi(power)),
        _ => format!("{minus}{digit}×10{}", superscript(power)),
    }
}

/// A digit times a power of ten seconds, as in `20 ms`.
pub fn time_of_decade(digit: f64, power: i32) -> String {
    let (power, unit) = match power {
        ..=-1 => (power + 3, "ms"),
        _ => (power, "s"),
    };
    let decimals = (-power).max(0) as usize;
    format!("{:.decimals$} {unit}", digit * 10f64.powi(power))
}

fn without_trailing_zeros(digits: &str) -> &str {
    match digits.contains('.') {
        true => digits.trim_end_matches('0').trim_end_matches('.'),
        false => digits,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_ten_digits() {
        assert_eq!(significant(11.069189708218), "11.06918971");
        assert_eq!(significant(-0.00123), "-0.001230000000");
        assert_eq!(significant(1.5e-30), "1.500000000e-30");
        assert_eq!(significant(f64::NAN), "NaN");
    }

    #[test]
    fn brief_numbers_have_five() {
        assert_eq!(brief(0.6000000000000001), "0.6");
        assert_eq!(brief(-1234.567), "-1234.6");
        assert_eq!(brief(12.0), "12");
        assert_eq!(brief(3e-9 / 7.0), "4.2857e-10");
        assert_eq!(brief(3e-5), "3e-5");
        assert_eq!(brief(20000.0), "20000");
        assert_eq!(brief(f64::NAN), "NaN");
        assert_eq!(brief(0.0), "0");
    }

    #[test]
    fn points_have_no_negative_zero() {
        assert_eq!(point([1.0, -4e-4, -0.25], 3), "(1.000, 0.000, -0.250)");
    }

    #[test]
    fn times_are_readable() {
        assert_eq!(seconds(0.00123), "1.23 ms");
        assert_eq!(seconds(12.0), "12.00 s");
    }

    #[test]
    fn numbers_in_figures_have_few_digits() {
        assert_eq!(short(0.0), "0");
        assert_eq!(short(-0.123456), "\u{2212}0.1235");
        assert_eq!(short(1234.56), "1235");
        assert_eq!(short(0.7), "0.7");
        assert_eq!(short(120.0), "120");
        assert_eq!(short(2.5e-9), "2.50×10⁻⁹");
        assert_eq!(short(f64::NAN), "∞");
        assert_eq!(fixed(-0.25, 1), "\u{2212}0.2");
        assert_eq!(decade(-1.0, -3), "\u{2212}10⁻³");
        assert_eq!(digit_of_decade(-2.0, -1), "\u{2212}0.2");
        assert_eq!(digit_of_decade(5.0, 6), "5×10⁶");
        let times = [-5, -4, -3, -1, 0, 2].map(|power| time_of_decade(1.0, power));
        let wanted = ["0.01 ms", "0.1 ms", "1 ms", "100 ms", "1 s", "100 s"];
        assert_eq!(times, wanted);
    }
}
